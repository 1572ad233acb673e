//! External events: dead owners, locks, deletion, damage, other versions.

use super::*;
use crate::system::process;

/// A store with one finished case, one running with two checkpoints, and one failed.
fn mixed(directory: &Path) -> Store {
    let mut store = open(directory);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    let whole = finished_as(&claim, State::Done);
    store.end(&claim, &whole).unwrap();
    let claim = store.next().unwrap();
    store
        .fail(&claim, failure(37), &rows(first_samples(0)))
        .unwrap();
    let claim = store.next().unwrap();
    for steps in [20, 40] {
        store.keep_state(&claim, steps, &checkpoint(steps)).unwrap();
    }
    store.release([&claim]).unwrap();
    store
}

/// Simulates deaths of the owner of the next case.
fn die(directory: &Path, times: u32, same_boot: bool) -> Store {
    let mut heir = open(directory);
    heir.register(1).unwrap();
    for _ in 0..times {
        let mut dead = open(directory);
        dead.register(1).unwrap();
        dead.next().unwrap();
        let change = if same_boot {
            "start = '1'"
        } else {
            "boot = 'before'"
        };
        dead.connection
            .execute(
                &format!("UPDATE processes SET {change} WHERE id = ?1"),
                [dead.me()],
            )
            .unwrap();
        assert_eq!(heir.release_dead().unwrap(), 1);
    }
    heir
}

const ONE: &str = "seeds = 2";

/// A directory with a store of a single case.
fn single() -> (tempfile::TempDir, String) {
    let directory = tempfile::tempdir().unwrap();
    let text = CAMPAIGN
        .replace(ONE, "seeds = 1")
        .replace("[0.1, inf]", "inf");
    drop(Store::at(
        &directory.path().join("small.sqlite"),
        &campaign(&text),
    ));
    (directory, text)
}

/// The store of [`single`], opened again.
fn again(directory: &Path, text: &str) -> Store {
    Store::at(&directory.join("small.sqlite"), &campaign(text))
}

#[test]
fn case_that_kills_its_process_again_and_again_ends_as_failed() {
    let (directory, text) = single();
    let mut heir = again(directory.path(), &text);
    heir.register(1).unwrap();
    for death in 1..=DEATH_LIMIT {
        let mut dead = again(directory.path(), &text);
        dead.register(1).unwrap();
        let claim = dead.next().unwrap();
        if death == 1 {
            dead.keep_state(&claim, 20, &checkpoint(20)).unwrap();
        }
        mark_owners_dead(&dead);
        heir.connection
            .execute(
                "UPDATE processes SET start = ?2 WHERE id = ?1",
                params![heir.me(), "alive"],
            )
            .unwrap();
        assert_eq!(heir.counts().unwrap().running, 1);
        assert_eq!(heir.release_dead().unwrap(), 1);
    }
    assert_eq!(heir.counts().unwrap().failed, 1);
    let line = heir.failures(9).unwrap().remove(0);
    assert!(
        line.failed.error.contains("5 times in a row"),
        "{}",
        line.failed.error
    );
    assert_eq!(
        (line.failed.step, line.failed.attempt),
        (20, u64::from(DEATH_LIMIT))
    );
    let state = heir
        .replays(None, 9)
        .unwrap()
        .remove(0)
        .failed
        .snapshot
        .unwrap();
    assert!(state.contains("\"centres\""), "{state}");
    heir.retry_failed().unwrap();
    assert!(heir.next().is_some());
}

#[test]
fn deaths_between_which_there_was_a_checkpoint_or_a_power_cut_are_no_fault_of_the_case() {
    let (directory, text) = single();
    let mut heir = again(directory.path(), &text);
    heir.register(1).unwrap();
    for round in 1..=2 * u64::from(DEATH_LIMIT) {
        let mut dead = again(directory.path(), &text);
        dead.register(1).unwrap();
        let claim = dead.next().unwrap();
        dead.keep_state(&claim, 20 * round, &checkpoint(20 * round))
            .unwrap();
        dead.connection
            .execute(
                "UPDATE processes SET start = '1' WHERE id = ?1",
                [dead.me()],
            )
            .unwrap();
        assert_eq!(heir.release_dead().unwrap(), 1);
    }
    assert_eq!(heir.counts().unwrap().pending, 1);
    drop(heir);
    let other = tempfile::tempdir().unwrap();
    drop(open(other.path()));
    let heir = die(other.path(), 2 * DEATH_LIMIT, false);
    assert_eq!(heir.counts().unwrap().failed, 0);
}

