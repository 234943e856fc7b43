//! The two-level tree: instances over shapes and meshes.
//!
//! Both levels are compressed wide trees (Ylitie, Karras and Laine, HPG 2017) of obvhs, which tests f32 boxes with an absolute epsilon. [`Tree`]
//! makes that safe for f64 rays at any scale: boxes live in a frame in which the tree fills -1..1, padded by four units
//! of f32 rounding; the origin is advanced in f64 to the bounds before it is rounded; the direction is
//! shortened by 2^-20, which turns the epsilon of 1e-4 in t into 1e-10 of the size of the tree; and directions near zero
//! get an inverse that stays finite. Boxes only ever cull: every hit is decided in f64 by the shape.

use super::ray::LocalRay;
use super::{Hit, Instance, InstanceId, Ray, Shape, SurfaceId, SurfacePoint, instance};
use glam::{DVec2, DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::RayHit;
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// Added to boxes whose coordinates reach 1: four roundings of f32.
const PADDING: f64 = 4.8e-7;
/// 2^-20, the length of directions handed to obvhs.
const SHORTEN: f32 = 1.0 / 1_048_576.0;
/// Components of such directions below this are as good as zero (2^-60).
const LEAST: f32 = SHORTEN * SHORTEN * SHORTEN;

/// A tree of boxes, in the space of the boxes given.
#[derive(Debug)]
pub(super) struct Tree {
    bvh: CwBvh,
    /// Middle of the bounds and 1 / the largest half side: the map to the frame of the tree.
    center: DVec3,
    inv_scale: f64,
    /// Padded bounds are `-reach..reach` in the frame of the tree.
    reach: DVec3,
}

/// A ray in the frame of a tree.
struct Entry {
    ray: obvhs::ray::Ray,
    /// Where the ray reaches the bounds.
    t0: f64,
    /// Tree parameter per unit of `t`.
    rate: f64,
}

impl Entry {
    /// The tree parameter of `t`, rounded up far enough that nothing nearer is culled.
    #[inline(always)]
    fn parameter(&self, t: f64) -> f32 {
        ((t - self.t0).max(0.0) * self.rate * (1.0 + 1e-6) + 1.0) as f32
    }
}

struct Padded(Aabb);

impl Boundable for Padded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    /// The tree over `count` boxes (at least one), and the order in which its queries number them: the i-th is box
    /// `order[i]`.
    pub fn build(count: usize, bounds: impl Fn(usize) -> (DVec3, DVec3)) -> (Self, Vec<u32>) {
        let (low, high) = (0..count)
            .map(&bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or_default();
        let center = low + (high - low) / 2.0;
        let half = (high - low) / 2.0;
        let largest = half.max_element();
        let inv_scale = if largest > 0.0 { 1.0 / largest } else { 1.0 };
        let frame = |p: DVec3| (p - center) * inv_scale;
        let pad = DVec3::splat(PADDING);
        let boxes: Vec<Padded> = (0..count)
            .map(|i| {
                // Unequal padding tells coincident boxes apart, of which the builder would pair one at a time.
                let pad = pad * (1.0 + (i as f64 * 0.618_033_988_749_894_9).fract());
                let (low, high) = bounds(i);
                Padded(Aabb::new(
                    (frame(low) - pad).as_vec3a(),
                    (frame(high) + pad).as_vec3a(),
                ))
            })
            .collect();
        let params = BvhBuildParams::medium_build();
        let mut bvh = build_cwbvh(&boxes, params, &mut Duration::default());
        bvh.nodes.shrink_to_fit();
        let order = std::mem::take(&mut bvh.primitive_indices);
        (
            Self {
                bvh,
                center,
                inv_scale,
                reach: half * inv_scale + pad * 2.0,
            },
            order,
        )
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        std::mem::size_of_val(self.bvh.nodes.as_slice())
    }

    /// The ray in the frame of the tree, from where it enters the bounds; `None` if it misses them.
    #[inline]
    fn enter(&self, o: DVec3, d: DVec3, t_max: f64) -> Option<Entry> {
        let o = (o - self.center) * self.inv_scale;
        let d = d * self.inv_scale;
        let (mut t0, mut t1) = (0.0f64, t_max);
        for axis in 0..3 {
            let inv = 1.0 / d[axis];
            let a = (-self.reach[axis] - o[axis]) * inv;
            let b = (self.reach[axis] - o[axis]) * inv;
            t0 = t0.max(a.min(b));
            t1 = t1.min(a.max(b));
        }
        if t0 > t1 {
            return None;
        }
        let length = d.abs().max_element();
        let direction = (d / length).as_vec3a() * SHORTEN;
        // The sign must be the one obvhs sees in `direction`, where -0 counts as positive.
        let least = Vec3A::select(
            direction.cmplt(Vec3A::ZERO),
            Vec3A::splat(-LEAST),
            Vec3A::splat(LEAST),
        );
        let guarded = Vec3A::select(direction.abs().cmplt(Vec3A::splat(LEAST)), least, direction);
        let mut entry = Entry {
            ray: obvhs::ray::Ray {
                origin: (o + d * t0).as_vec3a(),
                direction,
                inv_direction: guarded.recip(),
                tmin: 0.0,
                tmax: f32::INFINITY,
            },
            t0,
            rate: length / f64::from(SHORTEN),
        };
        entry.ray.tmax = entry.parameter(t_max);
        Some(entry)
    }

    /// Visits what may be hit before `t_max`, roughly from near to far; `hit` returns the parameter of a new closest
    /// hit.
    #[inline]
    pub fn closest(&self, o: DVec3, d: DVec3, t_max: f64, mut hit: impl FnMut(u32) -> Option<f64>) {
        let Some(entry) = self.enter(o, d, t_max) else {
            return;
        };
        self.bvh
            .ray_traverse(entry.ray, &mut RayHit::none(), |_, i| {
                hit(i as u32).map_or(f32::INFINITY, |t| entry.parameter(t))
            });
    }

    /// Whether `hit` holds for anything that may be hit before `t_max`.
    #[inline]
    pub fn any(&self, o: DVec3, d: DVec3, t_max: f64, mut hit: impl FnMut(u32) -> bool) -> bool {
        let Some(entry) = self.enter(o, d, t_max) else {
            return false;
        };
        !self.bvh.ray_traverse_miss(
            entry.ray,
            |_, i| {
                if hit(i as u32) { 0.0 } else { f32::INFINITY }
            },
        )
    }
}

/// All instances of a scene, ready for ray queries.
#[derive(Debug)]
pub struct Accel {
    instances: Vec<Instance>,
    /// `None` without instances.
    top: Option<Top>,
}

#[derive(Debug)]
struct Top {
    tree: Tree,
    /// The instance of each leaf of the tree.
    order: Vec<u32>,
    bounds: (DVec3, DVec3),
}

impl Accel {
    /// Builds the tree over the instances.
    #[must_use]
    pub fn build(instances: Vec<Instance>) -> Self {
        let boxes: Vec<_> = instances.iter().map(Instance::bounds).collect();
        let bounds = boxes
            .iter()
            .copied()
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let top = bounds.map(|bounds| {
            let (tree, order) = Tree::build(boxes.len(), |i| boxes[i]);
            Top {
                tree,
                order,
                bounds,
            }
        });
        Self { instances, top }
    }

    /// The instances, by id.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// World bounds over the whole shutter; `None` without any instance.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.top.as_ref().map(|top| top.bounds)
    }

    /// `ray` in the own space of an instance.
    #[inline]
    fn local(&self, ray: &Ray, id: InstanceId, t_max: f64) -> (&Shape, LocalRay) {
        let instance = &self.instances[id.0 as usize];
        let to_object = instance.transform.at(ray.time).to_object;
        let extent = instance.shape.extent();
        (
            &instance.shape,
            LocalRay::new(ray, id, &to_object, t_max, extent),
        )
    }

    /// The closest hit among the instances for which `visible` says true.
    #[must_use]
    #[inline]
    pub fn closest(&self, ray: &Ray, visible: impl Fn(InstanceId) -> bool) -> Option<Hit> {
        let top = self.top.as_ref()?;
        let mut best: Option<Hit> = None;
        let mut t_best = ray.t_max;
        top.tree.closest(ray.o, ray.d, ray.t_max, |leaf| {
            let instance = InstanceId(top.order[leaf as usize]);
            if !visible(instance) {
                return None;
            }
            let (shape, local) = self.local(ray, instance, t_best);
            let (t, prim, uv) = match shape {
                Shape::Mesh(mesh) => mesh.closest(&local)?,
                _ => shape
                    .analytic_hit(&local)
                    .map(|(t, prim)| (t, prim, DVec2::ZERO))?,
            };
            best = Some(Hit {
                t,
                id: SurfaceId { instance, prim },
                uv,
            });
            t_best = t;
            Some(t)
        });
        best
    }

    /// Whether any instance for which `opaque` says true is hit.
    #[must_use]
    #[inline]
    pub fn occluded(&self, ray: &Ray, opaque: impl Fn(InstanceId) -> bool) -> bool {
        let Some(top) = &self.top else { return false };
        top.tree.any(ray.o, ray.d, ray.t_max, |leaf| {
            let instance = InstanceId(top.order[leaf as usize]);
            if !opaque(instance) {
                return false;
            }
            let (shape, local) = self.local(ray, instance, ray.t_max);
            match shape {
                Shape::Mesh(mesh) => mesh.occluded(&local),
                _ => shape.analytic_hit(&local).is_some(),
            }
        })
    }

    /// Derivatives of the position by the texture coordinates at a surface point, in world space; `None` where there are
    /// none.
    #[must_use]
    pub fn tangents(&self, point: &SurfacePoint, time: f64) -> Option<[DVec3; 2]> {
        let instance = &self.instances[point.id.instance.0 as usize];
        let placement = instance.transform.at(time);
        let p = placement.to_object.transform_point3(point.p);
        let local = instance.shape.tangents(point.id.prim, p)?;
        Some(local.map(|d| placement.to_world.transform_vector3(d)))
    }

    /// Texture coordinates at the point `p` of a face, in world space.
    #[must_use]
    pub fn texture_coordinates(&self, id: SurfaceId, p: DVec3, time: f64) -> DVec2 {
        let instance = &self.instances[id.instance.0 as usize];
        let p = instance.transform.at(time).to_object.transform_point3(p);
        let weights = match &instance.shape {
            Shape::Mesh(mesh) => mesh.weights(id.prim, p),
            _ => DVec2::ZERO,
        };
        instance.shape.local_point(id.prim, p, weights).uv
    }

    /// Full local geometry of a hit: position refined onto the surface, normals, uv.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let instance = &self.instances[hit.id.instance.0 as usize];
        let placement = instance.transform.at(ray.time);
        let p = placement.to_object.transform_point3(ray.o + ray.d * hit.t);
        let point = instance.shape.local_point(hit.id.prim, p, hit.uv);
        instance::to_world(hit.id.instance, &placement, &point)
    }
}
