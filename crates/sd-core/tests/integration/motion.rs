//! The motion of spheres, out of a run: velocities, and positions that are not wrapped.

use sd_core::cell::Cell;
use sd_core::model::{CrossShear, Segment};
use sd_core::{
    Bulk, Hydrodynamics, Layer, LeadingOrder, NearFields, Params, RunSpace, Simulation, Snapshot,
    Space,
};

const STEP: f64 = 0.01;

/// A segment from a strain on.
fn from(start: f64, direction: f64) -> Segment {
    Segment {
        start,
        direction: Some(direction),
        ..Segment::default()
    }
}

/// A suspension or a layer under a protocol, at the cheapest hydrodynamics.
fn params<S: Space>(segments: Vec<Segment>) -> Params {
    let start = Params::builder();
    let start = if S::DIMENSIONS == 3 {
        start.spheres(40).volume_fraction(0.2)
    } else {
        start.spheres(30).area_fraction(0.5)
    };
    start
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::Lubrication(LeadingOrder::DEFAULT))
        .time_step(STEP)
        .segments(segments)
        .build()
        .unwrap()
}

fn length<S: Space>(x: S::Vector) -> f64 {
    S::norm_squared(&x).sqrt()
}

/// Whether two positions differ by a vector of the lattice.
fn are_images<S: Space>(cell: &Cell<S>, x: S::Vector, y: S::Vector) -> bool {
    length::<S>(cell.nearest(x - y).0) < 1e-9
}

fn spheres_are_followed_through_the_edges_of_the_cell<S: RunSpace>(
    segments: Vec<Segment>,
    steps: usize,
    rates: impl Fn(f64) -> [f64; 2],
) {
    let (params, tables) = (params::<S>(segments), NearFields::default());
    let mut run = Simulation::<S>::new(&params, 3, &tables).unwrap();
    let (mut before, mut farthest): (Vec<_>, _) = (run.unwrapped().collect(), 0.0_f64);
    assert_eq!(before, run.centres(), "not wrapped at the start");
    let start = before.clone();
    for _ in 0..steps {
        let (_, frame) = run.step_with_frame().unwrap();
        let after: Vec<_> = run.unwrapped().collect();
        let cell = run.cell_at(run.strain()).unwrap();
        for (k, (&x, &old)) in after.iter().zip(&before).enumerate() {
            assert!(are_images(&cell, x, run.centres()[k]));
            // No more than the motion of the step, whose rate is known to first order. Velocities
            // are those of the image in the cell at the start of the step; the flow moves the one
            // that was followed further.
            let [along, cross] = rates(frame.strain);
            let mut carried = S::Vector::default();
            let above = frame.unwrapped[k][1] - frame.centres[k][1];
            carried[0] = along * above;
            if S::DIMENSIONS > 2 {
                carried[2] = cross * above;
            }
            let motion = (S::translation(&run.velocities()[k]) + carried) * STEP;
            assert!(length::<S>(x - old - motion) < 0.02 * (1.0 + length::<S>(motion)));
            farthest = farthest.max(length::<S>(x - start[k]) / run.side());

            // Between the places before and after, at velocities like those of the run.
            let sampled = S::vector(&frame.unwrapped[k]);
            assert!(length::<S>(sampled - old) < length::<S>(x - old) + 0.02);
            let velocity = S::vector(&frame.velocities[k]) + carried;
            assert!(length::<S>(x - old - velocity * STEP) < 0.05 * (1.0 + length::<S>(motion)));
        }
        let [first, second] = [0, 1].map(|k| S::vector(&frame.lattice()[k]));
        let cell = run.cell_at(frame.strain).unwrap();
        for vector in [first, second] {
            assert!(are_images(&cell, vector, S::Vector::default()));
        }
        for (x, unwrapped) in frame.centres.iter().zip(&frame.unwrapped) {
            assert!(are_images(&cell, S::vector(x), S::vector(unwrapped)));
        }
        before = after;
    }
    assert!(farthest > 2.0, "{farthest}");

    // A run that is resumed follows the same images.
    let text = serde_json::to_string(&run.snapshot()).unwrap();
    let snapshot: Snapshot<S> = serde_json::from_str(&text).unwrap();
    let mut resumed = Simulation::from_snapshot(&params, snapshot, &tables).unwrap();
    for _ in 0..20 {
        run.step().unwrap();
        resumed.step().unwrap();
        assert!(run.unwrapped().eq(resumed.unwrapped()));
        assert_eq!(
            serde_json::to_string(&run.snapshot()).unwrap(),
            serde_json::to_string(&resumed.snapshot()).unwrap()
        );
    }
}

#[test]
fn spheres_of_a_layer_are_followed_through_the_edges_of_the_cell() {
    spheres_are_followed_through_the_edges_of_the_cell::<Layer>(Vec::new(), 500, |_| [1.0, 0.0]);
}

#[test]
fn spheres_of_a_layer_are_followed_when_the_shear_is_reversed() {
    let segments = vec![from(0.0, -1.0), from(2.7, 1.0), from(3.1, -1.0)];
    spheres_are_followed_through_the_edges_of_the_cell::<Layer>(segments, 500, |strain| {
        let is_forward = (2.7..3.1).contains(&strain);
        [if is_forward { 1.0 } else { -1.0 }, 0.0]
    });
}

#[test]
fn spheres_of_a_suspension_are_followed_under_cross_shear() {
    let crossed = Segment {
        cross_shear: Some(CrossShear {
            amplitude: 1.3,
            ratio: 2.0,
        }),
        ..from(1.5, 1.0)
    };
    let segments = vec![from(0.0, 1.0), crossed, from(4.5, -1.0)];
    spheres_are_followed_through_the_edges_of_the_cell::<Bulk>(segments, 600, |strain| {
        let crosses = (1.5..4.5).contains(&strain);
        let cross = 1.3 * 2.0 * (2.0 * (strain - 1.5)).cos();
        [
            if strain < 4.5 { 1.0 } else { -1.0 },
            if crosses { cross } else { 0.0 },
        ]
    });
}

#[test]
fn snapshot_with_images_of_other_spheres_is_refused() {
    let (params, tables) = (params::<Layer>(Vec::new()), NearFields::default());
    let mut snapshot = Snapshot::<Layer>::start(&params, 3).unwrap();
    snapshot.images = vec![[0, 1]; 3];
    let error = Simulation::from_snapshot(&params, snapshot, &tables)
        .err()
        .unwrap();
    assert!(error.to_string().contains("images"), "{error}");
}
