//! Clusters of contacts, and whether they percolate.
//!
//! A cluster percolates if a path along its contacts leads from a sphere to an image of the same
//! sphere. The displacements of such paths, counted in cells, are the windings of the cluster. The
//! image above in y is shifted along x by the offset, and wrapping this offset changes the count
//! along x of every winding with a component along y: so only windings without one determine
//! percolation along the flow. Under cross shear the same holds along the vorticity.
//!
//! In a flow that is no shear the axes are the vectors of its reduced lattice, the shortest first.

use super::network::{Link, Network};
use sd_core::Space;

/// Cells along each axis.
type Winding = [i64; 3];

/// The clusters of the spheres of a network.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clusters {
    /// Number of the cluster of each sphere, counted from 0 in the order of their first spheres.
    pub of_sphere: Vec<usize>,
    /// Number of spheres of each cluster; 1 for a sphere without contacts.
    pub sizes: Vec<usize>,
    /// Whether some cluster percolates along flow, gradient and vorticity.
    pub percolates: [bool; 3],
}

impl Clusters {
    /// Spheres in the largest cluster over all spheres; a sphere without contacts is no cluster.
    pub(crate) fn largest_share(&self) -> f64 {
        let largest = self.sizes.iter().copied().filter(|size| *size > 1).max();
        largest.unwrap_or(0) as f64 / self.of_sphere.len().max(1) as f64
    }
}

/// The clusters formed by some contacts of a network.
pub(crate) fn clusters<'n, S: Space>(
    network: &'n Network<S>,
    links: impl Iterator<Item = &'n Link<S>>,
) -> Clusters {
    const NONE: usize = usize::MAX;
    let links: Vec<&Link<S>> = links.collect();
    let neighbours = network.neighbours(links.iter().copied());
    let n = network.spheres();
    let (mut of_sphere, mut sizes) = (vec![NONE; n], Vec::new());
    // The image of each sphere reached from the first sphere of its cluster.
    let mut reached: Vec<Winding> = vec![[0; 3]; n];
    let mut waiting = Vec::new();
    for first in 0..n {
        if of_sphere[first] != NONE {
            continue;
        }
        let cluster = sizes.len();
        sizes.push(0);
        of_sphere[first] = cluster;
        waiting.push(first);
        while let Some(sphere) = waiting.pop() {
            sizes[cluster] += 1;
            for &(other, number) in &neighbours[sphere] {
                if of_sphere[other] == NONE {
                    of_sphere[other] = cluster;
                    reached[other] = step(reached[sphere], links[number], sphere);
                    waiting.push(other);
                }
            }
        }
    }
    let mut windings: Vec<Vec<Winding>> = vec![Vec::new(); sizes.len()];
    for link in links {
        let around = difference(step(reached[link.i], link, link.i), reached[link.j]);
        let known = &mut windings[of_sphere[link.i]];
        if around != [0; 3] && !known.contains(&around) {
            known.push(around);
        }
    }
    let is_sheared = network.is_sheared();
    let is_crossed = is_sheared && network.cell.cross_offset() != 0.0;
    let mut percolates = [false; 3];
    for windings in &windings {
        for (axis, along) in directions(windings, [is_sheared, is_crossed])
            .into_iter()
            .enumerate()
        {
            percolates[axis] |= along;
        }
    }
    Clusters {
        of_sphere,
        sizes,
        percolates,
    }
}

/// The image of the other sphere of a link where one of them is in this image.
fn step<S: Space>(from: Winding, link: &Link<S>, sphere: usize) -> Winding {
    let mut to = from;
    for (axis, cells) in to.iter_mut().enumerate().take(S::DIMENSIONS) {
        let cells_over = i64::from(link.image[axis]);
        *cells += if sphere == link.i {
            cells_over
        } else {
            -cells_over
        };
    }
    to
}

