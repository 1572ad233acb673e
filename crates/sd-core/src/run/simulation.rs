//! One run: a layer or a suspension sheared step by step.

mod brownian;
mod evaluation;
mod forces;
mod frame;
mod sample;
mod sampling;
mod scheme_memory;
mod shear_control;
mod snapshot;
mod step;
mod volume;

pub use crate::stress::JAM_VISCOSITY;
pub use forces::Instant;
pub use frame::{Frame, FrameContact};
pub use sample::{Counters, NetworkSample, Sample, StructureSample};
pub use scheme_memory::SchemeMemory;
pub use snapshot::{SNAPSHOT_VERSION, Snapshot};
pub use volume::ARREST_NUMBER;

use crate::contact::laws::Laws;
use crate::error::Error;
use crate::hydrodynamics::resistance::NearFields;
use crate::law::CustomNormalLaw;
use crate::model::{
    ContactScheme, DEEPEST_OVERLAP, Imposed, Keywords as _, Params, PressureKind, Refusal,
    SolverSettings,
};
use crate::procedure::ContactList;
use crate::run::cell_path::{CellPath, planned_cell};
use crate::run::spaces::Starts;
use crate::run::steppers::rosenbrock::Rosenbrock;
use crate::run::steppers::{Midpoint, State, Stepper};
use crate::space::cell::Cell;
use crate::space::pair::PairKey;
use crate::space::{Bulk, Layer, Space, VelocityGradient};
use crate::stage::{Method, StageSolver};
use crate::stress::StressWork;
use brownian::Brownian;
use forces::AppliedForces;
use serde::{Deserialize, Serialize};
use shear_control::ShearControl;
use std::fmt;
use volume::{Extent, StageRates};

/// A run that stays jammed for this strain ends as jammed.
pub const JAM_STRAIN: f64 = 0.1;
/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Flow {
    /// The spheres flow.
    Flowing,
    /// The viscosity stayed above [`JAM_VISCOSITY`] for [`JAM_STRAIN`], or the spheres flow only by
    /// overlaps that their contacts do not allow.
    Jammed,
}

/// A layer or a suspension under shear.
pub struct Simulation<S: Starts = Layer> {
    /// Parameters of the current step, or of the last one.
    params: Params,
    settings: SolverSettings,
    /// The law in place of the spring law of contacts, if there is one.
    custom_law: Option<&'static dyn CustomNormalLaw>,
    /// Parameters with all segments, if there are several.
    run: Option<Box<Params>>,
    pub(crate) imposed: Imposed,
    /// Steps done.
    steps: u64,
    pub(crate) extent: Extent,
    /// How the cell dilates in the current step.
    dilations: StageRates,
    /// How it shears, where the rate is free.
    shears: StageRates,
    /// Centres in the cell of a stage, where it dilates.
    grown: Vec<S::Vector>,
    /// The lattice, unless the run is sheared throughout.
    path: Option<Box<CellPath<S>>>,
    state: State<S>,
    /// Cells along each lattice vector by which the spheres have left the first cell of a sheared
    /// run.
    images: Vec<S::Image>,
    /// Vectors by which the spheres have left their places in the lattice of a run in another flow.
    shifts: Vec<S::Vector>,
    /// What the current step changes, as it was before.
    before: Before<S>,
    /// Contact laws at the present critical load.
    laws: Laws,
    /// Disturbance velocities `[3N]` of the first stage of a step, under laws.
    first: Vec<f64>,
    /// Velocities `[3N]` of the stage solved last, background included; empty before the first.
    motion: Vec<f64>,
    shear_control: ShearControl,
    /// Forces and torques of the user.
    forces: AppliedForces<S>,
    /// Random forces, if the run has them.
    brownian: Option<Brownian>,
    /// The background flow.
    background: VelocityGradient<S>,
    /// Offset of the cell at strain 0, in a.
    offset: f64,
    /// Memory of contacts.
    memory: SchemeMemory<S>,
    counters: Counters,
    /// Linear systems of contact problems since the run was started or resumed.
    systems: u64,
    solver: StageSolver<S>,
    stepper: Stepper<S>,
    stress: StressWork<S>,
    /// Whether the current step is measured.
    is_measured: bool,
    /// The frame of the current step, if requested.
    frame: Option<Box<Frame<S>>>,
    /// Pairs in contact before the stage, under the procedure.
    contact_list_before: ContactList,
}

impl<S: Starts> fmt::Debug for Simulation<S> {
    /// What tells one run from another: spheres and workspaces would fill pages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Simulation")
            .field("params", &self.params)
            .field("steps", &self.steps)
            .field("strain", &self.strain())
            .finish_non_exhaustive()
    }
}

