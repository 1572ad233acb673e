//! What a table is made of: the rows of a CSV file, which of them stand where, and what is shown of each.

use crate::table::markdown;
use sd_core::Params;
use sd_core::model::PublishedUnits;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::cmp::Ordering;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;
use sweep::axes::Axis;
use sweep::format::{Uncertain, short};

/// Share by which a value may differ from the one that has a label.
const NEAR: f64 = 0.15;

/// The rows of a CSV file.
pub(crate) struct Results {
    name: String,
    rows: Vec<HashMap<String, String>>,
}

impl Results {
    /// Those of NAME.csv.
    pub(crate) fn read(folder: &Path, name: &str) -> Result<Self, String> {
        let path = folder.join(format!("{name}.csv"));
        let failed = |error: csv::Error| format!("{name}.csv: {error}");
        let mut reader = csv::Reader::from_path(path).map_err(failed)?;
        let rows = reader.deserialize().collect::<Result<_, _>>();
        Ok(Self {
            name: name.to_owned(),
            rows: rows.map_err(failed)?,
        })
    }

    /// All numbers of a column.
    pub(crate) fn numbers(&self, column: &str) -> Vec<f64> {
        let numbers = self.rows.iter().filter_map(|row| number(row, column));
        numbers.collect()
    }

    /// Whether they are not ours.
    fn are_of_others(&self) -> bool {
        self.name.contains(".reference")
    }

    fn must_have(&self, column: &str) -> Result<(), String> {
        match self.rows.first() {
            Some(row) if row.contains_key(column) => Ok(()),
            _ => Err(format!("{}.csv has no column {column}", self.name)),
        }
    }
}

/// A row of a file.
type Row = HashMap<String, String>;

fn number(row: &Row, column: &str) -> Option<f64> {
    row.get(column)?.parse().ok()
}

/// What a cell shows.
#[derive(Debug, Clone)]
struct Shown {
    quantity: String,
    percent: bool,
    beside: Option<String>,
}

impl Shown {
    fn parse(text: &str) -> Self {
        let (text, beside) = match text.split_once(" (") {
            Some((text, beside)) => (text, Some(beside.trim_end_matches(')').to_owned())),
            None => (text, None),
        };
        let percent = text.strip_suffix(" %");
        Self {
            quantity: percent.unwrap_or(text).to_owned(),
            percent: percent.is_some(),
            beside,
        }
    }

    /// The columns of the file it needs.
    fn columns(&self) -> Vec<&str> {
        let quantity = match self.quantity.as_str() {
            "viscosity_se" => "viscosity",
            "published_viscosity" => "area_fraction",
            name => name,
        };
        std::iter::once(quantity)
            .chain(self.beside.as_deref())
            .collect()
    }

    /// Number and half its interval.
    fn value(&self, row: &Row) -> Option<(f64, Option<f64>)> {
        let (name, viscosity) = (self.quantity.as_str(), number(row, "viscosity"));
        let half = number(row, "viscosity_ci95");
        match name {
            // Numbers of others have it, and no interval.
            "viscosity_se" if row.contains_key(name) => Some((viscosity?, number(row, name))),
            "viscosity_se" => {
                let freedom = number(row, "seeds")? - 1.0;
                let student = StudentsT::new(0.0, 1.0, freedom).ok();
                let student = student.map(|student| student.inverse_cdf(0.975));
                Some((viscosity?, half.zip(student).map(|(half, t)| half / t)))
            }
            "published_viscosity" if !row.contains_key(name) => {
                let units = PublishedUnits::of(&Params {
                    area_fraction: number(row, "area_fraction")?,
                    size_ratio: number(row, "size_ratio")?,
                    large_fraction: number(row, "large_fraction")?,
                    ..Params::UNWRITTEN
                });
                let half = half.map(|half| units.difference(half));
                Some((units.viscosity(viscosity?), half))
            }
            _ => {
                let scale = if self.percent { 100.0 } else { 1.0 };
                let half = number(row, &format!("{name}_ci95")).map(|half| scale * half);
                Some((scale * number(row, name)?, half))
            }
        }
    }

    /// Numbers of others, with the digits that they gave.
    fn as_written(&self, row: &Row) -> String {
        let [value, half] = match self.quantity.as_str() {
            "viscosity_se" => ["viscosity", "viscosity_se"],
            name => [name, ""],
        };
        match row.get(half).filter(|half| !half.is_empty()) {
            Some(half) => format!("{} ± {half}", row[value]),
            None => row[value].clone(),
        }
    }

    fn cell(&self, row: &Row) -> String {
        let mut text = match self.value(row) {
            None => "–".to_owned(),
            Some((value, Some(half))) => Uncertain::Interval(value, half).plain(),
            Some((value, None)) if is_count(&self.quantity) => value.to_string(),
            Some((value, None)) => Uncertain::of(value, if self.percent { 3 } else { 4 }).plain(),
        };
        if self.percent && text != "–" {
            text.push_str(" %");
        }
        if let Some(beside) = &self.beside {
            let value = number(row, beside).unwrap_or(f64::NAN);
            write!(text, " ({})", short(value, 3)).unwrap();
        }
        text
    }

