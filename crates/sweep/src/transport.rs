//! Short-time transport at the points of a campaign: that of the spheres its runs begin with.

use crate::measure::Estimate;
use crate::model::axes::{AXES, Identity, identity};
use crate::model::campaign::Campaign;
use rayon::prelude::*;
use sd_core::cell::Cell;
use sd_core::model::{Refusal, SolverSettings};
use sd_core::products::Resistance;
use sd_core::transport::{ShortTime, short_time};
use sd_core::{Bulk, Error, Hydrodynamics, NearFields, Params, start};
use serde_json::{Value as Json, json};
use std::collections::HashMap;

/// A number of a start: its name in JSON and how to read it.
type Named = (&'static str, fn(&ShortTime) -> f64);

/// All of them.
pub(crate) const NUMBERS: [Named; 4] = [
    ("self_diffusion", |s| s.self_diffusion),
    ("rotational_diffusion", |s| s.rotation),
    ("sedimentation", |s| s.sedimentation),
    ("viscosity", |s| s.viscosity),
];

/// Coefficient of the lattice of Hasimoto (J. Fluid Mech. 5, 317, 1959): a sphere in a cubic cell
/// moves slower by this times the cube root of its volume fraction.
const LATTICE: f64 = 1.7601;

/// A point of a campaign.
#[derive(Debug, Clone)]
pub(crate) struct TransportPoint {
    /// Parameters of its runs.
    pub(crate) params: Params,
    /// What was computed, start by start.
    pub(crate) starts: Vec<ShortTime>,
}

impl TransportPoint {
    /// The mean of a number over the starts.
    pub(crate) fn estimate(&self, of: fn(&ShortTime) -> f64) -> Option<Estimate> {
        let values: Vec<f64> = self.starts.iter().map(of).collect();
        Estimate::of(&values)
    }

    /// The mean of a number for infinitely many spheres, where images change it and all spheres are
    /// equal. Its interval is that of the number itself.
    pub(crate) fn infinite(&self, name: &str) -> Option<Estimate> {
        let [of_diffusion, of_sedimentation] = self.corrections()?;
        let with = |of, correction| {
            let estimate = self.estimate(of)?;
            Some(Estimate {
                mean: estimate.mean + correction,
                ..estimate
            })
        };
        match name {
            "self_diffusion" => with(|s| s.self_diffusion, of_diffusion),
            "sedimentation" => with(|s| s.sedimentation, of_sedimentation),
            _ => None,
        }
    }

    /// What to add to self-diffusion and to sedimentation for infinitely many spheres, if all are
    /// equal: images of a sphere, 2L apart, hold it back in a fluid of viscosity η∞, by S(0) less
    /// in sedimentation (Ladd, J. Chem. Phys. 93, 3484, 1990); S(0) by Carnahan and Starling.
    /// Without a far field images hold nothing back.
    fn corrections(&self) -> Option<[f64; 2]> {
        if self.params.hydrodynamics != Hydrodynamics::StokesianDynamics {
            return None;
        }
        let phi = self
            .params
            .volume_fraction
            .filter(|_| !self.params.is_mixed())?;
        let viscosity = self.estimate(|s| s.viscosity)?.mean;
        let images = LATTICE * (phi / self.params.spheres as f64).cbrt() / viscosity;
        let compressibility =
            (1.0 - phi).powi(4) / ((1.0 + 2.0 * phi).powi(2) + phi.powi(3) * (phi - 4.0));
        Some([images, images * compressibility])
    }

    /// The axes, then the numbers, each with its 95 % interval.
    pub(crate) fn json(&self) -> Json {
        // Whatever shears the runs, their starts are at rest.
        let axes = AXES
            .iter()
            .filter(|axis| !axis.is_of_shear() && axis.means_something(&self.params))
            .map(|axis| (axis.key.to_owned(), json!(axis.value(&self.params))));
        let mut object: serde_json::Map<String, Json> = axes.collect();
        object.insert("starts".into(), json!(self.starts.len()));
        for (name, of) in NUMBERS {
            let estimate = self.estimate(of);
            object.insert(name.into(), json!(estimate.map(|e| e.mean)));
            let interval = estimate.and_then(|e| e.ci95);
            object.insert(format!("{name}_ci95"), json!(interval));
            if let Some(infinite) = self.infinite(name) {
                object.insert(format!("{name}_infinite"), json!(infinite.mean));
                object.insert(format!("{name}_infinite_ci95"), json!(infinite.ci95));
            }
        }
        Json::Object(object)
    }
}

/// Computes the points of a campaign in the order of its file. Only runs that are certain count,
/// not those that a precision may ask for.
///
/// # Errors
/// Those of a start and of its resistance, and hydrodynamic friction; the first one in the order of
/// the runs.
pub(crate) fn transport(
    campaign: &Campaign,
    tables: &NearFields,
    workers: usize,
) -> Result<Vec<TransportPoint>, Error> {
    let cases: Vec<_> = campaign.certain().map(|(_, case)| case).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build();
    let compute = || {
        let found = cases
            .par_iter()
            .map(|case| of_start(&case.params, case.seed, tables));
        found.collect::<Vec<_>>()
    };
    let found = match pool {
        Ok(pool) => pool.install(compute),
        // Without threads of its own the pool of the process does it.
        Err(_) => compute(),
    };
    let mut places: HashMap<Identity, usize> = HashMap::new();
    let mut points: Vec<TransportPoint> = Vec::new();
    for (case, found) in cases.iter().zip(found) {
        let place = *places.entry(identity(&case.params)).or_insert_with(|| {
            points.push(TransportPoint {
                params: case.params.clone(),
                starts: Vec::new(),
            });
            points.len() - 1
        });
        points[place].starts.push(found?);
    }
    Ok(points)
}

/// The transport of the start of a run.
fn of_start(params: &Params, seed: u64, tables: &NearFields) -> Result<ShortTime, Error> {
    let friction = params.contact.laws().hydrodynamic_friction;
    if friction > 0.0 {
        return Err(Refusal {
            key: "hydrodynamic_friction",
            value: friction.to_string(),
            problem: "resists sliding, which short-time transport does not have".into(),
            allowed: "0 there: these numbers are of smooth spheres".into(),
            because: None,
        }
        .into());
    }
    let start = start::suspension(params, seed)?;
    let cell = Cell::<Bulk>::equal_sides(start.side, 0.0)?;
    let mut resistance = Resistance::new(
        params.hydrodynamics,
        &cell,
        &start.radii,
        &start.centres,
        tables,
        &SolverSettings::precise(),
    )?;
    short_time(&mut resistance, &cell, &start.radii, seed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::ContactLaws;

    #[test]
    fn only_a_far_field_holds_spheres_back() {
        let point = |hydrodynamics| TransportPoint {
            params: Params {
                hydrodynamics,
                volume_fraction: Some(0.2),
                ..crate::test_support::params()
            },
            starts: [0.60, 0.64]
                .map(|diffusion| ShortTime {
                    self_diffusion: diffusion,
                    rotation: 0.8,
                    sedimentation: 0.3,
                    viscosity: 1.8,
                })
                .to_vec(),
        };
        let of = point(Hydrodynamics::StokesianDynamics);
        let infinite = of.infinite("self_diffusion").unwrap();
        let images = LATTICE * (0.2 / of.params.spheres as f64).cbrt() / 1.8;
        assert!((infinite.mean - 0.62 - images).abs() < 1e-12);
        assert_eq!(
            infinite.ci95,
            of.estimate(|s| s.self_diffusion).unwrap().ci95
        );
        assert!(of.json()["self_diffusion_infinite_ci95"].is_number());
        assert!(of.json()["shear_rate"].is_null());
        let without = point(Hydrodynamics::BallMelrose);
        assert_eq!(without.infinite("self_diffusion"), None);
        assert_eq!(without.infinite("sedimentation"), None);
        assert!(without.json()["self_diffusion_infinite"].is_null());
    }

    #[test]
    fn spheres_whose_sliding_is_resisted_have_no_transport() {
        let mut laws = ContactLaws::PAPER;
        laws.hydrodynamic_friction = 0.1;
        let params = Params {
            volume_fraction: Some(0.2),
            contact: laws.into(),
            ..crate::test_support::params()
        };
        let refused = of_start(&params, 1, &NearFields::default()).unwrap_err();
        assert!(
            refused.to_string().contains("hydrodynamic_friction = 0.1"),
            "{refused}"
        );
    }
}
