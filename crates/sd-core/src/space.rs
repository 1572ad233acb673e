//! What differs between a layer and a suspension, and the geometry that is written once for both.

pub mod cell;
pub mod modes;
pub(crate) mod neighbours;
pub(crate) mod pair;
mod verlet;

use nalgebra::{Vector2, Vector3};
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Sub, SubAssign};

/// A layer or a suspension.
pub trait Space: Copy + Debug + PartialEq + 'static {
    /// Number of coordinates.
    const DIMENSIONS: usize;
    /// Neighbours of a sphere within the lubrication range that room is made for.
    const MOST_NEIGHBOURS: usize;
    /// Positions, velocities, forces.
    type Vector: Copy
        + Debug
        + PartialEq
        + Default
        + Add<Output = Self::Vector>
        + AddAssign
        + Sub<Output = Self::Vector>
        + SubAssign
        + Mul<f64, Output = Self::Vector>
        + Div<f64, Output = Self::Vector>
        + Index<usize, Output = f64>
        + IndexMut<usize>;
    /// An image of the cell, by the number of cells along each axis.
    type Image: Copy + Debug + PartialEq + Default + Index<usize, Output = i32> + IndexMut<usize>;

    /// Scalar product.
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64;

    /// Square of a vector's length.
    #[inline(always)]
    fn norm_squared(vector: &Self::Vector) -> f64 {
        Self::dot(vector, vector)
    }
}

/// Spheres whose centres lie in one plane of an unbounded fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer;

/// Spheres that fill a fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bulk;

impl Space for Layer {
    const DIMENSIONS: usize = 2;
    /// Equal spheres have 18 at most.
    const MOST_NEIGHBOURS: usize = 20;
    type Vector = Vector2<f64>;
    type Image = [i32; 2];

    #[inline(always)]
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64 {
        a.dot(b)
    }
}

impl Space for Bulk {
    const DIMENSIONS: usize = 3;
    /// Equal spheres on a face-centred lattice have 42 before the next shell comes in.
    const MOST_NEIGHBOURS: usize = 54;
    type Vector = Vector3<f64>;
    type Image = [i32; 3];

    #[inline(always)]
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64 {
        a.dot(b)
    }
}
