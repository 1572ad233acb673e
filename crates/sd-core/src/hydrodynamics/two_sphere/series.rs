//! The resistance functions at one separation, from the coupled multipoles of the two spheres.
//!
//! The published recurrences (Jeffrey & Onishi 1984, Jeffrey 1992) expand the solution of a linear
//! system in powers of `a/r`; near contact that expansion no longer converges usefully. Here the
//! system itself is solved at the given separation, which converges exponentially in the number of
//! multipoles. With `x` the multipoles `(P_n, V_n, Q_n)` of a sphere and `b` the start,
//!
//! ```text
//! x1 = b1 + K12 x2,   x2 = b2 + K21 x1   ⟹   (I − K12 K21) x1 = b1 + K12 b2
//! ```
//!
//! where the unknowns of the sphere with fewer multipoles are kept. All coefficients are rational
//! multiples of
//!
//! ```text
//! T(n,s) = C(n+s, n) t^n t'^s,   t = a/r,   T(n,s) = t T(n−1,s) + t' T(n,s−1)
//! ```
//!
//! a sum of positive terms that neither overflows nor cancels at any order.

use super::{Scalars, ordered};
use crate::linalg::dense::{Matrix, add_outer, add_scaled};
use crate::linalg::lu;
use crate::linalg::whole;

/// Multipoles kept per unit of 1/α, α the bispherical coordinate of the sphere's surface.
const ORDERS_PER_ALPHA: f64 = 16.0;
/// Fewest multipoles kept.
const MINIMUM_ORDER: usize = 14;
/// Orders of the eliminated sphere handled together, to bound memory.
const CHUNK: usize = 512;
/// Place, after the two starts of family X, of the pressure at the centre of the other sphere.
const FIELD: usize = 2;

/// Two spheres, the first of radius 1.
#[derive(Debug, Clone, Copy)]
struct Geometry {
    radii: [f64; 2],
    distance: f64,
    gap: f64,
}

impl Geometry {
    /// The geometry from the size ratio a2/a1 and ξ.
    fn new(size_ratio: f64, xi: f64) -> Self {
        let mean = 0.5 * (1.0 + size_ratio);
        Self {
            radii: [1.0, size_ratio],
            distance: mean * (2.0 + xi),
            gap: mean * xi,
        }
    }

    /// Orders kept for a sphere: the multipoles decay as `exp(−n α)`, their effect as its square.
    fn order(&self, sphere: usize, effort: f64) -> usize {
        let (own, other) = (self.radii[sphere], self.radii[1 - sphere]);
        // cosh α − 1 = (r² + a² − a'²)/(2ra) − 1, without cancellation.
        let x = self.gap * (self.distance - own + other) / (2.0 * self.distance * own);
        let alpha = (x + (x * (2.0 + x)).sqrt()).ln_1p();
        let order = whole((effort * ORDERS_PER_ALPHA / alpha).ceil());
        order.max(MINIMUM_ORDER)
    }

    /// `a/r` of a sphere.
    fn ratio(&self, sphere: usize) -> f64 {
        self.radii[sphere] / self.distance
    }
}

/// The azimuthal number of a system: 0, 1 or 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Family {
    /// Along the line of centres.
    X,
    /// Across it.
    Y,
    /// Strain in the plane normal to it.
    Z,
}

/// Coupling of a multipole of order s of the other sphere to those of order n.
struct Coupling {
    /// `P_n` from `P'_s`.
    pp: f64,
    /// `V_n` from `P'_s`.
    vp: f64,
    /// `P_n` and `V_n` from `V'_s`.
    pv: f64,
    /// `P_n` and `V_n` from `Q'_s`.
    pq: f64,
    /// `Q_n` from `P'_s`.
    qp: f64,
    /// `Q_n` from `Q'_s`.
    qq: f64,
}

impl Family {
    /// Lowest order.
    fn first(self) -> usize {
        if self == Self::Z { 2 } else { 1 }
    }

    /// Number of kinds of multipole.
    fn kinds(self) -> usize {
        if self == Self::X { 2 } else { 3 }
    }

