//! The state from which a run can continue.

use super::Counters;
use super::scheme_memory::SchemeMemory;
use super::shear_control::ShearControl;
use super::volume::Extent;
use crate::contact::ContactMemory;
use crate::contact::springs::Springs;
use crate::error::Error;
use crate::model::{Params, StartLayer};
use crate::run::cell_path::CellPath;
use crate::run::spaces::Starts;
use crate::run::start;
use crate::space::cell::Cell;
use crate::space::pair::PairKey;
use crate::space::{Layer, Space};
use crate::stage::Method;
use serde::{Deserialize, Serialize};

/// Version of [`Snapshot`].
pub const SNAPSHOT_VERSION: u32 = 6;

/// The state needed by the next step. Restored with the same parameters, a run continues with the
/// same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Snapshot<S: Space = Layer> {
    /// [`SNAPSHOT_VERSION`].
    pub version: u32,
    /// Steps done; strain = steps × time step.
    pub steps: u64,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Side of the square or cubic cell, or of one with the content of the lattice, in a; where the
    /// cell dilates along the gradient alone, the side across that.
    pub side: f64,
    /// Height of the cell along the gradient over that side.
    #[serde(default = "one")]
    pub height: f64,
    /// Distances along x and z by which the images above have travelled, in a, where the height
    /// changes or the rate of shear is free.
    #[serde(default)]
    pub travelled: [f64; 2],
    /// Viscosity of the last stage, from which the next pressure follows where the ratio of stress
    /// and pressure is imposed; `None` otherwise.
    #[serde(default)]
    pub viscosity: Option<f64>,
    /// Centres, in a.
    pub centres: Vec<S::Point>,
    /// Orientations: in radians, or unit quaternions.
    pub orientations: Vec<S::Orientation>,
    /// Cells along each lattice vector by which the spheres have left the first cell, see
    /// [`crate::Simulation::unwrapped`]; empty: none.
    #[serde(default)]
    pub images: Vec<S::Image>,
    /// Vectors by which the spheres have left their places in the lattice of a flow that is no
    /// shear, in a; empty: none.
    #[serde(default)]
    pub shifts: Vec<S::Point>,
    /// Memory of contacts.
    pub memory: SchemeMemory<S>,
    /// Ordered pairs of the near part's pattern, if the resistance is stored pair by pair: they
    /// determine the order of elimination.
    #[serde(default)]
    pub near_pairs: Vec<PairKey>,
    /// Initial guess of the next solve of an iterated far field, `[12N + 4]`, in a suspension
    /// `[22N + 4]`: force modes of the last solution and associated values, in single precision.
    /// Empty before the first step, and without iteration.
    #[serde(default)]
    pub far_field: Vec<f32>,
    /// F_crit at the last stage, in mu·a²·rate, under an imposed stress; forces of tangential
    /// springs refer to it. `None` before the first stage, and under an imposed rate.
    #[serde(default)]
    pub critical_load: Option<f64>,
    /// Seed of the random forces of Brownian motion, which with the number of the step determines
    /// them; `None` without.
    #[serde(default)]
    pub noise_seed: Option<u64>,
    /// Counters.
    pub counters: Counters,
}

/// Whether the spheres are Brownian in any part of a run.
fn is_thermal(params: &Params) -> bool {
    let flows = params.flows();
    flows.iter().any(|flow| flow.thermal_energy().is_some())
}

/// Default of [`Snapshot::height`].
fn one() -> f64 {
    1.0
}

