//! From a checked [`Plan`] to the renderer's own types: library names are looked up, meshes read. One small function per
//! kind of thing.

use super::document::Source;
use super::error::SceneFileErrors;
use super::plan::Plan;
use crate::scene::description::SceneDescription;

/// Builds the description.
///
/// # Errors
/// Unknown library names, meshes that cannot be read, indices out of range.
pub fn resolve(
    _plan: Plan,
    _hash: u64,
    _source: &Source,
) -> Result<SceneDescription, SceneFileErrors> {
    todo!("spectra, lights and cameras")
}
