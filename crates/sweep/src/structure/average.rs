//! Sums over the frames of a run, and means over runs with their intervals.

use super::clusters::clusters;
use super::contacts::{Contacts, contacts, deviator, force_bins};
use super::network::Network;
use super::pairs::{ANGLES, Distances, Pairs, angle_bins, pairs};
use super::profiles::{Profile, middles};
use super::scalars::{NAMED, SCALARS, scalars};
use crate::measure::Estimate;
use sd_core::Space;
use sd_core::simulation::{Frame, StructureSample};

/// Distance below contact of the smallest spheres at which g(r, θ) begins, in a: spheres of soft
/// contacts overlap.
const OVERLAP: f64 = 0.1;
/// Cluster sizes up to which there are bins: 1, 2 to 3, 4 to 7, and so on.
const SIZES: usize = 14;

/// Sums over the frames of one run.
#[derive(Debug, Clone)]
pub(crate) struct RunStructure {
    dimensions: usize,
    frames: u64,
    /// Radius of the smallest sphere, in a.
    smallest: f64,
    distances: Distances,
    pairs: Pairs,
    contacts: Contacts,
    /// Fraction of spheres in clusters of each size.
    sizes: Vec<f64>,
    /// Sums of the numbers, and the number of frames that have each.
    scalars: [(f64, u64); SCALARS],
    /// Along the gradient, and in a suspension along the vorticity.
    profiles: Vec<Profile>,
    /// D_yy and D_zz of the run, in a²·rate.
    pub diffusivities: [Option<f64>; 2],
}

impl RunStructure {
    /// Empty sums for cells of this kind, of which none has a smaller reach: the cell may change
    /// from frame to frame, and differ between runs that are averaged, which need the same bins.
    pub(crate) fn new<S: Space>(network: &Network<S>, reach: f64) -> Self {
        let distances = Distances::within(reach);
        let forces = vec![0.0; force_bins().len()];
        Self {
            dimensions: S::DIMENSIONS,
            frames: 0,
            smallest: network.radii.iter().copied().fold(1.0, f64::min),
            pairs: Pairs {
                radial: vec![0.0; distances.radial.len()],
                with_angle: vec![0.0; distances.with_angle.len() * ANGLES],
            },
            contacts: Contacts {
                angles: vec![0.0; ANGLES],
                forces_by_angle: vec![0.0; ANGLES],
                normal: forces.clone(),
                tangential: forces,
                ..Contacts::default()
            },
            sizes: vec![0.0; SIZES],
            scalars: [(0.0, 0); SCALARS],
            profiles: Vec::new(),
            diffusivities: [None; 2],
            distances,
        }
    }

    /// Adds the profiles of a frame in a sheared cell; `direction` is the sense of its shear.
    pub(crate) fn add_profiles<S: Space>(&mut self, frame: &Frame<S>, direction: f64) {
        if !frame.is_sheared() {
            return;
        }
        if self.profiles.is_empty() {
            let axes = 1..S::DIMENSIONS;
            self.profiles = axes
                .map(|axis| Profile::new::<S>(axis, frame.side))
                .collect();
        }
        for profile in &mut self.profiles {
            profile.add(frame, direction);
        }
    }

    /// Adds the network and the sampled numbers of a frame.
    pub(crate) fn add<S: Space>(&mut self, network: &Network<S>, sampled: &StructureSample) {
        self.frames += 1;
        let found = pairs(network, &self.distances);
        add(&mut self.pairs.radial, &found.radial);
        add(&mut self.pairs.with_angle, &found.with_angle);
        let found = contacts(network);
        add(&mut self.contacts.angles, &found.angles);
        add(&mut self.contacts.forces_by_angle, &found.forces_by_angle);
        add(&mut self.contacts.normal, &found.normal);
        add(&mut self.contacts.tangential, &found.tangential);
        self.contacts.number += found.number;
        for (row, found) in self.contacts.fabric.iter_mut().zip(&found.fabric) {
            add(row, found);
        }
        let n = network.spheres().max(1) as f64;
        for size in clusters(network, network.frictional()).sizes {
            let place = size.max(1).ilog2() as usize;
            self.sizes[place.min(SIZES - 1)] += size as f64 / n;
        }
        for ((sum, number), found) in self.scalars.iter_mut().zip(scalars(network, sampled)) {
            if !found.is_nan() {
                *sum += found;
                *number += 1;
            }
        }
    }

