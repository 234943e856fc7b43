//! abbe: a spectral bidirectional renderer for dispersive glass, lenses and correct color.
//!
//! A glass ball, rendered, read and written:
//!
//! ```
//! use abbe::io::{exr, image};
//! use abbe::material::Material;
//! use abbe::render::{Session, SessionOptions};
//! use abbe::scene::{SceneBuilder, Settings, builder::look_at};
//! use abbe::spectrum::Emission;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut scene = SceneBuilder::new();
//! let flint = scene.glass("schott:N-SF11")?;
//! let white = scene.material(Material::diffuse(0.7));
//! let clear = scene.material(Material::interface(0.0));
//! scene.quad("floor", [0.0; 3], [0.0, 0.0, 3.0], [3.0, 0.0, 0.0]).of(white);
//! scene.sphere("ball", [0.0, 0.6, 0.0], 0.6).of(clear).filled_with(flint);
//! scene.sphere("lamp", [1.0, 2.5, 0.5], 0.3).emits(Emission::from_rgb([10.0; 3]));
//! let view = look_at([0.0, 1.5, 4.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0]);
//! scene.pinhole("main", [48, 32], view, 40_f64.to_radians());
//!
//! let settings = Settings { spp: 4, ..Settings::default() };
//! let mut session = Session::new(scene.build()?, &settings, SessionOptions::default())?;
//! session.run();
//!
//! let render = session.render();
//! let y: Vec<f64> = render.xyz().iter().skip(1).step_by(3).copied().collect();
//! assert!(y.len() == 48 * 32 && y.iter().any(|&y| y > 0.0));
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! exr::write(&folder.join("ball.exr"), &image::of(&render))?;
//! # Ok(())
//! # }
//! ```
//!
//! - Scenes: [`scene::SceneBuilder`] makes them in Rust, [`io::scene_file`] reads them from TOML.
//! - Renders: a [`render::Session`] adds passes until it is time to stop; its films can be read at
//!   any time.
//! - Results: [`io::image`] makes images that say how they were made, [`io::exr`] writes them,
//!   [`io::part`] keeps exact sums to go on from or to add up.
//! - Glasses, metals and spectra: [`spectrum::library::Library`].
//!
//! Lengths are meters, angles radians, wavelengths nanometers. `tests/examples` holds more: a sweep
//! over glasses, the spectrum on a detector, a stop rule of one's own. The feature `cli` (on by
//! default) brings the command line; `default-features = false` leaves it out.
//!
//! The modules are listed from the ground floor up: a module uses only modules listed above it
//! (`tests/tidy.rs` checks this). `ARCHITECTURE.md` gives the bird's-eye view.

// links to private items serve who reads the source
#![allow(rustdoc::private_intra_doc_links)]

pub use glam;

pub mod math;

pub mod spectrum;

pub mod develop;
pub mod optics;

pub mod geometry;
pub mod texture;

pub mod bsdf;
pub mod camera;
pub mod film;
pub mod light;
pub mod material;
pub mod medium;
pub mod sampler;

pub mod scene;

pub mod transport;

pub mod integrator;

pub mod render;

pub mod io;

pub mod job;
pub mod report;

#[cfg(feature = "cli")]
pub mod cli;
