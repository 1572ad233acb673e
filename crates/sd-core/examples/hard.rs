//! Runs every contact law where contact problems are hardest, and counts the outcomes.
//!
//! Dense layers with strong friction, at Γ = 10 so that friction sets in with a jump at some of the
//! contacts: a strain each, in steps of 0.01. With such a jump a consistent active set need not
//! exist: contacts above the critical load without friction, and below it with friction, are
//! counted in the samples of unjammed steps. There is one table for each law, and under all of them
//! a list of the runs that failed, took too long or had stages that did not converge, with the
//! options that run each of them again.
//!
//! `cargo run --release -p sd-core --example hard -- --spheres 50 --seeds 1`; `scripts/hard` runs
//! all and keeps the tables.
#![expect(clippy::print_stdout, reason = "examples print their results")]

#[path = "../benches/layers/clock.rs"]
mod clock;

use clap::Parser;
use clock::Moment;
use rayon::prelude::*;
use sd_core::contact::ContactState;
use sd_core::law::Keywords as _;
use sd_core::simulation::{Counters, Frame};
use sd_core::{
    ContactLaws, ContactScheme, Error, Flow, Hydrodynamics, NearFields, NormalLaw, Params,
    Simulation, TangentialLaw,
};
use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Strain of a run.
const STRAIN: f64 = 1.0;
/// Time step, in strain.
const TIME_STEP: f64 = 0.01;
/// Γ.
const SHEAR_RATE: f64 = 10.0;

/// Normal and tangential law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Law {
    normal: NormalLaw,
    tangential: TangentialLaw,
}

/// The laws that are tried.
#[rustfmt::skip]
const LAWS: [Law; 8] = [
    Law { normal: NormalLaw::Rigid, tangential: TangentialLaw::RollSlip },
    Law { normal: NormalLaw::Rigid, tangential: TangentialLaw::Coulomb },
    Law { normal: NormalLaw::Rigid, tangential: TangentialLaw::StickSlide },
    Law { normal: NormalLaw::Rigid, tangential: TangentialLaw::StickRotate },
    Law { normal: NormalLaw::LinearSpring, tangential: TangentialLaw::RollSlip },
    Law { normal: NormalLaw::LinearSpring, tangential: TangentialLaw::StickSlide },
    Law { normal: NormalLaw::LinearSpring, tangential: TangentialLaw::Coulomb },
    Law { normal: NormalLaw::Hertz, tangential: TangentialLaw::StickSlide },
];

impl Law {
    /// The law with this name.
    fn of_name(name: &str) -> Result<Self, String> {
        let found = LAWS.into_iter().find(|law| law.to_string() == name);
        found.ok_or_else(|| {
            let names: Vec<String> = LAWS.iter().map(Self::to_string).collect();
            format!("the laws are {}", names.join(", "))
        })
    }

    /// The choice of laws, for a roughness height and springs of a stiffness, tangential ones
    /// beside rigid contacts.
    fn choice(self, roughness: f64, stiffness: f64, tangential_stiffness: f64) -> ContactLaws {
        match self.normal {
            NormalLaw::Rigid => ContactLaws {
                tangential: self.tangential,
                tangential_stiffness: if self.tangential.has_spring() {
                    tangential_stiffness
                } else {
                    0.0
                },
                ..ContactLaws::PAPER
            },
            normal => ContactLaws {
                normal,
                ..ContactLaws::linear_spring(stiffness, self.tangential, roughness)
            },
        }
    }
}

impl fmt::Display for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}+{}", self.normal.word(), self.tangential.word())
    }
}

