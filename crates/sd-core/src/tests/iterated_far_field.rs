//! The iterated far field against the dense one.

mod dense_contacts;

use crate::contact::contact_solver::{AppliedForces, StageInput};
use crate::contact::laws::{Laws, NormalForce, Span};
use crate::contact::{ContactMemory, ContactSolver, ContactState, SolvePass, Surface};
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::iterative::{Convergence, IterativeFarField};
use crate::hydrodynamics::resistance::{PressureWork, Resistance};
use crate::linalg::dense::{add_scaled, dot};
use crate::space::cell::Cell;
use crate::space::modes::{Vec2, strain_tensor};
use crate::space::{IncidentFlow, Layer, VelocityGradient};
use crate::stage::{Method, StageContacts, StageSolver};
use crate::stress::StressWork;
use crate::{
    ContactLaws, ContactScheme, Error, Hydrodynamics, NearFields, NormalLaw, Params, Simulation,
    TangentialLaw,
};
use dense_contacts::DenseContacts;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Parameters of a layer with many contacts, all with friction.
fn params(spheres: usize, size_ratio: f64) -> Params {
    Params {
        spheres,
        area_fraction: 0.72,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: f64::INFINITY,
        size_ratio,
        large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact: ContactScheme::Rigid,
        time_step: 0.005,
        ..Params::UNSET
    }
}

/// A layer after a strain of 0.3.
struct Sheared {
    cell: Cell,
    centres: Vec<Vec2>,
    radii: Vec<f64>,
}

impl Sheared {
    fn new(params: &Params) -> Self {
        let mut simulation = Simulation::<Layer>::new(params, 1, &NearFields::default()).unwrap();
        for _ in 0..60 {
            simulation.step().unwrap();
        }
        let snapshot = simulation.snapshot();
        let centres = snapshot.centres.iter().map(|x| Vec2::new(x[0], x[1]));
        Self {
            cell: Cell::equal_sides(snapshot.side, 0.3 * snapshot.side).unwrap(),
            centres: centres.collect(),
            radii: snapshot.radii,
        }
    }

    /// Full Stokesian Dynamics with more accurate periodic sums than default.
    fn dense(&self) -> StageSolver {
        let tables = NearFields::default();
        StageSolver::new(Resistance::new_dense(&self.cell, &self.radii, &tables, 1e-13).unwrap())
    }

    /// Full Stokesian Dynamics with the far field iterated to a residual.
    fn iterated(&self, residual: f64) -> StageSolver {
        let far = IterativeFarField::new(&self.cell, &self.radii, residual).unwrap();
        StageSolver::with_far_field(self.by_pairs(Hydrodynamics::StokesianDynamics), far)
    }

    /// Stored pair by pair; under Stokesian Dynamics with the far field of near pairs.
    fn by_pairs(&self, hydrodynamics: Hydrodynamics) -> Resistance {
        let tables = NearFields::default();
        Resistance::new_pairwise(hydrodynamics, &self.cell, &self.radii, &tables, &[]).unwrap()
    }

    /// Ball-Melrose hydrodynamics, factored.
    fn factored(&self) -> Resistance {
        let (kind, tables) = (Hydrodynamics::BallMelrose, NearFields::default());
        Resistance::new(kind, &self.cell, &self.radii, &tables).unwrap()
    }

    /// The stage solved under external forces and contact laws, if there are any.
    fn solved(&self, mut stage: StageSolver, external: &[f64], laws: Option<&Laws>) -> StageSolver {
        stage.assemble(&self.cell, &self.centres).unwrap();
        let memory = &mut ContactMemory::default();
        let contact = match laws {
            None => StageContacts::None,
            Some(laws) => StageContacts::Laws {
                laws,
                span: Span::single(TIME_SPAN),
                memory,
            },
        };
        let quality = stage.solve(&shear(), external, contact, SolvePass::First);
        let quality = quality.unwrap();
        assert!(quality.converged(), "{laws:?}: {quality:?}");
        stage
    }

    /// A resistance without a far field at the positions, and the forces on the spheres.
    fn driven(&self, mut near: Resistance, external: &[f64]) -> (Resistance, Vec<f64>) {
        near.update(&self.cell, &self.centres).unwrap();
        let mut forces = vec![0.0; 3 * self.radii.len()];
        near.background_forces(shear().strains(), &mut forces);
        add_scaled(&mut forces, external, 1.0);
        (near, forces)
    }

