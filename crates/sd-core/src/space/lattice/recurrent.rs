//! Lattices that a flow returns to themselves, or close to it, again and again, so that their
//! shortest vector has a lower bound for ever.
//!
//! ```text
//! x = Σ_k c_k e_k,   L e_k = λ_k e_k:      c_k(t) = c_k exp(λ_k t)
//! ```
//! The vectors of the lattice have the integers of a number field as coordinates c_k, one of its
//! embeddings along each eigenvector. Their product, the norm, does not change with time and is at
//! least that of a unit; units map the lattice to itself.
//!
//! **Planar flows.** Two eigenvectors at an angle θ, λ and −λ, and a quadratic field:
//!
//! ```text
//! (1, 1), (−α, 1/β),   α = p + 1/β,  β = q + 1/α:     c₁ c₂ ≥ A'/(p + 2/β)  or  ≤ −A'/(q + 2/α),   A' = A/sin θ
//! |x|² ≥ 2 |c₁ c₂| (1 ± cos θ),      unit s = αβ:  s² − (2 + p q) s + 1 = 0
//! ```
//! (p, q are the period of the continued fraction of α, whose convergents have the smallest norms.)
//! For pure extension, θ = 90° and p = q = 1: the square lattice at 31.7175° to the axes of Kraynik
//! & Reinelt (Int. J. Multiphase Flow 18, 1045, 1992), its shortest vector above 0.9457 √A, and
//! periodic in a Hencky strain of ln s = 0.96242. In a mixture the one of p and q is 1, the other
//! chosen so that the bound is largest. In a suspension the third vector is as long as the bound.
//!
//! **Flows along the axes of space.** `(1, 1, 1), (t₁, t₂, t₃), (t₁², t₂², t₃²)`, t_i =
//! 2 cos(2πi/7): |x y z| ≥ V/7 and a shortest vector of at least 0.9054 V^(1/3). The t_i and their
//! conjugates are units.

use super::{Lattice, reduced};
use crate::model::FlowType;
use crate::space::Space;
use std::f64::consts::PI;

/// Largest period of a continued fraction that is tried.
const MOST: u32 = 1_000_000;

/// A lattice whose shortest vector is shortest at strain 0, and in a flow never shorter.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RecurrentLattice<S: Space> {
    /// Eigenvectors of the flow; the third one is zero in a layer.
    axes: [S::Vector; 3],
    /// Their eigenvalues at rate 1.
    rates: [f64; 3],
    /// Coordinates of the lattice vectors at strain 0.
    coordinates: [[f64; 3]; 3],
    /// Logarithms of units whose embeddings are all positive, by eigenvector: multiplied by such a
    /// unit the lattice is the same.
    units: [[f64; 3]; 2],
}

impl<S: Space> RecurrentLattice<S> {
    /// The lattice of an area or volume for a flow that is no simple shear.
    pub(crate) fn new(flow: FlowType, content: f64) -> Self {
        match flow {
            FlowType::Uniaxial => Self::cubic(content, [1.0, -0.5, -0.5]),
            FlowType::Biaxial => Self::cubic(content, [0.5, 0.5, -1.0]),
            FlowType::Mixture(ratio) => {
                let shear = (2.0 * ratio).hypot(1.0).recip();
                Self::planar(content, shear, ratio * shear)
            }
            FlowType::Shear | FlowType::PlanarExtension => Self::planar(content, 0.0, 0.5),
        }
    }

