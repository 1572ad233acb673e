//! Campaigns of sheared layers: everything of the `sweep` program but its `main`.
//!
//! One way through: a [`campaign`] file is laid out as [`case`]s, the [`runner`] computes them and keeps every
//! state of every case in the [`store`], and a [`report`] averages what the store holds. The store is the only memory:
//! a process may die at any line, and the next one goes on. On a cluster a scheduler of the [`cluster`] starts tasks that compute slices of the
//! campaign in stores of their own, published as shards and merged into the one store.
//!
//! # From another program
//! The Python package calls the same functions as the commands do, and holds none of their work:
//! ```text
//! campaign::Campaign                  a campaign file, or the text of one
//! cli::{plan, InstantInput, …}        what plan, solve and scalars read and answer
//! api::begin                          a campaign in its store, before anything is computed
//! runner::compute_campaign            run: with runner::{Stop, Progress, Options}
//! store::StoreSource                  opened for reading, for report::Report, Store::samples, Store::frames, Store::runs
//! report::outline                     a figure, to be drawn elsewhere
//! data::DataColumn                    what tables are made of
//! Error, cli::ErrorRenderer           the same words, and the kind of trouble by its exit code
//! ```

pub mod api;
pub mod axes;
pub mod campaign;
pub mod case;
mod checkpoint;
pub mod cli;
mod clock;
pub mod cluster;
mod costs;
mod csv_rows;
pub mod data;
pub mod doubt;
pub mod exit;
mod files;
pub mod format;
mod process;
pub mod protocol;
mod replay;
pub mod report;
pub mod runner;
pub mod serve;
pub mod statistics;
pub mod store;
mod stresses;
pub mod tables;
pub mod trajectory;
mod visible;

#[cfg(test)]
mod test_support;

pub use cli::Error;
