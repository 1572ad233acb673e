//! The lattice of a periodic cell: its vectors, nearest images, wave vectors, and how it moves with
//! the flow.
//!
//! ```text
//! H: rows a₀, a₁, a₂ (a₀, a₁ in a layer);   x = X a₀ + Y a₁ + Z a₂;   k = 2π H⁻ᵀ (m, n, l)
//! dH/dt = H Lᵀ
//! ```
//! Any basis of a lattice describes the same system: images are counted in the one that was given,
//! all sums and searches use a reduced one. That is held together with the frame in which it is
//! triangular; for a sheared cell (Lees & Edwards 1972), which is not reduced, the frame of the
//! flow:
//!
//! ```text
//! a₀ = (l₀, 0, 0)      a₁ = (offset, l₁, cross offset)      a₂ = (tilt, 0, l₂)
//! ```

mod recurrent;

pub(crate) use recurrent::RecurrentLattice;

use super::{Layer, Space, VelocityGradient};
use crate::error::{Error, Refusal};
use std::f64::consts::PI;

/// Vectors whose volume is smaller than this, relative to the product of their lengths, count as
/// dependent.
const INDEPENDENCE: f64 = 1e-9;

/// Numbers of lattice vectors to the neighbouring cells, one of each opposite pair; the first four
/// are those in a layer.
const NEIGHBOURS: [[i32; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [1, 1, 0],
    [1, -1, 0],
    [0, 0, 1],
    [1, 0, 1],
    [-1, 0, 1],
    [0, 1, 1],
    [0, -1, 1],
    [1, 1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [-1, -1, 1],
];

/// The vectors of a periodic lattice, right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice<S: Space = Layer> {
    /// Reduced lattice vectors, in a; the third one is zero in a layer.
    vectors: [S::Vector; 3],
    /// Lattice vectors in which images are counted, in a.
    basis: [S::Vector; 3],
    /// The reduced vectors by numbers of vectors of the basis.
    numbers: [[i32; 3]; 3],
    /// Unit vectors of the frame in which the lattice vectors are triangular.
    frame: [S::Vector; 3],
    /// The frame's unit vectors over the lengths: numbers of cells along each of them.
    cells_along: [S::Vector; 3],
    /// Diagonal of the triangular matrix, in a; 1 beyond the dimensions of the space.
    lengths: [f64; 3],
    offset: f64,
    cross_offset: f64,
    tilt: f64,
    /// Every vector shorter than this is found by [`Lattice::nearest`], in a.
    reach: f64,
    /// Whether it is a sheared cell, whose nearest images are those within half the sides.
    is_sheared_cell: bool,
    /// The reduced vectors summed by [`NEIGHBOURS`], and their squares; none in a sheared cell.
    neighbours: [(S::Vector, f64); NEIGHBOURS.len()],
}

impl<S: Space> Lattice<S> {
    /// The lattice of these vectors, two in a layer and three in a suspension, in a.
    ///
    /// # Errors
    /// [`Error::Refused`] unless the vectors are finite, independent and right-handed.
    ///
    /// ```
    /// use sd_core::Layer;
    /// use sd_core::cell::Lattice;
    /// use sd_core::modes::Vec2;
    ///
    /// let lattice = Lattice::<Layer>::new(&[Vec2::new(10.0, 0.0), Vec2::new(21.0, 9.0)])?;
    /// assert!((lattice.content() - 90.0).abs() < 1e-12);
    /// assert!((lattice.shortest() - 82.0_f64.sqrt()).abs() < 1e-12);
    /// assert_eq!(lattice.nearest(Vec2::new(2.0, 9.5)), (Vec2::new(1.0, 0.5), [2, -1]));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn new(vectors: &[S::Vector]) -> Result<Self, Error> {
        let refuse = |problem: String| {
            Err(Error::from(Refusal {
                key: "lattice",
                value: written::<S>(vectors),
                problem,
                allowed: format!(
                    "{} finite, linearly independent vectors in right-handed order",
                    S::DIMENSIONS
                ),
                because: None,
            }))
        };
        if vectors.len() != S::DIMENSIONS {
            return refuse(format!("has {} vectors", vectors.len()));
        }
        let mut rows = [S::Vector::default(); 3];
        rows[..S::DIMENSIONS].copy_from_slice(vectors);
        let content = determinant::<S>(&rows);
        let lengths = vectors.iter().map(S::norm_squared).product::<f64>().sqrt();
        if !(content.is_finite() && lengths.is_finite()) {
            return refuse("has a number that is not finite or too large".into());
        }
        if content.abs() <= INDEPENDENCE * lengths {
            return refuse(format!("has dependent vectors, of volume {content:.3e}"));
        }
        if content < 0.0 {
            return refuse(format!("is left-handed, with volume {content:.6}"));
        }
        let mut lattice = Self::with_basis(reduced::<S>(rows));
        let given = Self::with_basis(rows);
        for (numbers, a) in lattice.numbers.iter_mut().zip(&lattice.vectors) {
            #[expect(clippy::cast_possible_truncation, reason = "whole numbers of vectors")]
            let whole = given.coordinates(a).map(|x| x.round() as i32);
            *numbers = whole;
        }
        lattice.basis = rows;
        Ok(lattice)
    }

    /// The cell of these sides whose images above, in y, are shifted along x and z (Lees & Edwards
    /// 1972): positive sides, and offsets within half a side.
    pub(super) fn sheared_cell(sides: S::Vector, offset: f64, cross_offset: f64) -> Self {
        let mut cell = Self {
            vectors: [S::Vector::default(); 3],
            basis: [S::Vector::default(); 3],
            numbers: IDENTITY,
            frame: [S::Vector::default(); 3],
            cells_along: [S::Vector::default(); 3],
            lengths: [1.0; 3],
            offset,
            cross_offset,
            tilt: 0.0,
            reach: f64::INFINITY,
            is_sheared_cell: true,
            neighbours: [(S::Vector::default(), f64::INFINITY); NEIGHBOURS.len()],
        };
        for k in 0..S::DIMENSIONS {
            cell.lengths[k] = sides[k];
            cell.vectors[k][k] = sides[k];
            cell.frame[k][k] = 1.0;
            cell.cells_along[k][k] = sides[k].recip();
            cell.reach = cell.reach.min(0.5 * sides[k]);
        }
        cell.vectors[1][0] = offset;
        if S::DIMENSIONS > 2 {
            cell.vectors[1][2] = cross_offset;
        }
        cell.basis = cell.vectors;
        cell
    }

    /// The lattice of a right-handed basis, which must be reduced for nearest images.
    fn with_basis(vectors: [S::Vector; 3]) -> Self {
        let unit = |x: S::Vector| x / S::norm_squared(&x).sqrt();
        let across = |x: S::Vector, axis: &S::Vector| x - *axis * S::dot(&x, axis);
        let [a, b, c] = vectors;
        let first = unit(a);
        let mut frame = [first, unit(across(b, &first)), S::Vector::default()];
        if S::DIMENSIONS > 2 {
            let third = unit(across(c, &first));
            frame = [first, unit(across(across(b, &first), &third)), third];
        }
        let [mut lengths, mut cells_along] = [[1.0; 3], [0.0; 3]];
        for k in 0..S::DIMENSIONS {
            lengths[k] = S::dot(&vectors[k], &frame[k]);
            cells_along[k] = lengths[k].recip();
        }
        let shortest = (0..S::DIMENSIONS).map(|k| S::norm_squared(&vectors[k]).sqrt());
        Self {
            vectors,
            basis: vectors,
            numbers: IDENTITY,
            frame,
            cells_along: std::array::from_fn(|k| frame[k] * cells_along[k]),
            lengths,
            offset: S::dot(&b, &frame[0]),
            cross_offset: S::dot(&b, &frame[2]),
            tilt: S::dot(&c, &frame[0]),
            reach: 0.5 * shortest.fold(f64::INFINITY, f64::min),
            is_sheared_cell: false,
            neighbours: NEIGHBOURS.map(|numbers| {
                let vector = combination::<S>(&vectors, numbers);
                (vector, S::norm_squared(&vector))
            }),
        }
    }

    /// The lattice vectors as they were given, in a: those in which images are counted.
    pub fn vectors(&self) -> &[S::Vector] {
        &self.basis[..S::DIMENSIONS]
    }

    /// The vectors that sums and searches use, in a.
    pub(crate) fn reduced_vectors(&self) -> &[S::Vector] {
        &self.vectors[..S::DIMENSIONS]
    }

    /// The sides of a sheared cell; of another lattice the diagonal of its triangular form. In a,
    /// one per dimension.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths[..S::DIMENSIONS]
    }

    /// The diagonal of the triangular form, in a; 1 beyond the dimensions of the space.
    #[inline(always)]
    pub(crate) fn lengths_in_frame(&self) -> [f64; 3] {
        self.lengths
    }

    /// Shift of the images above along the first lattice vector, in a; in a sheared cell within
    /// half a side.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Shift of the images above across the first two axes of the triangular form, in a; 0 in a
    /// layer and without cross shear.
    pub fn cross_offset(&self) -> f64 {
        self.cross_offset
    }

    /// Shift of the third lattice vector along the first one, in a; 0 in a sheared cell.
    pub(crate) fn tilt(&self) -> f64 {
        self.tilt
    }

    /// Whether it is a sheared cell: sides along the axes, of which the second may be inclined.
    pub fn is_sheared_cell(&self) -> bool {
        self.is_sheared_cell
    }

    /// Area or volume, in a² or a³.
    pub fn content(&self) -> f64 {
        self.lengths().iter().product()
    }

    /// Every vector shorter than this is found by [`Lattice::nearest`], in a: half the shortest
    /// lattice vector, or half the shortest side of a sheared cell.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Length of the shortest lattice vector, in a.
    pub fn shortest(&self) -> f64 {
        let [first, ..] = reduced::<S>(self.vectors);
        S::norm_squared(&first).sqrt()
    }

    /// The lattice with its shortest basis: by Lagrange and Gauss in a layer, by Minkowski in a
    /// suspension. The first vector is the shortest one.
    #[must_use]
    pub fn reduce(&self) -> Self {
        Self::with_basis(reduced::<S>(self.vectors))
    }

    /// The lattice after a flow for a time, with a reduced basis unless it still is a sheared cell:
    /// `H exp(Lᵀ t)`.
    #[must_use]
    pub fn deform(&self, flow: &VelocityGradient<S>, time: f64) -> Self {
        let rows = self.vectors.map(|row| flow.carried(&row, time));
        let stays =
            |k: usize| (0..S::DIMENSIONS).all(|j| j == k || rows[k][j] == 0.0) && rows[k][k] > 0.0;
        let is_sheared = stays(0) && (S::DIMENSIONS < 3 || stays(2)) && rows[1][1] > 0.0;
        if !is_sheared {
            return Self::with_basis(reduced::<S>(rows));
        }
        let mut sides = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            sides[k] = rows[k][k];
        }
        let cross_offset = if S::DIMENSIONS > 2 {
            wrapped(rows[1][2], sides[2])
        } else {
            0.0
        };
        Self::sheared_cell(sides, wrapped(rows[1][0], sides[0]), cross_offset)
    }

    /// The lattice with all lengths multiplied by a factor.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        if self.is_sheared_cell {
            let mut sides = S::Vector::default();
            for k in 0..S::DIMENSIONS {
                sides[k] = self.lengths[k] * factor;
            }
            return Self::sheared_cell(sides, self.offset * factor, self.cross_offset * factor);
        }
        Self {
            basis: self.basis.map(|row| row * factor),
            numbers: self.numbers,
            ..Self::with_basis(self.vectors.map(|row| row * factor))
        }
    }

    /// Position of an image relative to the original.
    pub fn image_vector(&self, image: S::Image) -> S::Vector {
        let mut vector = self.basis[0] * f64::from(image[0]);
        for k in 1..S::DIMENSIONS {
            vector += self.basis[k] * f64::from(image[k]);
        }
        vector
    }

    /// A sum of reduced vectors.
    pub(crate) fn translation(&self, numbers: S::Image) -> S::Vector {
        let mut vector = self.vectors[0] * f64::from(numbers[0]);
        for k in 1..S::DIMENSIONS {
            vector += self.vectors[k] * f64::from(numbers[k]);
        }
        vector
    }

    /// Moves a separation to an image whose components along the frame of the lattice are at most
    /// half its lengths; the image is counted in reduced vectors.
    #[inline(always)]
    pub(crate) fn fold(&self, separation: S::Vector) -> (S::Vector, S::Image) {
        let (mut vector, mut image) = (separation, S::Image::default());
        for k in [1, 2, 0] {
            if k < S::DIMENSIONS {
                let cells = -S::dot(&vector, &self.cells_along[k]).round_ties_even();
                #[expect(clippy::cast_possible_truncation, reason = "whole numbers of cells")]
                let whole = cells as i32;
                image[k] = whole;
                vector += self.vectors[k] * cells;
            }
        }
        (vector, image)
    }

    /// Moves a separation to its nearest image, and returns that image. In a sheared cell that is
    /// the image whose components are at most half the sides.
    ///
    /// Every vector shorter than [`Lattice::reach`] is found this way.
    #[inline(always)]
    pub fn nearest(&self, separation: S::Vector) -> (S::Vector, S::Image) {
        let found = self.fold(separation);
        if self.is_sheared_cell {
            found
        } else {
            self.descend(found)
        }
    }

    /// The nearest image, by steps to closer ones, counted in the vectors given. Of a reduced
    /// basis, the vectors to the faces of the Voronoi cell have the coefficients −1, 0, 1.
    fn descend(&self, (mut vector, mut image): (S::Vector, S::Image)) -> (S::Vector, S::Image) {
        let count = if S::DIMENSIONS < 3 {
            4
        } else {
            NEIGHBOURS.len()
        };
        let mut square = S::norm_squared(&vector);
        while square >= self.reach * self.reach {
            // |v ± x|² = v² + x² ± 2 v·x, the less of both.
            let (mut least, mut best) = (square, None);
            for (k, (neighbour, length)) in self.neighbours[..count].iter().enumerate() {
                let along = 2.0 * S::dot(&vector, neighbour);
                let closer = square + length - along.abs();
                if closer < least {
                    least = closer;
                    best = Some((k, if along > 0.0 { -1 } else { 1 }));
                }
            }
            let Some((k, sign)) = best else { break };
            let closer = vector + self.neighbours[k].0 * f64::from(sign);
            // A margin, so that rounding cannot lead around a circle.
            let new = S::norm_squared(&closer);
            if new >= square * (1.0 - 1e-14) {
                break;
            }
            (vector, square) = (closer, new);
            for j in 0..S::DIMENSIONS {
                image[j] += sign * NEIGHBOURS[k][j];
            }
        }
        let mut given = S::Image::default();
        for j in 0..S::DIMENSIONS {
            given[j] = (0..S::DIMENSIONS)
                .map(|k| image[k] * self.numbers[k][j])
                .sum();
        }
        (vector, given)
    }

    /// Moves a position into the cell: components along the frame of the lattice from 0 to its
    /// lengths.
    pub fn wrap(&self, position: S::Vector) -> S::Vector {
        let mut wrapped = position;
        for k in [1, 2, 0] {
            if k < S::DIMENSIONS {
                let cells = (S::dot(&wrapped, &self.frame[k]) / self.lengths[k]).floor();
                wrapped -= self.vectors[k] * cells;
            }
        }
        wrapped
    }

    /// Coordinates (X, Y, Z) of a position in reduced lattice vectors; Z is 0 in a layer.
    #[inline(always)]
    pub(crate) fn coordinates(&self, position: &S::Vector) -> [f64; 3] {
        let [x, y, z] = self.in_frame(position);
        let second = y / self.lengths[1];
        if S::DIMENSIONS < 3 {
            return [(x - second * self.offset) / self.lengths[0], second, 0.0];
        }
        let third = (z - second * self.cross_offset) / self.lengths[2];
        let first = (x - second * self.offset - third * self.tilt) / self.lengths[0];
        [first, second, third]
    }

    /// Components of a vector in the frame of the triangular form; the third one is 0 in a layer.
    #[inline(always)]
    pub(crate) fn in_frame(&self, vector: &S::Vector) -> [f64; 3] {
        let mut components = [0.0; 3];
        for (k, component) in components.iter_mut().enumerate().take(S::DIMENSIONS) {
            *component = S::dot(vector, &self.frame[k]);
        }
        components
    }

    /// All images of a separation that are shorter than a distance.
    pub(crate) fn images_within(
        &self,
        separation: S::Vector,
        reach: f64,
    ) -> impl Iterator<Item = S::Vector> + use<S> {
        let range = |x: f64, side: f64, reach: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "whole numbers of cells")]
            let (first, last) = (
                ((-reach - x) / side).ceil() as i32,
                ((reach - x) / side).floor() as i32,
            );
            first..=last
        };
        let lattice = *self;
        let [length, above, depth] = lattice.lengths_in_frame();
        let [first, second, third] = lattice.in_frame(&separation);
        let rows = range(second, above, reach);
        let most = rows.start().abs().max(rows.end().abs());
        let shifted = f64::from(most) * lattice.cross_offset().abs();
        let planes = if S::DIMENSIONS < 3 {
            0..=0
        } else {
            range(third, depth, reach + shifted)
        };
        planes.flat_map(move |l| {
            rows.clone().flat_map(move |n| {
                let (n, l) = (f64::from(n), f64::from(l));
                let x = first + (n * lattice.offset() + l * lattice.tilt());
                let y = second + n * above;
                let z = third + (l * depth + n * lattice.cross_offset());
                range(x, length, reach)
                    .map(move |m| lattice.out_of_frame([x + f64::from(m) * length, y, z]))
                    .filter(move |x| S::norm_squared(x) < reach * reach)
            })
        })
    }

    /// The vector with these components in the frame of the triangular form.
    #[inline(always)]
    pub(crate) fn out_of_frame(&self, components: [f64; 3]) -> S::Vector {
        let mut vector = self.frame[0] * components[0];
        for (unit, component) in self
            .frame
            .iter()
            .zip(components)
            .take(S::DIMENSIONS)
            .skip(1)
        {
            vector += *unit * component;
        }
        vector
    }

    /// Wave vector of wave numbers (m, n, l) along the reduced vectors, in 1/a: `k·a₀ = 2πm,
    /// k·a₁ = 2πn, k·a₂ = 2πl`.
    pub(crate) fn wave_vector(&self, [m, n, l]: [f64; 3]) -> S::Vector {
        let [length, above, depth] = self.lengths;
        let x = m / length;
        let z = (l - x * self.tilt) / depth;
        let y = (n - x * self.offset - z * self.cross_offset) / above;
        self.out_of_frame([x, y, z]) * (2.0 * PI)
    }

    /// Reciprocal vectors b of the reduced ones: `b_i·a_j = δ_ij`, the gradients of the
    /// coordinates, in 1/a.
    pub(crate) fn reciprocal(&self) -> [S::Vector; 3] {
        let [x, y, z] = self.lengths.map(f64::recip);
        let offset = self.offset - self.cross_offset * z * self.tilt;
        [
            self.out_of_frame([x, -offset * x * y, -self.tilt * x * z]),
            self.out_of_frame([0.0, y, 0.0]),
            self.out_of_frame([0.0, -self.cross_offset * y * z, z]),
        ]
    }

    /// Lengths of the lattice vectors, in a: a wave vector k has at most k·length/2π waves along
    /// each. Those of a sheared cell are upper bounds for any offset, and any cross offset if it
    /// has one now.
    pub(crate) fn wave_lengths(&self) -> [f64; 3] {
        let [length, above, depth] = self.lengths;
        if self.is_sheared_cell {
            let above = above.hypot(0.5 * length);
            let is_crossed = self.cross_offset != 0.0;
            let above = if is_crossed {
                above.hypot(0.5 * depth)
            } else {
                above
            };
            return [length, above, depth];
        }
        self.vectors.map(|a| S::norm_squared(&a).sqrt())
    }
}

