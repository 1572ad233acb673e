//! A campaign: which runs there are, how each is made, and at which points a precision is requested.

use super::case::{Case, CaseKey};
use super::protocol::Protocol;
use crate::statistics::Precision;
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
    /// What that file says, to the letter.
    pub text: String,
    /// How every run is made.
    pub protocol: Protocol,
    /// Its cases in the order of the file, seeds innermost. Where a precision is asked for, all that it may take.
    pub cases: Vec<(CaseKey, Case)>,
    /// Points at which a precision is asked for.
    pub rules: Vec<PointRule>,
    /// Runs that the file names besides its cases and that are the same as one of these: friction has no effect at Γ = 0, nor has the
    /// shear rate without friction.
    pub folded: usize,
}

/// A point whose seeds are computed until a precision is reached.
#[derive(Debug, Clone, PartialEq)]
pub struct PointRule {
    /// What is asked for.
    pub precision: Precision,
    /// Its cases, in the order of their seeds.
    pub cases: Range<usize>,
}

impl Campaign {
    /// Keys of the cases that are computed whatever comes out: all but those that a precision may add.
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

    /// Where its store is unless the user says otherwise: `results/NAME.sqlite` in its project, which is the folder that holds
    /// `sweeps/`, or where there is no such folder, the one of the file.
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
