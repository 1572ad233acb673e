//! The grand mobility of a suspension as a full matrix, in unbounded fluid or by Ewald sums in the
//! sheared cell.
//!
//! ```text
//! G = G_real + G_wave − own image,   G_real: f = r erfc(αr), summed over all images within a cut-off
//! G_wave(k) = (8π/k²)(I − kk/k²)(1 + w + 2w²) exp(−w)/V,   w = k²/4α²,   k ≠ 0
//! ```
//! Rows are ordered strain first: the 5N strains or stresslets, then the 6N velocities `(U, Ω)` or
//! forces.

use crate::error::Error;
use crate::hydrodynamics::far_field::highest;
use crate::hydrodynamics::far_field::{Splitting, check};
use crate::hydrodynamics::free_space::coupling::{Coupling, MODES};
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::hydrodynamics::free_space::planar::{RadialChain, self_mobility as planar_self};
use crate::hydrodynamics::free_space::spatial::{
    couplings, finite_size, pair_mobility, self_mobility,
};
use crate::linalg::dense::{Matrix, add_outer};
use crate::linalg::simd::vectorised;
use crate::space::Bulk;
use crate::space::cell::{Cell, Lattice};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Columns of the wave sum that are multiplied together.
const BATCH: usize = 256;

/// The grand mobility of spheres, planned for a cell's volume, radii and tolerance.
#[derive(Debug)]
pub(crate) struct DenseMobility {
    radii: Vec<f64>,
    sizes: Vec<FiniteSize>,
    /// The periodic sums; `None` in unbounded fluid.
    splitting: Option<Splitting>,
    /// Amplitudes of one batch of waves, `[11N × BATCH]`, and their weighted counterparts.
    waves: [Matrix; 2],
}

/// Cut-offs whose remainders stay below a tolerance of M, relative to its largest entry.
pub(in crate::hydrodynamics::far_field) fn cut_offs(
    alpha: f64,
    volume: f64,
    radii: &[f64],
    tolerance: f64,
) -> Splitting {
    let largest = radii.iter().copied().fold(0.0, f64::max);
    let size = FiniteSize::new(largest);
    // Terms of opposite signs cancel, so remainders stay well below the sum of magnitudes; test
    // `operator_is_the_dense_mobility`.
    let limit = 2.0 * tolerance * planar_self(largest)[0];
    let magnitude = |c: &Coupling| {
        let numbers = [
            c.force_velocity[0],
            c.force_velocity[1],
            c.force_strain[0],
            c.force_strain[1],
            c.stress_strain[0],
            c.stress_strain[1],
            c.torque_rotation[1],
            c.force_rotation,
        ];
        numbers.into_iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    };
    // All images of a shell where the summand falls by e count as one sum without signs.
    let mut distance = 1.0 / alpha;
    loop {
        let shell = (4.0 * PI * distance * distance / (alpha * volume)).max(1.0);
        let coupling = couplings(&RadialChain::screened(distance * distance, alpha));
        if shell * magnitude(&finite_size(&coupling, &size, &size)) < limit {
            break;
        }
        distance += 0.02 / alpha;
    }
    let mut wave = 2.0 * alpha;
    loop {
        let square = wave * wave;
        let modes = (1.0 + square) * (1.0 + square * size.force);
        let shell = (square * alpha / (PI * PI)).max(1.0 / volume);
        if shell * transform(square, alpha) * modes < limit {
            break;
        }
        wave += 0.02 * alpha;
    }
    Splitting {
        alpha,
        distance,
        wave,
    }
}

/// `(1 + w + 2w²) exp(−w)/k²`, w = k²/4α².
pub(in crate::hydrodynamics::far_field) fn transform(square: f64, alpha: f64) -> f64 {
    let w = square / (4.0 * alpha * alpha);
    (1.0 + w * (1.0 + 2.0 * w)) * (-w).exp() / square
}

impl DenseMobility {
    /// Accuracy of the periodic sums, relative to the largest entry of M.
    pub(crate) const TOLERANCE: f64 = 1e-9;

    /// Plans the sums for cells of this volume.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance.
    pub(crate) fn new(cell: &Cell<Bulk>, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        // The cost of an image equals that of four half-waves.
        let balanced = cell.content().map_or(0.0, |volume| {
            let mut best = (f64::INFINITY, 0.0);
            for step in 0..60 {
                let alpha = volume.cbrt().recip() * 1.05_f64.powi(step);
                let cut = cut_offs(alpha, volume, radii, tolerance);
                let images = 4.0 / 3.0 * PI * cut.distance.powi(3) / volume;
                let waves = volume * cut.wave.powi(3) / (12.0 * PI * PI);
                let cost = 2.0 * images + waves;
                if cost < best.0 {
                    best = (cost, alpha);
                }
            }
            best.1
        });
        Self::with_splitting(cell, radii, tolerance, balanced)
    }

