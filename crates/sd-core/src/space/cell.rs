//! The periodic cell of any space, or unbounded fluid.

pub use super::lattice::Lattice;

use super::lattice::wrapped;
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
    /// Images on a lattice.
    Periodic(Lattice<S>),
}

impl<S: Space> From<Lattice<S>> for Cell<S> {
    fn from(lattice: Lattice<S>) -> Self {
        Self::Periodic(lattice)
    }
}

impl<S: Space> Cell<S> {
    /// A sheared cell (Lees & Edwards 1972) with sides along flow, gradient and, in a suspension,
    /// vorticity, whose images above, in y, are shifted along x by the offset; any offset is
    /// wrapped into half a side.
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
        let offset = wrapped(offset, sides[0]);
        Ok(Self::Periodic(Lattice::sheared_cell(sides, offset, 0.0)))
    }

    /// The sheared cell with its images above also shifted along z; any offset is wrapped into half
    /// a side.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the offset is finite, and 0 in a layer, in unbounded fluid and
    /// in a lattice that is not a sheared cell.
    pub fn with_cross_offset(self, offset: f64) -> Result<Self, Error> {
        match self {
            Self::Periodic(lattice)
                if S::DIMENSIONS > 2 && lattice.is_sheared_cell() && offset.is_finite() =>
            {
                let mut sides = S::Vector::default();
                for (k, &length) in lattice.lengths().iter().enumerate() {
                    sides[k] = length;
                }
                let offset = wrapped(offset, sides[2]);
                let lattice = Lattice::sheared_cell(sides, lattice.offset(), offset);
                Ok(Self::Periodic(lattice))
            }
            _ if offset == 0.0 => Ok(self),
            _ => Err(Error::OutOfRange {
                field: "cross_offset",
                value: offset,
                allowed: "finite, and 0 except in periodic suspensions",
            }),
        }
    }

    /// A sheared cell with equal sides, see [`Cell::periodic`].
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub fn equal_sides(side: f64, offset: f64) -> Result<Self, Error> {
        let mut sides = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            sides[k] = side;
        }
        Self::periodic(sides, offset)
    }

    /// The cell with all lengths multiplied by a factor.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Unbounded => self,
            Self::Periodic(lattice) => Self::Periodic(lattice.scaled(factor)),
        }
    }

    /// The lattice of the images; `None` if unbounded.
    pub fn lattice(&self) -> Option<&Lattice<S>> {
        match self {
            Self::Unbounded => None,
            Self::Periodic(lattice) => Some(lattice),
        }
    }

    /// Area or volume, in a² or a³; `None` if unbounded.
    pub fn content(&self) -> Option<f64> {
        self.lattice().map(Lattice::content)
    }

    /// Shift of the images above along x, in a; 0 if unbounded.
    pub fn offset(&self) -> f64 {
        self.lattice().map_or(0.0, Lattice::offset)
    }

    /// Shift of the images above along z, in a; 0 if unbounded.
    pub fn cross_offset(&self) -> f64 {
        self.lattice().map_or(0.0, Lattice::cross_offset)
    }

    /// Position of an image relative to the original.
    pub fn image_vector(&self, image: S::Image) -> S::Vector {
        match self {
            Self::Unbounded => S::Vector::default(),
            Self::Periodic(lattice) => lattice.image_vector(image),
        }
    }

    /// Moves a separation to its nearest image, and returns that image; see [`Lattice::nearest`].
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
        match self {
            Self::Unbounded => (separation, S::Image::default()),
            Self::Periodic(lattice) => lattice.nearest(separation),
        }
    }

    /// Moves a position into the cell; see [`Lattice::wrap`].
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
        match self {
            Self::Unbounded => position,
            Self::Periodic(lattice) => lattice.wrap(position),
        }
    }

    /// Refuses a cell in which a sphere could have two images of one neighbour within a range, in
    /// s' = 2r/(a_i + a_j).
    ///
    /// # Errors
    /// [`Error::CellTooSmall`] names the side that is too short, [`Error::LatticeTooShort`] the
    /// shortest vector.
    pub fn check_range(&self, radii: &[f64], range: f64) -> Result<(), Error> {
        let Self::Periodic(lattice) = self else {
            return Ok(());
        };
        let needed = needed(radii, range);
        if !lattice.is_sheared_cell() {
            let shortest = 2.0 * lattice.reach();
            if shortest < needed {
                return Err(Error::LatticeTooShort { shortest, needed });
            }
            return Ok(());
        }
        for (direction, &side) in ['x', 'y', 'z'].into_iter().zip(lattice.lengths()) {
            if side < needed {
                return Err(Error::CellTooSmall {
                    direction,
                    side,
                    needed,
                });
            }
        }
        Ok(())
    }
}

/// The width of a cell in which no sphere has two images of one neighbour within a range.
pub(crate) fn needed(radii: &[f64], range: f64) -> f64 {
    let largest = radii.iter().copied().fold(0.0, f64::max);
    2.0 * range * largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Bulk;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn offset_is_wrapped() {
        let cell = Cell::<Layer>::periodic(Vector2::new(10.0, 10.0), 16.0).unwrap();
        assert!((cell.offset() + 4.0).abs() < 1e-12);
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
