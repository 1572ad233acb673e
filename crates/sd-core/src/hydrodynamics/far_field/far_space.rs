//! What the mobility of layers and that of suspensions differ in: modes, Green's functions, and the
//! short-ranged part of the periodic sums.

use super::real_space::RealSpace;
use super::suspension::dense_mobility;
use super::{Splitting, ewald, wave_space};
use crate::hydrodynamics::free_space::coupling::{Coupling, Lanes, MODES, Modes, both};
use crate::hydrodynamics::free_space::kernels::{self, FiniteSize};
use crate::hydrodynamics::free_space::planar::{RadialChain, pair_lanes};
use crate::hydrodynamics::free_space::spatial::{couplings, finite_size};
use crate::hydrodynamics::part_of_pairs::{LEAST_SPHERES, for_pairs_of, part_of};
use crate::linalg::simd::vectorised;
use crate::space::modes::{ModeBlock, Vec2};
use crate::space::pair::Neighbours;
use crate::space::{Bulk, FixedArray, Layer, Space};
use crate::threads;
use nalgebra::Vector3;
use std::ops::Range;

/// Components of a vector; none normal to a layer.
pub(super) fn components<S: Space>(vector: &S::Vector) -> [f64; 3] {
    let mut components = [0.0; 3];
    for (k, component) in components.iter_mut().enumerate().take(S::DIMENSIONS) {
        *component = vector[k];
    }
    components
}

/// The parts of the mobility that differ between layers and suspensions.
pub trait FarSpace: Space {
    /// A value for each component of a vector.
    type PerComponent<T: Copy + Send + Sync>: FixedArray<T>;
    /// The short-ranged part of M in a periodic cell.
    type NearPart: NearPart<Self>;
    /// Measured nanoseconds of a near pair in an application.
    const PAIR_COST: f64;
    /// Measured nanoseconds of a point under the window of a sphere, and of a point of the grid.
    const GRID_COSTS: [f64; 2];
    /// Smallest splitting parameter tried, over the inverse of the lattice's reach.
    const LEAST_SPLITTING: f64;
    /// Whether the estimates of remainders hold where several images of a pair are in range. Those
    /// of a layer take terms as random, which such images are not.
    const COUNTS_IMAGES: bool;

    /// Modes `(U, Ω, e)` in three dimensions.
    fn embedded(modes: &Self::PerAnyMode<f64>) -> [f64; MODES];

    /// Those modes of a sphere in three dimensions that it has in this space.
    fn restricted(modes: &[f64; MODES]) -> Self::PerAnyMode<f64>;

    /// Cut-offs whose remainders stay below a tolerance of M, relative to its largest entry.
    fn splitting(alpha: f64, content: f64, radii: &[f64], tolerance: f64) -> Splitting;

    /// `[b0, b1, b2]` at a wave vector: `G^_ab = −δ_ab b1 + k_a k_b b0,  (∇²G)^_ab = δ_ab b2 − k_a
    /// k_b b1`, over 8π.
    fn transforms(k: &Self::Vector, alpha: f64) -> [f64; 3];
}

/// The short-ranged part of M in a periodic cell.
pub trait NearPart<S: FarSpace>: Sized + Send + Sync {
    /// What a pair adds to M.
    type Block: Copy + Send + Sync;

    /// The part for one splitting of the sums.
    fn new(splitting: Splitting, radii: &[f64], tolerance: f64) -> Self;

    /// The block of sphere i from sphere j; `x`: from j to i.
    fn block(&self, x: &S::Vector, i: &FiniteSize, j: &FiniteSize) -> Self::Block;

    /// The block of sphere i from sphere j in unbounded fluid.
    fn unbounded(x: &S::Vector, i: &FiniteSize, j: &FiniteSize) -> Self::Block;

    /// Adds to the modes of the first sphere the product of a block with those of the second.
    fn add_to_first(
        block: &Self::Block,
        of_second: &S::PerAnyMode<f64>,
        to_first: &mut S::PerAnyMode<f64>,
    );

    /// Adds to the modes of the second sphere the product of the transpose with those of the first.
    fn add_to_second(
        block: &Self::Block,
        of_first: &S::PerAnyMode<f64>,
        to_second: &mut S::PerAnyMode<f64>,
    );

    /// Adds the products of all pairs with vectors of as many spheres, one after another.
    fn add_all(
        pairs: &NearPairs<S>,
        x: &[S::PerAnyMode<f64>],
        y: &mut [S::PerAnyMode<f64>],
        _: &mut SideBySide<S>,
    ) {
        add_one_by_one::<S>(pairs, x, y);
    }
}

