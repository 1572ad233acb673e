//! Nested dissection: an order of elimination for large graphs.
//!
//! Without the vertices of a *separator*, no edge connects the two sides that are left. Both sides
//! come first, ordered in the same way, and the separator last (George 1973), so that no entry
//! between the sides fills, and threads can factor them at the same time. Small graphs have the
//! order of minimum degree.
//!
//! A separator is found on a coarse graph, in which pairs of neighbours are one vertex, as the edge
//! of a half around a vertex far from others. On the way back from graph to finer graph, moves of
//! single vertices make it smaller (Fiduccia & Mattheyses 1982; Karypis & Kumar 1998). All
//! quantities are integers, and ties go to the first vertex, so the order is the same everywhere.
//!
//! The factor of 10 000 spheres in a suspension that is close to jamming takes six tenths of the
//! operations that it takes in the order of minimum degree. The constants below matter little: of
//! 60 to 300 undivided vertices, sides of at most 0.55 to 0.65, 6 or 20 halves and a patience of 60
//! or 200 the operations differ by some 7 %, in a prototype.

use super::minimum_degree;
use faer::sparse::FaerError;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Fewest block rows that have this order.
pub(super) const LEAST_ROWS: usize = 5000;
/// Most vertices of a part that is not divided.
const UNDIVIDED: usize = 120;
/// Most vertices of the coarsest graph.
const COARSEST: usize = 100;
/// Halves of the coarsest graph from which a separator is sought.
const HALVES: usize = 6;
/// Most passes over a separator.
const PASSES: usize = 6;
/// Moves in succession that do not improve a separator, after which a pass ends.
const PATIENCE: usize = 60;

/// Number of the separator, beside the sides 0 and 1.
const SEPARATOR: usize = 2;

/// Position of each vertex in the order; `columns`: its neighbours and itself, ascending.
///
/// # Errors
/// Those of the order of minimum degree.
pub(super) fn order(columns: &[Vec<usize>]) -> Result<Vec<usize>, FaerError> {
    // Vertices with the same neighbours, such as the block rows of a sphere, are one.
    let mut numbers = BTreeMap::new();
    let mut members: Vec<Vec<usize>> = Vec::new();
    let mut owner = Vec::with_capacity(columns.len());
    for (vertex, column) in columns.iter().enumerate() {
        let number = *numbers.entry(column).or_insert(members.len());
        if number == members.len() {
            members.push(Vec::new());
        }
        members[number].push(vertex);
        owner.push(number);
    }
    let edges = members.iter().enumerate().map(|(number, members)| {
        let others = columns[members[0]].iter().map(|&other| owner[other]);
        sum_edges(
            others
                .filter(|&other| other != number)
                .map(|other| (other, 1)),
        )
    });
    let graph = Graph {
        edges: edges.collect(),
        weights: members.iter().map(Vec::len).collect(),
    };
    let mut ordered = Vec::with_capacity(members.len());
    graph.dissect(&(0..members.len()).collect::<Vec<_>>(), &mut ordered)?;
    let mut positions = vec![0; columns.len()];
    for (position, &vertex) in ordered.iter().flat_map(|&k| &members[k]).enumerate() {
        positions[vertex] = position;
    }
    Ok(positions)
}

/// Neighbours, ascending, with the number of edges to each.
fn sum_edges(edges: impl Iterator<Item = (usize, usize)>) -> Vec<(usize, usize)> {
    let mut sums = BTreeMap::new();
    for (other, count) in edges {
        *sums.entry(other).or_insert(0) += count;
    }
    sums.into_iter().collect()
}

/// A graph whose vertices and edges stand for several of a finer one.
#[derive(Debug)]
struct Graph {
    /// Neighbours of each vertex, ascending, and for how many edges an edge stands.
    edges: Vec<Vec<(usize, usize)>>,
    /// For how many vertices a vertex stands.
    weights: Vec<usize>,
}

impl Graph {
    fn len(&self) -> usize {
        self.weights.len()
    }

    /// Appends its vertices, which have these names, in their order.
    fn dissect(&self, names: &[usize], ordered: &mut Vec<usize>) -> Result<(), FaerError> {
        let division = (self.len() > UNDIVIDED).then(|| self.divide());
        let Some(division) = division.filter(|division| division.sizes[..SEPARATOR] != [0, 0])
        else {
            return self.by_degree(names, ordered);
        };
        for side in 0..SEPARATOR {
            let (part, of_part) = self.part(&division.places, side);
            let names: Vec<_> = of_part.iter().map(|&vertex| names[vertex]).collect();
            if part.len() < self.len() {
                part.dissect(&names, ordered)?;
            } else {
                part.by_degree(&names, ordered)?;
            }
        }
        let places = division.places.iter().zip(names);
        ordered.extend(
            places
                .filter(|(place, _)| **place == SEPARATOR)
                .map(|(_, name)| name),
        );
        Ok(())
    }

