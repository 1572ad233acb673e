//! Short runs of layers and suspensions at random points of the whole range of every parameter: all
//! end as done, jammed or failed by a named cause; no output has a number that is not one, no
//! process panics, and no doubtful run is averaged.

use crate::harness::{chosen, folder, printed, program, run};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Random values of parameters.
struct Draw(ChaCha8Rng);

impl Draw {
    fn share(&mut self) -> f64 {
        self.0.random()
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.random_range(0..of.len())]
    }

    fn word(&mut self, of: &str) -> Value {
        let words: Vec<&str> = of.split(' ').collect();
        json!(self.one(&words))
    }

    /// Log-uniform over the whole range, or one of its ends.
    fn number(&mut self, low: f64, high: f64, ends: &[f64]) -> Value {
        if !ends.is_empty() && self.share() < 0.25 {
            return number(self.one(ends));
        }
        let logarithm = low.ln() + self.share() * (high / low).ln();
        number(format!("{:.3e}", logarithm.exp()).parse().unwrap())
    }

    /// A block of a campaign file with one run. Conflicting values are left out by the reader.
    fn grid(&mut self, is_suspension: bool) -> BTreeMap<&'static str, Value> {
        let inf = f64::INFINITY;
        let contact = self.one(&[
            "rigid",
            "rigid",
            "procedure",
            "linear-spring",
            "hertz",
            "exponential-repulsion",
        ]);
        let is_soft = !["rigid", "procedure"].contains(&contact);
        let (fraction, dilute, dense, spheres): (_, _, _, &[u64]) = if is_suspension {
            ("volume_fraction", 0.45, 0.62, &[5, 20, 40, 80, 120])
        } else {
            ("area_fraction", 0.7, 0.84, &[1, 2, 5, 10, 20, 30, 40])
        };
        let least = self.one(&[0.01, dilute]);
        let smooth: &[f64] = if is_soft {
            &[1e-6, 0.01, 0.0]
        } else {
            &[1e-6, 0.01]
        };
        let hydrodynamics = self.one(&["stokesian-dynamics", "ball-melrose", "lubrication"]);
        // A whole number of steps makes a sample.
        let step = 10_f64.powf(-7.0 + 6.0 * self.share());
        let step = 0.02 / (0.02 / step).round().clamp(1.0, 40.0);
        let mut keys = BTreeMap::from([
            (fraction, number(least + self.share() * (dense - least))),
            ("friction", self.number(1e-3, 10.0, &[0.0, 10.0])),
            ("roughness", self.number(1e-5, 0.4999, smooth)),
            ("seeds", json!([self.0.random_range(1..1_u32 << 31)])),
            ("spheres", json!(self.one(spheres))),
            ("hydrodynamics", json!(hydrodynamics)),
            ("contact", json!(contact)),
            ("direction", json!(self.one(&[1, -1]))),
            ("time_step", number(step)),
        ]);
        if self.share() < 0.3 {
            keys.insert("shear_stress", self.number(1e-6, 1e6, &[]));
        } else {
            keys.insert("shear_rate", self.number(1e-8, 1e8, &[0.0, inf]));
        }
        if self.share() < 0.4 {
            keys.insert("size_ratio", self.number(1.0, 10.0, &[1.0, 10.0]));
            let large = self.share();
            keys.insert("large_fraction", number(self.one(&[0.0, 1.0, large])));
        }
        if hydrodynamics == "lubrication" && self.share() < 0.5 {
            keys.insert("lubrication_cutoff", self.number(1e-3, 0.9, &[]));
            keys.insert("lubrication_regularisation", self.number(1e-6, 0.1, &[]));
        }
        let mut maybe = |draw: &mut Self, share: f64, key: &'static str, value: Value| {
            if draw.share() < share {
                keys.insert(key, value);
            }
        };
        let mut tangential = Value::Null;
        if contact != "procedure" {
            tangential = self.word("roll-slip stick-slide coulomb stick-rotate none");
            let value = self.word("critical-load reduced contact");
            maybe(self, 0.6, "tangential", tangential.clone());
            maybe(self, 0.6, "friction_onset", value);
            let value = self.number(1e-3, 10.0, &[0.0, 10.0]);
            maybe(self, 0.2, "rolling_friction", value);
            let value = self.number(1e-6, 1e6, &[0.0]);
            maybe(self, 0.1, "adhesion", value);
        }
        if contact == "linear-spring" || contact == "hertz" {
            let value = self.word("critical-load flow");
            maybe(self, 1.0, "stiffness_unit", value);
            let value = self.number(1e-3, 1e12, &[inf]);
            maybe(self, 1.0, "stiffness", value);
            let value = self.number(1e-6, 1e6, &[0.0]);
            maybe(self, 0.5, "dashpot", value);
            if tangential == "stick-slide" {
                let value = self.number(1e-3, 100.0, &[]);
                maybe(self, 0.5, "tangential_stiffness", value);
            }
        }
        if contact != "procedure" && self.share() < 0.3 {
            keys.insert("repulsion", self.number(1e-6, 1e6, &[0.0]));
            keys.insert("repulsion_length", self.number(1e-4, 0.5, &[]));
        }
        keys
    }
}

