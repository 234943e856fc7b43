//! From a checked [`Plan`] to the renderer's own types: library names are looked up, meshes read. One small function per
//! kind of thing; a problem is said at the place of its name.

use super::document::Source;
use super::error::{Problem, SceneFileError, SceneFileErrors};
use super::plan::{
    AbsorptionPlan, IorPlan, LightKind, LobePlan, MediumPlan, ObjectPlan, Plan, SensorPlan,
    ShapePlan, Span, SpectrumPlan, SpectrumSource,
};
use crate::camera::Camera;
use crate::film::Filter;
use crate::geometry::{Mesh, Shape, Transform};
use crate::light::Light;
use crate::material::{LobeSpec, Material, MaterialId};
use crate::medium::{Medium, MediumId};
use crate::scene::description::{
    AreaEmission, LightDescription, ObjectDescription, SceneDescription, SensorDescription,
};
use crate::spectrum::{Curve, Emission, Ior};
use std::path::Path;
use std::sync::Arc;

/// Builds the description.
///
/// # Errors
/// Unknown library names, meshes that cannot be read or are not closed, indices out of range: all of them.
pub fn resolve(
    plan: Plan,
    hash: u64,
    source: &Source,
) -> Result<SceneDescription, SceneFileErrors> {
    let mut r = Resolver {
        source,
        range_nm: plan.wavelengths.range_nm,
        errors: Vec::new(),
    };
    let meshes: Vec<Option<Arc<Mesh>>> = plan
        .meshes
        .iter()
        .map(|m| match load_mesh(&m.path, &m.name) {
            Ok(mesh) => Some(Arc::new(mesh)),
            Err(problem) => r.fail(&m.at, problem),
        })
        .collect();
    let media = plan.media.iter().filter_map(|m| r.medium(m)).collect();
    let materials = plan
        .materials
        .iter()
        .map(|lobes| Material {
            lobes: lobes
                .iter()
                .filter_map(|(w, l)| Some((*w, r.lobe(l)?)))
                .collect(),
        })
        .collect();
    let objects = plan
        .objects
        .iter()
        .filter_map(|o| r.object(o, &meshes))
        .collect();
    let lights = plan
        .lights
        .iter()
        .filter_map(|l| {
            Some(LightDescription {
                name: l.name.clone(),
                light: r.light(&l.kind)?,
            })
        })
        .collect();
    let sensors = plan.sensors.iter().map(sensor).collect();
    match SceneFileErrors::from_unsorted(r.errors) {
        Some(errors) => Err(errors),
        None => Ok(SceneDescription {
            media,
            materials,
            objects,
            lights,
            sensors,
            wavelengths: plan.wavelengths,
            ambient: MediumId::AMBIENT,
            hash,
        }),
    }
}

struct Resolver<'a> {
    source: &'a Source,
    /// Indices must be known over this range.
    range_nm: [f64; 2],
    errors: Vec<SceneFileError>,
}

