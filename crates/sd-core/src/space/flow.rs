//! The imposed flow: any linear flow of an incompressible fluid.

use super::{Layer, Space};
use crate::error::{Error, Refusal};
use crate::model::FlowType;

/// Trace of a velocity gradient, relative to its numbers, that is taken for rounding.
const TRACE_TOLERANCE: f64 = 1e-12;

/// Terms of the exponential's series, at most: enough for strains of tens.
const MAX_ORDER: u32 = 200;

/// The imposed linear flow `u∞(x) = L·x = E∞·x + Ω∞ × x`, in shear rates.
///
/// In a layer the fluid also flows across the plane: `E_zz = −E_xx − E_yy`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityGradient<S: Space = Layer> {
    /// Rows of L; the third one is zero in a layer.
    rows: [S::Vector; 3],
}

impl<S: Space> VelocityGradient<S> {
    /// The flow of these rows of L, two in a layer and three in a suspension.
    ///
    /// # Errors
    /// [`Error::Refused`] unless the numbers are finite and, in a suspension, the trace is 0.
    ///
    /// ```
    /// use sd_core::modes::Vec2;
    /// use sd_core::{Layer, VelocityGradient};
    ///
    /// let shear = VelocityGradient::<Layer>::new(&[Vec2::new(0.0, 1.0), Vec2::zeros()])?;
    /// assert_eq!(shear, VelocityGradient::simple_shear(1.0));
    /// assert_eq!(shear.velocity(&Vec2::new(3.0, 2.0)), Vec2::new(2.0, 0.0));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn new(rows: &[S::Vector]) -> Result<Self, Error> {
        let refuse = |value: String, problem: String, allowed: &str| {
            Err(Error::from(Refusal {
                key: "background",
                value,
                problem,
                allowed: allowed.into(),
                because: None,
            }))
        };
        let mut all = [S::Vector::default(); 3];
        if rows.len() != S::DIMENSIONS {
            let value = format!("{} rows", rows.len());
            return refuse(
                value,
                "is no velocity gradient".into(),
                "one row per coordinate",
            );
        }
        all[..S::DIMENSIONS].copy_from_slice(rows);
        let flow = Self { rows: all };
        let numbers = flow.numbers();
        if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
            return refuse(format!("{number}"), "is out of range".into(), "finite");
        }
        let trace: f64 = (0..S::DIMENSIONS).map(|k| all[k][k]).sum();
        let largest = numbers.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if S::DIMENSIONS > 2 && trace.abs() > TRACE_TOLERANCE * largest {
            let problem = "is the trace of the rate of strain, xx + yy + zz".into();
            return refuse(
                format!("{trace}"),
                problem,
                "0: the fluid is incompressible",
            );
        }
        Ok(flow)
    }

    /// The flow of a rate of strain, see [`Space::tensor`], and an angular velocity.
    pub fn from_parts(rate_of_strain: &S::Tensor, angular_velocity: &S::Spin) -> Self {
        Self {
            rows: S::gradient(rate_of_strain, angular_velocity),
        }
    }

    /// Simple shear `u∞ = rate y x̂`.
    pub fn simple_shear(rate: f64) -> Self {
        let mut flow = Self::at_rest();
        flow.rows[0][1] = rate;
        flow
    }

    /// Fluid at rest.
    pub fn at_rest() -> Self {
        Self {
            rows: [S::Vector::default(); 3],
        }
    }

    /// Planar extension along x, compression along y: `u∞ = rate (x, −y)`.
    pub fn planar_extension(rate: f64) -> Self {
        let mut flow = Self::at_rest();
        flow.rows[0][0] = rate;
        flow.rows[1][1] = -rate;
        flow
    }

    /// The flow of a type with this rate; that of a negative rate is the opposite one.
    ///
    /// ```
    /// use sd_core::model::FlowType;
    /// use sd_core::{Bulk, VelocityGradient};
    ///
    /// let uniaxial = VelocityGradient::<Bulk>::of_type(FlowType::Uniaxial, 3.0_f64.sqrt());
    /// let [xx, yy, zz, ..] = uniaxial.rate_of_strain();
    /// assert!((xx - 1.0).abs() < 1e-15 && (yy + 0.5).abs() < 1e-15 && (zz + 0.5).abs() < 1e-15);
    /// ```
    pub fn of_type(flow: FlowType, rate: f64) -> Self {
        let third = 3.0_f64.sqrt().recip();
        let diagonal = match flow {
            FlowType::Shear => return Self::simple_shear(rate),
            FlowType::PlanarExtension => return Self::planar_extension(0.5 * rate),
            FlowType::Mixture(ratio) => {
                let shear = rate / (2.0 * ratio).hypot(1.0);
                let mut flow = Self::planar_extension(ratio * shear);
                flow.rows[0][1] = shear;
                return flow;
            }
            FlowType::Uniaxial => [third, -0.5 * third, -0.5 * third],
            FlowType::Biaxial => [0.5 * third, 0.5 * third, -third],
        };
        let mut flow = Self::at_rest();
        for (k, of_axis) in diagonal.into_iter().enumerate().take(S::DIMENSIONS) {
            flow.rows[k][k] = of_axis * rate;
        }
        flow
    }

    /// The flow with an additional cross shear, `u∞ = rate y ẑ`, in a suspension; a layer has no
    /// vorticity direction.
    #[must_use]
    pub fn with_cross_shear(mut self, rate: f64) -> Self {
        if S::DIMENSIONS > 2 {
            self.rows[2][1] += rate;
        }
        self
    }

    /// Where the flow takes a vector within a time: `exp(L t) x`.
    pub(crate) fn carried(&self, x: &S::Vector, time: f64) -> S::Vector {
        // The series of the exponential; that of a shear ends after one term.
        let (mut carried, mut term) = (*x, *x);
        for order in 1..=MAX_ORDER {
            term = self.velocity(&term) * (time / f64::from(order));
            carried += term;
            if S::norm_squared(&term) <= f64::EPSILON.powi(2) * S::norm_squared(&carried) {
                break;
            }
        }
        carried
    }

    /// This flow at another rate, in rates of this one.
    pub(crate) fn scaled(mut self, rate: f64) -> Self {
        for row in &mut self.rows {
            *row = *row * rate;
        }
        self
    }

    /// Rows of L.
    pub fn rows(&self) -> &[S::Vector] {
        &self.rows[..S::DIMENSIONS]
    }

    /// Velocity at a point.
    #[inline(always)]
    pub fn velocity(&self, x: &S::Vector) -> S::Vector {
        let mut velocity = S::Vector::default();
        for (k, row) in self.rows.iter().enumerate().take(S::DIMENSIONS) {
            velocity[k] = S::dot(row, x);
        }
        velocity
    }

    /// Angular velocity.
    #[inline(always)]
    pub fn angular_velocity(&self) -> S::Spin {
        S::rotation_of(&self.rows)
    }

    /// Rate of strain: xx, yy, zz, xy, xz, yz.
    pub fn rate_of_strain(&self) -> [f64; 6] {
        let [x, y, z] = &self.rows;
        let [xx, yy, xy] = [x[0], y[1], 0.5 * (x[1] + y[0])];
        if S::DIMENSIONS < 3 {
            return [xx, yy, -(xx + yy), xy, 0.0, 0.0];
        }
        let [xz, yz] = [0.5 * (x[2] + z[0]), 0.5 * (y[2] + z[1])];
        [xx, yy, -(xx + yy), xy, xz, yz]
    }

    /// Components of the rate of strain.
    pub fn strain(&self) -> S::Strain {
        S::strain_of(&self.rate_of_strain())
    }

    /// The rate `√(2 E:E)`, of which strain is the integral: that of shear in simple shear.
    ///
    /// ```
    /// use sd_core::{Layer, VelocityGradient};
    ///
    /// assert_eq!(VelocityGradient::<Layer>::simple_shear(-3.0).rate(), 3.0);
    /// assert_eq!(VelocityGradient::<Layer>::planar_extension(0.5).rate(), 1.0);
    /// ```
    pub fn rate(&self) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.rate_of_strain();
        let diagonal = xx * xx + yy * yy + zz * zz;
        (2.0 * diagonal + 4.0 * (xy * xy + xz * xz + yz * yz)).sqrt()
    }

    /// All numbers of L.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let rows = self.rows.iter().take(S::DIMENSIONS);
        rows.flat_map(|row| (0..S::DIMENSIONS).map(|k| row[k]))
            .collect()
    }

    /// Earlier position of a point advected to `x` over `time` at its initial velocity:
    /// `x = (1 + time L) x₀`.
    pub(crate) fn advect_backward(&self, x: &S::Vector, time: f64) -> S::Vector {
        let mut columns = [S::Vector::default(); 3];
        for (k, column) in columns.iter_mut().enumerate().take(S::DIMENSIONS) {
            column[k] = 1.0;
            let travelled = self.velocity(column) * time;
            *column += travelled;
        }
        S::solve_columns(&columns, x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Bulk;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn what_the_flow_carried_away_is_carried_back() {
        let planar = VelocityGradient::<Layer>::from_parts(&[0.3, -0.4, 0.2], &-0.6);
        let before = Vector2::new(1.3, -0.7);
        let after = before + planar.velocity(&before) * 0.1;
        assert!((planar.advect_backward(&after, 0.1) - before).norm() < 1e-15);
        let spin = Vector3::new(0.3, -0.6, 0.2);
        let flow = VelocityGradient::<Bulk>::from_parts(&[0.3, -0.4, 0.2, 0.7, -0.1], &spin);
        let before = Vector3::new(1.3, -0.7, 0.4);
        let after = before + flow.velocity(&before) * 0.1;
        assert!((flow.advect_backward(&after, 0.1) - before).norm() < 1e-15);
    }

    #[test]
    fn strain_and_rotation_make_up_the_flow() {
        let (strain, spin) = ([0.3, -0.4, 0.2, 0.7, -0.1], Vector3::new(0.3, -0.6, 0.2));
        let flow = VelocityGradient::<Bulk>::from_parts(&strain, &spin);
        assert!((flow.angular_velocity() - spin).norm() < 1e-15);
        let [xx, yy, zz, xy, xz, yz] = flow.rate_of_strain();
        for (a, b) in [xx, yy, xy, xz, yz, zz]
            .into_iter()
            .zip(strain.into_iter().chain([0.1]))
        {
            assert!((a - b).abs() < 1e-15);
        }
        let x = Vector3::new(1.3, -0.7, 0.4);
        let strained = Vector3::new(
            0.3 * x.x + 0.2 * x.y + 0.7 * x.z,
            0.2 * x.x - 0.4 * x.y - 0.1 * x.z,
            0.7 * x.x - 0.1 * x.y + 0.1 * x.z,
        );
        assert!((flow.velocity(&x) - strained - spin.cross(&x)).norm() < 1e-15);
        let rows = [[0.3, 1.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.0]].map(Vector3::from);
        assert!(
            (VelocityGradient::<Bulk>::new(&rows).unwrap().rate() - 1.36_f64.sqrt()).abs() < 1e-15
        );
    }

    #[test]
    fn cross_shear_goes_along_the_vorticity() {
        for direction in [1.0, -1.0] {
            let flow = VelocityGradient::<Bulk>::simple_shear(direction).with_cross_shear(0.7);
            let u = flow.velocity(&Vector3::new(2.0, 3.0, -5.0));
            assert!((u - Vector3::new(3.0 * direction, 0.0, 2.1)).norm() < 1e-15);
        }
    }

    #[test]
    fn a_flow_with_a_trace_is_refused() {
        let rows = [[0.5, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, -0.5]].map(Vector3::from);
        let error = VelocityGradient::<Bulk>::new(&rows)
            .unwrap_err()
            .to_string();
        assert!(error.contains("background = 0.25 is the trace"), "{error}");
        assert!(error.contains("0: the fluid"), "{error}");
        let endless = [Vector2::new(f64::NAN, 0.0), Vector2::zeros()];
        assert!(VelocityGradient::<Layer>::new(&endless).is_err());
        assert!(VelocityGradient::<Layer>::new(&endless[..1]).is_err());
    }
}
