//! One instant of one suspension or cluster in three dimensions: velocities, stresslets, viscosity.
//!
//! A tensor is held as its components in the orthonormal basis
//!
//! ```text
//! e1 = (E_xx − E_yy)/√2   e2 = √2 E_xy   e3 = √(3/2)(E_xx + E_yy)   e4 = √2 E_xz   e5 = √2 E_yz
//! ```
//! whose first three are those of the layer. Equations: see `hydrodynamics::bulk`; stress:
//!
//! ```text
//! η = 1 + Σ S_xy/V → 1 + 5φ/2 for a dilute suspension,   V (η − 1) = v'Rv in shear without forces
//! ```

use crate::error::Error;
use crate::hydrodynamics::bulk::{Resistance, Strain};
use crate::hydrodynamics::resistance::NearFields;
use crate::model::Hydrodynamics;
use crate::space::Bulk;
use crate::space::cell::Cell;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// A symmetric traceless tensor: `E_zz = −E_xx − E_yy`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TracelessTensor {
    /// xx.
    pub xx: f64,
    /// yy.
    pub yy: f64,
    /// xy.
    pub xy: f64,
    /// xz.
    pub xz: f64,
    /// yz.
    pub yz: f64,
}

impl TracelessTensor {
    /// Its components `(e1, …, e5)`.
    fn components(&self) -> Strain {
        Strain::from([
            FRAC_1_SQRT_2 * (self.xx - self.yy),
            SQRT_2 * self.xy,
            1.5_f64.sqrt() * (self.xx + self.yy),
            SQRT_2 * self.xz,
            SQRT_2 * self.yz,
        ])
    }

    /// The tensor of components.
    fn of_components(e: &Strain) -> Self {
        let (difference, sum) = (SQRT_2 * e[0], e[2] / 1.5_f64.sqrt());
        Self {
            xx: 0.5 * (sum + difference),
            yy: 0.5 * (sum - difference),
            xy: FRAC_1_SQRT_2 * e[1],
            xz: FRAC_1_SQRT_2 * e[3],
            yz: FRAC_1_SQRT_2 * e[4],
        }
    }
}

/// The imposed linear flow `u∞(x) = E∞·x + Ω∞ × x`, in shear rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background {
    /// Rate of strain.
    pub rate_of_strain: TracelessTensor,
    /// Angular velocity.
    pub angular_velocity: Vector3<f64>,
}

impl Background {
    /// Simple shear at unit rate: `u∞ = y x̂`.
    pub const SHEAR: Self = Self {
        rate_of_strain: TracelessTensor {
            xx: 0.0,
            yy: 0.0,
            xy: 0.5,
            xz: 0.0,
            yz: 0.0,
        },
        angular_velocity: Vector3::new(0.0, 0.0, -0.5),
    };

    /// Velocity at a point.
    pub fn velocity(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let TracelessTensor { xx, yy, xy, xz, yz } = self.rate_of_strain;
        Vector3::new(
            xx * x.x + xy * x.y + xz * x.z,
            xy * x.x + yy * x.y + yz * x.z,
            xz * x.x + yz * x.y - (xx + yy) * x.z,
        ) + self.angular_velocity.cross(x)
    }
}

/// Spheres, where they are and what drives them.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// Centres, in a.
    pub centres: Vec<Vector3<f64>>,
    /// Radii, in a; one per centre.
    pub radii: Vec<f64>,
    /// Periodic cell or unbounded fluid.
    pub cell: Cell<Bulk>,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Imposed flow.
    pub background: Background,
    /// External forces, in mu·a²·rate; one per centre. In a cell they move the spheres against a fluid whose mean flow with them is
    /// zero.
    pub forces: Vec<Vector3<f64>>,
    /// External torques, in mu·a³·rate; one per centre.
    pub torques: Vec<Vector3<f64>>,
}

