//! The k-core of a network.

use super::network::{Link, Network};
use sd_core::Space;

/// Spheres of the k-core of some contacts: the remainder after repeated removal of spheres with
/// fewer than `k` contacts to remaining spheres.
pub(crate) fn core<'n, S: Space>(
    network: &'n Network<S>,
    links: impl Iterator<Item = &'n Link<S>>,
    k: usize,
) -> Vec<bool> {
    let neighbours = network.neighbours(links);
    let mut degrees: Vec<usize> = neighbours.iter().map(Vec::len).collect();
    let mut is_left = vec![true; network.spheres()];
    let mut waiting: Vec<usize> = (0..degrees.len()).filter(|&i| degrees[i] < k).collect();
    for &sphere in &waiting {
        is_left[sphere] = false;
    }
    while let Some(sphere) = waiting.pop() {
        for &(other, _) in &neighbours[sphere] {
            if is_left[other] {
                degrees[other] -= 1;
                if degrees[other] < k {
                    is_left[other] = false;
                    waiting.push(other);
                }
            }
        }
    }
    is_left
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::Layer;
    use sd_core::cell::Cell;
    use sd_core::contact::ContactState;

    fn left(n: usize, pairs: &[(usize, usize)], k: usize) -> Vec<usize> {
        let centres: Vec<_> = (0..n).map(|i| [i as f64, 0.0].into()).collect();
        let pairs = pairs
            .iter()
            .map(|&(i, j)| (i, j, 1.0, 0.0, ContactState::Sticking));
        let network = Network::<Layer>::new(Cell::Unbounded, centres, vec![1.0; n], pairs);
        let is_left = core(&network, network.links.iter(), k);
        (0..n).filter(|&i| is_left[i]).collect()
    }

    #[test]
    fn cores_of_graphs_known_by_hand() {
        // A complete graph of four, a triangle hung to it, and a tail.
        let pairs = [
            (0, 1),
            (0, 2),
            (0, 3),
            (1, 2),
            (1, 3),
            (2, 3),
            (3, 4),
            (4, 5),
            (5, 3),
            (5, 6),
            (6, 7),
        ];
        assert_eq!(left(9, &pairs, 3), [0, 1, 2, 3]);
        assert_eq!(left(9, &pairs, 2), [0, 1, 2, 3, 4, 5]);
        assert_eq!(left(9, &pairs, 1), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(left(9, &pairs, 4), [] as [usize; 0]);
        assert_eq!(left(9, &pairs, 0).len(), 9);
    }

    #[test]
    fn a_wheel_loses_its_rim_and_then_its_hub() {
        // Every sphere of the rim has three contacts; without one link of the rim two have two, and
        // all fall one after the other.
        let rim = 6;
        let mut pairs: Vec<(usize, usize)> = (0..rim).map(|i| (i, (i + 1) % rim)).collect();
        pairs.extend((0..rim).map(|i| (i, rim)));
        assert_eq!(left(rim + 1, &pairs, 3).len(), rim + 1);
        pairs.remove(0);
        assert_eq!(left(rim + 1, &pairs, 3), [] as [usize; 0]);
    }
}
