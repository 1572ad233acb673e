//! Pictures of the spheres of a run at a kept strain.

use super::error::ReportError;
use super::figure::{COLOURS, Colour, Key, Mark, Origin, PlanePicture, draw_plane};
use super::labels::all_named;
use super::starts::Starts;
use super::units::Units;
use crate::store::{CaseDetails, Origin as Made, Store};
use crate::structure::{Link, Network, clusters};
use crate::text::choices::choices;
use crate::text::format::{count, significant};
use crate::trajectory::{Kept, by_space};
use sd_core::simulation::Frame;
use std::f64::consts::PI;

/// Width of the line of the largest force, and of the outline of lines on each side, in a.
const WIDEST: f64 = 0.35;
const CASING: f64 = 0.04;
/// Number of clusters with their own colour, the largest first; black is the colour of lines.
const CLUSTERS: [Colour; 7] = [
    COLOURS[0], COLOURS[1], COLOURS[3], COLOURS[5], COLOURS[6], COLOURS[4], COLOURS[7],
];
/// Fraction of numbers beyond an open end of a scale: near jamming, single spheres carry many times
/// the load of others.
const BEYOND: f64 = 0.02;

choices! {
    /// Quantity that colours the spheres.
    SphereColour {
        Pressure = "pressure", "Normal forces of its contacts over the surface of the sphere";
        Contacts = "contacts", "Contacts of the sphere";
        Spin = "spin", "Angular velocity along the vorticity: rotation per strain until the next kept frame";
        Cluster = "cluster", "Cluster of frictional contacts";
    }
}

/// Options of a picture.
#[derive(Debug, Clone, Copy, Default)]
pub struct SphereView {
    /// The strain, for the nearest kept frame; the last frame by default.
    pub strain: Option<f64>,
    /// Quantity that colours the spheres.
    pub colour: SphereColour,
    /// In a suspension, only spheres with centres in this range along the vorticity, in a.
    pub slab: Option<[f64; 2]>,
}

/// A picture and its content.
#[derive(Debug, Default)]
pub struct SpherePicture {
    /// The file, as SVG.
    pub file: String,
    /// The key of the run.
    pub key: String,
    /// The strain of the frame.
    pub strain: f64,
    /// Spheres, without images.
    pub spheres: usize,
    /// Contacts between any of its spheres.
    pub contacts: usize,
}

/// Draws the spheres of a case, identified by the beginning of its key or its number.
///
/// # Errors
/// An I/O or SQLite error, [`crate::store::StoreError::NoFrames`] without kept frames;
/// [`ReportError::Argument`] on a strain outside the frames, and on a slab without spheres.
pub fn draw_spheres(
    store: &Store,
    case: &str,
    view: SphereView,
) -> Result<SpherePicture, ReportError> {
    let details = store.details(case)?;
    let frames = store.frames(&details.key, 1)?;
    let frames: Vec<_> = frames.iter().map(|kept| (kept.step, &kept.frame)).collect();
    let (layers, suspensions) = by_space(&frames);
    let caption = caption(store, &details)?;
    let campaign = store.campaign_name()?;
    let mut origin = vec![
        format!("campaign {campaign}"),
        format!("key {}", details.key),
    ];
    let program = details.origin.as_ref().map(Made::program);
    origin.extend(program.map(|program| format!("computed by {program}")));
    let origin = Origin::of_lines(&campaign, &origin);
    let (picture, drawn) = if layers.is_empty() {
        drawn(&suspensions, view, caption)?
    } else {
        drawn(&layers, view, caption)?
    };
    Ok(SpherePicture {
        file: draw_plane(&picture, &origin),
        key: details.key,
        ..drawn
    })
}

/// Caption with the run of a picture.
fn caption(store: &Store, details: &CaseDetails) -> Result<Vec<String>, ReportError> {
    let number = details.number.map(|number| number.to_string());
    let case = number.unwrap_or(details.key[..8].to_owned());
    let starts = Starts::of_store(store)?;
    let mut caption = vec![store.campaign_name()?, format!("case {case}")];
    caption.extend(all_named(&details.params, Units::default(), &starts));
    caption.push(format!("seed {}", details.seed));
    Ok(caption)
}

