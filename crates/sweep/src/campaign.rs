//! The campaign file: read, validated with spans in its errors, and laid out as cases.

mod elsewhere;
mod ends_of_runs;
mod error;
mod grid;
mod protocol;
mod reader;
mod seeds;
mod segments;
mod shared;
mod sizes;
mod start;
mod start_names;

pub use elsewhere::text_elsewhere;
pub use error::{CampaignError, Fault};
pub(crate) use reader::nearest;

use crate::model::axes::identity;
use crate::model::campaign::{self, CASE_LIMIT, Campaign, PointRule};
use crate::model::case::{Case, CaseKey};
use crate::model::protocol::Protocol;
use crate::system::files::read_whole;
use error::Problem;
use grid::Grid;
use protocol::Written;
use reader::{Table, wrong_type};
use sd_core::Params;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Largest campaign file, in bytes.
pub const FILE_LIMIT: u64 = 1 << 20;

/// Reads a campaign file.
///
/// # Errors
/// An I/O error, or all faults of its content.
pub fn read(path: &Path) -> Result<Campaign, CampaignError> {
    let unreadable = |source| CampaignError::Unreadable {
        path: path.to_owned(),
        source,
    };
    let bytes = read_whole(path, FILE_LIMIT).map_err(unreadable)?;
    if bytes.starts_with(b"SQLite format 3") {
        return Err(unreadable(std::io::Error::other(
            "this is a store, and not a campaign file, which is a text such as sweeps/quickstart.toml",
        )));
    }
    let text = String::from_utf8(bytes)
        .map_err(|error| unreadable(std::io::Error::other(error.utf8_error())))?;
    let campaign = parse(&path.display().to_string(), text)?;
    Ok(Campaign {
        file: std::path::absolute(path).map_err(unreadable)?,
        ..campaign
    })
}

/// Reads the text of a campaign file; `file` names it in errors, and its folder is where relative
/// paths in it begin.
///
/// # Errors
/// All its faults, the first in front.
pub fn parse(file: &str, text: String) -> Result<Campaign, CampaignError> {
    let mut problems = Vec::new();
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    let (name, protocol, laid_out) = parts(&text, folder, &mut problems);
    let LaidOut {
        cases,
        rules,
        folded,
        shared,
    } = laid_out;
    match error::in_file(problems, file, &text) {
        Some(fault) => Err(fault.into()),
        None => Ok(Campaign {
            name,
            file: PathBuf::from(file),
            written: campaign::Written {
                shared,
                starts: start_names::names(&text, cases.iter().map(|(_, case)| &case.params)),
            },
            text,
            protocol,
            cases,
            rules,
            folded,
        }),
    }
}

/// The cases of a file and their definitions.
#[derive(Default)]
struct LaidOut {
    cases: Vec<(CaseKey, Case)>,
    rules: Vec<PointRule>,
    /// Runs that several points share.
    folded: usize,
    shared: Vec<(u64, Params)>,
}

/// Reads the parts of a campaign and records their faults.
fn parts(text: &str, folder: &Path, problems: &mut Vec<Problem>) -> (String, Protocol, LaidOut) {
    let nothing = || (String::new(), Protocol::default(), LaidOut::default());
    let document = match DeTable::parse(text) {
        Ok(document) => document,
        Err(error) => {
            let at = error.span().unwrap_or(0..0);
            problems.push(
                Problem::at(&at, error.message(), instead_of(text, &at, error.message()))
                    .labelled("not TOML"),
            );
            return nothing();
        }
    };
    let first_line = 0..text.find('\n').unwrap_or(text.len());
    let top = Table::new(
        document.get_ref(),
        first_line.clone(),
        "the campaign",
        &["name", "protocol", "grid"],
        problems,
    );
    let name = if let Some(written) = top.get("name") {
        read_name(written).unwrap_or_else(|problem| {
            problems.push(problem);
            String::new()
        })
    } else {
        problems.extend(top.missing("name", "\"my-campaign\""));
        String::new()
    };
    let protocol = protocol_of(&top, first_line, problems);
    let grids = grids(&top, problems);
    let laid_out = lay_out(&grids, &protocol, folder, problems);
    (name, protocol.protocol, laid_out)
}

/// The protocol; the default where there is none, placed at the first line.
fn protocol_of(top: &Table<'_>, first_line: Range<usize>, problems: &mut Vec<Problem>) -> Written {
    match top
        .get("protocol")
        .map(|written| (written, written.get_ref()))
    {
        None => Written::default_at(first_line),
        Some((written, DeValue::Table(entries))) => {
            Written::read(entries, written.span(), problems)
        }
        Some((written, _)) => {
            problems.push(wrong_type(written, "protocol", "write a table: [protocol]"));
            Written::default_at(written.span())
        }
    }
}

