//! The two-level tree: instances over shapes and meshes.
//!
//! Boxes only ever cull: every hit is decided in f64 by the shape.

use super::gap::{Crossing, Gaps};
use super::ray::LocalRay;
use super::tree::Tree;
use super::tree_walk::Boxes;
use super::{
    Hit, Instance, InstanceId, Moment, Placement, Ray, Shape, SurfaceId, SurfacePoint, Transform,
    instance,
};
use glam::{DVec2, DVec3};

/// All instances of a scene, ready for ray queries.
#[derive(Debug)]
pub struct Accel {
    instances: Vec<Instance>,
    /// `None` without instances.
    top: Option<Top>,
    center: DVec3,
    radius: f64,
    pub(super) gaps: Gaps,
    /// Whether any shape has searches that had better take turns.
    pub(super) takes_turns: bool,
}

/// All instances of a scene at one moment.
#[derive(Clone, Copy, Debug)]
pub struct AccelAt<'a> {
    accel: &'a Accel,
    moment: Moment<'a>,
}

#[derive(Debug)]
pub(super) struct Top {
    pub(super) tree: Tree,
    /// The instance of each leaf of the tree.
    pub(super) order: Vec<u32>,
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
            let (tree, order) = Tree::build(boxes.len(), 1, |i| boxes[i]);
            Top {
                tree,
                order,
                bounds,
            }
        });
        let (center, radius) = bounds.map_or((DVec3::ZERO, 1.0), |(low, high)| {
            let radius = (high - low).length() * 0.5;
            ((low + high) * 0.5, if radius > 0.0 { radius } else { 1.0 })
        });
        Self {
            gaps: Gaps::new(&instances),
            takes_turns: instances.iter().any(|i| i.shape.takes_turns()),
            instances,
            top,
            center,
            radius,
        }
    }

    /// Center of the sphere around the bounds; the origin without geometry.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Radius of the sphere around the bounds in meters; 1 without geometry.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Another sphere, for closed forms in tests.
    #[cfg(test)]
    pub(crate) fn set_sphere(&mut self, center: DVec3, radius: f64) {
        (self.center, self.radius) = (center, radius);
    }

    /// The instance of this id.
    #[must_use]
    pub fn instance(&self, id: InstanceId) -> &Instance {
        &self.instances[id.0 as usize]
    }

    /// The instances at a moment.
    #[must_use]
    pub fn at<'a>(&'a self, moment: impl Into<Moment<'a>>) -> AccelAt<'a> {
        let (accel, moment) = (self, moment.into());
        AccelAt { accel, moment }
    }

    /// The instances, by id.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    pub(super) fn top(&self) -> Option<&Top> {
        self.top.as_ref()
    }

    /// World bounds over the whole shutter; `None` without any instance.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.top.as_ref().map(|top| top.bounds)
    }
}

