//! From a description to a scene: lights on surfaces, detectors in the geometry, media at the ends
//! of paths.

mod enclosures;
mod power;
mod surroundings;

use super::albedo::albedo_tables;
use super::description::{
    LightDescription, ObjectDescription, SceneDescription, SensorDescription, WavelengthChoice,
};
use super::effects::find_effects;
use super::probe::stack_at;
use super::{Object, Passage, Scene, Sensor};
use crate::camera::{Camera, CameraKind};
use crate::geometry::coincident::MOST_FACES;
use crate::geometry::contact::MOST_CONTACTS;
use crate::geometry::{
    Accel, AccelAt, AreaSampler, Instance, InstanceId, Shape, Shutter, SurfaceId,
};
use crate::light::area::AreaLight;
use crate::light::casters::{Ball, Casters};
use crate::light::selection::LightSelection;
use crate::light::{Light, LightId};
use crate::material::{Material, MaterialId};
use crate::medium::{Boundary, MediumId, MediumStack};
use crate::optics::Polarization;
use crate::spectrum::Emission;
use enclosures::Enclosures;
use glam::{DVec2, DVec3};
use power::distribution;
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, OnceLock};

/// Part of a [`SceneDescription`] that a [`BuildError`] is about, by its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Subject {
    /// An entry of `objects`.
    Object(usize),
    /// The emission of an entry of `objects`.
    Emission(usize),
    /// An entry of `lights`.
    Light(usize),
    /// An entry of `sensors`.
    Sensor(usize),
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Object(_) => "object",
            Self::Emission(_) | Self::Light(_) => "light",
            Self::Sensor(_) => "sensor",
        })
    }
}

/// Why a description is no scene.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum BuildError {
    /// Nothing emits.
    #[error(
        "the scene has no light that emits anything in the working range of wavelengths (needed: a \
         [[light]], or an [[object]] with emission)"
    )]
    NoLight,
    /// Rays disagree about the medium around a light or sensor.
    #[error(
        "cannot tell which medium {subject} \"{name}\" is in (a solid around it is not closed, or a surface cuts through it; its key medium can say it)"
    )]
    UnclearMedium {
        /// The light or sensor.
        subject: Subject,
        /// Name.
        name: String,
    },
    /// The medium that is said to be around a light or sensor is not the one that is there.
    #[error("{subject} \"{name}\" is in the medium \"{found}\", not in \"{named}\"")]
    OtherMedium {
        /// The light or sensor.
        subject: Subject,
        /// Name.
        name: String,
        /// The medium that is there.
        found: String,
        /// The medium that is said to be there.
        named: String,
    },
    /// The medium around a light or sensor is another one at another time.
    #[error("{subject} \"{name}\" moves from one medium into another while the shutter is open")]
    ChangingMedium {
        /// The light or sensor.
        subject: Subject,
        /// Name.
        name: String,
    },
    /// A rough surface where one polarization is asked for.
    #[error(
        "{subject} \"{name}\" is rough, or coated paint: its reflectance is known for unpolarized light only (allowed: smooth and diffuse surfaces, or fresnel = \"average\")"
    )]
    NotPolarized {
        /// The object.
        subject: Subject,
        /// Name.
        name: String,
    },
    /// A solid whose surface moves is wound inwards.
    #[error(
        "{subject} \"{name}\" is inside out: the triangles of its mesh run clockwise seen from outside (allowed: counter-clockwise)"
    )]
    InsideOut {
        /// The object.
        subject: Subject,
        /// Name.
        name: String,
    },
    /// Two detectors are in the same place: only one can be met there.
    #[error(
        "{subject} \"{name}\" lies on sensor \"{other}\": only one detector can be in a place (allowed: a gap, or transparent = true on one of them)"
    )]
    SensorsTouch {
        /// The detector that comes first.
        subject: Subject,
        /// Name.
        name: String,
        /// The name of the other.
        other: String,
    },
    /// A lamp emits from its two sides into two media.
    #[error(
        "{subject} \"{name}\" emits from its two sides into two media (allowed: two lamps that face the two sides)"
    )]
    TwoMedia {
        /// The lamp.
        subject: Subject,
        /// Name.
        name: String,
    },
    /// More surfaces are in one place than are told apart.
    #[error(
        "more than {MOST_FACES} surfaces are in the same place, \"{name}\" and \"{other}\" among them (allowed: {MOST_FACES} that touch)"
    )]
    Crowd {
        /// The object, or the detector.
        subject: Subject,
        /// Name.
        name: String,
        /// The name of another one in its place.
        other: String,
    },
    /// More surfaces touch one another than are looked at.
    #[error(
        "{subject} \"{name}\" and object \"{other}\" are two of too many in one place (allowed: {MOST_CONTACTS} pairs that touch)"
    )]
    TooManyContacts {
        /// The object, or the detector.
        subject: Subject,
        /// Name.
        name: String,
        /// The name of another one in its place.
        other: String,
    },
    /// More instances than ids.
    #[error("the scene has more than {0} surfaces")]
    TooManyInstances(u32),
}

