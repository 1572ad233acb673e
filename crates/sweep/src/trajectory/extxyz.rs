//! Frames as extended XYZ, which OVITO and ASE read.

use super::{Kept, by_space};
use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use crate::model::spaces::AnyFrame;
use crate::text::format::count;
use sd_core::Params;
use sd_core::simulation::Frame;
use std::fmt::Write as _;
use std::io::{self, Write};

/// The run of the frames.
#[derive(Debug, Clone)]
pub(crate) struct FrameSource {
    /// Its parameters.
    pub params: Params,
    /// Its seed.
    pub seed: u64,
    /// Its key.
    pub key: String,
}

/// Writes frames, each with its step, as extended XYZ: the sheared cell and the run, then one line
/// per sphere.
///
/// The layer lies at z = 0 in a cell two radii high that is not periodic in z. Orientations are
/// quaternions about z. Spheres of the smallest radius are of the species S, larger ones of the
/// species L. A suspension fills a cell that is periodic along z too. Velocities are means over the
/// strain to the next frame, for the last frame over that from the one before; a single frame has
/// none.
pub(crate) fn write_extxyz(
    frames: &[(u64, &AnyFrame)],
    filmed: &FrameSource,
    out: &mut dyn Write,
) -> io::Result<()> {
    let (layers, suspensions) = by_space(frames);
    write_frames(&layers, filmed, out)?;
    write_frames(&suspensions, filmed, out)
}

fn write_frames<S: Kept>(
    frames: &[(u64, &Frame<S>)],
    filmed: &FrameSource,
    out: &mut dyn Write,
) -> io::Result<()> {
    let about = about(filmed);
    for (place, (step, frame)) in frames.iter().enumerate() {
        let pair = match (frames.get(place + 1), place.checked_sub(1)) {
            (Some((_, next)), _) => Some([*frame, *next]),
            (None, Some(before)) => Some([frames[before].1, *frame]),
            (None, None) => None,
        };
        let velocities = pair.map(|[from, to]| {
            let net = |frame: &Frame<S>| {
                let params = &filmed.params;
                params.net_strain(count(frame.strain / params.time_step) as u64)
            };
            let sheared = if filmed.params.segments.is_empty() {
                to.strain - from.strain
            } else {
                net(to) - net(from)
            };
            move |sphere| velocity(from, to, sheared, sphere)
        });
        write_frame(frame, *step, velocities.as_ref(), &about, out)?;
    }
    Ok(())
}

/// The run in the format of the comment: `area_fraction=0.7 friction=0.5 … seed=1 key=3f…`.
fn about(filmed: &FrameSource) -> String {
    let mut words = String::new();
    let meant = |axis: &&Axis| axis.means_something(&filmed.params);
    for axis in AXES.iter().filter(meant) {
        let value = match axis.value(&filmed.params) {
            Value::Word(word) => format!("\"{word}\""),
            value => value.to_string(),
        };
        let _ = write!(words, " {}={value}", axis.key);
    }
    let _ = write!(words, " seed={} key=\"{}\"", filmed.seed, filmed.key);
    words
}

