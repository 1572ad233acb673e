//! Instants and short runs of every contact law against those of an earlier program with separate
//! solvers per law.
//!
//! The records and their origin are described in `tests/data/README.md`. If
//! friction sets in with a jump at a finite critical load, several active sets can be consistent,
//! and the two programs may find different ones. Such instants are counted, and solved again from
//! the recorded forces: the recorded solution must then be found.

#![expect(clippy::print_stdout, reason = "counts what is left out")]

use sd_core::cell::Cell;
use sd_core::contact::{Contact, ContactState, Laws, PairForces, Quality};
use sd_core::internals::{
    ContactList, ContactMemory, IterativeFarField, Resistance, SolvePass, Span, Springs,
    StageContacts, StageSolver, StressWork, WarmStart,
};
use sd_core::model::DEEPEST_OVERLAP;
use sd_core::modes::Vec2;
use sd_core::simulation::{Counters, SNAPSHOT_VERSION, SchemeMemory};
use sd_core::{
    ContactScheme, Error, FrictionOnset, Hydrodynamics, Method, NearFields, Params, Simulation,
    Snapshot, VelocityGradient,
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest difference of velocities, forces and viscosities, over the largest of each.
const LIMIT: f64 = 1e-6;
/// Maximum fraction of instants with another active set.
const OTHER_SETS: f64 = 0.05;
/// Relative residual of the iterated far field.
const FAR_FIELD_RESIDUAL: f64 = 1e-7;

/// One record.
#[derive(Deserialize)]
struct Record {
    params: Params,
    steps: u64,
    side: f64,
    centres: Vec<[f64; 2]>,
    velocities: Vec<f64>,
    listed: Vec<(u32, u32)>,
    memory: Vec<(u32, u32, f64, f64)>,
    instant: Instant,
    run: Vec<(f64, u64)>,
}

/// One solution at the state of a record.
#[derive(Deserialize)]
struct Instant {
    time_span: f64,
    converged: bool,
    consistent: bool,
    viscosity: f64,
    velocities: Vec<f64>,
    contacts: Vec<(usize, usize, f64, f64)>,
}

/// Forces by pair, and the motion.
struct Solved {
    quality: Quality,
    viscosity: f64,
    velocities: Vec<f64>,
    contacts: BTreeMap<(usize, usize), [f64; 2]>,
    /// Contacts on which friction acts below the critical load, or does not above it.
    contradictions: usize,
}

/// Outcome of the records.
#[derive(Debug, Default, PartialEq)]
struct Tally {
    instants: u32,
    /// Instants at which another set of contacts has friction.
    other_sets: u32,
    runs: u32,
    other_runs: u32,
}

impl Record {
    fn memory(&self) -> ContactMemory {
        let springs = self.params.contact.laws().tangential.has_spring();
        let stretched = self.memory.iter().filter(|f| springs && f.3 != 0.0);
        ContactMemory {
            springs: Springs::new(PairForces(
                stretched.map(|&(i, j, _, t)| (i, j, t)).collect(),
            )),
            warm_start: WarmStart {
                forces: self.memory.clone(),
                ..WarmStart::default()
            },
            ..ContactMemory::default()
        }
    }

    fn contact_list(&self) -> ContactList {
        ContactList {
            pairs: self.listed.clone(),
        }
    }

    fn snapshot(&self) -> Snapshot {
        let memory = match self.params.contact {
            ContactScheme::Procedure => SchemeMemory::Procedure {
                contact_list: self.contact_list(),
                velocities: self.velocities.clone(),
            },
            ContactScheme::Rigid | ContactScheme::Laws(_) => SchemeMemory::Laws(self.memory()),
        };
        Snapshot {
            noise_seed: None,
            version: SNAPSHOT_VERSION,
            steps: self.steps,
            radii: vec![1.0; self.params.spheres],
            side: self.side,
            height: 1.0,
            travelled: [0.0; 2],
            viscosity: None,
            centres: self.centres.clone(),
            orientations: vec![0.0; self.params.spheres],
            images: Vec::new(),
            shifts: Vec::new(),
            memory,
            near_pairs: Vec::new(),
            far_field: Vec::new(),
            critical_load: None,
            counters: Counters::default(),
        }
    }

    /// Whether friction begins with a jump.
    fn jumps(&self) -> bool {
        let load = self.params.critical_load();
        let onset = self.params.contact.laws().onset;
        load > 0.0 && load.is_finite() && onset == FrictionOnset::CriticalLoad
    }

    /// The applicable methods of computing.
    fn methods(&self) -> Vec<Method> {
        match (self.params.contact, self.params.hydrodynamics) {
            (ContactScheme::Procedure, _) => vec![Method::Dense],
            (_, Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_)) => {
                vec![Method::Dense, Method::Pairwise]
            }
            // Near jamming the iteration may converge to another active set.
            (_, Hydrodynamics::StokesianDynamics) if self.params.area_fraction <= 0.6 => {
                vec![Method::Dense, Method::Iterated]
            }
            (_, Hydrodynamics::StokesianDynamics) => vec![Method::Dense],
        }
    }

    fn stage(&self, method: Method, cell: &Cell) -> StageSolver {
        let (radii, tables) = (vec![1.0; self.params.spheres], NearFields::default());
        let laws = self.params.contact.laws();
        let regular = |mut resistance: Resistance| {
            if laws.is_soft() {
                resistance.regularise(laws.lubrication_gap, DEEPEST_OVERLAP);
            }
            resistance
        };
        let near = || {
            regular(
                Resistance::new_pairwise(self.params.hydrodynamics, cell, &radii, &tables, &[])
                    .unwrap(),
            )
        };
        match method {
            Method::Dense => {
                let dense = Resistance::new(self.params.hydrodynamics, cell, &radii, &tables);
                StageSolver::new(regular(dense.unwrap()))
            }
            Method::Pairwise => StageSolver::new(near()),
            Method::Iterated => {
                let far = IterativeFarField::new(cell, &radii, FAR_FIELD_RESIDUAL).unwrap();
                StageSolver::with_far_field(near(), far)
            }
        }
    }

    /// Solves the instant, from the forces of the stage before or from the recorded solution.
    fn solve(&self, method: Method, from_solution: bool) -> Result<Solved, Error> {
        let strain = self.steps as f64 * self.params.time_step;
        let cell = Cell::equal_sides(self.side, strain * self.side).unwrap();
        let mut stage = self.stage(method, &cell);
        let centres: Vec<Vec2> = self.centres.iter().map(|x| Vec2::new(x[0], x[1])).collect();
        stage.assemble(&cell, &centres).unwrap();
        let (surface, mut listed, mut memory) =
            (self.params.surface(), self.contact_list(), self.memory());
        if from_solution {
            let pairs = self.instant.contacts.iter();
            #[expect(clippy::cast_possible_truncation, reason = "numbers of spheres")]
            let forces = pairs.map(|&(i, j, f, t)| {
                // The set of sliding contacts must survive the rounding of the recorded digits.
                let bound = surface.friction * f;
                let slides = t.abs() > (1.0 - 1e-6) * bound;
                let t = if slides { bound.copysign(t) } else { t };
                (i as u32, j as u32, f, t)
            });
            memory.warm_start.forces = forces.collect();
        }
        let laws = Laws::new(self.params.contact.laws(), surface);
        let contact = match self.params.contact {
            ContactScheme::Procedure => StageContacts::Procedure {
                surface,
                contact_list: &mut listed,
            },
            ContactScheme::Rigid | ContactScheme::Laws(_) => StageContacts::Laws {
                laws: &laws,
                span: Span::single(self.instant.time_span),
                memory: &mut memory,
            },
        };
        let quality = stage.solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &[],
            contact,
            SolvePass::First,
        )?;
        let area = self.side * self.side;
        let stress = StressWork::default().stress(
            &stage,
            &VelocityGradient::simple_shear(1.0).into(),
            &VelocityGradient::simple_shear(1.0),
            area,
        );
        let loaded = stage.contacts.list.iter().filter(|c| c.normal_force > 0.0);
        let load = surface.critical_load;
        let contradicts = |c: &&Contact| {
            c.normal_force > 0.0
                && (c.normal_force > load) == (c.state == ContactState::Frictionless)
        };
        Ok(Solved {
            contradictions: stage.contacts.list.iter().filter(contradicts).count(),
            quality,
            viscosity: stress.viscosity,
            velocities: stage.velocities().to_vec(),
            contacts: loaded
                .map(|c| ((c.pair.i, c.pair.j), [c.normal_force, c.tangential_force]))
                .collect(),
        })
    }

    fn expected(&self) -> BTreeMap<(usize, usize), [f64; 2]> {
        let contacts = self.instant.contacts.iter();
        contacts.map(|&(i, j, f, t)| ((i, j), [f, t])).collect()
    }

    /// The failure at the instant, if any.
    fn compare(&self, solved: &Solved, limit: f64) -> Option<String> {
        if !solved.quality.converged() {
            return Some(format!("{:?}", solved.quality));
        }
        let fastest = largest(self.instant.velocities.iter().copied());
        let pairs = solved.velocities.iter().zip(&self.instant.velocities);
        let velocity = largest(pairs.map(|(a, b)| a - b)) / fastest;
        let expected = self.expected();
        let most = largest(expected.values().flatten().copied()).max(1.0);
        let of = |map: &BTreeMap<_, _>, pair| map.get(pair).copied().unwrap_or([0.0; 2]);
        let all = expected.keys().chain(solved.contacts.keys());
        let force = largest(all.flat_map(|pair| {
            let (a, b) = (of(&expected, pair), of(&solved.contacts, pair));
            [a[0] - b[0], a[1] - b[1]]
        })) / most;
        let viscosity = (solved.viscosity / self.instant.viscosity - 1.0).abs();
        (velocity.max(force).max(viscosity) > limit).then(|| {
            format!("velocity {velocity:.1e}, force {force:.1e}, viscosity {viscosity:.1e}")
        })
    }

    /// Whether friction acts on other contacts than recorded; negligible forces count as none.
    fn has_other_set(&self, solved: &Solved) -> bool {
        let expected = self.expected();
        let none = 1e-7 * largest(expected.values().flatten().copied());
        let set = |map: &BTreeMap<(usize, usize), [f64; 2]>| -> Vec<(usize, usize)> {
            let acting = map.iter().filter(|(_, force)| force[1].abs() > none);
            acting.map(|(pair, _)| *pair).collect()
        };
        set(&expected) != set(&solved.contacts)
    }

    /// The viscosities of the next steps.
    fn run(&self) -> Vec<(f64, u64)> {
        let tables = NearFields::default();
        let mut simulation =
            Simulation::from_snapshot(&self.params, self.snapshot(), &tables).unwrap();
        let steps = self.run.len().min(2);
        (0..steps)
            .map(|_| {
                let sample = simulation.step().unwrap();
                (sample.viscosity, sample.counters.unconverged_stages)
            })
            .collect()
    }
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Compares all records of a law; prints what fails.
fn check(law: &str) -> (Tally, Vec<String>) {
    let path = format!("tests/data/recorded_laws/{law}.json");
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    let records: Vec<Record> = serde_json::from_str(&text).unwrap();
    let (mut tally, mut failures) = (Tally::default(), Vec::new());
    for record in &records {
        let p = &record.params;
        let what = format!(
            "{law}, {:?}, N = {}, c = {}, nu = {}",
            p.hydrodynamics, p.spheres, p.area_fraction, p.friction
        );
        if !(record.instant.converged && record.instant.consistent) {
            continue;
        }
        let mut other = false;
        for method in record.methods() {
            tally.instants += 1;
            // The far field is iterated to a relative residual of 1e-7 over all spheres: single
            // velocities are less exact.
            let limit = if method == Method::Iterated {
                10.0 * LIMIT
            } else {
                LIMIT
            };
            let solved = match record.solve(method, false) {
                Ok(solved) => solved,
                Err(error) => {
                    failures.push(format!("{what}, {method:?}: {error}"));
                    continue;
                }
            };
            let Some(failure) = record.compare(&solved, limit) else {
                continue;
            };
            if record.jumps() && solved.quality.converged() && record.has_other_set(&solved) {
                tally.other_sets += 1;
                other = true;
                println!(
                    "{what}, {method:?}: friction acts on other contacts, {} contradict; {failure}",
                    solved.contradictions
                );
                let again = record.solve(method, true);
                let failure = match &again {
                    Ok(again) => record.compare(again, limit),
                    Err(error) => Some(error.to_string()),
                };
                if let Some(failure) = failure {
                    failures.push(format!("{what}, {method:?}, from the solution: {failure}"));
                }
            } else {
                failures.push(format!("{what}, {method:?}: {failure}"));
            }
        }
        // Rigid contacts were moved by another method then: the instants are what can be compared.
        let run = if law.starts_with("rigid") {
            Vec::new()
        } else {
            record.run()
        };
        for (step, (found, recorded)) in run.iter().zip(&record.run).enumerate() {
            if found.1 > 0 || recorded.1 > 0 {
                break;
            }
            tally.runs += 1;
            let error = (found.0 / recorded.0 - 1.0).abs();
            if error > LIMIT {
                // At a stage within the step friction may act on other contacts, which is not
                // recorded.
                println!("{what}, step {step}: viscosity {error:.1e}, {other}");
                tally.other_runs += 1;
                break;
            }
        }
    }
    println!("{law}: {tally:?}");
    (tally, failures)
}

