//! Logs that are a stranger's, or are taken away from under a live process.

use super::*;
use crate::store::place::log_of;

/// A store with one result in the file itself and more in its log, as a killed process leaves it; the log alone holds what
/// came after the copy that is given back.
fn killed(directory: &Path) -> (std::path::PathBuf, Vec<u8>) {
    let mut store = open(directory);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
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
fn kill(store: Store) {
    store
        .connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)
        .unwrap();
    drop(store);
}

fn done(path: &Path) -> u64 {
    Store::open_read_only(path).unwrap().counts().unwrap().done
}

/// A store all of whose runs have ended, left in peace.
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
fn log_of_another_store_is_refused_and_salvage_leaves_it_out() {
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
    let saved = salvage_in_place(&path, None).unwrap();
    assert!(saved.warning.unwrap().contains("left out"));
    let counts = Store::open(&path).unwrap().counts().unwrap();
    assert_eq!((counts.jammed, counts.done), (4, 0));
    // Nothing was thrown away.
    let aside = saved.set_aside.unwrap();
    assert!(aside.exists() && log_of(&aside).exists());
}

#[test]
fn log_of_a_later_day_of_the_same_store_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    // A copy of the file alone, from before the first result: its log would go on from a state it never had.
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
fn copy_from_before_the_changes_in_the_log_goes_on_with_them() {
    let directory = tempfile::tempdir().unwrap();
    let (path, early) = killed(directory.path());
    // The state from which the log goes on, whichever way it came there.
    std::fs::write(&path, early).unwrap();
    assert_eq!(done(&path), 3);
}

#[test]
fn damaged_log_is_told_and_what_comes_before_the_damage_is_kept() {
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    let log = log_of(&path);
    let whole = std::fs::read(&log).unwrap();
    // In the header, in the first page and in a later one.
    for at in [5, 20, 200, 32 + 6 * 4120 + 2000] {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        std::fs::write(&log, bytes).unwrap();
        let _ = std::fs::remove_file(path.with_extension("sqlite-shm"));
        let store = Store::open_read_only(&path).unwrap();
        let told = store.warning().unwrap_or_default().to_owned();
        assert!(told.contains("damaged"), "byte {at}: {told:?}");
        assert!((1..=3).contains(&store.counts().unwrap().done));
        kill(store);
    }
    std::fs::write(&log, &whole).unwrap();
    let _ = std::fs::remove_file(path.with_extension("sqlite-shm"));
    let store = Store::open_read_only(&path).unwrap();
    assert_eq!((store.warning(), store.counts().unwrap().done), (None, 3));
}

#[test]
fn log_that_was_cut_or_taken_away_at_rest_is_told_until_somebody_writes() {
    let shm = |path: &Path| place::with_suffix(path, "-shm");
    let directory = tempfile::tempdir().unwrap();
    let (path, _) = killed(directory.path());
    let (log, pages) = (
        std::fs::read(log_of(&path)).unwrap(),
        std::fs::read(shm(&path)).unwrap(),
    );
    let file = std::fs::read(&path).unwrap();
    // What comes after the pages that the index counts is left over from before the log was begun anew.
    let counted = u32::from_ne_bytes(*pages[16..].first_chunk().unwrap());
    let used = 32 + 4120 * usize::try_from(counted).unwrap();
    // Nothing, its header alone, some of it, all but its last byte.
    for kept in [None, Some(0), Some(32), Some(32 + 5 * 4120), Some(used - 1)] {
        let lay_out = || {
            std::fs::write(&path, &file).unwrap();
            std::fs::write(shm(&path), &pages).unwrap();
            match kept {
                None => std::fs::remove_file(log_of(&path)).unwrap(),
                Some(bytes) => std::fs::write(log_of(&path), &log[..bytes]).unwrap(),
            }
        };
        lay_out();
        for _ in 0..2 {
            let store = Store::open_read_only(&path).unwrap();
            let told = store.warning().unwrap_or_default().to_owned();
            assert!(told.contains("lost"), "{kept:?}: {told:?}");
            assert!((1..3).contains(&store.counts().unwrap().done));
        }
        let to = directory.path().join("saved.sqlite");
        let saved = salvage(&path, &to, None).unwrap();
        assert!(saved.warning.unwrap().contains("lost"), "{kept:?}");
        std::fs::remove_file(to).unwrap();
        let store = Store::open(&path).unwrap();
        assert!(store.warning().unwrap().contains("lost"), "{kept:?}");
        kill(store);
        assert_eq!(Store::open(&path).unwrap().warning(), None, "{kept:?}");
    }
    // A whole log has nothing to tell, nor has one whose changes are all in the store by now.
    std::fs::write(&path, &file).unwrap();
    std::fs::write(log_of(&path), &log).unwrap();
    std::fs::write(shm(&path), &pages).unwrap();
    let store = Store::open(&path).unwrap();
    assert_eq!((store.warning(), store.counts().unwrap().done), (None, 3));
    store
        .connection
        .execute_batch("PRAGMA wal_checkpoint(PASSIVE)")
        .unwrap();
    kill(store);
    std::fs::remove_file(log_of(&path)).unwrap();
    assert_eq!(Store::open_read_only(&path).unwrap().warning(), None);
    assert_eq!(done(&path), 3);
}