// Users move runs to other threads and share them: no field may forbid that.
const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<Simulation<Layer>>();
    is_shared::<Simulation<Bulk>>();
};

/// The background flow of a step.
fn background<S: Space>(params: &Params, imposed: &Imposed) -> VelocityGradient<S> {
    VelocityGradient::of_type(params.flow, params.direction).with_cross_shear(imposed.cross_rate())
}

/// What a step changes, as it was before the step.
struct Before<S: Space> {
    state: State<S>,
    extent: Extent,
    memory: SchemeMemory<S>,
    shear_control: ShearControl,
    counters: Counters,
}

impl<S: Starts> Simulation<S> {
    /// Puts a law of the normal force in place of the spring law of the parameters. It is no part
    /// of a snapshot: a run that is resumed needs it again. A law made at run time is leaked:
    /// `Box::leak(Box::new(law))`.
    ///
    /// `examples/cone.rs` shears a layer with one.
    ///
    /// # Errors
    /// [`Error::Refused`] if the contacts of the parameters are no springs.
    pub fn use_normal_law(&mut self, law: &'static dyn CustomNormalLaw) -> Result<(), Error> {
        let replaced = self.params.contact.laws().normal;
        if !replaced.is_spring() {
            return Err(Refusal {
                key: "contact",
                value: format!("{:?}", replaced.word()),
                problem: "is no spring that another law could replace".into(),
                allowed: "\"linear-spring\" with the stiffness of that law".into(),
                because: None,
            }
            .into());
        }
        self.custom_law = Some(law);
        self.laws = self.laws_at_load();
        Ok(())
    }

    /// Continues a run from a snapshot, with valid settings.
    pub(super) fn continued(
        params: &Params,
        mut snapshot: Snapshot<S>,
        tables: &NearFields,
        settings: &SolverSettings,
    ) -> Result<Self, Error> {
        params.validate()?;
        S::check(params)?;
        snapshot.check(params)?;
        let imposed = params.imposed(snapshot.steps.saturating_sub(1));
        let cell = planned_cell::<S>(params, snapshot.side)?;
        let mut path = CellPath::of_run(params, snapshot.side)?.map(Box::new);
        let extent = snapshot.extent(params);
        if let Some(path) = &mut path {
            path.enter(params, imposed.segment)?;
        }
        let method = Method::of(params);
        let mut solver = method.solver(
            params.hydrodynamics,
            &cell,
            &snapshot.radii,
            tables,
            &snapshot.near_pairs,
            settings,
        )?;
        solver.start_far_field_from(&snapshot.far_field);
        solver.resistance.expect_contacts(params.roughness);
        let friction = params.contact.laws().hydrodynamic();
        solver.resistance.roughen(friction);
        let mut stepper = Stepper::default();
        let run = (!params.segments.is_empty()).then(|| Box::new(params.clone()));
        let params = params.in_step(&imposed);
        let shear_control = ShearControl::new(&params, snapshot.critical_load);
        if params.contact != ContactScheme::Procedure {
            let choice = params.contact.laws();
            stepper = if choice.is_soft() {
                let (gap, deepest) = (choice.lubrication_gap, DEEPEST_OVERLAP);
                solver.resistance.regularise(gap, deepest);
                Stepper::Rosenbrock(Rosenbrock::default())
            } else {
                Stepper::Midpoint(Midpoint::default())
            };
        }
        snapshot.images.resize(params.spheres, S::Image::default());
        let mut shifts: Vec<_> = snapshot.shifts.iter().map(S::vector).collect();
        shifts.resize(params.spheres, S::Vector::default());
        Ok(Self {
            before: Before {
                state: State::default(),
                extent,
                memory: SchemeMemory::new(&params.contact),
                shear_control,
                counters: snapshot.counters,
            },
            settings: *settings,
            custom_law: None,
            run,
            imposed,
            steps: snapshot.steps,
            extent,
            dilations: StageRates::default(),
            shears: StageRates::default(),
            grown: Vec::new(),
            path,
            state: State {
                centres: snapshot.centres.iter().map(S::vector).collect(),
                orientations: snapshot.orientations,
            },
            images: snapshot.images,
            shifts,
            laws: shear_control.laws(&params),
            first: Vec::with_capacity(S::MODES * params.spheres),
            motion: Vec::with_capacity(S::MODES * params.spheres),
            shear_control,
            forces: AppliedForces::default(),
            background: background(&params, &imposed),
            brownian: snapshot.noise_seed.map(Brownian::new),
            offset: params.given_layer().map_or(0.0, |layer| layer.offset),
            memory: snapshot.memory,
            counters: snapshot.counters,
            systems: 0,
            solver,
            stepper,
            stress: StressWork::default(),
            is_measured: true,
            frame: None,
            contact_list_before: ContactList::default(),
            params,
        })
    }

