//! The iterated far field against the dense one.

mod dense_contacts;

use crate::contact::contact_solver::{AppliedForces, StageInput};
use crate::contact::laws::{Laws, NormalForce, Span};
use crate::contact::{Contact, ContactMemory, ContactSolver, ContactState, SolvePass, Surface};
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::dense::{add_scaled, dot};
use crate::space::cell::Cell;
use crate::space::modes::{Vec2, strain_tensor};
use crate::space::{IncidentFlow, Layer, Strains, VelocityGradient};
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

/// A layer after a strain of 0.3: cell, centres, radii.
fn sheared(params: &Params) -> (Cell, Vec<Vec2>, Vec<f64>) {
    let mut simulation =
        Simulation::<crate::Layer>::new(params, 1, &NearFields::default()).unwrap();
    for _ in 0..60 {
        simulation.step().unwrap();
    }
    let snapshot = simulation.snapshot();
    let cell = Cell::equal_sides(snapshot.side, 0.3 * snapshot.side).unwrap();
    let centres = snapshot.centres.iter().map(|x| Vec2::new(x[0], x[1]));
    (cell, centres.collect(), snapshot.radii)
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

/// The sparse resistance below an iterated far field, at given positions, and its forces.
fn driven(
    mut near: Resistance,
    cell: &Cell,
    centres: &[Vec2],
    external: &[f64],
) -> (Resistance, Vec<f64>) {
    near.update(cell, centres).unwrap();
    let mut forces = vec![0.0; external.len()];
    near.background_forces(
        Strains::Uniform(VelocityGradient::<Layer>::simple_shear(1.0).strain()),
        &mut forces,
    );
    add_scaled(&mut forces, external, 1.0);
    (near, forces)
}

/// Ball-Melrose, factored.
fn near_factored(
    cell: &Cell,
    centres: &[Vec2],
    radii: &[f64],
    external: &[f64],
) -> (Resistance, Vec<f64>) {
    let tables = NearFields::default();
    let near = Resistance::new(Hydrodynamics::BallMelrose, cell, radii, &tables).unwrap();
    driven(near, cell, centres, external)
}

/// Stored pair by pair; under Stokesian Dynamics with the far field of near pairs.
fn near_by_pairs(hydrodynamics: Hydrodynamics, cell: &Cell, radii: &[f64]) -> Resistance {
    let tables = NearFields::default();
    Resistance::new_pairwise(hydrodynamics, cell, radii, &tables, &[]).unwrap()
}

/// Full Stokesian Dynamics with more accurate periodic sums than default.
fn dense_resistance(cell: &Cell, radii: &[f64]) -> Resistance {
    Resistance::new_dense(cell, radii, &NearFields::default(), 1e-13).unwrap()
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
            resistance: self.near,
            flow: &VelocityGradient::simple_shear(1.0).into(),
            laws: &Laws::NONE,
            span: Span::single(1.0),
        };
        let pass = match progress.evaluations {
            0 => SolvePass::First,
            _ => SolvePass::FixedActivation,
        };
        let applied = AppliedForces::both(&forces[..v.len()]);
        self.contacts
            .solve(&input, applied, &mut self.memory, pass, v)?;
        Ok(false)
    }
}

