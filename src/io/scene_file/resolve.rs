//! From a checked [`Plan`] to the renderer's own types: library names are looked up, meshes read. One small function per
//! kind of thing.

mod material;
mod model;

use super::document::Source;
use super::error::{Problem, SceneFileError, SceneFileErrors};
use super::plan::{
    AbsorptionPlan, FramePlan, IorPlan, LightKind, LightPlan, MaterialPlan, MediumPlan, MeshPlan,
    ObjectPlan, Plan, SensorKind, SensorPlan, ShapePlan, Span, SpectrumPlan, SpectrumSource,
};
use super::schema::FilterName;
use crate::camera::detector::Detector;
use crate::camera::orthographic::Orthographic;
use crate::camera::perspective::{Perspective, ThinLens};
use crate::camera::{Camera, Resolution};
use crate::film::Filter as FilmFilter;
use crate::geometry::{Link, Shape, Shutter, Transform};
use crate::io::files::FileProblem;
use crate::io::model_file::ModelKind;
use crate::io::obj::{self, Loaded};
use crate::io::ply;
use crate::light::Light;
use crate::light::beam::BeamLight;
use crate::light::directional::DirectionalLight;
use crate::light::environment::EnvironmentLight;
use crate::light::point::PointLight;
use crate::light::spot::SpotLight;
use crate::material::MaterialId;
use crate::medium::{Boundary, Medium, MediumId, absorption_of};
use crate::scene::description::{
    AreaEmission, LightDescription, ObjectDescription, SceneDescription, SensorDescription,
};
use crate::spectrum::emission::Line;
use crate::spectrum::library::{Library, LibraryError};
use crate::spectrum::{Curve, Emission, Ior, upsample};
use crate::texture::{Image, SpectrumTexture};
use glam::{DAffine3, DMat3, DVec3};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Builds the description; also gives what the models say of themselves.
///
/// # Errors
/// Unknown library names, indices without data, meshes that cannot be read or are not closed where they must be.
pub fn resolve(
    plan: &Plan,
    hash: u64,
    source: &Source,
) -> Result<(SceneDescription, Vec<String>), SceneFileErrors> {
    let mut resolver = Resolver {
        library: Library::embedded(),
        source,
        range_nm: plan.wavelengths.range_nm,
        images: BTreeMap::new(),
        textured: plan
            .materials
            .iter()
            .map(MaterialPlan::texture_at)
            .collect(),
        notes: Vec::new(),
        shutter: shutter(plan),
        errors: Vec::new(),
    };
    let description = resolver.scene(plan, hash);
    match SceneFileErrors::from_unsorted(resolver.errors) {
        None => Ok((description, resolver.notes)),
        Some(errors) => Err(errors),
    }
}

/// From the first sensor to open to the last to close; the cameras of models are sensors where there are no others.
fn shutter(plan: &Plan) -> Shutter {
    let sensors = plan.sensors.iter().map(|sensor| sensor.shutter);
    let models = plan.models.iter().map(|model| model.staging.shutter);
    sensors
        .reduce(Shutter::union)
        .or_else(|| models.reduce(Shutter::union))
        .unwrap_or_default()
}

/// Looks names up, and collects what is wrong: every function returns a stand-in then.
struct Resolver<'a> {
    library: &'static Library,
    source: &'a Source,
    range_nm: [f64; 2],
    /// By file, encoding and whether with a pyramid; `None` where it cannot be read, which has been reported.
    images: BTreeMap<(PathBuf, bool, bool), Option<Arc<Image>>>,
    /// A place where each material names a texture, if it does.
    textured: Vec<Option<Span>>,
    /// What models say of themselves.
    notes: Vec<String>,
    /// From the first sensor to open to the last to close.
    shutter: Shutter,
    errors: Vec<SceneFileError>,
}

