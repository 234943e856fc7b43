//! From a description to a scene: lights on surfaces, detectors in the geometry, media at the ends of paths.

use super::description::{SceneDescription, WavelengthChoice, WavelengthSettings};
use super::effects::find_effects;
use super::probe::stack_at;
use super::{Object, Scene, Sensor};
use crate::camera::Camera;
use crate::geometry::{Accel, Instance, InstanceId, Shape, Shutter, Transform};
use crate::light::area::AreaLight;
use crate::light::beam::BeamLight;
use crate::light::point::PointLight;
use crate::light::selection::LightSelection;
use crate::light::spot::SpotLight;
use crate::light::{Light, LightContext, LightId};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, MediumId, MediumStack};
use crate::spectrum::{Emission, WavelengthDistribution};
use glam::{DVec2, DVec3};

/// Why a description is no scene.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum BuildError {
    /// Nothing emits.
    #[error("the scene has no light that emits anything in the working range of wavelengths")]
    NoLight,
    /// Rays disagree about the medium around a light or sensor.
    #[error(
        "cannot tell which medium {what} \"{name}\" is in (a solid around it is not closed, or a surface cuts through it)"
    )]
    UnclearMedium {
        /// "light" or "sensor".
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// The medium around a light or sensor is another one at another time.
    #[error("{what} \"{name}\" moves from one medium into another while the shutter is open")]
    ChangingMedium {
        /// "light" or "sensor".
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// More instances than ids.
    #[error("the scene has more than {0} surfaces")]
    TooManyInstances(u32),
}

/// Points of a surface at which the medium around it is checked.
const PROBES: [[f64; 3]; 5] = [
    [0.5, 0.5, 0.5],
    [0.1, 0.07, 0.09],
    [0.9, 0.93, 0.06],
    [0.3, 0.08, 0.94],
    [0.7, 0.92, 0.91],
];

/// Moments of the shutter at which media are looked for and powers averaged where something moves, as fractions.
const MOMENTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

impl Scene {
    /// Builds a scene.
    ///
    /// # Errors
    /// Where the parts are valid by themselves but do not make a scene.
    pub fn build(description: SceneDescription) -> Result<Self, BuildError> {
        let SceneDescription {
            media,
            mut materials,
            objects: described,
            lights: free_lights,
            sensors,
            wavelengths,
            ambient,
            hash,
        } = description;
        let black = MaterialId(materials.len() as u32);
        materials.push(Material::default());

        let mut instances = Vec::with_capacity(described.len());
        let mut objects = Vec::with_capacity(described.len());
        let mut lights = Vec::new();
        let mut light_names = Vec::new();
        if described.len() + sensors.len() >= u32::MAX as usize {
            return Err(BuildError::TooManyInstances(u32::MAX));
        }
        let chosen_lines = match &wavelengths.choice {
            WavelengthChoice::Lines(lines) => Some(lines.clone()),
            _ => None,
        };
        // where only some lines exist, continuous light stands for a band of 1 nm about each
        let seen = |emission: Emission| match &chosen_lines {
            Some(lines) => emission.restricted_to_lines(lines),
            None => emission,
        };
        for object in described {
            let id = InstanceId(instances.len() as u32);
            let instance = Instance {
                shape: object.shape,
                transform: object.transform,
            };
            let light = object.emission.map(|emission| {
                let light = LightId(lights.len() as u32);
                lights.push(Light::Area(AreaLight {
                    instance: id,
                    radiance: seen(emission.radiance),
                    pattern: emission.pattern,
                    two_sided: emission.two_sided,
                }));
                light_names.push(object.name.clone());
                light
            });
            instances.push(instance);
            let material = &materials[object.material.0 as usize];
            objects.push(Object {
                clear: material.is_clear_interface() && light.is_none(),
                covered: material.coverage.is_some()
                    && light.is_none()
                    && object.boundary == Boundary::None,
                name: object.name,
                material: object.material,
                boundary: object.boundary,
                light,
                sensor: None,
                transparent_sensor: false,
            });
        }
        for free in free_lights {
            lights.push(free.light.map_emission(seen));
            light_names.push(free.name);
        }
        let mut placed = Vec::with_capacity(sensors.len());
        for (index, mut sensor) in sensors.into_iter().enumerate() {
            if let Camera::Detector(detector) = &mut sensor.camera {
                detector.instance = Some(InstanceId(instances.len() as u32));
                instances.push(Instance {
                    shape: Shape::Quad,
                    transform: detector.transform.clone(),
                });
                objects.push(Object {
                    name: sensor.name.clone(),
                    material: black,
                    boundary: Boundary::None,
                    light: None,
                    sensor: Some(index),
                    transparent_sensor: detector.transparent,
                    clear: false,
                    covered: false,
                });
            }
            placed.push(Sensor {
                name: sensor.name,
                camera: sensor.camera,
                filter: sensor.filter,
                shutter: sensor.shutter,
                stack: MediumStack::new(ambient),
            });
        }

        let accel = Accel::build(instances);
        let (center, radius) = bounding_sphere(&accel);
        let shutter = placed
            .iter()
            .map(|sensor| sensor.shutter)
            .reduce(Shutter::union)
            .unwrap_or_default();
        let is_moving = accel.instances().iter().any(Instance::is_moving)
            || lights
                .iter()
                .filter_map(Light::transform)
                .any(Transform::is_moving)
            || placed
                .iter()
                .any(|sensor| sensor.camera.transform().is_moving());
        let moments = |shutter: Shutter| -> Vec<f64> {
            if is_moving && !shutter.is_instant() {
                MOMENTS.iter().map(|&u| shutter.at(u)).collect()
            } else {
                vec![shutter.open_s]
            }
        };
        let contexts: Vec<LightContext> = moments(shutter)
            .into_iter()
            .map(|time| LightContext {
                accel: &accel,
                center,
                radius,
                time,
            })
            .collect();
        let mean_flux = |light: &Light| {
            contexts.iter().map(|c| light.flux_factor(c)).sum::<f64>() / contexts.len() as f64
        };
        let fluxes: Vec<f64> = lights.iter().map(mean_flux).collect();
        let power = |(light, flux): (&Light, &f64)| {
            flux * light.emission().sampling_power(wavelengths.range_nm)
        };
        let powers: Vec<f64> = lights.iter().zip(&fluxes).map(power).collect();
        if !powers.iter().any(|&p| p > 0.0) {
            return Err(BuildError::NoLight);
        }
        let distribution = distribution(&wavelengths, &lights, &fluxes);

        let mut light_stacks = Vec::with_capacity(lights.len());
        for (light, name) in lights.iter().zip(&light_names) {
            let stacks = contexts
                .iter()
                .map(|context| light_stack(&accel, &objects, context, light, ambient));
            light_stacks.push(lasting(stacks, "light", name)?);
        }
        for sensor in &mut placed {
            let stacks = moments(sensor.shutter)
                .into_iter()
                .map(|time| sensor_stack(&accel, &objects, &sensor.camera, time, ambient));
            sensor.stack = lasting(stacks, "sensor", &sensor.name)?;
        }
        let environments = (0..lights.len())
            .filter(|&i| matches!(lights[i], Light::Environment(_)))
            .map(|i| LightId(i as u32))
            .collect();
        let mut scene = Self {
            has_coverage: objects.iter().any(|o| o.covered),
            selection: LightSelection::new(&powers),
            accel,
            objects,
            materials,
            media,
            lights,
            light_names,
            light_stacks,
            environments,
            sensors: placed,
            wavelengths: distribution,
            center,
            radius,
            is_moving,
            effects: Vec::new(),
            hash,
        };
        scene.effects = find_effects(&scene);
        Ok(scene)
    }
}

/// The distribution of wavelengths for these lights.
fn distribution(
    settings: &WavelengthSettings,
    lights: &[Light],
    fluxes: &[f64],
) -> WavelengthDistribution {
    if let WavelengthChoice::Lines(lines) = &settings.choice {
        return WavelengthDistribution::lines(lines);
    }
    let emitters: Vec<(Emission, f64)> = lights
        .iter()
        .zip(fluxes)
        .map(|(light, &flux)| (light.emission().clone(), flux))
        .collect();
    let scene = WavelengthDistribution::scene(&emitters, settings.range_nm);
    match &settings.choice {
        WavelengthChoice::Uniform => {
            WavelengthDistribution::uniform(settings.range_nm).with_atoms_of(&scene)
        }
        WavelengthChoice::Visible => {
            WavelengthDistribution::visible(settings.range_nm).with_atoms_of(&scene)
        }
        _ => scene,
    }
}

/// The sphere around the geometry's box; of radius 1 about the origin without geometry.
fn bounding_sphere(accel: &Accel) -> (DVec3, f64) {
    accel.bounds().map_or((DVec3::ZERO, 1.0), |(low, high)| {
        let radius = (high - low).length() * 0.5;
        ((low + high) * 0.5, if radius > 0.0 { radius } else { 1.0 })
    })
}

/// The stack that is found at all moments.
fn lasting(
    stacks: impl Iterator<Item = Option<MediumStack>>,
    what: &'static str,
    name: &str,
) -> Result<MediumStack, BuildError> {
    let mut found: Option<MediumStack> = None;
    for stack in stacks {
        let name = || name.to_owned();
        let stack = stack.ok_or_else(|| BuildError::UnclearMedium { what, name: name() })?;
        if found.as_ref().is_some_and(|first| *first != stack) {
            return Err(BuildError::ChangingMedium { what, name: name() });
        }
        found = Some(stack);
    }
    Ok(found.expect("invariant: there is at least one moment"))
}

fn light_stack(
    accel: &Accel,
    objects: &[Object],
    context: &LightContext,
    light: &Light,
    ambient: MediumId,
) -> Option<MediumStack> {
    match light {
        Light::Area(area) => {
            let mut found: Option<MediumStack> = None;
            for [u, v, w] in PROBES {
                let instance = &accel.instances()[area.instance.0 as usize];
                let point = instance
                    .sample_area(area.instance, context.time, u, DVec2::new(v, w))
                    .point;
                let stack = stack_at(
                    accel,
                    objects,
                    point.p,
                    point.ng,
                    Some(point.id),
                    context.time,
                    ambient,
                )?;
                if found.as_ref().is_some_and(|first| *first != stack) {
                    return None;
                }
                found = Some(stack);
            }
            found
        }
        Light::Point(PointLight { transform, .. })
        | Light::Spot(SpotLight { transform, .. })
        | Light::Beam(BeamLight { transform, .. }) => {
            let p = transform.at(context.time).to_world.translation;
            stack_at(accel, objects, p, DVec3::ZERO, None, context.time, ambient)
        }
        Light::Directional(_) | Light::Environment(_) => Some(MediumStack::new(ambient)),
    }
}

fn sensor_stack(
    accel: &Accel,
    objects: &[Object],
    camera: &Camera,
    time: f64,
    ambient: MediumId,
) -> Option<MediumStack> {
    let resolution = camera.resolution();
    let size = DVec2::new(f64::from(resolution.width), f64::from(resolution.height));
    let mut found: Option<MediumStack> = None;
    for [u, v, _] in PROBES {
        let sample = camera.sample_ray(DVec2::new(u, v) * size, DVec2::new(v, u), time);
        let stack = stack_at(
            accel,
            objects,
            sample.xk.p,
            sample.xk.n,
            sample.xk.surface,
            time,
            ambient,
        )?;
        if found.as_ref().is_some_and(|first| *first != stack) {
            return None;
        }
        found = Some(stack);
    }
    found
}
