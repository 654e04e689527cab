//! # viscera-report
//!
//! What a study leaves behind: one Markdown file with tables, and its figures as SVG beside it.
//!
//! The same data give the same bytes: nothing here looks at a clock or at fonts.

mod axis;
mod chart;
mod document;
mod numbers;
mod output;
mod plot;
mod table;

pub use axis::{Axis, Scale};
pub use document::Document;
pub use numbers::{percent, scientific, si};
pub use plot::{Plot, Series, Style};
pub use table::Table;
