//! One instant of a published code of soft spheres (LF_DEM) in three dimensions: springs, friction,
//! leading-order lubrication, two sizes.
//!
//! The model of that code differs from ours where spheres overlap, and in its stress; the test adds
//! the differences, from its own tables of coefficients, and then expects the same numbers:
//!
//! | | that code | ours |
//! | --- | --- | --- |
//! | pairs that overlap, X functions | a dashpot of 40 times the coefficient | 1/δ = 1000 times |
//! | pairs that overlap | no forces from the rate of strain, no stresslet | both, as of a pair at contact |
//! | stiffness | k (a_i + a_j)/2 | the same for all pairs |
//! | stress | keeps the trace; no isolated stresslets; Y^M where the rotation of a sphere has Y^H | traceless; all of them |

use crate::common::data::{data, difference, numbers, vectors};
use nalgebra::{Matrix3, Vector3};
use sd_core::cell::Cell;
use sd_core::contact::{ContactState, Laws, NormalForce, PairForces, Surface};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::internals::{Resistance, StageSolver};
use sd_core::law::hydrodynamic_friction::HydrodynamicFriction;
use sd_core::{
    Bulk, FrictionOnset, Hydrodynamics, LeadingOrder, NearFields, Neighbours, NormalLaw,
    Space as _, TangentialLaw, VelocityGradient,
};
use serde_json::Value;
use std::f64::consts::PI;

type Vector = Vector3<f64>;

/// Our unit of force, stress and resistance in theirs.
const UNIT: f64 = 6.0 * PI;

/// A vector in our axes: theirs are x flow, z gradient, y vorticity.
fn turned(v: Vector) -> Vector {
    Vector::new(v.x, v.z, -v.y)
}

/// Vectors of the instant, in our axes.
fn list(value: &Value) -> Vec<Vector> {
    vectors(value).into_iter().map(turned).collect()
}

/// A pair of the instant whose springs act, in our axes and their units.
struct Touching {
    i: usize,
    j: usize,
    n: Vector,
    reduced_gap: f64,
    spring_normal: f64,
    spring_tangential: Vector,
    dashpot: Vector,
    slides: bool,
}

/// The instant, in our axes and their units.
struct Instant {
    file: Value,
    configuration: Configuration<Bulk>,
    velocities: Vec<Vector>,
    spins: Vec<Vector>,
    touching: Vec<Touching>,
}

fn instant() -> Instant {
    let file = data("lf3d_instant.json");
    let number = |key: &str| file[key].as_f64().unwrap();
    let radii = numbers(&file["radii"]);
    let side = number("side");
    // Theirs are 0 to the side, so that −y is below the cell.
    let centres = list(&file["centres"]);
    let centres = centres.iter().map(|x| x + Vector::z() * side).collect();
    let touching = file["contacts"].as_array().unwrap();
    let touching = touching.iter().map(|c| {
        let vector = |key: &str| turned(Vector::from_column_slice(&numbers(&c[key])));
        let sphere = |key: &str| usize::try_from(c[key].as_u64().unwrap()).unwrap();
        Touching {
            i: sphere("i"),
            j: sphere("j"),
            n: vector("n"),
            reduced_gap: c["reduced_gap"].as_f64().unwrap(),
            spring_normal: c["spring_normal"].as_f64().unwrap(),
            spring_tangential: vector("spring_tangential"),
            dashpot: vector("dashpot"),
            slides: c["slides"].as_bool().unwrap(),
        }
    });
    Instant {
        configuration: Configuration {
            centres,
            cell: Cell::periodic(Vector::repeat(side), number("offset")).unwrap(),
            hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
                cutoff: number("cutoff"),
                regularisation: number("regularisation"),
            }),
            background: VelocityGradient::simple_shear(1.0).into(),
            forces: vec![Vector::zeros(); radii.len()],
            torques: vec![Vector::zeros(); radii.len()],
            radii,
        },
        velocities: list(&file["velocity_disturbance"]),
        spins: list(&file["angular_velocity_disturbance"]),
        touching: touching.collect(),
        file,
    }
}

