//! The right-hand side: from positions to velocities, with what contacts remember and how the shear is imposed.

use super::drive::{Drive, Pass};
use super::{Scheme, SchemeMemory, Simulation};
use crate::contact::Quality;
use crate::contact::laws::Span;
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
        let quality = self.solve_driven(stage, &cell, centres)?;
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

    /// The contact problem of a stage and its motion, at the rate or the stress that is imposed.
    fn solve_driven(
        &mut self,
        stage: Stage,
        cell: &Cell,
        centres: &[Vec2],
    ) -> Result<Quality, Error> {
        match &self.drive {
            Drive::Rate => self.solve(stage, cell, centres, Pass::First),
            Drive::Stress { .. } => self.solve_at_stress(stage, cell, centres),
        }
    }

    /// The contact problem of a stage and its motion.
    pub(super) fn solve(
        &mut self,
        stage: Stage,
        cell: &Cell,
        centres: &[Vec2],
        pass: Pass,
    ) -> Result<Quality, Error> {
        let (background, solver) = (self.background, &mut self.stage);
        if pass == Pass::First {
            solver.assemble(cell, centres)?;
        }
        let surface = self.drive.surface(&self.params);
        match (&mut self.scheme, &mut self.memory) {
            (Scheme::Laws { laws, first }, SchemeMemory::Laws(memory)) => {
                let span = Span {
                    time: stage.span,
                    phase: stage.phase,
                    first,
                };
                let contact = Contact::Laws { laws, span, memory };
                let quality = if pass == Pass::First {
                    solver.solve(&background, &[], contact)?
                } else if laws.repulsion.is_some() || laws.adhesion > 0.0 {
                    // They are a part of the forces, and a repulsion of the matrix that was factored.
                    solver.assemble(cell, centres)?;
                    solver.solve(&background, &[], contact)?
                } else {
                    solver.solve_again(&background, contact)?
                };
                if stage.number == 0 {
                    // What a later stage of the step asks for.
                    first.clear();
                    first.extend_from_slice(solver.velocities());
                }
                Ok(quality)
            }
            (_, SchemeMemory::Procedure { listed, velocities }) => {
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
                    self.listed_before.pairs.clone_from(&listed.pairs);
                    let contact = Contact::Procedure { surface, listed };
                    solver.solve(&background, &[], contact)
                } else {
                    // A solve drops pairs from the list.
                    listed.pairs.clone_from(&self.listed_before.pairs);
                    let contact = Contact::Procedure { surface, listed };
                    solver.solve_again(&background, contact)
                }
            }
            (Scheme::Procedure, SchemeMemory::Laws(_)) => {
                unreachable!("snapshots are checked against the parameters")
            }
        }
    }
}