/// Draws one of the frames of a run.
fn drawn<S: Kept>(
    frames: &[(u64, &Frame<S>)],
    view: SphereView,
    mut caption: Vec<String>,
) -> Result<(PlanePicture, SpherePicture), ReportError> {
    let frames: Vec<&Frame<S>> = frames.iter().map(|(_, frame)| *frame).collect();
    let place = nearest(&frames, view.strain)?;
    let frame = frames[place];
    let network =
        Network::try_from(frame).map_err(|error| ReportError::Refused(error.to_string()))?;
    let (colours, key) = coloured(&frames, place, &network, view.colour)?;
    let centres = network.centres.iter().map(|x| network.cell.wrap(*x));
    let centres: Vec<S::Vector> = centres.collect();
    let is_deep = S::DIMENSIONS > 2;
    // Spheres from back to front; in a layer they do not overlap, and lines are above all of them.
    let vectors = lattice(frame);
    let mut order: Vec<(usize, [f64; 3])> = Vec::new();
    for (sphere, centre) in centres.iter().enumerate() {
        let depth = if is_deep { centre[2] } else { 0.0 };
        let place = [centre[0], centre[1], depth];
        let images = images(frame, &vectors, place, network.radii[sphere]);
        order.extend(images.into_iter().map(|image| (sphere, image)));
    }
    let shown = in_slab::<S>(&order, centres.len(), view.slab, frame.side)?;
    order.retain(|(_, image)| {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&image[2]);
        view.slab.is_none_or(within)
    });
    order.sort_by(|(_, a), (_, b)| a[2].total_cmp(&b[2]));
    let forces = network.links.iter().map(|link| link.normal_force);
    let largest = forces.fold(0.0, f64::max);
    // Each sphere draws half of the line of each of its contacts.
    let mut halves = vec![Vec::new(); centres.len()];
    for link in &network.links {
        let r = network.radii[link.i] + network.radii[link.j];
        let strokes = strokes(link.is_frictional(), WIDEST * link.normal_force / largest);
        for (sphere, sign) in [(link.i, 1.0), (link.j, -1.0)] {
            let part = sign * network.radii[sphere] / r;
            let reach = [0, 1].map(|k| part * link.separation[k]);
            halves[sphere].push((reach, strokes));
        }
    }
    // Spheres, outlines of lines, lines; in a suspension the lines of a sphere lie on it, and all
    // are in the first list.
    let mut marks = <[Vec<Mark>; 3]>::default();
    for (sphere, [x, y, _]) in order {
        marks[0].push(Mark::Sphere {
            centre: [x, y],
            radius: network.radii[sphere],
            colour: colours[sphere],
            is_shaded: is_deep,
        });
        for (number, place) in if is_deep { [0, 0] } else { [1, 2] }
            .into_iter()
            .enumerate()
        {
            marks[place].extend(halves[sphere].iter().map(|(reach, strokes)| Mark::Line {
                ends: [[x, y], [x + reach[0], y + reach[1]]],
                width: strokes[number].1,
                colour: strokes[number].0,
                // In a suspension the outline of a line ends with its sphere.
                is_round: !is_deep || number == 1,
            }));
        }
    }
    caption.push(format!("strain {:.2}", frame.strain));
    if let Some([low, high]) = view.slab {
        caption.push(format!("z / a from {low} to {high}"));
    }
    let linked = |link: &&Link<S>| shown[link.i] && shown[link.j];
    let picture = PlanePicture {
        ends: [0.0, frame.side],
        marks: marks.into_iter().flatten().collect(),
        key,
        lines: explained(largest),
        caption,
    };
    let drawn = SpherePicture {
        strain: frame.strain,
        spheres: shown.iter().filter(|shown| **shown).count(),
        contacts: network.links.iter().filter(linked).count(),
        ..SpherePicture::default()
    };
    Ok((picture, drawn))
}

/// The line of a contact on its outline: colours and widths, in a. A line no wider than its outline
/// would look like one of the other colour.
fn strokes(is_frictional: bool, width: f64) -> [(Colour, f64); 2] {
    let width = width.max(2.0 * CASING);
    let colours = if is_frictional {
        [Colour::WHITE, Colour::INK]
    } else {
        [Colour::INK, Colour::WHITE]
    };
    [(colours[0], width + 2.0 * CASING), (colours[1], width)]
}

/// Key of the lines.
fn explained(largest: f64) -> Vec<(Vec<(Colour, f64)>, String)> {
    if largest <= 0.0 {
        return Vec::new();
    }
    // A round force not above the largest.
    let power = 10.0_f64.powf(largest.log10().floor());
    let mut factors = [5.0, 2.0, 1.0].into_iter().map(|factor| factor * power);
    let round = factors.find(|force| *force <= largest).unwrap_or(largest);
    let width = WIDEST * round / largest;
    let force = format!(
        "frictional contact, normal force {} μa² rate",
        significant(round, 1)
    );
    vec![
        (strokes(true, width).to_vec(), force),
        (strokes(false, 0.0).to_vec(), "frictionless contact".into()),
    ]
}

