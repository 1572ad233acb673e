//! The command line: bad input, exit codes, output, without long runs.

use crate::harness::{Served, command, program, words};
use assert_cmd::Command;
use std::path::Path;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
strain = 0.1
discard = 0.0
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [0.1, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

fn sweep(directory: &Path) -> Command {
    Command::from_std(program(directory))
}

/// Files below a directory.
fn files(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn bad_campaign_ends_with_2_names_its_place_and_writes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let bad = CAMPAIGN.replace("area_fraction = 0.6", "area_fraction = 0.9");
    std::fs::write(directory.path().join("bad.toml"), bad).unwrap();
    for subcommand in ["run", "plan"] {
        let output = sweep(directory.path())
            .args([subcommand, "bad.toml"])
            .assert()
            .code(2)
            .stdout("");
        let error = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
        for part in [
            "bad.toml:6:17",
            "0.9",
            "at most 0.84",
            "area_fraction = 0.9",
        ] {
            assert!(error.contains(part), "{part} not in {error}");
        }
        assert!(error.lines().count() < 24, "one screen: {error}");
    }
    assert_eq!(files(directory.path()), ["bad.toml"]);
}

#[test]
fn unwritable_store_ends_with_2() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("small.toml"), CAMPAIGN).unwrap();
    for place in [
        "/proc/none/small.sqlite",
        "small.toml/x.sqlite",
        "small.toml",
    ] {
        sweep(directory.path())
            .args(["run", "small.toml", "--store", place])
            .assert()
            .code(2)
            .stdout("");
    }
    assert_eq!(files(directory.path()), ["small.toml"]);
    assert_eq!(
        std::fs::read_to_string(directory.path().join("small.toml")).unwrap(),
        CAMPAIGN
    );
}

#[test]
fn the_true_reason_is_given_where_a_file_is_something_else() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("small.toml"), CAMPAIGN).unwrap();
    sweep(at).args(["run", "small.toml", "-q"]).assert().code(0);
    for (arguments, reason) in [
        (&["report", "."][..], "is a folder, and not a store"),
        (&["status", "results"], "is a folder, and not a store"),
        (
            &["run", "small.toml", "--store", "results"],
            "is a folder, and not a store",
        ),
        (
            &["run", "small.toml", "--store", "/proc/x.sqlite"],
            "cannot write a store at /proc/x.sqlite: the file system there accepts no user files",
        ),
        (
            &["plan", "results/small.sqlite"],
            "this is a store, and not a campaign file",
        ),
        (
            &["report", "results/small.sqlite", "--store", "x.sqlite"],
            "--store: it belongs to a campaign file",
        ),
        (
            &["report", "small.toml", "--store", "none.sqlite"],
            "there is no store at /",
        ),
        (
            &["show", "small.toml", "99999"],
            "\"99999\" is no case of /",
        ),
    ] {
        let output = sweep(at).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let words = words(&output.stderr);
        assert!(words.contains(reason), "{arguments:?}: {words}");
    }
}

#[test]
fn store_is_in_the_project_of_the_file_wherever_one_stands() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::create_dir_all(at.join("sweeps/paper")).unwrap();
    std::fs::create_dir(at.join("elsewhere")).unwrap();
    std::fs::write(at.join("sweeps/paper/small.toml"), CAMPAIGN).unwrap();
    sweep(&at.join("elsewhere"))
        .args(["run", "../sweeps/paper/small.toml", "-q", "-j", "1"])
        .assert()
        .code(0);
    assert!(files(&at.join("elsewhere")).is_empty());
    assert!(at.join("results/small.sqlite").exists());
    let status = |folder: &str, file: &str| {
        let output = sweep(&at.join(folder))
            .args(["status", file, "--json"])
            .output()
            .unwrap();
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["cases"]["done"]
            .clone()
    };
    assert_eq!(status("sweeps", "paper/small.toml"), 4);
    // A single file has its results beside it; --store works wherever a store is read.
    std::fs::write(at.join("elsewhere/small.toml"), CAMPAIGN).unwrap();
    for command in ["report", "status", "merge", "cancel"] {
        let output = sweep(at)
            .args([command, "elsewhere/small.toml"])
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(!at.join("elsewhere/results").exists());
        let store = ["--store", "results/small.sqlite"];
        let shards = (command == "merge").then_some("results/small.sqlite");
        sweep(at)
            .args([command, "elsewhere/small.toml"])
            .args(shards)
            .args(store)
            .assert()
            .code(0);
    }
    for command in ["show", "export", "replay"] {
        let output = sweep(at)
            .args([
                command,
                "elsewhere/small.toml",
                "1",
                "--store",
                "results/small.sqlite",
            ])
            .output()
            .unwrap();
        let missing = words(&output.stderr).contains("there is no store");
        assert!(!missing, "{output:?}");
    }
}

