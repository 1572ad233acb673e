//! Numbers quoted in sentences, held against the tables beside them.
//!
//! Every number in a sentence must stand in a table of its section, or of a section or page that the section links to: to the digits
//! that are quoted, a share in per cent as one in per cent, `7.0 ± 0.3` as a number with that interval, a sign if there is one. Not
//! looked for are
//!
//! - sentences that begin with one of [`OUTSIDE`]: they quote others, and may not speak of ours;
//! - `symbol = number` (and a list that follows, `c = 0.70, 0.72 and 0.74`) where the campaigns of the section have these values on that
//!   axis; likewise `200 spheres`, and `8 seeds` or `runs` as a point has them;
//! - ratios of sizes written as `1 : 1.4`, numbers of figures, equations and versions of the physics, names, and what is set as code.
//!
//! What this cannot see is a number that stands in another cell than the one that is meant. So a sentence that quotes a number says where
//! it stands, and has as many of its digits as its neighbours in the table need.

use crate::numbers::{JOINTS, Number, near, numbers};
use crate::pivot::Results;
use crate::table::sources;
use std::path::Path;
use sweep::axes::AXES;

/// How sentences begin that quote others.
const OUTSIDE: [&str; 3] = ["The paper", "As in the paper", "The published"];
/// What numbers of figures and the like come after.
const REFERENCES: [&str; 8] = [
    "fig. ", "figs. ", "figure ", "figures ", "eq. (", "eqs. (", "physics ", "version ",
];

/// A part of a page, from one heading to the next.
struct Section<'t> {
    title: &'t str,
    text: &'t str,
}

fn sections(page: &str) -> Vec<Section<'_>> {
    let mut starts: Vec<usize> = page.match_indices("\n#").map(|(at, _)| at + 1).collect();
    starts.push(page.len());
    let parts = starts.windows(2).map(|pair| &page[pair[0]..pair[1]]);
    parts
        .map(|text| Section {
            title: text
                .lines()
                .next()
                .unwrap_or_default()
                .trim_start_matches('#')
                .trim(),
            text,
        })
        .collect()
}

/// What a heading is linked by.
fn anchor(title: &str) -> String {
    let letters = title.to_lowercase().replace(' ', "-");
    letters
        .chars()
        .filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_')
        .collect()
}

/// Where the links of a text lead.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](")
        .skip(1)
        .filter_map(|after| after.split(')').next())
}

/// The lines of tables in a text.
fn table_lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| line.starts_with('|'))
}

/// The sentences of a text: without tables, headings, comments, code and where links lead.
fn sentences(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut paragraph = String::new();
    let mut is_fenced = false;
    for line in text.lines().chain([""]) {
        let is_fence = line.starts_with("```");
        let is_prose = !is_fenced && !is_fence && !line.starts_with(['|', '#', '<']);
        is_fenced ^= is_fence;
        let begins = line.is_empty() || line.starts_with("- ") || !is_prose;
        if begins && !paragraph.is_empty() {
            all.extend(split(&plain(&std::mem::take(&mut paragraph))));
        }
        if is_prose && !line.is_empty() {
            paragraph.push_str(line.trim_start_matches("- ").trim());
            paragraph.push(' ');
        }
    }
    all
}

/// A paragraph without marks of emphasis, code and the targets of links.
fn plain(text: &str) -> String {
    let mut words = String::new();
    for (at, part) in text.split('`').enumerate() {
        words.push_str(if at % 2 == 0 { part } else { "CODE" });
    }
    let mut parts = words.split("](");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        text.push_str(part.split_once(')').map_or("", |(_, after)| after));
    }
    text.replace("**", "").replace('[', "")
}

/// Sentences of a plain text: after a full stop, a colon does not count, another begins with a capital letter or a sign.
fn split(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut rest = text.trim();
    let mut from = 0;
    while let Some(found) = rest[from..].find(". ") {
        let end = from + found + 1;
        let next = rest[end..].trim_start().chars().next();
        if next.is_some_and(|c| c.is_uppercase() || c == '"') {
            all.push(rest[..end].to_owned());
            rest = rest[end..].trim_start();
            from = 0;
        } else {
            from = end;
        }
    }
    all.push(rest.to_owned());
    all
}

/// What numbers of a section are held against.
struct Known {
    tables: Vec<Number>,
    campaigns: Vec<Results>,
}

