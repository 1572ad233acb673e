//! Time of commands on a store of 100 000 finished runs: one is computed, and the others are copies
//! of it.
//!
//! `SEEDS=400` makes it a million, 400 seeds at each of 2500 points.
//! `STORE=FILE cargo bench --bench large_store` keeps the store, and `python/benches/overhead.py`
//! measures on it.
#![expect(clippy::print_stdout, reason = "the times are what this bench is for")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use sweep::store::{Store, accept_changes};

fn campaign(points: &str, seeds: u32) -> String {
    format!(
        "name = \"large\"\n[protocol]\nstrain = 0.2\ndiscard = 0.1\n[[grid]]\narea_fraction = 0.65\nroughness = 0.01\n\
         spheres = 30\nhydrodynamics = \"ball-melrose\"\nseeds = {seeds}\n{points}\n"
    )
}

/// Numbers of a list, as TOML has it.
fn list(number: u32, value: impl Fn(u32) -> f64) -> String {
    format!("{:?}", (0..number).map(value).collect::<Vec<_>>())
}

/// Time of a command, which must end well.
fn time(words: &str, arguments: &[&str]) {
    let begun = Instant::now();
    let status = Command::new(env!("CARGO_BIN_EXE_sweep"))
        .args(arguments)
        .stdout(Stdio::null())
        .status()
        .expect("a program");
    assert!(status.success(), "{arguments:?}");
    println!("{words}: {:.2} s", begun.elapsed().as_secs_f64());
}

/// Time of something done here.
fn time_of<T>(words: &str, work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let value = work();
    println!("{words}: {:.2} s", begun.elapsed().as_secs_f64());
    value
}

/// Gives every case the result and the samples of the first one that has them.
fn copy_the_run(store: &Path) -> Result<(), rusqlite::Error> {
    let connection = rusqlite::Connection::open(store)?;
    for table in ["results", "samples"] {
        let mut query = connection.prepare("SELECT name FROM pragma_table_info(?1)")?;
        let columns: Vec<String> = query
            .query_map([table], |row| row.get(0))?
            .collect::<Result<_, _>>()?;
        let values = columns.iter().map(|name| match name.as_str() {
            "case_id" => "c.id".to_owned(),
            name => format!("t.{name}"),
        });
        connection.execute(
            &format!(
                "INSERT INTO {table} ({}) SELECT {} FROM cases c JOIN {table} t WHERE c.state = 'pending'
                     AND t.case_id = (SELECT min(case_id) FROM results)",
                columns.join(", "),
                values.collect::<Vec<_>>().join(", ")
            ),
            [],
        )?;
    }
    connection.execute_batch(
        "UPDATE cases SET state = 'done', steps_done = steps WHERE state = 'pending'",
    )
}

fn main() {
    let directory = tempfile::tempdir().expect("a place for the store");
    let at = |name: &str| directory.path().join(name);
    let kept = std::env::var_os("STORE").map(PathBuf::from);
    let store = kept.unwrap_or_else(|| at("large.sqlite"));
    let (one, all) = (at("one.toml"), at("large.toml"));
    let points = format!(
        "friction = {}\nshear_rate = {}",
        list(50, |n| f64::from(n) / 49.0),
        list(50, |n| 10_f64.powf(f64::from(n) / 12.0 - 2.0)),
    );
    let seeds = std::env::var("SEEDS").map_or(40, |seeds| seeds.parse().expect("a number"));
    let text = campaign(&points, seeds);
    std::fs::write(&one, campaign("friction = 0.0\nshear_rate = 0.01", 1)).expect("room");
    std::fs::write(&all, &text).expect("room");
    let path = |path: &Path| path.to_string_lossy().into_owned();
    let (one, all, store_path) = (path(&one), path(&all), path(&store));
    if !store.exists() {
        time("one run", &["run", &one, "--quiet", "--store", &store_path]);
        let campaign = sweep::campaign::parse("large.toml", text).expect("a good campaign");
        time_of("all cases are entered", || {
            Store::enter(&store, &campaign).expect("a campaign for the store");
        });
        copy_the_run(&store).expect("a store to write to");
        accept_changes(&store).expect("a store to write to");
    }
    let bytes = std::fs::metadata(&store).map_or(0, |file| file.len());
    println!("the store has {} MB", bytes >> 20);
    time_of("open for reading", || {
        Store::open_read_only(&store).expect("a good store");
    });
    time_of("open for writing", || {
        Store::open(&store).expect("a good store");
    });
    time("status STORE", &["status", &store_path]);
    time("status FILE", &["status", &all, "--store", &store_path]);
    time("report STORE", &["report", &store_path]);
    time("report FILE", &["report", &all, "--store", &store_path]);
    time(
        "run with nothing to do",
        &["run", &all, "--quiet", "--store", &store_path],
    );
}
