//! Whole runs, and right-hand sides in sequence as runs have them, as the tables of
//! `results/published/performance.md`.
//!
//! ```text
//! cargo bench -p sd-core --bench runs -- whole [N...]                 five strains under every law
//! cargo bench -p sd-core --bench runs -- dense                        three strains where friction nearly jams a layer
//! cargo bench -p sd-core --bench runs -- sequence [suspension] [full | lubrication] [LAW] [threads=T] [lead-in=STRAIN] N...
//!                                                                     right-hand sides one after the other
//! ```
//!
//! CPU times of one thread; wall times with several. Random layers, h = 0.01, Γ = 1, and c = 0.693,
//! ν = 0.3 where nothing else is said; suspensions have φ = 0.45. A LAW is one of `roll-slip`,
//! `coulomb`, `stick-slide`; the last one has springs of 1e4 `F_crit`/a, the others are rigid.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "layers/clock.rs"]
mod clock;

use clock::Moment;
use sd_core::model::{ContactLaws, TangentialLaw};
use sd_core::{
    Bulk, ContactScheme, Flow, Hydrodynamics, Layer, LeadingOrder, NearFields, Params, RunSpace,
    Simulation, Threads,
};
use std::time::Instant;

/// Roughness height, in radii.
const ROUGHNESS: f64 = 0.01;
/// Stiffness of springs, in `F_crit`/a.
const STIFFNESS: f64 = 1e4;
/// Strain of the timed runs, and strain after which their viscosity counts.
const RUN: (f64, f64) = (5.0, 2.0);
/// Strain from one sample to the next, the default of campaigns: every second step of half of it,
/// and every longer one.
const SAMPLE_EVERY: f64 = 0.02;
/// CPU time after which a run is stopped, in seconds.
const LIMIT: f64 = 120.0;
/// Time step of the timed runs.
const TIME_STEP: f64 = 0.01;
/// Strain before right-hand sides are timed, unless said otherwise, in steps of so many times the
/// time step; under Ball-Melrose hydrodynamics in place of full Stokesian Dynamics.
const LEAD_IN: (f64, u32) = (0.8, 2);
/// Computing time and number of steps that are timed at least.
const LONG_ENOUGH: (f64, u32) = (4.0, 3);

/// Normal and tangential law.
#[derive(Clone, Copy)]
struct Law {
    name: &'static str,
    tangential: TangentialLaw,
}

const LAWS: [Law; 3] = [
    Law {
        name: "roll-slip",
        tangential: TangentialLaw::RollSlip,
    },
    Law {
        name: "coulomb",
        tangential: TangentialLaw::Coulomb,
    },
    Law {
        name: "stick-slide",
        tangential: TangentialLaw::StickSlide,
    },
];

/// Spheres, and the CPU time in seconds that the public code `LF_DEM` (commit 00fa7cc0) took
/// for the same five strains of soft ones, measured once on the kind of machine that the page
/// names.
const LF_DEM: [(usize, f64); 3] = [(90, 7.3), (400, 62.0), (1000, 208.0)];

/// Spheres, and the CPU time in seconds of one right-hand side of full Stokesian Dynamics in the
/// code that Townsend has published, measured like that of `LF_DEM`.
const TOWNSEND: [(usize, f64); 2] = [(90, 9.3), (400, 255.0)];

impl Law {
    fn is_soft(self) -> bool {
        self.tangential.has_spring()
    }

    fn params(self, spheres: usize) -> Params {
        let laws = if self.is_soft() {
            ContactLaws::linear_spring(STIFFNESS, self.tangential, ROUGHNESS)
        } else {
            ContactLaws {
                tangential: self.tangential,
                ..ContactLaws::PAPER
            }
        };
        Params::builder()
            .spheres(spheres)
            .area_fraction(0.693)
            .roughness(ROUGHNESS)
            .friction(0.3)
            .shear_rate(1.0)
            .hydrodynamics(Hydrodynamics::BallMelrose)
            .contact(ContactScheme::Laws(laws))
            .time_step(TIME_STEP)
            .build()
            .expect("valid parameters")
    }

