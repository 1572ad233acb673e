//! The generated pages of the reference: keys of a grid, columns of tables, commands.
//!
//! Each page is made here from what the program declares and compared with the file in `docs`.
//! `UPDATE_REFERENCE=1 cargo test --release -p sweep --test integration reference` writes the files
//! after a change of a declaration.

use crate::harness::{campaign, folder, refused, root, sweep};
use clap::builder::StyledStr;
use clap::{ArgAction, CommandFactory as _};
use sd_core::Params;
use sd_core::model::Form;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use sweep::model::axes::AXES;

/// What every generated page says below its title.
const ORIGIN: &str = "<!-- Generated: UPDATE_REFERENCE=1 cargo test --release -p sweep --test integration reference -->";

/// Compares a page with its file, or writes it.
fn check(name: &str, page: &str) {
    let path = root().join("docs").join(name);
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&path, page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let line = written.lines().zip(page.lines()).position(|(a, b)| a != b);
    let hint = "is not what the declarations give; set UPDATE_REFERENCE=1 to write it";
    assert!(written == page, "docs/{name}, after line {line:?}, {hint}");
}

/// Text for a cell of a table.
fn cell(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let text = words.join(" ").replace('|', "\\|");
    let text = text.replace("<=", "≤").replace('<', "&lt;");
    text.trim_end_matches('.').to_owned()
}

/// Paragraphs broken to lines of 100 characters.
fn wrapped(text: &str) -> String {
    let options = textwrap::Options::new(100)
        .break_words(false)
        .word_splitter(textwrap::WordSplitter::NoHyphenation);
    let paragraphs = text.split("\n\n");
    let wrapped: Vec<String> = paragraphs
        .map(|paragraph| textwrap::fill(&paragraph.replace('\n', " "), &options))
        .collect();
    wrapped.join("\n\n")
}

/// The parameters of cases that choose differently, for defaults that follow from other keys.
fn cases() -> Vec<Params> {
    let grids = "[[grid]]\narea_fraction = 0.5\nfriction = 0.5\nroughness = [0.01, 0.02]\nshear_rate = 1.0\nseeds = 1\n\
                 spheres = 30\ncontact = [\"rigid\", \"linear-spring\"]\nstiffness = 1e4\ntangential = \"stick-slide\"\n\
                 [[grid]]\narea_fraction = 0.5\nfriction = 0\nroughness = 0.01\nshear_rate = 1.0\nseeds = 1\nspheres = 30\n\
                 contact = \"exponential-repulsion\"\n\
                 [[grid]]\narea_fraction = 0.5\nfriction = 0.5\nroughness = 0.01\nshear_rate = 1.0\nseeds = 1\nspheres = 30\n\
                 hydrodynamics = \"lubrication\"\n";
    let folder = folder("c.toml", campaign("defaults", [1.0, 0.0], grids));
    let read = sweep::campaign::read(&folder.path().join("c.toml"));
    let cases = read.unwrap().cases;
    cases.iter().map(|case| case.1.params.clone()).collect()
}

