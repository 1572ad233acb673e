//! Errors prepared for display: their texts hold no control sequences but the colours added here.

use super::Error;
use crate::text::visible::visible;
use miette::{Diagnostic, LabeledSpan, Severity, SourceCode};
use std::fmt;

/// Renders errors, with or without colours.
#[derive(Debug, Clone, Copy)]
pub struct ErrorRenderer {
    pub(crate) coloured: bool,
    /// Maximum width in columns.
    pub(crate) width: usize,
}

impl ErrorRenderer {
    /// A renderer without colours that does not wrap lines.
    pub fn plain() -> Self {
        Self {
            coloured: false,
            width: 10_000,
        }
    }

    /// An error as text for standard error: what is wrong, where, and what is allowed.
    pub fn explain(self, error: &Error) -> String {
        let theme = if self.coloured {
            miette::GraphicalTheme::unicode()
        } else {
            miette::GraphicalTheme::unicode_nocolor()
        };
        let mut text = String::new();
        let rendered = miette::GraphicalReportHandler::new_themed(theme)
            .with_width(self.width)
            .without_cause_chain()
            .render_report(&mut text, &Shown::of(error));
        match rendered {
            Ok(()) => text,
            Err(_) => visible(&error.to_string()).into_owned(),
        }
    }
}

/// An error whose texts are [`visible`]. Excerpts become visible where they are cut from their
/// files.
#[derive(Debug)]
struct Shown<'e> {
    error: &'e dyn Diagnostic,
    related: Vec<Shown<'e>>,
}

impl<'e> Shown<'e> {
    fn of(error: &'e dyn Diagnostic) -> Self {
        Self {
            error,
            related: error
                .related()
                .map(|related| related.map(Self::of).collect())
                .unwrap_or_default(),
        }
    }
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&visible(&self.error.to_string()))
    }
}

impl std::error::Error for Shown<'_> {}

impl Diagnostic for Shown<'_> {
    fn severity(&self) -> Option<Severity> {
        self.error.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.error.help()?.to_string();
        Some(Box::new(visible(&help).into_owned()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.error.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let labels = self.error.labels()?;
        Some(Box::new(labels.map(|label| {
            let text = label.label().map(|text| visible(text).into_owned());
            let span = *label.inner();
            if label.primary() {
                LabeledSpan::new_primary_with_span(text, span)
            } else {
                LabeledSpan::new_with_span(text, span)
            }
        })))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        if self.related.is_empty() {
            return None;
        }
        Some(Box::new(self.related.iter().map(|other| other as _)))
    }
}