    fn words(self) -> String {
        let kind = if self.is_soft() { "springs" } else { "rigid" };
        format!("{kind}, {}", self.name)
    }
}

/// A run up to a strain, or as far as it comes within [`LIMIT`].
struct Run {
    seconds: f64,
    stages: u64,
    /// Mean viscosity after the strain from which it counts; no number if the run did not come so
    /// far.
    viscosity: f64,
    end: String,
}

impl Run {
    fn of(params: &Params, strain: f64) -> Self {
        let layer = Simulation::<Layer>::new(params, 1, &NearFields::default());
        let mut layer = layer.expect("valid parameters");
        let stride = if params.time_step > 0.5 * SAMPLE_EVERY {
            1
        } else {
            2
        };
        let (mut total, mut samples) = (0.0, 0_u32);
        let start = Moment::now();
        let end = loop {
            if layer.strain() >= strain - 0.5 * params.time_step {
                break String::new();
            }
            if layer.flow() == Flow::Jammed {
                break format!("jammed at strain {:.2}", layer.strain());
            }
            if start.seconds() > LIMIT {
                break format!("stopped at strain {:.2}", layer.strain());
            }
            let sampled = layer.steps().is_multiple_of(stride);
            match layer.step() {
                Ok(sample) if sampled && sample.strain >= RUN.1.min(0.5 * strain) => {
                    total += sample.viscosity;
                    samples += 1;
                }
                Ok(_) => {}
                Err(error) => break error.to_string(),
            }
        };
        Self {
            seconds: start.seconds(),
            stages: layer.counters().stages,
            viscosity: total / f64::from(samples),
            end,
        }
    }

    /// Its cells of a table.
    fn cells(&self) -> String {
        let note = if self.end.is_empty() {
            String::new()
        } else {
            format!(" ({})", self.end)
        };
        let viscosity = if self.viscosity.is_finite() {
            format!("{:.2}", self.viscosity)
        } else {
            "–".to_owned()
        };
        format!(
            "{} | {:.3} | {:.2} s{note} | {viscosity}",
            self.stages,
            1e3 * self.seconds / self.stages as f64,
            self.seconds
        )
    }
}

/// Runs of five strains under every law.
fn whole(all: &[usize]) {
    println!(
        "| contacts | N | time step | right-hand sides | each, ms | run of {} strains | mean viscosity | LF_DEM | ratio |",
        RUN.0
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for law in LAWS {
        let steps: &[f64] = if law.name == "roll-slip" {
            &[0.025, 0.01]
        } else {
            &[0.01]
        };
        for (&spheres, &time_step) in all.iter().flat_map(|n| steps.iter().map(move |s| (n, s))) {
            let params = Params {
                time_step,
                ..law.params(spheres)
            };
            let run = Run::of(&params, RUN.0);
            let peer = LF_DEM.iter().find(|(n, _)| *n == spheres);
            let peer = peer.map_or_else(
                || "| ".to_owned(),
                |(_, time)| format!("{time} s | {:.2}", run.seconds / time),
            );
            println!(
                "| {} | {spheres} | {time_step} | {} | {peer} |",
                law.words(),
                run.cells()
            );
        }
    }
}

/// Runs of three strains of 200 spheres of two sizes with much friction: close to jamming.
fn dense() {
    println!(
        "| contacts | N | time step | right-hand sides | each, ms | run of 3 strains | mean viscosity |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for law in LAWS {
        let params = Params {
            area_fraction: 0.76,
            friction: 1.0,
            size_ratio: 1.4,
            large_fraction: 0.5,
            ..law.params(200)
        };
        println!(
            "| {} | 200 | {TIME_STEP} | {} |",
            law.words(),
            Run::of(&params, 3.0).cells()
        );
    }
}

/// Peak memory of this process, in MB; `None` where the system does not report it.
fn most_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1e-3 * kilobytes)
}

