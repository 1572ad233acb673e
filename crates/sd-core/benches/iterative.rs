//! Cost of full Stokesian Dynamics by iteration over the number of spheres: assembly, planning, one product with the mobility, with
//! two vectors at once, iterations of a solve without contacts from nothing and from the one before, its time; then with contacts.
//!
//! c = 0.75, h = 0.01, ν = 0.3, Γ = ∞, rigid contacts, layers sheared by Ball-Melrose hydrodynamics; an N above 400 is made of 2 × 2
//! copies of a layer of N/4, every sphere moved by up to a thousandth of its radius. Arguments are numbers of spheres.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

use sd_core::cell::Cell;
use sd_core::contact::network::passing::NetworkPasses;
use sd_core::contact::rigid::Memory;
use sd_core::contact::{Contacts, Surface};
use sd_core::modes::{Background, Vec2};
use sd_core::resistance::Resistance;
use sd_core::resistance::iterative::{DEFAULT_RESIDUAL, IterativeFarField};
use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params, Simulation};
use std::sync::LazyLock;
use std::time::Instant;

/// Time step of the runs.
const TIME_STEP: f64 = 0.005;
/// Steps before the layer is taken.
const STEPS: u32 = 60;

/// Nanoseconds this process has spent computing, so that others on the machine do not count.
fn computing() -> f64 {
    let spent = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let first = spent.split(' ').next().and_then(|n| n.parse().ok());
    first.unwrap_or_else(|| START.elapsed().as_nanos() as f64)
}

/// Where there is no such account: the clock.
static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Mean milliseconds of several calls after a first one.
fn mean(calls: u32, mut call: impl FnMut()) -> f64 {
    call();
    let start = computing();
    (0..calls).for_each(|_| call());
    1e-6 * (computing() - start) / f64::from(calls)
}

/// Cell and centres of a sheared layer.
fn layer(spheres: usize) -> (Cell, Vec<Vec2>) {
    let copies = if spheres > 400 { 2 } else { 1 };
    let params = Params {
        spheres: spheres / (copies * copies),
        area_fraction: 0.75,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: f64::INFINITY,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact: ContactScheme::Rigid,
        time_step: TIME_STEP,
    };
    let mut simulation =
        Simulation::new(&params, 1, &NearFields::default()).expect("valid parameters");
    for _ in 0..STEPS {
        simulation.step().expect("a step that succeeds");
    }
    let small = simulation.snapshot();
    let shift = f64::from(STEPS) * TIME_STEP * small.side;
    let mut centres = Vec::new();
    for copy in 0..copies * copies {
        let (right, up) = ((copy % copies) as f64, (copy / copies) as f64);
        for [x, y] in &small.centres {
            let k = centres.len() as f64;
            let shake = Vec2::new((12.9 * k).sin(), (78.2 * k + 1.0).sin()) * 1e-3;
            let at = Vec2::new(x + right * small.side + up * shift, y + up * small.side);
            centres.push(if copies > 1 { at + shake } else { at });
        }
    }
    let side = copies as f64 * small.side;
    let offset = copies as f64 * shift;
    (Cell::periodic(side, side, offset).expect("a side"), centres)
}

/// One line of the table.
fn measure(spheres: usize) {
    let (cell, mut centres) = layer(spheres);
    let n = centres.len();
    let radii = vec![1.0; n];
    let near = Resistance::as_network(&cell, &radii, &NearFields::default(), &[]);
    let mut near = near.expect("a valid layer");
    let assembling = mean(3, || near.update(&cell, &centres).expect("no overlap"));
    let mut far = IterativeFarField::new(&cell, &radii, DEFAULT_RESIDUAL).expect("a wide cell");
    let planning = mean(5, || far.update(&cell, &centres).expect("the planned cell"));
    let x: Vec<f64> = (0..6 * n).map(|k| (k as f64).sin()).collect();
    let mut y = vec![0.0; 6 * n];
    let product = mean(100, || far.apply_mobility(&x, &mut y));
    let both = [&x[..], &x[..]].concat();
    let mut two = vec![0.0; 12 * n];
    let pair = mean(50, || far.apply_mobility(&both, &mut two));
    let strain = Background::SHEAR.strain();
    let (mut forces, mut v) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
    near.background_forces(&strain, &mut forces);
    let mut cold = 0;
    let whole = mean(5, || {
        far.forget();
        let found = far.solve(&near, &strain, &forces, &mut v);
        cold = found.expect("a regular layer").iterations;
    });
    // The stage after, half a time step later.
    for (k, x) in centres.iter_mut().enumerate() {
        let flow = Background::SHEAR.velocity(*x) + Vec2::new(v[3 * k], v[3 * k + 1]);
        *x += 0.1 * TIME_STEP * flow;
    }
    let Cell::Periodic {
        length_x,
        length_y,
        offset,
    } = cell
    else {
        return;
    };
    let cell = Cell::periodic(length_x, length_y, offset + 0.1 * TIME_STEP * length_y);
    let cell = cell.expect("a side");
    near.update(&cell, &centres).expect("no overlap");
    far.update(&cell, &centres).expect("the planned cell");
    near.background_forces(&strain, &mut forces);
    let warm = far.solve(&near, &strain, &forces, &mut v);
    let warm = warm.expect("a regular layer").iterations;
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    };
    let (mut contacts, mut memory) = (Contacts::default(), Memory::default());
    let mut offset = offset + 0.1 * TIME_STEP * length_y;
    far.forget();
    for name in ["from nothing", "next stage", "next stage"] {
        let cell = Cell::periodic(length_x, length_y, offset).expect("a side");
        near.update(&cell, &centres).expect("no overlap");
        near.background_forces(&strain, &mut forces);
        let begun = computing();
        far.update(&cell, &centres).expect("the planned cell");
        let (contacts, memory) = (&mut contacts, &mut memory);
        let (shear, span) = (&Background::SHEAR, 0.5 * TIME_STEP);
        let mut motion = NetworkPasses::new(&near, contacts, shear, surface, span, memory);
        let (found, quality) = loop {
            let found = far.solve_passes(&near, &mut motion, &strain, &forces, &mut v);
            if let (quality, false) = motion.finish(&v) {
                break (found.expect("a regular layer"), quality);
            }
        };
        let spent = 1e-6 * (computing() - begun);
        println!("{n:6} with contacts, {name}: {spent:.0} ms, {found:?} {quality:?}");
        for (k, x) in centres.iter_mut().enumerate() {
            let flow = Background::SHEAR.velocity(*x) + Vec2::new(v[3 * k], v[3 * k + 1]);
            *x += span * flow;
        }
        offset += span * length_y;
    }
    let (pairs, points) = far.operator().sizes();
    println!(
        "{n:6} {pairs:8} {points:8} {assembling:9.1} {planning:8.1} {product:8.2} {pair:8.2} {cold:6} {warm:6} {whole:9.1}"
    );
}

fn main() {
    let mut numbers: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    if numbers.is_empty() {
        numbers = vec![200, 800, 2000];
    }
    println!(
        "     N    pairs   pointsassembly/ms  plan/ms product/ms   two/ms  cold  warm  all/ms"
    );
    for spheres in numbers {
        measure(spheres);
    }
}
