//! How much of the thickening of a layer each choice of its model makes: from the runs of the campaigns
//! `cause-of-thickening` and, with full Stokesian Dynamics, `cause-of-thickening-full`.
//!
//! The rise of a model is ln(η above / η below): the mean over runs of ln η at Γ = 10, where the critical load no longer counts, less
//! that at Γ = 0.01, where hardly any contact bears it, so that neither friction nor its law does anything there. Rises are sums of means over
//! runs, and so is what a choice makes of them: the rise with it less the rise without it, all else the same. A main effect is the mean
//! of that over the other choices, a pair is how much more one choice makes where another is made as well.
//!
//! Intervals are of 95 %, of Student's distribution with the degrees of freedom of Welch and Satterthwaite (B. L. Welch, Biometrika 34,
//! 28 (1947)).

mod questions;

use crate::rows;
use questions::{Counted, FULL, Model, questions};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::BTreeSet;
use std::path::Path;
use sweep::report::{Format, Graph, Line, draw_graph};
use sweep::statistics::Estimate;

/// The shear rate below the transition, and that above it.
const BELOW: f64 = 0.01;
const ABOVE: f64 = 10.0;
/// Area fractions from here on are near jamming, where moments of a run make its mean: there medians in time stand for means.
const NEAR_JAMMING: f64 = 0.775;

/// A run, as `sweep report --runs` writes it.
#[derive(Debug, Clone, Deserialize)]
struct Run {
    state: String,
    hydrodynamics: String,
    tangential: String,
    spheres: usize,
    area_fraction: f64,
    friction: f64,
    stiffness: f64,
    shear_rate: f64,
    viscosity: Option<f64>,
    viscosity_median: Option<f64>,
    viscosity_stresslet: Option<f64>,
    viscosity_stresslet_median: Option<f64>,
    /// The rules that it broke: such runs are averaged nowhere.
    doubts: Option<String>,
}

impl Run {
    /// ln of a viscosity of a run that went to its end, and whose numbers are not doubtful.
    fn logarithm(&self, counted: Counted) -> Option<f64> {
        let is_near_jamming = self.area_fraction > NEAR_JAMMING;
        let [all, stresslets] = if is_near_jamming {
            [self.viscosity_median, self.viscosity_stresslet_median]
        } else {
            [self.viscosity, self.viscosity_stresslet]
        };
        let value = match counted {
            Counted::All => all?,
            Counted::Stresslets => stresslets?,
            Counted::Ratio => all? / stresslets?,
        };
        (self.state == "done" && self.doubts.is_none()).then(|| value.ln())
    }
}

/// What is known of a choice at a place of the design: a row of the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Effect {
    kind: &'static str,
    choice: String,
    friction: f64,
    area_fraction: f64,
    rise: f64,
    rise_ci95: f64,
    /// Runs that it was taken from, and those that jammed or failed instead.
    seeds: usize,
    lost: usize,
}

/// A sum of means of samples with its interval; `None` where one of them has fewer than two values.
fn sum_of_means(terms: &[(f64, Vec<f64>)]) -> Option<Estimate> {
    let (mut sum, mut variance, mut spread) = (0.0, 0.0, 0.0);
    for (weight, values) in terms {
        let number = values.len() as f64;
        if values.len() < 2 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / number;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let part = weight * weight * squares / (number - 1.0) / number;
        sum += weight * mean;
        variance += part;
        spread += part * part / (number - 1.0);
    }
    let freedom = variance * variance / spread;
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(Estimate {
        mean: sum,
        standard_error: Some(variance.sqrt()),
        ci95: Some(student.inverse_cdf(0.975) * variance.sqrt()),
    })
}

/// A rise, and the runs that it was taken from.
struct Rise {
    estimate: Estimate,
    /// Those that went to their end.
    seeds: usize,
    /// Those that jammed or failed, and are in no mean.
    lost: usize,
}

/// The runs of both campaigns.
struct Runs(Vec<Run>);

impl Runs {
    /// The runs of a model at c, ν and Γ. Below the transition friction does not count, and was not varied. Of cells of several sizes it is
    /// the one of the design.
    fn of(&self, model: Model, [c, friction, rate]: [f64; 3]) -> impl Iterator<Item = &Run> {
        let is_below = rate == BELOW;
        let tangential = if is_below {
            "roll-slip"
        } else {
            model.tangential()
        };
        let spheres = if model.hydrodynamics == FULL {
            200
        } else {
            400
        };
        self.0.iter().filter(move |run| {
            run.hydrodynamics == model.hydrodynamics
                && run.tangential == tangential
                && run.spheres == spheres
                && run.stiffness == model.stiffness
                && run.area_fraction == c
                && run.shear_rate == rate
                && (is_below || run.friction == friction)
        })
    }

