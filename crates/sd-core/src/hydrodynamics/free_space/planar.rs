//! Mobility of two spheres in unbounded fluid, to the level of force, torque and stresslet.
//!
//! ```text
//! 8π u_a = (1 + κ_i a_i² ∇² + κ_j a_j² ∇²) (G_ab F_b − Q_bc ∂_c G_ab q),   G_ab = (δ_ab ∇² − ∂_a ∂_b) f,   f = r
//! κ = 1/6 for F and U, 1/10 for s and e, 0 for T and Ω
//! Q = s1: diag(1, −1)/√2,  s2: offdiag(1)/√2,  s3: √(3/2) I,  torque: Q_xy = −1/2, Q_yx = +1/2
//! ```
//! and the same Q read strain and angular velocity off the gradient, `q = Q_bc ∂_c u_b`.

use super::kernels::{self, FiniteSize, LANES, Lanes, RADIAL};
use crate::space::modes::{ModeBlock, Modes, Vec2};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// `(1/r d/dr)ᵏ f` for k = 1..6 of a radial function f.
///
/// ```text
/// f₁ = f'/r,   ∂_a f = x_a f₁,   ∂_a ∂_b f = δ_ab f₁ + x_a x_b f₂,   …;   (∇²f)ₖ = (3 + 2k) fₖ₊₁ + r² fₖ₊₂
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RadialChain {
    /// f₁ to f₆.
    pub(crate) derivatives: [f64; 6],
    /// r².
    pub(crate) square: f64,
}

impl RadialChain {
    /// f = r.
    pub(crate) fn distance(square: f64) -> Self {
        let inverse = 1.0 / square;
        let mut derivatives = [square.sqrt().recip(); 6];
        for k in 1..6 {
            derivatives[k] = (1.0 - 2.0 * k as f64) * inverse * derivatives[k - 1];
        }
        Self {
            derivatives,
            square,
        }
    }

    /// The twelve radial functions of f, each divided by rᵐ, and of ∇²f.
    pub(crate) fn radial_functions(&self) -> ([f64; RADIAL], [f64; RADIAL]) {
        let f = &self.derivatives;
        let laplacian =
            [0, 1, 2, 3].map(|k| (5.0 + 2.0 * k as f64) * f[k + 1] + self.square * f[k + 2]);
        (
            radial([f[0], f[1], f[2], f[3]], self.square),
            radial(laplacian, self.square),
        )
    }
}

/// The radial functions from f₁..f₄, in the order of [`kernels`].
#[rustfmt::skip]
fn radial([f1, f2, f3, f4]: [f64; 4], square: f64) -> [f64; RADIAL] {
    let l1 = 5.0 * f2 + square * f3;
    let l2 = 7.0 * f3 + square * f4;
    [
        -0.5 * f2,                                      // UU, m = 2
        0.5 * FRAC_1_SQRT_2 * l2,                       // EΩ, m = 2
        -0.75_f64.sqrt() * f3,                          // E3 E, m = 2
        0.25 * f4,                                      // EE, m = 4
        0.5 * l1,                                       // UΩ, m = 1
        -1.5_f64.sqrt() * f2,                           // U s3, m = 1
        -FRAC_1_SQRT_2 * (3.0 * f2 + 0.5 * square * f3), // US, m = 1
        0.5 * FRAC_1_SQRT_2 * f3,                       // US, m = 3
        2.0 * f1 + 0.5 * square * f2,                   // UU
        -0.25 * (2.0 * l1 + square * l2),               // ΩΩ
        -1.5 * (2.0 * f2 + square * f3),                // E3 E3
        -3.0 * f2 - 2.5 * square * f3 - 0.25 * square * square * f4, // EE
    ]
}

/// Lanes of a separation from radial functions.
pub(crate) fn lanes(radial: &[f64; RADIAL], separation: Vec2) -> Lanes {
    let (re, im) = kernels::harmonics(separation);
    let mut lanes = [0.0; LANES];
    for k in 0..8 {
        lanes[k] = radial[k] * re[k];
        lanes[k + 8] = radial[k] * im[k];
    }
    lanes[16..].copy_from_slice(&radial[8..]);
    lanes
}

