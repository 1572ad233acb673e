//! Parameters from the values that are given: the others get their defaults, or are named.

use super::{
    ContactScheme, FlowType, Hydrodynamics, PARAMETERS, Parameter, Params, PressureKind, Refusal,
    Segment, Sizes, StartFrom, parameters,
};
use crate::error::Error;
use crate::model::Form;

/// Parameters under construction, made by [`Params::builder`].
///
/// Required are the number of spheres, an area or a volume fraction, the roughness height, the
/// friction coefficient where surfaces touch, and a shear rate or a shear stress.
///
/// ```
/// use sd_core::{Error, Params};
///
/// let forgotten = Params::builder().spheres(90).area_fraction(0.6).friction(0.5).build();
/// assert_eq!(
///     forgotten.unwrap_err().to_string(),
///     "no value is given of roughness, shear_rate"
/// );
/// ```
#[derive(Debug, Clone)]
#[must_use = "`build` makes the parameters"]
pub struct ParamsBuilder {
    params: Params,
    /// Keys of the parameters that have a value.
    given: Vec<&'static str>,
}

/// Keys of the parameters that a contact scheme comes with.
fn keys_of_laws() -> impl Iterator<Item = &'static str> {
    let words = [
        "contact",
        "tangential",
        "friction_onset",
        "stiffness_unit",
        "colloid_unit",
    ];
    let numbers = PARAMETERS
        .iter()
        .filter(|parameter| matches!(&parameter.form, Form::Number(number) if number.is_of_laws));
    words
        .into_iter()
        .chain(numbers.map(|parameter| parameter.key))
}

impl Params {
    /// Parameters without any value yet.
    ///
    /// ```
    /// use sd_core::{Hydrodynamics, Params};
    ///
    /// let params = Params::builder()
    ///     .spheres(90)
    ///     .area_fraction(0.693)
    ///     .roughness(0.01)
    ///     .friction(0.3)
    ///     .shear_rate(f64::INFINITY)
    ///     .build()?;
    /// assert_eq!(params.hydrodynamics, Hydrodynamics::StokesianDynamics);
    /// assert_eq!(params.time_step, 0.01);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn builder() -> ParamsBuilder {
        ParamsBuilder {
            params: Self::UNSET,
            given: Vec::new(),
        }
    }
}

impl ParamsBuilder {
    /// Changes the parameters and notes that these have values.
    fn with(
        mut self,
        keys: impl IntoIterator<Item = &'static str>,
        change: impl FnOnce(&mut Params),
    ) -> Self {
        change(&mut self.params);
        self.given.extend(keys);
        self
    }

    /// Number of spheres N.
    pub fn spheres(self, spheres: usize) -> Self {
        self.with(["spheres"], |p| p.spheres = spheres)
    }

    /// Area fraction c of a layer, above 0.
    pub fn area_fraction(self, fraction: f64) -> Self {
        self.with(["area_fraction"], |p| p.area_fraction = fraction)
    }

    /// Volume fraction φ of a suspension, from 0.01 to 0.64, in place of an area fraction.
    pub fn volume_fraction(self, fraction: f64) -> Self {
        self.with(["volume_fraction"], |p| {
            parameters::set_volume_fraction(p, fraction);
        })
    }

    /// Roughness height h, in a, below 0.5.
    pub fn roughness(self, height: f64) -> Self {
        self.with(["roughness"], |p| p.roughness = height)
    }

    /// Friction coefficient ν, from 0.
    pub fn friction(self, coefficient: f64) -> Self {
        self.with(["friction"], |p| p.friction = coefficient)
    }

    /// Dimensionless shear rate Γ = 6π/F_crit; at ∞ friction acts on every contact, at 0 on none.
    pub fn shear_rate(self, rate: f64) -> Self {
        self.with(["shear_rate"], |p| p.shear_rate = rate)
    }

    /// Imposed shear stress σ* = σ a²/F_crit, above 0, in place of a shear rate.
    pub fn shear_stress(self, stress: f64) -> Self {
        self.with(["shear_stress"], |p| p.shear_stress = Some(stress))
    }

