//! Every command of the documentation, run as it is written; links, anchors and the pages of the
//! book.
//!
//! Of each file the fenced blocks marked `sh` are run in order by `sh -eu`, in a directory of their
//! own, with campaigns shortened. ```` ```sh needs=PROGRAM,… ```` is run where these programs are
//! installed (`python:MODULE` for a module of Python), and named as skipped elsewhere.
//! `cargo run --release --` is the program under test; other commands of cargo are not run, and
//! only checked for naming tests, examples and benches that exist.

use crate::harness::root;
use std::fmt::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

/// What stands for cargo.
const CARGO: &str = r#"#!/bin/sh
case "$*" in
"run --release -- "*) shift 3; exec sweep "$@" ;;
esac
case "$1" in
build | test | bench | run | fmt | clippy | doc) ;;
*) echo "cargo $* is not known here" >&2; exit 9 ;;
esac
while [ $# -gt 0 ]; do
    case "$1" in
    --test) folder=tests ;;
    --example) folder=examples ;;
    --bench) folder=benches ;;
    *) shift; continue ;;
    esac
    ls "$ROOT"/crates/*/"$folder/$2.rs" "$ROOT"/crates/*/"$folder/$2/main.rs" 2> /dev/null | grep -q . ||
        { echo "cargo $1 $2: no such file" >&2; exit 9; }
    shift
done
"#;

/// The fenced blocks of a kind: what follows the kind in the first line, and the text.
fn blocks(markdown: &str, kind: &str) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let mut lines = markdown.lines();
    while let Some(line) = lines.next() {
        let Some(info) = line.trim_start().strip_prefix("```") else {
            continue;
        };
        let text: Vec<&str> = lines
            .by_ref()
            .take_while(|line| line.trim() != "```")
            .collect();
        let (word, rest) = info.split_once(' ').unwrap_or((info, ""));
        if word == kind {
            all.push((rest.trim().to_owned(), text.join("\n") + "\n"));
        }
    }
    all
}

/// Whether a program, or a module of Python, is installed.
fn is_there(program: &str) -> bool {
    let command = match program.strip_prefix("python:") {
        Some(module) => format!("python3 -c 'import {module}'"),
        None => format!("command -v {program}"),
    };
    let output = Command::new("sh").args(["-c", &command]).output();
    output.unwrap().status.success()
}

fn write_program(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// A directory as a reader of the documentation has it, but for its size: campaigns are shorter,
/// scripts do nothing.
fn checkout() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    for folder in ["bin", "sweeps", "scripts", "results", "home"] {
        std::fs::create_dir(at.join(folder)).unwrap();
    }
    write_program(&at.join("bin/cargo"), CARGO);
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_sweep"), at.join("bin/sweep")).unwrap();
    for entry in std::fs::read_dir(root().join("scripts")).unwrap() {
        let name = entry.unwrap().file_name();
        write_program(&at.join("scripts").join(name), "#!/bin/sh\n");
    }
    std::os::unix::fs::symlink(root().join("crates"), at.join("crates")).unwrap();
    let quickstart = std::fs::read_to_string(root().join("sweeps/quickstart.toml")).unwrap();
    let short = shortened(&quickstart);
    assert_ne!(short, quickstart);
    std::fs::write(at.join("sweeps/quickstart.toml"), short).unwrap();
    directory
}

/// A campaign as the tutorial has them, with shorter runs; also where a command writes its file.
fn shortened(text: &str) -> String {
    text.replace("strain = 4.0", "strain = 0.3")
        .replace("discard = 1.0", "discard = 0.0")
        .replace("seeds = 8 ", "seeds = 2 ")
}

