use super::*;
use crate::measure::numbers::{Level, Number};
use crate::model::precision::Quantity;
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const RULE: Precision = Precision {
    precision: 0.05,
    quantity: Quantity::Viscosity,
    at_least: 4,
    at_most: 64,
};

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    ((random.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// Standard normal numbers, by Box and Muller.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v) = (uniform(random), uniform(random));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

fn done(values: &[f64]) -> Vec<Outcome> {
    values.iter().map(|v| Outcome::Value(*v)).collect()
}

#[test]
fn batches_have_fixed_sizes_and_are_looked_at_only_when_complete() {
    let mut runs = vec![Outcome::Open; 64];
    let mut sizes = Vec::new();
    loop {
        let decision = RULE.decide(&runs);
        if decision.verdict != Verdict::Open {
            assert_eq!(decision.verdict, Verdict::AtMost);
            break;
        }
        sizes.push(decision.wanted);
        // The last seed of the batch is the last to finish: without it nothing changes.
        for seed in 0..decision.wanted {
            if runs[seed] == Outcome::Open {
                assert_eq!(RULE.decide(&runs).wanted, decision.wanted);
                // A scatter of 100 %: never narrow.
                runs[seed] = Outcome::Value(if seed % 2 == 0 { 0.1 } else { 1.9 });
            }
        }
    }
    assert_eq!(sizes, [4, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 48, 58, 64]);
}

#[test]
fn order_in_which_seeds_finish_does_not_matter() {
    let values: Vec<f64> = (0..64)
        .map(|n| 1.0 + 0.08 * f64::from(n * 37 % 11 - 5) / 5.0)
        .collect();
    let last = RULE.decide(&done(&values));
    assert_eq!(last.verdict, Verdict::Reached);
    assert!(last.wanted < 64);
    // Seeds beyond those that count have no effect.
    let mut beyond = done(&values);
    beyond[last.wanted..].fill(Outcome::Open);
    assert_eq!(RULE.decide(&beyond), last);
    // In reverse order the batch is open until its first seed is done.
    let mut runs = vec![Outcome::Open; 64];
    let mut wanted = RULE.decide(&runs).wanted;
    while RULE.decide(&runs).verdict == Verdict::Open {
        for seed in (0..wanted).rev() {
            runs[seed] = Outcome::Value(values[seed]);
        }
        wanted = RULE.decide(&runs).wanted;
    }
    assert_eq!(RULE.decide(&runs), last);
}

#[test]
fn lost_runs_use_up_their_seeds_and_a_point_without_runs_ends() {
    let all_jammed = RULE.decide(&[Outcome::Lost; 64]);
    assert_eq!(
        (all_jammed.wanted, all_jammed.verdict),
        (4, Verdict::TooFewRuns)
    );
    let mut runs = done(&[1.0; 64]);
    runs[1] = Outcome::Lost;
    let decision = RULE.decide(&runs);
    assert_eq!((decision.wanted, decision.verdict), (6, Verdict::Reached));
}

#[test]
fn a_mean_of_zero_is_never_precise() {
    let decision = RULE.decide(&done(&[0.0; 64]));
    assert_eq!((decision.wanted, decision.verdict), (64, Verdict::AtMost));
}

/// Coverage of the true mean 1 by 95 % intervals, and the mean number of seeds, for runs with this
/// scatter, normal or log-normal.
fn coverage(scatter: f64, skewed: bool, random: &mut ChaCha8Rng) -> (f64, f64) {
    const CAMPAIGNS: u32 = 20_000;
    let sigma = (1.0 + scatter * scatter).ln().sqrt();
    let (mut held, mut seeds) = (0_u32, 0);
    for _ in 0..CAMPAIGNS {
        let mut runs = Vec::new();
        let decision = loop {
            let decision = RULE.decide(&runs);
            if decision.verdict != Verdict::Open {
                break decision;
            }
            while runs.len() < decision.wanted {
                let z = normal(random);
                runs.push(Outcome::Value(if skewed {
                    (sigma * z - 0.5 * sigma * sigma).exp()
                } else {
                    1.0 + scatter * z
                }));
            }
        };
        let estimate = Estimate::of(&values(&runs, decision.wanted).unwrap()).unwrap();
        held += u32::from((estimate.mean - 1.0).abs() <= estimate.ci95.unwrap());
        seeds += decision.wanted;
    }
    (
        f64::from(held) / f64::from(CAMPAIGNS),
        seeds as f64 / f64::from(CAMPAIGNS),
    )
}

#[test]
fn intervals_hold_the_mean_almost_as_often_as_they_say() {
    let mut random = ChaCha8Rng::seed_from_u64(17);
    for skewed in [false, true] {
        for scatter in [0.02, 0.05, 0.07, 0.1, 0.15, 0.2] {
            let (coverage, seeds) = coverage(scatter, skewed, &mut random);
            println!("scatter {scatter} skewed {skewed}: {coverage:.4} with {seeds:.1} seeds");
            assert!(
                coverage >= 0.93,
                "scatter {scatter} skewed {skewed}: {coverage}"
            );
        }
    }
}

#[test]
fn foreseen_seeds_are_those_it_takes() {
    let mut random = ChaCha8Rng::seed_from_u64(18);
    for scatter in [0.03, 0.1] {
        let (_, seeds) = coverage(scatter, false, &mut random);
        let foreseen = RULE.foreseen(scatter) as f64;
        assert!((foreseen / seeds - 1.0).abs() < 0.25, "{foreseen} {seeds}");
    }
}

#[test]
fn every_quantity_is_a_number_of_runs() {
    for quantity in Quantity::ALL {
        let name = quantity.name();
        let number = Number::named(name).unwrap_or_else(|| panic!("{name}"));
        assert!(number.meaning(Level::Runs).is_some(), "{name}");
        assert_eq!(Quantity::of_name(name), Some(quantity));
        let text = serde_json::to_string(&quantity).unwrap();
        assert_eq!(text, format!("\"{name}\""), "as stores have it");
    }
}
