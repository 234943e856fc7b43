//! Objects, their transforms and media, and lights.

use super::super::plan::{
    FramePlan, ImagePlan, LightKind, LightPlan, LobePlan, MaterialPlan, MeshPlan, ModelPlan,
    ObjectPlan, ShapePlan, Span,
};
use super::super::schema::{
    At, Environment, Light, Material, Mesh, Model, NameOr, Named, Object, Quad, Render,
};
use super::motion::May;
use super::sensor::{DEFAULT_RESOLUTION, FILTER_RADIUS};
use super::spectrum::Use;
use super::transform::euler;
use super::{Allowed, Checker, FINITE, NON_NEGATIVE, POSITIVE, label};
use crate::io::files::MAX_OBJ_BYTES;
use crate::io::image_file::MAX_IMAGE_BYTES;
use crate::io::model::{MAX_MODEL_BYTES, Staging};
use crate::io::model_file::ModelKind;
use crate::medium::{Boundary, MediumId};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The image of an environment that is built in.
const STUDIO: &str = "builtin:studio";
const HALF_ANGLE: Allowed = Allowed {
    text: "above 0, at most 180 degrees",
    test: |v| v > 0.0 && v <= 180.0,
};
/// Most frames of a mesh.
const MAX_FRAMES: usize = 1024;
/// Material without lobes: the last one of the plan.
type Materials = [MaterialPlan];