/// Checks a law.
fn hold(law: &str) {
    let (tally, failures) = check(law);
    let no_runs = law.starts_with("rigid");
    let enough = tally.instants > 5 && (tally.runs > 5 || no_runs);
    assert!(enough, "{tally:?}");
    assert!(failures.is_empty(), "{failures:#?}");
    let share = f64::from(tally.other_sets) / f64::from(tally.instants);
    assert!(share <= OTHER_SETS, "{tally:?}");
    assert!(
        f64::from(tally.other_runs) <= OTHER_SETS * f64::from(tally.runs),
        "{tally:?}"
    );
}

#[test]
fn rigid_roll_slip_is_as_before() {
    hold("rigid");
}

#[test]
fn procedure_is_as_before() {
    hold("procedure");
}

#[test]
fn rigid_coulomb_is_as_before() {
    hold("rigid-coulomb");
}

#[test]
fn rigid_stick_rotate_is_as_before() {
    hold("rigid-stick-rotate");
}

#[test]
fn spring_roll_slip_is_as_before() {
    hold("spring-roll-slip");
}

#[test]
fn spring_stick_slide_is_as_before() {
    hold("spring-stick-slide");
}

#[test]
fn spring_coulomb_is_as_before() {
    hold("spring-coulomb");
}

#[test]
fn hertz_stick_slide_is_as_before() {
    hold("hertz-stick-slide");
}

#[test]
fn spring_with_reduced_onset_dashpot_and_repulsion_is_as_before() {
    hold("spring-reduced");
}