/// Right-hand sides in sequence, without samples. One row; the memory is that of the process, so
/// that each row is a process of its own.
fn sequence<S: RunSpace>(
    params: &Params,
    hydrodynamics: Hydrodynamics,
    contacts: &str,
    (threads, strain): (usize, f64),
) {
    let tables = NearFields::default();
    let factor = LEAD_IN.1;
    let full = hydrodynamics == Hydrodynamics::StokesianDynamics;
    let time_step = f64::from(factor) * TIME_STEP;
    let coarse = Params {
        time_step,
        hydrodynamics: if full {
            Hydrodynamics::BallMelrose
        } else {
            hydrodynamics
        },
        ..params.clone()
    };
    let mut before = Simulation::<S>::new(&coarse, 1, &tables).expect("valid parameters");
    while before.strain() < strain - 0.5 * time_step {
        before.step().expect("a step that succeeds");
    }
    let mut there = before.snapshot();
    drop(before);
    // Strain is counted in steps.
    there.steps *= u64::from(factor);
    let timed = Params {
        hydrodynamics,
        ..params.clone()
    };
    let mut run = Simulation::from_snapshot(&timed, there, &tables).expect("a valid snapshot");
    run.step().expect("a step that succeeds");
    let (stages, start, begun) = (run.counters().stages, Moment::now(), Instant::now());
    let mut steps = 0;
    while steps < LONG_ENOUGH.1 || begun.elapsed().as_secs_f64() < LONG_ENOUGH.0 {
        run.step().expect("a step that succeeds");
        steps += 1;
    }
    let seconds = if threads > 1 {
        begun.elapsed().as_secs_f64()
    } else {
        start.seconds()
    };
    let each = 1e3 * seconds / (run.counters().stages - stages) as f64;
    let peer = TOWNSEND
        .iter()
        .find(|(n, _)| full && *n == params.spheres && params.volume_fraction.is_none());
    println!(
        "| {} | {contacts} | {} | {steps} | {each:.2} | {} | {} |",
        match hydrodynamics {
            Hydrodynamics::StokesianDynamics => "full",
            Hydrodynamics::BallMelrose => "Ball-Melrose",
            Hydrodynamics::Lubrication(_) => "lubrication",
        },
        params.spheres,
        most_memory().map_or_else(String::new, |memory| format!("{memory:.0} MB")),
        peer.map_or_else(String::new, |(_, time)| format!("{time} s"))
    );
}

fn main() {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| given.iter().any(|given| given == word);
    let spheres: Vec<usize> = given.iter().filter_map(|a| a.parse().ok()).collect();
    if has("whole") {
        whole(if spheres.is_empty() {
            &[90, 400, 1000]
        } else {
            &spheres
        });
    } else if has("dense") {
        dense();
    } else if has("sequence") {
        let law = LAWS.into_iter().find(|law| has(law.name));
        let law = law.unwrap_or(LAWS[0]);
        let hydrodynamics = if has("full") {
            Hydrodynamics::StokesianDynamics
        } else if has("lubrication") {
            Hydrodynamics::Lubrication(LeadingOrder::DEFAULT)
        } else {
            Hydrodynamics::BallMelrose
        };
        let named = |name: &str| given.iter().find_map(|a| a.strip_prefix(name));
        let threads = named("threads=").map_or(1, |n| n.parse().expect("a number of threads"));
        let strain = named("lead-in=").map_or(LEAD_IN.0, |x| x.parse().expect("a strain"));
        let how = (threads, strain);
        let pool = Threads::new(threads).expect("threads");
        let run = |work: &(dyn Fn() + Sync)| pool.run(work);
        for spheres in spheres {
            let mut layer = law.params(spheres);
            if let (Hydrodynamics::Lubrication(_), ContactScheme::Laws(laws)) =
                (hydrodynamics, &mut layer.contact)
            {
                laws.lubrication_gap = 0.0;
            }
            if has("suspension") {
                let suspension = Params {
                    area_fraction: 0.0,
                    volume_fraction: Some(0.45),
                    ..layer
                };
                run(&|| sequence::<Bulk>(&suspension, hydrodynamics, &law.words(), how));
            } else {
                run(&|| sequence::<Layer>(&layer, hydrodynamics, &law.words(), how));
            }
        }
    } else {
        println!("whole, dense or sequence: see the head of benches/runs.rs");
    }
}