/// The selected runs. Lists are separated by commas.
#[derive(Debug, Clone, Parser)]
#[command(about = "Runs every contact law in dense layers and counts the outcomes")]
pub(crate) struct Part {
    /// Laws, such as rigid+coulomb; all of them unless given
    #[arg(long, value_delimiter = ',', value_parser = Law::of_name, default_values_t = LAWS)]
    law: Vec<Law>,
    /// Area fractions
    #[arg(long, value_delimiter = ',', default_values_t = [0.76, 0.80, 0.82, 0.84])]
    area_fraction: Vec<f64>,
    /// Friction coefficients; laws whose friction has no limit take the first alone
    #[arg(long, value_delimiter = ',', default_values_t = [0.3, 1.0, 10.0])]
    friction: Vec<f64>,
    /// Roughness heights
    #[arg(long, value_delimiter = ',', default_values_t = [0.01, 0.001])]
    roughness: Vec<f64>,
    /// Numbers of spheres
    #[arg(long, value_delimiter = ',', default_values_t = [50, 100, 200])]
    spheres: Vec<usize>,
    /// Stiffness of springs, in F_crit/a; of Hertz's law in F_crit/a^(3/2)
    #[arg(long, default_value_t = 1e4)]
    stiffness: f64,
    /// Stiffness of tangential springs beside rigid contacts, in F_crit/a
    #[arg(long, default_value_t = 1e5)]
    tangential_stiffness: f64,
    /// Coefficient of rolling friction, for compatible laws
    #[arg(long, default_value_t = 0.0)]
    rolling_friction: f64,
    /// How many seeds
    #[arg(long, default_value_t = 2)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Seconds of CPU time after which a run is stopped, checked between steps
    #[arg(long, default_value_t = 60)]
    limit: u64,
    /// Runs in parallel
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

/// One run.
#[derive(Debug, Clone)]
struct Case {
    law: Law,
    params: Params,
    seed: u64,
}

impl Part {
    /// Its runs.
    fn cases(&self) -> Vec<Case> {
        let valid = Params::builder()
            .spheres(100)
            .area_fraction(0.5)
            .roughness(0.01)
            .friction(1.0)
            .shear_rate(SHEAR_RATE)
            .hydrodynamics(Hydrodynamics::BallMelrose)
            .time_step(TIME_STEP)
            .build()
            .expect("values within their ranges");
        let mut cases = Vec::new();
        for &law in &self.law {
            let unlimited = law.tangential.bound(1.0, 1.0).is_infinite();
            let frictions = if unlimited {
                self.friction.get(..1).unwrap_or_default()
            } else {
                &self.friction
            };
            for &area_fraction in &self.area_fraction {
                for &spheres in &self.spheres {
                    for &roughness in &self.roughness {
                        for &friction in frictions {
                            for seed in self.first_seed..self.first_seed + self.seeds {
                                // A case out of range is refused where it is run.
                                let mut params = Params {
                                    spheres,
                                    area_fraction,
                                    roughness,
                                    friction,
                                    contact: ContactScheme::Laws(ContactLaws {
                                        rolling_friction: self.rolling_friction,
                                        ..law.choice(
                                            roughness,
                                            self.stiffness,
                                            self.tangential_stiffness,
                                        )
                                    }),
                                    ..valid.clone()
                                };
                                params.canonicalise();
                                cases.push(Case { law, params, seed });
                            }
                        }
                    }
                }
            }
        }
        cases
    }
}

impl Case {
    /// The options to repeat it.
    fn options(&self) -> String {
        let Params {
            area_fraction,
            friction,
            roughness,
            spheres,
            ..
        } = self.params;
        let mut options = format!(
            "--law {} --area-fraction {area_fraction} --friction {friction} --roughness {roughness} --spheres {spheres}",
            self.law
        );
        let rolling_friction = self.params.contact.laws().rolling_friction;
        if rolling_friction > 0.0 {
            let _ = write!(options, " --rolling-friction {rolling_friction}");
        }
        let laws = self.params.contact.laws();
        if laws.has_rigid_springs() {
            let _ = write!(
                options,
                " --tangential-stiffness {:e}",
                laws.tangential_stiffness
            );
        }
        let stiffness = laws.stiffness;
        if stiffness.is_finite() {
            let _ = write!(options, " --stiffness {stiffness:e}");
        }
        let _ = write!(options, " --seeds 1 --first-seed {}", self.seed);
        options
    }

    /// Runs it; a panic is a failure like others.
    fn run(&self, limit: f64, tables: &NearFields) -> Ran {
        let run = AssertUnwindSafe(|| self.step_through(limit, tables));
        catch_unwind(run).unwrap_or_else(|_| Ran::without_steps(End::Failed("a panic"), "a panic"))
    }

