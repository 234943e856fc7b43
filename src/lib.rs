//! abbe: a spectral bidirectional renderer.
//!
//! The modules are listed from the ground floor up: a module uses only modules listed above it
//! (`tests/tidy.rs` checks this). `ARCHITECTURE.md` gives the bird's-eye view.

pub mod math;

pub mod spectrum;

pub mod optics;

pub mod geometry;
pub mod texture;

pub mod bsdf;
pub mod camera;
pub mod film;
pub mod light;
pub mod material;
pub mod medium;
pub mod sampler;

pub mod scene;

pub mod transport;

pub mod integrator;

pub mod io;
pub mod render;

pub mod cli;
