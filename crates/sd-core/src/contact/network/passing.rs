//! Rigid contacts of a network under an iterated far field: the passes of [`super`], one for each iteration of the far field.

use super::super::augmented::{Goal, System};
use super::super::rigid::{MOST_ROUNDS, Memory};
use super::super::{Contacts, Quality, Surface};
use super::{DECIDING_PASSES, Driving, LEAST_FORCE, ROUNDING, VIOLATION};
use crate::error::Error;
use crate::geometry::modes::Background;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::resistance::Resistance;
use nalgebra::Vector3;

/// How small a violation of the normal problem must be, over the relative residual of the far field, in a·rate.
const STRICT: f64 = 5e-3;

/// How small a force left over must be, over the relative residual of the far field and the drag on a sphere.
const CLOSE: f64 = 0.1;
/// Relative residual that the first pass is made for.
const FIRST: f64 = 1e-2;

/// The contact problem of one stage.
pub struct NetworkPasses<'a> {
    /// Ball-Melrose, [`Resistance::new_pairwise`], at the stage's positions.
    near: &'a Resistance,
    /// Candidates, forces and workspace.
    contacts: &'a mut Contacts,
    /// Imposed flow.
    background: &'a Background,
    /// Roughness and friction.
    surface: Surface,
    /// τ of the stage, in strain.
    time_span: f64,
    /// Forces of the stage before, then of this one.
    memory: &'a mut Memory,
    /// How well the normal problem of the last pass was solved.
    quality: Quality,
}

impl<'a> NetworkPasses<'a> {
    /// The problem of all pairs that could close within the time span.
    pub fn new(
        near: &'a Resistance,
        contacts: &'a mut Contacts,
        background: &'a Background,
        surface: Surface,
        time_span: f64,
        memory: &'a mut Memory,
    ) -> Self {
        let problem = Self {
            near,
            contacts,
            background,
            surface,
            time_span,
            memory,
            quality: Quality::default(),
        };
        problem.contacts.choose_candidates(
            near,
            background,
            &problem.surface,
            time_span,
            problem.memory,
        );
        problem
    }

    /// Solves the stage: rounds, as long as pairs join that would close after all.
    ///
    /// # Errors
    /// Those of [`IterativeFarField::solve_fixed_point`].
    pub fn solve(
        &mut self,
        far: &mut IterativeFarField,
        strain: &Vector3<f64>,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let mut passes = 0;
        for _ in 0..MOST_ROUNDS {
            let near = self.near;
            far.solve_fixed_point(near, self, strain, forces, velocities)?;
            let (mut quality, joined) = self.finish(velocities);
            passes += quality.passes;
            quality.passes = passes;
            if !joined {
                return Ok(quality);
            }
        }
        let closing = self.contacts.fastest_closing(&self.surface, self.time_span);
        Ok(Quality {
            residual: self.quality.residual.max(closing),
            passes,
            ..self.quality
        })
    }

    /// Takes the velocities `[3N]` that came out: forces and velocities of the list, memory. How well the stage was solved, and
    /// whether pairs have joined that would close after all; it must then be solved again.
    fn finish(&mut self, velocities: &[f64]) -> (Quality, bool) {
        self.contacts.take_network_forces(&self.surface);
        self.contacts.take_velocities(velocities);
        let work = &self.contacts.network;
        let largest = work
            .normal
            .forces
            .iter()
            .fold(LEAST_FORCE, |m: f64, f| m.max(*f));
        let pairs = work.wanted.iter().zip(&work.applied);
        let change = pairs.fold(0.0, |m: f64, (wanted, applied)| {
            m.max((wanted - applied).abs())
        });
        self.quality.friction_error = change / largest;
        let joined = self.contacts.add_closing(
            self.near,
            self.background,
            &self.surface,
            self.time_span,
            velocities,
            self.memory,
        );
        (self.quality, joined)
    }
}

impl FixedPointMap for NetworkPasses<'_> {
    fn start(&mut self, applied: &mut Vec<f64>) {
        applied.clear();
        let Some(network) = self.near.pairwise() else {
            return;
        };
        let pattern = network.pattern();
        let contacts = &mut *self.contacts;
        contacts.network.start(3 * self.near.radii().len());
        contacts.begin_network(
            (network, pattern),
            &self.surface,
            self.time_span,
            self.memory,
        );
        applied.extend_from_slice(&contacts.network.applied);
        self.quality = Quality::default();
    }

    fn evaluate(
        &mut self,
        forces: &[f64],
        applied: &[f64],
        progress: Progress,
        velocities: &mut [f64],
        wanted: &mut Vec<f64>,
    ) -> Result<bool, Error> {
        let network = self.near.pairwise().ok_or(Error::OnlyRigidContacts)?;
        let pattern = network.pattern();
        let (normal, by_friction) = forces.split_at(forces.len() / 2);
        let (v, v_t) = velocities.split_at_mut(by_friction.len());
        let Contacts {
            network: work,
            list,
            ..
        } = &mut *self.contacts;
        work.applied.copy_from_slice(applied);
        // The sum of both parts' forces, where the velocities will be.
        for (v, (n, t)) in v.iter_mut().zip(normal.iter().zip(by_friction)) {
            *v = n + t;
        }
        let driving = Driving {
            forces: v,
            by_friction,
        };
        let largest = work
            .normal
            .forces
            .iter()
            .fold(LEAST_FORCE, |m: f64, f| m.max(*f));
        let residual = progress.residual.min(FIRST);
        let friction = self.surface.has_friction();
        let goal = Goal {
            force: (CLOSE * residual * LEAST_FORCE).max(ROUNDING * largest),
            velocity: (STRICT * residual).clamp(VIOLATION[1], VIOLATION[0]),
            passing: false,
        };
        let system = System {
            network,
            pattern,
            list,
        };
        work.drive(&system, driving, goal.force)?;
        self.quality.residual = work.normal.solve(&system, &work.driving, goal)?;
        self.quality.passes += 1;
        // A load of zero makes no jump: it is never decided.
        let jumps = self.surface.critical_load > 0.0;
        let deciding = !jumps || progress.evaluations < DECIDING_PASSES;
        let activated = |work: &super::Workspace| work.activated.iter().filter(|a| **a).count();
        let active = activated(work);
        if friction {
            work.apply_law(list, self.near, &self.surface, deciding);
        }
        let changed = jumps && deciding && activated(work) != active;
        wanted.clear();
        wanted.extend_from_slice(&work.wanted);
        v.copy_from_slice(&work.normal.velocities);
        v_t.copy_from_slice(&work.by_friction);
        for (v, v_t) in v.iter_mut().zip(v_t) {
            *v -= *v_t;
        }
        Ok(changed)
    }
}
