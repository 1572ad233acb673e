//! Common helpers: the program in a separate folder, stores that are computed once, and waiting for
//! other processes.

use assert_cmd::cargo::cargo_bin;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// After this time a test gives up on another process. It guards against a hang and measures
/// nothing.
pub(crate) const PATIENCE: Duration = Duration::from_mins(2);

/// The repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The program in a folder, without arguments. Its cache is there too, so that tests are
/// independent.
pub(crate) fn program(at: &Path) -> Command {
    let mut command = Command::new(cargo_bin("sweep"));
    command.current_dir(at).env("XDG_CACHE_HOME", at);
    command
}

/// The program in a folder, with arguments.
pub(crate) fn command(at: &Path, arguments: &[&str]) -> Command {
    let mut command = program(at);
    command.args(arguments);
    command
}

/// Runs it, however it ends.
pub(crate) fn run(at: &Path, arguments: &[&str]) -> Output {
    command(at, arguments).output().unwrap()
}

/// Its output on success.
pub(crate) fn sweep(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The object it prints.
pub(crate) fn json(at: &Path, arguments: &[&str]) -> serde_json::Value {
    let text = sweep(at, &[arguments, &["--json"]].concat());
    serde_json::from_str(&text).unwrap()
}

/// Its message about bad input, with an empty standard output.
pub(crate) fn refused(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty());
    words(&output.stderr)
}

/// The text of an error on one line, without its frame: lines are wrapped to fit the terminal.
pub(crate) fn words(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text).replace(['│', '╰', '─', '▶', '×'], " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Everything that a command printed.
pub(crate) fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&[output.stdout.clone(), output.stderr.clone()].concat()).into_owned()
}

/// Starts it without output.
pub(crate) fn spawn(at: &Path, arguments: &[&str]) -> Child {
    command(at, arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

pub(crate) fn send(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).unwrap();
}

/// Waits until a condition holds.
pub(crate) fn until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// How a process ended; one that does not is killed, and the test fails.
pub(crate) fn ended(child: &mut Child) -> ExitStatus {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begun.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            unreachable!("a process did not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A folder with a campaign file in it.
pub(crate) fn folder(name: &str, campaign: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), campaign).unwrap();
    folder
}

/// A campaign with this name, strain, discarded strain and grids.
pub(crate) fn campaign(name: &str, [strain, discard]: [f64; 2], grids: &str) -> &'static str {
    let protocol = format!("time_step = 0.02\nstrain = {strain}\ndiscard = {discard:?}");
    format!("name = \"{name}\"\n[protocol]\n{protocol}\n{grids}").leak()
}

/// A campaign that is computed once, for all tests that look at its store.
pub(crate) struct Computed {
    campaign: &'static str,
    /// Arguments of `sweep run`.
    more: &'static [&'static str],
    store: OnceLock<Vec<u8>>,
}

impl Computed {
    pub(crate) const fn new(campaign: &'static str, more: &'static [&'static str]) -> Self {
        Self {
            campaign,
            more,
            store: OnceLock::new(),
        }
    }

    /// A folder with a copy of its store, `s.sqlite`, and its file, `c.toml`.
    pub(crate) fn folder(&self) -> tempfile::TempDir {
        let folder = folder("c.toml", self.campaign);
        let at = folder.path();
        let bytes = self.store.get_or_init(|| {
            let run = ["run", "c.toml", "--store", "s.sqlite", "-q"];
            sweep(at, &[&run[..], self.more].concat());
            std::fs::read(at.join("s.sqlite")).unwrap()
        });
        std::fs::write(at.join("s.sqlite"), bytes).unwrap();
        folder
    }
}

/// Changes a store without the program.
pub(crate) fn edit(store: &Path, statements: &str) {
    let connection = rusqlite::Connection::open(store).unwrap();
    connection.execute_batch(statements).unwrap();
    drop(connection);
    sweep::store::accept_changes(store).unwrap();
}

/// All runs of a store with all bits of their samples, results and failures, without times: two
/// computations of the same runs have the same.
pub(crate) fn dump(store: &Path) -> Vec<String> {
    let connection = rusqlite::Connection::open(store).unwrap();
    connection.busy_timeout(PATIENCE).unwrap();
    let differs = |name: &str| {
        name.ends_with("_at") || name.ends_with("_time_s") || name.ends_with("digest") || {
            let others = [
                "id", "case_id", "point", "process", "owner", "resumed", "attempt",
            ];
            others.contains(&name)
        }
    };
    let mut lines = Vec::new();
    for (table, query) in [
        ("run", "SELECT * FROM runs ORDER BY key"),
        (
            "sample",
            "SELECT c.key, s.* FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step",
        ),
        (
            "case",
            "SELECT key, state, steps_done FROM cases WHERE counts ORDER BY key",
        ),
        (
            "failure",
            "SELECT c.key, f.step, f.error FROM failures f JOIN cases c ON c.id = f.case_id ORDER BY 1, 2, 3",
        ),
    ] {
        let mut query = connection.prepare(query).unwrap();
        let names: Vec<String> = query.column_names().map(str::to_owned).collect();
        let mut rows = query.query([]).unwrap();
        while let Some(row) = rows.next().unwrap() {
            let cells = names.iter().enumerate().filter(|(_, name)| !differs(name));
            let cells = cells.map(|(at, name)| {
                let value: rusqlite::types::Value = row.get_unwrap(at);
                format!("{name}={value:?}")
            });
            lines.push(format!("{table} {}", cells.collect::<Vec<_>>().join(" ")));
        }
    }
    lines
}

/// JSON without times and without the file that it is about.
pub(crate) fn without_times(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(map) => {
            map.retain(|name, _| {
                !name.ends_with("_time_s")
                    && !["silent_s", "published_s", "file"].contains(&&**name)
            });
            map.values_mut().for_each(without_times);
        }
        serde_json::Value::Array(list) => list.iter_mut().for_each(without_times),
        _ => {}
    }
}

/// A number from the environment, for tests whose length can be chosen.
pub(crate) fn chosen(name: &str, usual: usize) -> usize {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap())
}

/// Damages the store of a folder.
pub(crate) fn spoil(at: &Path, statements: &str) {
    edit(&at.join("s.sqlite"), statements);
}

/// Marks runs of a store that meet an SQL condition as failed.
pub(crate) fn fail(at: &Path, which: &str) {
    spoil(
        at,
        &format!(
            "CREATE TEMP TABLE chosen AS SELECT c.id FROM cases c JOIN axes p ON p.id = c.point WHERE {which};
             UPDATE cases SET state = 'failed' WHERE id IN chosen;
             DELETE FROM results WHERE case_id IN chosen;
             INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
                 SELECT id, 1, 'made up', 3, 0.015, 1, 0 FROM chosen;"
        ),
    );
}

/// A live page; the server ends with the test.
pub(crate) struct Served {
    pub(crate) child: Child,
    pub(crate) address: String,
}

impl Served {
    /// Starts a command that serves and prints its address as JSON.
    pub(crate) fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let said: serde_json::Value = serde_json::from_str(&line).unwrap();
        Self {
            child,
            address: said["address"].as_str().unwrap().to_owned(),
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
