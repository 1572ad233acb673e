//! Campaigns on a cluster, with substitutes for Slurm's programs on PATH. `scripts/slurm-test` uses
//! a real Slurm.

mod cluster;
mod shards;
mod submit;
mod tasks;
mod waves;
