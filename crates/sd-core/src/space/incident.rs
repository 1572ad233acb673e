//! The incident flow: what the fluid does where a sphere is, as the sphere meets it.

use super::{Layer, Space, VelocityGradient};
use crate::error::Error;

/// The flow incident on the spheres: a linear flow, and where it is not linear its departure from
/// that at each sphere.
///
/// ```text
/// u∞ = L·x_i + u_i,   Ω∞ = Ω + ω_i,   E∞ = E + e_i       at sphere i
/// ```
/// The departures have the period of the cell: images of a sphere have the same, and differ in the
/// linear flow alone. In unbounded fluid the linear flow may be left at rest.
///
/// # Meaning of the numbers
/// They are what a sphere meets, not the flow at its centre: an isolated sphere without force and
/// torque moves with u∞ and Ω∞, and has the stresslet `(20/3)π a³ E∞`. By Faxén's laws these are
///
/// ```text
/// u∞ = (1 + a²/6 ∇²) u,   Ω∞ = ½ ∇ × u,   E∞ = (1 + a²/10 ∇²) ½ (∇u + ∇uᵀ)       at its centre
/// ```
/// of a flow u, which in a linear flow are the flow itself.
///
/// ```
/// use sd_core::bulk::Vec3;
/// use sd_core::{Bulk, IncidentFlow, LocalFlow, VelocityGradient};
///
/// // A sphere of radius 1 at y = 2 in the pressure-driven flow u = 1 − (y/10)² along x.
/// let (y, curvature) = (2.0, -2.0 / 100.0);
/// let velocity = Vec3::new(1.0 - y * y / 100.0 + curvature / 6.0, 0.0, 0.0);
/// let rows = [Vec3::new(0.0, curvature * y, 0.0), Vec3::zeros(), Vec3::zeros()];
/// let local = LocalFlow { velocity, gradient: VelocityGradient::new(&rows)? };
/// let flow = IncidentFlow::<Bulk>::per_sphere(VelocityGradient::at_rest(), &[local])?;
/// assert_eq!(flow.at(0, &Vec3::new(0.0, y, 0.0))[0], velocity.x);
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct IncidentFlow<S: Space = Layer> {
    linear: VelocityGradient<S>,
    departures: Option<Departures<S>>,
}

/// The departure of an incident flow from a linear one at a sphere: see [`IncidentFlow`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFlow<S: Space = Layer> {
    /// Velocity, in a·rate.
    pub velocity: S::Vector,
    /// Angular velocity and rate of strain, in rate.
    pub gradient: VelocityGradient<S>,
}

#[derive(Debug, Clone, PartialEq)]
struct Departures<S: Space> {
    /// Velocities and angular velocities, sphere by sphere.
    velocities: Vec<f64>,
    /// Rate of strain at each sphere, that of the linear flow included.
    strains: Vec<S::Strain>,
}

/// The rate of strain of an incident flow at each sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strains<'a, S: Space> {
    /// One rate of strain at all spheres.
    Uniform(S::Strain),
    /// A rate of strain for each sphere.
    PerSphere(&'a [S::Strain]),
}

impl<S: Space> Strains<'_, S> {
    /// No strain.
    pub fn none() -> Self {
        Self::Uniform(S::Strain::default())
    }

    /// The strain at a sphere.
    ///
    /// # Panics
    /// If there is no such sphere.
    #[inline(always)]
    pub fn at(&self, sphere: usize) -> &S::Strain {
        match self {
            Self::Uniform(strain) => strain,
            Self::PerSphere(strains) => &strains[sphere],
        }
    }
}

impl<S: Space> From<VelocityGradient<S>> for IncidentFlow<S> {
    fn from(linear: VelocityGradient<S>) -> Self {
        Self {
            linear,
            departures: None,
        }
    }
}

impl<S: Space> IncidentFlow<S> {
    /// A linear flow with a departure at each sphere.
    ///
    /// # Errors
    /// [`Error::OfSphere`] for a number that is not finite.
    pub fn per_sphere(
        linear: VelocityGradient<S>,
        departures: &[LocalFlow<S>],
    ) -> Result<Self, Error> {
        let mut velocities = Vec::with_capacity(S::MODES * departures.len());
        for (sphere, local) in departures.iter().enumerate() {
            let modes = S::join(&local.velocity, &local.gradient.angular_velocity());
            let numbers = modes.as_ref().iter().copied();
            let numbers = numbers.chain(local.gradient.numbers());
            if let Some(value) = numbers.into_iter().find(|number| !number.is_finite()) {
                return Err(Error::OfSphere {
                    field: "background",
                    sphere,
                    value,
                    allowed: "finite",
                });
            }
            velocities.extend_from_slice(modes.as_ref());
        }
        let strain = linear.strain();
        let strains = departures.iter();
        Ok(Self {
            linear,
            departures: Some(Departures {
                velocities,
                strains: strains
                    .map(|local| strain + local.gradient.strain())
                    .collect(),
            }),
        })
    }

    /// The linear flow, from which the flow may depart at the spheres.
    pub fn linear(&self) -> &VelocityGradient<S> {
        &self.linear
    }

    /// Velocity and angular velocity that a sphere at this centre meets. Together with its
    /// disturbance they are those of the sphere.
    ///
    /// # Panics
    /// If the flow has departures for fewer spheres.
    pub fn at(&self, sphere: usize, centre: &S::Vector) -> S::PerMode<f64> {
        let linear = &self.linear;
        let mut modes = S::join(&linear.velocity(centre), &linear.angular_velocity());
        if let Some(departures) = self.departures() {
            for k in 0..S::MODES {
                modes[k] += departures[S::MODES * sphere + k];
            }
        }
        modes
    }

    /// The rate of strain at each sphere.
    pub fn strains(&self) -> Strains<'_, S> {
        match &self.departures {
            None => Strains::Uniform(self.linear.strain()),
            Some(departures) => Strains::PerSphere(&departures.strains),
        }
    }

    /// Departures of velocities and angular velocities, sphere by sphere.
    pub(crate) fn departures(&self) -> Option<&[f64]> {
        self.departures
            .as_ref()
            .map(|departures| &departures.velocities[..])
    }

    /// Earlier vector from sphere i to sphere j, `pair` = [i, j], which the flow takes to `x` over
    /// `time` at its initial velocity: `x = (1 + time L) x₀ + time (u_j − u_i)`.
    pub(crate) fn advect_backward(&self, x: &S::Vector, time: f64, pair: [usize; 2]) -> S::Vector {
        let Some(departures) = self.departures() else {
            return self.linear.advect_backward(x, time);
        };
        let departures = S::by_sphere(departures);
        let [u_i, u_j] = pair.map(|sphere| S::translation(&departures[sphere]));
        self.linear
            .advect_backward(&(*x - (u_j - u_i) * time), time)
    }

    /// Refuses departures for another number of spheres, and a linear flow that is not finite.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`].
    pub(crate) fn check(&self, spheres: usize) -> Result<(), Error> {
        let numbers = self.linear.numbers();
        if let Some(value) = numbers.into_iter().find(|number| !number.is_finite()) {
            return Err(Error::OutOfRange {
                field: "background",
                value,
                allowed: "finite",
            });
        }
        match &self.departures {
            Some(departures) if departures.strains.len() != spheres => Err(Error::Length {
                field: "background",
                found: departures.strains.len(),
                expected: spheres,
            }),
            _ => Ok(()),
        }
    }
}
