//! `sweep convert`.

use super::Output;
use super::place::StoreArguments;
use crate::error::Error;
use crate::model::axes::{AXES, Axis};
use crate::report::{Point, Report, Selection};
use crate::system::exit;
use crate::text::format::{significant, wrapped};
use crate::text::table::table;
use sd_core::model::PublishedUnits;
use serde::Serialize;

/// Print results in the units of published soft-sphere simulations
///
/// Lengths in radii of the small spheres, a layer one small radius thick, viscosities without the
/// stresslets of isolated spheres; the formulas for layers and suspensions are in
/// docs/published-models.md. Reads only.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: sweep convert sweeps/quickstart.toml --where shear_rate=0.1,inf")]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only points with one of these values on an axis, named by its key in the campaign file;
    /// repeatable
    #[arg(long = "where", value_name = "KEY=VALUE[,VALUE..]")]
    selection: Vec<String>,
}

/// A point in the published units.
#[derive(Serialize)]
struct Converted {
    /// Its values on the axes, in our units; under imposed stress also the resulting rate.
    #[serde(flatten)]
    axes: serde_json::Map<String, serde_json::Value>,
    seeds: u64,
    /// Mean radius over that of the small spheres.
    mean_radius: f64,
    /// Rate; `null` where it is infinite.
    published_shear_rate: Option<f64>,
    /// Stress; `null` where it is infinite.
    published_shear_stress: Option<f64>,
    /// Viscosity, and half width of its 95 % interval.
    published_viscosity: Option<f64>,
    published_viscosity_ci95: Option<f64>,
}

impl Converted {
    fn of(point: &Point) -> Self {
        let mut params = point.params.clone();
        // Under an imposed pressure the spheres have found their own.
        if let Some(fraction) = point.number("fraction") {
            match &mut params.volume_fraction {
                Some(volume) => *volume = fraction,
                None => params.area_fraction = fraction,
            }
        }
        let units = PublishedUnits::of(&params);
        let rate = point.shear_rate();
        let viscosity = point.viscosity.as_ref();
        let axes = AXES.iter().map(|axis| {
            let value = if axis.is_shear_rate() && point.params.shear_stress.is_some() {
                serde_json::to_value(rate)
            } else {
                serde_json::to_value(axis.value(&point.params))
            };
            (axis.key.to_owned(), value.unwrap_or_default())
        });
        Self {
            axes: axes.collect(),
            seeds: point.seeds,
            mean_radius: units.mean_radius,
            published_shear_rate: rate
                .map(|rate| units.shear_rate(rate))
                .filter(|rate| rate.is_finite()),
            published_shear_stress: viscosity
                .zip(rate)
                .map(|(v, rate)| units.shear_stress(v.mean, rate))
                .filter(|stress| stress.is_finite()),
            published_viscosity: viscosity.map(|v| units.viscosity(v.mean)),
            published_viscosity_ci95: viscosity.and_then(|v| Some(units.difference(v.ci95?))),
        }
    }
}

/// Writes the points.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let selection = Selection::parse(&arguments.selection)?;
    let store = arguments.place.open(output)?;
    let report = Report::of(&store, &selection)?;
    let points: Vec<Converted> = report.points.iter().map(Converted::of).collect();
    if output.json {
        output.json(&serde_json::json!({"campaign": report.campaign, "points": points}))?;
        return Ok(exit::DONE);
    }
    let varied: Vec<&Axis> = AXES
        .iter()
        .filter(|axis| {
            axis.is_shear_rate() || axis.varies(report.points.iter().map(|point| &point.params))
        })
        .collect();
    let axes = varied.iter().map(|axis| axis.symbol().to_owned());
    let theirs = ["runs", "Γ'", "σ'", "η'"].map(str::to_owned);
    let heads: Vec<String> = axes.chain(theirs).collect();
    let number = |value: Option<f64>, digits| {
        value.map_or_else(|| "–".into(), |value| significant(value, digits))
    };
    let rows = report.points.iter().zip(&points).map(|(point, converted)| {
        let mut viscosity = number(converted.published_viscosity, 4);
        if let Some(width) = converted.published_viscosity_ci95 {
            viscosity = format!("{viscosity} ± {}", significant(width, 2));
        }
        let axes = varied.iter().map(|axis| match point.params.shear_stress {
            Some(_) if axis.is_shear_rate() => number(point.shear_rate(), 4),
            None if axis.is_shear_stress() => "–".into(),
            _ => axis.value(&point.params).to_string(),
        });
        let theirs = [
            converted.seeds.to_string(),
            number(converted.published_shear_rate, 4),
            number(converted.published_shear_stress, 4),
            viscosity,
        ];
        axes.chain(theirs).collect::<Vec<_>>()
    });
    let table = table(output.width, heads, rows);
    let out = &mut *output.out;
    writeln!(out, "{}", report.campaign)?;
    writeln!(out, "{table}")?;
    let suspensions = report
        .points
        .iter()
        .filter(|point| point.params.volume_fraction.is_some());
    let of_what = match suspensions.count() {
        0 => " of a layer one a_s thick",
        number if number == report.points.len() => "",
        _ => " (of layers: one a_s thick)",
    };
    let note = format!(
        "Γ': rate, 6π μ a_s² × rate / F_crit; σ': shear stress, in F_crit/a_s² (papers often give 6π σ' = η' Γ'); \
         η': viscosity{of_what}, without the stresslets of isolated spheres, ± half the 95 % Student interval. \
         a_s: radius of the small spheres. Axes before them are ours.\n"
    );
    out.write_all(wrapped(&note, output.width).as_bytes())?;
    Ok(exit::DONE)
}
