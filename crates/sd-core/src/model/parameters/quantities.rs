//! Quantities of a run outside the contact laws.

use crate::law::{Quantity, Range};

/// Most spheres of a layer or configuration.
pub(in crate::model) const MAX_SPHERES: usize = 10_000;

/// N.
pub(super) static SPHERES: Quantity = Quantity {
    key: "spheres",
    symbol: "N",
    unit: "1",
    meaning: "number of spheres N",
    range: Range::from_to(1.0, MAX_SPHERES as f64),
    note: "",
    example: "90",
    logarithmic: false,
};

/// c.
pub(super) static AREA_FRACTION: Quantity = Quantity {
    key: "area_fraction",
    symbol: "c",
    unit: "1",
    meaning: "area fraction c",
    range: Range::above_to(0.0, 0.84),
    note: "",
    example: "0.693",
    logarithmic: false,
};

/// Sizes of mixtures.
pub(super) static SIZE_RATIO: Quantity = Quantity {
    key: "size_ratio",
    symbol: "size ratio",
    unit: "1",
    meaning: "radius of large over small spheres",
    range: Range::from_to(1.0, 10.0),
    note: "",
    example: "1.4",
    logarithmic: false,
};

/// Numbers of mixtures.
pub(super) static LARGE_FRACTION: Quantity = Quantity {
    key: "large_fraction",
    symbol: "large",
    unit: "1",
    meaning: "large spheres over all",
    range: Range::from_to(0.0, 1.0),
    note: "",
    example: "0.5",
    logarithmic: false,
};

/// h.
pub(super) static ROUGHNESS: Quantity = Quantity {
    key: "roughness",
    symbol: "h",
    unit: "a",
    meaning: "roughness height h",
    range: Range::from_below(0.0, 0.5),
    note: "0 for springs and repulsion only",
    example: "0.01",
    logarithmic: false,
};

/// ν.
pub(super) static FRICTION: Quantity = Quantity {
    key: "friction",
    symbol: "ν",
    unit: "1",
    meaning: "friction coefficient ν",
    range: Range::from_to(0.0, 10.0),
    note: "",
    example: "0.3",
    logarithmic: false,
};

/// g_min.
pub(super) static LUBRICATION_GAP: Quantity = Quantity {
    key: "lubrication_gap",
    symbol: "g_min",
    unit: "a",
    meaning: "gap below which lubrication is constant",
    range: Range::between(0.0, 0.5),
    note: "in a, at most the roughness if there is any",
    example: "0.001",
    logarithmic: false,
};

/// Δt.
pub(super) static TIME_STEP: Quantity = Quantity {
    key: "time_step",
    symbol: "Δt",
    unit: "strain",
    meaning: "time step Δt",
    range: Range::from_to(1e-7, 0.1),
    note: "a strain; shorter steps lose their motion to rounding",
    example: "0.01",
    logarithmic: false,
};

/// σ*.
pub(super) static SHEAR_STRESS: Quantity = Quantity {
    key: "shear_stress",
    symbol: "σ*",
    unit: "F_crit/a²",
    meaning: "imposed shear stress σ*; in place of the shear rate",
    range: Range::between(0.0, f64::INFINITY),
    note: "in F_crit/a²; for the plateaus impose `shear_rate` = 0 or inf",
    example: "[0.1, 1.0, 10.0]",
    logarithmic: true,
};

/// Sense of the shear.
pub(super) static DIRECTION: Quantity = Quantity {
    key: "direction",
    symbol: "direction",
    unit: "1",
    meaning: "sense of the shear",
    range: Range::from_to(-1.0, 1.0),
    note: "1, or -1 for a layer that is sheared the other way",
    example: "-1",
    logarithmic: false,
};

/// The start layer.
pub(super) static START: Quantity = Quantity {
    key: "start",
    symbol: "start",
    unit: "1",
    meaning: "number that names the layer a run begins with; 0 where its seed makes it",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "",
    example: "\"layer.xyz\"",
    logarithmic: false,
};

/// Γ.
pub(super) static SHEAR_RATE: Quantity = Quantity {
    key: "shear_rate",
    symbol: "Γ",
    unit: "1",
    meaning: "shear rate Γ; inf is the upper plateau",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "0 and inf are the plateaus",
    example: "[0.1, 1.0, 10.0, inf]",
    logarithmic: true,
};
