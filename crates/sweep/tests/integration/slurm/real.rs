//! A campaign on a real Slurm of two nodes with typical failures, compared bit for bit with a local
//! run. By hand, about 15 minutes; on a busy machine Slurm stalls:
//! ```sh
//! SLURM_HELPER=DIR cargo test --release -p sweep --test integration slurm::real -- --ignored
//! ```
//! DIR has `slurm-local.sh`, which starts a throwaway Slurm on this host: `up` starts its daemons,
//! `env` prints the `SLURM_CONF` to use, `fail-node n2` kills a node's daemon and all its tasks,
//! `heal-node n2` starts the daemon again, `down` stops all. It gets its folder in
//! `SLURM_LOCAL_DIR` and the seconds after which a silent node counts as down in
//! `SLURM_LOCAL_NODE_TIMEOUT`.

use crate::harness::{dump, folder, json, program, run, sweep};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// 24 cases of some seconds each, of two kinds.
const CAMPAIGN: &str = r#"name = "test"
[protocol]
strain = 10.0
discard = 1.0
checkpoint_every = 0.05
[[grid]]
area_fraction = 0.65
friction = 0.3
roughness = 0.01
shear_rate = [0.1, 1.0, inf]
seeds = 4
spheres = 70
hydrodynamics = "ball-melrose"
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [0.1, 1.0, inf]
seeds = 4
spheres = 50
hydrodynamics = "ball-melrose"
"#;

/// A throwaway Slurm and a campaign.
struct Cluster {
    folder: tempfile::TempDir,
    helper: PathBuf,
    /// `SLURM_CONF`.
    settings: Vec<(String, String)>,
}

impl Cluster {
    fn up() -> Self {
        let helper =
            std::env::var("SLURM_HELPER").expect("SLURM_HELPER names the folder of slurm-local.sh");
        let mut cluster = Self {
            folder: folder("test.toml", CAMPAIGN),
            helper: Path::new(&helper).join("slurm-local.sh"),
            settings: Vec::new(),
        };
        // The tasks may run as another user.
        let all = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(cluster.at(), all).unwrap();
        cluster.help("up");
        let settings = cluster.help("env");
        cluster.settings = settings
            .lines()
            .filter_map(|line| line.trim_start_matches("export ").split_once('='))
            .map(|(name, value)| (name.to_owned(), value.trim_matches(['"', '\'']).to_owned()))
            .collect();
        sweep(
            cluster.at(),
            &["run", "test.toml", "--store", "local.sqlite", "-q"],
        );
        cluster
    }

    fn at(&self) -> &Path {
        self.folder.path()
    }

