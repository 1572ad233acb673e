//! A campaign: its runs, their protocol, and the points with a requested precision.

use super::case::{Case, CaseKey};
use super::protocol::Protocol;
use crate::model::axes::{Identity, identity};
use crate::model::precision::Precision;
use sd_core::Params;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Most cases a campaign may have.
pub const CASE_LIMIT: u64 = 1_000_000;

/// A campaign that can be run.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Its name, `[a-z0-9-]`.
    pub name: String,
    /// The file it came from.
    pub file: PathBuf,
    /// Text of that file.
    pub text: String,
    /// Protocol of every run.
    pub protocol: Protocol,
    /// Its cases in the order of the file, seeds innermost; with a requested precision, all that it
    /// may need.
    pub cases: Vec<(CaseKey, Case)>,
    /// Points with a requested precision.
    pub rules: Vec<PointRule>,
    /// Further runs of the file that are identical to one of its cases: friction has no effect at
    /// Γ = 0, nor have its laws and the shear rate without friction.
    pub folded: usize,
    /// What the file says and its cases do not show.
    pub written: AsWritten,
    /// Names of files of start layers, and of stores of start runs, with their places in the text.
    pub(crate) start_files: Vec<(String, Range<usize>)>,
}

/// What a campaign file says and its cases do not show: reports show the points and names of the
/// file. Stores keep it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AsWritten {
    /// The points that share their runs with others, as written but without their start layers, in
    /// the order of the file; each with the position of the case that follows it.
    pub shared: Vec<(u64, Params)>,
    /// Names of start layers, by their numbers on the axis.
    pub starts: Vec<(u64, String)>,
}

/// The points of a campaign file that share their runs, by these runs.
#[derive(Debug)]
pub(crate) struct SharedPoints<'w> {
    shared: &'w [(u64, Params)],
    /// Places in that list, by the points of the runs.
    places: HashMap<Identity, Vec<usize>>,
}

impl<'w> SharedPoints<'w> {
    pub(crate) fn new(written: &'w AsWritten) -> Self {
        let mut places: HashMap<Identity, Vec<usize>> = HashMap::new();
        for (place, (_, point)) in written.shared.iter().enumerate() {
            let mut settled = point.clone();
            settled.canonicalise();
            places.entry(identity(&settled)).or_default().push(place);
        }
        Self {
            shared: &written.shared,
            places,
        }
    }

    /// The points that have the run with these parameters, as they are written, each after the
    /// position of the case that follows it and its place among all shared points; `None` for a
    /// run of one point that is written as it is.
    pub(crate) fn of_run(
        &self,
        params: &Params,
    ) -> Option<impl Iterator<Item = (u64, usize, Params)>> {
        if self.places.is_empty() {
            return None;
        }
        let settled = Params {
            start: None,
            ..params.clone()
        };
        let places = self.places.get(&identity(&settled))?;
        let start = &params.start;
        Some(places.iter().map(move |place| {
            let (follows, point) = &self.shared[*place];
            let point = Params {
                start: start.clone(),
                ..point.clone()
            };
            (*follows, *place, point)
        }))
    }
}

/// A point whose seeds are computed until a precision is reached.
#[derive(Debug, Clone, PartialEq)]
pub struct PointRule {
    /// The requested precision.
    pub precision: Precision,
    /// Its cases, in the order of their seeds.
    pub cases: Range<usize>,
}

impl Campaign {
    /// Its points as the file has them, in the order of the file; one that follows itself only
    /// once.
    pub(crate) fn written_points(&self) -> Vec<Cow<'_, Params>> {
        let shared = SharedPoints::new(&self.written);
        let mut points = Vec::new();
        let mut last = None;
        for (position, (_, case)) in self.cases.iter().enumerate() {
            if last == Some(&case.params) {
                continue;
            }
            last = Some(&case.params);
            match shared.of_run(&case.params) {
                Some(written) => points.extend(
                    written.map(|(follows, place, point)| (follows, place, Cow::Owned(point))),
                ),
                None => points.push((position as u64, usize::MAX, Cow::Borrowed(&case.params))),
            }
        }
        points.sort_by_key(|(follows, place, _)| (*follows, *place));
        points.into_iter().map(|(.., point)| point).collect()
    }

    /// Keys of the cases that are always computed: all but those that a precision may add.
    pub fn certain(&self) -> impl Iterator<Item = &(CaseKey, Case)> {
        let mut later = self.rules.iter().map(|rule| {
            let first = rule.cases.start + rule.precision.at_least;
            first.min(rule.cases.end)..rule.cases.end
        });
        let mut next = later.next();
        self.cases
            .iter()
            .enumerate()
            .filter_map(move |(place, case)| {
                while next.as_ref().is_some_and(|range| range.end <= place) {
                    next = later.next();
                }
                let is_later = next.as_ref().is_some_and(|range| range.contains(&place));
                (!is_later).then_some(case)
            })
    }

    /// A warning about starts in equilibrium that are denser than a fluid, if there are any.
    pub fn warning(&self) -> Option<String> {
        let dense = self.cases.iter().filter_map(|(_, case)| {
            let params = &case.params;
            let fraction = params.volume_fraction.unwrap_or(params.area_fraction);
            Some((fraction, sd_core::start::freezing_exceeded(params)?))
        });
        let (fraction, freezing) = dense.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(format!(
            "`start` = \"equilibrium\" at a fraction of {fraction}: equal spheres in equilibrium are a fluid up to {freezing:.3} and a \
             crystal above; denser starts are a fluid that has not frozen yet"
        ))
    }

    /// The text of its file for a copy in another folder: relative paths become absolute; nothing
    /// else changes.
    pub fn text_elsewhere(&self) -> String {
        let folder = self.file.parent().unwrap_or(Path::new(""));
        let mut text = self.text.clone();
        // From the end, so that earlier positions stay valid.
        for (name, span) in self.start_files.iter().rev() {
            if let Some(full) = folder.join(name).to_str() {
                text.replace_range(span.clone(), &basic_string(full));
            }
        }
        text
    }

    /// Default path of its store: `results/NAME.sqlite` in its project, which is the folder that
    /// holds `sweeps/`, or where there is no such folder, the one of the file.
    pub fn default_store(&self) -> PathBuf {
        let folder = self.file.parent().unwrap_or(Path::new(""));
        let project = folder
            .ancestors()
            .find(|folder| folder.file_name().is_some_and(|name| name == "sweeps"))
            .and_then(Path::parent)
            .unwrap_or(folder);
        project
            .join("results")
            .join(format!("{}.sqlite", self.name))
    }
}

/// A text as a basic string of TOML.
fn basic_string(text: &str) -> String {
    let mut written = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => written.extend(['\\', character]),
            c if c.is_control() => written.extend(format!("\\u{:04X}", u32::from(c)).chars()),
            c => written.push(c),
        }
    }
    written + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_paths_come_back_from_what_is_written() {
        for odd in ["a\tb\\c\"d", "ä/ß", "\u{7f}"] {
            let text = format!("x = {}", basic_string(odd));
            let table: toml::Table = text.parse().unwrap();
            assert_eq!(table["x"].as_str(), Some(odd));
        }
    }
}