impl<'a> AccelAt<'a> {
    /// The instances, whenever.
    #[must_use]
    pub fn accel(&self) -> &'a Accel {
        self.accel
    }

    /// The moment.
    #[must_use]
    pub fn moment(&self) -> Moment<'a> {
        self.moment
    }

    /// The closest hit among the instances for which `visible` says true.
    #[must_use]
    #[inline]
    pub fn closest(&self, ray: &Ray, visible: impl Fn(InstanceId) -> bool) -> Option<Hit> {
        if !self.accel.gaps.is_empty()
            && let Some(hit) = self.across_gap(ray, &visible)
        {
            return Some(hit);
        }
        self.closest_in_tree(ray, visible)
    }

    /// The same, and the point that is hit where it is known already: what [`AccelAt::surface`]
    /// gives, to rounding.
    #[must_use]
    #[inline]
    pub fn closest_point(
        &self,
        ray: &Ray,
        visible: impl Fn(InstanceId) -> bool,
    ) -> Option<(Hit, Option<SurfacePoint>)> {
        if !self.accel.gaps.is_empty()
            && let Some((hit, point)) = self.point_across_gap(ray, &visible)
        {
            return Some((hit, Some(point)));
        }
        Some((self.closest_in_tree(ray, visible)?, None))
    }

    #[inline]
    fn closest_in_tree(&self, ray: &Ray, visible: impl Fn(InstanceId) -> bool) -> Option<Hit> {
        let top = self.accel.top.as_ref()?;
        let mut best: Option<Hit> = None;
        let mut t_best = ray.t_max;
        let entry = top.tree.enter(ray.o, ray.d, ray.t_max)?;
        top.tree.closest(
            &entry,
            |_| (),
            |leaf| {
                let instance = InstanceId(top.order[leaf.start as usize]);
                if !visible(instance) {
                    return None;
                }
                let (t, prim, uv) = self.hit_before(ray, instance, t_best)?;
                best = Some(Hit {
                    t,
                    id: SurfaceId { instance, prim },
                    uv,
                });
                t_best = t;
                Some(t)
            },
        );
        best
    }

    /// The same hit where it is on the far side of a gap, and known for it.
    pub(super) fn across_gap(
        &self,
        ray: &Ray,
        visible: &impl Fn(InstanceId) -> bool,
    ) -> Option<Hit> {
        let (crossing, t) = self.across(ray, visible)?;
        Some(crossing.hit(t))
    }

    /// The same, and the point.
    fn point_across_gap(
        &self,
        ray: &Ray,
        visible: &impl Fn(InstanceId) -> bool,
    ) -> Option<(Hit, SurfacePoint)> {
        let (crossing, t) = self.across(ray, visible)?;
        let hit = crossing.hit(t);
        let instance = self.accel.instance(crossing.to());
        let (Shape::Lens(lens), Transform::Static(placement)) =
            (&instance.shape, &instance.transform)
        else {
            return None;
        };
        // the place is known in the space of the lens
        let point = lens.point(hit.id.prim, crossing.at(t));
        Some((hit, instance::to_world(crossing.to(), placement, &point)))
    }

    #[inline(always)]
    fn across(
        &self,
        ray: &Ray,
        visible: &impl Fn(InstanceId) -> bool,
    ) -> Option<(Crossing<'a>, f64)> {
        let start = ray.start?;
        if ray.end.is_some() || ray.t_max != f64::INFINITY {
            return None;
        }
        let crossing = self.accel.gaps.ahead(ray, start.instance)?;
        if !visible(crossing.to()) {
            return None;
        }
        let Shape::Lens(lens) = &self.accel.instance(crossing.to()).shape else {
            return None;
        };
        let (t, _) = lens.conic_hit(crossing.shape(), &crossing.local(ray, lens.extent()))?;
        crossing.is_free(t).then_some((crossing, t))
    }

    /// The hits of one instance within a ray, from near to far.
    pub fn hits_of(&self, ray: &Ray, id: InstanceId, mut met: impl FnMut(Hit)) {
        let mut rest = *ray;
        let mut before = 0.0;
        while let Some(mut hit) = self.hit_of(&rest, id) {
            hit.t += before;
            met(hit);
            if matches!(
                self.accel.instance(id).shape,
                Shape::Disk { .. } | Shape::Quad
            ) {
                // a line meets a plane once
                return;
            }
            rest = Ray {
                o: self.surface(ray, &hit).p,
                t_max: ray.t_max - hit.t,
                start: Some(hit.id),
                ..*ray
            };
            before = hit.t;
        }
    }

    /// The closest hit of one instance.
    fn hit_of(&self, ray: &Ray, id: InstanceId) -> Option<Hit> {
        let (t, prim, uv) = self.hit_before(ray, id, ray.t_max)?;
        let id = SurfaceId { instance: id, prim };
        Some(Hit { t, id, uv })
    }

    /// The same among hits before `t_max`: where, the face, and weights on a mesh.
    #[inline(always)]
    fn hit_before(&self, ray: &Ray, id: InstanceId, t_max: f64) -> Option<(f64, u32, DVec2)> {
        let Instance { shape, transform } = self.accel.instance(id);
        transform.with(self.moment, |Placement { to_object, .. }| {
            let local = |extent| LocalRay::new(ray, id, to_object, t_max, extent);
            match shape {
                Shape::Mesh(mesh) => mesh.closest(&local(mesh.extent()), self.moment.time()),
                Shape::Deforming(mesh) => mesh.closest(&local(mesh.extent()), self.moment.time()),
                _ => shape
                    .analytic_hit(ray.ends_on(id), local)
                    .map(|(t, prim)| (t, prim, DVec2::ZERO)),
            }
        })
    }

    /// Whether any instance for which `opaque` says true is hit.
    #[must_use]
    #[inline]
    pub fn occluded(&self, ray: &Ray, opaque: impl Fn(InstanceId) -> bool) -> bool {
        self.any(ray, opaque, |_| true)
    }

    /// Whether an instance is hit for which `stops` says true then, among those for which `visible`
    /// does. It is asked about instances that are hit until it says so, in any order.
    #[must_use]
    #[inline]
    pub fn any(
        &self,
        ray: &Ray,
        visible: impl Fn(InstanceId) -> bool,
        mut stops: impl FnMut(InstanceId) -> bool,
    ) -> bool {
        let Some(top) = &self.accel.top else {
            return false;
        };
        let Some(entry) = top.tree.enter(ray.o, ray.d, ray.t_max) else {
            return false;
        };
        top.tree.any(
            &entry,
            |_| (),
            |leaf| {
                let instance = InstanceId(top.order[leaf.start as usize]);
                if !visible(instance) {
                    return false;
                }
                self.is_hit(ray, instance) && stops(instance)
            },
        )
    }

    /// Whether an instance is hit.
    #[inline(always)]
    pub(super) fn is_hit(&self, ray: &Ray, id: InstanceId) -> bool {
        let Instance { shape, transform } = self.accel.instance(id);
        let time = self.moment.time();
        transform.with(self.moment, |Placement { to_object, .. }| {
            let local = |extent| LocalRay::new(ray, id, to_object, ray.t_max, extent);
            match shape {
                Shape::Mesh(mesh) => mesh.occluded(&local(mesh.extent()), time),
                Shape::Deforming(mesh) => mesh.occluded(&local(mesh.extent()), time),
                _ => shape.analytic_hit(ray.ends_on(id), local).is_some(),
            }
        })
    }

    /// Derivatives of the position by the texture coordinates at a surface point, in world space;
    /// `None` where there are none.
    #[must_use]
    pub fn tangents(&self, point: &SurfacePoint) -> Option<[DVec3; 2]> {
        let instance = self.accel.instance(point.id.instance);
        let placement = instance.transform.at(self.moment);
        let p = placement.to_object.transform_point3(point.p);
        let local = instance
            .shape
            .tangents(point.id.prim, p, self.moment.time())?;
        Some(local.map(|d| placement.to_world.transform_vector3(d)))
    }

    /// Texture coordinates at the point `p` of a face, in world space.
    #[must_use]
    pub fn texture_coordinates(&self, id: SurfaceId, p: DVec3) -> DVec2 {
        let instance = self.accel.instance(id.instance);
        let p = instance
            .transform
            .at(self.moment)
            .to_object
            .transform_point3(p);
        let weights = match &instance.shape {
            Shape::Mesh(mesh) => mesh.weights(id.prim, p, self.moment.time()),
            Shape::Deforming(mesh) => mesh.weights(id.prim, p, self.moment.time()),
            _ => DVec2::ZERO,
        };
        instance
            .shape
            .local_point(id.prim, p, weights, self.moment.time())
            .uv
    }

    /// Full local geometry of a hit: position refined onto the surface, normals, uv.
    #[must_use]
    #[inline(always)]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let instance = self.accel.instance(hit.id.instance);
        if let (Shape::Quad | Shape::Disk { .. }, Transform::Static(placement)) =
            (&instance.shape, &instance.transform)
        {
            let p = placement.to_object.transform_point3(ray.o + ray.d * hit.t);
            return instance::flat_to_world(hit.id.instance, placement, p);
        }
        self.surface_of(instance, ray, hit)
    }

    #[inline(never)]
    fn surface_of(&self, instance: &Instance, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let placement = instance.transform.at(self.moment);
        let p = placement.to_object.transform_point3(ray.o + ray.d * hit.t);
        let point = match &instance.shape {
            Shape::Lens(lens) if !instance.is_moving() => lens.point(hit.id.prim, p),
            shape => shape.local_point(hit.id.prim, p, hit.uv, self.moment.time()),
        };
        instance::to_world(hit.id.instance, &placement, &point)
    }
}
