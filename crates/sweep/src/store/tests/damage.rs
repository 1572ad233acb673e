//! Altered digits, states and lists are detected by every reader that tabulates them.

use super::*;

/// A store whose cases have all ended: done, jammed, failed.
fn ended(directory: &Path) -> Store {
    let mut store = open(directory);
    store.register(1).unwrap();
    for state in [State::Done, State::Done, State::Jammed] {
        let claim = store.next().unwrap();
        store.end(&claim, &finished_as(&claim, state)).unwrap();
    }
    let claim = store.next().unwrap();
    store
        .fail(&claim, failure(37), &rows(first_samples(1)))
        .unwrap();
    store.leave().unwrap();
    store
}

/// Changes a store without updating digests.
fn alter(path: &Path, statement: &str) {
    let other = rusqlite::Connection::open(path).unwrap();
    other
        .execute_batch("PRAGMA ignore_check_constraints = ON; PRAGMA foreign_keys = OFF")
        .unwrap();
    assert!(other.execute(statement, []).unwrap() > 0, "{statement}");
}

/// Mean viscosity of the samples from step 100 on.
fn mean_viscosity(samples: &[(u64, sd_core::Sample)]) -> f64 {
    let params = crate::test_support::params();
    crate::measure::RunData::of(&params, samples, 100)
        .number("viscosity")
        .unwrap()
}

/// Result of reading the runs of a store.
fn read(path: &Path) -> Result<(Vec<crate::measure::PointRun>, Vec<FailureLine>), StoreError> {
    let store = Store::open_read_only(path)?;
    let found = (store.point_runs()?, store.failures(9)?);
    store.campaign_text()?;
    store.provenance()?;
    Ok(found)
}

#[test]
fn no_altered_value_of_what_is_shown_gets_into_a_table_and_a_run_computes_it_again() {
    for statement in [
        "UPDATE results SET viscosity = viscosity * 1.0000001",
        "UPDATE results SET viscosity_median = 9.0",
        "DELETE FROM results",
        "UPDATE cases SET state = 'pending' WHERE state = 'done'",
        "UPDATE cases SET state = 'pending' WHERE state = 'jammed'",
        "UPDATE cases SET state = 'pending' WHERE state = 'failed'",
        "UPDATE cases SET state = 'dune' WHERE state = 'done'",
        "UPDATE cases SET state = 'done' WHERE state = 'failed'",
        "UPDATE cases SET state = 'failed' WHERE state = 'done'",
        "UPDATE cases SET state = 'running', owner = 99 WHERE state = 'done'",
        "UPDATE cases SET position = 7 WHERE position = 1",
        "UPDATE cases SET position = NULL WHERE position = 3",
        "UPDATE cases SET counts = 0 WHERE position = 3",
        "UPDATE cases SET steps = 150",
        "DELETE FROM cases WHERE state = 'failed'",
        "UPDATE points SET params = replace(params, '0.3', '0.4')",
        "UPDATE points SET axes = json_set(axes, '$.friction', 0.7, '$.spheres', 99)",
        "UPDATE cases SET seed = seed + 1",
        "UPDATE failures SET error = 'nothing'",
        "DELETE FROM failures",
        "UPDATE processes SET build = 'another'",
        "UPDATE campaign SET name = 'smoll'",
        "UPDATE campaign SET entered = replace(entered, '0.5', '0.6')",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let store = ended(directory.path());
        let path = store.path().to_owned();
        drop(store);
        let before = read(&path).unwrap().0.len();
        alter(&path, statement);
        let refused = read(&path);
        assert!(
            matches!(refused, Err(StoreError::Damaged { .. })),
            "{statement}: {refused:?}"
        );
        assert!(!check(&path).unwrap().findings.is_empty(), "{statement}");
        let mut store = Store::open(&path).unwrap();
        assert!(!store.forget_damaged().unwrap().is_empty(), "{statement}");
        drop(store);
        let store = Store::at(&path, &campaign(CAMPAIGN));
        assert_eq!(store.point_runs().unwrap().len(), before, "{statement}");
        assert!(check(&path).unwrap().findings.is_empty(), "{statement}");
    }
}