impl Resolver<'_> {
    fn fail<T>(&mut self, at: &Span, problem: Problem) -> Option<T> {
        self.errors.push(self.source.error(at, problem));
        None
    }

    fn medium(&mut self, m: &MediumPlan) -> Option<Medium> {
        let absorption = match &m.absorption {
            None => None,
            Some(AbsorptionPlan::Coefficient(s)) => Some(self.curve(s)?),
            Some(AbsorptionPlan::Color { color, distance_m }) => {
                Some(absorption_of(&self.curve(color)?, *distance_m))
            }
        };
        Some(Medium {
            name: m.name.clone(),
            ior: self.ior(&m.ior)?,
            absorption,
            use_k: m.use_k,
        })
    }

    fn lobe(&mut self, lobe: &LobePlan) -> Option<LobeSpec> {
        Some(match lobe {
            LobePlan::Diffuse { reflectance } => LobeSpec::Diffuse {
                reflectance: self.curve(reflectance)?,
            },
            LobePlan::Mirror { reflectance } => LobeSpec::Mirror {
                reflectance: self.curve(reflectance)?,
            },
            LobePlan::Conductor { ior, alpha, tint } => LobeSpec::Conductor {
                ior: self.ior(ior)?,
                alpha: *alpha,
                tint: self.curve(tint)?,
            },
            LobePlan::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => LobeSpec::Dielectric {
                alpha: *alpha,
                reflect_tint: self.curve(reflect_tint)?,
                transmit_tint: self.curve(transmit_tint)?,
            },
            LobePlan::Thin { ior, transmit_tint } => LobeSpec::Thin {
                ior: self.ior(ior)?,
                transmit_tint: self.curve(transmit_tint)?,
            },
        })
    }

    fn object(
        &mut self,
        o: &ObjectPlan,
        meshes: &[Option<Arc<Mesh>>],
    ) -> Option<ObjectDescription> {
        let shape = match o.shape {
            ShapePlan::Sphere => Shape::Sphere,
            ShapePlan::Disk { inner } => Shape::Disk { inner },
            ShapePlan::Quad => Shape::Quad,
            ShapePlan::Cylinder => Shape::Cylinder,
            ShapePlan::Box => Shape::Box,
            // a mesh that could not be read has been reported
            ShapePlan::Mesh(i) => Shape::Mesh(meshes.get(i)?.clone()?),
        };
        if let (Some(at), Shape::Mesh(_)) = (&o.interior_at, &shape)
            && !shape.is_closed()
        {
            let message = "interior needs a closed mesh (every edge shared by two triangles of opposite winding)";
            return self.fail(at, Problem::Conflict(message.to_owned()));
        }
        let emission = match &o.emission {
            Some((radiance, two_sided)) => Some(AreaEmission {
                radiance: self.emission(radiance)?,
                two_sided: *two_sided,
            }),
            None => None,
        };
        Some(ObjectDescription {
            name: o.name.clone(),
            shape,
            transform: Transform::fixed(o.to_world),
            material: MaterialId(o.material),
            boundary: o.boundary,
            emission,
        })
    }

    /// A reflectance, tint or coefficient.
    fn curve(&mut self, s: &SpectrumPlan) -> Option<Curve> {
        match &s.source {
            SpectrumSource::Constant(v) => Some(Curve::Constant(v * s.scale)),
            _ => todo!(
                "Rgb: upsampling; Library: by name, Problem::unknown at s.at; Table; checked to be in range"
            ),
        }
    }

    fn emission(&mut self, s: &SpectrumPlan) -> Option<Emission> {
        match &s.source {
            SpectrumSource::Constant(v) if s.luminance.is_none() => Some(Emission {
                continuous: Some(Curve::Constant(*v)),
                lines: Vec::new(),
                scale: s.scale,
            }),
            _ => todo!(
                "as curve, Rgb times D65, Blackbody, Lines; luminance: scale = luminance / Y of the spectrum"
            ),
        }
    }

    /// The index, valid over the working range.
    fn ior(&mut self, ior: &IorPlan) -> Option<Ior> {
        match ior {
            IorPlan::Constant { n, k } if *k == 0.0 => Some(Ior::constant(*n)),
            _ => todo!(
                "library, formulas and tables over {:?}; errors at the plan's place",
                self.range_nm
            ),
        }
    }

    fn light(&mut self, kind: &LightKind) -> Option<Light> {
        match kind {
            LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => {
                self.emission(intensity)?;
                todo!("PointLight, SpotLight")
            }
            LightKind::Directional { irradiance, .. } | LightKind::Beam { irradiance, .. } => {
                self.emission(irradiance)?;
                todo!("DirectionalLight, BeamLight")
            }
            LightKind::Environment { radiance } => {
                self.emission(radiance)?;
                todo!("EnvironmentLight")
            }
        }
    }
}

fn sensor(s: &SensorPlan) -> SensorDescription {
    SensorDescription {
        name: s.name.clone(),
        camera: camera(s),
        filter: filter(s),
    }
}

fn camera(_s: &SensorPlan) -> Camera {
    todo!("Perspective, Orthographic, Detector of s.kind and s.resolution")
}

/// The filter asked for; a box of one pixel for detectors by default.
fn filter(_s: &SensorPlan) -> Filter {
    todo!("s.filter with s.filter_radius")
}

/// α = -ln(color)/distance, in 1/m.
fn absorption_of(color: &Curve, distance_m: f64) -> Curve {
    match color {
        Curve::Constant(c) => Curve::Constant(-c.max(f64::MIN_POSITIVE).ln() / distance_m),
        #[allow(unreachable_patterns)]
        _ => todo!("tabulate color over 360..830 nm"),
    }
}

/// Reads an OBJ file (`crate::io::obj::load` once it is there).
fn load_mesh(_path: &Path, name: &str) -> Result<Mesh, Problem> {
    Err(Problem::BadFile {
        path: name.to_owned(),
        message: "meshes cannot be read yet".to_owned(),
    })
}
