//! Numbers quoted in sentences, held against the tables beside them.
//!
//! Every number in a sentence must stand in a table of its section, or of a section or page that the sentence links to: to three digits or
//! more, or to those that the table has; a share in per cent as one in per cent, `7.0 ± 0.3` as a number with that interval, a sign if
//! there is one. Not looked for are
//!
//! - sentences that begin with one of [`OUTSIDE`]: they quote others, and may not speak of ours;
//! - `symbol = number` (and a list that follows, `c = 0.70, 0.72 and 0.74`) where the campaigns of the section have these values on that
//!   axis; likewise `200 spheres`, and `8 seeds` or `runs` as a point has them;
//! - ratios of sizes written as `1 : 1.4`, numbers of figures, equations and versions of the physics, names, and what is set as code.
//!
//! Other pages are held to the same where a sentence of theirs links to the page of results.
//!
//! What this cannot see is a number that stands in another cell than the one that is meant.

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

/// The lines of tables in a text.
fn table_lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| line.starts_with('|'))
}

/// A sentence, and where its links lead.
struct Sentence {
    words: String,
    links: Vec<String>,
}

/// The sentences of a text: without tables, headings, comments and code.
fn sentences(text: &str) -> Vec<Sentence> {
    let mut all = Vec::new();
    let mut paragraph = String::new();
    let mut is_fenced = false;
    for line in text.lines().chain([""]) {
        let is_fence = line.starts_with("```");
        let is_prose = !is_fenced && !is_fence && !line.starts_with(['|', '#', '<']);
        is_fenced ^= is_fence;
        let begins = line.is_empty() || line.starts_with("- ") || !is_prose;
        if begins && !paragraph.is_empty() {
            all.extend(split(&std::mem::take(&mut paragraph)));
        }
        if is_prose && !line.is_empty() {
            paragraph.push_str(line.trim_start_matches("- ").trim());
            paragraph.push(' ');
        }
    }
    all
}

/// Sentences of a paragraph: after a full stop another begins with a capital letter or a quotation.
fn split(paragraph: &str) -> Vec<Sentence> {
    let mut text = String::new();
    for (at, part) in paragraph.split('`').enumerate() {
        text.push_str(if at % 2 == 0 { part } else { "CODE" });
    }
    let mut all = Vec::new();
    let (mut rest, mut from) = (text.trim(), 0);
    while let Some(found) = rest[from..].find(". ") {
        let end = from + found + 1;
        let next = rest[end..]
            .trim_start_matches([' ', '*', '['])
            .chars()
            .next();
        if next.is_some_and(|c| c.is_uppercase() || c == '"') {
            all.push(sentence(&rest[..end]));
            (rest, from) = (rest[end..].trim_start(), 0);
        } else {
            from = end;
        }
    }
    all.push(sentence(rest));
    all
}

/// A sentence without marks of emphasis, and with its links apart.
fn sentence(text: &str) -> Sentence {
    let mut parts = text.split("](");
    let mut words = parts.next().unwrap_or_default().to_owned();
    let mut links = Vec::new();
    for part in parts {
        let (link, after) = part.split_once(')').unwrap_or((part, ""));
        links.push(link.to_owned());
        words.push_str(after);
    }
    Sentence {
        words: words.replace("**", "").replace('[', ""),
        links,
    }
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
    // Whole numbers after a word such as `figures`, and those that go on with its list.
    let mut cited = vec![false; all.len()];
    for at in 0..all.len() {
        let lower = before(at).to_lowercase();
        let in_list = at > 0 && cited[at - 1] && is_joined(at - 1) && is_plain(at);
        let is_cited = in_list || REFERENCES.iter().any(|word| lower.ends_with(word));
        cited[at] = is_cited && all[at].last == 0;
    }
    let is_ratio = |one: usize, two: usize| {
        two < all.len() && sentence[all[one].end..all[two].start].trim_matches(' ') == ":"
    };
    let of_sizes = |at: usize| is_ratio(at, at + 1) || at > 0 && is_ratio(at - 1, at);
    let is_known = |at: &usize| {
        let number = &all[*at];
        cited[*at]
            || of_sizes(*at)
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
        let own = Known::of(&[section.text], folder)?;
        for sentence in sentences(section.text) {
            let mut unknown = unknown(&sentence.words, &own);
            if !unknown.is_empty() && !sentence.links.is_empty() {
                let mut texts = vec![section.text.to_owned()];
                for link in &sentence.links {
                    texts.extend(linked(link, &all, folder)?);
                }
                let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
                unknown = self::unknown(&sentence.words, &Known::of(&texts, folder)?);
            }
            let place = section.title;
            let told = unknown
                .iter()
                .map(|number| format!("{place}: {number} in {:?}", sentence.words));
            missing.extend(told);
        }
    }
    Ok(missing)
}

