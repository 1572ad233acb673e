//! Points as curves: one axis of the campaign along, one curve per value of all others.

use super::{AXES, Point, Report};
use sd_core::Params;

/// The axis a figure is drawn against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Abscissa {
    /// Dimensionless shear rate Γ, logarithmic, its plateaus at the edges.
    ShearRate,
    /// Friction coefficient ν.
    Friction,
    /// Area fraction c.
    AreaFraction,
    /// Roughness height h.
    Roughness,
}

impl Abscissa {
    /// Its value.
    pub fn value(self, params: &Params) -> f64 {
        match self {
            Self::ShearRate => params.shear_rate,
            Self::Friction => params.friction,
            Self::AreaFraction => params.area_fraction,
            Self::Roughness => params.roughness,
        }
    }

    /// Its symbol, the heading of its column in `AXES`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::ShearRate => "Γ",
            Self::Friction => "ν",
            Self::AreaFraction => "c",
            Self::Roughness => "h",
        }
    }

    /// Its label on a figure.
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::ShearRate => "shear rate Γ",
            Self::Friction => "friction coefficient ν",
            Self::AreaFraction => "area fraction c",
            Self::Roughness => "roughness h / a",
        }
    }
}

/// Points that differ only along one axis, in the order of its values.
#[derive(Debug)]
pub struct Curve<'r> {
    /// What sets it apart from the others; empty if there are no others.
    pub label: String,
    /// Its points.
    pub points: Vec<&'r Point>,
}

/// The curves of a report.
pub(super) fn curves(report: &Report, along: Abscissa) -> Vec<Curve<'_>> {
    let words = |params: &Params| -> Vec<String> {
        AXES.iter()
            .filter(|axis| axis.0 != along.symbol())
            .map(|axis| axis.1(params))
            .chain([params.time_step.to_string()])
            .collect()
    };
    let names: Vec<&str> = AXES
        .iter()
        .map(|axis| axis.0)
        .filter(|name| *name != along.symbol())
        .chain(["time step"])
        .collect();
    let mut groups: Vec<(Vec<String>, Vec<&Point>)> = Vec::new();
    for point in &report.points {
        let words = words(&point.params);
        match groups.iter_mut().find(|group| group.0 == words) {
            Some(group) => group.1.push(point),
            None => groups.push((words, vec![point])),
        }
    }
    let differs: Vec<bool> = (0..names.len())
        .map(|place| {
            groups
                .iter()
                .any(|group| group.0[place] != groups[0].0[place])
        })
        .collect();
    groups
        .into_iter()
        .map(|(words, mut points)| {
            points.sort_by(|a, b| along.value(&a.params).total_cmp(&along.value(&b.params)));
            let label: Vec<String> = words
                .iter()
                .zip(&names)
                .zip(&differs)
                .filter(|(_, differs)| **differs)
                .map(|((word, name), _)| match *name {
                    "hydrodynamics" | "contact" => word.clone(),
                    name => format!("{name} = {word}"),
                })
                .collect();
            Curve {
                label: label.join(", "),
                points,
            }
        })
        .collect()
}