/// Runs all commands of one file; panics on the first that fails.
fn run(file: &str) {
    let markdown = std::fs::read_to_string(root().join(file)).unwrap();
    let directory = checkout();
    let mut script = String::new();
    for (info, text) in blocks(&markdown, "sh") {
        let needs = info.strip_prefix("needs=").unwrap_or_default();
        match needs.split(',').find(|p| !p.is_empty() && !is_there(p)) {
            Some(missing) => eprintln!("skipped in {file}, no {missing}:\n{text}"),
            None => script.push_str(&shortened(&text)),
        }
    }
    let mut path = directory.path().join("bin").into_os_string();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let output = Command::new("sh")
        .args(["-eux", "-c", &script])
        .current_dir(directory.path())
        .env("PATH", path)
        .env("ROOT", root())
        .env("HOME", directory.path().join("home"))
        .env_remove("XDG_CACHE_HOME")
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{file}: {}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Files of the documentation.
fn files() -> Vec<String> {
    let mut all = vec!["README.md".to_owned(), "CONTRIBUTING.md".to_owned()];
    for entry in std::fs::read_dir(root().join("docs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "md") {
            let name = path.file_name().unwrap().to_str().unwrap();
            all.push(format!("docs/{name}"));
        }
    }
    all.sort();
    all
}

#[test]
fn help_names_only_files_that_exist() {
    use clap::CommandFactory as _;
    let mut missing = String::new();
    for mut subcommand in sweep::cli::Cli::command().get_subcommands().cloned() {
        let help = subcommand.render_long_help().to_string();
        let ends = |c: char| c.is_whitespace() || "`'\"),".contains(c);
        for word in help.split(ends).filter(|word| !word.contains("NAME")) {
            // A store or a folder of shards exists once its campaign was run.
            let file = match word
                .strip_prefix("results/")
                .and_then(|name| name.split_once('.'))
            {
                Some((name, _)) => format!("sweeps/{name}.toml"),
                None if word.starts_with("sweeps/") && word.len() > 7 => word.to_owned(),
                None => continue,
            };
            if !root().join(&file).exists() {
                writeln!(missing, "{}: {word}", subcommand.get_name()).unwrap();
            }
        }
    }
    assert!(missing.is_empty(), "{missing}");
}

#[test]
fn every_command_runs() {
    let threads: Vec<_> = files()
        .into_iter()
        .map(|file| std::thread::spawn(move || run(&file)))
        .collect();
    let failed = threads.into_iter().filter_map(|t| t.join().err()).count();
    assert_eq!(failed, 0, "files with commands that fail, see above");
}

/// Lines of comments wider than 100 columns, without code blocks, tables and aligned columns.
fn wide_comments(text: &str, marker: &str) -> Vec<usize> {
    let mut wide = Vec::new();
    let mut in_fence = false;
    for (line, number) in text.lines().zip(1..) {
        let Some(comment) = line.trim_start().strip_prefix(marker) else {
            in_fence = false;
            continue;
        };
        let comment = comment.trim_start_matches(['/', '!']).trim_end();
        let comment = comment.strip_prefix(' ').unwrap_or(comment);
        in_fence ^= comment.starts_with("```");
        let is_laid_out = in_fence || comment.starts_with('|') || comment.contains("  ");
        if line.chars().count() > 100 && !is_laid_out {
            wide.push(number);
        }
    }
    wide
}

/// Lines of prose wider than 100 columns: of Markdown without code blocks, tables, HTML and links.
fn wide_prose(text: &str) -> Vec<usize> {
    let mut wide = Vec::new();
    let mut in_fence = false;
    for (line, number) in text.lines().zip(1..) {
        in_fence ^= line.trim_start().starts_with("```");
        let is_prose = !in_fence && !line.trim_start().starts_with(['|', '<', '!', '[']);
        if is_prose && line.chars().count() > 100 {
            wide.push(number);
        }
    }
    wide
}

#[test]
fn comments_and_prose_have_at_most_100_columns() {
    let mut wide = String::new();
    // A page that a script writes.
    let exempt = ["results/published/performance.md"];
    let names = ["crates", "python", "scripts", "sweeps", "docs", "results"];
    let mut paths: Vec<std::path::PathBuf> = names.map(|name| root().join(name)).into();
    paths.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root().join(name)));
    while let Some(path) = paths.pop() {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        if path.ends_with("target") || exempt.iter().any(|part| name.starts_with(part)) {
            continue;
        }
        if path.is_dir() {
            let entries = std::fs::read_dir(path).unwrap();
            paths.extend(entries.map(|entry| entry.unwrap().path()));
            continue;
        }
        let kind = path.extension().and_then(std::ffi::OsStr::to_str);
        if !matches!(kind, Some("rs" | "py" | "toml" | "md") | None) {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let lines = match kind {
            Some("rs") => wide_comments(&text, "//"),
            Some("md") => wide_prose(&text),
            _ => wide_comments(&text, "#"),
        };
        for line in lines {
            writeln!(wide, "{name}:{line}").unwrap();
        }
    }
    assert!(wide.is_empty(), "lines wider than 100 columns:\n{wide}");
}

