//! A checked scene file: numbers in SI units and in range, names of the file resolved, files found. What is left for
//! [`super::resolve`] is to look up library names and to build the renderer's own types.

use super::schema::{FilterName, OutputUnits};
use crate::geometry::{Link, Shutter};
use crate::io::model::Staging;
use crate::io::model_file::ModelKind;
use crate::medium::Boundary;
use crate::scene::description::WavelengthSettings;
use crate::scene::settings::Settings;
use crate::texture::{Filter, Wrap};
use glam::{DAffine2, DAffine3, DMat3, DVec3};
use std::ops::Range;
use std::path::PathBuf;

/// A place in the source.
pub type Span = Range<usize>;

/// A whole scene.
#[derive(Clone, Debug)]
pub struct Plan {
    /// \[0\] is the ambient medium.
    pub media: Vec<MediumPlan>,
    /// In the order of their names, then the black material of objects without one, if there are such.
    pub materials: Vec<MaterialPlan>,
    /// Files of meshes; objects refer to them by index, so that instances share a mesh.
    pub meshes: Vec<MeshPlan>,
    /// Files of other programs.
    pub models: Vec<ModelPlan>,
    /// Surfaces.
    pub objects: Vec<ObjectPlan>,
    /// Lights.
    pub lights: Vec<LightPlan>,
    /// Sensors.
    pub sensors: Vec<SensorPlan>,
    /// Wavelengths.
    pub wavelengths: WavelengthSettings,
    /// Render settings.
    pub settings: Settings,
    /// Scale of the output.
    pub units: OutputUnits,
}

/// What the values of a spectrum come from.
#[derive(Clone, Debug, PartialEq)]
pub enum SpectrumSource {
    /// The same at every wavelength.
    Constant(f64),
    /// Linear sRGB.
    Rgb([f64; 3]),
    /// A name of the library.
    Library(String),
    /// (nm, value), wavelengths ascending.
    Table(Vec<[f64; 2]>),
    /// Planck's law, kelvin.
    Blackbody(f64),
    /// (nm, power), wavelengths ascending.
    Lines(Vec<[f64; 2]>),
    /// An image over the surface.
    Texture(Box<TexturePlan>),
}

/// An image on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturePlan {
    /// The file, canonical.
    pub path: PathBuf,
    /// As written.
    pub name: String,
    /// Where it is named.
    pub at: Span,
    /// Whether its bytes are sRGB-encoded.
    pub srgb: bool,
    /// From the coordinates of the surface to those of the image.
    pub map: DAffine2,
    /// Beyond the borders.
    pub wrap: Wrap,
    /// Between texels.
    pub filter: Filter,
}

/// A number that may come from an image.
#[derive(Clone, Debug, PartialEq)]
pub enum ScalarPlan {
    /// The same everywhere.
    Constant(f64),
    /// A channel of an image times a factor.
    Image {
        texture: TexturePlan,
        channel: usize,
        factor: f64,
    },
}

/// A material.
#[derive(Clone, Debug, Default)]
pub struct MaterialPlan {
    /// (weight, lobe).
    pub lobes: Vec<(ScalarPlan, LobePlan)>,
    /// Normal map and its scale.
    pub normal: Option<(TexturePlan, f64)>,
    /// Coverage and from where on it is all.
    pub coverage: Option<(ScalarPlan, Option<f64>)>,
}

impl MaterialPlan {
    /// A place where it names a texture, if it does.
    pub fn texture_at(&self) -> Option<Span> {
        let of_scalar = |s: &ScalarPlan| match s {
            ScalarPlan::Image { texture, .. } => Some(texture.at.clone()),
            ScalarPlan::Constant(_) => None,
        };
        let of_spectrum = |s: &SpectrumPlan| match &s.source {
            SpectrumSource::Texture(texture) => Some(texture.at.clone()),
            _ => None,
        };
        let of_lobe = |lobe: &LobePlan| match lobe {
            LobePlan::Diffuse { reflectance } | LobePlan::Mirror { reflectance } => {
                of_spectrum(reflectance)
            }
            LobePlan::Coated {
                reflectance: s,
                alpha,
                ..
            }
            | LobePlan::Conductor { tint: s, alpha, .. }
            | LobePlan::ColoredMetal { color: s, alpha } => {
                of_spectrum(s).or_else(|| alpha.iter().find_map(of_scalar))
            }
            LobePlan::Dielectric {
                alpha,
                reflect_tint,
                transmit_tint,
            } => of_spectrum(reflect_tint)
                .or_else(|| of_spectrum(transmit_tint))
                .or_else(|| alpha.iter().find_map(of_scalar)),
            LobePlan::Thin { transmit_tint, .. } => of_spectrum(transmit_tint),
        };
        let lobes = self
            .lobes
            .iter()
            .find_map(|(w, l)| of_scalar(w).or_else(|| of_lobe(l)));
        let normal = self.normal.as_ref().map(|n| n.0.at.clone());
        let coverage = self.coverage.as_ref().and_then(|c| of_scalar(&c.0));
        lobes.or(normal).or(coverage)
    }
}

