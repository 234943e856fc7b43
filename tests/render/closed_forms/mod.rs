//! Renders against numbers known without rendering.
//!
//! Scenes of one wavelength whose paths all have weight 1 are free of noise: they are compared to
//! the rounding of a lane (f32). Elsewhere the tolerance is the standard error of the independent
//! batches (4.5 of them), and each test states how small that must be, so that a wrong formula
//! would be seen.

mod absorption;
mod coating;
mod emitter;
mod flux;
mod fresnel;
mod furnace;
mod imaging;
mod interface;
mod mirrors;
mod radiometry;
mod sources;