impl BuildError {
    /// The part of the description to blame; `None` where it is the scene as a whole.
    #[must_use]
    pub fn subject(&self) -> Option<Subject> {
        match self {
            Self::UnclearMedium { subject, .. }
            | Self::OtherMedium { subject, .. }
            | Self::ChangingMedium { subject, .. }
            | Self::NotPolarized { subject, .. }
            | Self::InsideOut { subject, .. }
            | Self::TwoMedia { subject, .. }
            | Self::Crowd { subject, .. }
            | Self::TooManyContacts { subject, .. }
            | Self::SensorsTouch { subject, .. } => Some(*subject),
            Self::NoLight | Self::TooManyInstances(_) => None,
        }
    }
}

/// Points of a surface at which the medium around it is checked.
const PROBES: u32 = 32;

/// Numbers of the nth of them, spread evenly (Roberts, The unreasonable effectiveness of
/// quasirandom sequences, 2018).
fn probe(n: u32) -> [f64; 3] {
    [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|step| (0.5 + step * f64::from(n)).fract())
}

/// Moments of the shutter at which media are looked for and powers averaged where something moves,
/// as fractions.
const MOMENTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

impl Scene {
    /// Builds a scene.
    ///
    /// # Errors
    /// Where the parts are valid by themselves but do not make a scene.
    pub fn build(mut description: SceneDescription) -> Result<Self, BuildError> {
        let surfaces = description.objects.len() + description.sensors.len();
        if surfaces >= u32::MAX as usize {
            return Err(BuildError::TooManyInstances(u32::MAX));
        }
        let albedos = albedo_tables(&description);
        let mut builder = Builder::new(&mut description);
        builder.surfaces(std::mem::take(&mut description.objects))?;
        builder.lights(std::mem::take(&mut description.lights));
        builder.sensors(std::mem::take(&mut description.sensors));
        let motions = builder.motions();
        // before the tree, which takes its time over a crowd
        let overlaps = builder.overlaps()?;
        let accel = Accel::build(std::mem::take(&mut builder.instances));
        let moments = Moments::new(&builder, &accel);
        let contacts = builder.surroundings(&accel, &overlaps)?;
        let fluxes = builder.fluxes(&accel, &moments);
        let powers = builder.powers(&fluxes, description.wavelengths.range_nm)?;
        builder.enclosures = Enclosures::new(&accel, &builder.objects);
        let film_exponent = builder.film_exponent(&accel, &fluxes, &powers);
        let light_stacks = builder.light_stacks(&accel, &moments)?;
        builder.sensor_stacks(&accel, &moments)?;

        let Builder {
            materials,
            objects,
            lights,
            light_names,
            sensors,
            notes,
            ..
        } = builder;
        let environments = (0u32..)
            .zip(&lights)
            .filter(|(_, light)| light.as_environment().is_some())
            .map(|(i, _)| LightId(i))
            .collect();
        let wavelengths = distribution(&description.wavelengths, &lights, &fluxes);
        let balls = caster_balls(&objects, &materials, &accel);
        let casters = Casters::new(description.caster_share, balls);
        let passed = (0u32..)
            .zip(&objects)
            .filter(|(_, object)| object.is_passed)
            .filter_map(|(i, object)| Some((InstanceId(i), object.sensor?)))
            .collect();
        let mut scene = Self {
            casters,
            passed,
            has_coverage: objects.iter().any(|o| o.has_alpha),
            selection: LightSelection::new(&powers),
            wavelengths,
            accel,
            objects,
            materials,
            albedos,
            media: description.media,
            wavelength_settings: description.wavelengths,
            polarization: description.polarization,
            sequences: description.sequences,
            lights,
            light_names,
            light_stacks,
            environments,
            sensors,
            motions,
            is_moving: moments.is_moving,
            effects: Vec::new(),
            chains: OnceLock::new(),
            contacts,
            notes,
            film_exponent,
            hash: description.hash,
        };
        scene.effects = find_effects(&scene);
        Ok(scene)
    }
}