#[test]
fn no_altered_case_process_or_rule_is_shown() {
    for statement in [
        "UPDATE cases SET seed = 0 WHERE position = 2",
        "UPDATE cases SET steps = 0 WHERE position = 0",
        "DELETE FROM results WHERE case_id = 1",
        "UPDATE processes SET physics_version = 99",
        "DELETE FROM cases WHERE position = 3",
        "UPDATE cases SET rule = 0",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let store = ended(directory.path());
        let (path, key) = (store.path().to_owned(), store.key_of("1").unwrap());
        assert!(store.details(&key).is_ok());
        drop(store);
        alter(&path, statement);
        let store = Store::open_read_only(&path).unwrap();
        let shown = store.details(&key).map(drop);
        for refused in [shown, store.verify()] {
            assert!(
                matches!(refused, Err(StoreError::Damaged { .. })),
                "{statement}: {refused:?}"
            );
        }
    }
}

#[test]
fn no_altered_frame_is_shown_or_merged() {
    for change in [
        "step = step + 1000",
        "strain = strain + 1.0",
        "data = zeroblob(9)",
        "digest = digest + 1",
        "case_id = (SELECT max(id) FROM cases)",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let mut store = open(directory.path());
        store.register(1).unwrap();
        let claims = [(); 4].map(|()| store.next().unwrap());
        for claim in &claims[..2] {
            let run = finished_as(claim, State::Done).filmed();
            store.end(claim, &run).unwrap();
        }
        let keys = claims.each_ref().map(|claim| claim.key.clone());
        store.leave().unwrap();
        let path = store.path().to_owned();
        drop(store);
        alter(
            &path,
            &format!(
                "UPDATE frames SET {change} WHERE step = 40 AND case_id = (SELECT min(case_id) FROM frames)"
            ),
        );
        let shown = Store::open_read_only(&path).unwrap();
        let refused = |key: &String| {
            let shown = shown.frames(key, 1);
            matches!(shown, Err(StoreError::Damaged { .. }))
        };
        assert!(keys.iter().any(refused), "{change}");
        assert!(!check(&path).unwrap().findings.is_empty(), "{change}");
    }
}

#[test]
fn lost_frames_are_found_and_computed_again() {
    for which in ["step % 8 = 0", "step = 196", "step >= 100", "true"] {
        let directory = tempfile::tempdir().unwrap();
        let mut store = open(directory.path());
        store.register(1).unwrap();
        let claim = store.next().unwrap();
        let run = finished_as(&claim, State::Done).filmed();
        store.end(&claim, &run).unwrap();
        let path = store.path().to_owned();
        drop(store);
        assert!(check(&path).unwrap().findings.is_empty());
        alter(&path, &format!("DELETE FROM frames WHERE {which}"));
        let found = check(&path).unwrap().findings;
        assert_eq!(found[0].key.as_ref(), Some(&claim.key), "{which}");
        let shown = Store::open_read_only(&path).unwrap().frames(&claim.key, 1);
        assert!(matches!(shown, Err(StoreError::Damaged { .. })), "{which}");
        // Neither a merge nor the store itself keeps the run without them.
        let mut new = Store::at(&directory.path().join("new.sqlite"), &campaign(CAMPAIGN));
        let merged = new
            .merge(MergedCases::All, std::slice::from_ref(&path))
            .unwrap();
        assert_eq!((merged.results, merged.unreadable), (0, 1), "{which}");
        let mut store = Store::open(&path).unwrap();
        store.forget_damaged().unwrap();
        drop(store);
        for mut store in [new, Store::at(&path, &campaign(CAMPAIGN))] {
            store.register(1).unwrap();
            let again = store.next().unwrap();
            assert_eq!(again.key, claim.key);
            assert_eq!(store.restart(&again).unwrap().frames_from, Some(0));
            store.release([&again]).unwrap();
        }
    }
}

#[test]
fn frames_belong_to_the_run_and_are_computed_on_request() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let plain = store.next().unwrap();
    let filmed = store.next().unwrap();
    store
        .end(&plain, &finished_as(&plain, State::Done))
        .unwrap();
    let run = finished_as(&filmed, State::Done).filmed();
    store.end(&filmed, &run).unwrap();
    // Begun before and after the discarded strain.
    let early = store.next().unwrap();
    store.keep_state(&early, 40, &checkpoint(40)).unwrap();
    let late = store.next().unwrap();
    store.keep_state(&late, 160, &checkpoint(160)).unwrap();
    store.release([&early, &late]).unwrap();
    assert_eq!(store.has_frames(&filmed.key, 100).unwrap(), Ok(()));
    assert_eq!(store.has_frames(&plain.key, 100).unwrap(), Err(None));
    assert_eq!(store.request_frames().unwrap(), 2);
    assert_eq!(store.request_frames().unwrap(), 0);
    let counts = store.counts().unwrap();
    assert_eq!((counts.done, counts.pending), (1, 3));
    for _ in 0..3 {
        let claim = store.next().unwrap();
        let from = claim.checkpoints.first();
        let rows = match from {
            Some(Ok(from)) => store.resume(&claim, from).unwrap().unwrap(),
            _ => store.restart(&claim).unwrap(),
        };
        let begins = if claim.key == early.key { 40 } else { 0 };
        assert_eq!(rows.frames_from, Some(begins));
    }
}

