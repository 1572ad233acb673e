//! What users call of runs and instants, compiled in this crate.
//!
//! Generic code is compiled in the crate that uses it, with the optimisation of that crate: a
//! program optimised for size would take three times as long per step. So the two spaces are
//! instantiated here, by [`RunSpace`]. All that computes is called from here, and nothing of it
//! calls back.

use super::instant::{self, Configuration, InstantContacts, SolvedConfiguration};
use super::simulation::{Frame, Sample, Simulation, Snapshot};
use super::spaces::Starts;
use crate::error::Error;
use crate::hydrodynamics::resistance::NearFields;
use crate::model::{Params, SolverSettings};
use crate::space::{Bulk, Layer};
use crate::threads;

/// The spaces, for code that is generic in them: [`Layer`] and [`Bulk`]. No other type can be one.
///
/// It implies all other bounds on spaces in this interface: those of [`Space`](crate::Space), and
/// those of [`Simulation`] and of the [products](crate::products), whose traits have no public
/// names.
///
/// ```
/// use sd_core::{Bulk, Error, Layer, NearFields, Params, RunSpace, Simulation};
///
/// /// The viscosity of a layer or of a suspension in its first step.
/// fn first_viscosity<S: RunSpace>(params: &Params) -> Result<f64, Error> {
///     let mut run = Simulation::<S>::new(params, 1, &NearFields::default())?;
///     Ok(run.step()?.viscosity)
/// }
///
/// let spheres = || {
///     let lubrication = sd_core::LeadingOrder::DEFAULT;
///     let few = Params::builder().spheres(40).hydrodynamics(lubrication);
///     few.roughness(0.01).friction(0.5).shear_rate(1.0)
/// };
/// let layer = spheres().area_fraction(0.3).build()?;
/// let suspension = spheres().volume_fraction(0.1).build()?;
/// assert!(first_viscosity::<Layer>(&layer)? > 1.0);
/// assert!(first_viscosity::<Bulk>(&suspension)? > 1.0);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub trait RunSpace: Starts {
    #[doc(hidden)]
    fn continue_run(
        params: &Params,
        snapshot: Snapshot<Self>,
        tables: &NearFields,
        settings: &SolverSettings,
    ) -> Result<Simulation<Self>, Error>;

    #[doc(hidden)]
    fn advance(run: &mut Simulation<Self>) -> Result<Sample, Error>;

    #[doc(hidden)]
    fn solve(
        configuration: &Configuration<Self>,
        contacts: &InstantContacts<Self>,
        tables: &NearFields,
    ) -> Result<SolvedConfiguration<Self>, Error>;
}

macro_rules! compile {
    ($space:ty) => {
        impl RunSpace for $space {
            #[inline(never)]
            fn continue_run(
                params: &Params,
                snapshot: Snapshot<Self>,
                tables: &NearFields,
                settings: &SolverSettings,
            ) -> Result<Simulation<Self>, Error> {
                Simulation::continued(params, snapshot, tables, settings)
            }

            #[inline(never)]
            fn advance(run: &mut Simulation<Self>) -> Result<Sample, Error> {
                run.advance()
            }

            #[inline(never)]
            fn solve(
                configuration: &Configuration<Self>,
                contacts: &InstantContacts<Self>,
                tables: &NearFields,
            ) -> Result<SolvedConfiguration<Self>, Error> {
                let method = instant::method(configuration, contacts);
                instant::solve_with(method, configuration, contacts, tables)
            }
        }
    };
}

compile!(Layer);
compile!(Bulk);

impl<S: RunSpace> Simulation<S> {
    /// Starts a run from the layer or suspension of a seed.
    ///
    /// # Errors
    /// Parameters out of range, a cell too small, an area fraction that cannot be packed.
    pub fn new(params: &Params, seed: u64, tables: &NearFields) -> Result<Self, Error> {
        Self::from_snapshot(params, Snapshot::start(params, seed)?, tables)
    }

    /// Continues a run from a snapshot made with the same parameters.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if it does not fit the parameters.
    pub fn from_snapshot(
        params: &Params,
        snapshot: Snapshot<S>,
        tables: &NearFields,
    ) -> Result<Self, Error> {
        Self::with_settings(params, snapshot, tables, &SolverSettings::default())
    }

