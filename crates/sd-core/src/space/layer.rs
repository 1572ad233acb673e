//! Spheres whose centres lie in one plane.

use super::Space;
use super::modes::{strain_modes, strain_tensor};
use nalgebra::{Vector2, Vector3};

/// Spheres whose centres lie in one plane of an unbounded fluid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Layer;

impl Space for Layer {
    const DIMENSIONS: usize = 2;
    const MODES: usize = 3;
    const STRAINS: usize = 3;
    const TANGENTS: usize = 1;
    /// Equal spheres have 18 at most.
    const RESERVED_NEIGHBOURS: usize = 20;
    const UPRIGHT: f64 = 0.0;
    type Vector = Vector2<f64>;
    type Point = [f64; 2];
    type Image = [i32; 2];
    type Spin = f64;
    /// Along t = (−n_y, n_x), which turns with the pair.
    type Tangent = f64;
    /// In radians.
    type Orientation = f64;
    /// `(e1, e2, e3)`, see [`crate::modes`].
    type Strain = Vector3<f64>;
    type Tensor = [f64; 3];
    type PerMode<T: Copy + Send + Sync> = [T; 3];
    type PerAnyMode<T: Copy + Send + Sync> = [T; 6];
    type PerTangent<T: Copy + Send + Sync> = [T; 1];
    type Weights = [f64; 6];
    type Block = [f64; 9];

    #[inline(always)]
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64 {
        a.dot(b)
    }

    fn point(vector: &Self::Vector) -> Self::Point {
        [vector.x, vector.y]
    }

    fn vector(&[x, y]: &Self::Point) -> Self::Vector {
        Vector2::new(x, y)
    }

    #[inline(always)]
    fn weights(i: &[f64; 3], j: &[f64; 3]) -> [f64; 6] {
        [i[0], i[1], i[2], j[0], j[1], j[2]]
    }

    #[inline(always)]
    fn join(vector: &Self::Vector, spin: &f64) -> [f64; 3] {
        [vector.x, vector.y, *spin]
    }

    #[inline(always)]
    fn translation(modes: &[f64; 3]) -> Self::Vector {
        Vector2::new(modes[0], modes[1])
    }

    #[inline(always)]
    fn rotation(modes: &[f64; 3]) -> f64 {
        modes[2]
    }

    #[inline(always)]
    fn tangents(n: &Self::Vector) -> [Self::Vector; 1] {
        [Vector2::new(-n.y, n.x)]
    }

    #[inline(always)]
    fn axis(_: &Self::Vector, _: &Self::Vector) -> f64 {
        1.0
    }

    #[inline(always)]
    fn tangent(_: &[Self::Vector; 1], &[component]: &[f64; 1]) -> f64 {
        component
    }

    #[inline(always)]
    fn along(_: &[Self::Vector; 1], tangent: &f64) -> [f64; 1] {
        [*tangent]
    }

    #[inline(always)]
    fn spin_dot(axis: &f64, spin: &f64) -> f64 {
        axis * spin
    }

    #[inline(always)]
    fn length(&[component]: &[f64; 1]) -> f64 {
        component.abs()
    }

    #[inline(always)]
    fn within(&[component]: &[f64; 1], bound: f64) -> [f64; 1] {
        [component.clamp(-bound, bound)]
    }

    #[inline(always)]
    fn tangent_dot(a: &f64, b: &f64) -> f64 {
        a * b
    }

    fn is_finite(tangent: &f64) -> bool {
        tangent.is_finite()
    }

    #[inline(always)]
    fn transported(tangent: &f64, _: &Self::Vector, _: &Self::Vector) -> f64 {
        *tangent
    }

    #[inline(always)]
    fn projected(tangent: &f64, _: &Self::Vector) -> f64 {
        *tangent
    }

    #[inline(always)]
    fn turned(orientation: &f64, rotation: &f64) -> f64 {
        orientation + rotation
    }

    fn is_orientation(orientation: &f64) -> bool {
        orientation.is_finite()
    }

    #[inline(always)]
    fn commutator(_: &f64, _: &f64) -> f64 {
        0.0
    }

    fn gradient(&[xx, yy, xy]: &[f64; 3], angular_velocity: &f64) -> [Self::Vector; 3] {
        [
            Vector2::new(xx, xy - angular_velocity),
            Vector2::new(xy + angular_velocity, yy),
            Vector2::zeros(),
        ]
    }

    #[inline(always)]
    fn rotation_of([x, y, _]: &[Self::Vector; 3]) -> f64 {
        0.5 * (y.x - x.y)
    }

    fn strain_of(&[xx, yy, _, xy, ..]: &[f64; 6]) -> Self::Strain {
        strain_modes(xx, yy, xy)
    }

    fn solve_columns([first, second, _]: &[Self::Vector; 3], x: &Self::Vector) -> Self::Vector {
        let [a, c, b, d] = [first.x, first.y, second.x, second.y];
        Vector2::new(d * x.x - b * x.y, a * x.y - c * x.x) / (a * d - b * c)
    }

    #[inline(always)]
    fn strain_dot(a: &Self::Strain, b: &Self::Strain) -> f64 {
        a.dot(b)
    }

    #[inline(always)]
    fn tensor(strain: &Self::Strain) -> [f64; 3] {
        let (xx, yy, xy) = strain_tensor(strain);
        [xx, yy, xy]
    }

    fn full_tensor(strain: &Self::Strain) -> [f64; 6] {
        let (xx, yy, xy) = strain_tensor(strain);
        [xx, yy, -(xx + yy), xy, 0.0, 0.0]
    }

    fn moment_along(n: &Self::Vector, m: f64) -> [f64; 6] {
        [m * n.x * n.x, m * n.y * n.y, 0.0, m * n.x * n.y, 0.0, 0.0]
    }

    fn moment_across(n: &Self::Vector, tangent: &f64, m: f64) -> [f64; 6] {
        let moment = m * tangent;
        let product = moment * n.x * n.y;
        let xy = 0.5 * moment * (n.x * n.x - n.y * n.y);
        [-product, product, 0.0, xy, 0.0, 0.0]
    }

    /// The layer is two mean radii thick.
    fn volume(content: f64, radii: &[f64]) -> f64 {
        2.0 * content * radii.iter().sum::<f64>() / radii.len() as f64
    }
}