#[test]
fn keys_are_those_declared() {
    let cases = cases();
    let mut page = format!("# Keys of a grid\n\n{ORIGIN}\n\n");
    page.push_str(
        "Each key of `[[grid]]` takes a value or a list of values. [The campaign file](campaign-file.md)\n\
         explains them, with `seeds` and the keys of `[protocol]`. The symbol heads the columns of tables.\n\n\
         ## Numbers\n\n| key | symbol | unit | range | default | meaning |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    let mut words = String::new();
    for axis in AXES.iter() {
        let key = axis.written_key().unwrap_or(axis.key);
        match &axis.form {
            Form::Number(number) => {
                let quantity = number.quantity;
                let mut defaults: Vec<String> = Vec::new();
                // Cases in which the key has an effect; if there is none, any case.
                let has_effect = |case: &&Params| axis.means_something(case);
                let mut chosen: Vec<&Params> = cases.iter().filter(has_effect).collect();
                if chosen.is_empty() {
                    chosen.push(&cases[0]);
                }
                for case in chosen {
                    let default = number.default.map(|default| default(case));
                    let default = default.filter(|default| quantity.range.contains(*default));
                    let text = default.map(|default| default.to_string());
                    defaults.extend(text.filter(|text| !defaults.contains(text)));
                }
                let default = match &defaults[..] {
                    [] => "–",
                    [one] => one,
                    _ => "follows from other keys",
                };
                let mut range = quantity.range.to_string();
                if number.whole {
                    range.push_str(", whole");
                }
                if !quantity.note.is_empty() {
                    write!(range, "; {}", quantity.note).unwrap();
                }
                writeln!(
                    page,
                    "| `{key}` | {} | {} | {} | {default} | {} |",
                    cell(axis.symbol()),
                    cell(axis.unit),
                    cell(&range),
                    cell(axis.meaning)
                )
                .unwrap();
            }
            Form::Choice(choice) => {
                writeln!(words, "\n### `{key}`\n").unwrap();
                writeln!(
                    words,
                    "{}; by default `{}`.\n",
                    axis.meaning, choice.default
                )
                .unwrap();
                words.push_str("| word | meaning |\n| --- | --- |\n");
                for word in (choice.words)() {
                    writeln!(words, "| `{}` | {} |", word.word, cell(word.meaning)).unwrap();
                }
            }
        }
    }
    page.push_str("\n## Choices\n");
    page.push_str(&words);
    check("reference-keys.md", &page);
}

/// Name, unit and meaning of each column, by the file with the units of a table.
fn columns(at: &Path, file: &str) -> Vec<[String; 3]> {
    let mut reader = csv::Reader::from_path(at.join(file)).unwrap();
    let rows = reader.records().map(Result::unwrap);
    rows.map(|row| [0, 1, 2].map(|k| row[k].to_owned()))
        .collect()
}

#[test]
fn columns_are_those_of_tables() {
    let grid = "[[grid]]\narea_fraction = 0.5\nfriction = 0.5\nroughness = 0.01\nshear_rate = 1.0\nseeds = 1\nspheres = 30\n\
                hydrodynamics = \"ball-melrose\"\n";
    let folder = folder("c.toml", campaign("columns", [0.1, 0.0], grid));
    let at = folder.path();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    let tables = [
        "--csv",
        "points.csv",
        "--runs",
        "runs.csv",
        "--samples",
        "samples.csv",
    ];
    sweep(at, &[&["report", "s.sqlite", "-q"][..], &tables].concat());
    let mut page = format!("# Columns of tables\n\n{ORIGIN}\n\n");
    page.push_str(
        "CSV, Parquet and JSON use these names. The columns of the axes stand first; [Keys of a\n\
         grid](reference-keys.md) lists them. Units are those of a = μ = shear rate = 1, unless `--units` is\n\
         given. A column `NAME_ci95` is half the width of the 95 % Student interval of `NAME` over runs.\n",
    );
    for (title, file) in [
        ("Points: `sweep report --csv`", "points.units.csv"),
        ("Runs: `sweep report --runs`", "runs.units.csv"),
        ("Samples: `sweep report --samples`", "samples.units.csv"),
    ] {
        write!(
            page,
            "\n## {title}\n\n| column | unit | meaning |\n| --- | --- | --- |\n"
        )
        .unwrap();
        for [name, unit, meaning] in columns(at, file) {
            let is_interval = name.ends_with("_ci95") && meaning.contains("Student");
            let is_axis = AXES.iter().any(|axis| axis.key == name);
            if !is_interval && (!is_axis || title.starts_with("Samples")) {
                writeln!(page, "| `{name}` | {} | {} |", cell(&unit), cell(&meaning)).unwrap();
            }
        }
    }
    check("reference-columns.md", &page);
}

/// A styled text without its styles.
fn plain(text: Option<&StyledStr>) -> String {
    text.map(ToString::to_string).unwrap_or_default()
}

/// The row of an argument.
fn row(argument: &clap::Arg) -> String {
    let values: Vec<String> = argument
        .get_value_names()
        .unwrap_or_default()
        .iter()
        .map(|name| format!("<{name}>"))
        .collect();
    let mut names: Vec<String> = Vec::new();
    names.extend(argument.get_short().map(|short| format!("-{short}")));
    names.extend(argument.get_long().map(|long| format!("--{long}")));
    let mut name = names.join(", ");
    if names.is_empty() || argument.get_action().takes_values() {
        names = vec![name];
        names.extend(values);
        name = names.join(" ").trim().into();
    }
    let help = argument.get_long_help().or(argument.get_help());
    let mut meaning = cell(&plain(help));
    let possible = argument.get_possible_values();
    if argument.get_action().takes_values() && !argument.is_hide_possible_values_set() {
        for value in &possible {
            let help = cell(&plain(value.get_help()));
            let help = if help.is_empty() {
                help
            } else {
                format!(": {help}")
            };
            write!(meaning, "<br>`{}`{help}", value.get_name()).unwrap();
        }
    }
    let defaults: Vec<_> = argument
        .get_default_values()
        .iter()
        .map(|value| value.to_string_lossy())
        .collect();
    if !defaults.is_empty()
        && !matches!(argument.get_action(), ArgAction::SetTrue | ArgAction::Count)
    {
        write!(meaning, "<br>default: `{}`", defaults.join(" ")).unwrap();
    }
    format!("| `{}` | {meaning} |\n", name.replace('|', "\\|"))
}

#[test]
fn commands_are_those_of_the_program() {
    let mut program = sweep::cli::Cli::command();
    let mut page = format!("# Commands\n\n{ORIGIN}\n\n");
    page.push_str("`sweep COMMAND --help` prints the same.\n\n");
    let names: Vec<(String, String)> = program
        .get_subcommands()
        .map(|command| (command.get_name().to_owned(), plain(command.get_about())))
        .collect();
    page.push_str("| command | |\n| --- | --- |\n");
    for (name, about) in &names {
        writeln!(page, "| [`{name}`](#sweep-{name}) | {} |", cell(about)).unwrap();
    }
    page.push_str("\n## Options of every command\n\n| option | meaning |\n| --- | --- |\n");
    for argument in program
        .get_arguments()
        .filter(|argument| argument.is_global_set())
    {
        page.push_str(&row(argument));
    }
    page.push_str("\n## Exit codes\n\n```text\n");
    writeln!(page, "{}\n```", plain(program.get_after_help())).unwrap();
    for (name, _) in &names {
        let command = program.find_subcommand_mut(name).unwrap();
        let about = plain(command.get_long_about().or(command.get_about()));
        write!(page, "\n## `sweep {name}`\n\n{}\n", wrapped(&about)).unwrap();
        // By their headings; those without one come first.
        let mut groups: BTreeMap<&str, Vec<&clap::Arg>> = BTreeMap::new();
        for argument in command.get_arguments() {
            if !argument.is_hide_set() && !argument.is_global_set() {
                let heading = argument.get_help_heading().unwrap_or_default();
                groups.entry(heading).or_default().push(argument);
            }
        }
        for (heading, arguments) in groups {
            let heading = if heading.is_empty() {
                "argument"
            } else {
                heading
            };
            write!(page, "\n| {heading} | meaning |\n| --- | --- |\n").unwrap();
            for argument in arguments {
                page.push_str(&row(argument));
            }
        }
        write!(
            page,
            "\n```text\n{}\n```\n",
            plain(command.get_after_help()).trim_end()
        )
        .unwrap();
    }
    check("reference-commands.md", &page);
}

#[test]
fn every_key_is_explained() {
    let text = "name = \"k\"\n[protocol]\nk = 1\n[[protocol.segment]]\nstrain = 1.0\nk = 1\n\
                oscillation = { amplitude = 0.5, cycles = 3, k = 1 }\ncross_shear = { amplitude = 0.05, ratio = 20, k = 1 }\n\
                [[grid]]\nk = 1\nseeds = { precision = 0.05, k = 1 }\n";
    let folder = folder("c.toml", text);
    let errors = refused(folder.path(), &["plan", "c.toml"]);
    let pages = ["campaign-file.md", "protocols.md", "reference-keys.md"];
    let explained: String = pages
        .iter()
        .map(|page| std::fs::read_to_string(root().join("docs").join(page)).unwrap())
        .collect();
    let lists: Vec<&str> = errors.split("keys of ").skip(1).collect();
    assert_eq!(lists.len(), 6, "{errors}");
    for list in lists {
        let (table, keys) = list.split_once(": ").unwrap();
        for key in keys.split(' ') {
            let name = key.trim_end_matches(',');
            assert!(
                explained.contains(&format!("`{name}`")),
                "{name} of {table}"
            );
            if name == key {
                break;
            }
        }
    }
}
