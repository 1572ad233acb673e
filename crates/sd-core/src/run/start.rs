//! Start layers: random, without contact, at any area fraction up to 0.84.
//!
//! Random points are relaxed as soft discs of diameter `a_i + a_j + h + margin` (energy ½ Σ overlap², FIRE: Bitzek et al.
//! 2006) until no overlap is left. The margin is the largest of a few that fits, so that dilute layers do not start with
//! crowds of pairs just at h. Dense layers that get stuck are shaken and relaxed again, ever more gently.

mod given;

pub use given::fit;

use crate::error::Error;
use crate::model::{Params, Refusal, StartLayer, Words as _};
use crate::space::Layer;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::neighbours::NeighbourList;
use crate::stage::Method;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Extra gaps tried, in a, largest first.
const MARGINS: [f64; 6] = [0.2, 0.1, 0.05, 0.02, 0.005, 0.001];
/// Area fraction of the grown discs up to which plain relaxation is worth a try.
const EASY: f64 = 0.80;
/// Fresh random layers tried at the smallest margin before an area fraction is given up.
const SCATTERS: u32 = 3;
/// Shakes tried with each of these gaps.
const SHAKES: u32 = 100;
/// Height of the rows in which spheres of large layers are numbered, in a.
const ROW: f64 = 3.0;

/// Radii, centres and cell of a layer at strain 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Radii, in a; their mean is 1.
    pub radii: Vec<f64>,
    /// Centres, in a, inside the cell.
    pub centres: Vec<Vec2>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Stretches of tangential springs, in a, by pair.
    pub springs: Vec<(u32, u32, f64)>,
    /// The same of the springs of rolling friction.
    pub rolling_springs: Vec<(u32, u32, f64)>,
    /// Side of the square cell, in a.
    pub side: f64,
}

/// Area fraction of the densest packing of equal discs, π/√12.
const CLOSE_PACKED: f64 = 0.906_899_682_117_108_9;

/// Refuses layers that cannot be started or held, by what is known without making one.
///
/// Layers that pass may still fail to pack: see [`layer`].
///
/// # Errors
/// [`Error::Refused`] about the number of spheres or the area fraction, with what is allowed.
pub fn check(params: &Params) -> Result<(), Error> {
    let n = params.spheres as f64;
    let refuse =
        |key, value: String, problem: String, allowed: String, because| -> Result<(), Error> {
            Err(Refusal {
                key,
                value,
                problem,
                allowed,
                because: Some(because),
            }
            .into())
        };
    let most = Method::of(params).most_spheres(params.hydrodynamics);
    if params.spheres > most {
        return refuse(
            "spheres",
            params.spheres.to_string(),
            format!(
                "is out of range under {} with the paper's procedure, which takes full matrices",
                params.hydrodynamics.word()
            ),
            format!("at most {most} there, which take a gigabyte"),
            "contact",
        );
    }
    // Spheres that, with the roughness around them, cover more than discs can.
    let growth = (1.0 + 0.5 * params.roughness).powi(2);
    if params.start.is_none() && params.area_fraction * growth > CLOSE_PACKED {
        return refuse(
            "area_fraction",
            params.area_fraction.to_string(),
            format!(
                "is denser than any layer that starts without contact at `roughness` = {}",
                params.roughness
            ),
            format!("at most {:.3} at this roughness", CLOSE_PACKED / growth),
            "roughness",
        );
    }
    // Two radii of mean 1, and the mean square of all.
    let large = number_of_large(params) as f64 / n;
    let small_radius = 1.0 / (1.0 - large + large * params.size_ratio);
    let largest = if large > 0.0 {
        params.size_ratio * small_radius
    } else {
        small_radius
    };
    let mean_square =
        small_radius * small_radius * (1.0 - large + large * params.size_ratio * params.size_ratio);
    let area = n * PI * mean_square;
    let side = (area / params.area_fraction).sqrt();
    let Err(Error::CellTooSmall { side, needed, .. }) =
        Cell::<Layer>::equal_sides(side, 0.0)?.check_range(&[largest])
    else {
        return match &params.start {
            Some(given) => fit(given, params).map(|_| ()),
            None => Ok(()),
        };
    };
    let least = (needed * needed * params.area_fraction / (PI * mean_square)).ceil();
    refuse(
        "spheres",
        params.spheres.to_string(),
        format!(
            "at `area_fraction` = {} make a cell {side:.3} wide, less than {needed:.3}, twice the distance up to which pairs are looked for",
            params.area_fraction
        ),
        format!(
            "at least {least} spheres at this area fraction, or an area fraction of at most {:.3}",
            area / (needed * needed)
        ),
        "area_fraction",
    )
}

