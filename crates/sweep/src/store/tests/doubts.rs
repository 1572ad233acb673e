//! Runs with doubtful numbers: stored, counted, and averaged only on request.

use super::*;
use crate::measure::doubt::Doubt;
use crate::report::{Report, Selection, point_table, write_json, write_text};

/// A store with a sound and a doubtful run of each point.
fn half_doubtful(directory: &Path) -> Store {
    let mut store = open(directory);
    store.register(1).unwrap();
    for number in 0..4 {
        let claim = store.next().unwrap();
        let mut run = finished(State::Done);
        if number % 2 == 1 {
            run = run.with(|samples| samples[40].1.viscosity = 1e6);
            run.counters.unconverged_stages = 39;
        }
        store.end(&claim, &run).unwrap();
    }
    store.leave().unwrap();
    store
}

#[test]
fn doubtful_runs_are_counted_and_averaged_only_on_request() {
    let directory = tempfile::tempdir().unwrap();
    let store = half_doubtful(directory.path());
    let runs = store.point_runs().unwrap();
    let doubts: Vec<_> = runs.iter().filter(|run| run.is_doubtful()).collect();
    assert_eq!(doubts.len(), 2);
    assert_eq!(doubts[0].doubts, [Doubt::Unconverged, Doubt::OneSample]);
    let sound = Report::of(&store, &Selection::default()).unwrap();
    assert_eq!((sound.doubtful, sound.counts.done), (2, 4));
    let selection = Selection::default().with_doubtful(true);
    let all = Report::of(&store, &selection).unwrap();
    assert_eq!(sound.points.iter().map(|point| point.seeds).sum::<u64>(), 2);
    assert_eq!(all.points.iter().map(|point| point.seeds).sum::<u64>(), 4);
    let highest = |report: &Report| {
        let means = report.points.iter().filter_map(|p| p.viscosity);
        means.map(|estimate| estimate.mean).fold(0.0, f64::max)
    };
    assert!(highest(&sound) < 10.0 && highest(&all) > 1e4);
    for (report, word) in [(&sound, "not averaged"), (&all, "averaged with the others")] {
        let mut text = Vec::new();
        write_text(report, crate::report::Shape::default(), None, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains("2 finished runs have doubtful numbers"));
        assert!(text.contains(word), "{text}");
        let mut csv = Vec::new();
        crate::data::write_csv(&point_table(report), &mut csv).unwrap();
        assert!(String::from_utf8(csv).unwrap().contains(",doubtful,"));
        let mut json = Vec::new();
        write_json(report, &mut json).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
        assert_eq!(json["cases"]["doubtful"], 2);
    }
    let figure = |report| {
        let drawing = crate::report::Drawing::default();
        crate::report::draw(report, &[], &drawing).unwrap()
    };
    assert!(figure(&sound).contains("2 doubtful runs left out"));
    assert!(figure(&all).contains("2 doubtful runs averaged too"));
}
