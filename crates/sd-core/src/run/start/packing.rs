//! Random packing of spheres in a cell, without contact.
//!
//! Random points are relaxed as soft spheres of diameter `a_i + a_j + h + margin` (energy ½ Σ
//! overlap², FIRE: Bitzek et al. 2006) until no overlap is left. The margin is the largest of a few
//! that fits, so that dilute systems do not start with many pairs just at h. Dense systems that get
//! stuck are shaken with decreasing amplitude and relaxed again. Relaxations and their steps are
//! limited, so that packing ends, with centres or with the fraction reached.

use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::cmp::Ordering;

/// Extra gaps tried, in a, largest first.
const MARGINS: [f64; 6] = [0.2, 0.1, 0.05, 0.02, 0.005, 0.001];
/// Number of new random starts at the smallest margin before packing fails.
const SCATTERS: u32 = 3;
/// Maximum steps of one relaxation.
const STEPS: u32 = 4000;
/// Height of the rows in which spheres of large systems are numbered, in a.
pub(super) const ROW: f64 = 3.0;

/// Packing limits of discs or spheres.
pub(super) struct Density {
    /// Fraction of the grown spheres up to which plain relaxation is tried.
    pub(super) easy: f64,
    /// Fraction of the densest packing of equal ones.
    pub(super) closest: f64,
    /// Shakes tried with each of [`SCATTERS`].
    pub(super) shakes: u32,
    /// Net force on spheres over the forces of overlaps, as sums of squares, below which the system
    /// counts as jammed.
    pub(super) balanced: f64,
}

/// Packing limits of discs.
pub(super) const DISCS: Density = Density {
    easy: 0.80,
    closest: 0.906_899_682_117_108_9, // π/√12
    shakes: 100,
    balanced: 0.0,
};

/// Packing limits of spheres.
pub(super) const SPHERES: Density = Density {
    easy: 0.55,
    closest: 0.740_480_489_693_061, // π/√18
    shakes: 10,
    balanced: 1e-4,
};

/// Spheres during packing into a cell.
pub(super) struct Packing<S: Space> {
    cell: Cell<S>,
    pub(super) radii: Vec<f64>,
    /// Required smallest gap, in a.
    gap: f64,
    /// Additional target gap, in a.
    margin: f64,
    pub(super) centres: Vec<S::Vector>,
    velocities: Vec<S::Vector>,
    forces: Vec<S::Vector>,
    /// Sum of the squares of the overlaps.
    overlaps: f64,
    neighbours: NeighbourList<S>,
}

impl<S: Space> Packing<S> {
    /// Spheres before placement.
    pub(super) fn new(cell: Cell<S>, radii: Vec<f64>, gap: f64) -> Self {
        let zero = vec![S::Vector::default(); radii.len()];
        Self {
            cell,
            radii,
            gap,
            margin: 0.0,
            centres: zero.clone(),
            velocities: zero.clone(),
            forces: zero,
            overlaps: 0.0,
            neighbours: NeighbourList::default(),
        }
    }

