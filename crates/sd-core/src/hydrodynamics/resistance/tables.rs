//! Sources of near-field terms: tables of any size ratios, shared between runs, and the terms of
//! the pairs of sizes in one layer.

use crate::error::Error;
use crate::hydrodynamics::two_sphere::{
    LeadingOrderPair, NearField, NearFieldRange, PairTerm, PressureEntries, PressureRange,
    PressureTable, RANGES, TwistRange, TwistTable, check_size_ratio, leading_order_pressure,
    range_of,
};
use crate::linalg::simd::vectorised;
use crate::model::{Hydrodynamics, LeadingOrder};
use crate::threads;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Maximum number of sizes with one table per pair; with more sizes, one table covers all size
/// ratios up to the largest.
const FEW_SIZES: usize = 6;
/// Fewest pairs whose terms a thread computes.
pub(super) const LEAST_PAIRS: usize = 500;

/// Near-field tables by size ratio, shared between runs.
///
/// ```
/// use sd_core::NearFields;
/// use sd_core::two_sphere::NearField;
///
/// let mut tables = NearFields::default();
/// tables.insert(NearField::new(1.4)?);
/// assert!(tables.contains(1.4) && !tables.contains(2.0));
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct NearFields {
    /// Tables of unequal spheres; that of equal ones is built in.
    tables: Vec<Arc<NearField>>,
    /// Tables for many sizes, by range of size ratios.
    ranges: Arc<[OnceLock<Arc<NearFieldRange>>; RANGES.len()]>,
    /// Tables of twists for many sizes, by range of size ratios.
    twists: Arc<[OnceLock<Arc<TwistRange>>; RANGES.len()]>,
    /// Tables of pressure moments, made where they are needed.
    pressures: Arc<Mutex<Vec<Arc<PressureTable>>>>,
    /// Those for many sizes, by range of size ratios.
    pressure_ranges: Arc<[OnceLock<Arc<PressureRange>>; RANGES.len()]>,
}

/// The sizes among the radii, each once, in increasing order.
fn sizes(radii: &[f64]) -> Vec<f64> {
    let mut distinct: Vec<f64> = radii.to_vec();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup();
    distinct
}

/// The largest size ratio, where there are more than a few sizes.
pub(super) fn largest_of_continuous_sizes(radii: &[f64]) -> Option<f64> {
    let sizes = sizes(radii);
    let is_many = sizes.len() > FEW_SIZES;
    is_many.then(|| sizes[sizes.len() - 1] / sizes[0])
}

