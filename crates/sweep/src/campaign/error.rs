//! Errors that show the place in the campaign file.

use super::imposed_keys::with_written_keys;
use crate::text::visible::{visible, visible_in_place};
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::fmt::Display;
use std::io;
use std::ops::Range;
use std::path::PathBuf;

/// Longest line that is shown in an excerpt; a longer one would fill the screen.
const LONGEST_LINE: usize = 240;
/// Most lines between two places shown in one excerpt.
const FARTHEST: usize = 15;

/// Most faults of one file that are shown.
pub(super) const MAX_SHOWN: usize = 20;
/// Longest message about a fault, in characters: values in it may have any length.
const LONGEST_SENTENCE: usize = 1000;

/// Why a campaign could not be read.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum CampaignError {
    /// A file that could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// An invalid file.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Faulty(#[from] Box<Fault>),
}

/// A fault of a campaign file: what, where, and what is allowed. The first fault carries the others
/// of the file.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {message}")]
pub struct Fault {
    /// File, line and column.
    place: String,
    message: String,
    allowed: String,
    about: About,
    /// Places in the text, the main one first.
    labels: Vec<LabeledSpan>,
    /// The text, if its lines are short enough to show.
    source_code: Option<NamedSource<String>>,
    others: Vec<Fault>,
}

impl Diagnostic for Fault {
    fn help<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        Some(Box::new(&self.allowed))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source_code.as_ref().map(|source| source as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(self.labels.iter().cloned()))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        if self.others.is_empty() {
            return None;
        }
        Some(Box::new(self.others.iter().map(|other| other as _)))
    }
}

/// The key and the value of a fault, for programs.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct About {
    pub(super) key: Option<String>,
    pub(super) value: Option<String>,
    pub(super) suggestion: Option<String>,
}

impl Fault {
    /// The fault and what is allowed, without a place: for a campaign that was not read from a
    /// file.
    pub fn words(&self) -> String {
        let mut words = format!("{}: {}", self.message, self.allowed);
        for other in &self.others {
            words = format!("{words}\n{}", other.words());
        }
        words
    }

    /// What is allowed.
    pub fn allowed(&self) -> &str {
        &self.allowed
    }

    /// The key concerned, if any.
    pub fn key(&self) -> Option<&str> {
        self.about.key.as_deref()
    }

    /// The invalid value, as written.
    pub fn value(&self) -> Option<&str> {
        self.about.value.as_deref()
    }

    /// The suggested key or word.
    pub fn suggestion(&self) -> Option<&str> {
        self.about.suggestion.as_deref()
    }
}

/// The faults of a file as one error, in the order of their places; `None` without faults.
pub(super) fn in_file(mut problems: Vec<Problem>, file: &str, text: &str) -> Option<Box<Fault>> {
    problems.sort_by_key(|problem| problem.labels.first().map_or(0, |(span, _)| span.start));
    let more = problems.len().saturating_sub(MAX_SHOWN);
    problems.truncate(MAX_SHOWN);
    let mut faults = problems
        .into_iter()
        .map(|problem| problem.in_file(file, text));
    let mut first = faults.next()?;
    first.others = faults.collect();
    if more > 0 {
        first.allowed = format!("{}\n({more} more faults than those below)", first.allowed);
    }
    Some(Box::new(first))
}

/// A [`Fault`] without its file.
#[derive(Debug, PartialEq)]
pub(super) struct Problem {
    pub(super) message: String,
    pub(super) allowed: String,
    pub(super) about: Box<About>,
    /// Places in the text, each with its label.
    pub(super) labels: Vec<(Range<usize>, String)>,
}

impl Problem {
    /// A problem with one place.
    pub(super) fn at(
        span: &Range<usize>,
        message: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self {
            message: message.into(),
            allowed: allowed.into(),
            about: Box::default(),
            labels: vec![(span.clone(), "here".into())],
        }
    }

    /// Names the key that the problem is about.
    pub(super) fn of_key(mut self, key: &str) -> Self {
        self.about.key = Some(key.to_owned());
        self
    }

    /// Names the key and the value that the problem is about.
    pub(super) fn of_value(mut self, key: &str, value: &str) -> Self {
        self.about.value = Some(value.to_owned());
        self.of_key(key)
    }

    /// Adds the key or word that is suggested, if there is one.
    pub(super) fn suggesting(mut self, meant: Option<&str>) -> Self {
        if let Some(meant) = meant {
            self.allowed = format!("did you mean {meant}? {}", self.allowed);
            self.about.suggestion = Some(meant.trim_matches(['`', '"']).to_owned());
        }
        self
    }

    /// Adds one more place.
    pub(super) fn also(mut self, span: &Range<usize>, label: impl Into<String>) -> Self {
        self.labels.push((span.clone(), label.into()));
        self
    }

    /// Puts another label at the first place.
    pub(super) fn labelled(mut self, label: impl Into<String>) -> Self {
        if let Some(first) = self.labels.first_mut() {
            first.1 = label.into();
        }
        self
    }

    /// Puts it into its file.
    fn in_file(mut self, file: &str, text: &str) -> Fault {
        let line_of = |span: &Range<usize>| {
            text.get(..span.start)
                .map_or(0, |before| before.matches('\n').count())
        };
        let first = self.labels.first().map_or(0, |(span, _)| line_of(span));
        let mut allowed = with_written_keys(self.allowed);
        // An excerpt shows all lines between two places, so distant ones are named instead.
        self.labels.retain(|(span, label)| {
            let line = line_of(span);
            let near = line.abs_diff(first) <= FARTHEST;
            if !near {
                allowed = format!("{allowed}\n(line {}: {label})", line + 1);
            }
            near
        });
        let mut labels: Vec<_> = self
            .labels
            .into_iter()
            .map(|(span, label)| {
                let span = first_line(text, &span);
                LabeledSpan::new(Some(with_written_keys(label)), span.start, span.len())
            })
            .collect();
        let start = labels.first().map_or(0, LabeledSpan::offset);
        let before = text.get(..start).unwrap_or_default();
        let line = before.matches('\n').count();
        let column = before.chars().rev().take_while(|c| *c != '\n').count();
        let shown = labels
            .iter()
            .all(|label| neighbourhood_is_short(text, label.offset()));
        if !shown {
            // Without its own text it would appear in the excerpt of the first fault.
            labels.clear();
        }
        Fault {
            place: format!("{file}:{}:{}", line + 1, column + 1),
            message: shortened(with_written_keys(self.message)),
            allowed: shortened(allowed),
            about: *self.about,
            labels,
            source_code: shown
                .then(|| NamedSource::new(visible(file), visible_in_place(text).into_owned())),
            others: Vec::new(),
        }
    }
}

/// A message, cut at the maximum length.
fn shortened(mut sentence: String) -> String {
    if let Some((end, _)) = sentence.char_indices().nth(LONGEST_SENTENCE) {
        sentence.truncate(end);
        sentence.push('…');
    }
    sentence
}

/// The part of a span on its first line.
fn first_line(text: &str, span: &Range<usize>) -> Range<usize> {
    let start = span.start.min(text.len());
    let end = span.end.clamp(start, text.len());
    let line = text.get(start..end).unwrap_or_default();
    start..start + line.find('\n').unwrap_or(line.len())
}

/// Whether the line at this place and its neighbours are short enough to be shown.
fn neighbourhood_is_short(text: &str, offset: usize) -> bool {
    let (before, after) = text.split_at_checked(offset).unwrap_or((text, ""));
    before
        .rsplit('\n')
        .take(2)
        .chain(after.split('\n').take(2))
        .all(|line| line.len() <= LONGEST_LINE)
}
