//! Runs that are longer or shorter than requested.

use super::*;

/// The campaign with another length of its runs.
fn of_strain(strain: &str) -> Campaign {
    campaign(&CAMPAIGN.replace("strain = 1.0", &format!("strain = {strain}")))
}

/// A store with one finished run of a strain of 1.
fn store_with_a_run(directory: &Path) -> (Store, String) {
    let mut store = open(directory);
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    (store, claim.key)
}

fn run(store: &Store, key: &str) -> crate::measure::PointRun {
    let runs = store.point_runs().unwrap();
    runs.into_iter().find(|run| run.key == key).unwrap()
}

#[test]
fn finished_run_continues_from_its_last_state_to_a_larger_strain() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    store.take_in(&of_strain("2.0")).unwrap();
    assert_eq!(run(&store, &key).state, State::Pending);
    // As another program reads it: our own connections use no views.
    let shown: (Option<f64>, f64) = rusqlite::Connection::open(store.path())
        .unwrap()
        .query_row(
            "SELECT viscosity, time_step FROM runs WHERE key = ?1",
            [&key],
            |row| Ok((row.get(0)?, row.get(1)?)),
        )
        .unwrap();
    assert_eq!(shown, (None, 0.005), "it has no result yet");
    let claim = store.next().unwrap();
    assert_eq!((&claim.key, claim.case.steps), (&key, 400));
    let [Ok(from)] = claim.checkpoints.as_slice() else {
        panic!("{:?}", claim.checkpoints);
    };
    assert_eq!(from.snapshot.steps(), 200);
    let samples = rows(first_samples(50)).samples_digest;
    assert_eq!(from.samples_digest, samples);
    // The continuation is interrupted, and resumes from its checkpoint.
    store.keep_state(&claim, 240, &checkpoint(240)).unwrap();
    store.release([&claim]).unwrap();
    let claim = store.next().unwrap();
    let steps = claim.checkpoints.iter().flatten();
    let steps: Vec<u64> = steps.map(|found| found.snapshot.steps()).collect();
    assert_eq!(steps, [240, 200]);
}

#[test]
fn a_result_stays_if_its_last_state_is_of_another_format() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    let other = rusqlite::Connection::open(store.path()).unwrap();
    // The version follows the first four bytes.
    let changed = "UPDATE checkpoints SET data =
         CAST(substr(data, 1, 4) || x'04000000' || substr(data, 9) AS BLOB)";
    assert_eq!(other.execute(changed, []).unwrap(), 1);
    assert_eq!(super::super::check(store.path()).unwrap().findings, []);
    assert_eq!(run(&store, &key).state, State::Done);
    store.take_in(&of_strain("2.0")).unwrap();
    let claim = store.next().unwrap();
    assert_eq!(
        claim.checkpoints,
        [Err(BadCheckpoint::Version { found: 4 })]
    );
}

#[test]
fn a_run_cut_short_has_the_averages_of_its_beginning_and_comes_back_whole() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    let whole = format!("{:?}", run(&store, &key));
    store.take_in(&of_strain("0.8")).unwrap();
    let cut = run(&store, &key);
    assert_eq!(
        (cut.state, cut.number("samples")),
        (State::Done, Some(15.0))
    );
    let kept = &first_samples(50)[25..40];
    let mean = kept.iter().map(|(_, s)| s.viscosity).sum::<f64>() / 15.0;
    assert!((cut.number("viscosity").unwrap() - mean).abs() < 1e-12);
    let details = store.details(&key).unwrap();
    assert_eq!(details.samples.len(), 40);
    store.take_in(&campaign(CAMPAIGN)).unwrap();
    assert_eq!(format!("{:?}", run(&store, &key)), whole);
}

#[test]
fn jammed_run_stays_jammed_at_a_larger_strain_and_flows_before_it_jammed() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Jammed)).unwrap();
    store.take_in(&of_strain("2.0")).unwrap();
    assert_eq!(run(&store, &claim.key).state, State::Jammed);
    store.take_in(&of_strain("0.8")).unwrap();
    assert_eq!(run(&store, &claim.key).state, State::Done);
    store.take_in(&campaign(CAMPAIGN)).unwrap();
    assert_eq!(run(&store, &claim.key).state, State::Jammed);
}

#[test]
fn runs_that_failed_beyond_the_requested_strain_are_retried() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store
        .fail(&claim, failure(170), &rows(first_samples(0)))
        .unwrap();
    store.take_in(&of_strain("0.9")).unwrap();
    assert_eq!(store.counts().unwrap().failed, 1);
    store.take_in(&of_strain("0.8")).unwrap();
    assert_eq!(store.counts().unwrap().failed, 0);
}

