//! Numbers of a network, one for each instant: declared once, with their meanings.

use super::clusters::clusters;
use super::core::core;
use super::network::Network;
use super::pebble::PebbleGame;
use crate::measure::numbers::{Level, Number};
use sd_core::contact::ContactState;
use sd_core::simulation::{NetworkSample, StructureSample};
use sd_core::{Layer, Space};

/// Minimum contacts of a sphere that is not a rattler: with friction, two.
const HELD: usize = 2;

/// A number of a network: its name and meaning.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scalar {
    /// Its name in tables and in JSON.
    pub name: &'static str,
    /// Its meaning; empty for a number that samples have too.
    meaning: &'static str,
}

impl Scalar {
    /// Its meaning.
    pub(crate) fn meaning(&self) -> &'static str {
        let sampled = Number::named(self.name).and_then(|number| number.meaning(Level::Samples));
        sampled.unwrap_or(self.meaning)
    }
}

const fn scalar(name: &'static str, meaning: &'static str) -> Scalar {
    Scalar { name, meaning }
}

/// Number of entries.
pub(crate) const SCALARS: usize = 21;

/// All of them, in the order of [`scalars`].
#[rustfmt::skip]
pub(crate) static NAMED: [Scalar; SCALARS] = [
    scalar("coordination", ""),
    scalar("coordination_without_rattlers", "loaded contacts of a sphere between spheres that are not rattlers"),
    scalar("rattlers", "fraction of spheres with fewer than two contacts, removed one after the other"),
    scalar("frictional_coordination", ""),
    scalar("sticking", "fraction of loaded contacts that friction holds"),
    scalar("sliding", "fraction of loaded contacts that slide against friction"),
    scalar("largest_cluster", ""),
    scalar("percolating_x", ""),
    scalar("percolating_y", ""),
    scalar("percolating_z", "fraction of instants at which such a cluster percolates along the vorticity; none in a layer"),
    scalar("core_fraction", ""),
    scalar("rigid_fraction", "fraction of spheres of a layer in rigid clusters of at least three spheres, by the frictional pebble game"),
    scalar("largest_rigid_cluster", "fraction of spheres of a layer in the largest of these"),
    scalar("redundant_constraints", "fraction of constraints of a layer that others of them imply"),
    scalar("hyperstaticity", ""),
    scalar("layering", ""),
    scalar("psi_6", ""),
    scalar("q_6", ""),
    scalar("localisation", ""),
    scalar("concentration_y", ""),
    scalar("concentration_z", ""),
];

/// The numbers of a network that a run may sample, which are cheap.
pub(crate) fn observe<S: Space>(network: &Network<S>) -> NetworkSample {
    let n = network.spheres().max(1) as f64;
    let frictional = clusters(network, network.frictional());
    let [along_x, along_y, _] = frictional.percolates.map(|is| f64::from(u8::from(is)));
    let in_core = core(network, network.frictional(), S::DIMENSIONS + 1);
    NetworkSample {
        coordination: 2.0 * network.links.len() as f64 / n,
        frictional_coordination: 2.0 * network.frictional().count() as f64 / n,
        largest_cluster: frictional.largest_share(),
        percolating_x: along_x,
        percolating_y: along_y,
        core_fraction: in_core.iter().filter(|is| **is).count() as f64 / n,
    }
}

/// The numbers of a network and of its spheres, in the order of [`NAMED`]; NaN where undefined.
pub(crate) fn scalars<S: Space>(network: &Network<S>, sampled: &StructureSample) -> [f64; SCALARS] {
    let n = network.spheres().max(1) as f64;
    let links = network.links.len() as f64;
    let is_held = core(network, network.links.iter(), HELD);
    let held = is_held.iter().filter(|held| **held).count() as f64;
    let between_held = network
        .links
        .iter()
        .filter(|link| is_held[link.i] && is_held[link.j])
        .count() as f64;
    let share_of = |state: ContactState| {
        network
            .links
            .iter()
            .filter(|link| link.state == state)
            .count() as f64
            / links
    };
    let observed = observe(network);
    let along_z = clusters(network, network.frictional()).percolates[2];
    let [rigid, largest, redundant] = rigidity(network);
    [
        observed.coordination,
        2.0 * between_held / held,
        1.0 - held / n,
        observed.frictional_coordination,
        share_of(ContactState::Sticking),
        share_of(ContactState::Slipping),
        observed.largest_cluster,
        observed.percolating_x,
        observed.percolating_y,
        if S::DIMENSIONS > 2 {
            f64::from(u8::from(along_z))
        } else {
            f64::NAN
        },
        observed.core_fraction,
        rigid,
        largest,
        redundant,
        sampled.hyperstaticity,
        sampled.layering,
        sampled.psi_6,
        sampled.q_6,
        sampled.localisation,
        sampled.concentration_y,
        sampled.concentration_z,
    ]
}

/// Shares of spheres in rigid clusters and in the largest one, and of redundant constraints. In
/// layers only: no correct constraint counting of this kind is known for spheres in three
/// dimensions.
fn rigidity<S: Space>(network: &Network<S>) -> [f64; 3] {
    if S::DIMENSIONS != Layer::DIMENSIONS {
        return [f64::NAN; 3];
    }
    let constraints = network.links.iter().flat_map(|link| {
        let number = if link.state == ContactState::Sticking {
            2
        } else {
            1
        };
        std::iter::repeat_n((link.i, link.j), number)
    });
    let game = PebbleGame::play(network.spheres(), constraints);
    let (independent, all) = game.constraints();
    let mut sizes = vec![0_usize; network.spheres()];
    for cluster in game.rigid_clusters() {
        sizes[cluster] += 1;
    }
    // Two spheres that stick in one contact roll on each other: no pair is rigid.
    let n = network.spheres().max(1) as f64;
    let rigid: usize = sizes.iter().filter(|size| **size > 2).sum();
    let largest = sizes
        .iter()
        .copied()
        .filter(|size| *size > 2)
        .max()
        .unwrap_or(0);
    [
        rigid as f64 / n,
        largest as f64 / n,
        (all - independent) as f64 / all as f64,
    ]
}
