//! One instant of one configuration: velocities, stresslets, contact forces.

use crate::contact::laws::{GAMMA, Laws, Span};
use crate::contact::pair_forces::PairForces;
use crate::contact::springs::Springs;
use crate::contact::{Contact, ContactMemory, SolvePass};
use crate::error::Error;
use crate::hydrodynamics::applied_forces::{
    check_length, check_net_force, check_numbers, check_spheres,
};
use crate::hydrodynamics::resistance::{Fluid, NearFields};
use crate::model::Surface;
use crate::model::parameters::{FRICTION, ROUGHNESS};
use crate::model::{ContactScheme, DEEPEST_OVERLAP, Hydrodynamics, Params, SolverSettings};
use crate::procedure::ContactList;
use crate::space::cell::Cell;
use crate::space::modes::strain_tensor;
use crate::space::{IncidentFlow, Layer, Space};
use crate::stage::{Method, StageContacts, StageSolver};
use crate::stress::{Stress, StressWork};

/// Spheres, their positions and external forces; examples are at
/// [`solve`](crate::instant::solve) and [`InstantContacts`].
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration<S: Space = Layer> {
    /// Centres, in a.
    pub centres: Vec<S::Vector>,
    /// Radii, in a; one per centre.
    pub radii: Vec<f64>,
    /// Periodic cell or unbounded fluid.
    pub cell: Cell<S>,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Incident flow.
    pub background: IncidentFlow<S>,
    /// External forces, in mu·a²·rate; one per centre. In the cell of a suspension the mean flow of
    /// spheres and fluid is zero. On a periodic layer in full Stokesian Dynamics they must sum to
    /// zero.
    pub forces: Vec<S::Vector>,
    /// External torques, in mu·a³·rate; one per centre.
    pub torques: Vec<S::Spin>,
}

/// The contact problem to solve.
///
/// ```
/// use sd_core::cell::Cell;
/// use sd_core::contact::{Laws, Surface};
/// use sd_core::instant::{Configuration, InstantContacts, solve};
/// use sd_core::modes::Vec2;
/// use sd_core::{Hydrodynamics, Layer, NearFields, VelocityGradient};
///
/// // Two rough spheres that touch, in fluid at rest, pressed together by a force of 5.
/// let pair = Configuration::<Layer> {
///     centres: vec![Vec2::new(0.0, 0.0), Vec2::new(2.01, 0.0)],
///     radii: vec![1.0; 2],
///     cell: Cell::Unbounded,
///     hydrodynamics: Hydrodynamics::StokesianDynamics,
///     background: VelocityGradient::at_rest().into(),
///     forces: vec![Vec2::new(5.0, 0.0), Vec2::new(-5.0, 0.0)],
///     torques: vec![0.0; 2],
/// };
/// let surface = Surface { roughness: 0.01, friction: 0.5, critical_load: 0.0 };
/// let contacts = InstantContacts::under(Laws::rigid(surface), 0.005);
/// let solved = solve(&pair, &contacts, &NearFields::default())?;
/// assert!((solved.contacts[0].normal_force - 5.0).abs() < 1e-5);
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum InstantContacts<S: Space = Layer> {
    /// No contact.
    None,
    /// These pairs are stopped simultaneously by eqs. (12)-(13), without friction; negative forces
    /// are then set to zero.
    HeldPairs {
        /// Pairs of sphere numbers.
        pairs: Vec<[usize; 2]>,
    },
    /// The paper's procedure; every approaching pair with gap ≤ roughness is in contact.
    Procedure {
        /// Roughness and friction.
        surface: Surface,
    },
    /// Laws; overlaps of springs follow from the gaps.
    Laws {
        /// The laws, in the units of the solver.
        laws: Laws,
        /// Gap below which lubrication is held constant, in a; 0: nowhere, and surfaces may overlap
        /// only if the hydrodynamics allow it.
        lubrication_gap: f64,
        /// Look-ahead time of contact forces, in strain.
        time_span: f64,
        /// Forces of the tangential springs; others are unstretched.
        springs: PairForces<S>,
        /// Forces of the springs of rolling friction; others are unstretched.
        rolling_springs: PairForces<S>,
    },
}