/// Columns of a table.
fn columns(table: &str) -> Vec<String> {
    let directory = tempfile::tempdir().unwrap();
    let store = ended(directory.path());
    store
        .connection
        .prepare("SELECT name FROM pragma_table_info(?1) WHERE name != 'case_id'")
        .unwrap()
        .query_map([table], |row| row.get(0))
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap()
}

/// Adds one to a column of the rows of the first case.
fn alter_column(path: &Path, table: &str, column: &str, condition: &str) {
    alter(
        path,
        &format!(
            "UPDATE {table} SET {column} = CASE WHEN typeof({column}) = 'blob' THEN zeroblob(9)
                 WHEN typeof({column}) = 'text' THEN {column} || 'x' ELSE coalesce({column}, 0) + 1 END
             WHERE {condition} case_id = (SELECT id FROM cases WHERE position = 0)"
        ),
    );
}

#[test]
fn no_altered_sample_is_averaged_shown_or_merged() {
    for column in columns("samples") {
        let directory = tempfile::tempdir().unwrap();
        let store = ended(directory.path());
        let (path, key) = (
            store.path().to_owned(),
            store.point_runs().unwrap()[0].key.clone(),
        );
        drop(store);
        alter_column(&path, "samples", &column, "step = 160 AND");
        let store = Store::open_read_only(&path).unwrap();
        assert!(
            matches!(store.trace(&key), Err(StoreError::Damaged { .. })),
            "{column}"
        );
        drop(store);
        let later = CAMPAIGN.replace("discard = 0.5", "discard = 0.8");
        let again = Store::open(&path).unwrap().take_in(&campaign(&later));
        assert!(
            matches!(again, Err(StoreError::Damaged { .. })),
            "{column}: {again:?}"
        );
        let mut new = Store::at(&directory.path().join("new.sqlite"), &campaign(CAMPAIGN));
        let merged = new.merge(MergedCases::All, &[path]).unwrap();
        assert_eq!((merged.results, merged.unreadable), (2, 1), "{column}");
    }
}

#[test]
fn no_altered_column_of_a_result_is_shown_or_merged() {
    for column in columns("results") {
        let directory = tempfile::tempdir().unwrap();
        let store = ended(directory.path());
        let path = store.path().to_owned();
        drop(store);
        alter_column(&path, "results", &column, "");
        assert_eq!(check(&path).unwrap().findings.len(), 1, "{column}");
        assert!(read(&path).is_err(), "{column}");
        let mut new = Store::at(&directory.path().join("new.sqlite"), &campaign(CAMPAIGN));
        let merged = new.merge(MergedCases::All, &[path]).unwrap();
        assert_eq!((merged.results, merged.unreadable), (2, 1), "{column}");
    }
}

#[test]
fn running_case_of_a_missing_owner_is_continued() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    store.next().unwrap();
    let path = store.path().to_owned();
    let mut heir = Store::at(&path, &campaign(CAMPAIGN));
    heir.register(1).unwrap();
    alter(&path, "UPDATE cases SET owner = 77 WHERE state = 'running'");
    assert_eq!(heir.release_dead().unwrap(), 1);
    assert_eq!(heir.counts().unwrap().running, 0);
}

#[test]
fn owner_with_a_heartbeat_a_day_ahead_is_not_waited_for() {
    let directory = tempfile::tempdir().unwrap();
    let (mut far, mut heir) = (open(directory.path()), open(directory.path()));
    far.register(1).unwrap();
    heir.register(1).unwrap();
    far.next().unwrap();
    far.connection
        .execute(
            "UPDATE processes SET host = 'elsewhere', heartbeat = heartbeat + 86400000 WHERE id = ?1",
            [far.me()],
        )
        .unwrap();
    assert_eq!(heir.release_dead().unwrap(), 1);
}

/// An intact store and its tables.
static WHOLE: std::sync::LazyLock<(Vec<u8>, String)> = std::sync::LazyLock::new(|| {
    let directory = tempfile::tempdir().unwrap();
    let store = ended(directory.path());
    let path = store.path().to_owned();
    drop(store);
    let tables = tables(&path).unwrap();
    (std::fs::read(path).unwrap(), tables)
});

