//! Hard spheres in thermal equilibrium: Monte Carlo moves of a packing.
//!
//! A move puts one sphere, drawn at random, to a place drawn uniformly from a cube about its own,
//! and holds if every gap there is at least h (Metropolis et al., J. Chem. Phys. 21, 1087, 1953).
//! All arrangements without a smaller gap are then equally likely: spheres of radius `a_i + h/2`
//! with no other force.

use super::packing::range;
use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Moves per sphere. Of 200 spheres at a volume fraction of 0.49, the pair distribution at contact,
/// over 40 seeds, is 6.28 after 400, 5.65 after 1500 and 5.57 after 6000 (each ± 0.08); that of
/// Carnahan and Starling is 5.69.
const SWEEPS: u32 = 2000;
/// Share of the sweeps in which the size of moves follows the share that hold.
const ADAPTED: u32 = SWEEPS / 4;
/// Share of moves that hold, which the size of moves is adapted to.
const ACCEPTED: f64 = 0.4;
/// Factor by which a sweep changes the size of moves.
const CHANGE: f64 = 1.05;
/// Size of moves at first and at most: half the side of the cube, in a. Spheres then move often
/// before their neighbours are sought anew.
const LARGEST: f64 = 0.15;
/// Gap, beyond h, up to which pairs are kept as neighbours, in a.
const SKIN: f64 = 0.8;
/// Added to h, in a, so that no gap is below h by rounding.
const ROUNDING: f64 = 1e-12;
/// Random numbers of moves are another stream than those of the packing.
const STREAM: u64 = 1;

/// Spheres that keep gaps of at least h.
pub(super) struct HardSpheres<'a, S: Space> {
    cell: Cell<S>,
    radii: &'a [f64],
    centres: &'a mut [S::Vector],
    /// Smallest gap allowed, in a.
    gap: f64,
    /// Half the side of the cube of a move, in a.
    size: f64,
    random: ChaCha8Rng,
    list: NeighbourList<S>,
    /// Neighbours of all spheres, one sphere after the other, and where those of each begin.
    neighbours: Vec<usize>,
    starts: Vec<usize>,
    /// Centres when the neighbours were found.
    found_at: Vec<S::Vector>,
}

impl<'a, S: Space> HardSpheres<'a, S> {
    /// Spheres whose gaps are at least `gap`, with random numbers of the seed (`ChaCha8`).
    pub(super) fn new(
        cell: Cell<S>,
        radii: &'a [f64],
        centres: &'a mut [S::Vector],
        gap: f64,
        seed: u64,
    ) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        let mut spheres = Self {
            cell,
            radii,
            gap: gap + ROUNDING,
            size: LARGEST,
            random,
            list: NeighbourList::new(radii.len()),
            neighbours: Vec::new(),
            starts: Vec::new(),
            found_at: Vec::new(),
            centres,
        };
        spheres.find_neighbours();
        spheres
    }

    /// Moves the spheres until they are in equilibrium.
    pub(super) fn equilibrate(&mut self) {
        for sweep in 0..SWEEPS {
            let held = self.sweep();
            if sweep < ADAPTED {
                let factor = if held > ACCEPTED {
                    CHANGE
                } else {
                    1.0 / CHANGE
                };
                self.size = f64::min(self.size * factor, LARGEST);
            }
        }
        for x in self.centres.iter_mut() {
            *x = self.cell.wrap(*x);
        }
    }

    /// Tries as many moves as there are spheres; returns the share that held.
    pub(super) fn sweep(&mut self) -> f64 {
        let spheres = self.centres.len();
        let mut held = 0;
        for _ in 0..spheres {
            let i = self.random.random_range(0..spheres);
            let mut moved = self.centres[i];
            for k in 0..S::DIMENSIONS {
                moved[k] += self.size * (2.0 * self.random.random::<f64>() - 1.0);
            }
            let distance = moved - self.found_at[i];
            if S::norm_squared(&distance) > (0.5 * SKIN).powi(2) {
                self.find_neighbours();
            }
            if self.is_free(i, &moved) {
                held += 1;
                self.centres[i] = moved;
            }
        }
        f64::from(held) / spheres as f64
    }

    /// Whether sphere i keeps the gap to all others at that place, less than half the skin away
    /// from where it was when neighbours were found.
    fn is_free(&self, i: usize, place: &S::Vector) -> bool {
        let neighbours = &self.neighbours[self.starts[i]..self.starts[i + 1]];
        neighbours.iter().all(|&j| {
            let (r, _) = self.cell.nearest(self.centres[j] - *place);
            S::norm_squared(&r) >= (self.radii[i] + self.radii[j] + self.gap).powi(2)
        })
    }

    fn find_neighbours(&mut self) {
        let range = range(self.radii, self.gap + SKIN);
        self.list.find(&self.cell, self.centres, self.radii, range);
        let pairs = self.list.pairs();
        self.starts.clear();
        self.starts.resize(self.centres.len() + 1, 0);
        for pair in pairs {
            self.starts[pair.i] += 1;
            self.starts[pair.j] += 1;
        }
        let mut before = 0;
        for start in &mut self.starts {
            before += *start;
            *start = before;
        }
        self.neighbours.resize(before, 0);
        for pair in pairs {
            for (sphere, other) in [(pair.i, pair.j), (pair.j, pair.i)] {
                self.starts[sphere] -= 1;
                self.neighbours[self.starts[sphere]] = other;
            }
        }
        self.found_at.clear();
        self.found_at.extend_from_slice(self.centres);
    }
}