/// A number as TOML has it.
fn number(value: f64) -> Value {
    if value.is_infinite() {
        json!("inf")
    } else {
        json!(value)
    }
}

/// A campaign of these blocks, and the block that each of its lines belongs to.
fn text(blocks: &[BTreeMap<&'static str, Value>]) -> (String, Vec<Option<usize>>) {
    let head = "name = \"extreme\"\n[protocol]\nstrain = 0.1\ndiscard = 0.0\nsample_every = 0.02\ncheckpoint_every = 0.1\n";
    let mut text = head.to_owned();
    let mut owners = vec![None; head.lines().count()];
    for (block, keys) in blocks.iter().enumerate() {
        let lines = keys.iter().map(|(key, value)| match value.as_str() {
            Some("inf") => format!("{key} = inf\n"),
            _ => format!("{key} = {value}\n"),
        });
        for line in std::iter::once("[[grid]]\n".to_owned()).chain(lines) {
            text += &line;
            owners.push(Some(block));
        }
    }
    (text, owners)
}

/// Writes a campaign of the blocks that the reader accepts. Returns the number of those it refuses.
fn write_accepted(at: &Path, mut blocks: Vec<BTreeMap<&'static str, Value>>) -> usize {
    let all = blocks.len();
    loop {
        let (text, owners) = text(&blocks);
        std::fs::write(at.join("extreme.toml"), text).unwrap();
        let plan = run(at, &["plan", "extreme.toml", "--json"]);
        if plan.status.success() {
            return all - blocks.len();
        }
        assert_eq!(plan.status.code(), Some(2), "{plan:?}");
        let said = printed(&plan);
        let lines = said.split("extreme.toml:").skip(1);
        let lines = lines.filter_map(|rest| rest.split(':').next()?.parse::<usize>().ok());
        let faulty: BTreeSet<usize> = lines.filter_map(|line| *owners.get(line - 1)?).collect();
        assert!(!faulty.is_empty(), "{said}");
        let mut block = 0;
        blocks.retain(|_| {
            block += 1;
            !faulty.contains(&(block - 1))
        });
    }
}

#[test]
#[ignore = "minutes: a thousand runs at random parameters"]
fn runs_anywhere_end_by_a_named_cause_with_numbers() {
    extreme(chosen("RUNS", 1000), 100);
}

#[test]
fn some_runs_anywhere_end_by_a_named_cause_with_numbers() {
    extreme(8, 12);
}

fn extreme(wanted: usize, blocks: usize) {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(chosen("SEED", 1) as u64));
    let (mut total, mut refused, mut part) = (0, 0, 0);
    while total < wanted {
        part += 1;
        let folder = folder("extreme.toml", "");
        let at = folder.path();
        let grids = (0..blocks).map(|_| draw.grid(part % 2 == 0)).collect();
        refused += write_accepted(at, grids);
        let ran = program(at)
            .args(["run", "extreme.toml", "-q", "--store", "s.sqlite"])
            .args(["--max-wall-time", "5s"])
            .output()
            .unwrap();
        assert!(matches!(ran.status.code(), Some(0 | 1)), "{ran:?}");
        assert!(!printed(&ran).contains("panic"), "{ran:?}");
        let report = run(
            at,
            &[
                "report",
                "s.sqlite",
                "--json",
                "--runs",
                "runs.csv",
                "--samples",
                "samples.csv",
                "--csv",
                "points.csv",
            ],
        );
        assert!(report.status.success(), "{report:?}");
        let report: Value = serde_json::from_slice(&report.stdout).unwrap();
        // A point has one run, so a doubtful one leaves no average.
        for point in report["points"].as_array().unwrap() {
            let is_doubtful = point["doubtful"].as_u64() > Some(0);
            assert!(!is_doubtful || point["viscosity"].is_null(), "{point}");
        }
        for file in ["runs.csv", "samples.csv", "points.csv"] {
            let text = std::fs::read_to_string(at.join(file)).unwrap();
            let is_none = |cell: &str| {
                cell.trim_start_matches(['+', '-'])
                    .eq_ignore_ascii_case("nan")
            };
            let wrong = text.lines().find(|line| line.split(',').any(is_none));
            assert_eq!(wrong, None, "{file}");
            if file == "runs.csv" {
                let mut lines = text.lines();
                let state = lines
                    .next()
                    .unwrap()
                    .split(',')
                    .position(|name| name == "state");
                for line in lines {
                    let state = line.split(',').nth(state.unwrap()).unwrap();
                    assert!(["done", "jammed", "failed"].contains(&state), "{line}");
                    total += 1;
                }
            }
        }
        let store = rusqlite::Connection::open(at.join("s.sqlite")).unwrap();
        let panics = "SELECT count(*) FROM failures WHERE error LIKE '%panic%'";
        let panics: i64 = store.query_row(panics, [], |row| row.get(0)).unwrap();
        assert_eq!(panics, 0);
    }
    eprintln!("{total} runs; {refused} random points were refused by the reader");
}
