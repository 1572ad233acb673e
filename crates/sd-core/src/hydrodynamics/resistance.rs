//! Grand resistance of all spheres, and the factored solve for their velocities.
//!
//! ```text
//! (F, T, S~) = R (v, −E),   v = (U − u∞, Ω − Ω∞)
//! Stokesian Dynamics:  R = R_far + Σ_pairs [R2B − R2B_inf]
//! Ball-Melrose:        R = diag(6π a, 8π a³, (20/3)π a³) + Σ_pairs [R2B − R2B_inf]
//! ```
//!
//! Every pair term is positive semidefinite, so R is positive definite in both. Pairs count up to
//! `s' = 2r/(a_i + a_j) < 4` in a cell and in clusters; two spheres alone in unbounded fluid count at any distance and are
//! then exact under Stokesian Dynamics. Velocities and forces are ordered `(x, y, rotation)` sphere by sphere, `[3N]`.

mod order;
mod pairwise;

use crate::error::Error;
use crate::geometry::cell::{Cell, LUBRICATION_RANGE};
use crate::geometry::modes::Vec2;
use crate::geometry::neighbours::{MOST_NEIGHBOURS, NeighbourList};
use crate::geometry::pair::Neighbours;
use crate::hydrodynamics::far_field::{DEFAULT_TOLERANCE, FarField, FarResistance};
use crate::hydrodynamics::two_sphere::{NearField, PairTerm};
use crate::linalg::cholesky::skyline::ProfileCholesky;
use crate::linalg::dense::Matrix;
use crate::linalg::simd::vectorised;
use crate::params::Hydrodynamics;
use nalgebra::{SVector, Vector3};
use order::Order;
pub use pairwise::Network;
use std::f64::consts::PI;
use std::sync::Arc;

/// Near-field tables by size ratio, shared between runs.
#[derive(Debug, Clone, Default)]
pub struct NearFields {
    /// Tables of unequal spheres; equal ones are in the program.
    tables: Vec<Arc<NearField>>,
}

impl NearFields {
    /// The size ratios, larger over smaller radius, that a set of radii needs besides 1, in increasing order.
    pub fn ratios(radii: &[f64]) -> Vec<f64> {
        let mut distinct: Vec<f64> = radii.to_vec();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let mut ratios: Vec<f64> = distinct
            .iter()
            .enumerate()
            .flat_map(|(k, a)| distinct[k + 1..].iter().map(move |b| b / a))
            .collect();
        ratios.sort_by(f64::total_cmp);
        ratios.dedup_by(|a, b| same_ratio(*a, *b));
        ratios
    }

    /// Adds a table made elsewhere, such as one kept on disk.
    pub fn insert(&mut self, table: NearField) {
        self.tables.push(Arc::new(table));
    }

    /// Whether the table of a size ratio (≥ 1) is here.
    pub fn contains(&self, size_ratio: f64) -> bool {
        self.find(size_ratio).is_some()
    }

    /// The table of a size ratio (≥ 1).
    fn find(&self, size_ratio: f64) -> Option<&Arc<NearField>> {
        self.tables
            .iter()
            .find(|t| same_ratio(t.size_ratio(), size_ratio))
    }
}

/// Whether two size ratios are one up to rounding.
fn same_ratio(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a
}

/// Grand resistance at one set of positions, factored, with its workspace.
pub struct Resistance {
    /// Radii, in a.
    radii: Vec<f64>,
    /// Table of each pair of species.
    tables: Vec<Arc<NearField>>,
    /// Species of each sphere.
    species: Vec<usize>,
    /// Number of species.
    species_count: usize,
    /// Range of the pair sum in s'.
    range: f64,
    /// Pairs in range.
    neighbours: NeighbourList,
    /// Their near-field terms.
    terms: Vec<PairTerm>,
    /// Far field under Stokesian Dynamics.
    pub(in crate::hydrodynamics) far: Option<FarResistance>,
    /// Factor of R_FU.
    factor: ProfileCholesky,
    /// Order of the spheres in the factor.
    order: Order,
    /// Work vector of the far field, `[6N]`.
    far_vector: Vec<f64>,
    /// Gap below which near-field terms are those of this gap, in a.
    lubrication_gap: f64,
    /// `R_FU` pair by pair, where there is no factor.
    network: Option<Box<Network>>,
}

impl Resistance {
    /// Workspace for spheres of the given radii, in cells of the given sides.
    ///
    /// Tables that `tables` lacks are made here, which costs seconds per size ratio.
    ///
    /// # Errors
    /// No sphere, a cell thinner than twice the lubrication range, a size ratio outside 0.01 to 100.
    pub fn new(
        hydrodynamics: Hydrodynamics,
        cell: &Cell,
        radii: &[f64],
        tables: &NearFields,
    ) -> Result<Self, Error> {
        let factor = ProfileCholesky::new(3 * radii.len());
        Self::with_factor(hydrodynamics, cell, radii, tables, factor)
    }

