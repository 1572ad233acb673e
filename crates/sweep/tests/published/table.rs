//! Tables of the published results, made from their CSV files.
//!
//! A table of results/published/README.md stands between two comments, of which the first says how it is made:
//!
//! ```text
//! <!-- table: figure-13 | rows: shear_rate | columns: hydrodynamics | cells: viscosity, viscosity_stresslet | where: friction=0.3 -->
//! <!-- end -->
//! ```
//!
//! - `rows`: columns of the file that name a row; `columns`: the one whose values stand side by side, if there is one.
//! - `cells`: what is shown, with half its 95 % interval if the file has one. `NAME (OTHER)` puts the other number into brackets,
//!   `NAME %` is a share in per cent. Besides the columns of the file there are `viscosity_se` (± one standard error in place of the
//!   interval) and `published_viscosity` (in the units of published soft-sphere simulations, as `sweep convert` has it).
//! - `where`: only rows with these values, `friction=0.3|1`.
//! - `change`: `inf over 0` adds how much more, in per cent, each of `cells` is at one value of `columns` than at another.
//! - `labels`: `0.00348=0.1` shows values of `columns` near the first number under the second; `columns: shear_stress as published_stress`
//!   then calls them by another name.
//!
//! Numbers of others stand in NAME.reference.csv. Instead of a CSV file a table can be a page made by `scripts/published` (`<!-- table: NAME.md -->`), or pairs of spheres as `sweep
//! pair` tells of them (`<!-- table: figure-08-a.txt, figure-08-b.txt -->`), or the list of the campaigns of `scripts/published`, with what
//! each took and the physics that made it, as NAME.txt has them (`<!-- table: campaigns -->`).

use crate::pivot::{Pivot, Results};
use std::fmt::Write as _;
use std::path::Path;
use sweep::campaign::Campaign;
use sweep::format::Uncertain;

/// How a table begins.
const BEGIN: &str = "<!-- table: ";
/// How it ends.
const END: &str = "<!-- end -->";

/// Lines of cells, the first of them the headings.
pub(crate) fn markdown(lines: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (at, line) in lines.iter().enumerate() {
        writeln!(text, "| {} |", line.join(" | ")).unwrap();
        if at == 0 {
            writeln!(text, "|{}", " --- |".repeat(line.len())).unwrap();
        }
    }
    text
}

