//! Facets: the flat faces of a mesh at rest, triangles of one plane taken together.

use super::Mesh;
use glam::{DVec2, DVec3};

/// Angle in radians between normals, and distance in units of the mesh, up to which triangles are
/// in one plane: what vertices of six digits leave.
const TURN: f64 = 2e-5;
const OFF: f64 = 1e-6;
/// Barycentric weights below 0 by as much are still on a triangle, so that no point of a facet is
/// lost between two.
const BETWEEN: f64 = 1e-9;
/// Most triangles of a mesh that is looked at.
const MOST_TRIANGLES: usize = 1 << 14;

/// The facets of a mesh.
#[derive(Clone, Debug)]
pub struct Facets {
    /// Facet of each triangle.
    of: Vec<u32>,
    /// Triangles of each facet, the largest first.
    triangles: Vec<Vec<u32>>,
}

/// Plane of a facet in object space.
struct Plane {
    origin: DVec3,
    normal: DVec3,
}

impl Facets {
    /// The facets of a mesh; `None` where it has more than `most`, where its normals are not those
    /// of its triangles, or it is large.
    #[must_use]
    pub fn of(mesh: &Mesh, most: usize) -> Option<Self> {
        let count = mesh.triangle_count();
        if count > MOST_TRIANGLES {
            return None;
        }
        let (low, high) = mesh.bounds();
        let off = OFF * low.distance(high);
        let area = |prim: u32| (mesh.area_of(prim, 0.0), prim);
        let mut by_area: Vec<(f64, u32)> = (0..count as u32).map(area).collect();
        by_area.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut planes: Vec<Plane> = Vec::new();
        let (mut of, mut triangles) = (vec![0; count], Vec::<Vec<u32>>::new());
        for (_, prim) in by_area {
            let corners = mesh.corners(prim, 0.0);
            let normal = mesh.geometric_normal(prim, 0.0);
            if !is_shaded_flat(mesh, prim, normal) {
                return None;
            }
            let is_in = |plane: &Plane| {
                let is_near = |p: DVec3| (p - plane.origin).dot(plane.normal).abs() <= off;
                (plane.normal - normal).length() <= TURN && corners.into_iter().all(is_near)
            };
            let facet = match planes.iter().position(is_in) {
                Some(facet) => facet,
                None if planes.len() == most => return None,
                None => {
                    let origin = corners[0];
                    planes.push(Plane { origin, normal });
                    triangles.push(Vec::new());
                    planes.len() - 1
                }
            };
            of[prim as usize] = facet as u32;
            triangles[facet].push(prim);
        }
        Some(Self { of, triangles })
    }

    /// All facets, each by its triangles, the largest first: it stands for the facet.
    pub fn all(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.triangles.iter().map(Vec::as_slice)
    }

    /// Triangles of the facet that a triangle is of.
    #[must_use]
    pub fn with(&self, prim: u32) -> &[u32] {
        &self.triangles[self.of[prim as usize] as usize]
    }

    /// The triangle which stands for the facet of a triangle.
    #[must_use]
    pub fn first(&self, prim: u32) -> u32 {
        self.with(prim)[0]
    }

    /// The triangle, of the facet of `prim`, that a point of its plane lies on.
    #[must_use]
    pub fn at(&self, mesh: &Mesh, prim: u32, p: DVec3) -> Option<u32> {
        let is_on = |&prim: &u32| {
            let [a, b, c] = mesh.corners(prim, 0.0);
            let (normal, area) = (
                mesh.geometric_normal(prim, 0.0),
                2.0 * mesh.area_of(prim, 0.0),
            );
            // barycentric weights times twice the area
            [[a, b], [b, c], [c, a]]
                .into_iter()
                .all(|[from, to]| (to - from).cross(p - from).dot(normal) >= -BETWEEN * area)
        };
        self.with(prim).iter().copied().find(is_on)
    }
}

/// Whether the normals at the corners of a triangle are its own.
fn is_shaded_flat(mesh: &Mesh, prim: u32, normal: DVec3) -> bool {
    [DVec2::ZERO, DVec2::X, DVec2::Y]
        .into_iter()
        .all(|weights| {
            let shading = mesh.local_point(prim, weights, 0.0).ns;
            shading.is_none_or(|ns| (ns.normalize() - normal).length() <= TURN)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};

    /// A closed prism over a regular polygon, its sides split, turned in space and rounded to six
    /// digits.
    fn prism(sides: u32) -> Mesh {
        let turn = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
        let corner = |i: u32, z: f64| {
            let angle = f64::from(i % sides) / f64::from(sides) * std::f64::consts::TAU;
            let p = turn * DVec3::new(angle.cos(), angle.sin(), z);
            (p * 1e6).round() / 1e6
        };
        let mut triangles: Vec<[DVec3; 3]> = Vec::new();
        for i in 0..sides {
            let [a, b] = [i, i + 1].map(|i| corner(i, -1.0));
            let [c, d] = [i, i + 1].map(|i| corner(i, 1.0));
            triangles.extend([[a, b, d], [a, d, c]]);
            if (2..sides).contains(&(i + 1)) && i > 0 {
                triangles.push([corner(0, 1.0), c, d]);
                triangles.push([corner(0, -1.0), b, a]);
            }
        }
        let corners = triangles.iter().flatten();
        let positions: Vec<[f32; 3]> = corners.map(|p| p.as_vec3().to_array()).collect();
        let indices: Vec<[u32; 3]> = (0..triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        Mesh::new(&positions, None, None, indices).expect("a mesh")
    }

    #[test]
    fn triangles_of_one_plane_are_one_facet() {
        for sides in [3, 4, 7, 24] {
            let mesh = prism(sides);
            let facets = Facets::of(&mesh, 26).expect("flat");
            assert_eq!(facets.all().len() as u32, sides + 2);
            let count: usize = facets.all().map(<[u32]>::len).sum();
            assert_eq!(count, mesh.triangle_count());
            assert!(Facets::of(&mesh, sides as usize + 1).is_none());
        }
    }

    #[test]
    fn points_of_a_facet_lie_on_one_of_its_triangles() {
        let mesh = prism(6);
        let facets = Facets::of(&mesh, 8).expect("flat");
        for prim in 0..mesh.triangle_count() as u32 {
            let first = facets.first(prim);
            for i in 0..50 {
                let [u, v] =
                    [0, 1].map(|k| unit_f64(random_bits(5, u64::from(100 * prim + 2 * i + k))));
                let at = if u + v < 1.0 {
                    DVec2::new(u, v)
                } else {
                    DVec2::new(1.0 - u, 1.0 - v)
                };
                let p = mesh.local_point(prim, at, 0.0).p;
                assert!(facets.at(&mesh, first, p).is_some());
            }
            // beyond the polygon in its plane
            let [a, b, c] = mesh.corners(prim, 0.0);
            let middle = (a + b + c) / 3.0;
            let beyond = middle + (a - middle).normalize() * 10.0;
            assert_eq!(facets.at(&mesh, first, beyond), None);
        }
    }
}
