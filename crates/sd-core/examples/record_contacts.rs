//! Records steps of runs as fixtures of contact problems.
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a tool"
)]
#[path = "../benches/layers/clock.rs"]
mod clock;
use clock::Moment;
use rayon::prelude::*;
use sd_core::law::Words as _;
use sd_core::{
    ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, NearFields, NormalLaw, Params,
    Simulation, TangentialLaw,
};

fn main() {
    let out = std::env::args().nth(1).unwrap();
    let rigid = |t| ContactLaws {
        tangential: t,
        ..ContactLaws::PAPER
    };
    let spring = |t| ContactLaws::linear_spring(1e4, t, 0.01);
    let laws: Vec<(&str, ContactLaws)> = vec![
        ("rigid-roll-slip", rigid(TangentialLaw::RollSlip)),
        ("rigid-coulomb", rigid(TangentialLaw::Coulomb)),
        (
            "rigid-coulomb-reduced",
            ContactLaws {
                onset: FrictionOnset::Reduced,
                ..rigid(TangentialLaw::Coulomb)
            },
        ),
        ("rigid-stick-rotate", rigid(TangentialLaw::StickRotate)),
        ("spring-stick-slide", spring(TangentialLaw::StickSlide)),
        ("spring-coulomb", spring(TangentialLaw::Coulomb)),
        ("spring-roll-slip", spring(TangentialLaw::RollSlip)),
        (
            "hertz-stick-slide",
            ContactLaws {
                normal: NormalLaw::Hertz,
                ..spring(TangentialLaw::StickSlide)
            },
        ),
    ];
    let mut cases = Vec::new();
    for (name, law) in &laws {
        let main = *name == "rigid-coulomb";
        for (n, cs, nus) in [
            (
                50,
                vec![0.60, 0.693, 0.72, 0.76, 0.80],
                vec![0.3, 1.0, 10.0],
            ),
            (100, vec![0.693, 0.76, 0.80], vec![0.3, 1.0]),
            (200, vec![0.693, 0.76], vec![0.3, 1.0]),
            (400, vec![0.693, 0.76], vec![0.3]),
        ] {
            if !main && (n == 100) {
                continue;
            }
            for &c in &cs {
                for &nu in &nus {
                    if !main
                        && ((n == 50 && (c == 0.60 || c == 0.72))
                            || (n == 200 && c == 0.76 && nu == 1.0))
                    {
                        continue;
                    }
                    if law.tangential == TangentialLaw::StickRotate && nu != 1.0 {
                        continue;
                    }
                    if !main && law.tangential == TangentialLaw::RollSlip && nu == 10.0 {
                        continue;
                    }
                    let full = main && n == 50 && c == 0.693;
                    for h in if full {
                        vec![Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics]
                    } else {
                        vec![Hydrodynamics::BallMelrose]
                    } {
                        cases.push((
                            *name,
                            Params {
                                spheres: n,
                                area_fraction: c,
                                roughness: 0.01,
                                friction: nu,
                                shear_rate: 10.0,
                                size_ratio: 1.4,
                                large_fraction: 0.5,
                                hydrodynamics: h,
                                contact: ContactScheme::Laws(*law),
                                time_step: if c > 0.7 { 0.01 } else { 0.005 },
                                ..Params::UNWRITTEN
                            },
                            h == Hydrodynamics::StokesianDynamics,
                        ));
                    }
                }
            }
        }
    }
    println!("{} cases", cases.len());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .unwrap();
    pool.install(|| {
        cases.par_iter().for_each(|(name, params, full)| {
            let mut layer = match Simulation::new(params, 3, &NearFields::default()) {
                Ok(l) => l,
                Err(e) => {
                    println!("{name}: {e}");
                    return;
                }
            };
            let begin = Moment::now();
            let (mut hardest, mut snap, mut last, mut times) = (0.0, None, None, Vec::new());
            let steps = (0.6 / params.time_step) as u64;
            for step in 0..steps {
                let before = layer.snapshot();
                let t = Moment::now();
                let ok = layer.step().is_ok();
                let took = t.seconds();
                times.push(took);
                if step * 3 > steps && took > hardest || snap.is_none() && step > 5 {
                    hardest = took;
                    snap = Some(before.clone());
                }
                last = Some(before);
                if !ok || begin.seconds() > 25.0 || layer.flow() != sd_core::Flow::Flowing {
                    break;
                }
            }
            times.sort_by(f64::total_cmp);
            let label = format!(
                "{name}{}-n{}-c{}-nu{}",
                if *full { "-full" } else { "" },
                params.spheres,
                params.area_fraction,
                params.friction
            );
            println!(
                "{label}: {} steps, median {:.2e} hardest {hardest:.2e} max {:.2e}",
                times.len(),
                times[times.len() / 2],
                times[times.len() - 1]
            );
            for (kind, s) in [("hard", snap), ("last", last)] {
                if let Some(s) = s {
                    let text = serde_json::to_string(
                        &serde_json::json!({"params": params, "snapshot": s}),
                    )
                    .unwrap();
                    std::fs::write(format!("{out}/{label}-{kind}.json"), text).unwrap();
                }
            }
            let _ = NormalLaw::Rigid.word();
        })
    });
}