/// Pairs of spheres that passed each other, from what `sweep pair` printed.
fn pairs(folder: &Path, files: &[&str]) -> Result<String, String> {
    let mut lines = vec![
        [
            "file",
            "rotation in degrees",
            "of the second",
            "offset at the end",
            "smallest gap",
            "time",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for file in files {
        let text = std::fs::read_to_string(folder.join(file))
            .map_err(|error| format!("{file}: {error}"))?;
        let after = |label: &str| -> Result<Vec<f64>, String> {
            let at = text
                .find(label)
                .ok_or_else(|| format!("{file} has no {label:?}"))?;
            let words = text[at + label.len()..].lines().next().unwrap_or_default();
            let words = words.split([' ', ',']).filter(|word| !word.is_empty());
            Ok(words.map_while(|word| word.parse().ok()).collect())
        };
        let (turned, offset) = (after("rotation in degrees")?, after("offset at the end")?);
        let (gap, time) = (after("smallest gap")?, after(", time")?);
        let first = |numbers: &[f64], at: usize| {
            let number = numbers
                .get(at)
                .ok_or_else(|| format!("{file} lacks a number"))?;
            Ok::<_, String>(Uncertain::of(*number, 4).plain())
        };
        lines.push(vec![
            format!("`{file}`"),
            first(&turned, 0)?,
            first(&turned, 1)?,
            first(&offset, 0)?,
            first(&gap, 0)?,
            first(&time, 0)?,
        ]);
    }
    Ok(markdown(&lines))
}

/// The campaigns of `scripts/published`: what their runs took, and which physics made them.
fn campaigns(folder: &Path) -> Result<String, String> {
    let read = |path: &Path| {
        std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let script = read(&folder.join("../../scripts/published"))?;
    let names = script.lines().find_map(|line| line.strip_prefix("all=("));
    let names = names.ok_or("scripts/published names no campaigns")?;
    let mut lines = vec![
        ["campaign", "made by", "processor time", "physics"]
            .map(str::to_owned)
            .to_vec(),
    ];
    for name in names.trim_end_matches(')').split(' ') {
        let path = folder.join(format!("{name}.txt"));
        if !path.exists() {
            continue;
        }
        let text = read(&path)?;
        let told = text.lines().rfind(|line| line.starts_with("computed in "));
        let parts = told.and_then(|line| {
            let told = line.strip_prefix("computed in ")?;
            // Older programs did not tell processor time from that of the clock.
            let (time, _) = told
                .split_once(" of processor time")
                .or_else(|| told.split_once(','))?;
            // A report has only runs that its own program would make the same: that one is as new as the newest that made any.
            let versions = line.split("(physics ").skip(1);
            let versions = versions.filter_map(|rest| rest.split_once(',')?.0.parse::<u32>().ok());
            Some((time, versions.max()?))
        });
        let (time, version) = parts.ok_or(format!("{name}.txt says no time or no physics"))?;
        let is_present = version >= needed(folder, name)?;
        lines.push(vec![
            name.to_owned(),
            format!("`scripts/published {name}`"),
            time.to_owned(),
            format!("{version}{}", if is_present { "" } else { ", stale" }),
        ]);
    }
    Ok(markdown(&lines))
}

/// The version of the physics that last changed runs of a campaign.
fn needed(folder: &Path, name: &str) -> Result<u32, String> {
    let file = folder.join(format!("../../sweeps/{name}.toml"));
    let campaign = Campaign::read(&file).map_err(|error| format!("{name}: {error}"))?;
    let versions = campaign.cases.iter().map(|_| sweep::case::PHYSICS_VERSION);
    versions.max().ok_or(format!("{name} has no cases"))
}

/// What stands in the marker of a line: its parts, the first of them the files.
fn marker(line: &str) -> Option<Vec<&str>> {
    let inner = line.strip_prefix(BEGIN)?.strip_suffix("-->")?;
    Some(inner.trim().split(" | ").collect())
}

fn has_ending(file: &str, ending: &str) -> bool {
    Path::new(file)
        .extension()
        .is_some_and(|found| found == ending)
}

/// The table that a marker asks for.
fn made(folder: &Path, parts: &[&str]) -> Result<String, String> {
    let files: Vec<&str> = parts[0].split(", ").collect();
    if parts[0] == "campaigns" {
        return campaigns(folder);
    }
    if has_ending(parts[0], "md") {
        let page = std::fs::read_to_string(folder.join(parts[0]));
        return page.map_err(|error| format!("{}: {error}", parts[0]));
    }
    if has_ending(files[0], "txt") {
        return pairs(folder, &files);
    }
    Pivot::parse(&parts[1..])?.table(&Results::read(folder, parts[0])?)
}

/// A page with every table between markers made anew.
pub(crate) fn with_tables(page: &str, folder: &Path) -> Result<String, String> {
    let mut text = String::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        writeln!(text, "{line}").unwrap();
        let Some(parts) = marker(line) else {
            continue;
        };
        let table = made(folder, &parts).map_err(|error| format!("{line}\n{error}"))?;
        writeln!(text, "{}\n{END}", table.trim_end()).unwrap();
        if !lines.any(|line| line == END) {
            return Err(format!("{line}\nhas no {END}"));
        }
    }
    Ok(text)
}

/// The CSV files of the tables of a text, by name.
pub(crate) fn sources(text: &str) -> Vec<&str> {
    let markers = text.lines().filter_map(marker);
    let names = markers.map(|parts| parts[0]);
    names
        .filter(|name| {
            *name != "campaigns" && (!name.contains('.') || name.ends_with(".reference"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "friction,shear_rate,seeds,viscosity,viscosity_ci95,rolling_fraction\n\
                        0.1,0.0,8,7.0,0.25,\n0.1,inf,8,9.8,0.5,0.625\n0.3,inf,1,10.5,,0.4\n0.3,1.0,0,,,\n";

    fn page(specification: &str) -> Result<String, String> {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("some.csv"), FILE).unwrap();
        let page = format!("before\n{BEGIN}some | {specification} -->\nold\n{END}\nafter\n");
        let made = with_tables(&page, directory.path())?;
        assert_eq!(with_tables(&made, directory.path()).as_ref(), Ok(&made));
        Ok(made)
    }

    #[test]
    fn rows_and_columns_are_those_asked_for() {
        let made = page(
            "rows: friction | columns: shear_rate | cells: viscosity (seeds) | change: inf over 0",
        )
        .unwrap();
        let table = "\
| ν | Γ = 0 | 1 | ∞ | η (runs), ∞ over 0 |
| --- | --- | --- | --- | --- |
| 0.1 | 7.00 ± 0.25 (8) |  | 9.80 ± 0.50 (8) | +40 % |
| 0.3 |  | – (0) | 10.50 (1) |  |
<!-- end -->
after
";
        assert!(made.ends_with(table), "{made}");
        assert!(made.starts_with("before\n<!-- table: some |") && !made.contains("old"));
        let made = page(
            "rows: friction, seeds | cells: viscosity, rolling_fraction % | where: shear_rate=inf",
        )
        .unwrap();
        assert!(made.contains("| ν | runs | η | rolling |\n"), "{made}");
        assert!(
            made.contains("| 0.1 | 8 | 9.80 ± 0.50 | 62.5 % |\n"),
            "{made}"
        );
        let made = page(
            "rows: friction | columns: shear_rate | cells: viscosity | where: shear_rate=inf | labels: inf=top, 1=middle",
        );
        assert!(made.unwrap_err().contains("has no label"));
    }

    #[test]
    fn one_standard_error_is_that_of_students_interval() {
        let made =
            page("rows: friction, shear_rate | cells: viscosity_se | where: seeds=8").unwrap();
        // 0.25 over 2.365, for 8 runs.
        assert!(made.contains("| 0.1 | 0 | 7.00 ± 0.11 |"), "{made}");
    }

    #[test]
    fn what_cannot_be_made_is_named() {
        for (specification, said) in [
            ("rows: friction | cells: viscosity", "several rows"),
            ("rows: friktion | cells: viscosity", "no column friktion"),
            (
                "rows: friction | cells: viscosity | where: friction=0.7",
                "no row has friction = 0.7",
            ),
            ("row: friction", "no part of a table is called row"),
            ("rows", "is no KEY: VALUES"),
        ] {
            let error = page(specification).unwrap_err();
            assert!(error.contains(said) && error.contains(BEGIN), "{error}");
        }
        let unended = format!("{BEGIN}some | rows: friction | cells: seeds -->\n");
        assert!(with_tables(&unended, Path::new("nowhere")).is_err());
    }
}
