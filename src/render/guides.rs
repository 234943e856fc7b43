//! First-hit images: depth, normal and albedo through each pixel's centre, in the middle of the
//! shutter.

use crate::bsdf::{Bsdf, CoatingLanes, Interface};
use crate::film::Crop;
use crate::geometry::{InstanceId, Placements, Ray};
use crate::scene::Scene;
use crate::scene::crossing::alone;
use crate::spectrum::{MAX_LANES, xyz};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// First hit of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guide {
    /// Distance from the camera in meters; 0 where nothing is hit.
    pub depth: f64,
    /// Unit shading normal, in world space.
    pub normal: DVec3,
    /// XYZ of the reflectance (equal-energy illuminant).
    pub albedo: [f64; 3],
}

/// First hits over a crop, row by row.
#[must_use]
pub fn guides(scene: &Scene, sensor: usize, crop: &Crop) -> Vec<Guide> {
    // enough wavelengths for a colour
    let wavelengths: Vec<_> = (0..8)
        .map(|i| {
            scene
                .wavelengths
                .sample((f64::from(i) + 0.5) / 64.0, MAX_LANES)
        })
        .collect();
    (crop.y0..crop.y1)
        .into_par_iter()
        .flat_map_iter(|y| (crop.x0..crop.x1).map(move |x| (x, y)))
        .map_init(Placements::default, |placements, (x, y)| {
            let raster = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let sensor = &scene.sensors[sensor];
            let scene = scene.at(sensor.shutter.at(0.5), placements);
            let start = sensor
                .camera
                .sample_ray(raster, DVec2::splat(0.5), scene.moment());
            let mut ray = Ray::leaving(start.xk.p, start.direction, start.xk.surface);
            let visible = |id: InstanceId| scene.object(id).sensor.is_none();
            let mut passed = 0.0;
            let (hit, point) = loop {
                let Some(hit) = scene.closest(&ray, visible) else {
                    return Guide::default();
                };
                let point = scene.geometry.surface(&ray, &hit);
                let mut faces = scene.faces_at(&point);
                // what is mostly open is looked through
                faces.retain(|face| {
                    let id = face.point.id.instance;
                    visible(id)
                        && !(scene.object(id).has_alpha && scene.coverage(&face.point) < 0.5)
                });
                if let Some(last) = faces.len().checked_sub(1) {
                    let met = alone(&scene.objects, &faces).unwrap_or(last);
                    break (hit, scene.shading_point(faces[met].point));
                }
                passed += hit.t;
                ray = Ray::leaving(point.p, ray.d, Some(point.id));
            };
            let material = scene.material(scene.object(point.id.instance).material);
            let mut albedo = [0.0; 3];
            for lanes in &wavelengths {
                let coating = material.coating.as_deref();
                let coating = coating.map(|stack| CoatingLanes::new(stack, lanes));
                let interface = Interface {
                    eta_above: &[1.0; MAX_LANES],
                    eta_below: &[1.5; MAX_LANES],
                    count: lanes.count(),
                    dispersive: false,
                    coating: coating.as_ref(),
                    polarization: scene.polarization,
                    albedos: scene.albedos(),
                };
                let mut lobes = Vec::new();
                material.push_lobes(point.uv, lanes, &interface, &mut lobes);
                let bsdf = Bsdf {
                    lobes: &lobes,
                    interface,
                };
                let colour = bsdf.albedo();
                for j in 0..lanes.count() {
                    let share = f64::from(colour[j])
                        / lanes.pdf(j)
                        / (lanes.count() * wavelengths.len()) as f64;
                    for (sum, cmf) in albedo.iter_mut().zip(xyz::cmf(lanes.lambda_nm(j))) {
                        *sum += share * cmf / xyz::N_Y;
                    }
                }
            }
            Guide {
                depth: passed + hit.t,
                normal: point.ns,
                albedo,
            }
        })
        .collect()
}
