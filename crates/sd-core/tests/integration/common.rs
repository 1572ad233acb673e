//! What several tests share: a layer, contact laws, reference numbers, resumed runs.

pub(crate) mod data;
pub(crate) mod resumed;
pub(crate) mod schemes;
pub(crate) mod spheres;

use sd_core::{ContactScheme, Hydrodynamics, Params, TangentialLaw};

/// A small dense layer of two sizes under these contacts, where friction acts on most of them.
pub(crate) fn small_layer(contact: ContactScheme, hydrodynamics: Hydrodynamics) -> Params {
    // Spheres under stick-rotate jam much earlier than others.
    let welds = contact.laws().tangential == TangentialLaw::StickRotate;
    Params::builder()
        .spheres(40)
        .area_fraction(if welds { 0.5 } else { 0.7 })
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(5.0)
        .hydrodynamics(hydrodynamics)
        .contact(contact)
        .time_step(0.005)
        .two_sizes(1.4, 1.0 / 2.96)
        .build()
        .unwrap()
}
