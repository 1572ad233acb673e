//! Structure for programs: JSON, and tables of numbers and of curves.

use super::{Count, StructureReport};
use crate::axes::{AXES, Kind, Value};
use crate::data::{Cells, DataColumn};
use crate::report::columns::point_row;
use crate::structure::{Band, Curve, NAMED, Structure};
use sd_core::Params;
use serde_json::{Map, Value as Json, json};

/// A curve of a structure, with its names: of the whole, of its axis, of its heights.
type NamedCurve<'s> = (&'static str, &'static str, &'static str, &'s Curve);

impl StructureReport {
    /// The object for programs; its names are a promise.
    pub fn json(&self) -> Json {
        let points = self.points.iter().map(|(place, structure)| {
            let mut object = point_row(&self.report.points[*place]);
            fill(&mut object, structure);
            Json::Object(object)
        });
        json!({ "campaign": self.report.campaign, "points": points.collect::<Vec<_>>() })
    }

    /// A row for each point: all axes, then numbers and their intervals.
    pub fn table(&self) -> Vec<DataColumn> {
        let rows = self.points.len();
        let mut table: Vec<DataColumn> = AXES
            .iter()
            .map(|axis| {
                let mut column = DataColumn::named(axis.key, axis.kind(), rows);
                column.unit = axis.unit;
                column.meaning = axis.meaning;
                for params in self.params() {
                    column.cells.push(Some(axis.value(params)));
                }
                column
            })
            .collect();
        let counts: [Count; 2] = [
            ("runs", "runs averaged", |structure| structure.runs),
            ("frames", "their frames together", |structure| {
                structure.frames
            }),
        ];
        for (name, meaning, count) in counts {
            let mut column = DataColumn::named(name, Kind::Count, rows);
            column.meaning = meaning;
            column.unit = "1";
            for (_, structure) in &self.points {
                column.cells.push(Some(Value::Count(count(structure))));
            }
            table.push(column);
        }
        for (name, meaning, number) in numbers() {
            let mut means = DataColumn::named("", Kind::Number, rows);
            let mut halves = DataColumn::named("", Kind::Number, rows);
            for (_, structure) in &self.points {
                let band = number(structure);
                means.cells.push(band.map(|band| Value::Number(band.mean)));
                let half = band.and_then(|band| band.ci95);
                halves.cells.push(half.map(Value::Number));
            }
            halves.name = format!("{name}_ci95").into();
            halves.meaning = "half width of its 95 % Student interval over runs";
            means.name = name.into();
            means.meaning = meaning;
            for column in [&mut means, &mut halves] {
                column.unit = "1";
            }
            table.extend([means, halves]);
        }
        table
    }

    /// All curves, a row for each bin of each curve of each point: the axes that vary, what it is, the middle of the bin, the mean and half
    /// its interval. g(r, θ) has its angles beside its distances.
    pub fn curves(&self) -> Vec<DataColumn> {
        let axes = self.axes();
        let mut of_axes: Vec<Cells> = axes
            .iter()
            .map(|axis| Cells::with_capacity(axis.kind(), 0))
            .collect();
        let mut words = Cells::with_capacity(Kind::Word, 0);
        let mut columns = [(); 4].map(|()| Cells::with_capacity(Kind::Number, 0));
        let number = Value::Number;
        let mut add = |params: &Params, name, cells: [Option<f64>; 4]| {
            for (column, axis) in of_axes.iter_mut().zip(&axes) {
                column.push(Some(axis.value(params)));
            }
            words.push(Some(Value::Word(name)));
            for (column, cell) in columns.iter_mut().zip(cells) {
                column.push(cell.map(number));
            }
        };
        for (params, (_, structure)) in self.params().zip(&self.points) {
            for (name, _, _, curve) in curves(structure) {
                for (x, band) in curve.x.iter().zip(&curve.y) {
                    let half = band.and_then(|band| band.ci95);
                    add(params, name, [Some(*x), None, band.map(|b| b.mean), half]);
                }
            }
            let (distances, angles, rows) = &structure.with_angle;
            for (r, row) in distances.iter().zip(rows) {
                for (angle, g) in angles.iter().zip(row) {
                    add(
                        params,
                        "g_r_theta",
                        [Some(*r), Some(*angle), Some(*g), None],
                    );
                }
            }
        }
        let mut table: Vec<DataColumn> = axes
            .iter()
            .zip(of_axes)
            .map(|(axis, cells)| DataColumn {
                unit: axis.unit,
                meaning: axis.meaning,
                cells,
                ..DataColumn::named(axis.key, axis.kind(), 0)
            })
            .collect();
        table.push(DataColumn {
            cells: words,
            meaning: "which curve",
            ..DataColumn::named("quantity", Kind::Word, 0)
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
        for ((name, meaning), cells) in about.into_iter().zip(columns) {
            table.push(DataColumn {
                cells,
                meaning,
                unit: "1",
                ..DataColumn::named(name, Kind::Number, 0)
            });
        }
        table
    }
}

/// Numbers of a structure that tables have: name, meaning, and where it is.
type Number = (
    String,
    &'static str,
    Box<dyn Fn(&Structure) -> Option<Band>>,
);

/// All of them.
fn numbers() -> Vec<Number> {
    let mut all: Vec<Number> = NAMED
        .iter()
        .enumerate()
        .map(|(place, scalar)| -> Number {
            let of = move |structure: &Structure| structure.scalars[place];
            (scalar.name.to_owned(), scalar.meaning, Box::new(of))
        })
        .collect();
    for (place, name) in [(0, "x"), (1, "y")] {
        for (other, second) in [(0, "x"), (1, "y")] {
            if other >= place {
                let of = move |structure: &Structure| {
                    structure.fabric.get(place)?.get(other).copied().flatten()
                };
                let meaning = "n n averaged over contacts";
                all.push((format!("fabric_{name}{second}"), meaning, Box::new(of)));
            }
        }
    }
    all.push((
        "fabric_deviator".into(),
        "how far the fabric is from that of contacts without a preferred direction",
        Box::new(|structure| structure.fabric_deviator),
    ));
    all
}

/// The curves of a structure.
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

/// Puts all that is known of a point into an object.
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
