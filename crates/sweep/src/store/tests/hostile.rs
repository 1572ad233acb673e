//! Malicious stores: nothing in them is executed, blocks, or is trusted.

use super::*;
use crate::case::State;

/// A shard of the campaign with one result, and its file.
fn shard(directory: &Path) -> std::path::PathBuf {
    let folder = directory.join("shard");
    std::fs::create_dir(&folder).unwrap();
    let mut store = open(&folder);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store
        .end(&claim, &finished_as(&claim, State::Done))
        .unwrap();
    let path = store.path().to_owned();
    drop(store);
    path
}

/// A store with two results of its own.
fn own(directory: &Path) -> Store {
    let mut store = open(directory);
    store.register(1).unwrap();
    let first = store.next().unwrap();
    for _ in 0..2 {
        let claim = store.next().unwrap();
        store.end(&claim, &finished(State::Done)).unwrap();
    }
    store.release([&first]).unwrap();
    store
}

fn craft(path: &Path, statements: &str) {
    rusqlite::Connection::open(path)
        .unwrap()
        .execute_batch(statements)
        .unwrap();
}

fn viscosities(store: &Store) -> Vec<Option<f64>> {
    let runs = store.point_runs().unwrap();
    runs.iter().map(|run| run.viscosity).collect()
}

#[test]
fn names_of_columns_in_a_shard_are_never_sql() {
    let evil = r#"ALTER TABLE TABLE_ ADD COLUMN "seed) VALUES (1); UPDATE results SET viscosity = 666; --" INTEGER DEFAULT 1;
        ALTER TABLE TABLE_ ADD COLUMN "x = (UPDATE results SET viscosity = 666)" DEFAULT 2"#;
    let directory = tempfile::tempdir().unwrap();
    let path = shard(directory.path());
    let mut store = own(directory.path());
    let before = viscosities(&store);
    for table in [
        "cases",
        "processes",
        "results",
        "ends",
        "checkpoints",
        "failures",
    ] {
        craft(&path, &evil.replace("TABLE_", table));
    }
    // An upsert in place of a value, which names of columns once allowed.
    craft(
        &path,
        r#"ALTER TABLE results ADD COLUMN "samples) SELECT * FROM results WHERE 1 ON CONFLICT DO UPDATE SET viscosity = 666 --" DEFAULT 3"#,
    );
    let merged = store.merge(std::slice::from_ref(&path), true).unwrap();
    let after = viscosities(&store);
    for (before, after) in before.iter().zip(&after) {
        assert!(before.is_none() || before == after, "{before:?} {after:?}");
        assert_ne!(*after, Some(666.0));
    }
    assert_eq!(merged.damaged, [], "columns of no meaning do no harm");
    let reused = store.reuse(std::slice::from_ref(&path)).unwrap();
    assert_eq!(reused.damaged, []);
}

#[test]
fn views_virtual_tables_and_computed_columns_are_no_store() {
    for statements in [
        "DROP VIEW runs; ALTER TABLE cases RENAME TO c; CREATE VIEW cases AS
             WITH RECURSIVE n (id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) SELECT n.id, c.* FROM n, c",
        "DROP VIEW runs; DROP TABLE campaign; CREATE VIEW campaign AS
             WITH RECURSIVE n (id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) SELECT max(id) AS id, 'small' AS name FROM n",
        "ALTER TABLE samples ADD COLUMN more AS (hex(zeroblob(100000000)))",
        "DROP VIEW runs; DROP TABLE frames; CREATE VIRTUAL TABLE frames USING rtree(id, a, b)",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let path = shard(directory.path());
        craft(&path, &format!("PRAGMA legacy_alter_table = ON; {statements}"));
        let mut store = own(directory.path());
        for refused in [Store::open(&path).err(), Store::open_read_only(&path).err()] {
            assert!(
                matches!(
                    refused,
                    Some(StoreError::NotAStore { .. } | StoreError::Damaged { .. })
                ),
                "{statements}: {refused:?}"
            );
        }
        let merged = store.merge(std::slice::from_ref(&path), true).unwrap();
        assert_eq!((merged.damaged.len(), merged.results), (1, 0), "{statements}");
    }
}

