//! Colors against colour-science, from the tables to the image files.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests, outside #[test] functions

mod color_checker;
mod files;
mod lamps;
mod python;
mod rendered;
mod spectral;
mod tables;
