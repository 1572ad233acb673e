//! The table of points as LaTeX.

use super::sheet::{NumberFormat, Shape, Sheet, SheetColumn};
use super::{Report, ReportError};
use crate::format::Uncertain;
use std::io::Write;

/// Writes the points as a `tabular` that needs no package: the columns of the table on the screen, all the usual ones if `wide`.
///
/// # Errors
/// Output that cannot be written.
pub fn write_latex(report: &Report, shape: Shape, out: &mut dyn Write) -> Result<(), ReportError> {
    let sheet = Sheet::of(report, shape, None);
    let columns = sheet.columns();
    writeln!(
        out,
        "% {}",
        super::figure::origin_of(report)
            .trim_end()
            .replace('\n', "\n% ")
    )?;
    writeln!(out, "\\begin{{tabular}}{{{}}}", "r".repeat(columns.len()))?;
    writeln!(out, "\\hline")?;
    let heads: Vec<String> = columns.iter().map(head).collect();
    writeln!(out, "{} \\\\", heads.join(" & "))?;
    writeln!(out, "\\hline")?;
    for row in 0..report.points.len() {
        let cells: Vec<String> = columns
            .iter()
            .map(|column| cell(column.cells[row].as_ref(), shape.format))
            .collect();
        writeln!(out, "{} \\\\", cells.join(" & "))?;
    }
    writeln!(out, "\\hline\n\\end{{tabular}}")?;
    Ok(())
}

/// The heading of a column, with its unit where it has one of its own.
fn head(column: &SheetColumn) -> String {
    let first = column.heading.lines().next().unwrap_or_default();
    let whole = column.heading.replace('\n', " ");
    let (words, unit) = match column.unit {
        "" | "1" | "mu" | "mu rate" | "a rate" => (whole, String::new()),
        unit if column.heading.ends_with(unit) => {
            (first.to_owned(), format!(" ({})", escaped(unit)))
        }
        unit => (whole, format!(" ({})", escaped(unit))),
    };
    format!("{}{unit}", symbols(&escaped(&words)))
}

/// A cell.
fn cell(cell: Option<&Uncertain>, format: NumberFormat) -> String {
    let Some(cell) = cell else {
        return "--".into();
    };
    let text = match (cell, format) {
        (Uncertain::Word(word), _) => return escaped(word),
        (cell, NumberFormat::Plain) => cell.plain(),
        (cell, NumberFormat::Si) => cell.si(),
    };
    let text = text.replace(" %", "\\,\\%").replace(" ± ", " \\pm ");
    let text = match text.split_once('e') {
        Some((number, power)) => format!("{number} \\times 10^{{{power}}}"),
        None => text.replace("inf", "\\infty"),
    };
    format!("${text}$")
}

/// Text without the signs that LaTeX takes for its own.
fn escaped(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                plain.push('\\');
                plain.push(character);
            }
            '~' => plain.push_str("\\textasciitilde{}"),
            '^' => plain.push_str("\\textasciicircum{}"),
            '\\' => plain.push_str("\\textbackslash{}"),
            _ => plain.push(character),
        }
    }
    plain
}

/// Signs that a document in ASCII cannot have, as commands.
fn symbols(text: &str) -> String {
    let known = [
        ("Γ", "$\\Gamma$"),
        ("ν", "$\\nu$"),
        ("σ*", "$\\sigma^*$"),
        ("σ", "$\\sigma$"),
        ("λ", "$\\lambda$"),
        ("κ", "$\\kappa$"),
        ("Δt", "$\\Delta t$"),
        ("μ", "$\\mu$"),
        ("η", "$\\eta$"),
        ("²", "$^2$"),
    ];
    known.iter().fold(text.to_owned(), |text, (sign, command)| {
        text.replace(sign, command)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_mathematics_and_signs_commands() {
        let plain = |value: Uncertain| cell(Some(&value), NumberFormat::Plain);
        let si = |value: Uncertain| cell(Some(&value), NumberFormat::Si);
        assert_eq!(plain(Uncertain::Interval(9.863, 0.79)), "$9.86 \\pm 0.79$");
        assert_eq!(si(Uncertain::Interval(9.863, 0.79)), "$9.86(79)$");
        assert_eq!(
            si(Uncertain::Interval(1.234e-5, 4.5e-7)),
            "$1.234(45) \\times 10^{-5}$"
        );
        assert_eq!(plain(Uncertain::exact(f64::INFINITY)), "$\\infty$");
        assert_eq!(cell(None, NumberFormat::Si), "--");
        assert_eq!(
            symbols(&escaped("Γ_5 % σ*")),
            "$\\Gamma$\\_5 \\% $\\sigma^*$"
        );
    }
}
