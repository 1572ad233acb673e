//! Classical Runge-Kutta of order four.

use super::state::{Stage, State};
use crate::contact::laws::StageKind;
use crate::space::{Layer, Space};

/// Nodes of the stages, in steps.
const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
/// Time spans τ of the stages for the contact laws, in steps.
const SPANS: [f64; 4] = [1.0, 0.5, 0.5, 1.0];
/// Weights of the stages.
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// Workspace of the integrator.
#[derive(Default, Debug)]
pub struct RungeKutta<S: Space = Layer> {
    centres: Vec<S::Vector>,
    /// Velocities at the stage, sphere by sphere, background included.
    velocities: Vec<f64>,
    /// Velocities at the first stage.
    first: Vec<f64>,
    /// Weighted mean of the velocities over the step.
    mean: Vec<f64>,
}

impl<S: Space> RungeKutta<S> {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities at the given centres.
    ///
    /// Centres move continuously (they are not wrapped into a cell within the step).
    ///
    /// # Errors
    /// Errors of `rhs`; the state is then unchanged.
    pub fn step<E>(
        &mut self,
        state: &mut State<S>,
        time: f64,
        dt: f64,
        mut rhs: impl FnMut(Stage, &[S::Vector], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let n = state.centres.len();
        self.velocities.resize(S::MODES * n, 0.0);
        self.mean.clear();
        self.mean.resize(S::MODES * n, 0.0);
        for number in 0..4 {
            self.centres.clear();
            let moved = state.centres.iter().zip(S::by_sphere(&self.velocities));
            self.centres.extend(moved.map(|(&x, u)| {
                // The first stage is at the start itself, so old velocities are ignored.
                if number == 0 {
                    x
                } else {
                    x + S::translation(u) * (NODES[number] * dt)
                }
            }));
            let stage = Stage {
                number,
                time: time + NODES[number] * dt,
                span: SPANS[number] * dt,
                kind: StageKind::Single,
            };
            rhs(stage, &self.centres, &mut self.velocities)?;
            if number == 0 {
                self.first.clone_from(&self.velocities);
            }
            for (mean, u) in self.mean.iter_mut().zip(&self.velocities) {
                *mean += WEIGHTS[number] * u;
            }
        }
        let spheres = state.centres.iter_mut().zip(&mut state.orientations);
        let last = S::by_sphere(&self.velocities);
        let stages = S::by_sphere(&self.first).iter().zip(last);
        let means = S::by_sphere(&self.mean).iter().zip(stages);
        for ((x, orientation), (mean, (first, last))) in spheres.zip(means) {
            *x += S::translation(mean) * dt;
            // Rotations do not commute: with τ²/12 ω₄ × ω₁ orientations are of order four too
            // (Magnus 1954).
            let commutator = S::commutator(&S::rotation(last), &S::rotation(first));
            let rotation = S::rotation(mean) * dt + commutator * (dt * dt / 12.0);
            *orientation = S::turned(orientation, &rotation);
        }
        Ok(())
    }

    /// Mean velocities of the last step, sphere by sphere.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Bulk;
    use crate::space::modes::Vec2;
    use nalgebra::Vector3;

    /// Error after one turn of a point on a circle whose speed oscillates in time.
    fn error(steps: u32) -> f64 {
        let mut state: State = State {
            centres: vec![Vec2::new(1.0, 0.0)],
            orientations: vec![0.0],
        };
        let mut rk = RungeKutta::default();
        let dt = std::f64::consts::TAU / f64::from(steps);
        for k in 0..steps {
            rk.step(&mut state, f64::from(k) * dt, dt, |stage, x, u| {
                let rate = 1.0 + stage.time.sin();
                u.copy_from_slice(&[-rate * x[0].y, rate * x[0].x, rate]);
                Ok::<(), ()>(())
            })
            .unwrap();
        }
        (state.centres[0] - Vec2::new(1.0, 0.0)).norm()
    }

    /// Error of an orientation after a unit of time about an axis that moves on a cone.
    fn turning_error(steps: u32) -> f64 {
        let mut state = State::<Bulk> {
            centres: vec![Vector3::zeros()],
            orientations: vec![Bulk::UPRIGHT],
        };
        let mut method = RungeKutta::default();
        let dt = 1.0 / f64::from(steps);
        // In the frame that turns at the rate b about z the axis is constant: ω = a + b ẑ there.
        let (a, b) = (Vector3::new(1.3, 0.0, 0.4), 2.0);
        for k in 0..steps {
            method
                .step(&mut state, f64::from(k) * dt, dt, |stage, _, u| {
                    let (sin, cos) = (b * stage.time).sin_cos();
                    let axis = Vector3::new(cos * a.x, sin * a.x, a.z);
                    u[3..].copy_from_slice(axis.as_slice());
                    Ok::<_, ()>(())
                })
                .unwrap();
        }
        let own = Bulk::turned(&Bulk::UPRIGHT, &(a - Vector3::z() * b));
        let exact = Bulk::turned(&own, &(Vector3::z() * b));
        let pairs = state.orientations[0].iter().zip(exact);
        pairs
            .map(|(found, exact)| (found - exact).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn orientations_in_three_dimensions_are_of_order_four() {
        let order = (turning_error(40) / turning_error(80)).log2();
        assert!((order - 4.0).abs() < 0.2, "order {order}");
    }

    #[test]
    fn order_is_four() {
        let order = (error(50) / error(100)).log2();
        assert!((order - 4.0).abs() < 0.2, "order {order}");
    }
}