    /// n n averaged over the contacts.
    fn fabric(&self) -> Option<[[f64; 3]; 3]> {
        let number = self.contacts.number;
        (number > 0.0).then(|| self.contacts.fabric.map(|row| row.map(|sum| sum / number)))
    }
}

fn add(sums: &mut [f64], more: &[f64]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        *sum += more;
    }
}

/// A quantity along an axis, with the mean over runs in each bin.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Curve {
    /// Centres of the bins, or for cluster sizes their lower ends.
    pub x: Vec<f64>,
    /// Mean over runs; `None` where no run has a value.
    pub y: Vec<Option<Estimate>>,
}

/// Structure of a point, averaged over its runs.
#[derive(Debug, Clone)]
pub(crate) struct Structure {
    /// Number of runs averaged.
    pub runs: u64,
    /// Total number of their frames.
    pub frames: u64,
    /// The numbers of [`NAMED`], in that order; `None` where undefined.
    pub scalars: Vec<Option<Estimate>>,
    /// g(r), r in a.
    pub radial: Curve,
    /// Distances of g(r, θ), in a, its angles, and its means over runs, a row for each distance.
    pub with_angle: (Vec<f64>, Vec<f64>, Vec<Vec<f64>>),
    /// Fraction of contacts in each bin of the angle from the flow towards the gradient.
    pub contact_angle: Curve,
    /// Fraction of the normal forces in each of these bins.
    pub force_angle: Curve,
    /// n n averaged over contacts; `None` without contacts.
    pub fabric: Vec<Vec<Option<Estimate>>>,
    /// Deviation of that from isotropic contacts.
    pub fabric_deviator: Option<Estimate>,
    /// Probability density of normal forces over their mean.
    pub normal_force: Curve,
    /// Probability density of friction forces over their mean.
    pub tangential_force: Curve,
    /// Fraction of spheres in clusters of frictional contacts by size.
    pub cluster_size: Curve,
    /// Velocity along the flow, in a·rate, and fraction of the spheres, by height along the
    /// gradient, in a.
    pub profile: [Curve; 2],
    /// Velocity along the flow less that of the linear profile, and fraction, along the vorticity;
    /// empty for a layer.
    pub profile_z: [Curve; 2],
    /// Diffusivities D_yy and D_zz, in a²·rate.
    pub diffusivities: [Option<Estimate>; 2],
}

