//! What differs between a layer and a suspension, and the geometry that is written once for both.

pub mod cell;
pub(crate) mod neighbours;

use nalgebra::{Vector2, Vector3};
use std::fmt::Debug;
use std::ops::{Add, Div, Index, IndexMut, Mul, Sub};

/// A layer or a suspension.
pub trait Space: Copy + Debug + PartialEq + 'static {
    /// Number of coordinates.
    const DIMENSIONS: usize;
    /// Positions, velocities, forces.
    type Vector: Copy
        + Debug
        + PartialEq
        + Default
        + Add<Output = Self::Vector>
        + Sub<Output = Self::Vector>
        + Mul<f64, Output = Self::Vector>
        + Div<f64, Output = Self::Vector>
        + Index<usize, Output = f64>
        + IndexMut<usize>;

    /// Square of a vector's length.
    fn norm_squared(vector: &Self::Vector) -> f64;
}

/// Spheres whose centres lie in one plane of an unbounded fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer;

/// Spheres that fill a fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bulk;

impl Space for Layer {
    const DIMENSIONS: usize = 2;
    type Vector = Vector2<f64>;

    #[inline(always)]
    fn norm_squared(vector: &Self::Vector) -> f64 {
        vector.norm_squared()
    }
}

impl Space for Bulk {
    const DIMENSIONS: usize = 3;
    type Vector = Vector3<f64>;

    #[inline(always)]
    fn norm_squared(vector: &Self::Vector) -> f64 {
        vector.norm_squared()
    }
}
