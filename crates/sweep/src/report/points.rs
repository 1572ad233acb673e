//! The points of a campaign: what its store holds, averaged over the runs that differ only in their seed.

use super::columns::Columns;
use super::error::ReportError;
use super::failures::FailureGroup;
use super::selection::Selection;
use super::steady;
use super::units::{At, Units};
use crate::axes::{Axis, identity};
use crate::campaign::Discard;
use crate::case::State;
use crate::doubt::is_rigid;
use crate::model::stresses::{COUNT, STRESSES};
use crate::statistics::{
    Decision, Distribution, Drift, Estimate, Measure, Precision, mean, ratio, relative_half_width,
};
use crate::store::{Counts, PointRun, Provenance, Store};
use sd_core::Params;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Failures listed in a report.
const FAILURES_SHOWN: usize = 10;

/// A campaign's results so far.
#[derive(Debug, Clone)]
pub struct Report {
    /// Name of the campaign.
    pub campaign: String,
    /// Which of its points it is about.
    pub selection: Selection,
    /// Which columns its tables have.
    pub columns: Columns,
    /// Their cases by state.
    pub counts: Counts,
    /// Finished runs among them whose numbers are doubtful.
    pub doubtful: u64,
    /// Whether these are averaged all the same.
    pub with_doubtful: bool,
    /// What is discarded from every run.
    pub discard: Discard,
    /// The points in the order of the file.
    pub points: Vec<Point>,
    /// Their first failures, those that are alike together.
    pub failures: Vec<FailureGroup>,
    /// Seconds of computing their results took, over all workers.
    pub computing: f64,
    /// The same by the processor, as far as it is known.
    pub processor: f64,
    /// Processes that finished results of the store, the latest first.
    pub provenance: Vec<Provenance>,
    /// The keys of its runs with a result.
    pub keys: Vec<String>,
    /// The units of its numbers.
    pub units: Units,
}

/// All runs that differ only in their seed.
#[derive(Debug, Clone)]
pub struct Point {
    /// Their parameters.
    pub params: Params,
    /// Runs averaged.
    pub seeds: u64,
    /// Runs that ended jammed: counted, not averaged.
    pub jammed: u64,
    /// Runs that failed.
    pub failed: u64,
    /// Finished runs whose numbers are doubtful: counted, and averaged only if that was asked for.
    pub doubtful: u64,
    /// Viscosity in full: mean over the runs of their means.
    pub viscosity: Option<Estimate>,
    /// Median over the runs of their medians.
    pub viscosity_median: Option<f64>,
    /// First and third quartile over the runs of their medians; `None` of a single run.
    pub viscosity_quartiles: Option<[f64; 2]>,
    /// Viscosity from the stresslets alone.
    pub viscosity_stresslet: Option<Estimate>,
    /// First normal stress difference.
    pub normal_stress_difference: Option<Estimate>,
    /// Components and parts of the stress, in the order of [`STRESSES`].
    pub(crate) stresses: [Option<Estimate>; COUNT],
    /// Contacts per sphere over all samples of all runs, as are the fractions.
    pub contacts_per_sphere: Option<f64>,
    /// Activated contacts over contacts.
    pub activated_fraction: Option<f64>,
    /// Rolling contacts over activated ones.
    pub rolling_fraction: Option<f64>,
    /// Smallest gap of any run at any stage, the discarded strain included.
    pub minimum_gap: Option<f64>,
    /// Mean approach velocity of the contacts.
    pub mean_approach_velocity: Option<f64>,
    /// Worst residual of any run.
    pub worst_residual: Option<f64>,
    /// Unconverged right-hand sides over all with contacts.
    pub unconverged_fraction: Option<f64>,
    /// Right-hand sides whose friction is off by more than 1e-3 of the largest force, over all.
    pub inexact_fraction: Option<f64>,
    /// Contact problems without an admissible motion.
    pub jammed_stages: u64,
    /// Mean seconds of computing of a run.
    pub wall_time_s: Option<f64>,
    /// Mean seconds of processor of a run.
    pub cpu_time_s: Option<f64>,
    /// Seeds that count: of a precision those of its batches so far, else all of the file.
    pub seeds_wanted: u64,
    /// Half width of the 95 % interval over the mean: of the quantity whose precision is asked for, else of the viscosity.
    pub precision: Option<f64>,
    /// What is asked for, and what its rule says; `None` where the file says how many seeds.
    pub rule: Option<(Precision, Decision)>,
    /// Largest strain discarded from a run.
    pub discard: Option<f64>,
    /// Whether the runs drift.
    pub drift: Option<Drift>,
    /// Strain after which the viscosity counts as independent, mean over runs.
    pub correlation_strain: Option<f64>,
    /// Independent samples that all runs together are worth.
    pub effective_samples: Option<f64>,
    /// What to do about runs that are not steady.
    pub advice: Option<String>,
}