impl Resolver<'_> {
    fn error(&mut self, at: &Span, problem: Problem) {
        self.errors.push(self.source.error(at, problem));
    }

    fn scene(&mut self, plan: &Plan, hash: u64) -> SceneDescription {
        let meshes: Vec<Option<(Shape, DVec3)>> =
            plan.meshes.iter().map(|m| self.mesh(m)).collect();
        let mut scene = SceneDescription {
            media: plan.media.iter().map(|m| self.medium(m)).collect(),
            materials: plan.materials.iter().map(|m| self.material(m)).collect(),
            objects: plan
                .objects
                .iter()
                .filter_map(|o| self.object(o, &meshes))
                .collect(),
            lights: plan.lights.iter().map(|l| self.light(l)).collect(),
            sensors: plan.sensors.iter().map(|s| self.sensor(s)).collect(),
            wavelengths: plan.wavelengths.clone(),
            ambient: MediumId::AMBIENT,
            hash,
        };
        self.models(plan, &mut scene);
        scene
    }

    fn bad_file(&mut self, at: &Span, name: &str, message: String) {
        self.error(
            at,
            FileProblem::Bad {
                path: name.to_owned(),
                message,
            }
            .into(),
        );
    }

    fn unknown(&mut self, at: &Span, error: LibraryError) {
        let problem = match error {
            LibraryError::Unknown {
                kind,
                name,
                suggestions,
            } => Problem::Unknown {
                what: kind,
                name,
                suggestion: suggestions.into_iter().next(),
                known: Vec::new(),
            },
            other => Problem::Conflict(other.to_string()),
        };
        self.error(at, problem);
    }

    fn curve(&mut self, plan: &SpectrumPlan) -> Curve {
        let curve = match &plan.source {
            SpectrumSource::Constant(value) => Curve::Constant(*value),
            SpectrumSource::Rgb(rgb) => upsample::reflectance(*rgb),
            SpectrumSource::Library(name) => match self.library.curve(name) {
                Ok(curve) => curve,
                Err(error) => {
                    self.unknown(&plan.at, error);
                    Curve::Constant(0.0)
                }
            },
            SpectrumSource::Table(rows) => table(rows),
            SpectrumSource::Blackbody(temp_k) => Curve::Blackbody {
                temp_k: *temp_k,
                scale: 1.0,
            },
            // rejected when the file was checked
            SpectrumSource::Lines(_) | SpectrumSource::Texture(_) => Curve::Constant(0.0),
        };
        match (curve, plan.scale) {
            (Curve::Constant(value), scale) => Curve::Constant(value * scale),
            (curve, 1.0) => curve,
            (curve, scale) => curve.scaled(scale),
        }
    }

    /// A spectrum that may not exceed 1.
    fn reflectance(&mut self, plan: &SpectrumPlan) -> Curve {
        let curve = self.curve(plan);
        let largest = curve.bounds().1;
        if largest > 1.0 {
            let value = largest.to_string();
            let what = "the largest value of a reflectance or transmittance".to_owned();
            self.error(
                &plan.at,
                Problem::Range {
                    what,
                    value,
                    allowed: "0 to 1",
                },
            );
        }
        curve
    }

    fn emission(&mut self, plan: &SpectrumPlan) -> Emission {
        let emission = match &plan.source {
            SpectrumSource::Rgb(rgb) => Emission::from_rgb(*rgb),
            SpectrumSource::Library(name) => match self.library.emission(name) {
                Ok(emission) => emission,
                Err(error) => {
                    self.unknown(&plan.at, error);
                    Emission::default()
                }
            },
            SpectrumSource::Lines(rows) => Emission::from_lines(
                rows.iter()
                    .map(|&[lambda_nm, value]| Line { lambda_nm, value })
                    .collect(),
            ),
            _ => {
                let unscaled = SpectrumPlan {
                    scale: 1.0,
                    ..plan.clone()
                };
                Emission::from_curve(self.curve(&unscaled))
            }
        };
        match plan.luminance {
            Some(y) => emission.with_luminance(y),
            None => emission.scaled(plan.scale),
        }
    }

    fn ior(&mut self, plan: &IorPlan, conductor: bool) -> Ior {
        let (ior, at) = match plan {
            IorPlan::Constant { n, k } if *k > 0.0 => {
                (Ior::constant(*n).with_k(Curve::Constant(*k)), 0..0)
            }
            IorPlan::Constant { n, .. } => (Ior::constant(*n), 0..0),
            IorPlan::Glass { name, at } | IorPlan::Metal { name, at } => {
                match self.library.ior(name) {
                    Ok(ior) => (ior, at.clone()),
                    Err(error) => {
                        self.unknown(at, error);
                        return Ior::constant(1.5);
                    }
                }
            }
            IorPlan::Cauchy(c) => {
                let mut coefficients = vec![c.first().copied().unwrap_or(1.0)];
                for (i, value) in c.iter().enumerate().skip(1) {
                    coefficients.extend([*value, -2.0 * i as f64]);
                }
                (self.formula(5, coefficients, "Cauchy"), 0..0)
            }
            IorPlan::Sellmeier(terms) => {
                let coefficients = std::iter::once(0.0)
                    .chain(terms.iter().flatten().copied())
                    .collect();
                (self.formula(2, coefficients, "Sellmeier"), 0..0)
            }
            IorPlan::Table {
                rows,
                extrapolate,
                at,
            } => {
                let column = |i: usize| rows.iter().map(|r| r[i]).collect::<Vec<f64>>();
                let ior =
                    Ior::table(&column(0), &column(1), &column(2)).with_extrapolation(*extrapolate);
                (ior.named("the table", "the scene file"), at.clone())
            }
        };
        let valid = if conductor {
            ior.validate_conductor(self.range_nm)
        } else {
            ior.validate(self.range_nm)
        };
        if let Err(error) = valid {
            self.error(&at, Problem::Conflict(error.to_string()));
        }
        ior
    }

    /// A formula of the scene file: fitted by its author to the whole working range, as far as anyone knows.
    fn formula(&mut self, number: u8, coefficients: Vec<f64>, name: &str) -> Ior {
        match Ior::formula(number, coefficients, self.range_nm) {
            Ok(ior) => ior.named(name, "the scene file"),
            Err(error) => {
                self.error(&(0..0), Problem::Conflict(error.to_string()));
                Ior::constant(1.5)
            }
        }
    }

    fn medium(&mut self, plan: &MediumPlan) -> Medium {
        let absorption = plan.absorption.as_ref().map(|absorption| match absorption {
            AbsorptionPlan::Coefficient(plan) => self.curve(plan),
            AbsorptionPlan::Color { color, distance_m } => {
                let transmittance = self.reflectance(color);
                absorption_of(&transmittance, *distance_m, self.range_nm)
            }
        });
        Medium {
            name: plan.name.clone(),
            ior: self.ior(&plan.ior, false),
            absorption,
            use_k: plan.use_k,
        }
    }

    /// A mesh, and where its zero is in the coordinates of its file.
    fn mesh(&mut self, plan: &MeshPlan) -> Option<(Shape, DVec3)> {
        let bad = |frame: &FramePlan, message: String| {
            Problem::from(FileProblem::Bad {
                path: frame.name.clone(),
                message,
            })
        };
        if let [file] = plan.frames.as_slice() {
            let read = match file.kind {
                ModelKind::Ply => ply::load(&file.path),
                _ => obj::load(&file.path).map_err(|e| e.to_string()),
            };
            return match read {
                Ok(Loaded {
                    mesh,
                    origin,
                    notes,
                }) => {
                    let named = notes.into_iter().map(|n| format!("{}: {n}", file.name));
                    self.notes.extend(named);
                    Some((Shape::Mesh(Arc::new(mesh)), origin))
                }
                Err(message) => {
                    self.error(&file.at, bad(file, message));
                    None
                }
            };
        }
        let mut frames = Vec::with_capacity(plan.frames.len());
        for file in &plan.frames {
            match obj::load_arrays(&file.path) {
                Ok((arrays, notes)) => {
                    let named = notes.into_iter().map(|n| format!("{}: {n}", file.name));
                    self.notes.extend(named);
                    frames.push((file.time_s, arrays));
                }
                Err(error) => self.error(&file.at, bad(file, error.to_string())),
            }
        }
        if frames.len() < plan.frames.len() {
            return None;
        }
        match obj::deforming(frames, self.shutter) {
            Ok(both) => Some(both),
            Err(error) => {
                let file = &plan.frames[error.frame().min(plan.frames.len() - 1)];
                self.error(&file.at, bad(file, error.to_string()));
                None
            }
        }
    }

    /// `None` where its mesh could not be read, which has been reported.
    fn object(
        &mut self,
        plan: &ObjectPlan,
        meshes: &[Option<(Shape, DVec3)>],
    ) -> Option<ObjectDescription> {
        let mut to_world = plan.to_world;
        let shape = match plan.shape {
            ShapePlan::Sphere => Shape::Sphere,
            ShapePlan::Disk { inner } => Shape::Disk { inner },
            ShapePlan::Quad => Shape::Quad,
            ShapePlan::Cylinder => Shape::Cylinder,
            ShapePlan::Box => Shape::Box,
            ShapePlan::Mesh(index) => {
                let (shape, origin) = meshes.get(index)?.clone()?;
                to_world *= DAffine3::from_translation(origin);
                shape
            }
        };
        if let (Some(at), Boundary::Solid { .. }) = (&plan.interior_at, plan.boundary)
            && !shape.is_closed()
        {
            let message = "the mesh is not closed, so it has no interior (every edge needs two triangles that run \
                           through it in opposite directions)";
            self.error(at, Problem::Conflict(message.to_owned()));
        }
        if let Some(at) = self.textured_at(plan) {
            let has_coordinates = match &shape {
                Shape::Mesh(mesh) => mesh.has_texture_coordinates(),
                Shape::Deforming(mesh) => mesh.has_texture_coordinates(),
                _ => true,
            };
            if !has_coordinates {
                let message = "a texture on a mesh without texture coordinates";
                self.error(&at, Problem::Conflict(message.to_owned()));
            }
        }
        let emission = plan.emission.as_ref().map(|(spectrum, two_sided)| {
            let (radiance, pattern) = match &spectrum.source {
                SpectrumSource::Texture(texture) => {
                    let white = Emission::from_rgb([spectrum.scale; 3]);
                    let pattern = self.texture(texture).map(|texture| SpectrumTexture::Image {
                        texture,
                        factor: [1.0; 3],
                    });
                    (white, pattern)
                }
                _ => (self.emission(spectrum), None),
            };
            AreaEmission {
                radiance,
                pattern,
                two_sided: *two_sided,
            }
        });
        Some(ObjectDescription {
            name: plan.name.clone(),
            shape,
            transform: self.placed(to_world, &plan.motion),
            material: MaterialId(plan.material),
            boundary: plan.boundary,
            emission,
        })
    }

    /// Where the object has a texture, if it has one.
    fn textured_at(&self, plan: &ObjectPlan) -> Option<Span> {
        let emission = plan.emission.as_ref().map(|e| &e.0.source);
        if let Some(SpectrumSource::Texture(texture)) = emission {
            return Some(texture.at.clone());
        }
        self.textured.get(plan.material as usize).cloned().flatten()
    }

    fn light(&mut self, plan: &LightPlan) -> LightDescription {
        let light = match &plan.kind {
            LightKind::Point {
                position,
                intensity,
            } => Light::Point(PointLight::at(*position, self.emission(intensity))),
            LightKind::Spot {
                position,
                direction,
                inner_rad,
                outer_rad,
                intensity,
            } => {
                let intensity = self.emission(intensity);
                Light::Spot(SpotLight::aimed(
                    *position, *direction, intensity, *outer_rad, *inner_rad,
                ))
            }
            LightKind::Directional {
                direction,
                irradiance,
            } => Light::Directional(DirectionalLight::along(
                *direction,
                self.emission(irradiance),
            )),
            LightKind::Beam {
                position,
                direction,
                radius_m,
                irradiance,
            } => Light::Beam(BeamLight::aimed(
                *position,
                *direction,
                self.emission(irradiance),
                *radius_m,
            )),
            LightKind::Environment { radiance, image } => {
                let radiance = match radiance {
                    Some(radiance) => self.emission(radiance),
                    None => Emission::from_rgb([1.0; 3]),
                };
                match image {
                    None => Light::Environment(EnvironmentLight::uniform(radiance)),
                    Some(image) => self.environment(radiance, image),
                }
            }
        };
        let light = if plan.motion.is_empty() {
            light
        } else {
            light.under(&plan.motion, self.shutter)
        };
        LightDescription {
            name: plan.name.clone(),
            light,
        }
    }

    fn sensor(&self, plan: &SensorPlan) -> SensorDescription {
        let mut sensor = sensor(plan);
        if !plan.motion.is_empty() {
            sensor.camera = sensor.camera.under(&plan.motion, self.shutter);
        }
        sensor
    }

    fn placed(&self, to_world: DAffine3, motion: &[Link]) -> Transform {
        let fixed = Transform::fixed(to_world);
        if motion.is_empty() {
            fixed
        } else {
            fixed.under(motion, self.shutter)
        }
    }
}

