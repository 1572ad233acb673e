//! `sweep scalars`.

use super::Output;
use crate::error::Error;
use crate::instant::named_scalars;
use crate::system::exit;
use crate::text::table::table;
use serde_json::json;

/// Print the resistance functions of two spheres
///
/// Normalised as in Kim & Karrila: A by 6 pi mu a1; B, G by 4 pi mu a1^2; C, H by 8 pi mu a1^3; M
/// by (20/3) pi mu a1^3.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: sweep scalars --size-ratio 1 --separation 2.01")]
pub(crate) struct Arguments {
    /// Radius of the second sphere over that of the first
    #[arg(long, value_name = "L")]
    size_ratio: f64,
    /// Separation s' = 2 r / (a1 + a2), above 2
    #[arg(long, value_name = "S")]
    separation: f64,
}

/// Writes the functions.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let named = named_scalars(arguments.size_ratio, arguments.separation)?;
    if output.json {
        let mut object = json!({
            "size_ratio": arguments.size_ratio,
            "s_prime": arguments.separation,
        });
        for (name, values) in named {
            object[name] = json!(values);
        }
        output.json(&object)?;
        return Ok(exit::DONE);
    }
    let rows = named
        .map(|(name, [own, other])| [name.into(), format!("{own:.12e}"), format!("{other:.12e}")]);
    let table = table(output.width, ["function", "11", "12"], rows);
    writeln!(output.out, "{table}")?;
    Ok(exit::DONE)
}
