//! Costs of runs in CPU seconds, from runs measured on this machine with this build, or from a
//! short run where no similar run was measured.
//!
//! Between measured runs the cost of a step is interpolated: its ratio to the rough estimate
//! [`step_cost`], which includes the scaling of methods with the number of spheres, is averaged
//! with weights that fall as the fourth power of the distance in parameters.

pub(crate) use super::cache::record;

use super::cache;
use crate::data::Value;
use crate::model::axes::{AXES, Axis, Identity, identity};
use crate::model::case::{Case, step_cost};
use sd_core::{Method, Params};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Distance in parameters up to which a measured run determines the cost of another.
pub(crate) const NEAR: f64 = 0.6;
/// Distance up to which it still gives an estimate.
pub(crate) const COMPARABLE: f64 = 1.0;
/// Area fraction that no layer of discs exceeds by much.
const CLOSEST: f64 = 0.86;
/// Volume fraction that no random suspension of spheres exceeds by much.
const CLOSEST_SPHERES: f64 = 0.66;
/// Distance below which runs count as one point.
const CORE: f64 = 0.05;
/// Maximum number of measured points that are used, the latest ones.
const MAX_POINTS: usize = 600;

/// A measured run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Its parameters.
    pub(crate) params: Params,
    /// Its steps.
    pub(crate) steps: u64,
    /// CPU seconds.
    pub(crate) cpu_s: f64,
}

/// Measured costs of one point.
struct PointCosts {
    values: Vec<Option<Value>>,
    method: Method,
    /// Logarithms of cost over rough estimate, one of every run.
    logarithms: Vec<f64>,
}

/// Cost of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepCost {
    /// CPU seconds.
    pub(crate) seconds: f64,
    /// Distance to the nearest measured run; infinite where none is comparable.
    pub(crate) distance: f64,
    /// Scatter of similar measured runs; `None` where no point has two.
    pub(crate) scatter: Option<Scatter>,
}

/// Scatter of the costs of runs of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scatter {
    /// Standard deviation over the mean.
    pub(crate) relative: f64,
    /// Number of similar measured runs, and degrees of freedom of their scatter.
    pub(crate) runs: f64,
    pub(crate) freedom: f64,
}

/// Measured costs.
#[derive(Default)]
pub(crate) struct Costs {
    known: Vec<PointCosts>,
    place_of: HashMap<Identity, usize>,
}

impl Costs {
    /// The costs of runs measured by this build on this machine.
    pub(crate) fn of_this_machine() -> Self {
        let mut costs = Self::default();
        for record in cache::records() {
            costs.learn(&record);
        }
        costs
    }

    /// Adds a measured run.
    pub(crate) fn learn(&mut self, record: &Record) {
        let rough = step_cost(&record.params);
        if record.steps == 0 || record.cpu_s <= 0.0 || rough <= 0.0 {
            return;
        }
        let logarithm = (record.cpu_s / record.steps as f64 / rough).ln();
        let known = &mut self.known;
        let place = *self
            .place_of
            .entry(identity(&record.params))
            .or_insert_with(|| {
                known.push(PointCosts {
                    values: values(&record.params),
                    method: Method::of(&record.params),
                    logarithms: Vec::new(),
                });
                known.len() - 1
            });
        known[place].logarithms.push(logarithm);
    }

    /// Cost of a step of runs with these parameters.
    pub(crate) fn step(&self, params: &Params) -> StepCost {
        let (values, method, rough) = (values(params), Method::of(params), step_cost(params));
        let (mut total, mut weights, mut nearest) = (0.0, 0.0, f64::INFINITY);
        let (mut squares, mut freedom, mut runs) = (0.0, 0.0, 0.0);
        for known in self.known.iter().rev().take(MAX_POINTS) {
            let Some(distance) = distance(&values, &known.values) else {
                continue;
            };
            // Other methods scale differently with the number of spheres.
            let distance = distance + if known.method == method { 0.0 } else { 1.0 };
            let of_point = known.logarithms.len() as f64;
            let sum: f64 = known.logarithms.iter().sum();
            let weight = of_point / (distance.powi(4) + CORE.powi(4));
            total += weight * sum / of_point;
            weights += weight;
            nearest = nearest.min(distance);
            if distance <= NEAR {
                let off = known.logarithms.iter().map(|own| own - sum / of_point);
                squares += off.map(|off| off * off).sum::<f64>();
                freedom += of_point - 1.0;
                runs += of_point;
            }
        }
        let logarithm = if weights > 0.0 { total / weights } else { 0.0 };
        StepCost {
            seconds: rough * logarithm.exp(),
            distance: nearest,
            scatter: (freedom > 0.0).then(|| Scatter {
                // Of logarithms, which for a small scatter is that over the mean.
                relative: (squares / freedom).sqrt(),
                runs,
                freedom,
            }),
        }
    }

