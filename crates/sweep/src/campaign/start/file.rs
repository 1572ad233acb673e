//! Start layers read from files: the last frame of an extended XYZ file, or JSON in the format of
//! `sweep solve`.

use crate::system::files::read_text;
use sd_core::model::StartLayer;
use serde::Deserialize;
use std::path::Path;

/// Largest file of a layer, in bytes.
const SIZE_LIMIT: u64 = 1 << 30;
/// Relative difference allowed between the sides of a square cell: files have single precision.
const SQUARE: f64 = 1e-5;

/// Reads a layer.
///
/// # Errors
/// The fault of the file and the expected format.
pub(super) fn read(path: &Path) -> Result<StartLayer, [String; 2]> {
    let fault = |problem: String| {
        if path.extension().is_some_and(|ending| ending == "sqlite") {
            return [
                format!("{} is a store, and no layer", path.display()),
                "name one of its points: `start = { store = \"FILE\", point = { KEY = VALUE, .. } }`".to_owned(),
            ];
        }
        [
            format!("the start layer {} {problem}", path.display()),
            "the last frame of an extended XYZ file as `sweep export` writes it, or JSON with `centres`, `radii`, `cell` and `offset` as \
             `sweep solve` reads it"
                .to_owned(),
        ]
    };
    let unreadable = |error: std::io::Error| fault(format!("cannot be read: {error}"));
    let text = read_text(path, SIZE_LIMIT).map_err(unreadable)?;
    let layer = if text.trim_start().starts_with('{') {
        from_json(&text)
    } else {
        last_frame(&text).and_then(|frame| out_of_frame(&frame))
    };
    layer.map_err(fault)
}

/// A layer as JSON; other keys of `sweep solve` are ignored.
#[derive(Deserialize)]
struct LayerFile {
    centres: Vec<[f64; 2]>,
    radii: Option<Vec<f64>>,
    cell: [f64; 2],
    #[serde(default)]
    offset: f64,
    orientations: Option<Vec<f64>>,
}

fn from_json(text: &str) -> Result<StartLayer, String> {
    // Excerpts of a file that is something else stay private.
    let layer: LayerFile = serde_json::from_str(text).map_err(|error| {
        let words = error.to_string();
        if words.starts_with("missing field") {
            format!("is not a layer: {words}")
        } else {
            let (line, column) = (error.line(), error.column());
            format!("is not a layer: see line {line}, column {column}")
        }
    })?;
    let n = layer.centres.len();
    Ok(StartLayer {
        side: square(layer.cell)?,
        offset: layer.offset,
        radii: layer.radii.unwrap_or_else(|| vec![1.0; n]),
        orientations: layer.orientations.unwrap_or_else(|| vec![0.0; n]),
        centres: layer.centres,
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        origin: None,
    })
}

/// The side of a square cell.
fn square([x, y]: [f64; 2]) -> Result<f64, String> {
    if x > 0.0 && (x - y).abs() <= SQUARE * x {
        Ok(x)
    } else {
        Err(format!(
            "has a cell of sides {x} and {y}, which is not square"
        ))
    }
}

/// One frame of an extended XYZ file.
struct Frame<'t> {
    comment: &'t str,
    /// Lines of spheres, each with its number in the file, from 1.
    spheres: Vec<(usize, &'t str)>,
}

/// The last frame of a file.
fn last_frame(text: &str) -> Result<Frame<'_>, String> {
    let mut lines = (1..).zip(text.lines());
    let mut last = None;
    while let Some((line, count)) = lines.next() {
        if count.trim().is_empty() {
            continue;
        }
        let n: usize = count
            .trim()
            .parse()
            .map_err(|_| format!("is no XYZ file: line {line} has no number of spheres"))?;
        let comment = lines.next().map_or("", |(_, comment)| comment);
        let spheres: Vec<(usize, &str)> = lines.by_ref().take(n).collect();
        if spheres.len() < n {
            return Err(format!("ends after {} of {n} spheres", spheres.len()));
        }
        last = Some(Frame { comment, spheres });
    }
    last.ok_or_else(|| "is empty".to_owned())
}

/// The value of a key in the second line of a frame.
fn value<'t>(comment: &'t str, key: &str) -> Option<&'t str> {
    let mut rest = comment;
    while let Some((before, after)) = rest.split_once('=') {
        let name = before.rsplit(char::is_whitespace).next().unwrap_or(before);
        let (value, next) = match after.strip_prefix('"') {
            Some(quoted) => quoted.split_once('"')?,
            None => after.split_once(char::is_whitespace).unwrap_or((after, "")),
        };
        if name.eq_ignore_ascii_case(key) {
            return Some(value);
        }
        rest = next;
    }
    None
}

/// Columns of a frame: the name and the first column of each property, and how many columns there
/// are. `species:S:1:pos:R:3` has `pos` in columns 1 to 3 of 4.
fn columns(properties: &str) -> Option<(Vec<(&str, usize)>, usize)> {
    let parts: Vec<&str> = properties.split(':').collect();
    let mut all = Vec::new();
    let mut number = 0_usize;
    for property in parts.chunks(3) {
        let [name, _, count] = property else {
            return None;
        };
        all.push((*name, number));
        number = number.checked_add(count.parse().ok()?)?;
    }
    Some((all, number))
}

