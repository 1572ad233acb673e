//! Parameters of a run, each declared once: description, allowed values, and accessor in
//! [`Params`].

mod choices;
mod quantities;
mod table;

pub use table::PARAMETERS;

pub(super) use choices::set_volume_fraction;
pub(crate) use quantities::{FRICTION, MAX_SPHERES, ROUGHNESS};
use quantities::{SHEAR_RATE, SHEAR_STRESS};

use super::sizes::no_sphere;
use super::{
    ContactLaws, ContactScheme, FlowType, Hydrodynamics, Params, PressureKind, Surface, segments,
};
use crate::error::{Error, Refusal};
use crate::law::tangential::stick_slide::MAX_RATIO;
use crate::law::{ColloidUnit, Keyword, Keywords as _, NormalLaw, Quantity, TangentialLaw};
use std::borrow::Cow;

/// A parameter of a run: description, allowed values, and accessor in [`Params`].
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Its key in files, tables and JSON.
    pub key: &'static str,
    /// Its unit; `1` for pure numbers, empty for keywords.
    pub unit: &'static str,
    /// Its meaning; up to a semicolon the label of an axis.
    pub meaning: &'static str,
    /// Whether it has an effect under the other choices, independent of its own value.
    pub has_meaning: fn(&Params) -> bool,
    /// The choice that gives it a meaning, where it is an error to give it without.
    pub needs: Option<fn() -> String>,
    /// Kind of its value.
    pub form: Form,
}

/// Kind of the value of a parameter.
#[derive(Debug, Clone, Copy)]
pub enum Form {
    /// A keyword.
    Choice(Choice),
    /// A number.
    Number(Number),
}

/// A parameter with keywords as values.
#[derive(Debug, Clone, Copy)]
pub struct Choice {
    /// The keywords.
    pub words: fn() -> Vec<Keyword>,
    /// The default keyword.
    pub default: &'static str,
    /// Its keyword.
    pub get: fn(&Params) -> Cow<'static, str>,
    /// Sets the choice with this keyword.
    pub set: fn(&mut Params, &str) -> Result<(), Refusal>,
}

/// A parameter that is a number.
#[derive(Debug, Clone, Copy)]
pub struct Number {
    /// Its range and description.
    pub quantity: &'static Quantity,
    /// Whether it is a whole number.
    pub whole: bool,
    /// The default value; `None` for required parameters.
    pub default: Option<fn(&Params) -> f64>,
    /// Its value.
    pub get: fn(&Params) -> f64,
    /// Sets its value.
    pub set: fn(&mut Params, f64),
    /// Its value where it has no meaning.
    pub without: Option<f64>,
    /// Whether another value that has no meaning stays when parameters are
    /// [canonical](Params::canonicalise), to be refused.
    pub stays: bool,
    /// Whether it belongs to [`ContactLaws`].
    pub is_of_laws: bool,
}

impl Parameter {
    /// Checks its value.
    fn check(&self, params: &Params) -> Result<(), Refusal> {
        let Form::Number(number) = &self.form else {
            return Ok(());
        };
        let value = (number.get)(params);
        if (self.has_meaning)(params) {
            return number.quantity.check(self.key, value);
        }
        match (number.without, self.needs) {
            (Some(without), _) if value == without => Ok(()),
            (Some(without), Some(needs)) => Err(Refusal {
                key: self.key,
                value: value.to_string(),
                problem: "has no meaning".into(),
                allowed: format!("{without}, or choose {}", needs()),
                because: None,
            }),
            _ => number.quantity.check(self.key, value),
        }
    }
}