fn write_frame<S: Kept>(
    frame: &Frame<S>,
    step: u64,
    velocity_of: Option<&impl Fn(usize) -> [f64; 3]>,
    about: &str,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut touching = vec![0_u32; frame.centres.len()];
    for contact in &frame.contacts {
        touching[contact.i] += 1;
        touching[contact.j] += 1;
    }
    let is_layer = S::DIMENSIONS == 2;
    let (side, offset, cross_offset) = (frame.side, frame.offset, frame.cross_offset);
    let (height, bottom) = if is_layer {
        let height = 2.0 * frame.radii.iter().copied().fold(1.0, f64::max);
        (height, -0.5 * height)
    } else {
        (side, 0.0)
    };
    let angle = if is_layer { ":angle:R:1" } else { "" };
    let smallest = frame.radii.iter().copied().fold(f64::INFINITY, f64::min);
    let velocities = if velocity_of.is_some() {
        ":velo:R:3"
    } else {
        ""
    };
    writeln!(out, "{}", frame.centres.len())?;
    writeln!(
        out,
        "Lattice=\"{side} 0 0 {offset} {side} {cross_offset} 0 0 {height}\" Origin=\"0 0 {bottom}\" \
         Properties=species:S:1:pos:R:3:id:I:1:radius:R:1:orientation:R:4{angle}:stresslet:R:{}:contacts:I:1{velocities} \
         pbc=\"T T {}\" strain={} step={step}{about}",
        S::STRAINS,
        if is_layer { "F" } else { "T" },
        frame.strain,
    )?;
    for (number, centre) in frame.centres.iter().enumerate() {
        let radius = frame.radii[number];
        let species = if radius > smallest { 'L' } else { 'S' };
        write!(out, "{species}")?;
        write_all(&in_space(centre.as_ref()), out)?;
        write!(out, " {} {radius}", number + 1)?;
        match S::orientation(&frame.orientations[number]) {
            &[w, x, y, z] => write_all(&[x, y, z, w], out)?,
            angles => {
                for angle in angles {
                    let (sine, cosine) = (0.5 * angle).sin_cos();
                    write_all(&[0.0, 0.0, sine, cosine, *angle], out)?;
                }
            }
        }
        write_all(frame.stresslets[number].as_ref(), out)?;
        write!(out, " {}", touching[number])?;
        if let Some(velocity_of) = velocity_of {
            write_all(&velocity_of(number), out)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes numbers, a space before each.
fn write_all(numbers: &[f64], out: &mut dyn Write) -> io::Result<()> {
    numbers
        .iter()
        .try_for_each(|number| write!(out, " {number}"))
}

/// A point of a layer is at z = 0.
fn in_space(point: &[f64]) -> [f64; 3] {
    [point[0], point[1], point.get(2).copied().unwrap_or(0.0)]
}

/// The mean velocity of a sphere between two frames, in a·rate, while the cell was sheared by a
/// strain.
///
/// A sphere that left the cell re-entered as one of its images; the images in the later frame
/// determine its path, since they move with the flow.
fn velocity<S: Kept>(from: &Frame<S>, to: &Frame<S>, sheared: f64, sphere: usize) -> [f64; 3] {
    let time = to.strain - from.strain;
    let [x, y, z] = in_space(from.centres[sphere].as_ref());
    let [end_x, end_y, end_z] = in_space(to.centres[sphere].as_ref());
    let side = to.side;
    // The position after advection by the flow.
    let carried = sheared * y;
    let rows = ((end_y - y) / side).round();
    let rise = end_y - y - rows * side;
    let along = end_x - x - carried - rows * to.offset;
    let along = along - (along / side).round() * side + carried;
    // Cross strains are known up to whole cells.
    let crossed = (to.cross_offset - from.cross_offset) / side;
    let carried = (crossed - crossed.round()) * y;
    let across = end_z - z - carried - rows * to.cross_offset;
    let across = across - (across / side).round() * side + carried;
    [along / time, rise / time, across / time]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{frame, params, suspension};

    fn lines(frames: &[(u64, &AnyFrame)]) -> Vec<String> {
        let filmed = FrameSource {
            params: params(),
            seed: 7,
            key: "3f9a".into(),
        };
        let mut text = Vec::new();
        write_extxyz(frames, &filmed, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn the_comment_has_the_sheared_cell_and_the_run() {
        let lines = lines(&[(25, &frame())]);
        assert_eq!((lines[0].as_str(), lines.len()), ("2", 4));
        assert!(lines[1].starts_with("Lattice=\"8 0 0 -2 8 0 0 0 3\""));
        for part in [
            "strain=0.5 step=25",
            "area_fraction=0.693",
            "friction=0.3",
            "roughness=0.01",
            "shear_rate=inf",
            "contact=\"rigid\"",
            "seed=7 key=\"3f9a\"",
        ] {
            assert!(lines[1].contains(part), "{part} is not in {}", lines[1]);
        }
        assert_eq!(lines[2], "S 1 2 0 1 1 0 0 0 1 0 1 -1 20.5 1");
        assert!(lines[3].starts_with("L 3.5 2 0 2 1.5 "), "{}", lines[3]);
    }

    /// A sphere that moves with the flow has its velocity, over the edges of the cell too.
    #[test]
    fn velocities_go_over_the_edges_of_the_cell() {
        let (side, time) = (8.0, 0.5);
        let at = |strain: f64, centres: Vec<[f64; 2]>| -> Frame {
            Frame {
                strain,
                side,
                offset: 0.25 + side * strain,
                orientations: vec![0.0; centres.len()],
                radii: vec![1.0; centres.len()],
                stresslets: vec![[0.0; 3]; centres.len()],
                centres,
                ..Frame::default()
            }
        };
        let from = at(0.0, vec![[7.0, 6.0], [3.0, 7.9], [1.0, 0.05]]);
        let offset = 0.25 + side * time;
        // The second goes up through the edge, the third down, both with a quarter beyond the flow.
        let to = at(
            time,
            vec![
                [7.0 + 6.0 * time - side, 6.0],
                [3.0 + 7.9 * time + 0.25 * time - offset, 0.1],
                [1.0 + 0.05 * time + offset, 7.85],
            ],
        );
        let wanted = [[6.0, 0.0], [8.15, 0.4], [0.05, -0.4]];
        for (sphere, wanted) in wanted.into_iter().enumerate() {
            let found = velocity(&from, &to, time, sphere);
            for (a, b) in found.into_iter().zip(wanted) {
                assert!((a - b).abs() < 1e-12, "{sphere}: {found:?}");
            }
        }
    }

    #[test]
    fn suspensions_have_three_coordinates_and_quaternions_in_a_cell_periodic_along_z() {
        let (first, second) = (
            suspension(0.5, [1.0, 2.0, 7.9]),
            suspension(1.0, [2.25, 2.5, 0.4]),
        );
        let lines = lines(&[(25, &first), (50, &second)]);
        assert!(
            lines[1].starts_with("Lattice=\"8 0 0 -2 8 0 0 0 8\" Origin=\"0 0 0\""),
            "{}",
            lines[1]
        );
        assert!(
            lines[1].contains("orientation:R:4:stresslet:R:5:"),
            "{}",
            lines[1]
        );
        assert!(lines[1].contains("pbc=\"T T T\""), "{}", lines[1]);
        // Half a strain at y = 2 carries it by 1; OVITO's order of a quaternion is x y z w.
        let wanted = [
            1.0, 2.0, 7.9, 1.0, 1.0, 0.0, 0.6, 0.0, 0.8, 1.0, -1.0, 20.5, 0.25, -0.5, 1.0, 2.5,
            1.0, 1.0,
        ];
        let found: Vec<f64> = lines[2]
            .split(' ')
            .skip(1)
            .map(|cell| cell.parse().unwrap())
            .collect();
        assert_eq!(found.len(), wanted.len(), "{}", lines[2]);
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-12, "{}", lines[2]);
        }
    }
}