#[test]
fn jobs_is_another_name_of_workers() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("small.toml"), CAMPAIGN).unwrap();
    for name in [
        &["--jobs", "3"][..],
        &["-j3"],
        &["--workers", "3"],
        &["-w3"],
    ] {
        let output = sweep(directory.path())
            .args(["plan", "small.toml", "--json"])
            .args(name)
            .output()
            .unwrap();
        let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(plan["workers"], 3);
    }
}

#[test]
fn a_plan_says_that_its_times_are_those_of_one_thread_where_runs_have_more() {
    let directory = tempfile::tempdir().unwrap();
    let one = CAMPAIGN
        .replace("[0.1, inf]", "inf")
        .replace("seeds = 2", "seeds = 1");
    std::fs::write(directory.path().join("one.toml"), one).unwrap();
    std::fs::write(directory.path().join("four.toml"), CAMPAIGN).unwrap();
    let cores = std::thread::available_parallelism().unwrap().get();
    for (file, expected) in [("one.toml", cores.min(4)), ("four.toml", 1)] {
        let plan = |more: &[&str]| {
            let mut command = sweep(directory.path());
            let output = command.args(["plan", file, "--workers", "4"]).args(more);
            output.output().unwrap().stdout
        };
        let json: serde_json::Value = serde_json::from_slice(&plan(&["--json"])).unwrap();
        assert_eq!(json["threads_per_run"], expected);
        let text = words(&plan(&[]));
        let says = text.contains("wall time is that of one thread per run");
        assert_eq!(says, expected > 1, "{text}");
    }
}

#[test]
fn unwritable_output_ends_with_3_and_a_closed_pipe_with_the_code_of_the_runs() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("small.toml"), CAMPAIGN).unwrap();
    let shell = |line: &str| {
        let line = line.replace("sweep", env!("CARGO_BIN_EXE_sweep"));
        let output = std::process::Command::new("bash")
            .args(["-c", &line])
            .current_dir(at)
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    // Every run takes too long.
    let failing = "sweep run small.toml --max-wall-time 1e-6s --retry-failed 2>&1 | head -n 0; echo ${PIPESTATUS[0]}";
    assert_eq!(shell(failing), "1\n");
    assert_eq!(
        shell("sweep run small.toml --retry-failed 2>&1 | head -n 0; echo ${PIPESTATUS[0]}"),
        "0\n"
    );
    assert_eq!(
        shell("sweep report small.toml > /dev/full 2> /dev/null; echo $?"),
        "3\n"
    );
    assert_eq!(
        shell("sweep report small.toml --csv /dev/full 2> /dev/null; echo $?"),
        "3\n"
    );
}

#[test]
fn addresses_may_be_names() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("small.toml"), CAMPAIGN).unwrap();
    sweep(at).args(["run", "small.toml", "-q"]).assert().code(0);
    let server = Served::start(&mut command(
        at,
        &["serve", "small.toml", "--listen", "localhost:0", "--json"],
    ));
    let address = &server.address;
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    let refused = sweep(at)
        .args(["serve", "small.toml", "--listen", "8420"])
        .output()
        .unwrap();
    assert!(
        words(&refused.stderr).contains("write ADDRESS:PORT"),
        "{refused:?}"
    );
}

#[test]
fn missing_files_and_wrong_arguments_end_with_2() {
    let directory = tempfile::tempdir().unwrap();
    for arguments in [
        &["run", "none.toml"][..],
        &["report", "none.sqlite"],
        &["status", "none.sqlite"],
        &["solve", "none.json"],
        &["scalars", "--size-ratio", "1", "--separation", "2"],
        &["scalars", "--size-ratio", "nan", "--separation", "3"],
        &["pair", "--roughness", "-1"],
        &["pair", "--time-step", "nan"],
        &["walk"],
        &[],
    ] {
        sweep(directory.path())
            .args(arguments)
            .assert()
            .code(2)
            .stdout("");
    }
    assert!(files(directory.path()).is_empty());
}

