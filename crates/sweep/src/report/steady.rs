//! Points whose runs are not in steady state, with advice: suitable values of `discard` or
//! `strain`.

use super::error::ReportError;
use crate::measure::{Drift, Runs, Steadiness, Trend, mser_5};
use crate::model::protocol::Protocol;
use crate::store::Store;
use crate::text::format::{short, significant};

/// The trend of a point whose averaged runs are not in steady state, with advice. Their samples are
/// read only then.
pub(super) fn trend(
    store: &Store,
    runs: &Runs<'_>,
    protocol: &Protocol,
) -> Result<Option<(Trend, String)>, ReportError> {
    let Some(trend) = runs.trend() else {
        return Ok(None);
    };
    let traces = runs
        .averaged
        .iter()
        .map(|run| store.trace(&run.key))
        .collect::<Result<Vec<_>, _>>()?;
    let percent = |part: f64| significant(100.0 * part.abs(), 2);
    let direction = |part: f64| if part > 0.0 { "above" } else { "below" };
    let mut found: Vec<String> = Vec::new();
    for (what, change) in runs.changes_of_order() {
        let verb = if change > 0.0 { "rises" } else { "falls" };
        let size = significant(change.abs(), 2);
        found.push(format!(
            "{what} {verb} by {size} from the first half of the kept strain to the second"
        ));
    }
    if let Some(change) = runs.change_of_fraction() {
        let verb = if change > 0.0 { "rises" } else { "falls" };
        let size = significant(change.abs(), 2);
        found.push(format!(
            "the fraction {verb} by {size} from the first half of the kept strain to the second"
        ));
    }
    let drift = runs.drift();
    if let Some(drift) = drift.filter(Drift::drifts) {
        let halves = drift.halves.mean;
        found.push(format!(
            "the viscosity over the second half of the kept strain is {} % {} that over the first",
            percent(halves),
            direction(halves)
        ));
    } else if let Some(drift) = drift.filter(Drift::remembers_start) {
        let start = drift.start.mean;
        found.push(format!(
            "the viscosity over the first quarter of the kept strain is {} % {} that over the rest: the initial transient persists",
            percent(start),
            direction(start)
        ));
    }
    let remedy = if trend == Trend::Ordering {
        longer(protocol)
    } else {
        remedy(&traces, protocol)
    };
    Ok(Some((trend, format!("{}; {remedy}", found.join(", and ")))))
}

/// The strain of the run at which the averaged segment starts, and its name in terms of the keys of
/// the file: with segments the last is averaged.
fn averaged_segment(protocol: &Protocol) -> (f64, String) {
    match protocol.segments.last() {
        None => (0.0, String::new()),
        Some(last) => {
            let number = protocol.segments.len();
            (last.imposed.start, format!(" of segment {number}"))
        }
    }
}

/// Advice to make runs longer.
fn longer(protocol: &Protocol) -> String {
    let (start, of_segment) = averaged_segment(protocol);
    match protocol.segments.last() {
        Some(last) if last.imposed.amplitude.is_some() => {
            format!("more cycles{of_segment} are needed")
        }
        _ => format!(
            "longer runs are needed, such as strain = {}{of_segment}",
            short(2.0 * (protocol.strain - start), 6)
        ),
    }
}

/// The remedy suggested by the same runs.
fn remedy(traces: &[Vec<(f64, f64)>], protocol: &Protocol) -> String {
    let (start, of_segment) = averaged_segment(protocol);
    let length = traces.iter().map(Vec::len).min().unwrap_or(0);
    let series: Vec<f64> = (0..length)
        .map(|n| traces.iter().map(|trace| trace[n].1).sum::<f64>() / traces.len() as f64)
        .collect();
    let Some((left_out, is_limit)) = mser_5(&series) else {
        return longer(protocol);
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
    if is_steady_then && !is_limit && protocol.discard < strain {
        return format!(
            "discard = {}{of_segment} leaves a steady part (MSER-5)",
            significant(strain - start, 3)
        );
    }
    longer(protocol)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::parse;

    /// A campaign with these segments, as far as the second.
    fn protocol(segments: &str) -> Protocol {
        let text = format!(
            "name = \"two\"\n{segments}[[grid]]\narea_fraction = 0.6\nfriction = 0.3\nroughness = 0.01\n\
             shear_rate = 1\nseeds = 1\nspheres = 30\nhydrodynamics = \"ball-melrose\"\n"
        );
        parse("two.toml", text)
            .unwrap()
            .protocol
            .of_segment(2)
            .unwrap()
    }

    #[test]
    fn advice_is_in_terms_of_the_segment_that_is_averaged() {
        let steady = protocol(
            "[[protocol.segment]]\nstrain = 3.0\n[[protocol.segment]]\nstrain = 2.0\ndirection = -1\n",
        );
        let advice = remedy(&[Vec::new()], &steady);
        assert!(advice.ends_with("strain = 4 of segment 2"), "{advice}");
        // Twenty values that fall, then a hundred that fluctuate about a mean.
        let late = (0..120).map(|n| {
            let noise = f64::from(n * 7919 % 13) / 13.0;
            let start = if n < 20 {
                100.0 - 5.0 * f64::from(n)
            } else {
                0.0
            };
            (3.0 + f64::from(n) / 60.0, 10.0 + start + noise)
        });
        let advice = remedy(&[late.collect()], &steady);
        assert!(advice.starts_with("discard = 0."), "{advice}");
        assert!(advice.contains(" of segment 2 leaves"), "{advice}");
        let oscillation = protocol(
            "[[protocol.segment]]\nstrain = 3.0\n\
             [[protocol.segment]]\noscillation = { amplitude = 0.5, cycles = 3 }\n",
        );
        let advice = remedy(&[Vec::new()], &oscillation);
        assert_eq!(advice, "more cycles of segment 2 are needed");
    }
}