#[test]
fn triggers_of_a_store_are_not_executed() {
    let directory = tempfile::tempdir().unwrap();
    let store = own(directory.path());
    let (path, before) = (store.path().to_owned(), viscosities(&store));
    drop(store);
    craft(
        &path,
        "CREATE TRIGGER evil AFTER UPDATE ON processes BEGIN UPDATE results SET viscosity = 666; END;
         CREATE TRIGGER worse AFTER INSERT ON processes BEGIN UPDATE results SET viscosity = 666; END",
    );
    let mut store = Store::at(&path, &campaign(CAMPAIGN));
    store.register(1).unwrap();
    store.heartbeat().unwrap();
    assert_eq!(viscosities(&store), before);
}

#[test]
fn values_of_types_that_no_store_has_are_not_taken_over() {
    for statement in [
        "UPDATE cases SET steps_done = 'much' WHERE id = 1",
        "UPDATE ends SET wall_time_s = x'00ff'",
        "UPDATE ends SET resumed = 'often'",
        "UPDATE samples SET contacts = 'some'",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let path = shard(directory.path());
        craft(&path, statement);
        let mut store = own(directory.path());
        let merged = store.merge(std::slice::from_ref(&path), true).unwrap();
        assert_eq!(merged.results, 0, "{statement}");
        assert_eq!(
            merged.unreadable + merged.damaged.len() as u64,
            1,
            "{statement}"
        );
        assert!(check(store.path()).unwrap().findings.is_empty());
    }
}

#[test]
fn pipe_is_refused_without_blocking() {
    let directory = tempfile::tempdir().unwrap();
    let pipe = directory.path().join("pipe.sqlite");
    rustix::fs::mknodat(
        rustix::fs::CWD,
        &pipe,
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::from_raw_mode(0o600),
        0,
    )
    .unwrap();
    for refused in [
        Store::open(&pipe).err(),
        Store::open_read_only(&pipe).err(),
        check(&pipe).err(),
    ] {
        assert!(
            matches!(refused, Some(StoreError::NotAFile { .. })),
            "{refused:?}"
        );
    }
    let mut store = own(directory.path());
    let merged = store.merge(std::slice::from_ref(&pipe), true).unwrap();
    assert_eq!(merged.damaged.len(), 1);
    assert!(Store::open_read_only(Path::new("/dev/zero")).is_err());
}

#[test]
fn failed_runs_bring_their_samples_and_frames() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("shard");
    std::fs::create_dir(&folder).unwrap();
    let mut shard = open(&folder);
    shard.register(1).unwrap();
    let claim = shard.next().unwrap();
    shard
        .keep_frames(&claim, &[(20, crate::test_support::frame())])
        .unwrap();
    shard.fail(&claim, failure(37), &first_samples(2)).unwrap();
    let path = shard.path().to_owned();
    drop(shard);
    let mut store = open(directory.path());
    let merged = store.merge(std::slice::from_ref(&path), true).unwrap();
    assert_eq!(merged.failures, 1);
    let details = store.details(&claim.key).unwrap();
    assert_eq!((details.samples.len(), details.frames), (2, 1));
}

/// An intact shard, and a store after its merge.
static SHARD: std::sync::LazyLock<Vec<u8>> = std::sync::LazyLock::new(|| {
    let directory = tempfile::tempdir().unwrap();
    std::fs::read(shard(directory.path())).unwrap()
});

proptest::proptest! {
    // A case takes a thousand times as long as one of other properties. PROPTEST_CASES overrides
    // this number.
    #![proptest_config(proptest::test_runner::Config::with_cases(8))]
    #[test]
    fn damaged_shards_crash_no_merge_and_bring_nothing_that_was_not_computed(
        at in proptest::prelude::any::<usize>(),
        put in proptest::collection::vec(proptest::prelude::any::<u8>(), 1..40),
    ) {
        let directory = tempfile::tempdir().unwrap();
        let mut bytes = SHARD.clone();
        let at = at % bytes.len();
        for (place, byte) in bytes[at..].iter_mut().zip(put) {
            *place = byte;
        }
        let path = directory.path().join("damaged.sqlite");
        std::fs::write(&path, bytes).unwrap();
        let mut store = open(directory.path());
        let _ = store.merge(std::slice::from_ref(&path), true);
        drop(store);
        let store = Store::open(&directory.path().join("small.sqlite")).unwrap();
        proptest::prop_assert!(check(store.path()).unwrap().findings.is_empty());
        for run in store.point_runs().unwrap() {
            let is_right = run.viscosity.is_none_or(|viscosity| {
                let samples = finished(State::Done).samples;
                let mean = crate::statistics::Averages::of(&samples, 100).viscosity.unwrap().mean;
                (viscosity - mean).abs() < 1e-12
            });
            proptest::prop_assert!(is_right, "{:?}", run.viscosity);
        }
    }
}