/// The rate of strain of the background.
fn strain() -> Matrix3<f64> {
    Matrix3::new(0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
}

/// The symmetric part of a product of vectors.
fn symmetric(a: Vector, b: Vector) -> Matrix3<f64> {
    0.5 * (a * b.transpose() + b * a.transpose())
}

/// Leading orders of a pair by that code's table of coefficients, for 6 π μ = 1: entries 11, 12,
/// 21, 22 of each function, without the factor of the gap.
struct Coefficients {
    x_a: [f64; 4],
    y_a: [f64; 4],
    y_b: [f64; 4],
    y_c: [f64; 4],
    x_g: [f64; 4],
    y_g: [f64; 4],
    y_h: [f64; 4],
    x_m: [f64; 4],
    y_m: [f64; 4],
}

impl Coefficients {
    fn of(a_i: f64, a_j: f64) -> Self {
        // Both at a ratio of radii and at its inverse.
        let of = |g: fn(f64, f64) -> f64| [a_j / a_i, a_i / a_j].map(|l| g(l, 1.0 + l));
        let first = |g: fn(f64, f64) -> f64| {
            let [g, h] = of(g);
            [a_i * g, -a_i * g, -a_i * g, a_j * h]
        };
        let second = |g: fn(f64, f64) -> f64| {
            let [g, h] = of(g);
            [a_i * a_i * g, -a_i * a_i * g, a_j * a_j * h, -a_j * a_j * h].map(|x| 2.0 / 3.0 * x)
        };
        let third = |factor: f64, of_self: fn(f64, f64) -> f64, of_other: fn(f64, f64) -> f64| {
            let ([g, h], [m, n]) = (of(of_self), of(of_other));
            let (i, j) = (a_i.powi(3), a_j.powi(3));
            [i * g, i * m, j * n, j * h].map(|x| factor * x)
        };
        let mut y_c = third(
            4.0 / 3.0,
            |l, p| 0.4 * l / p,
            |l, p| 0.8 * l * l / p.powi(4),
        );
        let y_c_12 = (a_i + a_j).powi(3) / 6.0 * of(|l, p| 0.8 * l * l / p.powi(4))[0];
        (y_c[1], y_c[2]) = (y_c_12, y_c_12);
        let m = 10.0 / 9.0;
        Self {
            x_a: first(|l, p| 2.0 * l * l / p.powi(3)),
            y_a: first(|l, p| 4.0 / 15.0 * l * (2.0 + l + 2.0 * l * l) / p.powi(3)),
            y_b: second(|l, p| -0.2 * l * (4.0 + l) / p.powi(2)),
            y_c,
            x_g: second(|l, p| 3.0 * l * l / p.powi(3)),
            y_g: second(|l, p| 0.1 * l * (4.0 - l + 7.0 * l * l) / p.powi(3)),
            y_h: third(
                4.0 / 3.0,
                |l, p| 0.1 * l * (2.0 - l) / p.powi(2),
                |l, p| 0.05 * l * l * (1.0 + 7.0 * l) / p.powi(2),
            ),
            x_m: third(
                m,
                |l, p| 1.2 * l * l / p.powi(3),
                |l, p| 1.2 * l.powi(3) / p.powi(3),
            ),
            y_m: third(
                m,
                |l, p| 0.24 * l * (1.0 - l + 4.0 * l * l) / p.powi(3),
                |l, p| 0.06 * l * l * (7.0 - 10.0 * l + 7.0 * l * l) / p.powi(3),
            ),
        }
    }

    /// Forces on i and j, then torques, of velocities and spins.
    fn drag(&self, n: Vector, [x, y]: [f64; 2], v: [Vector; 2], w: [Vector; 2]) -> [Vector; 4] {
        let along = n * n.transpose();
        let across = Matrix3::identity() - along;
        let mut drag = [Vector::zeros(); 4];
        for (one, other) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let k = 2 * one + other;
            let a = along * (x * self.x_a[k]) + across * (y * self.y_a[k]);
            // The force of a sphere by the rotation of the other is the torque of that one by its
            // velocity, transposed.
            let (b, transposed) = (y * self.y_b[2 * other + one], y * self.y_b[k]);
            drag[one] -= a * v[other] + n.cross(&w[other]) * b;
            drag[2 + one] -=
                v[other].cross(&n) * transposed + across * w[other] * (y * self.y_c[k]);
        }
        drag
    }

    /// Forces on i and j, then torques, of the rate of strain.
    fn pull(&self, n: Vector, [x, y]: [f64; 2]) -> [Vector; 4] {
        let stretched = strain() * n;
        let of = |k: usize, l: usize| {
            let (x, y) = (
                x * (self.x_g[k] + self.x_g[l]),
                2.0 * y * (self.y_g[k] + self.y_g[l]),
            );
            n * n.dot(&stretched) * (x - y) + stretched * y
        };
        let turn =
            |k: usize, l: usize| stretched.cross(&n) * (-2.0 * y * (self.y_h[k] + self.y_h[l]));
        [of(0, 2), of(1, 3), turn(0, 2), turn(1, 3)]
    }

    /// Stresslets of both together, of velocities, spins and the rate of strain.
    fn stresslet(
        &self,
        n: Vector,
        [x, y]: [f64; 2],
        v: [Vector; 2],
        w: [Vector; 2],
    ) -> Matrix3<f64> {
        let along = n * n.transpose();
        let stretched = strain() * n;
        let mut sum = Matrix3::zeros();
        for k in 0..4 {
            let (v, w) = (v[k % 2], w[k % 2]);
            let shear = |u: Vector| symmetric(n, u) - along * n.dot(&u);
            sum += along
                * (1.5 * x * self.x_m[k] * n.dot(&stretched) - x * self.x_g[k] * n.dot(&v))
                + shear(stretched) * (2.0 * y * self.y_m[k])
                - shear(v) * (2.0 * y * self.y_g[k])
                - symmetric(n, w.cross(&n)) * (2.0 * y * self.y_h[k]);
        }
        sum
    }

    /// Change of the stresslets of both by Y^M in place of Y^H.
    fn mistaken(&self, n: Vector, y: f64, w: [Vector; 2]) -> Matrix3<f64> {
        let of =
            |k: usize| symmetric(n, w[k % 2].cross(&n)) * (2.0 * y * (self.y_h[k] - self.y_m[k]));
        (0..4).map(of).sum()
    }
}