    /// The far field iterated on top of a resistance by a map, from none.
    fn iterate(
        &self,
        (near, forces): (&Resistance, &[f64]),
        map: &mut impl FixedPointMap,
        residual: f64,
    ) -> Result<Motion, Error> {
        let mut far = IterativeFarField::new(&self.cell, &self.radii, residual)?;
        far.update(&self.cell, &self.centres)?;
        let mut v = vec![0.0; 3 * self.radii.len()];
        let found = far.solve_fixed_point(near, map, shear().strains(), forces, &mut v)?;
        let (mut work, mut counter, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
        near.apply(
            &v,
            shear().strains(),
            &mut work,
            &mut counter,
            &mut stresslets,
        );
        far.correct(&mut counter, &mut stresslets);
        Ok(Motion {
            found,
            v,
            counter,
            stresslets,
        })
    }
}

/// The result of an iteration, with forces and stresslets of the fluid.
#[derive(Debug, PartialEq)]
struct Motion {
    found: Convergence,
    v: Vec<f64>,
    counter: Vec<f64>,
    stresslets: Vec<Vector3<f64>>,
}

/// Rough spheres with friction under any load.
const SURFACE: Surface = Surface {
    roughness: 0.01,
    friction: 0.3,
    critical_load: 0.0,
};

/// Time span of contact forces.
const TIME_SPAN: f64 = 0.0025;

fn shear() -> IncidentFlow<Layer> {
    VelocityGradient::simple_shear(1.0).into()
}

/// Forces that add up to zero, and torques.
fn external(spheres: usize) -> Vec<f64> {
    let mut forces: Vec<f64> = (0..3 * spheres)
        .map(|k| 3.0 * (1.7 * k as f64 + 0.01 * (k * k) as f64).sin())
        .collect();
    for c in 0..2 {
        let mean = forces[c..].iter().step_by(3).sum::<f64>() / spheres as f64;
        forces[c..].iter_mut().step_by(3).for_each(|f| *f -= mean);
    }
    forces
}

/// Root mean square of a vector, and of its difference from another over it.
fn relative_difference(expected: &[f64], found: &[f64]) -> f64 {
    let difference: Vec<f64> = expected.iter().zip(found).map(|(a, b)| a - b).collect();
    (dot(&difference, &difference) / dot(expected, expected)).sqrt()
}

fn flat(stresslets: &[Vector3<f64>]) -> Vec<f64> {
    stresslets.iter().flat_map(|s| [s[0], s[1], s[2]]).collect()
}

/// The motion without contacts, as a map: forces act on both parts together.
struct Free<'a> {
    near: &'a Resistance,
    contacts: ContactSolver,
    memory: ContactMemory,
}

impl<'a> Free<'a> {
    fn new(near: &'a Resistance) -> Self {
        Self {
            near,
            contacts: ContactSolver::new(near),
            memory: ContactMemory::default(),
        }
    }
}

impl FixedPointMap for Free<'_> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        let (v, v_t) = velocities.split_at_mut(forces.len() / 2);
        v_t.fill(0.0);
        let input = StageInput {
            random_motion: &[],
            resistance: self.near,
            flow: &shear(),
            laws: &Laws::none(),
            span: Span::single(1.0),
        };
        let pass = match progress.evaluations {
            0 => SolvePass::First,
            _ => SolvePass::FixedActivation,
        };
        if pass == SolvePass::First {
            self.contacts.begin_stage();
        }
        let applied = AppliedForces::both(&forces[..v.len()]);
        self.contacts
            .solve(&input, applied, &mut self.memory, pass, v)?;
        Ok(false)
    }
}

