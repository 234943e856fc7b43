//! Motion blur of a scene: which things move while a shutter is open, and how far in the picture.

use super::Scene;
use crate::geometry::{Instance, Shape};
use glam::{DVec2, DVec3};

/// A thing that moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// A surface, by instance (detectors are sensors).
    Object(usize),
    /// A light that is not a surface.
    Light(usize),
    /// A camera or detector.
    Sensor(usize),
}

/// Steps over the shutter along which ways are measured.
const STEPS: u32 = 64;
/// Most triangles of a thing whose corners are followed.
const TRIANGLES: usize = 64;

impl Scene {
    /// Everything that moves while any shutter is open.
    #[must_use]
    pub fn moving(&self) -> Vec<Moving> {
        let objects = self
            .accel
            .instances()
            .iter()
            .enumerate()
            .filter(|(i, instance)| self.objects[*i].sensor.is_none() && instance.is_moving())
            .map(|(i, _)| Moving::Object(i));
        let lights = (0..self.lights.len())
            .filter(|&i| self.lights[i].is_moving())
            .map(Moving::Light);
        let sensors = (0..self.sensors.len())
            .filter(|&i| self.sensors[i].camera.transform().is_moving())
            .map(Moving::Sensor);
        objects.chain(lights).chain(sensors).collect()
    }

    /// The kind of a moving thing, and its name.
    #[must_use]
    pub fn name_of(&self, moving: Moving) -> (&'static str, &str) {
        match moving {
            Moving::Object(i) => ("object", &self.objects[i].name),
            Moving::Light(i) => ("light", &self.light_names[i]),
            Moving::Sensor(i) => ("sensor", &self.sensors[i].name),
        }
    }

    /// Length of the longest screen-space track, in pixels, of a point of the thing in the picture
    /// of a camera while its shutter is open; of a moving camera itself, of a corner of the scene.
    /// `None` where there is nothing to follow: for detectors, for lights at infinity, for what is
    /// behind the camera.
    #[must_use]
    pub fn motion_blur_px(&self, sensor: usize, moving: Moving) -> Option<f64> {
        let points: Vec<Box<dyn Fn(f64) -> DVec3 + '_>> = match moving {
            Moving::Object(i) => points_of(&self.accel.instances()[i]),
            Moving::Light(i) => {
                let transform = self.lights[i].transform.as_ref()?;
                let at = |t: f64| transform.at(t).to_world.translation;
                (!self.lights[i].is_infinite())
                    .then(|| vec![Box::new(at) as Box<dyn Fn(f64) -> DVec3>])?
            }
            Moving::Sensor(i) if i == sensor => {
                let (low, high) = self.accel.bounds()?;
                corners(low, high)
                    .map(|p| Box::new(move |_| p) as Box<dyn Fn(f64) -> DVec3>)
                    .collect()
            }
            Moving::Sensor(_) => return None,
        };
        let way = |point: &dyn Fn(f64) -> DVec3| {
            let mut way = None;
            let mut last: Option<DVec2> = None;
            for i in 0..=STEPS {
                let here = self.raster(sensor, point, f64::from(i) / f64::from(STEPS));
                if let (Some(a), Some(b)) = (last, here) {
                    way = Some(way.unwrap_or(0.0) + a.distance(b));
                }
                last = here;
            }
            way
        };
        points
            .iter()
            .filter_map(|point| way(point.as_ref()))
            .reduce(f64::max)
    }

    /// Where a point is in the picture at a fraction of the shutter.
    fn raster(&self, sensor: usize, point: &dyn Fn(f64) -> DVec3, u: f64) -> Option<DVec2> {
        let sensor = &self.sensors[sensor];
        if sensor.camera.is_hittable() {
            return None;
        }
        let time = sensor.shutter.at(u);
        let center = DVec2::splat(0.5);
        let seen =
            sensor
                .camera
                .sample_connection(point(time), center, time.into(), f64::INFINITY)?;
        Some(seen.raster)
    }
}

fn corners(low: DVec3, high: DVec3) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |i| {
        let side = |axis: usize| if i >> axis & 1 == 0 { low } else { high }[axis];
        DVec3::new(side(0), side(1), side(2))
    })
}

/// Points of an instance as functions of time: the corners of its box, or vertices of a mesh that
/// changes its form.
fn points_of(instance: &Instance) -> Vec<Box<dyn Fn(f64) -> DVec3 + '_>> {
    let to_world = |t: f64| instance.transform.at(t).to_world;
    if let Shape::Deforming(mesh) = &instance.shape {
        let step = mesh.triangle_count().div_ceil(TRIANGLES);
        return (0..mesh.triangle_count())
            .step_by(step)
            .flat_map(|prim| (0..3).map(move |corner| (prim as u32, corner)))
            .map(|(prim, corner)| {
                let at = move |t: f64| to_world(t).transform_point3(mesh.corners(prim, t)[corner]);
                Box::new(at) as Box<dyn Fn(f64) -> DVec3>
            })
            .collect();
    }
    let (low, high) = instance.shape.bounds();
    corners(low, high)
        .map(|p| Box::new(move |t| to_world(t).transform_point3(p)) as Box<dyn Fn(f64) -> DVec3>)
        .collect()
}
