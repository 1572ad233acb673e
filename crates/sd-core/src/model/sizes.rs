//! Sizes of the spheres: several species, or a distribution.
//!
//! ```text
//! lognormal   ln a normal, σ² = ln(1 + s²)
//! schulz      p(a) ∝ a^(k−1) exp(−k a), k = 1/s²
//! uniform     a within √3 s of 1
//! ```
//! of mean 1 and standard deviation s, by number. Sphere k of N has the quantile (k + ½)/N, and all
//! are divided by their mean, so that sizes depend only on N; the seed determines the position of
//! each sphere.

use crate::error::Refusal;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Maximum number of species.
const MAX_SPECIES: usize = 32;
/// Smallest radius allowed, over the mean.
const LEAST: f64 = 0.2;
/// The largest of them.
const MOST: f64 = 5.0;
/// Largest size ratio of two sizes, which are those of [`crate::Params::size_ratio`].
pub(super) const MAX_SIZE_RATIO: f64 = 10.0;
/// Tolerance of the sum of fractions.
const ROUNDING: f64 = 1e-9;

/// Sizes other than one or two. As text: `lognormal 0.2`, or species as `1:0.5 1.4:0.25 2:0.25`,
/// each with its number fraction.
///
/// ```
/// use sd_core::model::Sizes;
///
/// let sizes: Sizes = "lognormal 0.2".parse()?;
/// let radii = sizes.radii(100);
/// let mean = radii.iter().sum::<f64>() / 100.0;
/// assert!((mean - 1.0).abs() < 1e-12 && radii[0] > radii[99]);
/// # Ok::<(), sd_core::model::Refusal>(())
/// ```
#[derive(Clone, PartialEq)]
pub struct Sizes(Kind);

#[derive(Clone, PartialEq)]
enum Kind {
    /// A distribution, and its standard deviation over its mean.
    Distribution(Distribution, f64),
    /// Radii in any one unit, increasing, each with its number fraction.
    Species(Vec<[f64; 2]>),
}

crate::law::words! {
    /// A distribution of radii.
    #[non_exhaustive]
    Distribution {
        Lognormal = "lognormal", "the logarithm of the radius is normal";
        Schulz = "schulz", "the radius has a gamma distribution";
        Uniform = "uniform", "the radius is uniform between two values";
    }
}

/// The refusal of sizes.
fn refuse(value: impl Into<String>, problem: &str, allowed: impl Into<String>) -> Refusal {
    Refusal {
        key: "sizes",
        value: value.into(),
        problem: problem.into(),
        allowed: allowed.into(),
        because: None,
    }
}

/// The refusal of so few spheres that none has a size: its share of n, rounded, is 0 below one
/// half.
pub(super) fn no_sphere(n: usize, size: &str, fraction: f64, because: &'static str) -> Refusal {
    Refusal {
        key: "spheres",
        value: n.to_string(),
        problem: format!("leaves no sphere of {size}, whose fraction of the number is {fraction}"),
        allowed: format!(
            "about {} spheres or more, or another fraction",
            (0.5 / fraction).ceil()
        ),
        because: Some(because),
    }
}

impl Sizes {
    /// Species in canonical form: in order, each radius once.
    ///
    /// # Arguments
    /// - `species`: radii in any one unit, with fractions of number (`power` 0), area (2) or volume
    ///   (3).
    ///
    /// # Errors
    /// Another power, a radius or fraction that is not positive, fractions whose sum is not one,
    /// none or too many species, two sizes of too large a ratio.
    pub fn species(species: &[[f64; 2]], power: i32) -> Result<Self, Refusal> {
        if ![0, 2, 3].contains(&power) {
            return Err(refuse(
                format!("fractions of power {power} of the radius"),
                "have no meaning",
                "0 for fractions of number, 2 of area, 3 of volume",
            ));
        }
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if species.is_empty() || species.len() > MAX_SPECIES {
            return Err(refuse(
                format!("{} species", species.len()),
                "is out of range",
                format!("1 to {MAX_SPECIES} species, or a distribution"),
            ));
        }
        for [radius, fraction] in species {
            if !positive(*radius) {
                return Err(refuse(
                    format!("a radius of {radius}"),
                    "is out of range",
                    "radii above 0, in any one unit: only their ratios matter",
                ));
            }
            if !positive(*fraction) {
                return Err(refuse(
                    format!("a fraction of {fraction}"),
                    "is out of range",
                    "fractions above 0 with a sum of 1",
                ));
            }
        }
        let sum: f64 = species.iter().map(|[_, fraction]| fraction).sum();
        if (sum - 1.0).abs() > ROUNDING {
            return Err(refuse(
                format!("fractions with a sum of {sum}"),
                "do not add up to a whole",
                "fractions with a sum of 1",
            ));
        }
        let weight = |[radius, fraction]: &[f64; 2]| fraction / radius.powi(power);
        let all: f64 = species.iter().map(weight).sum();
        let by_number = species.iter().map(|one| match power {
            0 => *one,
            _ => [one[0], weight(one) / all],
        });
        let mut sorted: Vec<[f64; 2]> = by_number.collect();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        sorted.dedup_by(|next, first| {
            let is_same = next[0] == first[0];
            if is_same {
                first[1] += next[1];
            }
            is_same
        });
        if let [[small, _], [large, _]] = sorted[..]
            && large / small > MAX_SIZE_RATIO
        {
            return Err(refuse(
                format!("a size ratio of {}", large / small),
                "is out of range",
                format!("at most {MAX_SIZE_RATIO} of two sizes"),
            ));
        }
        Ok(Self(Kind::Species(sorted)))
    }

