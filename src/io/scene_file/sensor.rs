//! `[[sensor]]`: cameras and detectors.

use super::aim::{AimKeys, Disk};
use super::document::Node;
use super::film::{Film, FilmKeys};
use super::keys::{
    Build, Built, FINITE, Form, Given, Keys, NON_NEGATIVE, POSITIVE, Range, Spec, Table, Value,
    first_given, keys,
};
use super::motion::Motion;
use super::reader::Reader;
use super::transform::Matrix;
use super::value::{At, Direction, Length, MediumName, Name, Point, items, number};
use crate::camera::curved::Curved;
use crate::camera::detector::{Aim, Toward};
use crate::camera::far_field::FarField;
use crate::camera::perspective::ThinLens;
use crate::camera::{Camera, Resolution};
use crate::geometry::{Link, Shutter, Transform};
use crate::io::model::MAX_PIXELS;
use crate::scene::description::SensorDescription;
use crate::scene::settings::FilterKind;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::collections::BTreeSet;
use std::ops::Range as Span;

const FIELD_OF_VIEW: Range = Range {
    below_high: true,
    ..Range::above(0.0, 180.0, "above 0, below 180 degrees")
};
const ACCEPTANCE: Range = Range {
    below_high: true,
    ..Range::above(0.0, 90.0, "above 0, below 90 degrees")
};
const FAR_FIELD: Range = Range {
    below_high: true,
    ..Range::above(0.0, 180.0, "above 0, below 180 degrees")
};
/// Range of the radius of a filter.
pub const FILTER_RADIUS: Range = Range::closed(0.5, 8.0, "0.5 to 8 pixels");
/// Largest edge of an image in pixels.
const MAX_EDGE: f64 = 65_536.0;
/// Range of the edges of an image.
pub const EDGE: Range = Range::closed(1.0, MAX_EDGE, "1 to 65536");
/// Where a sensor says nothing.
pub const DEFAULT_RESOLUTION: Size = Size {
    width: 640,
    height: 480,
};

/// Columns and rows of an image.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Size {
    fn checked(self, at: &Span<usize>, cx: &mut Reader<'_>) -> Self {
        let Self { width, height } = self;
        let pixels = u64::from(width) * u64::from(height);
        if pixels > MAX_PIXELS {
            let message =
                format!("{width} x {height} are {pixels} pixels (allowed: at most {MAX_PIXELS})");
            cx.conflict(at, message);
        }
        self
    }

    /// As cameras take it.
    pub fn resolution(self) -> Resolution {
        let Self { width, height } = self;
        Resolution { width, height }
    }
}

impl Value for Size {
    fn form() -> Form {
        <[i64; 2]>::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spec = Spec {
            range: Some(EDGE),
            ..spec
        };
        let [width, height] = <[i64; 2]>::read(node, spec, cx)?.map(|edge| edge as u32);
        Some(Self { width, height }.checked(&node.span(), cx))
    }

    fn show(&self) -> String {
        format!("[{}, {}]", self.width, self.height)
    }
}

/// A camera that waits for its resolution, which it may know itself.
type Unsized = (Box<dyn FnOnce(Resolution) -> Camera>, Option<Size>);

keys! {
    /// A pinhole, or a thin lens where it has an aperture: `aperture_radius`, or `f_number` with
    /// `focal_length`. The view is either `eye` and `target` (and `up`), or `matrix`.
    PerspectiveKeys = "perspective" {
        /// Position of the camera.
        eye: Option<Point>;
        /// A point that it looks at, other than `eye`.
        target: Option<Point>;
        /// Up in the picture, not along the view.
        up: Option<Direction>, or "[0, 1, 0]";
        /// Rows of a 3x4 matrix, a rotation with a translation, instead: the camera looks along its
        /// -z, +y is up.
        matrix: Option<Matrix>;
        /// Full vertical field of view.
        fov_deg: f64, in FIELD_OF_VIEW, unit "degrees";
        /// Radius of the aperture.
        aperture_radius: Option<Length>, in NON_NEGATIVE, or "0, a pinhole";
        /// Focal length by diameter of the aperture.
        f_number: Option<f64>, in POSITIVE;
        /// With `f_number`.
        focal_length: Option<Length>, in POSITIVE;
        /// Distance at which things are sharp; needed with an aperture.
        focus_distance: Option<Length>, in POSITIVE;
    }
}