/// Numbers of vectors in vectors of the same basis.
const IDENTITY: [[i32; 3]; 3] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/// An offset within half a side.
pub(super) fn wrapped(offset: f64, side: f64) -> f64 {
    offset - side * (offset / side + 0.5).floor()
}

/// The vectors as they are written in input files.
fn written<S: Space>(vectors: &[S::Vector]) -> String {
    let rows = vectors.iter().map(|x| format!("{:?}", S::point(x)));
    format!("[{}]", rows.collect::<Vec<_>>().join(", "))
}

/// Signed area or volume of vectors.
fn determinant<S: Space>([a, b, c]: &[S::Vector; 3]) -> f64 {
    if S::DIMENSIONS < 3 {
        return a[0] * b[1] - a[1] * b[0];
    }
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// All numbers of cells −1, 0, 1 along each lattice vector, without zero.
fn neighbouring_cells<S: Space>() -> impl Iterator<Item = [i32; 3]> {
    let depth = i32::from(S::DIMENSIONS > 2);
    (-1..=1)
        .flat_map(|m| (-1..=1).map(move |n| [m, n]))
        .flat_map(move |[m, n]| (-depth..=depth).map(move |l| [m, n, l]))
        .filter(|&step| step != [0; 3])
}

/// A sum of lattice vectors.
fn combination<S: Space>(vectors: &[S::Vector; 3], numbers: [i32; 3]) -> S::Vector {
    let mut sum = S::Vector::default();
    for (vector, number) in vectors.iter().zip(numbers) {
        sum += *vector * f64::from(number);
    }
    sum
}

/// The shortest basis, in order of length, right-handed.
fn reduced<S: Space>(mut basis: [S::Vector; 3]) -> [S::Vector; 3] {
    // A margin, so that rounding cannot lead around a circle.
    let is_shorter = |new: &S::Vector, old: &S::Vector| {
        S::norm_squared(new) < S::norm_squared(old) * (1.0 - 1e-12)
    };
    let mut has_changed = true;
    while has_changed {
        has_changed = false;
        for k in 0..S::DIMENSIONS {
            for j in (0..S::DIMENSIONS).filter(|&j| j != k) {
                let share = S::dot(&basis[k], &basis[j]) / S::norm_squared(&basis[j]);
                let new = basis[k] - basis[j] * share.round();
                if is_shorter(&new, &basis[k]) {
                    basis[k] = new;
                    has_changed = true;
                }
            }
            // Of three vectors, also by sums and differences of two.
            for mut step in neighbouring_cells::<S>() {
                step[k] = 1;
                let new = combination::<S>(&basis, step);
                if is_shorter(&new, &basis[k]) {
                    basis[k] = new;
                    has_changed = true;
                }
            }
        }
    }
    basis[..S::DIMENSIONS].sort_by(|a, b| S::norm_squared(a).total_cmp(&S::norm_squared(b)));
    if determinant::<S>(&basis) < 0.0 {
        let last = S::DIMENSIONS - 1;
        basis[last] = -basis[last];
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Bulk, cell::Cell};
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt as _, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Right-handed vectors of a random, skewed lattice.
    fn skewed<S: Space>(random: &mut ChaCha8Rng) -> Vec<S::Vector> {
        loop {
            let mut rows = vec![S::Vector::default(); S::DIMENSIONS];
            for row in &mut rows {
                for k in 0..S::DIMENSIONS {
                    row[k] = 20.0 * random.random::<f64>() - 10.0;
                }
            }
            let mut all = [S::Vector::default(); 3];
            all[..S::DIMENSIONS].copy_from_slice(&rows);
            if determinant::<S>(&all) > 5.0_f64.powi(i32::try_from(S::DIMENSIONS).unwrap()) {
                return rows;
            }
        }
    }

    /// Of many lattices: all vectors up to some numbers of cells are no shorter than the reduced
    /// ones, the nearest image is the nearest of all, and waves are whole along all vectors.
    fn check_lattices<S: Space>() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..200 {
            let given = skewed::<S>(&mut random);
            let lattice = Lattice::<S>::new(&given).unwrap();
            let depth = if S::DIMENSIONS > 2 { 4 } else { 0 };
            let mut many = Vec::new();
            for m in -4..=4 {
                for n in -4..=4 {
                    many.extend((-depth..=depth).map(|l| [m, n, l]));
                }
            }
            let shortest = many.iter().filter(|&&x| x != [0; 3]).map(|&numbers| {
                S::norm_squared(&combination::<S>(&lattice.vectors, numbers)).sqrt()
            });
            let shortest = shortest.fold(f64::INFINITY, f64::min);
            assert!((lattice.shortest() - shortest).abs() < 1e-12);
            assert!((lattice.reach() - 0.5 * shortest).abs() < 1e-12);
            for a in &given {
                let coordinates = lattice.coordinates(a);
                assert!(coordinates.iter().all(|x| (x - x.round()).abs() < 1e-10));
                let along = S::dot(a, &lattice.wave_vector([3.0, -2.0, 1.0])) / (2.0 * PI);
                assert!((along - along.round()).abs() < 1e-9);
            }
            for (k, b) in lattice.reciprocal().iter().enumerate().take(S::DIMENSIONS) {
                for (j, a) in lattice.reduced_vectors().iter().enumerate() {
                    let expected = f64::from(u8::from(j == k));
                    assert!((S::dot(a, b) - expected).abs() < 1e-12);
                }
            }
            for _ in 0..20 {
                let mut x = S::Vector::default();
                for k in 0..S::DIMENSIONS {
                    x[k] = 60.0 * random.random::<f64>() - 30.0;
                }
                let (near, image) = lattice.nearest(x);
                assert!(S::norm_squared(&(x + lattice.image_vector(image) - near)) < 1e-24);
                let nearest = many.iter().map(|&numbers| {
                    S::norm_squared(&(near + combination::<S>(&lattice.vectors, numbers)))
                });
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                assert!(S::norm_squared(&near) <= nearest * (1.0 + 1e-12));
                let inside = lattice.wrap(x);
                let wrapped = lattice.in_frame(&inside);
                assert!((0..S::DIMENSIONS).all(|k| (-1e-12..1.0 + 1e-12)
                    .contains(&(wrapped[k] / lattice.lengths[k]))));
                assert!(S::norm_squared(&lattice.nearest(inside - x).0) < 1e-20);
            }
        }
    }

    #[test]
    fn lattices_are_reduced_and_nearest_images_found() {
        check_lattices::<Layer>();
        check_lattices::<Bulk>();
    }

    #[test]
    fn a_sheared_cell_is_the_lattice_of_its_vectors() {
        let cell = Cell::<Bulk>::periodic(Vector3::new(10.0, 12.0, 9.0), 3.0)
            .and_then(|cell| cell.with_cross_offset(-2.5))
            .unwrap();
        let Cell::Periodic(sheared) = cell else {
            unreachable!()
        };
        let other = Lattice::<Bulk>::new(sheared.vectors()).unwrap();
        assert!((other.content() - sheared.content()).abs() < 1e-9);
        for k in 0..200 {
            let k = f64::from(k);
            let x = Vector3::new((1.7 * k).sin(), (0.9 * k).cos(), (2.3 * k).sin()) * 30.0;
            let (first, second) = (sheared.nearest(x).0, other.nearest(x).0);
            if first.norm() < sheared.reach() {
                assert!((first - second).norm() < 1e-12);
            }
        }
        let [a, b] = [&sheared, &other].map(|lattice| {
            Matrix3::from_rows(&lattice.reciprocal().map(|b| b.transpose())).determinant()
        });
        assert!((a / b - 1.0).abs() < 1e-12);
    }

    #[test]
    fn bad_vectors_are_refused_by_name_and_number() {
        let refused = |rows: &[[f64; 3]]| {
            let rows: Vec<Vector3<f64>> = rows.iter().map(|&row| row.into()).collect();
            Lattice::<Bulk>::new(&rows).unwrap_err().to_string()
        };
        let dependent = refused(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
        assert!(
            dependent.contains("lattice") && dependent.contains("volume 0"),
            "{dependent}"
        );
        let left = refused(&[[0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert!(left.contains("left-handed, with volume -2"), "{left}");
        assert!(refused(&[[1.0, 0.0, 0.0]]).contains("1 vectors"));
        let endless = refused(&[[f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert!(endless.contains("not finite"), "{endless}");
    }

    fn extension(xx: f64, yy: f64) -> VelocityGradient<Bulk> {
        VelocityGradient::from_parts(&[xx, yy, 0.0, 0.0, 0.0], &Vector3::zeros())
    }

    #[test]
    fn shear_moves_a_sheared_cell_to_a_sheared_cell() {
        let start = Cell::<Bulk>::periodic(Vector3::new(10.0, 12.0, 9.0), 3.0).unwrap();
        let Cell::Periodic(start) = start else {
            unreachable!()
        };
        let flow = VelocityGradient::simple_shear(1.0);
        let later = start.deform(&flow, 0.3);
        assert!(later.is_sheared_cell());
        assert!((later.offset() - (3.0 + 0.3 * 12.0 - 10.0)).abs() < 1e-12);
        assert!(
            !start
                .deform(&extension(0.1, -0.1), 0.3)
                .reduce()
                .is_sheared_cell()
        );
    }
}