    /// The cell at a strain of the current step; with segments, valid while the flow of the last
    /// step continues.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`] for a strain that is not finite.
    pub fn cell_at(&self, strain: f64) -> Result<Cell<S>, Error> {
        if let Some(path) = &self.path {
            let scale = self
                .params
                .imposes_pressure()
                .then(|| self.extent.side * self.dilations.growth());
            let [net, cross] = self.imposed.gained(strain, self.params.time_step);
            let segment = self.imposed.segment;
            return match &self.run {
                Some(run) if !path.is_in(segment) => {
                    let mut path = path.clone();
                    path.enter(run, segment)?;
                    path.at(net, cross)
                }
                _ => path.at(net, cross),
            }
            .map(|cell| scale.map_or(cell, |scale| cell.scaled(scale)));
        }
        let [offset, cross_offset] = self.travelled_at(strain);
        let growth = match self.params.pressure {
            PressureKind::Isotropic => self.dilations.growth(),
            PressureKind::Gradient => 1.0,
        };
        Cell::periodic(self.sides(), offset * growth)?.with_cross_offset(cross_offset * growth)
    }

    /// Wrapped offset of the upper image cell at a strain; with segments, valid while the shear of
    /// the last step continues. 0 where [`Simulation::cell_at`] fails.
    pub fn offset_at(&self, strain: f64) -> f64 {
        self.cell_at(strain).map_or(0.0, |cell| cell.offset())
    }

    /// Whether the spheres still flow.
    pub fn flow(&self) -> Flow {
        if self.counters.jammed_steps_running >= self.jam_steps() {
            Flow::Jammed
        } else {
            Flow::Flowing
        }
    }

