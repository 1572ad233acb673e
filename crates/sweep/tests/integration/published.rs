//! Published results: none of an older version of the physics is presented as current.
//! `scripts/published --check` compares tables, figures and quoted numbers with the CSV files.

use crate::harness::root;
use sweep::model::case::PHYSICS_VERSION;

/// The versions of the physics that a report names:
/// `... by sweep 0.1.0 (physics 12, build a22173902e77)`.
fn physics(report: &str) -> Vec<u32> {
    let named = report.split("(physics ").skip(1);
    let named = named.filter_map(|rest| rest.split_once(',')?.0.parse().ok());
    named.collect()
}

/// The fault in the row of a result in the list of the page.
fn fault(page: &str, name: &str, report: &str, present: u32) -> Option<String> {
    let made_by = physics(report);
    if made_by.is_empty() {
        return None; // It is not the report of a campaign.
    }
    let row = page
        .lines()
        .find(|line| line.starts_with(&format!("| {name} |")));
    let Some(row) = row else {
        return Some(format!("{name}: in no list of the page"));
    };
    let is_stale = made_by.iter().any(|version| *version != present);
    (is_stale && !row.contains("stale")).then(|| {
        format!("{name}: made by physics {made_by:?}, while the program has {present}; make it again, or call it stale by scripts/published --tables")
    })
}

#[test]
fn results_of_another_physics_are_called_stale() {
    let folder = root().join("results/published");
    let page = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let mut reports = 0;
    let mut faults = Vec::new();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "txt") {
            let name = path.file_stem().unwrap().to_str().unwrap();
            let report = std::fs::read_to_string(&path).unwrap();
            reports += usize::from(!physics(&report).is_empty());
            faults.extend(fault(&page, name, &report, PHYSICS_VERSION));
        }
    }
    assert!(reports >= 19, "{reports}");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_stale_result_is_found() {
    let report = "computed in 2 s by sweep 0.1.0 (physics 2, build 07ca); sweep 0.1.0 (physics 1, build 07cb)\n";
    let page = "| campaign | physics |\n| some | 1 and 2 |\n";
    let found = |page: &str, report: &str| fault(page, "some", report, 2);
    assert!(found(page, report).unwrap().contains("[2, 1]"));
    assert_eq!(
        found(&page.replace("1 and 2", "1 and 2, stale"), report),
        None
    );
    assert_eq!(found(page, &report.replace("physics 1", "physics 2")), None);
    assert!(found("", report).unwrap().contains("in no list"));
    assert_eq!(found("", "rotation in degrees -90\n"), None);
}