#[test]
fn a_longer_run_of_a_shard_takes_the_place_of_a_shorter_one_that_agrees() {
    let directory = tempfile::tempdir().unwrap();
    let longer = Finished {
        steps: 400,
        ..finished(State::Done)
    }
    .with(|samples| *samples = first_samples(100));
    let path = directory.path().join("shard.sqlite");
    let mut shard = Store::at(&path, &of_strain("2.0"));
    shard.register(1).unwrap();
    let claim = shard.next().unwrap();
    shard.end(&claim, &longer).unwrap();
    drop(shard);
    let (mut store, key) = store_with_a_run(directory.path());
    assert_eq!(key, claim.key);
    let before = run(&store, &key).number("viscosity");
    let merged = store
        .merge(MergedCases::All, std::slice::from_ref(&path))
        .unwrap();
    assert_eq!((merged.results, merged.duplicates), (1, 0));
    assert_eq!(
        run(&store, &key).number("viscosity"),
        before,
        "a strain of 1 is requested"
    );
    assert!(merged.disagreements.is_empty());
    store.take_in(&of_strain("2.0")).unwrap();
    assert_eq!(run(&store, &key).number("samples"), Some(75.0));
    // The shorter one adds nothing to it.
    let small = directory.path().join("small.sqlite");
    let other = directory.path().join("other.sqlite");
    database::snapshot(&small, &other).unwrap();
    let merged = store.merge(MergedCases::All, &[other]).unwrap();
    assert_eq!((merged.results, merged.duplicates), (0, 1));
}

#[test]
fn a_run_that_fails_in_a_continuation_keeps_its_beginning() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    let whole = format!("{:?}", run(&store, &key));
    store.take_in(&of_strain("2.0")).unwrap();
    let resumed = |store: &mut Store| {
        let claim = store.next().unwrap();
        let from = claim.checkpoints[0].as_ref().unwrap();
        assert_eq!((&claim.key, from.snapshot.steps()), (&key, 200));
        let rows = store.resume(&claim, from).unwrap().unwrap();
        assert_eq!(store.samples(&key).unwrap().len(), 50);
        (claim, rows)
    };
    let (claim, mut rows) = resumed(&mut store);
    for (step, sample) in &first_samples(60)[50..] {
        rows.add(*step, *sample);
    }
    store.fail(&claim, failure(240), &rows).unwrap();
    assert_eq!(store.samples(&key).unwrap().len(), 60);
    assert_eq!(store.counts().unwrap().failed, 1);
    assert_eq!(store.retry_failed().unwrap(), 1);
    let (claim, _) = resumed(&mut store);
    store.release([&claim]).unwrap();
    store.take_in(&campaign(CAMPAIGN)).unwrap();
    assert_eq!(format!("{:?}", run(&store, &key)), whole);
}

#[test]
fn resumable_runs_are_merged_with_their_last_state() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    store.take_in(&of_strain("2.0")).unwrap();
    let mut new = Store::at(&directory.path().join("new.sqlite"), &of_strain("2.0"));
    let merged = new
        .merge(MergedCases::All, &[store.path().to_owned()])
        .unwrap();
    assert_eq!((merged.results, merged.unreadable), (1, 0));
    assert_eq!(new.counts().unwrap().pending, 4);
    let claim = new.next().unwrap();
    assert_eq!(claim.key, key);
    assert_eq!(claim.checkpoints[0].as_ref().unwrap().snapshot.steps(), 200);
}

#[test]
fn an_added_segment_continues_from_the_finished_run() {
    let directory = tempfile::tempdir().unwrap();
    let (mut store, key) = store_with_a_run(directory.path());
    let segments = |second: &str| {
        let text = "[[protocol.segment]]\nstrain = 1.0\ndiscard = 0.5\n[[protocol.segment]]\nstrain = 1.0\n";
        let (before, after) = CAMPAIGN
            .split_once("strain = 1.0\ndiscard = 0.5\n")
            .unwrap();
        campaign(&format!("{before}{text}{second}{after}"))
    };
    store.take_in(&segments("direction = -1\n")).unwrap();
    let claim = store.next().unwrap();
    assert_ne!(claim.key, key);
    assert_eq!(claim.case.steps, 400);
    let [Ok(from)] = claim.checkpoints.as_slice() else {
        panic!("{:?}", claim.checkpoints);
    };
    assert_eq!(from.snapshot.steps(), 200);
    assert_eq!(from.samples_digest, rows(first_samples(50)).samples_digest);
    store.release([&claim]).unwrap();
    // The run without it keeps its result.
    store.take_in(&campaign(CAMPAIGN)).unwrap();
    assert_eq!(run(&store, &key).state, State::Done);
    // A run that reverses earlier has no state to continue from.
    let earlier = segments("")
        .text
        .replacen("strain = 1.0", "strain = 0.8", 1);
    store.take_in(&campaign(&earlier)).unwrap();
    assert_eq!(store.next().unwrap().checkpoints.len(), 0);
}
