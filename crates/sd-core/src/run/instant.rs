//! One instant of one configuration: velocities, stresslets, contact forces.

use crate::contact::laws::{Laws, Span};
use crate::contact::memory::PairForces;
use crate::contact::springs::Springs;
use crate::contact::{Contact, ContactMemory, Pass};
use crate::error::Error;
use crate::hydrodynamics::resistance::NearFields;
use crate::model::Surface;
use crate::model::{ContactScheme, DEEPEST_OVERLAP, Hydrodynamics, Params};
use crate::procedure::ContactList;
use crate::space::cell::Cell;
use crate::space::modes::{Background, Vec2, strain_tensor};
use crate::stage::{Contact as StageContact, Method, StageSolver};
use crate::stress::{Stress, StressWork};
use nalgebra::Vector3;

/// Spheres, where they are and what drives them.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// Centres, in a.
    pub centres: Vec<Vec2>,
    /// Radii, in a; one per centre.
    pub radii: Vec<f64>,
    /// Periodic cell or unbounded fluid.
    pub cell: Cell,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Imposed flow.
    pub background: Background,
    /// External forces, in mu·a²·rate; one per centre.
    pub forces: Vec<Vec2>,
    /// External torques, in mu·a³·rate; one per centre.
    pub torques: Vec<f64>,
}

/// The contact problem that is to be solved.
#[derive(Debug, Clone)]
pub enum ContactRequest {
    /// No contact.
    None,
    /// These pairs are halted all at once by eqs. (12)-(13), without friction; negative forces are set to zero afterwards.
    Listed {
        /// Pairs of sphere numbers.
        pairs: Vec<[usize; 2]>,
    },
    /// The paper's procedure; every approaching pair with gap ≤ roughness counts as listed.
    Procedure {
        /// Roughness and friction.
        surface: Surface,
    },
    /// Laws; springs are as long as the gaps say.
    Laws {
        /// The laws, in the units of the solver.
        laws: Laws,
        /// Gap below which lubrication is held constant, in a; 0: nowhere, and surfaces may not overlap unless the hydrodynamics admit it.
        lubrication_gap: f64,
        /// How far contact forces look ahead, in strain.
        time_span: f64,
        /// Forces of the tangential springs; others are unstretched.
        springs: PairForces,
        /// The same of rolling friction.
        rolling_springs: PairForces,
    },
}

impl ContactRequest {
    /// The paper's rigid contacts, looking ahead by `time_span`, in strain.
    pub fn rigid(surface: Surface, time_span: f64) -> Self {
        Self::Laws {
            laws: Laws::rigid(surface),
            lubrication_gap: 0.0,
            time_span,
            springs: PairForces::default(),
            rolling_springs: PairForces::default(),
        }
    }

    /// The contact problem of a single instant of a run with these parameters: forces look ahead by `time_span`, in strain.
    pub fn of_run(params: &Params, time_span: f64) -> Self {
        let surface = params.surface();
        match &params.contact {
            ContactScheme::Procedure => Self::Procedure { surface },
            ContactScheme::Rigid => Self::rigid(surface, time_span),
            ContactScheme::Laws(laws) => Self::Laws {
                laws: Laws::new(laws, surface),
                lubrication_gap: laws.lubrication_gap,
                time_span,
                springs: PairForces::default(),
                rolling_springs: PairForces::default(),
            },
        }
    }
}

/// Motion, stresslets and contacts of a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedConfiguration {
    /// `(U − u∞, Ω − Ω∞)` of each sphere, background at its own centre.
    pub disturbances: Vec<[f64; 3]>,
    /// Stresslets S of (20), `(s1, s2, s3)` of each sphere, in mu·a³·rate.
    pub stresslets: Vec<Vector3<f64>>,
    /// Bulk stress; `None` in unbounded fluid.
    pub stress: Option<Stress>,
    /// All candidate pairs.
    pub contacts: Vec<Contact>,
    /// Pairs that a repulsion keeps apart besides the contacts.
    pub repelled: Vec<Contact>,
    /// Pairs that adhesion holds together besides the contacts; their normal force is below 0.
    pub adhering: Vec<Contact>,
}

impl SolvedConfiguration {
    /// Stresslet of sphere i as `(xx, yy, xy)`.
    pub fn stresslet(&self, i: usize) -> (f64, f64, f64) {
        strain_tensor(&self.stresslets[i])
    }

