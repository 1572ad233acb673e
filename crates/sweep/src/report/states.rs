//! States of the points of a state diagram, and where the slope of their flow curves crosses a
//! limit.

use super::points::Point;
use crate::data::Tag;
use crate::model::axes::{AXES, Axis, identity};
use std::collections::HashMap;

/// State of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flow {
    /// d ln η/d ln σ < 1: no or continuous thickening.
    Continuous,
    /// d ln η/d ln σ ≥ 1: the shear rate does not increase with the stress.
    Discontinuous,
    /// Most runs jam, but not at some lower stress or rate.
    ShearJammed,
    /// Most runs jam, and at every lower stress or rate too.
    Jammed,
    /// No run was completed.
    Failed,
    /// It flows, but no other point of its curve does, so that there is no slope.
    Alone,
}

impl Flow {
    /// All of them, in the order of the legend.
    pub(super) const ALL: [Self; 6] = [
        Self::Continuous,
        Self::Discontinuous,
        Self::ShearJammed,
        Self::Jammed,
        Self::Failed,
        Self::Alone,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Continuous => "continuous",
            Self::Discontinuous => "discontinuous",
            Self::ShearJammed => "shear-jammed",
            Self::Jammed => "jammed",
            Self::Failed => "failed",
            Self::Alone => "flows, slope unknown",
        }
    }
}

/// Points that differ only in the stress or the rate, the lowest first.
pub(super) struct FlowCurve<'p> {
    points: Vec<&'p Point>,
}

impl<'p> FlowCurve<'p> {
    /// The curve of points in any order.
    pub(super) fn of(mut points: Vec<&'p Point>) -> Self {
        points.sort_by(|a, b| imposed(a).total_cmp(&imposed(b)));
        Self { points }
    }

    pub(super) fn points(&self) -> &[&'p Point] {
        &self.points
    }

    /// ln σ and ln η of the points that flow at a finite stress, by index.
    fn flowing(&self) -> Vec<(usize, f64, f64)> {
        let of = |(place, point): (usize, &&Point)| {
            if point.is_jammed() {
                return None;
            }
            let (stress, viscosity) = (point.shear_stress()?.mean, point.viscosity?.mean);
            let is_finite = stress > 0.0 && stress.is_finite() && viscosity > 0.0;
            is_finite.then(|| (place, stress.ln(), viscosity.ln()))
        };
        self.points.iter().enumerate().filter_map(of).collect()
    }

    /// State of each point; `None` where it is unknown. The slope at a point is that between its
    /// neighbours, or at an end that to its neighbour.
    pub(super) fn flows(&self) -> Vec<Option<Flow>> {
        let flowing = self.flowing();
        let mut slopes = vec![f64::NAN; self.points.len()];
        for (at, (place, ..)) in flowing.iter().enumerate() {
            let before = flowing[at.saturating_sub(1)];
            let after = flowing[(at + 1).min(flowing.len() - 1)];
            slopes[*place] = slope(before, after);
        }
        let mut has_flowed = false;
        let flow = |(point, slope): (&&Point, f64)| match point.viscosity {
            _ if point.is_jammed() && has_flowed => Some(Flow::ShearJammed),
            _ if point.is_jammed() => Some(Flow::Jammed),
            None => (point.failed > 0).then_some(Flow::Failed),
            Some(_) => {
                has_flowed = true;
                Some(if slope.is_nan() {
                    Flow::Alone
                } else if slope >= 1.0 {
                    Flow::Discontinuous
                } else {
                    Flow::Continuous
                })
            }
        };
        self.points.iter().zip(slopes).map(flow).collect()
    }

    /// Positions along an axis where the slope first rises above a limit and last falls below it.
    pub(super) fn crossings(&self, limit: f64, axis: &Axis) -> [Option<f64>; 2] {
        let flowing = self.flowing();
        let place = |at: usize| self.points[flowing[at].0].place(axis).ln();
        // A slope between two points is assigned to their middle.
        let slopes = (1..flowing.len()).map(|at| {
            let middle = 0.5 * (place(at - 1) + place(at));
            (middle, slope(flowing[at - 1], flowing[at]))
        });
        let slopes: Vec<(f64, f64)> = slopes.collect();
        let crossing = |pair: &[(f64, f64)]| {
            let [(from, low), (to, high)] = [pair[0], pair[1]];
            (from + (limit - low) / (high - low) * (to - from)).exp()
        };
        let mut pairs = slopes.windows(2);
        let rises = pairs
            .clone()
            .find(|pair| pair[0].1 < limit && pair[1].1 >= limit);
        let falls = pairs.rfind(|pair| pair[0].1 >= limit && pair[1].1 < limit);
        [rises.map(crossing), falls.map(crossing)]
    }
}

