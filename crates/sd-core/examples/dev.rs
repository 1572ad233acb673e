//! dev
use sd_core::*;
fn main() {
    let a: Vec<f64> = std::env::args()
        .skip(1)
        .map(|x| x.parse().unwrap())
        .collect();
    let (n, c, nu, gamma, strain, seed) = (a[0] as usize, a[1], a[2], a[3], a[4], a[5] as u64);
    let scheme = if a.len() > 6 && a[6] == 1.0 {
        ContactScheme::Procedure
    } else {
        ContactScheme::Rigid
    };
    let hydro = if a.len() > 7 && a[7] == 1.0 {
        Hydrodynamics::StokesianDynamics
    } else {
        Hydrodynamics::BallMelrose
    };
    let dt = if a.len() > 8 { a[8] } else { 0.005 };
    let params = Params {
        spheres: n,
        area_fraction: c,
        roughness: 0.01,
        friction: nu,
        shear_rate: gamma,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics: hydro,
        contact: scheme,
        time_step: dt,
    };
    let t = std::time::Instant::now();
    let mut sim = Simulation::new(&params, seed, &NearFields::default()).unwrap();
    println!("start {:?}", t.elapsed());
    let t = std::time::Instant::now();
    let steps = (strain / params.time_step).round() as u64;
    let (mut sum, mut sums, mut k, mut nc, mut sd) = (0.0, 0.0, 0, 0.0, 0.0);
    let mut etas = vec![];
    let mut mg: f64 = 1.0;
    for s in 0..steps {
        match sim.step() {
            Ok(x) => {
                mg = mg.min(x.minimum_gap);
                mg = mg.min(x.minimum_gap);
                if s % (steps / 10).max(1) == 0 {
                    println!(
                        "{:.3} eta {:.3} sl {:.3} n1 {:.3} c {} a {} r {} s {} vn {:.2e} gap {:.5} {:?}",
                        x.strain,
                        x.viscosity,
                        x.viscosity_stresslet,
                        x.normal_stress_difference,
                        x.contacts,
                        x.activated,
                        x.rolling,
                        x.slipping,
                        x.normal_velocity,
                        x.minimum_gap,
                        x.counters
                    );
                }
                if x.strain >= strain.min(2.0) * 0.999 || strain < 2.5 {
                    sum += x.viscosity;
                    sums += x.viscosity_stresslet;
                    k += 1;
                    nc += x.contacts as f64;
                    sd += x.dissipation;
                    etas.push(x.viscosity);
                }
            }
            Err(e) => {
                println!("{e}");
                break;
            }
        }
    }
    println!("min gap at starts {mg:.6}");
    etas.sort_by(f64::total_cmp);
    println!(
        "mean eta {:.4} median {:.3} stresslet {:.4} contacts {:.2} diss {:.4} wall {:?} per stage {:?} {:?}",
        sum / k as f64,
        etas[etas.len() / 2],
        sums / k as f64,
        nc / k as f64,
        sd / k as f64,
        t.elapsed(),
        t.elapsed() / (4 * steps as u32),
        sim.counters()
    );
}
