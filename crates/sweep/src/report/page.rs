//! The report as one self-contained page: summary, curves, traces, movies, failures, provenance.
//!
//! The page loads nothing from the network. All user text is JSON in a script element, with every
//! `<`, `>` and `&` escaped, and is inserted as text only.

use super::error::ReportError;
use super::figure::palette::{COLOURS, COLOURS_ON_DARK, Colour, HEAT, MARKERS};
use super::points::{Point, Report};
use super::selection::Excerpt;
use super::states::{Flow, flows_of};
use super::units::Units;
use crate::data::{DataColumn, Kind, Objects};
use crate::measure::numbers::{Level, Number, columns};
use crate::measure::{Estimate, PointRun, ratio};
use crate::model::axes::{AXES, Axis};
use crate::model::spaces::of_either;
use crate::store::Store;
use crate::trajectory::{Kept, state_number};
use sd_core::simulation::Frame;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};

/// The HTML of the page.
const PAGE: &str = include_str!("page/page.html");
/// Its style.
const STYLE: &str = include_str!("page/page.css");
/// Its scripts, one per subject, within one function to keep their names local.
const SCRIPT: &str = concat!(
    "'use strict';\n(() => {\n",
    include_str!("page/base.js"),
    include_str!("page/curves.js"),
    include_str!("page/views.js"),
    include_str!("page/runs.js"),
    include_str!("page/table.js"),
    include_str!("page/save.js"),
    include_str!("page/start.js"),
    "})();\n"
);

/// Maximum total points of traces, so that a page of thousands of runs still opens.
const TRACE_POINTS: usize = 400_000;
/// Maximum total frames of movies.
const MAX_MOVIE_FRAMES: usize = 3000;
/// Maximum number of movies.
const MAX_MOVIES: usize = 100;
/// Maximum number of failures listed.
const FAILURES: u32 = 200;
/// Width of a bin of a histogram, in decades.
const BIN: f64 = 0.04;

/// Host of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageHost {
    /// A file, which holds everything.
    File,
    /// A server, which the page polls for updates and for movies.
    Server,
}

/// The data for the script.
#[derive(Serialize)]
struct Data<'r> {
    points: Objects<'r>,
    #[serde(flatten)]
    others: Value,
}

/// An axis: `unit` of converted values, their maximum significant `digits`, and `names` of named
/// values.
fn axis_data(report: &Report, axis: &'static Axis) -> Value {
    json!({
        "key": axis.key, "symbol": axis.symbol(), "label": report.units.label_of(axis), "numeric": axis.is_numeric(),
        "logarithmic": axis.is_logarithmic(), "unit": report.units.of_axis(axis), "digits": report.words_of(axis).digits.most,
        "names": report.starts.of_axis(axis),
    })
}

/// A quantity that curves can show.
fn quantity_data(units: Units, number: &Number) -> Value {
    let (label, word) = (number.label, units.word(number.unit));
    let label = if word == number.unit {
        label.to_owned()
    } else {
        format!("{label} ({word})")
    };
    json!({"key": number.name, "label": label})
}

/// The points: the columns of the table by name, and the shear stress that a flow curve shows.
fn point_data(report: &Report) -> Vec<DataColumn> {
    let mut table = report.whole_table(report.units);
    let stress = |of: fn(Estimate) -> Option<f64>| {
        move |point: &Point| {
            let stress = point
                .shear_stress()
                .filter(|stress| stress.mean.is_finite());
            let factor = report.units.factor("F_crit/a²", point.at())?;
            Some(crate::data::Value::Number(factor * of(stress?)?))
        }
    };
    for (name, cell) in [
        ("stress", stress(|s| Some(s.mean))),
        ("stress_ci95", stress(|s| s.ci95)),
    ] {
        table.push(DataColumn::of(
            name,
            Kind::Number,
            "",
            report.points.iter().map(cell),
        ));
    }
    table
}

/// The page of a part of a store.
///
/// # Errors
/// An I/O or SQLite error; [`ReportError::Argument`] on a selection that no point meets.
pub fn page(excerpt: Excerpt<'_>, host: PageHost) -> Result<String, ReportError> {
    let data = data(excerpt, host)?;
    let connect = match host {
        PageHost::File => "'none'",
        PageHost::Server => "'self'",
    };
    let page = PAGE
        .replace("@CONNECT@", connect)
        .replace("@CSS@", &style())
        .replace("@JS@", SCRIPT);
    // Last, in a single pass: user text is never searched for placeholders.
    Ok(page.replacen("@DATA@", &in_script(&data), 1))
}

