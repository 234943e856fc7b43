//! Files in and out: scenes, meshes, images, part files. Every reader checks before it allocates
//! and never panics; every writer replaces a file at once or not at all. The only floor that names
//! file formats.

pub mod atomic;
pub mod convert;
pub mod destination;
pub mod exr;
mod exr_blocks;
mod exr_header;
pub(crate) mod files;
pub mod glass;
pub mod gltf;
pub mod identity;
pub mod image;
pub mod image_file;
pub mod jpeg;
pub mod layers;
pub mod lens;
pub mod loaded;
pub mod lock;
pub mod material_text;
pub mod model;
pub mod model_file;
pub mod mtl;
pub mod obj;
mod origin;
pub mod part;
pub mod ply;
pub mod png;
mod reasons;
pub mod scene_file;
