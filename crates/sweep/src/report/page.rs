//! The report as one self-contained page: summary, curves, traces, movies, failures, provenance.
//!
//! The page asks nothing of any network. All text of users goes through JSON in a script element, with every `<`, `>` and
//! `&` escaped, and reaches the page as text only.

use super::ReportError;
use super::columns::quantities;
use super::json::Row;
use super::{Report, Selection, selected_runs};
use crate::axes::{AXES, Axis, identity};
use crate::statistics::ratio;
use crate::store::{FailureLine, Provenance, Store, StoredFrame};
use crate::trajectory::state_number;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::HashMap;

/// The frame of the page.
const PAGE: &str = include_str!("page/page.html");
/// Its style.
const STYLE: &str = include_str!("page/page.css");
/// Its script.
const SCRIPT: &str = include_str!("page/page.js");

/// Points of all traces together at most, so that a page of thousands of runs still opens.
const TRACE_POINTS: usize = 400_000;
/// Frames of all movies together at most.
const MOVIE_FRAMES: usize = 3000;
/// Movies at most.
const MOVIES: usize = 100;
/// Failures listed at most.
const FAILURES: u32 = 200;

/// Where a page lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageHost {
    /// In a file: everything is in it.
    File,
    /// On a server that is asked for news, and for movies one by one.
    Server,
}

/// What the script is given.
#[derive(Serialize)]
struct Data<'r> {
    /// Whether a server can be asked for news.
    live: bool,
    /// Name of the campaign.
    campaign: &'r str,
    /// Which of its points the page is about; nothing for all.
    selection: String,
    /// Its file.
    text: String,
    /// Strain discarded.
    discard: f64,
    /// Cases by state.
    cases: crate::store::Counts,
    /// Share of the work done.
    work_done: f64,
    /// Seconds left, while processes work on it.
    eta_s: Option<f64>,
    /// Axes that tell points apart, in the order of the columns.
    axes: Vec<AxisData>,
    /// Quantities that curves can show.
    quantities: Vec<QuantityData>,
    /// Finished runs with doubtful numbers.
    doubtful: u64,
    /// Whether these are averaged with the others.
    with_doubtful: bool,
    /// Points, with the names of `sweep report --json`.
    points: Vec<Row<'r>>,
    /// Runs.
    runs: Vec<Value>,
    /// Movies by key; `true` for one that the server has.
    movies: Map<String, Value>,
    /// Failures.
    failures: Vec<FailureLine>,
    /// Programs that computed.
    provenance: &'r [Provenance],
}

/// An axis, as the script is told of it.
#[derive(Serialize)]
struct AxisData {
    key: &'static str,
    symbol: &'static str,
    /// Label of a figure's axis.
    label: String,
    /// Whether its values lie on a line.
    numeric: bool,
    logarithmic: bool,
}

/// A quantity, as the script is told of it.
#[derive(Serialize)]
struct QuantityData {
    key: &'static str,
    label: &'static str,
}

impl From<&Axis> for AxisData {
    fn from(axis: &Axis) -> Self {
        Self {
            key: axis.key,
            symbol: axis.symbol,
            label: axis.label(),
            numeric: axis.is_numeric(),
            logarithmic: axis.is_logarithmic(),
        }
    }
}

/// The page of the points selected of a store.
///
/// # Errors
/// Trouble with the store; [`ReportError::Argument`] on a selection that no point meets.
pub fn page(store: &Store, selection: &Selection, host: PageHost) -> Result<String, ReportError> {
    let data = data(store, selection, host)?;
    let connect = match host {
        PageHost::File => "'none'",
        PageHost::Server => "'self'",
    };
    let page = PAGE
        .replace("@CONNECT@", connect)
        .replace("@CSS@", STYLE)
        .replace("@JS@", SCRIPT);
    // Last, and once: what users wrote is never looked at for placeholders.
    Ok(page.replacen("@DATA@", &in_script(&data), 1))
}

/// JSON that cannot end the element it stands in.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