    /// Calls the helper.
    fn help(&self, what: &str) -> String {
        let output = Command::new("bash")
            .arg(&self.helper)
            .args(what.split(' '))
            .env("SLURM_LOCAL_DIR", self.at().join("slurm"))
            .env("SLURM_LOCAL_NODES", "2")
            .env("SLURM_LOCAL_NODE_TIMEOUT", "30")
            .output()
            .unwrap();
        assert!(output.status.success(), "{what}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// One of Slurm's programs; its output.
    fn slurm(&self, program: &str, arguments: &[&str]) -> String {
        let output = Command::new(program)
            .args(arguments)
            .envs(self.settings.iter().cloned())
            .output()
            .unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Submits the campaign to a store of this name; returns the job.
    fn submit(&self, name: &str, arguments: &[&str]) -> String {
        let store = format!("{name}.sqlite");
        let output = program(self.at())
            .args([
                "submit",
                "test.toml",
                "--store",
                &store,
                "--publish-every",
                "5s",
                "-q",
                "--json",
            ])
            .args(arguments)
            .envs(self.settings.iter().cloned())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        answer["job"].as_str().unwrap().to_owned()
    }

    /// Waits so many seconds at most.
    fn until(&self, seconds: u64, what: &str, mut holds: impl FnMut() -> bool) {
        let begun = Instant::now();
        while !holds() {
            let is_late = begun.elapsed() > Duration::from_secs(seconds);
            assert!(
                !is_late,
                "waited in vain for {what}: {}",
                self.slurm("squeue", &["-r"])
            );
            std::thread::sleep(Duration::from_secs(1));
        }
    }

    fn is_gone(&self, job: &str) -> bool {
        self.slurm("squeue", &["-h", "-r", "-j", job]).is_empty()
    }

    fn shards(&self, name: &str) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.at().join(format!("{name}.shards")));
        let paths = entries
            .into_iter()
            .flatten()
            .map(|entry| entry.unwrap().path());
        let mut shards: Vec<PathBuf> = paths
            .filter(|path| path.extension().is_some_and(|end| end == "sqlite"))
            .collect();
        shards.sort();
        shards
    }

    /// Whether a node has published a shard within a run.
    fn is_half_way(&self, name: &str, node: &str) -> bool {
        let running = "SELECT count(*) FROM cases WHERE state = 'running' AND steps_done > 0";
        let end = format!(".{node}.sqlite");
        self.shards(name).iter().any(|shard| {
            let path = shard.to_str().unwrap();
            let uri = format!("file:{path}?immutable=1");
            path.ends_with(&end)
                && rusqlite::Connection::open(uri)
                    .and_then(|shard| shard.query_row(running, [], |row| row.get::<_, i64>(0)))
                    .is_ok_and(|cases| cases > 0)
        })
    }

    /// Merges, and into another store in the opposite order, and compares both with the local run.
    fn check(&self, name: &str) {
        let at = self.at();
        let store = format!("{name}.sqlite");
        json(at, &["merge", &store]);
        let local = dump(&at.join("local.sqlite"));
        assert_eq!(dump(&at.join(&store)), local, "{name}");
        let again = format!("{name}-again.sqlite");
        let shards = self.shards(name);
        let mut merge = vec!["merge", &again];
        merge.extend(shards.iter().rev().map(|shard| shard.to_str().unwrap()));
        json(at, &merge);
        assert_eq!(
            dump(&at.join(&again)),
            local,
            "{name} in the opposite order"
        );
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.help("down");
    }
}

#[test]
#[ignore = "minutes, by hand: needs a Slurm, see the top of the file"]
fn campaigns_survive_a_lost_node_time_limits_and_cancelling() {
    let cluster = Cluster::up();
    // A node crashes in the middle of a run.
    let job = cluster.submit("crash", &["--tasks", "8", "--time", "10m"]);
    cluster.until(120, "a task on n2", || cluster.is_half_way("crash", "n2"));
    cluster.help("fail-node n2");
    let state = || cluster.slurm("sinfo", &["-h", "-n", "n2", "-o", "%t"]);
    cluster.until(240, "n2 to be seen as down", || state().starts_with("down"));
    cluster.help("heal-node n2");
    cluster.until(600, "the job", || cluster.is_gone(&job));
    cluster.check("crash");
    // Signalled ahead of a limit of two minutes, and only at the limit of one.
    let limit = cluster.submit("limit", &["--tasks", "2", "--time", "2m"]);
    let term = cluster.submit("term", &["--tasks", "4", "--time", "1m"]);
    for (name, job) in [("limit", limit), ("term", term)] {
        cluster.until(1800, "the job", || cluster.is_gone(&job));
        cluster.check(name);
        let is_restarted = |shard: &PathBuf| {
            let name = shard.file_name().unwrap().to_str().unwrap();
            name.split('.').nth(3) != Some("0")
        };
        assert!(cluster.shards(name).iter().any(is_restarted), "{name}");
    }
    // Cancelled in the middle, and submitted again.
    let first = cluster.submit("cancel", &["--tasks", "6", "--time", "10m"]);
    cluster.until(120, "tasks half way", || {
        cluster.is_half_way("cancel", "n1")
    });
    let cancelled = program(cluster.at())
        .args(["cancel", "cancel.sqlite", "--quiet"])
        .envs(cluster.settings.iter().cloned())
        .output()
        .unwrap();
    assert!(cancelled.status.success(), "{cancelled:?}");
    cluster.until(60, "the job", || cluster.is_gone(&first));
    let merged = run(cluster.at(), &["merge", "cancel.sqlite"]);
    assert!(merged.status.success(), "{merged:?}");
    let second = cluster.submit("cancel", &["--tasks", "5", "--time", "10m"]);
    cluster.until(600, "the job", || cluster.is_gone(&second));
    assert!(cluster.is_gone(&first), "it came back");
    cluster.check("cancel");
}