impl Known {
    /// The tables of texts, and the campaigns these are made of.
    fn of(texts: &[&str], folder: &Path) -> Result<Self, String> {
        let lines = texts.iter().flat_map(|text| table_lines(text));
        let names = texts.iter().flat_map(|text| sources(text));
        Ok(Self {
            tables: lines
                .flat_map(|line| line.split('|').flat_map(numbers))
                .collect(),
            campaigns: names
                .map(|name| Results::read(folder, name))
                .collect::<Result<_, _>>()?,
        })
    }

    /// Whether a campaign has this value in one of these columns.
    fn has(&self, columns: &[&str], number: &Number) -> bool {
        let values = self
            .campaigns
            .iter()
            .flat_map(|results| columns.iter().flat_map(|column| results.numbers(column)));
        // As files have them, values are exact.
        values
            .into_iter()
            .any(|value| near((number.value, number.last), (value, i32::MIN)))
    }
}

/// The axis with this symbol at the end of a text: its key.
fn axis_before(text: &str) -> Option<&'static str> {
    let text = text.strip_suffix(" = ")?;
    let symbol = text.rsplit([' ', '(', ',']).next()?;
    let mut axes = AXES.iter().filter(|axis| axis.is_numeric());
    axes.find(|axis| {
        axis.symbol == symbol || symbol == "δ" && axis.key == "lubrication_regularisation"
    })
    .map(|axis| axis.key)
}

/// Numbers of a sentence that are in no table, as they are written.
fn unknown(sentence: &str, known: &Known) -> Vec<String> {
    if OUTSIDE
        .iter()
        .any(|beginning| sentence.starts_with(beginning))
    {
        let ours = sentence
            .split(|c: char| !c.is_alphabetic())
            .find(|word| ["ours", "Ours", "our", "we"].contains(word));
        return ours
            .map(|word| format!("{word:?} in a sentence that quotes others"))
            .into_iter()
            .collect();
    }
    let all = numbers(sentence);
    let before = |at: usize| &sentence[..all[at].start];
    let after = |at: usize| &sentence[all[at].end..];
    let is_joined = |at: usize| {
        let between = &sentence[all[at].end..all[at + 1].start];
        JOINTS.contains(&between)
    };
    let is_plain = |at: usize| !all[at].percent && all[at].half.is_none();
    // Columns that a number may be a value of: by what stands before it or its list, and by what stands after.
    let mut named: Vec<Vec<&str>> = Vec::new();
    for at in 0..all.len() {
        let list = (at > 0 && is_joined(at - 1) && is_plain(at)).then(|| named[at - 1].clone());
        named.push(match axis_before(before(at)) {
            Some(key) => vec![key],
            None => list.unwrap_or_default(),
        });
    }
    let mut counted: Vec<Vec<&str>> = vec![Vec::new(); all.len()];
    for at in (0..all.len()).rev() {
        let runs = [" seeds", " runs", " starts"];
        counted[at] = if after(at).starts_with(" spheres") {
            vec!["spheres"]
        } else if runs.iter().any(|word| after(at).starts_with(word)) {
            vec!["seeds", "jammed", "failed", "seeds_wanted"]
        } else if at + 1 < all.len() && is_joined(at) && is_plain(at) {
            counted[at + 1].clone()
        } else {
            Vec::new()
        };
    }
    let mut is_reference = vec![false; all.len()];
    for at in 0..all.len() {
        let lower = before(at).to_lowercase();
        let is_ratio = |text: &str| text.trim_matches(' ') == ":";
        let of_sizes = at + 1 < all.len() && is_ratio(&sentence[all[at].end..all[at + 1].start])
            || at > 0 && is_ratio(&sentence[all[at - 1].end..all[at].start]);
        let in_list =
            at > 0 && is_joined(at - 1) && is_plain(at) && is_reference[at - 1] && !of_sizes;
        is_reference[at] =
            of_sizes || in_list || REFERENCES.iter().any(|word| lower.ends_with(word));
    }
    let is_known = |at: &usize| {
        let number = &all[*at];
        is_reference[*at]
            || known.has(&named[*at], number)
            || known.has(&counted[*at], number)
            || known.tables.iter().any(|other| number.is(other))
    };
    let missing = (0..all.len()).filter(|at| !is_known(at));
    missing
        .map(|at| sentence[all[at].start..all[at].end].to_owned())
        .collect()
}