    /// Starts used: (kind, order).
    fn starts(self) -> &'static [(usize, usize)] {
        match self {
            Self::X => &[(0, 1), (0, 2)],
            Self::Y => &[(0, 1), (2, 1), (0, 2)],
            Self::Z => &[(0, 2)],
        }
    }

    /// The coefficients, given `T(n,s)`; t and t' belong to n and s.
    fn coupling(self, n: f64, s: f64, t: f64, t_other: f64, binomial: f64) -> Coupling {
        let n1 = n + 1.0;
        let tt = t * t;
        let source = n * (4.0 * n * n - 1.0) / (2.0 * n1 * (2.0 * s + 1.0)) * t_other * t_other;
        let near = tt * n * (2.0 * n - 1.0) / (2.0 * n1);
        let volume = tt * 2.0 * n / (n1 * (2.0 * n + 3.0));
        let both = (n + s) * (2.0 * s - 1.0);
        match self {
            Self::X => {
                let c = binomial / t;
                let pp = c
                    * (n * (2.0 * n + 1.0) * (2.0 * n * s - n - s + 2.0) / (2.0 * n1 * both)
                        - near);
                Coupling {
                    pp,
                    vp: pp - c * volume,
                    pv: -c * source,
                    pq: 0.0,
                    qp: 0.0,
                    qq: 0.0,
                }
            }
            Self::Y => {
                let c = binomial * s / (n1 * t);
                let far = 3.0 * (n + s) - (n * s + 1.0) * (2.0 * n * s - s - n + 2.0);
                let pp = c * ((2.0 * n + 1.0) / (2.0 * n1) * far / (s * both) + near);
                Coupling {
                    pp,
                    vp: pp + c * volume,
                    pv: c * source,
                    pq: -c * t_other * 2.0 * (4.0 * n * n - 1.0) / (3.0 * n1),
                    qp: -c * t * 1.5 / (n * s * n1),
                    qq: c * t * t_other * s / n1,
                }
            }
            Self::Z => {
                let c = binomial * s * (s - 1.0) / (n1 * (n + 2.0) * t);
                let far = n * s * (n + s - 2.0 * n * s - 2.0)
                    - 4.0 * (2.0 * n * s - 4.0 * s - 4.0 * n + 2.0);
                let pp = c * ((2.0 * n + 1.0) / n1 * far / (2.0 * s * both) + near);
                Coupling {
                    pp,
                    vp: pp + c * volume,
                    pv: c * source,
                    pq: -c * t_other * 2.0 * (4.0 * n * n - 1.0) / n1,
                    qp: -c * t * 2.0 / (n * s * n1),
                    qq: c * t * t_other * s / n1,
                }
            }
        }
    }
}

/// `T(·,s)` for successive s.
struct Binomials {
    /// `T(n,s)`, n from 0.
    column: Vec<f64>,
    /// `t` of the sphere counted by n.
    t: f64,
    /// `t` of the sphere counted by s.
    t_other: f64,
}

impl Binomials {
    /// The column of s = 0.
    fn new(orders: usize, t: f64, t_other: f64) -> Self {
        let mut column = vec![1.0; orders + 1];
        for n in 1..=orders {
            column[n] = flush(t * column[n - 1]);
        }
        Self { column, t, t_other }
    }

    /// Advances to the column of the next s.
    fn advance(&mut self) {
        self.column[0] = flush(self.t_other * self.column[0]);
        for n in 1..self.column.len() {
            self.column[n] = flush(self.t * self.column[n - 1] + self.t_other * self.column[n]);
        }
    }
}

/// Sets tiny numbers to zero: they are negligible, and subnormal arithmetic is slow.
fn flush(x: f64) -> f64 {
    if x < 1e-290 { 0.0 } else { x }
}

/// Adds a unit start of `kind` and `order` to a column of multipoles.
fn add_start(column: &mut [f64], family: Family, orders: usize, (kind, order): (usize, usize)) {
    column[kind * orders + order - family.first()] += 1.0;
    if kind == 0 {
        column[orders + order - family.first()] += 1.0;
    }
}

/// Multipoles `[observer][start sphere]`, each `[start × observed]` with starts and observed
/// multipoles numbered as [`Family::starts`]; at [`FIELD`] of family X the sum `Σ tˢ P_s` over
/// those of the observer, which is the pressure that they make at the centre of the other sphere.
type Response = [[[[f64; 3]; 3]; 2]; 2];

fn respond(family: Family, geometry: &Geometry, effort: f64) -> Response {
    if geometry.radii[0].to_bits() == geometry.radii[1].to_bits() {
        respond_equal(family, geometry, effort)
    } else {
        respond_unequal(family, geometry, effort)
    }
}

/// Number of unknowns with `orders` multipoles of each kind.
fn count(family: Family, orders: usize) -> usize {
    family.kinds() * (orders + 1 - family.first())
}

/// Writes the columns of order s of K (rows: orders n of the sphere of `binomials.t`).
fn fill_columns(
    k: &mut Matrix,
    family: Family,
    binomials: &Binomials,
    s: usize,
    at: usize,
    step: usize,
) {
    let first = family.first();
    let rows = binomials.column.len() - first;
    for n in first..binomials.column.len() {
        let c = family.coupling(
            n as f64,
            s as f64,
            binomials.t,
            binomials.t_other,
            binomials.column[n],
        );
        let row = n - first;
        k[(row, at)] = c.pp;
        k[(rows + row, at)] = c.vp;
        k[(row, at + step)] = c.pv;
        k[(rows + row, at + step)] = c.pv;
        if family.kinds() == 3 {
            k[(2 * rows + row, at)] = c.qp;
            k[(row, at + 2 * step)] = c.pq;
            k[(rows + row, at + 2 * step)] = c.pq;
            k[(2 * rows + row, at + 2 * step)] = c.qq;
        }
    }
}

