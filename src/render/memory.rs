//! Memory that a render needs: films, meshes, images.

use super::OutputRequest;
use crate::film::fixed::FixedSum;
use crate::geometry::Shape;
use crate::light::Light;
use crate::scene::Scene;
use crate::spectrum::SpectralChannels;
use std::sync::Arc;

/// Bytes of the films of a request, of so many pixels: two halves of a sum per channel. Films of single strategies come
/// with the paths that are met, and are not counted.
#[must_use]
pub fn film_bytes(pixels: u64, request: &OutputRequest) -> u64 {
    let shares = if request.shares { 2 } else { 0 };
    let spectral = request.spectral.as_ref();
    let spectral = spectral.map_or(0, SpectralChannels::count);
    let channels = (3 * (1 + request.classes.len() + shares) + spectral) as u64;
    pixels
        .saturating_mul(channels)
        .saturating_mul(2 * size_of::<FixedSum>() as u64)
}

/// Bytes of the meshes of a scene, shared ones once.
#[must_use]
pub fn geometry_bytes(scene: &Scene) -> u64 {
    let mut seen = Vec::new();
    let mut bytes = 0;
    for instance in scene.accel.instances() {
        let (address, size) = match &instance.shape {
            Shape::Mesh(mesh) => (Arc::as_ptr(mesh).cast::<()>(), mesh.bytes()),
            Shape::Deforming(mesh) => (Arc::as_ptr(mesh).cast(), mesh.bytes()),
            _ => continue,
        };
        if !seen.contains(&address) {
            seen.push(address);
            bytes += size as u64;
        }
    }
    bytes
}

/// Bytes of the images of a scene, shared ones once, and of the tables that draw from environments.
#[must_use]
pub fn texture_bytes(scene: &Scene) -> u64 {
    let images: usize = scene.images().iter().map(|i| i.bytes()).sum();
    let table = |light: &Light| match light {
        Light::Environment(e) => e.image.as_ref().map_or(0, |i| i.table_bytes()),
        _ => 0,
    };
    (images + scene.lights.iter().map(table).sum::<usize>()) as u64
}