    /// Costs of runs in order, each point evaluated once.
    pub(crate) fn of_cases(&self) -> impl Fn(&Case) -> f64 {
        let memory = std::cell::RefCell::new(HashMap::new());
        move |case| {
            let mut memory = memory.borrow_mut();
            let step = *memory
                .entry(identity(&case.params))
                .or_insert_with(|| self.step(&case.params).seconds);
            step * case.steps as f64
        }
    }
}

/// Values on all axes; `None` where they have no effect.
pub(super) fn values(params: &Params) -> Vec<Option<Value>> {
    let value = |axis: &Axis| match axis.value(params) {
        Value::Count(count) => Value::Number(count as f64),
        value => value,
    };
    AXES.iter()
        .map(|axis| axis.means_something(params).then(|| value(axis)))
        .collect()
}

/// Distance of two points in terms of cost; `None` where they differ in a choice. Below 1 costs are
/// similar.
pub(super) fn distance(a: &[Option<Value>], b: &[Option<Value>]) -> Option<f64> {
    let mut squares = 0.0;
    for ((axis, a), b) in AXES.iter().zip(a).zip(b) {
        let apart = match (a, b) {
            (a, b) if a == b => 0.0,
            (Some(Value::Word(_)), _) | (_, Some(Value::Word(_))) => return None,
            (Some(Value::Number(a)), Some(Value::Number(b))) => numbers_apart(axis.key, *a, *b),
            // A value that has an effect at only one of the points.
            _ => 0.5,
        };
        squares += apart * apart;
    }
    Some(squares.sqrt())
}

/// Distance of two numbers on an axis in terms of cost.
fn numbers_apart(key: &str, a: f64, b: f64) -> f64 {
    if a == b {
        return 0.0;
    }
    // The number of contacts and their cost grow fast near close packing.
    let of_room = |closest: f64| {
        let room = |fraction: f64| (closest - fraction).max(0.01);
        (room(a) / room(b)).ln().abs() / 0.25
    };
    match key {
        "area_fraction" => of_room(CLOSEST),
        "volume_fraction" => of_room(CLOSEST_SPHERES),
        _ if a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite() && key != "shear_rate" => {
            (a / b).ln().abs() / 0.7
        }
        // From 0 to infinity, the middle at 1.
        _ => {
            let squeezed = |x: f64| if x.is_finite() { x / (1.0 + x) } else { 1.0 };
            (squeezed(a) - squeezed(b)).abs() / 0.7
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    fn record(area_fraction: f64, spheres: usize, cpu_s: f64) -> Record {
        Record {
            params: Params {
                area_fraction,
                spheres,
                ..params()
            },
            steps: 1000,
            cpu_s,
        }
    }

    #[test]
    fn cost_at_a_measured_point_is_the_measured_one_and_interpolated_between() {
        let mut costs = Costs::default();
        assert_eq!(costs.step(&params()).distance, f64::INFINITY);
        costs.learn(&record(0.65, 90, 2.0));
        costs.learn(&record(0.75, 90, 8.0));
        costs.learn(&record(0.75, 90, 8.0));
        let at = |area_fraction| {
            let params = record(area_fraction, 90, 0.0).params;
            costs.step(&params)
        };
        assert!(
            (at(0.65).seconds / 2e-3 - 1.0).abs() < 0.01,
            "{:?}",
            at(0.65)
        );
        assert!(
            (at(0.75).seconds / 8e-3 - 1.0).abs() < 0.01,
            "{:?}",
            at(0.75)
        );
        let middle = at(0.7);
        assert!((3e-3..7e-3).contains(&middle.seconds), "{middle:?}");
        assert!(middle.distance > NEAR);
        assert!(at(0.65).distance == 0.0);
        assert_eq!(at(0.65).scatter, None, "one run");
        assert_eq!(at(0.75).scatter.unwrap().relative, 0.0, "two alike");
        costs.learn(&record(0.75, 90, 8.8));
        let scatter = costs.step(&record(0.75, 90, 0.0).params).scatter.unwrap();
        assert_eq!((scatter.runs, scatter.freedom), (3.0, 2.0));
        // Of ln 8, ln 8, ln 8.8.
        let by_hand = 1.1_f64.ln() / 3.0_f64.sqrt();
        assert!((scatter.relative / by_hand - 1.0).abs() < 1e-9);
    }

    #[test]
    fn runs_that_differ_in_a_choice_are_not_comparable() {
        let mut costs = Costs::default();
        costs.learn(&record(0.65, 90, 2.0));
        let other = Params {
            hydrodynamics: sd_core::Hydrodynamics::StokesianDynamics,
            ..params()
        };
        assert_eq!(costs.step(&other).distance, f64::INFINITY);
        let seconds = costs.step(&other).seconds;
        assert!((seconds / step_cost(&other) - 1.0).abs() < 1e-12);
    }
}
