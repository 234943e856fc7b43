//! Files to values and back: the only floor that names formats.

pub mod atomic;
pub mod exr;
mod exr_header;
pub mod obj;
pub mod part;
pub mod png;
pub mod scene_file;
