//! `[[sensor]]`.

use super::At;
use super::motion::Motion;
use super::render::FilterName;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    pub name: Option<At<String>>,
    pub resolution: Option<At<[i64; 2]>>,
    pub filter: Option<FilterName>,
    pub filter_radius: Option<At<f64>>,
    pub shutter: Option<At<[f64; 2]>>,
    #[serde(default)]
    pub motion: Vec<At<Motion>>,
    pub perspective: Option<At<Perspective>>,
    pub orthographic: Option<At<Orthographic>>,
    pub detector: Option<At<Detector>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Perspective {
    pub eye: Option<At<[f64; 3]>>,
    pub target: Option<At<[f64; 3]>>,
    pub up: Option<At<[f64; 3]>>,
    pub matrix: Option<At<[[f64; 4]; 3]>>,
    pub fov_deg: At<f64>,
    pub aperture_radius: Option<At<f64>>,
    pub f_number: Option<At<f64>>,
    pub focal_length: Option<At<f64>>,
    pub focus_distance: Option<At<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Orthographic {
    pub eye: Option<At<[f64; 3]>>,
    pub target: Option<At<[f64; 3]>>,
    pub up: Option<At<[f64; 3]>>,
    pub matrix: Option<At<[[f64; 4]; 3]>>,
    pub height: At<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detector {
    pub center: At<[f64; 3]>,
    pub u: Option<At<[f64; 3]>>,
    pub v: Option<At<[f64; 3]>>,
    pub normal: Option<At<[f64; 3]>>,
    pub up: Option<At<[f64; 3]>>,
    pub width: Option<At<f64>>,
    pub height: Option<At<f64>>,
    pub pitch: Option<At<f64>>,
    #[serde(default)]
    pub transparent: bool,
}