    /// Imposed viscous number J = mu·rate/P, above 0, which imposes the particle pressure P; the
    /// fraction is then that of the start.
    pub fn viscous_number(self, number: f64) -> Self {
        self.with(["imposed_viscous_number"], |p| {
            p.viscous_number = Some(number);
        })
    }

    /// Imposed ratio σ/P of shear stress and particle pressure in place of the viscous number: see
    /// [`Params::macroscopic_friction`].
    pub fn macroscopic_friction(self, ratio: f64) -> Self {
        self.with(["imposed_macroscopic_friction"], |p| {
            p.macroscopic_friction = Some(ratio);
        })
    }

    /// The normal stress that the imposed pressure is: [`PressureKind::Isotropic`] by default.
    pub fn pressure(self, kind: PressureKind) -> Self {
        self.with(["imposed_pressure"], |p| p.pressure = kind)
    }

    /// Two sizes: radius of the large spheres over that of the small, and number of large spheres
    /// over all. All spheres are equal by default.
    pub fn two_sizes(self, ratio: f64, large_fraction: f64) -> Self {
        self.with(["size_ratio", "large_fraction"], |p| {
            p.size_ratio = ratio;
            p.large_fraction = large_fraction;
        })
    }

    /// Several sizes or a distribution of them.
    pub fn sizes(self, sizes: Sizes) -> Self {
        match sizes.to_two() {
            Some([ratio, large_fraction]) => self.two_sizes(ratio, large_fraction),
            None => self.with(["sizes"], |p| p.sizes = Some(sizes)),
        }
    }

    /// Hydrodynamics; [`Hydrodynamics::StokesianDynamics`] by default.
    pub fn hydrodynamics(self, choice: impl Into<Hydrodynamics>) -> Self {
        let keys = [
            "hydrodynamics",
            "lubrication_cutoff",
            "lubrication_regularisation",
        ];
        self.with(keys, |p| p.hydrodynamics = choice.into())
    }

    /// Contact scheme; [`ContactScheme::Rigid`] by default.
    pub fn contact(self, scheme: impl Into<ContactScheme>) -> Self {
        self.with(keys_of_laws(), |p| p.contact = scheme.into())
    }

    /// Time step, in strain; 0.01 by default.
    pub fn time_step(self, strain: f64) -> Self {
        self.with(["time_step"], |p| p.time_step = strain)
    }

    /// No shear: see [`Params::at_rest`]. Spheres then move under forces, see
    /// [`crate::Simulation::use_forces`].
    pub fn at_rest(self) -> Self {
        self.with([], |p| p.at_rest = true)
    }

    /// Péclet number of Brownian motion: see [`Params::peclet`]; none by default.
    pub fn peclet(self, number: f64) -> Self {
        self.with(["peclet"], |p| p.peclet = number)
    }

    /// `F_crit a/kT` of Brownian motion in place of a Péclet number: see [`Params::thermal_load`].
    pub fn thermal_load(self, load: f64) -> Self {
        self.with(["thermal_load"], |p| p.thermal_load = load)
    }

    /// Type of the imposed flow: [`FlowType::Shear`] by default.
    pub fn flow(self, flow: FlowType) -> Self {
        self.with(["flow"], |p| p.flow = flow)
    }

    /// Sense of the flow: 1 (the default), or −1 for the opposite direction.
    pub fn direction(self, direction: f64) -> Self {
        self.with(["direction"], |p| p.direction = direction)
    }

    /// What the run begins with; by default the packing that the seed makes.
    pub fn start(self, start: impl Into<StartFrom>) -> Self {
        self.with(["start"], |p| p.start = Some(start.into()))
    }

    /// Segments of the run, starting at strain 0; steady shear by default.
    pub fn segments(self, segments: Vec<Segment>) -> Self {
        self.with([], |p| p.segments = segments)
    }

    /// Sets the value of a parameter by its declaration.
    ///
    /// A choice precedes the numbers that have a meaning under it, so values are set from the last
    /// parameter to the first.
    ///
    /// # Errors
    /// Those of `change`.
    pub fn set(
        &mut self,
        parameter: &Parameter,
        change: impl FnOnce(&mut Params) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        self.given.push(parameter.key);
        change(&mut self.params)
    }