    /// Appends its vertices in the order of minimum degree.
    fn by_degree(&self, names: &[usize], ordered: &mut Vec<usize>) -> Result<(), FaerError> {
        let columns = self.edges.iter().enumerate().map(|(vertex, edges)| {
            let mut column: Vec<_> = edges.iter().map(|&(other, _)| other).collect();
            column.push(vertex);
            column.sort_unstable();
            column
        });
        let positions = minimum_degree(&columns.collect::<Vec<_>>())?;
        let first = ordered.len();
        ordered.resize(first + names.len(), 0);
        for (position, &name) in positions.into_iter().zip(names) {
            ordered[first + position] = name;
        }
        Ok(())
    }

    /// The graph of the vertices in one place, and their numbers in this one.
    fn part(&self, places: &[usize], place: usize) -> (Self, Vec<usize>) {
        let vertices = (0..self.len()).filter(|&vertex| places[vertex] == place);
        let vertices: Vec<_> = vertices.collect();
        let mut numbers = vec![usize::MAX; self.len()];
        for (number, &vertex) in vertices.iter().enumerate() {
            numbers[vertex] = number;
        }
        let edges = vertices.iter().map(|&vertex| {
            let edges = self.edges[vertex].iter();
            let edges = edges.map(|&(other, count)| (numbers[other], count));
            edges.filter(|&(other, _)| other != usize::MAX).collect()
        });
        let part = Self {
            edges: edges.collect(),
            weights: vertices
                .iter()
                .map(|&vertex| self.weights[vertex])
                .collect(),
        };
        (part, vertices)
    }

    /// A small separator between two sides of similar weight.
    fn divide(&self) -> Division<'_> {
        let mut division = if self.len() <= COARSEST {
            self.divide_in_half()
        } else {
            let (coarse, of_coarse) = self.coarsen();
            if 20 * coarse.len() > 19 * self.len() {
                return self.divide_in_half();
            }
            let of_coarse_vertices = coarse.divide().places;
            let places = of_coarse.iter().map(|&vertex| of_coarse_vertices[vertex]);
            Division::new(self, places.collect())
        };
        division.improve();
        division
    }

    /// The graph in which neighbours are joined in pairs, and the vertex in it of each vertex.
    /// Vertices with few neighbours choose first, where most edges lead.
    fn coarsen(&self) -> (Self, Vec<usize>) {
        let mut vertices: Vec<usize> = (0..self.len()).collect();
        vertices.sort_by_key(|&vertex| self.edges[vertex].len());
        let mut of_coarse = vec![usize::MAX; self.len()];
        let mut weights = Vec::new();
        for vertex in vertices {
            if of_coarse[vertex] != usize::MAX {
                continue;
            }
            let free = self.edges[vertex].iter();
            let free = free.filter(|&&(other, _)| of_coarse[other] == usize::MAX);
            let partner = free.min_by_key(|&&(other, count)| (Reverse(count), self.weights[other]));
            of_coarse[vertex] = weights.len();
            let mut weight = self.weights[vertex];
            if let Some(&(partner, _)) = partner {
                of_coarse[partner] = weights.len();
                weight += self.weights[partner];
            }
            weights.push(weight);
        }
        let mut edges = vec![Vec::new(); weights.len()];
        for (vertex, own) in self.edges.iter().enumerate() {
            let own = own.iter().map(|&(other, count)| (of_coarse[other], count));
            edges[of_coarse[vertex]].extend(own.filter(|&(other, _)| other != of_coarse[vertex]));
        }
        let edges = edges.into_iter().map(|edges| sum_edges(edges.into_iter()));
        let edges = edges.collect();
        (Self { edges, weights }, of_coarse)
    }

    /// The best of several separators, each around half of the graph.
    fn divide_in_half(&self) -> Division<'_> {
        let half = self.weights.iter().sum::<usize>() / 2;
        let around = |k: usize| {
            let far = self.by_distance(k * self.len() / HALVES);
            let mut places = vec![1; self.len()];
            let mut weight = 0;
            for vertex in self.by_distance(far[far.len() - 1]) {
                if weight >= half {
                    break;
                }
                weight += self.weights[vertex];
                places[vertex] = 0;
            }
            let is_at_edge = |vertex: usize| {
                let mut edges = self.edges[vertex].iter();
                places[vertex] == 0 && edges.any(|&(other, _)| places[other] == 1)
            };
            let at_edge: Vec<_> = (0..self.len())
                .filter(|&vertex| is_at_edge(vertex))
                .collect();
            for vertex in at_edge {
                places[vertex] = SEPARATOR;
            }
            let mut division = Division::new(self, places);
            division.improve();
            division
        };
        let mut best = around(0);
        for division in (1..HALVES).map(around) {
            if division.cost() < best.cost() {
                best = division;
            }
        }
        best
    }

    /// All vertices, by their distance from one; those that it does not reach come last.
    fn by_distance(&self, from: usize) -> Vec<usize> {
        let mut is_seen = vec![false; self.len()];
        is_seen[from] = true;
        let mut found = vec![from];
        let mut at = 0;
        while let Some(&vertex) = found.get(at) {
            at += 1;
            for &(other, _) in &self.edges[vertex] {
                if !std::mem::replace(&mut is_seen[other], true) {
                    found.push(other);
                }
            }
        }
        found.extend((0..self.len()).filter(|&vertex| !is_seen[vertex]));
        found
    }
}