#[cfg(test)]
mod tests {
    use super::HardSpheres;
    use crate::model::{Hydrodynamics, Params, StartFrom};
    use crate::run::start::{Start, freezing_exceeded, layer, suspension};
    use crate::space::cell::Cell;
    use crate::space::neighbours::NeighbourList;
    use crate::space::{Bulk, Layer, Space};
    use std::f64::consts::PI;

    const ROUGHNESS: f64 = 0.01;

    /// Equal spheres whose fraction is this one when they are grown by the roughness.
    fn params(spheres: usize, grown: f64, dimensions: i32) -> Params {
        let fraction = grown / (1.0 + 0.5 * ROUGHNESS).powi(dimensions);
        let (area_fraction, volume_fraction) = match dimensions {
            2 => (fraction, None),
            _ => (0.0, Some(fraction)),
        };
        Params {
            spheres,
            area_fraction,
            volume_fraction,
            roughness: ROUGHNESS,
            friction: 0.0,
            shear_rate: 0.0,
            hydrodynamics: Hydrodynamics::BallMelrose,
            time_step: 0.005,
            start: Some(StartFrom::Equilibrium),
            ..Params::UNSET
        }
    }

    /// The pair distribution at contact: that of two thin shells, continued to contact.
    fn at_contact<S: Space>(starts: &[Start<S>]) -> f64 {
        let (mut counts, mut ideal) = ([0.0; 2], [0.0; 2]);
        for start in starts {
            let spheres = start.radii.len() as f64;
            let power = S::DIMENSIONS as f64;
            let ball = if S::DIMENSIONS == 2 {
                PI
            } else {
                4.0 / 3.0 * PI
            };
            for (shell, ideal) in ideal.iter_mut().enumerate() {
                let inner = 2.0 + ROUGHNESS + WIDTH * shell as f64;
                let content = ball * ((inner + WIDTH).powf(power) - inner.powf(power));
                *ideal += 0.5 * spheres.powi(2) * content / start.side.powf(power);
            }
            for excess in excesses(start) {
                assert!(excess >= 0.0);
                if excess < 2.0 * WIDTH {
                    counts[usize::from(excess >= WIDTH)] += 1.0;
                }
            }
        }
        let g = [0, 1].map(|shell| counts[shell] / ideal[shell]);
        // Linear from the middles of the shells, at w/2 and 3w/2.
        1.5 * g[0] - 0.5 * g[1]
    }

    /// Gaps of near pairs beyond the roughness.
    fn excesses<S: Space>(start: &Start<S>) -> Vec<f64> {
        let cell = Cell::<S>::equal_sides(start.side, 0.0).unwrap();
        let mut list = NeighbourList::<S>::default();
        list.find(&cell, &start.centres, &start.radii, 2.5);
        list.pairs()
            .iter()
            .map(|pair| pair.gap - ROUGHNESS)
            .collect()
    }