impl Instant {
    fn pair(&self, i: usize, j: usize) -> Coefficients {
        let radii = &self.configuration.radii;
        Coefficients::of(radii[i], radii[j])
    }

    fn number(&self, key: &str) -> f64 {
        self.file[key].as_f64().unwrap()
    }

    /// The pairs with lubrication in our resistance.
    fn pairs(&self) -> Vec<Neighbours<Bulk>> {
        let Configuration {
            hydrodynamics,
            cell,
            centres,
            radii,
            ..
        } = &self.configuration;
        let tables = NearFields::default();
        let mut resistance = Resistance::new(*hydrodynamics, cell, radii, &tables).unwrap();
        resistance.regularise(0.0, f64::INFINITY);
        let mut stage = StageSolver::new(resistance);
        stage.assemble(cell, centres).unwrap();
        let pairs = stage.resistance.neighbours().iter().copied();
        let cutoff = self.number("cutoff");
        pairs
            .filter(|p| p.gap < 0.5 * cutoff * (radii[p.i] + radii[p.j]))
            .collect()
    }

    /// Disturbances of two spheres.
    fn motion(&self, i: usize, j: usize) -> ([Vector; 2], [Vector; 2]) {
        let both = |list: &[Vector]| [list[i], list[j]];
        (both(&self.velocities), both(&self.spins))
    }

    /// Factors of X and Y functions where spheres overlap: of ours, and of that code's dashpot.
    fn factors(&self) -> [[f64; 2]; 2] {
        let delta = self.number("regularisation");
        let dashpot = ["dashpot_normal", "dashpot_tangential"].map(|key| self.number(key));
        [[1.0 / delta, -delta.ln()], dashpot]
    }

