//! The report for machines: one JSON object, its names and meanings a promise.

use super::{Point, Report};
use crate::error::Error;
use crate::statistics::Estimate;
use sd_core::{ContactScheme, Hydrodynamics};
use serde::{Serialize, Serializer};
use std::io::Write;

/// The object.
#[derive(Serialize)]
struct Document<'r> {
    /// Name of the campaign.
    campaign: &'r str,
    /// Cases by state.
    cases: Cases,
    /// Points.
    points: Vec<Row>,
}

/// Cases by state; those under way count as pending.
#[derive(Serialize)]
struct Cases {
    /// Finished.
    done: u64,
    /// Jammed.
    jammed: u64,
    /// Failed.
    failed: u64,
    /// To do, or under way.
    pending: u64,
}

/// One point.
#[derive(Serialize)]
struct Row {
    /// Area fraction c.
    area_fraction: f64,
    /// Friction coefficient ν.
    friction: f64,
    /// Roughness height h, in a.
    roughness: f64,
    /// Dimensionless shear rate Γ; `"inf"` for the upper plateau.
    #[serde(serialize_with = "infinite")]
    shear_rate: f64,
    /// Number of spheres.
    spheres: usize,
    /// Hydrodynamics.
    hydrodynamics: Hydrodynamics,
    /// Contact scheme.
    contact: ContactScheme,
    /// Size ratio; left out of monodisperse points.
    #[serde(skip_serializing_if = "Option::is_none")]
    size_ratio: Option<f64>,
    /// Number fraction of large spheres; left out of monodisperse points.
    #[serde(skip_serializing_if = "Option::is_none")]
    large_fraction: Option<f64>,
    /// Runs averaged.
    seeds: u64,
    /// Runs that ended jammed.
    jammed: u64,
    /// Mean viscosity in full.
    viscosity: Option<f64>,
    /// Half width of its 95 % interval; `null` for a single run.
    viscosity_ci95: Option<f64>,
    /// Median over runs of their medians.
    viscosity_median: Option<f64>,
    /// Mean viscosity from the stresslets alone.
    viscosity_stresslet: Option<f64>,
    /// Half width of its 95 % interval.
    viscosity_stresslet_ci95: Option<f64>,
    /// Contacts per sphere.
    contacts_per_sphere: Option<f64>,
    /// Activated contacts over contacts.
    activated_fraction: Option<f64>,
    /// Rolling contacts over activated ones.
    rolling_fraction: Option<f64>,
    /// Smallest gap of any run.
    minimum_gap: Option<f64>,
    /// Mean approach velocity of contacts.
    mean_approach_velocity: Option<f64>,
    /// Worst residual of any run.
    worst_residual: Option<f64>,
    /// Unconverged stages over stages.
    unconverged_fraction: Option<f64>,
    /// Mean seconds of computing of a run.
    wall_time_s: Option<f64>,
}

impl From<&Point> for Row {
    fn from(point: &Point) -> Self {
        let p = &point.params;
        let mean = |estimate: Option<Estimate>| estimate.map(|e| e.mean);
        let ci95 = |estimate: Option<Estimate>| estimate.and_then(|e| e.ci95);
        let mixed = p.size_ratio > 1.0;
        Self {
            area_fraction: p.area_fraction,
            friction: p.friction,
            roughness: p.roughness,
            shear_rate: p.shear_rate,
            spheres: p.spheres,
            hydrodynamics: p.hydrodynamics,
            contact: p.contact,
            size_ratio: mixed.then_some(p.size_ratio),
            large_fraction: mixed.then_some(p.large_fraction),
            seeds: point.seeds,
            jammed: point.jammed,
            viscosity: mean(point.viscosity),
            viscosity_ci95: ci95(point.viscosity),
            viscosity_median: point.viscosity_median,
            viscosity_stresslet: mean(point.viscosity_stresslet),
            viscosity_stresslet_ci95: ci95(point.viscosity_stresslet),
            contacts_per_sphere: point.contacts_per_sphere,
            activated_fraction: point.activated_fraction,
            rolling_fraction: point.rolling_fraction,
            minimum_gap: point.minimum_gap,
            mean_approach_velocity: point.mean_approach_velocity,
            worst_residual: point.worst_residual,
            unconverged_fraction: point.unconverged_fraction,
            wall_time_s: point.wall_time_s,
        }
    }
}

/// A point as a JSON object.
pub(super) fn row(point: &Point) -> serde_json::Value {
    serde_json::to_value(Row::from(point)).unwrap_or_default()
}

/// Infinity as `"inf"`, since JSON has no number for it.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature serde asks for"
)]
pub(crate) fn infinite<S: Serializer>(value: &f64, s: S) -> Result<S::Ok, S::Error> {
    if value.is_infinite() {
        s.serialize_str("inf")
    } else {
        s.serialize_f64(*value)
    }
}

/// Writes the report.
///
/// # Errors
/// Output that cannot be written.
pub fn write(report: &Report, out: &mut dyn Write) -> Result<(), Error> {
    let document = Document {
        campaign: &report.campaign,
        cases: Cases {
            done: report.counts.done,
            jammed: report.counts.jammed,
            failed: report.counts.failed,
            pending: report.counts.pending + report.counts.running,
        },
        points: report.points.iter().map(Row::from).collect(),
    };
    serde_json::to_writer(&mut *out, &document).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
