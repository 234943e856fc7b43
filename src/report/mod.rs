//! Studies of scenes and images: what accuracy costs, what merging shares, how images differ, as
//! typed results with views of them (text, JSON, CSV, SVG, HTML). Prints nothing and knows no
//! command line; progress goes to a callback.

pub mod banding;
pub mod class_tables;
pub mod compare;
pub mod cost;
mod error;
pub mod figure;
pub(crate) mod html;
mod json;
pub mod readable;
pub mod spot;
pub mod statistics;
pub mod svg;

pub use error::ReportError;