    /// Our motion under that code's springs, with the lubrication of overlapping spheres reduced to
    /// its dashpots.
    fn moved(&self) -> SolvedConfiguration<Bulk> {
        let mut configuration = self.configuration.clone();
        let [ours, dashpot] = self.factors();
        let mut add = |sphere: usize, force: Vector, torque: Vector| {
            configuration.forces[sphere] += force * UNIT;
            configuration.torques[sphere] += torque * UNIT;
        };
        for c in &self.touching {
            let (pair, (v, w)) = (self.pair(c.i, c.j), self.motion(c.i, c.j));
            let [a_i, a_j] = [c.i, c.j].map(|i| self.configuration.radii[i]);
            let springs = c.spring_tangential - c.n * c.spring_normal;
            let (u, spin) = self.background(c);
            // On i, of the background: that code's torque is that of this force at the surface.
            let carried = pair.drag(c.n, dashpot, u, [spin; 2])[0];
            let theirs = pair.drag(c.n, dashpot, v, w);
            let (ours, pull) = (pair.drag(c.n, ours, v, w), pair.pull(c.n, ours));
            let on_i = springs + carried;
            for (k, sphere, sign, a) in [(0, c.i, 1.0, a_i), (1, c.j, -1.0, a_j)] {
                add(
                    sphere,
                    on_i * sign + theirs[k] - ours[k] - pull[k],
                    c.n.cross(&on_i) * a + theirs[2 + k] - ours[2 + k] - pull[2 + k],
                );
            }
        }
        solve(
            &configuration,
            &InstantContacts::None,
            &NearFields::default(),
        )
        .unwrap()
    }

    /// Velocities of the background at i and at j, less that at i, and its spin.
    fn background(&self, c: &Touching) -> ([Vector; 2], Vector) {
        let [a_i, a_j] = [c.i, c.j].map(|i| self.configuration.radii[i]);
        let apart = c.n * (0.5 * (a_i + a_j) * (2.0 + c.reduced_gap));
        ([Vector::zeros(), Vector::x() * apart.y], Vector::z() * -0.5)
    }
}

#[test]
fn pairs_and_gaps_are_those_of_a_published_code() {
    let instant = instant();
    let (pairs, radii) = (instant.pairs(), &instant.configuration.radii);
    assert_eq!(pairs.len() as f64, instant.number("pairs"));
    assert_eq!(
        pairs.iter().filter(|p| p.gap <= 0.0).count(),
        instant.touching.len()
    );
    for c in &instant.touching {
        let key = (c.i.min(c.j), c.i.max(c.j));
        let pair = pairs.iter().find(|p| (p.i, p.j) == key).unwrap();
        let n = if c.i < c.j { c.n } else { -c.n };
        assert!((pair.normal - n).amax() < 1e-13);
        let gap = c.reduced_gap * 0.5 * (radii[c.i] + radii[c.j]);
        assert!((pair.gap - gap).abs() < 1e-13);
    }
}

#[test]
fn spring_forces_are_those_of_a_published_code() {
    let instant = instant();
    let friction = instant.number("friction");
    let mut compared = 0;
    // There the stiffness grows with the mean radius of a pair, so that each mean has a law of its
    // own here.
    for mean in [1.0, 1.2, 1.4] {
        let stiffness = |key: &str| instant.number(key) * mean * UNIT;
        let laws = Laws {
            surface: Surface {
                roughness: 0.0,
                friction,
                critical_load: 0.0,
            },
            normal: NormalForce {
                law: sd_core::contact::ForceLaw::BuiltIn(NormalLaw::LinearSpring),
                stiffness: stiffness("kn"),
                dashpot: 0.0,
            },
            tangential: TangentialLaw::StickSlide,
            tangential_stiffness: stiffness("kt"),
            onset: FrictionOnset::CriticalLoad,
            repulsion: None,
            attraction: None,
            rolling_friction: 0.0,
            adhesion: 0.0,
            hydrodynamic_friction: HydrodynamicFriction::default(),
        };
        let springs = instant.touching.iter().map(|c| {
            let force = c.spring_tangential * UNIT;
            let (i, j) = (c.i.min(c.j), c.i.max(c.j));
            // F_t acts on the sphere of the lower number.
            let force = if c.i < c.j { force } else { -force };
            (u32::try_from(i).unwrap(), u32::try_from(j).unwrap(), force)
        });
        let mut springs: Vec<_> = springs.collect();
        springs.sort_by_key(|spring| (spring.0, spring.1));
        let request = InstantContacts::Laws {
            laws,
            lubrication_gap: 0.0,
            // Forces are those at the start of this time.
            time_span: 1e-15,
            springs: PairForces(springs),
            rolling_springs: PairForces::default(),
        };
        let solved = solve(&instant.configuration, &request, &NearFields::default()).unwrap();
        for c in &instant.touching {
            let radii = &instant.configuration.radii;
            if (0.5 * (radii[c.i] + radii[c.j]) - mean).abs() > 1e-12 {
                continue;
            }
            let key = (c.i.min(c.j), c.i.max(c.j));
            let contact = solved.contacts.iter().find(|o| (o.pair.i, o.pair.j) == key);
            let contact = contact.unwrap();
            let sign = if c.i < c.j { UNIT } else { -UNIT };
            let normal = contact.normal_force / UNIT - c.spring_normal;
            let tangential = contact.tangential_force / sign - c.spring_tangential;
            assert!(normal.abs() < 1e-10, "{normal:e}");
            assert!(tangential.amax() < 1e-10, "{:e}", tangential.amax());
            if !c.slides {
                assert_eq!(contact.state, ContactState::Sticking);
            }
            compared += 1;
        }
    }
    assert_eq!(compared, instant.touching.len());
}

