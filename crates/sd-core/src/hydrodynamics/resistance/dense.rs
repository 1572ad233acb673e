//! `R_FU` as a full matrix with its factor; under Stokesian Dynamics, with the far field of all
//! spheres in it.

use super::PressureWork;
use super::fluid::{FarMatrix, Fluid, modes_in_strain};
use super::isolated::isolated;
use super::pair_terms;
use crate::error::Error;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::error::BadPivot;
use crate::space::Strains;
use crate::space::cell::Cell;
use crate::space::pair::Neighbours;

/// The far field and the full `R_FU`, rows in the order of the spheres.
pub(super) struct DenseResistance<S: Fluid> {
    /// The far field of Stokesian Dynamics; without it, the drag of isolated spheres.
    far: Option<S::Far>,
    radii: Vec<f64>,
    /// `R_FU`, then its factor.
    factor: DenseCholesky,
    /// Scratch of the far field, all modes of all spheres, strains first.
    vector: Vec<f64>,
}

impl<S: Fluid> DenseResistance<S> {
    /// Workspace around a planned far field, or without one.
    pub(super) fn new(far: Option<S::Far>, radii: &[f64]) -> Self {
        Self {
            far,
            radii: radii.to_vec(),
            factor: DenseCholesky::new(S::MODES * radii.len()),
            vector: Vec::new(),
        }
    }

    /// `R_FU` of the far field and the pair terms.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] for the far-field mobility.
    pub(super) fn assemble(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        pairs: &[Neighbours<S>],
        terms: &[S::Term],
    ) -> Result<(), Error> {
        let matrix = self.factor.matrix_mut();
        if let Some(far) = &mut self.far {
            far.fill(cell, centres, matrix)?;
        } else {
            let n = S::MODES * self.radii.len();
            matrix.reset(n, n);
            for (i, &a) in self.radii.iter().enumerate() {
                let (drag, first) = (isolated::<S>(a), S::MODES * i);
                for m in 0..S::MODES {
                    matrix[(first + m, first + m)] = drag[m];
                }
            }
        }
        pair_terms::add_to_matrix(pairs, terms, matrix);
        Ok(())
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity.
    pub(super) fn add_spring(&mut self, pair: &Neighbours<S>, slope: f64) {
        pair_terms::add_spring(pair, slope, self.factor.matrix_mut());
    }

    /// The far field, if there is one, with a scratch vector.
    pub(super) fn far(&mut self) -> Option<(&S::Far, &mut Vec<f64>)> {
        Some((self.far.as_ref()?, &mut self.vector))
    }

    pub(super) fn factor(&mut self) -> Result<(), BadPivot> {
        self.factor.factor()
    }

    pub(super) fn solver(&self) -> &DenseCholesky {
        &self.factor
    }

    /// Forces with which the incident strains drive the spheres through the far field.
    pub(super) fn background_forces(&mut self, strains: Strains<'_, S>, forces: &mut [f64]) {
        let Some(far) = &mut self.far else {
            forces.fill(0.0);
            return;
        };
        let first = S::STRAINS * (forces.len() / S::MODES);
        self.vector.clear();
        self.vector.resize(first + forces.len(), 0.0);
        let spheres = self.vector[..first].chunks_exact_mut(S::STRAINS);
        for (sphere, e) in spheres.enumerate() {
            for (k, e) in e.iter_mut().enumerate() {
                *e = strains.at(sphere)[k];
            }
        }
        far.apply_for_forces(&mut self.vector);
        forces.copy_from_slice(&self.vector[first..]);
    }

    /// Sets the forces, torques and stresslets that the spheres exert on the fluid in the far
    /// field, if there is one; returns whether.
    pub(super) fn far_modes(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut PressureWork<S>,
    ) -> bool {
        if self.far.is_none() {
            return false;
        }
        let (forces, stresslets) = (&mut work.forces, &mut work.stresslets);
        forces.clear();
        stresslets.clear();
        self.apply(velocities, strains, &mut work.far, forces, stresslets);
        let spheres = S::by_sphere(forces).iter().zip(stresslets);
        work.modes.clear();
        // As modes `(v, −e)`, here of the force and the stresslet.
        for (f, s) in spheres {
            let modes = modes_in_strain::<S>(f, s);
            work.modes.extend_from_slice(modes.as_ref());
        }
        true
    }

    /// Appends the far field's counterforces and stresslets to empty vectors; `work` is scratch.
    pub(super) fn apply(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<S::Strain>,
    ) {
        let Some(far) = &self.far else {
            add_isolated::<S>(&self.radii, velocities, strains, forces, stresslets);
            return;
        };
        let first = S::STRAINS * (velocities.len() / S::MODES);
        work.clear();
        work.resize(first + velocities.len(), 0.0);
        let spheres = work[..first].chunks_exact_mut(S::STRAINS);
        for (sphere, e) in spheres.enumerate() {
            for (k, e) in e.iter_mut().enumerate() {
                *e = -strains.at(sphere)[k];
            }
        }
        work[first..].copy_from_slice(velocities);
        far.apply(work);
        forces.extend_from_slice(&work[first..]);
        stresslets.extend(work[..first].chunks_exact(S::STRAINS).map(|s| {
            let mut stresslet = S::Strain::default();
            for (k, s) in s.iter().enumerate() {
                stresslet[k] = -s;
            }
            stresslet
        }));
    }
}

/// Appends the counterforces and stresslets of isolated spheres.
pub(super) fn add_isolated<S: Fluid>(
    radii: &[f64],
    velocities: &[f64],
    strains: Strains<'_, S>,
    forces: &mut Vec<f64>,
    stresslets: &mut Vec<S::Strain>,
) {
    let spheres = S::by_sphere(velocities).iter().zip(radii);
    for (sphere, (v, &a)) in spheres.enumerate() {
        let drag = isolated::<S>(a);
        forces.extend((0..S::MODES).map(|m| drag[m] * v[m]));
        stresslets.push(*strains.at(sphere) * drag[S::MODES]);
    }
}
