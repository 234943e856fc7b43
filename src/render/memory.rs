//! Memory that a render needs: films, meshes, images.

use super::OutputRequest;
use crate::geometry::contact::Region;
use crate::geometry::{Contact, Instance, Shape};
use crate::light::Light;
use crate::medium::MediumStack;
use crate::scene::{Object, Scene, Sensor};
use crate::spectrum::SpectralChannels;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Bytes of the films of a request, of so many pixels: two halves of a sum per channel. Films of
/// single strategies come with the paths that are met, and are not counted; nor are sums by sources
/// of detectors, of which there are no more than pixels, and at most 64.
#[must_use]
pub fn film_bytes(pixels: u64, request: &OutputRequest) -> u64 {
    let shares = if request.shares { 2 } else { 0 };
    let spectral = request.spectral.as_ref();
    let spectral = spectral.map_or(0, SpectralChannels::count);
    let channels = (3 * (1 + request.classes.len() + shares) + spectral) as u64;
    pixels
        .saturating_mul(channels)
        .saturating_mul(2 * size_of::<i128>() as u64)
}

/// Bytes per pixel of what an image and its preview are made of while they are written: XYZ in
/// doubles, channels, the picture.
const IMAGE_BYTES: u64 = 100;
/// Bytes per pixel of a layer's channel, and of the first hits that layers show.
const LAYER_BYTES: u64 = 12;
/// Halves of sums that are copied for a part: both of whole passes, and one of a pass in flight.
const PART_HALVES: u64 = 3;

/// Bytes that saving takes beside the films, at most at once: the image of so many pixels with the
/// channels of its layers, or its part with so many channels (0: there is none).
#[must_use]
pub fn saving_bytes(pixels: u64, layer_channels: u64, part_channels: u64) -> u64 {
    let image = IMAGE_BYTES + LAYER_BYTES * layer_channels;
    let part = part_channels * PART_HALVES * size_of::<i128>() as u64;
    pixels.saturating_mul(image.max(part))
}

/// Bytes of the objects, lights and sensors of a scene by themselves, and of the tree over them.
#[must_use]
pub fn object_bytes(scene: &Scene) -> u64 {
    let names = |name: &String| name.capacity() as u64;
    let objects = scene.objects.iter().map(|o| names(&o.name)).sum::<u64>();
    let lights = scene.light_names.iter().map(names).sum::<u64>();
    let each = |count: usize, bytes: usize| (count * bytes) as u64;
    let tree = 64;
    objects
        + lights
        + each(
            scene.objects.len(),
            size_of::<Object>() + size_of::<Instance>() + tree,
        )
        + each(
            scene.lights.len(),
            size_of::<Light>() + size_of::<MediumStack>() + size_of::<String>(),
        )
        + each(scene.sensors.len(), size_of::<Sensor>())
        + each(
            scene.contacts.len(),
            size_of::<Contact>() + size_of::<Region>(),
        )
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
