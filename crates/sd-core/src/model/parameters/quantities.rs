//! Quantities of a run outside the contact laws.

use crate::law::{Quantity, Range};

/// Most spheres of a run or of a configuration.
pub(crate) const MAX_SPHERES: usize = 50_000;

/// N.
pub(super) static SPHERES: Quantity = Quantity {
    key: "spheres",
    unit: "1",
    meaning: "number of spheres N",
    range: Range::from_to(1.0, MAX_SPHERES as f64),
    note: "",
};

/// c.
pub(super) static AREA_FRACTION: Quantity = Quantity {
    key: "area_fraction",
    unit: "1",
    meaning: "area fraction c",
    range: Range::above_to(0.0, 0.84),
    note: "",
};

/// φ. Which fractions can be packed depends on the sizes, the roughness and the seed.
pub(super) static VOLUME_FRACTION: Quantity = Quantity {
    key: "volume_fraction",
    unit: "1",
    meaning: "volume fraction φ",
    range: Range::from_to(0.01, 0.64),
    note: "",
};

/// Sizes of mixtures.
pub(super) static SIZE_RATIO: Quantity = Quantity {
    key: "size_ratio",
    unit: "1",
    meaning: "radius of large over small spheres",
    range: Range::from_to(1.0, 10.0),
    note: "",
};

/// Numbers of mixtures.
pub(super) static LARGE_FRACTION: Quantity = Quantity {
    key: "large_fraction",
    unit: "1",
    meaning: "large spheres over all",
    range: Range::from_to(0.0, 1.0),
    note: "",
};

/// h.
pub(crate) static ROUGHNESS: Quantity = Quantity {
    key: "roughness",
    unit: "a",
    meaning: "roughness height h",
    range: Range::from_below(0.0, 0.5),
    note: "0 for springs and repulsion only",
};

/// ν.
pub(crate) static FRICTION: Quantity = Quantity {
    key: "friction",
    unit: "1",
    meaning: "friction coefficient ν",
    range: Range::from_to(0.0, 10.0),
    note: "",
};

/// g_min.
pub(super) static LUBRICATION_GAP: Quantity = Quantity {
    key: "lubrication_gap",
    unit: "a",
    meaning: "gap below which lubrication is constant",
    range: Range::between(0.0, 0.5),
    note: "in a, at most the roughness if there is any",
};

/// Δt.
pub(super) static TIME_STEP: Quantity = Quantity {
    key: "time_step",
    unit: "strain",
    meaning: "time step Δt",
    range: Range::from_to(1e-7, 0.1),
    note: "a strain; shorter steps lose their motion to rounding",
};

/// σ*.
pub(super) static SHEAR_STRESS: Quantity = Quantity {
    key: "shear_stress",
    unit: "F_crit/a²",
    meaning: "imposed shear stress σ*; in place of the shear rate",
    range: Range::between(0.0, f64::INFINITY),
    note: "in F_crit/a²; for the plateaus impose `shear_rate` = 0 or inf",
};

/// J.
pub(super) static VISCOUS_NUMBER: Quantity = Quantity {
    key: "imposed_viscous_number",
    unit: "1",
    meaning: "imposed viscous number J; the fraction is then that of the start",
    range: Range::between(0.0, f64::INFINITY),
    note: "μ rate over the particle pressure; without it the fraction is imposed",
};

/// σ/P.
pub(super) static MACROSCOPIC_FRICTION: Quantity = Quantity {
    key: "imposed_macroscopic_friction",
    unit: "1",
    meaning: "imposed ratio of shear stress and particle pressure; in place of the viscous number",
    range: Range::between(0.0, f64::INFINITY),
    note: "shear stress over particle pressure; without it the viscous number or the fraction is imposed",
};

/// Sense of the flow.
pub(super) static DIRECTION: Quantity = Quantity {
    key: "direction",
    unit: "1",
    meaning: "sense of the flow",
    range: Range::from_to(-1.0, 1.0),
    note: "1, or -1 for the opposite flow",
};

/// What a run begins with.
pub(super) static START: Quantity = Quantity {
    key: "start",
    unit: "1",
    meaning: "number that names what a run begins with: 0 the packing that its seed makes, 1 hard spheres in equilibrium, another one a given layer",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "",
};

/// Γ.
pub(super) static SHEAR_RATE: Quantity = Quantity {
    key: "shear_rate",
    unit: "1",
    meaning: "shear rate Γ; inf is the upper plateau",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "0 and inf are the plateaus",
};

/// Pe.
pub(super) static PECLET: Quantity = Quantity {
    key: "peclet",
    unit: "1",
    meaning: "Péclet number Pe; inf is no Brownian motion",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "6 pi mu a^3 rate/kT, under a stress 6 pi a^3 sigma/kT, above 0; inf is no Brownian motion",
};

/// F_crit a/kT.
pub(super) static THERMAL_LOAD: Quantity = Quantity {
    key: "thermal_load",
    unit: "kT/a",
    meaning: "critical load in thermal units; in place of the Péclet number",
    range: Range::from_below(0.0, f64::INFINITY),
    note: "F_crit a/kT, from which Pe = shear_rate thermal_load, under a stress 6 pi shear_stress thermal_load; 0 is no Brownian motion",
};