/// A file of another program.
#[derive(Clone, Debug)]
pub struct ModelPlan {
    /// The file, canonical.
    pub path: PathBuf,
    /// As written.
    pub name: String,
    /// Where it is named.
    pub at: Span,
    /// Its kind.
    pub kind: ModelKind,
    /// Where and when it is shown; over the shutters of its own cameras.
    pub staging: Staging,
    /// Columns and rows of its cameras.
    pub resolution: [u32; 2],
    /// Filter of its cameras and the filter's radius in pixels; `None`: the default.
    pub filter: (Option<FilterName>, Option<f64>),
    /// Whether its lights are taken.
    pub lights: bool,
}

/// A spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectrumPlan {
    /// The values.
    pub source: SpectrumSource,
    /// Factor on them.
    pub scale: f64,
    /// Scaled so that its Y is this (instead of `scale`).
    pub luminance: Option<f64>,
    /// Where it is used.
    pub at: Span,
}

impl SpectrumPlan {
    /// The same value everywhere.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self {
            source: SpectrumSource::Constant(value),
            scale: 1.0,
            luminance: None,
            at: 0..0,
        }
    }
}

/// A refractive index.
#[derive(Clone, Debug, PartialEq)]
pub enum IorPlan {
    /// The same at every wavelength.
    Constant {
        /// Real part.
        n: f64,
        /// Imaginary part.
        k: f64,
    },
    /// A name of the glass catalogue, as written.
    Glass {
        /// `schott:N-SF11`, `N-SF11`, `WATER`.
        name: String,
        /// Where it is written.
        at: Span,
    },
    /// A name of the metal library, as written.
    Metal {
        /// `Au`, `Ag`, ...
        name: String,
        /// Where it is written.
        at: Span,
    },
    /// n = Σ cᵢ λ^(-2i), λ in micrometres.
    Cauchy(Vec<f64>),
    /// n² = 1 + Σ Bλ²/(λ² - C), (B, C in µm²), λ in micrometres.
    Sellmeier(Vec<[f64; 2]>),
    /// (nm, n, k), wavelengths ascending.
    Table {
        /// The rows.
        rows: Vec<[f64; 3]>,
        /// Evaluated beyond the rows too.
        extrapolate: bool,
        /// Where it is named.
        at: Span,
    },
}

/// A medium.
#[derive(Clone, Debug)]
pub struct MediumPlan {
    /// Name.
    pub name: String,
    /// Index.
    pub ior: IorPlan,
    /// Absorption beyond the index's own.
    pub absorption: Option<AbsorptionPlan>,
    /// Whether k of the index absorbs.
    pub use_k: bool,
}

/// Absorption of a medium.
#[derive(Clone, Debug)]
pub enum AbsorptionPlan {
    /// Coefficient in 1/m.
    Coefficient(SpectrumPlan),
    /// The transmittance `color` after `distance_m`.
    Color {
        /// Transmittance in (0, 1].
        color: SpectrumPlan,
        /// Metres.
        distance_m: f64,
    },
}

/// One lobe.
#[derive(Clone, Debug)]
pub enum LobePlan {
    /// Lambertian.
    Diffuse { reflectance: SpectrumPlan },
    /// Perfect mirror.
    Mirror { reflectance: SpectrumPlan },
    /// Metal.
    Conductor {
        ior: IorPlan,
        alpha: [ScalarPlan; 2],
        tint: SpectrumPlan,
    },
    /// Metal known by its color.
    ColoredMetal {
        color: SpectrumPlan,
        alpha: [ScalarPlan; 2],
    },
    /// Diffuse base under a dielectric layer of an index.
    Coated {
        reflectance: SpectrumPlan,
        index: f64,
        alpha: [ScalarPlan; 2],
    },
    /// Interface between media.
    Dielectric {
        alpha: [ScalarPlan; 2],
        reflect_tint: SpectrumPlan,
        transmit_tint: SpectrumPlan,
    },
    /// Thin sheet.
    Thin {
        ior: IorPlan,
        transmit_tint: SpectrumPlan,
    },
}