    /// Makes steps until the strain is reached or the run ends.
    fn step_through(&self, limit: f64, tables: &NearFields) -> Ran {
        let started = Moment::now();
        let mut layer = match Simulation::<sd_core::Layer>::new(&self.params, self.seed, tables) {
            Ok(layer) => layer,
            Err(error @ Error::CannotPack { .. }) => {
                return Ran::without_steps(End::NotPacked, &error.to_string());
            }
            Err(error) => {
                return Ran::without_steps(End::Failed(cause(&error)), &error.to_string());
            }
        };
        let mut seconds = Vec::new();
        let mut onset = Onset::default();
        let load = self.params.surface().critical_load;
        let (end, note) = loop {
            if layer.flow() == Flow::Jammed {
                break (End::Jammed, format!("at strain {:.2}", layer.strain()));
            }
            if layer.strain() >= STRAIN - 0.5 * TIME_STEP {
                break (End::Done, String::new());
            }
            if started.seconds() > limit {
                break (End::Stopped, format!("at strain {:.2}", layer.strain()));
            }
            let jammed = layer.counters().jammed_stages;
            let moment = Moment::now();
            let frame = match layer.step_with_frame() {
                Ok((_, frame)) => frame,
                Err(error) => break (End::Failed(cause(&error)), error.to_string()),
            };
            seconds.push(moment.seconds());
            // Forces of a jammed layer are those of yielding contacts.
            if layer.counters().jammed_stages == jammed {
                onset.count(&frame, load);
            }
        };
        seconds.sort_by(f64::total_cmp);
        let median = seconds.get(seconds.len() / 2);
        Ran {
            end,
            note,
            counters: *layer.counters(),
            systems: layer.linear_systems(),
            onset,
            slowest: seconds
                .last()
                .zip(median)
                .map(|(most, middle)| most / middle),
        }
    }
}

/// Outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// At its full strain.
    Done,
    /// The layer jammed, which is a result.
    Jammed,
    /// No layer of this area fraction was found.
    NotPacked,
    /// With an error, or a panic.
    Failed(&'static str),
    /// At the limit of time.
    Stopped,
}

/// The kind of an error, in a word or two.
fn cause(error: &Error) -> &'static str {
    match error {
        Error::Step { source, .. } => cause(source),
        Error::Overlap { .. } => "overlap",
        Error::NotPositiveDefinite { .. } => "not positive definite",
        Error::NotFinite { .. } => "not finite",
        Error::OutOfRange { .. } | Error::Refused(_) | Error::CellTooSmall { .. } => "refused",
        _ => "other",
    }
}

/// Contacts of samples, and those whose friction does not agree with their load.
#[derive(Debug, Default, Clone, Copy)]
struct Onset {
    contacts: u64,
    /// Above the critical load, without friction.
    without: u64,
    /// Below it, with friction.
    with: u64,
}

impl Onset {
    /// Counts the contacts of one sample. `load`: the critical one, in mu·a²·rate.
    fn count(&mut self, frame: &Frame, load: f64) {
        for contact in &frame.contacts {
            let is_loaded = contact.normal_force > load;
            let has_friction = contact.state != ContactState::Frictionless;
            self.contacts += 1;
            self.without += u64::from(is_loaded && !has_friction);
            self.with += u64::from(!is_loaded && has_friction);
        }
    }

    /// The second and third number over the first, in percent.
    fn shares(self) -> [f64; 2] {
        [self.without, self.with].map(|part| 100.0 * part as f64 / self.contacts.max(1) as f64)
    }
}

/// The result of one run.
#[derive(Debug)]
struct Ran {
    end: End,
    /// Description of its end.
    note: String,
    counters: Counters,
    /// Linear systems of contact problems.
    systems: u64,
    onset: Onset,
    /// Computing time of its slowest step over that of its median one.
    slowest: Option<f64>,
}

impl Ran {
    /// A run that never moved.
    fn without_steps(end: End, note: &str) -> Self {
        Self {
            end,
            note: note.into(),
            counters: Counters::default(),
            systems: 0,
            onset: Onset::default(),
            slowest: None,
        }
    }

    /// Whether it is a failure of the solver.
    fn is_bad(&self) -> bool {
        matches!(self.end, End::Failed(_) | End::Stopped) || self.counters.unconverged_stages > 0
    }
}

/// One line of a table: counts over runs.
#[derive(Debug, Default)]
struct Row {
    runs: u32,
    done: u32,
    jammed: u32,
    not_packed: u32,
    stopped: u32,
    failed: BTreeMap<&'static str, u32>,
    stages: u64,
    unconverged: u64,
    jammed_stages: u64,
    systems: u64,
    onset: Onset,
    slowest: f64,
}