/// The section or the page of this folder that a link leads to, if it leads to one.
fn linked(link: &str, all: &[Section<'_>], folder: &Path) -> Result<Option<String>, String> {
    if let Some(wanted) = link.strip_prefix('#') {
        let section = all.iter().find(|section| anchor(section.title) == wanted);
        let section = section.ok_or_else(|| format!("no section is linked by {link}"))?;
        return Ok(Some(section.text.to_owned()));
    }
    match link.split_once(".md") {
        Some((file, _)) if !file.contains("..") => {
            let page = std::fs::read_to_string(folder.join(format!("{file}.md")));
            page.map(Some).map_err(|error| format!("{link}: {error}"))
        }
        _ => Ok(None),
    }
}

/// Numbers in sentences of another page that link to this one, to a section of it or as a whole, and in no table there.
pub(crate) fn not_found_from(
    other: &str,
    place: &str,
    page: &str,
    folder: &Path,
) -> Result<Vec<String>, String> {
    let all = sections(page);
    let mut missing = Vec::new();
    for sentence in sentences(other) {
        let mut texts = Vec::new();
        for link in &sentence.links {
            match link.strip_prefix(place) {
                Some("") => texts.push(page.to_owned()),
                Some(section) => texts.extend(linked(section, &all, folder)?),
                None => {}
            }
        }
        if texts.is_empty() {
            continue;
        }
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        let unknown = unknown(&sentence.words, &Known::of(&texts, folder)?);
        let told = unknown
            .iter()
            .map(|number| format!("{number} in {:?}", sentence.words));
        missing.extend(told);
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
             | 0.3 | 7.77 ± 0.27 |\n| 1 | -1.64 % |\n| 2 | 0.0016 (9) |\n| 3 | 12.34 |\n<!-- end -->\n\n## Second part\n\n| 42.5 |\n"
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
            "Of 7.77, -1.64 and -1.64 % or 9, -1.64 % the first is none, nor is 9.",
            "It is 7.77, or 7.8 ± 0.3, with 0.0016 and 9 more; 12.3 is 12.34.",
            "- A fall by 1.64 %,\n  which is -1.64 %.",
            "At ν = 0.3 to 1, 50 spheres, 8 seeds: 16 runs failed; h is no axis here.",
            "Sizes 1 : 1.4 or 1:0.5, fig. 12 and eq. (20) by physics 5; `time_step = 0.01`; N1 in 3D.",
            "The paper has 99 %. As in the paper 98 %.",
            "See [below](#second-part): 42.5.",
        ] {
            assert_eq!(missing(prose), Vec::<String>::new(), "{prose}");
        }
    }

    #[test]
    fn other_pages_quote_what_they_link_to() {
        let folder = tempfile::tempdir().unwrap();
        let page = "# Page\n\n## First\n\n| 7.77 % |\n\n## Second\n\n| 42.5 |\n";
        let missing = |other: &str| not_found_from(other, "p/README.md", page, folder.path());
        for other in [
            "By 7.77 % ([there](p/README.md#first)). Others have 99.",
            "From 42.5 by 7.77 % ([there](p/README.md)).",
        ] {
            assert_eq!(missing(other), Ok(Vec::new()), "{other}");
        }
        let found = missing("By 42.5 ([there](p/README.md#first)).").unwrap();
        assert!(
            found.len() == 1 && found[0].starts_with("42.5 in "),
            "{found:?}"
        );
        assert!(missing("By 1 ([there](p/README.md#third)).").is_err());
    }

    #[test]
    fn numbers_of_no_table_are_named() {
        for (prose, wanted) in [
            ("It is 7.78.", "7.78"),
            ("It is 12.4.", "12.4"),
            // Two digits of three, or of four, could be those of many others.
            ("It is 7.8.", "7.8"),
            ("It is 12.", "12"),
            ("It is 7.770.", "7.770"),
            ("It is 7.77 ± 0.28.", "7.77 ± 0.28"),
            // Of another kind or sign.
            ("A rise by +1.64 %.", "+1.64"),
            ("A fall by 7.77 %.", "7.77"),
            ("It is 1.64.", "1.64"),
            // No value of that axis, and none that goes on with its list.
            ("At ν = 0.5.", "0.5"),
            ("At ν = 0.3, 12 are left.", "12"),
            ("With 60 spheres.", "60"),
            ("In 5 runs.", "5"),
            ("Sizes 1 : 1.4, 201 spheres.", "201"),
            ("In figures 2 to 5, 7.78.", "7.78"),
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