    /// Steps of [`JAM_STRAIN`].
    fn jam_steps(&self) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "steps are at least 1e-7 of strain"
        )]
        let steps = (JAM_STRAIN / self.params.time_step).ceil() as u64;
        steps
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Strain reached, in either direction: the time, and 0 in fluid at rest. Under a stress
    /// imposed on Brownian spheres the net strain, which noise makes vary.
    pub fn strain(&self) -> f64 {
        if self.params.at_rest {
            0.0
        } else {
            self.free_strain().unwrap_or_else(|| self.time())
        }
    }

    /// Time reached, in the unit of [`Params::time_step`]: inverse rates, in fluid at rest the unit
    /// that the forces are given in, and mu/σ under a stress imposed on Brownian spheres.
    pub fn time(&self) -> f64 {
        self.time_of(self.steps)
    }

    /// Time after that many steps.
    fn time_of(&self, steps: u64) -> f64 {
        steps as f64 * self.params.time_step
    }

    /// Centres, in a, in the cell of the strain reached.
    pub fn centres(&self) -> &[S::Vector] {
        &self.state.centres
    }

    /// Centres, in a, followed from the start of the run without being moved back into the cell:
    /// the image of each sphere that the flow has carried from its place at strain 0. Differences
    /// in time are displacements, those of the background flow included.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Layer, NearFields, Params, Simulation};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    /// let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default())?;
    /// let before: Vec<_> = layer.unwrapped().collect();
    /// for _ in 0..100 {
    ///     layer.step()?;
    /// }
    /// // The mean square displacement along the gradient, which the flow does not contribute to.
    /// let displacements = layer.unwrapped().zip(&before).map(|(x, start)| x.y - start.y);
    /// let mean_square = displacements.map(|dy| dy * dy).sum::<f64>() / 40.0;
    /// assert!(mean_square > 0.0 && mean_square < 1.0);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn unwrapped(&self) -> impl Iterator<Item = S::Vector> {
        self.unwrapped_at(self.time(), &self.state.centres)
    }

    /// Centres at a strain of the current step, each moved to the image that was followed.
    fn unwrapped_at<'c>(
        &self,
        strain: f64,
        centres: &'c [S::Vector],
    ) -> impl Iterator<Item = S::Vector> + use<'c, '_, S> {
        let [along, cross] = self.travelled_at(strain);
        let since = strain - self.time();
        let Extent { side, height, .. } = self.extent;
        let places = centres.iter().zip(&self.images).zip(&self.shifts);
        places.map(move |((&x, image), shift)| {
            if self.path.is_some() {
                return x + self.background.carried(shift, since);
            }
            let mut x = x;
            for k in 0..S::DIMENSIONS {
                let side = if k == 1 { side * height } else { side };
                x[k] += f64::from(image[k]) * side;
            }
            let up = f64::from(image[1]);
            x[0] += up * along;
            if S::DIMENSIONS > 2 {
                x[2] += up * cross;
            }
            x
        })
    }

    /// Moves all spheres into the cell of the strain reached, and counts the cells moved by, or in
    /// another flow than shear adds the vectors.
    fn wrap(&mut self, cell: &Cell<S>) {
        if self.path.is_some() {
            let dt = self.params.time_step;
            let growth = self.extent.side / self.before.extent.side;
            for (x, shift) in self.state.centres.iter_mut().zip(&mut self.shifts) {
                let before = *x;
                *x = cell.wrap(before);
                *shift = self.background.carried(shift, dt) * growth + (before - *x);
            }
            return;
        }
        // Whole sides by which the shifts of the cell's images differ from those travelled.
        let sides = self.travelled_at(self.time()).map(|shift| {
            #[expect(clippy::cast_possible_truncation, reason = "strains are below 2^31")]
            let sides = (shift / self.extent.side + 0.5).floor() as i32;
            sides
        });
        for (x, image) in self.state.centres.iter_mut().zip(&mut self.images) {
            let before = *x;
            *x = cell.wrap(before);
            if *x == before {
                continue;
            }
            let (_, moved) = cell.nearest(*x - before);
            for k in 0..S::DIMENSIONS {
                image[k] += moved[k];
            }
            image[0] -= moved[1] * sides[0];
            if S::DIMENSIONS > 2 {
                image[2] -= moved[1] * sides[1];
            }
        }
    }

    /// Velocities and angular velocities `(U, Ω)` of the spheres, in a·rate and rate,
    /// background included, at the stage solved last: the middle of the last step or its second
    /// stage. None before the first step. The background is that at the image in the cell.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Layer, NearFields, Params, Simulation};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    /// let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default())?;
    /// assert!(layer.velocities().is_empty());
    /// layer.step()?;
    /// let spin: f64 = layer.velocities().iter().map(|[_, _, spin]| spin).sum();
    /// assert!((spin / 40.0 + 0.5).abs() < 0.3); // the fluid turns at −1/2
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn velocities(&self) -> &[S::PerMode<f64>] {
        S::by_sphere(&self.motion)
    }

    /// Orientations: in radians, or unit quaternions.
    pub fn orientations(&self) -> &[S::Orientation] {
        &self.state.orientations
    }

    /// Radii, in a.
    pub fn radii(&self) -> &[f64] {
        self.solver.resistance.radii()
    }

    /// Counters so far.
    ///
    /// ```
    /// use sd_core::{Layer, NearFields, Simulation};
    /// # use sd_core::{Hydrodynamics, Params};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    ///
    /// let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default())?;
    /// layer.step()?;
    /// let counters = layer.counters();
    /// assert!(counters.stages >= 2 && counters.unconverged_stages == 0);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Linear systems of contact problems that were solved since the run was started or resumed,
    /// those of rejected attempts included: a measure of its cost that does not depend on the
    /// machine.
    pub fn linear_systems(&self) -> u64 {
        self.systems
    }

    /// The pairs of the near part's pattern, if the resistance is stored pair by pair.
    fn near_pairs(&self) -> Vec<PairKey> {
        let pairwise = self.solver.resistance.pairwise();
        pairwise.map_or_else(Vec::new, |pairwise| pairwise.pattern_pairs().to_vec())
    }

    /// All that the next step needs. As JSON it keeps its bits with the feature `float_roundtrip`
    /// of serde_json.
    ///
    /// ```
    /// use sd_core::{Layer, NearFields, Simulation};
    /// # use sd_core::{Hydrodynamics, Params};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    ///
    /// let tables = NearFields::default();
    /// let mut layer = Simulation::<Layer>::new(&params, 1, &tables)?;
    /// layer.step()?;
    /// let mut resumed = Simulation::from_snapshot(&params, layer.snapshot(), &tables)?;
    /// assert_eq!(resumed.step()?, layer.step()?); // the same bits
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn snapshot(&self) -> Snapshot<S> {
        Snapshot {
            version: SNAPSHOT_VERSION,
            steps: self.steps,
            radii: self.solver.resistance.radii().to_vec(),
            side: self.extent.side,
            height: self.extent.height,
            travelled: self.extent.travelled,
            viscosity: self
                .params
                .macroscopic_friction
                .map(|_| self.extent.viscosity),
            centres: self.state.centres.iter().map(S::point).collect(),
            orientations: self.state.orientations.clone(),
            images: self.images.clone(),
            shifts: match &self.path {
                Some(_) => self.shifts.iter().map(S::point).collect(),
                None => Vec::new(),
            },
            memory: self.memory.clone(),
            near_pairs: self.near_pairs(),
            far_field: self.solver.far_field(),
            noise_seed: self.brownian.as_ref().map(Brownian::seed),
            critical_load: self.shear_control.critical_load(),
            counters: self.counters,
        }
    }
}
