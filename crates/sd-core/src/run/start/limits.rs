//! Layers and suspensions that no run can begin with, refused before they are made.

use super::first_cell::{fraction_of, radii_and_side};
use super::given::fit;
use super::packing::{DISCS, SPHERES};
use crate::error::Error;
use crate::model::{Keywords as _, Params, Refusal, StartFrom};
use crate::space::cell::LUBRICATION_RANGE;
use crate::stage::Method;

/// Volume fraction that equal spheres at random do not exceed: random close packing has 0.64. A
/// hundred spheres with a roughness of 0.01 were packed at 0.62, but not at 0.63.
const CLOSEST_AT_RANDOM: f64 = 0.645;

/// Area fraction up to which equal hard discs in equilibrium are a fluid (Bernard & Krauth, Phys.
/// Rev. Lett. 107, 155704, 2011).
const FREEZING_OF_DISCS: f64 = 0.700;

/// Volume fraction up to which equal hard spheres in equilibrium are a fluid (Hoover & Ree, J.
/// Chem. Phys. 49, 3609, 1968).
const FREEZING_OF_SPHERES: f64 = 0.494;

/// Refuses impossible layers and suspensions without making one.
///
/// Those that pass may still fail to pack: see [`layer`](super::layer) and
/// [`suspension`](super::suspension).
///
/// # Errors
/// [`Error::Refused`] about the number of spheres or their fraction, with what is allowed.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
///
/// ```
/// use sd_core::start;
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
///
/// start::check(&params)?;
/// // A cell of ten spheres is too small for the range of lubrication.
/// let few = Params { spheres: 10, ..params };
/// assert!(start::check(&few).unwrap_err().to_string().contains("at least"));
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn check(params: &Params) -> Result<(), Error> {
    let method = Method::of(params);
    let most = method.most_spheres(params.hydrodynamics);
    if params.spheres > most {
        let word = params.hydrodynamics.word();
        let (problem, because) = match method {
            Method::Dense => (
                format!(
                    "is out of range under {word} with the paper's procedure, which takes full matrices"
                ),
                "contact",
            ),
            Method::Pairwise | Method::Iterated => {
                (format!("is out of range under {word}"), "hydrodynamics")
            }
        };
        return Err(Refusal {
            key: "spheres",
            value: params.spheres.to_string(),
            problem,
            allowed: format!("at most {most} there"),
            because: Some(because),
        }
        .into());
    }
    if params.given_layer().is_none() {
        check_density(params)?;
    }
    let (shape, side, needed) = match radii_and_side(params) {
        Ok((radii, _)) => {
            check_cutoff(params, &radii)?;
            return match params.given_layer() {
                Some(given) => fit(given, params).map(|_| ()),
                None => Ok(()),
            };
        }
        Err(Error::CellTooSmall { side, needed, .. }) => {
            let shape = if params.imposes_pressure() {
                format!("a cell that a pressure may shrink to a width of {side:.3}")
            } else {
                format!("a cell {side:.3} wide")
            };
            (shape, side, needed)
        }
        Err(Error::LatticeTooShort { shortest, needed }) => (
            format!("a lattice whose shortest vector is {shortest:.3} at times in this `flow`"),
            shortest,
            needed,
        ),
        Err(other) => return Err(other),
    };
    let (key, kind, fraction, power) = fraction_of(params);
    let sizes = match &params.sizes {
        Some(sizes) => Some(("sizes", sizes.to_string())),
        None if params.size_ratio > 1.0 => Some(("size_ratio", params.size_ratio.to_string())),
        None => None,
    };
    let of_sizes = sizes.as_ref().map_or_else(String::new, |(key, value)| {
        format!(" and `{key}` = {value}")
    });
    let (range, model) = match params.hydrodynamics.leading_order() {
        Some(numbers) if power == 3 => (
            2.0 + numbers.cutoff,
            format!("`lubrication_cutoff` = {}", numbers.cutoff),
        ),
        _ => (
            LUBRICATION_RANGE,
            format!("`hydrodynamics` = {:?}", params.hydrodynamics.word()),
        ),
    };
    Err(Refusal {
        key: "spheres",
        value: params.spheres.to_string(),
        problem: format!(
            "at `{key}` = {fraction}{of_sizes} make {shape}, less than {needed:.3}, twice the range of pairs under {model}, \
             which is {range} radii of the largest sphere"
        ),
        allowed: if params.imposes_pressure() {
            format!("at least {} spheres", least_spheres(params, side, needed))
        } else {
            format!(
                "at least {} spheres at this {kind} fraction, or {} {kind} fraction of at most {:.3}",
                least_spheres(params, side, needed),
                if power == 2 { "an" } else { "a" },
                fraction * (side / needed).powi(power)
            )
        },
        because: Some(sizes.map_or(key, |(key, _)| key)),
    }
    .into())
}

