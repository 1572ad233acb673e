//! Structure for programs: JSON, and tables of numbers and of curves.

use super::{Count, StructureReport};
use crate::data::DataColumn;
use crate::data::{Kind, Value};
use crate::model::axes::AXES;
use crate::report::columns::point_row;
use crate::structure::{Band, Curve, NAMED, Structure};
use sd_core::Params;
use serde_json::{Map, Value as Json, json};

/// A curve of a structure, with its name and the names of both axes.
type NamedCurve<'s> = (&'static str, &'static str, &'static str, &'s Curve);

impl StructureReport {
    /// The object for programs, a stable interface.
    pub fn json(&self) -> Json {
        let points = self.points.iter().map(|(place, structure)| {
            let mut object = point_row(&self.report.points[*place]);
            fill(&mut object, structure);
            Json::Object(object)
        });
        json!({ "campaign": self.report.campaign, "points": points.collect::<Vec<_>>() })
    }

    /// One row per point: all axes, then numbers and their intervals.
    pub fn table(&self) -> Vec<DataColumn> {
        let mut table: Vec<DataColumn> =
            AXES.iter().map(|axis| axis.column(self.params())).collect();
        let counts: [Count; 2] = [
            ("runs", "runs averaged", |s| s.runs),
            ("frames", "their frames together", |s| s.frames),
        ];
        for (name, meaning, count) in counts {
            let cells = self.points.iter().map(|(_, s)| Value::Count(count(s)));
            table.push(DataColumn::of(name, Kind::Count, meaning, cells.map(Some)));
        }
        let all: Vec<Vec<Number>> = self.points.iter().map(|(_, s)| numbers(s)).collect();
        for (place, (name, meaning, _)) in all[0].iter().enumerate() {
            let mut add = |name: String, meaning, of: fn(Band) -> Option<f64>| {
                let cells = all.iter().map(|point| of(point[place].2?));
                let cells = cells.map(|number| number.map(Value::Number));
                table.push(DataColumn::of(name, Kind::Number, meaning, cells));
            };
            add(name.clone(), meaning, |band| Some(band.mean));
            let half = "half width of its 95 % Student interval over runs";
            add(format!("{name}_ci95"), half, |band| band.ci95);
        }
        table
    }

    /// All curves, one row per bin of each curve of each point: the axes that vary, the name, the
    /// centre of the bin, the mean and half its interval. g(r, θ) has both distance and angle.
    pub fn curves(&self) -> Vec<DataColumn> {
        let mut rows: Vec<(&Params, &'static str, [Option<f64>; 4])> = Vec::new();
        for (params, (_, structure)) in self.params().zip(&self.points) {
            for (name, _, _, curve) in curves(structure) {
                for (x, band) in curve.x.iter().zip(&curve.y) {
                    let half = band.and_then(|band| band.ci95);
                    let cells = [Some(*x), None, band.map(|band| band.mean), half];
                    rows.push((params, name, cells));
                }
            }
            let (distances, angles, of_angles) = &structure.with_angle;
            for (r, row) in distances.iter().zip(of_angles) {
                for (angle, g) in angles.iter().zip(row) {
                    let cells = [Some(*r), Some(*angle), Some(*g), None];
                    rows.push((params, "g_r_theta", cells));
                }
            }
        }
        let axes = self.axes().into_iter();
        let mut table: Vec<DataColumn> = axes
            .map(|axis| axis.column(rows.iter().map(|row| row.0)))
            .collect();
        let names = rows.iter().map(|row| Some(Value::Word(row.1)));
        table.push(DataColumn {
            unit: "",
            ..DataColumn::of("quantity", Kind::Word, "which curve", names)
        });
        let about = [
            (
                "x",
                "middle of a bin: r in a, angle in radians, force over its mean, or spheres of a cluster",
            ),
            (
                "angle",
                "of g_r_theta: from the flow towards the gradient, in radians",
            ),
            ("value", "mean over runs"),
            (
                "value_ci95",
                "half width of its 95 % Student interval over runs",
            ),
        ];
        for (place, (name, meaning)) in about.into_iter().enumerate() {
            let cells = rows.iter().map(|row| row.2[place].map(Value::Number));
            table.push(DataColumn::of(name, Kind::Number, meaning, cells));
        }
        table
    }
}

/// A number of a structure that tables have: name, meaning, value.
type Number = (String, &'static str, Option<Band>);

/// All of them.
fn numbers(structure: &Structure) -> Vec<Number> {
    let scalars = NAMED.iter().zip(&structure.scalars);
    let mut all: Vec<Number> = scalars
        .map(|(scalar, band)| (scalar.name.to_owned(), scalar.meaning(), *band))
        .collect();
    for (name, row, column) in [("xx", 0, 0), ("xy", 0, 1), ("yy", 1, 1)] {
        let rows = structure.fabric.get(row);
        let band = rows.and_then(|row| row.get(column).copied().flatten());
        let meaning = "n n averaged over contacts";
        all.push((format!("fabric_{name}"), meaning, band));
    }
    all.push((
        "fabric_deviator".into(),
        "deviation of the fabric from that of isotropic contacts",
        structure.fabric_deviator,
    ));
    all
}

fn curves(structure: &Structure) -> [NamedCurve<'_>; 6] {
    [
        ("g_r", "r", "g", &structure.radial),
        (
            "contact_angle",
            "theta",
            "probability",
            &structure.contact_angle,
        ),
        (
            "force_angle",
            "theta",
            "force_weighted",
            &structure.force_angle,
        ),
        ("normal_force", "f", "density", &structure.normal_force),
        (
            "tangential_force",
            "f",
            "density",
            &structure.tangential_force,
        ),
        ("cluster_size", "size", "share", &structure.cluster_size),
    ]
}

/// Adds all results of a point to an object.
fn fill(object: &mut Map<String, Json>, structure: &Structure) {
    let mean = |band: &Option<Band>| band.map(|band| band.mean);
    let half = |band: &Option<Band>| band.and_then(|band| band.ci95);
    object.insert("runs".into(), structure.runs.into());
    object.insert("frames".into(), structure.frames.into());
    for (name, x, y, curve) in curves(structure) {
        // Both weights of the contact angle are in one object.
        let name = if name == "force_angle" {
            "contact_angle"
        } else {
            name
        };
        let entry = object.entry(name).or_insert_with(|| json!({}));
        entry[x] = json!(curve.x);
        entry[y] = curve.y.iter().map(mean).collect();
        entry[format!("{y}_ci95")] = curve.y.iter().map(half).collect();
    }
    let (r, theta, g) = &structure.with_angle;
    object.insert("g_r_theta".into(), json!({"r": r, "theta": theta, "g": g}));
    let tensor = |of: fn(&Option<Band>) -> Option<f64>| -> Json {
        let rows = structure.fabric.iter();
        rows.map(|row| row.iter().map(of).collect::<Json>())
            .collect()
    };
    object.insert("fabric".into(), tensor(|band| band.map(|band| band.mean)));
    object.insert(
        "fabric_ci95".into(),
        tensor(|band| band.and_then(|band| band.ci95)),
    );
    let mut put = |name: &str, band: &Option<Band>| {
        object.insert(name.into(), json!(mean(band)));
        object.insert(format!("{name}_ci95"), json!(half(band)));
    };
    put("fabric_deviator", &structure.fabric_deviator);
    for (scalar, band) in NAMED.iter().zip(&structure.scalars) {
        put(scalar.name, band);
    }
}