/// A suggestion for a syntax error of TOML.
fn instead_of(text: &str, at: &Range<usize>, message: &str) -> String {
    if message == "duplicate key" {
        return "each key once in its table; tables that may be repeated have two brackets: [[grid]], [[protocol.segment]]"
            .into();
    }
    let rest = text.get(at.start..).unwrap_or_default();
    let word: String = rest
        .trim_start_matches(['[', ',', ' '])
        .chars()
        .take_while(|c| c.is_alphanumeric() || "-_∞".contains(*c))
        .collect();
    match word.to_lowercase().as_str() {
        "infinity" | "inf" | "infinite" | "∞" => "write `inf`".into(),
        _ if word.starts_with(char::is_alphabetic) => {
            format!("words need quotes: `\"{word}\"`; the file must be TOML 1.1")
        }
        _ => "the file must be TOML 1.1: `key = value` on lines of their own".into(),
    }
}

/// The tables of the grids, each with its place.
fn grids<'t>(top: &Table<'t>, problems: &mut Vec<Problem>) -> Vec<(Range<usize>, &'t DeTable<'t>)> {
    let Some(written) = top.get("grid") else {
        problems.extend(top.missing("grid", "[{ … }]` or a table `[[grid]]"));
        return Vec::new();
    };
    let list = match written.get_ref() {
        DeValue::Array(list) => list.iter().collect(),
        _ => vec![written],
    };
    if list.is_empty() {
        problems.push(Problem::at(
            &written.span(),
            "`grid` is empty",
            "give at least one table [[grid]]",
        ));
    }
    let mut grids = Vec::with_capacity(list.len());
    for grid in list {
        match grid.get_ref() {
            DeValue::Table(entries) => grids.push((grid.span(), entries)),
            _ => problems.push(wrong_type(grid, "grid", "write tables: [[grid]]")),
        }
    }
    grids
}

/// All cases of all grids, each once.
fn lay_out(
    tables: &[(Range<usize>, &DeTable<'_>)],
    protocol: &Written,
    folder: &Path,
    problems: &mut Vec<Problem>,
) -> LaidOut {
    let mut total = 0_u64;
    let mut grids = Vec::with_capacity(tables.len());
    for (span, entries) in tables {
        // Many faults are one mistake, and only the first are shown.
        if problems.len() > 2 * error::MAX_SHOWN {
            return LaidOut::default();
        }
        let grid = Grid::read(entries, span.clone(), protocol, Some(folder), problems);
        total = total.saturating_add(grid.len());
        // Checked before the next grid is read: a short count of seeds in the file can take much
        // memory.
        if total > CASE_LIMIT {
            problems.push(
                Problem::at(
                    &grid.span,
                    format!("the campaign has at least {total} cases"),
                    format!("at most {CASE_LIMIT} cases; use fewer values or several campaigns"),
                )
                .labelled("with this grid"),
            );
            return LaidOut::default();
        }
        if grid.is_whole {
            grids.push(grid);
        } else {
            grid.note_missing(entries, problems);
        }
    }
    let LaidOut {
        mut cases,
        mut rules,
        mut folded,
        ..
    } = LaidOut::default();
    let mut ruled = HashSet::new();
    let mut grid_of = HashMap::new();
    for (number, grid) in grids.iter().enumerate() {
        grid.lay_out(protocol, problems, |case, is_folded, problems| {
            let key = case.key();
            match grid_of.insert(key, (number, is_folded)) {
                None => {
                    if let Some(precision) = grid.seeds.rule() {
                        let place = cases.len();
                        match rules.last_mut() {
                            Some(rule)
                                if rule.cases.end == place
                                    && cases[rule.cases.start].1.params == case.params =>
                            {
                                rule.cases.end += 1;
                            }
                            // Its seeds are those of the first grid.
                            _ if !ruled.insert(identity(&case.params)) => return,
                            _ => rules.push(PointRule {
                                precision,
                                cases: place..place + 1,
                            }),
                        }
                    }
                    cases.push((key, case));
                }
                // Values without effect under one of the choices of the grid repeat the same case.
                Some((other, _)) if other == number => folded += usize::from(is_folded),
                // The same holds where friction or shear rate have no effect.
                Some((_, was_folded)) if is_folded || was_folded => folded += 1,
                Some((other, _)) => {
                    let message = format!("the case {} is in two grids", case.label());
                    let allowed =
                        "each case may occur once: remove the shared values from one of the grids";
                    let again = Problem::at(&grid.span, message, allowed)
                        .labelled("again in this grid")
                        .also(&grids[other].span, "first in this grid");
                    grid.note(again, problems);
                }
            }
        });
    }
    LaidOut {
        shared: shared::shared(&grids, protocol, &cases),
        cases,
        rules,
        folded,
    }
}

/// The name is also that of the store's file, so its characters are restricted.
fn read_name(written: &Spanned<DeValue<'_>>) -> Result<String, Problem> {
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
