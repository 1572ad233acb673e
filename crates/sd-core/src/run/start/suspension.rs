//! Start suspensions: random, without contact, up to a volume fraction of 0.60 for equal spheres
//! and 0.62 for sizes 1 : 1.4.

use super::packing::{Density, Packing};
use super::radii;
use crate::error::Error;
use crate::model::{Params, Sizes};
use crate::space::Bulk;
use crate::space::cell::Cell;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Packing limits of spheres.
const SPHERES: Density = Density {
    easy: 0.55,
    closest: 0.740_480_489_693_061, // π/√18
    shakes: 10,
    balanced: 1e-4,
};

/// The spheres of a suspension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixture {
    /// Their number.
    pub spheres: usize,
    /// Volume fraction.
    pub volume_fraction: f64,
    /// Roughness height h: the smallest gap, in a.
    pub roughness: f64,
    /// Radius of the large ones over that of the small ones, at least 1.
    pub size_ratio: f64,
    /// Number fraction of large spheres.
    pub large_fraction: f64,
    /// Sizes other than one or two, which override these.
    pub sizes: Option<Sizes>,
}

/// Radii, centres and cell of a suspension at strain 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspension {
    /// Radii, in a; their mean is 1.
    pub radii: Vec<f64>,
    /// Centres, in a, inside the cell.
    pub centres: Vec<Vector3<f64>>,
    /// Side of the cubic cell, in a.
    pub side: f64,
}

impl Mixture {
    /// The spheres of a run with these parameters.
    pub(in crate::run) fn of(params: &Params) -> Self {
        Self {
            spheres: params.spheres,
            volume_fraction: params.volume_fraction.unwrap_or(0.0),
            roughness: params.roughness,
            size_ratio: params.size_ratio,
            large_fraction: params.large_fraction,
            sizes: params.sizes,
        }
    }

    /// Radii and cell side, without packing.
    pub(in crate::run) fn radii_and_side(&self) -> Result<(Vec<f64>, f64), Error> {
        let large = if self.size_ratio == 1.0 {
            0
        } else {
            self.number_of_large()
        };
        let radii = match self.sizes {
            Some(sizes) => sizes.radii(self.spheres).to_vec(),
            None => radii(self.spheres, self.size_ratio, large),
        };
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        let side = (volume / self.volume_fraction).cbrt();
        Cell::<Bulk>::equal_sides(side, 0.0)?.check_range(&radii)?;
        Ok((radii, side))
    }

