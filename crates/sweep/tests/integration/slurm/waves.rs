//! Campaigns with a requested precision, in successive waves of tasks.

use super::cluster::{Cluster, QUICK, Task, contains};
use crate::harness::send;
use rustix::process::Signal;

/// Points that need different numbers of seeds.
fn precise() -> String {
    QUICK.replace(
        "seeds = 3",
        "seeds = { precision = 0.1, at_least = 3, at_most = 8 }",
    )
}

/// Submits the next wave; returns its script and numbers of cases and tasks, or `None` if nothing
/// remains.
fn next_wave(cluster: &Cluster) -> Option<(std::path::PathBuf, u64, usize)> {
    let arguments = ["submit", "small.toml", "--tasks", "3", "--quiet", "--json"];
    let answer = cluster.json(&arguments);
    let plan = answer["plan"].as_str()?;
    let script = cluster.shards().join("plans").join(plan).join("job.sh");
    let tasks = usize::try_from(answer["tasks"].as_u64().unwrap()).unwrap();
    Some((script, answer["cases"].as_u64().unwrap(), tasks))
}

#[test]
fn waves_end_by_themselves_with_the_results_of_a_local_run() {
    let cluster = Cluster::new(&precise());
    let mut waves = Vec::new();
    while let Some((script, cases, tasks)) = next_wave(&cluster) {
        let job = 4711 + u32::try_from(waves.len()).unwrap();
        waves.push(cases);
        assert!(waves.len() < 12, "{waves:?}");
        cluster.set_reply("job", &format!("{}\n", job + 1));
        cluster.run_all(&script, job, tasks);
    }
    // First batches of both points; then only the seeds of the rule.
    assert_eq!(waves[0], 6);
    assert!(waves.len() > 2, "{waves:?}");
    let points = cluster.json(&["report", "small.toml", "--json"]);
    let points = points["points"].as_array().unwrap();
    let wanted = |point: &serde_json::Value| point["seeds_wanted"].as_u64().unwrap();
    assert_eq!(
        points.iter().map(wanted).sum::<u64>(),
        waves.iter().sum::<u64>()
    );
    for point in points {
        let reached = point["precision"].as_f64().unwrap();
        assert!(reached <= 0.1 || wanted(point) == 8, "{point}");
    }
    cluster.equals_local_run();
}

#[test]
fn lost_task_of_a_wave_is_submitted_again_before_the_rule_looks() {
    let cluster = Cluster::new(&precise());
    let (script, cases, tasks) = next_wave(&cluster).unwrap();
    assert_eq!((cases, tasks), (6, 3));
    // One task ends well, one goes down with its node, one never begins.
    let one = Task::FIRST;
    let done = cluster.start(&script, one).wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    let two = Task { number: 1, ..one };
    let mut lost = cluster.start(&script, two);
    cluster.hold_at_steps(&lost, two, 4);
    send(&lost, Signal::KILL);
    lost.wait().unwrap();
    cluster.set_reply("job", "4712\n");
    // Batches are not complete: no seed beyond them is submitted.
    let (script, again, tasks) = next_wave(&cluster).unwrap();
    assert!((1..6).contains(&again), "{again}");
    cluster.run_all(&script, 4712, tasks);
    let mut job = 4712;
    while let Some((script, _, tasks)) = next_wave(&cluster) {
        job += 1;
        assert!(job < 4724);
        cluster.set_reply("job", &format!("{}\n", job + 1));
        cluster.run_all(&script, job, tasks);
    }
    contains(
        &cluster.ok(&["submit", "small.toml"]),
        &["nothing to submit"],
    );
    cluster.equals_local_run();
}
