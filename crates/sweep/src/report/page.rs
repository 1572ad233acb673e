//! The report as one self-contained page: summary, figures, points, runs in time, movies,
//! failures, provenance.
//!
//! Its figures are those of `sweep report --figure`: a file holds them, and a server draws those
//! that are asked for. The page loads nothing from the network. All user text is JSON in a script
//! element, with every `<`, `>` and `&` escaped, and is inserted as text only; figures are images.

use super::columns::Column;
use super::error::ReportError;
use super::failures::FailureGroup;
use super::figure::palette::HEAT;
use super::figure::{Drawing, Kind, Trace, default_axis, draw_on_page};
use super::points::Report;
use super::selection::{Excerpt, Selection};
use super::sheet::{Shape, SheetColumn, view_of};
use super::table::point_table;
use crate::data::write_csv;
use crate::measure::numbers::{Level, Number, columns};
use crate::measure::{PointRun, ratio};
use crate::model::axes::{AXES, Axis};
use crate::model::spaces::of_either;
use crate::store::Store;
use crate::text::format::{duration, significant};
use crate::trajectory::{Kept, state_number};
use sd_core::model::Keywords as _;
use sd_core::simulation::Frame;
use serde_json::{Map, Value, json};
use std::collections::HashMap;

/// The HTML of the page.
const PAGE: &str = include_str!("page/page.html");
/// Its style.
const STYLE: &str = include_str!("page/page.css");
/// Its scripts, one per subject, within one function to keep their names local.
const SCRIPT: &str = concat!(
    "'use strict';\n(() => {\n",
    include_str!("page/base.js"),
    include_str!("page/runs.js"),
    include_str!("page/start.js"),
    "})();\n"
);

/// Size of the figures of a file beyond which it holds no more, so that it still opens.
const FIGURE_BYTES: usize = 16 << 20;
/// Maximum total points of traces.
const TRACE_POINTS: usize = 400_000;
/// Maximum total frames of movies.
const MAX_MOVIE_FRAMES: usize = 3000;
/// Maximum number of movies.
const MAX_MOVIES: usize = 100;
/// Maximum number of runs of a point that are drawn in time.
const RUNS_IN_TIME: usize = 32;
/// Host of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageHost {
    /// A file, which holds everything.
    File,
    /// A server, which the page polls for updates and asks for figures and movies.
    Server,
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
        .replace("@CSS@", STYLE)
        .replace("@JS@", SCRIPT);
    // Last, in a single pass: user text is never searched for placeholders.
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
    let (report, runs, places) = Report::with_runs(store, selection)?;
    let report = Report { units, ..report };
    // The remaining time is that of the whole campaign.
    let (work_done, left) = if selection.is_everything() {
        let work = store.work()?;
        (ratio(work.done, work.total), store.time_left(&work)?)
    } else {
        let c = &report.counts;
        let ended = c.done + c.jammed + c.failed;
        (ratio(ended as f64, c.total() as f64), None)
    };
    let mut csv = Vec::new();
    write_csv(&point_table(&report), &mut csv)?;
    let mut of_point: Vec<Vec<&PointRun>> = vec![Vec::new(); report.points.len()];
    for (run, place) in runs.iter().zip(&places) {
        of_point[*place].push(run);
    }
    let labels = report.labels(report.params());
    let most = (TRACE_POINTS / runs.len().max(1)).clamp(12, 240);
    let mut points = Vec::with_capacity(labels.len());
    for (label, runs) in labels.into_iter().zip(&of_point) {
        let trace = match host {
            PageHost::File => in_time(store, &report, runs, most)?.map_or(Value::Null, Value::from),
            PageHost::Server => Value::Bool(true),
        };
        let name = Some(label.words).filter(|words| !words.is_empty());
        points.push(json!({"name": name.unwrap_or("all runs".into()), "trace": trace}));
    }
    let provenance = report.provenance.iter();
    let provenance = provenance.map(|process| json!([process.words(), process.started_at]));
    let of_axis = |axis: &Axis| (axis.key.to_owned(), Value::from(units.label_of(axis)));
    let rows = runs.iter().zip(&places).map(|(run, point)| {
        let number = |name: &str, factor: f64| {
            let number = run.number(name).map(|number| factor * number);
            number.map_or("–".into(), |number| significant(number, 4))
        };
        let mut state = vec![run.state.word(&run.params).to_owned()];
        if run.is_arrested() {
            state.push(format!("at {}", number("final_fraction", 1.0)));
        }
        state.extend(run.doubts.iter().map(|doubt| doubt.name().to_owned()));
        json!({
            "point": point, "key": run.key, "seed": run.seed,
            "state": state.join(", "),
            "viscosity": number("viscosity", units.viscosity_factor()), "time": number("wall_time_s", 1.0),
        })
    });
    let data = json!({
        // Whether a server provides updates.
        "live": host == PageHost::Server,
        "campaign": report.campaign, "summary": summary(&report, left), "work_done": work_done.unwrap_or(1.0),
        "figures": figures(&report, host), "axes": AXES.iter().map(of_axis).collect::<Map<_, _>>(),
        "columns": shown(&report), "points": points, "csv": String::from_utf8_lossy(&csv),
        "viscosity_label": units.label("viscosity", "mu"), "runs": rows.collect::<Vec<_>>(),
        "movies": movies(store, runs.iter().zip(places.iter().copied()), host)?,
        "failures": report.failures.iter().map(FailureGroup::text).collect::<Vec<_>>(),
        "provenance": provenance.collect::<Vec<_>>(), "text": store.campaign_text()?, "heat": HEAT,
    });
    Ok(data.to_string())
}