    /// For shear and planar extension at these rates.
    fn planar(content: f64, shear: f64, extension: f64) -> Self {
        let length = shear.hypot(2.0 * extension);
        let [cos, sin] = [-shear / length, 2.0 * extension / length];
        let (mut best, mut chosen) = (0.0, [1.0, 1.0]);
        for q in 1..=MOST {
            let [alpha, beta] = fraction(1.0, f64::from(q));
            let same = (1.0 + cos) / (1.0 + 2.0 / beta);
            let opposite = (1.0 - cos) / (f64::from(q) + 2.0 / alpha);
            if same.min(opposite) <= best {
                break;
            }
            best = same.min(opposite);
            // The phase at which the vector with this norm is shortest.
            let phase = if same <= opposite {
                1.0
            } else {
                (alpha * beta).sqrt().recip()
            };
            chosen = [f64::from(q), phase];
        }
        let [q, phase] = chosen;
        let [alpha, beta] = fraction(1.0, q);
        // Shortest vector and side of a square of the same area.
        let bound = (2.0 * best / sin).sqrt();
        let side = if S::DIMENSIONS < 3 {
            content.sqrt()
        } else {
            (content / bound).cbrt()
        };
        let scale = side / ((alpha + beta.recip()) * sin).sqrt();
        let mut axes = [S::Vector::default(); 3];
        axes[0][0] = 1.0;
        (axes[1][0], axes[1][1]) = (cos, sin);
        if S::DIMENSIONS > 2 {
            axes[2][2] = 1.0;
        }
        let unit = (alpha * beta).ln();
        Self {
            axes,
            rates: [extension, -extension, 0.0],
            coordinates: [
                [scale * phase, scale / phase, 0.0],
                [-scale * alpha * phase, scale / (beta * phase), 0.0],
                [0.0, 0.0, bound * side],
            ],
            units: [[unit, -unit, 0.0], [0.0; 3]],
        }
    }

    /// For flows along the axes of space with these ratios of the rates.
    fn cubic(content: f64, ratios: [f64; 3]) -> Self {
        let roots = [1.0, 2.0, 3.0].map(|i| 2.0 * (2.0 * PI * i / 7.0).cos());
        // The volume of the integers is 7.
        let scale = (content / 7.0).cbrt();
        let mut axes = [S::Vector::default(); 3];
        for (k, axis) in axes.iter_mut().enumerate().take(S::DIMENSIONS) {
            axis[k] = 1.0;
        }
        let square: f64 = ratios.iter().map(|ratio| ratio * ratio).sum();
        let rate = (2.0 * square).sqrt();
        let [a, b, c] = roots.map(|root: f64| 2.0 * root.abs().ln());
        Self {
            axes,
            rates: ratios.map(|ratio| ratio / rate),
            coordinates: [
                [scale; 3],
                roots.map(|root| scale * root * root),
                roots.map(|root| scale * root),
            ],
            units: [[a, b, c], [b, c, a]],
        }
    }

    /// The lattice after a net strain in the flow.
    pub(crate) fn at(&self, strain: f64) -> Lattice<S> {
        let [mut x, mut y, mut z] = self.rates.map(|rate| rate * strain);
        // Whole powers of units, so that coordinates stay near those at strain 0. Rounding would
        // otherwise turn it into a lattice that does not recur.
        let [first, second] = self.units;
        let determinant = first[0] * second[1] - first[1] * second[0];
        let powers = if determinant == 0.0 {
            [x / first[0], 0.0]
        } else {
            [
                (x * second[1] - y * second[0]) / determinant,
                (first[0] * y - first[1] * x) / determinant,
            ]
        };
        for (power, unit) in powers.into_iter().zip([first, second]) {
            let power = power.round();
            x -= power * unit[0];
            y -= power * unit[1];
            z -= power * unit[2];
        }
        let growth = [x, y, z].map(f64::exp);
        let rows = self.coordinates.map(|of_row| {
            let mut row = S::Vector::default();
            for k in 0..S::DIMENSIONS {
                row += self.axes[k] * (of_row[k] * growth[k]);
            }
            row
        });
        let mut vectors = [S::Vector::default(); 3];
        vectors[..S::DIMENSIONS].copy_from_slice(&rows[..S::DIMENSIONS]);
        Lattice::with_basis(reduced::<S>(vectors))
    }
}

