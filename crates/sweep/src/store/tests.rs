use super::*;
use crate::model::campaign::Campaign;
use crate::model::case::{CaseKey, PHYSICS_VERSION, State};
use crate::test_support::{counters, frame, sample, snapshot};
use rusqlite::{TransactionBehavior, params};
use std::path::Path;
use std::time::Duration;

mod damage;
mod doubts;
mod length;
mod merge;
mod older;
mod recovery;
mod rules;
mod runs;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 1.0
discard = 0.5
[[grid]]
area_fraction = 0.65
friction = 0.3
roughness = 0.01
shear_rate = [0.1, inf]
seeds = 2
spheres = 40
"#;

fn campaign(text: &str) -> Campaign {
    crate::campaign::parse("small.toml", text.into()).unwrap()
}

fn open(directory: &Path) -> Store {
    Store::at(&directory.join("small.sqlite"), &campaign(CAMPAIGN))
}

/// One case at a time.
impl Store {
    /// The store of a campaign, created if missing.
    fn at(path: &Path, campaign: &Campaign) -> Self {
        Self::enter(path, campaign).unwrap().0
    }

    fn take_in(&mut self, campaign: &Campaign) -> Result<Adoption, StoreError> {
        self.adopt(campaign)
    }

    fn next(&mut self) -> Option<Claim> {
        let mut claims = self.claim(1, Duration::ZERO).unwrap();
        assert!(claims.len() < 2);
        claims.pop()
    }

    /// Stores a checkpoint without samples.
    fn keep_state(&mut self, claim: &Claim, steps: u64, data: &[u8]) -> Result<(), StoreError> {
        self.keep(claim, steps, data, &NewRows::default())
    }

    fn end(&mut self, claim: &Claim, finished: &Finished) -> Result<(), StoreError> {
        let owned = self.finish(&[(claim, finished)])?;
        if owned == [true] {
            Ok(())
        } else {
            Err(claim.lost())
        }
    }

    fn shown(path: &Path, campaign: &Campaign) -> Self {
        let source = StoreSource::new(path.to_owned(), Some(campaign.clone()));
        source.open().unwrap()
    }
}

fn checkpoint(steps: u64) -> Vec<u8> {
    checkpoint_after(steps, &[])
}

/// A checkpoint of a run with these samples.
fn checkpoint_after(steps: u64, samples: &[(u64, sd_core::Sample)]) -> Vec<u8> {
    Checkpoint {
        snapshot: snapshot(steps),
        samples_digest: rows(samples.to_vec()).samples_digest,
        wall_time_s: 1.0,
        cpu_time_s: 0.9,
        resumed: 0,
    }
    .encode()
    .unwrap()
}

/// New rows of a run that has no others.
fn rows(samples: Vec<(u64, sd_core::Sample)>) -> NewRows {
    let mut rows = NewRows::default();
    for (step, sample) in samples {
        rows.add(step, sample);
    }
    rows
}

fn finished(state: State) -> Finished {
    Finished {
        state,
        rows: NewRows::default(),
        counters: counters(),
        steps: 200,
        wall_time_s: 2.0,
        cpu_time_s: 1.8,
        resumed: 0,
        last_state: Vec::new(),
    }
    .with(|samples| *samples = first_samples(50))
}

/// The first samples of a run.
fn first_samples(number: u64) -> Vec<(u64, sd_core::Sample)> {
    (0..number)
        .map(|n| (4 * n, sample(n as f64 * 0.02)))
        .collect()
}

impl Finished {
    /// With other samples.
    fn with(self, change: impl FnOnce(&mut Vec<(u64, sd_core::Sample)>)) -> Self {
        let mut samples = self.rows.samples;
        change(&mut samples);
        Self {
            last_state: checkpoint_after(self.steps, &samples),
            rows: rows(samples),
            ..self
        }
    }

    /// With frames of all its samples.
    fn filmed(mut self) -> Self {
        let steps = self.rows.samples.iter().map(|(step, _)| *step);
        self.rows.frames = steps.map(|step| (step, frame())).collect();
        self.rows.frames_from = Some(0);
        self
    }
}