/// Number of large spheres.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a fraction of n, rounded"
)]
fn number_of_large(params: &Params) -> usize {
    if params.size_ratio == 1.0 {
        0
    } else {
        (params.large_fraction * params.spheres as f64).round() as usize
    }
}

/// Radii and cell side: what is known without packing.
///
/// # Errors
/// [`Error::CellTooSmall`].
pub fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error> {
    let n = params.spheres;
    let large = number_of_large(params);
    let mut radii = vec![1.0; n];
    radii[..large].fill(params.size_ratio);
    let mean = radii.iter().sum::<f64>() / n as f64;
    for a in &mut radii {
        *a /= mean;
    }
    let area: f64 = radii.iter().map(|a| PI * a * a).sum();
    let side = (area / params.area_fraction).sqrt();
    Cell::<Layer>::equal_sides(side, 0.0)?.check_range(&radii)?;
    Ok((radii, side))
}

/// The layer a run begins with: the one that is given, or else the one that the seed makes.
///
/// # Errors
/// Those of [`fit`] and [`layer`].
pub fn first_layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let Some(given) = &params.start else {
        return layer(params, seed);
    };
    let StartLayer {
        side,
        radii,
        centres,
        orientations,
        springs,
        rolling_springs,
        ..
    } = fit(given, params)?;
    Ok(Start {
        springs,
        rolling_springs,
        radii,
        centres: centres.iter().map(|x| Vec2::new(x[0], x[1])).collect(),
        orientations,
        side,
    })
}

/// Makes the layer, which depends on the parameters and the seed alone (`ChaCha8`).
///
/// # Errors
/// [`Error::CellTooSmall`], or [`Error::CannotPack`] with the area fraction reached.
pub fn layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let (radii, side) = radii_and_side(params)?;
    let cell = Cell::equal_sides(side, 0.0)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut packing = Packing::new(cell, radii, params.roughness);
    let mut smallest = f64::NEG_INFINITY;
    for (attempt, &margin) in MARGINS.iter().enumerate() {
        let grown = params.area_fraction * (1.0 + 0.5 * (params.roughness + margin)).powi(2);
        let last = attempt + 1 == MARGINS.len();
        if grown > EASY && !last {
            continue;
        }
        packing.margin = margin;
        for _ in 0..if last { SCATTERS } else { 1 } {
            packing.scatter(side, &mut random);
            let mut gap = packing.relax();
            for shake in 0..if last { SHAKES } else { 0 } {
                if gap >= params.roughness {
                    break;
                }
                // Shakes go from most of a radius, which melts the layer, down to a tenth of it, several times over.
                let size = 0.8 * 0.125f64.powf(f64::from(shake % 10) / 9.0);
                packing.shake(size, &mut random);
                gap = packing.relax();
            }
            smallest = smallest.max(gap);
            if gap >= params.roughness {
                let mut centres: Vec<_> = packing.centres.iter().map(|&x| cell.wrap(x)).collect();
                if params.spheres > Params::LARGE_ABOVE {
                    number_by_rows(&packing.radii, &mut centres);
                }
                return Ok(Start {
                    orientations: vec![0.0; packing.radii.len()],
                    springs: Vec::new(),
                    rolling_springs: Vec::new(),
                    radii: packing.radii,
                    centres,
                    side,
                });
            }
        }
    }
    // Spheres with the gap that was reached, swollen until it is h, would have fitted at this area fraction.
    let reached = params.area_fraction * ((2.0 + smallest) / (2.0 + params.roughness)).powi(2);
    Err(Error::CannotPack {
        spheres: params.spheres,
        area_fraction: params.area_fraction,
        gap: params.roughness,
        reached,
        advice: "lower the area fraction or the roughness, use other numbers of spheres, or two sizes",
    })
}