fn out_of_frame(frame: &Frame<'_>) -> Result<StartLayer, String> {
    let lattice = value(frame.comment, "Lattice").ok_or("has no `Lattice` in its second line")?;
    let lattice: Vec<f64> = lattice
        .split_whitespace()
        .map(|number| number.parse().unwrap_or(f64::NAN))
        .collect();
    let [x, 0.0, 0.0, offset, y, 0.0, ..] = lattice[..] else {
        return Err("has a `Lattice` that is not a layer sheared along x".into());
    };
    let properties =
        value(frame.comment, "Properties").ok_or("has no `Properties` in its second line")?;
    let (columns, number_of_columns) = columns(properties)
        .ok_or("has `Properties` that are no list of names, kinds and numbers of columns")?;
    let column = |name: &str| {
        let of_name = columns.iter().find(|column| column.0 == name);
        of_name.map(|column| column.1)
    };
    let place =
        |name: &str| column(name).ok_or_else(|| format!("has no `{name}` in its `Properties`"));
    let (position, radius) = (place("pos")?, place("radius")?);
    let angle = column("angle");
    let mut layer = StartLayer {
        side: square([x, y])?,
        offset,
        radii: Vec::new(),
        centres: Vec::new(),
        orientations: Vec::new(),
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        origin: None,
    };
    for (line, sphere) in &frame.spheres {
        let cells: Vec<&str> = sphere.split_whitespace().collect();
        if cells.len() != number_of_columns {
            let found = cells.len();
            return Err(format!(
                "has {found} columns in line {line}, where its `Properties` have {number_of_columns}"
            ));
        }
        let number = |column: usize| -> Result<f64, String> {
            let cell = cells.get(column).copied().unwrap_or("");
            let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| format!("has no number in column {} of line {line}", column + 1))
        };
        layer
            .centres
            .push([number(position)?, number(position + 1)?]);
        layer.radii.push(number(radius)?);
        layer.orientations.push(match angle {
            Some(column) => number(column)?,
            None => 0.0,
        });
    }
    Ok(layer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::spaces::{AnyFrame, InSpace};
    use crate::trajectory::{FrameSource, write_extxyz};
    use sd_core::simulation::Frame as Kept;

    fn kept(shift: f64) -> Kept {
        Kept {
            strain: 0.5,
            side: 8.0,
            offset: -2.0,
            radii: vec![1.0, 1.5],
            centres: vec![[1.0 + shift, 2.0], [3.5, 2.0]],
            unwrapped: vec![[1.0 + shift, 2.0], [3.5, 2.0]],
            velocities: vec![[2.0, 0.0], [2.0, 0.0]],
            angular_velocities: vec![-0.5, -0.5],
            orientations: vec![0.0, -0.25],
            stresslets: vec![[1.0, -1.0, 20.5], [0.0, 0.5, 19.0]],
            ..Kept::default()
        }
    }

    fn read_text(name: &str, text: &str) -> Result<StartLayer, [String; 2]> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path)
    }

    fn export(frames: &[Kept], text: &mut Vec<u8>) {
        let frames: Vec<InSpace<Kept, _>> = frames.iter().cloned().map(InSpace::Layer).collect();
        let filmed = FrameSource {
            params: crate::test_support::params(),
            seed: 1,
            key: "3f9a".into(),
        };
        let frames: Vec<(u64, &AnyFrame)> = frames.iter().map(|frame| (1, frame)).collect();
        write_extxyz(&frames, &filmed, text).unwrap();
    }

    #[test]
    fn last_frame_of_an_export_comes_back() {
        let mut text = Vec::new();
        export(&[kept(0.5), kept(0.0)], &mut text);
        let layer = read_text("layer.xyz", std::str::from_utf8(&text).unwrap()).unwrap();
        let kept = kept(0.0);
        assert_eq!(layer.side, kept.side);
        assert_eq!(layer.offset, kept.offset);
        assert_eq!(layer.radii, kept.radii);
        assert_eq!(layer.centres, kept.centres);
        assert_eq!(layer.orientations, kept.orientations);
        let json = r#"{"centres": [[1, 2], [3.5, 2]], "radii": [1, 1.5], "cell": [8, 8], "offset": -2,
                       "orientations": [0, -0.25], "hydrodynamics": "ball-melrose"}"#;
        assert_eq!(read_text("layer.json", json).unwrap(), layer);
    }

    #[test]
    fn files_that_are_not_layers_are_explained() {
        let mut text = Vec::new();
        export(&[kept(0.0)], &mut text);
        let good = String::from_utf8(text).unwrap();
        for (bad, part) in [
            (String::new(), "is empty"),
            ("name = 3".into(), "no number of spheres"),
            (
                good.replace("\n2\n", "\n").replacen('2', "9", 1),
                "ends after 2 of 9 spheres",
            ),
            (good.replace("Lattice", "Latice"), "no `Lattice`"),
            (good.replace("8 0 0 -2 8", "8 0 0 -2 9"), "not square"),
            (
                good.replace("8 0 0 -2 8", "8 1 0 -2 8"),
                "not a layer sheared along x",
            ),
            (good.replace("radius:R:1", "size:R:1"), "no `radius`"),
            (
                good.replace("He 3.5", "He wide"),
                "no number in column 2 of line 4",
            ),
            (
                good.replace("He 3.5", "He nan"),
                "no number in column 2 of line 4",
            ),
            (
                good.trim_end().rsplit_once(' ').unwrap().0.into(),
                "columns in line 4, where its `Properties` have",
            ),
            (good.replace("pos:R:3", "pos:R"), "`Properties` that are no"),
            ("{\"centres\": 3}".into(), "is not a layer"),
        ] {
            let [message, allowed] = read_text("layer.xyz", &bad).unwrap_err();
            assert!(message.contains(part), "{part}: {message}");
            assert!(allowed.contains("sweep export"));
        }
        let [message, _] = read(Path::new("nowhere.xyz")).unwrap_err();
        assert!(message.contains("cannot be read"), "{message}");
    }
}
