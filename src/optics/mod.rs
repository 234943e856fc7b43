//! Lens systems: surfaces, prescriptions, paraxial and real rays, aberrations, ghosts, coatings.
//!
//! Lengths are millimeters as in lens files, wavelengths nanometers, angles degrees in
//! prescriptions. Light enters along +z. The intersection of a ray with a surface ([`LensSurface`])
//! is in double precision, in the space of the surface, and knows nothing of prescriptions:
//! anything that meets a lens surface uses the same code.

pub mod analysis;
pub mod aperture;
pub mod coating;
pub mod exit_pupil;
pub mod ghosts;
mod interval;
pub mod paraxial;
pub mod polarization;
pub mod prescription;
pub mod profile;
pub mod seidel;
pub mod stacks;
pub mod surface;
pub mod trace;
mod validate;

pub use aperture::{Aperture, Outline};
pub use coating::{Layer, Stack};
pub use exit_pupil::ExitPupil;
pub use paraxial::FirstOrder;
pub use polarization::Polarization;
pub use prescription::{
    Break, FieldKind, Interaction, Medium, Prescription, Surface, SystemAperture, Wavelength,
};
pub use profile::Profile;
pub use surface::{Crossing, LensSurface};
pub use trace::{Event, Lost, Passage, Ray, System};
pub use validate::PrescriptionError;