/// Checks every value and their consistency.
pub(super) fn check(params: &Params) -> Result<(), Refusal> {
    if !params.segments.is_empty() {
        if params.at_rest {
            return Err(Refusal {
                key: "segments",
                value: format!("{} segments", params.segments.len()),
                problem: "are imposed on fluid at rest".into(),
                allowed: "none there".into(),
                because: Some("at_rest"),
            });
        }
        segments::check(params)?;
        let oscillates = params.segments.iter().any(|one| one.amplitude.is_some());
        if oscillates && let Some(ratio) = params.macroscopic_friction {
            return Err(Refusal {
                key: "imposed_macroscopic_friction",
                value: ratio.to_string(),
                problem: "would have the pressure follow the stress of an oscillation, which vanishes twice a cycle".into(),
                allowed: "`viscous_number`, whose pressure is constant, or segments without `oscillation`".into(),
                because: Some("segments"),
            });
        }
        if params.flows().iter().any(Params::has_free_rate) {
            return Err(Refusal {
                key: "segments",
                value: format!("{} segments", params.segments.len()),
                problem: "begin at given strains, which Brownian spheres under an imposed stress pass at random times".into(),
                allowed: "no segments, or rates in place of stresses".into(),
                because: Some("shear_stress"),
            });
        }
        params.flows().into_iter().try_for_each(|mut flow| {
            // A value may have a meaning in one segment and none in another.
            canonicalise(&mut flow);
            check(&flow)
        })?;
        let slowest = params.slowest_steps();
        return slowest.iter().try_for_each(check_brownian);
    }
    check_suspension(params)?;
    check_flow(params)?;
    check_pressure(params)?;
    for parameter in &PARAMETERS {
        parameter.check(params)?;
    }
    check_two_sizes(params)?;
    if let Some(sizes) = &params.sizes {
        sizes.check(params.spheres)?;
    }
    check_together(params)?;
    check_brownian(params)?;
    check_step(params)
}

/// Refuses two sizes of which the spheres are too few to have both.
fn check_two_sizes(params: &Params) -> Result<(), Refusal> {
    if params.size_ratio == 1.0 || params.sizes.is_some() {
        return Ok(());
    }
    let (spheres, large) = (params.spheres, params.number_of_large());
    for (size, number, fraction) in [
        ("the large size", large, params.large_fraction),
        (
            "the small size",
            spheres - large,
            1.0 - params.large_fraction,
        ),
    ] {
        if number == 0 && fraction > 0.0 {
            return Err(no_sphere(spheres, size, fraction, "large_fraction"));
        }
    }
    Ok(())
}

impl Quantity {
    /// Refuses a value out of range, under this name of the quantity.
    pub(crate) fn check(&self, key: &'static str, value: f64) -> Result<(), Refusal> {
        if self.range.contains(value) {
            return Ok(());
        }
        Err(Refusal {
            key,
            value: value.to_string(),
            problem: "is out of range".into(),
            allowed: self.allowed(),
            because: None,
        })
    }
}

/// Checks the parameters specific to suspensions.
fn check_suspension(params: &Params) -> Result<(), Refusal> {
    if params.volume_fraction.is_none() {
        return Ok(());
    }
    let refuse = |key, value: String, problem: &str, allowed: &str| {
        Err(Refusal {
            key,
            value,
            problem: problem.into(),
            allowed: allowed.into(),
            because: Some("volume_fraction"),
        })
    };
    if params.area_fraction != 0.0 {
        return refuse(
            "area_fraction",
            params.area_fraction.to_string(),
            "has no meaning in a suspension",
            "either of the two: a layer or a suspension",
        );
    }
    if params.contact == ContactScheme::Procedure {
        return refuse(
            "contact",
            "\"procedure\"".into(),
            "is a protocol of layers",
            "\"rigid\" or a law: the paper states its steps for spheres in a plane",
        );
    }
    if params.given_layer().is_some() {
        return refuse(
            "start",
            "a layer".into(),
            "cannot begin a suspension",
            "\"equilibrium\", or nothing for the packing that the seed makes",
        );
    }
    Ok(())
}

/// Refuses a flow that the space or the start of a run does not have.
fn check_flow(params: &Params) -> Result<(), Refusal> {
    let refuse = |problem: &str, allowed: &str, because| {
        Err(Refusal {
            key: "flow",
            value: format!("{:?}", params.flow.to_string()),
            problem: problem.into(),
            allowed: allowed.into(),
            because: Some(because),
        })
    };
    if params.volume_fraction.is_none() && !params.flow.is_planar() {
        return refuse(
            "is a flow in space, and a layer lies in a plane",
            "\"shear\", \"planar-extension\" or a mixture of the two, or a suspension, which has a `volume_fraction`",
            "area_fraction",
        );
    }
    if params.flow != FlowType::Shear && params.given_layer().is_some() {
        return refuse(
            "needs a cell that is not the square one of a given layer, which it would flatten",
            "\"shear\", or no given layer: the seed then makes one in the right cell",
            "start",
        );
    }
    Ok(())
}

