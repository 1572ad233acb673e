//! Two versions of a campaign on one store: what is shown, what is kept, who is let in.

use super::*;

/// The campaign with other shear rates, in another file.
fn other_version() -> Campaign {
    let text = CAMPAIGN.replace("[0.1, inf]", "[inf, 7.0]");
    Campaign::parse("/elsewhere/small.toml", text).unwrap()
}

#[test]
fn a_reader_sees_what_its_file_asks_for_and_changes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    while let Some(claim) = store.claim(1).unwrap() {
        store.finish(&claim, &finished(State::Done)).unwrap();
    }
    let path = store.path().to_owned();
    drop(store);
    let before = std::fs::read(&path).unwrap();
    let seen = Store::open_as_asked(&path, &other_version()).unwrap();
    let counts = seen.counts().unwrap();
    assert_eq!((counts.done, counts.pending), (2, 2));
    assert_eq!(seen.point_runs().unwrap().len(), 4);
    assert_eq!(seen.last_run_with(), Some(Path::new("small.toml")));
    assert_eq!(seen.inventory().unwrap().orphans, 2);
    assert!(seen.campaign_text().unwrap().contains("7.0"));
    // Another strain discarded gives other averages.
    let later = campaign(&CAMPAIGN.replace("discard = 0.5", "discard = 0.8"));
    let seen = Store::open_as_asked(&path, &later).unwrap();
    assert!(
        seen.point_runs()
            .unwrap()
            .iter()
            .all(|run| run.samples == 10)
    );
    drop(seen);
    let same = Store::open_as_asked(&path, &campaign(CAMPAIGN)).unwrap();
    assert_eq!(same.last_run_with(), None);
    assert!(
        same.point_runs()
            .unwrap()
            .iter()
            .all(|run| run.samples == 25)
    );
    drop(same);
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn another_version_is_refused_while_one_is_computed_and_let_in_afterwards() {
    let directory = tempfile::tempdir().unwrap();
    let mut first = open(directory.path());
    first.register(1).unwrap();
    let claim = first.claim(1).unwrap().unwrap();
    let mut second = Store::open(first.path()).unwrap();
    let error = second.adopt(&other_version()).unwrap_err();
    assert!(matches!(error, StoreError::AtWork { .. }), "{error}");
    for part in ["small.toml", "/elsewhere/small.toml"] {
        assert!(error.to_string().contains(part), "{error}");
    }
    assert_eq!(first.counts().unwrap().total(), 4);
    first.finish(&claim, &finished(State::Done)).unwrap();
    first.check_campaign().unwrap();
    // The same wishes in other words are no other version.
    let reworded = campaign(&format!("# as before\n{CAMPAIGN}"));
    second.adopt(&reworded).unwrap();
    first.leave().unwrap();
    let adoption = second.adopt(&other_version()).unwrap();
    assert!(adoption.changed);
    let there = adoption.inventory;
    assert_eq!(
        (there.runs, there.new, there.ended, there.orphans),
        (4, 4, 0, 1)
    );
    assert!(there.orphan_bytes > 5000.0);
}

#[test]
fn a_version_taken_in_between_is_noticed() {
    let directory = tempfile::tempdir().unwrap();
    let mut first = open(directory.path());
    let mut second = Store::open(first.path()).unwrap();
    second.adopt(&other_version()).unwrap();
    let refused = first.register(1);
    assert!(
        matches!(refused, Err(StoreError::Displaced { .. })),
        "{refused:?}"
    );
    second.register(1).unwrap();
    assert!(first.check_campaign().is_err());
    second.check_campaign().unwrap();
}

#[test]
fn pruning_removes_what_is_not_asked_for_and_nothing_else() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    while let Some(claim) = store.claim(1).unwrap() {
        let frame = sd_core::simulation::Frame::default();
        store.keep_frames(&claim, &[(0, frame)]).unwrap();
        store.finish(&claim, &finished(State::Done)).unwrap();
    }
    store.leave().unwrap();
    store.adopt(&other_version()).unwrap();
    assert_eq!(store.prune().unwrap(), 2);
    assert_eq!(store.inventory().unwrap().orphans, 0);
    let counts = store.counts().unwrap();
    assert_eq!((counts.done, counts.pending), (2, 2));
    for table in ["samples", "frames", "results", "ends"] {
        let strangers: i64 = store
            .connection
            .query_row(
                &format!(
                    "SELECT count(*) FROM {table} WHERE case_id NOT IN (SELECT id FROM cases)"
                ),
                [],
                |row| row.get(0),
            )
            .unwrap();
        assert_eq!(strangers, 0, "{table}");
    }
    assert_eq!(store.prune().unwrap(), 0);
}

#[test]
fn frames_fill_their_pages() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.claim(1).unwrap().unwrap();
    // As many spheres as the published runs have, and about as many contacts.
    let contact = sd_core::simulation::FrameContact {
        i: 0,
        j: 1,
        normal: [1.0, 0.0],
        gap: 0.01,
        normal_force: 12.5,
        tangential_force: -2.0,
        state: sd_core::contact::ContactState::Rolling,
    };
    let frame = sd_core::simulation::Frame {
        radii: vec![1.0; 90],
        centres: vec![[1.0, 2.0]; 90],
        orientations: vec![0.5; 90],
        stresslets: vec![[1.0, 2.0, 3.0]; 90],
        contacts: vec![contact; 100],
        ..Default::default()
    };
    let frames: Vec<_> = (0..200).map(|step| (step, frame.clone())).collect();
    store.keep_frames(&claim, &frames).unwrap();
    let (used, taken): (f64, f64) = store
        .connection
        .query_row(
            "SELECT (SELECT total(length(data)) FROM frames), (SELECT total(pgsize) FROM dbstat WHERE name = 'frames')",
            [],
            |row| Ok((row.get(0)?, row.get(1)?)),
        )
        .unwrap();
    println!("{used} of {taken} bytes");
    assert!(taken < 1.25 * used, "{used} of {taken} bytes");
}
