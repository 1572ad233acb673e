//! Profiles along gradient and vorticity: velocity along the flow, and fraction of the spheres.

use sd_core::Space;
use sd_core::simulation::Frame;
use std::f64::consts::PI;

/// Rows into which a side of the cell is divided.
const ROWS: usize = 20;

/// Area or volume of a cell of this side.
fn content<S: Space>(side: f64) -> f64 {
    side.powi(if S::DIMENSIONS == 2 { 2 } else { 3 })
}

/// Middles of the rows of a cell of this side, in a.
pub(super) fn middles(side: f64) -> Vec<f64> {
    let each = (0..ROWS).map(|row| (row as f64 + 0.5) / ROWS as f64 * side);
    each.collect()
}

/// Sums over the frames of a run, by rows of the cell across one axis.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    /// The axis along which it is: 1 for the gradient, 2 for the vorticity.
    axis: usize,
    /// Mean side of the cell, in a.
    pub(super) side: f64,
    /// Side of the first frame, in a.
    first: f64,
    frames: f64,
    /// Spheres with their centres in each row, the sum of their velocities, and of their areas or
    /// volumes in a cell scaled to the side of the first frame.
    rows: [[f64; 3]; ROWS],
    /// Area or volume of a row of the first frame.
    content: f64,
}

impl Profile {
    /// An empty profile along an axis of cells, the first of this side.
    pub(super) fn new<S: Space>(axis: usize, side: f64) -> Self {
        Self {
            axis,
            side,
            first: side,
            frames: 0.0,
            rows: [[0.0; 3]; ROWS],
            content: content::<S>(side) / ROWS as f64,
        }
    }

    /// Adds a frame; `direction` is the sense of its shear.
    pub(super) fn add<S: Space>(&mut self, frame: &Frame<S>, direction: f64) {
        self.frames += 1.0;
        // A running mean, which equal sides do not change.
        self.side += (frame.side - self.side) / self.frames;
        let scale = content::<S>(self.first / frame.side);
        let spheres = frame.centres.iter().zip(&frame.velocities);
        for ((x, u), &radius) in spheres.zip(&frame.radii) {
            let place = (x[self.axis] / frame.side).rem_euclid(1.0);
            let row = crate::text::format::count((place * ROWS as f64).floor()).min(ROWS - 1);
            // The velocity in the row of the cell, of which the sphere may be an image.
            let carried = if self.axis == 1 {
                place * frame.side
            } else {
                0.0
            };
            let velocity = u[0] + direction * (carried - x[1]);
            let sphere = if S::DIMENSIONS == 2 {
                PI * radius * radius
            } else {
                4.0 / 3.0 * PI * radius.powi(3)
            };
            for (sum, value) in self.rows[row]
                .iter_mut()
                .zip([1.0, velocity, sphere * scale])
            {
                *sum += value;
            }
        }
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
        let (y, velocity, fraction) = (
            middles(profile.side),
            profile.velocity(),
            profile.fraction(),
        );
        assert_eq!((y[4], y[15]), (2.25, 7.75));
        assert!((velocity[4] - 2.5).abs() < 1e-12 && (velocity[15] - 8.0).abs() < 1e-12);
        assert!(velocity[0].is_nan());
        let one = PI * 0.25 / (side * 0.5);
        assert!((fraction[4] - 3.0 * one).abs() < 1e-12);
        assert!((fraction[15] - 6.0 * one).abs() < 1e-12 && fraction[0] == 0.0);
        let mean = fraction.iter().sum::<f64>() / fraction.len() as f64;
        assert!((mean - 9.0 * PI * 0.25 / 100.0).abs() < 1e-12);
    }

    #[test]
    fn in_a_cell_that_changes_the_profile_has_the_mean_fraction_and_the_flow_of_the_mean_cell() {
        let sides = [10.0, 12.0, 17.0];
        let mut profile = Profile::new::<Layer>(1, sides[0]);
        let mut wanted = 0.0;
        for side in sides {
            // A sphere in the middle of each row, carried along, some of them seen by their images.
            let heights = middles(side).into_iter().zip(0..);
            let heights: Vec<f64> = heights.map(|(y, k)| y + side * f64::from(k % 3)).collect();
            let frame = Frame::<Layer> {
                side,
                radii: vec![0.5; ROWS],
                centres: heights.iter().map(|y| [1.0, *y]).collect(),
                velocities: heights.iter().map(|y| [*y, 0.0]).collect(),
                ..Frame::default()
            };
            profile.add(&frame, 1.0);
            wanted += ROWS as f64 * PI * 0.25 / (side * side) / 3.0;
        }
        assert!((profile.side - 13.0).abs() < 1e-12);
        for fraction in profile.fraction() {
            assert!(
                (fraction - wanted).abs() < 1e-12,
                "{fraction} and not {wanted}"
            );
        }
        for (velocity, y) in profile.velocity().into_iter().zip(middles(profile.side)) {
            assert!((velocity - y).abs() < 1e-12, "{velocity} at {y}");
        }
    }
}