#[test]
fn linear_motion_is_that_of_the_dense_far_field() {
    for size_ratio in [1.0, 1.5] {
        let layer = Sheared::new(&params(60, size_ratio));
        let external = external(60);
        let free = |stage| {
            let stage = layer.solved(stage, &external, None);
            let mut work = StressWork::default();
            let power = work.update(&stage, &shear());
            (stage, work.stresslets, power)
        };
        let (dense, expected, power) = free(layer.dense());
        for residual in [1e-4, 1e-6, 1e-7] {
            let (stage, stresslets, found_power) = free(layer.iterated(residual));
            assert!(stage.contacts.list.is_empty());
            let v = stage.velocities();
            let error = relative_difference(dense.velocities(), v);
            assert!(error < 3.0 * residual, "{size_ratio}: {error:e}");
            let error = relative_difference(&flat(&expected), &flat(&stresslets));
            assert!(error < residual, "{size_ratio}: stresslets {error:e}");
            let error = (found_power / power - 1.0).abs();
            assert!(error < 0.5 * residual, "{size_ratio}: {error:e}");
            let [a, b] = [&dense, &stage].map(|stage| {
                stage.hydrodynamic_pressure(shear().strains(), &mut PressureWork::default())
            });
            let error = (a - b).abs() / power;
            assert!(error < residual, "{size_ratio}: pressure {a} {b}");
            // The forces of the fluid balance those on the spheres: pair by pair to the tolerance
            // of the near part's solver, and by its factor to rounding.
            let (mut work, mut counter, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
            stage.counterforces(shear().strains(), &mut work, &mut counter, &mut stresslets);
            let error = relative_difference(&external, &counter);
            assert!(error < 1e-9, "{size_ratio}: balance {error:e}");
            let (near, forces) = layer.driven(layer.factored(), &external);
            let map = &mut Free::new(&near);
            let motion = layer.iterate((&near, &forces), map, residual).unwrap();
            assert!(motion.found.converged);
            let error = relative_difference(&external, &motion.counter);
            assert!(error < 1e-12, "{size_ratio}: balance {error:e}");
            let error = relative_difference(dense.velocities(), &motion.v);
            assert!(error < 3.0 * residual, "{size_ratio}: factored {error:e}");
            let error = relative_difference(&flat(&expected), &flat(&motion.stresslets));
            assert!(
                error < residual,
                "{size_ratio}: factored stresslets {error:e}"
            );
            let strain = shear().linear().strain();
            let strains = motion
                .stresslets
                .iter()
                .map(|s| s.dot(&strain))
                .sum::<f64>();
            let work = dot(&motion.v, &motion.counter) + strains;
            let error = (work / power - 1.0).abs();
            assert!(
                error < 0.5 * residual,
                "{size_ratio}: factored power {error:e}"
            );
        }
    }
}

#[test]
fn random_forces_alone_have_the_stresslets_of_forces_of_the_user() {
    let layer = Sheared::new(&params(60, 1.5));
    let mut stage = layer.iterated(1e-7);
    stage.assemble(&layer.cell, &layer.centres).unwrap();
    let mut count = 0.0;
    let number = || {
        count += 1.0;
        1.5 * f64::sin(1.9 * count + 0.03 * count * count)
    };
    stage.draw_random_forces(2.0, number, None).unwrap();
    let at_rest = VelocityGradient::at_rest().into();
    stage
        .solve(&at_rest, &[], StageContacts::None, SolvePass::First)
        .unwrap();
    // There are no other forces.
    let mut work = StressWork::default();
    work.update(&stage, &at_rest);
    let (mut scratch, mut forces, mut random) = (Vec::new(), Vec::new(), Vec::new());
    stage.random_stresslets([&mut scratch, &mut forces], &mut random);
    let error = relative_difference(&flat(&work.stresslets), &flat(&random));
    assert!(error < 1e-6, "{error:e}");
    let size = flat(&random).iter().map(|s| s * s).sum::<f64>();
    assert!(size > 1.0, "{size}");
}

#[test]
fn solves_repeat_their_bits_and_refuse_bad_input() {
    let layer = Sheared::new(&params(40, 1.0));
    let (near, forces) = layer.driven(layer.factored(), &external(40));
    let solve = |forces: &[f64]| layer.iterate((&near, forces), &mut Free::new(&near), 1e-6);
    assert_eq!(solve(&forces).unwrap(), solve(&forces).unwrap());
    assert!(matches!(solve(&forces[1..]), Err(Error::Length { .. })));
    assert!(IterativeFarField::new(&layer.cell, &layer.radii, 1e-12).is_err());
    assert!(IterativeFarField::<Layer>::new(&Cell::Unbounded, &layer.radii, 1e-6).is_err());
}

#[test]
fn motion_with_contacts_is_that_of_the_dense_far_field() {
    for (spheres, friction) in [(60, 0.0), (60, 0.3), (150, 0.3)] {
        let layer = Sheared::new(&params(spheres, 1.0));
        let external = vec![0.0; 3 * spheres];
        let surface = Surface {
            friction,
            ..SURFACE
        };
        let dense = layer.solved(layer.dense(), &external, Some(&Laws::rigid(surface)));
        let area = layer.cell.content().unwrap();
        let list = &dense.contacts.list;
        let flow = shear();
        let expected = StressWork::default().stress(&dense, &flow, flow.linear(), area);
        let count = |state| {
            list.iter()
                .filter(|c| c.normal_force > 0.0 && c.state == state)
                .count()
        };
        let counts = [ContactState::Sticking, ContactState::Slipping].map(count);
        assert!(
            friction == 0.0 || counts.iter().all(|&count| count >= 5),
            "{counts:?}"
        );
        let (near, forces) = layer.driven(layer.factored(), &external);
        for residual in [1e-4, 1e-6, 1e-7] {
            let mut contacts = DenseContacts::new(&near, &surface, TIME_SPAN);
            let motion = layer.iterate((&near, &forces), &mut contacts, residual);
            let motion = motion.unwrap();
            assert!(motion.found.residual <= residual);
            let error = relative_difference(dense.velocities(), &motion.v);
            let hydrodynamic: f64 = motion.stresslets.iter().map(|s| strain_tensor(s).2).sum();
            let viscosity = 1.0 + (hydrodynamic + contacts.shear_stress()) / (2.0 * area);
            let (mut squares, mut differences) = (0.0, 0.0);
            for c in list {
                let (f, f_t) = contacts.forces(c.pair.i, c.pair.j);
                squares += c.normal_force.powi(2) + c.tangential_force.powi(2);
                differences += (c.normal_force - f).powi(2) + (c.tangential_force - f_t).powi(2);
            }
            let force_error = (differences / squares).sqrt();
            assert!(error < 2.0 * residual, "{error:e}");
            assert!(force_error < 2.0 * residual, "{force_error:e}");
            assert!(
                (viscosity / expected.viscosity - 1.0).abs() < 0.5 * residual,
                "{viscosity} {}",
                expected.viscosity
            );
        }
    }
}

/// A map with alternating results: its velocities are off by `±size` in turn.
struct Flipping<'a> {
    free: Free<'a>,
    size: f64,
    /// Whether it no longer alternates once bounds are held.
    settles: bool,
}

