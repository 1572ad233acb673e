//! Two stages per step for rigid contacts: the midpoint rule, with the gaps of the step's start
//! held over the whole step.
//!
//! ```text
//! v1 = v(x; contacts hold their gaps over τ)
//! v2 = v(x + τ/2 v1; contacts hold the gaps that they had at x over τ)
//! x ← x + τ v2
//! ```
//!
//! Contacts close and open within a step, where velocities jump and a method of higher order has no
//! advantage. The gaps must be preserved, and two spheres that move by v2 relative to the line of
//! centres at the step's middle keep their gap up to O(τ³). Forces at the middle act over the whole
//! step, and so are their mean over it, including contacts that close within the step.
//!
//! Without contact forces the motion is smooth, and integrated by Runge-Kutta of order four.

use super::runge_kutta::RungeKutta;
use super::state::{Stage, State};
use crate::contact::laws::StageKind;
use crate::space::Space;

/// The stages whose velocities move the spheres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stages {
    Both,
    /// The first alone.
    First,
}

/// Workspace of the integrator.
#[derive(Default, Debug)]
pub(crate) struct Midpoint<S: Space> {
    /// State at the start of the step.
    start: State<S>,
    centres: Vec<S::Vector>,
    /// Velocities of both stages, sphere by sphere, background included.
    velocities: [Vec<f64>; 2],
    /// For steps without contact forces.
    free: RungeKutta<S>,
}

impl<S: Space> Midpoint<S> {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities at the given centres,
    /// and returns whether contacts have forces there.
    ///
    /// `stages`: how many of the two are used. One, whose contacts hold their gaps over the whole
    /// step, makes a step of order one.
    ///
    /// # Errors
    /// Errors of `rhs`; the state is then unchanged.
    pub(crate) fn step<E>(
        &mut self,
        state: &mut State<S>,
        [time, dt]: [f64; 2],
        stages: Stages,
        mut rhs: impl FnMut(Stage, &[S::Vector], &mut [f64]) -> Result<bool, E>,
    ) -> Result<(), E> {
        self.start.copy_from(state);
        let spheres = state.centres.len();
        for velocities in &mut self.velocities {
            velocities.resize(S::MODES * spheres, 0.0);
        }
        self.centres.clear();
        self.centres.reserve(spheres);
        let [first, second] = &mut self.velocities;
        let stage = Stage {
            number: 0,
            time,
            span: dt,
            kind: StageKind::Single,
        };
        let has_contact_forces = rhs(stage, &state.centres, first)?;
        if stages == Stages::First {
            state.advance(first, dt);
            return Ok(());
        }
        if !has_contact_forces {
            return self
                .free
                .step(state, time, dt, |stage, centres, velocities| {
                    if stage.number == 0 {
                        velocities.copy_from_slice(first);
                        Ok(())
                    } else {
                        rhs(stage, centres, velocities).map(|_| ())
                    }
                });
        }
        let moved = state.centres.iter().zip(S::by_sphere(first));
        self.centres
            .extend(moved.map(|(&x, u)| x + S::translation(u) * (0.5 * dt)));
        let middle = Stage {
            number: 1,
            time: time + 0.5 * dt,
            span: dt,
            kind: StageKind::Midpoint,
        };
        rhs(middle, &self.centres, second)?;
        state.advance(second, dt);
        Ok(())
    }

    /// Undoes the last step.
    pub(crate) fn undo(&self, state: &mut State<S>) {
        state.copy_from(&self.start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::Vec2;

    /// Error after one turn of a point on a circle whose speed oscillates in time.
    fn error(steps: u32, has_contact_forces: bool) -> f64 {
        let mut state: State = State {
            centres: vec![Vec2::new(1.0, 0.0)],
            orientations: vec![0.0],
        };
        let mut method = Midpoint::default();
        let dt = std::f64::consts::TAU / f64::from(steps);
        for k in 0..steps {
            method
                .step(
                    &mut state,
                    [f64::from(k) * dt, dt],
                    Stages::Both,
                    |stage, x, u| {
                        let rate = 1.0 + stage.time.sin();
                        u.copy_from_slice(&[-rate * x[0].y, rate * x[0].x, rate]);
                        Ok::<_, ()>(has_contact_forces)
                    },
                )
                .unwrap();
        }
        (state.centres[0] - Vec2::new(1.0, 0.0)).norm()
    }

    #[test]
    fn order_is_two_under_contact_forces_and_four_without() {
        for (has_contact_forces, expected) in [(true, 2.0), (false, 4.0)] {
            let order = (error(100, has_contact_forces) / error(200, has_contact_forces)).log2();
            assert!(
                (order - expected).abs() < 0.2,
                "{has_contact_forces}: order {order}"
            );
        }
    }

    #[test]
    fn step_taken_back_leaves_the_same_bits() {
        let mut state: State = State {
            centres: vec![Vec2::new(0.1, 0.7)],
            orientations: vec![0.3],
        };
        let before = state.clone();
        let mut method = Midpoint::default();
        method
            .step(&mut state, [0.0, 0.1], Stages::Both, |_, x, u| {
                u.copy_from_slice(&[x[0].y, -x[0].x, 1.0]);
                Ok::<_, ()>(true)
            })
            .unwrap();
        assert_ne!(state, before);
        method.undo(&mut state);
        assert_eq!(state, before);
    }
}
