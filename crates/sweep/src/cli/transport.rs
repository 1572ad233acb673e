//! `sweep transport`.

use super::Output;
use super::place::WorkersArgument;
use crate::error::Error;
use crate::measure::Estimate;
use crate::near_field_cache;
use crate::system::exit;
use crate::text::format::{NumberFormat, counted, significant, uncertain, wrapped};
use crate::text::table::table;
use crate::transport::{NUMBERS, TransportPoint, transport};
use sd_core::{Hydrodynamics, Params};
use serde_json::json;
use std::path::PathBuf;

/// Print short-time diffusion, sedimentation and viscosity of the starts of suspensions
///
/// Computes no run: at every point of the campaign these are means over its starts, one per seed,
/// with 95 % intervals. `start = "equilibrium"` makes starts in thermal equilibrium.
/// docs/transport.md defines the numbers. Writes nothing.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  sweep transport sweeps/suspension.toml\n  \
                  sweep transport sweeps/suspension.toml --json")]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    #[command(flatten)]
    workers: WorkersArgument,
}

/// Writes the numbers.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = crate::campaign::read(&arguments.campaign)?;
    let certain = || campaign.certain().map(|(_, case)| &case.params);
    if certain().any(|params| params.volume_fraction.is_none()) {
        return Err(Error::Argument {
            argument: "CAMPAIGN",
            message: format!(
                "{} has layers, whose diffusion in the fluid above and below depends on the size of the cell: \
                 `volume_fraction` in place of `area_fraction` makes suspensions",
                arguments.campaign.display()
            ),
        });
    }
    output.note(&counted(certain().count(), "start"));
    if let Some(warning) = campaign.warning() {
        output.note(&format!("warning: {warning}"));
    }
    let ratios = near_field_cache::ratios(certain())?;
    let tables = near_field_cache::make(&ratios, |text| output.note(text))?;
    let points = transport(&campaign, &tables, arguments.workers.or_all())?;
    if output.json {
        let points: Vec<_> = points.iter().map(TransportPoint::json).collect();
        output.json(&json!({ "points": points }))?;
        return Ok(exit::DONE);
    }
    let mut heads: Vec<String> = Vec::new();
    let axes: Vec<_> = crate::model::axes::AXES
        .iter()
        .filter(|axis| axis.key == "volume_fraction" || axis.varies(certain()))
        .collect();
    heads.extend(axes.iter().map(|axis| axis.symbol().to_owned()));
    heads.extend(
        [
            "starts", "D_s/D_0", "N = ∞", "D_r/D_r0", "U/U_0", "N = ∞", "η/η_0",
        ]
        .map(Into::into),
    );
    let rows = points.iter().map(|point| {
        let mut row: Vec<String> = axes
            .iter()
            .map(|axis| axis.value(&point.params).to_string())
            .collect();
        row.push(point.starts.len().to_string());
        for (name, of) in NUMBERS {
            row.push(point.estimate(of).map_or_else(String::new, shown));
            if ["self_diffusion", "sedimentation"].contains(&name) {
                let infinite = point.infinite(name);
                row.push(infinite.map_or_else(|| "–".into(), shown));
            }
        }
        row
    });
    writeln!(output.out, "{}", table(output.width, heads, rows))?;
    let mut notes = "over the values of a sphere alone and of the fluid; mean over starts ± half the 95 % Student interval; N = ∞: \
                     less the hold of periodic images on equal spheres, where the hydrodynamics have a far field."
        .to_owned();
    let has_far_field = |params: &Params| params.hydrodynamics == Hydrodynamics::StokesianDynamics;
    if certain().any(has_far_field) {
        notes += " The force-torque-stresslet approximation of Stokesian Dynamics makes U/U_0 too large in dense suspensions.";
    }
    if !certain().all(has_far_field) {
        notes += " Without a far field spheres sink and diffuse as if alone but for near neighbours: only \
                  `hydrodynamics` = \"stokesian-dynamics\" makes these numbers those of a suspension.";
    }
    notes += " See docs/transport.md";
    writeln!(output.out, "{}", wrapped(&notes, output.width).trim_end())?;
    Ok(exit::DONE)
}

/// A mean with its interval.
fn shown(estimate: Estimate) -> String {
    match estimate.ci95 {
        Some(half) => uncertain(estimate.mean, half, NumberFormat::Plain),
        None => significant(estimate.mean, 4),
    }
}
