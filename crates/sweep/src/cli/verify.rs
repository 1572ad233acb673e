//! `sweep verify`.

use super::Output;
use crate::error::Error;
use crate::system::exit;
use crate::text::format::significant;
use crate::text::table::table;
use crate::verify::{Check, checks};
use serde_json::json;

/// Recompute known results and compare them, within seconds
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  sweep verify\n  sweep verify --json")]
pub(crate) struct Arguments {}

/// Writes the table of checks; fails if one does.
pub(crate) fn execute(_: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let checks = checks()?;
    let failed = checks.iter().filter(|check| !check.passes()).count();
    if output.json {
        let rows: Vec<_> = checks
            .iter()
            .map(|check| {
                let mut row = json!(check);
                row["pass"] = check.passes().into();
                row
            })
            .collect();
        output.json(&json!({ "checks": rows, "failed": failed }))?;
    } else {
        let rows = checks.iter().map(|check| {
            [
                check.quantity.clone(),
                number(check.value, 9),
                known(check),
                check.source.into(),
                if check.passes() { "pass" } else { "FAIL" }.into(),
            ]
        });
        let heads = ["quantity", "ours", "known", "source", ""];
        writeln!(output.out, "{}", table(output.width, heads, rows))?;
        writeln!(output.out, "{} checks, {failed} failed", checks.len())?;
    }
    Ok(if failed == 0 {
        exit::DONE
    } else {
        exit::FAILED
    })
}

/// The known value with its tolerance, or the range allowed.
fn known(check: &Check) -> String {
    let (least, most) = (check.least, check.most);
    if least == f64::MIN_POSITIVE {
        "above 0".into()
    } else if most == f64::INFINITY {
        format!("at least {}", number(least, 3))
    } else if least == 0.0 {
        format!("at most {}", number(most, 3))
    } else {
        let (middle, half) = (0.5 * (least + most), 0.5 * (most - least));
        format!("{} ± {}", number(middle, 9), number(half, 1))
    }
}

/// A number with this many significant digits, in plain form if legible, else in powers of ten.
fn number(value: f64, digits: i32) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        significant(value, digits)
    } else {
        let decimals = usize::try_from(digits.min(3) - 1).unwrap_or(0);
        format!("{value:.decimals$e}")
    }
}
