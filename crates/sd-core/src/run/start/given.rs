//! A layer that is given in place of the one a seed makes: whether it fits the parameters, and in the form a run begins with.

use super::radii_and_side;
use crate::error::Error;
use crate::model::{DEEPEST_OVERLAP, Params, Refusal, StartLayer};
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::neighbours::NeighbourList;

/// Share by which radii and cell of a layer that is given may differ from those of the parameters: files have single precision.
const SAME: f64 = 1e-5;

/// Brings a layer that is given into the form in which a run with these parameters begins with it: radii and cell are those of the
/// parameters to the last digit, the largest spheres come first, and centres lie in the cell.
///
/// # Errors
/// [`Refusal`] of a layer of another number of spheres, other radii, another cell, or with spheres nearer than the contact law can hold.
pub fn fit(given: &StartLayer, params: &Params) -> Result<StartLayer, Error> {
    let n = given.centres.len();
    if n != params.spheres {
        return refuse(
            format!("a layer of {n} spheres"),
            format!("does not go with `spheres` = {}", params.spheres),
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
            match params.sizes {
                Some(sizes) => format!("does not go with `sizes` = {}", sizes.text()),
                None => format!(
                    "does not go with `size_ratio` = {} and `large_fraction` = {}",
                    params.size_ratio, params.large_fraction
                ),
            },
            format!("radius {radius} in its place, in units of the mean radius"),
        );
    }
    if !near(given.side, side) {
        return refuse(
            format!("a layer in a cell of side {}", given.side),
            format!(
                "does not go with `area_fraction` = {}",
                params.area_fraction
            ),
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
    // The slip of a pair is the same seen from either sphere; the rolling velocity has the other sign.
    let (Some(springs), Some(rolling_springs)) = (
        reordered(&given.springs, &order, 1.0),
        reordered(&given.rolling_springs, &order, -1.0),
    ) else {
        return refuse(
            "a layer".into(),
            "has springs of spheres that are not there, or of no finite stretch".into(),
            format!("pairs of sphere numbers below {n}"),
        );
    };
    let offset = match cell {
        Cell::Periodic { offset, .. } => offset,
        Cell::Unbounded => 0.0,
    };
    Ok(StartLayer {
        side,
        offset,
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

/// Whether a length is the one it should be, as far as a file can say.
fn near(given: f64, wanted: f64) -> bool {
    (given - wanted).abs() <= SAME * wanted
}

/// Refuses spheres that overlap by more than the contact law can hold. `order`: their numbers in the layer that was given.
fn check_gaps(
    cell: &Cell,
    centres: &[Vec2],
    radii: &[f64],
    order: &[usize],
    params: &Params,
) -> Result<(), Error> {
    // What soft contacts are given up at; rigid ones begin with spheres that do not touch but by their roughness.
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

/// Springs with the numbers that spheres have in another order; `None` where a sphere is not there or a stretch is not finite.
///
/// `exchanged`: sign of a stretch where the spheres of a pair change places.
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
