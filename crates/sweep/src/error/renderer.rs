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
        let handler = miette::GraphicalReportHandler::new_themed(theme)
            .with_width(self.width)
            .without_cause_chain();
        let mut text = String::new();
        // One after the other: the handler itself prints an empty heading above every further
        // error.
        let others = error.related().into_iter().flatten();
        for one in std::iter::once(error as &dyn Diagnostic).chain(others) {
            if !text.is_empty() {
                text.push('\n');
            }
            if handler.render_report(&mut text, &Shown(one)).is_err() {
                text.push_str(&visible(&one.to_string()));
            }
        }
        text
    }
}

/// An error whose texts are [`visible`]. Excerpts become visible where they are cut from their
/// files.
#[derive(Debug)]
struct Shown<'e>(&'e dyn Diagnostic);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&visible(&self.0.to_string()))
    }
}

impl std::error::Error for Shown<'_> {}

impl Diagnostic for Shown<'_> {
    fn severity(&self) -> Option<Severity> {
        self.0.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.0.help()?.to_string();
        Some(Box::new(visible(&help).into_owned()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let labels = self.0.labels()?;
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
}
