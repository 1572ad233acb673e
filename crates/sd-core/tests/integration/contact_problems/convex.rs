//! For given friction bounds, the motion minimizes a convex function of the velocities. Here an
//! interior-point method of another library computes it, with the bounds of the solution itself:
//!
//! ```text
//! minimise   vᵀ R v/2 − Fᵀ v + Σ ρ_k s_k + Σ |p_k|²/(2μ)          over v, s and p
//! subject to C v + b ≥ 0,   |D_k v + d_k − p_k| ≤ s_k
//! ```
//!
//! with the rate p at which a tangential spring of compliance μ is stretched, 0 without springs.
//!
//! The two methods share only the resistance, not the contact problem.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus};
use sd_core::cell::Cell;
use sd_core::contact::{Contact, ContactState, Laws, PairForces};
use sd_core::instant::{self, Configuration, InstantContacts};
use sd_core::internals::{OVERLAP_CORRECTION, Resistance};
use sd_core::simulation::SchemeMemory;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Layer, NearFields, Params, RunSpace, Simulation,
    StiffnessUnit, Strains, TangentialLaw, VelocityGradient,
};
use std::f64::consts::FRAC_1_SQRT_2;

/// Weights of velocities, by number.
type Weights = Vec<(usize, f64)>;

/// Kinematics of a contact from the velocities of all spheres.
struct Rows {
    normal: Weights,
    /// Slip, along orthonormal directions, and that of the background.
    slip: Vec<(Weights, f64)>,
}

/// A space with its rows, written out again.
trait Read: RunSpace {
    fn rows(contact: &Contact<Self>) -> Rows;
    /// Components of a friction force along the directions of the slip.
    fn along_slip(contact: &Contact<Self>, force: &Self::Tangent) -> Vec<f64>;
    fn cell(side: f64, offset: f64) -> Cell<Self>;
}

impl Read for Layer {
    fn rows(contact: &Contact) -> Rows {
        let (i, j, n) = (3 * contact.pair.i, 3 * contact.pair.j, contact.pair.normal);
        let [l_i, l_j] = contact.levers;
        Rows {
            normal: vec![(i, -n.x), (i + 1, -n.y), (j, n.x), (j + 1, n.y)],
            slip: vec![(
                vec![
                    (i, n.y),
                    (i + 1, -n.x),
                    (i + 2, -l_i),
                    (j, -n.y),
                    (j + 1, n.x),
                    (j + 2, -l_j),
                ],
                contact.background_slip,
            )],
        }
    }

    fn along_slip(_: &Contact, force: &f64) -> Vec<f64> {
        vec![*force]
    }

    fn cell(side: f64, offset: f64) -> Cell {
        Cell::equal_sides(side, offset).unwrap()
    }
}

impl Read for Bulk {
    fn rows(contact: &Contact<Self>) -> Rows {
        let (i, j, n) = (6 * contact.pair.i, 6 * contact.pair.j, contact.pair.normal);
        let mut normal = Vec::new();
        for k in 0..3 {
            normal.extend([(i + k, -n[k]), (j + k, n[k])]);
        }
        let first = n.cross(&nalgebra::Vector3::ith(n.iamin(), 1.0)).normalize();
        let slip = [first, n.cross(&first)].map(|d| {
            let axis = n.cross(&d);
            let mut weights = Vec::new();
            for k in 0..3 {
                weights.extend([(i + k, -d[k]), (j + k, d[k])]);
                weights.push((i + 3 + k, -contact.levers[0] * axis[k]));
                weights.push((j + 3 + k, -contact.levers[1] * axis[k]));
            }
            (weights, d.dot(&contact.background_slip))
        });
        Rows {
            normal,
            slip: slip.into(),
        }
    }

    fn along_slip(contact: &Contact<Self>, force: &nalgebra::Vector3<f64>) -> Vec<f64> {
        let n = contact.pair.normal;
        let first = n.cross(&nalgebra::Vector3::ith(n.iamin(), 1.0)).normalize();
        vec![first.dot(force), n.cross(&first).dot(force)]
    }

    fn cell(side: f64, offset: f64) -> Cell<Self> {
        Cell::equal_sides(side, offset).unwrap()
    }
}

