//! Foreign logs, and logs removed while a process uses them.

use super::*;
use crate::store::place::log_of;

/// A store with one result in the file itself and more in its log, as a killed process leaves it;
/// only the log holds the changes after the returned copy.
fn killed(directory: &Path) -> (std::path::PathBuf, Vec<u8>) {
    let mut store = open(directory);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    mark_owners_dead(&store);
    store
        .connection
        .execute_batch("PRAGMA wal_checkpoint(RESTART)")
        .unwrap();
    let early = std::fs::read(store.path()).unwrap();
    for _ in 0..2 {
        let claim = store.next().unwrap();
        store.end(&claim, &finished(State::Done)).unwrap();
    }
    let path = store.path().to_owned();
    kill(store);
    (path, early)
}

/// Ends the use of a store as a kill does: nothing is checkpointed, and its log stays.
fn kill(mut store: Store) {
    store.process = None;
    store
        .connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)
        .unwrap();
    drop(store);
}

fn done(path: &Path) -> u64 {
    Store::open_read_only(path).unwrap().counts().unwrap().done
}

/// A store whose runs have all ended, closed cleanly.
fn leave_complete_store(directory: &Path) {
    let mut complete = open(directory);
    complete.register(1).unwrap();
    for _ in 0..4 {
        let claim = complete.next().unwrap();
        complete.end(&claim, &finished(State::Jammed)).unwrap();
    }
    complete.leave().unwrap();
}

#[test]
fn log_of_a_killed_process_is_replayed() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    assert!(log_of(&path).exists());
    assert_eq!(done(&path), 3);
    assert_eq!(Store::open(&path).unwrap().counts().unwrap().done, 3);
}

#[test]
fn log_of_another_store_is_refused_and_a_merge_leaves_it_out() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    let other = tempfile::tempdir().unwrap();
    leave_complete_store(other.path());
    // As `mv` does it: the log of the killed one stays beside the name.
    std::fs::rename(other.path().join("small.sqlite"), &path).unwrap();
    let before = std::fs::read(&path).unwrap();
    for refused in [Store::open(&path).err(), Store::open_read_only(&path).err()] {
        assert!(
            matches!(refused, Some(StoreError::ForeignLog { .. })),
            "{refused:?}"
        );
    }
    assert_eq!(std::fs::read(&path).unwrap(), before, "not replayed");
    let mut new = Store::at(&directory.path().join("new.sqlite"), &campaign(CAMPAIGN));
    let merged = new.merge(&[path], false).unwrap();
    assert!(merged.damaged[0].reason.contains("left out"));
    let counts = new.counts().unwrap();
    assert_eq!((counts.jammed, counts.done), (4, 0));
}

#[test]
fn log_of_a_later_day_of_the_same_store_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    // A copy of only the file, from before the first result: the log would continue from a state
    // that it never had.
    let fresh = tempfile::tempdir().unwrap();
    let backup = {
        let store = open(fresh.path());
        let path = store.path().to_owned();
        drop(store);
        std::fs::read(path).unwrap()
    };
    std::fs::write(&path, backup).unwrap();
    assert!(matches!(
        Store::open(&path),
        Err(StoreError::ForeignLog { .. })
    ));
}

#[test]
fn copy_from_before_the_changes_in_the_log_continues_with_them() {
    let directory = tempfile::tempdir().unwrap();
    let (path, early) = killed(directory.path());
    // The state from which the log continues.
    std::fs::write(&path, early).unwrap();
    assert_eq!(done(&path), 3);
}

#[test]
fn damaged_log_is_reported_and_earlier_changes_are_kept() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    let log = log_of(&path);
    let whole = std::fs::read(&log).unwrap();
    for at in [5, 20, 200, 32 + 6 * 4120 + 2000] {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        std::fs::write(&log, bytes).unwrap();
        let _ = std::fs::remove_file(path.with_extension("sqlite-shm"));
        let store = Store::open_read_only(&path).unwrap();
        let message = store.warning().unwrap_or_default().to_owned();
        assert!(message.contains("lost"), "byte {at}: {message:?}");
        assert!((1..=3).contains(&store.counts().unwrap().done));
        kill(store);
    }
    std::fs::write(&log, &whole).unwrap();
    let _ = std::fs::remove_file(path.with_extension("sqlite-shm"));
    let store = Store::open_read_only(&path).unwrap();
    assert_eq!((store.warning(), store.counts().unwrap().done), (None, 3));
}

#[test]
fn log_removed_at_rest_is_reported_until_a_process_works() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    rusqlite::Connection::open(&path)
        .unwrap()
        .execute_batch("PRAGMA wal_checkpoint(PASSIVE)")
        .unwrap();
    let _ = std::fs::remove_file(log_of(&path));
    for _ in 0..2 {
        let store = Store::open_read_only(&path).unwrap();
        assert!(store.warning().unwrap().contains("may be lost"));
    }
    let mut store = Store::at(&path, &campaign(CAMPAIGN));
    assert!(store.warning().unwrap().contains("may be lost"));
    store.register(1).unwrap();
    store.release_dead().unwrap();
    drop(store);
    assert_eq!(Store::open_read_only(&path).unwrap().warning(), None);
}

#[test]
fn store_deleted_or_replaced_under_a_live_process_is_noticed_and_nothing_is_left_beside_another() {
    for (replace, with_log) in [(false, true), (false, false), (true, true)] {
        let directory = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        leave_complete_store(other.path());
        let mut live = open(directory.path());
        live.register(1).unwrap();
        let claim = live.next().unwrap();
        live.end(&claim, &finished(State::Done)).unwrap();
        let path = live.path().to_owned();
        if replace {
            std::fs::rename(other.path().join("small.sqlite"), &path).unwrap();
        } else {
            std::fs::remove_file(&path).unwrap();
        }
        if !with_log {
            std::fs::remove_file(log_of(&path)).unwrap();
        }
        let word = if replace { "replaced" } else { "deleted" };
        let error = live.heartbeat().unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
        assert!(error.is_of_the_store());
        assert!(live.make_sure_of_the_file().is_err());
        drop(live);
        assert!(!log_of(&path).exists());
        if replace {
            let counts = Store::open(&path).unwrap().counts().unwrap();
            assert_eq!((counts.jammed, counts.done), (4, 0));
        }
    }
}
