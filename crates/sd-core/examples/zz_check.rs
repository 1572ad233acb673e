//! throwaway
use sd_core::cell::Cell;
use sd_core::contact::laws::{Laws, Span};
use sd_core::contact::solver::ContactMemory;
use sd_core::contact::warm_start::SpringForces;
use sd_core::contact::warm_start::WarmStart;
use sd_core::modes::{Background, Vec2};
use sd_core::params::DEEPEST_OVERLAP;
use sd_core::resistance::Resistance;
use sd_core::stage::{Contact, StageSolver};
use sd_core::stress::StressWork;
use sd_core::*;
use serde_json::Value;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let sparse = a[1] == "sparse";
    let text = std::fs::read_to_string(&a[2]).unwrap();
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    let numbers = |v: &Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    for r in &all {
        let params: Params = serde_json::from_value(r["params"].clone()).unwrap();
        let full = params.hydrodynamics == Hydrodynamics::StokesianDynamics;
        if sparse && full { continue; }
        let centres: Vec<Vec2> = r["centres"].as_array().unwrap().iter().map(|x| Vec2::new(x[0].as_f64().unwrap(), x[1].as_f64().unwrap())).collect();
        let side = r["side"].as_f64().unwrap();
        let strain = r["steps"].as_f64().unwrap() * params.time_step;
        let cell = Cell::periodic(side, side, strain * side).unwrap();
        let radii = vec![1.0; centres.len()];
        let tables = NearFields::default();
        let mut resistance = if sparse { Resistance::new_pairwise(&cell, &radii, &tables, &[]).unwrap() } else { Resistance::new(params.hydrodynamics, &cell, &radii, &tables).unwrap() };
        let choice = params.contact.laws();
        if choice.is_soft() { resistance.regularise(choice.lubrication_gap, DEEPEST_OVERLAP); }
        let mut stage = StageSolver::new(resistance);
        let laws = Laws::new(choice, params.surface());
        let spring = matches!(laws.tangential, contact::laws::Tangential::StickSlide { .. });
        let forces: Vec<(u32, u32, f64, f64)> = serde_json::from_value(r["memory"].clone()).unwrap();
        let mut memory = ContactMemory {
            springs: SpringForces(if spring { forces.iter().map(|f| (f.0, f.1, f.3)).collect() } else { vec![] }),
            warm_start: WarmStart { forces: if a.len() > 3 { vec![] } else { forces } },
        };
        let t = std::time::Instant::now();
        stage.assemble(&cell, &centres).unwrap();
        let q = stage.solve(&Background::SHEAR, &[], Contact::Laws { laws: &laws, span: Span::alone(r["instant"]["time_span"].as_f64().unwrap()), memory: &mut memory });
        let el = t.elapsed();
        let q = match q { Ok(q) => q, Err(e) => { println!("FAILED {e}"); continue } };
        let stress = StressWork::default().stress(&stage, &Background::SHEAR, side * side);
        let want = numbers(&r["instant"]["velocities"]);
        let largest = want.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let dv = stage.velocities().iter().zip(&want).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / largest;
        let mut df = 0.0f64; let mut fl = 0.0f64; let mut dt = 0.0f64;
        for c in r["instant"]["contacts"].as_array().unwrap() {
            let (i, j) = (c[0].as_u64().unwrap() as usize, c[1].as_u64().unwrap() as usize);
            let k = stage.contacts.list.iter().find(|k| (k.pair.i, k.pair.j) == (i, j));
            let (f, t) = k.map_or((0.0, 0.0), |k| (k.normal_force, k.tangential_force));
            fl = fl.max(c[2].as_f64().unwrap()); df = df.max((f - c[2].as_f64().unwrap()).abs()); dt = dt.max((t - c[3].as_f64().unwrap()).abs());
        }
        let eta = r["instant"]["viscosity"].as_f64().unwrap();
        println!("{} N {} c {} nu {} full {}: old conv {} cons {} | dv {:.1e} df {:.1e} dt {:.1e} deta {:.1e} | res {:.1e} fr {:.1e} systems {} {:?} energy {:.0e}", r["law"].as_str().unwrap(), params.spheres, params.area_fraction, params.friction, full, r["instant"]["converged"], r["instant"]["consistent"], dv, df / fl, dt / fl, (stress.viscosity - eta).abs() / eta, q.residual, q.friction_error, q.systems, el,
            {
              let vol = 2.0*side*side; let p: f64 = stage.contacts.list.iter().chain(&stage.repelled.pairs).map(|c| -c.normal_force*c.normal_velocity + c.tangential_force*c.slip_velocity).sum();
              (vol*(stress.viscosity-1.0) - stress.dissipation*vol - p).abs()/(vol*stress.viscosity)
            });
    }
}
