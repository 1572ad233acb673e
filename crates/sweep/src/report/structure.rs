//! Structure of the points of a campaign, from the frames in its store.

use super::error::ReportError;
use super::figure::{
    Colour, Curve, CurveKind, Key, Mark, Origin, PlanePicture, draw_curves, draw_plane,
};
use super::labels::all_named;
use super::points::{Point, Report};
use super::selection::Selection;
use super::sheet::{Shape, Sheet, View};
use super::table::{TableOf, axis_table};
use crate::data::{DataColumn, Kind, Object, Value};
use crate::measure::numbers::{Level, Number};
use crate::measure::{Estimate, PointRun};
use crate::model::axes::{AXES, Axis};
use crate::model::case::State;
use crate::model::spaces::of_either;
use crate::store::{Store, StoredFrame};
use crate::structure::{
    NAMED, Network, OutsideFrame, Reference, RunStructure, Structure, reach, sampled,
};
use crate::text::choices::choices;
use crate::text::format::{count, counted, short};
use sd_core::Params;
use sd_core::model::Keywords as _;
use serde_json::{Value as Json, json};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::f64::consts::PI;

/// Structure of the points of a campaign.
#[derive(Debug)]
pub struct StructureReport {
    /// Its points.
    report: Report,
    /// Structure of the points with frames, by index in the report.
    points: Vec<(usize, Structure)>,
    /// Keys of the runs that are left out, since they lack frames of the averaged strain; the
    /// strain of their first one.
    left_out: Vec<(String, Option<f64>)>,
}

/// Maximum number of runs left out that are named.
const NAMED_RUNS: usize = 3;

choices! {
    /// Kind of a figure of structure.
    StructureKind {
        PairDistribution = "pair-distribution", "g(r), from the distances of g(r, θ), each over 0.05 a";
        PairMap = "pair-map", "g(r, θ) of one point in the plane of flow and gradient";
        ContactAngle = "contact-angle", "Fraction of contacts by the angle of their normals from the flow towards the gradient";
        ForceAngle = "force-angle", "The same, weighted by the normal force";
        NormalForce = "normal-force", "Probability density of normal forces over their mean";
        TangentialForce = "tangential-force", "The same for friction forces";
        ClusterSize = "cluster-size", "Fraction of spheres in clusters of frictional contacts by size";
        VelocityProfile = "velocity-profile", "Velocity along the flow by height along the gradient";
        FractionProfile = "fraction-profile", "Local area or volume fraction by height along the gradient";
    }
}

/// Views of the table.
const VIEWS: [View<'_>; 19] = [
    ("runs", "runs", 3, 0),
    ("frames", "frames", 3, 4),
    ("coordination", "contacts\nof a sphere", 3, 0),
    ("frictional_coordination", "frictional", 3, 1),
    ("largest_cluster", "largest\ncluster", 3, 1),
    ("percolating_x", "percolates\nalong x", 3, 2),
    ("percolating_y", "percolates\nalong y", 3, 2),
    ("percolating_z", "percolates\nalong z", 3, 2),
    ("core_fraction", "core", 3, 2),
    ("rigid_fraction", "rigid", 3, 2),
    ("rattlers", "rattlers", 3, 3),
    ("sticking", "sticking", 3, 3),
    ("fabric_deviator", "fabric\ndeviator", 3, 3),
    ("layering", "layering", 3, 2),
    ("psi_6", "Ψ6", 3, 2),
    ("q_6", "Q6", 3, 2),
    ("localisation", "locali-\nsation", 3, 3),
    ("hyperstaticity", "hyper-\nstaticity", 3, 3),
    ("diffusivity_yy", "D_yy", 3, 3),
];