impl Report {
    /// Of what a store holds now about the points selected.
    ///
    /// # Errors
    /// Trouble with the store; [`ReportError::Argument`] on a selection that no point meets.
    pub fn of(store: &Store, selection: &Selection) -> Result<Self, ReportError> {
        let runs = selected_runs(store, selection)?;
        let mut failures = store.failures(u32::MAX)?;
        failures.retain(|failure| selection.has(&failure.params));
        let mut failures = FailureGroup::of(failures);
        failures.truncate(FAILURES_SHOWN);
        let computing = runs
            .iter()
            .filter_map(|run| run.wall_time_s)
            .fold(0.0, |sum, time| sum + time);
        let keys = runs.iter().filter(|run| run.viscosity.is_some());
        let keys = keys.map(|run| run.key.clone()).collect();
        // A sum of nothing would be -0.
        let processor = runs
            .iter()
            .filter_map(|run| run.cpu_time_s)
            .fold(0.0, |sum, time| sum + time);
        let rules: HashMap<_, _> = store
            .point_states()?
            .into_iter()
            .map(|state| (identity(&state.params), (state.rule, state.decision)))
            .collect();
        let mut groups: Vec<Vec<&PointRun>> = Vec::new();
        let mut place_of = HashMap::new();
        let mut last: Option<usize> = None;
        let mut counts = Counts::default();
        let doubtful = runs.iter().filter(|run| run.is_doubtful()).count() as u64;
        for run in &runs {
            *match run.state {
                State::Pending => &mut counts.pending,
                State::Running => &mut counts.running,
                State::Done => &mut counts.done,
                State::Jammed => &mut counts.jammed,
                State::Failed => &mut counts.failed,
            } += 1;
            // Runs of a point come one after the other.
            let place = match last {
                Some(last) if groups[last][0].params == run.params => last,
                _ => *place_of.entry(identity(&run.params)).or_insert_with(|| {
                    groups.push(Vec::new());
                    groups.len() - 1
                }),
            };
            last = Some(place);
            groups[place].push(run);
        }
        let protocol = store.protocol()?;
        let mut points = Vec::with_capacity(groups.len());
        for runs in &groups {
            let averaged: Vec<&PointRun> = runs
                .iter()
                .copied()
                .filter(|run| run.is_sound() || (selection.with_doubtful && run.is_doubtful()))
                .collect();
            let Some(mut point) = Point::of(runs, &averaged) else {
                continue;
            };
            if let Some((rule, decision)) = rules.get(&identity(&point.params)) {
                point.follow(&averaged, *rule, *decision);
            }
            point.advice = steady::advice(store, &point, &averaged, &protocol)?;
            points.push(point);
        }
        Ok(Self {
            campaign: store.campaign_name()?,
            selection: selection.clone(),
            columns: Columns::default(),
            counts,
            discard: protocol.discard,
            points,
            doubtful,
            with_doubtful: selection.with_doubtful,
            failures,
            computing,
            processor,
            provenance: store.provenance()?,
            keys,
            units: Units::default(),
        })
    }

    /// The programs that computed its results, each once.
    pub(crate) fn programs(&self) -> Vec<String> {
        let mut programs: Vec<String> = Vec::new();
        for process in &self.provenance {
            let program = process.program();
            if !programs.contains(&program) {
                programs.push(program);
            }
        }
        programs
    }
}

/// All runs of the points selected, in the order of the campaign file.
pub(super) fn selected_runs(
    store: &Store,
    selection: &Selection,
) -> Result<Vec<PointRun>, ReportError> {
    let mut runs = store.point_runs()?;
    let params: Vec<&Params> = runs.iter().map(|run| run.params.as_ref()).collect();
    selection.check(&params)?;
    runs.retain(|run| selection.has(&run.params));
    Ok(runs)
}

impl Point {
    /// Γ: imposed, or that of the mean viscosity where the stress is imposed.
    pub(crate) fn shear_rate(&self) -> Option<f64> {
        match self.params.shear_stress {
            None => Some(self.params.shear_rate),
            Some(stress) => self.viscosity.map(|eta| 6.0 * PI * stress / eta.mean),
        }
    }

    /// What turning its numbers into physical units has to know of it.
    pub(super) fn at(&self) -> At {
        At::new(&self.params, self.shear_rate())
    }

    /// σ*: imposed, or that of the mean viscosity where the rate is imposed.
    pub(super) fn shear_stress(&self) -> Option<Estimate> {
        if let Some(stress) = self.params.shear_stress {
            return Some(Estimate::bare(stress));
        }
        let factor = self.params.shear_rate / (6.0 * PI);
        self.viscosity.map(|eta| Estimate {
            mean: factor * eta.mean,
            standard_error: eta.standard_error.map(|error| factor * error),
            ci95: eta.ci95.map(|width| factor * width),
        })
    }

    /// Its place along an axis: what was measured where rate or stress follow; not a number where nothing was.
    pub(super) fn place(&self, axis: &Axis) -> f64 {
        if axis.is_shear_rate() {
            self.shear_rate().unwrap_or(f64::NAN)
        } else if axis.is_shear_stress() {
            self.shear_stress().map_or(f64::NAN, |stress| stress.mean)
        } else {
            axis.number(&self.params)
        }
    }

