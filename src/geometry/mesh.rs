//! Triangle meshes: vertices in f32, intersected watertight in f64.

use obvhs::cwbvh::CwBvh;

/// A triangle mesh with its tree.
#[derive(Debug)]
pub struct Mesh {
    // H2: positions [f32; 3], normals (optional), uvs (optional), triangles [u32; 3], the tree
    #[allow(dead_code)]
    tree: Option<CwBvh>,
}