    /// As [`DenseMobility::new`] with a given α, in 1/a.
    pub(crate) fn with_splitting(
        cell: &Cell<Bulk>,
        radii: &[f64],
        tolerance: f64,
        alpha: f64,
    ) -> Result<Self, Error> {
        check(radii, tolerance)?;
        Ok(Self {
            radii: radii.to_vec(),
            sizes: radii.iter().map(|&a| FiniteSize::new(a)).collect(),
            splitting: cell
                .content()
                .map(|volume| cut_offs(alpha, volume, radii, tolerance)),
            waves: Default::default(),
        })
    }

    /// Row of a mode of a sphere, modes ordered `(U, Ω, e)`.
    pub(crate) fn row(spheres: usize, sphere: usize, mode: usize) -> usize {
        if mode < 6 {
            5 * spheres + 6 * sphere + mode
        } else {
            5 * sphere + mode - 6
        }
    }

    /// Fills the grand mobility `[11N × 11N]`, its lower triangle, in 1/(mu a), 1/(mu a²), 1/(mu
    /// a³).
    ///
    /// # Errors
    /// [`Error::Length`].
    pub(crate) fn fill(
        &mut self,
        cell: &Cell<Bulk>,
        centres: &[Vector3<f64>],
        mobility: &mut Matrix,
    ) -> Result<(), Error> {
        let n = self.radii.len();
        if centres.len() != n {
            return Err(Error::Length {
                field: "centres",
                found: centres.len(),
                expected: n,
            });
        }
        mobility.reset(MODES * n, MODES * n);
        if let (Cell::Periodic(lattice), Some(splitting)) = (cell, self.splitting) {
            self.add_waves(&splitting, lattice, centres, mobility);
            self.add_images(&splitting, lattice, centres, mobility);
            return Ok(());
        }
        for i in 0..n {
            let own = self_mobility(self.radii[i]);
            add_block(mobility, n, [i, i], &own, &Vector3::x());
            for j in 0..i {
                let x = centres[i] - centres[j];
                let distance = x.norm();
                let coupling = pair_mobility(distance, self.radii[i], self.radii[j]);
                add_block(mobility, n, [i, j], &coupling, &(x / distance));
            }
        }
        Ok(())
    }

    /// Adds the real sums, and the self mobility of each sphere minus its own image in the wave
    /// part.
    fn add_images(
        &self,
        splitting: &Splitting,
        lattice: &Lattice<Bulk>,
        centres: &[Vector3<f64>],
        mobility: &mut Matrix,
    ) {
        let n = self.radii.len();
        let own_image = couplings(&RadialChain::own_image(splitting.alpha));
        let reach = splitting.distance;
        for i in 0..n {
            let size = &self.sizes[i];
            let image = finite_size(&own_image, size, size);
            let alone = unbounded_less(&self_mobility(self.radii[i]), &image);
            add_block(mobility, n, [i, i], &alone, &Vector3::x());
            for j in 0..=i {
                let x0 = centres[i] - centres[j];
                for x in lattice.images_within(x0, reach) {
                    let square = x.norm_squared();
                    if i == j && square < 1e-12 {
                        continue;
                    }
                    let chain = RadialChain::screened(square, splitting.alpha);
                    let coupling = finite_size(&couplings(&chain), size, &self.sizes[j]);
                    add_block(mobility, n, [i, j], &coupling, &(x / square.sqrt()));
                }
            }
        }
    }

