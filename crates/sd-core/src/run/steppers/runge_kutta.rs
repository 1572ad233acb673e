//! Classical Runge-Kutta of order four.

use super::state::{Stage, State};
use crate::contact::laws::Phase;
use crate::space::modes::Vec2;

/// Nodes of the stages, in steps.
const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
/// Time spans τ of the stages for the contact laws, in steps.
const SPANS: [f64; 4] = [1.0, 0.5, 0.5, 1.0];
/// Weights of the stages.
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// Workspace of the integrator.
#[derive(Debug, Default)]
pub struct RungeKutta {
    centres: Vec<Vec2>,
    /// Velocities at the stage, `[3N]`: `(U_x, U_y, Ω)` per sphere, background included.
    velocities: Vec<f64>,
    /// Weighted mean of the velocities over the step, `[3N]`.
    mean: Vec<f64>,
}

impl RungeKutta {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities `[3N]` at the given centres.
    ///
    /// Centres move continuously (they are not wrapped into a cell within the step).
    ///
    /// # Errors
    /// Whatever `rhs` returns; the state is then unchanged.
    pub fn step<E>(
        &mut self,
        state: &mut State,
        time: f64,
        dt: f64,
        mut rhs: impl FnMut(Stage, &[Vec2], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let n = state.centres.len();
        self.velocities.resize(3 * n, 0.0);
        self.mean.clear();
        self.mean.resize(3 * n, 0.0);
        for number in 0..4 {
            self.centres.clear();
            for (i, &x) in state.centres.iter().enumerate() {
                let u = Vec2::new(self.velocities[3 * i], self.velocities[3 * i + 1]);
                // The first stage is at the start itself, whatever the velocities still hold.
                self.centres.push(if number == 0 {
                    x
                } else {
                    x + u * (NODES[number] * dt)
                });
            }
            let stage = Stage {
                number,
                time: time + NODES[number] * dt,
                span: SPANS[number] * dt,
                phase: Phase::Alone,
            };
            rhs(stage, &self.centres, &mut self.velocities)?;
            for (mean, u) in self.mean.iter_mut().zip(&self.velocities) {
                *mean += WEIGHTS[number] * u;
            }
        }
        for (i, x) in state.centres.iter_mut().enumerate() {
            *x += Vec2::new(self.mean[3 * i], self.mean[3 * i + 1]) * dt;
            state.orientations[i] += self.mean[3 * i + 2] * dt;
        }
        Ok(())
    }

    /// Mean velocities `[3N]` of the last step.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error after one turn of a point on a circle whose speed oscillates in time.
    fn error(steps: u32) -> f64 {
        let mut state = State {
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

    #[test]
    fn order_is_four() {
        let order = (error(50) / error(100)).log2();
        assert!((order - 4.0).abs() < 0.2, "order {order}");
    }
}