/// Solves the present instant of a run by both methods; returns the number of sliding contacts.
fn compare<S: Read>(params: &Params, run: &Simulation<S>) -> usize {
    let tables = NearFields::default();
    let n = params.spheres;
    let configuration = Configuration::<S> {
        centres: run.centres().to_vec(),
        radii: run.radii().to_vec(),
        cell: S::cell(run.side(), run.offset_at(run.strain())),
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::<S>::simple_shear(params.direction).into(),
        forces: vec![S::Vector::default(); n],
        torques: vec![S::Spin::default(); n],
    };
    let laws = Laws::new(params.contact.laws(), params.surface());
    let springs = match run.snapshot().memory {
        SchemeMemory::Laws(memory) if laws.tangential_stiffness > 0.0 => memory.springs.forces,
        _ => PairForces::default(),
    };
    let request = InstantContacts::Laws {
        laws,
        lubrication_gap: 0.0,
        time_span: params.time_step,
        springs: springs.clone(),
        rolling_springs: PairForces::default(),
    };
    let found = instant::solve(&configuration, &request, &tables).unwrap();
    let velocities = convex_minimum(
        &configuration,
        &laws,
        params.time_step,
        &found.contacts,
        &springs,
    );
    let expected: Vec<f64> = found
        .disturbances
        .iter()
        .flat_map(|v| v.as_ref().to_vec())
        .collect();
    let largest = expected.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    for (at, (x, y)) in velocities.iter().zip(&expected).enumerate() {
        let error = (x - y).abs() / largest;
        assert!(error < 1e-6, "velocity {at}: {x} and {y}, of {largest}");
    }
    let slides = |c: &&Contact<S>| c.state == ContactState::Slipping;
    found.contacts.iter().filter(slides).count()
}

/// The force of the spring of a contact at the start of the step.
fn spring_force<S: Read>(springs: &PairForces<S>, contact: &Contact<S>) -> S::Tangent {
    let is_own = |spring: &&(u32, u32, S::Tangent)| {
        [spring.0, spring.1].map(|sphere| sphere as usize) == [contact.pair.i, contact.pair.j]
    };
    let spring = springs.0.iter().find(is_own);
    spring.map_or_else(S::Tangent::default, |spring| {
        S::projected(&spring.2, &contact.pair.normal)
    })
}

/// Settings of an accurate solution.
fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        tol_gap_abs: 1e-10,
        tol_gap_rel: 1e-10,
        tol_feas: 1e-10,
        ..DefaultSettings::default()
    }
}

/// The velocities at the minimum.
fn convex_minimum<S: Read>(
    configuration: &Configuration<S>,
    laws: &Laws,
    time_span: f64,
    contacts: &[Contact<S>],
    springs: &PairForces<S>,
) -> Vec<f64> {
    let Configuration {
        centres,
        radii,
        cell,
        hydrodynamics,
        background,
        ..
    } = configuration;
    let mut resistance =
        Resistance::new(*hydrodynamics, cell, radii, &NearFields::default()).unwrap();
    resistance.update(cell, centres).unwrap();
    let size = S::MODES * centres.len();
    let (mut work, mut forces, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
    let mut apply = |velocities: &[f64], strains: Strains<'_, S>| {
        resistance.apply(velocities, strains, &mut work, &mut forces, &mut stresslets);
        forces.clone()
    };
    let drag = apply(&vec![0.0; size], background.strains());
    let sliding: Vec<&Contact<S>> = contacts
        .iter()
        .filter(|c| c.state != ContactState::Frictionless)
        .collect();
    // Springs look ahead by γ of the step.
    let ahead = laws.tangential_stiffness * time_span * (1.0 - FRAC_1_SQRT_2);
    let stretched = if ahead > 0.0 { S::TANGENTS } else { 0 };
    let first_rate = size + sliding.len();
    let unknowns = first_rate + stretched * sliding.len();
    let mut quadratic = (Vec::new(), Vec::new(), Vec::new());
    for column in 0..size {
        let mut unit = vec![0.0; size];
        unit[column] = 1.0;
        let force = apply(&unit, Strains::none());
        for (row, &x) in force.iter().enumerate().take(column + 1) {
            if x != 0.0 {
                quadratic.0.push(row);
                quadratic.1.push(column);
                quadratic.2.push(x);
            }
        }
    }
    for rate in first_rate..unknowns {
        quadratic.0.push(rate);
        quadratic.1.push(rate);
        quadratic.2.push(ahead);
    }
    let p = CscMatrix::new_from_triplets(unknowns, unknowns, quadratic.0, quadratic.1, quadratic.2);
    let mut q = drag;
    q.extend(
        sliding
            .iter()
            .map(|c| laws.surface.friction * c.normal_force),
    );
    q.resize(unknowns, 0.0);
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let (mut b, mut cones) = (Vec::new(), vec![NonnegativeConeT(contacts.len())]);
    let mut put = |weights: &Weights, constant: f64, b: &mut Vec<f64>| {
        for &(column, weight) in weights {
            rows.push(b.len());
            columns.push(column);
            values.push(-weight);
        }
        b.push(constant);
    };
    for contact in contacts {
        let overlap = laws.surface.roughness - contact.pair.gap;
        let share = if overlap > 0.0 {
            OVERLAP_CORRECTION
        } else {
            1.0
        };
        let parting = share * overlap / time_span;
        let constant = contact.background_approach - parting;
        put(&S::rows(contact).normal, constant, &mut b);
    }
    for (k, contact) in sliding.iter().enumerate() {
        put(&vec![(size + k, 1.0)], 0.0, &mut b);
        let slip = S::rows(contact).slip;
        cones.push(SecondOrderConeT(1 + slip.len()));
        let force = spring_force(springs, contact);
        for (d, (mut weights, mut constant)) in slip.into_iter().enumerate() {
            if stretched > 0 {
                weights.push((first_rate + stretched * k + d, -1.0));
                constant += S::along_slip(contact, &force)[d] / ahead;
            }
            put(&weights, constant, &mut b);
        }
    }
    let a = CscMatrix::new_from_triplets(b.len(), unknowns, rows, columns, values);
    let mut solver = DefaultSolver::new(&p, &q, &a, &b, &cones, settings()).unwrap();
    solver.solve();
    let status = solver.solution.status;
    assert!(
        matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved),
        "{status:?}"
    );
    solver.solution.x[..size].to_vec()
}