    /// Places the spheres, which cover the given fraction of the cell, by the seed (`ChaCha8`).
    ///
    /// # Errors
    /// The fraction reached.
    pub(super) fn pack(&mut self, fraction: f64, density: &Density, seed: u64) -> Result<(), f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let power = |x: f64| (0..S::DIMENSIONS).map(|_| x).product::<f64>();
        let mut smallest = f64::NEG_INFINITY;
        for (attempt, &margin) in MARGINS.iter().enumerate() {
            let last = attempt + 1 == MARGINS.len();
            let grown = fraction * power(1.0 + 0.5 * (self.gap + margin));
            if grown > density.easy && !last {
                continue;
            }
            self.margin = margin;
            for _ in 0..if last { SCATTERS } else { 1 } {
                self.scatter(&mut random);
                let mut gap = self.relax(density.balanced);
                for shake in 0..if last { density.shakes } else { 0 } {
                    if gap >= self.gap {
                        break;
                    }
                    // Shakes decrease from most of a radius, which melts the packing, to a tenth of
                    // it, several times.
                    let size = 0.8 * 0.125f64.powf(f64::from(shake % 10) / 9.0);
                    self.shake(size, &mut random);
                    gap = self.relax(density.balanced);
                }
                smallest = smallest.max(gap);
                if gap >= self.gap {
                    for x in &mut self.centres {
                        *x = self.cell.wrap(*x);
                    }
                    return Ok(());
                }
            }
        }
        // Spheres with the gap that was reached, grown until it is h, would fit at this fraction.
        Err(fraction * power((2.0 + smallest) / (2.0 + self.gap)))
    }

    /// Numbers spheres row by row along the flow, by size, or for many sizes all together.
    /// Neighbours are then close in memory, and remain so for long, since shear moves whole rows
    /// past each other.
    pub(super) fn number_by_rows(&mut self, many_sizes: bool) {
        let in_rows = |a: &S::Vector, b: &S::Vector| {
            let rows = (1..S::DIMENSIONS).rev().map(|k| {
                let [row_a, row_b] = [a, b].map(|x| (x[k] / ROW).floor());
                row_a.total_cmp(&row_b)
            });
            rows.fold(Ordering::Equal, Ordering::then)
                .then(a[0].total_cmp(&b[0]))
        };
        if many_sizes {
            let mut spheres: Vec<_> = self
                .centres
                .iter()
                .copied()
                .zip(self.radii.clone())
                .collect();
            spheres.sort_by(|a, b| in_rows(&a.0, &b.0));
            (self.centres, self.radii) = spheres.into_iter().unzip();
            return;
        }
        let mut rest = self.centres.as_mut_slice();
        for alike in self.radii.chunk_by(|a, b| a == b) {
            let (same_size, others) = rest.split_at_mut(alike.len());
            same_size.sort_by(in_rows);
            rest = others;
        }
    }

    /// Places every sphere at random.
    fn scatter(&mut self, random: &mut impl Rng) {
        let Cell::Periodic(lattice) = self.cell else {
            return;
        };
        for x in &mut self.centres {
            *x = S::Vector::default();
            for vector in lattice.reduced_vectors() {
                *x += *vector * random.random::<f64>();
            }
        }
    }

    /// Moves every sphere by up to `size` along each axis.
    fn shake(&mut self, size: f64, random: &mut impl Rng) {
        for x in &mut self.centres {
            for k in 0..S::DIMENSIONS {
                x[k] += 2.0 * size * (random.random::<f64>() - 0.5);
            }
        }
    }

    /// Relaxes the overlaps by FIRE; returns the smallest gap at the end.
    fn relax(&mut self, balanced: f64) -> f64 {
        let (mut dt, mut mixing, mut downhill) = (0.1, 0.1, 0u32);
        self.velocities.fill(S::Vector::default());
        let mut smallest = self.update_forces();
        let mut last_energy = f64::INFINITY;
        for step in 0..STEPS {
            let energy: f64 = self.forces.iter().map(S::norm_squared).sum();
            // The spheres are jammed: forces no longer decrease, or are balanced, but overlaps
            // remain.
            if step % 100 == 99 {
                if energy > 0.8 * last_energy || energy < balanced * self.overlaps {
                    break;
                }
                last_energy = energy;
            }
            if smallest >= self.gap {
                break;
            }
            let power: f64 = self
                .forces
                .iter()
                .zip(&self.velocities)
                .map(|(f, v)| S::dot(f, v))
                .sum();
            if power > 0.0 {
                let speed: f64 = self.velocities.iter().map(S::norm_squared).sum();
                let scale = mixing * (speed / energy.max(f64::MIN_POSITIVE)).sqrt();
                for (v, &f) in self.velocities.iter_mut().zip(&self.forces) {
                    *v = *v * (1.0 - mixing) + f * scale;
                }
                downhill += 1;
                if downhill > 5 {
                    dt = f64::min(dt * 1.1, 0.5);
                    mixing *= 0.99;
                }
            } else {
                self.velocities.fill(S::Vector::default());
                (dt, mixing, downhill) = (f64::max(dt * 0.5, 0.02), 0.1, 0);
            }
            for ((x, v), &f) in self
                .centres
                .iter_mut()
                .zip(&mut self.velocities)
                .zip(&self.forces)
            {
                *v += f * dt;
                *x += *v * dt;
            }
            smallest = self.update_forces();
        }
        smallest
    }

    /// Forces of the overlaps; returns the smallest gap between spheres.
    fn update_forces(&mut self) -> f64 {
        let range = range(&self.radii, self.gap + self.margin);
        self.neighbours
            .find_all(&self.cell, &self.centres, &self.radii, range);
        self.forces.fill(S::Vector::default());
        self.overlaps = 0.0;
        let mut smallest = f64::INFINITY;
        for pair in self.neighbours.pairs() {
            smallest = smallest.min(pair.gap);
            let overlap = self.gap + self.margin - pair.gap;
            if overlap > 0.0 {
                self.overlaps += overlap * overlap;
                let force = pair.normal * overlap;
                self.forces[pair.i] -= force;
                self.forces[pair.j] += force;
            }
        }
        smallest
    }
}

/// Twice the distance, over the sum of the radii, within which are all pairs with that gap or less.
pub(super) fn range(radii: &[f64], gap: f64) -> f64 {
    let least = radii.iter().copied().fold(f64::INFINITY, f64::min);
    (2.0 + gap / least) * (1.0 + 1e-9)
}