/// Number of runs by state, remaining time, and what is averaged.
fn summary(report: &Report, left: Option<f64>) -> String {
    let c = &report.counts;
    let mut words = vec![format!(
        "{} of {} runs done, {}, {} failed, {} running, {} pending",
        c.done,
        c.total(),
        c.words_of_jammed(),
        c.failed,
        c.running,
        c.pending
    )];
    words.extend(left.map(|left| format!("about {} left", duration(left))));
    words.push(format!("discarded strain: {}", report.discard));
    if !report.selection.is_everything() {
        words.push(format!("only where {}", report.selection));
    }
    if report.doubtful > 0 {
        let how = if report.with_doubtful { "in" } else { "not in" };
        words.push(format!("{} doubtful, {how} the means", report.doubtful));
    }
    words.join("; ")
}

/// All columns with something in them, as text; the usual ones are those of the table on a
/// terminal.
fn shown(report: &Report) -> Vec<Value> {
    let shape = Shape {
        wide: true,
        ..Shape::default()
    };
    let usual = report.sheet(shape, None);
    let axes = AXES.iter().map(|axis| {
        let column = SheetColumn::of_axis(axis, report, &report.points.iter());
        (column, axis.key, axis.meaning)
    });
    let numbers = columns(Level::Points).map(|number| {
        let (column, view) = (Column::Number(number), view_of(number.name));
        let shown = report.view(column, view, shape.format);
        (shown, number.name, column.meaning())
    });
    let trends = Report::trends(report.points.iter());
    let trends = trends.map(|column| (column, "trend", "how runs change that are not steady"));
    let all = axes.chain(trends).chain(numbers);
    let all = all.filter(|of| !of.0.is_empty());
    all.map(|(column, name, meaning)| {
        json!({
            "name": name, "heading": column.heading.replace('\n', " "), "meaning": meaning,
            "usual": usual.has(&column.name), "cells": column.cells,
        })
    })
    .collect()
}

/// The figures that the page offers: name, label, and axes, each with the figure along it in a
/// file, and `true` from a server. Numbers other than the viscosity run along the default axis in a
/// file.
fn figures(report: &Report, host: PageHost) -> Vec<Value> {
    let numbers = columns(Level::Points).filter(|number| {
        let mut points = report.points.iter();
        !number.label.is_empty() && points.any(|point| point.number(number.name).is_some())
    });
    let numbers = numbers.map(|number| (number.name, number.label));
    let (main, other): (Vec<_>, Vec<_>) = numbers.partition(|(name, _)| *name == "viscosity");
    let kinds = [
        (Kind::FrictionLaw, "friction law μ(J)"),
        (Kind::Contacts, "contacts"),
        (Kind::FlowCurve, "flow curve"),
        (Kind::StateDiagram, "state diagram"),
    ];
    let kinds = kinds.map(|(kind, label)| (kind.word(), label));
    let mut left = FIGURE_BYTES;
    let mut figures = Vec::new();
    for (name, label) in main.into_iter().chain(kinds).chain(other) {
        let Some(drawing) = drawing(name) else {
            continue;
        };
        let usual = default_axis(report, drawing.kind);
        let is_one = matches!(
            drawing.kind,
            Kind::FrictionLaw | Kind::FlowCurve | Kind::StateDiagram
        ) || host == PageHost::File && name != "viscosity";
        let others = report
            .varying()
            .filter(|axis| !is_one && axis.is_numeric() && axis.key != usual.key);
        let mut along = Vec::new();
        for axis in [usual].into_iter().chain(others) {
            let figure = match host {
                PageHost::Server => Ok(Value::Bool(true)),
                PageHost::File => draw_of(report, &drawing, axis).map(Value::from),
            };
            if let Ok(figure) = figure {
                left = left.saturating_sub(figure.as_str().map_or(0, str::len));
                along.push(json!([axis.key, figure]));
            }
        }
        if along.is_empty() && name == "viscosity" {
            // Others have the same curves.
            break;
        }
        if !along.is_empty() && left > 0 {
            figures.push(json!({"name": name, "label": label, "along": along}));
        }
    }
    figures
}