/// Numbers spheres of the same size row by row along the flow. Neighbours in the layer are then neighbours in memory too, and stay so for
/// long, since shear moves whole rows past each other.
fn number_by_rows(radii: &[f64], centres: &mut [Vec2]) {
    let mut rest = centres;
    for alike in radii.chunk_by(|a, b| a == b) {
        let (same_size, others) = rest.split_at_mut(alike.len());
        same_size.sort_by(|a, b| {
            let [row_a, row_b] = [a, b].map(|x| (x.y / ROW).floor());
            row_a.total_cmp(&row_b).then(a.x.total_cmp(&b.x))
        });
        rest = others;
    }
}

/// Discs that are being packed into a layer.
struct Packing {
    cell: Cell,
    radii: Vec<f64>,
    /// Smallest gap that the layer must have, in a.
    gap: f64,
    /// Gap aimed at beyond that, in a.
    margin: f64,
    centres: Vec<Vec2>,
    velocities: Vec<Vec2>,
    forces: Vec<Vec2>,
    neighbours: NeighbourList,
}

impl Packing {
    /// Discs that are not yet placed.
    fn new(cell: Cell, radii: Vec<f64>, gap: f64) -> Self {
        let n = radii.len();
        Self {
            cell,
            radii,
            gap,
            margin: 0.0,
            centres: vec![Vec2::zeros(); n],
            velocities: vec![Vec2::zeros(); n],
            forces: vec![Vec2::zeros(); n],
            neighbours: NeighbourList::default(),
        }
    }

    /// Puts every disc anywhere.
    fn scatter(&mut self, side: f64, random: &mut impl Rng) {
        for x in &mut self.centres {
            *x = Vec2::new(random.random::<f64>() * side, random.random::<f64>() * side);
        }
    }

    /// Moves every disc by up to `size` in x and y.
    fn shake(&mut self, size: f64, random: &mut impl Rng) {
        for x in &mut self.centres {
            let step = Vec2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
            *x += 2.0 * size * step;
        }
    }

