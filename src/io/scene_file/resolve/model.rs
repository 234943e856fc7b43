//! Models, and what surrounds scenes.

use super::super::plan::{ImagePlan, Plan, TexturePlan};
use super::super::schema::OutputUnits;
use super::{Resolver, film_filter};
use crate::camera::Resolution;
use crate::io::gltf::PER_NIT;
use crate::io::model::{self, ModelCamera, Staging};
use crate::io::model_file;
use crate::light::Light;
use crate::light::environment_image::EnvironmentImage;
use crate::math::hash::combine;
use crate::scene::description::{LightDescription, SceneDescription};
use crate::spectrum::Emission;
use crate::texture::{Filter, Wrap};
use glam::{DAffine2, DMat3};
use std::sync::Arc;

impl Resolver<'_> {
    pub(super) fn environment(&mut self, radiance: Emission, plan: &ImagePlan) -> Light {
        let Some(path) = &plan.path else {
            return model::studio(radiance, plan.to_world);
        };
        let texture = TexturePlan {
            path: path.clone(),
            name: plan.name.clone(),
            at: plan.at.clone(),
            srgb: true,
            map: DAffine2::IDENTITY,
            wrap: Wrap::Repeat,
            filter: Filter::Bilinear,
        };
        let image = self.image(&texture).and_then(|image| {
            let environment = EnvironmentImage::new(image, plan.to_world);
            if environment.is_none() {
                self.bad_file(&plan.at, &plan.name, "the image is black".to_owned());
            }
            environment.map(Arc::new)
        });
        Light::environment(radiance, image)
    }

    /// Adds the models, then what a scene with models but without cameras or lights needs.
    pub(super) fn models(&mut self, plan: &Plan, scene: &mut SceneDescription) {
        let mut cameras = Vec::new();
        let mut lit =
            !scene.lights.is_empty() || scene.objects.iter().any(|o| o.emission.is_some());
        for m in &plan.models {
            let staging = Staging {
                shutter: self.shutter,
                ..m.staging.clone()
            };
            let mut read = match model_file::load(&m.path, m.kind, &staging) {
                Ok(read) => read,
                Err(message) => {
                    self.bad_file(&m.at, &m.name, message);
                    continue;
                }
            };
            if !m.lights {
                read.lights.clear();
            }
            lit |= read.lit && m.lights;
            let notes = std::mem::take(&mut read.notes);
            self.notes
                .extend(notes.into_iter().map(|n| format!("{}: {n}", m.name)));
            scene.hash = combine(scene.hash, read.hash);
            let [width, height] = m.resolution;
            let resolution = Resolution { width, height };
            let filter = film_filter(m.filter.0, m.filter.1, false);
            let sensor = |c: &ModelCamera| c.sensor(resolution, filter, m.staging.shutter);
            cameras.extend(read.cameras.iter().map(sensor));
            read.add_to(scene);
        }
        let Some(first) = plan.models.first().filter(|_| self.errors.is_empty()) else {
            return;
        };
        let [width, height] = first.resolution;
        if scene.sensors.is_empty() {
            if cameras.is_empty() {
                self.notes
                    .push("no camera: one that sees all of the model is used".to_owned());
                let camera = model::standard_camera(&scene.objects);
                let filter = film_filter(first.filter.0, first.filter.1, false);
                let resolution = Resolution { width, height };
                cameras.push(camera.sensor(resolution, filter, first.staging.shutter));
            }
            model::name_sensors(&mut cameras);
            scene.sensors = cameras;
        }
        if !lit {
            self.notes
                .push("no light: a studio of built-in lamps is used".to_owned());
            let level = match plan.units {
                OutputUnits::Radiance => 1.0,
                OutputUnits::Photometric => PER_NIT,
            };
            scene.lights.push(LightDescription {
                name: "studio".to_owned(),
                light: model::studio(Emission::from_rgb([level; 3]), DMat3::IDENTITY),
            });
        }
    }
}