/// The style, with the colours of curves.
fn style() -> String {
    let list = |colours: &[Colour]| {
        let each = colours.iter().enumerate();
        let each = each.map(|(n, colour)| format!("--c{n}: {colour};"));
        each.collect::<Vec<_>>().join(" ")
    };
    STYLE
        .replace("@LIGHT@", &list(&COLOURS))
        .replace("@DARK@", &list(&COLOURS_ON_DARK))
}

/// JSON that cannot end the element it stands in.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

/// The data for the script, as JSON.
///
/// # Errors
/// An I/O or SQLite error; [`ReportError::Argument`] on a selection that no point meets.
pub fn data(excerpt: Excerpt<'_>, host: PageHost) -> Result<String, ReportError> {
    let Excerpt {
        store,
        selection,
        units,
    } = excerpt;
    let (report, all, points) = Report::with_runs(store, selection)?;
    let report = Report { units, ..report };
    // The remaining time is that of the whole campaign.
    let (work_done, eta_s) = if selection.is_everything() {
        let work = store.work()?;
        (ratio(work.done, work.total), store.time_left(&work)?)
    } else {
        let c = &report.counts;
        let ended = c.done + c.jammed + c.failed;
        (ratio(ended as f64, c.total() as f64), None)
    };
    let factor = units.viscosity_factor();
    let points_each = (TRACE_POINTS / all.len().max(1)).clamp(12, 240);
    let mut runs = Vec::with_capacity(all.len());
    for (run, point) in all.iter().zip(&points) {
        let mut trace = store.trace(&run.key)?;
        for (_, viscosity) in &mut trace {
            *viscosity *= factor;
        }
        let discard = run.discard().unwrap_or(report.discard);
        runs.push(json!({
            "point": point, "key": run.key, "seed": run.seed, "state": run.state,
            "doubts": run.doubts.iter().map(|doubt| doubt.name()).collect::<Vec<_>>(),
            "viscosity": run.number("viscosity").map(|viscosity| factor * viscosity), "wall_time_s": run.number("wall_time_s"), "cpu_time_s": run.number("cpu_time_s"),
            "discard": discard, "histogram": histogram(&trace, discard), "trace": thinned(&trace, points_each),
        }));
    }
    let filmed = filmed(store, all.iter().zip(points), host)?;
    let frames_each = (MAX_MOVIE_FRAMES / filmed.len().max(1)).clamp(20, 120);
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
    let others = json!({
        // Whether a server provides updates.
        "live": host == PageHost::Server,
        "campaign": report.campaign, "selection": selection.to_string(), "text": store.campaign_text()?,
        "discard": report.discard, "cases": report.counts, "work_done": work_done.unwrap_or(1.0), "eta_s": eta_s,
        "axes": AXES.iter().map(|axis| axis_data(&report, axis)).collect::<Vec<_>>(),
        "quantities": columns(Level::Points).filter(|number| !number.label.is_empty()).map(|number| quantity_data(units, number)).collect::<Vec<_>>(),
        // State of each point, as in a state diagram.
        "flows": flows_of(&report.points).iter().map(|flow| flow.map(Flow::name)).collect::<Vec<_>>(),
        "doubtful": report.doubtful, "with_doubtful": report.with_doubtful,
        "viscosity_label": units.label("viscosity", "mu"), "viscosity_factor": factor,
        "stress_label": match units.word("F_crit/a²") {
            "F_crit/a²" => "shear stress σ*".into(),
            _ => units.label("shear stress σ*", "F_crit/a²"),
        },
        // Movies by key; `true` for one on the server.
        "runs": runs, "movies": movies, "failures": failures, "provenance": report.provenance,
        "histogram_bin": BIN,
        // The map of the page includes the yellow end, since its cells have their own background.
        "look": {"markers": MARKERS, "heat": HEAT},
    });
    let points = &point_data(&report);
    let document = Data {
        points: Objects(points),
        others,
    };
    serde_json::to_string(&document).map_err(|error| ReportError::Output(error.into()))
}

/// The runs with movies: on a server all that keep frames; in a file the first of every point
/// before the second of any, up to a size that still opens.
fn filmed<'r>(
    store: &Store,
    all: impl Iterator<Item = (&'r PointRun, usize)>,
    host: PageHost,
) -> Result<Vec<String>, ReportError> {
    let mut filmed: Vec<(usize, &PointRun)> = Vec::new();
    let mut number_of: HashMap<usize, usize> = HashMap::new();
    for (run, point) in all {
        if store.frame_count(&run.key)? > 1 {
            let number = number_of.entry(point).or_insert(0);
            filmed.push((*number, run));
            *number += 1;
        }
    }
    if host == PageHost::File {
        filmed.sort_by_key(|(number, _)| *number);
        filmed.truncate(MAX_MOVIES);
    }
    Ok(filmed.into_iter().map(|(_, run)| run.key.clone()).collect())
}