    /// As [`Resistance::new`] for Ball-Melrose hydrodynamics, with `R_FU` held as a [`Network`] in place of a factor: O(N), for many
    /// spheres with rigid contacts or none.
    ///
    /// `listed`: pairs of the near part's pattern where a run goes on, ordered; else empty.
    ///
    /// # Errors
    /// Those of [`Resistance::new`]; [`Error::OutOfMemory`].
    pub fn as_network(
        cell: &Cell,
        radii: &[f64],
        tables: &NearFields,
        listed: &[(u32, u32)],
    ) -> Result<Self, Error> {
        let (kind, factor) = (Hydrodynamics::BallMelrose, ProfileCholesky::default());
        let mut resistance = Self::with_factor(kind, cell, radii, tables, factor)?;
        resistance.network = Some(Box::new(Network::new(radii.len(), listed)?));
        Ok(resistance)
    }

    /// With the factor's workspace.
    fn with_factor(
        hydrodynamics: Hydrodynamics,
        cell: &Cell,
        radii: &[f64],
        tables: &NearFields,
        factor: ProfileCholesky,
    ) -> Result<Self, Error> {
        if radii.is_empty() {
            return Err(Error::NoSpheres);
        }
        cell.check_range(radii)?;
        let mut sizes: Vec<f64> = radii.to_vec();
        sizes.sort_by(f64::total_cmp);
        sizes.dedup();
        let species = radii
            .iter()
            .map(|a| sizes.partition_point(|b| b < a))
            .collect();
        let mut known = tables.clone();
        let equal = Arc::new(NearField::equal_spheres());
        let mut by_species = Vec::with_capacity(sizes.len() * sizes.len());
        for &a in &sizes {
            for &b in &sizes {
                let ratio = a.max(b) / a.min(b);
                if a == b {
                    by_species.push(Arc::clone(&equal));
                    continue;
                }
                if !known.contains(ratio) {
                    known.insert(NearField::new(ratio)?);
                }
                by_species.extend(known.find(ratio).cloned());
            }
        }
        let range = if *cell == Cell::Unbounded && radii.len() == 2 {
            f64::INFINITY
        } else {
            LUBRICATION_RANGE
        };
        let far = match hydrodynamics {
            Hydrodynamics::StokesianDynamics => {
                let far_field = FarField::new(cell, radii, DEFAULT_TOLERANCE)?;
                Some(FarResistance::new(far_field))
            }
            Hydrodynamics::BallMelrose => None,
        };
        Ok(Self {
            radii: radii.to_vec(),
            tables: by_species,
            species,
            species_count: sizes.len(),
            range,
            neighbours: NeighbourList::new(radii.len()),
            terms: Vec::with_capacity(MOST_NEIGHBOURS * radii.len() / 2),
            far,
            factor,
            order: Order::new(radii.len()),
            far_vector: Vec::new(),
            lubrication_gap: 0.0,
            network: None,
        })
    }

    /// For soft spheres: near-field terms below a gap are those at that gap, and surfaces may overlap by less than `deepest`, in a.
    pub fn regularise(&mut self, lubrication_gap: f64, deepest: f64) {
        self.lubrication_gap = lubrication_gap;
        self.neighbours.allow_overlap(deepest);
    }

    /// Assembles and factors at new positions. The cell's sides must be those of [`Resistance::new`]; its offset is free.
    ///
    /// # Errors
    /// [`Error::Overlap`], [`Error::NotPositiveDefinite`].
    pub fn update(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        self.assemble(cell, centres)?;
        self.factor()
    }

    /// The first half of [`Resistance::update`]: far field, pair terms, `R_FU`. [`Resistance::factor`] must follow.
    ///
    /// # Errors
    /// [`Error::Overlap`]; [`Error::NotPositiveDefinite`] for the far-field mobility.
    pub fn assemble(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        self.neighbours
            .update(cell, centres, &self.radii, self.range)?;
        self.evaluate_terms();
        if let Some(network) = &mut self.network {
            let drags = self.radii.iter().map(|&a| isolated_drag(a));
            let pairs = self.neighbours.pairs();
            return network.assemble(pairs, &self.terms, &self.radii, drags);
        }
        let n = self.radii.len();
        if let Some(far) = &mut self.far {
            let matrix = self.factor.full_matrix();
            far.update(cell, centres, matrix)?;
            if matches!(cell, Cell::Periodic { .. }) {
                resist_uniform_motion(matrix);
            }
        } else {
            self.order.update(cell, centres, self.neighbours.pairs());
            let ends = (0..3 * n).map(|row| self.order.ends[row / 3]);
            let matrix = self.factor.matrix_of_profile(3 * n, ends, self.order.tail);
            for (&row, &a) in self.order.rows.iter().zip(&self.radii) {
                let drag = isolated_drag(a);
                for m in 0..3 {
                    matrix[(row + m, row + m)] = drag[m];
                }
            }
        }
        self.add_terms();
        Ok(())
    }

