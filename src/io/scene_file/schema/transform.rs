//! `transform` of objects.

use serde::Deserialize;

/// One step of a transform; steps apply in the order of the list.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransformStep {
    Translate([f64; 3]),
    Rotate(Rotation),
    /// About x, then y, then z.
    EulerDeg([f64; 3]),
    Scale(Scale),
    /// Rows of a 3×4 affine matrix.
    Matrix([[f64; 4]; 3]),
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    pub axis: [f64; 3],
    pub deg: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number or [x, y, z]")]
pub enum Scale {
    Uniform(f64),
    PerAxis([f64; 3]),
}
