//! The sheared periodic cell (Lees-Edwards) of any space, or unbounded fluid.

use super::{Layer, Space};
use crate::error::Error;

/// Pairs with `s' = 2r/(a_i + a_j)` below this get a near-field term in a periodic cell and in
/// clusters.
pub const LUBRICATION_RANGE: f64 = 4.0;

/// Names of the sides in errors.
const SIDES: [&str; 3] = ["cell[0]", "cell[1]", "cell[2]"];

/// Domain of the spheres: a periodic cell, or unbounded fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell<S: Space = Layer> {
    /// No images.
    Unbounded,
    /// Lattice vectors along the axes; the second one is shifted along x: `(length_x, 0)` and
    /// `(offset, length_y)` in a layer. Cross shear shifts that of a suspension along z too:
    /// `(offset, length_y, cross_offset)`.
    Periodic {
        /// Sides along flow, gradient and, in a suspension, vorticity, in a.
        sides: S::Vector,
        /// Shift of the images above in y along x, in `[-sides[0]/2, sides[0]/2)`, in a.
        offset: f64,
        /// Their shift along z, in `[-sides[2]/2, sides[2]/2)`, in a; 0 without cross shear.
        cross_offset: f64,
    },
}

impl<S: Space> Cell<S> {
    /// A periodic cell, without an offset along z; any offset is wrapped.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the sides are positive and finite and the offset is finite.
    ///
    /// ```
    /// use sd_core::Layer;
    /// use sd_core::cell::Cell;
    /// use sd_core::modes::Vec2;
    ///
    /// let cell = Cell::<Layer>::periodic(Vec2::new(10.0, 8.0), 0.0)?;
    /// assert_eq!(cell.content(), Some(80.0));
    /// assert!(Cell::<Layer>::periodic(Vec2::new(10.0, -8.0), 0.0).is_err());
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn periodic(sides: S::Vector, offset: f64) -> Result<Self, Error> {
        for (k, field) in SIDES.into_iter().enumerate().take(S::DIMENSIONS) {
            if !(sides[k] > 0.0 && sides[k].is_finite()) {
                return Err(Error::OutOfRange {
                    field,
                    value: sides[k],
                    allowed: "positive and finite",
                });
            }
        }
        if !offset.is_finite() {
            return Err(Error::OutOfRange {
                field: "offset",
                value: offset,
                allowed: "finite",
            });
        }
        Ok(Self::Periodic {
            sides,
            offset: wrapped(offset, sides[0]),
            cross_offset: 0.0,
        })
    }

    /// The same cell with its images above also shifted along z; any offset is wrapped.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the offset is finite, and 0 in a layer and in unbounded fluid.
    pub fn with_cross_offset(mut self, offset: f64) -> Result<Self, Error> {
        match &mut self {
            Self::Periodic {
                sides,
                cross_offset,
                ..
            } if S::DIMENSIONS > 2 && offset.is_finite() => {
                *cross_offset = wrapped(offset, sides[2]);
            }
            _ if offset == 0.0 => {}
            _ => {
                return Err(Error::OutOfRange {
                    field: "cross_offset",
                    value: offset,
                    allowed: "finite, and 0 except in periodic suspensions",
                });
            }
        }
        Ok(self)
    }