/// A failed attempt that ended at a step.
fn failure(step: u64) -> Attempt {
    Attempt {
        error: "spheres 1 and 2 overlap".into(),
        step,
        strain: step as f64 * 0.005,
        pair: Some((1, 2)),
        gap: Some(-1e-3),
        snapshot: Some("{}".into()),
        ..Attempt::default()
    }
}

/// A finished run with samples at the steps of the case.
fn finished_as(claim: &Claim, state: State) -> Finished {
    finished(state).with(|samples| {
        for (number, (step, _)) in (0_u64..).zip(samples) {
            *step = number * claim.case.sample_stride;
        }
    })
}

/// Makes the owner of all running cases look like a dead process.
fn mark_owners_dead(store: &Store) {
    store
        .connection
        .execute("UPDATE processes SET start = '1'", [])
        .unwrap();
}

#[test]
fn cases_are_claimed_once_first_seeds_first() {
    let directory = tempfile::tempdir().unwrap();
    let (mut one, mut two) = (open(directory.path()), open(directory.path()));
    one.register(1).unwrap();
    two.register(1).unwrap();
    let mut seeds = Vec::new();
    let mut keys = std::collections::HashSet::new();
    for _ in 0..2 {
        for store in [&mut one, &mut two] {
            let claim = store.next().unwrap();
            seeds.push(claim.case.seed);
            keys.insert(claim.key);
        }
    }
    assert_eq!(seeds, [1, 1, 2, 2]);
    assert_eq!(keys.len(), 4);
    assert!(one.next().is_none());
}

#[test]
fn open_runs_take_as_long_as_those_of_their_point() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let work = store.work().unwrap();
    assert_eq!(store.time_left(&work).unwrap(), None);
    assert_eq!(store.remaining_cpu_s(&work).unwrap(), work.left);
    // The first seeds of both points: 2 s and 200 s.
    for seconds in [2.0, 200.0] {
        let claim = store.next().unwrap();
        let finished = Finished {
            wall_time_s: seconds,
            cpu_time_s: 0.5 * seconds,
            ..finished(State::Done)
        };
        store.end(&claim, &finished).unwrap();
        // Without a run of the other point its runs are judged by this one.
        let left = store.remaining_cpu_s(&store.work().unwrap()).unwrap();
        let wanted = if seconds == 2.0 { 3.0 } else { 101.0 };
        assert!((left - wanted).abs() < 1e-9, "{left}");
    }
    let claim = store.next().unwrap();
    store.keep_state(&claim, 100, &checkpoint(100)).unwrap();
    let work = store.work().unwrap();
    let left = store.time_left(&work).unwrap().unwrap();
    // Half a run of the first point, and one of the second.
    assert!((left - 201.0).abs() < 1e-9, "{left}");
}

#[test]
fn result_is_kept_and_averaged() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(2).unwrap();
    let claim = store.next().unwrap();
    store.keep_state(&claim, 20, &checkpoint(20)).unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    let counts = store.counts().unwrap();
    assert_eq!((counts.done, counts.pending, counts.running), (1, 3, 0));
    let runs = store.point_runs().unwrap();
    let run = runs.iter().find(|run| run.key == claim.key).unwrap();
    assert_eq!(run.number("samples"), Some(25.0));
    assert_eq!(run.number("stages"), Some(40.0));
    assert_eq!(
        samples::of(&store.connection, claim.id, u64::MAX).unwrap(),
        first_samples(50)
    );
    let left: i64 = store
        .connection
        .query_row(
            "SELECT count(*) FROM checkpoints WHERE generation < 2",
            [],
            |row| row.get(0),
        )
        .unwrap();
    assert_eq!(left, 0);
}

