//! Mobility of two spheres at the level of force, torque and stresslet, in three dimensions.
//!
//! ```text
//! 8π u_a = (1 + κ_i a_i² ∇² + κ_j a_j² ∇²) (G_ab F_b − Q_bc ∂_c G_ab q),   G_ab = (δ_ab ∇² − ∂_a ∂_b) f,   q = Q_bc ∂_c u_b
//! κ = 1/6 for F and U, 1/10 for S and E, 0 for T and Ω;   torque along k: Q_bc = −ε_kbc/2;   strains: the unit tensors
//! ```
//! With `x = r n` the separation from the source j to the sphere i, and f₁, f₂, … as in
//! [`RadialChain`]:
//!
//! ```text
//! U∥ = 2 f₁ F∥,   U⊥ = (2 f₁ + r² f₂) F⊥,   U = (r/2) l₁ n×T,   Ω = (r/2) l₁ n×F
//! Ω∥ = −(1/2) l₁ T∥,   Ω⊥ = −(1/4)(2 l₁ + r² l₂) T⊥,   l₁ = 5 f₂ + r² f₃,   l₂ = 7 f₃ + r² f₄
//! U∥ = −√6 r f₂ a,   U⊥ = −r (3 f₂ + r² f₃)/√2 σ,   Ω = −(r²/√8) l₂ n×σ;   strains from forces: the transpose
//! a = −3 (f₂ + r² f₃) a,   σ = −(1/2)(6 f₂ + 5 r² f₃ + r⁴ f₄) σ,   W = −(3 f₂ + r² f₃) W
//! ```

use super::coupling::Coupling;
use super::kernels::FiniteSize;
use super::planar::{self, RadialChain};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// 1/(8π).
const SCALE: f64 = 1.0 / (8.0 * PI);

/// The coupling from f₁ to f₄ at a distance r.
#[inline(always)]
fn coupling([f1, f2, f3, f4]: [f64; 4], distance: f64) -> Coupling {
    let square = distance * distance;
    let l1 = 5.0 * f2 + square * f3;
    let l2 = 7.0 * f3 + square * f4;
    let spin = 0.5 * SCALE * distance * l1;
    let push = [
        -6.0_f64.sqrt() * SCALE * distance * f2,
        -FRAC_1_SQRT_2 * SCALE * distance * (3.0 * f2 + square * f3),
    ];
    let twist = -0.5 * FRAC_1_SQRT_2 * SCALE * square * l2;
    Coupling {
        force_velocity: [SCALE * 2.0 * f1, SCALE * (2.0 * f1 + square * f2)],
        force_rotation: spin,
        force_strain: push,
        torque_velocity: spin,
        torque_rotation: [-0.5 * SCALE * l1, -0.25 * SCALE * (2.0 * l1 + square * l2)],
        torque_strain: twist,
        stress_velocity: push.map(|x| -x),
        stress_rotation: -twist,
        stress_strain: [
            -3.0 * SCALE * (f2 + square * f3),
            -0.5 * SCALE * (6.0 * f2 + 5.0 * square * f3 + square * square * f4),
            -SCALE * (3.0 * f2 + square * f3),
        ],
    }
}

/// The couplings of f and of ∇²f.
#[inline(always)]
pub(crate) fn couplings(chain: &RadialChain) -> [Coupling; 2] {
    let (f, square) = (&chain.derivatives, chain.square);
    let laplacian = [0, 1, 2, 3].map(|k| (5.0 + 2.0 * k as f64) * f[k + 1] + square * f[k + 2]);
    let distance = square.sqrt();
    [
        coupling([f[0], f[1], f[2], f[3]], distance),
        coupling(laplacian, distance),
    ]
}

/// `point + factor · laplacian` for the velocity modes of a sphere from the force modes of another.
#[inline(always)]
pub(crate) fn finite_size(
    [point, laplacian]: &[Coupling; 2],
    to: &FiniteSize,
    from: &FiniteSize,
) -> Coupling {
    let both = |a: [f64; 2], b: [f64; 2], factor: f64| [a[0] + factor * b[0], a[1] + factor * b[1]];
    let (p, l) = (point, laplacian);
    let strains = to.stresslet + from.stresslet;
    Coupling {
        force_velocity: both(p.force_velocity, l.force_velocity, to.force + from.force),
        force_rotation: p.force_rotation + to.force * l.force_rotation,
        force_strain: both(p.force_strain, l.force_strain, to.force + from.stresslet),
        torque_velocity: p.torque_velocity + from.force * l.torque_velocity,
        torque_rotation: p.torque_rotation,
        torque_strain: p.torque_strain + from.stresslet * l.torque_strain,
        stress_velocity: both(
            p.stress_velocity,
            l.stress_velocity,
            to.stresslet + from.force,
        ),
        stress_rotation: p.stress_rotation + to.stresslet * l.stress_rotation,
        stress_strain: [0, 1, 2].map(|k| p.stress_strain[k] + strains * l.stress_strain[k]),
    }
}

/// Velocity modes of sphere i from force modes of sphere j in unbounded fluid, for the unit vector
/// from j to i.
///
/// Signs as in [`planar::pair_mobility`], with which it agrees in the plane; radii and distance
/// in a.
#[inline(always)]
pub(crate) fn pair_mobility(distance: f64, radius_i: f64, radius_j: f64) -> Coupling {
    let couplings = couplings(&RadialChain::distance(distance * distance));
    finite_size(
        &couplings,
        &FiniteSize::new(radius_i),
        &FiniteSize::new(radius_j),
    )
}

/// Mobility of an isolated sphere: 1/(6πa), 1/(8πa³), 3/(20πa³).
pub(crate) fn self_mobility(radius: f64) -> Coupling {
    let modes = planar::self_mobility(radius);
    Coupling::isotropic(modes[0], modes[2], modes[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::Vec2;
    use nalgebra::Vector3;

    #[test]
    fn in_the_plane_the_mobility_is_that_of_the_layer() {
        let x = Vec2::new(1.3, -2.1);
        let (a, b) = (1.0, 1.4);
        let n = Vector3::new(x.x, x.y, 0.0) / x.norm();
        let found = pair_mobility(x.norm(), a, b).matrix(&n);
        let layer = planar::pair_mobility(x, a, b);
        // Modes (U_x, U_y, Ω, e1, e2, e3) among the eleven.
        let planar = [0, 1, 5, 6, 7, 8];
        for (column, &from) in planar.iter().enumerate() {
            for (row, &to) in planar.iter().enumerate() {
                let error = (found[from][to] - layer[(row, column)]).abs();
                assert!(error < 1e-15, "{row} {column}: {error:e}");
            }
        }
    }

    #[test]
    fn a_rotlet_along_the_line_of_centres_spins_by_one_over_r_cubed() {
        let found = pair_mobility(2.5, 1.0, 1.0).torque_rotation[0];
        assert!((found * 8.0 * PI * 2.5_f64.powi(3) - 1.0).abs() < 1e-14);
    }
}