/// Balls around all that may cast a caustic.
fn caster_balls(objects: &[Object], materials: &[Material], accel: &Accel) -> Vec<Ball> {
    let casts = |object: &Object| {
        let ambient = MediumId::AMBIENT;
        // a solid of what is around it is not there
        let is_ambient = |b| matches!(b, Boundary::Solid { medium, .. } if medium == ambient);
        let is_there = object.sensor.is_none() && !(object.clear && is_ambient(object.boundary));
        is_there && materials[object.material.0 as usize].casts()
    };
    let things = objects.iter().zip(accel.instances());
    let balls = things.filter(|(object, _)| casts(object));
    let ball = |instance: &Instance| match instance.shape {
        Shape::Sphere => Ball::around_round(instance.bounds()),
        _ => Ball::around(instance.bounds()),
    };
    balls.map(|(_, instance)| ball(instance)).collect()
}

/// A scene in the making, one method a phase.
struct Builder {
    ambient: MediumId,
    named_media: HashMap<Subject, MediumId>,
    media_names: Vec<String>,
    /// The only lines there are, in nanometres, where a render draws nothing else.
    chosen_lines: Option<Vec<f64>>,
    materials: Vec<Material>,
    instances: Vec<Instance>,
    objects: Vec<Object>,
    lights: Vec<Light>,
    light_names: Vec<String>,
    light_subjects: Vec<Subject>,
    sensors: Vec<Sensor>,
    enclosures: Enclosures,
    polarization: Polarization,
    notes: Vec<String>,
}

/// The moments of a shutter at which media are looked for and powers averaged.
struct Moments {
    is_moving: bool,
    /// Those of the union of all shutters.
    all: Vec<f64>,
}

impl Moments {
    fn new(builder: &Builder, accel: &Accel) -> Self {
        let shutters = builder.sensors.iter().map(|sensor| sensor.shutter);
        let shutter = shutters.reduce(Shutter::union).unwrap_or_default();
        let is_moving = accel.instances().iter().any(Instance::is_moving)
            || builder.lights.iter().any(Light::is_moving)
            || builder
                .sensors
                .iter()
                .any(|sensor| sensor.camera.transform().is_moving());
        let mut moments = Self {
            is_moving,
            all: Vec::new(),
        };
        moments.all = moments.of(shutter);
        moments
    }

    fn of(&self, shutter: Shutter) -> Vec<f64> {
        if self.is_moving && !shutter.is_instant() {
            MOMENTS.iter().map(|&u| shutter.at(u)).collect()
        } else {
            vec![shutter.open_s]
        }
    }
}

impl Builder {
    fn new(description: &mut SceneDescription) -> Self {
        let chosen_lines = match &description.wavelengths.choice {
            WavelengthChoice::Lines(lines) => Some(lines.clone()),
            _ => None,
        };
        Self {
            ambient: description.ambient,
            named_media: description.named_media.iter().copied().collect(),
            media_names: description.media.iter().map(|m| m.name.clone()).collect(),
            chosen_lines,
            materials: std::mem::take(&mut description.materials),
            instances: Vec::with_capacity(description.objects.len()),
            objects: Vec::with_capacity(description.objects.len()),
            lights: Vec::new(),
            light_names: Vec::new(),
            light_subjects: Vec::new(),
            sensors: Vec::with_capacity(description.sensors.len()),
            enclosures: Enclosures::default(),
            polarization: description.polarization,
            notes: Vec::new(),
        }
    }

    /// An emission as the render sees it: where only some lines exist, continuous light stands for
    /// a band of 1 nm about each.
    fn seen(&self, emission: Emission) -> Emission {
        match &self.chosen_lines {
            Some(lines) => emission.restricted_to_lines(lines),
            None => emission,
        }
    }

    fn add_light(&mut self, light: Light, name: String, subject: Subject) -> LightId {
        let id = LightId(self.lights.len() as u32);
        self.lights.push(light);
        self.light_names.push(name);
        self.light_subjects.push(subject);
        id
    }

