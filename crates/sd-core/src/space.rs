//! Differences between layers and suspensions, and their common geometry.

pub mod bulk;
pub mod cell;
pub(crate) mod flow;
pub(crate) mod incident;
pub(crate) mod lattice;
mod layer;
pub mod modes;
pub(crate) mod neighbours;
pub(crate) mod pair;
mod verlet;

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Neg, Sub, SubAssign};

pub use bulk::Bulk;
pub use flow::VelocityGradient;
pub use incident::{IncidentFlow, LocalFlow, Strains};
pub use layer::Layer;

/// A vector in the space or in the tangent plane of a contact, or a number where that is a line.
pub trait Linear:
    Copy
    + Send
    + Sync
    + Debug
    + PartialEq
    + Default
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + 'static
{
}

impl<T> Linear for T where
    T: Copy
        + Send
        + Sync
        + Debug
        + PartialEq
        + Default
        + Add<Output = Self>
        + AddAssign
        + Sub<Output = Self>
        + SubAssign
        + Neg<Output = Self>
        + Mul<f64, Output = Self>
        + Div<f64, Output = Self>
        + 'static
{
}

/// An array `[T; N]` whose N depends on the space.
pub trait FixedArray<T>:
    Copy + Send + Sync + AsRef<[T]> + AsMut<[T]> + Index<usize, Output = T> + IndexMut<usize>
{
    /// The value N times.
    fn each(value: T) -> Self;

    /// Splits a list into arrays.
    fn chunks(list: &[T]) -> &[Self];

    /// Splits a mutable list into arrays.
    fn chunks_mut(list: &mut [T]) -> &mut [Self];

    /// The elements of arrays, one after another.
    fn flat(arrays: &[Self]) -> &[T];

    /// The elements of mutable arrays, one after another.
    fn flat_mut(arrays: &mut [Self]) -> &mut [T];
}

impl<T: Copy + Send + Sync, const N: usize> FixedArray<T> for [T; N] {
    #[inline(always)]
    fn each(value: T) -> Self {
        [value; N]
    }

    #[inline(always)]
    fn chunks(list: &[T]) -> &[Self] {
        list.as_chunks().0
    }

    #[inline(always)]
    fn chunks_mut(list: &mut [T]) -> &mut [Self] {
        list.as_chunks_mut().0
    }

    #[inline(always)]
    fn flat(arrays: &[Self]) -> &[T] {
        arrays.as_flattened()
    }

    #[inline(always)]
    fn flat_mut(arrays: &mut [Self]) -> &mut [T] {
        arrays.as_flattened_mut()
    }
}

mod sealed {
    /// A space of this crate.
    pub trait Sealed {}
    impl Sealed for super::Layer {}
    impl Sealed for super::Bulk {}
}

