//! Memory that a render needs: films, meshes, images.

use super::OutputRequest;
use crate::film::fixed::FixedSum;
use crate::geometry::{Instance, Shape};
use crate::light::Light;
use crate::scene::Scene;
use crate::spectrum::SpectralChannels;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Bytes of the films of a request, of so many pixels: two halves of a sum per channel. Films of
/// single strategies come with the paths that are met, and are not counted.
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

/// Bytes of the meshes of a scene and of the tables of those that emit, shared ones once.
#[must_use]
pub fn geometry_bytes(scene: &Scene) -> u64 {
    let mesh = |instance: &Instance| match &instance.shape {
        Shape::Mesh(mesh) => Some((Arc::as_ptr(mesh).cast::<()>(), mesh.bytes())),
        Shape::Deforming(mesh) => Some((Arc::as_ptr(mesh).cast(), mesh.bytes())),
        _ => None,
    };
    let table = |light: &Light| {
        let table = light.as_area()?.sampler.table()?;
        Some((Arc::as_ptr(table).cast(), table.bytes()))
    };
    let meshes = scene.accel.instances().iter().filter_map(mesh);
    let tables = scene.lights.iter().filter_map(table);
    let each: BTreeMap<_, _> = meshes.chain(tables).collect();
    each.values().sum::<usize>() as u64
}

/// Bytes of the images of a scene, shared ones once, and of the tables that draw from environments.
#[must_use]
pub fn texture_bytes(scene: &Scene) -> u64 {
    let images: usize = scene.images().iter().map(|i| i.bytes()).sum();
    let table = |light: &Light| {
        let image = light.as_environment().and_then(|e| e.image.as_ref());
        image.map_or(0, |i| i.table_bytes())
    };
    (images + scene.lights.iter().map(table).sum::<usize>()) as u64
}