    /// Power that contacts, repulsion and adhesion take, in mu·a³·rate²: what friction dissipates, and what goes into springs, dashpots and
    /// the repulsion.
    ///
    /// ```text
    /// Σ F_t u_t + Σ F_r u_r − Σ f v_n
    /// ```
    pub fn contact_power(&self) -> f64 {
        let others = self.repelled.iter().chain(&self.adhering);
        let contacts = self.contacts.iter().chain(others);
        contacts
            .map(|c| {
                c.tangential_force * c.slip_velocity - c.normal_force * c.normal_velocity
                    + c.rolling_force * c.rolling_velocity
            })
            .sum()
    }
}

/// Solves the motion under a contact problem, at the positions taken.
fn move_under(
    stage: &mut StageSolver,
    background: &Background,
    external: &[f64],
    request: &ContactRequest,
) -> Result<(), Error> {
    match request {
        ContactRequest::None => {
            stage.solve(background, external, StageContact::None, Pass::First)?;
        }
        ContactRequest::Listed { pairs } => {
            let mut listed = listed_pairs(pairs, stage)?;
            let contact = StageContact::Procedure {
                surface: Surface {
                    roughness: 0.0,
                    friction: 0.0,
                    critical_load: f64::INFINITY,
                },
                listed: &mut listed,
            };
            stage.solve(background, external, contact, Pass::First)?;
        }
        ContactRequest::Laws {
            laws,
            time_span,
            springs,
            rolling_springs,
            ..
        } => {
            check_surface(&laws.surface, laws.normal.is_rigid())?;
            in_range(
                time_span.is_finite() && *time_span > 0.0,
                "contact.time_span",
                *time_span,
                "positive and finite",
            )?;
            let mut memory = ContactMemory {
                springs: Springs::new(springs.clone()),
                rolling_springs: Springs::new(rolling_springs.clone()),
                ..ContactMemory::default()
            };
            let contact = StageContact::Laws {
                laws,
                span: Span::alone(*time_span),
                memory: &mut memory,
            };
            stage.solve(background, external, contact, Pass::First)?;
        }
        ContactRequest::Procedure { surface } => {
            check_surface(surface, true)?;
            stage.solve(background, external, StageContact::None, Pass::First)?;
            let mut listed = ContactList::default();
            listed.add_approaching(
                &stage.resistance,
                background,
                surface.roughness,
                stage.velocities(),
            );
            let contact = StageContact::Procedure {
                surface: *surface,
                listed: &mut listed,
            };
            stage.solve(background, external, contact, Pass::Again)?;
        }
    }
    Ok(())
}

/// How [`solve`] computes this instant.
pub fn method(configuration: &Configuration, request: &ContactRequest) -> Method {
    let is_soft = match request {
        ContactRequest::Listed { .. } | ContactRequest::Procedure { .. } => return Method::Dense,
        ContactRequest::Laws { laws, .. } => laws.is_soft(),
        ContactRequest::None => false,
    };
    let Configuration {
        hydrodynamics,
        cell,
        radii,
        ..
    } = configuration;
    Method::of_instant(*hydrodynamics, cell, radii, is_soft)
}

/// Solves one instant.
///
/// # Errors
/// Bad lengths, radii, overlaps, a cell too small, pairs out of range, an indefinite matrix.
pub fn solve(
    configuration: &Configuration,
    request: &ContactRequest,
    tables: &NearFields,
) -> Result<SolvedConfiguration, Error> {
    check(configuration)?;
    let Configuration {
        centres,
        radii,
        cell,
        hydrodynamics,
        background,
        ..
    } = configuration;
    let external: Vec<f64> = configuration
        .forces
        .iter()
        .zip(&configuration.torques)
        .flat_map(|(f, &t)| [f.x, f.y, t])
        .collect();
    let mut stage =
        method(configuration, request).solver(*hydrodynamics, cell, radii, tables, &[])?;
    if hydrodynamics.admits_overlap() {
        stage.resistance.regularise(0.0, f64::INFINITY);
    } else if let ContactRequest::Laws {
        lubrication_gap, ..
    } = request
        && *lubrication_gap > 0.0
    {
        stage
            .resistance
            .regularise(*lubrication_gap, DEEPEST_OVERLAP);
    }
    if let ContactRequest::Laws { laws, .. } = request {
        stage.resistance.expect_contacts(laws.surface.roughness);
    }
    stage.assemble(cell, centres)?;
    move_under(&mut stage, background, &external, request)?;
    let mut work = StressWork::default();
    let contacts = stage.contacts.list.clone();
    let stress = if let Some(area) = cell.content() {
        Some(work.stress(&stage, background, area))
    } else {
        work.update(&stage, background);
        None
    };
    Ok(SolvedConfiguration {
        disturbances: stage
            .velocities()
            .chunks_exact(3)
            .map(|v| [v[0], v[1], v[2]])
            .collect(),
        stresslets: work.stresslets,
        stress,
        contacts,
        repelled: stage.repelled.pairs.clone(),
        adhering: stage.adhering.pairs.clone(),
    })
}

