//! Integrators: thin strategies over the path core.

pub mod companion;
pub mod photons;
pub mod sample;
pub mod strategies;

pub use companion::Companion;
pub use photons::PhotonTracer;
pub use sample::{
    LightWalks, SensorJob, Workspace, sample_and_merge, sample_pixel, sample_primary,
};
pub use strategies::{aims, fans, strategies};