/// Longest step of Brownian motion, over the roughness and in a²/D0. The gap g of two equal spheres
/// diffuses by 4 g D0, so a gap of the roughness changes by 0.32 of it (root mean square). The
/// density of pairs within 0.005 of contact, over the exact one, is 0.88, 0.93, 0.93 and 0.99 at
/// steps of 1/10, 1/20, 1/40 and 1/100 (h = 0.01, leading-order lubrication, each ± 0.03).
const LONGEST_THERMAL_STEP: f64 = 1.0 / 80.0;

/// Checks the parameters of Brownian motion.
fn check_brownian(params: &Params) -> Result<(), Refusal> {
    let (peclet, load) = (params.peclet, params.thermal_load);
    let (key, value) = if load > 0.0 {
        ("thermal_load", load)
    } else {
        ("peclet", peclet)
    };
    let refuse = |problem: &str, allowed: &str, because| {
        Err(Refusal {
            key,
            value: value.to_string(),
            problem: problem.into(),
            allowed: allowed.into(),
            because: Some(because),
        })
    };
    if load > 0.0 && peclet.is_finite() {
        return refuse(
            "is given beside `peclet`",
            "one of them: Pe = shear_rate thermal_load",
            "peclet",
        );
    }
    let has_stress = params.shear_stress.is_some();
    if load > 0.0 && !has_stress && !(params.shear_rate > 0.0 && params.shear_rate.is_finite()) {
        return refuse(
            "is a ratio to F_crit, which this rate does not have",
            "0 there, or a `peclet`: F_crit = 6 pi/shear_rate is infinite at 0 and zero at inf",
            "shear_rate",
        );
    }
    let Some(thermal_energy) = params.thermal_energy() else {
        return Ok(());
    };
    if params.contact == ContactScheme::Procedure {
        return refuse(
            "is of Brownian motion, which the steps of that paper do not have",
            "none there; `contact` = \"rigid\" or a law",
            "contact",
        );
    }
    if has_stress && params.flow != FlowType::Shear {
        return refuse(
            "under an imposed stress is of shear, whose cell can follow any strain",
            "`flow` = \"shear\", or a rate in place of the stress",
            "flow",
        );
    }
    if params.at_rest != (load == 0.0 && peclet == 0.0) {
        return refuse(
            if params.at_rest {
                "is the number of a flow, and the fluid is at rest"
            } else {
                "leaves no flow whose strain would be the time"
            },
            if params.at_rest {
                "0 or inf"
            } else {
                "above 0; inf is no Brownian motion"
            },
            "at_rest",
        );
    }
    let longest =
        LONGEST_THERMAL_STEP * params.roughness * 6.0 * std::f64::consts::PI / thermal_energy;
    if params.roughness > 0.0 && params.time_step > longest {
        return Err(Refusal {
            key: "time_step",
            value: params.time_step.to_string(),
            problem: "lets a gap of the roughness diffuse too far".into(),
            allowed: format!(
                "at most roughness Pe/80 = {longest:.3e}, at rest roughness/80; in an oscillation Pe is that of its slowest step"
            ),
            because: Some(key),
        });
    }
    Ok(())
}

