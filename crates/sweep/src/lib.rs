//! Campaigns of sheared layers: all of the `sweep` program but its `main`.
//!
//! One way through: a [`campaign`] file is laid out as [`case`]s, the [`runner`] computes them and
//! keeps every state of every case in the [`store`], and a [`report`] averages what the store
//! holds. The store is the only state: a process may die at any point, and the next one continues.
//! On a cluster a scheduler of the `cluster` starts tasks that compute slices of the campaign in
//! stores of their own, published as shards and merged into the one store.
//!
//! # Modules, from the lowest level up
//! ```text
//! system  text  data                  the machine; words and numbers; tables
//! model  statistics                   axes, case, protocol, campaign, order of work; averages, doubts, stopping rules
//! structure                           frames as pair distributions and networks of contacts
//! store                               SQLite: cases, checkpoints, samples, results
//! campaign                            the TOML file, which may name runs of a store to begin with
//! costs  runner  cluster              estimates; computing; tasks of a scheduler
//! report  serve                       tables, figures, the page
//! api  cli                            each command as a function; its arguments and its output
//! ```
//!
//! # From another program
//! The Python package calls the same functions as the commands:
//! ```text
//! campaign::Campaign                  a campaign file, or the text of one
//! api::{plan, InstantInput, …}        what plan, solve and scalars read and answer
//! api::begin                          a campaign in its store, before anything is computed
//! api::complete                       the cases of a store computed: with runner::{Stop, Progress, Options}
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
mod model;
pub mod plan;
pub mod report;
pub mod runner;
mod serve;
mod statistics;
pub mod store;
mod structure;
mod system;
mod text;
pub mod trajectory;

#[cfg(test)]
mod test_support;

pub use error::{Error, ErrorRenderer};
pub use model::{axes, case, protocol, spaces};
pub use statistics::doubt;
pub use system::{disk, exit, tables};
pub use text::format;
