//! Rigid clusters of a layer by the frictional pebble game (Henkes, Quint, Fily and Schwarz, PRL
//! 116, 028301 (2016)).
//!
//! Each sphere has three degrees of freedom in its plane, represented by three pebbles. A sticking
//! contact takes two of them, a sliding or frictionless one takes one: constraints are counted
//! without regard to their geometry. A constraint between two spheres is independent of earlier
//! ones if four pebbles can be gathered on the two, as a rigid body of both keeps three; one of
//! them covers it. Spheres on which no fourth pebble can finally be gathered move as one body.

/// Degrees of freedom of a sphere in a layer, and of a rigid body of several.
const FREEDOMS: usize = 3;

/// The independent constraints of a layer.
#[derive(Debug)]
pub(crate) struct PebbleGame {
    /// For each sphere, the spheres at the other ends of its covered constraints: at most three.
    covered: Vec<Vec<usize>>,
    independent: usize,
    all: usize,
    // State of a search: for each sphere the last visit and its predecessor.
    seen: Vec<usize>,
    search: usize,
    from: Vec<usize>,
    waiting: Vec<usize>,
}

impl PebbleGame {
    /// Plays the game for a number of spheres with these constraints between pairs. A sticking
    /// contact counts as two.
    pub(crate) fn play(
        spheres: usize,
        constraints: impl IntoIterator<Item = (usize, usize)>,
    ) -> Self {
        let mut game = Self {
            covered: vec![Vec::with_capacity(FREEDOMS); spheres],
            independent: 0,
            all: 0,
            seen: vec![0; spheres],
            search: 0,
            from: vec![0; spheres],
            waiting: Vec::new(),
        };
        for (i, j) in constraints {
            game.add(i, j);
        }
        game
    }

    /// Constraints that are independent, and all.
    pub(crate) fn constraints(&self) -> (usize, usize) {
        (self.independent, self.all)
    }

    /// Number of pebbles on a sphere.
    fn free(&self, sphere: usize) -> usize {
        FREEDOMS - self.covered[sphere].len()
    }

    /// Adds a constraint.
    fn add(&mut self, i: usize, j: usize) {
        self.all += 1;
        while self.free(i) < FREEDOMS && self.gather(i, None) {}
        if self.free(j) == 0 && !self.gather(j, Some(i)) {
            return;
        }
        self.covered[j].push(i);
        self.independent += 1;
    }

    /// Moves one more pebble onto a sphere, but not from the other one. Returns whether one was
    /// found.
    fn gather(&mut self, sphere: usize, not_from: Option<usize>) -> bool {
        self.search += 1;
        self.seen[sphere] = self.search;
        if let Some(held) = not_from {
            self.seen[held] = self.search;
        }
        self.waiting.clear();
        self.waiting.push(sphere);
        while let Some(at) = self.waiting.pop() {
            for place in 0..self.covered[at].len() {
                let next = self.covered[at][place];
                if self.seen[next] == self.search {
                    continue;
                }
                self.seen[next] = self.search;
                self.from[next] = at;
                if self.free(next) > 0 {
                    self.turn_way(sphere, next);
                    return true;
                }
                self.waiting.push(next);
            }
        }
        false
    }

    /// Reverses the cover of the constraints along the path to a sphere with a pebble.
    fn turn_way(&mut self, sphere: usize, end: usize) {
        let mut at = end;
        while at != sphere {
            let before = self.from[at];
            let place = self.covered[before].iter().position(|next| *next == at);
            if let Some(place) = place {
                self.covered[before].swap_remove(place);
            }
            self.covered[at].push(before);
            at = before;
        }
    }

    /// The number of the rigid cluster of each sphere, counted from 0 in the order of their first
    /// spheres; a free sphere is its own cluster.
    pub(crate) fn rigid_clusters(mut self) -> Vec<usize> {
        const NONE: usize = usize::MAX;
        let n = self.covered.len();
        let mut cluster_of = vec![NONE; n];
        let mut clusters = 0;
        for first in 0..n {
            if cluster_of[first] != NONE {
                continue;
            }
            while self.free(first) < FREEDOMS && self.gather(first, None) {}
            let can_move = self.can_gather(first);
            for sphere in 0..n {
                // Two bodies that share a sphere are one, so that no sphere is in two clusters.
                if sphere == first || (cluster_of[sphere] == NONE && !can_move[sphere]) {
                    cluster_of[sphere] = clusters;
                }
            }
            clusters += 1;
        }
        cluster_of
    }