/// Motion and stresslets of a configuration without contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedConfiguration {
    /// `U − u∞` of each sphere, background at its own centre, in a·rate.
    pub velocities: Vec<Vector3<f64>>,
    /// `Ω − Ω∞`, in rates.
    pub angular_velocities: Vec<Vector3<f64>>,
    /// Stresslets S, in mu·a³·rate.
    pub stresslets: Vec<TracelessTensor>,
    /// `1 + Σ S_xy/V`, in mu; `None` in unbounded fluid.
    pub viscosity: Option<f64>,
    /// `v'Rv/V`, v = (U − u∞, Ω − Ω∞, −E∞), in mu·rate²; `None` in unbounded fluid.
    pub dissipation: Option<f64>,
}

/// Solves one instant.
///
/// # Errors
/// Lists of other lengths, numbers that are not finite, radii that are not positive, overlaps, a cell too small, an indefinite matrix.
pub fn solve(
    configuration: &Configuration,
    tables: &NearFields,
) -> Result<SolvedConfiguration, Error> {
    check(configuration)?;
    let Configuration {
        centres,
        radii,
        cell,
        hydrodynamics,
        background,
        forces,
        torques,
    } = configuration;
    let strain = background.rate_of_strain.components();
    let mut resistance = Resistance::new(*hydrodynamics, cell, radii, tables)?;
    resistance.update(cell, centres)?;
    let (driving, _) = resistance.apply(&vec![0.0; 6 * centres.len()], &strain);
    let mut velocities: Vec<f64> = forces
        .iter()
        .zip(torques)
        .flat_map(|(f, t)| [f.x, f.y, f.z, t.x, t.y, t.z])
        .zip(driving)
        .map(|(external, driving)| external - driving)
        .collect();
    resistance.solve(&mut velocities);
    let (counterforces, stresslets) = resistance.apply(&velocities, &strain);
    let power = crate::linalg::dense::dot(&velocities, &counterforces)
        + stresslets.iter().map(|s| s.dot(&strain)).sum::<f64>();
    let stresslets: Vec<_> = stresslets
        .iter()
        .map(TracelessTensor::of_components)
        .collect();
    let part = |first: usize| {
        velocities
            .chunks_exact(6)
            .map(|v| Vector3::new(v[first], v[first + 1], v[first + 2]))
            .collect()
    };
    let volume = cell.content();
    Ok(SolvedConfiguration {
        velocities: part(0),
        angular_velocities: part(3),
        viscosity: volume.map(|v| 1.0 + stresslets.iter().map(|s| s.xy).sum::<f64>() / v),
        dissipation: volume.map(|v| power / v),
        stresslets,
    })
}

/// Refuses a configuration with a list of another length or a value out of range.
fn check(configuration: &Configuration) -> Result<(), Error> {
    let n = configuration.centres.len();
    if n == 0 {
        return Err(Error::NoSpheres);
    }
    for (field, found) in [
        ("radii", configuration.radii.len()),
        ("forces", configuration.forces.len()),
        ("torques", configuration.torques.len()),
    ] {
        if found != n {
            return Err(Error::Length {
                field,
                found,
                expected: n,
            });
        }
    }
    if let Some(numbers) = configuration.hydrodynamics.leading_order() {
        numbers.check()?;
    }
    let background = &configuration.background;
    let strain = background.rate_of_strain.components();
    let finite = |field, values: &[f64]| match values.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(&value) => Err(Error::OutOfRange {
            field,
            value,
            allowed: "finite",
        }),
    };
    for (field, vectors) in [
        ("centres", &configuration.centres),
        ("forces", &configuration.forces),
        ("torques", &configuration.torques),
    ] {
        vectors
            .iter()
            .try_for_each(|x| finite(field, x.as_slice()))?;
    }
    finite("background", strain.as_slice())?;
    finite("background", background.angular_velocity.as_slice())?;
    for &value in &configuration.radii {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Error::OutOfRange {
                field: "radii",
                value,
                allowed: "positive and finite",
            });
        }
    }
    Ok(())
}