#[test]
fn velocities_are_those_of_a_published_code() {
    let instant = instant();
    let solved = instant.moved();
    for (first, expected) in [(0, &instant.velocities), (3, &instant.spins)] {
        let found = solved.disturbances.iter();
        let found = found.flat_map(|v| v[first..first + 3].to_vec());
        let expected: Vec<f64> = expected.iter().flatten().copied().collect();
        let error = difference(found, &expected);
        assert!(error < 1e-12, "{error:e}");
    }
}

#[test]
fn dashpots_of_a_published_code_are_those_put_in_for_it() {
    let instant = instant();
    let [_, dashpot] = instant.factors();
    for c in &instant.touching {
        let (pair, (v, w)) = (instant.pair(c.i, c.j), instant.motion(c.i, c.j));
        let (u, spin) = instant.background(c);
        let force = pair.drag(c.n, dashpot, v, w)[0] + pair.drag(c.n, dashpot, u, [spin; 2])[0];
        assert!((force - c.dashpot).amax() < 1e-12);
    }
}

#[test]
fn stress_is_that_of_a_published_code() {
    let instant = instant();
    let solved = instant.moved();
    let radii = &instant.configuration.radii;
    let volume = instant.configuration.cell.content().unwrap();
    let mut sum = Matrix3::zeros();
    for (s, a) in solved.stresslets.iter().zip(radii) {
        let [xx, yy, xy, xz, yz] = Bulk::tensor(s);
        let ours = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy);
        sum += ours / UNIT - strain() * (20.0 / 3.0 * PI / UNIT * a.powi(3));
    }
    let [ours, _] = instant.factors();
    for c in &instant.touching {
        let (pair, (v, w)) = (instant.pair(c.i, c.j), instant.motion(c.i, c.j));
        sum -= pair.stresslet(c.n, ours, v, w);
        let force = c.spring_tangential - c.n * c.spring_normal + c.dashpot;
        let apart = c.n * (0.5 * (radii[c.i] + radii[c.j]) * (2.0 + c.reduced_gap));
        sum += symmetric(apart, force);
    }
    let mut mistaken = Matrix3::zeros();
    for p in instant.pairs().iter().filter(|p| p.gap > 0.0) {
        let xi = 2.0 * p.gap / (radii[p.i] + radii[p.j]);
        let y = -(xi + instant.number("regularisation")).ln();
        let (_, w) = instant.motion(p.i, p.j);
        mistaken += instant.pair(p.i, p.j).mistaken(p.normal, y, w);
    }
    let found = (sum + mistaken) / volume + strain() * (2.0 / UNIT);
    let [xx, xy, xz, yz, yy, zz] = numbers(&instant.file["stress"])[..] else {
        unreachable!()
    };
    let theirs = Matrix3::new(xx, xz, -xy, xz, zz, -yz, -xy, -yz, yy);
    let traceless = |m: Matrix3<f64>| m - Matrix3::identity() * (m.trace() / 3.0);
    let error = (traceless(found) - traceless(theirs)).amax();
    assert!(error < 1e-12, "{error:e}");
    for (stress, key) in [
        (found, "viscosity"),
        (found - mistaken / volume, "viscosity_with_y_h"),
    ] {
        let error = stress[(0, 1)] * UNIT / instant.number(key) - 1.0;
        assert!(error.abs() < 1e-12, "{key}: {error:e}");
    }
}
