//! Sensors.

use super::super::plan::{SensorKind, SensorPlan, Span};
use super::super::schema::{At, Detector, Orthographic, Perspective, Render, Sensor};
use super::motion::May;
use super::transform::affine;
use super::{Allowed, Checker, NON_NEGATIVE, POSITIVE, label};
use crate::io::model::MAX_PIXELS;
use glam::{DAffine3, DMat3, DVec3};

const FIELD_OF_VIEW: Allowed = Allowed {
    text: "above 0, below 180 degrees",
    test: |v| v > 0.0 && v < 180.0,
};
pub(super) const FILTER_RADIUS: Allowed = Allowed {
    text: "0.5 to 8 pixels",
    test: |v| (0.5..=8.0).contains(&v),
};
/// Largest edge of an image in pixels.
const MAX_EDGE: i64 = 65_536;
/// Where a sensor says nothing.
pub(super) const DEFAULT_RESOLUTION: [u32; 2] = [640, 480];

impl Checker<'_> {
    pub(super) fn sensors(&mut self, sensors: &[At<Sensor>], render: &Render) -> Vec<SensorPlan> {
        if sensors.is_empty() {
            self.conflict(
                &(0..0),
                "the scene has no sensor (allowed: at least one [[sensor]])",
            );
        }
        let mut plans: Vec<SensorPlan> = Vec::new();
        for (i, sensor) in sensors.iter().enumerate() {
            let s = sensor.get_ref();
            let name = label(s.name.as_ref(), "sensor", i).replace(' ', "-");
            let name_at = s.name.as_ref().map_or(sensor.span(), At::span);
            if plans.iter().any(|p| p.name == name) {
                self.conflict(&name_at, format!("sensor \"{name}\" is defined twice"));
            }
            let in_file_name = |c: char| c.is_alphanumeric() || "-_.".contains(c);
            if name.is_empty()
                || name.len() > 64
                || !name.chars().all(in_file_name)
                || name.starts_with('.')
            {
                let message = format!(
                    "name \"{name}\" cannot be part of a file name (allowed: letters, digits, - _ .)"
                );
                self.conflict(&name_at, message);
            }
            let filter = s.filter.or(render.filter);
            let radius = s.filter_radius.as_ref().or(render.filter_radius.as_ref());
            let filter_radius = radius.map(|r| self.number("filter_radius", r, FILTER_RADIUS));
            let Some((kind, own_resolution)) = self.sensor_kind(s, &sensor.span()) else {
                continue;
            };
            let given = s.resolution.as_ref().map(|r| self.resolution(r));
            if let (Some(r), Some(_)) = (&s.resolution, own_resolution) {
                self.conflict(&r.span(), "resolution and pitch exclude each other");
            }
            let resolution = given.or(own_resolution).unwrap_or(DEFAULT_RESOLUTION);
            let shutter = self.shutter(s.shutter.as_ref());
            let motion = self.motion(&s.motion, May::KeepSize);
            plans.push(SensorPlan {
                name,
                resolution,
                filter,
                filter_radius,
                shutter,
                motion,
                kind,
            });
        }
        plans
    }

    pub(super) fn resolution(&mut self, resolution: &At<[i64; 2]>) -> [u32; 2] {
        let edge = |c: &mut Self, v: i64| {
            c.integer(
                "resolution",
                &At::new(resolution.span(), v),
                1,
                MAX_EDGE,
                "1 to 65536",
            ) as u32
        };
        let [w, h] = resolution.get_ref().map(|v| edge(self, v));
        self.pixels(w, h, &resolution.span());
        [w, h]
    }

    fn pixels(&mut self, width: u32, height: u32, at: &Span) {
        let pixels = u64::from(width) * u64::from(height);
        if pixels > MAX_PIXELS {
            self.conflict(
                at,
                format!("{width} x {height} are {pixels} pixels (allowed: at most {MAX_PIXELS})"),
            );
        }
    }

    /// The kind, and its resolution where it follows from a pixel pitch.
    fn sensor_kind(&mut self, s: &Sensor, at: &Span) -> Option<(SensorKind, Option<[u32; 2]>)> {
        let choices = [
            ("perspective", s.perspective.is_some()),
            ("orthographic", s.orthographic.is_some()),
            ("detector", s.detector.is_some()),
        ];
        self.exactly_one(at, "sensor", &choices)?;
        if let Some(p) = &s.perspective {
            return Some((self.perspective(p), None));
        }
        if let Some(o) = &s.orthographic {
            let Orthographic {
                eye,
                target,
                up,
                matrix,
                height,
            } = o.get_ref();
            let to_world = self.view(
                &o.span(),
                eye.as_ref(),
                target.as_ref(),
                up.as_ref(),
                matrix.as_ref(),
            );
            return Some((
                SensorKind::Orthographic {
                    to_world,
                    height_m: self.length("height", height, POSITIVE),
                },
                None,
            ));
        }
        s.detector.as_ref().and_then(|d| self.detector(d))
    }

    fn perspective(&mut self, perspective: &At<Perspective>) -> SensorKind {
        let p = perspective.get_ref();
        let at = perspective.span();
        let to_world = self.view(
            &at,
            p.eye.as_ref(),
            p.target.as_ref(),
            p.up.as_ref(),
            p.matrix.as_ref(),
        );
        let fov_rad = self
            .number("fov_deg", &p.fov_deg, FIELD_OF_VIEW)
            .to_radians();
        let aperture_radius_m = match (&p.aperture_radius, &p.f_number, &p.focal_length) {
            (None, None, None) => 0.0,
            (Some(radius), None, None) => self.length("aperture_radius", radius, NON_NEGATIVE),
            (None, Some(number), Some(focal)) => {
                let number = self.number("f_number", number, POSITIVE);
                self.length("focal_length", focal, POSITIVE) / (2.0 * number)
            }
            _ => {
                self.conflict(
                    &at,
                    "the aperture is either aperture_radius, or f_number with focal_length",
                );
                0.0
            }
        };
        let focus_distance_m = p
            .focus_distance
            .as_ref()
            .map(|d| self.length("focus_distance", d, POSITIVE));
        if aperture_radius_m > 0.0 && focus_distance_m.is_none() {
            self.conflict(&at, "a camera with an aperture needs focus_distance");
        }
        SensorKind::Perspective {
            to_world,
            fov_rad,
            aperture_radius_m,
            focus_distance_m: focus_distance_m.unwrap_or(1.0),
        }
    }

    /// Camera space to world: x to the right, y up, looking along -z.
    fn view(
        &mut self,
        at: &Span,
        eye: Option<&At<[f64; 3]>>,
        target: Option<&At<[f64; 3]>>,
        up: Option<&At<[f64; 3]>>,
        matrix: Option<&At<[[f64; 4]; 3]>>,
    ) -> DAffine3 {
        let (eye, target) = match (eye, target, matrix) {
            (Some(eye), Some(target), None) => (eye, target),
            (None, None, Some(matrix)) if up.is_none() => return self.rigid(matrix),
            _ => {
                self.conflict(at, "the view is either eye and target (and up), or matrix");
                return DAffine3::IDENTITY;
            }
        };
        let up_vector = up.map_or(DVec3::Y, |u| self.direction("up", u));
        let position = self.point("eye", eye);
        let Some(forward) = (self.point("target", target) - position).try_normalize() else {
            self.conflict(&target.span(), "target is the same point as eye");
            return DAffine3::IDENTITY;
        };
        let across = forward.cross(up_vector);
        if across.length() < 1e-9 {
            self.conflict(
                &up.map_or(at.clone(), At::span),
                "up is parallel to the view (allowed: any other direction)",
            );
            return DAffine3::IDENTITY;
        }
        let right = across.normalize();
        DAffine3::from_mat3_translation(
            DMat3::from_cols(right, right.cross(forward), -forward),
            position,
        )
    }

    fn rigid(&mut self, matrix: &At<[[f64; 4]; 3]>) -> DAffine3 {
        let map = affine(matrix.get_ref(), self.unit_m);
        let gram = map.matrix3.transpose() * map.matrix3;
        let off = (gram - DMat3::IDENTITY)
            .to_cols_array()
            .iter()
            .fold(
                0.0,
                |a: f64, v| if v.is_nan() { 1.0 } else { a.max(v.abs()) },
            );
        if off > 1e-6 || !map.translation.is_finite() || map.matrix3.determinant() < 0.0 {
            self.conflict(
                &matrix.span(),
                "matrix is not a rotation with a translation (rows of a 3x4 matrix)",
            );
            return DAffine3::IDENTITY;
        }
        map
    }

    fn detector(&mut self, detector: &At<Detector>) -> Option<(SensorKind, Option<[u32; 2]>)> {
        let d = detector.get_ref();
        let at = detector.span();
        let center = self.point("center", &d.center);
        let (u, v) = match (&d.u, &d.v, &d.normal, &d.width, &d.height) {
            (Some(u), Some(v), None, None, None) if d.up.is_none() => {
                (self.point("u", u), self.point("v", v))
            }
            (None, None, Some(normal), Some(width), Some(height)) => {
                let n = self.direction("normal", normal);
                let up = d.up.as_ref().map_or(DVec3::Y, |u| self.direction("up", u));
                let Some(right) = up
                    .cross(n)
                    .try_normalize()
                    .filter(|_| up.cross(n).length() > 1e-9)
                else {
                    self.conflict(
                        &d.up.as_ref().map_or(normal.span(), At::span),
                        "up is parallel to the normal",
                    );
                    return None;
                };
                let half = |c: &mut Self, what, l: &At<f64>| c.length(what, l, POSITIVE) / 2.0;
                (
                    right * half(self, "width", width),
                    n.cross(right) * half(self, "height", height),
                )
            }
            _ => {
                self.conflict(&at, "a detector needs center with either u and v, or normal, width and height (and up)");
                return None;
            }
        };
        if u.dot(v).abs() > 1e-9 * u.length() * v.length() || u.cross(v).length() <= 0.0 {
            self.conflict(&at, "u and v of the detector are not at right angles");
        }
        let resolution = d.pitch.as_ref().map(|pitch| {
            let size = self.length("pitch", pitch, POSITIVE);
            let count = |half: DVec3| {
                (2.0 * half.length() / size)
                    .round()
                    .clamp(1.0, MAX_EDGE as f64) as u32
            };
            let (w, h) = (count(u), count(v));
            let off = |half: DVec3, n: u32| {
                (2.0 * half.length() - f64::from(n) * size).abs() > 1e-6 * size * f64::from(n)
            };
            if off(u, w) || off(v, h) {
                self.conflict(
                    &pitch.span(),
                    "width and height are not whole multiples of pitch (at most 65536)",
                );
            }
            self.pixels(w, h, &pitch.span());
            [w, h]
        });
        Some((
            SensorKind::Detector {
                center,
                u,
                v,
                transparent: d.transparent,
            },
            resolution,
        ))
    }
}
