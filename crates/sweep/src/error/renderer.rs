//! Errors prepared for display.

use super::Error;
use crate::text::visible::visible;
use miette::{Diagnostic, LabeledSpan, SourceCode};
use std::fmt;

/// Renders errors.
#[derive(Debug, Clone, Copy)]
pub struct ErrorRenderer {
    /// Maximum width in columns.
    width: usize,
}

impl Default for ErrorRenderer {
    /// A renderer for terminals.
    fn default() -> Self {
        Self { width: 100 }
    }
}

impl ErrorRenderer {
    /// A renderer that does not wrap lines.
    pub fn plain() -> Self {
        Self { width: 10_000 }
    }

    /// An error as text for standard error: what is wrong, where, and what is allowed. It holds no
    /// control sequences.
    pub fn explain(self, error: &Error) -> String {
        let theme = miette::GraphicalTheme::unicode_nocolor();
        let handler = miette::GraphicalReportHandler::new_themed(theme)
            .with_width(self.width)
            .without_cause_chain();
        let mut text = String::new();
        let others = error.related().into_iter().flatten();
        for one in std::iter::once(error as &dyn Diagnostic).chain(others) {
            if !text.is_empty() {
                text.push('\n');
            }
            if handler.render_report(&mut text, &Alone(one)).is_err() {
                text.push_str(&one.to_string());
            }
        }
        visible(&text).into_owned()
    }
}

/// An error without the errors related to it: the handler prints an empty heading above each.
#[derive(Debug)]
struct Alone<'e>(&'e dyn Diagnostic);

impl fmt::Display for Alone<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

impl std::error::Error for Alone<'_> {}

impl Diagnostic for Alone<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.help()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.0.labels()
    }
}