#[test]
fn dead_owner_loses_its_case_and_the_next_resumes_from_its_checkpoint() {
    let directory = tempfile::tempdir().unwrap();
    let (mut dead, mut heir) = (open(directory.path()), open(directory.path()));
    dead.register(1).unwrap();
    let claim = dead.next().unwrap();
    for steps in [20, 40, 60] {
        dead.keep_state(&claim, steps, &checkpoint(steps)).unwrap();
    }
    heir.register(1).unwrap();
    assert_eq!(heir.release_dead().unwrap(), 0, "it lives");
    heir.connection
        .execute("UPDATE processes SET start = '1' WHERE id = 1", [])
        .unwrap();
    assert_eq!(heir.release_dead().unwrap(), 1);
    let taken = heir.next().unwrap();
    assert_eq!(taken.key, claim.key, "begun cases come first");
    let steps: Vec<u64> = taken
        .checkpoints
        .iter()
        .map(|c| c.as_ref().unwrap().snapshot.steps())
        .collect();
    assert_eq!(steps, [60, 40], "two generations, the newest first");
    // Later writes of the old owner are discarded.
    assert!(matches!(
        dead.keep_state(&claim, 80, &checkpoint(80)),
        Err(StoreError::ClaimLost { .. })
    ));
    assert!(matches!(
        dead.end(&claim, &finished(State::Done)),
        Err(StoreError::ClaimLost { .. })
    ));
    dead.release([&claim]).unwrap();
    dead.leave().unwrap();
    assert_eq!(heir.counts().unwrap().running, 1);
    heir.end(&taken, &finished(State::Jammed)).unwrap();
    assert_eq!(heir.counts().unwrap().jammed, 1);
}

#[test]
fn torn_checkpoint_falls_back_to_the_one_before() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.keep_state(&claim, 20, &checkpoint(20)).unwrap();
    let torn = checkpoint(40);
    store
        .keep_state(&claim, 40, &torn[..torn.len() - 3])
        .unwrap();
    store.release([&claim]).unwrap();
    let again = store.next().unwrap();
    assert_eq!(again.checkpoints[0], Err(BadCheckpoint::Checksum));
    assert_eq!(again.checkpoints[1].as_ref().unwrap().snapshot.steps(), 20);
}

#[test]
fn editing_the_grid_keeps_finished_cases() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    for _ in 0..2 {
        let claim = store.next().unwrap();
        store.end(&claim, &finished(State::Done)).unwrap();
    }
    let wider = CAMPAIGN.replace("seeds = 2", "seeds = 4");
    store.take_in(&campaign(&wider)).unwrap();
    let counts = store.counts().unwrap();
    assert_eq!((counts.done, counts.total()), (2, 8));
    // One shear rate is removed: its finished case is not counted any more, but not lost.
    let narrower = CAMPAIGN.replace("[0.1, inf]", "[0.1]");
    store.take_in(&campaign(&narrower)).unwrap();
    assert_eq!(store.counts().unwrap().done, 1);
    store.take_in(&campaign(CAMPAIGN)).unwrap();
    assert_eq!(store.counts().unwrap().done, 2);
}

#[test]
fn another_discarded_strain_averages_finished_runs_again() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    let later = CAMPAIGN.replace("discard = 0.5", "discard = 0.8");
    store.take_in(&campaign(&later)).unwrap();
    let runs = store.point_runs().unwrap();
    let run = runs.iter().find(|run| run.key == claim.key).unwrap();
    assert_eq!(run.number("samples"), Some(10.0));
    assert_eq!(
        run.number("stages"),
        Some(40.0),
        "counters of the whole run stay"
    );
}

#[test]
fn failure_is_kept_and_retried() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store
        .fail(&claim, failure(37), &rows(first_samples(1)))
        .unwrap();
    let line = store.failures(10).unwrap().remove(0);
    assert_eq!((line.failed.step, line.key), (37, claim.key));
    assert!((line.failed.strain - 0.185).abs() < 1e-12);
    assert_eq!(store.retry_failed().unwrap(), 1);
    assert_eq!(store.counts().unwrap().pending, 4);
}

