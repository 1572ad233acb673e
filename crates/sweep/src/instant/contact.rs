//! The contact problem of `sweep solve` in JSON.

use sd_core::contact::{Laws, PairForces, Surface};
use sd_core::instant::InstantContacts;
use sd_core::{ContactLaws, Hydrodynamics, Space};
use serde::Deserialize;

/// Most pairs listed.
const PAIR_LIMIT: usize = 1_000_000;

/// Names of the contact problems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Scheme {
    None,
    Listed,
    Rigid,
    Procedure,
    /// Laws chosen one by one.
    Laws,
}

/// A contact problem in JSON. Which values belong to which scheme is checked afterwards: an enum
/// tagged by `scheme` would accept unknown keys of `none`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub(super) struct Contact<S: Space> {
    scheme: Scheme,
    /// Pairs of `listed`.
    pairs: Option<Vec<[usize; 2]>>,
    roughness: Option<f64>,
    friction: Option<f64>,
    /// Critical load.
    critical_load: Option<f64>,
    /// Time span of the rigid scheme and of laws.
    time_span: Option<f64>,
    /// The laws, in units of the critical load.
    laws: Option<ContactLaws>,
    /// Pairs, and the forces of their tangential springs.
    springs: Option<Vec<Spring<S::Tangent>>>,
    /// Pairs, and the forces of their springs of rolling friction.
    rolling_springs: Option<Vec<Spring<S::Tangent>>>,
}

/// A tangential spring in JSON: spheres and force.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(expecting = "a spring is [i, j, force]")]
struct Spring<T>(u32, u32, T);

impl<S: Space> Contact<S> {
    /// The contact problem, or the value that is not part of it and what is allowed.
    pub(super) fn request(
        self,
        hydrodynamics: Hydrodynamics,
    ) -> Result<InstantContacts<S>, (&'static str, String)> {
        let scheme = self.scheme;
        // Which schemes have each value.
        let surfaces = [Scheme::Rigid, Scheme::Procedure, Scheme::Laws];
        let (laws, springs) = (self.laws.is_some(), self.springs.is_some());
        let rolling_springs = self.rolling_springs.is_some();
        let given = [
            ("contact.laws", laws, &[Scheme::Laws][..]),
            ("contact.springs", springs, &[Scheme::Laws]),
            ("contact.rolling_springs", rolling_springs, &[Scheme::Laws]),
            ("contact.roughness", self.roughness.is_some(), &surfaces),
            ("contact.friction", self.friction.is_some(), &surfaces),
            (
                "contact.critical_load",
                self.critical_load.is_some(),
                &surfaces,
            ),
            ("contact.pairs", self.pairs.is_some(), &[Scheme::Listed]),
            (
                "contact.time_span",
                self.time_span.is_some(),
                &[Scheme::Rigid, Scheme::Laws],
            ),
        ];
        let mut given = given.into_iter();
        if let Some((name, ..)) = given.find(|(_, is, of)| *is && !of.contains(&scheme)) {
            let words = format!("does not belong to scheme {scheme:?}");
            return Err((name, words.to_lowercase()));
        }
        let need = |name: &'static str, value: Option<f64>| match value {
            Some(value) if value >= 0.0 => Ok(value),
            Some(value) => Err((name, format!("{value} is out of range: not negative"))),
            None => Err((name, format!("scheme {scheme:?} needs it").to_lowercase())),
        };
        match scheme {
            Scheme::None => Ok(InstantContacts::None),
            Scheme::Listed => {
                let pairs = self
                    .pairs
                    .ok_or(("contact.pairs", "scheme listed needs it".into()))?;
                if pairs.len() > PAIR_LIMIT {
                    return Err(("contact.pairs", format!("at most {PAIR_LIMIT} pairs")));
                }
                Ok(InstantContacts::HeldPairs { pairs })
            }
            Scheme::Rigid | Scheme::Procedure | Scheme::Laws => {
                let roughness = need("contact.roughness", self.roughness)?;
                let friction = need("contact.friction", self.friction)?;
                let critical_load = need("contact.critical_load", self.critical_load)?;
                let surface = Surface {
                    roughness,
                    friction,
                    critical_load,
                };
                if scheme == Scheme::Procedure {
                    if S::DIMENSIONS > 2 {
                        return Err((
                            "contact.scheme",
                            "\"procedure\" is a protocol of layers, whose steps the paper states for spheres in a plane: \"rigid\" or \
                             \"laws\" in a suspension"
                                .into(),
                        ));
                    }
                    return Ok(InstantContacts::Procedure { surface });
                }
                let time_span = self.time_span.unwrap_or(0.005);
                if time_span <= 0.0 {
                    return Err((
                        "contact.time_span",
                        format!("{time_span} is out of range: above 0"),
                    ));
                }
                if scheme == Scheme::Rigid {
                    return Ok(InstantContacts::under(Laws::rigid(surface), time_span));
                }
                self.laws(surface, hydrodynamics, time_span)
            }
        }
    }

    /// The contact problem of laws chosen one by one.
    fn laws(
        self,
        surface: Surface,
        hydrodynamics: Hydrodynamics,
        time_span: f64,
    ) -> Result<InstantContacts<S>, (&'static str, String)> {
        let laws = self
            .laws
            .ok_or(("contact.laws", "scheme laws needs it".into()))?;
        laws.validate(&surface, hydrodynamics)
            .map_err(|error| ("contact.laws", error.to_string()))?;
        Ok(InstantContacts::Laws {
            lubrication_gap: laws.lubrication_gap,
            laws: Laws::new(&laws, surface),
            time_span,
            springs: forces("contact.springs", self.springs)?,
            rolling_springs: forces("contact.rolling_springs", self.rolling_springs)?,
        })
    }
}

/// The forces of springs, ordered by pair.
fn forces<S: Space>(
    name: &'static str,
    springs: Option<Vec<Spring<S::Tangent>>>,
) -> Result<PairForces<S>, (&'static str, String)> {
    let springs = springs.unwrap_or_default();
    if springs.len() > PAIR_LIMIT {
        return Err((name, format!("at most {PAIR_LIMIT} pairs")));
    }
    if let Some(Spring(i, j, _)) = springs.iter().find(|spring| spring.0 >= spring.1) {
        return Err((
            name,
            format!("pairs are [i, j, …] with i < j, not [{i}, {j}, …]"),
        ));
    }
    let forces = springs.into_iter();
    Ok(forces.map(|Spring(i, j, force)| (i, j, force)).collect())
}
