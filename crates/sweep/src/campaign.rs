//! The campaign file: read, validated with spans in its errors, and laid out as cases.

mod axis_values;
mod error;
mod grid;
mod imposed_keys;
mod protocol;
mod reader;
mod seeds;
mod segments;
mod start;
mod time_unit;

pub use error::{CampaignError, Fault};
pub(crate) use reader::nearest;

use crate::model::axes::{Identity, identity};
use crate::model::campaign::{self, CASE_LIMIT, Campaign, PointRule};
use crate::model::case::{Case, CaseKey};
use crate::model::precision::Precision;
use crate::model::protocol::Protocol;
use crate::system::files::read_whole;
use error::Problem;
use grid::Grid;
use protocol::WrittenProtocol;
use reader::{Faults, Reader, wrong_type};
use sd_core::Params;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
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
    let faults = Faults::default();
    let campaign = read_text(file, &text, &faults);
    match error::in_file(faults.all(), file, &text) {
        Some(fault) => Err(fault.into()),
        None => Ok(Campaign { text, ..campaign }),
    }
}

/// Reads the parts of a campaign and records their faults.
fn read_text(file: &str, text: &str, faults: &Faults) -> Campaign {
    let mut campaign = Campaign {
        name: String::new(),
        file: PathBuf::from(file),
        text: String::new(),
        protocol: Protocol::default(),
        cases: Vec::new(),
        rules: Vec::new(),
        folded: 0,
        written: campaign::AsWritten::default(),
        start_files: Vec::new(),
    };
    let document = match DeTable::parse(text) {
        Ok(document) => document,
        Err(error) => {
            let at = error.span().unwrap_or(0..0);
            faults.push(not_toml(text, &at, error.message()));
            return campaign;
        }
    };
    let first_line = 0..text.find('\n').unwrap_or(text.len());
    let known = ["name", "protocol", "grid"];
    let document = document.get_ref();
    let top = Reader::new(document, first_line, "the campaign", &known, faults);
    campaign.name = read_name(&top).unwrap_or_default();
    let (name, keys) = (protocol::NAME, protocol::KEYS);
    let protocol = top.table("protocol", name, &keys, name);
    let protocol =
        protocol.unwrap_or_else(|| Reader::empty(top.place("protocol"), name, &keys, faults));
    let tables = top.tables("grid", "[[grid]]");
    let unit = time_unit::in_strain(&protocol, &tables, faults);
    let protocol = WrittenProtocol::read(protocol, unit);
    campaign.protocol = protocol.protocol.clone();
    top.need("grid", "[{ … }]` or a table `[[grid]]");
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    if let Some(grids) = grids(tables, &protocol, folder, faults) {
        let starts = || grids.iter().filter_map(|grid| grid.start.as_ref());
        campaign.start_files = starts().filter_map(|start| start.file.clone()).collect();
        campaign.written.starts = start::names(starts());
        lay_out(&grids, &protocol, &mut campaign, faults);
    }
    campaign
}

/// The grids that could be read as a whole; `None` if there are too many faults or cases.
fn grids<'t>(
    tables: Vec<(Range<usize>, &'t DeTable<'t>)>,
    protocol: &WrittenProtocol<'t>,
    folder: &Path,
    faults: &'t Faults,
) -> Option<Vec<Grid<'t>>> {
    let mut total = 0_u64;
    let mut grids = Vec::with_capacity(tables.len());
    for table in tables {
        // Many faults are one mistake, and only the first are shown.
        if faults.count() > 2 * error::MAX_SHOWN {
            return None;
        }
        let grid = Grid::read(table, protocol, folder, faults);
        total = total.saturating_add(grid.len());
        // Checked before the next grid is read: a short count of seeds in the file can take much
        // memory.
        if total > CASE_LIMIT {
            let problem = format!("the campaign has at least {total} cases");
            let allowed =
                format!("at most {CASE_LIMIT} cases; use fewer values or several campaigns");
            let problem = Problem::at(grid.span(), problem, allowed);
            faults.push(problem.labelled("with this grid"));
            return None;
        }
        if grid.is_whole {
            grids.push(grid);
        } else {
            grid.note_missing();
        }
    }
    Some(grids)
}