    /// Near-field terms of all pairs.
    fn evaluate_terms(&mut self) {
        let (tables, species, count) = (&self.tables, &self.species, self.species_count);
        let (radii, terms) = (&self.radii, &mut self.terms);
        let least = self.lubrication_gap;
        let pairs = self.neighbours.pairs();
        terms.clear();
        vectorised(
            #[inline(always)]
            || {
                for pair in pairs {
                    let (i, j) = (pair.i, pair.j);
                    let table = &tables[count * species[i] + species[j]];
                    terms.push(table.evaluate(radii[i], radii[j], pair.gap.max(least)));
                }
            },
        );
    }

    /// Adds the near-field terms to `R_FU`, lower triangle.
    fn add_terms(&mut self) {
        let matrix = self.factor.filled_matrix();
        for (pair, term) in self.neighbours.pairs().iter().zip(&self.terms) {
            let n = pair.normal;
            let (i, j) = (self.order.rows[pair.i], self.order.rows[pair.j]);
            for (first, block) in [(i, term.block(n, 0, 0)), (j, term.block(n, 1, 1))] {
                for (column, entries) in block.into_iter().enumerate() {
                    let own = &mut matrix.column_mut(first + column)[first..first + 3];
                    for row in column..3 {
                        own[row] += entries[row];
                    }
                }
            }
            // The coupling stands below the diagonal, in the columns of the sphere that comes first.
            let (first, second, block) = if i < j {
                (i, j, term.block(n, 1, 0))
            } else {
                (j, i, term.block(n, 0, 1))
            };
            for (column, entries) in block.into_iter().enumerate() {
                let coupling = &mut matrix.column_mut(first + column)[second..second + 3];
                for (value, entry) in coupling.iter_mut().zip(entries) {
                    *value += entry;
                }
            }
        }
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity to the assembled `R_FU`: a resistance along the line of centres, which the
    /// fluid has no part in. Neither [`Resistance::apply`] nor [`Resistance::background_forces`] knows of it.
    pub fn add_spring(&mut self, pair: &Neighbours, slope: f64) {
        let (i, j) = (self.order.rows[pair.i], self.order.rows[pair.j]);
        let (first, second) = if i < j { (i, j) } else { (j, i) };
        let n = pair.normal;
        let matrix = self.factor.filled_matrix();
        for column in 0..2 {
            for row in 0..2 {
                let value = slope * n[row] * n[column];
                if row >= column {
                    matrix[(first + row, first + column)] += value;
                    matrix[(second + row, second + column)] += value;
                }
                matrix[(second + row, first + column)] -= value;
            }
        }
    }

    /// The second half of [`Resistance::update`]: factors `R_FU` in place, once for every [`Resistance::assemble`]. Nothing for a network.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn factor(&mut self) -> Result<(), Error> {
        if self.network.is_some() {
            return Ok(());
        }
        self.factor
            .factor()
            .map_err(|bad| Error::NotPositiveDefinite {
                matrix: "force-velocity resistance",
                pivot: bad.pivot,
                sphere: self.order.spheres[bad.pivot / 3],
            })
    }

    /// `R_FU` pair by pair, where there is no factor.
    pub fn network(&self) -> Option<&Network> {
        self.network.as_deref()
    }

    /// Radii, in a.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Pairs in range, ordered by (i, j).
    pub fn neighbours(&self) -> &[Neighbours] {
        self.neighbours.pairs()
    }

    /// Factor of R_FU, `[3N × 3N]`, its rows in the order of [`Resistance::row`].
    pub fn solver(&self) -> &ProfileCholesky {
        &self.factor
    }

    /// First row of a sphere in the factor.
    pub fn row(&self, sphere: usize) -> usize {
        self.order.rows[sphere]
    }

    /// Puts a vector `[3N]` into the order of the factor's rows.
    pub fn to_rows(&self, vector: &[f64], rows: &mut Vec<f64>) {
        rows.clear();
        for &sphere in &self.order.spheres {
            rows.extend_from_slice(&vector[3 * sphere..3 * sphere + 3]);
        }
    }

    /// Puts a vector in the order of the factor's rows back into that of the spheres, `[3N]`.
    pub fn from_rows(&self, rows: &[f64], vector: &mut [f64]) {
        for (v, &row) in vector.chunks_exact_mut(3).zip(&self.order.rows) {
            v.copy_from_slice(&rows[row..row + 3]);
        }
    }

