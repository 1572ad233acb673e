//! Campaigns on a cluster, with stand-ins for Slurm's programs on PATH. `scripts/slurm-test` does it with a real one.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

mod cluster;
mod shards;
mod submit;
mod tasks;
mod waves;