/// Velocity modes of sphere i from force modes of sphere j.
///
/// ```text
/// (U_x, U_y, Ω, e1, e2, e3) of i  =  M_ij (F_x, F_y, T, s1, s2, s3) of j
/// ```
/// F and T are external, s is the moment S~ that sphere j exerts on the fluid, and e is the strain
/// of the disturbance at i. With the self terms, M maps (F, T, S~) to (U − u∞, Ω − Ω∞, −E∞),
/// because an isolated sphere in strain E exerts S~ = −(20/3) π a³ E.
///
/// # Arguments
/// - `separation`: `x_i − x_j`, in a; from j, the source, to i.
/// - `radius_i`, `radius_j`: in a.
///
/// # Returns
/// `[6 × 6]` in 1/(mu a), 1/(mu a²), 1/(mu a³); `pair_mobility(−x, a_j, a_i)` is its transpose; → 0
/// as r → ∞.
///
/// # Accuracy
/// Rounding. The truncated multipoles themselves leave 1e-4 (forces) and 2e-3 (strains) at s' = 3.9
/// of equal spheres, test `agrees_with_exact_pairs_at_distance`.
///
/// # Source
/// Durlofsky, Brady & Bossis 1987, reduced to the planar modes.
pub(crate) fn pair_mobility(separation: Vec2, radius_i: f64, radius_j: f64) -> ModeBlock {
    let (i, j) = (FiniteSize::new(radius_i), FiniteSize::new(radius_j));
    let [ij, ji] = pair_lanes(separation, &i, &j);
    kernels::blocks(&ij, &ji).to_modes()
}

/// Lanes of pair (i, j) and of pair (j, i) at separation `x_i − x_j`.
pub(crate) fn pair_lanes(separation: Vec2, i: &FiniteSize, j: &FiniteSize) -> [Lanes; 2] {
    let (point, laplacian) = RadialChain::distance(separation.norm_squared()).radial_functions();
    let (point, laplacian) = (lanes(&point, separation), lanes(&laplacian, separation));
    [i.factors(j), j.factors(i)].map(|factors| {
        kernels::finite_size(&point, &laplacian, &factors).map(|value| value / (8.0 * PI))
    })
}

