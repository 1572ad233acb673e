//! Cost of one right-hand side of full Stokesian Dynamics over the number of spheres, beside faer's bare Cholesky factorization
//! of a matrix of dimension 6N: the least of many interleaved rounds each, so that their ratio holds on a busy machine as well.
//!
//! c = 0.693, h = 0.01, ν = 0.3, Γ = 100, rigid contacts, layers sheared by 0.8. Arguments are numbers of spheres; an N divisible
//! by 4 from 400 on is made of 2 × 2 copies of a layer of N/4.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "layers/sheared.rs"]
mod layers;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec};
use layers::{TIME_STEP, params, quadrupled, sheared};
use sd_core::cell::Cell;
use sd_core::contact::Surface;
use sd_core::contact::rigid::Memory;
use sd_core::modes::{Background, Vec2};
use sd_core::motion::{ContactLaw, Motion};
use sd_core::resistance::Resistance;
use sd_core::{Hydrodynamics, NearFields};
use std::time::Instant;

/// Milliseconds of a call.
fn milliseconds(call: impl FnOnce()) -> f64 {
    let start = Instant::now();
    call();
    1e3 * start.elapsed().as_secs_f64()
}

/// Least times in ms: right-hand side, assembly, factorization, contact solve, bare Cholesky.
fn measure(spheres: usize, seconds: f64) -> [f64; 5] {
    let snapshot = if spheres >= 400 {
        quadrupled(&sheared(spheres / 4))
    } else {
        sheared(spheres)
    };
    let offset = snapshot.steps as f64 * TIME_STEP * snapshot.side;
    let cell = Cell::periodic(snapshot.side, snapshot.side, offset).expect("positive sides");
    let centres: Vec<Vec2> = snapshot
        .centres
        .iter()
        .map(|&[x, y]| Vec2::new(x, y))
        .collect();
    let resistance = Resistance::new(
        Hydrodynamics::StokesianDynamics,
        &cell,
        &snapshot.radii,
        &NearFields::default(),
    );
    let mut motion = Motion::new(resistance.expect("a valid layer"));
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: params(spheres, Hydrodynamics::StokesianDynamics).critical_load(),
    };
    let mut memory = Memory::default();
    let n = 6 * spheres;
    let mut matrix = Mat::<f64>::zeros(n, n);
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
    let mut scratch = MemBuffer::new(scratch);
    let mut least = [f64::INFINITY; 5];
    let start = Instant::now();
    let mut rounds = 0;
    while rounds < 5 || start.elapsed().as_secs_f64() < seconds {
        let assembly = milliseconds(|| {
            let done = motion.resistance.assemble(&cell, &centres);
            done.expect("a regular layer");
        });
        let factorization = milliseconds(|| motion.resistance.factor().expect("a regular layer"));
        let contacts = milliseconds(|| {
            let law = ContactLaw::Rigid {
                surface,
                time_span: 0.5 * TIME_STEP,
                memory: &mut memory,
            };
            motion
                .solve_again(&Background::SHEAR, &[], law)
                .expect("finite velocities");
        });
        matrix.fill(0.0);
        for k in 0..n {
            matrix[(k, k)] = 2.0;
        }
        let bare = milliseconds(|| {
            llt::factor::cholesky_in_place(
                matrix.as_mut(),
                llt::factor::LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut scratch),
                Spec::default(),
            )
            .expect("a positive diagonal");
        });
        let times = [
            assembly + factorization + contacts,
            assembly,
            factorization,
            contacts,
            bare,
        ];
        for (least, time) in least.iter_mut().zip(times) {
            *least = time.min(*least);
        }
        rounds += 1;
    }
    least
}

fn main() {
    let given: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let all = if given.is_empty() {
        vec![50, 90, 200, 400, 800]
    } else {
        given
    };
    println!("ms, least of many rounds");
    println!("    N  right-hand side   assembly  factor  contacts  bare Cholesky 6N   ratio");
    for spheres in all {
        let [total, assembly, factor, contacts, bare] = measure(spheres, 5.0);
        println!(
            "{spheres:5} {total:16.3} {assembly:10.3} {factor:7.3} {contacts:9.3} {bare:17.3} {:7.2}",
            total / bare
        );
    }
}
