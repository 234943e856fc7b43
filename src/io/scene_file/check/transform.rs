//! `transform` of objects.

use super::super::schema::{At, Scale, TransformStep};
use super::{Checker, FINITE};
use glam::{DAffine3, DMat3, DVec3};

impl Checker<'_> {
    /// The product of the steps, the first innermost.
    pub(super) fn transform(&mut self, steps: &[At<TransformStep>]) -> DAffine3 {
        let mut all = DAffine3::IDENTITY;
        for step in steps {
            let at = step.span();
            let mut finite = |values: &[f64]| {
                for v in values {
                    self.number_at("transform", *v, &at, FINITE);
                }
            };
            let map = match *step.get_ref() {
                TransformStep::Translate(t) => {
                    finite(&t);
                    DAffine3::from_translation(DVec3::from_array(t) * self.unit_m)
                }
                TransformStep::Rotate(r) => {
                    finite(&[r.deg]);
                    let axis = self.direction("axis", &At::new(at.clone(), r.axis));
                    DAffine3::from_axis_angle(axis, r.deg.to_radians())
                }
                TransformStep::EulerDeg(e) => {
                    finite(&e);
                    DAffine3::from_mat3(euler(DVec3::from_array(e)))
                }
                TransformStep::Scale(s) => {
                    let s = match s {
                        Scale::Uniform(s) => [s; 3],
                        Scale::PerAxis(s) => s,
                    };
                    finite(&s);
                    if s.contains(&0.0) {
                        self.conflict(&at, "scale is 0 (allowed: any other number)");
                    }
                    DAffine3::from_scale(DVec3::from_array(s))
                }
                TransformStep::Matrix(rows) => {
                    rows.iter().for_each(|r| finite(r));
                    affine(&rows, self.unit_m)
                }
            };
            all = map * all;
        }
        all
    }
}

/// The rotation about x, then y, then z, in degrees.
pub(super) fn euler(deg: DVec3) -> DMat3 {
    let [x, y, z] = deg.to_array().map(f64::to_radians);
    DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
}

/// The affine map of three matrix rows, its translation in metres.
pub(super) fn affine(rows: &[[f64; 4]; 3], unit_m: f64) -> DAffine3 {
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    DAffine3::from_mat3_translation(
        DMat3::from_cols(column(0), column(1), column(2)),
        column(3) * unit_m,
    )
}