    /// As [`Cell::periodic`], with equal sides.
    ///
    /// # Errors
    /// As [`Cell::periodic`].
    pub fn equal_sides(side: f64, offset: f64) -> Result<Self, Error> {
        let mut sides = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            sides[k] = side;
        }
        Self::periodic(sides, offset)
    }

    /// Product of the sides, in a² or a³; `None` if unbounded.
    pub fn content(&self) -> Option<f64> {
        match self {
            Self::Unbounded => None,
            Self::Periodic { sides, .. } => Some((0..S::DIMENSIONS).map(|k| sides[k]).product()),
        }
    }

    /// Position of an image relative to the original.
    pub fn image_vector(&self, image: S::Image) -> S::Vector {
        let mut vector = S::Vector::default();
        if let Self::Periodic {
            sides,
            offset,
            cross_offset,
        } = self
        {
            for k in 0..S::DIMENSIONS {
                vector[k] = f64::from(image[k]) * sides[k];
            }
            vector[0] += f64::from(image[1]) * offset;
            if S::DIMENSIONS > 2 {
                vector[2] += f64::from(image[1]) * cross_offset;
            }
        }
        vector
    }

    /// Moves a separation to the image whose components are at most half the sides, and returns
    /// that image.
    ///
    /// Every vector shorter than half of every side is found this way.
    ///
    /// ```
    /// use sd_core::Layer;
    /// use sd_core::cell::Cell;
    /// use sd_core::modes::Vec2;
    ///
    /// let cell = Cell::<Layer>::periodic(Vec2::new(10.0, 8.0), 0.0)?;
    /// let (separation, _) = cell.nearest(Vec2::new(9.0, 1.0));
    /// assert_eq!(separation, Vec2::new(-1.0, 1.0));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    #[inline(always)]
    pub fn nearest(&self, separation: S::Vector) -> (S::Vector, S::Image) {
        let (mut vector, mut image) = (separation, S::Image::default());
        if let Self::Periodic {
            sides,
            offset,
            cross_offset,
        } = self
        {
            let mut shift = |vector: &mut S::Vector, k: usize| -> f64 {
                // The reciprocals are the same for all pairs of a list: one division each.
                let cells = -(vector[k] * sides[k].recip()).round_ties_even();
                #[expect(clippy::cast_possible_truncation, reason = "whole numbers of cells")]
                let whole = cells as i32;
                image[k] = whole;
                vector[k] += cells * sides[k];
                cells
            };
            let up = shift(&mut vector, 1);
            vector[0] += up * offset;
            if S::DIMENSIONS > 2 {
                vector[2] += up * cross_offset;
            }
            shift(&mut vector, 0);
            for k in 2..S::DIMENSIONS {
                shift(&mut vector, k);
            }
        }
        (vector, image)
    }

    /// Moves a position into the cell, `0 ≤ x < sides`.
    ///
    /// ```
    /// use sd_core::Layer;
    /// use sd_core::cell::Cell;
    /// use sd_core::modes::Vec2;
    ///
    /// // The images above are shifted by 3.
    /// let cell = Cell::<Layer>::periodic(Vec2::new(10.0, 8.0), 3.0)?;
    /// assert_eq!(cell.wrap(Vec2::new(5.0, 9.0)), Vec2::new(2.0, 1.0));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn wrap(&self, position: S::Vector) -> S::Vector {
        let mut wrapped = position;
        if let Self::Periodic {
            sides,
            offset,
            cross_offset,
        } = self
        {
            let up = (position[1] / sides[1]).floor();
            wrapped[0] -= up * offset;
            wrapped[1] -= up * sides[1];
            if S::DIMENSIONS > 2 {
                wrapped[2] -= up * cross_offset;
            }
            for k in (0..S::DIMENSIONS).filter(|&k| k != 1) {
                wrapped[k] -= sides[k] * (wrapped[k] / sides[k]).floor();
            }
        }
        wrapped
    }

    /// Refuses a cell in which a sphere could have two images of one neighbour within the
    /// lubrication range.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`] names the side that is too short.
    pub fn check_range(&self, radii: &[f64]) -> Result<(), Error> {
        self.check_reach(radii, LUBRICATION_RANGE)
    }

    /// The same within another range, in s'.
    pub(crate) fn check_reach(&self, radii: &[f64], range: f64) -> Result<(), Error> {
        let Self::Periodic { sides, .. } = self else {
            return Ok(());
        };
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let needed = 2.0 * range * largest;
        for (k, direction) in ['x', 'y', 'z'].into_iter().enumerate().take(S::DIMENSIONS) {
            if sides[k] < needed {
                return Err(Error::CellTooSmall {
                    direction,
                    side: sides[k],
                    needed,
                });
            }
        }
        Ok(())
    }
}

/// An offset within half a side.
fn wrapped(offset: f64, side: f64) -> f64 {
    offset - side * (offset / side + 0.5).floor()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Bulk;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn offset_is_wrapped() {
        let cell = Cell::<Layer>::periodic(Vector2::new(10.0, 10.0), 16.0).unwrap();
        let Cell::Periodic { offset, .. } = cell else {
            unreachable!()
        };
        assert!((offset + 4.0).abs() < 1e-12);
    }

    #[test]
    fn image_vector_undoes_nearest() {
        let plain = Cell::<Bulk>::periodic(Vector3::new(10.0, 12.0, 9.0), 3.0).unwrap();
        for cross in [0.0, 2.5, -4.4, 7.0] {
            let cell = plain.with_cross_offset(cross).unwrap();
            for k in 0..100 {
                let k = f64::from(k);
                let x = Vector3::new((1.7 * k).sin(), (0.9 * k).cos(), (2.3 * k).sin()) * 30.0;
                let (near, image) = cell.nearest(x);
                assert!((near - x - cell.image_vector(image)).norm() < 1e-12);
                assert!(near.x.abs() <= 5.0 && near.y.abs() <= 6.0 && near.z.abs() <= 4.5);
                let wrapped = cell.wrap(x);
                assert!((cell.nearest(wrapped - x).0).norm() < 1e-12);
                assert!((0..3).all(|k| (0.0..[10.0, 12.0, 9.0][k]).contains(&wrapped[k])));
            }
            let above = cell.image_vector([0, 1, 0]);
            let lattice = (above.z - cross) / 9.0;
            assert!((lattice - lattice.round()).abs() < 1e-12 && above.z.abs() <= 4.5);
        }
    }

    #[test]
    fn only_suspensions_have_images_shifted_along_z() {
        let layer = Cell::<Layer>::periodic(Vector2::new(10.0, 10.0), 1.0).unwrap();
        assert_eq!(layer.with_cross_offset(0.0).unwrap(), layer);
        assert!(layer.with_cross_offset(1.0).is_err());
        assert!(Cell::<Bulk>::Unbounded.with_cross_offset(1.0).is_err());
        let cell = Cell::<Bulk>::equal_sides(10.0, 1.0).unwrap();
        assert!(cell.with_cross_offset(f64::NAN).is_err());
    }
}