/// A layer or a suspension.
///
/// A sphere has [`Space::MODES`] velocities `(U, Ω)`, with as many forces and torques, and
/// [`Space::STRAINS`] components of its strain and stresslet. Slip and friction of a contact have
/// [`Space::TANGENTS`] components.
///
/// Its vectors, spins, tangents and strains are added, subtracted and negated as numbers are, and
/// multiplied and divided by numbers. Points, tensors, weights, blocks and all types that begin
/// with `Per` are arrays, which can be indexed and used as slices.
///
/// No other type can be one, so that new methods break no program.
pub trait Space:
    sealed::Sealed + Copy + Debug + Default + PartialEq + Send + Sync + 'static
{
    /// Number of coordinates.
    const DIMENSIONS: usize;
    /// Velocities of a sphere, the translations first.
    const MODES: usize;
    /// Components of a strain.
    const STRAINS: usize;
    /// Velocities and strains of a sphere.
    const ALL_MODES: usize = Self::MODES + Self::STRAINS;
    /// Components of slip.
    const TANGENTS: usize;
    /// Reserved number of neighbours of a sphere within the lubrication range.
    const RESERVED_NEIGHBOURS: usize;
    /// Orientation at strain 0.
    const UPRIGHT: Self::Orientation;
    /// Positions, velocities, forces.
    type Vector: Linear + Index<usize, Output = f64> + IndexMut<usize>;
    /// The form of a vector in snapshots.
    type Point: FixedArray<f64> + Debug + PartialEq + Default + Serialize + DeserializeOwned;
    /// An image of the cell, by the number of cells along each axis.
    type Image: Copy
        + Send
        + Sync
        + Debug
        + PartialEq
        + Default
        + Index<usize, Output = i32>
        + IndexMut<usize>
        + Serialize
        + DeserializeOwned;
    /// Angular velocities, torques.
    type Spin: Linear + Serialize + DeserializeOwned;
    /// Slip, friction: vectors perpendicular to the line of centres.
    type Tangent: Linear + Serialize + DeserializeOwned;
    /// Orientation.
    type Orientation: Copy
        + Send
        + Sync
        + Debug
        + Default
        + PartialEq
        + Serialize
        + DeserializeOwned;
    /// Strains and stresslets.
    type Strain: Linear + Index<usize, Output = f64> + IndexMut<usize>;
    /// A traceless tensor, see [`Space::tensor`].
    type Tensor: FixedArray<f64> + Debug + PartialEq + Default + Serialize + DeserializeOwned;
    /// A value per velocity of a sphere.
    type PerMode<T: Copy + Send + Sync>: FixedArray<T>;
    /// A value per velocity and strain of a sphere, `(U, Ω, e)`.
    type PerAnyMode<T: Copy + Send + Sync>: FixedArray<T>;
    /// A value per component of a slip.
    type PerTangent<T: Copy + Send + Sync>: FixedArray<T>;
    /// Weights of the velocities of two spheres.
    type Weights: FixedArray<f64> + Debug + PartialEq;
    /// Forces and torques of a sphere from velocities of one, by columns.
    type Block: FixedArray<f64> + Debug + PartialEq;

    /// Scalar product.
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64;

    /// Square of a vector's length.
    #[inline(always)]
    fn norm_squared(vector: &Self::Vector) -> f64 {
        Self::dot(vector, vector)
    }

    /// The form of a vector in snapshots.
    fn point(vector: &Self::Vector) -> Self::Point;

    /// Converts a vector from the form of snapshots.
    fn vector(point: &Self::Point) -> Self::Vector;

    /// The value, once for each velocity of a sphere.
    #[inline(always)]
    fn each<T: Copy + Send + Sync>(value: T) -> Self::PerMode<T> {
        FixedArray::each(value)
    }

    /// Splits a list of the velocities of all spheres by sphere.
    #[inline(always)]
    fn by_sphere<T: Copy + Send + Sync>(list: &[T]) -> &[Self::PerMode<T>] {
        FixedArray::chunks(list)
    }

    /// Splits a mutable list of the velocities of all spheres by sphere.
    #[inline(always)]
    fn by_sphere_mut<T: Copy + Send + Sync>(list: &mut [T]) -> &mut [Self::PerMode<T>] {
        FixedArray::chunks_mut(list)
    }

    /// Splits a list of all modes of all spheres by sphere.
    #[inline(always)]
    fn all_modes(list: &[f64]) -> &[Self::PerAnyMode<f64>] {
        FixedArray::chunks(list)
    }

    /// Splits a mutable list of all modes of all spheres by sphere.
    #[inline(always)]
    fn all_modes_mut(list: &mut [f64]) -> &mut [Self::PerAnyMode<f64>] {
        FixedArray::chunks_mut(list)
    }

    /// Weights of the velocities of i, then of j.
    fn weights(of_i: &Self::PerMode<f64>, of_j: &Self::PerMode<f64>) -> Self::Weights;

    /// Velocity and angular velocity of a sphere, or force and torque.
    fn join(vector: &Self::Vector, spin: &Self::Spin) -> Self::PerMode<f64>;

    /// The vector part of the result of [`Space::join`].
    fn translation(modes: &Self::PerMode<f64>) -> Self::Vector;

    /// The angular velocity or torque in the result of [`Space::join`].
    fn rotation(modes: &Self::PerMode<f64>) -> Self::Spin;

    /// Orthonormal directions perpendicular to the line of centres.
    fn tangents(normal: &Self::Vector) -> Self::PerTangent<Self::Vector>;

    /// The axis `n × d` about which surfaces roll along d.
    fn axis(normal: &Self::Vector, direction: &Self::Vector) -> Self::Spin;

    /// The vector with these components along directions.
    fn tangent(
        directions: &Self::PerTangent<Self::Vector>,
        components: &Self::PerTangent<f64>,
    ) -> Self::Tangent;

    /// The components of a vector along directions.
    fn along(
        directions: &Self::PerTangent<Self::Vector>,
        tangent: &Self::Tangent,
    ) -> Self::PerTangent<f64>;

    /// Scalar product of an axis and an angular velocity.
    fn spin_dot(axis: &Self::Spin, spin: &Self::Spin) -> f64;

    /// Length of a vector by its components along directions.
    fn length(components: &Self::PerTangent<f64>) -> f64;

    /// The nearest vector whose length is within a bound, 0 or more, by components along
    /// directions.
    fn within(components: &Self::PerTangent<f64>, bound: f64) -> Self::PerTangent<f64>;

    /// The value, once for each component of a slip.
    #[inline(always)]
    fn each_tangent<T: Copy + Send + Sync>(value: T) -> Self::PerTangent<T> {
        FixedArray::each(value)
    }

    /// The components of a list of slips, one after another.
    fn components(slips: &[Self::PerTangent<f64>]) -> &[f64] {
        FixedArray::flat(slips)
    }

    /// The components of a mutable list of slips, one after another.
    fn components_mut(slips: &mut [Self::PerTangent<f64>]) -> &mut [f64] {
        FixedArray::flat_mut(slips)
    }

    /// Scalar product of vectors perpendicular to the line of centres.
    fn tangent_dot(a: &Self::Tangent, b: &Self::Tangent) -> f64;

    /// Whether all numbers of a vector are finite.
    fn is_finite(tangent: &Self::Tangent) -> bool;

    /// A vector perpendicular to the line of centres n, transported to the new one.
    fn transported(
        tangent: &Self::Tangent,
        from: &Self::Vector,
        to: &Self::Vector,
    ) -> Self::Tangent;

    /// A vector projected to a slightly rotated tangent plane, with its length preserved.
    fn projected(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Tangent;

    /// Orientation after a rotation by a vector.
    fn turned(orientation: &Self::Orientation, rotation: &Self::Spin) -> Self::Orientation;

    /// Whether an orientation is finite and normalized.
    fn is_orientation(orientation: &Self::Orientation) -> bool;

    /// `ω₁ × ω₀`, the difference between successive rotations and their sum.
    fn commutator(second: &Self::Spin, first: &Self::Spin) -> Self::Spin;

    /// Rows of the velocity gradient of a rate of strain and an angular velocity.
    fn gradient(rate_of_strain: &Self::Tensor, angular_velocity: &Self::Spin) -> [Self::Vector; 3];

    /// Angular velocity of a velocity gradient, by rows.
    fn rotation_of(gradient: &[Self::Vector; 3]) -> Self::Spin;

    /// Components of a symmetric traceless tensor: xx, yy, zz, xy, xz, yz.
    fn strain_of(tensor: &[f64; 6]) -> Self::Strain;

    /// The vector whose product with the matrix of these columns is x.
    fn solve_columns(columns: &[Self::Vector; 3], x: &Self::Vector) -> Self::Vector;

    /// Scalar product of strains and stresslets.
    fn strain_dot(a: &Self::Strain, b: &Self::Strain) -> f64;

    /// The tensor of components: xx, yy, xy and in a suspension xz, yz; zz makes the trace zero.
    fn tensor(strain: &Self::Strain) -> Self::Tensor;

    /// xx, yy, zz, xy, xz and yz of the tensor of components.
    fn full_tensor(strain: &Self::Strain) -> [f64; 6];

    /// xx, yy, zz, xy, xz and yz of `m n n`.
    fn moment_along(normal: &Self::Vector, m: f64) -> [f64; 6];

    /// x·T·x of a tensor as [`Space::full_tensor`] gives it.
    fn tensor_along(tensor: &[f64; 6], x: &Self::Vector) -> f64 {
        let products = tensor.iter().zip(Self::moment_along(x, 1.0)).enumerate();
        let terms = products.map(|(k, (t, xx))| if k < 3 { t * xx } else { 2.0 * t * xx });
        terms.sum()
    }

    /// xx, yy, zz, xy, xz and yz of `m (t n + n t)/2`.
    fn moment_across(normal: &Self::Vector, tangent: &Self::Tangent, m: f64) -> [f64; 6];

    /// The volume that stresses are means over, of a cell of this area or volume.
    fn volume(content: f64, radii: &[f64]) -> f64;
}
