//! The origin of a figure, in its metadata.

use crate::report::points::Report;

/// Number of characters of a key that identify a run.
const KEY: usize = 16;

/// The origin of a figure.
#[derive(Debug)]
pub(in crate::report) struct Origin {
    /// One line.
    pub(super) title: String,
    /// All lines: the campaign, the programs that computed it, runs by their keys.
    pub(in crate::report) text: String,
}

/// The drawing program.
pub(super) const PROGRAM: &str = concat!("sweep ", env!("CARGO_PKG_VERSION"));

impl Origin {
    /// The origin of a figure of a report.
    pub(in crate::report) fn of(report: &Report) -> Self {
        let mut lines = vec![format!("campaign {}", report.campaign)];
        if !report.selection.is_everything() {
            lines.push(format!("only where {}", report.selection));
        }
        let programs = report.programs().into_iter();
        lines.extend(programs.map(|program| format!("computed by {program}")));
        let keys = report.keys.iter().map(|key| key.get(..KEY).unwrap_or(key));
        lines.push(format!("keys {}", keys.collect::<Vec<_>>().join(" ")));
        Self::of_lines(&report.campaign, &lines)
    }

    /// An origin with a title and these lines.
    pub(in crate::report) fn of_lines(title: &str, lines: &[String]) -> Self {
        let program = [format!("drawn by {PROGRAM}")];
        Self {
            title: title.to_owned(),
            text: [&program, lines].concat().join("\n") + "\n",
        }
    }
}
