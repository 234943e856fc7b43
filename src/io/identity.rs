//! Identity of a render: what its images and parts say of how they were made, and the hash that
//! tells whether parts belong together.

use super::part::{PartHeader, PassRange};
use crate::camera::curved::Curved;
use crate::camera::detector::Toward;
use crate::film::Filter;
use crate::light::casters::Casters;
use crate::math::hash::hash_bytes;
use crate::optics::Polarization;
use crate::render::{EpsilonChoice, RadiusChoice, Render};
use crate::scene::description::WavelengthChoice;
use crate::scene::settings::{Merging, Metropolis, Regularization};
use crate::scene::{Scene, Sensor, Settings, WavelengthSettings};
use crate::spectrum::SensorResponse;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Named values, in the order in which they are hashed.
type Values = Vec<(&'static str, String)>;

fn filter_name(filter: &Filter) -> String {
    match filter {
        Filter::Box => "box".to_owned(),
        Filter::Tent { radius } => format!("tent, radius {radius} pixels"),
        Filter::Gaussian { sigma, radius } => {
            format!("gaussian, sigma {sigma}, radius {radius} pixels")
        }
    }
}

fn wavelengths_name(settings: &WavelengthSettings) -> String {
    let [low, high] = settings.range_nm;
    match &settings.choice {
        WavelengthChoice::Scene => format!("scene, {low}..{high} nm"),
        WavelengthChoice::Uniform => format!("uniform, {low}..{high} nm"),
        WavelengthChoice::Visible => format!("visible, {low}..{high} nm"),
        WavelengthChoice::Even => format!("even, {low}..{high} nm"),
        WavelengthChoice::Lines(lines) => {
            let lines: Vec<String> = lines.iter().map(f64::to_string).collect();
            format!("lines {} nm", lines.join(", "))
        }
    }
}

/// Quantity that a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Of cameras.
    Radiance,
    /// Of detectors over places.
    Irradiance,
    /// Of detectors over directions.
    Intensity,
}

impl Quantity {
    /// Of a sensor.
    #[must_use]
    pub fn of(scene: &Scene, sensor: usize) -> Self {
        let camera = &scene.sensors[sensor].camera;
        match (camera.as_detector(), camera.far_field()) {
            (None, _) => Self::Radiance,
            (Some(_), None) => Self::Irradiance,
            (Some(_), Some(_)) => Self::Intensity,
        }
    }

    /// Of the sensor that an image with these attributes is of.
    #[must_use]
    pub fn of_attributes(attributes: &BTreeMap<String, String>) -> Self {
        let is_detector = attributes.get(SENSOR_KIND).is_some_and(|k| k == DETECTOR);
        match (is_detector, attributes.contains_key(PIXEL_ANGLE)) {
            (false, _) => Self::Radiance,
            (true, false) => Self::Irradiance,
            (true, true) => Self::Intensity,
        }
    }

    /// The unit in a spectral image, per nanometer.
    #[must_use]
    pub fn spectral_unit(self) -> &'static str {
        match self {
            Self::Radiance => "W.m^-2.sr^-1",
            Self::Irradiance => "W.m^-2",
            Self::Intensity => "W.sr^-1",
        }
    }
}

/// Quantity and unit of the image.
fn unit_name(response: SensorResponse, quantity: Quantity) -> &'static str {
    match (response, quantity) {
        (SensorResponse::Xyz, Quantity::Radiance) => {
            "radiance, unit equal-energy radiance has Y = 1"
        }
        (SensorResponse::Xyz, Quantity::Irradiance) => {
            "irradiance, equal-energy irradiance of 1 W/(m^2 nm) has Y = 1"
        }
        (SensorResponse::Xyz, Quantity::Intensity) => {
            "intensity, equal-energy intensity of 1 W/(sr nm) has Y = 1"
        }
        (SensorResponse::Photometric, Quantity::Radiance) => "photometric, 683 lm/W",
        (SensorResponse::Photometric, Quantity::Irradiance) => {
            "photometric irradiance in lx, 683 lm/W"
        }
        (SensorResponse::Photometric, Quantity::Intensity) => {
            "photometric intensity in cd, 683 lm/W"
        }
    }
}

/// Whether a sensor measures irradiance.
#[must_use]
pub fn is_detector(scene: &Scene, sensor: usize) -> bool {
    scene.sensors[sensor].camera.as_detector().is_some()
}

