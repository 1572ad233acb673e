//! `sweep fit`.

use super::Output;
use super::output_file::{check_outputs, check_picture, save};
use super::place::StoreArguments;
use crate::data::write_csv;
use crate::error::Error;
use crate::report::{FitReport, Selection};
use crate::system::exit;
use crate::text::format::{short, significant, wrapped};
use crate::text::table::table;
use std::path::PathBuf;

/// Fit the Wyart-Cates model to the viscosities of a campaign
///
/// Five parameters: the area or volume fractions c_0 and c_m at which spheres jam without and with
/// friction, the stress sigma_c at which friction sets in and the exponent beta of its onset, and a
/// prefactor; with 95 % intervals by bootstrap over seeds. See docs/fit.md. Reads only.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep fit sweeps/flow-curve.toml\n  sweep fit sweeps/flow-curve.toml --where c=0.7..0.76 --figure fit.svg --csv residuals.csv\n  \
                  sweep fit sweeps/flow-curve.toml --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only points with one of these values on an axis, or in a range; repeatable
    #[arg(long = "where", value_name = "KEY=VALUE[,VALUE..]")]
    selection: Vec<String>,
    /// Replicates of the bootstrap; 0 for no intervals
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    replicates: u32,
    /// Draw viscosities and fit against the stress: FILE.svg
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Write every point with its viscosity, the fitted viscosity and the residual
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// Writes the fit.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let selection = Selection::parse(&arguments.selection)?;
    let files = [("--csv", &arguments.csv), ("--figure", &arguments.figure)];
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&files, &inputs, output)?;
    check_picture("--figure", arguments.figure.as_ref())?;
    let store = arguments.place.open(output)?;
    let report = FitReport::of(&store, &selection, arguments.replicates as usize)?;
    for note in report.notes() {
        output.note(&note);
    }
    if let Some(path) = &arguments.figure {
        save(path, report.draw()?.as_bytes(), output)?;
    }
    if let Some(path) = &arguments.csv {
        let mut bytes = Vec::new();
        write_csv(&report.table(), &mut bytes)?;
        save(path, &bytes, output)?;
    }
    if output.json {
        output.json(&report.json())?;
        return Ok(exit::DONE);
    }
    let is_stdout =
        |path: &Option<PathBuf>| path.as_ref().is_some_and(|path| path.as_os_str() == "-");
    if files.iter().any(|(_, path)| is_stdout(path)) {
        return Ok(exit::DONE);
    }
    let mut lines = vec![report.summary()];
    let rows = report.parameters().map(|(name, value, interval)| {
        if report.is_undetermined(name) {
            return [name.to_owned(), "not determined".into(), "–".into()];
        }
        let interval = interval.map_or_else(
            || "–".to_owned(),
            |[low, high]| format!("{} to {}", significant(low, 4), significant(high, 4)),
        );
        [name.to_owned(), significant(value, 4), interval]
    });
    let heads = ["parameter", "value", "95 % interval"];
    lines.push(table(output.width, heads, rows));
    let rows = report.rows().zip(report.trend_names());
    let rows = rows.map(|([fraction, stress, viscosity, fitted, residual], trend)| {
        let trend = trend.map_or_else(String::new, |name| format!(", {name}"));
        [
            short(fraction, 6),
            significant(stress, 3),
            significant(viscosity, 4) + &trend,
            significant(fitted, 4),
            format!("{residual:+.3}"),
        ]
    });
    let word = |number: Option<f64>, digits| {
        number.map_or_else(|| "–".to_owned(), |number| significant(number, digits))
    };
    let jammed = report
        .jammed()
        .map(|(fraction, stress, fitted, [jammed, runs])| {
            let viscosity = format!("{jammed} of {runs} jammed");
            let [stress, fitted] = [word(stress, 3), word(fitted, 4)];
            [
                short(fraction, 6),
                stress,
                viscosity,
                fitted,
                "–".to_owned(),
            ]
        });
    let rows = rows.chain(jammed);
    let heads = [report.fraction()[1], "σ*", "viscosity", "fit", "ln ratio"];
    lines.push(table(output.width, heads, rows));
    lines.push(format!(
        "root mean square of ln(viscosity/fit): {}; intervals reflect the scatter of runs, not the error of the model",
        significant(report.rms(), 2)
    ));
    let text = wrapped(&lines.join("\n"), output.width);
    writeln!(output.out, "{}", text.trim_end())?;
    Ok(exit::DONE)
}
