//! The figure of `published-2d`: what was published, and what the same model gives here, on the same axes.

use crate::rows;
use sd_core::Params;
use sd_core::model::PublishedUnits;
use serde::Deserialize;
use std::f64::consts::PI;
use std::path::Path;
use sweep::report::{Format, Graph, Line, draw_graph};
use sweep::statistics::Estimate;

/// A point that was published.
#[derive(Debug, Deserialize)]
struct Theirs {
    area_fraction: f64,
    published_stress: f64,
    published_viscosity: f64,
}

/// A point of the campaign.
#[derive(Debug, Deserialize)]
struct Ours {
    area_fraction: f64,
    size_ratio: f64,
    large_fraction: f64,
    friction: f64,
    spheres: usize,
    stiffness: f64,
    repulsion: f64,
    repulsion_length: f64,
    lubrication_regularisation: f64,
    /// None where the stress did not make the layer flow.
    shear_rate: Option<f64>,
    viscosity: Option<f64>,
}

impl Ours {
    /// Their stress and viscosity.
    fn published(&self) -> Option<(f64, f64)> {
        let units = PublishedUnits::of(&Params {
            area_fraction: self.area_fraction,
            size_ratio: self.size_ratio,
            large_fraction: self.large_fraction,
            ..Params::UNWRITTEN
        });
        let viscosity = self.viscosity?;
        let stress = 6.0 * PI * units.shear_stress(viscosity, self.shear_rate?);
        Some((stress, units.viscosity(viscosity)))
    }

    /// Whether it is of the parameters that the published text states for like layers, or of those that were fitted to the table.
    fn model(&self) -> Option<&'static str> {
        let is_usual = self.spheres == 200
            && self.stiffness == 5348.0
            && self.repulsion_length == 0.0441
            && self.lubrication_regularisation == 0.001;
        match (self.friction, self.repulsion) {
            (1.0, 1.0) if is_usual => Some("ours, ν = 1"),
            (10.0, 0.583) if is_usual => Some("ours, ν = 10 and 0.583 of the repulsion"),
            _ => None,
        }
    }
}

/// A panel for each area fraction that both have.
pub(crate) fn figure(folder: &Path) -> Vec<u8> {
    let ours: Vec<Ours> = rows(&folder.join("published-2d.csv"));
    let theirs: Vec<Theirs> = rows(&folder.join("published-2d.reference.csv"));
    let mut fractions: Vec<f64> = ours.iter().map(|point| point.area_fraction).collect();
    fractions.sort_by(f64::total_cmp);
    fractions.dedup();
    let mut lines = Vec::new();
    for (panel, c) in fractions.iter().enumerate() {
        let published = theirs
            .iter()
            .filter(|point| point.area_fraction == *c)
            .map(|point| (point.published_stress, point.published_viscosity));
        let mut kinds = vec![("published", published.collect::<Vec<_>>())];
        for name in ["ours, ν = 1", "ours, ν = 10 and 0.583 of the repulsion"] {
            let points = ours
                .iter()
                .filter(|point| point.area_fraction == *c && point.model() == Some(name));
            kinds.push((name, points.filter_map(Ours::published).collect()));
        }
        for (label, mut points) in kinds {
            points.sort_by(|one, two| one.0.total_cmp(&two.0));
            let bare = |value| Estimate {
                mean: value,
                standard_error: None,
                ci95: None,
            };
            lines.push(Line {
                label: label.to_owned(),
                panel,
                is_path: false,
                points: points.into_iter().map(|(x, y)| (x, bare(y))).collect(),
            });
        }
    }
    lines.retain(|line| !line.points.is_empty());
    let graph = Graph {
        x: "their stress 6π σ'".into(),
        log_x: true,
        y: "their viscosity η'".into(),
        panels: fractions.iter().map(|c| format!("c = {c}")).collect(),
        lines,
    };
    draw_graph(&graph, Format::Svg).unwrap()
}