impl Build for PerspectiveKeys {
    type Output = Unsized;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unsized> {
        let to_world = View {
            eye: self.eye,
            target: self.target,
            up: self.up,
            matrix: self.matrix,
        }
        .to_world(table, cx);
        let radius_m = match (self.aperture_radius, self.f_number, self.focal_length) {
            (None, None, None) => 0.0,
            (Some(radius), None, None) => radius.0,
            (None, Some(number), Some(focal)) => focal.0 / (2.0 * number),
            _ => {
                let message =
                    "the aperture is either aperture_radius, or f_number with focal_length";
                cx.conflict(&table.at, message);
                0.0
            }
        };
        if radius_m > 0.0 && self.focus_distance.is_none() {
            let message = "a camera with an aperture needs focus_distance";
            cx.conflict(&table.at, message);
        }
        table.sound(cx)?;
        let lens = self
            .focus_distance
            .filter(|_| radius_m > 0.0)
            .map(|distance| ThinLens {
                radius_m,
                focus_distance_m: distance.0,
            });
        let (transform, fov_rad) = (Transform::fixed(to_world?), self.fov_deg.to_radians());
        let camera = move |resolution| Camera::perspective(transform, resolution, fov_rad, lens);
        Some((Box::new(camera), None))
    }
}

keys! {
    /// A parallel projection. The view is either `eye` and `target` (and `up`), or `matrix`.
    OrthographicKeys = "orthographic" {
        /// Position of the camera.
        eye: Option<Point>;
        /// A point that it looks at, other than `eye`.
        target: Option<Point>;
        /// Up in the picture, not along the view.
        up: Option<Direction>, or "[0, 1, 0]";
        /// As of `perspective`.
        matrix: Option<Matrix>;
        /// Full height of the picture.
        height: Length, in POSITIVE;
    }
}

impl Build for OrthographicKeys {
    type Output = Unsized;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unsized> {
        let to_world = View {
            eye: self.eye,
            target: self.target,
            up: self.up,
            matrix: self.matrix,
        }
        .to_world(table, cx)?;
        table.sound(cx)?;
        let (transform, height_m) = (Transform::fixed(to_world), self.height.0);
        let camera = move |resolution: Resolution| {
            let (width, height) = (f64::from(resolution.width), f64::from(resolution.height));
            let width_m = height_m * width / height;
            Camera::orthographic(transform, resolution, width_m)
        };
        Some((Box::new(camera), None))
    }
}

/// Where a camera is and looks.
struct View {
    eye: Option<Point>,
    target: Option<Point>,
    up: Option<Direction>,
    matrix: Option<Matrix>,
}

