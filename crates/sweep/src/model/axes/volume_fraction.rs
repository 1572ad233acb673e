//! The volume fraction of suspensions, which replaces the area fraction of layers.

use sd_core::Params;
use sd_core::model::{Form, Number, Parameter, Quantity, Range};

/// Key of the fraction that layers have.
const OF_LAYERS: &str = "area_fraction";

/// φ. Which fractions can be packed depends on the sizes, the roughness and the number of spheres:
/// see [`crate::model::spaces::check_start`].
static QUANTITY: Quantity = Quantity {
    key: "volume_fraction",
    symbol: "φ",
    unit: "1",
    meaning: "volume fraction φ",
    range: Range::from_to(0.01, 0.64),
    note: "",
    example: "0.45",
    logarithmic: false,
};

/// Its axis, 0 in a layer.
static PARAMETER: Parameter = Parameter {
    key: QUANTITY.key,
    symbol: QUANTITY.symbol,
    unit: QUANTITY.unit,
    meaning: QUANTITY.meaning,
    example: QUANTITY.example,
    has_meaning: is_suspension,
    needs: None,
    is_shown: is_suspension,
    form: Form::Number(Number {
        quantity: &QUANTITY,
        whole: false,
        default: None,
        get: |p| p.volume_fraction.unwrap_or(0.0),
        put: |p, value| {
            p.volume_fraction = (value > 0.0).then_some(value);
            if is_suspension(p) {
                // Unless one is given, which is refused.
                p.area_fraction = 0.0;
            }
        },
        without: Some(0.0),
        is_of_laws: false,
    }),
};

/// Whether the spheres are a suspension.
fn is_suspension(params: &Params) -> bool {
    params.volume_fraction.is_some()
}

/// The parameters with the volume fraction in its own field.
pub(super) fn among(
    declared: impl Iterator<Item = &'static Parameter>,
) -> impl Iterator<Item = &'static Parameter> {
    declared.flat_map(|parameter| {
        let beside = (parameter.key == OF_LAYERS).then_some(&PARAMETER);
        std::iter::once(parameter).chain(beside)
    })
}