/// Lays out the cases of all grids, each once.
fn lay_out(
    grids: &[Grid<'_>],
    protocol: &WrittenProtocol<'_>,
    campaign: &mut Campaign,
    faults: &Faults,
) {
    let mut laid_out = LaidOut {
        campaign,
        grid_of: HashMap::new(),
        ruled: HashSet::new(),
        is_plain: Vec::new(),
        again: Vec::new(),
        sharing: HashSet::new(),
    };
    for (number, grid) in grids.iter().enumerate() {
        let mut twice = Vec::new();
        grid.lay_out(protocol, |case, given| {
            let label = case.label();
            if let Some(other) = laid_out.add(case, given, number, grid.seeds.rule()) {
                let message = format!("the case {label} is in two grids");
                let allowed =
                    "each case may occur once: remove the shared values from one of the grids";
                let problem = Problem::at(grid.span(), message, allowed)
                    .labelled("again in this grid")
                    .also(grids[other].span(), "first in this grid");
                grid::note(problem, &mut twice);
            }
        });
        for problem in twice {
            faults.push(problem);
        }
    }
    laid_out.note_shared();
}

/// The cases so far.
///
/// Points that share their runs are one case, by [`Params::canonicalise`]: friction has no effect
/// at Γ = 0, nor have its laws and the shear rate without friction. A file may name several of
/// them, and a user who requested three shear rates expects three points, so they are kept as they
/// are written.
struct LaidOut<'c> {
    campaign: &'c mut Campaign,
    /// Of each case, the grid that has it with its own parameters, if one does.
    grid_of: HashMap<CaseKey, Option<usize>>,
    /// Points with a requested precision.
    ruled: HashSet<Identity>,
    /// Of each case, whether its parameters are those of the file.
    is_plain: Vec<bool>,
    /// Points as written whose case has other parameters, or is there already for such a point;
    /// each with the number of cases before it.
    again: Vec<(u64, Params)>,
    /// The points of those cases.
    sharing: HashSet<Identity>,
}

impl LaidOut<'_> {
    /// Adds a case with the parameters that were given, if they are others. Returns the grid that
    /// has it too, where this is not allowed.
    fn add(
        &mut self,
        case: Case,
        given: Option<&Params>,
        number: usize,
        rule: Option<Precision>,
    ) -> Option<usize> {
        let (place, key) = (self.campaign.cases.len(), case.key());
        let last = self.again.last().map(|(_, last)| last);
        if let Some(given) = given.filter(|given| last != Some(*given)) {
            self.sharing.insert(identity(&without_start(&case.params)));
            self.again.push((place as u64, given.clone()));
        }
        let is_folded = given.is_some();
        let Some(plain) = self.grid_of.get_mut(&key) else {
            self.grid_of.insert(key, (!is_folded).then_some(number));
            if let Some(precision) = rule {
                let cases = &self.campaign.cases;
                match self.campaign.rules.last_mut() {
                    Some(rule)
                        if rule.cases.end == place
                            && cases[rule.cases.start].1.params == case.params =>
                    {
                        rule.cases.end += 1;
                    }
                    // Its seeds are those of the first grid.
                    _ if !self.ruled.insert(identity(&case.params)) => return None,
                    _ => self.campaign.rules.push(PointRule {
                        precision,
                        cases: place..place + 1,
                    }),
                }
            }
            self.is_plain.push(!is_folded);
            self.campaign.cases.push((key, case));
            return None;
        };
        match *plain {
            Some(other) if !is_folded => {
                // Values without effect under one of the choices of a grid repeat the same case.
                return (other != number).then_some(other);
            }
            None if !is_folded => {
                *plain = Some(number);
                self.again.push((place as u64, without_start(&case.params)));
            }
            _ => {}
        }
        self.campaign.folded += 1;
        None
    }

    /// Keeps the points that share their runs as the file has them, each with the position of the
    /// case that follows it.
    fn note_shared(self) {
        if self.sharing.is_empty() {
            return;
        }
        let mut all = self.again;
        for (place, (_, case)) in self.campaign.cases.iter().enumerate() {
            let point = without_start(&case.params);
            if self.is_plain[place] && self.sharing.contains(&identity(&point)) {
                all.push((place as u64, point));
            }
        }
        all.sort_by_key(|(follows, _)| *follows);
        let mut seen = HashSet::new();
        all.retain(|(_, point)| seen.insert(identity(point)));
        self.campaign.written.shared = all;
    }
}