/// A graph divided in two sides and a separator.
#[derive(Debug)]
struct Division<'g> {
    graph: &'g Graph,
    /// Side of each vertex, or [`SEPARATOR`].
    places: Vec<usize>,
    /// Weight of each place.
    sizes: [usize; 3],
}

impl<'g> Division<'g> {
    fn new(graph: &'g Graph, places: Vec<usize>) -> Self {
        let mut sizes = [0; 3];
        for (&place, weight) in places.iter().zip(&graph.weights) {
            sizes[place] += weight;
        }
        Self {
            graph,
            places,
            sizes,
        }
    }

    /// Weight of the separator, then the difference of the sides.
    fn cost(&self) -> (usize, usize) {
        let [first, second, separator] = self.sizes;
        (separator, first.abs_diff(second))
    }

    /// Whether a side may have this weight.
    fn is_allowed(&self, weight: usize) -> bool {
        5 * weight <= 3 * self.sizes.iter().sum::<usize>()
    }

    fn set(&mut self, vertex: usize, place: usize) {
        let weight = self.graph.weights[vertex];
        self.sizes[self.places[vertex]] -= weight;
        self.sizes[place] += weight;
        self.places[vertex] = place;
    }

    /// Makes the separator smaller, in passes as long as they help.
    fn improve(&mut self) {
        for _ in 0..PASSES {
            if !self.pass() {
                return;
            }
        }
    }

    /// Moves vertices of the separator to a side, and their neighbours on the other side into it;
    /// each vertex once, and each time the one after which the separator is smallest, even if it
    /// grows. Then all moves after the best division are taken back.
    ///
    /// Returns whether the division is better than before.
    fn pass(&mut self) -> bool {
        let mut is_moved = vec![false; self.graph.len()];
        let separator = self.places.iter().enumerate();
        let mut separator: Vec<usize> = separator
            .filter(|(_, place)| **place == SEPARATOR)
            .map(|(vertex, _)| vertex)
            .collect();
        // Vertices with their places before, move after move.
        let mut undo: Vec<(usize, usize)> = Vec::new();
        let (mut best, mut kept, mut without) = (self.cost(), 0, 0);
        while without < PATIENCE {
            let Some((at, side)) = self.best_move(&separator) else {
                break;
            };
            let vertex = separator.swap_remove(at);
            is_moved[vertex] = true;
            undo.push((vertex, SEPARATOR));
            self.set(vertex, side);
            for &(other, _) in &self.graph.edges[vertex] {
                if self.places[other] == 1 - side {
                    undo.push((other, 1 - side));
                    self.set(other, SEPARATOR);
                    if !is_moved[other] {
                        separator.push(other);
                    }
                }
            }
            let allowed = self.is_allowed(self.sizes[0].max(self.sizes[1]));
            if allowed && self.cost() < best {
                (best, kept, without) = (self.cost(), undo.len(), 0);
            } else {
                without += 1;
            }
        }
        for (vertex, place) in undo.drain(kept..).rev() {
            self.set(vertex, place);
        }
        kept > 0
    }

