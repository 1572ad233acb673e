//! Grand resistance of a suspension, eleven modes a sphere.
//!
//! ```text
//! (F, T, S~) = R (v, −E),   v = (U − u∞, Ω − Ω∞)
//! Stokesian Dynamics:  R = R_far + Σ_pairs [R2B − R2B_inf],   R_far = M⁻¹
//! Ball-Melrose:        R = diag(6π a, 8π a³, (20/3)π a³) + Σ_pairs [R2B − R2B_inf]
//! Lubrication:         R = diag(6π a, 8π a³, (20/3)π a³) + Σ_pairs of the leading singular terms of R2B
//! ```
//!
//! As [`crate::hydrodynamics::resistance`], from the same scalar functions and tables; X^C is added. Pairs count up to
//! `s' = 2r/(a_i + a_j) < 4`; two spheres alone in unbounded fluid count at any distance and are then exact under Stokesian Dynamics.
//! Velocities and forces are ordered `(U, Ω)` sphere by sphere, `[6N]`. [`Resistance`] is full and factored, for few spheres;
//! [`SparseResistance`] is held pair by pair and has the far field iterated on top, for many.

mod sparse;

pub(crate) use sparse::SparseResistance;

use crate::error::Error;
use crate::hydrodynamics::far_field::bulk::{DenseMobility, self_mobility};
use crate::hydrodynamics::resistance::{BySizes, NearFields, NearTerms};
use crate::hydrodynamics::two_sphere::{Coupling, MODES, Modes, Motion, PairTerm, TwistTable};
use crate::linalg::cholesky::skyline::SkylineCholesky;
use crate::linalg::cholesky::trailing::trailing_inverse;
use crate::linalg::dense::Matrix;
use crate::linalg::simd::vectorised;
use crate::model::Hydrodynamics;
use crate::space::Bulk;
use crate::space::cell::Cell;
use crate::space::cell::LUBRICATION_RANGE;
use crate::space::neighbours::NeighbourList;
use crate::space::pair::Neighbours;
use nalgebra::{SVector, Vector3};

/// Five components of a strain or a stresslet, see [`crate::bulk`].
pub(crate) type Strain = SVector<f64, 5>;

/// The near-field terms of all pairs in range: for each its blocks (i, i), (j, i), (j, j).
pub(crate) struct NearPart {
    radii: Vec<f64>,
    near: NearTerms,
    /// X^C of exact pairs.
    twists: Option<BySizes<TwistTable>>,
    /// Range of the pair sum in s'.
    range: f64,
    /// Whether surfaces may overlap.
    admits_overlap: bool,
    neighbours: NeighbourList<Bulk>,
    terms: Vec<PairTerm>,
    blocks: Vec<[Coupling; 3]>,
}

impl NearPart {
    /// The terms of spheres of the given radii in cells of the given sides.
    ///
    /// # Errors
    /// No sphere, a cell thinner than twice the lubrication range, a size ratio outside 0.01 to 100.
    pub(crate) fn new(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<Bulk>,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        if radii.is_empty() {
            return Err(Error::NoSpheres);
        }
        cell.check_range(radii)?;
        let twists = match hydrodynamics {
            Hydrodynamics::Lubrication(_) => None,
            Hydrodynamics::StokesianDynamics | Hydrodynamics::BallMelrose => {
                Some(BySizes::new(radii, |radii| Ok(TwistTable::new(radii)))?)
            }
        };
        let range = match (hydrodynamics.leading_order(), cell) {
            (Some(numbers), _) => 2.0 + numbers.cutoff,
            (None, Cell::Unbounded) if radii.len() == 2 => f64::INFINITY,
            (None, _) => LUBRICATION_RANGE,
        };
        Ok(Self {
            radii: radii.to_vec(),
            near: NearTerms::new(hydrodynamics, radii, tables)?,
            twists,
            range,
            admits_overlap: hydrodynamics.admits_overlap(),
            neighbours: NeighbourList::default(),
            terms: Vec::new(),
            blocks: Vec::new(),
        })
    }

