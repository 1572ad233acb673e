use super::*;
use rusqlite::types::Value;
use std::path::PathBuf;

/// A shard of task 0 after a number of restarts, with this process registered.
fn shard(directory: &Path, name: &str, restart: u32) -> (Store, PathBuf) {
    let path = directory.join(format!("{name}.sqlite"));
    let mut store = Store::at(&path, &campaign(CAMPAIGN));
    store.work_for(TaskName {
        job: "7".into(),
        task: 0,
        restart,
        node: name.into(),
    });
    store.register(1).unwrap();
    // Processes of this test differ in their hosts.
    store
        .connection
        .execute("UPDATE processes SET host = ?1", [name])
        .unwrap();
    let own = format!("t.id = {}", store.me());
    processes::SEALED.seal(&store.connection, &own, []).unwrap();
    (store, path)
}

/// Claims the next case and stores a checkpoint of it.
fn begin(store: &mut Store, steps: u64) -> Claim {
    let claim = store.next().unwrap();
    store.keep_state(&claim, steps, &checkpoint(steps)).unwrap();
    claim
}

fn rows(store: &Store, query: &str) -> Vec<Vec<Value>> {
    let mut query = store.connection.prepare(query).unwrap();
    let columns = query.column_count();
    query
        .query_map([], |row| {
            (0..columns).map(|column| row.get(column)).collect()
        })
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap()
}

/// The complete outcome of a merge, independent of the order.
fn content(store: &Store) -> Vec<Vec<Value>> {
    [
        "SELECT key, state, steps_done FROM cases ORDER BY key",
        "SELECT c.key, r.viscosity, r.samples, p.host FROM results r JOIN cases c ON c.id = r.case_id
             JOIN processes p ON p.id = r.process ORDER BY c.key",
        "SELECT c.key, s.* FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step",
        "SELECT c.key, k.steps, k.data FROM checkpoints k JOIN cases c ON c.id = k.case_id ORDER BY c.key, k.steps",
        "SELECT c.key, f.error FROM failures f JOIN cases c ON c.id = f.case_id ORDER BY c.key, f.error",
    ]
    .iter()
    .flat_map(|query| rows(store, query))
    .map(|mut row| {
        // Numbers of cases are the same in all these stores but may not be in others.
        row.truncate(6);
        row
    })
    .collect()
}

fn failure_of(error: &str) -> Attempt {
    Attempt {
        error: error.into(),
        ..failure(9)
    }
}

#[test]
fn shards_merge_in_any_order_and_repeatedly() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    // The first case is half done in one shard, further in another, complete in the third; the
    // second failed and was begun; the third has checkpoints only.
    let (mut a, path_a) = shard(at, "a", 0);
    begin(&mut a, 40);
    let claim = a.next().unwrap();
    a.fail(&claim, failure_of("no"), &NewRows::default())
        .unwrap();
    begin(&mut a, 100);
    let (mut b, path_b) = shard(at, "b", 1);
    begin(&mut b, 80);
    begin(&mut b, 120);
    begin(&mut b, 60);
    let (mut c, path_c) = shard(at, "c", 2);
    let claim = begin(&mut c, 20);
    c.end(&claim, &finished(State::Done)).unwrap();
    drop((a, b, c));
    let paths = [path_a, path_b, path_c];
    let mut outcomes = Vec::new();
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        let path = at.join(format!("{order:?}/small.sqlite"));
        let mut store = Store::at(&path, &campaign(CAMPAIGN));
        for number in order {
            let shards = [paths[number].clone()];
            let first = store.merge(MergedCases::All, &shards).unwrap();
            assert_eq!(first.shards, 1);
            let again = store.merge(MergedCases::All, &shards).unwrap();
            let copied = (again.results, again.checkpoints, again.failures);
            assert_eq!((again.shards, copied), (1, (0, 0, 0)));
        }
        let once = content(&store);
        let again = store.merge(MergedCases::All, &paths).unwrap();
        assert_eq!(
            (
                again.shards,
                again.results,
                again.checkpoints,
                again.failures
            ),
            (3, 0, 0, 0)
        );
        assert_eq!(content(&store), once);
        let counts = store.counts().unwrap();
        assert_eq!((counts.done, counts.failed, counts.pending), (1, 1, 2));
        assert!(again.disagreements.is_empty());
        outcomes.push(once);
    }
    assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]));
}

