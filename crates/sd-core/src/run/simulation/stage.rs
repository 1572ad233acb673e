//! The right-hand side: from positions to velocities, with what contacts remember and how the shear is imposed.

use super::drive::Drive;
use super::{SchemeMemory, Simulation};
use crate::contact::laws::Span;
use crate::contact::{Pass, Quality};
use crate::error::Error;
use crate::run::steppers::{Bearing, Stage};
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::stage::Contact;

impl Simulation {
    /// One right-hand side; whether its contact problem has no solution.
    pub(super) fn stage(
        &mut self,
        stage: Stage,
        centres: &[Vec2],
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        let cell = self.cell_at(stage.time)?;
        if stage.number == 0 {
            // A run that is resumed here then has the same bits.
            self.stage.begin_step();
        }
        let quality = match &self.drive {
            Drive::Rate => self.solve(stage, &cell, centres, Pass::First)?,
            Drive::Stress { .. } => self.solve_at_stress(stage, &cell, centres)?,
        };
        self.count(quality);
        let (background, solver) = (self.background, &self.stage);
        for ((u, v), &x) in velocities
            .chunks_exact_mut(3)
            .zip(solver.velocities().chunks_exact(3))
            .zip(centres)
        {
            let flow = background.velocity(x);
            u[0] = v[0] + flow.x;
            u[1] = v[1] + flow.y;
            u[2] = v[2] + background.angular_velocity;
        }
        Ok(quality.jammed())
    }

    /// Whether contacts bear forces at the stage solved last.
    pub(super) fn bearing(&self) -> Bearing {
        let mut contacts = self.stage.contacts.list.iter();
        if contacts.any(|contact| contact.normal_force > 0.0) {
            Bearing::Loaded
        } else {
            Bearing::Free
        }
    }

    /// The contact problem of a stage and its motion.
    pub(super) fn solve(
        &mut self,
        stage: Stage,
        cell: &Cell,
        centres: &[Vec2],
        mut pass: Pass,
    ) -> Result<Quality, Error> {
        let (background, solver, laws) = (self.background, &mut self.stage, &self.laws);
        if laws.act_at_a_distance() {
            // They are a part of the forces, and a repulsion of the matrix.
            pass = Pass::First;
        }
        if pass == Pass::First {
            solver.assemble(cell, centres)?;
        }
        match &mut self.memory {
            SchemeMemory::Laws(memory) => {
                let span = Span {
                    time: stage.span,
                    phase: stage.phase,
                    first: &self.first,
                };
                let contact = Contact::Laws { laws, span, memory };
                let quality = solver.solve(&background, &[], contact, pass)?;
                if stage.number == 0 {
                    // What a later stage of the step asks for.
                    self.first.clear();
                    self.first.extend_from_slice(solver.velocities());
                }
                Ok(quality)
            }
            SchemeMemory::Procedure { listed, velocities } => {
                let SchemeMemory::Procedure { listed: before, .. } = &mut self.remembered else {
                    unreachable!("made for the same scheme");
                };
                if pass == Pass::First {
                    if stage.number == 0 && !velocities.is_empty() {
                        let roughness = self.params.roughness;
                        listed.add_approaching(
                            &solver.resistance,
                            &background,
                            roughness,
                            velocities,
                        );
                    }
                    before.pairs.clone_from(&listed.pairs);
                } else {
                    // A solve drops pairs from the list.
                    listed.pairs.clone_from(&before.pairs);
                }
                let surface = self.drive.surface(&self.params);
                let contact = Contact::Procedure { surface, listed };
                solver.solve(&background, &[], contact, pass)
            }
        }
    }
}