    /// Finds the pairs in range and their terms.
    ///
    /// # Errors
    /// [`Error::Overlap`].
    pub(crate) fn update(
        &mut self,
        cell: &Cell<Bulk>,
        centres: &[Vector3<f64>],
    ) -> Result<(), Error> {
        let Self {
            radii,
            neighbours,
            terms,
            blocks,
            twists,
            ..
        } = self;
        neighbours.find(cell, centres, radii, self.range);
        for pair in neighbours.pairs() {
            if pair.distance == 0.0 || pair.gap <= 0.0 && !self.admits_overlap {
                return Err(pair.overlap());
            }
        }
        let pairs = neighbours.pairs();
        let gaps = pairs.iter().map(|pair| ([pair.i, pair.j], pair.gap));
        self.near.evaluate(radii, gaps, f64::NEG_INFINITY, terms);
        blocks.clear();
        vectorised(
            #[inline(always)]
            || {
                for (pair, term) in pairs.iter().zip(&*terms) {
                    let twist = twists.as_ref().map_or([0.0; 3], |tables| {
                        tables.of(pair.i, pair.j).evaluate(pair.gap)
                    });
                    blocks.push(term.couplings(twist));
                }
            },
        );
        Ok(())
    }

    /// Pairs in range, ordered by (i, j).
    pub(crate) fn pairs(&self) -> &[Neighbours<Bulk>] {
        self.neighbours.pairs()
    }

    /// Of each pair, its blocks (i, i), (j, i), (j, j).
    fn blocks(&self) -> &[[Coupling; 3]] {
        &self.blocks
    }

    /// Radii, in a.
    pub(crate) fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Adds the terms times all modes `x` of all spheres to `y`.
    pub(crate) fn add(&self, x: &[Modes], y: &mut [Modes]) {
        vectorised(
            #[inline(always)]
            || {
                for (pair, [own_i, coupling, own_j]) in self.pairs().iter().zip(&self.blocks) {
                    let (n, i, j) = (&pair.normal, pair.i, pair.j);
                    own_i.add(n, &x[i], &mut y[i]);
                    own_j.add(n, &x[j], &mut y[j]);
                    coupling.add(n, &x[i], &mut y[j]);
                    coupling.transposed().add(n, &x[j], &mut y[i]);
                }
            },
        );
    }

    /// Adds to y the forces that spheres have from the velocities v of the others.
    fn add_forces_from_others(&self, v: &[Motion], y: &mut [Motion]) {
        vectorised(
            #[inline(always)]
            || {
                for (pair, [_, coupling, _]) in self.pairs().iter().zip(&self.blocks) {
                    let (n, i, j) = (&pair.normal, pair.i, pair.j);
                    coupling.add_forces(n, &v[i], &mut y[j]);
                    coupling.transposed().add_forces(n, &v[j], &mut y[i]);
                }
            },
        );
    }

    /// Adds what forces and torques have of velocities to the lower triangle of `R_FU`, `[6N × 6N]`.
    fn add_to_matrix(&self, matrix: &mut Matrix) {
        for (pair, [own_i, coupling, own_j]) in self.pairs().iter().zip(&self.blocks) {
            let [i, j] = [pair.i, pair.j];
            for ([p, q], block) in [([i, i], own_i), ([j, j], own_j), ([j, i], coupling)] {
                let block = block.force_matrix(&pair.normal);
                for (from, entries) in block.iter().enumerate() {
                    let column = 6 * q + from;
                    for (to, entry) in entries.iter().enumerate() {
                        let row = 6 * p + to;
                        if row >= column {
                            matrix[(row, column)] += entry;
                        }
                    }
                }
            }
        }
    }
}

/// Drag of an isolated sphere: 6πa, 8πa³, (20/3)πa³.
pub(crate) fn isolated(radius: f64) -> [f64; 3] {
    let own = self_mobility(radius);
    [
        own.force_velocity[0],
        own.torque_rotation[0],
        own.stress_strain[0],
    ]
    .map(f64::recip)
}

/// The far field of all spheres as a factored mobility.
struct DenseFar {
    mobility: DenseMobility,
    /// M, then its factor.
    factor: SkylineCholesky,
    /// Scratch of the inverse of a block.
    inverse: Matrix,
}

/// Grand resistance at one set of positions, `R_FU` full and factored.
pub(crate) struct Resistance {
    near: NearPart,
    /// Stokesian Dynamics; others have isolated drag.
    far: Option<DenseFar>,
    /// `R_FU`, then its factor.
    factor: SkylineCholesky,
}