/// Writes, as columns, the rows of order s of the opposite coupling (columns: orders n).
fn fill_rows(
    k: &mut Matrix,
    family: Family,
    binomials: &Binomials,
    s: usize,
    at: usize,
    step: usize,
) {
    let first = family.first();
    let rows = binomials.column.len() - first;
    for n in first..binomials.column.len() {
        let c = family.coupling(
            s as f64,
            n as f64,
            binomials.t_other,
            binomials.t,
            binomials.column[n],
        );
        let row = n - first;
        k[(row, at)] = c.pp;
        k[(row, at + step)] = c.vp;
        k[(rows + row, at)] = c.pv;
        k[(rows + row, at + step)] = c.pv;
        if family.kinds() == 3 {
            k[(row, at + 2 * step)] = c.qp;
            k[(2 * rows + row, at)] = c.pq;
            k[(2 * rows + row, at + step)] = c.pq;
            k[(2 * rows + row, at + 2 * step)] = c.qq;
        }
    }
}

/// `Σ tˢ P_s`, s from 1.
fn field(multipoles: &[f64], t: f64) -> f64 {
    multipoles.iter().rev().fold(0.0, |sum, p| t * (p + sum))
}

/// Equal spheres: motions alike and opposite decouple.
fn respond_equal(family: Family, geometry: &Geometry, effort: f64) -> Response {
    let order = geometry.order(0, effort);
    let (first, size) = (family.first(), count(family, order));
    let orders = order + 1 - first;
    let mut coupling = Matrix::zeros(size, size);
    let mut binomials = Binomials::new(order, geometry.ratio(0), geometry.ratio(1));
    for s in 1..=order {
        binomials.advance();
        if s >= first {
            fill_columns(&mut coupling, family, &binomials, s, s - first, orders);
        }
    }
    let mut response = Response::default();
    let starts = family.starts();
    for sign in [1.0, -1.0] {
        let mut matrix = coupling.clone();
        for x in matrix.values_mut() {
            *x *= -sign;
        }
        let mut x = Matrix::zeros(size, starts.len());
        for k in 0..size {
            matrix[(k, k)] += 1.0;
        }
        for (k, &start) in starts.iter().enumerate() {
            add_start(x.column_mut(k), family, orders, start);
        }
        lu::solve_once(&mut matrix, &mut x).expect("separated spheres have a regular system");
        for k in 0..starts.len() {
            for (m, &(kind, order)) in starts.iter().enumerate() {
                let value = 0.5 * x[(kind * orders + order - first, k)];
                for observer in 0..2 {
                    response[observer][observer][k][m] += value;
                    response[observer][1 - observer][k][m] += sign * value;
                }
            }
            if family == Family::X {
                let value = 0.5 * field(&x.column(k)[..orders], geometry.ratio(0));
                for observer in 0..2 {
                    response[observer][observer][k][FIELD] += value;
                    response[observer][1 - observer][k][FIELD] += sign * value;
                }
            }
        }
    }
    response
}