    /// A distribution with this standard deviation over its mean.
    ///
    /// # Errors
    /// A spread that is not positive.
    pub fn distribution(distribution: Distribution, spread: f64) -> Result<Self, Refusal> {
        if spread > 0.0 && spread.is_finite() {
            return Ok(Self(Kind::Distribution(distribution, spread)));
        }
        Err(refuse(
            spread.to_string(),
            "is out of range",
            "a spread above 0: the standard deviation of the radius over its mean",
        ))
    }

    /// Size ratio and fraction of large spheres of one or two sizes, which are equivalent to
    /// [`crate::Params::size_ratio`].
    pub fn to_two(&self) -> Option<[f64; 2]> {
        match &self.0 {
            Kind::Species(species) => match species[..] {
                [_] => Some([1.0, 0.5]),
                [[small, _], [large, fraction]] => Some([large / small, fraction]),
                _ => None,
            },
            Kind::Distribution(..) => None,
        }
    }

    /// Radii of N spheres, the largest first; their mean is 1.
    pub fn radii(&self, n: usize) -> Vec<f64> {
        let mut radii = self.unscaled_radii(n);
        let mean = radii.iter().sum::<f64>() / n as f64;
        for radius in &mut radii {
            *radius /= mean;
        }
        radii
    }

    /// Radii of N spheres in any unit, the largest first.
    fn unscaled_radii(&self, n: usize) -> Vec<f64> {
        let mut radii = match &self.0 {
            Kind::Species(species) => {
                let mut radii = Vec::with_capacity(n);
                let mut share = 0.0;
                for [radius, fraction] in species.iter().rev() {
                    share += fraction;
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a fraction of n, rounded"
                    )]
                    let count = (share * n as f64).round() as usize;
                    radii.resize(count.clamp(radii.len(), n), *radius);
                }
                radii.resize(n, species[0][0]);
                return radii;
            }
            Kind::Distribution(Distribution::Uniform, spread) => probabilities(n)
                .map(|p| 1.0 + 3.0_f64.sqrt() * spread * (2.0 * p - 1.0))
                .collect(),
            Kind::Distribution(Distribution::Lognormal, spread) => {
                let variance = (spread * spread).ln_1p();
                quantiles(n, |t| -0.5 * t * t / variance, variance.sqrt())
            }
            // In t = ln a the density is a^k exp(−k a), which is largest at t = 0.
            Kind::Distribution(Distribution::Schulz, spread) => {
                let shape = (spread * spread).recip();
                quantiles(n, |t| shape * (t - t.exp_m1()), *spread)
            }
        };
        radii.reverse();
        radii
    }

    /// Refuses radii of N spheres that are too small or too large, and species without a sphere.
    pub(super) fn check(&self, n: usize) -> Result<(), Refusal> {
        if let Kind::Species(species) = &self.0 {
            let radii = self.unscaled_radii(n);
            let absent = |[radius, _]: &&[f64; 2]| !radii.contains(radius);
            if let Some([radius, fraction]) = species.iter().find(absent) {
                return Err(no_sphere(
                    n,
                    &format!("radius {radius}"),
                    *fraction,
                    "sizes",
                ));
            }
        }
        let radii = self.radii(n);
        let (Some(largest), Some(smallest)) = (radii.first(), radii.last()) else {
            return Ok(());
        };
        if *smallest >= LEAST && *largest <= MOST {
            return Ok(());
        }
        let remedy = match self.0 {
            Kind::Distribution(..) => "a smaller spread",
            Kind::Species(_) => "sizes nearer to each other",
        };
        Err(refuse(
            self.to_string(),
            &format!("makes radii from {smallest:.3} to {largest:.3} of the mean radius"),
            format!("{remedy}: radii from {LEAST} to {MOST} of the mean"),
        ))
    }
}