/// What the script is given, as JSON.
///
/// # Errors
/// Trouble with the store; [`ReportError::Argument`] on a selection that no point meets.
pub fn data(store: &Store, selection: &Selection, host: PageHost) -> Result<String, ReportError> {
    let report = Report::of(store, selection)?;
    let work_done = if selection.is_everything() {
        let (total, done) = store.work()?;
        ratio(done, total).unwrap_or(1.0)
    } else {
        let c = &report.counts;
        ratio((c.done + c.jammed + c.failed) as f64, c.total() as f64).unwrap_or(1.0)
    };
    // The time left is that of the whole campaign.
    let eta_s = if selection.is_everything() {
        store.time_left()?
    } else {
        None
    };
    let all = selected_runs(store, selection)?;
    let mut place_of = HashMap::new();
    for run in &all {
        let next = place_of.len();
        place_of.entry(identity(&run.params)).or_insert(next);
    }
    let points_each = (TRACE_POINTS / all.len().max(1)).clamp(12, 240);
    let mut runs = Vec::with_capacity(all.len());
    let mut filmed: Vec<String> = Vec::new();
    let mut last_filmed = None;
    for run in &all {
        let point = place_of[&identity(&run.params)];
        let trace = thinned(&store.trace(&run.key)?, points_each);
        runs.push(json!({
            "point": point, "key": run.key, "seed": run.seed, "state": run.state,
            "doubts": run.doubts.iter().map(|doubt| doubt.name()).collect::<Vec<_>>(),
            "viscosity": run.viscosity, "wall_time_s": run.wall_time_s, "trace": trace,
        }));
        if last_filmed != Some(point) && filmed.len() < MOVIES && store.frame_count(&run.key)? > 1 {
            last_filmed = Some(point);
            filmed.push(run.key.clone());
        }
    }
    let frames_each = (MOVIE_FRAMES / filmed.len().max(1)).clamp(20, 120);
    let mut movies = Map::new();
    for key in filmed {
        let film = match host {
            PageHost::File => movie(store, &key, frames_each)?,
            PageHost::Server => Value::Bool(true),
        };
        movies.insert(key, film);
    }
    let mut failures = store.failures(FAILURES)?;
    failures.retain(|failure| selection.has(&failure.params));
    let document = Data {
        live: host == PageHost::Server,
        campaign: &report.campaign,
        selection: selection.to_string(),
        text: store.campaign_text()?,
        discard: report.discard,
        cases: report.counts,
        work_done,
        eta_s,
        axes: AXES.iter().map(AxisData::from).collect(),
        quantities: quantities()
            .map(|(key, label)| QuantityData { key, label })
            .collect(),
        doubtful: report.doubtful,
        with_doubtful: report.with_doubtful,
        points: report.points.iter().map(Row).collect(),
        runs,
        movies,
        failures,
        provenance: &report.provenance,
    };
    serde_json::to_string(&document).map_err(|error| ReportError::Output(error.into()))
}

/// The movie of a run, at most so many frames.
///
/// # Errors
/// Those of [`Store::frames`].
pub fn movie(store: &Store, key: &str, frames: usize) -> Result<Value, ReportError> {
    let stored = usize::try_from(store.frame_count(key)?).unwrap_or(usize::MAX);
    let kept = store.frames(key, stored.div_ceil(frames.max(1)))?;
    let first = &kept[0].frame;
    let radii = &first.radii;
    let alike = radii
        .windows(2)
        .all(|pair| pair[0].to_bits() == pair[1].to_bits());
    // The typical strong force, so that a single spike does not make all others invisible.
    let mut forces: Vec<f64> = kept
        .iter()
        .flat_map(|kept| &kept.frame.contacts)
        .map(|contact| contact.normal_force)
        .collect();
    forces.sort_by(f64::total_cmp);
    let strong = forces.get(forces.len() * 95 / 100).copied().unwrap_or(1.0);
    Ok(json!({
        "side": rounded(first.side),
        "radii": radii[..if alike { radii.len().min(1) } else { radii.len() }],
        "force": rounded(strong.max(1e-3)),
        "frames": kept.iter().map(picture).collect::<Vec<_>>(),
    }))
}

/// One frame of a movie.
fn picture(kept: &StoredFrame) -> Value {
    let frame = &kept.frame;
    let places: Vec<f64> = frame
        .centres
        .iter()
        .zip(&frame.orientations)
        .flat_map(|([x, y], angle)| [rounded(*x), rounded(*y), rounded(*angle)])
        .collect();
    let contacts: Vec<Value> = frame
        .contacts
        .iter()
        .map(|c| {
            let [nx, ny] = c.normal.map(rounded);
            json!([
                c.i,
                c.j,
                state_number(c.state),
                nx,
                ny,
                rounded(c.normal_force)
            ])
        })
        .collect();
    json!({"strain": rounded(frame.strain), "offset": rounded(frame.offset), "x": places, "contacts": contacts})
}

/// To three decimals, as much as can be seen.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// At most `most` points of a trace: of each stretch the lowest and the highest, so that no spike is lost.
fn thinned(trace: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    let short = |(strain, viscosity): (f64, f64)| {
        let digits = 10_f64.powf(4.0 - viscosity.abs().max(1e-9).log10().floor());
        (rounded(strain), (viscosity * digits).round() / digits)
    };
    if trace.len() <= most {
        return trace.iter().copied().map(short).collect();
    }
    let stretch = (2 * trace.len()).div_ceil(most).max(2);
    trace
        .chunks(stretch)
        .flat_map(|part| {
            let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
            let low = part.iter().min_by(by_height).copied();
            let high = part.iter().max_by(by_height).copied();
            let mut both: Vec<(f64, f64)> = low.into_iter().chain(high).collect();
            both.sort_by(|a, b| a.0.total_cmp(&b.0));
            both.dedup();
            both
        })
        .map(short)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{in_script, thinned};

    #[test]
    fn markup_cannot_end_the_script() {
        let text = in_script(r#"{"name":"</script><img onerror=1>&amp;"}"#);
        assert!(!text.contains(['<', '>', '&']));
        let back: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["name"], "</script><img onerror=1>&amp;");
    }

    #[test]
    fn thinning_keeps_spikes_and_length() {
        let trace: Vec<(f64, f64)> = (0..5000)
            .map(|n| (f64::from(n) * 0.001, if n == 3333 { 1e4 } else { 7.0 }))
            .collect();
        let thin = thinned(&trace, 200);
        assert!(thin.len() <= 202);
        assert!(thin.contains(&(3.333, 1e4)));
    }
}