    /// How far rough surfaces ever overlapped, in a; 0 if they never did.
    pub(super) fn overlap(&self) -> Option<f64> {
        self.minimum_gap
            .map(|gap| (self.params.roughness - gap).max(0.0))
    }

    /// Whether soft contacts gave way by more than the roughness height, so that the spheres themselves overlapped.
    pub(super) fn overlaps_too_much(&self) -> bool {
        let height = self.params.roughness;
        height > 0.0
            && !is_rigid(&self.params)
            && self.overlap().is_some_and(|overlap| overlap > height)
    }

    /// A component or part of the stress by its name.
    pub(super) fn stress(&self, name: &str) -> Option<Estimate> {
        let place = STRESSES.iter().position(|column| column.name == name)?;
        self.stresses[place]
    }

    /// Of the runs of one point and those of them that are averaged; `None` of none.
    fn of(runs: &[&PointRun], averaged: &[&PointRun]) -> Option<Self> {
        let params = Params::clone(&runs.first()?.params);
        let values = |quantity: fn(&PointRun) -> Option<f64>| -> Vec<f64> {
            averaged.iter().filter_map(|run| quantity(run)).collect()
        };
        let sum = |quantity: fn(&PointRun) -> u64| -> f64 {
            averaged.iter().map(|run| quantity(run)).sum::<u64>() as f64
        };
        let (contacts, activated) = (sum(|r| r.contacts), sum(|r| r.activated));
        let parts: Vec<_> = averaged
            .iter()
            .filter_map(|run| Some(run.steadiness?.parts))
            .collect();
        let correlation = values(|r| Some(r.steadiness?.correlation * r.sample_every));
        let medians = Distribution::of(values(|r| r.viscosity_median));
        let effective = values(|r| Some(r.samples as f64 / r.steadiness?.correlation));
        Some(Self {
            seeds: averaged.len() as u64,
            jammed: runs.iter().filter(|r| r.state == State::Jammed).count() as u64,
            failed: runs.iter().filter(|r| r.state == State::Failed).count() as u64,
            doubtful: runs.iter().filter(|r| r.is_doubtful()).count() as u64,
            viscosity: Estimate::of(&values(|r| r.viscosity)),
            viscosity_median: medians.map(|medians| medians.median),
            viscosity_quartiles: medians
                .filter(|_| averaged.len() > 1)
                .map(|medians| [medians.quartile_1, medians.quartile_3]),
            viscosity_stresslet: Estimate::of(&values(|r| r.viscosity_stresslet)),
            normal_stress_difference: Estimate::of(&values(|r| r.normal_stress_difference)),
            stresses: std::array::from_fn(|place| {
                let means: Vec<f64> = averaged
                    .iter()
                    .filter_map(|run| run.stresses[place])
                    .collect();
                Estimate::of(&means)
            }),
            contacts_per_sphere: ratio(contacts, sum(|r| r.samples) * params.spheres as f64),
            activated_fraction: ratio(activated, contacts),
            rolling_fraction: ratio(sum(|r| r.rolling), activated),
            minimum_gap: values(|r| r.minimum_gap).into_iter().reduce(f64::min),
            mean_approach_velocity: ratio(
                averaged.iter().map(|run| run.approach).sum::<f64>(),
                contacts,
            ),
            worst_residual: values(|r| r.worst_residual).into_iter().reduce(f64::max),
            unconverged_fraction: ratio(sum(|r| r.unconverged_stages), sum(|r| r.stages)),
            inexact_fraction: ratio(sum(|r| r.inexact_stages), sum(|r| r.stages)),
            jammed_stages: averaged.iter().map(|run| run.jammed_stages).sum(),
            wall_time_s: mean(&values(|r| r.wall_time_s)),
            cpu_time_s: mean(&values(|r| r.cpu_time_s)),
            seeds_wanted: runs.len() as u64,
            precision: relative_half_width(&values(|r| r.viscosity)).filter(|w| w.is_finite()),
            rule: None,
            discard: values(|r| r.discard).into_iter().reduce(f64::max),
            drift: Drift::of(&parts),
            correlation_strain: mean(&correlation),
            effective_samples: (!effective.is_empty()).then(|| effective.iter().sum()),
            advice: None,
            params,
        })
    }

    /// Takes note of the precision that is asked for at this point, of these averaged runs.
    fn follow(&mut self, averaged: &[&PointRun], rule: Precision, decision: Decision) {
        let quantity: fn(&PointRun) -> Option<f64> = match rule.quantity {
            Measure::Viscosity => |run| run.viscosity,
            Measure::ViscosityMedian => |run| run.viscosity_median,
            Measure::ViscosityStresslet => |run| run.viscosity_stresslet,
            Measure::NormalStressDifference => |run| run.normal_stress_difference,
        };
        let values: Vec<f64> = averaged.iter().copied().filter_map(quantity).collect();
        self.seeds_wanted = decision.wanted as u64;
        self.precision = relative_half_width(&values).filter(|width| width.is_finite());
        self.rule = Some((rule, decision));
    }
}