/// A curve of a structure: its name in tables, its names and those of both axes in JSON, and the
/// names of both axes of its figure.
type NamedCurve = (
    &'static str,
    [&'static str; 3],
    [&'static str; 2],
    fn(&Structure) -> &crate::structure::Curve,
);

/// All of them. Both weights of the contact angle are one object of JSON, and so are velocity and
/// fraction along an axis.
#[rustfmt::skip]
const CURVES: [NamedCurve; 10] = [
    ("g_r", ["g_r", "r", "g"], ["r / a", "g(r)"], |s| &s.radial),
    ("contact_angle", ["contact_angle", "theta", "probability"], ["angle of the normal (rad)", "share of contacts"], |s| &s.contact_angle),
    ("force_angle", ["contact_angle", "theta", "force_weighted"], ["angle of the normal (rad)", "share of normal forces"], |s| &s.force_angle),
    ("normal_force", ["normal_force", "f", "density"], ["normal force over its mean", "probability density"], |s| &s.normal_force),
    ("tangential_force", ["tangential_force", "f", "density"], ["friction force over its mean", "probability density"], |s| &s.tangential_force),
    ("cluster_size", ["cluster_size", "size", "share"], ["spheres of a cluster, at least", "share of spheres"], |s| &s.cluster_size),
    ("velocity_profile", ["profile", "y", "velocity"], ["y / a", "velocity along the flow / (a rate)"], |s| &s.profile[0]),
    ("fraction_profile", ["profile", "y", "fraction"], ["y / a", "local fraction"], |s| &s.profile[1]),
    ("velocity_profile_z", ["profile_z", "z", "velocity"], ["z / a", "velocity along the flow less the linear profile / (a rate)"], |s| &s.profile_z[0]),
    ("fraction_profile_z", ["profile_z", "z", "fraction"], ["z / a", "local fraction"], |s| &s.profile_z[1]),
];

/// Fraction of the bins of a map beyond the upper end of its scale: the contact peak is too high.
const MAP_BEYOND: f64 = 0.02;

impl StructureReport {
    /// Reads the points selected, or a single run by the beginning of its key or its number. A run
    /// without the frames of its whole averaged strain is left out.
    ///
    /// # Errors
    /// An I/O or SQLite error; [`ReportError::Argument`] on a selection that no point meets, and
    /// without frames.
    pub fn of(
        store: &Store,
        selection: &Selection,
        case: Option<&str>,
    ) -> Result<Self, ReportError> {
        let (report, runs, places) = Report::with_runs(store, selection)?;
        let key = case.map(|case| store.key_of(case)).transpose()?;
        // Points may share runs. A first pass finds how far all frames of a point reach.
        let mut reaches: HashMap<&str, Option<f64>> = HashMap::new();
        let mut left_out = Vec::new();
        let mut meant = Vec::new();
        let mut least = vec![f64::INFINITY; report.points.len()];
        for (run, place) in runs.iter().zip(places) {
            let is_meant = match &key {
                Some(key) => run.key == *key,
                None => selection.averages(run) || run.state == State::Jammed,
            };
            if !is_meant {
                continue;
            }
            // Strains are sums of steps.
            let discard = run.discard().unwrap_or(report.discard);
            let first = count(discard / run.params.time_step) as u64;
            if !reaches.contains_key(run.key.as_str()) {
                let reach = match store.has_frames(&run.key, first)? {
                    Ok(()) => Some(reach_of(&frames(store, run, first)?)?),
                    Err(from) => {
                        let strain = from.map(|step| step as f64 * run.params.time_step);
                        left_out.push((run.key.clone(), strain));
                        None
                    }
                };
                reaches.insert(&run.key, reach);
            }
            if let Some(reach) = reaches[run.key.as_str()] {
                least[place] = least[place].min(reach);
                meant.push((run, place, first));
            }
        }
        let mut known: HashMap<(&str, u64), Option<RunStructure>> = HashMap::new();
        let mut of_point: Vec<Vec<RunStructure>> = vec![Vec::new(); report.points.len()];
        for (run, place, first) in meant {
            let key = (run.key.as_str(), least[place].to_bits());
            if let Entry::Vacant(vacant) = known.entry(key) {
                vacant.insert(of_run(run, &frames(store, run, first)?, least[place])?);
            }
            of_point[place].extend(known[&key].clone());
        }
        let points = of_point.iter().enumerate();
        let points = points.filter_map(|(place, runs)| Some((place, Structure::of(runs)?)));
        let points: Vec<(usize, Structure)> = points.collect();
        if points.is_empty() {
            let whose = match &key {
                Some(key) => format!("of case {key}"),
                None => "of a finished run of these points".into(),
            };
            return Err(ReportError::Refused(format!(
                "no frames {whose} are kept for the whole averaged strain: `sweep run CAMPAIGN.toml --trajectory` computes \
                     them, with the same digits"
            )));
        }
        Ok(Self {
            report,
            points,
            left_out,
        })
    }

    /// The runs that are left out, and the command that computes their frames.
    pub fn note(&self) -> Option<String> {
        let number = self.left_out.len();
        let named = self.left_out.iter().take(NAMED_RUNS).map(|(key, from)| {
            let from = from.map(|strain| format!("frames from strain {}", short(strain, 6)));
            format!("{} ({})", &key[..8], from.unwrap_or("no frames".into()))
        });
        let more = number.saturating_sub(NAMED_RUNS);
        let more = (more > 0).then(|| format!("{more} more"));
        let named: Vec<String> = named.chain(more).collect();
        (number > 0).then(|| {
            format!(
                "{} left out, without frames of the whole averaged strain: {}; `sweep run CAMPAIGN.toml --trajectory` computes them \
                 again with theirs",
                counted(number as u64, "finished run"),
                named.join(", ")
            )
        })
    }

    fn of_points(&self) -> impl Iterator<Item = &Point> + Clone {
        self.points
            .iter()
            .map(|(place, _)| &self.report.points[*place])
    }

    fn params(&self) -> impl Iterator<Item = &Params> + Clone {
        self.of_points().map(|point| &point.params)
    }

    /// The axes that distinguish its points.
    fn axes(&self) -> Vec<&'static Axis> {
        let varies = |axis: &&Axis| axis.varies(self.params());
        AXES.iter().filter(varies).collect()
    }

    /// The table for people, for a terminal of this width.
    pub(crate) fn sheet(&self, shape: Shape, width: Option<u16>) -> Sheet {
        let table = self.table();
        let of = (table.as_slice(), VIEWS.as_slice());
        let trends = Report::trends(self.of_points()).into_iter().collect();
        let sheet = Sheet::of_rows(&self.report, &self.of_points(), trends, of, shape);
        sheet.shaped(shape, width)
    }

    /// One row per point: all axes, then numbers and their intervals.
    pub fn table(&self) -> Vec<DataColumn> {
        numbers(axis_table(&self.of_points()), &self.points)
    }

    /// The object for programs, a stable interface: a point has the columns of the table and all
    /// curves.
    pub fn json(&self) -> Json {
        let table = self.table();
        let points = self.points.iter().enumerate();
        let points = points.map(|(row, (_, structure))| object(&table, row, structure));
        json!({ "campaign": self.report.campaign, "points": points.collect::<Vec<_>>() })
    }

    /// All curves, one row per bin of each curve of each point: the axes that vary, the name, the
    /// centre of the bin, the mean and half its interval. g(r, θ) has both distance and angle.
    pub fn curves(&self) -> Vec<DataColumn> {
        let mut rows: Vec<(&Params, &'static str, [Option<f64>; 4])> = Vec::new();
        for (params, (_, structure)) in self.params().zip(&self.points) {
            for (name, _, _, of) in CURVES {
                let curve = of(structure);
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
        let mut table = TableOf {
            columns: axes
                .map(|axis| axis.column(rows.iter().map(|row| row.0)))
                .collect(),
            rows: &rows,
        };
        table.add("quantity", Kind::Word, "which curve", |row| {
            Some(Value::Word(row.1))
        });
        if let Some(words) = table.columns.last_mut() {
            words.unit = "";
        }
        let about = [
            "middle of a bin: r in a, angle in radians, force over its mean, spheres of a cluster, or height in a",
            "of g_r_theta: from the flow towards the gradient, in radians",
            "mean over runs",
            "half width of its 95 % Student interval over runs",
        ];
        let names = ["x", "angle", "value", "value_ci95"];
        for (place, (name, meaning)) in names.into_iter().zip(about).enumerate() {
            table.number(name, meaning, |row| row.2[place]);
        }
        table.columns
    }

    /// Name of the campaign, and numbers of runs, frames and points.
    pub fn summary(&self) -> String {
        let sum = |of: fn(&Structure) -> u64| self.points.iter().map(|(_, s)| of(s)).sum::<u64>();
        format!(
            "{}: structure of {} of {} at {}, after the discarded strain",
            self.report.campaign,
            counted(sum(|s| s.frames), "frame"),
            counted(sum(|s| s.runs), "run"),
            counted(self.points.len(), "point")
        )
    }

    /// Draws one of the curves of every point.
    ///
    /// # Errors
    /// [`ReportError::Argument`] if there are more points than a figure holds.
    pub fn draw(&self, kind: StructureKind) -> Result<String, ReportError> {
        if kind == StructureKind::PairMap {
            return self.draw_map();
        }
        let labels = self.report.labels(self.params());
        let is_of_sizes = kind == StructureKind::ClusterSize;
        let marks = if is_of_sizes {
            CurveKind::Markers
        } else {
            CurveKind::Line
        };
        let number = kind.index();
        let (_, _, axes, of) = CURVES[number.saturating_sub(1)];
        let mut curves = Vec::with_capacity(labels.len());
        let points = labels.iter().zip(&self.points).zip(self.params());
        for (index, ((label, (_, structure)), params)) in points.enumerate() {
            let curve = match kind {
                StructureKind::PairDistribution => structure.radial_of_angles(),
                _ => of(structure).clone(),
            };
            let places = curve.x.into_iter().zip(curve.y);
            // No cluster has more spheres than there are.
            let places = places.filter(|(x, _)| !is_of_sizes || *x <= params.spheres as f64);
            let places = places.filter_map(|(x, y)| Some((x, Estimate::bare(y?.mean))));
            curves.push(Curve::of_values(&label.words, places, marks, index));
        }
        let origin = Origin::of(&self.report);
        // Shares by angle differ by their shape, not by their decades.
        let is_linear = matches!(
            kind,
            StructureKind::ContactAngle
                | StructureKind::ForceAngle
                | StructureKind::VelocityProfile
                | StructureKind::FractionProfile
        );
        draw_curves(curves, axes, [is_of_sizes, is_linear], &origin)
    }

    /// Draws g(r, θ) of a single point around a sphere, symmetrized: a pair has two opposite
    /// angles.
    fn draw_map(&self) -> Result<String, ReportError> {
        let [(place, structure)] = self.points.as_slice() else {
            let keys: Vec<&str> = self.axes().iter().map(|axis| axis.key).collect();
            let message = format!(
                "a map shows one point, but there are {}, which differ in {}: choose one (where)",
                self.points.len(),
                keys.join(", ")
            );
            return Err(ReportError::argument("kind", message));
        };
        let (report, params) = (&self.report, &self.report.points[*place].params);
        let (distances, angles, rows) = &structure.with_angle;
        let mut sorted: Vec<f64> = rows.iter().flatten().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let beyond = count(MAP_BEYOND * sorted.len() as f64);
        let high = sorted.iter().rev().nth(beyond).map_or(1.0, |g| g.max(1.0));
        let edges = edges(distances);
        let half_turn = 0.5 * PI / angles.len() as f64;
        let mut marks = vec![Mark::Sphere {
            centre: [0.0; 2],
            radius: 1.0,
            colour: Colour::WHITE,
            is_shaded: false,
        }];
        for (ring, row) in edges.windows(2).zip(rows) {
            for (angle, g) in angles.iter().zip(row) {
                for turn in [0.0, PI] {
                    let at = |(end, side): (usize, f64)| {
                        let (sin, cos) = (angle + turn + side * half_turn).sin_cos();
                        [ring[end] * cos, ring[end] * sin]
                    };
                    let corners = [(0, -1.0), (1, -1.0), (1, 0.0), (1, 1.0), (0, 1.0), (0, 0.0)];
                    marks.push(Mark::Area {
                        corners: corners.map(at).to_vec(),
                        colour: Colour::heat(g / high),
                    });
                }
            }
        }
        let reach = edges.last().copied().unwrap_or(1.0);
        let mut caption = vec![report.campaign.clone()];
        caption.extend(all_named(params, report.units, &report.starts));
        caption.push(format!(
            "{} of {}",
            counted(structure.frames, "frame"),
            counted(structure.runs, "run")
        ));
        let picture = PlanePicture {
            ends: [-reach, reach],
            marks,
            key: Key::Numbers {
                label: "g(r, θ)".into(),
                ends: [0.0, high],
                is_open: [false, true],
            },
            lines: Vec::new(),
            caption,
        };
        let origin = Origin::of(report);
        Ok(draw_plane(&picture, &origin))
    }
}

/// The numbers of structures and their intervals, one row each, after other columns.
fn numbers(columns: Vec<DataColumn>, rows: &[(usize, Structure)]) -> Vec<DataColumn> {
    let mut table = TableOf { columns, rows };
    table.count("runs", "runs averaged", |(_, s)| Some(s.runs));
    table.count("frames", "their frames together", |(_, s)| Some(s.frames));
    for (place, scalar) in NAMED.iter().enumerate() {
        table.estimate(scalar.name, scalar.meaning(), |(_, s)| s.scalars[place]);
    }
    for (name, row, column) in [
        ("fabric_xx", 0, 0),
        ("fabric_xy", 0, 1),
        ("fabric_yy", 1, 1),
    ] {
        table.estimate(name, "n n averaged over contacts", |(_, s)| {
            s.fabric[row][column]
        });
    }
    for (place, name) in ["diffusivity_yy", "diffusivity_zz"].into_iter().enumerate() {
        let number = Number::named(name).and_then(|number| number.meaning(Level::Points));
        table.estimate(name, number.unwrap_or_default(), |(_, s)| {
            s.diffusivities[place]
        });
    }
    let meaning = "deviation of the fabric from that of isotropic contacts";
    table.estimate("fabric_deviator", meaning, |(_, s)| s.fabric_deviator);
    table.columns
}

/// The object of a structure: a row of a table, and all curves.
fn object(table: &[DataColumn], row: usize, structure: &Structure) -> Json {
    let mean = |of: &Option<Estimate>| of.map(|of| of.mean);
    let half = |of: &Option<Estimate>| of.and_then(|of| of.ci95);
    let mut object = json!(Object(table, row));
    for (_, [name, x, y], _, of) in CURVES {
        let curve = of(structure);
        let entry = &mut object[name];
        entry[x] = json!(curve.x);
        entry[y] = curve.y.iter().map(mean).collect();
        entry[format!("{y}_ci95")] = curve.y.iter().map(half).collect();
    }
    let (r, theta, g) = &structure.with_angle;
    object["g_r_theta"] = json!({"r": r, "theta": theta, "g": g});
    let rows = || structure.fabric.iter().map(|row| row.iter());
    object["fabric"] = rows().map(|row| row.map(mean).collect::<Json>()).collect();
    object["fabric_ci95"] = rows().map(|row| row.map(half).collect::<Json>()).collect();
    object
}

/// The structure of runs of another program, as [`StructureReport::json`] has that of a point.
///
/// # Errors
/// [`ReportError::Refused`] on frames that are no spheres in a cell, and without any.
pub fn outside_structure(runs: &[Vec<OutsideFrame>]) -> Result<Json, ReportError> {
    let refused = |error: sd_core::Error| ReportError::Refused(error.to_string());
    let runs = RunStructure::of_outside(runs).map_err(refused)?;
    let none = || ReportError::Refused("there are no frames".into());
    let rows = [(0, Structure::of(&runs).ok_or_else(none)?)];
    Ok(object(&numbers(Vec::new(), &rows), 0, &rows[0].1))
}

/// The frames of a run from a step on.
fn frames(store: &Store, run: &PointRun, first: u64) -> Result<Vec<StoredFrame>, ReportError> {
    let mut frames = store.frames(&run.key, 1)?;
    frames.retain(|kept| kept.step >= first);
    Ok(frames)
}

/// The smallest reach of the cells of these frames, in a.
fn reach_of(frames: &[StoredFrame]) -> Result<f64, ReportError> {
    let mut least = f64::INFINITY;
    for kept in frames {
        let found = of_either!(&kept.frame, frame => frame.cell().map(|cell| reach(&cell)));
        least = least.min(found.map_err(|error| ReportError::Refused(error.to_string()))?);
    }
    Ok(least)
}

/// The structure of a run from its frames, of which none has a smaller reach.
fn of_run(
    run: &PointRun,
    frames: &[StoredFrame],
    reach: f64,
) -> Result<Option<RunStructure>, ReportError> {
    let mut segments = run.params.segments.iter();
    let has_cross_shear = segments.any(|segment| segment.cross_shear.is_some());
    let mut sums: Option<RunStructure> = None;
    for kept in frames {
        of_either!(&kept.frame, frame => {
            let network = Network::try_from(frame)
                .map_err(|error| ReportError::Refused(error.to_string()))?;
            let reference = Reference {
                direction: run.params.imposed(kept.step).direction,
                start: None,
                has_cross_shear,
            };
            let found = sampled(frame, &network, reference);
            let sums = sums.get_or_insert_with(|| RunStructure::new(&network, reach));
            sums.add(&network, &found);
            sums.add_profiles(frame, reference.direction);
        });
    }
    if let Some(sums) = &mut sums {
        sums.diffusivities = ["diffusivity_yy", "diffusivity_zz"].map(|name| run.number(name));
    }
    Ok(sums)
}

/// The edges of bins with these centres, which vary slowly.
fn edges(middles: &[f64]) -> Vec<f64> {
    let mut edges: Vec<f64> = middles
        .windows(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
    if let (Some(&first), Some(&last)) = (edges.first(), edges.last()) {
        edges.insert(0, 2.0 * middles[0] - first);
        edges.push(2.0 * middles[middles.len() - 1] - last);
    }
    edges
}
