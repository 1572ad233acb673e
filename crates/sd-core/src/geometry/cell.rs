//! The sheared periodic cell (Lees-Edwards) with its images, or unbounded fluid.

use crate::error::Error;
use crate::geometry::modes::Vec2;

/// Pairs with `s' = 2r/(a_i + a_j)` below this get a near-field term in a periodic cell and in clusters.
pub const LUBRICATION_RANGE: f64 = 4.0;

/// Where the spheres are: a doubly periodic layer or unbounded fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// No images.
    Unbounded,
    /// Lattice vectors `(length_x, 0)` and `(offset, length_y)`.
    Periodic {
        /// Side along the flow, in a.
        length_x: f64,
        /// Side along the gradient, in a.
        length_y: f64,
        /// Shift of the image above, in `[-length_x/2, length_x/2)`.
        offset: f64,
    },
}

impl Cell {
    /// A periodic cell; any offset is wrapped.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the sides are positive and finite and the offset is finite.
    pub fn periodic(length_x: f64, length_y: f64, offset: f64) -> Result<Self, Error> {
        for (field, value) in [("cell[0]", length_x), ("cell[1]", length_y)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::OutOfRange {
                    field,
                    value,
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
            length_x,
            length_y,
            offset: offset - length_x * (offset / length_x + 0.5).floor(),
        })
    }

    /// Area, in a²; `None` if unbounded.
    pub fn area(&self) -> Option<f64> {
        match *self {
            Self::Unbounded => None,
            Self::Periodic {
                length_x, length_y, ..
            } => Some(length_x * length_y),
        }
    }

    /// Position of image `[m, n]` relative to the original.
    pub fn image_vector(&self, image: [i32; 2]) -> Vec2 {
        match *self {
            Self::Unbounded => Vec2::zeros(),
            Self::Periodic {
                length_x,
                length_y,
                offset,
            } => {
                let (m, n) = (f64::from(image[0]), f64::from(image[1]));
                Vec2::new(m * length_x + n * offset, n * length_y)
            }
        }
    }

    /// Moves a separation to the image with `|y| ≤ length_y/2`, `|x| ≤ length_x/2`, and says which it is.
    ///
    /// Every vector shorter than half of either side is found this way.
    #[inline(always)]
    pub fn nearest(&self, separation: Vec2) -> (Vec2, [i32; 2]) {
        match *self {
            Self::Unbounded => (separation, [0, 0]),
            Self::Periodic {
                length_x,
                length_y,
                offset,
            } => {
                // The reciprocals are the same for all pairs of a list: one division each.
                let (per_x, per_y) = (length_x.recip(), length_y.recip());
                let n = -(separation.y * per_y).round_ties_even();
                let x = separation.x + n * offset;
                let m = -(x * per_x).round_ties_even();
                #[expect(clippy::cast_possible_truncation, reason = "whole numbers of cells")]
                let image = [m as i32, n as i32];
                (
                    Vec2::new(x + m * length_x, separation.y + n * length_y),
                    image,
                )
            }
        }
    }

    /// Moves a position into `0 ≤ y < length_y`, `0 ≤ x < length_x`.
    pub fn wrap(&self, position: Vec2) -> Vec2 {
        match *self {
            Self::Unbounded => position,
            Self::Periodic {
                length_x,
                length_y,
                offset,
            } => {
                let n = (position.y / length_y).floor();
                let x = position.x - n * offset;
                Vec2::new(
                    x - length_x * (x / length_x).floor(),
                    position.y - n * length_y,
                )
            }
        }
    }

    /// Refuses a cell in which a sphere could meet two images of one neighbour within the lubrication range.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`] names the side that is too short.
    pub fn check_range(&self, radii: &[f64]) -> Result<(), Error> {
        if let Self::Periodic {
            length_x, length_y, ..
        } = *self
        {
            let largest = radii.iter().copied().fold(0.0, f64::max);
            let needed = 2.0 * LUBRICATION_RANGE * largest;
            for (direction, side) in [('x', length_x), ('y', length_y)] {
                if side < needed {
                    return Err(Error::CellTooSmall {
                        direction,
                        side,
                        needed,
                    });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_is_wrapped() {
        let Cell::Periodic { offset, .. } = Cell::periodic(10.0, 10.0, 16.0).unwrap() else {
            unreachable!()
        };
        assert!((offset + 4.0).abs() < 1e-12);
    }

    #[test]
    fn image_vector_undoes_nearest() {
        let cell = Cell::periodic(10.0, 12.0, 3.0).unwrap();
        let d = Vec2::new(17.0, -20.0);
        let (near, image) = cell.nearest(d);
        assert!((near - d - cell.image_vector(image)).norm() < 1e-12);
    }
}
