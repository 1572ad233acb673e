//! Tidy tables: one row per point, one column per quantity, for pandas, R, `DuckDB` and papers.
//!
//! Units and meanings are in a sidecar, so that the table itself has one header row of plain names.

use super::{Point, Report, contact, hydrodynamics, significant};
use crate::error::Error;
use crate::statistics::Estimate;
use std::io::Write;

/// What stands in a cell.
enum Cell {
    /// A word.
    Word(&'static str),
    /// A count.
    Count(u64),
    /// A number; `None` where there is none.
    Number(Option<f64>),
}

/// A column: its name, unit and meaning, and its cell of a point.
struct Column {
    /// Name, the same as in `--json`.
    name: &'static str,
    /// Unit; `1` where there is none.
    unit: &'static str,
    /// Meaning.
    meaning: &'static str,
    /// Its cell.
    cell: fn(&Point) -> Cell,
}

/// Shorthand for [`COLUMNS`].
const fn column(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    cell: fn(&Point) -> Cell,
) -> Column {
    Column {
        name,
        unit,
        meaning,
        cell,
    }
}

/// Mean of an estimate.
fn mean(estimate: Option<Estimate>) -> Cell {
    Cell::Number(estimate.map(|e| e.mean))
}

/// Half the 95 % interval of an estimate.
fn ci95(estimate: Option<Estimate>) -> Cell {
    Cell::Number(estimate.and_then(|e| e.ci95))
}

/// All columns.
#[rustfmt::skip]
const COLUMNS: [Column; 28] = [
    column("hydrodynamics", "", "how the grand resistance is made", |p| Cell::Word(hydrodynamics(p.params.hydrodynamics))),
    column("contact", "", "contact scheme", |p| Cell::Word(contact(p.params.contact))),
    column("spheres", "1", "number of spheres N", |p| Cell::Count(p.params.spheres as u64)),
    column("area_fraction", "1", "area fraction c", |p| Cell::Number(Some(p.params.area_fraction))),
    column("size_ratio", "1", "radius of large over small spheres", |p| Cell::Number(Some(p.params.size_ratio))),
    column("large_fraction", "1", "large spheres over all", |p| Cell::Number(Some(p.params.large_fraction))),
    column("roughness", "a", "roughness height h", |p| Cell::Number(Some(p.params.roughness))),
    column("friction", "1", "friction coefficient", |p| Cell::Number(Some(p.params.friction))),
    column("shear_rate", "1", "dimensionless shear rate Gamma; inf is the upper plateau", |p| Cell::Number(Some(p.params.shear_rate))),
    column("time_step", "strain", "time step", |p| Cell::Number(Some(p.params.time_step))),
    column("seeds", "1", "runs averaged", |p| Cell::Count(p.seeds)),
    column("jammed", "1", "runs that ended jammed: not averaged", |p| Cell::Count(p.jammed)),
    column("failed", "1", "runs that failed: not averaged", |p| Cell::Count(p.failed)),
    column("viscosity", "mu", "viscosity in full, mean over runs of their means in time", |p| mean(p.viscosity)),
    column("viscosity_ci95", "mu", "half width of its 95 % Student interval", |p| ci95(p.viscosity)),
    column("viscosity_median", "mu", "median over runs of their medians in time", |p| Cell::Number(p.viscosity_median)),
    column("viscosity_stresslet", "mu", "viscosity without contact stress", |p| mean(p.viscosity_stresslet)),
    column("viscosity_stresslet_ci95", "mu", "half width of its 95 % interval", |p| ci95(p.viscosity_stresslet)),
    column("normal_stress_difference", "mu rate", "first normal stress difference, contacts included", |p| mean(p.normal_stress_difference)),
    column("normal_stress_difference_ci95", "mu rate", "half width of its 95 % interval", |p| ci95(p.normal_stress_difference)),
    column("contacts_per_sphere", "1", "pairs with a contact force over spheres", |p| Cell::Number(p.contacts_per_sphere)),
    column("activated_fraction", "1", "contacts above the critical load over contacts", |p| Cell::Number(p.activated_fraction)),
    column("rolling_fraction", "1", "rolling contacts over activated ones", |p| Cell::Number(p.rolling_fraction)),
    column("minimum_gap", "a", "smallest gap of any run", |p| Cell::Number(p.minimum_gap)),
    column("mean_approach_velocity", "a rate", "over all contacts, positive for approach", |p| Cell::Number(p.mean_approach_velocity)),
    column("worst_residual", "a rate", "of the contact problem, over all runs", |p| Cell::Number(p.worst_residual)),
    column("unconverged_fraction", "1", "contact problems that did not converge over all", |p| Cell::Number(p.unconverged_fraction)),
    column("wall_time_s", "s", "mean computing time of a run", |p| Cell::Number(p.wall_time_s)),
];

/// Writes the points as comma-separated values: a header row of names, numbers in full, nothing where there is none.
///
/// # Errors
/// Output that cannot be written.
pub fn write_csv(report: &Report, out: &mut dyn Write) -> Result<(), Error> {
    let names: Vec<&str> = COLUMNS.iter().map(|column| column.name).collect();
    writeln!(out, "{}", names.join(","))?;
    for point in &report.points {
        let cells: Vec<String> = COLUMNS
            .iter()
            .map(|column| match (column.cell)(point) {
                Cell::Word(word) => word.into(),
                Cell::Count(count) => count.to_string(),
                Cell::Number(Some(number)) if !number.is_nan() => format!("{number:?}"),
                Cell::Number(_) => String::new(),
            })
            .collect();
        writeln!(out, "{}", cells.join(","))?;
    }
    Ok(())
}

/// Writes the sidecar: name, unit and meaning of each column.
///
/// # Errors
/// Output that cannot be written.
pub fn write_units(out: &mut dyn Write) -> Result<(), Error> {
    writeln!(out, "column,unit,meaning")?;
    for column in &COLUMNS {
        let meaning = column.meaning;
        writeln!(out, "{},{},\"{meaning}\"", column.name, column.unit)?;
    }
    Ok(())
}

/// Writes the points as a Markdown table with units in its head, without the columns that have nothing to say.
///
/// # Errors
/// Output that cannot be written.
pub fn write_markdown(report: &Report, out: &mut dyn Write) -> Result<(), Error> {
    let mixed = report.points.iter().any(|p| p.params.size_ratio > 1.0);
    let columns: Vec<&Column> = COLUMNS
        .iter()
        .filter(|column| match column.name {
            "size_ratio" | "large_fraction" => mixed,
            "jammed" => report.counts.jammed > 0,
            "failed" => report.counts.failed > 0,
            _ => true,
        })
        .collect();
    let heads = columns.iter().map(|column| match column.unit {
        "" | "1" => column.name.to_owned(),
        unit => format!("{} ({unit})", column.name),
    });
    writeln!(out, "| {} |", heads.collect::<Vec<_>>().join(" | "))?;
    writeln!(out, "|{}", " ---: |".repeat(columns.len()))?;
    for point in &report.points {
        let cells = columns.iter().map(|column| match (column.cell)(point) {
            Cell::Word(word) => word.to_owned(),
            Cell::Count(count) => count.to_string(),
            Cell::Number(None) => "–".into(),
            Cell::Number(Some(number)) => trimmed(number),
        });
        writeln!(out, "| {} |", cells.collect::<Vec<_>>().join(" | "))?;
    }
    Ok(())
}

/// A number with four digits, or fewer where it has no more.
fn trimmed(number: f64) -> String {
    let (full, short) = (format!("{number}"), significant(number, 4));
    if full.len() < short.len() {
        full
    } else {
        short
    }
}