    /// The rise of a sum of models.
    fn rise(
        &self,
        sum: &[(f64, Model)],
        [c, friction]: [f64; 2],
        counted: Counted,
    ) -> Option<Rise> {
        // Models may occur more than once in a sum, and may share their runs below.
        let mut terms: Vec<(f64, Model, f64)> = Vec::new();
        for (weight, model) in sum {
            for (rate, sign) in [(ABOVE, 1.0), (BELOW, -1.0)] {
                let model = if rate == BELOW {
                    Model {
                        sticks: false,
                        ..*model
                    }
                } else {
                    *model
                };
                let known = terms.iter_mut().find(|t| t.1 == model && t.2 == rate);
                match known {
                    Some(term) => term.0 += sign * weight,
                    None => terms.push((sign * weight, model, rate)),
                }
            }
        }
        terms.retain(|term| term.0.abs() > 1e-12);
        let mut samples = Vec::new();
        let mut lost = 0;
        for (weight, model, rate) in terms {
            let runs = || self.of(model, [c, friction, rate]);
            let values: Vec<f64> = runs().filter_map(|run| run.logarithm(counted)).collect();
            samples.push((weight, values));
            lost += runs()
                .filter(|run| ["jammed", "failed"].contains(&run.state.as_str()))
                .count();
        }
        Some(Rise {
            estimate: sum_of_means(&samples)?,
            seeds: samples.iter().map(|(_, values)| values.len()).sum(),
            lost,
        })
    }

    fn effects(&self) -> Vec<Effect> {
        let places: BTreeSet<(u64, u64)> = self
            .0
            .iter()
            .map(|run| (run.friction.to_bits(), run.area_fraction.to_bits()))
            .collect();
        let mut all = Vec::new();
        for question in questions() {
            for (friction, c) in &places {
                let [friction, c] = [f64::from_bits(*friction), f64::from_bits(*c)];
                let known = self.rise(&question.sum, [c, friction], question.counted);
                all.extend(known.map(|known| Effect {
                    kind: question.kind,
                    choice: question.choice.clone(),
                    friction,
                    area_fraction: c,
                    rise: known.estimate.mean,
                    rise_ci95: known.estimate.ci95.unwrap(),
                    seeds: known.seeds,
                    lost: known.lost,
                }));
            }
        }
        all
    }
}

/// The lines of the figure, from the paper's reading of its model to soft layers that stick.
const LINES: [(&str, &str); 6] = [
    (
        "rigid, roll-slip, stresslets alone",
        "the paper: rigid, roll-slip, stresslets alone",
    ),
    ("rigid, roll-slip", "contact stress counted"),
    ("rigid, coulomb", "friction that sticks: rigid"),
    ("k = 1e5, stick-slide", "the same on springs, k = 1e5"),
    ("k = 1e4, stick-slide", "k = 1e4"),
    ("k = 1e3, stick-slide", "k = 1e3"),
];

/// Rises against c, a panel for each friction.
fn figure(effects: &[Effect]) -> Vec<u8> {
    let mut frictions: Vec<f64> = effects.iter().map(|effect| effect.friction).collect();
    frictions.sort_by(f64::total_cmp);
    frictions.dedup();
    let mut lines = Vec::new();
    for (panel, friction) in frictions.iter().enumerate() {
        for (choice, label) in LINES {
            let points = effects.iter().filter(|effect| {
                effect.kind == "rise" && effect.choice == choice && effect.friction == *friction
            });
            let estimate = |effect: &Effect| Estimate {
                mean: effect.rise,
                standard_error: None,
                ci95: Some(effect.rise_ci95),
            };
            lines.push(Line {
                label: label.to_owned(),
                panel,
                is_path: false,
                points: points.map(|e| (e.area_fraction, estimate(e))).collect(),
            });
        }
    }
    lines.retain(|line| !line.points.is_empty());
    let graph = Graph {
        x: "area fraction c".into(),
        log_x: false,
        y: "ln(η above / η below the transition)".into(),
        panels: frictions.iter().map(|f| format!("ν = {f}")).collect(),
        lines,
    };
    draw_graph(&graph, Format::Svg).unwrap()
}

