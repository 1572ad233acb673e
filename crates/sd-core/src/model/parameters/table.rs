//! The table of parameters.

use super::choices::{
    ONE_OR_TWO, alone, attracts, contact_word, contact_words, has_colloids, has_friction, has_laws,
    has_leading_order, has_lubrication_gap, has_spring, has_stiffness, has_tangential_spring,
    has_two_sizes, may_adhere, needs_colloids, needs_laws, needs_leading_order,
    needs_lubrication_gap, needs_repulsion, needs_rolling, needs_spring, needs_stiffness,
    needs_tangential_spring, needs_touch, read, repels, resists_rolling, set_contact,
    set_hydrodynamics, set_law, set_sizes, set_spheres, set_tangential, set_volume_fraction,
    tangential_words, usual_tangential_stiffness,
};
use super::quantities::{
    AREA_FRACTION, DIRECTION, FRICTION, LARGE_FRACTION, LUBRICATION_GAP, MACROSCOPIC_FRICTION,
    PECLET, ROUGHNESS, SHEAR_RATE, SHEAR_STRESS, SIZE_RATIO, SPHERES, START, THERMAL_LOAD,
    TIME_STEP, VISCOUS_NUMBER, VOLUME_FRACTION,
};
use super::{Choice, Form, Number, Parameter};
use crate::law::adhesion::ADHESION;
use crate::law::hydrodynamic_friction::{
    DEFAULT_RANGE, HYDRODYNAMIC_FRICTION, HYDRODYNAMIC_FRICTION_RANGE,
};
use crate::law::normal::{DASHPOT, STIFFNESS};
use crate::law::repulsion::{DEFAULT_LENGTH, REPULSION, REPULSION_ALONE, REPULSION_LENGTH};
use crate::law::rolling_friction::ROLLING_FRICTION;
use crate::law::tangential::stick_slide::TANGENTIAL_STIFFNESS;
use crate::law::van_der_waals::{
    DEFAULT_LENGTH as DEFAULT_DELTA, VAN_DER_WAALS, VAN_DER_WAALS_LENGTH,
};
use crate::law::{ColloidUnit, FrictionOnset, Keywords as _, Quantity, StiffnessUnit};
use crate::model::hydrodynamics::{CUTOFF, REGULARISATION};
use crate::model::{
    ContactLaws, Distribution, FlowType, Hydrodynamics, LeadingOrder, Params, PressureKind,
    StartFrom,
};

