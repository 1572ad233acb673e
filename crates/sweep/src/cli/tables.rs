//! The arguments of tables for people, shared by all commands.

use super::words::choice;
use crate::report::{NumberFormat, Shape};

/// Form of tables.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Tables")]
pub(crate) struct TableArguments {
    /// Only these columns after those that name a row; names are those of the CSV file and of JSON
    #[arg(long, value_name = "NAME[,NAME..]", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// Print all default columns, not only as many as fit
    #[arg(long)]
    wide: bool,
    /// Format of numbers with an interval
    #[arg(long, value_parser = choice::<NumberFormat>(), default_value = "plain", hide_short_help = true)]
    format: NumberFormat,
}

impl TableArguments {
    /// Style of a table.
    pub(crate) fn shape(&self) -> Shape {
        Shape {
            wide: self.wide,
            format: self.format,
        }
    }
}
