//! Two spheres alone: resistance functions at any separation and size ratio.

mod near_contact;
mod series;

use crate::error::Error;

/// Smallest size ratio; the largest is its inverse.
pub const SMALLEST_SIZE_RATIO: f64 = 0.01;

/// The resistance functions of the planar problem, each `[11, 12]`, dimensionless.
///
/// Scaled as Kim & Karrila do: A by `6π mu a_1`, B and G by `4π mu a_1²`, C and H by `8π mu a_1³`, M by
/// `(20/3)π mu a_1³`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scalars {
    /// Force along the line of centres from velocity along it.
    pub x_a: [f64; 2],
    /// Force across from velocity across.
    pub y_a: [f64; 2],
    /// Torque from velocity across.
    pub y_b: [f64; 2],
    /// Torque from angular velocity.
    pub y_c: [f64; 2],
    /// Axial stresslet from velocity along.
    pub x_g: [f64; 2],
    /// Shear stresslet from velocity across.
    pub y_g: [f64; 2],
    /// Shear stresslet from angular velocity.
    pub y_h: [f64; 2],
    /// Axial stresslet from axial strain.
    pub x_m: [f64; 2],
    /// Shear stresslet from shear strain.
    pub y_m: [f64; 2],
    /// Transverse stresslet from transverse strain.
    pub z_m: [f64; 2],
}

impl Scalars {
    /// In the order of the fields.
    pub(crate) fn to_array(self) -> [f64; 20] {
        let mut all = [0.0; 20];
        for (to, from) in all.chunks_exact_mut(2).zip([
            self.x_a, self.y_a, self.y_b, self.y_c, self.x_g, self.y_g, self.y_h, self.x_m, self.y_m, self.z_m,
        ]) {
            to.copy_from_slice(&from);
        }
        all
    }

    /// From the order of the fields.
    pub(crate) fn from_array(all: &[f64; 20]) -> Self {
        let at = |k: usize| [all[2 * k], all[2 * k + 1]];
        Self {
            x_a: at(0),
            y_a: at(1),
            y_b: at(2),
            y_c: at(3),
            x_g: at(4),
            y_g: at(5),
            y_h: at(6),
            x_m: at(7),
            y_m: at(8),
            z_m: at(9),
        }
    }
}

/// The size ratio as ≥ 1, and whether it was inverted.
fn ordered(size_ratio: f64) -> (f64, bool) {
    if size_ratio < 1.0 {
        (1.0 / size_ratio, true)
    } else {
        (size_ratio, false)
    }
}

/// The resistance functions of two spheres in unbounded fluid.
pub fn scalars(size_ratio: f64, s_prime: f64) -> Result<Scalars, Error> {
    Ok(series::solve(size_ratio, s_prime - 2.0, 1.0)[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    impl Scalars {
        fn named(&self) -> [(&'static str, [f64; 2]); 10] {
            [
                ("XA", self.x_a), ("YA", self.y_a), ("YB", self.y_b), ("YC", self.y_c), ("XG", self.x_g),
                ("YG", self.y_g), ("YH", self.y_h), ("XM", self.x_m), ("YM", self.y_m), ("ZM", self.z_m),
            ]
        }
    }

    #[test]
    fn reference() {
        let cases: Vec<serde_json::Value> =
            serde_json::from_str(include_str!("../../../tests/data/two_sphere_scalars.json")).unwrap();
        for case in &cases {
            let (l, s) = (case["size_ratio"].as_f64().unwrap(), case["s_prime"].as_f64().unwrap());
            if s < 2.0005 {continue;}
            let t = std::time::Instant::now();
            let found = scalars(l, s).unwrap();
            let dt = t.elapsed();
            let mut worst: (f64, String) = (0.0, String::new());
            for (name, v) in found.named() {
                for k in 0..2 {
                    let r = case[name][k].as_f64().unwrap();
                    let e = ((v[k] - r) / r).abs();
                    if e > worst.0 { worst = (e, format!("{name}{k} {} {r}", v[k])); }
                }
            }
            println!("{l} {s} {dt:?} {worst:?}");
        }
    }
}
