//! Conversion from and to units and conventions of most published simulations of sheared spheres.
//!
//! These use the radius `a_s` of the small spheres, a layer one small radius thick, and a viscosity
//! without the stresslets of isolated spheres. We use the mean radius a, a layer 2a thick, and the
//! full viscosity:
//!
//! ```text
//! η' = 1 + t (η − 1 − s),   Γ' = Γ/r²,   σ' = η' Γ'/(6π),   r = a/a_s
//!
//! layers:        t = 2r,   s = (5/3) c ⟨a³⟩/(⟨a⟩⟨a²⟩)
//! suspensions:   t = 1,    s = (5/2) φ
//! ```

use super::Params;
use std::f64::consts::PI;

/// The conversion for one kind of layer or suspension.
///
/// ```
/// use sd_core::model::PublishedUnits;
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
///
/// let units = PublishedUnits::of(&params);
/// // A layer whose spheres add nothing beyond their isolated stresslets.
/// assert!((units.viscosity(1.0 + 5.0 / 3.0 * 0.6) - 1.0).abs() < 1e-12);
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedUnits {
    /// r: mean radius over that of the small spheres.
    pub mean_radius: f64,
    /// t: our thickness of a layer over theirs; 1 for suspensions, which have a volume.
    pub thickness: f64,
    /// s: contribution of isolated spheres to our viscosity.
    pub isolated: f64,
}

impl PublishedUnits {
    /// The conversion for the layer or suspension of a run.
    pub fn of(params: &Params) -> Self {
        let new = |mean_radius: f64, moment: &dyn Fn(i32) -> f64| match params.volume_fraction {
            Some(volume_fraction) => Self {
                mean_radius,
                thickness: 1.0,
                isolated: 2.5 * volume_fraction,
            },
            None => Self {
                mean_radius,
                thickness: 2.0 * mean_radius,
                isolated: 5.0 / 3.0 * params.area_fraction * moment(3) / (moment(1) * moment(2)),
            },
        };
        if let Some(sizes) = &params.sizes {
            // Without small spheres their unit is the mean radius.
            let radii = sizes.radii(params.spheres);
            let sum = |power: i32| radii.iter().map(|a| a.powi(power)).sum::<f64>();
            return new(1.0, &|power| sum(power) / radii.len() as f64);
        }
        let large = if params.size_ratio > 1.0 {
            params.large_fraction
        } else {
            0.0
        };
        // Moments of the radii, in those of the small spheres.
        let moment = |power: i32| 1.0 - large + large * params.size_ratio.powi(power);
        new(moment(1), &moment)
    }

    /// Viscosity in published units.
    pub fn viscosity(&self, ours: f64) -> f64 {
        1.0 + self.difference(ours - 1.0 - self.isolated)
    }

    /// Difference or error of viscosities in published units.
    pub fn difference(&self, ours: f64) -> f64 {
        self.thickness * ours
    }

    /// Our viscosity.
    pub fn our_viscosity(&self, theirs: f64) -> f64 {
        1.0 + self.isolated + (theirs - 1.0) / self.thickness
    }

    /// Their rate `6π μ a_s² × rate / F_crit` from Γ.
    pub fn shear_rate(&self, ours: f64) -> f64 {
        ours / (self.mean_radius * self.mean_radius)
    }

    /// Their stress in `F_crit/a_s²` from our viscosity and Γ.
    pub fn shear_stress(&self, viscosity: f64, shear_rate: f64) -> f64 {
        self.viscosity(viscosity) * self.shear_rate(shear_rate) / (6.0 * PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_size_is_converted_by_halves() {
        let params = Params {
            area_fraction: 0.693,
            ..Params::UNSET
        };
        let units = PublishedUnits::of(&params);
        assert_eq!(units.mean_radius, 1.0);
        // ours = 1 + 5c/3 + (theirs − 1)/2.
        let ours = 1.0 + 5.0 / 3.0 * 0.693 + (20.0 - 1.0) / 2.0;
        assert!((units.our_viscosity(20.0) - ours).abs() < 1e-12);
        assert!((units.viscosity(ours) - 20.0).abs() < 1e-12);
        assert_eq!(units.shear_rate(0.3), 0.3);
    }

    #[test]
    fn suspensions_lose_the_isolated_stresslets_alone() {
        let params = Params {
            area_fraction: 0.0,
            volume_fraction: Some(0.05),
            size_ratio: 1.4,
            large_fraction: 0.25,
            ..Params::UNSET
        };
        let units = PublishedUnits::of(&params);
        assert!((units.viscosity(1.1321) - 1.0071).abs() < 1e-12);
        assert!((units.our_viscosity(1.0071) - 1.1321).abs() < 1e-12);
        assert_eq!(units.difference(0.0038), 0.0038);
        // The rate has the radius of the small spheres there too.
        assert!((units.shear_rate(2.0) - 2.0 / (1.1 * 1.1)).abs() < 1e-14);
    }

    #[test]
    fn two_sizes_meet_the_sums_over_spheres() {
        let params = Params {
            area_fraction: 0.75,
            size_ratio: 1.4,
            large_fraction: 0.25,
            ..Params::UNSET
        };
        let units = PublishedUnits::of(&params);
        // Three small spheres of radius 1 for each large one, summed as the stress is.
        let radii = [1.0, 1.0, 1.0, 1.4_f64];
        let area = radii.iter().map(|a| PI * a * a).sum::<f64>() / 0.75;
        let mean = radii.iter().sum::<f64>() / 4.0;
        let isolated: f64 = radii.iter().map(|a| 10.0 / 3.0 * PI * a.powi(3)).sum();
        assert!((units.mean_radius - mean).abs() < 1e-14);
        assert!((units.isolated - isolated / (2.0 * mean * area)).abs() < 1e-12);
        // A stress S besides, over their volume and over ours.
        let besides = 700.0;
        let ours = 1.0 + (isolated + besides) / (2.0 * mean * area);
        let theirs = 1.0 + besides / area;
        assert!((units.viscosity(ours) - theirs).abs() < 1e-10);
        assert!((units.our_viscosity(theirs) - ours).abs() < 1e-10);
        // Rates: mu a² rate/F with their radius for ours.
        assert!((units.shear_rate(2.0) - 2.0 / (mean * mean)).abs() < 1e-14);
    }
}