/// The complete report of a store.
fn tables(path: &Path) -> Result<String, crate::report::ReportError> {
    let store = Store::open_read_only(path)?;
    let report = crate::report::Report::of(&store, &crate::report::Selection::default())?;
    let mut tables = Vec::new();
    crate::report::write_text(&report, crate::report::Shape::default(), None, &mut tables)?;
    crate::report::write_json(&report, &mut tables)?;
    Ok(String::from_utf8(tables).unwrap())
}

/// One of the ways in which a file is damaged.
fn damaged(whole: &[u8], way: u8, at: usize, other: usize, put: &[u8]) -> Vec<u8> {
    const PAGE: usize = 4096;
    let mut bytes = whole.to_vec();
    let (at, other) = (at % bytes.len(), other % bytes.len());
    let page = at / PAGE * PAGE;
    match way % 4 {
        0 => {
            for (place, byte) in bytes[at..].iter_mut().zip(put) {
                *place = *byte;
            }
        }
        1 => bytes[page..page + PAGE].fill(put[0]),
        2 => bytes.copy_within(page..page + PAGE, other / PAGE * PAGE),
        _ => bytes.truncate(at),
    }
    bytes
}

proptest::proptest! {
    // A case takes a thousand times as long as one of other properties. PROPTEST_CASES overrides
    // this number.
    #![proptest_config(proptest::test_runner::Config::with_cases(8))]
    #[test]
    fn random_damage_crashes_no_reader_and_gives_no_other_table(
        way in proptest::prelude::any::<u8>(),
        at in proptest::prelude::any::<usize>(),
        other in proptest::prelude::any::<usize>(),
        put in proptest::collection::vec(proptest::prelude::any::<u8>(), 1..20),
    ) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("damaged.sqlite");
        std::fs::write(&path, damaged(&WHOLE.0, way, at, other, &put)).unwrap();
        if let Ok(tables) = tables(&path) {
            proptest::prop_assert_eq!(&tables, &WHOLE.1);
        }
        let _ = check(&path);
        // The recovered part is intact: it holds only computed data.
        let mut saved = Store::at(&directory.path().join("saved.sqlite"), &campaign(CAMPAIGN));
        if saved.merge(MergedCases::All, std::slice::from_ref(&path)).is_ok() {
            let right = mean_viscosity(&first_samples(50));
            for run in saved.point_runs().unwrap() {
                proptest::prop_assert!(run.number("viscosity").is_none_or(|v| (v - right).abs() < 1e-12));
            }
        }
    }
}

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

#[test]
fn values_of_types_that_no_store_has_are_not_taken_over() {
    for statement in [
        "UPDATE cases SET steps_done = 'much' WHERE id = 1",
        "UPDATE results SET wall_time_s = x'00ff'",
        "UPDATE results SET resumed = 'often'",
        "UPDATE samples SET contacts = 'some'",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let path = shard(directory.path());
        craft(&path, statement);
        let mut store = own(directory.path());
        let merged = store
            .merge(MergedCases::All, std::slice::from_ref(&path))
            .unwrap();
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
    let merged = store
        .merge(MergedCases::All, std::slice::from_ref(&pipe))
        .unwrap();
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
    let mut measured = rows(first_samples(2));
    measured.frames_from = Some(0);
    measured.frames = [0, 4].map(|step| (step, frame())).into();
    shard.fail(&claim, failure(7), &measured).unwrap();
    let path = shard.path().to_owned();
    drop(shard);
    let mut store = open(directory.path());
    let merged = store
        .merge(MergedCases::All, std::slice::from_ref(&path))
        .unwrap();
    assert_eq!(merged.failures, 1);
    let details = store.details(&claim.key).unwrap();
    assert_eq!((details.samples.len(), details.frames), (2, 2));
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
        let _ = store.merge(MergedCases::All, std::slice::from_ref(&path));
        drop(store);
        let store = Store::open(&directory.path().join("small.sqlite")).unwrap();
        proptest::prop_assert!(check(store.path()).unwrap().findings.is_empty());
        for run in store.point_runs().unwrap() {
            let is_right = run.number("viscosity").is_none_or(|viscosity| {
                let mean = mean_viscosity(&first_samples(50));
                (viscosity - mean).abs() < 1e-12
            });
            proptest::prop_assert!(is_right, "{:?}", run.number("viscosity"));
        }
    }
}
