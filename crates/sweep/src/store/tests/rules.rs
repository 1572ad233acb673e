//! Seeds under a requested precision.

use super::*;
use crate::measure::Verdict;

const PRECISE: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 1.0
discard = 0.5
[[grid]]
area_fraction = [0.6, 0.65]
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = { precision = 0.05, at_least = 3, at_most = 8 }
spheres = 40
"#;

fn precise(directory: &Path) -> Store {
    let mut store = Store::at(&directory.join("small.sqlite"), &campaign(PRECISE));
    store.register(1).unwrap();
    store
}

/// A run with a constant viscosity.
fn run_of(viscosity: f64) -> Finished {
    finished(State::Done).with(|samples| {
        for (_, sample) in samples {
            sample.viscosity = viscosity;
        }
    })
}

/// The viscosity of a run in these tests: equal at the lower area fraction, scattered at the higher
/// one.
fn viscosity(claim: &Claim) -> f64 {
    let scatter = if claim.case.params.area_fraction > 0.62 {
        1.0
    } else {
        0.001
    };
    10.0 + scatter
        * if claim.case.seed.is_multiple_of(2) {
            2.0
        } else {
            -2.0
        }
}

/// Number of seeds that count and verdict, at both points.
fn states(store: &Store) -> Vec<(usize, Verdict)> {
    let states = store.point_states().unwrap();
    states
        .iter()
        .map(|state| (state.decision.wanted, state.decision.verdict))
        .collect()
}

#[test]
fn seeds_are_added_until_the_precision_is_reached_or_no_more_may_be() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = precise(directory.path());
    assert_eq!(store.counts().unwrap().total(), 6);
    let mut seeds = Vec::new();
    while let Some(claim) = store.next() {
        seeds.push((claim.case.params.area_fraction, claim.case.seed));
        let run = run_of(viscosity(&claim));
        store.end(&claim, &run).unwrap();
    }
    // One seed of both points first, the rest of the first batches, the confirmation of one, the
    // scatter of the other.
    assert_eq!(&seeds[..2], [(0.6, 1), (0.65, 1)]);
    assert!(seeds[..6].iter().all(|(_, seed)| *seed <= 3));
    assert_eq!(
        states(&store),
        [(5, Verdict::Reached), (8, Verdict::AtMost)]
    );
    assert_eq!(store.counts().unwrap().done, 13);
    let report = crate::report::Report::of(&store, &crate::report::Selection::default()).unwrap();
    let points = report.points.iter();
    let wanted: Vec<f64> = points.filter_map(|p| p.number("seeds_wanted")).collect();
    assert_eq!(wanted, [5.0, 8.0]);
    let mut text = Vec::new();
    crate::report::write_text(&report, crate::report::Shape::default(), None, &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("reached at 1 of 2 points"), "{text}");
    assert!(
        text.contains("c 0.65, Γ inf: viscosity is known to"),
        "{text}"
    );
    assert!(text.contains("with the 8 seeds it may have"), "{text}");
}

#[test]
fn results_in_whatever_order_and_place_give_the_same_seeds() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = precise(directory.path());
    while let Some(claim) = store.next() {
        store.end(&claim, &run_of(viscosity(&claim))).unwrap();
    }
    // The same in shards, each of which holds some cases of the campaign and no rule, in waves.
    let mut merged = Store::at(&directory.path().join("merged.sqlite"), &campaign(PRECISE));
    for wave in 0.. {
        let open = merged.open_cases().unwrap();
        if open.is_empty() {
            assert!(wave > 2);
            break;
        }
        let mut shards = Vec::new();
        for part in 0..2 {
            let mut some = campaign(PRECISE);
            some.rules.clear();
            let mine: Vec<&String> = open
                .iter()
                .skip(part)
                .step_by(2)
                .map(|case| &case.key)
                .collect();
            some.cases
                .retain(|(key, _)| mine.contains(&&key.to_string()));
            let path = directory.path().join(format!("shard-{wave}-{part}.sqlite"));
            let mut shard = Store::at(&path, &some);
            shard.register(1).unwrap();
            while let Some(claim) = shard.next() {
                shard.end(&claim, &run_of(viscosity(&claim))).unwrap();
            }
            shards.push(path);
        }
        shards.reverse();
        merged.merge(MergedCases::All, &shards).unwrap();
    }
    assert_eq!(states(&merged), states(&store));
    let table = |store: &Store| -> Vec<(String, Option<u64>)> {
        let runs = store.point_runs().unwrap();
        runs.into_iter()
            .map(|run| (run.key.clone(), run.number("viscosity").map(f64::to_bits)))
            .collect()
    };
    assert_eq!(table(&merged), table(&store));
}