/// The block of a pair.
#[inline(always)]
pub(super) fn near_pair<S: FarSpace>(
    near: &S::NearPart,
    sizes: &[FiniteSize],
    pair: &Neighbours<S>,
) -> NearPair<S> {
    let (i, j) = (pair.i, pair.j);
    let x = -(pair.normal * pair.distance);
    (i, j, near.block(&x, &sizes[i], &sizes[j]))
}

/// As [`NearPart::add_all`], vector by vector.
fn add_one_by_one<S: FarSpace>(
    pairs: &NearPairs<S>,
    x: &[S::PerAnyMode<f64>],
    y: &mut [S::PerAnyMode<f64>],
) {
    let spheres = pairs.spheres();
    for (x, y) in x.chunks_exact(spheres).zip(y.chunks_exact_mut(spheres)) {
        threads::divide(y, LEAST_SPHERES, &|first, y| {
            let range = first..first + y.len();
            vectorised(
                #[inline(always)]
                || {
                    pairs.for_pairs_of(
                        &range,
                        #[inline(always)]
                        |(i, j, block), [has_i, has_j]| {
                            let (i, j) = (*i, *j);
                            if has_i {
                                let mut to_i = y[i - first];
                                S::NearPart::add_to_first(block, &x[j], &mut to_i);
                                y[i - first] = to_i;
                            }
                            if has_j {
                                let mut to_j = FixedArray::each(0.0);
                                S::NearPart::add_to_second(block, &x[i], &mut to_j);
                                for k in 0..S::ALL_MODES {
                                    y[j - first][k] += to_j[k];
                                }
                            }
                        },
                    );
                },
            );
        });
    }
}

/// Near pairs, ordered by (i, j); a pair has an entry for each image in range.
pub struct NearPairs<S: FarSpace> {
    pub(super) list: Vec<NearPair<S>>,
    /// Where those of each first sphere start, then their number.
    pub(super) starts: Vec<usize>,
}

impl<S: FarSpace> NearPairs<S> {
    fn spheres(&self) -> usize {
        self.starts.len() - 1
    }

    /// Visits the pairs that have a sphere in a range: see [`for_pairs_of`].
    #[inline(always)]
    fn for_pairs_of(&self, range: &Range<usize>, mut visit: impl FnMut(&NearPair<S>, [bool; 2])) {
        let second = |at: usize| self.list[at].1;
        for_pairs_of(
            range,
            &self.starts,
            second,
            #[inline(always)]
            |at, has| visit(&self.list[at], has),
        );
    }
}

/// Two vectors sphere by sphere, and their products.
pub struct SideBySide<S: FarSpace> {
    pub(super) vectors: Vec<S::PerAnyMode<[f64; 2]>>,
    pub(super) products: Vec<S::PerAnyMode<[f64; 2]>>,
}

/// The block of sphere i from sphere j.
pub(super) type NearPair<S> = (
    usize,
    usize,
    <<S as FarSpace>::NearPart as NearPart<S>>::Block,
);

impl FarSpace for Layer {
    type PerComponent<T: Copy + Send + Sync> = [T; 2];
    type NearPart = RealSpace;
    const PAIR_COST: f64 = 25.0;
    const GRID_COSTS: [f64; 2] = [2.0, 10.0];
    const LEAST_SPLITTING: f64 = 3.01;
    const COUNTS_IMAGES: bool = false;

    #[inline(always)]
    fn embedded(&[x, y, spin, e1, e2, e3]: &[f64; 6]) -> Modes {
        [x, y, 0.0, 0.0, 0.0, spin, e1, e2, e3, 0.0, 0.0]
    }

    #[inline(always)]
    fn restricted(&[x, y, _, _, _, spin, e1, e2, e3, _, _]: &Modes) -> [f64; 6] {
        [x, y, spin, e1, e2, e3]
    }

    fn splitting(alpha: f64, content: f64, radii: &[f64], tolerance: f64) -> Splitting {
        ewald::cut_offs(alpha, content, radii, tolerance)
    }

    fn transforms(k: &Vec2, alpha: f64) -> [f64; 3] {
        wave_space::transforms(*k, alpha)
    }
}

impl NearPart<Layer> for RealSpace {
    type Block = ModeBlock;

    fn new(splitting: Splitting, radii: &[f64], tolerance: f64) -> Self {
        let size = FiniteSize::new(radii[0]);
        let equal = radii.iter().all(|a| a.to_bits() == radii[0].to_bits());
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        Self::new(
            splitting.alpha,
            splitting.distance,
            1.99 * smallest,
            0.1 * tolerance,
            equal.then(|| size.factors(&size)),
        )
    }