    /// Relaxes the overlaps by FIRE; returns the smallest gap at the end.
    fn relax(&mut self) -> f64 {
        let (mut dt, mut mixing, mut downhill) = (0.1, 0.1, 0u32);
        self.velocities.fill(Vec2::zeros());
        let mut smallest = self.update_forces();
        let mut last_energy = f64::INFINITY;
        for step in 0..4000 {
            let energy: f64 = self.forces.iter().map(Vec2::norm_squared).sum();
            // The discs are jammed: no force decreases any more, yet overlaps are left.
            if step % 100 == 99 {
                if energy > 0.8 * last_energy {
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
                .map(|(f, v)| f.dot(v))
                .sum();
            if power > 0.0 {
                let speed: f64 = self.velocities.iter().map(Vec2::norm_squared).sum();
                let scale = mixing * (speed / energy.max(f64::MIN_POSITIVE)).sqrt();
                for (v, f) in self.velocities.iter_mut().zip(&self.forces) {
                    *v = *v * (1.0 - mixing) + f * scale;
                }
                downhill += 1;
                if downhill > 5 {
                    dt = f64::min(dt * 1.1, 0.5);
                    mixing *= 0.99;
                }
            } else {
                self.velocities.fill(Vec2::zeros());
                (dt, mixing, downhill) = (f64::max(dt * 0.5, 0.02), 0.1, 0);
            }
            for ((x, v), f) in self
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
        // Range 3 reaches well past the grown discs: h + margin < 1 at mean radius 1.
        self.neighbours
            .find(&self.cell, &self.centres, &self.radii, 3.0);
        self.forces.fill(Vec2::zeros());
        let mut smallest = f64::INFINITY;
        for pair in self.neighbours.pairs() {
            smallest = smallest.min(pair.gap);
            let overlap = self.gap + self.margin - pair.gap;
            if overlap > 0.0 {
                let force = pair.normal * overlap;
                self.forces[pair.i] -= force;
                self.forces[pair.j] += force;
            }
        }
        smallest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ContactScheme, Hydrodynamics};

    fn params(spheres: usize, area_fraction: f64, size_ratio: f64) -> Params {
        Params {
            spheres,
            area_fraction,
            roughness: 0.01,
            friction: 0.0,
            shear_rate: 0.0,
            size_ratio,
            large_fraction: 0.5,
            hydrodynamics: Hydrodynamics::BallMelrose,
            contact: ContactScheme::Rigid,
            time_step: 0.005,
            ..Params::UNWRITTEN
        }
    }

    /// Smallest gap between any two images, by brute force.
    fn smallest_gap(start: &Start) -> f64 {
        let mut smallest = f64::INFINITY;
        for (i, x) in start.centres.iter().enumerate() {
            for (j, y) in start.centres.iter().enumerate().skip(i + 1) {
                for m in -1..=1 {
                    for n in -1..=1 {
                        let shift = Vec2::new(f64::from(m), f64::from(n)) * start.side;
                        let gap = (y + shift - x).norm() - start.radii[i] - start.radii[j];
                        smallest = smallest.min(gap);
                    }
                }
            }
        }
        smallest
    }

    #[test]
    fn only_the_procedure_takes_full_matrices_for_many_spheres() {
        let many = |spheres, contact| Params {
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            contact,
            ..params(spheres, 0.7, 1.0)
        };
        assert!(check(&many(10_000, ContactScheme::Rigid)).is_ok());
        assert!(check(&many(2_000, ContactScheme::Procedure)).is_ok());
        let refused = check(&many(2_001, ContactScheme::Procedure)).unwrap_err();
        assert!(refused.to_string().contains("procedure"), "{refused}");
    }

    #[test]
    fn no_pair_starts_in_contact_up_to_the_densest_layer() {
        for (spheres, c, ratio) in [
            (90, 0.1, 1.0),
            (90, 0.693, 1.0),
            (100, 0.84, 1.0),
            (100, 0.8, 1.4),
        ] {
            let params = params(spheres, c, ratio);
            let start = layer(&params, 1).unwrap();
            assert!(smallest_gap(&start) >= params.roughness);
            let area: f64 = start.radii.iter().map(|a| PI * a * a).sum();
            assert!((area / start.side.powi(2) - c).abs() < 1e-12);
            let mean = start.radii.iter().sum::<f64>() / spheres as f64;
            assert!((mean - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn large_layers_are_numbered_row_by_row_and_keep_their_sizes() {
        let params = params(Params::LARGE_ABOVE + 1, 0.5, 1.4);
        let start = layer(&params, 1).unwrap();
        let (radii, _) = radii_and_side(&params).unwrap();
        assert_eq!(start.radii, radii);
        assert!(smallest_gap(&start) >= params.roughness);
        // Of numbers next to each other all but a few, at the ends of rows, are of spheres nearby.
        let next = start.centres.windows(2);
        let far = next.filter(|pair| (pair[1] - pair[0]).norm() > 4.0 * ROW);
        assert!(far.count() < params.spheres / 10);
    }

    #[test]
    fn layer_is_a_function_of_the_seed() {
        let params = params(60, 0.75, 1.4);
        assert_eq!(layer(&params, 7), layer(&params, 7));
        assert_ne!(layer(&params, 7), layer(&params, 8));
    }

    #[test]
    fn what_cannot_be_packed_is_refused() {
        // Grown by h = 0.4 these discs would cover more than the plane.
        let params = Params {
            roughness: 0.4,
            ..params(30, 0.84, 1.0)
        };
        assert!(matches!(layer(&params, 1), Err(Error::CannotPack { .. })));
    }

    #[test]
    fn small_cell_is_refused() {
        let too_small = layer(&params(10, 0.84, 1.0), 1);
        assert!(matches!(too_small, Err(Error::CellTooSmall { .. })));
    }
}