impl View {
    /// Camera space to world: x to the right, y up, looking along -z.
    fn to_world(&self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<DAffine3> {
        let (eye, target) = match (self.eye, self.target, self.matrix) {
            (Some(eye), Some(target), None) => (eye.0, target.0),
            (None, None, Some(matrix)) if self.up.is_none() => {
                return rigid(matrix.0, &table.span("matrix"), cx);
            }
            _ => {
                let message = "the view is either eye and target (and up), or matrix";
                cx.conflict(&table.at, message);
                return None;
            }
        };
        let up = self.up.map_or(DVec3::Y, |up| up.0);
        let Some(forward) = (target - eye).try_normalize() else {
            cx.conflict(&table.span("target"), "target is the same point as eye");
            return None;
        };
        let across = forward.cross(up);
        if across.length() < 1e-9 {
            let message = "up is parallel to the view (allowed: any other direction)";
            cx.conflict(&table.span("up"), message);
            return None;
        }
        let right = across.normalize();
        let axes = DMat3::from_cols(right, right.cross(forward), -forward);
        Some(DAffine3::from_mat3_translation(axes, eye))
    }
}

/// A rotation with a translation.
fn rigid(map: DAffine3, at: &Span<usize>, cx: &mut Reader<'_>) -> Option<DAffine3> {
    let gram = map.matrix3.transpose() * map.matrix3;
    let off = (gram - DMat3::IDENTITY).to_cols_array();
    let off = off.map(|v| if v.is_nan() { 1.0 } else { v.abs() });
    let is_turn = off.into_iter().all(|v| v <= 1e-6) && map.matrix3.determinant() >= 0.0;
    if !is_turn || !map.translation.is_finite() {
        let message = "matrix is not a rotation with a translation (rows of a 3x4 matrix)";
        cx.conflict(at, message);
        return None;
    }
    Some(map)
}

/// Radii along u and v in meters: one for both, or two.
#[derive(Clone, Copy, Debug)]
pub struct Radii([f64; 2]);

impl Value for Radii {
    fn form() -> Form {
        Form::Any(vec![Length::form(), <[Length; 2]>::form()])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        if node.get_ref().is_array() {
            return <[Length; 2]>::read(node, spec, cx).map(|r| Self(r.map(|r| r.0)));
        }
        number(node, spec, "a number or [along u, along v]", cx).map(|r| Self([r * cx.unit_m; 2]))
    }
}

keys! {
    /// A rectangle that measures irradiance, on the side of u x v (of `normal`). Columns run along
    /// u, row 0 is at +v. Either `u` and `v`, or `normal`, `width` and `height` (and `up`).
    DetectorKeys = "detector" {
        /// Center of the plane.
        center: Point;
        /// Half an edge, to the right.
        u: Option<Point>;
        /// Half an edge, up, at right angles to `u`.
        v: Option<Point>;
        /// The side that measures.
        normal: Option<Direction>;
        /// With `normal`: up in the picture, not along the normal.
        up: Option<Direction>, or "[0, 1, 0]";
        /// With `normal`: width.
        width: Option<Length>, in POSITIVE;
        /// With `normal`: height.
        height: Option<Length>, in POSITIVE;
        /// Size of a pixel, instead of `resolution`; divides width and height.
        pitch: Option<Length>, in POSITIVE;
        /// Whether light goes on behind it.
        transparent: bool, default false;
        /// Half angle of the cone about the normal from which it takes light.
        acceptance_deg: Option<f64>, in ACCEPTANCE, unit "degrees", or "90, all of its side";
        /// Measures intensity by direction instead, W/(sr nm) or cd, of light that arrives anywhere
        /// on the rectangle: [width, height] of the picture in angles about the normal, equal
        /// lengths for equal angles from its middle. Light that travels toward u is at the right.
        far_field_deg: Option<[f64; 2]>, in FAR_FIELD, unit "degrees";
        /// Radius of a spherical detector, or [along u, along v] of a cylinder or toroid, positive
        /// where the center is on the side that measures (a retina), 0 where it is straight; larger
        /// than half of the diagonal. Its points are before or behind those of the rectangle.
        radius: Option<Radii>, in FINITE, or "flat";
        /// Whether columns run against u: the picture as seen from behind, which is the right way
        /// round for a film behind a lens.
        flip: bool, default false;
        /// A disk that most light comes through, such as the rear element of the lens before a
        /// film: nine of ten camera sub-paths go there.
        aim: Option<Given<AimKeys>>, or "none";
    }
}

impl Build for DetectorKeys {
    type Output = Unsized;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unsized> {
        let (u, v) = self.half_edges(table, cx)?;
        if u.dot(v).abs() > 1e-9 * u.length() * v.length() || u.cross(v).length() <= 0.0 {
            let message = "u and v of the detector are not at right angles";
            cx.conflict(&table.at, message);
        }
        let size = self.pitch.map(|pitch| {
            let at = table.span("pitch");
            let count = |half: DVec3| {
                let count = (2.0 * half.length() / pitch.0).round();
                count.clamp(1.0, MAX_EDGE) as u32
            };
            let off = |half: DVec3, n: u32| {
                let n = f64::from(n);
                (2.0 * half.length() - n * pitch.0).abs() > 1e-6 * pitch.0 * n
            };
            let (width, height) = (count(u), count(v));
            if off(u, width) || off(v, height) {
                let message = "width and height are not whole multiples of pitch (at most 65536)";
                cx.conflict(&at, message);
            }
            Size { width, height }.checked(&at, cx)
        });
        let center = self.center.0;
        let transparent = self.transparent;
        let axes = DMat3::from_cols(u.normalize(), v.normalize(), u.cross(v).normalize());
        let pose = DAffine3::from_mat3_translation(axes, center);
        let (width_m, height_m) = (2.0 * u.length(), 2.0 * v.length());
        let aim = match self.aim {
            None => None,
            Some(Given(disk)) => {
                let Disk { target, radius_m } = disk?;
                let way = target - center;
                if way.dot(axes.z_axis) <= 0.0 {
                    let message = "aim is behind the detector (allowed: on the side that measures)";
                    cx.conflict(&table.span("aim"), message);
                }
                Some(Aim {
                    center: target,
                    normal: way.try_normalize()?,
                    radius_m,
                })
            }
        };
        let flip = self.flip;
        let acceptance = self.acceptance_deg.map(f64::to_radians);
        let far_field = self.far_field_deg.map(|full| FarField {
            half_rad: DVec2::from_array(full.map(|deg| 0.5 * deg.to_radians())),
        });
        if far_field.is_some() {
            for key in ["pitch", "aim", "acceptance_deg", "radius"] {
                if table.get(key).is_some() {
                    let message = format!(
                        "{key} and far_field_deg exclude each other (its film is over angles)"
                    );
                    cx.conflict(&table.span(key), message);
                }
            }
        }
        let curved = self.curved(DVec2::new(0.5 * width_m, 0.5 * height_m), table, cx);
        let camera = move |resolution| {
            let camera = Camera::detector(pose, width_m, height_m, resolution, transparent);
            let camera = if flip { camera.flipped() } else { camera };
            let camera = match acceptance {
                Some(rad) => camera.accepting(rad),
                None => camera,
            };
            let camera = match far_field {
                Some(field) => camera.by_direction(field),
                None => camera,
            };
            let camera = match aim {
                Some(aim) => camera.aimed(Toward::Disk(aim)),
                None => camera,
            };
            match curved {
                Some(curved) => camera.bent(curved),
                None => camera,
            }
        };
        Some((Box::new(camera), size))
    }
}

impl DetectorKeys {
    /// The surface of a bent detector over its rectangle.
    fn curved(&self, half_m: DVec2, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Curved> {
        let radii_m = self.radius?.0;
        if radii_m == [0.0; 2] {
            return None;
        }
        let curved = Curved::new(radii_m, half_m);
        if curved.is_none() {
            let message = "radius is not larger than half of the diagonal of the detector";
            cx.conflict(&table.span("radius"), message);
        }
        curved
    }

    fn half_edges(&self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<(DVec3, DVec3)> {
        match (self.u, self.v, self.normal, self.width, self.height) {
            (Some(u), Some(v), None, None, None) if self.up.is_none() => Some((u.0, v.0)),
            (None, None, Some(Direction(n)), Some(width), Some(height)) => {
                let up = self.up.map_or(DVec3::Y, |up| up.0);
                let across = up.cross(n);
                let right = across.try_normalize().filter(|_| across.length() > 1e-9);
                if right.is_none() {
                    let key = if self.up.is_some() { "up" } else { "normal" };
                    cx.conflict(&table.span(key), "up is parallel to the normal");
                }
                let right = right?;
                Some((right * (width.0 / 2.0), n.cross(right) * (height.0 / 2.0)))
            }
            _ => {
                let message = "a detector needs center with either u and v, or normal, width and \
                               height (and up)";
                cx.conflict(&table.at, message);
                None
            }
        }
    }
}

keys! {
    /// A sensor of exactly one kind.
    SensorKeys = "sensor" {
        /// Name for files: at most 64 letters, digits, `-`, `_`, `.` (not first); unique. Blanks
        /// become `-`.
        name: Option<At<Name>>, or "`sensor-0`, ...";
        /// Columns and rows, at most 2^28 pixels in all.
        resolution: Option<Size>, in EDGE, unit "pixels", or "[640, 480]";
        /// Reconstruction filter.
        filter: Option<FilterKind>, or "that of `[render]`; of detectors `\"box\"`";
        /// Radius of the filter; the box has none.
        filter_radius: Option<f64>, in FILTER_RADIUS, unit "pixels", or "that of `[render]`";
        /// [open, close], open <= close: the image is the mean over this time. Open for a moment
        /// only, it shows things as they are then.
        shutter: Shutter, unit "seconds", default Shutter::default();
        /// Motion, without `scale`.
        motion: Motion<false>;
        /// The medium it is in; checked, and needed only where solids are open.
        medium: Option<At<MediumName>>, or "what is there";
        /// A pinhole or a thin lens.
        perspective: Option<Given<PerspectiveKeys>>;
        /// A parallel projection.
        orthographic: Option<Given<OrthographicKeys>>;
        /// A rectangle that measures irradiance.
        detector: Option<Given<DetectorKeys>>;
        /// A film behind a lens of the scene.
        film: Option<Given<FilmKeys>>;
    }
}

/// A sensor that has no name yet, unless it was given one, and does not move yet.
pub struct Unnamed {
    name: Option<At<String>>,
    camera: Camera,
    filter: (Option<FilterKind>, Option<f64>),
    shutter: Shutter,
    motion: Vec<Link>,
    medium: Option<At<MediumName>>,
    film: Option<Film>,
}

impl Build for SensorKeys {
    type Output = Unnamed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Unnamed> {
        let name = self.name.as_ref().map(|given| At {
            value: file_name(given, cx),
            at: given.at.clone(),
        });
        let kinds = ["perspective", "orthographic", "detector", "film"];
        if table.exactly_one(&kinds, "sensor", cx)? == "film" && !self.motion.0.is_empty() {
            let message = "a film moves with its lens (allowed: motion of the lens)";
            cx.conflict(&table.span("motion"), message);
        }
        if let Some(Given(film)) = self.film {
            let film = film?;
            table.sound(cx)?;
            let size = self.resolution.unwrap_or(DEFAULT_RESOLUTION);
            return Some(Unnamed {
                name,
                camera: film.unplaced(size.resolution()),
                filter: (self.filter, self.filter_radius),
                shutter: self.shutter,
                motion: Vec::new(),
                medium: self.medium,
                film: Some(film),
            });
        }
        let (camera, own_size) = first_given([
            self.perspective.map(|g| g.0),
            self.orthographic.map(|g| g.0),
            self.detector.map(|g| g.0),
        ])??;
        if own_size.is_some() && self.resolution.is_some() {
            let message = "resolution and pitch exclude each other";
            cx.conflict(&table.span("resolution"), message);
        }
        table.sound(cx)?;
        let size = self.resolution.or(own_size).unwrap_or(DEFAULT_RESOLUTION);
        Some(Unnamed {
            name,
            camera: camera(size.resolution()),
            filter: (self.filter, self.filter_radius),
            shutter: self.shutter,
            motion: self.motion.0,
            medium: self.medium,
            film: None,
        })
    }
}

/// A sensor in its place, but for what moves it and for the lens that a film looks for.
pub struct Pending {
    /// The sensor.
    pub sensor: At<SensorDescription>,
    /// Motion, the outermost link first.
    pub motion: Vec<Link>,
    /// The film that it is.
    pub film: Option<Film>,
}

/// `[[sensor]]`, each with its place and what moves it.
#[derive(Default)]
pub struct Sensors {
    /// How many there are, also of those that are wrong.
    pub count: usize,
    /// The others.
    pub read: Vec<Pending>,
}

impl Value for Sensors {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(SensorKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let list = items(node, "an array", cx)?;
        let mut sensors = Self {
            count: list.len(),
            read: Vec::new(),
        };
        let mut names = BTreeSet::new();
        for (i, item) in list.into_iter().enumerate() {
            let Some(Built(sensor)) = Built::<SensorKeys>::read(item, spec, cx) else {
                continue;
            };
            let at = sensor.name.as_ref().map_or(item.span(), |n| n.at.clone());
            let name = sensor
                .name
                .map_or_else(|| format!("sensor-{i}"), |n| n.value);
            if !names.insert(name.clone()) {
                cx.conflict(&at, format!("sensor \"{name}\" is defined twice"));
            }
            let is_detector = sensor.camera.is_hittable();
            let shutter = sensor.shutter;
            cx.shutter = Some(cx.shutter.map_or(shutter, |all| all.union(shutter)));
            let sensor_description = SensorDescription {
                name,
                camera: sensor.camera,
                filter: cx.film_filter(sensor.filter.0, sensor.filter.1, is_detector),
                shutter,
            };
            let index = sensors.read.len();
            cx.sensor_media.extend(sensor.medium.map(|m| (index, m)));
            let at = item.span();
            let value = sensor_description;
            sensors.read.push(Pending {
                sensor: At { value, at },
                motion: sensor.motion,
                film: sensor.film,
            });
        }
        Some(sensors)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some(String::new())
    }
}

/// A name that can be part of a file name.
fn file_name(given: &At<Name>, cx: &mut Reader<'_>) -> String {
    let name = given.value.0.replace(' ', "-");
    let in_file_name = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    let fits = !name.is_empty() && name.len() <= 64 && !name.starts_with('.');
    if !fits || !name.chars().all(in_file_name) {
        let message = format!(
            "name \"{name}\" cannot be part of a file name (allowed: letters, digits, - _ .)"
        );
        cx.conflict(&given.at, message);
    }
    name
}
