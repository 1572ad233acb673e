//! The spheres of an instant and their loaded contacts.

use sd_core::Space;
use sd_core::cell::{Cell, Lattice};
use sd_core::contact::ContactState;
use sd_core::simulation::Frame;

/// Spheres in their periodic cell, and their loaded contacts.
#[derive(Debug, Clone)]
pub(crate) struct Network<S: Space> {
    /// The cell.
    pub cell: Cell<S>,
    /// Centres, in a.
    pub centres: Vec<S::Vector>,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Contacts with a normal force.
    pub links: Vec<Link<S>>,
}

/// A loaded contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link<S: Space> {
    /// One sphere.
    pub i: usize,
    /// The sphere at its other end.
    pub j: usize,
    /// From `i` to `j`, in a.
    pub separation: S::Vector,
    /// The image of `j`, by the number of cells along each axis.
    pub image: S::Image,
    /// In mu·a²·rate.
    pub normal_force: f64,
    /// Size of the friction force, in mu·a²·rate.
    pub tangential_force: f64,
    /// State of friction: inactive, sticking or sliding.
    pub state: ContactState,
}

impl<S: Space> Link<S> {
    /// Unit vector from `i` to `j`.
    pub(crate) fn normal(&self) -> S::Vector {
        self.separation / S::norm_squared(&self.separation).sqrt()
    }

    /// Whether friction acts.
    pub(crate) fn is_frictional(&self) -> bool {
        self.state != ContactState::Frictionless
    }
}

impl<S: Space> Network<S> {
    /// Whether its cell is a sheared one, which is periodic along y.
    pub(crate) fn is_sheared(&self) -> bool {
        self.cell.lattice().is_none_or(Lattice::is_sheared_cell)
    }

    /// The network of spheres and of pairs with a normal force, a friction force and a state each.
    /// Pairs refer to nearest images: spheres in contact are closer than half a side of the cell.
    pub(crate) fn new(
        cell: Cell<S>,
        centres: Vec<S::Vector>,
        radii: Vec<f64>,
        pairs: impl IntoIterator<Item = (usize, usize, f64, f64, ContactState)>,
    ) -> Self {
        let links = pairs
            .into_iter()
            .map(|(i, j, normal_force, tangential_force, state)| {
                let (separation, image) = cell.nearest(centres[j] - centres[i]);
                Link {
                    i,
                    j,
                    separation,
                    image,
                    normal_force,
                    tangential_force,
                    state,
                }
            })
            .collect();
        Self {
            cell,
            centres,
            radii,
            links,
        }
    }

    /// Number of spheres.
    pub(crate) fn spheres(&self) -> usize {
        self.centres.len()
    }

    /// Contacts on which friction acts.
    pub(crate) fn frictional(&self) -> impl Iterator<Item = &Link<S>> {
        self.links.iter().filter(|link| link.is_frictional())
    }

    /// The neighbours of each sphere along some links: the other sphere, and the index of the link.
    pub(super) fn neighbours<'l>(
        &self,
        links: impl Iterator<Item = &'l Link<S>>,
    ) -> Vec<Vec<(usize, usize)>> {
        let mut neighbours = vec![Vec::new(); self.spheres()];
        for (number, link) in links.enumerate() {
            neighbours[link.i].push((link.j, number));
            neighbours[link.j].push((link.i, number));
        }
        neighbours
    }
}

/// The network of a frame.
impl<S: Space> TryFrom<&Frame<S>> for Network<S> {
    type Error = sd_core::Error;

    fn try_from(frame: &Frame<S>) -> Result<Self, Self::Error> {
        let cell = frame.cell()?;
        let centres = frame.centres.iter().map(S::vector).collect();
        let contacts = frame.contacts.iter().filter(|c| c.normal_force > 0.0);
        let pairs = contacts.map(|c| {
            let friction = S::tangent_dot(&c.tangential_force, &c.tangential_force).sqrt();
            (c.i, c.j, c.normal_force, friction, c.state)
        });
        Ok(Self::new(cell, centres, frame.radii.clone(), pairs))
    }
}