/// The probabilities assigned to spheres.
fn probabilities(n: usize) -> impl Iterator<Item = f64> {
    (0..n).map(move |k| (k as f64 + 0.5) / n as f64)
}

/// Quantiles of e^t, increasing, where t has this density.
///
/// # Arguments
/// - `logarithm`: of the density, up to a constant: concave, largest at 0 and 0 there; it falls off
///   within some `width`s.
fn quantiles(n: usize, logarithm: impl Fn(f64) -> f64, width: f64) -> Vec<f64> {
    const CELLS: usize = 4096;
    let end = |step: f64| {
        let mut t = step;
        while logarithm(t) > -40.0 {
            t += step;
        }
        t
    };
    let (first, last) = (end(-width), end(width));
    let h = (last - first) / CELLS as f64;
    let density = |t: f64| logarithm(t).exp();
    // Simpson's rule, exact to 1e-12 with cells this narrow.
    let integral =
        |t: f64, h: f64| h / 6.0 * (density(t) + 4.0 * density(t + 0.5 * h) + density(t + h));
    let start = |cell: usize| first + h * cell as f64;
    let parts: Vec<f64> = (0..CELLS).map(|cell| integral(start(cell), h)).collect();
    let total: f64 = parts.iter().sum();
    let (mut cell, mut before) = (0, 0.0);
    probabilities(n)
        .map(|p| {
            while cell + 1 < CELLS && before + parts[cell] < p * total {
                before += parts[cell];
                cell += 1;
            }
            let wanted = p * total - before;
            let mut inside = h * (wanted / parts[cell]).clamp(0.0, 1.0);
            for _ in 0..4 {
                inside -= (integral(start(cell), inside) - wanted) / density(start(cell) + inside);
            }
            (start(cell) + inside).exp()
        })
        .collect()
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use crate::law::Keywords as _;
        match &self.0 {
            Kind::Distribution(distribution, spread) => {
                write!(f, "{} {spread}", distribution.word())
            }
            Kind::Species(species) => {
                for (place, [radius, fraction]) in species.iter().enumerate() {
                    let space = if place > 0 { " " } else { "" };
                    write!(f, "{space}{radius}:{fraction}")?;
                }
                Ok(())
            }
        }
    }
}

impl FromStr for Sizes {
    type Err = Refusal;

    fn from_str(text: &str) -> Result<Self, Refusal> {
        use crate::law::Keywords as _;
        let unread = || {
            refuse(
                format!("{text:?}"),
                "cannot be read",
                "a distribution and its spread, as \"lognormal 0.2\", or species, as \"1:0.5 1.4:0.25 2:0.25\"",
            )
        };
        let words = text.split_once(' ');
        if let Some((distribution, spread)) =
            words.and_then(|(word, spread)| Some((Distribution::of_word(word)?, spread)))
        {
            let spread = spread.parse().map_err(|_| unread())?;
            return Self::distribution(distribution, spread);
        }
        let read = |species: &str| {
            let (radius, fraction) = species.split_once(':')?;
            Some([radius.parse().ok()?, fraction.parse().ok()?])
        };
        let species: Option<Vec<[f64; 2]>> = text.split(' ').map(read).collect();
        Self::species(&species.ok_or_else(unread)?, 0)
    }
}

