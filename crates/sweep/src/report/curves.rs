//! Points as curves along one axis of the campaign, one curve per combination of values of the
//! others.

use super::axis_words::AxisWords;
use super::points::{Point, Report};
use super::starts::Starts;
use super::units::Units;
use crate::data::Tag;
use crate::model::axes::{AXES, Axis, identity};
use sd_core::Params;
use std::cmp::Ordering;

/// Points that differ only along one axis, in the order of its values.
#[derive(Debug)]
pub(super) struct Curve<'r> {
    /// Its label, from what distinguishes it; empty for a single curve.
    pub(super) label: Label,
    pub(super) points: Vec<&'r Point>,
}

/// The label of a curve.
#[derive(Debug, Clone, Default)]
pub(super) struct Label {
    /// As text: `c = 0.69, Γ = ∞`.
    pub(super) words: String,
    /// Its number, where curves differ in one number only.
    pub(super) number: Option<f64>,
}

impl Label {
    /// A label without a number.
    pub(super) fn of_words(words: &str) -> Self {
        Self {
            words: words.to_owned(),
            number: None,
        }
    }
}

/// Common settings of the curves of a figure: their axis, the axis of the panels, the units, and
/// the names of start layers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shared<'a> {
    pub(super) along: Option<&'a Axis>,
    pub(super) panels: Option<&'a Axis>,
    pub(super) units: Units,
    pub(super) starts: &'a Starts,
}

impl Shared<'_> {
    /// Whether this axis varies along the curves: rate and stress follow from each other.
    fn is_along(self, axis: &Axis) -> bool {
        self.along
            .is_some_and(|along| axis.key == along.key || axis.is_of_shear() && along.is_of_shear())
    }

    fn is_of_panels(self, axis: &Axis) -> bool {
        self.panels.is_some_and(|panels| panels.key == axis.key)
    }
}

/// The curves of reports, those of the first one first.
pub(super) fn curves<'r>(reports: &'r [Report], shared: Shared<'_>) -> Vec<Curve<'r>> {
    let mut groups: Vec<(Vec<Tag>, &str, Vec<&Point>)> = Vec::new();
    for (place, report) in reports.iter().enumerate() {
        for point in &report.points {
            let others: Vec<Tag> = identity(&point.params)
                .into_iter()
                .zip(AXES.iter())
                .filter(|(_, axis)| !shared.is_along(axis))
                .map(|(tag, _)| tag)
                // Points of imposed stress and of imposed rate make curves of their own, as do
                // those of several stores.
                .chain([
                    Tag::Bits(point.params.shear_stress.is_some().into()),
                    Tag::Bits(place as u64),
                ])
                .collect();
            match groups.iter_mut().find(|group| group.0 == others) {
                Some(group) => group.2.push(point),
                None => groups.push((others, &report.campaign, vec![point])),
            }
        }
    }
    let labelled: Vec<(&str, &Params)> = groups
        .iter()
        .map(|(_, campaign, points)| (*campaign, &points[0].params))
        .collect();
    let labels = labels(&labelled, shared);
    groups
        .into_iter()
        .zip(labels)
        .map(|((_, _, mut points), label)| {
            if let Some(along) = shared.along {
                points.sort_by(|a, b| a.place(along).total_cmp(&b.place(along)));
                if along.is_of_shear() {
                    // Along a curve that folds back, the imposed quantity increases.
                    points.sort_by(|a, b| {
                        a.params
                            .shear_stress
                            .partial_cmp(&b.params.shear_stress)
                            .unwrap_or(Ordering::Equal)
                    });
                }
            }
            Curve { label, points }
        })
        .collect()
}

/// The labels of some parameters, each with its campaign: without common values, the axis of the
/// curves and that of the panels.
pub(super) fn labels(all: &[(&str, &Params)], shared: Shared<'_>) -> Vec<Label> {
    let params = || all.iter().map(|(_, params)| *params);
    let differing: Vec<&Axis> = AXES
        .iter()
        .filter(|axis| !shared.is_along(axis) && !shared.is_of_panels(axis))
        .filter(|axis| axis.varies(params()))
        .collect();
    let words: Vec<AxisWords<'_>> = differing
        .iter()
        .map(|axis| AxisWords::of(axis, shared.units, shared.starts, params()))
        .collect();
    let is_imposed = |params: &Params| params.shear_stress.is_some();
    let both = params().any(is_imposed) && !params().all(is_imposed);
    let several = all.iter().any(|(campaign, _)| *campaign != all[0].0);
    let by_number = match differing.as_slice() {
        [axis] if axis.is_numeric() && !both && !several => Some(*axis),
        _ => None,
    };
    all.iter()
        .map(|(campaign, params)| {
            let own = differing
                .iter()
                .zip(&words)
                .filter(|(axis, _)| !axis.is_alternative() || axis.means_something(params));
            let name = several.then(|| (*campaign).to_owned());
            let mut words: Vec<String> = name
                .into_iter()
                .chain(own.map(|(_, words)| words.named(params)))
                .collect();
            if both && shared.along.is_some() {
                let how = if is_imposed(params) { "stress" } else { "rate" };
                words.push(format!("imposed {how}"));
            }
            Label {
                words: words.join(", "),
                number: by_number.map(|axis| axis.number(params)),
            }
        })
        .collect()
}