/// The frame nearest to a strain, or the last one.
fn nearest<S: Kept>(frames: &[&Frame<S>], strain: Option<f64>) -> Result<usize, ReportError> {
    let last = frames.len() - 1;
    let Some(strain) = strain else {
        return Ok(last);
    };
    let [from, to] = [frames[0].strain, frames[last].strain];
    // A run of strain 3 has its last sample a little before.
    let room = (to - from) / last.max(1) as f64 + 1e-3;
    if !(from - room..=to + room).contains(&strain) {
        let [from, to] = [from, to].map(|strain| significant(strain, 4));
        let kept = match last {
            0 => format!("the only frame is that of strain {from}"),
            _ => format!(
                "{} frames are kept, at strains from {from} to {to}",
                last + 1
            ),
        };
        let message = format!("{strain} is outside the run: {kept}");
        return Err(ReportError::argument("strain", message));
    }
    let distance = |place: &usize| (frames[*place].strain - strain).abs();
    let nearest = (0..=last).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    Ok(nearest.unwrap_or(last))
}

/// Spheres of which an image has its centre in a slab.
fn in_slab<S: Kept>(
    images: &[(usize, [f64; 3])],
    spheres: usize,
    slab: Option<[f64; 2]>,
    side: f64,
) -> Result<Vec<bool>, ReportError> {
    let Some([low, high]) = slab else {
        return Ok(vec![true; spheres]);
    };
    let refused = |message| Err(ReportError::argument("slab", message));
    if !(low < high && low.is_finite() && high.is_finite()) {
        return refused(format!("{low}..{high} is no range, the lower end first"));
    }
    if S::DIMENSIONS < 3 {
        return refused("a layer has no depth: slabs are cut from suspensions".to_owned());
    }
    let mut shown = vec![false; spheres];
    for (sphere, image) in images {
        shown[*sphere] |= (low..=high).contains(&image[2]);
    }
    if !shown.contains(&true) {
        let side = significant(side, 4);
        return refused(format!(
            "no sphere has its centre between z = {low} and {high}: z goes from 0 to {side}, in a"
        ));
    }
    Ok(shown)
}

/// Lattice vectors of a frame, in a; the third one of a layer is zero.
fn lattice<S: Kept>(frame: &Frame<S>) -> [[f64; 3]; 3] {
    let mut vectors = [[0.0; 3]; 3];
    for (vector, given) in vectors.iter_mut().zip(frame.lattice()) {
        vector[..S::DIMENSIONS].copy_from_slice(given.as_ref());
    }
    vectors
}

/// The images of a sphere that are visible in a square window, in a suspension the front of a cube.
/// In a sheared cell these are the cell itself.
fn images<S: Kept>(
    frame: &Frame<S>,
    [a, b, c]: &[[f64; 3]; 3],
    place: [f64; 3],
    radius: f64,
) -> Vec<[f64; 3]> {
    let (side, is_sheared) = (frame.side, frame.is_sheared());
    let is_deep = S::DIMENSIONS > 2;
    // Lattices are as wide as the window, but for a factor of two.
    let most = if is_sheared {
        [2, 1, 0]
    } else {
        [4, 4, if is_deep { 4 } else { 0 }]
    };
    let [columns, rows, planes] = most.map(|most: i32| -most..=most);
    let cells = planes.flat_map(|plane| {
        let columns = columns.clone();
        rows.clone()
            .flat_map(move |row| columns.clone().map(move |column| [column, row, plane]))
    });
    let all = cells.map(|cell| {
        let [m, n, l] = cell.map(f64::from);
        let mut image: [f64; 3] =
            std::array::from_fn(|k| place[k] + m * a[k] + n * b[k] + l * c[k]);
        if is_sheared && is_deep {
            // Those above and below have another depth under cross shear.
            image[2] = image[2].rem_euclid(side);
        }
        image
    });
    let is_seen = |image: &[f64; 3]| {
        let mut seen = image[..2].iter();
        seen.all(|x| (-radius..=side + radius).contains(x))
            && (is_sheared || !is_deep || (0.0..side).contains(&image[2]))
    };
    all.filter(is_seen).collect()
}

