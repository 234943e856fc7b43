//! The extension module of the Python package `abbe`: scenes, sessions, images, glasses and lenses
//! of the library as Python sees them. What is friendlier in Python is written there (`../abbe`).
//!
//! Invariant: the interpreter is never held while something is rendered, read or written.

mod attend;
mod glass;
mod image;
mod lens;
mod scene;
mod session;

use pyo3::prelude::*;

/// The extension module.
#[pymodule]
mod _abbe {
    #[pymodule_export]
    #[cfg(feature = "command")]
    use super::command;
    #[pymodule_export]
    use super::glass::{Glass, glass, glass_names};
    #[pymodule_export]
    use super::image::{Image, compare, write_bytes};
    #[pymodule_export]
    use super::lens::Lens;
    #[pymodule_export]
    use super::scene::{Scene, SceneError};
    #[pymodule_export]
    use super::session::Session;
    #[pymodule_export]
    use super::version;
}

/// The version of abbe.
#[pyfunction]
fn version() -> &'static str {
    abbe::io::identity::VERSION
}

/// Runs the command line with these arguments, the name of the program first, and returns its exit
/// code.
#[cfg(feature = "command")]
#[pyfunction]
fn command(py: Python, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| abbe::cli::run_with(arguments))
}