/// Unequal spheres: the one with more multipoles is eliminated, a chunk of orders at a time.
fn respond_unequal(family: Family, geometry: &Geometry, effort: f64) -> Response {
    let kept = usize::from(geometry.order(0, effort) > geometry.order(1, effort));
    let order = geometry.order(kept, effort);
    let last = geometry.order(1 - kept, effort);
    let (first, size) = (family.first(), count(family, order));
    let orders = order + 1 - first;
    let starts = family.starts();
    let mut matrix = Matrix::zeros(size, size);
    for k in 0..size {
        matrix[(k, k)] = 1.0;
    }
    // Columns: starts on the kept sphere, then on the other.
    let mut x = Matrix::zeros(size, 2 * starts.len());
    for (k, &start) in starts.iter().enumerate() {
        add_start(x.column_mut(k), family, orders, start);
    }
    let mut observed = Matrix::zeros(size, starts.len());
    // The pressure of the eliminated sphere at the centre of the kept one.
    let mut pressure = vec![0.0; size];
    let mut power = 1.0;
    let mut binomials = Binomials::new(order, geometry.ratio(kept), geometry.ratio(1 - kept));
    let (mut inward, mut outward) = (Matrix::default(), Matrix::default());
    if first == 2 {
        binomials.advance();
    }
    let mut begin = first;
    while begin <= last {
        let width = CHUNK.min(last + 1 - begin);
        inward.reset(size, width * family.kinds());
        outward.reset(size, width * family.kinds());
        for at in 0..width {
            binomials.advance();
            fill_columns(&mut inward, family, &binomials, begin + at, at, width);
            fill_rows(&mut outward, family, &binomials, begin + at, at, width);
        }
        add_outer(&mut matrix, &inward, &outward, -1.0);
        if family == Family::X {
            for at in 0..width {
                power *= geometry.ratio(1 - kept);
                add_scaled(&mut pressure, outward.column(at), power);
            }
        }
        if begin == first {
            for (k, &(kind, order)) in starts.iter().enumerate() {
                let at = order - first;
                let column = x.column_mut(starts.len() + k);
                column.copy_from_slice(inward.column(kind * width + at));
                if kind == 0 {
                    for (x, v) in column.iter_mut().zip(inward.column(width + at)) {
                        *x += v;
                    }
                }
                observed
                    .column_mut(k)
                    .copy_from_slice(outward.column(kind * width + at));
            }
        }
        begin += width;
    }
    lu::solve_once(&mut matrix, &mut x).expect("separated spheres have a regular system");
    let mut response = Response::default();
    for k in 0..2 * starts.len() {
        let (start, sphere) = if k < starts.len() {
            (k, kept)
        } else {
            (k - starts.len(), 1 - kept)
        };
        for (m, &(kind, order)) in starts.iter().enumerate() {
            response[kept][sphere][start][m] = x[(kind * orders + order - first, k)];
            let own = f64::from(u8::from(sphere != kept && m == start));
            response[1 - kept][sphere][start][m] =
                own + crate::linalg::dense::dot(observed.column(m), x.column(k));
        }
        if family == Family::X {
            let multipoles = &x.column(k)[..orders];
            response[kept][sphere][start][FIELD] = field(multipoles, geometry.ratio(kept));
            let own = if sphere == kept {
                0.0
            } else {
                geometry.ratio(1 - kept).powf(starts[start].1 as f64)
            };
            response[1 - kept][sphere][start][FIELD] =
                own + crate::linalg::dense::dot(&pressure, x.column(k));
        }
    }
    response
}

/// Both labellings of the resistance functions of one pair: with the first sphere as 1, and with
/// the second.
///
/// `effort` multiplies the number of multipoles; 1 gives 1e-11.
pub(super) fn solve(size_ratio: f64, xi: f64, effort: f64) -> [Scalars; 2] {
    let (ratio, swapped) = ordered(size_ratio);
    let geometry = Geometry::new(ratio, xi);
    let x = respond(Family::X, &geometry, effort);
    let y = respond(Family::Y, &geometry, effort);
    let z = respond(Family::Z, &geometry, effort);
    let label = |one: usize| {
        let two = 1 - one;
        let lambda = geometry.radii[two] / geometry.radii[one];
        let (x1, x2) = (&x[one][one], &x[one][two]);
        let (y1, y2) = (&y[one][one], &y[one][two]);
        Scalars {
            x_a: [x1[0][0], -x2[0][0]],
            x_g: [0.75 * x1[0][1], -0.75 * x2[0][1]],
            x_m: [x1[1][1], lambda * x2[1][1]],
            y_a: [y1[0][0], -y2[0][0]],
            y_b: [2.0 * y1[0][1], -2.0 * y2[0][1]],
            y_g: [0.75 * y1[0][2], -0.75 * y2[0][2]],
            y_c: [y1[1][1], lambda * y2[1][1]],
            y_h: [-0.375 * y1[1][2], -0.375 * lambda * y2[1][2]],
            y_m: [y1[2][2], lambda * y2[2][2]],
            z_m: [z[one][one][0][0], -lambda * z[one][two][0][0]],
        }
    };
    if swapped {
        [label(1), label(0)]
    } else {
        [label(0), label(1)]
    }
}

/// Both labellings of the pressure moments, `[X11P, X11Q, X12P, X12Q]`: see [`super::pressure`].
pub(super) fn pressure_moments(size_ratio: f64, xi: f64, effort: f64) -> [[f64; 4]; 2] {
    let (ratio, swapped) = ordered(size_ratio);
    let geometry = Geometry::new(ratio, xi);
    let x = respond(Family::X, &geometry, effort);
    let label = |one: usize| {
        let two = 1 - one;
        let lambda = geometry.radii[two] / geometry.radii[one];
        let scale = 1.5 * geometry.ratio(one);
        // In the scale of P_1 a strain along the line of centres starts P_2 with 10/3 of its
        // radius.
        let strain = scale * 10.0 / 3.0;
        let (own, other) = (&x[two][one], &x[two][two]);
        [
            scale * own[0][FIELD],
            strain * own[1][FIELD],
            -scale * other[0][FIELD],
            strain * lambda * other[1][FIELD],
        ]
    };
    if swapped {
        [label(1), label(0)]
    } else {
        [label(0), label(1)]
    }
}