fn in_range(ok: bool, field: &'static str, value: f64, allowed: &'static str) -> Result<(), Error> {
    if ok {
        Ok(())
    } else {
        Err(Error::OutOfRange {
            field,
            value,
            allowed,
        })
    }
}

/// Refuses a configuration with a list of another length or a value out of range.
fn check(configuration: &Configuration) -> Result<(), Error> {
    let vectors = |list: &[Vec2]| list.iter().flat_map(|x| [x.x, x.y]).collect();
    let b = &configuration.background;
    check_lists(
        configuration.centres.len(),
        [
            ("radii", configuration.radii.len()),
            ("forces", configuration.forces.len()),
            ("torques", configuration.torques.len()),
        ],
    )?;
    check_numbers(
        configuration.hydrodynamics,
        [
            ("centres", vectors(&configuration.centres)),
            ("forces", vectors(&configuration.forces)),
            ("torques", configuration.torques.clone()),
            ("background", vec![b.xx, b.yy, b.xy, b.angular_velocity]),
        ],
        &configuration.radii,
    )
}

/// Refuses a configuration without spheres, or with a list that is not one entry for each of them.
pub(super) fn check_lists(spheres: usize, lists: [(&'static str, usize); 3]) -> Result<(), Error> {
    if spheres == 0 {
        return Err(Error::NoSpheres);
    }
    for (field, found) in lists {
        if found != spheres {
            return Err(Error::Length {
                field,
                found,
                expected: spheres,
            });
        }
    }
    Ok(())
}

/// Refuses parameters of the hydrodynamics, numbers or radii out of range.
pub(super) fn check_numbers(
    hydrodynamics: Hydrodynamics,
    groups: [(&'static str, Vec<f64>); 4],
    radii: &[f64],
) -> Result<(), Error> {
    if let Some(numbers) = hydrodynamics.leading_order() {
        numbers.check()?;
    }
    for (field, values) in groups {
        for value in values {
            in_range(value.is_finite(), field, value, "finite")?;
        }
    }
    for &a in radii {
        in_range(a > 0.0 && a.is_finite(), "radii", a, "positive and finite")?;
    }
    Ok(())
}

/// Refuses a surface with a value out of range; rigid contacts must have a roughness.
fn check_surface(surface: &Surface, rigid: bool) -> Result<(), Error> {
    let Surface {
        roughness,
        friction,
        critical_load,
    } = *surface;
    in_range(
        (roughness > 0.0 || !rigid && roughness == 0.0) && roughness < 0.5,
        "contact.roughness",
        roughness,
        "above 0 and below 0.5; 0 for soft contacts only",
    )?;
    in_range(
        (0.0..=10.0).contains(&friction),
        "contact.friction",
        friction,
        "0 to 10",
    )?;
    in_range(
        critical_load >= 0.0,
        "contact.critical_load",
        critical_load,
        "0 or positive",
    )
}

/// Pairs given by number; each must be within lubrication range.
fn listed_pairs(pairs: &[[usize; 2]], stage: &StageSolver) -> Result<ContactList, Error> {
    let n = stage.resistance.radii().len();
    let mut listed = ContactList::default();
    for &[i, j] in pairs {
        let refuse = |reason| Err(Error::BadPair { i, j, reason });
        if i >= n || j >= n {
            return refuse("names a sphere that is not there");
        }
        if i == j {
            return refuse("is one sphere");
        }
        let (i, j) = (i.min(j), i.max(j));
        let neighbours = stage.resistance.neighbours();
        if !neighbours.iter().any(|p| (p.i, p.j) == (i, j)) {
            return refuse("is out of lubrication range");
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "sphere numbers fit 32 bits"
        )]
        listed.add((i as u32, j as u32));
    }
    Ok(listed)
}