/// The lines on which documentation begins with a reference to other documentation, which editors
/// and rustdoc do not show beside it.
fn leaning_comments(text: &str) -> Vec<usize> {
    const BEGINNINGS: [&str; 4] = ["The same", "As there", "The other", "The reverse"];
    let mut leaning = Vec::new();
    let mut before = "";
    for (line, number) in text.lines().zip(1..) {
        let line = line.trim_start();
        let begins = |marker: &str| {
            let words = line.strip_prefix(marker).unwrap_or_default().trim_start();
            !before.starts_with(marker) && BEGINNINGS.iter().any(|known| words.starts_with(known))
        };
        if begins("///") || begins("//!") {
            leaning.push(number);
        }
        before = line;
    }
    leaning
}

#[test]
fn documentation_stands_alone() {
    assert_eq!(
        leaning_comments("/// One.\n/// The same.\n\n    /// The same.\n"),
        [4]
    );
    let mut leaning = String::new();
    let mut paths = ["sd-core", "sweep"]
        .map(|folder| root().join("crates").join(folder))
        .to_vec();
    while let Some(path) = paths.pop() {
        if path.is_dir() {
            let entries = std::fs::read_dir(path).unwrap();
            paths.extend(entries.map(|entry| entry.unwrap().path()));
        } else if has_extension(&path.display().to_string(), "rs") {
            for line in leaning_comments(&std::fs::read_to_string(&path).unwrap()) {
                writeln!(leaning, "{}:{line}", path.display()).unwrap();
            }
        }
    }
    assert!(
        leaning.is_empty(),
        "documentation that does not stand alone:\n{leaning}"
    );
}

#[test]
fn every_campaign_is_one() {
    for file in files() {
        let markdown = std::fs::read_to_string(root().join(&file)).unwrap();
        for (_, text) in blocks(&markdown, "toml") {
            if !text.contains("[[grid]]") {
                continue;
            }
            let directory = tempfile::tempdir().unwrap();
            let at = directory.path().join("campaign.toml");
            std::fs::write(&at, &text).unwrap();
            let read = sweep::campaign::read(&at);
            let campaign = match read {
                Ok(campaign) => campaign,
                Err(error) => panic!("{file}: {error}\n{text}"),
            };
            // A block that names a file in its first line is that file, but for what it says
            // beside.
            let name = text.lines().next().unwrap_or_default();
            if let Some(name) = name.strip_prefix("# sweeps/") {
                let there = sweep::campaign::read(&root().join("sweeps").join(name)).unwrap();
                assert_eq!(campaign.cases, there.cases, "{file} and {name}");
                assert_eq!(campaign.protocol, there.protocol, "{file} and {name}");
            }
        }
    }
}

/// Whether a file's name ends in a dot and this.
fn has_extension(name: &str, extension: &str) -> bool {
    Path::new(name)
        .extension()
        .is_some_and(|found| found == extension)
}

/// Pages whose links are checked: those of the documentation, and the others that a reader meets.
fn linked_files() -> Vec<String> {
    let mut all = files();
    all.extend(
        [
            "CHANGELOG.md",
            "python/README.md",
            "crates/sd-core/tests/data/README.md",
        ]
        .map(str::to_owned),
    );
    let published = std::fs::read_dir(root().join("results/published")).unwrap();
    let names = published.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let pages = names.filter(|name| has_extension(name, "md"));
    all.extend(pages.map(|name| format!("results/published/{name}")));
    all
}

/// The anchors of a page: its headings in lower case, with `-` for spaces and without punctuation.
fn anchors(markdown: &str) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let mut in_fence = false;
    for line in markdown.lines() {
        in_fence ^= line.starts_with("```");
        let heading = line.trim_start_matches('#');
        if in_fence || heading == line || !heading.starts_with(' ') {
            continue;
        }
        let kept = heading.trim().to_lowercase();
        let kept = kept.replace(|c: char| !(c.is_alphanumeric() || " -_".contains(c)), "");
        let anchor = kept.replace(' ', "-");
        let before = all.iter().filter(|other| **other == anchor).count();
        all.push(if before == 0 {
            anchor
        } else {
            format!("{anchor}-{before}")
        });
    }
    all
}

