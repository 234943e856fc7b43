//! Integrators: thin strategies over the path core.

pub mod sample;

pub use sample::{Frame, Workspace, sample_pixel};