    /// The place in the list of the vertex to move next, and its side.
    fn best_move(&self, separator: &[usize]) -> Option<(usize, usize)> {
        let weights = &self.graph.weights;
        let moves = separator.iter().enumerate().flat_map(|(at, &vertex)| {
            let mut pulled = [0; 3];
            for &(other, _) in &self.graph.edges[vertex] {
                pulled[self.places[other]] += weights[other];
            }
            [0, 1].map(|side| (at, vertex, side, pulled[1 - side]))
        });
        let moves = moves.filter(|&(_, vertex, side, _)| {
            let smaller = self.sizes[side] < self.sizes[1 - side];
            smaller || self.is_allowed(self.sizes[side] + weights[vertex])
        });
        let best = moves.min_by_key(|&(_, vertex, side, pulled)| {
            // Growth of the separator, shifted by a constant.
            let growth = (pulled + self.sizes[SEPARATOR]).saturating_sub(weights[vertex]);
            (growth, self.sizes[side], vertex)
        });
        best.map(|(at, _, side, _)| (at, side))
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns;
    use super::super::tests::{cube, matrix};
    use super::*;

    /// A square of vertices with edges to the four neighbours.
    fn square(side: usize) -> Graph {
        let edges = (0..side * side).map(|k| {
            let (x, y) = (k % side, k / side);
            let mut edges = Vec::new();
            for (is_inside, other) in [
                (y > 0, k.wrapping_sub(side)),
                (x > 0, k.wrapping_sub(1)),
                (x + 1 < side, k + 1),
                (y + 1 < side, k + side),
            ] {
                if is_inside {
                    edges.push((other, 1));
                }
            }
            edges
        });
        Graph {
            edges: edges.collect(),
            weights: vec![1; side * side],
        }
    }

    #[test]
    fn a_separator_leaves_no_edge_between_the_sides_and_is_about_as_short_as_a_straight_one() {
        for side in [12, 30, 60] {
            let graph = square(side);
            let division = graph.divide();
            for (vertex, edges) in graph.edges.iter().enumerate() {
                for &(other, _) in edges {
                    let places = [division.places[vertex], division.places[other]];
                    assert!(!matches!(places, [0, 1] | [1, 0]));
                }
            }
            let [first, second, separator] = division.sizes;
            assert!(4 * separator <= 5 * side, "side {side}: {separator}");
            assert!(5 * first.max(second) <= 3 * side * side);
        }
    }

    #[test]
    fn an_order_names_each_vertex_once_and_keeps_equal_vertices_together() {
        // Two block rows for each vertex of a square, as a sphere of a suspension has.
        let columns: Vec<Vec<usize>> = square(20)
            .edges
            .iter()
            .enumerate()
            .flat_map(|(vertex, edges)| {
                let mut column: Vec<_> = edges.iter().map(|&(other, _)| other).collect();
                column.push(vertex);
                column.sort_unstable();
                let rows = column.into_iter().flat_map(|k| [2 * k, 2 * k + 1]);
                let rows: Vec<_> = rows.collect();
                [rows.clone(), rows]
            })
            .collect();
        let positions = order(&columns).unwrap();
        let mut sorted = positions.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..800));
        assert!(positions.chunks(2).all(|rows| rows[1] == rows[0] + 1));
    }

    #[test]
    fn graphs_without_edges_or_with_several_parts_have_an_order() {
        let alone = |count: usize| (0..count).map(|k| vec![k]).collect::<Vec<_>>();
        let pairs: Vec<Vec<usize>> = (0..600).map(|k| vec![k / 2 * 2, k / 2 * 2 + 1]).collect();
        let cross: Vec<Vec<usize>> = (0..400)
            .map(|k| {
                if k == 0 {
                    (0..400).collect()
                } else {
                    vec![0, k]
                }
            })
            .collect();
        for columns in [alone(1), alone(500), pairs, cross] {
            let mut positions = order(&columns).unwrap();
            positions.sort_unstable();
            assert!(positions.into_iter().eq(0..columns.len()));
        }
    }

    #[test]
    fn a_large_lattice_has_a_small_factor_with_the_same_bits_for_two_threads() {
        let (side, couplings) = (18, cube(18));
        let columns = columns(side * side * side, &couplings);
        assert!(columns.len() >= LEAST_ROWS);
        let values = |positions: &[usize]| fill(&columns, positions);
        let (ours, theirs) = (
            values(&order(&columns).unwrap()),
            values(&minimum_degree(&columns).unwrap()),
        );
        assert!(10 * ours < 9 * theirs, "{ours} of {theirs}");
        let (pattern, mut one) = matrix(columns.len(), couplings.clone());
        one.factor(&pattern).unwrap();
        let r: Vec<f64> = (0..3 * columns.len()).map(|k| (k as f64).cos()).collect();
        let mut z = vec![0.0; r.len()];
        one.solve(&pattern, &r, &mut z);
        let (_, mut many) = matrix(columns.len(), couplings);
        let threads = crate::threads::threads_for_small_work(2).unwrap();
        let mut of_two = vec![0.0; r.len()];
        threads.run(|| {
            many.factor(&pattern).unwrap();
            many.solve(&pattern, &r, &mut of_two);
        });
        assert_eq!(z, of_two);
    }

    /// Blocks of the factor.
    fn fill(columns: &[Vec<usize>], positions: &[usize]) -> usize {
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); columns.len()];
        for (vertex, column) in columns.iter().enumerate() {
            let own = positions[vertex];
            let rows = column.iter().map(|&other| positions[other]);
            below[own] = rows.filter(|&row| row > own).collect();
        }
        let mut count = 0;
        for k in 0..columns.len() {
            let mut rows = std::mem::take(&mut below[k]);
            rows.sort_unstable();
            rows.dedup();
            count += rows.len();
            if let Some((&parent, rest)) = rows.split_first() {
                below[parent].extend(rest);
            }
        }
        count
    }
}
