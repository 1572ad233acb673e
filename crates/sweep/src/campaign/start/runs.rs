//! Start layers taken from the ends of the runs of a point of another store.

use crate::data::{Tag, Value};
use crate::model::axes::{AXES, Axis, identity};
use crate::model::checkpoint::Checkpoint;
use crate::model::spaces::InSpace;
use crate::store::{LastState as Run, Store};
use sd_core::Params;
use sd_core::model::{PressureKind, StartFrom, StartLayer};
use std::path::Path;

/// Whether a run belongs to the point with these values. Points that share their runs count as one:
/// see [`Params::canonicalise`].
fn has(run: &Run, wanted: &[(&'static Axis, Value)]) -> bool {
    let mut meant = run.params.clone();
    for (axis, value) in wanted {
        match (axis.key, value) {
            ("friction", Value::Number(friction)) => meant.friction = *friction,
            ("shear_rate", Value::Number(rate)) if meant.shear_stress.is_none() => {
                meant.shear_rate = *rate;
            }
            _ if axis.is_of_friction() && !run.params.has_friction() => {}
            ("friction_onset", _) if run.params.shear_rate.is_infinite() => {}
            _ if axis.value(&run.params).tag() != value.tag() => return false,
            _ => {}
        }
    }
    meant.canonicalise();
    identity(&meant) == identity(&run.params)
}

/// The layers that the finished runs of a point of a store ended with, by their seeds. `folder`:
/// that of the campaign file. `wanted`: values that select the point.
///
/// # Errors
/// The fault and the available values: a file that is no store, no such point, several of them, an
/// unreadable state.
pub(super) fn layers(
    store: &Path,
    folder: &Path,
    wanted: &[(&'static Axis, Value)],
) -> Result<Vec<(u64, StartLayer)>, [String; 2]> {
    let allowed = || {
        "`start = { store = \"FILE\", point = { KEY = VALUE, .. } }` with a store of finished runs, from the folder of this file"
            .to_owned()
    };
    let unreadable = |error: &dyn std::fmt::Display| {
        let message = format!("the store {} cannot be read: {error}", store.display());
        [message, allowed()]
    };
    if !store.is_file() {
        // Stores are beside the folder of the campaign files.
        let beside = Path::new("..").join(store.strip_prefix(folder).unwrap_or(store));
        let hint = if folder.join(&beside).is_file() {
            format!("; did you mean \"{}\"?", beside.display())
        } else {
            String::new()
        };
        return Err(unreadable(&format!("there is no such file{hint}")));
    }
    let all = Store::open_read_only(store)
        .and_then(|store| store.last_states())
        .map_err(|error| unreadable(&error))?;
    if all.is_empty() {
        let message = format!("no run is finished in {}", store.display());
        return Err([message, allowed()]);
    }
    let (runs, others): (Vec<Run>, Vec<Run>) = all.into_iter().partition(|run| has(run, wanted));
    let Some(first) = runs.first() else {
        let message = format!("no run of that point is finished in {}", store.display());
        return Err([message, there_are(&others, wanted)]);
    };
    let point: Vec<Tag> = identity(&first.params);
    if let Some(other) = runs.iter().find(|run| identity(&run.params) != point) {
        let differing = AXES
            .iter()
            .zip(point)
            .zip(identity(&other.params))
            .filter(|((_, one), two)| one != two)
            .map(|((axis, _), _)| format!("`{}`", axis.key));
        let differing: Vec<String> = differing.collect();
        return Err([
            format!("{} has several such points", store.display()),
            format!(
                "select one in `point`: they differ in {}",
                differing.join(", ")
            ),
        ]);
    }
    let params = &first.params;
    let reason = if !params.is_sheared() {
        Some(("are no shear", "`flow` = \"shear\""))
    } else if params.imposes_pressure() && params.pressure == PressureKind::Gradient {
        Some((
            "dilate along the gradient alone",
            "`pressure` = \"isotropic\"",
        ))
    } else {
        None
    };
    if let Some((reason, other)) = reason {
        return Err([
            format!(
                "the runs of that point of {} {reason}, and their cells are not square",
                store.display()
            ),
            format!("a point with {other}, or no `start`"),
        ]);
    }
    runs.iter()
        .map(|run| match Checkpoint::decode(&run.state) {
            Ok(end) => {
                let origin = Some(origin(&run.params, end.snapshot.steps()));
                match end.snapshot {
                    InSpace::Layer(end) => {
                        let layer = end.layer(&run.params).map_err(|error| {
                            let run = format!("the run with seed {} in {}", run.seed, store.display());
                            [format!("{run}: {error}"), "another point, or no `start`".to_owned()]
                        })?;
                        Ok((run.seed, StartLayer { origin, ..layer }))
                    }
                    InSpace::Suspension(_) => Err([
                        format!("the runs of that point of {} are suspensions, and runs begin with layers only", store.display()),
                        "a point with an `area_fraction`, or no `start`".to_owned(),
                    ]),
                }
            }
            Err(damage) => Err([
                format!(
                    "the last state of the run with seed {} in {} cannot be used: {damage}",
                    run.seed,
                    store.display()
                ),
                "runs of this version of the program".to_owned(),
            ]),
        })
        .collect()
}

/// The values of the runs on the axes that select a point, in the order of the runs.
fn there_are(runs: &[Run], wanted: &[(&'static Axis, Value)]) -> String {
    let values = wanted.iter().map(|(axis, _)| {
        let params = runs.iter().map(|run| &run.params);
        let all = axis.distinct(params.filter(|params| axis.means_something(params)));
        let all: Vec<String> = all.iter().map(Value::to_string).collect();
        if all.is_empty() {
            format!("no `{}`", axis.key)
        } else {
            format!("`{}` = {}", axis.key, all.join(", "))
        }
    });
    let values: Vec<String> = values.collect();
    format!("finished runs there have {}", values.join("; "))
}

/// A hash for the ends of all runs of a point, independent of their seeds.
fn origin(params: &Params, steps: u64) -> u32 {
    let before = params.start.as_ref().map_or(0, StartFrom::number);
    let point = Params {
        start: None,
        ..params.clone()
    };
    let mut hasher = blake3::Hasher::new();
    let written = serde_json::to_writer(&mut hasher, &(point, before, steps));
    debug_assert!(written.is_ok(), "numbers and names always have JSON");
    let mut number = [0; 4];
    number.copy_from_slice(&hasher.finalize().as_bytes()[..4]);
    u32::from_le_bytes(number).max(2)
}