#[test]
fn recorded_layers_move_as_an_interior_point_method_finds() {
    let (mut compared, mut slide) = (0, 0);
    for recorded in super::recorded("rigid-coulomb") {
        if recorded.flows() && recorded.params.spheres <= 100 {
            let tables = NearFields::default();
            let run =
                Simulation::from_snapshot(&recorded.params, recorded.snapshot, &tables).unwrap();
            slide += compare(&recorded.params, &run);
            compared += 1;
        }
    }
    assert!(
        compared >= 8 && slide > 50,
        "{compared} layers, {slide} contacts slide"
    );
}

/// Rigid contacts with friction, and with tangential springs of a stiffness in units of the flow.
fn choices() -> [ContactLaws; 2] {
    let coulomb = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let springs = ContactLaws {
        tangential: TangentialLaw::StickSlide,
        tangential_stiffness: 300.0,
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::PAPER
    };
    [coulomb, springs]
}

#[test]
fn recorded_layers_with_tangential_springs_move_as_an_interior_point_method_finds() {
    let (mut compared, mut slide) = (0, 0);
    for recorded in super::recorded("rigid-coulomb") {
        if recorded.flows() && recorded.params.spheres <= 100 {
            let params = Params {
                contact: ContactScheme::Laws(choices()[1]),
                ..recorded.params
            };
            let tables = NearFields::default();
            let mut run = Simulation::from_snapshot(&params, recorded.snapshot, &tables).unwrap();
            // Until springs are stretched.
            for _ in 0..4 {
                run.step().unwrap();
            }
            slide += compare::<Layer>(&params, &run);
            compared += 1;
        }
    }
    assert!(
        compared >= 8 && slide > 50,
        "{compared} layers, {slide} contacts slide"
    );
}

#[test]
fn suspensions_with_friction_move_as_an_interior_point_method_finds() {
    let mut slide = 0;
    let [coulomb, springs] = choices();
    for (friction, seed, laws) in [(0.3, 1, coulomb), (1.0, 2, coulomb), (0.3, 1, springs)] {
        let params = Params::builder()
            .spheres(64)
            .volume_fraction(0.5)
            .friction(friction)
            .roughness(0.01)
            .shear_rate(f64::INFINITY)
            .time_step(0.005)
            .contact(ContactScheme::Laws(laws))
            .hydrodynamics(sd_core::Hydrodynamics::BallMelrose)
            .build()
            .unwrap();
        let mut run = Simulation::<Bulk>::new(&params, seed, &NearFields::default()).unwrap();
        for _ in 0..40 {
            run.step().unwrap();
        }
        slide += compare(&params, &run);
    }
    assert!(slide > 5, "{slide} contacts slide");
}