    /// The spheres onto which a pebble can be moved that is not on this one, which holds three.
    fn can_gather(&self, held: usize) -> Vec<bool> {
        let n = self.covered.len();
        let mut led_from = vec![Vec::new(); n];
        for (sphere, covered) in self.covered.iter().enumerate() {
            for next in covered {
                led_from[*next].push(sphere);
            }
        }
        let mut can = vec![false; n];
        let mut waiting: Vec<usize> = (0..n)
            .filter(|&sphere| sphere != held && self.free(sphere) > 0)
            .collect();
        for &sphere in &waiting {
            can[sphere] = true;
        }
        while let Some(sphere) = waiting.pop() {
            for &before in &led_from[sphere] {
                if before != held && !can[before] {
                    can[before] = true;
                    waiting.push(before);
                }
            }
        }
        can
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    /// Rigid clusters and rank by the null space of the matrix of bars at random places: bar k
    /// between bodies i and j along a line `x cos φ + y sin φ = d` takes away their relative motion
    /// along it.
    fn by_rank(spheres: usize, constraints: &[(usize, usize)], seed: u64) -> (usize, Vec<usize>) {
        use rand::{RngExt as _, SeedableRng as _};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        // At least as many rows as columns, so that the decomposition has every vector of the null
        // space.
        let columns = FREEDOMS * spheres;
        let mut matrix = DMatrix::<f64>::zeros(constraints.len().max(columns), columns);
        for (row, &(i, j)) in constraints.iter().enumerate() {
            let (angle, arm): (f64, f64) = (
                random.random_range(0.0..std::f64::consts::TAU),
                random.random_range(-1.0..1.0),
            );
            for (place, value) in [angle.cos(), angle.sin(), arm].into_iter().enumerate() {
                matrix[(row, FREEDOMS * i + place)] = value;
                matrix[(row, FREEDOMS * j + place)] = -value;
            }
        }
        let svd = matrix.svd(false, true);
        let vectors = svd.v_t.unwrap();
        // Random bars have singular values of any smallness, and rounding leaves 1e-14.
        let still: Vec<usize> = (0..columns)
            .filter(|&k| svd.singular_values[k] < 1e-10)
            .collect();
        let moves_as = |i: usize, j: usize| {
            still.iter().all(|&k| {
                (0..FREEDOMS).all(|place| {
                    let of = |sphere: usize| vectors[(k, FREEDOMS * sphere + place)];
                    (of(i) - of(j)).abs() < 1e-9
                })
            })
        };
        let mut cluster_of = vec![usize::MAX; spheres];
        let mut clusters = 0;
        for first in 0..spheres {
            if cluster_of[first] != usize::MAX {
                continue;
            }
            for (sphere, cluster) in cluster_of.iter_mut().enumerate().skip(first) {
                if *cluster == usize::MAX && moves_as(first, sphere) {
                    *cluster = clusters;
                }
            }
            clusters += 1;
        }
        (columns - still.len(), cluster_of)
    }

    fn sticking(pairs: &[(usize, usize)]) -> Vec<(usize, usize)> {
        pairs.iter().flat_map(|&pair| [pair, pair]).collect()
    }

    #[test]
    fn networks_known_by_hand() {
        // Three spheres that stick to each other: 6 constraints, all independent, and one body.
        let triangle = sticking(&[(0, 1), (1, 2), (2, 0)]);
        let game = PebbleGame::play(4, triangle.iter().copied());
        assert_eq!(game.constraints(), (6, 6));
        assert_eq!(game.rigid_clusters(), [0, 0, 0, 1]);
        // A ring of four that stick is a mechanism: each rolls on the next.
        let ring = sticking(&[(0, 1), (1, 2), (2, 3), (3, 0)]);
        assert_eq!(
            PebbleGame::play(4, ring.iter().copied()).rigid_clusters(),
            [0, 1, 2, 3]
        );
        // With one diagonal one contact is more than is needed.
        let braced = sticking(&[(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)]);
        let game = PebbleGame::play(4, braced.iter().copied());
        assert_eq!(game.constraints(), (9, 10));
        assert_eq!(game.rigid_clusters(), [0; 4]);
        // A triangle that slides at one contact, and a pair: mechanisms.
        let sliding = [(0, 1), (0, 1), (1, 2), (1, 2), (2, 0)];
        assert_eq!(PebbleGame::play(3, sliding).rigid_clusters(), [0, 1, 2]);
        assert_eq!(
            PebbleGame::play(2, [(0, 1), (0, 1)]).rigid_clusters(),
            [0, 1]
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn the_game_agrees_with_the_rank_of_the_rigidity_matrix(
            spheres in 2_usize..30,
            tenths in 3_usize..22,
            seed in any::<u64>(),
        ) {
            use rand::{RngExt as _, SeedableRng as _};
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let number = tenths * spheres / 10;
            let mut constraints = Vec::new();
            for _ in 0..number {
                let i = random.random_range(0..spheres);
                // Mostly neighbours, so that bodies of several spheres form.
                let j = (i + random.random_range(1..spheres.clamp(2, 4))) % spheres;
                if i != j {
                    constraints.push((i, j));
                    if random.random_range(0.0..1.0) < 0.7 {
                        constraints.push((i, j));
                    }
                }
            }
            let (rank, clusters) = by_rank(spheres, &constraints, seed);
            let game = PebbleGame::play(spheres, constraints.iter().copied());
            prop_assert_eq!(game.constraints().0, rank);
            prop_assert_eq!(game.rigid_clusters(), clusters);
        }
    }
}
