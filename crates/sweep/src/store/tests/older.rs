//! Stores of earlier programs, which knew fewer numbers and axes.

use super::*;

/// Takes a number from samples and results, and an axis from the points and the views, as in a
/// store of a program that did not know them.
fn forget(path: &Path) {
    let connection = rusqlite::Connection::open(path).unwrap();
    let views = "DROP VIEW runs; DROP VIEW axes;
         CREATE VIEW axes AS SELECT id, json_extract(axes, '$.friction') AS friction FROM points;
         CREATE VIEW runs AS SELECT c.key, c.state, a.friction, c.seed FROM cases c JOIN axes a ON a.id = c.point";
    let forgotten = "ALTER TABLE samples DROP COLUMN core_fraction;
         ALTER TABLE samples DROP COLUMN layering;
         ALTER TABLE samples DROP COLUMN displacement_yy;
         ALTER TABLE results DROP COLUMN core_fraction;
         ALTER TABLE results DROP COLUMN layering;
         ALTER TABLE results DROP COLUMN diffusivity_yy;
         UPDATE points SET axes = json_remove(axes, '$.direction')";
    connection.execute_batch(views).unwrap();
    connection.execute_batch(forgotten).unwrap();
    points::SEALED.seal(&connection, "true", []).unwrap();
}

/// A store of four runs with one result, of an earlier program.
fn older(folder: &Path) -> std::path::PathBuf {
    let mut store = open(folder);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    let path = store.path().to_owned();
    drop(store);
    forget(&path);
    path
}

/// Number of results.
fn results(store: &Store) -> usize {
    let runs = store.point_runs().unwrap();
    runs.iter()
        .filter(|run| run.number("viscosity").is_some())
        .count()
}

#[test]
fn an_older_store_is_read_with_empty_numbers_and_not_changed() {
    let directory = tempfile::tempdir().unwrap();
    let path = older(directory.path());
    let before = std::fs::read(&path).unwrap();
    let store = Store::open_read_only(&path).unwrap();
    let runs = store.point_runs().unwrap();
    let done = runs.iter().find(|run| run.state == State::Done).unwrap();
    assert!(done.number("viscosity").is_some());
    for name in ["core_fraction", "layering", "diffusivity_yy"] {
        assert_eq!(done.number(name), None, "{name}");
    }
    assert_eq!(
        store.samples(&done.key).unwrap(),
        finished(State::Done).rows.samples
    );
    assert!(check(&path).unwrap().findings.is_empty());
    let report = crate::report::Report::of(&store, &crate::report::Selection::default()).unwrap();
    assert_eq!(
        report.points.iter().map(|point| point.seeds).sum::<u64>(),
        1
    );
    // Another version of its campaign is shown too.
    let fewer = campaign(&CAMPAIGN.replace("seeds = 2", "seeds = 1"));
    let shown = crate::store::StoreSource::new(path.clone(), Some(fewer))
        .open()
        .unwrap();
    assert_eq!(results(&shown), 1);
    drop((store, shown));
    assert!(std::fs::read(&path).unwrap() == before);
}

#[test]
fn frames_of_an_earlier_version_are_refused_by_what_they_lack() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    let run = finished_as(&claim, State::Done).filmed();
    store.end(&claim, &run).unwrap();
    let case = "SELECT id FROM cases WHERE key = ?1";
    let case = store
        .connection
        .query_row(case, [&claim.key], |row| row.get(0));
    let mut data = crate::trajectory::encode(&frame()).unwrap();
    data[0] = 2;
    let at = (case.unwrap(), claim.key.as_str());
    super::super::frames::put(&store.connection, at, 40, 0.2, data).unwrap();
    let refused = store.frames(&claim.key, 1).unwrap_err();
    assert!(matches!(&refused, StoreError::EarlierFrames { key } if *key == claim.key));
    // The frame is whole, and so is the run.
    let path = store.path().to_owned();
    drop(store);
    assert!(check(&path).unwrap().findings.is_empty());
    assert_eq!(results(&Store::open_read_only(&path).unwrap()), 1);
}

#[test]
fn an_older_store_is_continued() {
    let directory = tempfile::tempdir().unwrap();
    let path = older(directory.path());
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    assert_eq!(results(&store), 2);
    assert!(store.forget_damaged().unwrap().is_empty());
    drop(store);
    let found: (f64, f64) = rusqlite::Connection::open(&path)
        .unwrap()
        .query_row(
            "SELECT direction, viscosity FROM runs WHERE state = 'done' AND core_fraction IS NULL AND key = ?1",
            [&claim.key],
            |row| row.try_into(),
        )
        .unwrap();
    assert!(found.0 == 1.0 || found.0.is_nan(), "{found:?}");
}

#[test]
fn a_store_with_numbers_or_axes_of_a_later_program_is_refused_and_not_changed() {
    for (change, unknown) in [
        ("ALTER TABLE results ADD COLUMN smell REAL", "results.smell"),
        (
            "DROP VIEW axes; UPDATE points SET axes = json_set(axes, '$.smell', 0.5);
             CREATE VIEW axes AS SELECT id, json_extract(axes, '$.friction') AS friction,
                 json_extract(axes, '$.smell') AS smell FROM points",
            "the axis smell",
        ),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let path = open(directory.path()).path().to_owned();
        let connection = rusqlite::Connection::open(&path).unwrap();
        connection.execute_batch(change).unwrap();
        drop(connection);
        let before = std::fs::read(&path).unwrap();
        for refused in [Store::open(&path), Store::open_read_only(&path)] {
            let error = refused.err().unwrap();
            assert!(
                matches!(&error, StoreError::Later { column, .. } if column == unknown),
                "{error}"
            );
            assert!(error.to_string().contains("a later version"), "{error}");
        }
        assert!(std::fs::read(&path).unwrap() == before, "{unknown}");
    }
}
