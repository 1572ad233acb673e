//! Where near-field terms come from: tables of any size ratios, shared between runs, and the terms of the pairs of sizes in one layer.

use crate::error::Error;
use crate::hydrodynamics::two_sphere::{LeadingOrderPair, NearField, PairTerm, check_size_ratio};
use crate::linalg::simd::vectorised;
use crate::model::Hydrodynamics;
use std::sync::Arc;

/// Near-field tables by size ratio, shared between runs.
#[derive(Debug, Clone, Default)]
pub struct NearFields {
    /// Tables of unequal spheres; equal ones are in the program.
    tables: Vec<Arc<NearField>>,
}

impl NearFields {
    /// The size ratios, larger over smaller radius, that a set of radii needs besides 1, in increasing order.
    pub fn ratios(radii: &[f64]) -> Vec<f64> {
        let mut distinct: Vec<f64> = radii.to_vec();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let mut ratios: Vec<f64> = distinct
            .iter()
            .enumerate()
            .flat_map(|(k, a)| distinct[k + 1..].iter().map(move |b| b / a))
            .collect();
        ratios.sort_by(f64::total_cmp);
        ratios.dedup_by(|a, b| same_ratio(*a, *b));
        ratios
    }

    /// Adds a table made elsewhere, such as one kept on disk.
    pub fn insert(&mut self, table: NearField) {
        self.tables.push(Arc::new(table));
    }

    /// Whether the table of a size ratio (≥ 1) is here.
    pub fn contains(&self, size_ratio: f64) -> bool {
        self.find(size_ratio).is_some()
    }

    /// The table of a size ratio (≥ 1).
    fn find(&self, size_ratio: f64) -> Option<&Arc<NearField>> {
        self.tables
            .iter()
            .find(|t| same_ratio(t.size_ratio(), size_ratio))
    }
}

/// Whether two size ratios are one up to rounding.
fn same_ratio(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a
}

/// Something for each pair of sizes that a set of spheres has.
pub(crate) struct BySizes<T> {
    /// Of each pair of sizes, row by row.
    pairs: Vec<T>,
    /// Number of the size of each sphere, from the smallest.
    sizes: Vec<usize>,
    size_count: usize,
}

impl<T> BySizes<T> {
    /// Makes it for every pair of sizes in order.
    pub(crate) fn new(
        radii: &[f64],
        mut make: impl FnMut([f64; 2]) -> Result<T, Error>,
    ) -> Result<Self, Error> {
        let mut distinct: Vec<f64> = radii.to_vec();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let sizes = radii
            .iter()
            .map(|a| distinct.partition_point(|b| b < a))
            .collect();
        let mut pairs = Vec::with_capacity(distinct.len() * distinct.len());
        for &a in &distinct {
            for &b in &distinct {
                pairs.push(make([a, b])?);
            }
        }
        Ok(Self {
            pairs,
            sizes,
            size_count: distinct.len(),
        })
    }

    /// That of spheres i and j.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize, j: usize) -> &T {
        &self.pairs[self.size_count * self.sizes[i] + self.sizes[j]]
    }
}

/// Where the near-field terms of pairs come from.
pub(crate) enum NearTerms {
    /// Exact pairs without their far field, from tables.
    Exact(BySizes<Arc<NearField>>),
    /// Leading-order lubrication.
    LeadingOrder(BySizes<LeadingOrderPair>),
}

impl NearTerms {
    /// The terms of spheres of the given radii; tables that `tables` lacks are made here, which costs seconds per size ratio.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(crate) fn new(
        hydrodynamics: Hydrodynamics,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        if let Some(&numbers) = hydrodynamics.leading_order() {
            let pairs = BySizes::new(radii, |radii| {
                check_size_ratio(radii[1] / radii[0])?;
                Ok(LeadingOrderPair::new(radii, numbers))
            })?;
            return Ok(Self::LeadingOrder(pairs));
        }
        let mut known = tables.clone();
        let equal = Arc::new(NearField::equal_spheres());
        let pairs = BySizes::new(radii, |[a, b]| {
            let ratio = a.max(b) / a.min(b);
            if a == b {
                return Ok(Arc::clone(&equal));
            }
            if let Some(table) = known.find(ratio) {
                return Ok(Arc::clone(table));
            }
            let table = Arc::new(NearField::new(ratio)?);
            known.tables.push(Arc::clone(&table));
            Ok(table)
        })?;
        Ok(Self::Exact(pairs))
    }

    /// Puts the terms of all pairs, given by their spheres and gaps, into `terms`; below the gap `least` they are those at that gap.
    ///
    /// `finish`: what becomes of the term of spheres at a gap.
    pub(crate) fn evaluate<T>(
        &self,
        radii: &[f64],
        pairs: impl Iterator<Item = ([usize; 2], f64)>,
        least: f64,
        finish: impl Fn(PairTerm, [usize; 2], f64) -> T,
        terms: &mut Vec<T>,
    ) {
        terms.clear();
        vectorised(
            #[inline(always)]
            || match self {
                Self::Exact(tables) => {
                    for ([i, j], gap) in pairs {
                        let gap = gap.max(least);
                        let term = tables.of(i, j).evaluate(radii[i], radii[j], gap);
                        terms.push(finish(term, [i, j], gap));
                    }
                }
                Self::LeadingOrder(leading) => {
                    for ([i, j], gap) in pairs {
                        let gap = gap.max(least);
                        terms.push(finish(leading.of(i, j).evaluate(gap), [i, j], gap));
                    }
                }
            },
        );
    }

    /// Inverse slip mobility K of spheres i and j, alone in unbounded fluid, in mu·a.
    pub(super) fn slip_resistance(&self, [i, j]: [usize; 2], radii: &[f64], gap: f64) -> f64 {
        match self {
            Self::Exact(tables) => tables.of(i, j).slip_resistance(radii[i], radii[j], gap),
            Self::LeadingOrder(leading) => leading.of(i, j).slip_resistance(gap),
        }
    }
}
