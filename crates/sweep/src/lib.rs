//! Campaigns of sheared layers: all of the `sweep` program but its `main`.
//!
//! One way through: a [`campaign`] file is laid out as `case`s, the [`runner`] computes them and
//! keeps every state of every case in the [`store`], and a [`report`] averages what the store
//! holds. The store is the only state: a process may die at any point, and the next one continues.
//! On a cluster a scheduler of the `cluster` starts tasks that compute slices of the campaign in
//! stores of their own, published as shards and merged into the one store.
//!
//! # Rooms, from the lowest up
//! A room imports only rooms named above it here, by their own paths: a test reads this list.
//! ```text
//! text               numbers, times and sizes as text; text without control sequences
//! system             clocks, processes, files, disks, exit codes
//! data               tables: values, columns, CSV, Parquet
//! model              axes, cases, protocol, campaign, order of work; layers and suspensions as one type
//! near_field_cache   near fields of unequal spheres, kept in the user's cache
//! measure            what a run measures: averages in time and over runs, doubts, stopping rule
//! transport          diffusion, sedimentation and viscosity of starts, at short times
//! structure          frames as pair distributions and networks of contacts
//! trajectory         kept frames in the formats of other programs
//! instant            one instant of one configuration, and the two-sphere functions
//! verify             known results, recomputed
//! store              SQLite: cases, checkpoints, samples, results
//! campaign           the TOML file, which may name runs of a store to begin with
//! plan               estimates of what is left to compute
//! runner             claims cases, computes them and keeps their states
//! report             tables, figures, the page
//! serve              the page of a store that is being computed
//! cluster            tasks of a scheduler, and their shards
//! error              errors of all rooms, with their exit codes and their form in print
//! cli                arguments and output of each command
//! ```
//!
//! # From another program
//! There is no layer between the commands and the rooms: a room is named for what it is for, and
//! the command line and the Python package call the same functions of it.
//! ```text
//! campaign::{read, parse}             a campaign file, or the text of one
//! plan::plan, instant                 what plan, solve and scalars read and answer
//! runner::begin                       a campaign in its store, before anything is computed
//! runner::complete                    the cases of a store computed: with runner::{Stop, Progress, Options}
//! store::StoreSource                  opened for reading, for report::Report, Store::samples, Store::frames, Store::runs
//! report::outline                     a figure, to be drawn elsewhere
//! report::draw_spheres                a picture of a kept frame
//! data::DataColumn                    what tables are made of
//! Error, ErrorRenderer                the same messages, and the kind of error by its exit code
//! ```

pub mod campaign;
pub mod cli;
mod cluster;
pub mod data;
mod error;
pub mod instant;
pub mod measure;
pub mod model;
pub mod near_field_cache;
pub mod plan;
pub mod report;
pub mod runner;
mod serve;
pub mod store;
mod structure;
pub mod system;
pub mod text;
pub mod trajectory;
mod transport;
mod verify;

#[cfg(test)]
mod test_support;

pub use error::{Error, ErrorRenderer};