/// Histogram of the logarithm of the viscosity in the samples after a strain, from the first
/// occupied bin.
fn histogram(trace: &[(f64, f64)], discard: f64) -> Option<Value> {
    let mut counts: BTreeMap<i32, u64> = BTreeMap::new();
    for (_, viscosity) in trace.iter().filter(|(strain, viscosity)| {
        *strain > discard && *viscosity > 0.0 && viscosity.is_finite()
    }) {
        #[expect(clippy::cast_possible_truncation, reason = "a few hundred bins")]
        let bin = (viscosity.log10() / BIN).floor() as i32;
        *counts.entry(bin).or_insert(0) += 1;
    }
    let (first, last) = (*counts.keys().next()?, *counts.keys().next_back()?);
    let all: Vec<u64> = (first..=last)
        .map(|bin| counts.get(&bin).copied().unwrap_or(0))
        .collect();
    Some(json!({"first": first, "counts": all}))
}

/// The movie of a run with a maximum number of frames.
///
/// # Errors
/// Those of [`Store::frames`].
pub fn movie(store: &Store, key: &str, frames: usize) -> Result<Value, ReportError> {
    let stored = usize::try_from(store.frame_count(key)?).unwrap_or(usize::MAX);
    let kept = store.frames(key, stored.div_ceil(frames.max(1)))?;
    let (side, radii) = of_either!(&kept[0].frame, first => (first.side, first.radii.as_slice()));
    let alike = radii
        .windows(2)
        .all(|pair| pair[0].to_bits() == pair[1].to_bits());
    // A typical strong force, so that a single spike does not hide all others.
    let mut forces: Vec<f64> = kept
        .iter()
        .flat_map(|kept| -> Vec<f64> {
            of_either!(&kept.frame, frame => frame.contacts.iter().map(|c| c.normal_force).collect())
        })
        .collect();
    forces.sort_by(f64::total_cmp);
    let strong = forces.get(forces.len() * 95 / 100).copied().unwrap_or(1.0);
    Ok(json!({
        "side": rounded(side),
        "radii": radii[..if alike { radii.len().min(1) } else { radii.len() }],
        "force": rounded(strong.max(1e-3)),
        "frames": kept
            .iter()
            .map(|kept| of_either!(&kept.frame, frame => picture(frame)))
            .collect::<Vec<_>>(),
    }))
}

/// One frame of a movie: a suspension is viewed along the vorticity, with the depth of each sphere.
fn picture<S: Kept>(frame: &Frame<S>) -> Value {
    let places: Vec<f64> = frame
        .centres
        .iter()
        .zip(&frame.orientations)
        .flat_map(|(x, orientation)| [x[0], x[1], S::angle(orientation)].map(rounded))
        .collect();
    let contacts: Vec<Value> = frame
        .contacts
        .iter()
        .map(|c| {
            json!([
                c.i,
                c.j,
                state_number(c.state),
                rounded(c.normal[0]),
                rounded(c.normal[1]),
                rounded(c.normal_force)
            ])
        })
        .collect();
    let mut picture = json!({"strain": rounded(frame.strain), "offset": rounded(frame.offset), "x": places, "contacts": contacts});
    if S::DIMENSIONS > 2 {
        let heights = frame
            .centres
            .iter()
            .map(|x| rounded(x[2].rem_euclid(frame.side)));
        picture["z"] = heights.collect();
    }
    picture
}

/// Rounded to three decimals, below the visible resolution.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// Thins a trace to at most `most` points: the minimum and maximum of each section, so that no
/// spike is lost.
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
    use super::{histogram, in_script, thinned};

    #[test]
    fn markup_cannot_end_the_script() {
        let text = in_script(r#"{"name":"</script><img onerror=1>&amp;"}"#);
        assert!(!text.contains(['<', '>', '&']));
        let back: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["name"], "</script><img onerror=1>&amp;");
    }

    #[test]
    fn histograms_count_what_is_kept() {
        let trace = [
            (0.1, 9.0),
            (0.3, 10.5),
            (0.4, 10.6),
            (0.5, 100.0),
            (0.6, -1.0),
        ];
        let histogram = histogram(&trace, 0.2).unwrap();
        assert_eq!(histogram["first"], 25);
        let counts = histogram["counts"].as_array().unwrap();
        assert_eq!((&counts[0], counts.len()), (&2.into(), 26));
        assert_eq!(counts[25], 1);
        assert_eq!(super::histogram(&trace[4..], 0.0), None);
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
