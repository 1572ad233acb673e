//! Frames as extended XYZ, which OVITO and ASE read.

use super::{Kept, by_space};
use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use crate::model::spaces::AnyFrame;
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

/// Writes frames, each with its step, as extended XYZ: the periodic cell and the run, then one line
/// per sphere.
///
/// The layer lies at z = 0 in a cell two radii high that is not periodic in z. Orientations are
/// quaternions about z. Species are symbols of elements, as ASE reads no others: H is a sphere of
/// the smallest radius, He a larger one. A suspension fills a cell that is periodic along z too.
/// Velocities (`velo`) and angular velocities include the background flow at the centre in the
/// cell, `pos`; `unwrapped` are positions followed from the start of the run over the edges of the
/// cell. Spheres are numbered from 0, as in tables.
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
    for (step, frame) in frames {
        write_frame(frame, *step, &about, out)?;
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
    about: &str,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut touching = vec![0_u32; frame.centres.len()];
    for contact in &frame.contacts {
        touching[contact.i] += 1;
        touching[contact.j] += 1;
    }
    let is_layer = S::DIMENSIONS == 2;
    let vectors = frame.lattice();
    let mut numbers: Vec<f64> = vectors.iter().flat_map(|a| in_space(a.as_ref())).collect();
    let mut bottom = 0.0;
    if is_layer {
        let height = 2.0 * frame.radii.iter().copied().fold(1.0, f64::max);
        numbers.extend([0.0, 0.0, height]);
        bottom = -0.5 * height;
    }
    let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
    let angle = if is_layer { ":angle:R:1" } else { "" };
    let smallest = frame.radii.iter().copied().fold(f64::INFINITY, f64::min);
    writeln!(out, "{}", frame.centres.len())?;
    writeln!(
        out,
        "Lattice=\"{}\" Origin=\"0 0 {bottom}\" \
         Properties=species:S:1:pos:R:3:id:I:1:radius:R:1:orientation:R:4{angle}:stresslet:R:{}:contacts:I:1\
         :velo:R:3:angular_velocity:R:3:unwrapped:R:3 pbc=\"T T {}\" strain={} step={step}{about}",
        numbers.join(" "),
        S::STRAINS,
        if is_layer { "F" } else { "T" },
        frame.strain,
    )?;
    for (number, centre) in frame.centres.iter().enumerate() {
        let radius = frame.radii[number];
        let species = if radius > smallest { "He" } else { "H" };
        write!(out, "{species}")?;
        write_all(&in_space(centre.as_ref()), out)?;
        write!(out, " {number} {radius}")?;
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
        write_all(&in_space(frame.velocities[number].as_ref()), out)?;
        match S::spin(&frame.angular_velocities[number]) {
            [about_z] => write_all(&[0.0, 0.0, *about_z], out)?,
            spin => write_all(spin, out)?,
        }
        write_all(&in_space(frame.unwrapped[number].as_ref()), out)?;
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
pub(super) fn in_space(point: &[f64]) -> [f64; 3] {
    [point[0], point[1], point.get(2).copied().unwrap_or(0.0)]
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
        assert!(
            lines[1].contains(
                ":contacts:I:1:velo:R:3:angular_velocity:R:3:unwrapped:R:3 pbc=\"T T F\""
            ),
            "{}",
            lines[1]
        );
        assert_eq!(
            lines[2],
            "H 1 2 0 0 1 0 0 0 1 0 1 -1 20.5 1 2.5 0.25 0 0 0 -0.5 9 2 0"
        );
        // Of two sizes, both have a symbol that ASE knows.
        assert!(lines[3].starts_with("He 3.5 2 0 1 1.5 "), "{}", lines[3]);
    }

    #[test]
    fn suspensions_have_three_coordinates_and_quaternions_in_a_cell_periodic_along_z() {
        let lines = lines(&[(25, &suspension(0.5, [1.0, 2.0, 7.9]))]);
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
        // OVITO's order of a quaternion is x y z w.
        let wanted = [
            1.0, 2.0, 7.9, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 1.0, -1.0, 20.5, 0.25, -0.5, 1.0, 2.5,
            0.25, 1.0, 0.5, 0.0, -0.25, 9.0, 2.0, 7.9,
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