#[test]
fn solve_refuses_strange_json() {
    let directory = tempfile::tempdir().unwrap();
    for text in [
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "center": 1}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "stokes"}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "radii": [1, 1]}"#,
        r#"{"centres": [], "hydrodynamics": "ball-melrose"}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "cell": [-1, 3]}"#,
        "",
    ] {
        sweep(directory.path())
            .args(["solve", "-", "--json"])
            .write_stdin(text)
            .assert()
            .code(2)
            .stdout("");
    }
}

#[test]
fn scalars_print_one_object_as_promised() {
    let directory = tempfile::tempdir().unwrap();
    let output = sweep(directory.path())
        .args([
            "scalars",
            "--size-ratio",
            "1",
            "--separation",
            "3",
            "--json",
        ])
        .assert()
        .success();
    let object: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(object["s_prime"], 3.0);
    for name in [
        "XA", "YA", "YB", "XC", "YC", "XG", "YG", "YH", "XM", "YM", "ZM",
    ] {
        assert_eq!(object[name].as_array().unwrap().len(), 2, "{name}");
    }
    // Far apart X11C is 1 + (a/r)^6 and X12C −(a/r)³, here r = 3 a.
    let x_c = |k: usize| object["XC"][k].as_f64().unwrap();
    assert!((x_c(0) - 1.0 - 3.0_f64.powi(-6)).abs() < 1e-3, "{}", x_c(0));
    assert!((x_c(1) + 3.0_f64.powi(-3)).abs() < 1e-3, "{}", x_c(1));
}

#[test]
fn completions_are_written_for_every_shell() {
    let directory = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = sweep(directory.path())
            .args(["completions", shell])
            .assert()
            .success();
        assert!(output.get_output().stdout.len() > 500);
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let directory = tempfile::tempdir().unwrap();
    sweep(directory.path())
        .args(["man", "man1"])
        .assert()
        .success();
    let page = |name: &str| std::fs::read_to_string(directory.path().join("man1").join(name));
    let program = <sweep::cli::Cli as clap::CommandFactory>::command();
    let commands: Vec<&str> = program
        .get_subcommands()
        .map(clap::Command::get_name)
        .collect();
    assert!(commands.contains(&"run"), "{commands:?}");
    for command in commands {
        let page = page(&format!("sweep-{command}.1")).unwrap();
        assert!(
            page.contains(".SH SYNOPSIS") && page.contains(".SH OPTIONS"),
            "{command}"
        );
    }
    assert!(page("sweep.1").unwrap().contains("Stokesian Dynamics"));
    assert!(page("sweep-run.1").unwrap().contains("time\\-limit"));
    std::fs::write(directory.path().join("file"), "").unwrap();
    let refused = sweep(directory.path()).args(["man", "file"]).assert();
    refused.code(2);
}

#[test]
fn version_names_physics_and_build() {
    let directory = tempfile::tempdir().unwrap();
    for arguments in [&["--version"][..], &["run", "--version"], &["-V"]] {
        let output = sweep(directory.path()).args(arguments).assert().success();
        let said = String::from_utf8_lossy(&output.get_output().stdout).into_owned();
        let (_, names) = said.trim_end().split_once(" (physics ").unwrap();
        let (physics, build) = names.split_once(", build ").unwrap();
        assert_eq!(physics, sweep::model::case::PHYSICS_VERSION.to_string());
        let build = build.strip_suffix(')').unwrap();
        assert!(
            build.len() == 16 && build.bytes().all(|b| b.is_ascii_hexdigit()),
            "{said}"
        );
    }
}

#[test]
fn help_is_what_it_was() {
    let directory = tempfile::tempdir().unwrap();
    let mut all = String::new();
    let program = <sweep::cli::Cli as clap::CommandFactory>::command();
    let commands = program.get_subcommands().map(clap::Command::get_name);
    for subcommand in [""].into_iter().chain(commands) {
        let mut command = sweep(directory.path());
        command.env("COLUMNS", "100");
        if !subcommand.is_empty() {
            command.arg(subcommand);
        }
        let output = command.arg("--help").assert().success();
        all.push_str(&String::from_utf8_lossy(&output.get_output().stdout));
        all.push_str("\n────────\n");
    }
    insta::assert_snapshot!(all);
}