/// All parameters of a run, in the order of columns and of nested loops.
///
/// A choice precedes the numbers that have a meaning under it. Values are therefore set in
/// [`crate::Params`] from the last entry to the first.
///
/// ```
/// use sd_core::model::PARAMETERS;
///
/// let friction = PARAMETERS.iter().find(|parameter| parameter.key == "friction");
/// assert_eq!(friction.map(|parameter| parameter.unit), Some("1"));
/// ```
pub static PARAMETERS: [Parameter; 39] = [
    Parameter {
        key: "hydrodynamics",
        meaning: "how the grand resistance is made",
        form: Form::Choice(Choice {
            words: || Hydrodynamics::KEYWORDS.to_vec(),
            default: "stokesian-dynamics",
            get: |p| p.hydrodynamics.word().into(),
            set: set_hydrodynamics,
        }),
        ..CHOICE
    },
    Parameter {
        key: "contact",
        meaning: "contact scheme",
        form: Form::Choice(Choice {
            words: contact_words,
            default: "rigid",
            get: contact_word,
            set: set_contact,
        }),
        ..CHOICE
    },
    Parameter {
        key: "tangential",
        meaning: "tangential law",
        has_meaning: has_friction,
        form: Form::Choice(Choice {
            words: tangential_words,
            default: "roll-slip",
            get: |p| p.contact.laws().tangential.word().into(),
            set: set_tangential,
        }),
        ..CHOICE
    },
    Parameter {
        key: "friction_onset",
        meaning: "how friction begins with the load",
        has_meaning: |p| has_friction(p) && (p.shear_stress.is_some() || p.shear_rate.is_finite()),
        form: Form::Choice(Choice {
            words: || FrictionOnset::KEYWORDS.to_vec(),
            default: "critical-load",
            get: |p| p.contact.laws().onset.word().into(),
            set: |p, word| match p.contact.chosen_laws() {
                Some(laws) => read(&mut laws.onset, "friction_onset", word),
                None => Ok(()),
            },
        }),
        ..CHOICE
    },
    Parameter {
        key: "stiffness_unit",
        meaning: "what stiffnesses are in units of",
        has_meaning: has_stiffness,
        needs: Some(needs_stiffness),
        form: Form::Choice(Choice {
            words: || StiffnessUnit::KEYWORDS.to_vec(),
            default: "critical-load",
            get: |p| p.contact.laws().stiffness_unit.word().into(),
            set: |p, word| match p.contact.chosen_laws() {
                Some(laws) => read(&mut laws.stiffness_unit, "stiffness_unit", word),
                None => Ok(()),
            },
        }),
        ..CHOICE
    },
    Parameter {
        key: "colloid_unit",
        meaning: "what repulsion and van der Waals attraction are in units of",
        has_meaning: has_colloids,
        needs: Some(needs_colloids),
        form: Form::Choice(Choice {
            words: || ColloidUnit::KEYWORDS.to_vec(),
            default: "critical-load",
            get: |p| p.contact.laws().colloid_unit.word().into(),
            set: |p, word| match p.contact.chosen_laws() {
                Some(laws) => read(&mut laws.colloid_unit, "colloid_unit", word),
                None => Ok(()),
            },
        }),
        ..CHOICE
    },
    Parameter {
        form: Form::Number(Number {
            whole: true,
            get: |p| p.spheres as f64,
            set: set_spheres,
            ..NEEDED
        }),
        ..number(&SPHERES)
    },
    Parameter {
        has_meaning: |p| p.volume_fraction.is_none(),
        form: Form::Number(Number {
            quantity: &AREA_FRACTION,
            // Of a suspension.
            without: Some(0.0),
            stays: true,
            get: |p| p.area_fraction,
            set: |p, value| p.area_fraction = value,
            ..NEEDED
        }),
        ..number(&AREA_FRACTION)
    },
    Parameter {
        has_meaning: |p| p.volume_fraction.is_some(),
        form: Form::Number(Number {
            quantity: &VOLUME_FRACTION,
            get: |p| p.volume_fraction.unwrap_or(0.0),
            set: set_volume_fraction,
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&VOLUME_FRACTION)
    },
    Parameter {
        key: "sizes",
        meaning: "sizes of the spheres",
        has_meaning: |p| p.sizes.is_some(),
        form: Form::Choice(Choice {
            words: || Distribution::KEYWORDS.to_vec(),
            default: ONE_OR_TWO,
            get: |p| match &p.sizes {
                None => ONE_OR_TWO.into(),
                Some(sizes) => sizes.to_string().into(),
            },
            set: set_sizes,
        }),
        ..CHOICE
    },
    Parameter {
        has_meaning: |p| p.sizes.is_none(),
        needs: Some(|| "no `sizes`".into()),
        form: Form::Number(Number {
            quantity: &SIZE_RATIO,
            // Two species set theirs.
            default: Some(|p| p.size_ratio),
            get: |p| p.size_ratio,
            set: |p, value| p.size_ratio = value,
            without: Some(1.0),
            ..NEEDED
        }),
        ..number(&SIZE_RATIO)
    },
    Parameter {
        has_meaning: has_two_sizes,
        form: Form::Number(Number {
            quantity: &LARGE_FRACTION,
            default: Some(|p| p.large_fraction),
            get: |p| p.large_fraction,
            set: |p, value| p.large_fraction = value,
            without: Some(0.5),
            ..NEEDED
        }),
        ..number(&LARGE_FRACTION)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &ROUGHNESS,
            get: |p| p.roughness,
            set: |p, value| p.roughness = value,
            ..NEEDED
        }),
        ..number(&ROUGHNESS)
    },
    Parameter {
        has_meaning: |p| p.contact.laws().normal.touches(),
        form: Form::Number(Number {
            quantity: &FRICTION,
            get: |p| p.friction,
            set: |p, value| p.friction = value,
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&FRICTION)
    },
    Parameter {
        has_meaning: resists_rolling,
        needs: Some(needs_rolling),
        form: Form::Number(Number {
            quantity: &ROLLING_FRICTION,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().rolling_friction,
            set: |p, value| set_law(p, |laws| laws.rolling_friction = value),
            ..OF_LAWS
        }),
        ..number(&ROLLING_FRICTION)
    },
    Parameter {
        has_meaning: has_spring,
        needs: Some(needs_spring),
        form: Form::Number(Number {
            quantity: &STIFFNESS,
            get: |p| p.contact.laws().stiffness,
            set: |p, value| set_law(p, |laws| laws.stiffness = value),
            without: Some(f64::INFINITY),
            ..OF_LAWS
        }),
        ..number(&STIFFNESS)
    },
    Parameter {
        has_meaning: has_tangential_spring,
        needs: Some(needs_tangential_spring),
        form: Form::Number(Number {
            quantity: &TANGENTIAL_STIFFNESS,
            default: Some(usual_tangential_stiffness),
            get: |p| p.contact.laws().tangential_stiffness,
            set: |p, value| set_law(p, |laws| laws.tangential_stiffness = value),
            ..OF_LAWS
        }),
        ..number(&TANGENTIAL_STIFFNESS)
    },
    Parameter {
        has_meaning: has_spring,
        needs: Some(|| format!("{} of finite stiffness", needs_spring())),
        form: Form::Number(Number {
            quantity: &DASHPOT,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().dashpot,
            set: |p, value| set_law(p, |laws| laws.dashpot = value),
            ..OF_LAWS
        }),
        ..number(&DASHPOT)
    },
    Parameter {
        has_meaning: has_lubrication_gap,
        needs: Some(needs_lubrication_gap),
        form: Form::Number(Number {
            quantity: &LUBRICATION_GAP,
            default: Some(|p| ContactLaws::usual_lubrication_gap(p.roughness)),
            get: |p| p.contact.laws().lubrication_gap,
            set: |p, value| set_law(p, |laws| laws.lubrication_gap = value),
            ..OF_LAWS
        }),
        ..number(&LUBRICATION_GAP)
    },
    Parameter {
        has_meaning: has_leading_order,
        needs: Some(needs_leading_order),
        form: Form::Number(Number {
            quantity: &CUTOFF,
            default: Some(|_| LeadingOrder::DEFAULT.cutoff),
            get: |p| p.hydrodynamics.leading_order().map_or(0.0, |n| n.cutoff),
            set: |p, value| p.hydrodynamics.change(|n| n.cutoff = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&CUTOFF)
    },
    Parameter {
        has_meaning: has_leading_order,
        needs: Some(needs_leading_order),
        form: Form::Number(Number {
            quantity: &REGULARISATION,
            default: Some(|_| LeadingOrder::DEFAULT.regularisation),
            get: |p| {
                p.hydrodynamics
                    .leading_order()
                    .map_or(0.0, |n| n.regularisation)
            },
            set: |p, value| p.hydrodynamics.change(|n| n.regularisation = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&REGULARISATION)
    },
    Parameter {
        has_meaning: has_laws,
        form: Form::Number(Number {
            quantity: &REPULSION,
            default: Some(|p| if alone(p) { REPULSION_ALONE } else { 0.0 }),
            get: |p| p.contact.laws().repulsion,
            set: |p, value| set_law(p, |laws| laws.repulsion = value),
            ..OF_LAWS
        }),
        ..number(&REPULSION)
    },
    Parameter {
        has_meaning: repels,
        needs: Some(needs_repulsion),
        form: Form::Number(Number {
            quantity: &REPULSION_LENGTH,
            default: Some(|_| DEFAULT_LENGTH),
            get: |p| p.contact.laws().repulsion_length,
            set: |p, value| set_law(p, |laws| laws.repulsion_length = value),
            ..OF_LAWS
        }),
        ..number(&REPULSION_LENGTH)
    },
    Parameter {
        has_meaning: has_laws,
        needs: Some(needs_laws),
        form: Form::Number(Number {
            quantity: &VAN_DER_WAALS,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().van_der_waals,
            set: |p, value| set_law(p, |laws| laws.van_der_waals = value),
            ..OF_LAWS
        }),
        ..number(&VAN_DER_WAALS)
    },
    Parameter {
        has_meaning: attracts,
        needs: Some(|| "`van_der_waals` above 0".into()),
        form: Form::Number(Number {
            quantity: &VAN_DER_WAALS_LENGTH,
            default: Some(|_| DEFAULT_DELTA),
            get: |p| p.contact.laws().van_der_waals_length,
            set: |p, value| set_law(p, |laws| laws.van_der_waals_length = value),
            ..OF_LAWS
        }),
        ..number(&VAN_DER_WAALS_LENGTH)
    },
    Parameter {
        has_meaning: may_adhere,
        needs: Some(needs_touch),
        form: Form::Number(Number {
            quantity: &ADHESION,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().adhesion,
            set: |p, value| set_law(p, |laws| laws.adhesion = value),
            ..OF_LAWS
        }),
        ..number(&ADHESION)
    },
    Parameter {
        has_meaning: has_laws,
        needs: Some(needs_laws),
        form: Form::Number(Number {
            quantity: &HYDRODYNAMIC_FRICTION,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().hydrodynamic_friction,
            set: |p, value| set_law(p, |laws| laws.hydrodynamic_friction = value),
            ..OF_LAWS
        }),
        ..number(&HYDRODYNAMIC_FRICTION)
    },
    Parameter {
        has_meaning: |p| p.contact.laws().hydrodynamic_friction > 0.0,
        needs: Some(|| "`hydrodynamic_friction` above 0".into()),
        form: Form::Number(Number {
            quantity: &HYDRODYNAMIC_FRICTION_RANGE,
            default: Some(|_| DEFAULT_RANGE),
            get: |p| p.contact.laws().hydrodynamic_friction_range,
            set: |p, value| set_law(p, |laws| laws.hydrodynamic_friction_range = value),
            ..OF_LAWS
        }),
        ..number(&HYDRODYNAMIC_FRICTION_RANGE)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &START,
            whole: true,
            default: Some(|_| 0.0),
            get: |p| p.start.as_ref().map_or(0.0, |start| start.number() as f64),
            // A start layer cannot be restored from its number.
            set: |p, value| {
                if value == f64::from(StartFrom::EQUILIBRIUM) {
                    p.start = Some(StartFrom::Equilibrium);
                }
            },
            ..NEEDED
        }),
        ..number(&START)
    },
    Parameter {
        key: "flow",
        meaning: "type of the imposed flow",
        has_meaning: |p| !p.at_rest,
        form: Form::Choice(Choice {
            words: || FlowType::keywords().to_vec(),
            default: "shear",
            get: |p| match p.flow {
                FlowType::Mixture(_) => p.flow.to_string().into(),
                single => single.word().into(),
            },
            set: |p, word| {
                p.flow = word.parse()?;
                Ok(())
            },
        }),
        ..CHOICE
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &PECLET,
            default: Some(|_| f64::INFINITY),
            get: |p| p.peclet,
            set: |p, value| p.peclet = value,
            ..NEEDED
        }),
        ..number(&PECLET)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &THERMAL_LOAD,
            default: Some(|_| 0.0),
            get: |p| p.thermal_load,
            set: |p, value| p.thermal_load = value,
            ..NEEDED
        }),
        ..number(&THERMAL_LOAD)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &DIRECTION,
            default: Some(|_| 1.0),
            get: |p| p.direction,
            set: |p, value| p.direction = value,
            ..NEEDED
        }),
        ..number(&DIRECTION)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &TIME_STEP,
            default: Some(|_| DEFAULT_TIME_STEP),
            get: |p| p.time_step,
            set: |p, value| p.time_step = value,
            ..NEEDED
        }),
        ..number(&TIME_STEP)
    },
    Parameter {
        has_meaning: |p| p.shear_stress.is_none(),
        needs: Some(|| "`shear_rate` in place of `shear_stress`: one of them is imposed".into()),
        form: Form::Number(Number {
            quantity: &SHEAR_RATE,
            get: |p| p.shear_rate,
            set: |p, value| p.shear_rate = value,
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&SHEAR_RATE)
    },
    Parameter {
        has_meaning: |p| p.shear_stress.is_some(),
        needs: Some(|| "a stress above 0".into()),
        form: Form::Number(Number {
            quantity: &SHEAR_STRESS,
            default: Some(|_| 0.0),
            get: |p| p.shear_stress.unwrap_or(0.0),
            set: |p, value| p.shear_stress = (value > 0.0).then_some(value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&SHEAR_STRESS)
    },
    Parameter {
        has_meaning: |p| p.viscous_number.is_some(),
        needs: Some(|| "a number above 0".into()),
        form: Form::Number(Number {
            quantity: &VISCOUS_NUMBER,
            default: Some(|_| 0.0),
            get: |p| p.viscous_number.unwrap_or(0.0),
            set: |p, value| p.viscous_number = (value > 0.0).then_some(value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&VISCOUS_NUMBER)
    },
    Parameter {
        has_meaning: |p| p.macroscopic_friction.is_some(),
        needs: Some(|| "a number above 0".into()),
        form: Form::Number(Number {
            quantity: &MACROSCOPIC_FRICTION,
            default: Some(|_| 0.0),
            get: |p| p.macroscopic_friction.unwrap_or(0.0),
            set: |p, value| p.macroscopic_friction = (value > 0.0).then_some(value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&MACROSCOPIC_FRICTION)
    },
    Parameter {
        key: "imposed_pressure",
        meaning: "normal stress that an imposed pressure is",
        has_meaning: Params::imposes_pressure,
        needs: Some(|| "an imposed pressure".into()),
        form: Form::Choice(Choice {
            words: || PressureKind::KEYWORDS.to_vec(),
            default: "isotropic",
            get: |p| p.pressure.word().into(),
            set: |p, word| read(&mut p.pressure, "imposed_pressure", word),
        }),
        ..CHOICE
    },
];

/// Default time step, in strain.
const DEFAULT_TIME_STEP: f64 = 0.01;

/// Common values of choices.
const CHOICE: Parameter = Parameter {
    key: "",
    unit: "",
    meaning: "",
    has_meaning: |_| true,
    needs: None,
    form: Form::Number(NEEDED),
};

/// Common values of numbers, which are required.
const NEEDED: Number = Number {
    quantity: &SPHERES,
    whole: false,
    default: None,
    get: |_| f64::NAN,
    set: |_, _| (),
    without: None,
    stays: false,
    is_of_laws: false,
};

/// Common values of numbers of contact laws: 0 where they have no meaning.
const OF_LAWS: Number = Number {
    without: Some(0.0),
    is_of_laws: true,
    ..NEEDED
};

/// Fields of a parameter from its quantity.
const fn number(quantity: &'static Quantity) -> Parameter {
    Parameter {
        key: quantity.key,
        unit: quantity.unit,
        meaning: quantity.meaning,
        ..CHOICE
    }
}
