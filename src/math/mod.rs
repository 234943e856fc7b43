//! Geometry and statistics that know nothing of light.

pub mod angle;
pub mod banding;
#[cfg(test)]
pub(crate) mod chi_square;
pub mod convergence;
pub mod distribution;
pub mod exact;
pub mod frame;
pub mod hash;
pub mod image_error;
pub mod named;
pub mod predicates;
pub mod sampling;
pub mod stats;
