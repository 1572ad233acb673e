//! Near-field tables: of any size ratios, shared between runs, and of the pairs of sizes in one layer.

use crate::error::Error;
use crate::hydrodynamics::two_sphere::NearField;
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

/// The near-field table of each pair of sizes that a set of spheres has.
pub(super) struct PairTables {
    /// Table of each pair of sizes, row by row.
    tables: Vec<Arc<NearField>>,
    /// Number of the size of each sphere, from the smallest.
    sizes: Vec<usize>,
    size_count: usize,
}

impl PairTables {
    /// Picks the tables for spheres of the given radii; those that `tables` lacks are made here, which costs seconds per size ratio.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(super) fn new(radii: &[f64], tables: &NearFields) -> Result<Self, Error> {
        let mut distinct: Vec<f64> = radii.to_vec();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let sizes = radii
            .iter()
            .map(|a| distinct.partition_point(|b| b < a))
            .collect();
        let mut known = tables.clone();
        let equal = Arc::new(NearField::equal_spheres());
        let mut of_pairs = Vec::with_capacity(distinct.len() * distinct.len());
        for &a in &distinct {
            for &b in &distinct {
                let ratio = a.max(b) / a.min(b);
                if a == b {
                    of_pairs.push(Arc::clone(&equal));
                    continue;
                }
                if !known.contains(ratio) {
                    known.insert(NearField::new(ratio)?);
                }
                of_pairs.extend(known.find(ratio).cloned());
            }
        }
        Ok(Self {
            tables: of_pairs,
            sizes,
            size_count: distinct.len(),
        })
    }

    /// The table of spheres i and j.
    #[inline(always)]
    pub(super) fn of(&self, i: usize, j: usize) -> &NearField {
        &self.tables[self.size_count * self.sizes[i] + self.sizes[j]]
    }
}