impl Checker<'_> {
    /// `[mesh.NAME]` and the index of its file in the plan.
    pub(super) fn named_meshes(&mut self, meshes: &Named<Mesh>) -> BTreeMap<String, usize> {
        let mut ids = BTreeMap::new();
        for (name, mesh) in meshes {
            if let Some(id) = self.mesh(mesh, &name.span()) {
                ids.insert(name.get_ref().clone(), id);
            }
        }
        ids
    }

    /// The index of a mesh: the same one is read once.
    fn mesh(&mut self, mesh: &Mesh, at: &Span) -> Option<usize> {
        let frames = match (&mesh.obj, &mesh.ply, &mesh.frames) {
            (Some(obj), None, None) => vec![self.mesh_file(0.0, obj, ModelKind::Obj)?],
            (None, Some(ply), None) => vec![self.mesh_file(0.0, ply, ModelKind::Ply)?],
            (None, None, Some(frames)) => {
                let given = frames.get_ref();
                if given.is_empty() || given.len() > MAX_FRAMES {
                    let message = format!("{} frames (allowed: 1 to {MAX_FRAMES})", given.len());
                    self.conflict(&frames.span(), message);
                    return None;
                }
                let mut plans = Vec::with_capacity(given.len());
                let mut last = f64::NEG_INFINITY;
                for frame in given {
                    let time = self.number("time", &frame.get_ref().time, FINITE);
                    if time <= last {
                        self.conflict(
                            &frame.get_ref().time.span(),
                            "time is not above that of the frame before",
                        );
                    }
                    last = time;
                    plans.push(self.mesh_file(time, &frame.get_ref().obj, ModelKind::Obj));
                }
                plans.into_iter().collect::<Option<Vec<FramePlan>>>()?
            }
            _ => {
                self.conflict(at, "a mesh needs one of obj, ply and frames");
                return None;
            }
        };
        let key = |frames: &[FramePlan]| -> Vec<(u64, PathBuf)> {
            let one = |f: &FramePlan| (f.time_s.to_bits(), f.path.clone());
            frames.iter().map(one).collect()
        };
        let known = self
            .meshes
            .iter()
            .position(|m| key(&m.frames) == key(&frames));
        Some(known.unwrap_or_else(|| {
            self.meshes.push(MeshPlan { frames });
            self.meshes.len() - 1
        }))
    }

    /// A file of another program.
    pub(super) fn model(&mut self, model: &At<Model>, render: &Render) -> Option<ModelPlan> {
        let (m, at) = (model.get_ref(), model.span());
        let files = [
            ("gltf", &m.gltf, ModelKind::Gltf, 1.0),
            ("obj", &m.obj, ModelKind::Obj, self.unit_m),
            ("ply", &m.ply, ModelKind::Ply, self.unit_m),
        ];
        let choices: Vec<(&str, bool)> = files.iter().map(|f| (f.0, f.1.is_some())).collect();
        let chosen = self.exactly_one(&at, "model", &choices)?;
        let (_, file, kind, unit_m) = files[chosen];
        let file = file.as_ref()?;
        let path = self.file(file, MAX_MODEL_BYTES)?;
        let to_world = self.transform(&m.transform) * DAffine3::from_scale(DVec3::splat(unit_m));
        let volume = to_world.matrix3.determinant().abs();
        if volume.is_nan() || volume < f64::MIN_POSITIVE {
            self.conflict(
                &at,
                "the model has no volume after its transform (allowed: an invertible transform)",
            );
        }
        for (key, at) in [
            ("at", m.at.as_ref().map(At::span)),
            ("animation", m.animation.as_ref().map(At::span)),
        ] {
            if let (Some(at), true) = (at, kind != ModelKind::Gltf) {
                self.conflict(&at, format!("{key} is for gltf only"));
            }
        }
        let at_s = m.at.as_ref().map_or(0.0, |t| self.number("at", t, FINITE));
        let shutter = self.shutter(m.shutter.as_ref());
        let resolution = m.resolution.as_ref();
        let resolution = resolution.map_or(DEFAULT_RESOLUTION, |r| self.resolution(r));
        let radius = render.filter_radius.as_ref();
        Some(ModelPlan {
            path,
            name: file.get_ref().clone(),
            at: file.span(),
            kind,
            staging: Staging {
                to_world,
                at_s,
                animation: m.animation.as_ref().map(|a| a.get_ref().clone()),
                shutter,
            },
            resolution,
            filter: (
                render.filter,
                radius.map(|r| self.number("filter_radius", r, FILTER_RADIUS)),
            ),
            lights: m.lights.unwrap_or(true),
        })
    }

    fn environment(&mut self, environment: &At<Environment>) -> LightKind {
        let e = environment.get_ref();
        let radiance = e
            .radiance
            .as_ref()
            .map(|r| self.spectrum("radiance", r, Use::Emission));
        if radiance.is_none() && e.image.is_none() {
            self.conflict(
                &environment.span(),
                "environment needs radiance, image or both",
            );
        }
        if let (Some(turn), None) = (&e.euler_deg, &e.image) {
            self.conflict(
                &turn.span(),
                "euler_deg is for environments with an image only",
            );
        }
        let image = e.image.as_ref().and_then(|image| {
            let path = if image.get_ref() == STUDIO {
                None
            } else {
                Some(self.file(image, MAX_IMAGE_BYTES)?)
            };
            let turn = e
                .euler_deg
                .as_ref()
                .map_or(DVec3::ZERO, |t| self.vector("euler_deg", t));
            Some(ImagePlan {
                path,
                name: image.get_ref().clone(),
                at: image.span(),
                to_world: euler(turn),
            })
        });
        LightKind::Environment { radiance, image }
    }

    fn mesh_file(&mut self, time_s: f64, file: &At<String>, kind: ModelKind) -> Option<FramePlan> {
        Some(FramePlan {
            time_s,
            path: self.file(file, MAX_OBJ_BYTES)?,
            name: file.get_ref().clone(),
            at: file.span(),
            kind,
        })
    }

    pub(super) fn objects(
        &mut self,
        objects: &[At<Object>],
        defined: &Named<At<Material>>,
        materials: &Materials,
        media: &[&str],
        meshes: &BTreeMap<String, usize>,
    ) -> Vec<ObjectPlan> {
        let ids: BTreeMap<&str, usize> = defined
            .keys()
            .enumerate()
            .map(|(i, k)| (k.get_ref().as_str(), i))
            .collect();
        let mut plans: Vec<ObjectPlan> = Vec::new();
        for (i, object) in objects.iter().enumerate() {
            let o = object.get_ref();
            let at = object.span();
            let errors_before = self.errors.len();
            let name = label(o.name.as_ref(), "object", i);
            self.unique(
                o.name.as_ref(),
                "object",
                plans.iter().map(|p| p.name.as_str()),
            );
            let material = match &o.material {
                None => materials.len() - 1,
                Some(name) => ids
                    .get(name.get_ref().as_str())
                    .copied()
                    .unwrap_or_else(|| {
                        self.unknown("material", name, &self.names.materials);
                        materials.len() - 1
                    }),
            };
            if o.material.is_none() && o.emission.is_none() {
                self.warnings.push(format!(
                    "{name} has no material and no emission: it is black"
                ));
            }
            let shape = self.shape(o, &at, meshes);
            let boundary = self.boundary(o, &at, media);
            self.closedness(o, shape.map(|s| s.0), &materials[material], boundary);
            let emission = o.emission.as_ref().map(|e| {
                (
                    self.spectrum("emission", e, Use::SurfaceEmission),
                    o.two_sided.as_ref().is_some_and(|t| *t.get_ref()),
                )
            });
            if let (Some(two_sided), None) = (&o.two_sided, &o.emission) {
                self.conflict(
                    &two_sided.span(),
                    "two_sided is for objects with emission only",
                );
            }
            if let (Some(name), Some(_), true) = (
                &o.material,
                &materials[material].coverage,
                o.emission.is_some() || boundary != Boundary::None,
            ) {
                let message = format!(
                    "material \"{}\" has a coverage, which objects with emission, interior or interface cannot have",
                    name.get_ref()
                );
                self.conflict(&name.span(), message);
            }
            let Some((shape, local)) = shape else {
                continue;
            };
            let to_world = self.transform(&o.transform) * local;
            let singular = !to_world.matrix3.is_finite()
                || to_world.matrix3.determinant().abs() < f64::MIN_POSITIVE;
            if singular && self.errors.len() == errors_before {
                self.conflict(&at, "the object has no volume or area after its transform (allowed: an invertible transform)");
            }
            let motion = self.motion(&o.motion, May::Scale);
            let interior_at = o.interior.as_ref().map(At::span);
            plans.push(ObjectPlan {
                name,
                shape,
                to_world,
                motion,
                material: material as u32,
                boundary,
                emission,
                interior_at,
            });
        }
        plans
    }

    fn unique<'n>(
        &mut self,
        name: Option<&At<String>>,
        kind: &str,
        mut others: impl Iterator<Item = &'n str>,
    ) {
        if let Some(name) = name
            && others.any(|o| o == name.get_ref())
        {
            self.conflict(
                &name.span(),
                format!("{kind} \"{}\" is defined twice", name.get_ref()),
            );
        }
    }

    fn shape(
        &mut self,
        o: &Object,
        at: &Span,
        meshes: &BTreeMap<String, usize>,
    ) -> Option<(ShapePlan, DAffine3)> {
        let choices = [
            ("sphere", o.sphere.is_some()),
            ("disk", o.disk.is_some()),
            ("quad", o.quad.is_some()),
            ("cylinder", o.cylinder.is_some()),
            ("box", o.box_.is_some()),
            ("mesh", o.mesh.is_some()),
        ];
        self.exactly_one(at, "object", &choices)?;
        let center = |c: &mut Self, p: Option<&At<[f64; 3]>>| {
            p.map_or(DVec3::ZERO, |p| c.point("center", p))
        };
        if let Some(s) = &o.sphere {
            let s = s.get_ref();
            let r = self.length("radius", &s.radius, POSITIVE);
            let center = center(self, s.center.as_ref());
            return Some((
                ShapePlan::Sphere,
                placed(DMat3::from_diagonal(DVec3::splat(r)), center),
            ));
        }
        if let Some(d) = &o.disk {
            let d = d.get_ref();
            let radius = self.length("radius", &d.radius, POSITIVE);
            let inner = d
                .inner_radius
                .as_ref()
                .map_or(0.0, |r| self.length("inner_radius", r, NON_NEGATIVE));
            if let Some(r) = &d.inner_radius
                && inner >= radius
            {
                self.conflict(&r.span(), "inner_radius is not smaller than radius");
            }
            let normal = d
                .normal
                .as_ref()
                .map_or(DVec3::Z, |n| self.direction("normal", n));
            let center = center(self, d.center.as_ref());
            let map = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, normal)) * radius;
            return Some((
                ShapePlan::Disk {
                    inner: inner / radius,
                },
                placed(map, center),
            ));
        }
        if let Some(q) = &o.quad {
            return self.quad(q).map(|map| (ShapePlan::Quad, map));
        }
        if let Some(c) = &o.cylinder {
            let c = c.get_ref();
            let (from, to) = (self.point("from", &c.from), self.point("to", &c.to));
            let radius = self.length("radius", &c.radius, POSITIVE);
            let half = (to - from) / 2.0;
            let Some(axis) = half.try_normalize() else {
                self.conflict(&c.to.span(), "from and to are the same point");
                return None;
            };
            let turn = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, axis));
            let map = turn * DMat3::from_diagonal(DVec3::new(radius, radius, half.length()));
            return Some((ShapePlan::Cylinder, placed(map, from + half)));
        }
        if let Some(b) = &o.box_ {
            let (min, max) = (
                self.point("min", &b.get_ref().min),
                self.point("max", &b.get_ref().max),
            );
            if !min.cmplt(max).all() {
                self.conflict(
                    &b.get_ref().max.span(),
                    "max is not above min on every axis",
                );
            }
            return Some((
                ShapePlan::Box,
                placed(DMat3::from_diagonal((max - min) / 2.0), (min + max) / 2.0),
            ));
        }
        let source = o.mesh.as_ref()?;
        let id = match source.get_ref() {
            NameOr::Table(mesh) => self.mesh(mesh, &source.span())?,
            NameOr::Name(name) => meshes.get(name).copied().or_else(|| {
                self.unknown(
                    "mesh",
                    &At::new(source.span(), name.clone()),
                    &self.names.meshes,
                );
                None
            })?,
        };
        // the vertices are in the file's unit
        Some((
            ShapePlan::Mesh(id),
            DAffine3::from_scale(DVec3::splat(self.unit_m)),
        ))
    }

    fn quad(&mut self, quad: &At<Quad>) -> Option<DAffine3> {
        let q = quad.get_ref();
        let (u, v) = (self.point("u", &q.u), self.point("v", &q.v));
        let center = self.point("center", &q.center);
        let Some(normal) = u.cross(v).try_normalize() else {
            self.conflict(&quad.span(), "u and v of the quad are parallel or zero");
            return None;
        };
        Some(placed(
            DMat3::from_cols(u, v, normal * u.cross(v).length().sqrt()),
            center,
        ))
    }

    fn medium_id(&mut self, name: &At<String>, media: &[&str]) -> MediumId {
        let found = media.iter().position(|m| m == name.get_ref());
        if found.is_none() {
            self.unknown("medium", name, &self.names.media);
        }
        MediumId(found.unwrap_or(0) as u32)
    }

    fn boundary(&mut self, o: &Object, at: &Span, media: &[&str]) -> Boundary {
        if let (Some(priority), None) = (&o.priority, &o.interior) {
            self.conflict(
                &priority.span(),
                "priority is for objects with interior only",
            );
        }
        match (&o.interior, &o.interface) {
            (None, None) => Boundary::None,
            (Some(interior), None) => {
                let priority = o.priority.as_ref().map_or(0, |p| *p.get_ref());
                Boundary::Solid {
                    medium: self.medium_id(interior, media),
                    priority,
                }
            }
            (None, Some(interface)) => {
                let mut side = |name: Option<&At<String>>| {
                    name.map_or(MediumId::AMBIENT, |n| self.medium_id(n, media))
                };
                let above = side(interface.get_ref().above.as_ref());
                Boundary::Interface {
                    above,
                    below: side(interface.get_ref().below.as_ref()),
                }
            }
            (Some(_), Some(_)) => {
                self.conflict(at, "an object has either interior or interface, not both");
                Boundary::None
            }
        }
    }

    /// A solid needs a closed shape, and a dielectric a medium on each side. (Meshes are looked at once they are read.)
    fn closedness(
        &mut self,
        o: &Object,
        shape: Option<ShapePlan>,
        material: &MaterialPlan,
        boundary: Boundary,
    ) {
        let open = matches!(
            shape,
            Some(ShapePlan::Disk { .. } | ShapePlan::Quad | ShapePlan::Cylinder)
        );
        if let (Some(interior), true) = (&o.interior, open) {
            self.conflict(
                &interior.span(),
                "interior needs a closed shape (allowed: sphere, box, a closed mesh; for others name both sides with interface)",
            );
        }
        let needs_media = material
            .lobes
            .iter()
            .any(|(_, lobe)| matches!(lobe, LobePlan::Dielectric { .. }));
        if let (Some(name), true, Boundary::None) = (&o.material, needs_media, boundary)
            && o.interior.is_none()
            && o.interface.is_none()
        {
            let message = format!(
                "material \"{}\" is dielectric: the object needs interior or interface",
                name.get_ref()
            );
            self.conflict(&name.span(), message);
        }
    }

    pub(super) fn light(&mut self, index: usize, light: &At<Light>) -> Option<LightPlan> {
        let l = light.get_ref();
        let choices = [
            ("point", l.point.is_some()),
            ("spot", l.spot.is_some()),
            ("directional", l.directional.is_some()),
            ("beam", l.beam.is_some()),
            ("environment", l.environment.is_some()),
        ];
        self.exactly_one(&light.span(), "light", &choices)?;
        let name = label(l.name.as_ref(), "light", index);
        let kind = if let Some(p) = l.point.as_ref().map(At::get_ref) {
            LightKind::Point {
                position: self.point("position", &p.position),
                intensity: self.spectrum("intensity", &p.intensity, Use::Emission),
            }
        } else if let Some(s) = l.spot.as_ref().map(At::get_ref) {
            let outer_deg = self.number("outer_deg", &s.outer_deg, HALF_ANGLE);
            let inner_deg = s
                .inner_deg
                .as_ref()
                .map_or(outer_deg, |d| self.number("inner_deg", d, HALF_ANGLE));
            if let Some(inner) = &s.inner_deg
                && inner_deg > outer_deg
            {
                self.conflict(&inner.span(), "inner_deg is larger than outer_deg");
            }
            LightKind::Spot {
                position: self.point("position", &s.position),
                direction: self.direction("direction", &s.direction),
                inner_rad: inner_deg.to_radians(),
                outer_rad: outer_deg.to_radians(),
                intensity: self.spectrum("intensity", &s.intensity, Use::Emission),
            }
        } else if let Some(d) = l.directional.as_ref().map(At::get_ref) {
            LightKind::Directional {
                direction: self.direction("direction", &d.direction),
                irradiance: self.spectrum("irradiance", &d.irradiance, Use::Emission),
            }
        } else if let Some(b) = l.beam.as_ref().map(At::get_ref) {
            LightKind::Beam {
                position: self.point("position", &b.position),
                direction: self.direction("direction", &b.direction),
                radius_m: self.length("radius", &b.radius, POSITIVE),
                irradiance: self.spectrum("irradiance", &b.irradiance, Use::Emission),
            }
        } else {
            self.environment(l.environment.as_ref()?)
        };
        if let (Some(motion), LightKind::Environment { image: None, .. }) =
            (l.motion.first(), &kind)
            && l.environment
                .as_ref()
                .is_some_and(|e| e.get_ref().image.is_none())
        {
            self.conflict(
                &motion.span(),
                "an environment without an image is the same from everywhere: it cannot move",
            );
        }
        let motion = self.motion(&l.motion, May::KeepSize);
        Some(LightPlan { name, motion, kind })
    }
}

fn placed(map: DMat3, center: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(map, center)
}
