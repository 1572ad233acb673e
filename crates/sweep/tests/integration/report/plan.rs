//! The tables of a plan, in the formats of a report.

use super::PAPER_CAMPAIGN;
use crate::harness::{folder, json, refused, sweep};

#[test]
fn tables_fit_a_terminal_and_go_into_a_paper() {
    let values: Vec<String> = (0..40).map(|n| (f64::from(n) / 39.0).to_string()).collect();
    let many = PAPER_CAMPAIGN
        .replace(
            "friction = [0.0, 0.3]",
            &format!("friction = [{}]", values.join(", ")),
        )
        .replace("seeds = 2", "seeds = 1");
    let folder = folder("c.toml", &many);
    let at = folder.path();
    let plan = |more: &[&str]| sweep(at, &[&["plan", "c.toml"], more].concat());
    let width = |text: &str| {
        let lines = text
            .lines()
            .filter(|line| line.starts_with([' ', '─', '═']));
        lines.map(|line| line.chars().count()).max().unwrap()
    };
    let usual = plan(&[]);
    assert!(width(&usual) <= 80, "{usual}");
    assert!(
        usual.contains("0, 0.02564, ") && usual.contains(", … 1 "),
        "{usual}"
    );
    assert!(!usual.contains("0.02564102564102564"), "{usual}");
    let wide = plan(&["--wide"]);
    assert!(width(&wide) > 80 && wide.contains("known from"), "{wide}");
    let chosen = plan(&["--columns", "memory_bytes,steps"]);
    let heads = chosen.lines().find(|line| line.contains("memory")).unwrap();
    assert!(
        heads.contains("steps") && !heads.contains("runs"),
        "{chosen}"
    );
    let latex = plan(&["--latex", "-", "--wide"]);
    assert_eq!(latex.matches("\\begin{tabular}").count(), 2);
    for part in ["% plan of campaign paper", "area\\_fraction", "step (ms)"] {
        assert!(latex.contains(part), "{part}: {latex}");
    }
    let error = refused(at, &["plan", "c.toml", "--columns", "price"]);
    assert!(error.contains("memory_bytes"), "{error}");
    let error = refused(at, &["plan", "c.toml", "--json", "--latex", "-"]);
    assert!(error.contains("--latex"), "{error}");
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
fn a_step_has_the_interval_of_the_runs_it_is_known_from() {
    let some = PAPER_CAMPAIGN
        .replace("area_fraction = [0.5, 0.65]", "area_fraction = 0.5")
        .replace("shear_rate = [0, 0.1, 1.0, 10.0, inf]", "shear_rate = inf")
        .replace("strain = 0.2", "strain = 0.4");
    let folder = folder("c.toml", &some);
    let at = folder.path();
    sweep(at, &["run", "c.toml", "-q", "--workers", "1"]);
    let more = some.replace("seeds = 2", "seeds = 8");
    std::fs::write(at.join("c.toml"), more).unwrap();
    let plan = json(at, &["plan", "c.toml", "--store", "none.sqlite"]);
    let kind = &plan["kinds"][0];
    assert_eq!(kind["source"], "runs");
    let half = kind["step_ci95_s"].as_f64().unwrap();
    assert!(half > 0.0, "{kind}");
    let text = sweep(at, &["plan", "c.toml", "--store", "none.sqlite"]);
    assert!(
        text.contains(" ± ") && text.contains("half its 95 % interval"),
        "{text}"
    );
    let text = sweep(
        at,
        &["plan", "c.toml", "--store", "none.sqlite", "--format", "si"],
    );
    assert!(!text.contains(" ± "), "{text}");
}
