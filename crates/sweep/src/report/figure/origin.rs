//! What a figure says of where it comes from.

use crate::report::points::Report;
use std::fmt;

/// Characters of a key that tell a run from all others.
const KEY: usize = 16;

/// Where a figure comes from: campaigns, runs by their keys, programs that computed them.
#[derive(Debug, Default)]
pub(super) struct Origin {
    campaigns: Vec<Part>,
}

/// What comes from one store.
#[derive(Debug)]
struct Part {
    campaign: String,
    selection: String,
    programs: Vec<String>,
    keys: Vec<String>,
}

impl Origin {
    /// The origin of what is made of reports.
    pub(super) fn of(reports: &[Report]) -> Self {
        let part = |report: &Report| Part {
            campaign: report.campaign.clone(),
            selection: report.selection.to_string(),
            programs: report.programs(),
            keys: report
                .keys
                .iter()
                .map(|key| key.get(..KEY).unwrap_or(key).to_owned())
                .collect(),
        };
        Self {
            campaigns: reports.iter().map(part).collect(),
        }
    }

    /// The program that draws.
    pub(super) fn program() -> String {
        concat!("sweep ", env!("CARGO_PKG_VERSION")).into()
    }

    /// One line.
    pub(super) fn title(&self) -> String {
        let names: Vec<&str> = self.campaigns.iter().map(|p| p.campaign.as_str()).collect();
        match names.as_slice() {
            [] => "two spheres that pass".into(),
            names => names.join(", "),
        }
    }
}

/// All of it: a line each.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "drawn by {}", Self::program())?;
        for part in &self.campaigns {
            writeln!(f, "campaign {}", part.campaign)?;
            if !part.selection.is_empty() {
                writeln!(f, "only where {}", part.selection)?;
            }
            for program in &part.programs {
                writeln!(f, "computed by {program}")?;
            }
            writeln!(f, "keys {}", part.keys.join(" "))?;
        }
        Ok(())
    }
}