/// Header of the parts, and of the images, of a render.
#[must_use]
pub fn header(render: &Render) -> PartHeader {
    let (scene, settings) = (render.scene(), render.settings());
    let (sensor, response) = (render.sensor(), render.outputs().response);
    let crop = render.crop();
    let size = scene.sensors[sensor].camera.resolution();
    let mut image = image_values(scene, sensor, settings, response);
    if let Some(epsilon) = render.epsilon() {
        image.extend(epsilon_values(
            &settings.regularization,
            epsilon,
            render.tells_bias(),
        ));
    }
    if let Some(radius) = render.radius() {
        image.extend(merging_values(&settings.merging, radius));
    }
    image.extend(detector_values(scene, sensor));
    let named = image
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value));
    PartHeader {
        version: VERSION.to_owned(),
        scene_hash: scene.hash,
        settings_hash: settings_hash(scene, sensor, settings, response),
        sensor: scene.sensors[sensor].name.clone(),
        width: size.width,
        height: size.height,
        crop: [crop.x0, crop.y0, crop.x1, crop.y1],
        channels: 3,
        blocks: render.outputs().image.blocks(),
        exponent: scene.film_exponent,
        pilot: render.factors().map_or(0, |found| found.passes.0),
        image: BTreeMap::from_iter(named),
        passes: pass_ranges(render.passes(), settings.seed),
        unfinished: None,
        companions: Vec::new(),
        spectral: None,
    }
}

/// Attribute with the unit of an image's values.
pub const UNIT: &str = "unit";

/// The response of a sensor whose image has this attribute [`UNIT`].
#[must_use]
pub fn response_of_unit(unit: &str) -> SensorResponse {
    if unit.starts_with("photometric") {
        SensorResponse::Photometric
    } else {
        SensorResponse::Xyz
    }
}

/// Photometric unit of Y in an image with this attribute [`UNIT`].
#[must_use]
pub fn photometric_unit(unit: &str) -> &'static str {
    if unit.contains("irradiance") {
        "lx"
    } else if unit.contains("intensity") {
        "cd"
    } else {
        "cd/m²"
    }
}

/// Photometric unit of Y in the images of a sensor.
#[must_use]
pub fn photometric_unit_of(scene: &Scene, sensor: usize) -> &'static str {
    photometric_unit(unit_name(
        SensorResponse::Photometric,
        Quantity::of(scene, sensor),
    ))
}

/// Attribute that tells images of cameras from those of detectors.
pub const SENSOR_KIND: &str = "sensorKind";
/// Value for a detector.
pub const DETECTOR: &str = "detector";

/// Attribute of detectors that are films behind lenses: their images are photographs.
pub const FILM: &str = "film";

/// Attributes of every image: how it was made.
fn image_values(
    scene: &Scene,
    sensor: usize,
    settings: &Settings,
    response: SensorResponse,
) -> Values {
    let max_depth = settings
        .max_depth
        .map_or_else(|| "unlimited".to_owned(), |d| d.to_string());
    let kind = if is_detector(scene, sensor) {
        DETECTOR
    } else {
        "camera"
    };
    let mut values = vec![
        ("integrator", settings.integrator.to_string()),
        ("heuristic", settings.heuristic.to_string()),
        ("regularize", settings.regularization.mode.to_string()),
        ("lanes", settings.lanes.to_string()),
        ("maxDepth", max_depth),
        ("filter", filter_name(&scene.sensors[sensor].filter)),
        ("wavelengths", wavelengths_name(&scene.wavelength_settings)),
        ("observer", "CIE 1931 2 degree".to_owned()),
        (SENSOR_KIND, kind.to_owned()),
        (
            UNIT,
            unit_name(response, Quantity::of(scene, sensor)).to_owned(),
        ),
    ];
    if scene.polarization != Polarization::Average {
        values.push(("fresnel", scene.polarization.to_string()));
    }
    if scene.casters.share() != Casters::SHARE {
        values.push(("casterShare", scene.casters.share().to_string()));
    }
    if let Some(sequences) = &scene.sequences {
        values.push(("sequences", sequences.source().to_owned()));
    }
    let detector = scene.sensors[sensor].camera.as_detector();
    if detector.is_some_and(|d| matches!(d.aim, Some(Toward::Pupil(_)))) {
        values.push((FILM, "behind a lens".to_owned()));
    }
    values
}

/// Attribute with the width of a pixel over its height, which OpenEXR has a place of its own for.
pub const PIXEL_ASPECT: &str = "pixelAspectRatio";

/// Attribute with the width and height of a detector's pixels.
pub const PIXEL_PITCH: &str = "pixelPitch";

/// Attribute with the width and height of the pixels of a film over directions.
pub const PIXEL_ANGLE: &str = "pixelAngle";

