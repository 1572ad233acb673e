//! `sweep show`.

use super::Output;
use super::place::StoreArguments;
use crate::error::Error;
use crate::model::axes::AXES;
use crate::report::Starts;
use crate::store::CaseDetails;
use crate::system::exit;
use crate::text::format::{counted, duration, significant};
use sd_core::Sample;
use std::io::Write;

/// Parts of a trace.
const PARTS: usize = 10;

/// Show one run: parameters, trace, counters, provenance, error
///
/// Reads only; the trace of an unfinished run is that of its last checkpoint.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep show results/quickstart.sqlite 12\n  sweep show results/quickstart.sqlite 3f9a --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// The run: the beginning of its key, or its number in the campaign file, from 1
    case: String,
}

/// The trace: means of the viscosity over ten equal parts of the samples, or fewer parts.
fn parts(samples: &[(u64, Sample)]) -> Vec<String> {
    let part = |number: usize| {
        let [from, to] = [number, number + 1].map(|end| end * samples.len() / PARTS);
        let own = &samples[from..to];
        let sum: f64 = own.iter().map(|(_, sample)| sample.viscosity).sum();
        (!own.is_empty()).then(|| significant(sum / own.len() as f64, 3))
    };
    (0..PARTS).filter_map(part).collect()
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = arguments.place.open(output)?;
    let details = store.details(&arguments.case)?;
    if output.json {
        let mut object = serde_json::json!(details);
        if details.params.volume_fraction.is_some() {
            object["params"]["area_fraction"] = serde_json::Value::Null;
        }
        output.json(&object)?;
        return Ok(exit::DONE);
    }
    let out = &mut *output.out;
    let number = details.number.map_or_else(
        || "no longer in the campaign file".into(),
        |number| format!("case {number}"),
    );
    let name = store.campaign_name()?;
    let starts = Starts::of_store(&store)?;
    writeln!(out, "{name}: {number}, key {}", details.key)?;
    let words: Vec<String> = AXES
        .iter()
        .filter(|axis| axis.matters(std::iter::once(&details.params)))
        .map(|axis| {
            let value = axis.value(&details.params).to_string();
            let name = starts.name_on(axis, &details.params).unwrap_or(&value);
            format!("{} {name}", axis.symbol())
        })
        .collect();
    writeln!(out, "{}, seed {}", words.join(", "), details.seed)?;
    let strain = |steps: u64| steps as f64 * details.params.time_step;
    writeln!(
        out,
        "{}{}: strain {:.3} of {:.3}, started {}{}{}",
        details.state.word(&details.params),
        details
            .final_fraction
            .filter(|_| details.state.is_arrest(&details.params))
            .map_or_else(String::new, |fraction| format!(
                " at a fraction of {}",
                significant(fraction, 4)
            )),
        strain(details.steps_done),
        strain(details.steps),
        counted(details.attempts, "time"),
        details
            .resumed
            .map_or_else(String::new, |n| format!(", resumed {}", counted(n, "time"))),
        details
            .cpu_time_s
            .or(details.wall_time_s)
            .map_or_else(String::new, |s| format!(", {} of computing", duration(s))),
    )?;
    write_samples(&details, out)?;
    for doubt in &details.doubts {
        writeln!(out, "its numbers are doubtful, and not averaged: {doubt}")?;
    }
    if let Some(origin) = &details.origin {
        writeln!(out, "computed on {} by {}", origin.host, origin.program())?;
    }
    for failure in &details.failures {
        let place = failure.pair.map_or_else(String::new, |(i, j)| {
            format!(
                ", pair {i}, {j}, gap {}",
                failure
                    .gap
                    .map_or_else(|| "–".into(), |gap| significant(gap, 3))
            )
        });
        writeln!(
            out,
            "attempt {} failed at step {}, strain {:.3}{place}: {}",
            failure.attempt, failure.step, failure.strain, failure.error
        )?;
    }
    Ok(exit::DONE)
}

/// Writes the trace and what the last sample has.
fn write_samples(details: &CaseDetails, out: &mut dyn Write) -> std::io::Result<()> {
    if let Some((_, last)) = details.samples.last() {
        writeln!(
            out,
            "{}, the last at strain {:.3} with viscosity {} (`sweep report FILE --figure trace.svg --kind trace --case {}` draws them)",
            counted(details.samples.len(), "sample"),
            last.strain,
            significant(last.viscosity, 4),
            &details.key[..8]
        )?;
        let parts = parts(&details.samples);
        writeln!(
            out,
            "viscosity over tenths of this strain: {}",
            parts.join(" ")
        )?;
    } else {
        writeln!(out, "no samples yet")?;
    }
    if let Some((_, last)) = details.samples.last() {
        let c = &last.counters;
        writeln!(
            out,
            "at the last sample: {} contacts, {} activated, {} rolling, {} slipping, smallest gap {}",
            last.contacts,
            last.activated,
            last.sticking,
            last.slipping,
            significant(last.minimum_gap, 3)
        )?;
        writeln!(
            out,
            "contact problems: {} solved, {} unconverged, {} without a solution, worst residual {}, worst friction error {}\n\
             smallest gap so far {}, jam events {}, {} kept",
            c.stages,
            c.unconverged_stages,
            c.jammed_stages,
            significant(c.worst_residual, 2),
            significant(c.worst_friction_error, 2),
            significant(c.minimum_gap, 3),
            c.jam_events,
            counted(details.frames, "frame")
        )?;
    }
    Ok(())
}
