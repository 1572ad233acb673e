//! The far field of near pairs, each pair alone: a sparse approximation of the far field, whose
//! remainder is iterated.
//!
//! ```text
//! P = D + Σ_near θ_ij (R2B∞ − D_ij),   θ_ij = min(1, LARGEST / max(w_i, w_j)),   w_i = Σ_j w_ij
//! ```
//! With θ = 1 a pair far from others is exact. For a sphere among many neighbours the sum over
//! pairs overestimates collective motion: as `R2B∞ − D ≥ −w_ij D`, these θ keep P at least
//! `(1 − LARGEST) D`. With isolated spheres only, `P = D`, the iteration takes about twice as many
//! steps.

use super::fluid::{Fluid, NearTerm};
use super::tables::{PerSizePair, largest_of_continuous_sizes};
use crate::error::Error;
use crate::hydrodynamics::two_sphere::{FarPair, PairTerm, check_size_ratio};
use crate::linalg::whole;
use crate::space::pair::Neighbours;

/// Pairs closer than this, in s', are near.
const NEAR: f64 = 2.4;
/// Largest fraction of the drag of a sphere by which its pairs may reduce it.
const LARGEST: f64 = 0.95;

/// The far field of twists is left out, as it is small: P need not be exact.
const NO_TWIST: [f64; 3] = [0.0; 3];

/// Logarithmic step of the size ratios of the tables for many sizes. Radii are then approximated
/// within a quarter of it, so that `R2B∞ − D ≥ −1.015 w D`, and P stays positive definite.
const STEP: f64 = 0.02;

/// `R2B∞ − D` of all pairs.
enum Tables {
    /// For a few sizes.
    Few(PerSizePair<FarPair>),
    /// For many sizes, approximately: by size ratio, in steps of [`STEP`] from 1.
    Many(Vec<FarPair>),
}

impl Tables {
    /// The term of a pair in range, and w.
    fn evaluate<S: Fluid>(&self, pair: &Neighbours<S>, radii: &[f64]) -> (PairTerm, f64) {
        let many = match self {
            Self::Few(tables) => return tables.of(pair.i, pair.j).evaluate(pair.distance),
            Self::Many(tables) => tables,
        };
        let (a, b) = (radii[pair.i], radii[pair.j]);
        let step = whole(((a / b).ln().abs() / STEP).round());
        many[step.min(many.len() - 1)].evaluate_near(a, b, pair.distance)
    }
}

/// `θ (R2B∞ − D)` of near pairs.
pub(super) struct FarPairs<S: Fluid> {
    tables: Tables,
    /// Number of each near pair among all pairs, and its term.
    terms: Vec<(usize, S::Term)>,
    /// w of each sphere.
    totals: Vec<f64>,
}

impl<S: Fluid> FarPairs<S> {
    /// Tables for spheres of the given radii.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(super) fn new(radii: &[f64]) -> Result<Self, Error> {
        let tables = if let Some(largest) = largest_of_continuous_sizes(radii) {
            let last = check_size_ratio(largest)?.ln() + STEP;
            let steps = (0..).map(|step| STEP * f64::from(step));
            let ratios = steps.take_while(|step| *step < last).map(f64::exp);
            Tables::Many(
                ratios
                    .map(|ratio| FarPair::new([1.0, ratio], NEAR))
                    .collect(),
            )
        } else {
            Tables::Few(PerSizePair::new(radii, |radii| {
                check_size_ratio(radii[1] / radii[0])?;
                Ok(FarPair::new(radii, NEAR))
            })?)
        };
        Ok(Self {
            tables,
            terms: Vec::new(),
            totals: vec![0.0; radii.len()],
        })
    }

    /// Computes the terms of near pairs, and adds them to `terms`.
    pub(super) fn add(&mut self, radii: &[f64], pairs: &[Neighbours<S>], terms: &mut [S::Term]) {
        self.terms.clear();
        self.totals.fill(0.0);
        for (number, pair) in pairs.iter().enumerate() {
            if pair.distance < 0.5 * NEAR * (radii[pair.i] + radii[pair.j]) {
                let (term, weight) = self.tables.evaluate(pair, radii);
                self.terms.push((number, S::term(&term, NO_TWIST)));
                self.totals[pair.i] += weight;
                self.totals[pair.j] += weight;
            }
        }
        for (number, term) in &mut self.terms {
            let pair = &pairs[*number];
            let most = self.totals[pair.i].max(self.totals[pair.j]);
            *term = term.scaled((LARGEST / most).min(1.0));
            terms[*number].add(term);
        }
    }

    /// The terms, with the numbers of their pairs.
    pub(super) fn terms(&self) -> &[(usize, S::Term)] {
        &self.terms
    }
}
