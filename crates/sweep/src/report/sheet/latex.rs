//! Tables as LaTeX.

use super::{NumberFormat, Shape, Sheet, SheetColumn};
use crate::report::error::ReportError;
use crate::report::figure::Origin;
use crate::report::points::Report;
use crate::text::format::Uncertain;
use std::io::{self, Write};

impl Sheet {
    /// Writes a `tabular` that needs no package, after comments with its origin.
    pub(crate) fn write_latex(&self, origin: &str, out: &mut dyn Write) -> io::Result<()> {
        for line in origin.trim_end().lines() {
            writeln!(out, "% {line}")?;
        }
        let forms = self.columns.iter().map(|column| {
            let is_of_words = column.is_of_words();
            if is_of_words { 'l' } else { 'r' }
        });
        writeln!(out, "\\begin{{tabular}}{{{}}}", forms.collect::<String>())?;
        writeln!(out, "\\hline")?;
        let heads: Vec<String> = self.columns.iter().map(head).collect();
        writeln!(out, "{} \\\\", heads.join(" & "))?;
        writeln!(out, "\\hline")?;
        let rows = self.columns.first().map_or(0, |column| column.cells.len());
        for row in 0..rows {
            let cells: Vec<String> = self
                .columns
                .iter()
                .map(|column| cell(column.cells[row].as_ref(), self.format))
                .collect();
            writeln!(out, "{} \\\\", cells.join(" & "))?;
        }
        writeln!(out, "\\hline\n\\end{{tabular}}")
    }
}

/// The heading of a column, with its unit.
fn head(column: &SheetColumn) -> String {
    let head = &column.head;
    let text = match head.unit {
        "" => head.title.clone(),
        unit => format!("{} ({unit})", head.title),
    };
    symbols(&escaped(&text))
}

fn cell(cell: Option<&Uncertain>, format: NumberFormat) -> String {
    let Some(cell) = cell else {
        return "--".into();
    };
    let text = match (cell, format) {
        (Uncertain::Word(word), _) => return symbols(&escaped(word).replace('\n', " ")),
        (Uncertain::Quantity(words), _) => {
            return symbols(&escaped(words).replace(" \\%", "\\,\\%"));
        }
        (cell, NumberFormat::Plain) => cell.plain(),
        (cell, NumberFormat::Si) => cell.si(),
    };
    let text = text.replace(" ± ", " \\pm ");
    let text = match text.split_once('e') {
        Some((number, power)) => format!("{number} \\times 10^{{{power}}}"),
        None => text.replace("inf", "\\infty"),
    };
    format!("${text}$")
}

/// Text with the special characters of LaTeX escaped.
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

/// Commands for characters outside ASCII.
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
        ("₁", "$_1$"),
        ("₂", "$_2$"),
        ("≈", "$\\approx$"),
        ("∞", "$\\infty$"),
        ("…", "\\dots{}"),
    ];
    known.iter().fold(text.to_owned(), |text, (sign, command)| {
        text.replace(sign, command)
    })
}

/// Writes the points as a LaTeX table with the columns of the table on the screen, all default ones
/// if it is wide.
pub(crate) fn write_latex(
    report: &Report,
    shape: Shape,
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let origin = Origin::of(std::slice::from_ref(report));
    Ok(Sheet::of(report, shape, None).write_latex(&origin.text, out)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_mathematics_and_signs_commands() {
        let plain = |value: Uncertain| cell(Some(&value), NumberFormat::Plain);
        let digits = crate::text::format::Digits::of([f64::INFINITY].into_iter());
        let si = |value: Uncertain| cell(Some(&value), NumberFormat::Si);
        assert_eq!(plain(Uncertain::Interval(9.863, 0.79)), "$9.86 \\pm 0.79$");
        assert_eq!(si(Uncertain::Interval(9.863, 0.79)), "$9.86(79)$");
        assert_eq!(
            si(Uncertain::Interval(1.234e-5, 4.5e-7)),
            "$1.234(45) \\times 10^{-5}$"
        );
        assert_eq!(plain(Uncertain::Short(f64::INFINITY, digits)), "$\\infty$");
        assert_eq!(cell(None, NumberFormat::Si), "--");
        assert_eq!(
            plain(Uncertain::Quantity("≈ 12 %".into())),
            "$\\approx$ 12\\,\\%"
        );
        assert_eq!(
            symbols(&escaped("Γ_5 % σ*")),
            "$\\Gamma$\\_5 \\% $\\sigma^*$"
        );
    }
}
