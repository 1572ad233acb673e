//! Profiles along gradient and vorticity: velocity along the flow, and fraction of the spheres.

use sd_core::Space;
use sd_core::simulation::Frame;
use std::f64::consts::PI;

/// Rows into which a side of the cell is divided.
const ROWS: usize = 20;

/// Sums over the frames of a run, by rows of the cell across one axis.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    /// The axis along which it is: 1 for the gradient, 2 for the vorticity.
    axis: usize,
    side: f64,
    frames: f64,
    /// Spheres with their centres in each row, the sum of their velocities, and of their areas or
    /// volumes.
    rows: [[f64; 3]; ROWS],
    /// Area or volume of a row.
    content: f64,
}

impl Profile {
    /// An empty profile along an axis of cells of this side.
    pub(super) fn new<S: Space>(axis: usize, side: f64) -> Self {
        let dimensions = if S::DIMENSIONS == 2 { 2 } else { 3 };
        Self {
            axis,
            side,
            frames: 0.0,
            rows: [[0.0; 3]; ROWS],
            content: side.powi(dimensions) / ROWS as f64,
        }
    }

    /// Adds a frame; `direction` is the sense of its shear.
    pub(super) fn add<S: Space>(&mut self, frame: &Frame<S>, direction: f64) {
        self.frames += 1.0;
        let spheres = frame.centres.iter().zip(&frame.velocities);
        for ((x, u), &radius) in spheres.zip(&frame.radii) {
            let place = (x[self.axis] / self.side).rem_euclid(1.0);
            let row = crate::text::format::count((place * ROWS as f64).floor()).min(ROWS - 1);
            // The velocity in the row of the cell, of which the sphere may be an image.
            let carried = if self.axis == 1 {
                place * self.side
            } else {
                0.0
            };
            let velocity = u[0] + direction * (carried - x[1]);
            let content = if S::DIMENSIONS == 2 {
                PI * radius * radius
            } else {
                4.0 / 3.0 * PI * radius.powi(3)
            };
            for (sum, value) in self.rows[row].iter_mut().zip([1.0, velocity, content]) {
                *sum += value;
            }
        }
    }

    /// Middles of the rows, in a.
    pub(super) fn middles(&self) -> Vec<f64> {
        let each = (0..ROWS).map(|row| (row as f64 + 0.5) / ROWS as f64 * self.side);
        each.collect()
    }

    /// Mean velocity of the spheres in each row, along the gradient with the linear profile, along
    /// the vorticity without it; NaN in rows without spheres.
    pub(super) fn velocity(&self) -> Vec<f64> {
        let means = self.rows.iter().map(|[number, sum, _]| sum / number);
        means.collect()
    }

    /// Local fraction, by the centres of the spheres.
    pub(super) fn fraction(&self) -> Vec<f64> {
        let sums = self.rows.iter().map(|[.., content]| content);
        sums.map(|sum| sum / (self.frames * self.content)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::Layer;

    #[test]
    fn profiles_are_those_put_in() {
        let side = 10.0;
        // Two rows of spheres, of which one is seen by its image below, and twice as many above.
        let heights = [2.25, 2.25, 2.25 - side, 7.75, 7.75, 7.75, 7.75, 7.75, 7.75];
        let frame = Frame::<Layer> {
            side,
            radii: vec![0.5; 9],
            centres: heights.iter().map(|y| [1.0, *y]).collect(),
            velocities: heights.iter().map(|y| [y + 0.25, 0.0]).collect(),
            ..Frame::default()
        };
        let mut profile = Profile::new::<Layer>(1, side);
        profile.add(&frame, 1.0);
        profile.add(&frame, 1.0);
        let (y, velocity, fraction) = (profile.middles(), profile.velocity(), profile.fraction());
        assert_eq!((y[4], y[15]), (2.25, 7.75));
        assert!((velocity[4] - 2.5).abs() < 1e-12 && (velocity[15] - 8.0).abs() < 1e-12);
        assert!(velocity[0].is_nan());
        let one = PI * 0.25 / (side * 0.5);
        assert!((fraction[4] - 3.0 * one).abs() < 1e-12);
        assert!((fraction[15] - 6.0 * one).abs() < 1e-12 && fraction[0] == 0.0);
        let mean = fraction.iter().sum::<f64>() / fraction.len() as f64;
        assert!((mean - 9.0 * PI * 0.25 / 100.0).abs() < 1e-12);
    }
}
