//! Reports: the results of a store, averaged over seeds.

mod columns;
mod error;
mod failures;
mod figure;
mod fit;
mod labels;
mod page;
mod points;
mod references;
mod runs;
mod segments;
mod selection;
mod sheet;
mod spheres;
mod starts;
mod states;
mod steady;
mod structure;
mod table;
mod text;
mod units;

pub use crate::structure::OutsideFrame;
pub use crate::text::format::NumberFormat;
pub use columns::{Columns, number};
pub use error::ReportError;
pub use failures::FailureGroup;
pub use figure::{
    Against, Drawing, Graph, Kind, Outline, Trace, draw, draw_graphs, outline, traces,
};
pub use fit::FitReport;
pub use page::{PageHost, data, movie, page, page_figure, page_runs};
pub use points::{Point, Report};
pub use references::Reference;
pub use runs::TableFormat;
pub use segments::SegmentReport;
pub(crate) use selection::range;
pub use selection::{Excerpt, Selection};
pub use sheet::Shape;
pub(crate) use sheet::room;
pub use spheres::{SphereColour, SpherePicture, SphereView, draw_spheres};
pub(crate) use starts::Starts;
pub use structure::{StructureKind, StructureReport, outside_structure};
pub use table::{point_table, write_json};
pub use text::write as write_text;
pub use units::Units;
