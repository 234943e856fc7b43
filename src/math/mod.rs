//! Geometry and statistics that know nothing of light.

pub mod distribution;
pub mod frame;
pub mod hash;
pub mod predicates;
pub mod sampling;
pub mod stats;