/// The parameters before start layers are read.
fn without_start(params: &Params) -> Params {
    Params {
        start: None,
        ..params.clone()
    }
}

/// The problem of a text that is no TOML.
fn not_toml(text: &str, at: &Range<usize>, message: &str) -> Problem {
    let problem = |allowed| Problem::at(at, message, allowed).labelled("not TOML");
    match open_list(text.get(..at.start).unwrap_or_default()) {
        Some(open) => {
            problem("close the list with `]`".into()).also(&open, "this list is not closed")
        }
        None => problem(instead_of(text, at, message)),
    }
}

/// The last bracket of a text that is not closed in an earlier line than the last, outside strings
/// and comments.
fn open_list(text: &str) -> Option<Range<usize>> {
    let mut open = Vec::new();
    let mut quote = None;
    let mut is_comment = false;
    for (at, character) in text.char_indices() {
        match (character, quote) {
            ('\n', _) => (is_comment, quote) = (false, None),
            _ if is_comment => {}
            (_, Some(end)) => quote = quote.filter(|_| character != end),
            ('"' | '\'', None) => quote = Some(character),
            ('#', None) => is_comment = true,
            ('[', None) => open.push(at),
            (']', None) => drop(open.pop()),
            _ => {}
        }
    }
    let line = text.rfind('\n')?;
    open.pop().filter(|at| *at < line).map(|at| at..at + 1)
}

/// A suggestion for a syntax error of TOML.
fn instead_of(text: &str, at: &Range<usize>, message: &str) -> String {
    if message == "duplicate key" {
        return "each key once in its table; tables that may be repeated have two brackets: [[grid]], [[protocol.segment]]"
            .into();
    }
    let line = text.get(..at.start).and_then(|before| before.rfind('\n'));
    let line = text.get(line.map_or(0, |end| end + 1)..);
    if let Some(number) = line.and_then(with_point) {
        return format!("a decimal fraction has a point: `{number}`");
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

/// The value with a decimal point of a line `key = 0,40`.
fn with_point(line: &str) -> Option<String> {
    let (_, value) = line.lines().next()?.split_once('=')?;
    let (whole, part) = value.trim().split_once(',')?;
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let end = part.find(|c: char| !c.is_ascii_digit());
    let part = &part[..end.unwrap_or(part.len())];
    (is_digits(whole) && is_digits(part)).then(|| format!("{whole}.{part}"))
}

/// The name is also that of the store's file, so its characters are restricted.
fn read_name(top: &Reader<'_>) -> Option<String> {
    let allowed = "`name` is 1 to 64 of a-z, 0-9 and -, and does not begin with -";
    let written = top.need("name", "\"my-campaign\"")?;
    let DeValue::String(name) = written.get_ref() else {
        top.faults.push(wrong_type(written, "name", allowed));
        return None;
    };
    let is_allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
    if (1..=64).contains(&name.len()) && !name.starts_with('-') && name.bytes().all(is_allowed) {
        return Some(name.to_string());
    }
    let name: String = name.chars().take(70).collect();
    let problem = format!("`name` cannot be {name:?}");
    top.faults
        .push(Problem::at(&written.span(), problem, allowed));
    None
}

#[cfg(test)]
mod tests;
