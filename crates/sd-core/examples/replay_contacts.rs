//! Replays recorded steps.
#![expect(clippy::print_stdout, clippy::unwrap_used, reason = "a tool")]
#[path = "../benches/layers/clock.rs"]
mod clock;
use clock::Moment;
use sd_core::{NearFields, Params, Simulation, Snapshot};
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let pattern = std::env::args().nth(2).unwrap_or_default();
    let mut files: Vec<_> = std::fs::read_dir(&dir)
        .unwrap()
        .map(|f| f.unwrap().path())
        .collect();
    files.sort();
    let (mut all, mut uncon, mut jam, mut time) = (0, 0, 0, 0.0);
    let tables = NearFields::default();
    for f in files {
        let name = f.file_name().unwrap().to_string_lossy().to_string();
        if !name.contains(&pattern) {
            continue;
        }
        let v: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&f).unwrap()).unwrap();
        let params: Params = serde_json::from_value(v["params"].clone()).unwrap();
        let snap: Snapshot = serde_json::from_value(v["snapshot"].clone()).unwrap();
        if std::env::var("CVX").is_ok() {
            eprintln!("{name}");
        }
        let before = snap.counters;
        let mut s = Simulation::from_snapshot(&params, snap, &tables).unwrap();
        let t = Moment::now();
        let r = s.step();
        let sec = t.seconds();
        let c = s.counters();
        let (a, b, j) = (
            c.stages - before.stages,
            c.unconverged_stages - before.unconverged_stages,
            c.jammed_stages - before.jammed_stages,
        );
        all += a;
        uncon += b;
        jam += j;
        time += sec;
        match r {
            Ok(r) => println!(
                "{name}: stages {a} unconverged {b} jammed {j} eta {:.8} ms {:.2}",
                r.viscosity,
                1e3 * sec
            ),
            Err(e) => println!(
                "{name}: ERROR {e} stages {a} unconverged {b} jammed {j} ms {:.2}",
                1e3 * sec
            ),
        }
    }
    println!("total stages {all} unconverged {uncon} jammed {jam} seconds {time:.3}");
}