#[test]
fn merged_checkpoint_is_gone_on_from() {
    let directory = tempfile::tempdir().unwrap();
    let (mut a, path) = shard(directory.path(), "a", 0);
    begin(&mut a, 40);
    let claim = a.next().unwrap();
    a.keep_state(&claim, 8, &checkpoint(8)).unwrap();
    a.keep_state(&claim, 16, &checkpoint(16)).unwrap();
    let mut store = open(directory.path());
    store.merge(MergedCases::All, &[path]).unwrap();
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    assert_eq!(claim.checkpoints[0].as_ref().unwrap().snapshot.steps(), 40);
    let claim = store.next().unwrap();
    let steps: Vec<u64> = claim
        .checkpoints
        .iter()
        .map(|found| found.as_ref().unwrap().snapshot.steps())
        .collect();
    assert_eq!(steps, [16, 8]);
}

#[test]
fn results_that_differ_are_reported_and_the_later_attempt_is_kept() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let (mut a, early) = shard(at, "early", 0);
    let (mut b, late) = shard(at, "late", 1);
    let (mut c, alike) = shard(at, "alike", 0);
    for (store, viscosity) in [
        (&mut a, 7.0),
        (&mut b, 7.000_000_000_000_001),
        (&mut c, 7.0),
    ] {
        let claim = store.next().unwrap();
        let result = finished(State::Done).with(|samples| samples[30].1.viscosity = viscosity);
        store.end(&claim, &result).unwrap();
    }
    drop((a, b, c));
    for order in [[&early, &late], [&late, &early]] {
        let mut store = Store::at(
            &at.join(order[0].file_stem().unwrap()).join("s.sqlite"),
            &campaign(CAMPAIGN),
        );
        let mut merge = |shard: &PathBuf| {
            let shard = std::slice::from_ref(shard);
            store.merge(MergedCases::All, shard).unwrap().disagreements
        };
        assert!(merge(order[0]).is_empty());
        let found = merge(order[1]);
        assert_eq!(found.len(), 1);
        // It is found again as long as both are there.
        let again = merge(&early);
        assert_eq!(
            (&again[0].kept, &again[0].other),
            (&found[0].kept, &found[0].other)
        );
        assert!(merge(&late).is_empty());
        assert_eq!(found[0].kept, "job 7 task 0 restart 1 on late");
        assert_eq!(found[0].other, "job 7 task 0 restart 0 on early");
        assert!(
            found[0].what.contains("at step 120: viscosity is 7"),
            "{}",
            found[0].what
        );
        let kept = rows(&store, "SELECT viscosity FROM samples WHERE step = 120");
        assert_eq!(kept, [[Value::Real(7.000_000_000_000_001)]]);
    }
    let mut store = open(at);
    let merged = store.merge(MergedCases::All, &[early, alike]).unwrap();
    assert_eq!((merged.results, merged.duplicates), (1, 1));
    assert!(merged.disagreements.is_empty());
}

#[test]
fn other_campaigns_are_refused_before_anything_is_merged_and_builds_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let (mut a, good) = shard(at, "a", 0);
    let claim = a.next().unwrap();
    a.end(&claim, &finished(State::Done)).unwrap();
    let (mut b, other) = shard(at, "b", 0);
    begin(&mut b, 40);
    begin(&mut b, 44);
    b.connection
        .execute("UPDATE processes SET build = 'other'", [])
        .unwrap();
    processes::SEALED.seal(&b.connection, "true", []).unwrap();
    drop((a, b));
    Store::at(
        &at.join("foreign.sqlite"),
        &campaign(&CAMPAIGN.replace("small", "else")),
    );
    let mut store = open(at);
    let shards = [good.clone(), at.join("foreign.sqlite")];
    let refused = store.merge(MergedCases::All, &shards);
    assert!(matches!(refused, Err(StoreError::OtherCampaign { .. })));
    assert_eq!(store.counts().unwrap().done, 0, "nothing was merged");
    let merged = store.merge(MergedCases::All, &[good, other]).unwrap();
    assert_eq!((merged.results, merged.checkpoints), (1, 1));
    let mut builds = [crate::system::process::build(), "other".into()];
    builds.sort();
    assert_eq!(store.builds().unwrap(), builds);
}