#[test]
fn another_precision_keeps_what_is_there() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = precise(directory.path());
    while let Some(claim) = store.next() {
        store.end(&claim, &run_of(viscosity(&claim))).unwrap();
    }
    store.leave().unwrap();
    drop(store);
    let rough = campaign(&PRECISE.replace("precision = 0.05", "precision = 0.9"));
    let path = directory.path().join("small.sqlite");
    // Showing it and entering it into the store give the same.
    let shown = Store::shown(&path, &rough);
    assert_eq!(
        states(&shown),
        [(5, Verdict::Reached), (7, Verdict::Reached)]
    );
    assert_eq!(shown.counts().unwrap().total(), 12);
    let mut store = Store::open(&path).unwrap();
    let adoption = store.take_in(&rough).unwrap();
    assert!(adoption.changed);
    assert_eq!(
        (adoption.inventory.runs, adoption.inventory.orphans),
        (12, 1)
    );
    store.take_in(&campaign(PRECISE)).unwrap();
    assert_eq!(store.counts().unwrap().done, 13);
}

#[test]
fn failed_runs_use_up_their_seed_until_they_are_computed_again() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = precise(directory.path());
    while let Some(claim) = store.next() {
        if claim.case.seed == 2 {
            store
                .fail(&claim, failure(3), &rows(first_samples(0)))
                .unwrap();
        } else {
            store.end(&claim, &run_of(10.0)).unwrap();
        }
    }
    assert_eq!(states(&store), [(5, Verdict::Reached); 2]);
    assert_eq!(store.retry_failed().unwrap(), 2);
    assert_eq!(states(&store), [(3, Verdict::Open); 2]);
    while let Some(claim) = store.next() {
        assert_eq!(claim.case.seed, 2);
        store.end(&claim, &run_of(10.0)).unwrap();
    }
    assert_eq!(store.counts().unwrap().done, 10);
}

#[test]
fn precision_is_that_of_the_runs_that_are_averaged() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = precise(directory.path());
    while let Some(claim) = store.next() {
        let mut run = run_of(viscosity(&claim));
        if claim.case.seed == 2 {
            run = run_of(1000.0);
            run.counters.unconverged_stages = 39;
        }
        store.end(&claim, &run).unwrap();
    }
    let states = store.point_states().unwrap();
    let precision = |with_doubtful| {
        let selection = crate::report::Selection::default().with_doubtful(with_doubtful);
        let report = crate::report::Report::of(&store, &selection).unwrap();
        let point = &report.points[0];
        assert_eq!(
            (point.params.area_fraction, point.number("doubtful")),
            (0.6, Some(1.0))
        );
        point.number("precision").unwrap()
    };
    let reached = states[0].decision.reached.unwrap();
    assert!(reached < 0.05, "{reached}");
    assert_eq!(precision(false), reached);
    assert!(precision(true) > 1.0);
}

#[test]
fn no_case_changes_its_rule_undetected() {
    for change in ["rule = 99", "rule = NULL", "rule = 1 - rule"] {
        let directory = tempfile::tempdir().unwrap();
        let store = precise(directory.path());
        let path = store.path().to_owned();
        drop(store);
        let other = rusqlite::Connection::open(&path).unwrap();
        let change =
            format!("PRAGMA foreign_keys = OFF; UPDATE cases SET {change} WHERE position = 2");
        other.execute_batch(&change).unwrap();
        drop(other);
        let shown = Store::open_read_only(&path).unwrap().point_runs();
        assert!(
            matches!(shown, Err(StoreError::Damaged { .. })),
            "{change}: {shown:?}"
        );
        let mut store = Store::open(&path).unwrap();
        assert!(!store.forget_damaged().unwrap().is_empty(), "{change}");
        drop(store);
        assert!(precise(directory.path()).point_runs().is_ok(), "{change}");
    }
}