    /// Objects become instances, and those that emit become lights.
    fn surfaces(&mut self, described: Vec<ObjectDescription>) -> Result<(), BuildError> {
        let mut samplers = Samplers::default();
        let mut turned = HashMap::new();
        for (index, mut object) in described.into_iter().enumerate() {
            if matches!(object.boundary, Boundary::Solid { .. }) {
                self.turn_outward(index, &mut object, &mut turned)?;
            }
            let instance = InstanceId(self.instances.len() as u32);
            let placed = Instance {
                shape: object.shape,
                transform: object.transform,
            };
            let light = object.emission.map(|emission| {
                let area = AreaLight {
                    instance,
                    pattern: emission.pattern,
                    sampler: samplers.of(&placed.shape).placed(&placed),
                    two_sided: emission.two_sided,
                };
                let light = Light::area(self.seen(emission.radiance), area);
                self.add_light(light, object.name.clone(), Subject::Emission(index))
            });
            self.instances.push(placed);
            let material = &self.materials[object.material.0 as usize];
            if self.polarization != Polarization::Average && !material.keeps_polarization() {
                return Err(BuildError::NotPolarized {
                    subject: Subject::Object(index),
                    name: object.name,
                });
            }
            self.objects.push(Object {
                is_interface: material.needs_interior(),
                is_smooth_interface: material.is_smooth_interface(),
                clear: material.is_clear_interface() && light.is_none(),
                has_alpha: material.coverage.is_some()
                    && light.is_none()
                    && object.boundary == Boundary::None,
                has_normal_map: material.normal.is_some(),
                passage: Passage::Blocked,
                contacts: Vec::new(),
                is_passed: false,
                name: object.name,
                material: object.material,
                boundary: object.boundary,
                light,
                sensor: None,
                transparent_sensor: false,
            });
        }
        Ok(())
    }

    /// Lights that are no surfaces.
    fn lights(&mut self, described: Vec<LightDescription>) {
        for (index, LightDescription { name, mut light }) in described.into_iter().enumerate() {
            light.emission = self.seen(light.emission);
            self.add_light(light, name, Subject::Light(index));
        }
    }

    /// Sensors, and the black surfaces of detectors.
    fn sensors(&mut self, described: Vec<SensorDescription>) {
        let black = MaterialId(self.materials.len() as u32);
        self.materials.push(Material::default());
        for (index, mut sensor) in described.into_iter().enumerate() {
            let transform = sensor.camera.transform().clone();
            if let CameraKind::Detector(detector) = &mut sensor.camera.kind {
                detector.instance = Some(InstanceId(self.instances.len() as u32));
                let (shape, transform) = match &detector.curved {
                    None => (Shape::Quad, transform),
                    Some(curved) => (
                        Shape::Lens(curved.shape()),
                        transform.inside(curved.to_square()),
                    ),
                };
                self.instances.push(Instance { shape, transform });
                self.objects.push(Object {
                    name: sensor.name.clone(),
                    material: black,
                    boundary: Boundary::None,
                    light: None,
                    sensor: Some(index),
                    transparent_sensor: detector.transparent,
                    is_interface: false,
                    is_smooth_interface: false,
                    clear: false,
                    has_alpha: false,
                    has_normal_map: false,
                    passage: Passage::Blocked,
                    contacts: Vec::new(),
                    is_passed: false,
                });
            }
            self.sensors.push(Sensor {
                name: sensor.name,
                camera: sensor.camera,
                filter: sensor.filter,
                shutter: sensor.shutter,
                stack: MediumStack::new(self.ambient),
            });
        }
    }

    /// Numbers all motions; how many there are.
    fn motions(&mut self) -> usize {
        let mut next = 0;
        for instance in &mut self.instances {
            instance.transform.enumerate(&mut next);
        }
        for transform in self.lights.iter_mut().filter_map(|l| l.transform.as_mut()) {
            transform.enumerate(&mut next);
        }
        for sensor in &mut self.sensors {
            sensor.camera.enumerate_motion(&mut next);
        }
        next
    }

    /// The solids each light is in.
    fn light_stacks(
        &self,
        accel: &Accel,
        moments: &Moments,
    ) -> Result<Vec<MediumStack>, BuildError> {
        let named = self.light_names.iter().zip(&self.light_subjects);
        let stack = |(light, (name, subject)): (&Light, (&String, &Subject))| {
            let at = |&t: &f64| self.light_stack(&accel.at(t), light, 1.0);
            let stack = self.known_stack(moments.all.iter().map(at), *subject, name)?;
            if light.as_area().is_some_and(|area| area.two_sided) {
                let behind = |&t: &f64| self.light_stack(&accel.at(t), light, -1.0);
                match constant_stack(moments.all.iter().map(behind), *subject, name) {
                    Ok(behind) if behind != stack => {
                        return Err(BuildError::TwoMedia {
                            subject: *subject,
                            name: name.clone(),
                        });
                    }
                    Err(problem) if !self.named_media.contains_key(subject) => return Err(problem),
                    _ => {}
                }
            }
            Ok(stack)
        };
        self.lights.iter().zip(named).map(stack).collect()
    }

