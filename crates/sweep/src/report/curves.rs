//! Points as curves: one axis of the campaign along, one curve per value of all others.

use super::{Point, Report};
use crate::axes::{AXES, Axis, Tag, Value, identity};
use sd_core::Params;

/// Points that differ only along one axis, in the order of its values.
#[derive(Debug)]
pub(super) struct Curve<'r> {
    /// What sets it apart from the others; empty if there are no others.
    pub(super) label: String,
    /// Its points.
    pub(super) points: Vec<&'r Point>,
}

/// The curves of a report.
pub(super) fn curves<'r>(report: &'r Report, along: &Axis) -> Vec<Curve<'r>> {
    let mut groups: Vec<(Vec<Tag>, Vec<&Point>)> = Vec::new();
    for point in &report.points {
        let others: Vec<Tag> = identity(&point.params)
            .into_iter()
            .zip(AXES.iter())
            .filter(|(_, axis)| axis.key != along.key)
            .map(|(tag, _)| tag)
            .collect();
        match groups.iter_mut().find(|group| group.0 == others) {
            Some(group) => group.1.push(point),
            None => groups.push((others, vec![point])),
        }
    }
    let params: Vec<&Params> = groups.iter().map(|group| &group.1[0].params).collect();
    let labels = labels(&params, Some(along));
    groups
        .into_iter()
        .zip(labels)
        .map(|((_, mut points), label)| {
            points.sort_by(|a, b| along.number(&a.params).total_cmp(&along.number(&b.params)));
            Curve { label, points }
        })
        .collect()
}

/// What sets each of some parameters apart from the others: `c = 0.69, Γ = ∞`; the axis they run along left out.
pub(super) fn labels(params: &[&Params], along: Option<&Axis>) -> Vec<String> {
    let differing: Vec<&Axis> = AXES
        .iter()
        .filter(|axis| along.is_none_or(|along| along.key != axis.key))
        .filter(|axis| axis.varies(params.iter().copied()))
        .collect();
    let word = |axis: &&Axis, params: &Params| match axis.value(params) {
        Value::Word(word) => word.to_owned(),
        Value::Number(f64::INFINITY) => format!("{} = ∞", axis.symbol),
        value => format!("{} = {value}", axis.symbol),
    };
    params
        .iter()
        .map(|params| {
            let words: Vec<String> = differing.iter().map(|axis| word(axis, params)).collect();
            words.join(", ")
        })
        .collect()
}
