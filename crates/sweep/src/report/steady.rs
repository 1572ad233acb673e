//! Advice for a point whose runs are not steady: suitable values of `discard` or `strain`.

use super::error::ReportError;
use crate::measure::PointRun;
use crate::measure::{Drift, Steadiness, mser_5};
use crate::model::protocol::{Discard, Protocol};
use crate::store::Store;
use crate::text::format::significant;

/// Advice about a point, if its averaged runs drift or remember their start. Their samples are read
/// only then.
pub(super) fn advice(
    store: &Store,
    drift: Option<Drift>,
    averaged: &[&PointRun],
    protocol: &Protocol,
) -> Result<Option<String>, ReportError> {
    let Some(drift) = drift.filter(|drift| drift.drifts() || drift.remembers_start()) else {
        return Ok(None);
    };
    let traces = averaged
        .iter()
        .map(|run| store.trace(&run.key))
        .collect::<Result<Vec<_>, _>>()?;
    let percent = |part: f64| significant(100.0 * part.abs(), 2);
    let direction = |part: f64| if part > 0.0 { "above" } else { "below" };
    let found = if drift.drifts() {
        let halves = drift.halves.mean;
        format!(
            "the mean over the second half of the kept strain is {} % {} that over the first",
            percent(halves),
            direction(halves)
        )
    } else {
        let start = drift.start.mean;
        format!(
            "the mean over its first quarter is {} % {} that over the rest: the initial transient persists",
            percent(start),
            direction(start)
        )
    };
    Ok(Some(format!("{found}; {}", remedy(&traces, protocol))))
}

/// The remedy suggested by the same runs.
fn remedy(traces: &[Vec<(f64, f64)>], protocol: &Protocol) -> String {
    let longer = || {
        format!(
            "longer runs are needed, such as strain = {}",
            2.0 * protocol.strain
        )
    };
    let length = traces.iter().map(Vec::len).min().unwrap_or(0);
    let series: Vec<f64> = (0..length)
        .map(|n| traces.iter().map(|trace| trace[n].1).sum::<f64>() / traces.len() as f64)
        .collect();
    let Some((left_out, is_limit)) = mser_5(&series) else {
        return longer();
    };
    let strain = traces[0][left_out].0;
    let parts: Vec<_> = traces
        .iter()
        .filter_map(|trace| {
            let kept: Vec<f64> = trace[left_out..].iter().map(|(_, v)| *v).collect();
            Some(Steadiness::of(&kept)?.parts)
        })
        .collect();
    let is_steady_then =
        Drift::of(&parts).is_some_and(|drift| !drift.drifts() && !drift.remembers_start());
    let discards_less = match protocol.discard {
        Discard::Strain(discarded) => discarded < strain,
        Discard::Auto => false,
    };
    match (is_steady_then && !is_limit, discards_less) {
        (true, true) => format!(
            "discard = {} leaves a steady part (MSER-5)",
            significant(strain, 3)
        ),
        _ => longer(),
    }
}