/// Numbers of a page of results that are in no table: each with its section and its sentence. What comes before the first section
/// with two marks quotes nothing.
pub(crate) fn not_found(page: &str, folder: &Path) -> Result<Vec<String>, String> {
    let all = sections(page);
    let mut missing = Vec::new();
    for section in &all {
        let mut pages = Vec::new();
        let mut texts = vec![section.text];
        for link in links(section.text) {
            if let Some(wanted) = link.strip_prefix('#') {
                texts.extend(
                    all.iter()
                        .filter(|other| anchor(other.title) == wanted)
                        .map(|other| other.text),
                );
            } else if let Some((file, _)) = link
                .split_once(".md")
                .filter(|(file, _)| !file.contains(".."))
            {
                let path = folder.join(format!("{file}.md"));
                pages.push(
                    std::fs::read_to_string(&path)
                        .map_err(|error| format!("{file}.md: {error}"))?,
                );
            }
        }
        texts.extend(pages.iter().map(String::as_str));
        let known = Known::of(&texts, folder)?;
        for sentence in sentences(section.text) {
            for number in unknown(&sentence, &known) {
                missing.push(format!("{}: {number} in {sentence:?}", section.title));
            }
        }
    }
    Ok(missing)
}

/// Numbers of a text that do not stand in another one.
pub(crate) fn not_in(text: &str, other: &str) -> Vec<String> {
    let there = numbers(other);
    let missing = numbers(text)
        .into_iter()
        .filter(|number| !there.iter().any(|other| number.is(other)));
    missing
        .map(|number| text[number.start..number.end].to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(prose: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let file = "friction,spheres,seeds,failed\n0.3,50,8,16\n1.0,200,4,0\n";
        std::fs::write(folder.path().join("some.csv"), file).unwrap();
        let page = format!(
            "# Page\n\nNumbers 17 of the beginning.\n\n## First\n\n{prose}\n\n<!-- table: some | rows: friction -->\n| ν | η |\n| --- | --- |\n\
             | 0.3 | 7.77 ± 0.27 |\n| 1 | -1.64 % |\n| 2 | 0.0016 (9) |\n<!-- end -->\n\n## Second part\n\n| 42.5 |\n"
        );
        let all = not_found(&page, folder.path()).unwrap();
        all.iter()
            .map(|found| {
                found
                    .split(" in \"")
                    .next()
                    .unwrap()
                    .trim_start_matches("First: ")
                    .to_owned()
            })
            .collect()
    }

    #[test]
    fn numbers_of_the_tables_are_found_to_the_digits_quoted() {
        for prose in [
            "Of 7.8, -2 and -1.6 % or 9, -2 % the first is none, nor is 9.",
            "It is 7.8, or 7.77 ± 0.27, with 0.002 and 9 more.",
            "- A fall by 1.6 %,\n  which is -2 %.",
            "At ν = 0.3 to 1, 50 spheres, 8 seeds: 16 runs failed; h is no axis here.",
            "Sizes 1 : 1.4 or 1:0.5, fig. 12 and eq. (20) by physics 5; `time_step = 0.01`; N1 in 3D.",
            "The paper has 99 %. As in the paper 98 %.",
            "See [below](#second-part): 42.5.",
        ] {
            assert_eq!(missing(prose), Vec::<String>::new(), "{prose}");
        }
    }

    #[test]
    fn numbers_of_no_table_are_named() {
        for (prose, wanted) in [
            ("It is 7.9.", "7.9"),
            ("It is 7.770.", "7.770"),
            ("It is 7.77 ± 0.28.", "7.77 ± 0.28"),
            // Of another kind or sign.
            ("A rise by +1.6 %.", "+1.6"),
            ("A fall by 7.8 %.", "7.8"),
            ("It is 1.64.", "1.64"),
            // No value of that axis, and none that goes on with its list.
            ("At ν = 0.5.", "0.5"),
            ("At ν = 0.3, 12 are left.", "12"),
            ("With 60 spheres.", "60"),
            ("In 5 runs.", "5"),
            ("Of another section: 42.5.", "42.5"),
            (
                "Others differ. The paper, beside ours, has 99.",
                "\"ours\" in a sentence that quotes others",
            ),
            ("As the paper says 98.", "98"),
            ("About 10⁴ or 2.", "10⁴"),
        ] {
            assert_eq!(
                missing(prose).first().map(String::as_str),
                Some(wanted),
                "{prose}"
            );
        }
    }
}
