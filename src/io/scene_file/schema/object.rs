//! `[mesh.NAME]`, `[[object]]` and `[[light]]`.

use super::motion::Motion;
use super::spectrum::Spectrum;
use super::transform::TransformStep;
use super::{At, NameOr};
use serde::Deserialize;

/// A mesh that several objects use: a file, or one per moment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    pub obj: Option<At<String>>,
    pub ply: Option<At<String>>,
    pub frames: Option<At<Vec<At<MeshFrame>>>>,
}

/// A file of another program with all it holds: exactly one of the first three keys.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    pub gltf: Option<At<String>>,
    pub obj: Option<At<String>>,
    pub ply: Option<At<String>>,
    #[serde(default)]
    pub transform: Vec<At<TransformStep>>,
    pub at: Option<At<f64>>,
    pub animation: Option<At<String>>,
    pub resolution: Option<At<[i64; 2]>>,
    pub shutter: Option<At<[f64; 2]>>,
    pub lights: Option<bool>,
}

/// The form of a mesh at one moment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshFrame {
    pub time: At<f64>,
    pub obj: At<String>,
}

/// The name of a `[mesh.NAME]`, or its keys.
pub type MeshSource = NameOr<Mesh>;

/// A surface: exactly one shape.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    pub name: Option<At<String>>,
    pub sphere: Option<At<Sphere>>,
    pub disk: Option<At<Disk>>,
    pub quad: Option<At<Quad>>,
    pub cylinder: Option<At<Cylinder>>,
    #[serde(rename = "box")]
    pub box_: Option<At<Box>>,
    pub mesh: Option<At<MeshSource>>,
    #[serde(default)]
    pub transform: Vec<At<TransformStep>>,
    #[serde(default)]
    pub motion: Vec<At<Motion>>,
    pub material: Option<At<String>>,
    pub interior: Option<At<String>>,
    pub priority: Option<At<i32>>,
    pub interface: Option<At<InterfaceMedia>>,
    pub emission: Option<At<Spectrum>>,
    pub two_sided: Option<At<bool>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    pub center: Option<At<[f64; 3]>>,
    pub radius: At<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disk {
    pub center: Option<At<[f64; 3]>>,
    pub normal: Option<At<[f64; 3]>>,
    pub radius: At<f64>,
    pub inner_radius: Option<At<f64>>,
}

/// Half edges `u` and `v` about `center`; the normal is u × v.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quad {
    pub center: At<[f64; 3]>,
    pub u: At<[f64; 3]>,
    pub v: At<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    pub from: At<[f64; 3]>,
    pub to: At<[f64; 3]>,
    pub radius: At<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Box {
    pub min: At<[f64; 3]>,
    pub max: At<[f64; 3]>,
}

/// Media on both sides of a surface that is not closed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterfaceMedia {
    pub above: Option<At<String>>,
    pub below: Option<At<String>>,
}

/// A light: exactly one kind.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    pub name: Option<At<String>>,
    pub point: Option<At<Point>>,
    pub spot: Option<At<Spot>>,
    pub directional: Option<At<Directional>>,
    pub beam: Option<At<Beam>>,
    pub environment: Option<At<Environment>>,
    #[serde(default)]
    pub motion: Vec<At<Motion>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    pub position: At<[f64; 3]>,
    pub intensity: At<Spectrum>,
}

/// Half-angles; between `inner_deg` and `outer_deg` the intensity falls to 0.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    pub position: At<[f64; 3]>,
    pub direction: At<[f64; 3]>,
    pub outer_deg: At<f64>,
    pub inner_deg: Option<At<f64>>,
    pub intensity: At<Spectrum>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Directional {
    pub direction: At<[f64; 3]>,
    pub irradiance: At<Spectrum>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    pub position: At<[f64; 3]>,
    pub direction: At<[f64; 3]>,
    pub radius: At<f64>,
    pub irradiance: At<Spectrum>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    pub radiance: Option<At<Spectrum>>,
    pub image: Option<At<String>>,
    pub euler_deg: Option<At<[f64; 3]>>,
}