#[test]
fn linear_motion_is_that_of_the_dense_far_field() {
    for size_ratio in [1.0, 1.5] {
        let (cell, centres, radii) = sheared(&params(60, size_ratio));
        let external = external(60);
        let mut dense = StageSolver::new(dense_resistance(&cell, &radii));
        let shear = IncidentFlow::from(VelocityGradient::simple_shear(1.0));
        let free = |stage: &mut StageSolver| {
            stage.assemble(&cell, &centres).unwrap();
            let free = StageContacts::None;
            stage
                .solve(&shear, &external, free, SolvePass::First)
                .unwrap();
            let mut work = StressWork::default();
            let power = work.update(stage, &shear);
            (work.stresslets, power)
        };
        let (expected, power) = free(&mut dense);
        for residual in [1e-4, 1e-6, 1e-7] {
            let near = near_by_pairs(Hydrodynamics::StokesianDynamics, &cell, &radii);
            let far = IterativeFarField::new(&cell, &radii, residual).unwrap();
            let mut stage = StageSolver::with_far_field(near, far);
            let (stresslets, found_power) = free(&mut stage);
            assert!(stage.contacts.list.is_empty());
            let v = stage.velocities();
            let error = relative_difference(dense.velocities(), v);
            assert!(error < 3.0 * residual, "{size_ratio}: {error:e}");
            let error = relative_difference(&flat(&expected), &flat(&stresslets));
            assert!(error < residual, "{size_ratio}: stresslets {error:e}");
            let error = (found_power / power - 1.0).abs();
            assert!(error < 0.5 * residual, "{size_ratio}: {error:e}");
            // The forces of the fluid balance those on the spheres: pair by pair to the tolerance
            // of the near part's solver, and by its factor to rounding.
            let (mut work, mut counter, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
            stage.counterforces(shear.strains(), &mut work, &mut counter, &mut stresslets);
            let error = relative_difference(&external, &counter);
            assert!(error < 1e-9, "{size_ratio}: balance {error:e}");
            let (near, forces) = near_factored(&cell, &centres, &radii, &external);
            let mut far = IterativeFarField::new(&cell, &radii, residual).unwrap();
            far.update(&cell, &centres).unwrap();
            let (mut v, strain) = (vec![0.0; 180], shear.linear().strain());
            let free = &mut Free::new(&near);
            let found =
                far.solve_fixed_point(&near, free, Strains::Uniform(strain), &forces, &mut v);
            assert!(found.unwrap().converged);
            near.apply(
                &v,
                Strains::Uniform(strain),
                &mut work,
                &mut counter,
                &mut stresslets,
            );
            far.correct(&mut counter, &mut stresslets);
            let error = relative_difference(&external, &counter);
            assert!(error < 1e-12, "{size_ratio}: balance {error:e}");
            let error = relative_difference(dense.velocities(), &v);
            assert!(error < 3.0 * residual, "{size_ratio}: factored {error:e}");
            let error = relative_difference(&flat(&expected), &flat(&stresslets));
            assert!(
                error < residual,
                "{size_ratio}: factored stresslets {error:e}"
            );
            let work = dot(&v, &counter) + stresslets.iter().map(|s| s.dot(&strain)).sum::<f64>();
            let error = (work / power - 1.0).abs();
            assert!(
                error < 0.5 * residual,
                "{size_ratio}: factored power {error:e}"
            );
        }
    }
}

#[test]
fn solves_repeat_their_bits_and_refuse_bad_input() {
    let (cell, centres, radii) = sheared(&params(40, 1.0));
    let (near, forces) = near_factored(&cell, &centres, &radii, &external(40));
    let mut far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
    far.update(&cell, &centres).unwrap();
    let strain = VelocityGradient::<Layer>::simple_shear(1.0).strain();
    let mut solve = |forces: &[f64]| {
        far.reset();
        let mut v = vec![0.0; 120];
        let found = far.solve_fixed_point(
            &near,
            &mut Free::new(&near),
            Strains::Uniform(strain),
            forces,
            &mut v,
        );
        found.map(|found| (found, v))
    };
    assert_eq!(solve(&forces).unwrap(), solve(&forces).unwrap());
    assert!(matches!(solve(&forces[1..]), Err(Error::Length { .. })));
    assert!(IterativeFarField::new(&cell, &radii, 1e-12).is_err());
    assert!(IterativeFarField::<Layer>::new(&Cell::Unbounded, &radii, 1e-6).is_err());
}

#[test]
fn motion_with_contacts_is_that_of_the_dense_far_field() {
    for (spheres, friction) in [(60, 0.0), (60, 0.3), (150, 0.3)] {
        let (cell, centres, radii) = sheared(&params(spheres, 1.0));
        let external = vec![0.0; 3 * spheres];
        let mut dense = StageSolver::new(dense_resistance(&cell, &radii));
        let shear = IncidentFlow::from(VelocityGradient::simple_shear(1.0));
        let surface = Surface {
            roughness: 0.01,
            friction,
            critical_load: 0.0,
        };
        let time_span = 0.0025;
        let contact = StageContacts::Laws {
            laws: &Laws::rigid(surface),
            span: Span::single(time_span),
            memory: &mut ContactMemory::default(),
        };
        dense.assemble(&cell, &centres).unwrap();
        let quality = dense
            .solve(&shear, &external, contact, SolvePass::First)
            .unwrap();
        assert!(quality.converged(), "{quality:?}");
        let area = cell.content().unwrap();
        let list = &dense.contacts.list;
        let expected = StressWork::default().stress(&dense, &shear, shear.linear(), area);
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
        let (near, forces) = near_factored(&cell, &centres, &radii, &external);
        let strain = shear.linear().strain();
        for residual in [1e-4, 1e-6, 1e-7] {
            let mut far = IterativeFarField::new(&cell, &radii, residual).unwrap();
            far.update(&cell, &centres).unwrap();
            let mut contacts = DenseContacts::new(&near, &surface, time_span);
            let mut v = vec![0.0; 3 * spheres];
            let found = far.solve_fixed_point(
                &near,
                &mut contacts,
                Strains::Uniform(strain),
                &forces,
                &mut v,
            );
            assert!(found.unwrap().residual <= residual);
            let error = relative_difference(dense.velocities(), &v);
            let (mut work, mut counter, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
            near.apply(
                &v,
                Strains::Uniform(strain),
                &mut work,
                &mut counter,
                &mut stresslets,
            );
            far.correct(&mut counter, &mut stresslets);
            let hydrodynamic: f64 = stresslets.iter().map(|s| strain_tensor(s).2).sum();
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
    let (cell, centres, radii) = sheared(&params(40, 1.0));
    let external = external(40);
    let mut dense = StageSolver::new(dense_resistance(&cell, &radii));
    dense.assemble(&cell, &centres).unwrap();
    let shear = IncidentFlow::from(VelocityGradient::simple_shear(1.0));
    let free = StageContacts::None;
    dense
        .solve(&shear, &external, free, SolvePass::First)
        .unwrap();
    let settled = dense.velocities();
    let (near, forces) = near_factored(&cell, &centres, &radii, &external);
    let strain = shear.linear().strain();
    let mut far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
    far.update(&cell, &centres).unwrap();
    let mut v = vec![0.0; 120];
    let mut solve = |size, settles, v: &mut [f64]| {
        far.reset();
        let mut map = Flipping {
            free: Free::new(&near),
            size,
            settles,
        };
        far.solve_fixed_point(&near, &mut map, Strains::Uniform(strain), &forces, v)
    };
    assert!(solve(0.0, false, &mut v).unwrap().converged);
    assert!(relative_difference(settled, &v) < 3e-6);
    let found = solve(10.0, true, &mut v).unwrap();
    assert!(found.converged && found.evaluations > 200, "{found:?}");
    let found = solve(1e-3, false, &mut v).unwrap();
    assert!(!found.converged && found.evaluations >= 100, "{found:?}");
    assert!(found.residual > 1e-5 && found.residual < 1e-2, "{found:?}");
    assert!(relative_difference(settled, &v) < 0.05);
    assert!(matches!(
        solve(10.0, false, &mut v),
        Err(Error::NotConverged { .. })
    ));
}

#[test]
fn near_pairs_of_the_far_field_halve_the_evaluations() {
    let (cell, centres, radii) = sheared(&params(150, 1.0));
    let strain = VelocityGradient::<Layer>::simple_shear(1.0).strain();
    let [without, with] =
        [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics].map(|hydrodynamics| {
            let near = near_by_pairs(hydrodynamics, &cell, &radii);
            let (near, forces) = driven(near, &cell, &centres, &[0.0; 450]);
            let mut far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
            far.update(&cell, &centres).unwrap();
            let mut v = vec![0.0; 450];
            let found = far.solve_fixed_point(
                &near,
                &mut Free::new(&near),
                Strains::Uniform(strain),
                &forces,
                &mut v,
            );
            (found.unwrap().evaluations, v)
        });
    assert!(3 * with.0 < 2 * without.0, "{} {}", with.0, without.0);
    assert!(relative_difference(&without.1, &with.1) < 2e-6);
}

#[test]
fn contacts_held_pair_by_pair_are_those_of_the_dense_far_field() {
    let rigid = Laws::rigid(Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    });
    let soft = Laws {
        normal: NormalForce {
            law: NormalLaw::LinearSpring.into(),
            stiffness: 1e5,
            dashpot: 0.0,
        },
        tangential: TangentialLaw::StickSlide,
        tangential_stiffness: 5e4,
        ..rigid
    };
    let coulomb = Laws {
        tangential: TangentialLaw::Coulomb,
        ..rigid
    };
    for spheres in [60, 150] {
        let (cell, centres, radii) = sheared(&params(spheres, 1.0));
        for laws in [rigid, coulomb, soft] {
            let solve = |mut stage: StageSolver| {
                stage.assemble(&cell, &centres).unwrap();
                let contact = StageContacts::Laws {
                    laws: &laws,
                    span: Span::single(0.0025),
                    memory: &mut ContactMemory::default(),
                };
                let quality = stage
                    .solve(
                        &VelocityGradient::simple_shear(1.0).into(),
                        &[],
                        contact,
                        SolvePass::First,
                    )
                    .unwrap();
                assert!(quality.converged(), "{laws:?}: {quality:?}");
                stage
            };
            let dense = solve(StageSolver::new(dense_resistance(&cell, &radii)));
            let near = near_by_pairs(Hydrodynamics::StokesianDynamics, &cell, &radii);
            let far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
            let iterated = solve(StageSolver::with_far_field(near, far));
            let error = relative_difference(dense.velocities(), iterated.velocities());
            assert!(error < 2e-6, "{spheres}, {laws:?}: {error:e}");
            let both = |list: &[Contact]| -> Vec<f64> {
                let loaded = list.iter().filter(|c| c.normal_force > 0.0);
                loaded
                    .flat_map(|c| [c.normal_force, c.tangential_force])
                    .collect()
            };
            let (expected, found) = (both(&dense.contacts.list), both(&iterated.contacts.list));
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
    let (cell, centres, radii) = sheared(&Params {
        area_fraction: 0.4,
        ..params(150, 1.0)
    });
    let laws = Laws::rigid(Surface {
        roughness: 0.01,
        friction: 0.0,
        critical_load: 0.0,
    });
    let solve = |mut stage: StageSolver| {
        stage.assemble(&cell, &centres).unwrap();
        let contact = StageContacts::Laws {
            laws: &laws,
            span: Span::single(0.0025),
            memory: &mut ContactMemory::default(),
        };
        let quality = stage
            .solve(
                &VelocityGradient::simple_shear(1.0).into(),
                &[],
                contact,
                SolvePass::First,
            )
            .unwrap();
        assert!(quality.converged(), "{quality:?}");
        stage.velocities().to_vec()
    };
    let dense = solve(StageSolver::new(dense_resistance(&cell, &radii)));
    let near = near_by_pairs(Hydrodynamics::StokesianDynamics, &cell, &radii);
    let far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
    let iterated = solve(StageSolver::with_far_field(near, far));
    let error = relative_difference(&dense, &iterated);
    assert!(error < 2e-6, "{error:e}");
}

#[test]
fn soft_contacts_that_press_hard_are_those_of_the_dense_far_field() {
    // k/Γ = 100: contact forces are large compared with the driving forces, and spheres overlap.
    let laws = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let (cell, centres, radii) = sheared(&Params {
        area_fraction: 0.76,
        shear_rate: 100.0,
        contact: ContactScheme::Laws(laws),
        ..params(150, 1.0)
    });
    let stiffness = 6.0 * PI * 100.0;
    let laws = Laws {
        normal: NormalForce {
            law: NormalLaw::LinearSpring.into(),
            stiffness,
            dashpot: 0.0,
        },
        tangential: TangentialLaw::StickSlide,
        tangential_stiffness: 0.5 * stiffness,
        ..Laws::rigid(Surface {
            roughness: 0.01,
            friction: 0.3,
            critical_load: 0.0,
        })
    };
    let solve = |mut stage: StageSolver| {
        stage.resistance.regularise(0.001, 0.2);
        stage.assemble(&cell, &centres).unwrap();
        let deepest = stage.closest().unwrap().gap;
        assert!(deepest < -0.005, "{deepest}");
        let contact = StageContacts::Laws {
            laws: &laws,
            span: Span::single(0.0025),
            memory: &mut ContactMemory::default(),
        };
        let quality = stage
            .solve(
                &VelocityGradient::simple_shear(1.0).into(),
                &[],
                contact,
                SolvePass::First,
            )
            .unwrap();
        assert!(quality.converged(), "{quality:?}");
        stage.velocities().to_vec()
    };
    let dense = solve(StageSolver::new(dense_resistance(&cell, &radii)));
    let near = near_by_pairs(Hydrodynamics::StokesianDynamics, &cell, &radii);
    let far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
    let iterated = solve(StageSolver::with_far_field(near, far));
    let error = relative_difference(&dense, &iterated);
    assert!(error < 2e-6, "{error:e}");
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
    let mut simulation =
        Simulation::<crate::Layer>::new(&params, 1, &NearFields::default()).unwrap();
    for _ in 0..20 {
        simulation.step().unwrap();
    }
}
