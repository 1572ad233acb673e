//! Points as curves: one axis of the campaign along, one curve per value of all others.

use super::{Point, Report};
use crate::axes::{AXES, Axis, Tag, Value, identity};
use sd_core::Params;
use std::cmp::Ordering;

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
            .filter(|(_, axis)| !is_along(axis, along))
            .map(|(tag, _)| tag)
            // Points of imposed stress and of imposed rate make curves of their own.
            .chain([Tag::Bits(point.params.shear_stress.is_some().into())])
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
            points.sort_by(|a, b| a.place(along).total_cmp(&b.place(along)));
            if along.is_of_shear() {
                // Along a curve that folds back the imposed quantity rises.
                points.sort_by(|a, b| {
                    a.params
                        .shear_stress
                        .partial_cmp(&b.params.shear_stress)
                        .unwrap_or(Ordering::Equal)
                });
            }
            Curve { label, points }
        })
        .collect()
}

/// Whether curves along an axis run along this one too: rate and stress follow from each other.
fn is_along(axis: &Axis, along: &Axis) -> bool {
    axis.key == along.key || axis.is_of_shear() && along.is_of_shear()
}

/// What sets each of some parameters apart from the others: `c = 0.69, Γ = ∞`; the axis they run along left out.
pub(super) fn labels(params: &[&Params], along: Option<&Axis>) -> Vec<String> {
    let differing: Vec<&Axis> = AXES
        .iter()
        .filter(|axis| along.is_none_or(|along| !is_along(axis, along)))
        .filter(|axis| axis.varies(params.iter().copied()))
        .collect();
    let word = |axis: &&Axis, params: &Params| match axis.value(params) {
        Value::Word(word) => word.to_owned(),
        Value::Number(f64::INFINITY) => format!("{} = ∞", axis.symbol),
        value => format!("{} = {value}", axis.symbol),
    };
    let imposed = |params: &&&Params| params.shear_stress.is_some();
    let both = params.iter().any(|p| imposed(&p)) && !params.iter().all(|p| imposed(&p));
    params
        .iter()
        .map(|params| {
            let own = differing
                .iter()
                .filter(|axis| !axis.is_of_shear() || axis.means_something(params));
            let mut words: Vec<String> = own.map(|axis| word(axis, params)).collect();
            if both && along.is_some() {
                let how = if params.shear_stress.is_some() {
                    "stress"
                } else {
                    "rate"
                };
                words.push(format!("imposed {how}"));
            }
            words.join(", ")
        })
        .collect()
}