    fn heading(&self) -> String {
        match &self.beside {
            Some(beside) => format!("{} ({})", symbol(&self.quantity), symbol(beside)),
            None => symbol(&self.quantity),
        }
    }
}

/// Whether a column counts something.
fn is_count(column: &str) -> bool {
    [
        "seeds",
        "jammed",
        "failed",
        "doubtful",
        "jammed_stages",
        "spheres",
        "starts",
    ]
    .contains(&column)
}

/// What a column is called.
fn symbol(column: &str) -> String {
    let name = match column {
        "viscosity" => "η",
        "viscosity_se" => "η ± one standard error",
        "published_viscosity" => "η'",
        "viscosity_median" => "median η",
        "viscosity_stresslet" => "η_S",
        "seeds" => "runs",
        "contacts_per_sphere" => "contacts / N",
        "activated_fraction" => "activated",
        "rolling_fraction" => "rolling",
        "minimum_gap" => "smallest gap",
        "mean_approach_velocity" => "approach velocity",
        "unconverged_fraction" => "unconverged",
        "overlap" => "largest overlap",
        "lubrication_regularisation" => "δ",
        "published_stress" => "6π σ'",
        "rise" => "ln(η above / η below)",
        name => Axis::of_key(name).map_or(name, |axis| axis.symbol),
    };
    name.replace('_', if name == "η_S" { "_" } else { " " })
}

/// A value as it stands in the file, for people.
fn word(value: &str) -> String {
    match value.parse::<f64>() {
        Ok(number) if number.is_infinite() => "∞".into(),
        Ok(number) => short(number, 4),
        Err(_) if value.is_empty() => "–".into(),
        Err(_) => value.to_owned(),
    }
}

/// Whether two values of a file, or of a specification, are the same.
fn same(one: &str, other: &str) -> bool {
    match (one.parse::<f64>(), other.parse::<f64>()) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
}

/// How a table is made.
#[derive(Debug, Default)]
pub(crate) struct Pivot {
    rows: Vec<String>,
    columns: Option<String>,
    /// What the values of `columns` are called, where that is not its own name.
    called: Option<String>,
    labels: Vec<(f64, String)>,
    cells: Vec<Shown>,
    wanted: Vec<(String, Vec<String>)>,
    change: Option<(String, String)>,
}

impl Pivot {
    /// As a marker says it, part by part.
    pub(crate) fn parse(parts: &[&str]) -> Result<Self, String> {
        let mut pivot = Self::default();
        for part in parts {
            let (key, text) = part
                .split_once(": ")
                .ok_or_else(|| format!("{part:?} is no KEY: VALUES"))?;
            let list: Vec<String> = text
                .split(", ")
                .map(|word| word.trim().to_owned())
                .collect();
            let pairs = |separator: &str| -> Result<Vec<(String, String)>, String> {
                let pair = |word: &String| {
                    let pair = word.split_once(separator);
                    let (one, two) =
                        pair.ok_or_else(|| format!("{word:?} has no {separator:?}"))?;
                    Ok((one.to_owned(), two.to_owned()))
                };
                list.iter().map(pair).collect()
            };
            match key.trim() {
                "rows" => pivot.rows = list,
                "columns" => {
                    let (column, called) = match text.trim().split_once(" as ") {
                        Some((column, called)) => (column, Some(called.to_owned())),
                        None => (text.trim(), None),
                    };
                    (pivot.columns, pivot.called) = (Some(column.to_owned()), called);
                }
                "cells" => pivot.cells = list.iter().map(|cell| Shown::parse(cell)).collect(),
                "where" => {
                    let several = |(key, values): (String, String)| {
                        (key, values.split('|').map(str::to_owned).collect())
                    };
                    pivot.wanted = pairs("=")?.into_iter().map(several).collect();
                }
                "change" => pivot.change = pairs(" over ")?.pop(),
                "labels" => {
                    for (value, label) in pairs("=")? {
                        let value = value.parse().map_err(|_| format!("{value} is no number"))?;
                        pivot.labels.push((value, label));
                    }
                }
                key => return Err(format!("no part of a table is called {key}")),
            }
        }
        Ok(pivot)
    }

