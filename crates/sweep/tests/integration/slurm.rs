//! Campaigns on a cluster, with substitutes for Slurm's programs on PATH. `real` uses a
//! real Slurm.

mod cluster;
mod real;
mod shards;
mod submit;
mod tasks;
mod waves;