    /// Adds the wave sum: `Σ_k γ [R Rᵀ − R_κ Rᵀ − R R_κᵀ]`, R the amplitudes of all modes in a
    /// wave, R_κ those times κ a² k².
    fn add_waves(
        &mut self,
        splitting: &Splitting,
        lattice: &Lattice<Bulk>,
        centres: &[Vector3<f64>],
        mobility: &mut Matrix,
    ) {
        let n = centres.len();
        let volume = lattice.content();
        let [left, right] = &mut self.waves;
        for matrix in [&mut *left, &mut *right] {
            matrix.reset(MODES * n, BATCH);
        }
        let mut column = 0;
        for k in half_waves(lattice, splitting.wave) {
            let square = k.norm_squared();
            // Both k and −k.
            let weight = 2.0 * transform(square, splitting.alpha) / volume;
            for polarisation in polarisations(&k) {
                let amplitudes = amplitudes(&k, &polarisation);
                for (i, (x, size)) in centres.iter().zip(&self.sizes).enumerate() {
                    let (sin, cos) = k.dot(x).sin_cos();
                    for (mode, &amplitude) in amplitudes.iter().enumerate() {
                        let (finite, phases) = match mode {
                            0..3 => (size.force, [cos, sin]),
                            3..6 => (0.0, [-sin, cos]),
                            _ => (size.stresslet, [-sin, cos]),
                        };
                        let row = Self::row(n, i, mode);
                        for (part, phase) in phases.into_iter().enumerate() {
                            let value = amplitude * phase;
                            left[(row, column + part)] = value;
                            right[(row, column + part)] =
                                weight * value * (1.0 - 2.0 * finite * square);
                        }
                    }
                }
                column += 2;
            }
            if column == BATCH {
                add_outer(mobility, left, right, 1.0);
                column = 0;
            }
        }
        for rest in column..BATCH {
            left.column_mut(rest).fill(0.0);
        }
        add_outer(mobility, left, right, 1.0);
        for column in 0..MODES * n {
            for row in column + 1..MODES * n {
                let mean = 0.5 * (mobility[(row, column)] + mobility[(column, row)]);
                mobility[(row, column)] = mean;
            }
        }
    }
}

/// The difference of two couplings that are the same in all directions.
fn unbounded_less(alone: &Coupling, image: &Coupling) -> Coupling {
    Coupling::isotropic(
        alone.force_velocity[0] - image.force_velocity[0],
        alone.torque_rotation[0] - image.torque_rotation[0],
        alone.stress_strain[0] - image.stress_strain[0],
    )
}

/// One of each pair of wave vectors k, −k up to a wave number, without 0.
fn half_waves(lattice: &Lattice<Bulk>, cut_off: f64) -> impl Iterator<Item = Vector3<f64>> {
    let lattice = *lattice;
    let lengths = lattice.reduced_vectors().iter().map(Vector3::norm);
    let mut most = [0; 3];
    for (most, length) in most.iter_mut().zip(lengths) {
        *most = highest(length, cut_off).cast_signed();
    }
    let [m, n, l] = most;
    (0..=m).flat_map(move |m| {
        (-n..=n).flat_map(move |n| {
            (-l..=l)
                .filter(move |&l| (m, n, l) > (0, 0, 0))
                .map(move |l| lattice.wave_vector([m, n, l].map(|x| x as f64)))
                .filter(move |k| k.norm_squared() <= cut_off * cut_off)
        })
    })
}

/// Two unit vectors across a wave vector and each other.
fn polarisations(k: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = if k.x.abs() < k.y.abs() && k.x.abs() < k.z.abs() {
        Vector3::x()
    } else if k.y.abs() < k.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let first = k.cross(&axis).normalize();
    [first, k.cross(&first).normalize()]
}

/// Velocity along p, angular velocity `k × p/2` and strain of a wave of unit amplitude; the latter
/// two are a quarter wave ahead.
pub(super) fn amplitudes(k: &Vector3<f64>, p: &Vector3<f64>) -> [f64; MODES] {
    let spin = k.cross(p) * 0.5;
    [
        p.x,
        p.y,
        p.z,
        spin.x,
        spin.y,
        spin.z,
        (p.x * k.x - p.y * k.y) * FRAC_1_SQRT_2,
        (p.x * k.y + p.y * k.x) * FRAC_1_SQRT_2,
        (p.x * k.x + p.y * k.y - 2.0 * p.z * k.z) / 6.0_f64.sqrt(),
        (p.x * k.z + p.z * k.x) * FRAC_1_SQRT_2,
        (p.y * k.z + p.z * k.y) * FRAC_1_SQRT_2,
    ]
}

/// Adds a block of spheres (i, j), i ≥ j, to the lower triangle.
fn add_block(
    mobility: &mut Matrix,
    spheres: usize,
    [i, j]: [usize; 2],
    coupling: &Coupling,
    n: &Vector3<f64>,
) {
    let block = vectorised(
        #[inline(always)]
        || coupling.matrix(n),
    );
    for (from, entries) in block.iter().enumerate() {
        let column = DenseMobility::row(spheres, j, from);
        for (to, entry) in entries.iter().enumerate() {
            let row = DenseMobility::row(spheres, i, to);
            if row >= column {
                mobility[(row, column)] += entry;
            } else if i != j {
                mobility[(column, row)] += entry;
            }
        }
    }
}