    /// Sets the solids that each sensor is in.
    fn sensor_stacks(&mut self, accel: &Accel, moments: &Moments) -> Result<(), BuildError> {
        for index in 0..self.sensors.len() {
            let sensor = &self.sensors[index];
            let moments = moments.of(sensor.shutter);
            let at = |&t: &f64| self.sensor_stack(&accel.at(t), &sensor.camera);
            let stacks = moments.iter().map(at);
            self.sensors[index].stack =
                self.known_stack(stacks, Subject::Sensor(index), &sensor.name)?;
        }
        Ok(())
    }

    /// The common stack of all moments, checked against the medium that is named, if one is; where
    /// rays cannot tell, it is the named one.
    fn known_stack(
        &self,
        stacks: impl Iterator<Item = Option<MediumStack>>,
        subject: Subject,
        name: &str,
    ) -> Result<MediumStack, BuildError> {
        let found = constant_stack(stacks, subject, name);
        let Some(&named) = self.named_media.get(&subject) else {
            return found;
        };
        match found {
            Err(BuildError::UnclearMedium { .. }) => Ok(MediumStack::new(named)),
            Ok(stack) if stack.medium() != named => {
                let text = |id: MediumId| self.media_names[id.0 as usize].clone();
                Err(BuildError::OtherMedium {
                    subject,
                    name: name.to_owned(),
                    found: text(stack.medium()),
                    named: text(named),
                })
            }
            found => found,
        }
    }

    /// The solids that a light is in, on the side of a surface's normal (`side` 1) or behind (-1).
    fn light_stack(&self, geometry: &AccelAt, light: &Light, side: f64) -> Option<MediumStack> {
        let stack = |p, n, start| self.stack_at(geometry, p, n, start);
        match light.as_area() {
            Some(area) => common_stack((0..PROBES).map(probe).map(|[u, v, w]| {
                let point = area.sample(geometry, u, DVec2::new(v, w)).point;
                stack(point.p, point.ng * side, Some(point.id))
            })),
            None if light.is_infinite() => Some(MediumStack::new(self.ambient)),
            None => {
                let p = light.placement(geometry).to_world.translation;
                stack(p, DVec3::ZERO, None)
            }
        }
    }

    fn sensor_stack(&self, geometry: &AccelAt, camera: &Camera) -> Option<MediumStack> {
        let size = camera.resolution().size();
        common_stack((0..PROBES).map(probe).map(|[u, v, _]| {
            let (raster, u_lens) = (DVec2::new(u, v) * size, DVec2::new(v, u));
            let xk = camera.sample_ray(raster, u_lens, geometry.moment()).xk;
            self.stack_at(geometry, xk.p, xk.n, xk.surface)
        }))
    }

    fn stack_at(
        &self,
        geometry: &AccelAt,
        p: DVec3,
        normal: DVec3,
        start: Option<SurfaceId>,
    ) -> Option<MediumStack> {
        if self.enclosures.may_hold(p) {
            stack_at(geometry, &self.objects, p, normal, start, self.ambient)
        } else {
            Some(MediumStack::new(self.ambient))
        }
    }
}

/// Samplers of the meshes that emit: instances of one mesh share one.
#[derive(Default)]
struct Samplers(HashMap<*const (), AreaSampler>);

impl Samplers {
    fn of(&mut self, shape: &Shape) -> AreaSampler {
        let mesh = match shape {
            Shape::Mesh(mesh) => Arc::as_ptr(mesh).cast(),
            Shape::Deforming(mesh) => Arc::as_ptr(mesh).cast(),
            _ => return AreaSampler::default(),
        };
        let sampler = self.0.entry(mesh);
        sampler.or_insert_with(|| AreaSampler::new(shape)).clone()
    }
}

/// The common stack of all moments, or why there is none.
fn constant_stack(
    stacks: impl Iterator<Item = Option<MediumStack>>,
    subject: Subject,
    name: &str,
) -> Result<MediumStack, BuildError> {
    let mut found: Option<MediumStack> = None;
    for stack in stacks {
        let name = || name.to_owned();
        let stack = stack.ok_or_else(|| BuildError::UnclearMedium {
            subject,
            name: name(),
        })?;
        if found.as_ref().is_some_and(|first| *first != stack) {
            return Err(BuildError::ChangingMedium {
                subject,
                name: name(),
            });
        }
        found = Some(stack);
    }
    Ok(found.expect("invariant: there is at least one moment"))
}

/// The stack that all probes find; `None` where one finds none or they disagree.
fn common_stack(mut stacks: impl Iterator<Item = Option<MediumStack>>) -> Option<MediumStack> {
    let first = stacks.next()??;
    stacks
        .all(|stack| stack.as_ref() == Some(&first))
        .then_some(first)
}