    /// The pair distribution at contact, and P/nkT from the smallest gaps: with probability
    /// exp(−D N (P/nkT − 1) x) all lengths can shrink by a share x before spheres touch.
    fn sampled<S: Space>(start: &mut Start<S>, samples: u64) -> [f64; 2] {
        let cell = Cell::<S>::equal_sides(start.side, 0.0).unwrap();
        let (mut starts, mut shares) = (Vec::new(), 0.0);
        for sample in 0..samples {
            let (radii, centres) = (&start.radii, &mut start.centres);
            let mut spheres = HardSpheres::new(cell, radii, centres, ROUGHNESS, sample);
            for _ in 0..10 {
                spheres.sweep();
            }
            let least = excesses(start).into_iter().fold(f64::INFINITY, f64::min);
            shares += least / (2.0 + ROUGHNESS);
            starts.push(start.clone());
        }
        let degrees = (S::DIMENSIONS * start.radii.len()) as f64;
        let compressibility = 1.0 + samples as f64 / (degrees * shares);
        [at_contact(&starts), compressibility]
    }

    /// Thickness of a shell of gaps, in a.
    const WIDTH: f64 = 0.04;

    fn near(found: [f64; 2], wanted: [f64; 2]) {
        for (found, wanted) in found.into_iter().zip(wanted) {
            assert!((found / wanted - 1.0).abs() < 0.04, "{found} {wanted}");
        }
    }

    #[test]
    fn spheres_have_the_pressure_and_contact_value_of_carnahan_and_starling() {
        for f in [0.1_f64, 0.3, 0.45] {
            let at_contact = (1.0 - 0.5 * f) / (1.0 - f).powi(3);
            let mut start = suspension(&params(100, f, 3), 1).unwrap();
            let found = sampled::<Bulk>(&mut start, 3000);
            near(found, [at_contact, 1.0 + 4.0 * f * at_contact]);
        }
    }

    #[test]
    fn discs_have_the_pressure_and_contact_value_of_henderson() {
        for f in [0.3_f64, 0.6] {
            // D. Henderson, Mol. Phys. 30, 971 (1975).
            let at_contact = (1.0 - 7.0 / 16.0 * f) / (1.0 - f).powi(2);
            let mut start = layer(&params(100, f, 2), 1).unwrap();
            let found = sampled::<Layer>(&mut start, 3000);
            near(found, [at_contact, 1.0 + 2.0 * f * at_contact]);
        }
    }

    #[test]
    fn packings_are_no_equilibrium_but_starts_are() {
        let f = 0.45;
        let mean = |start: Option<StartFrom>| {
            let found = (1..=16).map(|seed| {
                let params = Params {
                    start: start.clone(),
                    ..params(150, f, 3)
                };
                let start = suspension(&params, seed).unwrap();
                at_contact(&[start])
            });
            found.sum::<f64>() / 16.0
        };
        let wanted = (1.0 - 0.5 * f) / (1.0 - f).powi(3);
        let (packed, moved) = (mean(None), mean(Some(StartFrom::Equilibrium)));
        assert!((moved / wanted - 1.0).abs() < 0.1, "{moved}");
        assert!((packed / wanted - 1.0).abs() > 0.3, "{packed}");
    }

    #[test]
    fn moves_differ_from_seed_to_seed_and_repeat_with_it() {
        let params = params(150, 0.3, 3);
        let start = |seed| suspension(&params, seed).unwrap();
        assert_eq!(start(3), start(3));
        assert_ne!(start(3), start(4));
    }

    #[test]
    fn crystals_are_no_fluid() {
        let limit = |fraction, dimensions| freezing_exceeded(&params(150, fraction, dimensions));
        assert!(limit(0.49, 3).is_none() && limit(0.69, 2).is_none());
        let limit = limit(0.5, 3).unwrap();
        assert!((limit * 1.005_f64.powi(3) - 0.494).abs() < 1e-12);
        let packed = Params {
            start: None,
            ..params(150, 0.5, 3)
        };
        assert!(freezing_exceeded(&packed).is_none());
    }
}