    #[inline(always)]
    fn block(&self, x: &Vec2, i: &FiniteSize, j: &FiniteSize) -> ModeBlock {
        let [point, laplacian] = self.single(*x);
        if self.is_of_equal_spheres() {
            return kernels::blocks(&point, &point).to_modes();
        }
        let ij = kernels::finite_size(&point, &laplacian, &i.factors(j));
        let ji = kernels::finite_size(&point, &laplacian, &j.factors(i));
        kernels::blocks(&ij, &ji).to_modes()
    }

    fn unbounded(x: &Vec2, i: &FiniteSize, j: &FiniteSize) -> ModeBlock {
        let [ij, ji] = pair_lanes(*x, i, j);
        kernels::blocks(&ij, &ji).to_modes()
    }

    #[inline(always)]
    fn add_to_first(block: &ModeBlock, of_second: &[f64; 6], to_first: &mut [f64; 6]) {
        for (c, column) in block.data.0.iter().enumerate() {
            for r in 0..6 {
                to_first[r] = column[r].mul_add(of_second[c], to_first[r]);
            }
        }
    }

    #[inline(always)]
    fn add_to_second(block: &ModeBlock, of_first: &[f64; 6], to_second: &mut [f64; 6]) {
        for (to, column) in to_second.iter_mut().zip(&block.data.0) {
            *to += (column[0] * of_first[0] + column[1] * of_first[1])
                + (column[2] * of_first[2] + column[3] * of_first[3])
                + (column[4] * of_first[4] + column[5] * of_first[5]);
        }
    }
}

impl FarSpace for Bulk {
    type PerComponent<T: Copy + Send + Sync> = [T; 3];
    type NearPart = Screened;
    const PAIR_COST: f64 = 18.0;
    const GRID_COSTS: [f64; 2] = [2.4, 21.0];
    const LEAST_SPLITTING: f64 = 0.5;
    const COUNTS_IMAGES: bool = true;

    #[inline(always)]
    fn embedded(modes: &Modes) -> Modes {
        *modes
    }

    #[inline(always)]
    fn restricted(modes: &Modes) -> Modes {
        *modes
    }

    fn splitting(alpha: f64, content: f64, radii: &[f64], tolerance: f64) -> Splitting {
        dense_mobility::cut_offs(alpha, content, radii, tolerance)
    }

    fn transforms(k: &Vector3<f64>, alpha: f64) -> [f64; 3] {
        let square = k.norm_squared();
        let gamma = dense_mobility::transform(square, alpha);
        [-gamma / square, -gamma, -gamma * square]
    }
}

/// The screened Green's function of a suspension.
pub struct Screened {
    /// Splitting parameter α, in 1/a.
    alpha: f64,
}

/// A coupling and its direction.
#[derive(Clone, Copy)]
pub struct Directed {
    normal: Vector3<f64>,
    coupling: Coupling,
}

/// The block of two spheres from a Green's function.
#[inline(always)]
fn directed(x: &Vector3<f64>, chain: &RadialChain, i: &FiniteSize, j: &FiniteSize) -> Directed {
    Directed {
        normal: x.normalize(),
        coupling: finite_size(&couplings(chain), i, j),
    }
}

impl NearPart<Bulk> for Screened {
    type Block = Directed;

    fn new(splitting: Splitting, _: &[f64], _: f64) -> Self {
        Self {
            alpha: splitting.alpha,
        }
    }

    #[inline(always)]
    fn block(&self, x: &Vector3<f64>, i: &FiniteSize, j: &FiniteSize) -> Directed {
        directed(
            x,
            &RadialChain::screened(x.norm_squared(), self.alpha),
            i,
            j,
        )
    }

    fn unbounded(x: &Vector3<f64>, i: &FiniteSize, j: &FiniteSize) -> Directed {
        directed(x, &RadialChain::distance(x.norm_squared()), i, j)
    }

    #[inline(always)]
    fn add_to_first(block: &Directed, of_second: &Modes, to_first: &mut Modes) {
        block.coupling.add(&block.normal, of_second, to_first);
    }

    #[inline(always)]
    fn add_to_second(block: &Directed, of_first: &Modes, to_second: &mut Modes) {
        let coupling = block.coupling.transposed();
        coupling.add(&block.normal, of_first, to_second);
    }