#[test]
fn half_a_shard_is_named_and_the_others_are_merged() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let (mut a, work) = shard(at, "a", 0);
    let claim = a.next().unwrap();
    a.end(&claim, &finished(State::Done)).unwrap();
    let good = at.join("good.sqlite");
    database::snapshot(&work, &good).unwrap();
    drop(a);
    let bytes = std::fs::read(&good).unwrap();
    for length in [0, 1, 99, 100, 4096, bytes.len() / 2, bytes.len() - 1] {
        let half = at.join("half.sqlite");
        std::fs::write(&half, &bytes[..length]).unwrap();
        let mut store = Store::at(
            &at.join(format!("{length}/small.sqlite")),
            &campaign(CAMPAIGN),
        );
        let merged = store
            .merge(MergedCases::All, &[half.clone(), good.clone()])
            .unwrap();
        assert_eq!((merged.damaged.len(), merged.results), (1, 1), "{length}");
        assert_eq!(merged.damaged[0].path, half);
        // Once complete, it is merged by the same command.
        std::fs::write(&half, &bytes).unwrap();
        let merged = store
            .merge(MergedCases::All, &[half, good.clone()])
            .unwrap();
        assert_eq!((merged.damaged.len(), merged.duplicates), (0, 2));
    }
}

#[test]
fn case_running_here_is_unchanged_by_a_partial_copy_and_ended_by_a_complete_one() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let mut store = open(at);
    store.register(1).unwrap();
    let claim = begin(&mut store, 8);
    let (mut a, path) = shard(at, "a", 0);
    let theirs = begin(&mut a, 100);
    store
        .merge(MergedCases::All, std::slice::from_ref(&path))
        .unwrap();
    store.keep_state(&claim, 12, &checkpoint(12)).unwrap();
    a.end(&theirs, &finished(State::Jammed)).unwrap();
    store.merge(MergedCases::All, &[path]).unwrap();
    let lost = store.keep_state(&claim, 16, &checkpoint(16));
    assert!(matches!(lost, Err(StoreError::ClaimLost { .. })));
    assert_eq!(store.counts().unwrap().jammed, 1);
}

#[test]
fn complete_run_outranks_a_failure_and_retried_failures_stay_retried() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let (mut a, failed) = shard(at, "a", 0);
    let claim = a.next().unwrap();
    a.fail(&claim, failure_of("took too long"), &NewRows::default())
        .unwrap();
    let (mut b, done) = shard(at, "b", 1);
    let claim = b.next().unwrap();
    b.end(&claim, &finished(State::Done)).unwrap();
    drop((a, b));
    for order in [[&failed, &done], [&done, &failed]] {
        let mut store = Store::at(
            &at.join(format!(
                "{}-first/s.sqlite",
                order[0].file_stem().unwrap().display()
            )),
            &campaign(CAMPAIGN),
        );
        store.merge(MergedCases::All, &[order[0].clone()]).unwrap();
        store.merge(MergedCases::All, &[order[1].clone()]).unwrap();
        let counts = store.counts().unwrap();
        assert_eq!((counts.done, counts.failed), (1, 0));
    }
    let mut store = open(at);
    store
        .merge(MergedCases::All, std::slice::from_ref(&failed))
        .unwrap();
    assert_eq!(store.retry_failed().unwrap(), 1);
    store.merge(MergedCases::All, &[failed]).unwrap();
    assert_eq!(store.counts().unwrap().failed, 0);
}