fn table(rows: &[[f64; 2]]) -> Curve {
    let nm: Vec<f64> = rows.iter().map(|r| r[0]).collect();
    let values: Vec<f64> = rows.iter().map(|r| r[1]).collect();
    Curve::table(&nm, &values)
}

fn sensor(plan: &SensorPlan) -> SensorDescription {
    let [width, height] = plan.resolution;
    let resolution = Resolution { width, height };
    let camera = match plan.kind {
        SensorKind::Perspective {
            to_world,
            fov_rad,
            aperture_radius_m,
            focus_distance_m,
        } => {
            let lens = (aperture_radius_m > 0.0).then_some(ThinLens {
                radius_m: aperture_radius_m,
                focus_distance_m,
            });
            Camera::Perspective(Perspective::new(
                Transform::fixed(to_world),
                resolution,
                fov_rad,
                lens,
            ))
        }
        SensorKind::Orthographic { to_world, height_m } => {
            let width_m = height_m * f64::from(width) / f64::from(height);
            Camera::Orthographic(Orthographic::new(
                Transform::fixed(to_world),
                resolution,
                width_m,
            ))
        }
        SensorKind::Detector {
            center,
            u,
            v,
            transparent,
        } => {
            let axes = DMat3::from_cols(u.normalize(), v.normalize(), u.cross(v).normalize());
            let pose = DAffine3::from_mat3_translation(axes, center);
            let mut detector = Detector::new(pose, 2.0 * u.length(), 2.0 * v.length(), resolution);
            detector.transparent = transparent;
            Camera::Detector(detector)
        }
    };
    let is_detector = matches!(camera, Camera::Detector(_));
    let filter = film_filter(plan.filter, plan.filter_radius, is_detector);
    SensorDescription {
        name: plan.name.clone(),
        camera,
        filter,
        shutter: plan.shutter,
    }
}

/// The filter of a sensor: what is named, else the default of its kind.
fn film_filter(name: Option<FilterName>, radius: Option<f64>, is_detector: bool) -> FilmFilter {
    match (name, radius) {
        (Some(FilterName::Box), _) => FilmFilter::Box,
        (None, _) if is_detector => FilmFilter::Box,
        (Some(FilterName::Tent), radius) => FilmFilter::Tent {
            radius: radius.unwrap_or(1.0),
        },
        (_, None) => FilmFilter::default(),
        (_, Some(radius)) => FilmFilter::Gaussian {
            sigma: radius / 3.0,
            radius,
        },
    }
}