/// Refuses a suspension whose pairs are listed only when their asperities overlap: contacts act
/// between pairs within the cutoff of lubrication.
pub(in crate::run) fn check_cutoff(params: &Params, radii: &[f64]) -> Result<(), Error> {
    let (Some(numbers), Some(_)) = (params.hydrodynamics.leading_order(), params.volume_fraction)
    else {
        return Ok(());
    };
    let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
    let (range, most) = (
        params.contact.laws().hydrodynamic_friction_range,
        numbers.cutoff * smallest,
    );
    if range > most {
        return Err(Refusal {
            key: "hydrodynamic_friction_range",
            value: range.to_string(),
            problem: "reaches beyond the pairs that `lubrication_cutoff` leaves".into(),
            allowed: format!(
                "at most {most:.4}, the cutoff times the radius of the smallest spheres"
            ),
            because: Some("lubrication_cutoff"),
        }
        .into());
    }
    let least = (params.roughness + params.time_step) / smallest;
    if numbers.cutoff >= least {
        return Ok(());
    }
    Err(Refusal {
        key: "lubrication_cutoff",
        value: numbers.cutoff.to_string(),
        problem: format!(
            "ends before spheres of `roughness` = {} touch, and pairs beyond it have no contacts",
            params.roughness
        ),
        allowed: format!(
            "at least {least:.4}, the roughness and the strain of a step over the radius of the smallest spheres"
        ),
        because: Some("roughness"),
    }
    .into())
}

/// The fraction above which equal spheres of this roughness in equilibrium are no fluid, if the run
/// begins with such spheres and has a larger one: moves from a packing then end before crystals
/// are in equilibrium with it.
pub fn freezing_exceeded(params: &Params) -> Option<f64> {
    let (.., fraction, power) = fraction_of(params);
    let freezing = if power == 2 {
        FREEZING_OF_DISCS
    } else {
        FREEZING_OF_SPHERES
    };
    let freezing = freezing / (1.0 + 0.5 * params.roughness).powi(power);
    let begins_so = params.start == Some(StartFrom::Equilibrium) && !params.is_mixed();
    (begins_so && fraction > freezing).then_some(freezing)
}

/// Refuses spheres that, with their roughness, exceed the packing limit.
pub(super) fn check_density(params: &Params) -> Result<(), Error> {
    let (key, _, fraction, power) = fraction_of(params);
    let growth = (1.0 + 0.5 * params.roughness).powi(power);
    let (name, closest, more) = match power {
        2 => ("layer", DISCS.closest, ""),
        _ => (
            "suspension",
            if params.is_mixed() {
                SPHERES.closest
            } else {
                CLOSEST_AT_RANDOM
            },
            "; random starts reach about 0.60, of sizes 1 : 1.4 about 0.62",
        ),
    };
    if fraction * growth <= closest {
        return Ok(());
    }
    Err(Refusal {
        key,
        value: fraction.to_string(),
        problem: format!(
            "is denser than any {name} that starts without contact at `roughness` = {}",
            params.roughness
        ),
        allowed: format!("at most {:.3} at this roughness{more}", closest / growth),
        because: Some("roughness"),
    }
    .into())
}

/// The number of spheres that make a cell of width `needed`, where the present number makes one of
/// width `side`. The largest of more spheres may be larger.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of spheres; a cast saturates"
)]
fn least_spheres(params: &Params, mut side: f64, mut needed: f64) -> usize {
    let (.., power) = fraction_of(params);
    let mut more = params.clone();
    while more.spheres < Params::MAX_SPHERES {
        let wanted = (more.spheres as f64 * (needed / side).powi(power)).ceil() as usize;
        more.spheres = wanted.max(more.spheres + 1);
        match radii_and_side(&more) {
            Err(
                Error::CellTooSmall {
                    side: wide,
                    needed: least,
                    ..
                }
                | Error::LatticeTooShort {
                    shortest: wide,
                    needed: least,
                },
            ) => (side, needed) = (wide, least),
            _ => break,
        }
    }
    more.spheres
}
