//! Brownian motion under an iterated far field: random forces, and the motion that they cause.

use super::IterativeFarField;
use super::fixed_point::FixedPointMap;
use super::split::SplitMotion;
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::linalg::lanczos::InverseRoot;
use crate::space::{FixedArray as _, Strains};

/// Relative change at which the root of the mobility is accurate enough: the covariance is then
/// R_FU to 1e-4 of its largest entry. With 1e-2, two thirds of the products, it is off by 1.5e-3.
const ROOT_TOLERANCE: f64 = 1e-3;

/// State of the far field of the motion under random forces alone.
pub(crate) struct FreeMotion<S: Fluid> {
    split: SplitMotion<S>,
    delta: Vec<f64>,
    root: InverseRoot,
    /// Random numbers, then force modes, of all spheres.
    vector: Vec<f64>,
    /// Force modes of a product.
    work: Vec<f64>,
}

impl<S: Fluid> IterativeFarField<S> {
    /// Adds random forces and torques, `[3N]`, whose covariance is `scale`² times the far field's
    /// part of `R_FU`: the forces of all modes whose covariance is M⁻¹.
    ///
    /// ```text
    /// q = √M₀⁻¹ (√M₀⁻¹ M √M₀⁻¹)^(−1/2) z      in a layer among those without a net force
    /// ```
    ///
    /// `normal`: independent numbers of mean 0 and variance 1; `flow`: rates of strain of a flow
    /// whose rate is free.
    ///
    /// # Returns
    /// The random force on that rate, and the number of products with M.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn add_random_forces(
        &mut self,
        scale: f64,
        mut normal: impl FnMut() -> f64,
        flow: Option<&S::Strain>,
        forces: &mut [f64],
    ) -> Result<(f64, u32), Error> {
        let unknowns = S::ALL_MODES * self.drag.len();
        let free = self.free.get_or_insert_with(|| {
            Box::new(FreeMotion {
                split: SplitMotion::new(S::PerAnyMode::flat(&self.drag)),
                delta: vec![0.0; unknowns],
                root: InverseRoot::default(),
                vector: Vec::with_capacity(unknowns),
                work: vec![0.0; unknowns],
            })
        });
        let FreeMotion {
            root, vector, work, ..
        } = &mut **free;
        vector.clear();
        vector.resize_with(unknowns, &mut normal);
        let (operator, roots) = (&mut self.operator, &self.split.roots[..unknowns]);
        remove_net_force::<S>(roots, vector);
        let found = root.apply(vector, ROOT_TOLERANCE, |x, y| {
            for ((q, x), root) in work.iter_mut().zip(x).zip(roots) {
                *q = x * root;
            }
            operator.apply(work, y);
            for (y, root) in y.iter_mut().zip(roots) {
                *y *= root;
            }
            remove_net_force::<S>(roots, y);
        });
        if found.change >= ROOT_TOLERANCE {
            return Err(Error::NotConverged {
                quantity: "the root of the far field's mobility",
                iterations: found.products,
                residual: found.change,
                wanted: ROOT_TOLERANCE,
            });
        }
        let modes = S::all_modes(vector).iter().zip(S::all_modes(roots));
        let mut of_flow = 0.0;
        for (force, (x, roots)) in S::by_sphere_mut(forces).iter_mut().zip(modes) {
            for k in 0..S::MODES {
                force[k] += scale * roots[k] * x[k];
            }
            if let Some(strain) = flow {
                for k in 0..S::STRAINS {
                    let k_all = S::MODES + k;
                    of_flow -= scale * strain[k] * roots[k_all] * x[k_all];
                }
            }
        }
        Ok((of_flow, found.products))
    }

    /// Discards the motion under random forces alone of the previous stage.
    pub(crate) fn clear_free_motion(&mut self) {
        if let Some(free) = &mut self.free {
            free.split.reset();
        }
    }

    /// The motion `[3N]` under random forces alone, whose far field
    /// [`IterativeFarField::correct_free`] then has; otherwise as
    /// [`IterativeFarField::solve_fixed_point`].
    ///
    /// # Errors
    /// [`Error::NotConverged`]; those of the motion under sparse hydrodynamics.
    pub(crate) fn free_motion(
        &mut self,
        near: &Resistance<S>,
        map: &mut impl FixedPointMap,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        let Some(mut free) = self.free.take() else {
            return Ok(());
        };
        let mut exchange = |far: &mut Self| {
            std::mem::swap(&mut far.split, &mut free.split);
            std::mem::swap(&mut far.delta, &mut free.delta);
        };
        exchange(self);
        let solved = self.solve_fixed_point(near, map, Strains::none(), forces, velocities);
        exchange(self);
        self.free = Some(free);
        solved?;
        self.check_converged()
    }

    /// As [`IterativeFarField::correct`], for the motion under random forces alone.
    pub(crate) fn correct_free(&self, forces: &mut [f64], stresslets: &mut [S::Strain]) {
        if let Some(free) = &self.free {
            Self::add_delta(&free.delta, forces, stresslets);
        }
    }
}

