//! Grand resistance of all spheres, and the factored solve for their velocities.
//!
//! ```text
//! (F, T, S~) = R (v, −E),   v = (U − u∞, Ω − Ω∞)
//! Stokesian Dynamics:  R = R_far + Σ_pairs [R2B − R2B_inf]
//! Ball-Melrose:        R = diag(6π a, 8π a³, (20/3)π a³) + Σ_pairs [R2B − R2B_inf]
//! Lubrication:         R = diag(6π a, 8π a³, (20/3)π a³) + Σ_pairs of the leading singular terms of R2B, see `two_sphere::leading_order`
//! ```
//!
//! Every pair term is positive semidefinite, so R is positive definite in all. Pairs count up to
//! `s' = 2r/(a_i + a_j) < 4` in a cell and in clusters; two spheres alone in unbounded fluid count
//! at any distance and are then exact under Stokesian Dynamics. Under lubrication they have terms
//! up to its cutoff only. Velocities and forces are ordered `(x, y, rotation)` sphere by sphere,
//! `[3N]`.
//!
//! The same holds in a suspension, whose spheres have eleven modes; X^C is added to the pair terms.
//! Vectors are then `[6N]`, `(U, Ω)` sphere by sphere, where this module writes `[3N]` for a layer.
//! The differences are in [`fluid`]'s implementations for the two spaces.
//!
//! `R_FU` is held in one of two forms: full, with the far field in it under Stokesian Dynamics, or
//! pair by pair without a factor.

mod bulk;
mod dense;
mod far_pairs;
mod fluid;
mod isolated;
mod layer;
mod near_matrix;
mod pair_terms;
mod pairwise;
mod random_forces;
mod reach;
mod tables;

use crate::error::Error;
use crate::hydrodynamics::far_field::pressure::Source;
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::law::hydrodynamic_friction::HydrodynamicFriction;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::model::Hydrodynamics;
use crate::space::cell::{Cell, LUBRICATION_RANGE};
use crate::space::neighbours::NeighbourList;
use crate::space::pair::{Neighbours, PairKey};
use crate::space::{Layer, Strains};
use crate::threads;
use dense::DenseResistance;
use far_pairs::FarPairs;
pub(crate) use fluid::Fluid;
pub(crate) use fluid::{FarMatrix, ModeBlock, NearTerm, modes_in_strain};
pub(crate) use isolated::isolated;
pub(crate) use near_matrix::{NearMatrix, NearPattern};
pub(crate) use pairwise::{Motion, PairwiseResistance, side_by_side_mut};

pub(crate) use random_forces::RandomStress;
pub use tables::NearFields;
pub(crate) use tables::NearTerms;
use tables::{LEAST_PAIRS, PressureTerms, Twists};

/// Storage of `R_FU`.
enum Form<S: Fluid> {
    /// Full and factored.
    Dense(Box<DenseResistance<S>>),
    /// Ball-Melrose or lubrication, pair by pair.
    Pairwise(Box<PairwiseResistance<S>>),
}

/// Workspace of the pressure of the far field.
#[derive(Debug)]
pub(crate) struct PressureWork<S: Fluid> {
    /// Forces, torques and stresslets that the spheres exert on the fluid, all modes sphere by
    /// sphere.
    pub(crate) modes: Vec<f64>,
    pub(crate) sources: Vec<Source<S>>,
    /// Motion `(v, −e)` of each sphere.
    pub(crate) motion: Vec<f64>,
    far: Vec<f64>,
    forces: Vec<f64>,
    stresslets: Vec<S::Strain>,
    /// Of each pair, see [`Resistance::pressure_moments`].
    moments: Vec<[f64; 9]>,
}

impl<S: Fluid> Default for PressureWork<S> {
    fn default() -> Self {
        Self {
            modes: Vec::new(),
            sources: Vec::new(),
            motion: Vec::new(),
            far: Vec::new(),
            forces: Vec::new(),
            stresslets: Vec::new(),
            moments: Vec::new(),
        }
    }
}

