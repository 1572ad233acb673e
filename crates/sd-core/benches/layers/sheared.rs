//! Layers with a developed contact network: h = 0.01, ν = 0.3, Γ = 100, rigid contacts.

use sd_core::cell::Cell;
use sd_core::contact::Laws;
use sd_core::internals::{ContactMemory, SolvePass, Span, StageContacts, StageSolver};
use sd_core::model::SolverSettings;
use sd_core::modes::Vec2;
use sd_core::simulation::SchemeMemory;
use sd_core::{
    ContactScheme, Hydrodynamics, Method, NearFields, Params, Simulation, Snapshot,
    VelocityGradient,
};

/// Time step of the runs and of the stages timed.
pub(crate) const TIME_STEP: f64 = 0.005;
/// Strain after which the layer is taken.
const STRAIN: f64 = 0.8;
/// Layers of at least this many spheres are copies of smaller ones.
const COPIED_FROM: usize = 400;

pub(crate) fn params(spheres: usize, area_fraction: f64, hydrodynamics: Hydrodynamics) -> Params {
    Params::builder()
        .spheres(spheres)
        .area_fraction(area_fraction)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(100.0)
        .hydrodynamics(hydrodynamics)
        .contact(ContactScheme::Rigid)
        .time_step(TIME_STEP)
        .build()
        .expect("valid parameters")
}

/// A layer sheared by Ball-Melrose hydrodynamics; from 400 spheres on k × k copies of one of fewer,
/// with as many contacts per sphere.
///
/// # Panics
/// If such an N is not k² times a smaller number of spheres.
pub(crate) fn layer(spheres: usize, area_fraction: f64) -> Snapshot {
    let copies = (1..100)
        .find(|k| spheres / (k * k) < COPIED_FROM && spheres.is_multiple_of(k * k))
        .expect("a number of spheres that copies of fewer than 400 make");
    let params = params(
        spheres / (copies * copies),
        area_fraction,
        Hydrodynamics::BallMelrose,
    );
    let mut simulation = Simulation::<sd_core::Layer>::new(&params, 1, &NearFields::default())
        .expect("valid parameters");
    while simulation.strain() < STRAIN {
        simulation.step().expect("a step that succeeds");
    }
    let small = simulation.snapshot();
    if copies == 1 {
        small
    } else {
        copied(&small, area_fraction, copies)
    }
}

/// k × k copies of a layer.
fn copied(small: &Snapshot, area_fraction: f64, copies: usize) -> Snapshot {
    let mut large = small.clone();
    large.side = copies as f64 * small.side;
    large.memory = SchemeMemory::Laws(ContactMemory::default());
    large.near_pairs.clear();
    large.far_field.clear();
    // Where spheres have been wrapped does not matter here.
    large.images.clear();
    large.shifts.clear();
    let shift = small.steps as f64 * TIME_STEP * small.side;
    for copy in 1..copies * copies {
        let (right, up) = ((copy % copies) as f64, (copy / copies) as f64);
        for &[x, y] in &small.centres {
            large
                .centres
                .push([x + right * small.side + up * shift, y + up * small.side]);
        }
        large.orientations.extend_from_slice(&small.orientations);
        large.radii.extend_from_slice(&small.radii);
    }
    // The same length, with the bits that the parameters give.
    let params = params(large.radii.len(), area_fraction, Hydrodynamics::BallMelrose);
    let (_, side) = sd_core::start::radii_and_side(&params).expect("a valid layer");
    assert!((side / large.side - 1.0).abs() < 1e-12);
    large.side = side;
    large
}

/// The right-hand side of a layer at one instant, in its parts.
pub(crate) struct Layer {
    pub(crate) cell: Cell,
    pub(crate) centres: Vec<Vec2>,
    pub(crate) stage: StageSolver,
    laws: Laws,
    /// Contact forces of the stage before. After the first solve those of the same instant, as good
    /// a start as in a run.
    memory: ContactMemory,
}

impl Layer {
    /// The layer of a snapshot.
    pub(crate) fn new(snapshot: &Snapshot, params: &Params) -> Self {
        let offset = snapshot.steps as f64 * TIME_STEP * snapshot.side;
        let cell = Cell::equal_sides(snapshot.side, offset).expect("positive sides");
        let centres = snapshot.centres.iter();
        let (radii, tables) = (&snapshot.radii, NearFields::default());
        let method = Method::of(params);
        let settings = SolverSettings::default();
        let stage = method.solver(params.hydrodynamics, &cell, radii, &tables, &[], &settings);
        Self {
            cell,
            centres: centres.map(|&[x, y]| Vec2::new(x, y)).collect(),
            stage: stage.expect("a valid layer"),
            laws: Laws::rigid(params.surface()),
            memory: ContactMemory::default(),
        }
    }

    /// Finds the pairs and assembles far field and `R_FU`.
    pub(crate) fn assemble(&mut self) {
        let done = self.stage.assemble(&self.cell, &self.centres);
        done.expect("a regular layer");
    }

    /// Factors the resistance assembled, which [`Layer::solve`] does by itself.
    #[allow(dead_code, reason = "shared between benches, of which some time it")]
    pub(crate) fn factor(&mut self) {
        self.stage.resistance.factor().expect("a regular layer");
    }

    /// Forces, factor and velocities of a stage that looks ahead by `time_span`, once for each
    /// [`Layer::assemble`]; a far field is iterated from zero. Returns whether its contact problem
    /// is solved.
    pub(crate) fn solve(&mut self, time_span: f64) -> bool {
        self.stage.begin_step();
        self.stage.start_far_field_from(&[]);
        let contact = StageContacts::Laws {
            laws: &self.laws,
            span: Span::single(time_span),
            memory: &mut self.memory,
        };
        let solved = self.stage.solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &[],
            contact,
            SolvePass::First,
        );
        solved.expect("finite velocities").converged()
    }

    /// The last part of [`Layer::solve`] alone, once more: contact forces and velocities.
    #[allow(dead_code, reason = "shared between benches, of which some time it")]
    pub(crate) fn solve_contacts(&mut self, time_span: f64) {
        self.stage.begin_step();
        self.stage.start_far_field_from(&[]);
        let contact = StageContacts::Laws {
            laws: &self.laws,
            span: Span::single(time_span),
            memory: &mut self.memory,
        };
        let solved = self.stage.solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &[],
            contact,
            SolvePass::Repeat,
        );
        solved.expect("finite velocities");
    }
}