    /// Inverse slip mobility K of the pair, alone in unbounded fluid, in mu·a.
    pub fn slip_resistance(&self, pair: &Neighbours) -> f64 {
        let table = &self.tables[self.species_count * self.species[pair.i] + self.species[pair.j]];
        let gap = pair.gap.max(self.lubrication_gap);
        table.slip_resistance(self.radii[pair.i], self.radii[pair.j], gap)
    }

    /// Forces `R_FE e` with which the background strain `(e1, e2, e3)` drives the spheres, `[3N]`.
    pub fn background_forces(&mut self, strain: &Vector3<f64>, forces: &mut [f64]) {
        match &self.far {
            Some(far) => {
                let n = self.radii.len();
                self.far_vector.clear();
                self.far_vector.resize(6 * n, 0.0);
                for e in self.far_vector[..3 * n].chunks_exact_mut(3) {
                    e.copy_from_slice(strain.as_slice());
                }
                far.apply_for_forces(&mut self.far_vector);
                forces.copy_from_slice(&self.far_vector[3 * n..]);
            }
            None => forces.fill(0.0),
        }
        for (pair, term) in self.neighbours.pairs().iter().zip(&self.terms) {
            add_pair(
                forces,
                pair,
                &term.force_from_strain(pair.normal, strain, strain),
            );
        }
    }

    /// `R (v, −e)`: counterforces `R_FU v − R_FE e` `[3N]` and stresslets `S = R_SE e − R_SU v` of (20), for disturbances v `[3N]`.
    ///
    /// `work` is scratch.
    pub fn apply(
        &self,
        velocities: &[f64],
        strain: &Vector3<f64>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<Vector3<f64>>,
    ) {
        let n = self.radii.len();
        forces.clear();
        stresslets.clear();
        if let Some(far) = &self.far {
            let x = work;
            x.clear();
            x.resize(6 * n, 0.0);
            for e in x[..3 * n].chunks_exact_mut(3) {
                e.copy_from_slice((-strain).as_slice());
            }
            x[3 * n..].copy_from_slice(velocities);
            far.apply(x);
            forces.extend_from_slice(&x[3 * n..]);
            stresslets.extend(
                x[..3 * n]
                    .chunks_exact(3)
                    .map(|s| -Vector3::from_column_slice(s)),
            );
        } else {
            for (v, &a) in velocities.chunks_exact(3).zip(&self.radii) {
                let drag = isolated_drag(a);
                forces.extend((0..3).map(|m| drag[m] * v[m]));
                stresslets.push(strain * (20.0 / 3.0 * PI * a.powi(3)));
            }
        }
        for (pair, term) in self.neighbours.pairs().iter().zip(&self.terms) {
            let (i, j) = (pair.i, pair.j);
            let mut v = SVector::<f64, 6>::zeros();
            v.as_mut_slice()[..3].copy_from_slice(&velocities[3 * i..3 * i + 3]);
            v.as_mut_slice()[3..].copy_from_slice(&velocities[3 * j..3 * j + 3]);
            let n = pair.normal;
            let force = term.force_velocity(n) * v - term.force_from_strain(n, strain, strain);
            add_pair(forces, pair, &force);
            let s =
                term.stresslet_from_strain(n, strain, strain) - term.stresslet_from_velocity(n, &v);
            stresslets[i] += s.fixed_rows::<3>(0);
            stresslets[j] += s.fixed_rows::<3>(3);
        }
    }
}

/// Drag on an isolated sphere: `(6π a, 6π a, 8π a³)`.
fn isolated_drag(a: f64) -> [f64; 3] {
    [6.0 * PI * a, 6.0 * PI * a, 8.0 * PI * a.powi(3)]
}

/// Drag, over that of free spheres, on a periodic layer that moves as a whole. The fluid gives it none, and a layer without
/// pairs would be free to drift; forces add up to zero, so this small drag only sets that drift to zero.
const UNIFORM_DRAG: f64 = 1e-9;

/// Adds [`UNIFORM_DRAG`] to the lower triangle of R_FU, `[3N × 3N]`.
fn resist_uniform_motion(matrix: &mut Matrix) {
    let n = matrix.rows() / 3;
    let drag = 6.0 * PI * UNIFORM_DRAG / n as f64;
    for i in 0..n {
        for m in 0..2 {
            let column = matrix.column_mut(3 * i + m);
            for entry in column[3 * i + m..].iter_mut().step_by(3) {
                *entry += drag;
            }
        }
    }
}

/// Adds the forces on both spheres of a pair.
fn add_pair(forces: &mut [f64], pair: &Neighbours, force: &SVector<f64, 6>) {
    for m in 0..3 {
        forces[3 * pair.i + m] += force[m];
        forces[3 * pair.j + m] += force[3 + m];
    }
}
