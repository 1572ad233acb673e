//! The tables of a plan.

use super::PAPER_CAMPAIGN;
use crate::harness::{folder, json, sweep};

#[test]
fn tables_fit_a_terminal() {
    let values: Vec<String> = (0..40).map(|n| (f64::from(n) / 39.0).to_string()).collect();
    let many = PAPER_CAMPAIGN
        .replace(
            "friction = [0.0, 0.3]",
            &format!("friction = [{}]", values.join(", ")),
        )
        .replace("seeds = 2", "seeds = 1");
    let folder = folder("c.toml", &many);
    let at = folder.path();
    let width = |text: &str| {
        let lines = text
            .lines()
            .filter(|line| line.starts_with([' ', '─', '═']));
        lines.map(|line| line.chars().count()).max().unwrap()
    };
    let usual = sweep(at, &["plan", "c.toml"]);
    assert!(width(&usual) <= 80, "{usual}");
    assert!(
        usual.contains("0, 0.02564, ") && usual.contains(", … 1 "),
        "{usual}"
    );
    assert!(!usual.contains("0.02564102564102564"), "{usual}");
}

#[test]
fn kinds_that_differ_in_their_step_alone_say_which_it_is() {
    let one = PAPER_CAMPAIGN.replace("seeds = 2", "seeds = 1");
    let several = one.replace("[[grid]]", "[[grid]]\ntime_step = [0.01, 0.005, 0.0025]");
    let folder = folder("c.toml", &several);
    let at = folder.path();
    let text = sweep(at, &["plan", "c.toml"]);
    let rows: Vec<&str> = text
        .lines()
        .skip_while(|line| !line.contains("Δt"))
        .filter(|line| line.contains("ball-melrose, rigid"))
        .collect();
    assert_eq!(rows.len(), 3, "{text}");
    let steps = ["0.01", "0.005", "0.0025"];
    for step in steps {
        let of_it = |row: &&&str| row.split_whitespace().any(|word| word == step);
        assert_eq!(rows.iter().filter(of_it).count(), 1, "{step}: {text}");
    }
    let plan = json(at, &["plan", "c.toml"]);
    let kinds = plan["kinds"].as_array().unwrap();
    assert!(kinds.iter().all(|kind| kind["time_step"].is_f64()));
    // A single step is shown on the axis.
    std::fs::write(at.join("c.toml"), one).unwrap();
    let text = sweep(at, &["plan", "c.toml"]);
    assert!(!text.contains("Δt"), "{text}");
}

#[test]
fn time_of_a_step_comes_from_runs_of_the_store_where_there_are_some() {
    let some = PAPER_CAMPAIGN
        .replace("area_fraction = [0.5, 0.65]", "area_fraction = 0.5")
        .replace("shear_rate = [0, 0.1, 1.0, 10.0, inf]", "shear_rate = inf");
    let folder = folder("c.toml", &some);
    let at = folder.path();
    let before = json(at, &["plan", "c.toml"]);
    assert_eq!(before["kinds"][0]["source"], "trial");
    sweep(at, &["run", "c.toml", "-q", "--workers", "1"]);
    let more = some.replace("seeds = 2", "seeds = 8");
    std::fs::write(at.join("c.toml"), more).unwrap();
    let after = json(at, &["plan", "c.toml"]);
    let kind = &after["kinds"][0];
    assert_eq!(kind["source"], "runs");
    let step_s = |plan: &serde_json::Value| plan["kinds"][0]["step_s"].as_f64().unwrap();
    let ratio = step_s(&before) / step_s(&after);
    assert!((0.1..10.0).contains(&ratio), "{ratio}");
}
