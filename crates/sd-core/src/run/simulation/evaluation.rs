//! The right-hand side: from positions to velocities, with the memory of contacts and the control
//! of the shear.

use super::shear_control::ShearControl;
use super::volume::grown;
use super::{Instant, SchemeMemory, Simulation};
use crate::contact::laws::Span;
use crate::contact::{Quality, SolvePass};
use crate::error::Error;
use crate::run::spaces::Starts;
use crate::run::steppers::Stage;
use crate::space::cell::Cell;
use crate::stage::StageContacts;

impl<S: Starts> Simulation<S> {
    /// One right-hand side; returns the quality of its contact problem.
    pub(super) fn evaluate(
        &mut self,
        stage: Stage,
        centres: &[S::Vector],
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let Some(growth) = self.begin_dilation(&stage) else {
            return self.evaluate_at(stage, centres, velocities);
        };
        let kind = self.params.pressure;
        let mut places = std::mem::take(&mut self.grown);
        places.clear();
        places.extend(centres.iter().map(|&x| grown::<S>(kind, x, growth)));
        let quality = self.evaluate_at(stage, &places, velocities);
        self.grown = places;
        quality
    }

    /// One right-hand side at the positions of the stage.
    fn evaluate_at(
        &mut self,
        stage: Stage,
        centres: &[S::Vector],
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let cell = self.cell_at(stage.time)?;
        if stage.number == 0 {
            // This gives a run that is resumed here the same bits.
            self.solver.begin_step();
        }
        let quality = match &self.shear_control {
            ShearControl::Rate => self.solve(stage, &cell, centres, SolvePass::First)?,
            ShearControl::Stress { .. } => self.solve_at_stress(stage, &cell, centres)?,
            ShearControl::Thermal { .. } => self.solve_at_thermal_stress(stage, &cell, centres)?,
        };
        self.count(quality);
        if self.params.macroscopic_friction.is_some() {
            self.dilations.viscosity = self.stress_of_stage().viscosity;
        }
        if let Some(brownian) = self.brownian.as_mut().filter(|_| self.is_measured) {
            brownian.record(&stage, || self.stress.random_stress(&self.solver));
        }
        let (background, solver) = (self.background, &self.solver);
        let spheres = S::by_sphere_mut(velocities)
            .iter_mut()
            .zip(S::by_sphere(solver.velocities()));
        for ((u, v), x) in spheres.zip(centres) {
            let flow = S::join(&background.velocity(x), &background.angular_velocity());
            for k in 0..S::MODES {
                u[k] = v[k] + flow[k];
            }
        }
        self.motion.clear();
        self.motion.extend_from_slice(velocities);
        self.end_dilation(centres, velocities);
        Ok(quality)
    }

    /// Whether contacts have forces at the stage solved last.
    pub(super) fn has_contact_forces(&self) -> bool {
        let mut contacts = self.solver.contacts.list.iter();
        contacts.any(|contact| contact.normal_force > 0.0)
    }

    /// The contact problem of a stage and its motion.
    pub(super) fn solve(
        &mut self,
        stage: Stage,
        cell: &Cell<S>,
        centres: &[S::Vector],
        mut pass: SolvePass,
    ) -> Result<Quality, Error> {
        self.solver.contacts.pressure = self.imposed_pressure();
        let (primary, shear) = (self.primary_flow(), self.first_shear());
        let volume = || S::volume(self.content(), self.solver.resistance.radii());
        let free = self.shear_control.is_thermal().then(volume);
        let (flow, solver, laws) = (self.background.into(), &mut self.solver, &self.laws);
        if laws.act_without_contact() {
            // They are a part of the forces, and a repulsion of the matrix.
            pass = SolvePass::First;
        }
        if pass == SolvePass::First {
            let instant = Instant {
                time: stage.time,
                cell,
                centres,
            };
            let hydrodynamics = self.params.hydrodynamics;
            self.forces.update(hydrodynamics, &instant)?;
            solver.assemble(cell, centres)?;
            let energy = self.params.thermal_energy();
            let free = free.map(|volume| (primary.strain(), volume));
            if let (Some(brownian), Some(energy), 0) = (&mut self.brownian, energy, stage.number) {
                brownian.draw(
                    self.steps,
                    [stage.time, self.params.time_step],
                    energy,
                    free,
                    solver,
                )?;
            }
        }
        let external = self.forces.values();
        let quality = match &mut self.memory {
            SchemeMemory::Laws(memory) => {
                let span = Span {
                    time: stage.span,
                    kind: stage.kind,
                    first: &self.first,
                    shear,
                    dilation: self.dilations.first(),
                    dilates: self.params.pressure,
                };
                let contact = StageContacts::Laws { laws, span, memory };
                let quality = solver.solve(&flow, external, contact, pass)?;
                if stage.number == 0 {
                    // Input of a later stage of the step.
                    self.first.clear();
                    self.first.extend_from_slice(solver.velocities());
                }
                quality
            }
            SchemeMemory::Procedure {
                contact_list,
                velocities,
            } => {
                if pass == SolvePass::First {
                    if stage.number == 0 && !velocities.is_empty() {
                        let roughness = self.params.roughness;
                        contact_list.add_approaching(
                            &solver.resistance,
                            &flow,
                            roughness,
                            velocities,
                        );
                    }
                    self.contact_list_before
                        .pairs
                        .clone_from(&contact_list.pairs);
                } else {
                    // A solve removes pairs from the list.
                    contact_list
                        .pairs
                        .clone_from(&self.contact_list_before.pairs);
                }
                let surface = self.shear_control.surface(&self.params);
                let contact = StageContacts::Procedure {
                    surface,
                    contact_list,
                };
                solver.solve(&flow, external, contact, pass)?
            }
        };
        self.systems += u64::from(quality.systems);
        Ok(quality)
    }
}
