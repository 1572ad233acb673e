//! One right-hand side: from positions to velocities, contact forces included.

use crate::contact::laws::{History, Laws, Phase, Span};
use crate::contact::network::Driving;
use crate::contact::network::passing::NetworkPasses;
use crate::contact::procedure::ContactList;
use crate::contact::repulsion::Repelled;
use crate::contact::rigid::Memory;
use crate::contact::{Contacts, Quality, Surface};
use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::{Background, Vec2};
use crate::geometry::pair::Neighbours;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::resistance::Resistance;
use nalgebra::Vector3;

/// What keeps the spheres apart, with what it remembers from stage to stage.
pub enum ContactLaw<'a> {
    /// Nothing but the fluid.
    None,
    /// See [`crate::contact::rigid`].
    Rigid {
        /// Roughness and friction.
        surface: Surface,
        /// τ of the stage, in strain.
        time_span: f64,
        /// Forces of the stage before.
        memory: &'a mut Memory,
    },
    /// See [`crate::contact::procedure`].
    Procedure {
        /// Roughness and friction.
        surface: Surface,
        /// Pairs in contact.
        listed: &'a mut ContactList,
    },
    /// See [`crate::contact::laws`].
    Laws {
        /// The laws.
        laws: &'a Laws,
        /// How far contact forces look ahead, in strain, and in which stage of a step.
        span: (f64, Phase),
        /// Forces of the stage before, tangential springs.
        memory: &'a mut Memory,
        /// What the stages of a step tell each other.
        history: &'a mut History,
    },
}

impl ContactLaw<'_> {
    /// Whether it adds to `R_FU` itself, which must then be assembled only.
    fn changes_resistance(&self) -> bool {
        matches!(self, Self::Laws { laws, .. } if laws.repulsion.is_some())
    }
}

/// Solver of the motion of one set of spheres, with its workspace.
pub struct Motion {
    /// Hydrodynamics.
    pub resistance: Resistance,
    /// Contact problem of the last solve; its list is empty without contact.
    pub contacts: Contacts,
    /// Pairs that a repulsion keeps apart, besides.
    pub repelled: Repelled,
    /// External and background forces `[3N]`.
    forces: Vec<f64>,
    /// Work vector in the order of the factor's rows, `[3N]`.
    rows: Vec<f64>,
    /// Disturbance velocities `[3N]` of the last solve.
    velocities: Vec<f64>,
    /// Far field iterated on top of a Ball-Melrose network.
    far: Option<Box<IterativeFarField>>,
}

impl Motion {
    /// Workspace for the spheres the resistance was made for.
    pub fn new(resistance: Resistance) -> Self {
        let n = 3 * resistance.radii().len();
        let contacts = match resistance.pairwise() {
            None => Contacts::new(resistance.radii().len()),
            Some(_) => Contacts::default(),
        };
        Self {
            contacts,
            resistance,
            repelled: Repelled::default(),
            forces: vec![0.0; n],
            rows: Vec::with_capacity(n),
            velocities: vec![0.0; n],
            far: None,
        }
    }

    /// Full Stokesian Dynamics of many spheres: the far field iterated on top of a Ball-Melrose network, for rigid contacts or none.
    pub fn with_far_field(network: Resistance, far: IterativeFarField) -> Self {
        Self {
            far: Some(Box::new(far)),
            ..Self::new(network)
        }
    }

    /// Takes positions: assembles, and factors what is factored.
    ///
    /// # Errors
    /// Overlaps, an indefinite matrix, memory.
    pub fn update(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        self.assemble(cell, centres)?;
        self.resistance.factor()
    }

    /// The first half of [`Motion::update`], without the factor.
    ///
    /// # Errors
    /// Overlaps, an indefinite mobility, memory.
    pub fn assemble(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        self.resistance.assemble(cell, centres)?;
        match &mut self.far {
            Some(far) => far.update(cell, centres),
            None => Ok(()),
        }
    }

    /// Lets the next iteration of the far field, if there is one, not begin where the last ended: its result then depends on
    /// positions and contacts alone.
    pub fn forget(&mut self) {
        if let Some(far) = &mut self.far {
            far.forget();
        }
    }

    /// Counterforces `[3N]` and stresslets of the last solve, as [`Resistance::apply`]; `work` is scratch.
    pub fn counterforces(
        &self,
        strain: &Vector3<f64>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<Vector3<f64>>,
    ) {
        self.resistance
            .apply(&self.velocities, strain, work, forces, stresslets);
        if let Some(far) = &self.far {
            far.correct(forces, stresslets);
        }
    }