/// What the links and pictures of a page lead to, but for addresses of the web.
fn targets(markdown: &str) -> Vec<String> {
    let mut prose = String::new();
    let mut in_fence = false;
    for line in markdown.lines() {
        in_fence ^= line.trim_start().starts_with("```");
        if !in_fence {
            prose.push_str(line);
            prose.push(' ');
        }
    }
    let links = prose.split("](").skip(1);
    let all = links.chain(prose.split("src=\"").skip(1));
    all.map(|link| link.split([')', ' ', '"']).next().unwrap_or_default())
        .filter(|target| !target.contains("://"))
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_link_leads_somewhere() {
    let mut broken = String::new();
    for file in linked_files() {
        let markdown = std::fs::read_to_string(root().join(&file)).unwrap();
        let folder = root().join(&file).parent().unwrap().to_owned();
        for target in targets(&markdown) {
            let (path, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let there = if path.is_empty() {
                root().join(&file)
            } else {
                folder.join(path)
            };
            let is_page = has_extension(path, "md") || path.is_empty();
            let found = there.exists()
                && (anchor.is_empty()
                    || !is_page
                    || anchors(&std::fs::read_to_string(&there).unwrap())
                        .contains(&anchor.to_owned()));
            if !found {
                writeln!(broken, "{file}: {target}").unwrap();
            }
        }
    }
    assert!(broken.is_empty(), "{broken}");
}

#[test]
fn the_book_has_every_page_once() {
    let summary = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let mut listed = targets(&summary);
    listed.sort();
    let pages = files().into_iter();
    let pages = pages.filter_map(|file| file.strip_prefix("docs/").map(str::to_owned));
    let pages: Vec<String> = pages.filter(|page| page != "SUMMARY.md").collect();
    assert_eq!(listed, pages);
}

#[test]
fn pages_named_in_sources_exist() {
    let mut missing = String::new();
    let mut folders: Vec<std::path::PathBuf> = ["crates", "python", "sweeps", "scripts"]
        .map(|name| root().join(name))
        .into();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.extend((!path.ends_with("target")).then_some(path));
                continue;
            }
            // Pictures and the like name no pages.
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            for named in text.split("docs/").skip(1) {
                let end = named.find(|c: char| !(c.is_alphanumeric() || "-_.".contains(c)));
                let name = named[..end.unwrap_or(named.len())].trim_end_matches('.');
                if has_extension(name, "md") && !root().join("docs").join(name).exists() {
                    writeln!(missing, "{}: docs/{name}", path.display()).unwrap();
                }
            }
        }
    }
    assert!(missing.is_empty(), "{missing}");
}

#[test]
fn tests_named_on_the_page_of_validation_exist() {
    let page = std::fs::read_to_string(root().join("docs/validation.md")).unwrap();
    let mut found = 0;
    for row in page
        .lines()
        .filter(|line| line.starts_with('|') && line.contains(".rs`"))
    {
        let mut words = row.split('`').skip(1).step_by(2);
        let file = words.find(|word| has_extension(word, "rs")).unwrap();
        let source = std::fs::read_to_string(root().join("crates").join(file)).unwrap();
        for name in words {
            assert!(source.contains(&format!("fn {name}(")), "{file}: {name}");
            found += 1;
        }
    }
    assert!(found > 20, "{found} tests are named");
}

#[test]
fn every_subcommand_has_examples_that_are_commands() {
    use clap::{CommandFactory as _, Parser as _};
    for subcommand in sweep::cli::Cli::command().get_subcommands() {
        let name = subcommand.get_name();
        let helps = [
            subcommand.get_after_help(),
            subcommand.get_after_long_help(),
        ];
        let helps = helps.map(|help| help.map(ToString::to_string).unwrap_or_default());
        let help = helps.join("\n");
        let examples: Vec<&str> = help
            .lines()
            .map(|line| line.trim_start_matches("Example:").trim())
            .flat_map(|line| line.split(" | ").flat_map(|part| part.split(" && ")))
            .filter_map(|command| command.split(" > ").next())
            .filter(|command| command.starts_with("sweep "))
            .collect();
        let own = format!("sweep {name}");
        assert!(
            examples.iter().any(|example| example.starts_with(&own)),
            "{name} has no example"
        );
        for example in examples {
            let parsed = sweep::cli::Cli::try_parse_from(example.split_whitespace());
            assert!(parsed.is_ok(), "{example}: {:?}", parsed.err());
        }
    }
}
