//! `sweep verify`.

use super::Output;
use crate::api::Error;
use crate::exit;
use sd_core::verify::{Check, checks};
use serde_json::json;

/// Recompute known results and compare: seconds
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
        let mut table = crate::report::table(output.width);
        table.set_header(["quantity", "ours", "known", "source", ""]);
        for check in &checks {
            table.add_row([
                check.quantity.clone(),
                format!("{:.9}", Number(check.value)),
                known(check),
                check.source.into(),
                if check.passes() { "pass" } else { "FAIL" }.into(),
            ]);
        }
        writeln!(output.out, "{}", crate::report::whole(table))?;
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
        format!("at least {:.3}", Number(least))
    } else if least == 0.0 {
        format!("at most {:.3}", Number(most))
    } else {
        let (middle, half) = (0.5 * (least + most), 0.5 * (most - least));
        format!("{:.9} ± {:.1}", Number(middle), Number(half))
    }
}

/// A number in plain form if that is legible, else in powers of ten; the precision counts significant digits.
struct Number(f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(6);
        let magnitude = self.0.abs();
        if magnitude == 0.0 {
            write!(f, "0")
        } else if (1e-3..1e6).contains(&magnitude) {
            write!(
                f,
                "{}",
                crate::format::significant(self.0, i32::try_from(digits).unwrap_or(6))
            )
        } else {
            write!(f, "{:.*e}", digits.min(3) - 1, self.0)
        }
    }
}
