//! Reports: the results of a store, averaged over seeds.

mod axis_words;
mod columns;
mod curves;
mod error;
mod failures;
mod figure;
mod fit;
mod json;
mod markdown;
mod page;
mod points;
mod runs;
mod segments;
mod selection;
mod sheet;
mod spheres;
mod starts;
mod states;
mod steady;
mod structure;
mod text;
mod units;

pub use columns::{Columns, point_table};
pub use error::ReportError;
pub use failures::FailureGroup;
pub use figure::{
    Drawing, Graph, Kind, Outline, Quantity, Trace, draw, draw_graphs, outline, traces,
};
pub use fit::FitReport;
pub use json::write as write_json;
pub(crate) use markdown::write_markdown;
pub use page::{PageHost, data, movie, page};
pub use points::{Point, Report};
pub use runs::TableFormat;
pub use segments::SegmentReport;
pub(crate) use selection::range;
pub use selection::{Excerpt, Selection};
pub(crate) use sheet::room;
pub(crate) use sheet::write_latex;
pub use sheet::{NumberFormat, Shape};
pub use spheres::{SphereColour, SpherePicture, SphereView, draw_spheres};
pub(crate) use starts::Starts;
pub use structure::{StructureKind, StructureReport};
pub(crate) use text::table;
pub use text::write as write_text;
pub use units::Units;