    /// Disturbance velocities `(U − u∞, Ω − Ω∞)` of the last solve, `[3N]`.
    pub fn velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// The pair with the smallest gap, if any is in lubrication range.
    pub fn closest(&self) -> Option<&Neighbours> {
        let pairs = self.resistance.neighbours().iter();
        pairs.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Solves for the velocities at the given centres under external forces and torques `[3N]` (empty: none).
    ///
    /// # Errors
    /// Overlaps, an indefinite matrix, velocities that are not finite.
    pub fn solve(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        background: &Background,
        external: &[f64],
        law: ContactLaw<'_>,
    ) -> Result<Quality, Error> {
        if law.changes_resistance() {
            self.assemble(cell, centres)?;
        } else {
            self.update(cell, centres)?;
        }
        self.solve_again(background, external, law)
    }

    /// Adds the repulsion of laws that have one to forces and `R_FU`, and factors that.
    ///
    /// # Errors
    /// An indefinite matrix.
    fn add_repulsion(
        &mut self,
        background: &Background,
        law: &ContactLaw<'_>,
    ) -> Result<(), Error> {
        self.repelled.pairs.clear();
        if let ContactLaw::Laws {
            laws:
                Laws {
                    repulsion: Some(repulsion),
                    ..
                },
            span: (time, phase),
            history,
            ..
        } = law
        {
            let span = Span {
                time: *time,
                phase: *phase,
                first: &history.motion,
            };
            self.repelled.add(
                repulsion,
                &mut self.resistance,
                background,
                &span,
                &mut self.forces,
            );
            self.resistance.factor()?;
        }
        Ok(())
    }

    /// [`Motion::solve`] at the centres of the last call, for laws without repulsion; with one, `R_FU` must have been assembled anew.
    ///
    /// # Errors
    /// Velocities that are not finite; an indefinite matrix.
    pub fn solve_again(
        &mut self,
        background: &Background,
        external: &[f64],
        law: ContactLaw<'_>,
    ) -> Result<Quality, Error> {
        self.resistance
            .background_forces(&background.strain(), &mut self.forces);
        for (force, x) in self.forces.iter_mut().zip(external) {
            *force += x;
        }
        self.add_repulsion(background, &law)?;
        let (resistance, forces) = (&self.resistance, &self.forces);
        let velocities = &mut self.velocities;
        if let Some(far) = &mut self.far {
            let strain = background.strain();
            let quality = match law {
                ContactLaw::None => {
                    self.contacts.list.clear();
                    far.solve(resistance, &strain, forces, velocities)?;
                    Quality::default()
                }
                ContactLaw::Rigid {
                    surface,
                    time_span: span,
                    memory,
                } => {
                    let contacts = &mut self.contacts;
                    NetworkPasses::new(resistance, contacts, background, surface, span, memory)
                        .solve(far, &strain, forces, velocities)?
                }
                _ => return Err(Error::OnlyRigidContacts),
            };
            return finite(velocities, quality);
        }
        let quality = match law {
            ContactLaw::None => {
                if let Some(network) = resistance.pairwise() {
                    self.contacts
                        .solve_free_network(network, forces, velocities)?;
                    return finite(velocities, Quality::default());
                }
                self.contacts.list.clear();
                resistance.to_rows(forces, &mut self.rows);
                resistance.solver().solve(&mut self.rows);
                resistance.from_rows(&self.rows, velocities);
                Quality::default()
            }
            ContactLaw::Rigid {
                surface,
                time_span,
                memory,
            } => match resistance.pairwise() {
                None => self.contacts.solve_rigid(
                    resistance, background, &surface, time_span, forces, memory, velocities,
                ),
                Some(network) => {
                    let driving = Driving {
                        forces,
                        by_friction: &[],
                    };
                    self.contacts.solve_rigid_network(
                        resistance, network, background, &surface, time_span, driving, memory,
                        velocities,
                    )?
                }
            },
            _ if resistance.pairwise().is_some() => return Err(Error::OnlyRigidContacts),
            ContactLaw::Procedure { surface, listed } => self
                .contacts
                .solve_procedure(resistance, background, &surface, forces, listed, velocities),
            ContactLaw::Laws {
                laws,
                span,
                memory,
                history,
            } => self.contacts.solve_laws(
                resistance, background, laws, span, forces, memory, history, velocities,
            ),
        };
        self.repelled.finish(velocities);
        finite(velocities, quality)
    }
}

/// The quality, or the error that names a sphere whose velocity is not finite.
fn finite(velocities: &[f64], quality: Quality) -> Result<Quality, Error> {
    match velocities.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(Error::NotFinite {
            quantity: "the velocity",
            sphere: at / 3,
        }),
        None => Ok(quality),
    }
}
