//! Pairs of neighbouring spheres.

use super::cell::Cell;
use super::{Layer, Space};
use crate::error::Error;

/// The indices of the two spheres of a pair, the lower one first: its key.
pub type PairKey = (u32, u32);

/// Two spheres within range of each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbours<S: Space = Layer> {
    /// First sphere, `i < j`.
    pub i: usize,
    /// Second sphere.
    pub j: usize,
    /// The image of j.
    pub image: S::Image,
    /// Distance of the centres r, in a.
    pub distance: f64,
    /// Unit vector n from i to that image of j.
    pub normal: S::Vector,
    /// Surface-to-surface gap g = r − a_i − a_j, in a.
    pub gap: f64,
}

impl<S: Space> Neighbours<S> {
    /// The spheres `[i, j]`, i < j, if `s' = 2r/(a_i + a_j)` is below `range`.
    #[inline(always)]
    pub(super) fn within(
        range: f64,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        [i, j]: [usize; 2],
    ) -> Option<Self> {
        let (r, image) = cell.nearest(centres[j] - centres[i]);
        let sum = radii[i] + radii[j];
        let square = S::norm_squared(&r);
        let reach = 0.5 * range * sum;
        (square < reach * reach).then(|| {
            let distance = square.sqrt();
            Self {
                i,
                j,
                image,
                distance,
                normal: r / distance,
                gap: distance - sum,
            }
        })
    }

    /// The numbers of the two spheres.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "sphere numbers fit 32 bits"
    )]
    pub fn key(&self) -> PairKey {
        (self.i as u32, self.j as u32)
    }

    /// The error that names the pair as overlapping.
    pub(crate) fn overlap(&self) -> Error {
        Error::Overlap {
            i: self.i,
            j: self.j,
            gap: self.gap,
            separation: self.distance,
        }
    }
}
