//! Where the time of a run goes: shares of the parts of its right-hand sides, under either
//! hydrodynamics.
//!
//! ```text
//! cargo bench -p sd-core --bench profile [-- N...]          below 60 spheres, where all matrices are full
//! ```
//!
//! A layer of c = 0.693 (h = 0.01, ν = 0.3, Γ = 100, rigid contacts) is sheared on from 0.8 by
//! steps of 0.005, composed here from parts of the library. Times are CPU times of the thread.
//! Library calls are split by repeating their pieces outside the measured time, so the library
//! needs no instrumentation.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "layers/clock.rs"]
mod clock;
#[path = "layers/sheared.rs"]
mod layers;

use clock::Moment;
use layers::{Layer, TIME_STEP, layer, params};
use sd_core::cell::{Cell, LUBRICATION_RANGE};
use sd_core::contact::ContactState;
use sd_core::internals::{
    FarField, Matrix, NeighbourList, RungeKutta, StaggeredColumns, State, StressWork, TiledCholesky,
};
use sd_core::modes::Vec2;
use sd_core::{Hydrodynamics, VelocityGradient};

const STEPS: u32 = 60;

/// Parts of a run and the seconds that each takes.
#[derive(Default)]
struct Parts(Vec<(&'static str, f64)>);

impl Parts {
    /// Times a call as a part.
    fn time<R>(&mut self, name: &'static str, call: impl FnOnce() -> R) -> R {
        let start = Moment::now();
        let result = call();
        self.add(name, start.seconds());
        result
    }

    /// Adds seconds to a part.
    fn add(&mut self, name: &'static str, seconds: f64) {
        match self.0.iter_mut().find(|part| part.0 == name) {
            Some(part) => part.1 += seconds,
            None => self.0.push((name, seconds)),
        }
    }

    fn seconds(&self, name: &str) -> f64 {
        self.0
            .iter()
            .find(|part| part.0 == name)
            .map_or(0.0, |part| part.1)
    }
}

/// Pieces of a right-hand side, recomputed to be timed separately.
struct Pieces {
    neighbours: NeighbourList,
    far_field: Option<FarField>,
    mobility: TiledCholesky,
    /// Trailing block of the inverse mobility.
    inverse: Matrix,
    /// Columns of normal and of friction forces.
    columns: [StaggeredColumns; 2],
    /// Products of these columns.
    products: [Matrix; 2],
    forces: Vec<f64>,
}

impl Pieces {
    /// Does them at the positions of the right-hand side just solved.
    fn repeat(&mut self, layer: &mut Layer, parts: &mut Parts) {
        // Solving has factored the resistance in place.
        layer.assemble();
        parts.time("factorization", || layer.factor());
        let (cell, centres) = (&layer.cell, &layer.centres);
        let radii = layer.stage.resistance.radii();
        parts.time("neighbours", || {
            let found = self
                .neighbours
                .update(cell, centres, radii, LUBRICATION_RANGE);
            found.expect("no overlap");
        });
        if let Some(far_field) = &mut self.far_field {
            parts.time("real", || far_field.real_space_sums(cell, centres));
            parts.time("wave", || far_field.wave_space_sums(cell, centres));
            parts.time("mobility", || {
                let filled = far_field.fill(cell, centres, self.mobility.matrix_mut());
                filled.expect("a valid layer");
            });
            parts.time("mobility factor", || {
                self.mobility.factor().expect("a regular layer");
                self.mobility.trailing_inverse(&mut self.inverse);
            });
        }
        let strain = VelocityGradient::<sd_core::Layer>::simple_shear(1.0).strain();
        parts.time("background", || {
            let resistance = &mut layer.stage.resistance;
            resistance.background_forces(sd_core::Strains::Uniform(strain), &mut self.forces);
        });
        parts.time("columns", || self.columns(layer));
    }

    /// Columns of the contacts: as many, with the same starts.
    fn columns(&mut self, layer: &Layer) {
        let resistance = &layer.stage.resistance;
        let [normal, slip] = &mut self.columns;
        for (kind, columns) in [&mut *normal, &mut *slip].into_iter().enumerate() {
            let list = layer.stage.contacts.list.iter();
            let mut rows: Vec<[usize; 2]> = list
                .filter(|c| kind == 0 || c.state != ContactState::Frictionless)
                .map(|c| [c.pair.i, c.pair.j].map(|sphere| 3 * sphere))
                .map(|[i, j]| [i.min(j), i.max(j)])
                .collect();
            rows.sort_unstable();
            columns.reset(self.forces.len(), rows.iter().map(|rows| rows[0]));
            for (k, rows) in rows.iter().enumerate() {
                let column = columns.column_mut(k);
                (column[rows[0]], column[rows[1]]) = (-1.0, 1.0);
            }
            columns.solve_lower(resistance.solver());
        }
        let [g_nn, g_tn] = &mut self.products;
        normal.gram(g_nn);
        slip.transposed_product(normal, g_tn);
    }
}

/// Shears a layer; seconds per part, and of the whole.
fn profile(spheres: usize, hydrodynamics: Hydrodynamics) -> (Parts, f64) {
    let params = params(spheres, 0.693, hydrodynamics);
    let snapshot = layer(spheres, params.area_fraction);
    let mut layer = Layer::new(&snapshot, &params);
    let far_field = (hydrodynamics == Hydrodynamics::StokesianDynamics).then(|| {
        FarField::new(&layer.cell, &snapshot.radii, FarField::DEFAULT_TOLERANCE)
            .expect("valid radii")
    });
    let mut pieces = Pieces {
        neighbours: NeighbourList::new(spheres),
        far_field,
        mobility: TiledCholesky::default(),
        inverse: Matrix::default(),
        columns: Default::default(),
        products: Default::default(),
        forces: vec![0.0; 3 * spheres],
    };
    let mut parts = Parts::default();
    let mut stress = StressWork::default();
    let mut state: State = State {
        centres: layer.centres.clone(),
        orientations: snapshot.orientations.clone(),
    };
    let mut integrator = RungeKutta::default();
    let mut whole = 0.0;
    let start = snapshot.steps as f64 * TIME_STEP;
    for step in 0..STEPS {
        let begun = Moment::now();
        let mut apart = 0.0;
        let time = start + f64::from(step) * TIME_STEP;
        let done = integrator.step(&mut state, time, TIME_STEP, |stage, centres, velocities| {
            layer.cell = Cell::equal_sides(snapshot.side, stage.time * snapshot.side)?;
            layer.centres.copy_from_slice(centres);
            parts.time("assembly", || layer.assemble());
            parts.time("solution", || layer.solve(stage.span));
            if stage.number == 0 {
                let solved = &layer.stage;
                parts.time("stress", || {
                    stress.stress(
                        solved,
                        &VelocityGradient::simple_shear(1.0).into(),
                        &VelocityGradient::simple_shear(1.0),
                        snapshot.side * snapshot.side,
                    );
                });
            }
            let flow = |x: Vec2| VelocityGradient::<sd_core::Layer>::simple_shear(1.0).velocity(&x);
            let moved = velocities
                .chunks_exact_mut(3)
                .zip(layer.stage.velocities().chunks_exact(3));
            for ((u, v), &x) in moved.zip(centres) {
                u.copy_from_slice(&[
                    v[0] + flow(x).x,
                    v[1] + flow(x).y,
                    v[2] + VelocityGradient::<sd_core::Layer>::simple_shear(1.0).angular_velocity(),
                ]);
            }
            let again = Moment::now();
            pieces.repeat(&mut layer, &mut parts);
            apart += again.seconds();
            Ok::<(), sd_core::Error>(())
        });
        done.expect("a step that succeeds");
        whole += begun.seconds() - apart;
    }
    (parts, whole)
}

/// The parts in the order of a right-hand side, with their seconds. Differences are not below zero.
fn rows(parts: &Parts, whole: f64) -> Vec<(&'static str, f64)> {
    let of = |name| parts.seconds(name);
    let far = of("mobility") + of("mobility factor");
    let known = of("assembly") + of("solution") + of("stress");
    vec![
        ("neighbours", of("neighbours")),
        ("far field: sums in real space", of("real")),
        ("far field: sums in wave space", of("wave")),
        (
            "far field: mobility assembly",
            of("mobility") - of("real") - of("wave"),
        ),
        (
            "far field: mobility factorization, block of its inverse",
            of("mobility factor"),
        ),
        (
            "pair terms, resistance assembly",
            of("assembly") - of("neighbours") - far,
        ),
        ("resistance factorization", of("factorization")),
        ("forces of the background flow", of("background")),
        ("contact columns and their products", of("columns")),
        (
            "contact and friction forces, velocities",
            of("solution") - of("factorization") - of("background") - of("columns"),
        ),
        ("stress", of("stress")),
        ("other", whole - known),
    ]
}

fn main() {
    let given: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let all = if given.is_empty() { vec![50] } else { given };
    for spheres in all {
        assert!(
            spheres < 60,
            "{spheres} spheres: from 60 on Ball-Melrose has no full matrices to take apart"
        );
        let (full, full_whole) = profile(spheres, Hydrodynamics::StokesianDynamics);
        let (near, near_whole) = profile(spheres, Hydrodynamics::BallMelrose);
        println!("| share of the CPU time of a run, N = {spheres} | full | Ball-Melrose |");
        println!("| --- | ---: | ---: |");
        for ((name, full), (_, near)) in rows(&full, full_whole)
            .into_iter()
            .zip(rows(&near, near_whole))
        {
            let share = |seconds: f64, whole: f64| match (100.0 * seconds / whole).max(0.0) {
                0.0 => "–".to_owned(),
                share => format!("{share:.1} %"),
            };
            println!(
                "| {name} | {} | {} |",
                share(full, full_whole),
                share(near, near_whole)
            );
        }
        let each = |whole: f64| 1e3 * whole / f64::from(4 * STEPS);
        println!(
            "| right-hand side, ms | {:.3} | {:.3} |",
            each(full_whole),
            each(near_whole)
        );
    }
}