/// The continued fractions [p; q, p, …] and [q; p, q, …].
fn fraction(p: f64, q: f64) -> [f64; 2] {
    let unit = 1.0 + 0.5 * p * q + (p * q * (1.0 + 0.25 * p * q)).sqrt();
    [(unit * p / q).sqrt(), (unit * q / p).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Bulk, Layer, VelocityGradient};

    /// The shortest vector under a flow, over the side of a square or cube of the same content: at
    /// strain 0, and the smallest up to a strain of 60.
    fn shortest<S: Space>(flow: FlowType) -> [f64; 2] {
        let content = 10.0_f64.powi(i32::try_from(S::DIMENSIONS).unwrap());
        let recurrent = RecurrentLattice::<S>::new(flow, content);
        let start = recurrent.at(0.0).shortest() / 10.0;
        let mut worst = f64::INFINITY;
        for step in 0..30_000 {
            let lattice = recurrent.at(0.002 * f64::from(step));
            worst = worst.min(lattice.shortest() / 10.0);
            assert!((lattice.content() / content - 1.0).abs() < 1e-12);
        }
        [start, worst]
    }

    const FLOWS: [FlowType; 7] = [
        FlowType::PlanarExtension,
        FlowType::Mixture(0.1),
        FlowType::Mixture(0.5),
        FlowType::Mixture(1.0),
        FlowType::Mixture(20.0),
        FlowType::Uniaxial,
        FlowType::Biaxial,
    ];

    #[test]
    fn no_vector_is_ever_shorter_than_the_shortest_at_the_start() {
        for flow in FLOWS {
            if flow.is_planar() {
                let [start, worst] = shortest::<Layer>(flow);
                assert!(worst > start - 1e-12, "{flow}: {worst}");
            }
            let [start, worst] = shortest::<Bulk>(flow);
            assert!(worst > start - 1e-12, "{flow}: {worst}");
        }
        let [planar, _] = shortest::<Layer>(FlowType::PlanarExtension);
        assert!((planar - 0.9457).abs() < 1e-4, "{planar}");
        let [uniaxial, _] = shortest::<Bulk>(FlowType::Uniaxial);
        assert!((uniaxial - 0.9054).abs() < 1e-4, "{uniaxial}");
        let [mixed, _] = shortest::<Layer>(FlowType::Mixture(0.5));
        assert!(mixed > 0.78, "{mixed}");
    }

    #[test]
    fn planar_extension_passes_the_square_of_kraynik_and_reinelt() {
        let recurrent = RecurrentLattice::<Layer>::new(FlowType::PlanarExtension, 1.0);
        let angle = (0.5 * (5.0_f64.sqrt() - 1.0)).atan();
        let is_square = (0..10_000).any(|step| {
            let lattice = recurrent.at(2e-4 * f64::from(step));
            let [a, b] = [0, 1].map(|k| lattice.vectors()[k]);
            let turned = a.y.atan2(a.x).rem_euclid(0.5 * PI);
            a.dot(&b).abs() < 1e-3
                && (turned - angle)
                    .abs()
                    .min((0.5 * PI - turned - angle).abs())
                    < 1e-3
        });
        assert!(is_square);
        // Periodic in a Hencky strain of 0.96242, half of the strain.
        let [now, then] =
            [0.3, 0.3 + 2.0 * 0.962_423_650_119_206_9].map(|strain| recurrent.at(strain));
        for a in then.vectors() {
            let coordinates = now.coordinates(a);
            assert!(coordinates.iter().all(|x| (x - x.round()).abs() < 1e-12));
        }
    }

    /// Whether the flow takes the lattice of one strain to that of the next.
    fn check_motion<S: Space>(flow: FlowType) {
        let recurrent = RecurrentLattice::<S>::new(flow, 7.0);
        let gradient = VelocityGradient::<S>::of_type(flow, 1.0);
        for step in 0..400 {
            let strain = 0.05 * f64::from(step);
            let moved = recurrent.at(strain).deform(&gradient, 0.05);
            let next = recurrent.at(strain + 0.05);
            for a in moved.vectors() {
                let coordinates = next.coordinates(a);
                assert!(
                    coordinates.iter().all(|x| (x - x.round()).abs() < 1e-10),
                    "{flow} {strain}"
                );
            }
            let backwards = next.deform(&gradient, -0.05);
            for a in recurrent.at(strain).vectors() {
                let coordinates = backwards.coordinates(a);
                assert!(coordinates.iter().all(|x| (x - x.round()).abs() < 1e-10));
            }
        }
    }

    #[test]
    fn lattices_move_with_the_flow() {
        for flow in FLOWS {
            if flow.is_planar() {
                check_motion::<Layer>(flow);
            }
            check_motion::<Bulk>(flow);
        }
    }
}
