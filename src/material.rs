//! Materials: parameters over a surface, turned into a [`Bsdf`] at a point and at the wavelengths of a path.

use crate::bsdf::{Bsdf, Interface};
use crate::geometry::SurfacePoint;
use crate::spectrum::{Curve, Ior, SampledWavelengths};

/// Index of a material in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// One lobe's parameters.
#[derive(Clone, Debug)]
pub enum LobeSpec {
    /// Lambertian, both sides.
    Diffuse {
        /// Reflectance in [0, 1].
        reflectance: Curve,
    },
    /// Perfect mirror, both sides.
    Mirror {
        /// Reflectance in [0, 1].
        reflectance: Curve,
    },
    /// Metal. `alpha` (GGX, x and y) of 0 is a smooth metal (a specular lobe).
    Conductor {
        /// Complex index.
        ior: Ior,
        /// GGX roughness along the two tangents, 0..1.
        alpha: [f64; 2],
        /// Factor on the reflectance.
        tint: Curve,
    },
    /// Interface between the two media of the surface. `alpha` of 0 is smooth; below 1e-3 it is built as smooth.
    Dielectric {
        /// GGX roughness along the two tangents, 0..1.
        alpha: [f64; 2],
        /// Factor on reflection.
        reflect_tint: Curve,
        /// Factor on transmission.
        transmit_tint: Curve,
    },
    /// Thin glass sheet (window, soap bubble wall) of index `ior` against the medium around it: incoherent sum of inner
    /// reflections, straight transmission, no change of medium.
    Thin {
        /// Index of the sheet.
        ior: Ior,
        /// Factor on transmission.
        transmit_tint: Curve,
    },
}

/// A mixture of weighted lobes (at most 4; no lobe: black).
#[derive(Clone, Debug, Default)]
pub struct Material {
    /// (weight in 0..1, lobe); the weights' sum is at most 1.
    pub lobes: Vec<(f64, LobeSpec)>,
}

#[allow(unused_variables)]
impl Material {
    /// The bsdf at a point.
    #[must_use]
    pub fn bsdf(&self, point: &SurfacePoint, wavelengths: &SampledWavelengths, interface: &Interface) -> Bsdf {
        todo!()
    }

    /// Whether light crosses the surface without any vertex when the media on both sides are the same: a pure dielectric
    /// interface of full weight.
    #[must_use]
    pub fn is_clear_interface(&self) -> bool {
        todo!()
    }

    /// Whether any lobe is specular (smooth).
    #[must_use]
    pub fn has_specular(&self) -> bool {
        todo!()
    }

    /// Whether any lobe needs a medium on each side (dielectric).
    #[must_use]
    pub fn needs_interior(&self) -> bool {
        todo!()
    }
}