impl Snapshot {
    /// The start layer for another run in shear. `params` are those of this run, which must be
    /// sheared too.
    ///
    /// # Errors
    /// [`Error::Snapshot`] of a run whose cell is not square: in extension, or dilated along the
    /// gradient alone.
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
    /// let mut first = Simulation::<Layer>::new(&params, 1, &tables)?;
    /// first.step()?;
    /// let start = Some(first.snapshot().layer(&params)?.into());
    /// let faster = Params { shear_rate: 20.0, start, ..params };
    /// let second = Simulation::<Layer>::new(&faster, 1, &tables)?;
    /// assert_eq!(second.radii(), first.radii());
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn layer(&self, params: &Params) -> Result<StartLayer, Error> {
        if !params.is_sheared() || self.height != 1.0 {
            return Err(Error::Snapshot {
                reason: "its cell is not square, and layers begin in square ones",
            });
        }
        let last = params.in_step(&params.imposed(self.steps.saturating_sub(1)));
        let stiffness = ShearControl::new(&last, self.critical_load)
            .laws(&last)
            .tangential_stiffness;
        let stretches = |springs: fn(&ContactMemory) -> &Springs| match &self.memory {
            SchemeMemory::Laws(memory) if stiffness > 0.0 => {
                let forces = springs(memory).forces.0.iter();
                forces.map(|&(i, j, f)| (i, j, f / stiffness)).collect()
            }
            SchemeMemory::Laws(_) | SchemeMemory::Procedure { .. } => Vec::new(),
        };
        let [offset, _] = self.offsets(params);
        Ok(StartLayer {
            side: self.side,
            offset: offset - self.side * (offset / self.side + 0.5).floor(),
            radii: self.radii.clone(),
            centres: self.centres.clone(),
            orientations: self.orientations.clone(),
            origin: None,
            springs: stretches(|memory| &memory.springs),
            rolling_springs: stretches(|memory| &memory.rolling_springs),
        })
    }
}

impl<S: Space> Snapshot<S> {
    /// The periodic cell of the next step of the run with these parameters.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub fn cell(&self, params: &Params) -> Result<Cell<S>, Error> {
        let imposed = params.imposed(self.steps);
        let strain = self.steps as f64 * params.time_step;
        let Some(mut path) = CellPath::of_run(params, self.side)? else {
            if self.height != 1.0 {
                let mut sides = S::Vector::default();
                for k in 0..S::DIMENSIONS {
                    sides[k] = self.side;
                }
                sides[1] *= self.height;
                let [along, cross] = self.travelled;
                return Cell::periodic(sides, along)?.with_cross_offset(cross);
            }
            let [offset, cross] = self.offsets(params);
            return Cell::equal_sides(self.side, offset)?.with_cross_offset(cross);
        };
        path.enter(params, imposed.segment)?;
        let [net, cross] = imposed.gained(strain, params.time_step);
        let cell = path.at(net, cross)?;
        Ok(if params.imposes_pressure() {
            cell.scaled(self.side)
        } else {
            cell
        })
    }

    /// Distances along x and z by which the images above have moved in a sheared cell of equal
    /// sides, in a, not wrapped.
    fn offsets(&self, params: &Params) -> [f64; 2] {
        let before = params.given_layer().map_or(0.0, |layer| layer.offset);
        let [along, cross] = if params.has_free_rate() {
            self.travelled
        } else {
            let strains = [
                params.net_strain(self.steps),
                params.cross_strain(self.steps),
            ];
            strains.map(|strain| strain * self.side)
        };
        [before + along, cross]
    }

    pub(super) fn extent(&self, params: &Params) -> Extent {
        Extent {
            side: self.side,
            height: self.height,
            travelled: self.travelled,
            since: self.steps as f64 * params.time_step,
            viscosity: self.viscosity.unwrap_or(Extent::FIRST_VISCOSITY),
        }
    }
}