    /// Sets the defaults of declared parameters without a value, where they have a meaning.
    ///
    /// # Returns
    /// The keys of those that have no default.
    ///
    /// # Errors
    /// A default that conflicts with the values given.
    pub fn fill<'d>(
        &mut self,
        declared: impl IntoIterator<Item = &'d Parameter>,
    ) -> Result<Vec<&'static str>, Refusal> {
        let Self { params, given } = self;
        let mut missing = Vec::new();
        for parameter in declared {
            if given.contains(&parameter.key) || !(parameter.has_meaning)(params) {
                continue;
            }
            match &parameter.form {
                Form::Choice(choice) => (choice.set)(params, choice.default)?,
                Form::Number(number) => match number.default {
                    None => missing.push(parameter.key),
                    Some(default) => {
                        let value = default(params);
                        (number.set)(params, value);
                    }
                },
            }
        }
        Ok(missing)
    }

    /// The parameters with the values set so far, neither [canonical](Params::canonicalise) nor
    /// checked.
    pub fn into_given(self) -> Params {
        self.params
    }

    /// The parameters, [canonical](Params::canonicalise) and [checked](Params::validate).
    ///
    /// # Errors
    /// [`Error::Missing`] names the required parameters without a value; [`Error::Refused`] the
    /// first value that is out of range or conflicts with others.
    pub fn build(mut self) -> Result<Params, Error> {
        let mut missing = self.fill(&PARAMETERS)?;
        let mut params = self.params;
        let laws = params.contact.laws();
        if laws.normal.is_spring() && laws.stiffness.is_infinite() {
            // Those of `ContactLaws::PAPER`, which was completed: rigid contacts are a law.
            missing.push("stiffness");
        }
        if !missing.is_empty() {
            return Err(Error::Missing {
                parameters: missing,
            });
        }
        if params.shear_stress.is_some() && params.shear_rate > 0.0 {
            return Err(Refusal {
                key: "shear_rate",
                value: params.shear_rate.to_string(),
                problem: "is given beside `shear_stress`".into(),
                allowed: "one of them: the other follows from the viscosity".into(),
                because: Some("shear_stress"),
            }
            .into());
        }
        let segments = std::mem::take(&mut params.segments);
        params.impose(&segments);
        parameters::canonicalise(&mut params);
        params.validate()?;
        Ok(params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ContactLaws, NormalLaw};

    /// All that is required of a layer but the shear.
    fn at_rest() -> ParamsBuilder {
        let spheres = Params::builder().spheres(90).area_fraction(0.6);
        spheres.roughness(0.01).friction(0.5)
    }

    /// The error of what is built.
    fn error(builder: ParamsBuilder) -> String {
        builder.build().unwrap_err().to_string()
    }

    #[test]
    fn what_is_required_is_named() {
        assert_eq!(
            error(Params::builder()),
            "no value is given of spheres, area_fraction, roughness, friction, shear_rate"
        );
        let springs = ContactLaws {
            normal: NormalLaw::Hertz,
            ..ContactLaws::PAPER
        };
        let soft = at_rest().contact(springs);
        assert_eq!(error(soft), "no value is given of shear_rate, stiffness");
    }

    #[test]
    fn a_layer_has_one_shear_and_one_fraction() {
        let both = error(at_rest().shear_rate(1.0).shear_stress(1.0));
        assert!(both.contains("one of them"), "{both}");
        let both = error(at_rest().shear_rate(1.0).volume_fraction(0.4));
        assert!(both.contains("a layer or a suspension"), "{both}");
        at_rest().shear_stress(1.0).build().unwrap();
    }

    #[test]
    fn equal_physics_has_equal_numbers() {
        let params = at_rest().shear_rate(2.0).contact(ContactLaws::PAPER);
        let params = params.build().unwrap();
        assert_eq!(params, at_rest().shear_rate(2.0).build().unwrap());
        assert_eq!(params.contact, ContactScheme::Rigid);
    }
}