    /// Continues a run from a snapshot with other than the default settings. A run begins with
    /// [`Snapshot::start`].
    ///
    /// ```
    /// use sd_core::model::SolverSettings;
    /// use sd_core::{Layer, NearFields, Params, Simulation, Snapshot};
    ///
    /// let params = Params::builder()
    ///     .spheres(30)
    ///     .area_fraction(0.4)
    ///     .roughness(0.01)
    ///     .friction(0.0)
    ///     .shear_rate(0.0)
    ///     .build()?;
    /// let mut settings = SolverSettings::default();
    /// settings.far_field_tolerance = Some(1e-5);
    /// let start = Snapshot::<Layer>::start(&params, 1)?;
    /// let tables = NearFields::default();
    /// let mut coarse = Simulation::with_settings(&params, start, &tables, &settings)?;
    /// let exact = Simulation::<Layer>::new(&params, 1, &tables)?.step()?.viscosity;
    /// let error = coarse.step()?.viscosity / exact - 1.0;
    /// assert!(error != 0.0 && error.abs() < 1e-5);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Simulation::from_snapshot`] and [`SolverSettings::validate`].
    pub fn with_settings(
        params: &Params,
        snapshot: Snapshot<S>,
        tables: &NearFields,
        settings: &SolverSettings,
    ) -> Result<Self, Error> {
        settings.validate()?;
        S::continue_run(params, snapshot, tables, settings)
    }

    /// One step, and its sample: under rigid contacts by the midpoint rule with the gaps of its
    /// start held, under soft ones by an implicit method of two stages, and by Runge-Kutta of order
    /// four without contact forces and under the paper's procedure.
    ///
    /// Near jamming velocities can jump between two stages, so much that a gap of rigid contacts
    /// falls below h within a step or at its end, or that soft spheres overlap excessively. Such a
    /// step is repeated as two half steps, down to 2⁻⁶ of it. The same applies to a step of rigid
    /// contacts with inexact friction, or with a stage without admissible motion, down to a
    /// quarter; then the result is accepted and counted if the gaps hold. Otherwise the spheres
    /// stay where they are, and have jammed.
    ///
    /// # Errors
    /// [`Error::Step`] with step, strain and cause. The state is that before the step.
    pub fn step(&mut self) -> Result<Sample, Error> {
        self.make_step(true)
    }

    /// One step without its sample, which takes less time: the run continues with the same bits as
    /// after [`Simulation::step`].
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
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
    /// let mut sampled = Simulation::<Layer>::new(&params, 1, &tables)?;
    /// let mut other = Simulation::<Layer>::new(&params, 1, &tables)?;
    /// for _ in 0..5 {
    ///     sampled.step()?;
    ///     other.step_unmeasured()?;
    /// }
    /// assert_eq!(sampled.step()?, other.step()?);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn step_unmeasured(&mut self) -> Result<(), Error> {
        self.make_step(false).map(|_| ())
    }

    fn make_step(&mut self, is_measured: bool) -> Result<Sample, Error> {
        threads::keep_awake(|| {
            self.save();
            self.measure(is_measured);
            S::advance(self).map_err(|source| self.restore(source))
        })
    }

    /// Makes one step, and returns the frame of its sample too. The run itself is not affected.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
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
    /// let (sample, frame) = layer.step_with_frame()?;
    /// assert_eq!(frame.stresslets.len(), 40);
    /// assert_eq!(frame.contacts.len(), sample.contacts as usize);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn step_with_frame(&mut self) -> Result<(Sample, Frame<S>), Error> {
        self.request_frame();
        let result = self.step();
        let frame = self.take_frame().unwrap_or_default();
        Ok((result?, frame))
    }
}

/// Solves one instant.
///
/// # Errors
/// Bad lengths, radii, a net force on a layer, overlaps, a cell too small, pairs out of range,
/// springs of no pair or out of order, an indefinite matrix.
///
/// ```
/// use sd_core::cell::Cell;
/// use sd_core::instant::{Configuration, InstantContacts, solve};
/// use sd_core::modes::Vec2;
/// use sd_core::{Hydrodynamics, Layer, NearFields, VelocityGradient};
///
/// // The stresslet of one sphere in shear, (20/3)π E.
/// let alone = Configuration::<Layer> {
///     centres: vec![Vec2::new(0.0, 0.0)],
///     radii: vec![1.0],
///     cell: Cell::Unbounded,
///     hydrodynamics: Hydrodynamics::StokesianDynamics,
///     background: VelocityGradient::simple_shear(1.0).into(),
///     forces: vec![Vec2::new(0.0, 0.0)],
///     torques: vec![0.0],
/// };
/// let solved = solve(&alone, &InstantContacts::None, &NearFields::default())?;
/// let (_, _, xy) = solved.stresslet(0);
/// assert!((xy - 10.0 / 3.0 * std::f64::consts::PI).abs() < 1e-12);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn solve<S: RunSpace>(
    configuration: &Configuration<S>,
    request: &InstantContacts<S>,
    tables: &NearFields,
) -> Result<SolvedConfiguration<S>, Error> {
    S::solve(configuration, request, tables)
}