/// Reads the width and height of pixels in degrees from the text of [`PIXEL_ANGLE`].
#[must_use]
pub fn angle_of_text(text: &str) -> Option<[f64; 2]> {
    two_of_text(text, " deg")
}

/// Width and height of a detector's pixels in meters; `None` for cameras, and for films over
/// directions.
#[must_use]
pub fn pixel_pitch(scene: &Scene, sensor: usize) -> Option<[f64; 2]> {
    let Sensor {
        camera, shutter, ..
    } = &scene.sensors[sensor];
    if camera.as_detector()?.far_field.is_some() {
        return None;
    }
    // a detector is the image of the square -1..1
    let map = camera.transform().at(shutter.open_s).to_world.matrix3;
    let size = camera.resolution().size();
    Some([
        2.0 * map.x_axis.length() / size.x,
        2.0 * map.y_axis.length() / size.y,
    ])
}

/// Attribute with the radii of a bent detector along its width and height, 0 where it is straight.
pub const RADIUS: &str = "detectorRadius";

/// Reads radii in meters from the text of [`RADIUS`].
#[must_use]
pub fn radii_of_text(text: &str) -> Option<[f64; 2]> {
    let (x, y) = text.strip_suffix(" m")?.split_once(" x ")?;
    let radii = [x.parse().ok()?, y.parse().ok()?];
    radii.iter().all(|r: &f64| r.is_finite()).then_some(radii)
}

/// The surface of a bent detector by the texts of [`RADIUS`] and [`PIXEL_PITCH`], of a film of so
/// many columns and rows.
#[must_use]
pub fn curved_of_texts(radius: &str, pitch: &str, [width, height]: [u32; 2]) -> Option<Curved> {
    let film = DVec2::new(f64::from(width), f64::from(height));
    let pitch = DVec2::from_array(pitch_of_text(pitch)?);
    Curved::new(radii_of_text(radius)?, 0.5 * film * pitch)
}

/// Reads the width and height of pixels in meters from the text of [`PIXEL_PITCH`].
#[must_use]
pub fn pitch_of_text(text: &str) -> Option<[f64; 2]> {
    two_of_text(text, " m")
}

fn two_of_text(text: &str, unit: &str) -> Option<[f64; 2]> {
    let (x, y) = text.strip_suffix(unit)?.split_once(" x ")?;
    let pitch = [x.parse().ok()?, y.parse().ok()?];
    let is_length = |v: &f64| v.is_finite() && *v > 0.0;
    pitch.iter().all(is_length).then_some(pitch)
}

/// Attributes of a detector's image: its size in the world, and that of its pixels.
fn detector_values(scene: &Scene, sensor: usize) -> Values {
    let Sensor {
        camera, shutter, ..
    } = &scene.sensors[sensor];
    let Some(detector) = camera.as_detector() else {
        return Vec::new();
    };
    let map = camera.transform().at(shutter.open_s).to_world;
    let (u, v) = (map.matrix3.x_axis, map.matrix3.y_axis);
    let (width, height) = (2.0 * u.length(), 2.0 * v.length());
    let size = ("detectorSize", format!("{width} x {height} m"));
    let resolution = camera.resolution().size();
    if let Some(field) = &detector.far_field {
        let [x, y] = (2.0 * field.half_rad / resolution)
            .map(f64::to_degrees)
            .to_array();
        return vec![
            size,
            (PIXEL_ANGLE, format!("{x} x {y} deg")),
            (PIXEL_ASPECT, format!("{}", x / y)),
        ];
    }
    let [x, y] = [width / resolution.x, height / resolution.y];
    if let Some(curved) = &detector.curved {
        let [along_u, along_v] = curved.radii_m();
        return vec![
            size,
            (PIXEL_PITCH, format!("{x} x {y} m")),
            (PIXEL_ASPECT, format!("{}", x / y)),
            (RADIUS, format!("{along_u} x {along_v} m")),
        ];
    }
    // from columns and rows, counted from the upper left corner, to the world
    let u = if detector.flipped { -u } else { u };
    let (column, row) = (2.0 * u / resolution.x, -2.0 * v / resolution.y);
    let text = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
    let corner = text(map.translation - u + v);
    vec![
        size,
        (PIXEL_PITCH, format!("{x} x {y} m")),
        (PIXEL_ASPECT, format!("{}", x / y)),
        (
            "pixelToWorld",
            format!(
                "{corner} + column ({}) + row ({}) m",
                text(column),
                text(row)
            ),
        ),
    ]
}