impl Row {
    /// The counts of these runs.
    fn of<'r>(runs: impl Iterator<Item = &'r Ran>) -> Self {
        let mut row = Self::default();
        for ran in runs {
            row.runs += 1;
            match ran.end {
                End::Done => row.done += 1,
                End::Jammed => row.jammed += 1,
                End::NotPacked => row.not_packed += 1,
                End::Stopped => row.stopped += 1,
                End::Failed(cause) => *row.failed.entry(cause).or_default() += 1,
            }
            row.stages += ran.counters.stages;
            row.unconverged += ran.counters.unconverged_stages;
            row.jammed_stages += ran.counters.jammed_stages;
            row.systems += ran.systems;
            row.onset.contacts += ran.onset.contacts;
            row.onset.without += ran.onset.without;
            row.onset.with += ran.onset.with;
            row.slowest = row.slowest.max(ran.slowest.unwrap_or(0.0));
        }
        row
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let failed: Vec<String> = self
            .failed
            .iter()
            .map(|(cause, count)| format!("{count} {cause}"))
            .collect();
        let failed = if failed.is_empty() {
            "0".into()
        } else {
            failed.join(", ")
        };
        let [without, with] = self.onset.shares();
        let share = 100.0 * self.unconverged as f64 / self.stages.max(1) as f64;
        let systems = self.systems as f64 / self.stages.max(1) as f64;
        write!(
            f,
            "{} | {} | {} | {} | {failed} | {} | {} | {} ({share:.3} %) | {} | {systems:.1} | {without:.2} % | {with:.2} % | {:.0} |",
            self.runs,
            self.done,
            self.jammed,
            self.not_packed,
            self.stopped,
            self.stages,
            self.unconverged,
            self.jammed_stages,
            self.slowest,
        )
    }
}

/// Makes the runs of a part; the tables.
pub(crate) fn tables(part: &Part) -> Result<String, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(part.threads)
        .build()?;
    let (fields, cases) = (NearFields::default(), part.cases());
    let limit = part.limit as f64;
    // In blocks of one, so that slow runs are spread over the threads.
    let ran: Vec<Ran> = pool.install(|| {
        let runs = cases.par_iter().with_max_len(1);
        runs.map(|case| case.run(limit, &fields)).collect()
    });
    let mut text = String::new();
    for law in &part.law {
        write_law(&mut text, *law, part, cases.iter().zip(&ran));
    }
    let bad: Vec<(&Case, &Ran)> = cases
        .iter()
        .zip(&ran)
        .filter(|(_, ran)| ran.is_bad())
        .collect();
    text.push_str("## Runs to inspect\n\n");
    if bad.is_empty() {
        text.push_str("None failed, took too long or had a stage that did not converge.\n");
        return Ok(text);
    }
    text.push_str("| options of `scripts/hard` | end | unconverged stages | worst residual | friction error |\n");
    text.push_str("| --- | --- | ---: | ---: | ---: |\n");
    for (case, ran) in bad {
        let end = match ran.end {
            End::Done => "done".into(),
            End::Jammed => format!("jammed {}", ran.note),
            End::NotPacked => "not packed".into(),
            End::Failed(_) => ran.note.clone(),
            End::Stopped => format!("stopped {}", ran.note),
        };
        let counters = &ran.counters;
        let _ = writeln!(
            text,
            "| `{}` | {end} | {} of {} | {:.1e} | {:.1e} |",
            case.options(),
            counters.unconverged_stages,
            counters.stages,
            counters.worst_residual,
            counters.worst_friction_error,
        );
    }
    Ok(text)
}

/// The table of one law: a line for every area fraction, and one for all.
fn write_law<'r>(
    text: &mut String,
    law: Law,
    part: &Part,
    runs: impl Iterator<Item = (&'r Case, &'r Ran)> + Clone,
) {
    let of_law = runs.filter(|(case, _)| case.law == law);
    let _ = writeln!(text, "## `{law}`\n");
    text.push_str("| c | runs | done | jammed | not packed | failed | stopped | stages | unconverged | jammed stages | systems per stage | above F_crit without friction | below it with friction | slowest step over the median |\n");
    text.push_str(
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for &c in &part.area_fraction {
        let there = of_law
            .clone()
            .filter(|(case, _)| case.params.area_fraction == c);
        let _ = writeln!(text, "| {c} | {}", Row::of(there.map(|(_, ran)| ran)));
    }
    let _ = writeln!(text, "| all | {}\n", Row::of(of_law.map(|(_, ran)| ran)));
}

/// Runs the part selected on the command line.
pub(crate) fn main() -> Result<(), rayon::ThreadPoolBuildError> {
    print!("{}", tables(&Part::parse())?);
    Ok(())
}