/// Refuses what cannot be combined with an imposed pressure.
fn check_pressure(params: &Params) -> Result<(), Refusal> {
    let (key, number) = match (params.viscous_number, params.macroscopic_friction) {
        (None, None) => return Ok(()),
        (Some(number), _) => ("imposed_viscous_number", number),
        (None, Some(ratio)) => ("imposed_macroscopic_friction", ratio),
    };
    let refuse = |problem: &str, allowed: &str, because| {
        Err(Refusal {
            key,
            value: number.to_string(),
            problem: problem.into(),
            allowed: allowed.into(),
            because: Some(because),
        })
    };
    if params.viscous_number.is_some() && params.macroscopic_friction.is_some() {
        return refuse(
            "is imposed with the ratio of stress and pressure, from which it follows",
            "one of the two: the other is a result",
            "imposed_macroscopic_friction",
        );
    }
    if params.at_rest {
        return refuse(
            "is imposed on fluid at rest",
            "a flow: the pressure is in units of its rate, or of its stress",
            "at_rest",
        );
    }
    if params.viscous_number.is_some() && params.shear_stress.is_some() {
        return refuse(
            "is imposed without a rate",
            "a `shear_rate`, in units of which the pressure is then given, or the ratio of stress and pressure: \
             `macroscopic_friction`",
            "shear_stress",
        );
    }
    if params.flow != FlowType::Shear && params.pressure == PressureKind::Gradient {
        return refuse(
            "is imposed along the gradient of a flow that is no shear",
            "`pressure` = \"isotropic\", or `flow` = \"shear\"",
            "flow",
        );
    }
    if params.contact == ContactScheme::Procedure {
        return refuse(
            "is imposed on the paper's procedure, which has no equation for the volume",
            "another `contact`",
            "contact",
        );
    }
    if params.hydrodynamics == Hydrodynamics::StokesianDynamics {
        return refuse(
            "changes the size of the cell, for which the far field is planned",
            "`hydrodynamics` = \"ball-melrose\" or \"lubrication\"",
            "hydrodynamics",
        );
    }
    if params.thermal_energy().is_some() {
        return refuse(
            "is imposed on Brownian spheres, whose own pressure it leaves out",
            "no `peclet` and no `thermal_load`",
            "peclet",
        );
    }
    if params.given_layer().is_some() {
        return refuse(
            "is imposed on a given layer",
            "a fraction, from which the seed makes the start",
            "start",
        );
    }
    Ok(())
}

/// Longest step under soft laws: from about twice this value on, stresslet viscosities became
/// negative.
const LONGEST_SOFT_STEP: f64 = 0.025;

/// Refuses a step that does not resolve contacts.
///
/// ```text
/// two spheres in contact that move straight for a strain Δt, across their line of centres, separate by about Δt²/4
/// ```
///
/// Under rigid laws that must be less than the roughness height, or the step itself creates and
/// breaks contacts.
fn check_step(params: &Params) -> Result<(), Refusal> {
    let step = params.time_step;
    let refuse = |problem: &str, allowed, because| {
        Err(Refusal {
            key: "time_step",
            value: step.to_string(),
            problem: problem.into(),
            allowed,
            because: Some(because),
        })
    };
    if params.contact.laws().is_soft() {
        // Springs correct overlaps of a step, so the limit depends on their stiffness.
        if step <= LONGEST_SOFT_STEP {
            return Ok(());
        }
        return refuse(
            "is too long for soft contacts",
            format!("at most {LONGEST_SOFT_STEP}"),
            "contact",
        );
    }
    let longest = 2.0 * params.roughness.sqrt();
    if step > longest {
        return refuse(
            "is too long for gaps of this roughness",
            format!("at most 2 √roughness = {longest:.4}"),
            "roughness",
        );
    }
    Ok(())
}

impl ContactLaws {
    /// Checks ranges and combinations of laws, for spheres with this surface under these
    /// hydrodynamics.
    ///
    /// # Errors
    /// [`Error::Refused`] names the first value refused and what is allowed.
    ///
    /// ```
    /// use sd_core::model::Surface;
    /// use sd_core::{ContactLaws, Hydrodynamics, TangentialLaw};
    ///
    /// let springs = ContactLaws::linear_spring(1e4, TangentialLaw::Coulomb, 0.01);
    /// let surface = Surface { roughness: 0.01, friction: 0.5, critical_load: 1.0 };
    /// springs.validate(&surface, Hydrodynamics::BallMelrose)?;
    ///
    /// // In units of the critical load springs have no stiffness where that is 0.
    /// let without = Surface { critical_load: 0.0, ..surface };
    /// assert!(springs.validate(&without, Hydrodynamics::BallMelrose).is_err());
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn validate(&self, surface: &Surface, hydrodynamics: Hydrodynamics) -> Result<(), Error> {
        let load = surface.critical_load;
        if self.needs_critical_load() && !(load > 0.0 && load.is_finite()) {
            return Err(Refusal {
                key: "critical_load",
                value: load.to_string(),
                problem: "has no meaning under these laws".into(),
                allowed: "above 0 and finite where stiffness, repulsion or adhesion are in units of it: with an infinite \
                          one they are infinite, and with 0 there are none; a stiffness may be in units of the flow"
                    .into(),
                because: Some("contact"),
            }
            .into());
        }
        // Only the contact is checked; the rest of the layer is arbitrary.
        check_contact(&Params {
            roughness: surface.roughness,
            friction: surface.friction,
            shear_rate: 6.0 * std::f64::consts::PI / load,
            hydrodynamics,
            contact: ContactScheme::Laws(*self),
            ..Params::UNSET
        })?;
        Ok(())
    }
}

