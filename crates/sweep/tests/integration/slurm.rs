//! Campaigns on a cluster, with stand-ins for Slurm's programs on PATH. `scripts/slurm-test` does it with a real one.

mod cluster;
mod shards;
mod submit;
mod tasks;
mod waves;