    /// Where a row stands: its value of `columns`, or the label near that.
    fn place(&self, row: &Row) -> Result<String, String> {
        let Some(column) = &self.columns else {
            return Ok(String::new());
        };
        if self.labels.is_empty() {
            return Ok(row[column].clone());
        }
        let value = number(row, column).unwrap_or(f64::NAN);
        let distance = |label: &f64| (value / label).ln().abs();
        let nearest = self
            .labels
            .iter()
            .min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)));
        match nearest {
            Some((labelled, label)) if distance(labelled) < NEAR => Ok(label.clone()),
            _ => Err(format!("{column} = {value} has no label")),
        }
    }

    /// The table of these results.
    pub(crate) fn table(&self, results: &Results) -> Result<String, String> {
        let shown = self.cells.iter().flat_map(Shown::columns);
        let named = self.rows.iter().chain(&self.columns);
        let chosen = self.wanted.iter().map(|(column, _)| column);
        for column in named.chain(chosen).map(String::as_str).chain(shown) {
            results.must_have(column)?;
        }
        for (column, values) in &self.wanted {
            let there = |value: &String| results.rows.iter().any(|row| same(&row[column], value));
            if let Some(value) = values.iter().find(|value| !there(value)) {
                return Err(format!("no row has {column} = {value}"));
            }
        }
        let is_wanted = |row: &&Row| {
            let mut all = self.wanted.iter();
            all.all(|(column, values)| values.iter().any(|value| same(&row[column], value)))
        };
        let mut keys: Vec<Vec<&str>> = Vec::new();
        let mut places: Vec<String> = Vec::new();
        let mut cells: HashMap<(Vec<&str>, String), &Row> = HashMap::new();
        for row in results.rows.iter().filter(is_wanted) {
            let columns = self.rows.iter();
            let key: Vec<&str> = columns.map(|column| row[column].as_str()).collect();
            let place = self.place(row)?;
            if !keys.contains(&key) {
                keys.push(key.clone());
            }
            if !places.contains(&place) {
                places.push(place.clone());
            }
            if cells.insert((key, place), row).is_some() {
                return Err(format!("several rows of {}.csv share a cell", results.name));
            }
        }
        // By the first column of a row, then by the next; sorting keeps what is equal in its place.
        for at in (0..self.rows.len()).rev() {
            let seen: Vec<&str> = keys.iter().map(|key| key[at]).collect();
            keys.sort_by(|one, other| order(one[at], other[at], &seen));
        }
        let seen: Vec<String> = places.clone();
        let seen: Vec<&str> = seen.iter().map(String::as_str).collect();
        places.sort_by(|one, other| order(one, other, &seen));
        let mut lines = vec![self.headings(&places)];
        for key in keys {
            let mut line: Vec<String> = key.iter().map(|value| word(value)).collect();
            let row = |place: &String| cells.get(&(key.clone(), place.clone())).copied();
            for shown in &self.cells {
                let cell = |row: &Row| {
                    if results.are_of_others() {
                        shown.as_written(row)
                    } else {
                        shown.cell(row)
                    }
                };
                let all = places.iter();
                line.extend(all.map(|place| row(place).map_or_else(String::new, cell)));
                if let Some((one, other)) = &self.change {
                    let value = |place: &String| {
                        let at = places.iter().find(|value| same(value, place))?;
                        Some(shown.value(row(at)?)?.0)
                    };
                    line.push(
                        value(one)
                            .zip(value(other))
                            .map_or_else(String::new, change),
                    );
                }
            }
            lines.push(line);
        }
        Ok(markdown(&lines))
    }

    fn headings(&self, places: &[String]) -> Vec<String> {
        let mut line: Vec<String> = self.rows.iter().map(|column| symbol(column)).collect();
        let axis = self.called.as_ref().or(self.columns.as_ref());
        let axis = axis.map(|column| symbol(column)).unwrap_or_default();
        let is_axis_shown = places.iter().all(|place| place.parse::<f64>().is_ok());
        for shown in &self.cells {
            for (at, place) in places.iter().enumerate() {
                let place = match (at, is_axis_shown) {
                    (_, false) | (1.., true) => word(place),
                    (0, true) => format!("{axis} = {}", word(place)),
                };
                line.push(match (&self.columns, self.cells.len()) {
                    (None, _) => shown.heading(),
                    (Some(_), 1) => place,
                    (Some(_), _) => format!("{}, {place}", shown.heading()),
                });
            }
            if let Some((one, other)) = &self.change {
                line.push(format!(
                    "{}, {} over {}",
                    shown.heading(),
                    word(one),
                    word(other)
                ));
            }
        }
        line
    }
}

/// Numbers by their size, words by which of them was seen first.
fn order(one: &str, other: &str, seen: &[&str]) -> Ordering {
    if let (Ok(one), Ok(other)) = (one.parse::<f64>(), other.parse::<f64>()) {
        return one.total_cmp(&other);
    }
    let place = |value| seen.iter().position(|seen| *seen == value);
    place(one).cmp(&place(other))
}

/// How much more the first number is, in per cent.
fn change((one, other): (f64, f64)) -> String {
    let percent = 100.0 * (one / other - 1.0);
    let decimals = usize::from(percent.abs() < 9.95);
    format!("{percent:+.decimals$} %")
}
