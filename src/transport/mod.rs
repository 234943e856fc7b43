//! The path core: one walk, one connection, one weight, shared by every integrator.
//!
//! Read in this order: [`density`] (what a vertex knows of its densities), [`mis`] (the terms of
//! all strategies of a path), [`walk`] (sub-paths), [`connect`] (joining them). `README.md` beside
//! this file lists the rules that only appear when effects combine.

pub mod aim;
pub mod class;
pub mod connect;
pub mod context;
pub mod contribution;
pub mod density;
pub mod factors;
pub mod merge;
pub mod mis;
#[cfg(test)]
pub(crate) mod oracle;
pub mod photons;
#[cfg(test)]
pub mod record;
pub mod regularize;
pub mod strategies;
pub mod subpath;
pub mod throughput;
pub mod walk;

pub use context::{
    AskedDensities, Counters, MediaLanes, MediaMemory, PassSettings, PathContext, StepCount,
};
pub use contribution::{Contribution, Target};
pub use density::{Edge, PathView, VertexDensity};
pub use factors::Factors;
pub use photons::{PhotonBuffer, PhotonMap};
pub use regularize::Cone;
pub use strategies::StrategySet;
pub use subpath::Subpath;
pub use throughput::Throughput;