    /// Two vectors are multiplied side by side, for both spheres of a pair, or for two pairs of
    /// which only one sphere is computed.
    fn add_all(pairs: &NearPairs<Bulk>, x: &[Modes], y: &mut [Modes], work: &mut SideBySide<Bulk>) {
        let spheres = pairs.spheres();
        if x.len() != 2 * spheres {
            return add_one_by_one::<Bulk>(pairs, x, y);
        }
        let SideBySide { vectors, products } = work;
        let (first, second) = x.split_at(spheres);
        for ((both, first), second) in vectors.iter_mut().zip(first).zip(second) {
            for k in 0..MODES {
                both[k] = [first[k], second[k]];
            }
        }
        let vectors = &*vectors;
        threads::divide(products, LEAST_SPHERES, &|first, products| {
            vectorised(
                #[inline(always)]
                || multiply_side_by_side(pairs, vectors, first, products),
            );
        });
        let (first, second) = y.split_at_mut(spheres);
        for ((products, first), second) in products.iter().zip(first).zip(second) {
            for k in 0..MODES {
                first[k] += products[k][0];
                second[k] += products[k][1];
            }
        }
    }
}

/// Computes the products of two vectors for the spheres from `first` on: for both spheres of a pair
/// side by side, or for two pairs of which only one sphere is among them.
#[inline(always)]
fn multiply_side_by_side(
    pairs: &NearPairs<Bulk>,
    vectors: &[[[f64; 2]; MODES]],
    first: usize,
    products: &mut [[[f64; 2]; MODES]],
) {
    let end = first + products.len();
    products.fill([[0.0; 2]; MODES]);
    let second = |at: usize| pairs.list[at].1;
    for (i, v) in vectors.iter().enumerate().take(first) {
        let all = pairs.starts[i]..pairs.starts[i + 1];
        let mut own = part_of(all, second, first, end);
        while let Some(at) = own.next() {
            let next = own.next();
            let [(_, j, a), (_, other, b)] = [at, next.unwrap_or(at)].map(|at| &pairs.list[at]);
            let both = Coupling::side_by_side(&a.coupling.transposed(), &b.coupling.transposed());
            let product = product_side_by_side([&a.normal, &b.normal], &both, [v, v]);
            add_half(&product, 0, &mut products[j - first]);
            if next.is_some() {
                add_half(&product, 2, &mut products[other - first]);
            }
        }
    }
    for i in first..end {
        let all = pairs.starts[i]..pairs.starts[i + 1];
        let within = part_of(all.clone(), second, 0, end);
        let mut beyond = within.end..all.end;
        for (_, j, Directed { normal, coupling }) in &pairs.list[within] {
            let both = Coupling::side_by_side(coupling, &coupling.transposed());
            let of = [&vectors[*j], &vectors[i]];
            let product = product_side_by_side([normal; 2], &both, of);
            add_half(&product, 0, &mut products[i - first]);
            add_half(&product, 2, &mut products[j - first]);
        }
        while let Some(at) = beyond.next() {
            let next = beyond.next();
            let [(_, j, a), (_, other, b)] = [at, next.unwrap_or(at)].map(|at| &pairs.list[at]);
            let both = Coupling::side_by_side(&a.coupling, &b.coupling);
            let of = [&vectors[*j], &vectors[*other]];
            let product = product_side_by_side([&a.normal, &b.normal], &both, of);
            add_half(&product, 0, &mut products[i - first]);
            if next.is_some() {
                add_half(&product, 2, &mut products[i - first]);
            }
        }
    }
}

/// The products of two couplings with two vectors.
#[inline(always)]
fn product_side_by_side(
    [a, b]: [&Vector3<f64>; 2],
    coupling: &Coupling<Lanes>,
    [of_a, of_b]: [&[[f64; 2]; MODES]; 2],
) -> [Lanes; MODES] {
    let none = Lanes([0.0; 4]);
    let (mut of, mut to) = ([none; MODES], [none; MODES]);
    for k in 0..MODES {
        of[k] = Lanes([of_a[k][0], of_a[k][1], of_b[k][0], of_b[k][1]]);
    }
    let n = [both(a.x, b.x), both(a.y, b.y), both(a.z, b.z)];
    coupling.add_product(&n, &of, &mut to);
    to
}

/// Adds one of two products, by its first lane.
#[inline(always)]
fn add_half(product: &[Lanes; MODES], lane: usize, to: &mut [[f64; 2]; MODES]) {
    for k in 0..MODES {
        to[k][0] += product[k].0[lane];
        to[k][1] += product[k].0[lane + 1];
    }
}