impl Structure {
    /// Averages the runs of a point, of the same reach; `None` without frames.
    pub(crate) fn of(runs: &[RunStructure]) -> Option<Self> {
        let runs: Vec<&RunStructure> = runs.iter().filter(|run| run.frames > 0).collect();
        let first = *runs.first()?;
        let dimensions = first.dimensions;
        let per_frame = |of: fn(&RunStructure) -> &[f64]| {
            let each = |run: &&RunStructure| Some(scaled(of(run), 1.0 / run.frames as f64));
            bands(&runs.iter().map(each).collect::<Vec<_>>())
        };
        // Fractions, or a density for bins of the given width.
        let shares = |of: fn(&RunStructure) -> &[f64], width: f64| {
            let each = |run: &&RunStructure| {
                let total: f64 = of(run).iter().sum();
                (total > 0.0).then(|| scaled(of(run), 1.0 / (total * width)))
            };
            bands(&runs.iter().map(each).collect::<Vec<_>>())
        };
        let forces = force_bins();
        let width = forces.ends().next().map_or(1.0, |(low, high)| high - low);
        let fabrics: Vec<_> = runs.iter().filter_map(|run| run.fabric()).collect();
        let with_angle = per_frame(|run| &run.pairs.with_angle);
        let with_angle: Vec<f64> = with_angle
            .iter()
            .map(|b| b.map_or(0.0, |b| b.mean))
            .collect();
        let angles = angle_bins().middles();
        // The same bins for all runs, whose smallest spheres may differ.
        let smallest = runs.iter().map(|run| run.smallest).fold(1.0, f64::min);
        let nearest = first
            .distances
            .with_angle
            .place(2.0 * smallest - OVERLAP + 1e-9)
            .unwrap_or(0);
        let diffusivities = [0, 1].map(|axis| {
            let each = runs.iter().filter_map(|run| run.diffusivities[axis]);
            Estimate::of(&each.collect::<Vec<_>>())
        });
        let scalars = (0..NAMED.len()).map(|place| {
            let of_run = |run: &&RunStructure| {
                let (sum, number) = run.scalars[place];
                (number > 0).then(|| sum / number as f64)
            };
            Estimate::of(&runs.iter().filter_map(of_run).collect::<Vec<_>>())
        });
        let fabric = (0..dimensions).map(|a| {
            let each = |b: usize| fabrics.iter().map(|f| f[a][b]).collect::<Vec<_>>();
            (0..dimensions).map(|b| Estimate::of(&each(b))).collect()
        });
        let deviators: Vec<f64> = fabrics.iter().map(|f| deviator(f, dimensions)).collect();
        Some(Self {
            runs: runs.len() as u64,
            frames: runs.iter().map(|run| run.frames).sum(),
            scalars: scalars.collect(),
            radial: Curve {
                x: first.distances.radial.middles(),
                y: per_frame(|run| &run.pairs.radial),
            },
            with_angle: (
                first.distances.with_angle.middles().split_off(nearest),
                angles.clone(),
                with_angle
                    .chunks(ANGLES)
                    .skip(nearest)
                    .map(<[f64]>::to_vec)
                    .collect(),
            ),
            contact_angle: Curve {
                x: angles.clone(),
                y: shares(|run| &run.contacts.angles, 1.0),
            },
            force_angle: Curve {
                x: angles,
                y: shares(|run| &run.contacts.forces_by_angle, 1.0),
            },
            fabric: fabric.collect(),
            fabric_deviator: Estimate::of(&deviators),
            normal_force: Curve {
                x: forces.middles(),
                y: shares(|run| &run.contacts.normal, width),
            },
            tangential_force: Curve {
                x: forces.middles(),
                y: shares(|run| &run.contacts.tangential, width),
            },
            cluster_size: Curve {
                x: (0..SIZES).map(|k| (1_u64 << k) as f64).collect(),
                y: per_frame(|run| &run.sizes),
            },
            profile: profiles(&runs, 0),
            profile_z: profiles(&runs, 1),
            diffusivities,
        })
    }

    /// g(r) from g(r, θ), which has wider bins.
    pub(crate) fn radial_of_angles(&self) -> Curve {
        let (r, angles, rows) = &self.with_angle;
        let mean = |row: &Vec<f64>| row.iter().sum::<f64>() / angles.len() as f64;
        Curve {
            x: r.clone(),
            y: rows
                .iter()
                .map(|row| Some(Estimate::bare(mean(row))))
                .collect(),
        }
    }

    /// A number by its name in [`NAMED`].
    #[cfg(test)]
    pub(crate) fn scalar(&self, name: &str) -> Option<Estimate> {
        let place = NAMED.iter().position(|scalar| scalar.name == name)?;
        self.scalars[place]
    }
}

/// Velocity and fraction along the axis of a profile, in the mean cell; empty where there is none.
fn profiles(runs: &[&RunStructure], place: usize) -> [Curve; 2] {
    let of: [fn(&Profile) -> Vec<f64>; 2] = [Profile::velocity, Profile::fraction];
    let sides = runs
        .iter()
        .filter_map(|run| Some(run.profiles.get(place)?.side));
    // A running mean, which equal sides do not change.
    let side = sides.zip(1_u32..).fold(0.0, |mean, (side, number)| {
        mean + (side - mean) / f64::from(number)
    });
    of.map(|of| {
        let each = |run: &&RunStructure| run.profiles.get(place).map(of);
        Curve {
            x: if side > 0.0 {
                middles(side)
            } else {
                Vec::new()
            },
            y: bands(&runs.iter().map(each).collect::<Vec<_>>()),
        }
    })
}

fn scaled(sums: &[f64], factor: f64) -> Vec<f64> {
    sums.iter().map(|sum| sum * factor).collect()
}

/// The means over runs bin by bin; runs without values are left out.
fn bands(runs: &[Option<Vec<f64>>]) -> Vec<Option<Estimate>> {
    let runs: Vec<&Vec<f64>> = runs.iter().flatten().collect();
    let number = runs.first().map_or(0, |run| run.len());
    let each = |bin: usize| runs.iter().map(|run| run[bin]).collect::<Vec<_>>();
    (0..number).map(|bin| Estimate::of(&each(bin))).collect()
}