/// Checks the parameters of the contact laws and their consistency.
pub(super) fn check_contact(params: &Params) -> Result<(), Refusal> {
    for parameter in &PARAMETERS {
        // The parameters of the layer and of its flow are not set here.
        if matches!(&parameter.form, Form::Number(number) if number.is_of_laws) {
            parameter.check(params)?;
        }
    }
    check_together(params)
}

/// Checks the consistency of individually valid values.
fn check_together(params: &Params) -> Result<(), Refusal> {
    let laws = params.contact.laws();
    let refuse = |key, value: String, problem: &str, allowed: String, because| {
        Err(Refusal {
            key,
            value,
            problem: problem.into(),
            allowed,
            because: Some(because),
        })
    };
    if params.at_rest && params.shear_stress.is_some() {
        return refuse(
            "shear_stress",
            params.shear_stress.unwrap_or_default().to_string(),
            "is imposed on fluid at rest",
            "none there".into(),
            "at_rest",
        );
    }
    if params.direction.abs() != 1.0 {
        return refuse(
            "direction",
            params.direction.to_string(),
            "is no sense of the flow",
            "1 or -1".into(),
            "direction",
        );
    }
    if laws.normal == NormalLaw::Rigid && params.roughness == 0.0 {
        return refuse(
            "roughness",
            params.roughness.to_string(),
            "leaves rigid contacts no gap to hold",
            "above 0 and below 0.5 there; springs may have 0: then the surfaces themselves touch and overlap"
                .into(),
            "contact",
        );
    }
    if let Some(numbers) = params.hydrodynamics.leading_order() {
        numbers.check()?;
    }
    if laws.needs_critical_load()
        && params.shear_stress.is_none()
        && (params.shear_rate == 0.0 || params.shear_rate.is_infinite())
    {
        return refuse(
            "shear_rate",
            params.shear_rate.to_string(),
            "has no meaning under laws in units of F_crit",
            "above 0 and finite: stiffness, repulsion, attraction and adhesion are in units of F_crit = 6 pi/shear_rate, \
             which is infinite at 0 and zero at inf; give rigid contacts without them a grid of their own there, or springs the \
             `stiffness_unit` = \"flow\""
                .into(),
            "contact",
        );
    }
    if laws.tangential.has_spring() && !laws.normal.touches() {
        return refuse(
            "tangential",
            format!("{:?}", laws.tangential.word()),
            "conflicts with spheres that never touch",
            "another law, or a contact that touches".into(),
            "contact",
        );
    }
    if laws.tangential.has_spring()
        && laws.normal.is_spring()
        && laws.tangential_stiffness > MAX_RATIO
    {
        return refuse(
            "tangential_stiffness",
            laws.tangential_stiffness.to_string(),
            "is out of range over the stiffness of springs",
            format!("above 0 and at most {MAX_RATIO}; \"coulomb\" is the limit of stiff ones"),
            "contact",
        );
    }
    if laws.lubrication_gap > params.roughness && params.roughness > 0.0 {
        return refuse(
            "lubrication_gap",
            laws.lubrication_gap.to_string(),
            "is above the roughness",
            format!("above 0 and at most {}", params.roughness),
            "roughness",
        );
    }
    check_colloids(params)
}