impl NearFields {
    /// The size ratios, larger over smaller radius, whose tables a set of radii needs besides that
    /// of 1: those of its pairs, or for many sizes those that one table of all size ratios is made
    /// from.
    pub fn ratios(radii: &[f64]) -> Vec<f64> {
        if let Some(largest) = largest_of_continuous_sizes(radii) {
            // A size ratio out of range is refused where the tables are used.
            return NearFieldRange::ratios(largest).unwrap_or_default();
        }
        let distinct = sizes(radii);
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

    /// Whether the table of a size ratio (≥ 1) is present.
    pub fn contains(&self, size_ratio: f64) -> bool {
        self.find(size_ratio).is_some()
    }

    /// The table of a size ratio (≥ 1).
    fn find(&self, size_ratio: f64) -> Option<&Arc<NearField>> {
        self.tables
            .iter()
            .find(|t| same_ratio(t.size_ratio(), size_ratio))
    }

    /// The table of all size ratios up to one.
    fn range(&self, largest: f64) -> Result<Arc<NearFieldRange>, Error> {
        let place = &self.ranges[range_of(largest)?];
        if let Some(range) = place.get() {
            return Ok(Arc::clone(range));
        }
        let tables = NearFieldRange::ratios(largest)?
            .into_iter()
            .map(|ratio| match self.find(ratio) {
                Some(table) => Ok(Arc::clone(table)),
                None => Ok(Arc::new(NearField::new(ratio)?)),
            })
            .collect::<Result<Vec<_>, Error>>()?;
        let range = Arc::new(NearFieldRange::new(largest, &tables)?);
        Ok(Arc::clone(place.get_or_init(|| range)))
    }

    /// The table of twists for size ratios up to a largest.
    fn twist_range(&self, largest: f64) -> Result<Arc<TwistRange>, Error> {
        let range = range_of(largest)?;
        let made = self.twists[range].get_or_init(|| Arc::new(TwistRange::new(RANGES[range].0)));
        Ok(Arc::clone(made))
    }

    /// The table of pressure moments of a size ratio (≥ 1).
    fn pressure(&self, size_ratio: f64) -> Arc<PressureTable> {
        let mut tables = self
            .pressures
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let found = tables
            .iter()
            .find(|table| same_ratio(table.size_ratio(), size_ratio));
        if let Some(table) = found {
            return Arc::clone(table);
        }
        let table = Arc::new(PressureTable::new(size_ratio));
        tables.push(Arc::clone(&table));
        table
    }

    /// The table of pressure moments for size ratios up to a largest.
    fn pressure_range(&self, largest: f64) -> Result<Arc<PressureRange>, Error> {
        let place = &self.pressure_ranges[range_of(largest)?];
        if let Some(range) = place.get() {
            return Ok(Arc::clone(range));
        }
        let range = Arc::new(PressureRange::new(largest)?);
        Ok(Arc::clone(place.get_or_init(|| range)))
    }
}

/// Whether two size ratios are one up to rounding.
fn same_ratio(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a
}

/// A value for each pair of sizes of a set of spheres.
pub(crate) struct PerSizePair<T> {
    /// Values of the pairs of sizes, row by row.
    pairs: Vec<T>,
    /// Number of the size of each sphere, from the smallest.
    sizes: Vec<usize>,
    size_count: usize,
}

impl<T> PerSizePair<T> {
    /// Computes the value of every pair of sizes, in order.
    pub(crate) fn new(
        radii: &[f64],
        mut make: impl FnMut([f64; 2]) -> Result<T, Error>,
    ) -> Result<Self, Error> {
        let distinct = sizes(radii);
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

    /// The value for spheres i and j.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize, j: usize) -> &T {
        &self.pairs[self.size_count * self.sizes[i] + self.sizes[j]]
    }
}

/// Source of the near-field terms of pairs.
pub(crate) enum NearTerms {
    /// Exact pairs without their far field, from tables of a few size ratios.
    Exact(PerSizePair<Arc<NearField>>),
    /// Leading-order lubrication of a few sizes.
    LeadingOrder(PerSizePair<LeadingOrderPair>),
    /// Either of many sizes.
    Many(ContinuousSizes),
}

/// Source of the terms of many sizes.
pub(crate) enum ContinuousSizes {
    /// One table of exact pairs.
    Exact(Arc<NearFieldRange>),
    /// Leading-order lubrication, computed for every pair.
    LeadingOrder(LeadingOrder),
}

impl ContinuousSizes {
    /// The term of a pair.
    #[inline(never)]
    fn term(&self, [a, b]: [f64; 2], gap: f64) -> PairTerm {
        match self {
            Self::Exact(range) => vectorised(
                #[inline(always)]
                || range.evaluate(a, b, gap),
            ),
            Self::LeadingOrder(numbers) => LeadingOrderPair::new([a, b], *numbers).evaluate(gap),
        }
    }
}

impl NearTerms {
    /// The terms of spheres of the given radii; tables missing in `tables` are computed here, which
    /// takes seconds per size ratio.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(crate) fn new(
        hydrodynamics: Hydrodynamics,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        let many = largest_of_continuous_sizes(radii);
        match (hydrodynamics.leading_order(), many) {
            (None, Some(largest)) => {
                return Ok(Self::Many(ContinuousSizes::Exact(tables.range(largest)?)));
            }
            (Some(&numbers), Some(largest)) => {
                check_size_ratio(largest)?;
                return Ok(Self::Many(ContinuousSizes::LeadingOrder(numbers)));
            }
            (Some(&numbers), None) => {
                let pairs = PerSizePair::new(radii, |radii| {
                    check_size_ratio(radii[1] / radii[0])?;
                    Ok(LeadingOrderPair::new(radii, numbers))
                })?;
                return Ok(Self::LeadingOrder(pairs));
            }
            (None, None) => {}
        }
        let mut known = tables.clone();
        let equal = Arc::new(NearField::equal_spheres());
        let pairs = PerSizePair::new(radii, |[a, b]| {
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

    /// Computes the terms of all pairs, by their spheres and gaps; below the gap `least` they are
    /// those at that gap.
    ///
    /// `finish`: final operation on the term of spheres at a gap.
    pub(crate) fn evaluate<P: Sync, T: Copy + Send>(
        &self,
        radii: &[f64],
        (pairs, spheres_and_gap): (&[P], impl Fn(&P) -> ([usize; 2], f64) + Sync),
        least: f64,
        finish: impl Fn(PairTerm, [usize; 2], f64) -> T + Sync,
        terms: &mut Vec<T>,
    ) {
        terms.truncate(pairs.len());
        if let (Some(pair), true) = (pairs.first(), terms.len() < pairs.len()) {
            // Any term will do: all are replaced.
            let ([i, j], gap) = spheres_and_gap(pair);
            let gap = gap.max(least);
            let any = match self {
                Self::Exact(tables) => tables.of(i, j).evaluate(radii[i], radii[j], gap),
                Self::LeadingOrder(leading) => leading.of(i, j).evaluate(gap),
                Self::Many(many) => many.term([radii[i], radii[j]], gap),
            };
            terms.resize(pairs.len(), finish(any, [i, j], gap));
        }
        threads::divide(terms, LEAST_PAIRS, &|first, terms| {
            let pairs = pairs[first..].iter().map(|pair| {
                let ([i, j], gap) = spheres_and_gap(pair);
                ([i, j], gap.max(least))
            });
            let terms = terms.iter_mut().zip(pairs);
            if let Self::Many(many) = self {
                for (term, ([i, j], gap)) in terms {
                    *term = finish(many.term([radii[i], radii[j]], gap), [i, j], gap);
                }
                return;
            }
            vectorised(
                #[inline(always)]
                || match self {
                    Self::Exact(tables) => {
                        for (term, ([i, j], gap)) in terms {
                            let exact = tables.of(i, j).evaluate(radii[i], radii[j], gap);
                            *term = finish(exact, [i, j], gap);
                        }
                    }
                    Self::LeadingOrder(leading) => {
                        for (term, ([i, j], gap)) in terms {
                            *term = finish(leading.of(i, j).evaluate(gap), [i, j], gap);
                        }
                    }
                    Self::Many(_) => {}
                },
            );
        });
    }

    /// Inverse slip mobility K of spheres i and j, alone in unbounded fluid, in mu·a.
    pub(super) fn slip_resistance(&self, [i, j]: [usize; 2], radii: &[f64], gap: f64) -> f64 {
        match self {
            Self::Exact(tables) => tables.of(i, j).slip_resistance(radii[i], radii[j], gap),
            Self::LeadingOrder(leading) => leading.of(i, j).slip_resistance(gap),
            Self::Many(ContinuousSizes::Exact(range)) => {
                range.slip_resistance(radii[i], radii[j], gap)
            }
            Self::Many(ContinuousSizes::LeadingOrder(numbers)) => {
                LeadingOrderPair::new([radii[i], radii[j]], *numbers).slip_resistance(gap)
            }
        }
    }
}

/// X^C of exact pairs.
pub(super) enum Twists {
    /// Of a few sizes.
    Few(PerSizePair<TwistTable>),
    /// Of many.
    Many(Arc<TwistRange>),
}

impl Twists {
    /// Those of spheres of the given radii.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(super) fn new(radii: &[f64], tables: &NearFields) -> Result<Self, Error> {
        Ok(match largest_of_continuous_sizes(radii) {
            None => Self::Few(PerSizePair::new(radii, |radii| Ok(TwistTable::new(radii)))?),
            Some(largest) => Self::Many(tables.twist_range(largest)?),
        })
    }

    /// The entries for spheres i and j.
    #[inline(always)]
    pub(super) fn evaluate(&self, [i, j]: [usize; 2], radii: &[f64], gap: f64) -> [f64; 3] {
        match self {
            Self::Few(tables) => tables.of(i, j).evaluate(gap),
            Self::Many(range) => range.evaluate(radii[i], radii[j], gap),
        }
    }
}

/// Pressure moments of pairs.
pub(super) enum PressureTerms {
    /// Exact pairs without their far field, of a few sizes.
    Few(PerSizePair<Arc<PressureTable>>),
    /// Of many.
    Many(Arc<PressureRange>),
    /// Leading-order lubrication.
    LeadingOrder(LeadingOrder),
}

impl PressureTerms {
    /// Those of spheres of the given radii.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size ratio outside 0.01 to 100.
    pub(super) fn new(
        hydrodynamics: Hydrodynamics,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        if let Some(&numbers) = hydrodynamics.leading_order() {
            return Ok(Self::LeadingOrder(numbers));
        }
        Ok(match largest_of_continuous_sizes(radii) {
            None => Self::Few(PerSizePair::new(radii, |[a, b]| {
                Ok(tables.pressure(check_size_ratio(a.max(b) / a.min(b))?))
            })?),
            Some(largest) => Self::Many(tables.pressure_range(largest)?),
        })
    }

    /// The entries for spheres i and j at a gap.
    pub(super) fn evaluate(&self, [i, j]: [usize; 2], radii: &[f64], gap: f64) -> PressureEntries {
        let (a, b) = (radii[i], radii[j]);
        match self {
            Self::Few(tables) => tables.of(i, j).evaluate(a, b, gap),
            Self::Many(range) => range.evaluate(a, b, gap),
            Self::LeadingOrder(numbers) => leading_order_pressure([a, b], numbers, gap),
        }
    }
}