/// Diagonal of the mobility of an isolated sphere: 1/(6πa) twice, 1/(8πa³), and 3/(20πa³) three
/// times.
///
/// Signs as in [`pair_mobility`]; `radius` in a.
pub(crate) fn self_mobility(radius: f64) -> Modes {
    let cube = radius.powi(3);
    let (translation, rotation, strain) = (
        1.0 / (6.0 * PI * radius),
        1.0 / (8.0 * PI * cube),
        3.0 / (20.0 * PI * cube),
    );
    Modes::new(translation, translation, rotation, strain, strain, strain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::{rotation_to_frame, strain_modes};
    use nalgebra::{SMatrix, SVector, Vector3};

    /// Mobility of two spheres at the origin and at (r, 0).
    fn pair(distance: f64, radii: [f64; 2]) -> SMatrix<f64, 12, 12> {
        let mut m = SMatrix::<f64, 12, 12>::zeros();
        let x = Vec2::new(distance, 0.0);
        for (i, radius) in radii.into_iter().enumerate() {
            for (k, value) in self_mobility(radius).iter().enumerate() {
                m[(6 * i + k, 6 * i + k)] = *value;
            }
        }
        m.fixed_view_mut::<6, 6>(0, 6)
            .copy_from(&pair_mobility(-x, radii[0], radii[1]));
        m.fixed_view_mut::<6, 6>(6, 0)
            .copy_from(&pair_mobility(x, radii[1], radii[0]));
        m
    }

    /// Velocities of two freely straining spheres under forces.
    fn velocities(
        m: &SMatrix<f64, 12, 12>,
        forces: [Vec2; 2],
        strain: Vector3<f64>,
    ) -> [Vector3<f64>; 2] {
        // R (v, −E) = (F, 0, S~) with v unknown.
        let r = m.try_inverse().unwrap();
        let velocity = [0, 1, 2, 6, 7, 8];
        let known = SVector::<f64, 6>::from_fn(|k, _| {
            let row = velocity[k];
            let force = forces[k / 3];
            let external = [force.x, force.y, 0.0][k % 3];
            let mut sum = external;
            for sphere in 0..2 {
                for s in 0..3 {
                    sum += r[(row, 6 * sphere + 3 + s)] * strain[s];
                }
            }
            sum
        });
        let ff = SMatrix::<f64, 6, 6>::from_fn(|i, j| r[(velocity[i], velocity[j])]);
        let v = ff.try_inverse().unwrap() * known;
        [v.fixed_rows::<3>(0).into(), v.fixed_rows::<3>(3).into()]
    }

    #[test]
    fn agrees_with_exact_pairs_at_distance() {
        let text = include_str!("../../../tests/data/two_sphere_exact.json");
        let data: serde_json::Value = serde_json::from_str(text).unwrap();
        let vector =
            |v: &serde_json::Value| Vec2::new(v[0].as_f64().unwrap(), v[1].as_f64().unwrap());
        let mut compared = 0;
        for case in data["cases"].as_array().unwrap() {
            if case["s_prime"].as_f64().unwrap() < 3.0 {
                continue;
            }
            let radii = [0, 1].map(|k| case["radii"][k].as_f64().unwrap());
            let m = pair(case["separation"].as_f64().unwrap(), radii);
            let e = ["xx", "yy", "xy"].map(|k| case["rate_of_strain"][k].as_f64().unwrap());
            let forces = [0, 1].map(|k| vector(&case["forces"][k]));
            let found = velocities(&m, forces, strain_modes(e[0], e[1], e[2]));
            for (k, v) in found.iter().enumerate() {
                let u = vector(&case["velocity_disturbance"][k]);
                let omega = case["angular_velocity_disturbance"][k].as_f64().unwrap();
                // The first neglected multipoles: 2e-3 in a unit strain; under a force 5e-3 of the
                // smaller sphere's own mobility, 2e-2 where that sphere is close to a much larger
                // one.
                let smaller = radii[0].min(radii[1]);
                let limit = if case["case"].as_str().unwrap().starts_with('E') {
                    3e-3 / smaller
                } else {
                    (if smaller < 1.0 { 2e-2 } else { 5e-3 }) * self_mobility(smaller)[0]
                };
                let error = (v.xy() - u).norm().max((v.z - omega).abs());
                assert!(error < limit, "{case} {k} {v}");
            }
            compared += 1;
        }
        assert!(compared >= 6);
    }

    #[test]
    fn mobility_is_symmetric_and_positive_definite() {
        for radii in [[1.0, 1.0], [1.0, 0.3], [0.2, 1.7]] {
            for s in [2.0, 2.3, 5.0] {
                let m = pair(0.5 * s * (radii[0] + radii[1]), radii);
                assert!((m - m.transpose()).abs().max() < 1e-15);
                assert!(m.symmetric_eigenvalues().min() > 0.0, "{radii:?} {s}");
            }
        }
    }

    #[test]
    fn turning_the_pair_turns_the_block() {
        let n = Vec2::new(0.6, -0.8);
        let q = rotation_to_frame(n);
        let along = pair_mobility(Vec2::new(2.7, 0.0), 1.0, 0.6);
        let turned = pair_mobility(2.7 * n, 1.0, 0.6);
        assert!((q.transpose() * along * q - turned).abs().max() < 1e-15);
    }

    #[test]
    fn point_torque_and_force_flow_as_in_textbooks() {
        // Rotlet T × x/(8π r³), and Stokeslet with its finite-size term, at distance 3 along x.
        let m = pair_mobility(Vec2::new(3.0, 0.0), 1.0, 1.0);
        assert!((m[(1, 2)] - 1.0 / (8.0 * PI * 9.0)).abs() < 1e-16);
        assert!((m[(0, 0)] - (2.0 / 3.0 - 4.0 / 81.0) / (8.0 * PI)).abs() < 1e-16);
        assert!((m[(1, 1)] - (1.0 / 3.0 + 2.0 / 81.0) / (8.0 * PI)).abs() < 1e-16);
    }

    /// The velocity of a point force, for derivatives by differences.
    fn stokeslet(x: Vec2, force: Vec2) -> Vec2 {
        let r = x.norm();
        (force / r + x * (x.dot(&force) / r.powi(3))) / (8.0 * PI)
    }

    #[test]
    fn point_blocks_are_derivatives_of_the_stokeslet() {
        let q3 = 1.5_f64.sqrt();
        let dipoles = [
            [[0.0, -0.5], [0.5, 0.0]],
            [[FRAC_1_SQRT_2, 0.0], [0.0, -FRAC_1_SQRT_2]],
            [[0.0, FRAC_1_SQRT_2], [FRAC_1_SQRT_2, 0.0]],
            [[q3, 0.0], [0.0, q3]],
        ];
        let units = [Vec2::x(), Vec2::y()];
        let step = 1e-3;
        // Velocity of source k at x: forces or dipoles by central differences.
        let velocity = |x: Vec2, k: usize| -> Vec2 {
            if k < 2 {
                return stokeslet(x, units[k]);
            }
            let mut u = Vec2::zeros();
            for b in 0..2 {
                for c in 0..2 {
                    let d = stokeslet(x + step * units[c], units[b])
                        - stokeslet(x - step * units[c], units[b]);
                    u -= dipoles[k - 2][b][c] * d / (2.0 * step);
                }
            }
            u
        };
        let x = Vec2::new(1.7, 0.9);
        let m = pair_mobility(x, 1e-9, 1e-9);
        for column in 0..6 {
            for row in 0..6 {
                let expected = if row < 2 {
                    velocity(x, column)[row]
                } else {
                    let mut sum = 0.0;
                    for b in 0..2 {
                        for c in 0..2 {
                            let d = velocity(x + step * units[c], column)
                                - velocity(x - step * units[c], column);
                            sum += dipoles[row - 2][b][c] * d[b] / (2.0 * step);
                        }
                    }
                    sum
                };
                assert!(
                    (m[(row, column)] - expected).abs() < 1e-6,
                    "({row}, {column}): {} {expected}",
                    m[(row, column)]
                );
            }
        }
    }
}
