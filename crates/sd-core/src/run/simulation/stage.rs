//! The right-hand side: from positions to velocities, with what contacts remember and how the shear is imposed.

use super::drive::{Drive, Pass};
use super::{Sample, Scheme, SchemeMemory, Simulation};
use crate::contact::Quality;
use crate::contact::laws::{Phase, Span};
use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::run::steppers::Stage;
use crate::stage::Contact;

impl Simulation {
    /// One right-hand side; the layer is sampled at the first of a step.
    pub(super) fn stage(
        &mut self,
        stage: Stage,
        centres: &[Vec2],
        velocities: &mut [f64],
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let cell = self.cell_at(stage.time)?;
        let first = stage.number == 0;
        // Not of a step that is done again in halves.
        let sampled = first && sample.is_none();
        let mut pass = Pass::First;
        if first {
            // A run that is resumed here then has the same bits.
            self.stage.begin_step();
            if sampled && self.samples_apart(&stage) {
                *sample = Some(self.sample_apart(stage, &cell, centres)?);
                pass = Pass::Again;
            }
        }
        let quality = self.solve_driven(stage, &cell, centres, pass)?;
        self.count(quality);
        if sampled {
            let stress = self.stress_of_stage();
            self.count_first(stress.viscosity, quality.jammed);
            match sample {
                Some(sample) => sample.counters = self.counters,
                None => *sample = Some(self.measure(stage.time, &stress)),
            }
        }
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
        Ok(())
    }

    /// The contact problem of a stage and its motion, at the rate or the stress that is imposed.
    pub(super) fn solve_driven(
        &mut self,
        stage: Stage,
        cell: &Cell,
        centres: &[Vec2],
        pass: Pass,
    ) -> Result<Quality, Error> {
        match &self.drive {
            Drive::Rate => self.solve(stage, cell, centres, pass),
            Drive::Stress { .. } => self.solve_at_stress(stage, cell, centres, pass),
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
                let phase = match (laws.is_soft(), stage.number) {
                    (false, _) => Phase::Alone,
                    (true, 0) => Phase::First,
                    (true, _) => Phase::Second,
                };
                let span = Span {
                    time: stage.span,
                    phase,
                    first,
                };
                let contact = Contact::Laws { laws, span, memory };
                let quality = if pass == Pass::First {
                    solver.solve(&background, &[], contact)?
                } else if laws.repulsion.is_some() {
                    // Its slope is a part of the matrix that was factored.
                    solver.assemble(cell, centres)?;
                    solver.solve(&background, &[], contact)?
                } else {
                    solver.solve_again(&background, contact)?
                };
                if phase == Phase::First {
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
