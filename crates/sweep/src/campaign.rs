//! The campaign file: read, validated with spans in its errors, and laid out as cases.

mod contact;
mod error;
mod grid;
mod protocol;
mod reader;

pub use error::CampaignError;
pub use protocol::Protocol;

use crate::case::{Case, CaseKey};
use crate::error::Error;
use error::Problem;
use reader::{Table, wrong_type};
use std::collections::HashMap;
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Largest campaign file, in bytes.
pub const FILE_LIMIT: u64 = 1 << 20;
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
    /// Its cases in the order of the file, seeds innermost.
    pub cases: Vec<(CaseKey, Case)>,
}

impl Campaign {
    /// Reads a campaign file.
    ///
    /// # Errors
    /// [`Error::Read`] and [`Error::TooLarge`] about the file, [`Error::Campaign`] about what it says.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let refused = |source| Error::Read {
            path: path.to_owned(),
            source,
        };
        let mut bytes = Vec::new();
        std::fs::File::open(path)
            .and_then(|file| file.take(FILE_LIMIT + 1).read_to_end(&mut bytes))
            .map_err(refused)?;
        if bytes.len() as u64 > FILE_LIMIT {
            return Err(Error::TooLarge {
                path: path.to_owned(),
                limit: FILE_LIMIT,
            });
        }
        if bytes.starts_with(b"SQLite format 3") {
            return Err(refused(std::io::Error::other(
                "this is a store, and not a campaign file, which is a text such as sweeps/quickstart.toml",
            )));
        }
        let text = String::from_utf8(bytes)
            .map_err(|error| refused(std::io::Error::other(error.utf8_error())))?;
        let campaign = Self::parse(&path.display().to_string(), text)?;
        Ok(Self {
            file: std::path::absolute(path).map_err(refused)?,
            ..campaign
        })
    }

    /// Reads the text of a campaign file; `file` names it in errors.
    ///
    /// # Errors
    /// A [`CampaignError`] about the first thing wrong with it.
    pub fn parse(file: &str, text: String) -> Result<Self, Box<CampaignError>> {
        match parse(&text) {
            Ok((name, protocol, cases)) => Ok(Self {
                name,
                file: PathBuf::from(file),
                text,
                protocol,
                cases,
            }),
            Err(problem) => Err(problem.in_file(file, &text)),
        }
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

/// Reads the parts of a campaign.
#[expect(clippy::type_complexity, reason = "three parts, taken apart at once")]
fn parse(text: &str) -> Result<(String, Protocol, Vec<(CaseKey, Case)>), Problem> {
    let document = DeTable::parse(text).map_err(|error| {
        let at = error.span().unwrap_or(0..0);
        Problem::at(&at, error.message(), "the file must be TOML 1.1").labelled("not TOML")
    })?;
    let top = Table::new(
        document.get_ref(),
        0..text.find('\n').unwrap_or(text.len()),
        "the campaign",
        &["name", "protocol", "grid"],
    )?;
    let name = read_name(&top)?;
    let protocol = match top.get("protocol") {
        None => Protocol::default(),
        Some(written) => {
            let DeValue::Table(entries) = written.get_ref() else {
                return Err(wrong_type(written, "protocol", "write a table: [protocol]"));
            };
            protocol::read(entries, written.span())?
        }
    };
    let written = top.need("grid", "[{ … }]` or a table `[[grid]]")?;
    let grids: Vec<(Range<usize>, &DeTable<'_>)> = match written.get_ref() {
        DeValue::Table(entries) => vec![(written.span(), entries)],
        DeValue::Array(list) => list
            .iter()
            .map(|grid| match grid.get_ref() {
                DeValue::Table(entries) => Ok((grid.span(), entries)),
                _ => Err(wrong_type(grid, "grid", "write tables: [[grid]]")),
            })
            .collect::<Result<_, _>>()?,
        _ => return Err(wrong_type(written, "grid", "write tables: [[grid]]")),
    };
    if grids.is_empty() {
        return Err(Problem::at(
            &written.span(),
            "`grid` is empty",
            "give at least one table [[grid]]",
        ));
    }
    Ok((name, protocol, lay_out(&grids, &protocol)?))
}

/// All cases of all grids, each once.
fn lay_out(
    tables: &[(Range<usize>, &DeTable<'_>)],
    protocol: &Protocol,
) -> Result<Vec<(CaseKey, Case)>, Problem> {
    let mut total = 0_u64;
    let mut grids = Vec::with_capacity(tables.len());
    for (span, entries) in tables {
        let grid = grid::Grid::read(entries, span.clone())?;
        total = total.saturating_add(grid.len());
        // Before the next grid is read: a count of seeds is short in the file and long in memory.
        if total > CASE_LIMIT {
            return Err(Problem::at(
                &grid.span,
                format!("the campaign has at least {total} cases"),
                format!("at most {CASE_LIMIT} cases; use fewer values or several campaigns"),
            )
            .labelled("with this grid"));
        }
        grids.push(grid);
    }
    let mut cases = Vec::new();
    let mut grid_of = HashMap::new();
    for (number, grid) in grids.iter().enumerate() {
        grid.check(protocol)?;
        for case in grid.cases(protocol) {
            let key = case.key();
            if let Some(other) = grid_of.insert(key, number) {
                // Values that have no meaning under one of the contact laws of the grid make the same case again.
                if other == number {
                    continue;
                }
                return Err(Problem::at(
                    &grid.span,
                    format!("the case {} is in two grids", case.label()),
                    "each case once: take the values they share out of one of the grids",
                )
                .labelled("again in this grid")
                .also(&grids[other].span, "first in this grid"));
            }
            cases.push((key, case));
        }
    }
    Ok(cases)
}

/// The name: also the name of the store's file, so it must be harmless.
fn read_name(top: &Table<'_>) -> Result<String, Problem> {
    let written = top.need("name", "\"my-campaign\"")?;
    let allowed = "`name` is 1 to 64 of a-z, 0-9 and -, and does not begin with -";
    let DeValue::String(name) = written.get_ref() else {
        return Err(wrong_type(written, "name", allowed));
    };
    let fits = (1..=64).contains(&name.len())
        && !name.starts_with('-')
        && name
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-');
    if fits {
        Ok(name.to_string())
    } else {
        let name: String = name.chars().take(70).collect();
        Err(Problem::at(
            &written.span(),
            format!("`name` cannot be {name:?}"),
            allowed,
        ))
    }
}

#[cfg(test)]
mod tests;
