//! A given start layer: check against the parameters, and conversion to the form of a start.

use super::first_cell::radii_and_side;
use crate::error::Error;
use crate::model::{DEEPEST_OVERLAP, Params, Refusal, StartLayer};
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::neighbours::NeighbourList;

/// Relative tolerance of radii and cell of a given layer: files have single precision.
const SAME: f64 = 1e-5;

/// Converts a given layer to a start of a run with these parameters: radii and cell are exactly
/// those of the parameters, the largest spheres come first, and centres are in the cell.
///
/// # Errors
/// [`Error::Refused`] for a layer of another number of spheres, other radii, another cell, or with
/// overlaps that the contact law cannot handle; those of [`radii_and_side`].
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn fit(given: &StartLayer, params: &Params) -> Result<StartLayer, Error> {
    let n = given.centres.len();
    if n != params.spheres {
        return refuse(
            format!("a layer of {n} spheres"),
            format!("conflicts with `spheres` = {}", params.spheres),
            "a layer of that number of spheres".into(),
        );
    }
    for (what, number) in [
        ("radii", given.radii.len()),
        ("orientations", given.orientations.len()),
    ] {
        if number != n {
            return refuse(
                format!("a layer of {n} spheres"),
                format!("has {number} {what}"),
                format!("as many {what} as spheres"),
            );
        }
    }
    let (radii, side) = radii_and_side(params)?;
    let numbers = given.centres.as_flattened().iter();
    let numbers = numbers.chain(&given.orientations).chain([&given.offset]);
    if !numbers.copied().all(f64::is_finite) {
        return refuse(
            "a layer".into(),
            "has centres, angles or an offset that are not finite".into(),
            "finite numbers".into(),
        );
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| given.radii[j].total_cmp(&given.radii[i]));
    let mut pairs = order.iter().zip(&radii);
    if let Some((&sphere, radius)) =
        pairs.find(|(sphere, radius)| !near(given.radii[**sphere], **radius))
    {
        return refuse(
            format!("a layer with a sphere of radius {}", given.radii[sphere]),
            match &params.sizes {
                Some(sizes) => format!("conflicts with `sizes` = {sizes}"),
                None => format!(
                    "conflicts with `size_ratio` = {} and `large_fraction` = {}",
                    params.size_ratio, params.large_fraction
                ),
            },
            format!("radius {radius} in its place, in units of the mean radius"),
        );
    }
    if !near(given.side, side) {
        return refuse(
            format!("a layer in a cell of side {}", given.side),
            format!("conflicts with `area_fraction` = {}", params.area_fraction),
            format!("a square cell of side {side} for these spheres"),
        );
    }
    let cell = Cell::equal_sides(side, given.offset)?;
    let centre = |&sphere: &usize| {
        let [x, y] = given.centres[sphere];
        cell.wrap(Vec2::new(x, y))
    };
    let centres: Vec<Vec2> = order.iter().map(centre).collect();
    check_gaps(&cell, &centres, &radii, &order, params)?;
    // Exchanging the spheres of a pair keeps the slip and reverses the rolling velocity.
    let (Some(springs), Some(rolling_springs)) = (
        reordered(&given.springs, &order, 1.0),
        reordered(&given.rolling_springs, &order, -1.0),
    ) else {
        return refuse(
            "a layer".into(),
            "has springs of missing spheres, or with an infinite stretch".into(),
            format!("pairs of sphere numbers below {n}"),
        );
    };
    Ok(StartLayer {
        side,
        offset: cell.offset(),
        orientations: order
            .iter()
            .map(|&sphere| given.orientations[sphere])
            .collect(),
        centres: centres.iter().map(|x| [x.x, x.y]).collect(),
        radii,
        springs,
        rolling_springs,
        origin: given.origin,
    })
}

/// The refusal of a layer.
fn refuse<T>(value: String, problem: String, allowed: String) -> Result<T, Error> {
    Err(Refusal {
        key: "start",
        value,
        problem,
        allowed,
        because: None,
    }
    .into())
}

/// Whether a length agrees within the precision of a file.
fn near(given: f64, wanted: f64) -> bool {
    (given - wanted).abs() <= SAME * wanted
}

/// Refuses overlaps that the contact law cannot handle. `order`: indices of the spheres in the
/// given layer.
fn check_gaps(
    cell: &Cell,
    centres: &[Vec2],
    radii: &[f64],
    order: &[usize],
    params: &Params,
) -> Result<(), Error> {
    // The maximum overlap of soft contacts; for rigid ones, surfaces may touch only by their
    // roughness.
    let least = if params.contact.laws().is_soft() {
        -DEEPEST_OVERLAP
    } else {
        0.0
    };
    let mut neighbours = NeighbourList::default();
    neighbours.find(cell, centres, radii, 3.0);
    let nearest = neighbours
        .pairs()
        .iter()
        .min_by(|a, b| a.gap.total_cmp(&b.gap));
    match nearest {
        Some(pair) if pair.gap <= least => refuse(
            format!(
                "a layer whose spheres {} and {}, counted from 0,",
                order[pair.i], order[pair.j]
            ),
            format!("overlap: their gap is {:.4}", pair.gap),
            format!("gaps above {least} under this contact law"),
        ),
        _ => Ok(()),
    }
}

/// Springs with renumbered spheres; `None` if a sphere is missing or a stretch is not finite.
///
/// `exchanged`: sign of a stretch when the spheres of a pair are exchanged.
fn reordered(
    springs: &[(u32, u32, f64)],
    order: &[usize],
    exchanged: f64,
) -> Option<Vec<(u32, u32, f64)>> {
    let place = |sphere: u32| {
        let old = usize::try_from(sphere).ok()?;
        u32::try_from(order.iter().position(|&other| other == old)?).ok()
    };
    let mut all = Vec::with_capacity(springs.len());
    for &(i, j, stretch) in springs {
        let (i, j) = (place(i)?, place(j)?);
        if i == j || !stretch.is_finite() {
            return None;
        }
        let sign = if i < j { 1.0 } else { exchanged };
        all.push((i.min(j), i.max(j), sign * stretch));
    }
    all.sort_unstable_by_key(|spring| (spring.0, spring.1));
    Some(all)
}
