//! Files to values and back: the only floor that names formats.

pub mod obj;
pub mod scene_file;
