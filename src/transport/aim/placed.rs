//! Faces of the scene as surfaces that chains are solved for.

use super::quadric::Quadric;
use super::smooth::Smooth;
use super::surface::Surface;
use crate::geometry::{Facets, Instance, Placement, Shape, SurfaceId};
use crate::optics::{LensSurface, Profile};
use glam::{DMat3, DVec3};

/// Relative difference of lengths and cosine of angles up to which a map is one that keeps shapes.
const SIMILAR: f64 = 1e-12;
/// Distance from a lens surface, in units of its aperture, up to which a point is on it.
const ON_SHEET: f64 = 1e-6;

impl<'s> Surface<'s> {
    /// Face `id` of an instance under `placement`, of a mesh with `facets` the plane of one; `None`
    /// where its shape is none of these: a mesh that deforms, an aspheric surface.
    #[must_use]
    pub fn of(
        instance: &'s Instance,
        facets: Option<&Facets>,
        id: SurfaceId,
        placement: &Placement,
    ) -> Option<Self> {
        let prim = id.prim;
        let to_world = placement.to_world;
        let columns = to_world.matrix3;
        let [x, y, z] = [columns.x_axis, columns.y_axis, columns.z_axis];
        let is_round = |a: DVec3, b: DVec3| {
            let (a2, b2) = (a.length_squared(), b.length_squared());
            (a2 - b2).abs() <= SIMILAR * a2 && a.dot(b).abs() <= SIMILAR * a2
        };
        let is_square = |a: DVec3, b: DVec3| a.dot(b).abs() <= SIMILAR * a.length() * b.length();
        let quadric = |q: DMat3, b: DVec3, c: f64| {
            Self::Quadric(Quadric::placed(q, b, c, &to_world, &placement.to_object))
        };
        match instance.shape {
            Shape::Sphere if is_round(x, y) && is_round(y, z) && is_round(z, x) => {
                Some(Self::Sphere {
                    center: to_world.translation,
                    radius: x.length(),
                })
            }
            Shape::Sphere => Some(quadric(DMat3::IDENTITY, DVec3::ZERO, -1.0)),
            Shape::Cylinder if is_round(x, y) && is_square(x, z) && is_square(y, z) => {
                Some(Self::Cylinder {
                    center: to_world.translation,
                    axis: z.normalize(),
                    radius: x.length(),
                    half_length: z.length(),
                })
            }
            Shape::Cylinder => {
                let across = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0));
                Some(quadric(across, DVec3::ZERO, -1.0))
            }
            Shape::Quad | Shape::Disk { .. } => Some(Self::Plane {
                origin: to_world.translation,
                normal: placement.normal_to_world(DVec3::Z),
            }),
            Shape::Box => {
                let n = instance.shape.face_normal(prim)?;
                Some(Self::Plane {
                    origin: to_world.transform_point3(n),
                    normal: placement.normal_to_world(n),
                })
            }
            Shape::Lens(ref lens) => match lens.surface().profile {
                ref flat if flat.is_plane() => Some(Self::Plane {
                    origin: to_world.translation,
                    normal: placement.normal_to_world(DVec3::Z),
                }),
                Profile::Conic { curvature, conic } => {
                    // z - c (r^2 + (1 + k) z^2) / 2
                    let square = DVec3::new(1.0, 1.0, 1.0 + conic) * (-0.5 * curvature);
                    Some(quadric(DMat3::from_diagonal(square), DVec3::Z * 0.5, 0.0))
                }
                _ => None,
            },
            Shape::Mesh(ref mesh) => {
                if facets.is_none() {
                    return Some(Self::Mesh(Smooth::new(mesh, id.instance, *placement)));
                }
                let [corner, ..] = mesh.corners(prim, 0.0);
                Some(Self::Plane {
                    origin: to_world.transform_point3(corner),
                    normal: placement.normal_to_world(mesh.geometric_normal(prim, 0.0)),
                })
            }
            Shape::Deforming(_) => None,
        }
    }
}

/// The face that a point of the surface lies on, which may be smaller than the surface: `id`,
/// another triangle of its facet, or `prim`, that it was found on; `None` beside it.
#[must_use]
pub fn face_at(
    instance: &Instance,
    facets: Option<&Facets>,
    id: SurfaceId,
    placement: &Placement,
    (p, prim): (DVec3, u32),
) -> Option<SurfaceId> {
    let q = placement.to_object.transform_point3(p);
    let is_on = match instance.shape {
        Shape::Sphere => true,
        Shape::Cylinder => q.z.abs() <= 1.0,
        Shape::Quad => q.truncate().abs().max_element() <= 1.0,
        Shape::Disk { inner } => (inner * inner..=1.0).contains(&q.truncate().length_squared()),
        Shape::Box => {
            let axis = (id.prim / 2) as usize % 3;
            let mut across = q.abs();
            across[axis] = 0.0;
            across.max_element() <= 1.0
        }
        Shape::Lens(ref lens) => {
            let LensSurface {
                profile, aperture, ..
            } = lens.surface();
            // the other sheet of a conic is none of the lens
            let off = (q.z - profile.sag(q.x, q.y)).abs();
            aperture.contains(q.x, q.y) && off <= ON_SHEET * aperture.extent()
        }
        Shape::Mesh(ref mesh) => {
            let prim = match facets {
                Some(facets) => facets.at(mesh, id.prim, q)?,
                None => prim,
            };
            return Some(SurfaceId { prim, ..id });
        }
        Shape::Deforming(_) => false,
    };
    is_on.then_some(id)
}