impl<S: Starts> Snapshot<S> {
    /// The start of a run: the layer or suspension of a seed, or a given layer.
    ///
    /// ```
    /// use sd_core::{Bulk, Params, Snapshot};
    ///
    /// let params = Params::builder()
    ///     .spheres(100)
    ///     .volume_fraction(0.3)
    ///     .roughness(0.01)
    ///     .friction(0.5)
    ///     .shear_rate(10.0)
    ///     .build()?;
    /// let start = Snapshot::<Bulk>::start(&params, 7)?;
    /// assert_eq!(start.centres.len(), 100);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Parameters out of range, a cell too small, a fraction that cannot be packed.
    pub fn start(params: &Params, seed: u64) -> Result<Self, Error> {
        params.validate()?;
        S::check(params)?;
        let start = S::start(params, seed)?;
        start::check_cutoff(params, &start.radii)?;
        let mut memory = SchemeMemory::new(&params.contact);
        let first = params.in_step(&params.imposed(0));
        let shear_control = ShearControl::new(&first, None);
        memory.stretch(&start, shear_control.laws(&first).tangential_stiffness);
        Ok(Self {
            version: SNAPSHOT_VERSION,
            steps: 0,
            radii: start.radii,
            side: start.side,
            height: 1.0,
            travelled: [0.0; 2],
            viscosity: None,
            centres: start.centres.iter().map(S::point).collect(),
            orientations: start.orientations,
            images: Vec::new(),
            shifts: Vec::new(),
            memory,
            near_pairs: Vec::new(),
            far_field: Vec::new(),
            critical_load: None,
            noise_seed: is_thermal(params).then_some(seed),
            counters: Counters::default(),
        })
    }

    /// Refuses an inconsistent snapshot of a run with these parameters.
    pub(super) fn check(&self, params: &Params) -> Result<(), Error> {
        let refuse = |reason| Err(Error::Snapshot { reason });
        let n = params.spheres;
        if self.version != SNAPSHOT_VERSION {
            return refuse("made by another version of the program");
        }
        if self.radii.len() != n || self.centres.len() != n || self.orientations.len() != n {
            return refuse("other number of spheres");
        }
        if !(self.images.is_empty() || self.images.len() == n) {
            return refuse("images of another number of spheres");
        }
        if !(self.shifts.is_empty() || self.shifts.len() == n) {
            return refuse("shifts of another number of spheres");
        }
        if self.noise_seed.is_some() != is_thermal(params) {
            return refuse("Brownian motion in one of snapshot and parameters alone");
        }
        if let Some(reason) = self.memory.fault(&params.contact, n) {
            return refuse(reason);
        }
        let pairs = &self.near_pairs;
        if !pairs.iter().all(|&(i, j)| i < j && (j as usize) < n)
            || !pairs.is_sorted_by(|a, b| a < b)
        {
            return refuse("near pairs of missing spheres, or not in order");
        }
        let iterated = Method::of(params) == Method::Iterated;
        let modes = S::MODES + S::STRAINS;
        let expected = if iterated { 2 * modes * n + 4 } else { 0 };
        if !(self.far_field.is_empty() || self.far_field.len() == expected) {
            return refuse("a far field of another number of spheres");
        }
        let finite = self
            .centres
            .iter()
            .all(|x| x.as_ref().iter().all(|x| x.is_finite()))
            && self
                .shifts
                .iter()
                .all(|x| x.as_ref().iter().all(|x| x.is_finite()))
            && self.far_field.iter().all(|x| x.is_finite())
            && self.orientations.iter().all(S::is_orientation)
            && self.travelled.iter().all(|x| x.is_finite());
        if !finite {
            return refuse("not all numbers are finite");
        }
        if self
            .critical_load
            .is_some_and(|load| !(load > 0.0 && load.is_finite()))
        {
            return refuse("an invalid critical load");
        }
        start::check_cutoff(params, &self.radii)?;
        let (radii, side) = start::radii_and_side(params)?;
        let mut own = self.radii.clone();
        if params.sizes.is_some() {
            // The start may have numbered spheres of all sizes by rows.
            own.sort_by(|a, b| b.total_cmp(a));
        }
        let is_free = params.imposes_pressure()
            && [self.side, self.height]
                .iter()
                .all(|x| *x > 0.0 && x.is_finite())
            && self.viscosity.is_none_or(|x| x > 0.0 && x.is_finite());
        let is_given = self.side.to_bits() == side.to_bits() && self.height == 1.0;
        if own != radii || !(is_free || is_given) {
            return refuse("radii or cell inconsistent with the parameters");
        }
        Ok(())
    }
}
