//! Structure of the points of a campaign, from the frames that its store keeps.

use super::axis_words::AxisWords;
use super::columns::point_row;
use super::curves::{Shared, labels};
use super::error::ReportError;
use super::figure::{Format, draw_graphs};
use super::points::Report;
use super::selection::Selection;
use super::sheet::{Head, NumberFormat, Shape, Sheet, SheetColumn};
use crate::axes::{AXES, Axis, Kind, Value};
use crate::campaign::Discard;
use crate::case::State;
use crate::data::{Cells, DataColumn};
use crate::format::Uncertain;
use crate::spaces::of_either;
use crate::store::{PointRun, Store};
use crate::structure::{Band, Curve, NAMED, Network, RunStructure, Structure};
use sd_core::Params;
use serde_json::{Map, Value as Json, json};
use std::collections::HashMap;

/// Structure of the points of a campaign.
#[derive(Debug)]
pub struct StructureReport {
    /// Its points, as tables have them.
    report: Report,
    /// What those of them look like of which frames are kept, by their place in the report.
    points: Vec<(usize, Structure)>,
}

/// What a figure of structure shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum StructureKind {
    /// g(r), from the distances of g(r, θ), each over 0.05 a.
    #[default]
    PairDistribution,
    /// Share of contacts by the angle of their normals from the flow towards the gradient.
    ContactAngle,
    /// The same, each contact counting as its normal force.
    ForceAngle,
    /// Probability density of normal forces over their mean.
    NormalForce,
    /// The same of friction forces.
    TangentialForce,
    /// Share of spheres in clusters of frictional contacts by size.
    ClusterSize,
}

/// Columns of the table for people: name, heading, significant digits, and how soon it is left out, the highest first.
const USUAL: [(&str, &str, u8); 9] = [
    ("coordination", "contacts\nof a sphere", 0),
    ("frictional_coordination", "frictional", 1),
    ("largest_cluster", "largest\ncluster", 1),
    ("percolating_x", "percolates\nalong x", 2),
    ("percolating_y", "percolates\nalong y", 2),
    ("core_fraction", "core", 2),
    ("rigid_fraction", "rigid", 2),
    ("rattlers", "rattlers", 3),
    ("sticking", "sticking", 3),
];

/// A whole number of a structure: name, meaning, and where it is.
type Count = (&'static str, &'static str, fn(&Structure) -> u64);
/// A curve of a structure, with its names: of the whole, of its axis, of its heights.
type NamedCurve<'s> = (&'static str, &'static str, &'static str, &'s Curve);

impl StructureReport {
    /// Of the points selected, or of one run alone, by the beginning of its key or its number.
    ///
    /// # Errors
    /// Trouble with the store; [`ReportError::Argument`] on a selection that no point meets, and where no frames are kept.
    pub fn of(
        store: &Store,
        selection: &Selection,
        case: Option<&str>,
    ) -> Result<Self, ReportError> {
        let (report, runs, places) = Report::with_runs(store, selection)?;
        let key = case.map(|case| store.key_of(case)).transpose()?;
        let usual = match report.discard {
            Discard::Strain(strain) => strain,
            Discard::Auto => 0.0,
        };
        // Points may share runs.
        let mut known: HashMap<&str, Option<RunStructure>> = HashMap::new();
        let mut of_point: Vec<Vec<RunStructure>> = vec![Vec::new(); report.points.len()];
        for (run, place) in runs.iter().zip(places) {
            let is_meant = match &key {
                Some(key) => run.key == *key,
                None => {
                    run.is_sound()
                        || run.state == State::Jammed
                        || (report.with_doubtful && run.is_doubtful())
                }
            };
            if !is_meant {
                continue;
            }
            if !known.contains_key(run.key.as_str()) {
                known.insert(&run.key, of_run(store, run, run.discard.unwrap_or(usual))?);
            }
            of_point[place].extend(known[run.key.as_str()].clone());
        }
        let points: Vec<(usize, Structure)> = of_point
            .iter()
            .enumerate()
            .filter_map(|(place, runs)| Some((place, Structure::of(runs)?)))
            .collect();
        if points.is_empty() {
            let whose = match &key {
                Some(key) => format!("of case {key}"),
                None => "of a finished run of these points".into(),
            };
            return Err(ReportError::argument(
                "FILE",
                format!(
                    "no frames {whose} are kept after the discarded strain: `sweep run CAMPAIGN.toml --trajectory` keeps those of the \
                     runs it computes, and with --store ANOTHER.sqlite it computes them all"
                ),
            ));
        }
        Ok(Self { report, points })
    }

    fn params(&self) -> impl Iterator<Item = &Params> {
        let points = self.points.iter();
        points.map(|(place, _)| &self.report.points[*place].params)
    }

