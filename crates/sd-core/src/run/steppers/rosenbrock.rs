//! Two stages per step for forces that depend on the gaps: second order in time, and stable at any
//! stiffness.
//!
//! ```text
//! v1 = v(x; forces look ahead by γτ v1)
//! v2 = v(x + τ v1; forces look ahead by γτ (v2 − 2 v1))
//! x ← x + τ (v1 + v2)/2,    γ = 1 − 1/√2
//! ```
//!
//! The Rosenbrock W-method ROS2 (Verwer et al., SIAM J. Sci. Comput. 20, 1456 (1999)), written for
//! the sum v2 of its second stage and twice its first, with the slope of the contact forces along
//! the line of centres as its approximate Jacobian: of order two for any slope that is the same in
//! both stages up to O(τ), and L-stable in it. A gap that relaxes under a stiff spring reaches
//! equilibrium in one step. Where a contact opens or closes within a step the error of that step is
//! O(τ²).

use super::state::{Stage, State};
use crate::contact::laws::{GAMMA, StageKind};
use crate::space::{Layer, Space};

/// Workspace of the integrator.
#[derive(Default, Debug)]
pub struct Rosenbrock<S: Space = Layer> {
    centres: Vec<S::Vector>,
    /// Velocities of both stages, sphere by sphere, background included.
    velocities: [Vec<f64>; 2],
}

impl<S: Space> Rosenbrock<S> {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities at the given centres;
    /// `stage.span` is γτ.
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
        let [first, second] = &mut self.velocities;
        first.resize(S::MODES * n, 0.0);
        second.resize(S::MODES * n, 0.0);
        let stage = |number: usize| Stage {
            number,
            time: time + number as f64 * dt,
            span: GAMMA * dt,
            kind: if number == 0 {
                StageKind::First
            } else {
                StageKind::Second
            },
        };
        rhs(stage(0), &state.centres, first)?;
        self.centres.clear();
        let moved = state.centres.iter().zip(S::by_sphere(first));
        self.centres
            .extend(moved.map(|(&x, u)| x + S::translation(u) * dt));
        rhs(stage(1), &self.centres, second)?;
        let both = S::by_sphere(first).iter().zip(S::by_sphere(second));
        for ((x, turned), (u, v)) in state
            .centres
            .iter_mut()
            .zip(&mut state.orientations)
            .zip(both)
        {
            *x += (S::translation(u) + S::translation(v)) * (0.5 * dt);
            let rotation = (S::rotation(u) + S::rotation(v)) * (0.5 * dt);
            *turned = S::turned(turned, &rotation);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::Vec2;

    /// x after one unit of time of x' = −rate (x − cos t), x(0) = 1, its whole slope looking ahead,
    /// or `share` of it.
    fn relaxed(rate: f64, share: f64, steps: u32) -> f64 {
        let mut state: State = State {
            centres: vec![Vec2::new(1.0, 0.0)],
            orientations: vec![0.0],
        };
        let mut integrator = Rosenbrock::default();
        let dt = 1.0 / f64::from(steps);
        let mut first = 0.0;
        for k in 0..steps {
            integrator
                .step(&mut state, f64::from(k) * dt, dt, |stage, x, u| {
                    let pull = rate * share * stage.span;
                    let twice_first_approach = if stage.number == 1 { 2.0 * first } else { 0.0 };
                    let force = -rate * (x[0].x - stage.time.cos());
                    // u = force − pull (u − taken back)
                    u[0] = (force + pull * twice_first_approach) / (1.0 + pull);
                    first = u[0];
                    Ok::<(), ()>(())
                })
                .unwrap();
        }
        state.centres[0].x
    }

    #[test]
    fn order_is_two_whatever_part_of_the_slope_looks_ahead() {
        let rate = 10.0_f64;
        // x = (r² cos t + r sin t)/(r² + 1) + C e^(−rt)
        let forced = |t: f64| (rate * rate * t.cos() + rate * t.sin()) / (rate * rate + 1.0);
        let exact = forced(1.0) + (1.0 - forced(0.0)) * (-rate).exp();
        for share in [0.0, 0.5, 1.0] {
            let error = |steps| (relaxed(rate, share, steps) - exact).abs();
            let order = (error(200) / error(400)).log2();
            assert!((order - 2.0).abs() < 0.1, "share {share}: order {order}");
        }
    }

    #[test]
    fn stiff_relaxation_is_over_after_one_step() {
        let found = relaxed(1e9, 1.0, 1);
        // The first stage is at rest, and the second relaxes by 1/γ: x = 1 − (1 − cos 1)/(2γ).
        let limit = 1.0 - (1.0 - 1.0_f64.cos()) / (2.0 * GAMMA);
        assert!((found - limit).abs() < 1e-6, "{found}");
        assert!((relaxed(1e9, 1.0, 100) - 1.0_f64.cos()).abs() < 1e-2);
    }
}
