//! Statistics of flows.
#![expect(clippy::print_stdout, clippy::unwrap_used, reason = "a tool")]
#[path = "../benches/layers/clock.rs"]
mod clock;
use clock::Moment;
use sd_core::{ContactLaws, ContactScheme, Hydrodynamics, NearFields, Params, Simulation, TangentialLaw};
use sd_core::simulation::Frame;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (law, n, c, nu, gamma, strain, seed) = (&a[1], a[2].parse::<usize>().unwrap(), a[3].parse::<f64>().unwrap(), a[4].parse::<f64>().unwrap(), a[5].parse::<f64>().unwrap(), a[6].parse::<f64>().unwrap(), a[7].parse::<u64>().unwrap());
    let dt = a.get(8).map_or(0.005, |x| x.parse().unwrap());
    let rigid = |t| ContactLaws { tangential: t, ..ContactLaws::PAPER };
    let laws = match law.as_str() {
        "roll" => rigid(TangentialLaw::RollSlip), "coulomb" => rigid(TangentialLaw::Coulomb), "stick" => rigid(TangentialLaw::StickRotate),
        "spring" => ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01),
        "spring6" => ContactLaws::linear_spring(1e6, TangentialLaw::StickSlide, 0.01),
        "spring7" => ContactLaws::linear_spring(1e7, TangentialLaw::StickSlide, 0.01),
        _ => panic!() };
    let params = Params { spheres: n, area_fraction: c, roughness: 0.01, friction: nu, shear_rate: gamma, size_ratio: if a.len() > 9 {1.0} else {1.4}, large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose, contact: ContactScheme::Laws(laws), time_step: dt, ..Params::UNWRITTEN };
    let mut s = Simulation::new(&params, seed, &NearFields::default()).unwrap();
    let steps = (strain / dt).round() as u64;
    let (mut eta, mut count, mut times) = (0.0, 0, Vec::new());
    let (mut above, mut below, mut closed) = (0u64, 0u64, 0u64);
    let load = params.critical_load();
    let begin = Moment::now();
    let mut frame = Frame::default();
    for k in 0..steps {
        let t = Moment::now();
        let _ = (&mut frame, &mut above, &mut below, &mut closed, load);
        match s.step() { Ok(x) => { if k * 2 >= steps { eta += x.viscosity; count += 1; } }, Err(e) => { println!("ERROR {e}"); break; } }
        times.push(t.seconds());
        if s.flow() != sd_core::Flow::Flowing { println!("jammed at {}", s.strain()); break; }
    }
    let total = begin.seconds();
    times.sort_by(f64::total_cmp);
    let v = serde_json::to_value(s.counters()).unwrap();
    println!("{law} N={n} c={c} nu={nu} G={gamma} seed={seed}: eta {:.4} strain {:.3} cpu {total:.3} slowest/median {:.0} stages {} unconv {} inexact {} jammed {} gap {:.5}", eta / f64::from(count.max(1)), s.strain(), times[times.len()-1]/times[times.len()/2], v["stages"], v["unconverged_stages"], v["inexact_stages"], v["jammed_stages"], v["minimum_gap"].as_f64().unwrap_or(-1.0));
}