#[test]
fn store_of_another_campaign_schema_or_program_is_not_touched() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("small.sqlite");
    drop(open(directory.path()));
    let other = campaign(&CAMPAIGN.replace("\"small\"", "\"other\""));
    let before = std::fs::read(&path).unwrap();
    let mut store = Store::open(&path).unwrap();
    assert!(matches!(
        store.take_in(&other),
        Err(StoreError::OtherCampaign { .. })
    ));
    drop(store);
    assert_eq!(std::fs::read(&path).unwrap(), before);

    let connection = rusqlite::Connection::open(&path).unwrap();
    let (params, seed, stride): (String, u64, u64) = connection
        .query_row(
            "SELECT p.params, c.seed, c.sample_stride FROM cases c JOIN points p ON p.id = c.point ORDER BY c.id",
            [],
            |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
        )
        .unwrap();
    let keys = [PHYSICS_VERSION - 1, PHYSICS_VERSION]
        .map(|version| CaseKey::of_physics(version, &params, seed, stride).to_string());
    let rename = "UPDATE cases SET key = ?2 WHERE key = ?1";
    assert_eq!(connection.execute(rename, [&keys[1], &keys[0]]), Ok(1));
    let before = std::fs::read(&path).unwrap();
    for refused in [Store::open(&path), Store::open_read_only(&path)] {
        let error = refused.unwrap_err();
        assert!(matches!(error, StoreError::Physics { .. }), "{error}");
        assert!(
            error
                .to_string()
                .contains(&format!("physics {}", PHYSICS_VERSION - 1)),
            "{error}"
        );
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(connection.execute(rename, [&keys[0], &keys[1]]), Ok(1));
    connection.pragma_update(None, "user_version", 99).unwrap();
    drop(connection);
    let before = std::fs::read(&path).unwrap();
    for refused in [Store::open(&path), Store::open_read_only(&path)] {
        let error = refused.unwrap_err();
        assert!(
            matches!(error, StoreError::Schema { found: 99, .. }),
            "{error}"
        );
        assert!(error.to_string().contains("another version"), "{error}");
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);

    let foreign = directory.path().join("foreign.sqlite");
    let connection = rusqlite::Connection::open(&foreign).unwrap();
    connection.execute_batch("CREATE TABLE things (x)").unwrap();
    drop(connection);
    let text = directory.path().join("notes.txt");
    std::fs::write(&text, "these are notes, not a database ".repeat(100)).unwrap();
    for path in [foreign, text] {
        let before = std::fs::read(&path).unwrap();
        assert!(matches!(
            Store::open(&path),
            Err(StoreError::NotAStore { .. })
        ));
        assert!(matches!(
            Store::open_read_only(&path),
            Err(StoreError::NotAStore { .. })
        ));
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }
    assert!(matches!(
        Store::open_read_only(&directory.path().join("none.sqlite")),
        Err(StoreError::Missing { .. })
    ));
    assert!(matches!(
        Store::enter(Path::new("/proc/none/small.sqlite"), &other),
        Err(StoreError::Unwritable { .. })
    ));
}

#[test]
fn infinite_and_missing_numbers_survive_the_store() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    let run = finished(State::Done).with(|samples| {
        samples[30].1.minimum_gap = f64::INFINITY;
        samples[31].1.viscosity = f64::NAN;
    });
    store.end(&claim, &run).unwrap();
    let back = samples::of(&store.connection, claim.id, u64::MAX).unwrap();
    assert!(back[30].1.minimum_gap.is_infinite());
    assert!(back[31].1.viscosity.is_nan());
}

#[test]
fn reading_works_while_another_process_writes() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let reader = Store::open_read_only(store.path()).unwrap();
    let transaction = store
        .connection
        .transaction_with_behavior(TransactionBehavior::Immediate)
        .unwrap();
    transaction
        .execute("UPDATE cases SET steps_done = ?1", params![3])
        .unwrap();
    assert_eq!(reader.counts().unwrap().pending, 4);
    transaction.commit().unwrap();
}

#[test]
fn owners_of_a_restarted_machine_are_gone() {
    let directory = tempfile::tempdir().unwrap();
    let (mut one, mut two) = (open(directory.path()), open(directory.path()));
    one.register(1).unwrap();
    one.next().unwrap();
    mark_owners_dead(&one);
    two.register(1).unwrap();
    assert_eq!(two.release_dead().unwrap(), 1);
}