impl fmt::Debug for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl Serialize for Sizes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Sizes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse()
            .map_err(|refusal: Refusal| serde::de::Error::custom(refusal.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radii(text: &str, n: usize) -> Vec<f64> {
        text.parse::<Sizes>().unwrap().radii(n)
    }

    #[test]
    fn radii_have_the_mean_and_nearly_the_spread_of_their_distribution() {
        // Truncated tails of N spheres, a fraction that falls as 1/N.
        for (kind, lost) in [("lognormal", 0.02), ("schulz", 0.02), ("uniform", 1e-5)] {
            for spread in [0.02, 0.1, 0.2, 0.4] {
                let radii = radii(&format!("{kind} {spread}"), 400);
                let mean = radii.iter().sum::<f64>() / 400.0;
                let square = radii.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / 400.0;
                assert!((mean - 1.0).abs() < 1e-12);
                let found = square.sqrt() / spread;
                assert!(
                    (1.0 - lost..1.0 + 1e-3).contains(&found),
                    "{kind} {spread} {found}"
                );
                assert!(radii.is_sorted_by(|a, b| a >= b));
            }
        }
    }

    #[test]
    fn quantiles_are_those_of_their_distribution() {
        // Standard normal quantiles of 0.5, 0.9 and 0.975, and those of gamma distributions, by
        // published tables: χ² with 8 and 2 degrees of freedom over its mean.
        let lognormal = |z: f64| (z * 0.04_f64.ln_1p().sqrt()).exp();
        let variance = 0.04_f64.ln_1p();
        let found = |n: usize, k: usize, shape: f64| {
            let quantiles = quantiles(n, |t| shape * (t - t.exp_m1()), shape.sqrt().recip());
            quantiles[k]
        };
        let of_normal =
            |n: usize, k: usize| quantiles(n, |t| -0.5 * t * t / variance, variance.sqrt())[k];
        for (found, expected) in [
            (of_normal(1, 0), 1.0),
            (of_normal(5, 4), lognormal(1.281_551_565_545)),
            (of_normal(20, 19), lognormal(1.959_963_984_540)),
            (found(1, 0, 4.0), 7.344_121_497_701_2 / 8.0),
            (found(5, 4, 4.0), 13.361_566_136_511_7 / 8.0),
            (found(1, 0, 1.0), 2.0_f64.ln()),
            (found(10, 9, 1.0), 20.0_f64.ln()),
            (found(10, 0, 1.0), -0.95_f64.ln()),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
        }
    }

    #[test]
    fn species_have_their_shares_of_the_number() {
        let found = radii("1:0.5 1.4:0.25 2:0.25", 8);
        let mean = (4.0 + 2.0 * 1.4 + 2.0 * 2.0) / 8.0;
        let expected = [2.0, 2.0, 1.4, 1.4, 1.0, 1.0, 1.0, 1.0].map(|a| a / mean);
        assert_eq!(found[..], expected);
    }

    #[test]
    fn fractions_of_area_and_volume_become_fractions_of_number() {
        for power in [2, 3] {
            let kind = Sizes::species(&[[1.4, 0.5], [1.0, 0.5]], power).unwrap();
            let [ratio, large] = kind.to_two().unwrap();
            assert_eq!(ratio, 1.4);
            assert!((large - 1.0 / (1.0 + 1.4_f64.powi(power))).abs() < 1e-15);
        }
        // By number they keep their bits, in either order.
        let kind = Sizes::species(&[[1.4, 0.3], [1.0, 0.7]], 0).unwrap();
        assert_eq!(kind.to_two(), Some([1.4, 0.3]));
        let one = Sizes::species(&[[1.4, 0.3], [1.4, 0.7]], 0).unwrap();
        assert_eq!(one.to_two(), Some([1.0, 0.5]));
    }

    #[test]
    fn fractions_of_another_power_are_refused() {
        for power in [-2, 1, 4] {
            let refused = Sizes::species(&[[1.4, 0.5], [1.0, 0.5]], power).unwrap_err();
            assert!(refused.to_string().contains("3 of volume"), "{refused}");
        }
    }

    #[test]
    fn text_of_sizes_is_read_back_and_bad_sizes_are_refused() {
        for text in [
            "lognormal 0.2",
            "schulz 0.05",
            "uniform 0.46",
            "1:0.5 1.4:0.25 2:0.25",
        ] {
            let sizes: Sizes = text.parse().unwrap();
            assert_eq!(sizes.to_string(), text);
            assert!(sizes.check(400).is_ok());
            let json = serde_json::to_string(&sizes).unwrap();
            assert_eq!(serde_json::from_str::<Sizes>(&json).unwrap(), sizes);
        }
        for (text, problem) in [
            ("lognormal 0", "above 0"),
            ("lognormal x", "cannot be read"),
            ("gaussian 0.2", "cannot be read"),
            ("1:0.5 2:0.4 3:0.05", "a sum of 1"),
            ("1:0.5 -2:0.5", "radii above 0"),
            ("1:0.5 2:0", "fractions above 0"),
            ("1:0.5 11:0.5", "at most 10"),
            ("", "cannot be read"),
        ] {
            let refused = text.parse::<Sizes>().unwrap_err().to_string();
            assert!(refused.contains(problem), "{text}: {refused}");
        }
        for (text, problem) in [
            ("uniform 0.5", "a smaller spread"),
            ("lognormal 0.6", "a smaller spread"),
            ("1:0.1 8:0.4 9:0.5", "sizes nearer"),
        ] {
            let refused = text.parse::<Sizes>().unwrap().check(400).unwrap_err();
            assert!(refused.to_string().contains(problem), "{text}: {refused}");
        }
    }
}
