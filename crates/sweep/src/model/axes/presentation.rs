//! How axes are shown: symbols, examples, scales, and the columns of tables.

use super::Axis;
use sd_core::law::ColloidUnit;
use sd_core::model::{FlowType, Form, PressureKind};
use sd_core::{ContactLaws, Params, StiffnessUnit};

impl Axis {
    /// Its symbol, the heading of a column.
    pub fn symbol(&self) -> &'static str {
        match self.key {
            "friction_onset" => "onset",
            "stiffness_unit" => "k unit",
            "spheres" => "N",
            "area_fraction" => "c",
            "volume_fraction" => "φ",
            "size_ratio" => "size ratio",
            "large_fraction" => "large",
            "roughness" => "h",
            "friction" => "ν",
            "rolling_friction" => "μ_r",
            "stiffness" => "k",
            "tangential_stiffness" => "k_t",
            "lubrication_gap" => "g_min",
            "lubrication_cutoff" => "ξ_max",
            "lubrication_regularisation" => "δ",
            "repulsion" => "F0",
            "colloid_unit" => "F0 unit",
            "repulsion_length" => "l",
            "van_der_waals" => "A",
            "van_der_waals_length" => "δ_A",
            "adhesion" => "F_A",
            "peclet" => "Pe",
            "thermal_load" => "F_crit a/kT",
            "hydrodynamic_friction" => "α",
            "hydrodynamic_friction_range" => "g0",
            "time_step" => "Δt",
            "shear_rate" => "Γ",
            "shear_stress" => "σ*",
            "imposed_viscous_number" => "J",
            "imposed_macroscopic_friction" => "σ/P",
            key => key,
        }
    }

    /// An example value, in the format of files; empty for keywords.
    pub fn example(&self) -> &'static str {
        match self.key {
            "spheres" => "90",
            "area_fraction" => "0.693",
            "volume_fraction" => "0.45",
            "sizes" => "{ lognormal = 0.2 }",
            "size_ratio" => "1.4",
            "large_fraction" | "lubrication_cutoff" | "tangential_stiffness" => "0.5",
            "roughness" | "van_der_waals_length" | "time_step" => "0.01",
            "friction" => "0.3",
            "rolling_friction" | "hydrodynamic_friction_range" => "0.1",
            "stiffness" => "1e4",
            "dashpot" => "10",
            "lubrication_gap" => "0.001",
            "lubrication_regularisation" => "1e-3",
            "repulsion_length" => "0.02",
            "start" => "\"layer.xyz\"",
            "peclet" => "[1.0, 10.0, 100.0, inf]",
            "thermal_load" => "100",
            "direction" => "-1",
            "shear_rate" => "[0.1, 1.0, 10.0, inf]",
            "shear_stress" => "[0.1, 1.0, 10.0]",
            "imposed_viscous_number" => "[0.001, 0.01, 0.1]",
            "imposed_macroscopic_friction" => "[0.4, 0.5, 0.7]",
            _ if self.is_numeric() => "1",
            _ => "",
        }
    }

    /// Whether its values are drawn on a logarithmic axis, with 0 and infinity at its ends.
    pub fn is_logarithmic(&self) -> bool {
        let keys = [
            "stiffness",
            "tangential_stiffness",
            "hydrodynamic_friction",
            "lubrication_regularisation",
            "peclet",
            "thermal_load",
            "shear_rate",
            "shear_stress",
            "imposed_viscous_number",
        ];
        keys.contains(&self.key)
    }

    /// Whether tables show its value at a point even if it is the same at all points: where it has
    /// a meaning, but not what most campaigns leave as it is.
    pub(super) fn is_shown(&self, params: &Params) -> bool {
        let laws = params.contact.laws();
        match (self.key, &self.form) {
            ("friction", _) => true,
            ("friction_onset", _) => *laws != ContactLaws::PAPER,
            ("stiffness_unit", _) => laws.stiffness_unit != StiffnessUnit::CriticalLoad,
            ("colloid_unit", _) => laws.colloid_unit != ColloidUnit::CriticalLoad,
            ("start", _) => params.start.is_some(),
            ("flow", _) => params.flow != FlowType::Shear,
            ("direction", _) => params.direction != 1.0,
            ("imposed_pressure", _) => params.pressure != PressureKind::Isotropic,
            ("peclet", _) => params.peclet.is_finite(),
            ("thermal_load", _) => params.thermal_load > 0.0,
            (
                "size_ratio"
                | "rolling_friction"
                | "dashpot"
                | "repulsion"
                | "van_der_waals"
                | "adhesion"
                | "hydrodynamic_friction",
                Form::Number(number),
            ) => number.without != Some((number.get)(params)),
            _ => self.means_something(params),
        }
    }
}
