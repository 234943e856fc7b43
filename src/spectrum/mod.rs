//! Wavelengths, spectra, refractive indices and colour.

pub mod cie;
pub mod coverage;
pub mod curve;
mod embedded;
pub mod emission;
pub mod illuminant;
mod integral;
pub mod ior;
pub mod library;
mod read;
pub mod sampled;
pub mod sensor_response;
pub mod upsample;
mod vendors;
pub mod wavelengths;
pub mod xyz;

pub use curve::Curve;
pub use emission::{Emission, Line};
pub use integral::integrate;
pub use ior::{Ior, IorError};
pub use library::{Library, LibraryError, SpectrumFileError};
pub use sampled::{MAX_LANES, SampledSpectrum};
pub use sensor_response::{LaneResponse, SensorResponse, SpectralChannels};
pub use wavelengths::{SampledWavelengths, WavelengthDistribution};
