//! Scenes and rays as files for other programs: little-endian numbers without padding.
//!
//! A scene: the number of meshes; each with the numbers of its keys, vertices and triangles, the
//! vertices key by key and three vertices for each triangle; the number of placed meshes; each with
//! its mesh and a 3 x 4 matrix, column by column; the number of spheres; each with center and
//! radius. Rays: their number; each with origin, direction, least and largest parameter, and time.
//! Counts and indices are u32, all else is f32.

use super::scenes::Scene;
use super::sets::Set;
use std::io;
use std::path::Path;

/// Least parameter of rays that leave a surface, and distance from the end of those that reach one,
/// in units of the scene: other programs know no faces to leave out.
const CLEARANCE: f64 = 1e-4;

/// Writes a scene.
pub fn scene(path: &Path, scene: &Scene) -> io::Result<()> {
    let mut out = Numbers::default();
    out.count(scene.meshes.len());
    for mesh in &scene.meshes {
        out.count(mesh.keys.len());
        out.count(mesh.keys[0].len());
        out.count(mesh.indices.len());
        out.reals(mesh.keys.iter().flatten().flatten().copied());
        mesh.indices
            .iter()
            .flatten()
            .for_each(|&i| out.count(i as usize));
    }
    out.count(scene.placed.len());
    for (mesh, map) in &scene.placed {
        out.count(*mesh);
        out.reals(map.to_cols_array().map(|x| x as f32));
    }
    out.count(scene.spheres.len());
    for (center, radius) in &scene.spheres {
        out.reals(center.extend(*radius).to_array().map(|x| x as f32));
    }
    std::fs::write(path, out.0)
}

/// Writes the rays of a set.
pub fn rays(path: &Path, set: &Set) -> io::Result<()> {
    let mut out = Numbers::default();
    out.count(set.rays.len());
    for (ray, time) in set.rays.iter().zip(&set.times) {
        let clear = |is_surface: bool| if is_surface { CLEARANCE } else { 0.0 };
        let near = clear(ray.start.is_some());
        let far = ray.t_max - clear(ray.end.is_some());
        out.reals(ray.o.to_array().map(|x| x as f32));
        out.reals(ray.d.to_array().map(|x| x as f32));
        out.reals([near, far, *time].map(|x| x as f32));
    }
    std::fs::write(path, out.0)
}

#[derive(Default)]
struct Numbers(Vec<u8>);

impl Numbers {
    fn count(&mut self, count: usize) {
        self.0.extend((count as u32).to_le_bytes());
    }

    fn reals(&mut self, numbers: impl IntoIterator<Item = f32>) {
        for number in numbers {
            self.0.extend(number.to_le_bytes());
        }
    }
}