/// A mesh: a file, or one per moment.
#[derive(Clone, Debug)]
pub struct MeshPlan {
    /// At ascending times, at least one.
    pub frames: Vec<FramePlan>,
}

/// A mesh file.
#[derive(Clone, Debug)]
pub struct FramePlan {
    /// Seconds.
    pub time_s: f64,
    /// The file, canonical.
    pub path: PathBuf,
    /// As written.
    pub name: String,
    /// Where it is named.
    pub at: Span,
    /// Its kind (OBJ or PLY).
    pub kind: ModelKind,
}

/// The canonical shape (see `geometry::Shape`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShapePlan {
    /// Unit sphere.
    Sphere,
    /// Unit disk with a hole.
    Disk { inner: f64 },
    /// Square of half-edge 1.
    Quad,
    /// Unit cylinder of height 2.
    Cylinder,
    /// Cube of half-edge 1.
    Box,
    /// Index into the meshes, in the file's unit (the transform scales to metres).
    Mesh(usize),
}

/// A surface.
#[derive(Clone, Debug)]
pub struct ObjectPlan {
    /// Name or position.
    pub name: String,
    /// Canonical shape.
    pub shape: ShapePlan,
    /// To the world, metres.
    pub to_world: DAffine3,
    /// What moves it in the world, the outermost first.
    pub motion: Vec<Link>,
    /// Index into the materials.
    pub material: u32,
    /// Media.
    pub boundary: Boundary,
    /// (radiance, two-sided).
    pub emission: Option<(SpectrumPlan, bool)>,
    /// Where `interior` is written: whether a mesh is closed is known once it is read.
    pub interior_at: Option<Span>,
}

/// A light; positions in metres, directions unit, the way light travels.
#[derive(Clone, Debug)]
pub struct LightPlan {
    /// Name or position.
    pub name: String,
    /// What moves it in the world, the outermost first.
    pub motion: Vec<Link>,
    /// Kind.
    pub kind: LightKind,
}

/// Kind of a light.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// W/(sr nm).
    Point {
        position: DVec3,
        intensity: SpectrumPlan,
    },
    /// W/(sr nm) within the inner half-angle (radians), 0 from the outer one on.
    Spot {
        position: DVec3,
        direction: DVec3,
        inner_rad: f64,
        outer_rad: f64,
        intensity: SpectrumPlan,
    },
    /// W/(m² nm) on a surface at right angles.
    Directional {
        direction: DVec3,
        irradiance: SpectrumPlan,
    },
    /// The same, inside a circle only.
    Beam {
        position: DVec3,
        direction: DVec3,
        radius_m: f64,
        irradiance: SpectrumPlan,
    },
    /// W/(m² sr nm).
    Environment {
        /// `None`: white of Y = 1.
        radiance: Option<SpectrumPlan>,
        image: Option<ImagePlan>,
    },
}

/// An image around the scene.
#[derive(Clone, Debug)]
pub struct ImagePlan {
    /// The file, canonical; `None`: the studio that is built in.
    pub path: Option<PathBuf>,
    /// As written.
    pub name: String,
    /// Where it is named.
    pub at: Span,
    /// From its own directions to the world.
    pub to_world: DMat3,
}

/// A sensor.
#[derive(Clone, Debug)]
pub struct SensorPlan {
    /// Name.
    pub name: String,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// Filter; `None`: the default of the kind of sensor.
    pub filter: Option<FilterName>,
    /// Radius in pixels; `None`: the filter's own.
    pub filter_radius: Option<f64>,
    /// When it measures.
    pub shutter: Shutter,
    /// What moves it in the world, the outermost first.
    pub motion: Vec<Link>,
    /// Kind.
    pub kind: SensorKind,
}

/// Kind of a sensor. A camera's own space: looks along -z, +x to the right, +y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorKind {
    /// Pinhole (aperture radius 0) or thin lens.
    Perspective {
        to_world: DAffine3,
        fov_rad: f64,
        aperture_radius_m: f64,
        focus_distance_m: f64,
    },
    /// Parallel projection, full height in metres.
    Orthographic { to_world: DAffine3, height_m: f64 },
    /// Receiving rectangle with half edges `u` (right) and `v` (up); accepts on the side of u × v.
    Detector {
        center: DVec3,
        u: DVec3,
        v: DVec3,
        transparent: bool,
    },
}