/// Checks the forces between surfaces without contact.
fn check_colloids(params: &Params) -> Result<(), Refusal> {
    let laws = params.contact.laws();
    if laws.colloid_unit == ColloidUnit::Thermal && params.thermal_energy().is_none() {
        return Err(Refusal {
            key: "colloid_unit",
            value: format!("{:?}", laws.colloid_unit.word()),
            problem: "is kT/a, and there is no Brownian motion".into(),
            allowed: "\"critical-load\", or a `peclet` or `thermal_load`".into(),
            because: Some("peclet"),
        });
    }
    if !laws.normal.touches() && laws.repulsion == 0.0 {
        return Err(Refusal {
            key: "repulsion",
            value: "0".into(),
            problem: "leaves nothing that holds the spheres apart".into(),
            allowed: format!("above 0 with `contact` = {:?}", laws.normal.word()),
            because: Some("contact"),
        });
    }
    Ok(())
}

/// Sets friction or shear rate to 0 where it has no effect because of the other.
///
/// Friction never acts at the lower plateau. The shear rate sets the load of the onset of friction,
/// and is a unit of some laws: without friction and such laws it has no effect.
///
/// Where friction begins with contact it acts at every rate: rate 0 is then that of infinity, where
/// the onset has no effect.
fn merge_plateaus(params: &mut Params) {
    if params.shear_stress.is_some() || !params.segments.is_empty() {
        return;
    }
    if params.shear_rate == 0.0 {
        if params.has_friction() {
            params.shear_rate = f64::INFINITY;
        } else {
            params.friction = 0.0;
        }
    }
    if params.friction == 0.0
        && let ContactScheme::Laws(laws) = &mut params.contact
        && laws.has_rigid_springs()
    {
        // Their stiffness may be in units of the critical load.
        *laws = ContactLaws {
            tangential: ContactLaws::PAPER.tangential,
            tangential_stiffness: 0.0,
            ..*laws
        };
    }
    let acts = params.friction != 0.0 && params.contact.laws().normal.touches();
    let needs_load = params.contact.laws().needs_critical_load() || params.thermal_load > 0.0;
    if !acts && !needs_load {
        params.shear_rate = 0.0;
    }
}

/// Brings parameters to a canonical form, in which equal physics has equal numbers.
pub(super) fn canonicalise(params: &mut Params) {
    if let ContactScheme::Laws(laws) = &mut params.contact {
        if laws.normal.is_spring() && laws.stiffness.is_infinite() {
            laws.normal = NormalLaw::Rigid;
            if laws.tangential.has_spring() {
                laws.tangential_stiffness = f64::INFINITY;
            }
        }
        let is_infinite = laws.tangential_stiffness.is_infinite() && !laws.normal.is_spring();
        if laws.tangential.has_spring() && (is_infinite || !laws.normal.touches()) {
            laws.tangential = TangentialLaw::Coulomb;
        }
    }
    merge_plateaus(params);
    let flows = if params.segments.is_empty() {
        Vec::new()
    } else {
        params.flows()
    };
    // Segments name their shear themselves: that of another is not theirs.
    let is_of_shear =
        |parameter: &Parameter| [SHEAR_RATE.key, SHEAR_STRESS.key].contains(&parameter.key);
    // Friction first: tangential laws depend on it, and precede it.
    let friction = PARAMETERS
        .iter()
        .filter(|parameter| parameter.key == FRICTION.key);
    for parameter in friction.chain(&PARAMETERS) {
        let has_meaning = parameter.has_meaning;
        let in_flows = !is_of_shear(parameter) && flows.iter().any(has_meaning);
        let meaningless = !has_meaning(params) && !in_flows;
        match &parameter.form {
            Form::Choice(choice) if meaningless => {
                (choice.set)(params, choice.default).expect("a default is one of the words");
            }
            Form::Choice(_) => {}
            Form::Number(number) => {
                let value = number.without.filter(|_| meaningless && !number.stays);
                // Removes the sign of zero.
                let value = value.unwrap_or_else(|| (number.get)(params)) + 0.0;
                (number.set)(params, value);
            }
        }
    }
    if params.contact == ContactScheme::Laws(ContactLaws::PAPER) {
        params.contact = ContactScheme::Rigid;
    }
}