/// Groups of indices of points that differ only on some axes. Points of imposed stress and of
/// imposed rate are in separate groups.
pub(super) fn grouped(points: &[&Point], differ: impl Fn(&Axis) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut place_of: HashMap<Vec<Tag>, usize> = HashMap::new();
    for (place, point) in points.iter().enumerate() {
        let tags = identity(&point.params).into_iter().zip(AXES.iter());
        let of = tags.filter(|(_, axis)| !differ(axis)).map(|(tag, _)| tag);
        let is_imposed = Tag::Bits(point.params.shear_stress.is_some().into());
        let group = *place_of
            .entry(of.chain([is_imposed]).collect())
            .or_insert_with(|| {
                groups.push(Vec::new());
                groups.len() - 1
            });
        groups[group].push(place);
    }
    groups
}

/// The imposed stress or rate.
fn imposed(point: &Point) -> f64 {
    point.params.shear_stress.unwrap_or(point.params.shear_rate)
}

/// d ln η/d ln σ between two points.
fn slope(before: (usize, f64, f64), after: (usize, f64, f64)) -> f64 {
    (after.2 - before.2) / (after.1 - before.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Estimate;
    use crate::test_support::params;
    use sd_core::Params;

    /// A point at an imposed stress: its viscosity, and its runs averaged, jammed and failed.
    fn point(stress: f64, viscosity: Option<f64>, runs: [u64; 3]) -> Point {
        let params = Params {
            shear_stress: Some(stress),
            shear_rate: 0.0,
            ..params()
        };
        Point::synthetic(params, viscosity.map(Estimate::bare), runs)
    }

    fn flows(points: &[Point]) -> Vec<Option<Flow>> {
        FlowCurve::of(points.iter().collect()).flows()
    }

    #[test]
    fn slopes_of_power_laws_distinguish_continuous_from_discontinuous() {
        use Flow::{Continuous, Discontinuous};
        let law = |power: f64| -> Vec<Point> {
            let at = |k: i32| 2.0_f64.powi(k);
            let point = |k| point(at(k), Some(3.0 * at(k).powf(power)), [4, 0, 0]);
            (-3..3).rev().map(point).collect()
        };
        for power in [-0.2, 0.0, 0.5, 0.99] {
            assert!(
                flows(&law(power))
                    .iter()
                    .all(|flow| *flow == Some(Continuous)),
                "{power}"
            );
        }
        for power in [1.01, 1.5] {
            let found = flows(&law(power));
            assert!(
                found.iter().all(|flow| *flow == Some(Discontinuous)),
                "{power}"
            );
        }
    }

    #[test]
    fn what_jams_above_what_flows_is_shear_jammed() {
        let points = [
            point(0.1, Some(5.0), [4, 0, 0]),
            point(1.0, Some(5.1), [3, 1, 0]),
            point(10.0, Some(90.0), [1, 3, 0]),
            point(100.0, None, [0, 4, 0]),
            point(1000.0, None, [0, 0, 4]),
            point(1e4, None, [0, 0, 0]),
        ];
        let found = flows(&points);
        let wanted = [
            Some(Flow::Continuous),
            Some(Flow::Continuous),
            Some(Flow::ShearJammed),
            Some(Flow::ShearJammed),
            Some(Flow::Failed),
            None,
        ];
        assert_eq!(found, wanted);
        let jammed = [
            point(0.1, None, [0, 4, 0]),
            point(1.0, Some(9.0), [4, 0, 0]),
        ];
        assert_eq!(flows(&jammed)[0], Some(Flow::Jammed));
        // Without a neighbour that flows there is no slope.
        assert_eq!(flows(&jammed)[1], Some(Flow::Alone));
    }

    #[test]
    fn crossings_lie_where_the_slope_of_a_smooth_curve_passes_the_limit() {
        // ln η = 2 tanh(ln σ): the slope 2/cosh² passes 1 at ln σ = ∓ arcosh √2.
        let points: Vec<Point> = (-60..=60)
            .map(|k| {
                let log = 0.05 * f64::from(k);
                point(log.exp(), Some((2.0 * log.tanh()).exp()), [4, 0, 0])
            })
            .collect();
        let curve = FlowCurve::of(points.iter().collect());
        let axis = Axis::of_key("shear_stress").unwrap();
        let there = 2.0_f64.sqrt().acosh();
        let [rises, falls] = curve.crossings(1.0, axis).map(|at| at.unwrap().ln());
        assert!((rises + there).abs() < 1e-3, "{rises}");
        assert!((falls - there).abs() < 1e-3, "{falls}");
        assert_eq!(curve.crossings(2.5, axis), [None, None]);
        let discontinuous = curve
            .flows()
            .iter()
            .filter(|f| **f == Some(Flow::Discontinuous))
            .count();
        assert!((34..=36).contains(&discontinuous), "{discontinuous}");
    }
}