impl FixedPointMap for Flipping<'_> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        if !(self.settles && progress.holds_bounds) {
            self.size = -self.size;
        }
        self.free.evaluate(forces, progress, velocities)?;
        for (k, v) in velocities[..forces.len() / 2].iter_mut().enumerate() {
            *v += self.size * (k as f64).sin();
        }
        Ok(false)
    }
}

#[test]
fn unconverged_contacts_give_the_best_motion_with_a_flag() {
    let layer = Sheared::new(&params(40, 1.0));
    let external = external(40);
    let dense = layer.solved(layer.dense(), &external, None);
    let settled = dense.velocities();
    let (near, forces) = layer.driven(layer.factored(), &external);
    let solve = |size, settles| {
        let mut map = Flipping {
            free: Free::new(&near),
            size,
            settles,
        };
        layer.iterate((&near, &forces), &mut map, 1e-6)
    };
    let motion = solve(0.0, false).unwrap();
    assert!(motion.found.converged);
    assert!(relative_difference(settled, &motion.v) < 3e-6);
    let found = solve(10.0, true).unwrap().found;
    assert!(found.converged && found.evaluations > 200, "{found:?}");
    let Motion { found, v, .. } = solve(1e-3, false).unwrap();
    assert!(!found.converged && found.evaluations >= 100, "{found:?}");
    assert!(found.residual > 1e-5 && found.residual < 1e-2, "{found:?}");
    assert!(relative_difference(settled, &v) < 0.05);
    let diverged = solve(10.0, false);
    assert!(matches!(diverged, Err(Error::NotConverged { .. })));
}