#[test]
fn suspect_waits_until_there_is_no_other_case() {
    let directory = tempfile::tempdir().unwrap();
    let mut heir = die(directory.path(), 3, true);
    let suspect: String = heir
        .connection
        .query_row("SELECT key FROM cases WHERE deaths = 3", [], |row| {
            row.get(0)
        })
        .unwrap();
    let keys: Vec<String> = (0..4).map(|_| heir.next().unwrap().key).collect();
    assert_eq!(keys[3], suspect);
}

#[test]
fn owner_on_another_host_is_taken_over_after_the_limit_and_not_before() {
    let directory = tempfile::tempdir().unwrap();
    let (mut far, mut heir) = (open(directory.path()), open(directory.path()));
    far.register(1).unwrap();
    heir.register(1).unwrap();
    far.next().unwrap();
    let silence = |seconds: i64| {
        far.connection
            .execute(
                "UPDATE processes SET host = 'elsewhere', heartbeat = ?2 WHERE id = ?1",
                params![far.me(), process::now() - seconds * 1000],
            )
            .unwrap();
    };
    silence(process::HEARTBEAT_LIMIT.as_secs().cast_signed() - 10);
    assert_eq!(heir.release_dead().unwrap(), 0);
    silence(process::HEARTBEAT_LIMIT.as_secs().cast_signed() + 10);
    assert_eq!(heir.release_dead().unwrap(), 1);
}

#[test]
fn lock_held_by_another_program_is_waited_for_and_then_named() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let other = rusqlite::Connection::open(store.path()).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let error = store.heartbeat().unwrap_err();
    assert!(
        error.to_string().contains("another program holds the lock"),
        "{error}"
    );
    assert!(error.is_of_the_store());
    other.execute_batch("ROLLBACK").unwrap();
    store.heartbeat().unwrap();
}

#[test]
fn whole_store_is_merged_whole() {
    let directory = tempfile::tempdir().unwrap();
    let store = mixed(directory.path());
    let mut new = Store::at(&directory.path().join("new.sqlite"), &campaign(CAMPAIGN));
    let merged = new
        .merge(MergedCases::All, &[store.path().to_owned()])
        .unwrap();
    assert_eq!(
        (
            merged.results,
            merged.failures,
            merged.checkpoints,
            merged.unreadable
        ),
        (1, 1, 1, 0)
    );
    let one = |store: &Store| {
        store
            .point_runs()
            .unwrap()
            .into_iter()
            .find(|run| run.state == State::Done)
    };
    let (before, after) = (one(&store).unwrap(), one(&new).unwrap());
    assert_eq!(format!("{before:?}"), format!("{after:?}"));
}

#[test]
fn damage_anywhere_neither_crashes_nor_lets_wrong_numbers_through() {
    let directory = tempfile::tempdir().unwrap();
    let store = mixed(directory.path());
    let path = store.path().to_owned();
    let good = format!(
        "{:?}",
        store
            .point_runs()
            .unwrap()
            .iter()
            .find(|run| run.state == State::Done)
    );
    drop(store);
    let whole = std::fs::read(&path).unwrap();
    let broken = directory.path().join("broken.sqlite");
    let mut saved = 0;
    let pages = whole.len() / 4096;
    for (page, cut) in (0..pages)
        .map(|page| (page, false))
        .chain((pages / 2..pages).map(|page| (page, true)))
    {
        let mut bytes = whole.clone();
        if cut {
            bytes.truncate(page * 4096);
        } else {
            bytes[page * 4096..(page + 1) * 4096].fill(0x5a);
        }
        std::fs::write(&broken, bytes).unwrap();
        let to = directory.path().join(format!("new-{page}-{cut}.sqlite"));
        let mut new = Store::at(&to, &campaign(CAMPAIGN));
        let merged = new
            .merge(MergedCases::All, std::slice::from_ref(&broken))
            .unwrap();
        for run in new.point_runs().unwrap() {
            if run.state == State::Done {
                assert_eq!(format!("{:?}", Some(run)), good);
            }
        }
        assert_eq!(new.counts().unwrap().total(), 4);
        saved += merged.results;
    }
    assert!(saved > 0, "what can be read is merged");
}
