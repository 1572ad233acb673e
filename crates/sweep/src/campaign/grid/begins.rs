//! Start layers of the runs of a grid that do not come from their seeds.

use super::START;
use crate::campaign::error::Problem;
use crate::campaign::reader::{Located, Table, of_axis, wrong_type};
use crate::campaign::{ends_of_runs, start};
use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use sd_core::model::StartLayer;
use std::ops;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The start layers of a grid.
#[derive(Debug)]
pub(super) enum Start {
    /// One layer from a file for all runs.
    File(Box<StartLayer>),
    /// By seed, the end of the run with that seed at a point of another store.
    Runs(Vec<(u64, Box<StartLayer>)>),
}

/// The layer of a named file, or the ends of the runs of a point.
pub(super) fn start_layer(
    written: &Spanned<DeValue<'_>>,
    folder: &Path,
    problems: &mut Vec<Problem>,
) -> Option<Located<Start>> {
    let span = written.span();
    let found = match written.get_ref() {
        DeValue::String(name) => {
            start::read(&folder.join(name.as_ref())).map(|layer| Start::File(Box::new(layer)))
        }
        DeValue::Table(entries) => {
            let (store, point) = point_of(entries, &span, problems)?;
            ends_of_runs::layers(&folder.join(store), folder, &point).map(|layers| {
                let boxed = layers
                    .into_iter()
                    .map(|(seed, layer)| (seed, Box::new(layer)));
                Start::Runs(boxed.collect())
            })
        }
        _ => {
            let allowed = "`start` is the name of a file, or { store = \"FILE\", point = { KEY = VALUE, .. } }";
            problems.push(wrong_type(written, START, allowed));
            return None;
        }
    };
    match found {
        Ok(value) => Some(Located { value, span }),
        Err([message, allowed]) => {
            problems.push(Problem::at(&span, message, allowed).labelled("begins here"));
            None
        }
    }
}

/// A store, and values that select one of its points; `None` on a fault.
fn point_of<'t>(
    entries: &'t DeTable<'t>,
    span: &ops::Range<usize>,
    problems: &mut Vec<Problem>,
) -> Option<(&'t str, Vec<(&'static Axis, Value)>)> {
    let before = problems.len();
    let table = Table::new(entries, span.clone(), START, &["store", "point"], problems);
    let store = match table
        .get("store")
        .map(|written| (written, written.get_ref()))
    {
        Some((_, DeValue::String(name))) => Some(name.as_ref()),
        Some((written, _)) => {
            problems.push(wrong_type(
                written,
                "store",
                "`store` is the name of a file",
            ));
            None
        }
        None => {
            problems.extend(table.missing("store", "\"results/first.sqlite\""));
            None
        }
    };
    let mut point = Vec::new();
    match table
        .get("point")
        .map(|written| (written, written.get_ref()))
    {
        None => {}
        Some((written, DeValue::Table(values))) => {
            let known: Vec<&str> = AXES.iter().map(|axis| axis.key).collect();
            let values_of = Table::new(values, written.span(), "point", &known, problems);
            for axis in AXES.iter() {
                match values_of.get(axis.key).map(|value| of_axis(value, axis)) {
                    None => {}
                    Some(Ok(value)) => point.push((axis, value)),
                    Some(Err(problem)) => problems.push(problem),
                }
            }
        }
        Some((written, _)) => {
            let allowed = "`point` is a table of values: { shear_stress = 1.0, friction = 0.5 }";
            problems.push(wrong_type(written, "point", allowed));
        }
    }
    (problems.len() == before)
        .then(|| store.map(|store| (store, point)))
        .flatten()
}