/// Takes the net force of `√M₀⁻¹ x` out of x, in a layer, which does not resist one: x is
/// orthogonal to uniform translations then.
fn remove_net_force<S: Fluid>(roots: &[f64], x: &mut [f64]) {
    for row in 0..S::DRIFTS {
        let [mut net, mut whole] = [0.0; 2];
        for (roots, x) in S::all_modes(roots).iter().zip(S::all_modes(x)) {
            net += roots[row] * x[row];
            whole += roots[row] * roots[row];
        }
        for (roots, x) in S::all_modes(roots).iter().zip(S::all_modes_mut(x)) {
            x[row] -= net / whole * roots[row];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Snapshot;
    use crate::hydrodynamics::resistance::tests::{
        difference_of_covariance, free_shear, random_columns,
    };
    use crate::model::{Hydrodynamics, Params};
    use crate::space::cell::Cell;
    use crate::{Bulk, Layer, NearFields, RunSpace, Space as _};

    /// The error of the covariance for spheres of a start, over the largest resistance.
    fn covariance_error<S: RunSpace>(params: &Params) -> f64 {
        let (full, tables) = (Hydrodynamics::StokesianDynamics, NearFields::default());
        let start = Snapshot::<S>::start(params, 1).unwrap();
        let cell = Cell::<S>::equal_sides(start.side, 0.0).unwrap();
        let centres: Vec<_> = start.centres.iter().map(S::vector).collect();
        let radii = &start.radii;
        let mut near = Resistance::<S>::new_pairwise(full, &cell, radii, &tables, &[]).unwrap();
        near.assemble(&cell, &centres).unwrap();
        let mut far = IterativeFarField::<S>::new(&cell, radii, 1e-6).unwrap();
        far.update(&cell, &centres).unwrap();
        let mut products = 0;
        let flow = free_shear::<S>();
        let strains = flow.strains();
        let columns = random_columns(S::MODES * radii.len() + 1, |mut number, forces| {
            let (last, forces) = forces.split_last_mut().unwrap();
            let strain = Some(strains.at(0));
            let drawn = near.add_random_forces(1.0, &mut number, strain, forces);
            let of_far = far.add_random_forces(1.0, &mut number, strain, forces);
            let (force, draw) = of_far.unwrap();
            *last = drawn.force + force + drawn.rest.max(0.0).sqrt() * number();
            products = products.max(draw);
        });
        assert!(products < 60, "{products}");
        let mut dense = Resistance::<S>::new(full, &cell, radii, &tables).unwrap();
        dense.assemble(&cell, &centres).unwrap();
        difference_of_covariance(&columns, &dense)
    }

    #[test]
    fn random_forces_have_the_covariance_of_the_resistance() {
        let of = |spheres| {
            Params::builder()
                .spheres(spheres)
                .roughness(0.01)
                .friction(0.0)
                .shear_rate(0.0)
                .hydrodynamics(Hydrodynamics::StokesianDynamics)
        };
        let layer = of(20).area_fraction(0.6).build().unwrap();
        let error = covariance_error::<Layer>(&layer);
        assert!(error < 1e-4, "{error:e}");
        let suspension = of(31).volume_fraction(0.25).build().unwrap();
        let error = covariance_error::<Bulk>(&suspension);
        assert!(error < 1e-4, "{error:e}");
    }

    #[test]
    #[ignore = "a measurement, of which nothing is asserted"]
    fn times_of_draws() {
        for spheres in [125, 500, 1000] {
            let params = Params::builder()
                .spheres(spheres)
                .volume_fraction(0.45)
                .roughness(0.01)
                .friction(0.0)
                .shear_rate(0.0)
                .hydrodynamics(Hydrodynamics::StokesianDynamics)
                .contact(crate::ContactScheme::Rigid)
                .build()
                .unwrap();
            let start = Snapshot::<Bulk>::start(&params, 1).unwrap();
            let cell = Cell::<Bulk>::equal_sides(start.side, 0.0).unwrap();
            let centres: Vec<_> = start.centres.iter().map(Bulk::vector).collect();
            let tolerance = crate::model::SolverSettings::default().far_field_residual;
            let mut far = IterativeFarField::<Bulk>::new(&cell, &start.radii, tolerance).unwrap();
            far.update(&cell, &centres).unwrap();
            let mut run =
                crate::Simulation::<Bulk>::new(&params, 1, &NearFields::default()).unwrap();
            for _ in 0..3 {
                run.step().unwrap();
            }
            let before = run.counters().stages;
            let clock = std::time::Instant::now();
            for _ in 0..3 {
                run.step().unwrap();
            }
            let stages = f64::from(u32::try_from(run.counters().stages - before).unwrap());
            let side = clock.elapsed().as_secs_f64() / stages;
            let mut forces = vec![0.0; Bulk::MODES * spheres];
            let (mut number, mut products) = (0.0, 0);
            let clock = std::time::Instant::now();
            for _ in 0..4 {
                let normal = || {
                    number += 1.0;
                    1.5 * f64::sin(1.9 * number + 0.03 * number * number)
                };
                (_, products) = far
                    .add_random_forces(1.0, normal, None, &mut forces)
                    .unwrap();
            }
            let draw = clock.elapsed().as_secs_f64() / 4.0;
            println!(
                "{spheres}: {products} products, draw {draw:.4} s, right-hand side {side:.4} s, ratio {:.2}",
                draw / side
            );
        }
    }
}