/// Grand resistance at one set of positions, with its workspace.
pub struct Resistance<S: Fluid = Layer> {
    radii: Vec<f64>,
    near: NearTerms,
    /// X^C of exact pairs, where spheres twist.
    twists: Option<Twists>,
    /// Pressure moments of pairs.
    pressures: PressureTerms,
    /// Range of the pair sum in s'.
    range: f64,
    /// Gap below which near-field terms are those of this gap, in a.
    lubrication_gap: f64,
    /// Friction of hydrodynamic roughness, in addition to the near-field terms.
    friction: HydrodynamicFriction,
    /// Length added to gaps from 0 under lubrication, over the mean radius of the pair.
    gap_shift: f64,
    neighbours: NeighbourList<S>,
    /// Their terms.
    terms: Vec<S::Term>,
    /// The far field of near pairs, included in their terms if the rest of the far field is
    /// iterated.
    far_pairs: Option<FarPairs<S>>,
    form: Form<S>,
    /// Whether `R_FU` is factored at the current positions.
    factored: bool,
}

impl<S: Fluid> Resistance<S> {
    /// Workspace for spheres of the given radii, in cells of the given area or volume,
    /// with `R_FU` factored.
    ///
    /// Tables missing in `tables` are computed here, which takes seconds per size ratio.
    ///
    /// # Errors
    /// No sphere, a cell thinner than twice the lubrication range, a size ratio outside 0.01
    /// to 100.
    pub fn new(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        match hydrodynamics {
            Hydrodynamics::StokesianDynamics => {
                Self::new_dense(cell, radii, tables, S::Far::TOLERANCE)
            }
            Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) => {
                Self::with_form(hydrodynamics, cell, radii, tables, || {
                    Ok(Form::Dense(Box::new(DenseResistance::new(None, radii))))
                })
            }
        }
    }

    /// As [`Resistance::new`] for Stokesian Dynamics, with a given tolerance of the periodic sums.
    ///
    /// # Errors
    /// Those of [`Resistance::new`]; a tolerance out of range.
    pub(crate) fn new_dense(
        cell: &Cell<S>,
        radii: &[f64],
        tables: &NearFields,
        tolerance: f64,
    ) -> Result<Self, Error> {
        let hydrodynamics = Hydrodynamics::StokesianDynamics;
        Self::with_form(hydrodynamics, cell, radii, tables, || {
            let far = S::Far::new(cell, radii, tolerance)?;
            Ok(Form::Dense(Box::new(DenseResistance::new(
                Some(far),
                radii,
            ))))
        })
    }

    /// As [`Resistance::new`] with `R_FU` held as a [`PairwiseResistance`] in place of a factor:
    /// O(N), for many spheres.
    ///
    /// Under Stokesian Dynamics it is the sum of Ball-Melrose and of the far field of near pairs;
    /// the rest of the far field is iterated.
    ///
    /// `pattern_pairs`: ordered pairs of the near part's pattern of a resumed run; else empty.
    ///
    /// # Errors
    /// Those of [`Resistance::new`]; [`Error::OutOfMemory`].
    pub fn new_pairwise(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        tables: &NearFields,
        pattern_pairs: &[PairKey],
    ) -> Result<Self, Error> {
        let [short, long] = S::REACHES;
        let (far_pairs, reach) = match hydrodynamics {
            Hydrodynamics::StokesianDynamics => (Some(FarPairs::new(radii)?), long),
            Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) => (None, short),
        };
        let pairwise = Self::with_form(hydrodynamics, cell, radii, tables, || {
            let pairwise = PairwiseResistance::new(radii.len(), reach, pattern_pairs)?;
            Ok(Form::Pairwise(Box::new(pairwise)))
        })?;
        Ok(Self {
            far_pairs,
            ..pairwise
        })
    }

    /// Range of the pair sum in a periodic cell, in s': that of the exact pair functions, or in a
    /// suspension the cutoff of the leading terms of lubrication.
    pub(crate) fn range(hydrodynamics: Hydrodynamics) -> f64 {
        match hydrodynamics.leading_order() {
            Some(numbers) if S::ENDS_AT_CUTOFF => 2.0 + numbers.cutoff,
            _ => LUBRICATION_RANGE,
        }
    }

    /// Sets the asperity height of contacts, in a, for the pattern of pairwise storage.
    pub(crate) fn expect_contacts(&mut self, height: f64) {
        if let Form::Pairwise(pairwise) = &mut self.form {
            pairwise.expect_contacts(height, &self.radii);
        }
    }

    /// Creates the common parts, and then the form.
    fn with_form(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        tables: &NearFields,
        form: impl FnOnce() -> Result<Form<S>, Error>,
    ) -> Result<Self, Error> {
        if radii.is_empty() {
            return Err(Error::NoSpheres);
        }
        let range = if *cell == Cell::Unbounded && radii.len() == 2 {
            f64::INFINITY
        } else {
            Self::range(hydrodynamics)
        };
        cell.check_range(radii, range)?;
        Ok(Self {
            radii: radii.to_vec(),
            near: NearTerms::new(hydrodynamics, radii, tables)?,
            twists: if S::TWISTS && hydrodynamics.leading_order().is_none() {
                Some(Twists::new(radii, tables)?)
            } else {
                None
            },
            pressures: PressureTerms::new(hydrodynamics, radii, tables)?,
            range,
            lubrication_gap: 0.0,
            friction: HydrodynamicFriction::default(),
            gap_shift: hydrodynamics
                .leading_order()
                .map_or(0.0, |numbers| numbers.regularisation),
            neighbours: NeighbourList::new(radii.len()),
            terms: Vec::with_capacity(S::RESERVED_NEIGHBOURS * radii.len() / 2),
            far_pairs: None,
            form: form()?,
            factored: false,
        })
    }

    /// Has pairwise storage make a new pattern at the next [`Resistance::assemble`], as a new
    /// resistance does.
    pub(crate) fn forget_pattern(&mut self) {
        if let Form::Pairwise(pairwise) = &mut self.form {
            pairwise.forget_pattern();
        }
    }

    /// For soft spheres: near-field terms below a gap are those at that gap, and surfaces may
    /// overlap by less than `deepest`, in a.
    pub fn regularise(&mut self, lubrication_gap: f64, deepest: f64) {
        self.lubrication_gap = lubrication_gap;
        self.neighbours.allow_overlap(deepest);
    }

    /// Has pairs resist sliding by the friction of hydrodynamic roughness, from the next
    /// [`Resistance::assemble`] on.
    pub fn roughen(&mut self, friction: HydrodynamicFriction) {
        self.friction = friction;
    }

    /// Assembles and factors at new positions. The cell's area or volume must be that of
    /// [`Resistance::new`].
    ///
    /// # Errors
    /// [`Error::Overlap`], [`Error::NotPositiveDefinite`].
    pub fn update(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.assemble(cell, centres)?;
        self.factor()
    }

    /// The first half of [`Resistance::update`]: far field, pair terms, `R_FU`.
    /// [`Resistance::factor`] must follow.
    ///
    /// # Errors
    /// [`Error::Overlap`]; [`Error::NotPositiveDefinite`] for the far-field mobility.
    pub fn assemble(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.factored = false;
        self.neighbours
            .update(cell, centres, &self.radii, self.range)?;
        let mut terms = std::mem::take(&mut self.terms);
        let (radii, pairs) = (&self.radii, self.neighbours.pairs());
        let (least, rubs) = (self.lubrication_gap, self.friction.coefficient > 0.0);
        let gap_of = |pair: &Neighbours<S>| ([pair.i, pair.j], pair.gap);
        let (twists, friction, shift) = (self.twists.as_ref(), self.friction, self.gap_shift);
        let finish = |mut term: PairTerm, [i, j]: [usize; 2], gap| {
            if rubs {
                let radii = [radii[i], radii[j]];
                let levers = radii.map(|radius| radius + 0.5 * gap);
                term.resist_slip(slip_friction(friction, shift, radii, gap), levers);
            }
            let twist = twists.map_or([0.0; 3], |twists| twists.evaluate([i, j], radii, gap));
            S::term(&term, twist)
        };
        let pairs_and_gaps = (pairs, gap_of);
        self.near
            .evaluate(radii, pairs_and_gaps, least, finish, &mut terms);
        self.terms = terms;
        let terms = &mut self.terms;
        if let Some(far_pairs) = &mut self.far_pairs {
            far_pairs.add(radii, pairs, terms);
        }
        match &mut self.form {
            Form::Dense(dense) => dense.assemble(cell, centres, pairs, terms),
            Form::Pairwise(pairwise) => {
                // Across the gradient, along which images do not move.
                pairwise.assemble((pairs, terms), radii, |sphere| match cell {
                    Cell::Periodic(lattice) => {
                        lattice.coordinates(&centres[sphere])[1].rem_euclid(1.0)
                    }
                    Cell::Unbounded => centres[sphere][1],
                })
            }
        }
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity to the assembled `R_FU`: a resistance along
    /// the line of centres, independent of the fluid. [`Resistance::apply`] and
    /// [`Resistance::background_forces`] ignore it.
    pub fn add_spring(&mut self, pair: &Neighbours<S>, slope: f64) {
        match &mut self.form {
            Form::Dense(dense) => dense.add_spring(pair, slope),
            Form::Pairwise(pairwise) => pairwise.add_spring(pair, slope),
        }
    }

    /// The second half of [`Resistance::update`]: factors `R_FU` in place, unless it is factored at
    /// these positions. Pairwise storage has no factor and is unchanged.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn factor(&mut self) -> Result<(), Error> {
        if std::mem::replace(&mut self.factored, true) {
            return Ok(());
        }
        let factored = match &mut self.form {
            Form::Dense(dense) => dense.factor(),
            Form::Pairwise(_) => Ok(()),
        };
        factored.map_err(|bad| Error::NotPositiveDefinite {
            matrix: "force-velocity resistance",
            pivot: bad.pivot,
            sphere: bad.pivot / S::MODES,
        })
    }

    /// `R_FU` pair by pair, where there is no factor.
    pub fn pairwise(&self) -> Option<&PairwiseResistance<S>> {
        match &self.form {
            Form::Pairwise(pairwise) => Some(pairwise),
            Form::Dense(_) => None,
        }
    }

    /// The resistance stored pair by pair, to save and restore its pattern.
    pub(crate) fn pairwise_mut(&mut self) -> Option<&mut PairwiseResistance<S>> {
        match &mut self.form {
            Form::Pairwise(pairwise) => Some(pairwise),
            Form::Dense(_) => None,
        }
    }

    /// Terms of the far field of near pairs, if included.
    pub(crate) fn far_pairs(&self) -> impl Iterator<Item = (&Neighbours<S>, &S::Term)> {
        let pairs = self.neighbours.pairs();
        let terms = self.far_pairs.as_ref().map_or(&[][..], FarPairs::terms);
        terms.iter().map(|(number, term)| (&pairs[*number], term))
    }

    /// Radii, in a.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Pairs in range, ordered by (i, j).
    pub fn neighbours(&self) -> &[Neighbours<S>] {
        self.neighbours.pairs()
    }

    /// Checks that spheres that were in range do not overlap at nearby positions.
    ///
    /// # Errors
    /// [`Error::Overlap`].
    pub(crate) fn check_overlaps(
        &self,
        cell: &Cell<S>,
        centres: &[S::Vector],
    ) -> Result<(), Error> {
        self.neighbours.check(cell, centres, &self.radii)
    }

    /// The closest pair of the spheres that were in range, at nearby positions.
    pub(crate) fn closest_at(
        &self,
        cell: &Cell<S>,
        centres: &[S::Vector],
    ) -> Option<Neighbours<S>> {
        self.neighbours.closest_at(cell, centres, &self.radii)
    }

    /// Factor of R_FU, `[3N × 3N]`, its rows in the order of the spheres.
    ///
    /// # Panics
    /// If `R_FU` is stored pair by pair, without a factor: check [`Resistance::pairwise`] first.
    pub fn solver(&self) -> &DenseCholesky {
        match &self.form {
            Form::Dense(dense) => dense.solver(),
            Form::Pairwise(_) => unreachable!("pairwise storage has no factor"),
        }
    }

    /// Inverse slip mobility K of the pair, alone in unbounded fluid, in mu·a.
    pub fn slip_resistance(&self, pair: &Neighbours<S>) -> f64 {
        let gap = pair.gap.max(self.lubrication_gap);
        let pair = [pair.i, pair.j];
        let radii = pair.map(|sphere| self.radii[sphere]);
        let friction = slip_friction(self.friction, self.gap_shift, radii, gap);
        self.near.slip_resistance(pair, &self.radii, gap) + friction
    }

    /// Forces `R_FE e` with which the incident strains drive the spheres, `[3N]`.
    pub fn background_forces(&mut self, strains: Strains<'_, S>, forces: &mut [f64]) {
        match &mut self.form {
            Form::Dense(dense) => dense.background_forces(strains, forces),
            Form::Pairwise(_) => forces.fill(0.0),
        }
        pair_terms::add_background_forces(self.neighbours.pairs(), &self.terms, strains, forces);
    }

    /// Sets the forces, torques and stresslets that the spheres exert on the fluid in the far
    /// field, if it is in full matrices; returns whether.
    pub(crate) fn far_modes(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut PressureWork<S>,
    ) -> bool {
        match &self.form {
            Form::Dense(dense) => dense.far_modes(velocities, strains, work),
            Form::Pairwise(_) => false,
        }
    }

    /// Sum over all spheres of the pressure moments of near pairs for disturbances `velocities`, in
    /// mu·a³·rate: minus the trace of the first moment of the traction. Second, that of the forces
    /// of these pairs, as if they acted at the centres.
    pub(crate) fn pressure_moments(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut PressureWork<S>,
    ) -> [f64; 2] {
        let velocities = S::by_sphere(velocities);
        let virial = |pair: &Neighbours<S>, term: &S::Term| {
            let modes = [pair.i, pair.j]
                .map(|sphere| modes_in_strain::<S>(&velocities[sphere], strains.at(sphere)));
            let [of_i, of_j] = term.apply(&pair.normal, &modes);
            let push = (0..S::DIMENSIONS).map(|k| pair.normal[k] * (of_i[k] - of_j[k]));
            0.5 * pair.distance * push.sum::<f64>()
        };
        let (pairs, terms) = (self.neighbours.pairs(), &self.terms);
        let (pressures, radii, least) = (&self.pressures, &self.radii, self.lubrication_gap);
        let moments = &mut work.moments;
        moments.resize(pairs.len(), [0.0; 9]);
        threads::divide(moments, LEAST_PAIRS, &|first, moments| {
            let pairs = pairs[first..].iter().zip(&terms[first..]);
            for (moments, (pair, term)) in moments.iter_mut().zip(pairs) {
                let (n, gap) = (&pair.normal, pair.gap.max(least));
                let motion = [pair.i, pair.j].map(|sphere| {
                    let along = S::dot(&S::translation(&velocities[sphere]), n);
                    let strain = S::full_tensor(strains.at(sphere));
                    [along, -S::tensor_along(&strain, n)]
                });
                let (own, of_forces) = moments.split_at_mut(8);
                own.copy_from_slice(&pressures.evaluate([pair.i, pair.j], radii, gap));
                for row in own.chunks_exact_mut(4) {
                    for (entry, mode) in row.iter_mut().zip(motion.as_flattened()) {
                        *entry *= mode;
                    }
                }
                of_forces[0] = virial(pair, term);
            }
        });
        let mut sums = [0.0; 2];
        for [own @ .., of_forces] in moments {
            for moment in own {
                sums[0] += *moment;
            }
            sums[1] += *of_forces;
        }
        for (pair, term) in self.far_pairs() {
            sums[1] -= virial(pair, term);
        }
        sums
    }

    /// `R (v, −e)`: counterforces `R_FU v − R_FE e` `[3N]` and stresslets `S = R_SE e − R_SU v` of
    /// (20), for disturbances v `[3N]`.
    ///
    /// `work` is scratch.
    pub fn apply(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<S::Strain>,
    ) {
        forces.clear();
        stresslets.clear();
        match &self.form {
            Form::Dense(dense) => dense.apply(velocities, strains, work, forces, stresslets),
            Form::Pairwise(_) => {
                dense::add_isolated::<S>(&self.radii, velocities, strains, forces, stresslets);
            }
        }
        let (pairs, terms) = (self.neighbours.pairs(), &self.terms);
        pair_terms::add_counterforces(pairs, terms, velocities, strains, forces, stresslets);
    }
}

/// K_h of spheres of these radii, in mu·a, at a gap that is at least the lubrication gap. Under
/// lubrication, which adds `shift` over the mean radius to gaps, it is finite at contact, as its
/// functions are.
fn slip_friction(friction: HydrodynamicFriction, shift: f64, radii: [f64; 2], gap: f64) -> f64 {
    if shift == 0.0 {
        return friction.resistance(gap);
    }
    let shift = 0.5 * shift * (radii[0] + radii[1]);
    friction.resistance(gap.max(0.0) + shift)
}

#[cfg(test)]
pub(crate) mod tests;