/// The colours of the spheres of a frame, and their key.
fn coloured<S: Kept>(
    frames: &[&Frame<S>],
    place: usize,
    network: &Network<S>,
    colour: SphereColour,
) -> Result<(Vec<Colour>, Key), ReportError> {
    Ok(match colour {
        SphereColour::Pressure => {
            let label = "pressure of contacts Σf/(4πa²) (μ rate)";
            numbered(&pressures(network), true, label)
        }
        SphereColour::Spin => {
            // The last frame takes the spin of the one before.
            let first = place.min(frames.len().saturating_sub(2));
            let Some([from, to]) = frames.get(first..first + 2) else {
                let message =
                    "spin is the rotation until the next kept frame, and only one frame is kept";
                return Err(ReportError::argument("colour", message));
            };
            numbered(&spins(from, to), false, "spin along the vorticity (rate)")
        }
        SphereColour::Contacts => {
            let contacts = summed(network, |_, _| 1.0);
            let most = contacts.iter().copied().fold(0.0, f64::max);
            let colour = |number: f64| Colour::heat(number / most.max(1.0));
            let kinds = (0..=count(most)).map(|number| (colour(number as f64), number.to_string()));
            let key = Key::Kinds {
                label: "contacts of a sphere".into(),
                kinds: kinds.rev().collect(),
            };
            (contacts.into_iter().map(colour).collect(), key)
        }
        SphereColour::Cluster => clustered(network),
    })
}

/// Colours of numbers on a scale that covers nearly all of them.
fn numbered(numbers: &[f64], from_zero: bool, label: &str) -> (Vec<Colour>, Key) {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let beyond = count(BEYOND * sorted.len() as f64);
    let end = |place: usize| sorted.get(place).copied().unwrap_or(0.0);
    let low = if from_zero { 0.0 } else { end(beyond) };
    let high = end((sorted.len() - 1).saturating_sub(beyond));
    let high = if high > low { high } else { low + 1.0 };
    let colour = |number: &f64| Colour::heat((number - low) / (high - low));
    let key = Key::Numbers {
        label: label.to_owned(),
        ends: [low, high],
        is_open: [end(0) < low, end(sorted.len() - 1) > high],
    };
    (numbers.iter().map(colour).collect(), key)
}

/// The normal forces of the contacts of each sphere over its surface, in mu·rate.
///
/// ```text
/// p_i = Σ f/(4π a_i²) = −(1/3) trace(Σ S^C)/(4π a_i³/3)      (each contact a_i from the centre)
/// ```
fn pressures<S: Kept>(network: &Network<S>) -> Vec<f64> {
    let area = |sphere: usize| 4.0 * PI * network.radii[sphere].powi(2);
    summed(network, |link, sphere| link.normal_force / area(sphere))
}

/// A sum over the contacts of each sphere.
fn summed<S: Kept>(network: &Network<S>, of: impl Fn(&Link<S>, usize) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; network.spheres()];
    for link in &network.links {
        for sphere in [link.i, link.j] {
            sums[sphere] += of(link, sphere);
        }
    }
    sums
}

/// Rotation of each sphere about the vorticity per strain between two frames, in rates.
fn spins<S: Kept>(from: &Frame<S>, to: &Frame<S>) -> Vec<f64> {
    let strain = to.strain - from.strain;
    let pairs = from.orientations.iter().zip(&to.orientations);
    pairs
        .map(|(from, to)| S::turned_by(from, to) / strain)
        .collect()
}

/// Colours of the largest clusters of frictional contacts.
fn clustered<S: Kept>(network: &Network<S>) -> (Vec<Colour>, Key) {
    let found = clusters(network, network.frictional());
    let mut largest: Vec<usize> = (0..found.sizes.len())
        .filter(|n| found.sizes[*n] > 1)
        .collect();
    largest.sort_by_key(|cluster| std::cmp::Reverse(found.sizes[*cluster]));
    let colour = |cluster: &usize| match largest.iter().position(|known| known == cluster) {
        Some(place) => CLUSTERS.get(place).copied().unwrap_or(Colour::GREY),
        None => Colour::WHITE,
    };
    let mut kinds: Vec<(Colour, String)> = largest
        .iter()
        .take(CLUSTERS.len())
        .map(|cluster| (colour(cluster), found.sizes[*cluster].to_string()))
        .collect();
    if let Some(next) = largest.get(CLUSTERS.len()) {
        kinds.push((Colour::GREY, format!("≤ {}", found.sizes[*next])));
    }
    kinds.push((Colour::WHITE, "none".into()));
    let label = "spheres of a cluster of frictional contacts".into();
    let colours = found.of_sphere.iter().map(colour).collect();
    (colours, Key::Kinds { label, kinds })
}

#[cfg(test)]
mod tests;
