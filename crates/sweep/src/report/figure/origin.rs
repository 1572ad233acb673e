//! What a figure says of where it comes from.

use crate::report::points::Report;

/// Characters of a key that tell a run from all others.
const KEY: usize = 16;

/// Where a figure comes from.
#[derive(Debug)]
pub(super) struct Origin {
    /// One line.
    pub(super) title: String,
    /// All of it, a line each: campaigns, programs that computed them, runs by their keys.
    pub(super) text: String,
}

/// The program that draws.
pub(super) const PROGRAM: &str = concat!("sweep ", env!("CARGO_PKG_VERSION"));

impl Origin {
    /// The origin of what is made of reports.
    pub(super) fn of(reports: &[Report]) -> Self {
        let names: Vec<&str> = reports.iter().map(|r| r.campaign.as_str()).collect();
        let mut lines = vec![format!("drawn by {PROGRAM}")];
        for report in reports {
            lines.push(format!("campaign {}", report.campaign));
            if !report.selection.is_everything() {
                lines.push(format!("only where {}", report.selection));
            }
            let programs = report.programs().into_iter();
            lines.extend(programs.map(|program| format!("computed by {program}")));
            let keys = report.keys.iter().map(|key| key.get(..KEY).unwrap_or(key));
            lines.push(format!("keys {}", keys.collect::<Vec<_>>().join(" ")));
        }
        Self {
            title: match names.as_slice() {
                [] => "two spheres that pass".into(),
                names => names.join(", "),
            },
            text: lines.join("\n") + "\n",
        }
    }
}