impl Resistance {
    /// Workspace for spheres in cells of the given sides; with the far field if `is_full`, else with isolated drag.
    ///
    /// # Errors
    /// Those of [`DenseMobility::new`].
    pub(crate) fn new(near: NearPart, cell: &Cell<Bulk>, is_full: bool) -> Result<Self, Error> {
        let far = if is_full {
            let mobility = DenseMobility::new(cell, near.radii(), DenseMobility::TOLERANCE)?;
            Some(DenseFar {
                mobility,
                factor: SkylineCholesky::default(),
                inverse: Matrix::default(),
            })
        } else {
            None
        };
        Ok(Self {
            near,
            far,
            factor: SkylineCholesky::default(),
        })
    }

    /// Assembles and factors at new positions; the cell's sides must be those of [`Resistance::new`].
    ///
    /// # Errors
    /// [`Error::Overlap`], [`Error::NotPositiveDefinite`].
    pub(crate) fn update(
        &mut self,
        cell: &Cell<Bulk>,
        centres: &[Vector3<f64>],
    ) -> Result<(), Error> {
        self.near.update(cell, centres)?;
        let n = centres.len();
        let matrix = self.factor.full_matrix();
        if let Some(far) = &mut self.far {
            far.mobility.fill(cell, centres, far.factor.full_matrix())?;
            far.factor
                .factor()
                .map_err(|bad| Error::NotPositiveDefinite {
                    matrix: "far-field mobility",
                    pivot: bad.pivot,
                    sphere: bad
                        .pivot
                        .checked_sub(5 * n)
                        .map_or(bad.pivot / 5, |row| row / 6),
                })?;
            trailing_inverse(far.factor.lower(), 5 * n, &mut far.inverse, matrix);
        } else {
            matrix.reset(6 * n, 6 * n);
            for (i, &radius) in self.near.radii().iter().enumerate() {
                let drag = isolated(radius);
                for k in 0..6 {
                    matrix[(6 * i + k, 6 * i + k)] = drag[k / 3];
                }
            }
        }
        self.near.add_to_matrix(matrix);
        self.factor
            .factor()
            .map_err(|bad| Error::NotPositiveDefinite {
                matrix: "force-velocity resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / 6,
            })
    }

    /// `R (v, −e)` for disturbances v `[6N]` in the background strain: forces and torques `[6N]`, and the stresslets S = −S~.
    pub(crate) fn apply(&self, velocities: &[f64], strain: &Strain) -> (Vec<f64>, Vec<Strain>) {
        let n = self.near.radii().len();
        let modes: Vec<Modes> = (0..n)
            .map(|i| {
                std::array::from_fn(|k| match k {
                    0..6 => velocities[6 * i + k],
                    _ => -strain[k - 6],
                })
            })
            .collect();
        let mut results = self.far_forces(&modes);
        self.near.add(&modes, &mut results);
        let forces = results.iter().flat_map(|y| y[..6].to_vec()).collect();
        let stresslets = results
            .iter()
            .map(|y| -Strain::from_column_slice(&y[6..]))
            .collect();
        (forces, stresslets)
    }

    /// `R_far` or isolated drag times the modes of all spheres.
    fn far_forces(&self, modes: &[Modes]) -> Vec<Modes> {
        let n = modes.len();
        let Some(far) = &self.far else {
            let spheres = modes.iter().zip(self.near.radii());
            return spheres
                .map(|(x, &radius)| {
                    let drag = isolated(radius);
                    std::array::from_fn(|k| drag[(k / 3).min(2)] * x[k])
                })
                .collect();
        };
        let mut rows = vec![0.0; MODES * n];
        for (i, x) in modes.iter().enumerate() {
            for (k, &x) in x.iter().enumerate() {
                rows[DenseMobility::row(n, i, k)] = x;
            }
        }
        far.factor.solve(&mut rows);
        (0..n)
            .map(|i| std::array::from_fn(|k| rows[DenseMobility::row(n, i, k)]))
            .collect()
    }

    /// `x ← R_FU⁻¹ x`, `[6N]`.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        self.factor.solve(x);
    }
}