    /// The axes that tell its points apart.
    fn axes(&self) -> Vec<&'static Axis> {
        let varies = |axis: &&Axis| axis.varies(self.params());
        AXES.iter().filter(varies).collect()
    }

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

    /// The table for people, for a terminal of this width.
    pub(crate) fn sheet(&self, shape: Shape, width: Option<u16>) -> Sheet {
        let report = &self.report;
        let column = |head, cells| SheetColumn::new(head, cells, shape.format);
        let axes = self.axes();
        let mut columns: Vec<SheetColumn> = axes
            .iter()
            .map(|axis| {
                let words = AxisWords::of(axis, report.units, &report.starts, self.params());
                let cells = self.params().map(|params| Some(words.cell(params)));
                column(Head::new(axis.key, axis.symbol, "", 0), cells.collect())
            })
            .collect();
        let counts: [(Count, u8); 2] = [
            (("runs", "", |s| s.runs), 0),
            (("frames", "", |s| s.frames), 4),
        ];
        for ((name, _, count), rank) in counts {
            let cells = self
                .points
                .iter()
                .map(|(_, s)| Some(Uncertain::Count(count(s))));
            columns.push(column(Head::new(name, name, "", rank), cells.collect()));
        }
        let mut add = |name, heading: &str, rank, of: &dyn Fn(&Structure) -> Option<Band>| {
            let cell = |(_, structure): &(usize, Structure)| {
                of(structure).map(|band| match band.ci95 {
                    Some(half) => Uncertain::Interval(band.mean, half),
                    None => Uncertain::of(band.mean, 3),
                })
            };
            let cells: Vec<_> = self.points.iter().map(cell).collect();
            if cells.iter().any(Option::is_some) {
                columns.push(column(Head::new(name, heading, "", rank), cells));
            }
        };
        for (name, heading, rank) in USUAL {
            add(name, heading, rank, &|structure| structure.scalar(name));
        }
        add("fabric_deviator", "fabric\ndeviator", 3, &|s| {
            s.fabric_deviator
        });
        let sheet = Sheet::new(axes.len(), columns, NumberFormat::Plain);
        if shape.wide {
            sheet
        } else {
            sheet.fitted(width)
        }
    }

    /// Name of the campaign, how many runs and frames there are, and at how many points.
    pub fn summary(&self) -> String {
        let sum = |of: fn(&Structure) -> u64| self.points.iter().map(|(_, s)| of(s)).sum::<u64>();
        format!(
            "{}: structure of {} frames of {} runs at {} points, after the discarded strain",
            self.report.campaign,
            sum(|s| s.frames),
            sum(|s| s.runs),
            self.points.len()
        )
    }

    /// Draws one of the curves of every point.
    ///
    /// # Errors
    /// [`ReportError::Argument`] if there are more points than a figure holds.
    pub fn draw(&self, kind: StructureKind, format: Format) -> Result<Vec<u8>, ReportError> {
        let all: Vec<(&str, &Params)> = self
            .params()
            .map(|params| (self.report.campaign.as_str(), params))
            .collect();
        let shared = Shared {
            along: None,
            panels: None,
            units: self.report.units,
            starts: &self.report.starts,
        };
        let labels = labels(&all, shared);
        let mut axes = ["", ""];
        let mut graphs = Vec::with_capacity(labels.len());
        for (label, (_, structure)) in labels.iter().zip(&self.points) {
            let (names, places) = graph(structure, kind);
            axes = names;
            graphs.push((label.words.as_str(), places));
        }
        draw_graphs(&graphs, axes, format)
    }
}

/// The structure of a run from its frames after a strain; `None` without any.
fn of_run(
    store: &Store,
    run: &PointRun,
    discard: f64,
) -> Result<Option<RunStructure>, ReportError> {
    if store.frame_count(&run.key)? == 0 {
        return Ok(None);
    }
    let mut sums: Option<RunStructure> = None;
    for kept in store.frames(&run.key, 1)? {
        // Strains are sums of steps.
        if kept.frame.strain() < discard - 1e-9 {
            continue;
        }
        of_either!(&kept.frame, frame => {
            let network = Network::try_from(frame)
                .map_err(|error| ReportError::argument("FILE", error.to_string()))?;
            sums.get_or_insert_with(|| RunStructure::new(&network))
                .add(&network);
        });
    }
    Ok(sums)
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

/// A curve of a figure: the names of both axes, and its places.
fn graph(structure: &Structure, kind: StructureKind) -> ([&'static str; 2], Vec<[f64; 2]>) {
    let of = |curve: &Curve| {
        let places = curve.x.iter().zip(&curve.y);
        places
            .filter_map(|(x, band)| Some([*x, band.as_ref()?.mean]))
            .collect()
    };
    match kind {
        StructureKind::PairDistribution => {
            let (r, angles, rows) = &structure.with_angle;
            let mean = |row: &Vec<f64>| row.iter().sum::<f64>() / angles.len() as f64;
            let places = r.iter().zip(rows).map(|(r, row)| [*r, mean(row)]);
            (["r / a", "g(r)"], places.collect())
        }
        StructureKind::ContactAngle => (
            ["angle of the normal (rad)", "share of contacts"],
            of(&structure.contact_angle),
        ),
        StructureKind::ForceAngle => (
            ["angle of the normal (rad)", "share of normal forces"],
            of(&structure.force_angle),
        ),
        StructureKind::NormalForce => (
            ["normal force over its mean", "probability density"],
            of(&structure.normal_force),
        ),
        StructureKind::TangentialForce => (
            ["friction force over its mean", "probability density"],
            of(&structure.tangential_force),
        ),
        StructureKind::ClusterSize => (
            ["spheres of a cluster, at least", "share of spheres"],
            of(&structure.cluster_size),
        ),
    }
}