/// A figure by its name: that of a number of points, or a kind.
fn drawing(name: &str) -> Option<Drawing> {
    let kind = Kind::of_word(name);
    let number = Number::named(name);
    (kind.is_some() || number.is_some()).then(|| Drawing {
        kind: kind.unwrap_or_default(),
        number,
        ..Drawing::default()
    })
}

/// Draws a figure of a report along an axis, with panels if there are more curves than can be
/// distinguished.
fn draw_of(report: &Report, drawing: &Drawing, axis: &'static Axis) -> Result<String, ReportError> {
    // The default axis may have a single value.
    let usual = default_axis(report, drawing.kind);
    let along = Some(axis).filter(|axis| axis.key != usual.key);
    let draw = |panels| {
        let drawing = Drawing {
            along,
            panels,
            ..drawing.clone()
        };
        draw_on_page(report, &[], &drawing)
    };
    draw(None).or_else(|error| {
        let panels = report.varying().find_map(|panels| draw(Some(panels)).ok());
        panels.ok_or(error)
    })
}

/// The figure that the page asks for by its name and axis, of the points selected.
///
/// # Errors
/// An I/O or SQLite error; [`ReportError::Argument`] on a figure that cannot be drawn.
pub fn page_figure(
    excerpt: Excerpt<'_>,
    name: &str,
    along: &str,
    wanted: &str,
) -> Result<String, ReportError> {
    let wanted: Vec<String> = wanted.split_whitespace().map(str::to_owned).collect();
    let report = Report {
        units: excerpt.units,
        ..Report::of(excerpt.store, &Selection::parse(&wanted)?)?
    };
    let unknown = || ReportError::argument("figure", format!("there is none of {name:?}"));
    let drawing = drawing(name).ok_or_else(unknown)?;
    let axis = Axis::of_key(along).filter(|axis| axis.is_numeric());
    let axis = axis.unwrap_or_else(|| default_axis(&report, drawing.kind));
    draw_of(&report, &drawing, axis)
}

/// The runs of the point with this index in time; `None` without samples.
///
/// # Errors
/// An I/O or SQLite error.
pub fn page_runs(excerpt: Excerpt<'_>, point: usize) -> Result<Option<String>, ReportError> {
    let (report, runs, places) = Report::with_runs(excerpt.store, excerpt.selection)?;
    let report = Report {
        units: excerpt.units,
        ..report
    };
    let runs = runs.iter().zip(places).filter(|(_, place)| *place == point);
    let runs: Vec<&PointRun> = runs.map(|(run, _)| run).collect();
    in_time(excerpt.store, &report, &runs, TRACE_POINTS / RUNS_IN_TIME)
}

/// Draws runs of a point in time, each with at most as many samples.
fn in_time(
    store: &Store,
    report: &Report,
    runs: &[&PointRun],
    most: usize,
) -> Result<Option<String>, ReportError> {
    let mut traces = Vec::new();
    for run in runs.iter().take(RUNS_IN_TIME) {
        let trace = thinned(&store.trace(&run.key)?, most);
        if !trace.is_empty() {
            traces.push(Trace::of_run(
                run,
                run.discard().unwrap_or(report.discard),
                trace,
            ));
        }
    }
    let drawing = Drawing {
        kind: Kind::Trace,
        ..Drawing::default()
    };
    Ok(draw_on_page(report, &traces, &drawing).ok())
}

/// The movies by the keys of their runs; from a server `true` for all runs that keep frames, and in
/// a file the first of every point before the second of any, up to a size that still opens.
fn movies<'r>(
    store: &Store,
    all: impl Iterator<Item = (&'r PointRun, usize)>,
    host: PageHost,
) -> Result<Map<String, Value>, ReportError> {
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
    let each = (MAX_MOVIE_FRAMES / filmed.len().max(1)).clamp(20, 120);
    let film = |(_, run): (usize, &PointRun)| {
        let film = match host {
            PageHost::File => movie(store, &run.key, each)?,
            PageHost::Server => Value::Bool(true),
        };
        Ok((run.key.clone(), film))
    };
    filmed.into_iter().map(film).collect()
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
    if !frame.is_sheared() {
        let vectors = frame.lattice();
        let rows = vectors
            .iter()
            .map(|a| a.as_ref().iter().copied().map(rounded).collect());
        picture["lattice"] = rows.collect::<Vec<Value>>().into();
    }
    if S::DIMENSIONS > 2 {
        let heights = frame.centres.iter().map(|x| {
            rounded(if frame.is_sheared() {
                x[2].rem_euclid(frame.side)
            } else {
                x[2]
            })
        });
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