fn difference(a: Winding, b: Winding) -> Winding {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The axes along which these windings lead, in a cell with or without shear and cross shear.
fn directions(windings: &[Winding], [is_sheared, is_crossed]: [bool; 2]) -> [bool; 3] {
    let up = windings.iter().find(|winding| winding[1] != 0);
    let along = |axis: usize, is_inclined: bool| {
        windings.iter().any(|winding| match up {
            // Eliminates the upward component of a winding by means of another.
            Some(up) if is_inclined => winding[axis] * up[1] != up[axis] * winding[1],
            _ => winding[axis] != 0,
        })
    };
    [along(0, is_sheared), up.is_some(), along(2, is_crossed)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::cell::Cell;
    use sd_core::contact::ContactState;
    use sd_core::{Bulk, Layer};

    fn of<S: Space>(cell: Cell<S>, centres: Vec<S::Vector>, pairs: &[(usize, usize)]) -> Clusters {
        let radii = vec![1.0; centres.len()];
        let pairs = pairs
            .iter()
            .map(|&(i, j)| (i, j, 1.0, 0.0, ContactState::Sticking));
        let network = Network::new(cell, centres, radii, pairs);
        clusters(&network, network.links.iter())
    }

    /// A column of four spheres in a cell of 8 × 8: the top one touches the image of the lowest
    /// only where the offset brings it there.
    fn column(offset: f64, lean: f64) -> Clusters {
        let centres = (0..4).map(|k| [1.0 + lean * f64::from(k), 1.0 + 2.0 * f64::from(k)].into());
        let cell = Cell::<Layer>::equal_sides(8.0, offset).unwrap();
        of(cell, centres.collect(), &[(0, 1), (1, 2), (2, 3), (3, 0)])
    }

    #[test]
    fn a_column_that_touches_itself_through_the_sheared_image_percolates_along_the_gradient() {
        // Each sphere leans by a quarter of the offset, so that the fourth touches the first in the
        // cell above.
        for (offset, lean) in [
            (0.0, 0.0),
            (2.0, 0.5),
            (-2.0, -0.5),
            (3.9, 0.975),
            (-4.0, -1.0),
        ] {
            let column = column(offset, lean);
            assert_eq!(column.percolates, [false, true, false], "{offset}");
            assert_eq!(column.largest_share(), 1.0);
        }
    }

    #[test]
    fn a_chain_that_does_not_close_does_not_percolate_though_it_crosses_the_border() {
        let cell = Cell::<Layer>::equal_sides(8.0, 1.0).unwrap();
        let centres: Vec<_> = (0..4)
            .map(|k| [7.0, 1.0 + 2.0 * f64::from(k)].into())
            .collect();
        let open = of(cell, centres.clone(), &[(1, 2), (2, 3), (3, 0)]);
        assert_eq!(open.percolates, [false; 3]);
        assert_eq!(
            (open.sizes.as_slice(), open.largest_share()),
            (&[4][..], 1.0)
        );
        let apart = of(cell, centres, &[(0, 1)]);
        assert_eq!(apart.sizes, [2, 1, 1]);
        assert_eq!(apart.largest_share(), 0.5);
        let none = column(0.0, 0.0);
        assert_eq!(none.of_sphere, [0; 4]);
    }

    #[test]
    fn a_way_around_within_the_cell_is_no_winding() {
        let cell = Cell::<Layer>::equal_sides(8.0, 3.0).unwrap();
        let square = [[7.5, 7.5], [9.5, 7.5], [9.5, 9.5], [7.5, 9.5]].map(Into::into);
        let wrapped = square.map(|x| cell.wrap(x));
        let ring = of(cell, wrapped.to_vec(), &[(0, 1), (1, 2), (2, 3), (3, 0)]);
        assert_eq!(
            (ring.percolates, ring.sizes.as_slice()),
            ([false; 3], &[4][..])
        );
    }

    #[test]
    fn whether_the_flow_direction_percolates_does_not_depend_on_how_the_offset_is_wrapped() {
        // A row along x, and the column: both together, and each alone.
        let row = |k: i32| [1.0 + 2.0 * f64::from(k), 1.0].into();
        let cell = |offset| Cell::<Layer>::equal_sides(8.0, offset).unwrap();
        let ring = [(0, 1), (1, 2), (2, 3), (3, 0)];
        let alone = of(cell(2.5), (0..4).map(row).collect(), &ring);
        assert_eq!(alone.percolates, [true, false, false]);
        // One winding (1, 1) is an inclined column, whatever the label of its image.
        assert_eq!(
            directions(&[[1, 1, 0]], [true, false]),
            [false, true, false]
        );
        assert_eq!(
            directions(&[[0, 1, 0], [0, 2, 0]], [true, false]),
            [false, true, false]
        );
        assert_eq!(
            directions(&[[0, 1, 0], [1, 1, 0]], [true, false]),
            [true, true, false]
        );
        assert_eq!(
            directions(&[[3, 0, 0]], [true, false]),
            [true, false, false]
        );
        assert_eq!(directions(&[], [true, false]), [false; 3]);
        // Along the vorticity too where the images above are shifted along it.
        assert_eq!(directions(&[[0, 1, 1]], [true, false]), [false, true, true]);
        assert_eq!(directions(&[[0, 1, 1]], [true, true]), [false, true, false]);
        assert_eq!(
            directions(&[[0, 1, 1], [0, 1, 0]], [true, true]),
            [false, true, true]
        );
    }

    #[test]
    fn a_suspension_percolates_along_the_vorticity() {
        let cell = Cell::<Bulk>::equal_sides(8.0, 3.0).unwrap();
        let centres = (0..4).map(|k| [1.0, 1.0, 1.0 + 2.0 * f64::from(k)].into());
        let column = of(cell, centres.collect(), &[(0, 1), (1, 2), (2, 3), (3, 0)]);
        assert_eq!(column.percolates, [false, false, true]);
    }
}
