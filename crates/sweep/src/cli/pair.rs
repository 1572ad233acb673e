//! `sweep pair`.

use super::Output;
use super::output_file::{check_outputs, check_picture, save};
use crate::error::Error;
use crate::near_field_cache;
use crate::report::draw_graphs;
use crate::system::exit;
use crate::text::format::significant;
use crate::text::table::table;
use sd_core::NearFields;
use sd_core::pair::{PairScenario, pass};
use std::path::PathBuf;

/// Drive two spheres past each other
///
/// Unbounded fluid, radii 1 and L, forces +1 and -1 along x from (-X, Y) and (X, -Y), critical load
/// 0, until x1 - x2 = 2X.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  sweep pair --roughness 0.05 --friction 0.5\n  sweep pair --no-contact --json\n  \
                  sweep pair --size-ratio 0.5 --figure paths.svg"
)]
pub(crate) struct Arguments {
    /// Radius of the second sphere over that of the first
    #[arg(long, value_name = "L", default_value_t = 1.0)]
    size_ratio: f64,
    /// Roughness height, in radii of the first sphere
    #[arg(long, value_name = "H", default_value_t = 0.05)]
    roughness: f64,
    /// Friction coefficient
    #[arg(long, value_name = "NU", default_value_t = 0.0)]
    friction: f64,
    /// Smooth spheres
    #[arg(long, conflicts_with_all = ["roughness", "friction"])]
    no_contact: bool,
    /// Half the offset of the paths at the start
    #[arg(long, value_name = "Y", default_value_t = 0.25)]
    offset: f64,
    /// Half the distance along x at the start
    #[arg(long, value_name = "X", default_value_t = 5.0)]
    start: f64,
    /// Draw the paths of both centres
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
    /// Time step, in viscosity times radius squared over force
    #[arg(long, value_name = "T", default_value_t = 0.05)]
    time_step: f64,
}

/// Writes the paths of the spheres.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    for (argument, value) in [
        ("--size-ratio", arguments.size_ratio),
        ("--roughness", arguments.roughness),
        ("--friction", arguments.friction),
        ("--offset", arguments.offset),
        ("--start", arguments.start),
        ("--time-step", arguments.time_step),
    ] {
        let positive = !["--friction", "--offset"].contains(&argument);
        if !value.is_finite()
            || (positive && value <= 0.0)
            || (argument == "--friction" && value < 0.0)
        {
            return Err(Error::Argument {
                argument,
                message: format!(
                    "{value} is out of range: finite{}",
                    match argument {
                        "--friction" => " and not negative",
                        "--offset" => "",
                        _ => " and above 0",
                    }
                ),
            });
        }
    }
    let tables = near_field_cache::make(&NearFields::ratios(&[1.0, arguments.size_ratio]), |_| ())?;
    let scenario = PairScenario {
        size_ratio: arguments.size_ratio,
        contact: (!arguments.no_contact).then_some((arguments.roughness, arguments.friction)),
        offset: arguments.offset,
        start: arguments.start,
        time_step: arguments.time_step,
    };
    check_outputs(&[("--figure", &arguments.figure)], &[], output)?;
    check_picture("--figure", arguments.figure.as_ref())?;
    let passed = pass(&scenario, &tables)?;
    if let Some(path) = &arguments.figure {
        let path_of = |x: usize| passed.path.iter().map(|row| [row[x], row[x + 1]]).collect();
        let graphs = [("first sphere", path_of(1)), ("second sphere", path_of(4))];
        let drawn = draw_graphs(&graphs, ["x / a", "y / a"], "two spheres that pass")?;
        save(path, drawn.as_bytes(), output)?;
    }
    if output.json {
        output.json(&passed)?;
        return Ok(exit::DONE);
    }
    let last = passed.path.last().copied().unwrap_or_default();
    let rows = [
        ("rotation in degrees", passed.rotation_degrees),
        ("offset at the end", [passed.final_offset, last[5]]),
    ];
    let rows = rows.map(|(name, [first, second])| {
        [name.into(), significant(first, 6), significant(second, 6)]
    });
    let heads = ["quantity", "first sphere", "second sphere"];
    writeln!(output.out, "{}", table(output.width, heads, rows))?;
    writeln!(
        output.out,
        "smallest gap {}, time {}, {} points of the path (--json prints them)",
        significant(passed.minimum_gap, 6),
        significant(passed.time, 6),
        passed.path.len()
    )?;
    Ok(exit::DONE)
}