impl<S: Space> InstantContacts<S> {
    /// Laws with a look-ahead time, in strain. Their springs are unstretched, and lubrication holds
    /// at any gap.
    pub fn under(laws: Laws, time_span: f64) -> Self {
        Self::Laws {
            laws,
            lubrication_gap: 0.0,
            time_span,
            springs: PairForces::default(),
            rolling_springs: PairForces::default(),
        }
    }

    /// The contact problem of a single instant of a run with these parameters: `time_span`:
    /// look-ahead time of forces, in strain.
    pub fn of_run(params: &Params, time_span: f64) -> Self {
        let surface = params.surface();
        match &params.contact {
            ContactScheme::Procedure => Self::Procedure { surface },
            ContactScheme::Rigid => Self::under(Laws::rigid(surface), time_span),
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

/// Time over which contact forces look ahead in the first stage of a run's step, in strain.
///
/// ```
/// use sd_core::instant::look_ahead;
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
/// assert_eq!(look_ahead(&params), params.time_step); // rigid contacts
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn look_ahead(params: &Params) -> f64 {
    if params.contact.laws().is_soft() {
        GAMMA * params.time_step
    } else {
        params.time_step
    }
}

/// Motion, stresslets and contacts of a configuration.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SolvedConfiguration<S: Space = Layer> {
    /// `(U − u∞, Ω − Ω∞)` of each sphere, background at its own centre.
    pub disturbances: Vec<S::PerMode<f64>>,
    /// Stresslets S of (20) of each sphere by their components, in mu·a³·rate.
    pub stresslets: Vec<S::Strain>,
    /// Isotropic part of the hydrodynamic stress, which the stresslets lack, as a pressure times
    /// the volume, in mu·a³·rate: a third of the moments of [`crate::two_sphere::pressure_moments`]
    /// over all spheres, in a periodic suspension relative to the mean pressure of the fluid.
    pub pressure_moment: f64,
    /// Bulk stress; `None` in unbounded fluid. The viscosity is the resistance to the linear flow.
    pub stress: Option<Stress>,
    /// All candidate pairs.
    pub contacts: Vec<Contact<S>>,
    /// Pairs with a repulsion, in addition to the contacts.
    pub repulsive: Vec<Contact<S>>,
    /// Pairs with van der Waals attraction, in addition to the contacts; their normal force is
    /// negative.
    pub attractive: Vec<Contact<S>>,
    /// Pairs with adhesion, in addition to the contacts; their normal force is negative.
    pub adhesive: Vec<Contact<S>>,
}

impl SolvedConfiguration {
    /// Stresslet of sphere i as `(xx, yy, xy)`.
    ///
    /// # Panics
    /// If there is no such sphere.
    pub fn stresslet(&self, i: usize) -> (f64, f64, f64) {
        strain_tensor(&self.stresslets[i])
    }
}

impl<S: Space> SolvedConfiguration<S> {
    /// Power of contacts, repulsion, attraction and adhesion, in mu·a³·rate²: dissipated by
    /// friction and dashpots, and stored in springs, the repulsion and the attraction.
    ///
    /// ```text
    /// Σ F_t u_t + Σ F_r u_r − Σ f v_n
    /// ```
    pub fn contact_power(&self) -> f64 {
        let others = self
            .repulsive
            .iter()
            .chain(&self.attractive)
            .chain(&self.adhesive);
        let contacts = self.contacts.iter().chain(others);
        contacts
            .map(|c| {
                S::tangent_dot(&c.tangential_force, &c.slip_velocity)
                    - c.normal_force * c.normal_velocity
                    + S::tangent_dot(&c.rolling_force, &c.rolling_velocity)
            })
            .sum()
    }
}

/// Solves the motion under a contact problem, at the current positions.
fn move_under<S: Fluid>(
    stage: &mut StageSolver<S>,
    background: &IncidentFlow<S>,
    external: &[f64],
    request: &InstantContacts<S>,
) -> Result<(), Error> {
    match request {
        InstantContacts::None => {
            stage.solve(background, external, StageContacts::None, SolvePass::First)?;
        }
        InstantContacts::HeldPairs { pairs } => {
            let mut contact_list = listed_pairs(pairs, stage)?;
            let contact = StageContacts::Procedure {
                surface: Surface {
                    roughness: 0.0,
                    friction: 0.0,
                    critical_load: f64::INFINITY,
                },
                contact_list: &mut contact_list,
            };
            stage.solve(background, external, contact, SolvePass::First)?;
        }
        InstantContacts::Laws {
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
            let spheres = stage.resistance.radii().len();
            for list in [springs, rolling_springs] {
                if let Some(([i, j], reason)) = list.fault(spheres) {
                    return Err(Error::BadPair { i, j, reason });
                }
            }
            let mut memory = ContactMemory {
                springs: Springs::new(springs.clone()),
                rolling_springs: Springs::new(rolling_springs.clone()),
                ..ContactMemory::default()
            };
            let contact = StageContacts::Laws {
                laws,
                span: Span::single(*time_span),
                memory: &mut memory,
            };
            stage.solve(background, external, contact, SolvePass::First)?;
        }
        InstantContacts::Procedure { surface } => {
            check_surface(surface, true)?;
            stage.solve(background, external, StageContacts::None, SolvePass::First)?;
            let mut contact_list = ContactList::default();
            contact_list.add_approaching(
                &stage.resistance,
                background,
                surface.roughness,
                stage.velocities(),
            );
            let contact = StageContacts::Procedure {
                surface: *surface,
                contact_list: &mut contact_list,
            };
            stage.solve(background, external, contact, SolvePass::Repeat)?;
        }
    }
    // A run counts such a stage and continues; a single instant has no other result.
    stage.check_far_field()
}

/// The method by which [`solve`](crate::instant::solve) computes this instant.
pub fn method<S: Space>(configuration: &Configuration<S>, request: &InstantContacts<S>) -> Method {
    let is_soft = match request {
        InstantContacts::HeldPairs { .. } | InstantContacts::Procedure { .. } => {
            return Method::Dense;
        }
        InstantContacts::Laws { laws, .. } => laws.is_soft(),
        InstantContacts::None => false,
    };
    let Configuration {
        hydrodynamics,
        cell,
        radii,
        ..
    } = configuration;
    Method::of_instant(*hydrodynamics, cell, radii, is_soft)
}

/// Solves one instant by a given method.
pub(super) fn solve_with<S: Fluid>(
    method: Method,
    configuration: &Configuration<S>,
    request: &InstantContacts<S>,
    tables: &NearFields,
) -> Result<SolvedConfiguration<S>, Error> {
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
        .flat_map(|(f, t)| S::join(f, t).as_ref().to_vec())
        .collect();
    check(configuration, &external)?;
    check_net_force::<S>(*hydrodynamics, cell, &external, S::MODES)?;
    let mut stage = method.solver(
        *hydrodynamics,
        cell,
        radii,
        tables,
        &[],
        &SolverSettings::precise(),
    )?;
    if hydrodynamics.admits_overlap() {
        stage.resistance.regularise(0.0, f64::INFINITY);
    } else if let InstantContacts::Laws {
        lubrication_gap, ..
    } = request
        && *lubrication_gap > 0.0
    {
        stage
            .resistance
            .regularise(*lubrication_gap, DEEPEST_OVERLAP);
    }
    if let InstantContacts::Laws { laws, .. } = request {
        stage.resistance.expect_contacts(laws.surface.roughness);
        stage.resistance.roughen(laws.hydrodynamic_friction);
    }
    stage.assemble(cell, centres)?;
    move_under(&mut stage, background, &external, request)?;
    let mut work = StressWork::default();
    let contacts = stage.contacts.list.clone();
    let stress = if let Some(area) = cell.content() {
        Some(work.stress(&stage, background, background.linear(), area))
    } else {
        work.update(&stage, background);
        None
    };
    let pressure_moment = stage.hydrodynamic_pressure(background.strains(), &mut work.pressure);
    Ok(SolvedConfiguration {
        disturbances: S::by_sphere(stage.velocities()).to_vec(),
        stresslets: work.stresslets,
        pressure_moment,
        stress,
        contacts,
        repulsive: stage.distant.repulsive.clone(),
        attractive: stage.distant.attractive.clone(),
        adhesive: stage.distant.adhesive.clone(),
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

/// Refuses a configuration with a list of another length or a value out of range; `external`: its
/// forces and torques.
fn check<S: Space>(configuration: &Configuration<S>, external: &[f64]) -> Result<(), Error> {
    let spheres = configuration.centres.len();
    if spheres == 0 {
        return Err(Error::NoSpheres);
    }
    for (field, found) in [
        ("radii", configuration.radii.len()),
        ("forces", configuration.forces.len()),
        ("torques", configuration.torques.len()),
    ] {
        check_length(field, found, spheres)?;
    }
    configuration.background.check(spheres)?;
    let (radii, centres) = (&configuration.radii, &configuration.centres);
    check_spheres::<S>(configuration.hydrodynamics, radii, centres)?;
    check_numbers("forces and torques", external, S::MODES)
}

/// Refuses a surface with a value out of range; rigid contacts must have a roughness.
fn check_surface(surface: &Surface, rigid: bool) -> Result<(), Error> {
    let Surface {
        roughness,
        friction,
        critical_load,
    } = *surface;
    ROUGHNESS.check("contact.roughness", roughness)?;
    in_range(
        roughness > 0.0 || !rigid,
        "contact.roughness",
        roughness,
        "above 0 and below 0.5; 0 for soft contacts only",
    )?;
    FRICTION.check("contact.friction", friction)?;
    in_range(
        critical_load >= 0.0,
        "contact.critical_load",
        critical_load,
        "0 or positive",
    )
}

/// Pairs given by number; each must be within lubrication range.
fn listed_pairs<S: Fluid>(
    pairs: &[[usize; 2]],
    stage: &StageSolver<S>,
) -> Result<ContactList, Error> {
    let n = stage.resistance.radii().len();
    let mut contact_list = ContactList::default();
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
        contact_list.add((i as u32, j as u32));
    }
    Ok(contact_list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ContactLaws, StiffnessUnit, TangentialLaw};
    use crate::space::{Bulk, VelocityGradient};
    use nalgebra::Vector3;

    /// A sheared cell of spheres on a disordered lattice, at φ = 0.35.
    fn suspension(hydrodynamics: Hydrodynamics) -> Configuration<Bulk> {
        let side = 2.29;
        let centres: Vec<_> = (0..64)
            .map(|k| {
                let place = Vector3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16));
                let k = f64::from(k);
                place * side
                    + Vector3::new((1.7 * k).sin(), (2.9 * k).cos(), (0.9 * k).sin()) * 0.07
            })
            .collect();
        let n = centres.len();
        Configuration {
            radii: vec![1.0; n],
            cell: Cell::periodic(Vector3::repeat(4.0 * side), side).unwrap(),
            hydrodynamics,
            background: VelocityGradient::simple_shear(1.0).into(),
            forces: (0..n)
                .map(|k| Vector3::new((0.7 * k as f64).sin(), 0.3, -0.1))
                .collect(),
            torques: (0..n)
                .map(|k| Vector3::new(0.1, (1.1 * k as f64).cos(), 0.2))
                .collect(),
            centres,
        }
    }

    /// Sliding and sticking contacts, under each kind of law.
    fn requests() -> Vec<InstantContacts<Bulk>> {
        let surface = Surface {
            roughness: 0.2,
            friction: 0.3,
            critical_load: 0.0,
        };
        let law = |choice: &ContactLaws| InstantContacts::under(Laws::new(choice, surface), 0.01);
        let rigid = |tangential, rolling_friction| ContactLaws {
            tangential,
            rolling_friction,
            ..ContactLaws::PAPER
        };
        let springs = ContactLaws {
            stiffness_unit: StiffnessUnit::Flow,
            ..ContactLaws::linear_spring(3e3, TangentialLaw::StickSlide, 0.2)
        };
        vec![
            InstantContacts::None,
            law(&springs),
            law(&rigid(TangentialLaw::Coulomb, 0.0)),
            law(&rigid(TangentialLaw::Coulomb, 0.1)),
            law(&rigid(TangentialLaw::RollSlip, 0.0)),
            law(&rigid(TangentialLaw::StickRotate, 0.0)),
        ]
    }

    #[test]
    fn an_instant_whose_far_field_does_not_converge_is_an_error() {
        let c = suspension(Hydrodynamics::StokesianDynamics);
        let settings = SolverSettings::precise();
        for (number, request) in requests().iter().enumerate() {
            let solve = |limit: Option<u32>| {
                let tables = NearFields::default();
                let (kind, cell) = (c.hydrodynamics, &c.cell);
                let mut stage =
                    Method::Iterated.solver(kind, cell, &c.radii, &tables, &[], &settings)?;
                if let Some(limit) = limit {
                    stage.far_mut().unwrap().limit_evaluations(limit);
                }
                if let InstantContacts::Laws { laws, .. } = request {
                    stage.resistance.expect_contacts(laws.surface.roughness);
                    stage.resistance.roughen(laws.hydrodynamic_friction);
                }
                stage.assemble(cell, &c.centres)?;
                move_under(&mut stage, &c.background, &[], request)
            };
            assert_eq!(solve(None), Ok(()), "law {number}");
            let error = solve(Some(4)).unwrap_err();
            let Error::NotConverged {
                quantity,
                iterations,
                residual,
                wanted,
            } = error
            else {
                panic!("law {number}: {error}");
            };
            assert_eq!((quantity, iterations), ("the far field", 4), "law {number}");
            // Accurate enough for a run to continue with, and still not what was asked for.
            assert!(
                residual > wanted && residual < 0.1,
                "law {number}: {residual}"
            );
        }
    }

    #[test]
    fn motion_pair_by_pair_is_that_of_full_matrices() {
        for (hydrodynamics, sparse, tolerance) in [
            (Hydrodynamics::StokesianDynamics, Method::Iterated, 1e-5),
            (Hydrodynamics::BallMelrose, Method::Pairwise, 1e-7),
        ] {
            for (number, request) in requests().iter().enumerate() {
                let c = suspension(hydrodynamics);
                let tables = NearFields::default();
                let [dense, sparse] = [Method::Dense, sparse]
                    .map(|method| solve_with(method, &c, request, &tables).unwrap());
                let what = format!("{hydrodynamics:?}, law {number}");
                let loaded = |solved: &SolvedConfiguration<Bulk>| {
                    let contacts = solved.contacts.iter();
                    contacts.filter(|c| c.normal_force > 0.0).count()
                };
                assert_eq!(loaded(&dense), loaded(&sparse), "{what}");
                assert!(number == 0 || loaded(&dense) > 10, "{what}");
                for (a, b) in dense.contacts.iter().zip(&sparse.contacts) {
                    let error = (a.tangential_force - b.tangential_force).amax();
                    assert!(error < 300.0 * tolerance, "{what}: {error:e}");
                }
                for (a, b) in dense.disturbances.iter().zip(&sparse.disturbances) {
                    let pairs = a.iter().zip(b).map(|(a, b)| (a - b).abs());
                    let error = pairs.fold(0.0, f64::max);
                    assert!(error < tolerance, "{what}: {error:e}");
                }
                for (a, b) in dense.stresslets.iter().zip(&sparse.stresslets) {
                    let error = (a - b).amax() / 20.0;
                    assert!(error < 10.0 * tolerance, "{what}: stress {error:e}");
                }
                let [a, b] = [dense.pressure_moment, sparse.pressure_moment];
                assert!(
                    (a - b).abs() < 3e2 * tolerance && a.abs() > 0.1,
                    "{what}: {a} {b}"
                );
                // Energy: an identity of the solution.
                let stress = dense.stress.unwrap();
                let volume = c.cell.content().unwrap();
                let external: f64 = (c.forces.iter().zip(&c.torques))
                    .zip(&dense.disturbances)
                    .map(|((f, t), v)| {
                        let of =
                            |x: &Vector3<f64>, v: &[f64]| x.dot(&Vector3::from_column_slice(v));
                        of(f, &v[..3]) + of(t, &v[3..])
                    })
                    .sum();
                let spent = stress.dissipation * volume + dense.contact_power();
                let given = (stress.viscosity - 1.0) * volume + external;
                // The couples of stick-rotate are left out: rigid contacts yield by 1e-10 of them.
                let exact = if number == 5 { 1e-9 } else { 1e-10 };
                assert!(
                    (spent / given - 1.0).abs() < exact,
                    "{what}: {spent} {given}"
                );
            }
        }
    }
}
