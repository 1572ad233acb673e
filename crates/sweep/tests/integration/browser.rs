//! The page and the live page in a real browser, headless. Skipped with a note on a machine without
//! Chromium, unless CI is set.

mod chromium;
mod keyboard;
mod live;
mod views;

use crate::harness::{Computed, sweep};
use std::path::Path;

const CAMPAIGN: &str = r#"name = "browser"
[protocol]
strain = 0.4
discard = 0.1
[[grid]]
area_fraction = 0.65
friction = [0.1, 0.3]
roughness = 0.01
shear_rate = [0.1, 1.0, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

/// The store of most tests.
static COMPUTED: Computed = Computed::new(CAMPAIGN, &["--trajectory"]);

/// Writes the page of the store of a folder; returns its address.
fn page_of(at: &Path, more: &[&str]) -> String {
    sweep(
        at,
        &[&["report", "s.sqlite", "--page", "p.html"], more].concat(),
    );
    format!("file://{}", at.join("p.html").display())
}