/// What is done to the log of a live store, and the word for it.
type Deed = (fn(&Path), &'static str);

#[test]
fn log_taken_away_replaced_or_cut_under_a_live_process_is_noticed_before_its_end() {
    let deeds: [Deed; 3] = [
        (
            |log| std::fs::remove_file(log).unwrap(),
            "robbed of its log",
        ),
        (
            |log| {
                std::fs::rename(log, log.with_extension("old")).unwrap();
                std::fs::write(log, "another log").unwrap();
            },
            "given another log",
        ),
        (
            |log| {
                let log = std::fs::File::options().write(true).open(log).unwrap();
                log.set_len(32).unwrap();
            },
            "the end of its log",
        ),
    ];
    for (deed, word) in deeds {
        let directory = tempfile::tempdir().unwrap();
        let mut store = open(directory.path());
        store.register(1).unwrap();
        let claim = store.next().unwrap();
        store.end(&claim, &finished(State::Done)).unwrap();
        deed(&log_of(store.path()));
        let error = store.leave().unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
        let StoreError::Gone { advice, path, .. } = store.rescue(error) else {
            panic!("another error");
        };
        kill(store);
        if word == "the end of its log" {
            // What was in it cannot be read by anybody.
            assert!(
                advice.contains("salvage") || advice.contains("put back"),
                "{advice}"
            );
        } else {
            assert!(advice.contains("put back in its place"), "{advice}");
            assert_eq!(done(&path), 1);
        }
    }
}

#[test]
fn complete_store_renamed_over_a_live_one_is_whole_afterwards_and_so_is_what_the_live_one_held() {
    let directory = tempfile::tempdir().unwrap();
    let other = tempfile::tempdir().unwrap();
    leave_complete_store(other.path());
    let mut live = open(directory.path());
    live.register(1).unwrap();
    let claim = live.next().unwrap();
    live.end(&claim, &finished(State::Done)).unwrap();
    let path = live.path().to_owned();
    std::fs::rename(other.path().join("small.sqlite"), &path).unwrap();
    let error = live.heartbeat().unwrap_err();
    let StoreError::Gone { advice, .. } = live.rescue(error) else {
        panic!("another error");
    };
    kill(live);
    assert!(advice.contains("--reuse"), "{advice}");
    let counts = Store::open(&path).unwrap().counts().unwrap();
    assert_eq!((counts.jammed, counts.done), (4, 0));
    let rescued = path.with_extension(format!("rescued-{}.sqlite", std::process::id()));
    assert_eq!(done(&rescued), 1);
}

#[test]
fn deleted_store_is_put_back_and_its_own_log_does_not_touch_it() {
    // With and without the log left behind, which is what `rm NAME.sqlite` does.
    for leave_log in [true, false] {
        let directory = tempfile::tempdir().unwrap();
        let mut store = open(directory.path());
        store.register(1).unwrap();
        for _ in 0..2 {
            let claim = store.next().unwrap();
            store.end(&claim, &finished(State::Done)).unwrap();
        }
        let path = store.path().to_owned();
        std::fs::remove_file(&path).unwrap();
        if !leave_log {
            std::fs::remove_file(log_of(&path)).unwrap();
        }
        let error = store.claim(1).unwrap_err();
        let StoreError::Gone { advice, .. } = store.rescue(error) else {
            panic!("another error");
        };
        kill(store);
        assert!(advice.contains("put back in its place"), "{advice}");
        assert_eq!(done(&path), 2);
        assert_eq!(open(directory.path()).counts().unwrap().done, 2);
    }
}