#[test]
fn near_pairs_of_the_far_field_halve_the_evaluations() {
    let layer = Sheared::new(&params(150, 1.0));
    let [without, with] =
        [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics].map(|hydrodynamics| {
            let (near, forces) = layer.driven(layer.by_pairs(hydrodynamics), &[0.0; 450]);
            let map = &mut Free::new(&near);
            layer.iterate((&near, &forces), map, 1e-6).unwrap()
        });
    let [few, many] = [&with, &without].map(|motion| motion.found.evaluations);
    assert!(3 * few < 2 * many, "{few} {many}");
    assert!(relative_difference(&without.v, &with.v) < 2e-6);
}

/// The iterated far field moves spheres as the dense one; returns both stages. `prepare`: called
/// with both before they are solved.
fn compare(layer: &Sheared, laws: &Laws, prepare: impl Fn(&mut StageSolver)) -> [StageSolver; 2] {
    // Near jamming, velocities differ by up to 2.5 residuals.
    let both = [layer.dense(), layer.iterated(5e-7)].map(|mut stage| {
        prepare(&mut stage);
        layer.solved(stage, &[], Some(laws))
    });
    let error = relative_difference(both[0].velocities(), both[1].velocities());
    assert!(error < 2e-6, "{laws:?}: {error:e}");
    both
}

/// Springs of a stiffness in mu·a·rate, half of it tangentially.
fn springs(stiffness: f64) -> Laws {
    Laws {
        normal: NormalForce {
            law: NormalLaw::LinearSpring.into(),
            stiffness,
            dashpot: 0.0,
        },
        tangential: TangentialLaw::StickSlide,
        tangential_stiffness: 0.5 * stiffness,
        ..Laws::rigid(SURFACE)
    }
}

#[test]
fn contacts_held_pair_by_pair_are_those_of_the_dense_far_field() {
    let rigid = Laws::rigid(SURFACE);
    let coulomb = Laws {
        tangential: TangentialLaw::Coulomb,
        ..rigid
    };
    for spheres in [60, 150] {
        let layer = Sheared::new(&params(spheres, 1.0));
        for laws in [rigid, coulomb, springs(1e5)] {
            let [expected, found] = compare(&layer, &laws, |_| ()).map(|stage| {
                let list = stage.contacts.list.iter();
                let loaded = list.filter(|c| c.normal_force > 0.0);
                let both = loaded.flat_map(|c| [c.normal_force, c.tangential_force]);
                both.collect::<Vec<f64>>()
            });
            assert_eq!(expected.len(), found.len());
            assert!(expected.iter().skip(1).step_by(2).any(|t| *t != 0.0));
            let error = relative_difference(&expected, &found);
            assert!(error < 2e-6, "{spheres}, {laws:?}: {error:e}");
        }
    }
}

#[test]
fn frictionless_spheres_far_apart_move_as_under_the_dense_far_field() {
    // Few near pairs resist a translation of the layer: the iteration diverges unless forces and
    // motion are in the same part.
    let layer = Sheared::new(&Params {
        area_fraction: 0.4,
        ..params(150, 1.0)
    });
    let laws = Laws::rigid(Surface {
        friction: 0.0,
        ..SURFACE
    });
    compare(&layer, &laws, |_| ());
}

#[test]
fn soft_contacts_that_press_hard_are_those_of_the_dense_far_field() {
    // k/Γ = 100: contact forces are large compared with the driving forces, and spheres overlap.
    let laws = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let layer = Sheared::new(&Params {
        area_fraction: 0.76,
        shear_rate: 100.0,
        contact: ContactScheme::Laws(laws),
        ..params(150, 1.0)
    });
    let both = compare(&layer, &springs(6.0 * PI * 100.0), |stage| {
        stage.resistance.regularise(0.001, 0.2);
    });
    let deepest = both[0].closest().unwrap().gap;
    assert!(deepest < -0.005, "{deepest}");
}

#[test]
fn a_dense_layer_of_soft_spheres_continues() {
    // Contact problems solved too inaccurately disturb the iteration, by force differences within
    // their error.
    let laws = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let params = Params {
        area_fraction: 0.76,
        shear_rate: 10.0,
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        contact: ContactScheme::Laws(laws),
        time_step: 0.01,
        ..params(200, 1.0)
    };
    assert_eq!(Method::of(&params), Method::Iterated);
    let mut simulation = Simulation::<Layer>::new(&params, 1, &NearFields::default()).unwrap();
    for _ in 0..20 {
        simulation.step().unwrap();
    }
}