/// Attributes of a regularized image: its cones.
fn epsilon_values(settings: &Regularization, epsilon: &EpsilonChoice, tells_bias: bool) -> Values {
    let odd = if tells_bias {
        ", of odd passes the one before's over sqrt 2"
    } else {
        ""
    };
    let schedule = format!(
        "max({}, {} (pass + 1)^(-1/6)) rad{odd}",
        settings.epsilon_min, epsilon.epsilon
    );
    vec![
        ("epsilonFirst", epsilon.epsilon.to_string()),
        ("epsilonReason", epsilon.reason.to_string()),
        ("epsilonSchedule", schedule),
    ]
}

/// Attributes of an image with merging: its radii.
fn merging_values(merging: &Merging, choice: &RadiusChoice) -> Values {
    let (radius, exponent) = (choice.radius, -0.5 * (1.0 - merging.alpha));
    vec![
        ("mergeRadiusFirst", format!("{radius} m")),
        ("mergeRadiusReason", choice.reason.to_string()),
        (
            "mergeRadiusSchedule",
            format!("{radius} (pass + 1)^({exponent:.6}) m"),
        ),
        ("sharing", merging.sharing.to_string()),
    ]
}

/// Settings that change the estimate and that no attribute of every image tells.
fn further_values(settings: &Settings) -> Values {
    // by name, so that a new setting cannot be forgotten; passes and seeds are counted by the
    // header
    let Settings {
        integrator,
        spp: _,
        seed: _,
        lanes: _,
        max_depth: _,
        heuristic: _,
        pair_probability,
        light_paths,
        regularization,
        aim,
        merging,
        metropolis,
        show_point_lights,
        disabled,
    } = settings;
    let Regularization {
        mode: _,
        single_rule,
        epsilon,
        epsilon_min,
        bias_weight,
        bias_estimate,
    } = regularization;
    let Merging {
        radius,
        alpha,
        sharing,
    } = merging;
    let or_auto = |value: Option<String>| value.unwrap_or_else(|| "auto".to_owned());
    let disabled: Vec<String> = disabled.iter().map(|(s, t)| format!("s{s}t{t}")).collect();
    let mut values = vec![
        (
            "pairProbability",
            or_auto(pair_probability.map(|p| p.to_string())),
        ),
        ("lightPaths", or_auto(light_paths.map(|n| n.to_string()))),
        ("aim", aim.to_string()),
        ("singleRule", single_rule.to_string()),
        ("epsilon", or_auto(epsilon.map(|e| e.to_string()))),
        ("epsilonMin", epsilon_min.to_string()),
        ("biasWeight", bias_weight.to_string()),
        (
            "biasEstimate",
            or_auto(bias_estimate.map(|b| b.to_string())),
        ),
        ("mergeRadius", or_auto(radius.map(|r| r.to_string()))),
        ("mergeAlpha", alpha.to_string()),
        ("mergeSharing", sharing.to_string()),
        ("showPointLights", show_point_lights.to_string()),
        ("disabled", disabled.join(" ")),
    ];
    if integrator.runs_chains() {
        let Metropolis { mutations, uniform } = metropolis;
        values.push(("metropolisMutations", mutations.to_string()));
        values.push(("metropolisUniform", uniform.to_string()));
    }
    values
}

/// Hash of all that changes the estimate but scene, seed and passes: of the named values, so that
/// it depends on no name in this program's code.
#[must_use]
pub fn settings_hash(
    scene: &Scene,
    sensor: usize,
    settings: &Settings,
    response: SensorResponse,
) -> u64 {
    let mut values = image_values(scene, sensor, settings, response);
    values.extend(further_values(settings));
    hash_bytes(lines(&values).as_bytes())
}

fn lines(values: &Values) -> String {
    let line = |(name, value): &(&str, String)| format!("{name}={value}\n");
    values.iter().map(line).collect()
}

/// Passes in any order as ranges, sorted and apart.
fn pass_ranges(passes: &[u32], seed: u64) -> Vec<PassRange> {
    let mut sorted: Vec<u64> = passes.iter().copied().map(u64::from).collect();
    sorted.sort_unstable();
    let mut ranges: Vec<PassRange> = Vec::new();
    for pass in sorted {
        match ranges.last_mut().filter(|r| r.end == pass) {
            Some(range) => range.end += 1,
            None => ranges.push(PassRange {
                seed,
                start: pass,
                end: pass + 1,
            }),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_become_ranges() {
        let range = |start, end| PassRange {
            seed: 7,
            start,
            end,
        };
        assert_eq!(pass_ranges(&[], 7), []);
        assert_eq!(
            pass_ranges(&[5, 0, 1, 2, 6, 9], 7),
            [range(0, 3), range(5, 7), range(9, 10)]
        );
    }
}