    /// Number of large spheres.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a fraction of n, rounded"
    )]
    fn number_of_large(&self) -> usize {
        (self.large_fraction * self.spheres as f64).round() as usize
    }

    /// Refuses values out of range, without packing.
    fn check(&self) -> Result<(), Error> {
        if self.spheres == 0 {
            return Err(Error::NoSpheres);
        }
        let growth = (1.0 + 0.5 * self.roughness).powi(3);
        for (field, value, is_allowed, allowed) in [
            (
                "roughness",
                self.roughness,
                (0.0..0.5).contains(&self.roughness),
                "0 to below 0.5",
            ),
            (
                "size_ratio",
                self.size_ratio,
                (1.0..=10.0).contains(&self.size_ratio),
                "1 to 10",
            ),
            (
                "large_fraction",
                self.large_fraction,
                (0.0..=1.0).contains(&self.large_fraction),
                "0 to 1",
            ),
            (
                "volume_fraction",
                self.volume_fraction,
                self.volume_fraction > 0.0 && self.volume_fraction * growth <= SPHERES.closest,
                "above 0 and, with the roughness around the spheres, at most 0.7405, that of the densest lattice",
            ),
        ] {
            if !is_allowed {
                return Err(Error::OutOfRange {
                    field,
                    value,
                    allowed,
                });
            }
        }
        Ok(())
    }

    /// Makes the suspension, which depends only on the mixture and the seed.
    ///
    /// # Errors
    /// [`Error::NoSpheres`], [`Error::OutOfRange`], [`Error::CellTooSmall`], or
    /// [`Error::CannotPack`] with the volume fraction reached.
    pub fn suspension(&self, seed: u64) -> Result<Suspension, Error> {
        self.check()?;
        let (radii, side) = self.radii_and_side()?;
        let cell = Cell::equal_sides(side, 0.0)?;
        let mut packing = Packing::<Bulk>::new(cell, radii, self.roughness);
        packing
            .pack(self.volume_fraction, &SPHERES, seed)
            .map_err(|reached| Error::CannotPack {
                spheres: self.spheres,
                kind: "volume",
                fraction: self.volume_fraction,
                gap: self.roughness,
                reached,
                advice: "random spheres, with the roughness around them, fill at most about 0.64: lower the volume fraction or the roughness, or use two sizes",
            })?;
        packing.number_by_rows(self.sizes);
        Ok(Suspension {
            radii: packing.radii,
            centres: packing.centres,
            side,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::neighbours::NeighbourList;

    const MIXTURE: Mixture = Mixture {
        spheres: 200,
        volume_fraction: 0.45,
        roughness: 0.01,
        size_ratio: 1.0,
        large_fraction: 0.5,
        sizes: None,
    };

    /// Smallest gap between any two images, by brute force.
    fn smallest_gap(suspension: &Suspension, offset: f64) -> f64 {
        let Suspension {
            radii,
            centres,
            side,
        } = suspension;
        let cell = Cell::<Bulk>::equal_sides(*side, offset).unwrap();
        let mut smallest = f64::INFINITY;
        for (i, x) in centres.iter().enumerate() {
            for (j, y) in centres.iter().enumerate().skip(i + 1) {
                for image in 0..45 {
                    let image = [image % 5 - 2, image / 5 % 3 - 1, image / 15 - 1];
                    let distance = (y + cell.image_vector(image) - x).norm();
                    smallest = smallest.min(distance - radii[i] - radii[j]);
                }
            }
        }
        smallest
    }

    #[test]
    fn no_pair_starts_in_contact_up_to_dense_suspensions() {
        for (volume_fraction, size_ratio, roughness) in [
            (0.05, 1.0, 0.01),
            (0.45, 1.0, 0.05),
            (0.60, 1.0, 0.01),
            (0.62, 1.4, 0.01),
        ] {
            let mixture = Mixture {
                volume_fraction,
                roughness,
                size_ratio,
                ..MIXTURE
            };
            let suspension = mixture.suspension(1).unwrap();
            let gap = smallest_gap(&suspension, 0.0);
            assert!(gap >= roughness, "{mixture:?}: {gap}");
            let radii = &suspension.radii;
            let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
            assert!((volume / suspension.side.powi(3) / volume_fraction - 1.0).abs() < 1e-12);
            assert!((radii.iter().sum::<f64>() / radii.len() as f64 - 1.0).abs() < 1e-12);
            assert_eq!(radii[0] / radii[199], size_ratio);
            let inside = |x: f64| (0.0..suspension.side).contains(&x);
            assert!(suspension.centres.iter().flatten().all(|&x| inside(x)));
        }
    }

    #[test]
    fn spheres_are_packed_into_sheared_cells_too() {
        let radii = radii(150, 1.4, 75);
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        let side = (volume / 0.55).cbrt();
        let cell = Cell::equal_sides(side, 0.37 * side).unwrap();
        let mut packing = Packing::<Bulk>::new(cell, radii, 0.01);
        packing.pack(0.55, &SPHERES, 3).unwrap();
        let suspension = Suspension {
            radii: packing.radii,
            centres: packing.centres,
            side,
        };
        assert!(smallest_gap(&suspension, 0.37 * side) >= 0.01);
        // In another cell the same centres overlap.
        assert!(smallest_gap(&suspension, 0.0) < 0.0);
    }

    #[test]
    fn neighbours_in_a_suspension_are_near_in_memory() {
        let suspension = MIXTURE.suspension(2).unwrap();
        let cell = Cell::<Bulk>::equal_sides(suspension.side, 0.0).unwrap();
        let mut list = NeighbourList::default();
        list.find(&cell, &suspension.centres, &suspension.radii, 2.5);
        let distance: usize = list.pairs().iter().map(|pair| pair.j - pair.i).sum();
        let mean = distance as f64 / list.pairs().len() as f64;
        // Numbers at random are a third of 200 apart.
        assert!(mean < 50.0, "{mean}");
    }

    #[test]
    fn suspension_is_a_function_of_the_seed() {
        assert_eq!(MIXTURE.suspension(7), MIXTURE.suspension(7));
        assert_ne!(MIXTURE.suspension(7), MIXTURE.suspension(8));
    }

    #[test]
    fn suspensions_too_dense_or_too_small_are_refused() {
        let refusal = |mixture: Mixture| mixture.suspension(1).unwrap_err();
        let dense = |volume_fraction| Mixture {
            volume_fraction,
            ..MIXTURE
        };
        assert!(matches!(refusal(dense(0.75)), Error::OutOfRange { .. }));
        let Error::CannotPack { reached, kind, .. } = refusal(dense(0.70)) else {
            panic!("packed");
        };
        assert!(
            kind == "volume" && reached > 0.5 && reached < 0.70,
            "{reached}"
        );
        let few = Mixture {
            spheres: 30,
            ..dense(0.5)
        };
        assert!(matches!(refusal(few), Error::CellTooSmall { .. }));
        let smooth = Mixture {
            size_ratio: f64::NAN,
            ..MIXTURE
        };
        assert!(matches!(
            refusal(smooth),
            Error::OutOfRange {
                field: "size_ratio",
                ..
            }
        ));
    }
}