/// The files of the analysis as they should be, by name.
pub(crate) fn files(folder: &Path) -> [(&'static str, Vec<u8>); 2] {
    let campaigns = ["cause-of-thickening", "cause-of-thickening-full"];
    let runs = campaigns.map(|campaign| rows(&folder.join(format!("{campaign}-runs.csv"))));
    let effects = Runs(runs.concat()).effects();
    let mut table = csv::Writer::from_writer(Vec::new());
    for effect in &effects {
        table.serialize(effect).unwrap();
    }
    [
        (
            "cause-of-thickening-effects.csv",
            table.into_inner().unwrap(),
        ),
        ("cause-of-thickening.svg", figure(&effects)),
    ]
}

#[cfg(test)]
mod tests {
    use super::questions::RIGID;
    use super::*;

    fn run(stiffness: f64, tangential: &str, rate: f64, viscosity: f64, noise: f64) -> Run {
        // Of each viscosity a half is of stresslets below, a quarter above.
        let share = if rate == BELOW { 0.5 } else { 0.25 };
        Run {
            state: "done".into(),
            hydrodynamics: "ball-melrose".into(),
            tangential: tangential.into(),
            spheres: 400,
            area_fraction: 0.7,
            friction: 1.0,
            stiffness,
            shear_rate: rate,
            viscosity: Some(viscosity * noise),
            viscosity_median: None,
            viscosity_stresslet: Some(share * viscosity * noise * noise),
            viscosity_stresslet_median: None,
            doubts: None,
        }
    }

    /// Layers whose viscosities are products: of what each choice makes, exactly.
    fn made_up() -> Runs {
        let mut runs = Vec::new();
        for noise in [0.9, 1.0, 1.0 / 0.9] {
            for (stiffness, softness) in [(RIGID, 1.0), (1e5, 1.0), (1e4, 0.8), (1e3, 0.5)] {
                runs.push(run(stiffness, "roll-slip", BELOW, 10.0, noise));
                runs.push(run(stiffness, "roll-slip", ABOVE, 20.0 * softness, noise));
                if stiffness < RIGID {
                    let viscosity = 60.0 * softness;
                    runs.push(run(stiffness, "stick-slide", ABOVE, viscosity, noise));
                }
            }
        }
        Runs(runs)
    }

    #[test]
    fn what_a_choice_makes_is_found_where_it_is_known() {
        let effects = made_up().effects();
        let rise = |choice: &str| {
            let known: Vec<&Effect> = effects.iter().filter(|e| e.choice == choice).collect();
            assert_eq!(known.len(), 1, "{choice}");
            known[0].rise
        };
        for (choice, wanted) in [
            ("rigid, roll-slip", 2.0_f64),
            ("rigid, roll-slip, stresslets alone", 1.0),
            ("contact stress counted", 2.0),
            ("friction that sticks", 3.0),
            ("k = 1e4 in place of 1e5", 0.8),
            ("k = 1e3 in place of 1e5", 0.5),
            ("friction that sticks, more at k = 1e5 than at 1e3", 1.0),
        ] {
            assert!((rise(choice) - wanted.ln()).abs() < 1e-12, "{choice}");
        }
        let step = |choice: &str| rise(&format!("+ {choice}"));
        assert!((step("softer, k = 1e4") - 0.8_f64.ln()).abs() < 1e-12);
        // What there are no runs for is not told.
        assert!(
            effects
                .iter()
                .all(|effect| effect.choice != "rigid, coulomb")
        );
        // Runs below cancel from the friction law: the interval is that of the runs above.
        let of = |choice: &str| effects.iter().find(|e| e.choice == choice).unwrap();
        assert_eq!(of("friction that sticks, k = 1e4").seeds, 6);
        assert_eq!(of("k = 1e4, stick-slide").seeds, 6);
    }

    #[test]
    fn intervals_are_those_of_welch() {
        // Two samples of five each with the variances 2.5 and 10: t' of 5 degrees of freedom 5.88, half width t s.
        let one = vec![1.0, 2.0, 3.0, 4.0, 5.0];
        let two = vec![2.0, 4.0, 6.0, 8.0, 10.0];
        let estimate = sum_of_means(&[(1.0, two), (-1.0, one)]).unwrap();
        assert!((estimate.mean - 3.0).abs() < 1e-12);
        let error = (2.5_f64 / 5.0 + 10.0 / 5.0).sqrt();
        assert!((estimate.standard_error.unwrap() - error).abs() < 1e-12);
        let student = estimate.ci95.unwrap() / error;
        // t(0.975) lies between those of 5 and 6 degrees of freedom.
        assert!((2.447..2.571).contains(&student), "{student}");
        assert!(sum_of_means(&[(1.0, vec![1.0])]).is_none());
    }
}
