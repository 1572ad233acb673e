//! Spheres on a disordered lattice, and vectors of all of them.

use sd_core::cell::Cell;
use sd_core::model::SolverSettings;
use sd_core::products::Resistance;
use sd_core::{Hydrodynamics, NearFields, RunSpace, Space};

/// Spheres in a cell.
pub(crate) struct Spheres<S: Space> {
    pub(crate) cell: Cell<S>,
    pub(crate) radii: Vec<f64>,
    pub(crate) centres: Vec<S::Vector>,
}

impl<S: RunSpace> Spheres<S> {
    pub(crate) fn resistance(&self, hydrodynamics: Hydrodynamics) -> Resistance<S> {
        Resistance::new(
            hydrodynamics,
            &self.cell,
            &self.radii,
            &self.centres,
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap()
    }
}

/// Spheres of two sizes on a disordered lattice: `count` along each side, `spacing` apart.
pub(crate) fn spheres<S: Space>(count: i32, spacing: f64, seed: f64) -> Spheres<S> {
    let side = f64::from(count) * spacing;
    let number = count.pow(u32::try_from(S::DIMENSIONS).unwrap());
    let centres = (0..number).map(|sphere| {
        let mut centre = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            let column = sphere / count.pow(u32::try_from(k).unwrap()) % count;
            let wave = (seed + 1.7 * f64::from(sphere) + 0.9 * k as f64).sin();
            centre[k] = f64::from(column) * spacing + 0.07 * wave;
        }
        centre
    });
    Spheres {
        cell: Cell::equal_sides(side, 0.3 * side).unwrap(),
        radii: (0..number)
            .map(|sphere| if sphere % 3 == 0 { 1.0 } else { 0.9 })
            .collect(),
        centres: centres.collect(),
    }
}

/// Numbers without order; in a layer forces that sum to zero.
pub(crate) fn vector<S: Space>(spheres: usize, each: usize, seed: f64) -> Vec<f64> {
    let mut vector: Vec<f64> = (0..each * spheres)
        .map(|k| (seed + 1.3 * k as f64 + 0.01 * (k * k) as f64).sin())
        .collect();
    if S::DIMENSIONS == 2 {
        for k in 0..2 {
            let mean: f64 = vector.iter().skip(k).step_by(each).sum::<f64>() / spheres as f64;
            for force in vector.iter_mut().skip(k).step_by(each) {
                *force -= mean;
            }
        }
    }
    vector
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Largest difference over the largest number.
pub(crate) fn difference(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0_f64, |most, b| most.max(b.abs()));
    let pairs = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    pairs.fold(0.0, f64::max) / largest
}
