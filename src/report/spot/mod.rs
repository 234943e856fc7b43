//! Spots on detectors: power, centroid, radius, encircled energy and modulation transfer of the
//! light in a window of an image, wavelength by wavelength.
//!
//! A pixel is a square of uniform irradiance. Its own width is taken out of root mean square radii
//! (a square of side p has a variance of p²/12 along each axis) and of the modulation transfer
//! (divided by sin(πfp)/(πfp)), so that both are those of the light. Encircled energy is that of
//! the pixels. Where the image has the layer `noise`, and no filter spreads light over pixels, all
//! have standard errors.
//!
//! Of a film over directions all lengths are angles: degrees in place of millimeters.

mod errors;
mod view;

pub use errors::SpotErrors;
pub use view::{drawing, json, text};

use super::ReportError;
use crate::camera::Resolution;
use crate::camera::far_field::FarField;
use crate::film::Crop;
use crate::io::exr::{ExrImage, MetadataValue, noise_channel, spectral_channel_nm};
use crate::io::identity::{self, PIXEL_ANGLE, PIXEL_PITCH, RADIUS, angle_of_text, pitch_of_text};
use crate::spectrum::SensorResponse;
use glam::DVec2;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Shares of the power whose radii are told.
pub const SHARES: [f64; 3] = [0.5, 0.8, 0.95];
/// Points along each side of a pixel for encircled energy, where no more than so many have light.
const SUB: u32 = 4;
const MOST_DIVIDED: usize = 1 << 16;

/// Part of an image and of its light that is measured.
#[derive(Clone, Debug, Default)]
pub struct SpotRequest {
    /// The pixels, in those of the film; `None`: all.
    pub window: Option<Crop>,
    /// Whether the mean of the outermost pixels of the window is taken from all of it.
    pub background: bool,
    /// Spatial frequencies of the modulation transfer in cycles per millimeter; none: ten up to
    /// half the sampling frequency, beyond which there are none.
    pub frequencies: Vec<f64>,
}

/// Modulation transfer at one spatial frequency.
#[derive(Clone, Copy, Debug)]
pub struct Modulation {
    /// Cycles per millimeter.
    pub per_mm: f64,
    /// Of a pattern that varies along the rows (x), and along the columns (y).
    pub contrast: [f64; 2],
}

/// The spot of one channel.
#[derive(Clone, Debug)]
pub struct Spot {
    /// Name of the channel: a wavelength, `continuum`, `Y`, or a layer.
    pub name: String,
    /// Wavelength of a line in nanometers.
    pub lambda_nm: Option<f64>,
    /// Power in the window, of Y times the unit of the image.
    pub power: f64,
    /// Centroid in millimeters from the center of the detector, x to the right, y up.
    pub centroid_mm: DVec2,
    /// Centroid in pixels of the film from its upper left corner, y down.
    pub centroid_px: DVec2,
    /// Root mean square distances from the centroid along x and along y, millimeters.
    pub rms_mm: DVec2,
    /// Radii about the centroid that hold the [`SHARES`] of the power, millimeters.
    pub encircled_mm: [f64; 3],
    /// Encircled energy: radius in millimeters and share of the power.
    pub energy: Vec<(f64, f64)>,
    /// Modulation transfer.
    pub modulation: Vec<Modulation>,
    /// Standard errors, where the image tells the noise of its pixels.
    pub errors: Option<SpotErrors>,
}

impl Spot {
    /// Root mean square distance from the centroid, millimeters.
    #[must_use]
    pub fn rms_radius_mm(&self) -> f64 {
        self.rms_mm.length()
    }
}

/// Spots of an image.
#[derive(Clone, Debug)]
pub struct Spots {
    /// The window that was measured.
    pub window: Crop,
    /// Width and height of a pixel, millimeters.
    pub pitch_mm: DVec2,
    /// Whether the film is over directions: what are millimeters otherwise are degrees.
    pub is_angular: bool,
    /// Unit of the powers.
    pub unit: &'static str,
    /// One per channel that has light.
    pub spots: Vec<Spot>,
}

/// A channel as it is measured: a value per pixel, times the area of a pixel in m² the power.
struct Plane {
    name: String,
    lambda_nm: Option<f64>,
    values: Vec<f64>,
    /// Noise of the values, where the image tells it.
    noise: Option<Vec<f64>>,
}

/// Measures the spots of an image of a detector: of a spectral image each line and the rest, else Y
/// and the Y of each layer of path classes.
///
/// # Errors
/// The image is none of a detector, has values that are not finite, or no light in the window.
pub fn measure(path: &Path, image: &ExrImage, request: &SpotRequest) -> Result<Spots, ReportError> {
    let fault = |message: String| ReportError::file(path, message);
    let attribute = |name, read: fn(&str) -> Option<[f64; 2]>| match image.metadata.get(name) {
        Some(MetadataValue::Text(text)) => read(text).map(DVec2::from_array),
        _ => None,
    };
    let angle = attribute(PIXEL_ANGLE, angle_of_text);
    let pitch_m = attribute(PIXEL_PITCH, pitch_of_text);
    let pitch_mm = angle.or(pitch_m.map(|pitch| 1e3 * pitch)).ok_or_else(|| {
        fault("is no image of a detector: it has no attribute pixelPitch or pixelAngle".to_owned())
    })?;
    let window = request.window.unwrap_or(image.crop);
    let c = image.crop;
    if window.x1 > image.width || window.y1 > image.height {
        return Err(ReportError::Region {
            region: window,
            width: image.width,
            height: image.height,
        });
    }
    if window.x0 < c.x0 || window.y0 < c.y0 || window.x1 > c.x1 || window.y1 > c.y1 {
        let Crop { x0, y0, x1, y1 } = c;
        return Err(fault(format!(
            "the window reaches beyond what is rendered, {x0},{y0},{x1},{y1}"
        )));
    }
    let (planes, unit) = planes(image);
    if planes.is_empty() {
        return Err(fault("has neither a channel Y nor a spectrum".to_owned()));
    }
    let film = DVec2::new(f64::from(image.width), f64::from(image.height));
    // solid angles of pixels, as multiples of that in the middle
    let solid_angles = angle.map(|pitch| {
        let field = FarField {
            half_rad: 0.5 * film * pitch.map(f64::to_radians),
        };
        let (width, height) = (image.width, image.height);
        let (columns, rows) = (window.x0..window.x1, window.y0..window.y1);
        let pixels = field.pixels(Resolution { width, height }, columns, rows);
        let middle = field.solid_angle(DVec2::ZERO) / (film.x * film.y);
        pixels.into_iter().map(move |sr| sr / middle)
    });
    let text = |name| match image.metadata.get(name) {
        Some(MetadataValue::Text(text)) => Some(text.as_str()),
        _ => None,
    };
    // areas of the surface of a bent detector, as multiples of those of its pixels
    let curved = text(RADIUS).zip(text(PIXEL_PITCH)).map(|(radius, pitch)| {
        let size = [image.width, image.height];
        identity::curved_of_texts(radius, pitch, size)
            .ok_or_else(|| fault(format!("{RADIUS} \"{radius}\" is that of no surface")))
    });
    let areas = curved.transpose()?.map(|curved| {
        let (width, height) = (image.width, image.height);
        let (columns, rows) = (window.x0..window.x1, window.y0..window.y1);
        curved.stretches(Resolution { width, height }, columns, rows)
    });
    let shares: Option<Vec<f64>> = solid_angles.map(Iterator::collect).or(areas);
    let radians = angle.map(|pitch| pitch.map(f64::to_radians));
    let pixel = radians.unwrap_or(1e-3 * pitch_mm);
    let frame = Frame {
        film,
        window,
        pitch_mm,
        pixel_measure: pixel.x * pixel.y,
    };
    let frequencies = frame.frequencies(&request.frequencies);
    let most = 0.5 / pitch_mm.max_element();
    if let Some(beyond) = frequencies.iter().find(|f| **f > most * (1.0 + 1e-9)) {
        return Err(fault(format!(
            "its pixels are too wide for {beyond} cycles per {} (allowed: up to {most})",
            if angle.is_some() {
                "degree"
            } else {
                "millimeter"
            }
        )));
    }
    let mut spots = Vec::new();
    for plane in planes {
        let mut values = cut(&plane.values, image.crop, window);
        let mut noise = plane.noise.map(|noise| cut(&noise, image.crop, window));
        if let Some(shares) = &shares {
            for values in [Some(&mut values), noise.as_mut()].into_iter().flatten() {
                values
                    .iter_mut()
                    .zip(shares)
                    .for_each(|(v, share)| *v *= share);
            }
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(fault(format!("{}: pixels are not finite", plane.name)));
        }
        // of a render without two halves it is not known
        let noise = noise.filter(|noise| noise.iter().all(|v| v.is_finite()));
        if request.background {
            let level = border_mean(&values, window);
            values.iter_mut().for_each(|v| *v -= level);
        }
        if values.iter().sum::<f64>() > 0.0 {
            let mut spot = frame.spot(plane.name, plane.lambda_nm, &values, &frequencies);
            let errors = |noise: &[f64]| frame.errors(&spot, &values, noise, request.background);
            let errors = noise.as_deref().map(errors);
            spot.errors = errors;
            spots.push(spot);
        }
    }
    if spots.is_empty() {
        return Err(fault("there is no light in the window".to_owned()));
    }
    Ok(Spots {
        window,
        pitch_mm,
        is_angular: angle.is_some(),
        unit,
        spots,
    })
}

/// The channels to measure, in W/m² or the unit of Y, and the unit of their integral.
fn planes(image: &ExrImage) -> (Vec<Plane>, &'static str) {
    let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>();
    // what a filter spreads over pixels errs together in them
    let is_box = match image.metadata.get("filter") {
        Some(MetadataValue::Text(text)) => text == "box",
        _ => true,
    };
    let noise_of = |name: &str| {
        let name = noise_channel(name);
        let channel = image.channels.iter().find(|c| is_box && c.name == name);
        channel.map(|c| wide(&c.values))
    };
    let mut bins: Vec<(f64, Vec<f64>)> = Vec::new();
    let mut lines = Vec::new();
    for channel in &image.channels {
        if let Some(nm) = spectral_channel_nm(&channel.name) {
            bins.push((nm, wide(&channel.values)));
        } else if let Some(nm) = channel
            .name
            .strip_prefix("line.")
            .and_then(spectral_channel_nm)
        {
            lines.push(Plane {
                name: format!("{nm} nm"),
                lambda_nm: Some(nm),
                values: wide(&channel.values),
                noise: noise_of(&channel.name),
            });
        }
    }
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    lines.sort_by(|a, b| {
        a.lambda_nm
            .unwrap_or(0.0)
            .total_cmp(&b.lambda_nm.unwrap_or(0.0))
    });
    if !bins.is_empty() || !lines.is_empty() {
        // bins are equally wide
        let width = match bins.as_slice() {
            [(a, _), (b, _), ..] => b - a,
            _ => 0.0,
        };
        if width > 0.0 {
            let pixels = bins[0].1.len();
            let sum = |i: usize| bins.iter().map(|bin| width * bin.1[i]).sum();
            lines.push(Plane {
                name: "continuum".to_owned(),
                lambda_nm: None,
                values: (0..pixels).map(sum).collect(),
                noise: noise_of("continuum"),
            });
        }
        return (lines, "W");
    }
    let of_layer = |name: &str| -> Option<String> {
        if name == "Y" {
            return Some("Y".to_owned());
        }
        let layer = name.strip_suffix(".Y")?;
        let number = layer.strip_prefix("class")?;
        number.parse::<u32>().ok()?;
        // the expression, where the image says it
        match image.metadata.get(layer) {
            Some(MetadataValue::Text(text)) => Some(text.clone()),
            _ => Some(layer.to_owned()),
        }
    };
    let response = match image.metadata.get(identity::UNIT) {
        Some(MetadataValue::Text(text)) => identity::response_of_unit(text),
        _ => SensorResponse::Xyz,
    };
    let unit = response.photometric_unit();
    let planes = image.channels.iter().filter_map(|channel| {
        let name = of_layer(&channel.name)?;
        let values = channel.values.iter().map(|&v| unit * f64::from(v));
        let mut noise = noise_of(&channel.name);
        noise.iter_mut().flatten().for_each(|v| *v *= unit);
        Some(Plane {
            name,
            lambda_nm: None,
            values: values.collect(),
            noise,
        })
    });
    (planes.collect(), "lm")
}

/// Values of the pixels of a window.
fn cut(values: &[f64], crop: Crop, window: Crop) -> Vec<f64> {
    let row = |y: u32| {
        let first = (y - crop.y0) as usize * crop.width() as usize + (window.x0 - crop.x0) as usize;
        &values[first..first + window.width() as usize]
    };
    (window.y0..window.y1).flat_map(row).copied().collect()
}

/// Whether each pixel of a window is one of the outermost.
fn border(window: Crop) -> impl Iterator<Item = bool> {
    let (width, height) = (window.width() as usize, window.height() as usize);
    (0..width * height).map(move |i| {
        let (x, y) = (i % width, i / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    })
}

/// Mean of the outermost pixels.
fn border_mean(values: &[f64], window: Crop) -> f64 {
    let pixels = values.iter().zip(border(window));
    let border = pixels.filter_map(|(v, is_border)| is_border.then_some(v));
    let (sum, count) = border.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    sum / count
}

/// The window in the plane of the detector.
struct Frame {
    film: DVec2,
    window: Crop,
    pitch_mm: DVec2,
    /// Area of a pixel in m², or solid angle in sr.
    pixel_measure: f64,
}

impl Frame {
    /// Frequencies asked for, or ten up to half the sampling frequency of the coarser axis.
    fn frequencies(&self, asked: &[f64]) -> Vec<f64> {
        if !asked.is_empty() {
            return asked.to_vec();
        }
        let half = 0.5 / self.pitch_mm.max_element();
        (1..=10).map(|i| 0.1 * f64::from(i) * half).collect()
    }

    /// Middle of a pixel of the window in pixels of the film.
    fn pixel(&self, i: usize) -> DVec2 {
        let width = self.window.width() as usize;
        let at = DVec2::new((i % width) as f64, (i / width) as f64);
        at + DVec2::new(f64::from(self.window.x0), f64::from(self.window.y0)) + 0.5
    }

    /// From pixels of the film to millimeters from its center, y up.
    fn to_mm(&self, pixel: DVec2) -> DVec2 {
        (pixel - 0.5 * self.film) * self.pitch_mm * DVec2::new(1.0, -1.0)
    }

    fn spot(
        &self,
        name: String,
        lambda_nm: Option<f64>,
        values: &[f64],
        frequencies: &[f64],
    ) -> Spot {
        let sum: f64 = values.iter().sum();
        let weighted = |of: &dyn Fn(usize) -> DVec2| {
            let terms = values.iter().enumerate().map(|(i, v)| *v * of(i));
            terms.sum::<DVec2>() / sum
        };
        let centroid_px = weighted(&|i| self.pixel(i));
        let centroid_mm = self.to_mm(centroid_px);
        let from_centroid = |i: usize| self.to_mm(self.pixel(i)) - centroid_mm;
        let square = weighted(&|i| from_centroid(i) * from_centroid(i));
        let own = self.pitch_mm * self.pitch_mm / 12.0;
        let energy = self.energy(values, from_centroid, sum);
        let radius = |share: f64| {
            let beyond = energy.iter().find(|(_, s)| *s >= share);
            beyond.or(energy.last()).map_or(0.0, |(radius, _)| *radius)
        };
        Spot {
            name,
            lambda_nm,
            power: sum * self.pixel_measure,
            centroid_mm,
            centroid_px,
            // a background may leave less than nothing
            rms_mm: (square - own).max(DVec2::ZERO).map(f64::sqrt),
            encircled_mm: SHARES.map(radius),
            modulation: (frequencies.iter())
                .map(|&per_mm| self.modulation(values, per_mm, sum))
                .collect(),
            energy: thinned(&energy),
            errors: None,
        }
    }

    /// Share of the power within each radius, by points within the pixels.
    fn energy(
        &self,
        values: &[f64],
        from_centroid: impl Fn(usize) -> DVec2,
        sum: f64,
    ) -> Vec<(f64, f64)> {
        let lit = || values.iter().enumerate().filter(|(_, v)| **v != 0.0);
        let side = if lit().count() <= MOST_DIVIDED {
            SUB
        } else {
            1
        };
        let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(side) - 0.5;
        let mut points: Vec<(f64, f64)> = lit()
            .flat_map(|(i, &value)| {
                let middle = from_centroid(i);
                (0..side * side).map(move |k| {
                    let within = DVec2::new(offset(k % side), offset(k / side));
                    let at = middle + within * self.pitch_mm;
                    (at.length(), value / f64::from(side * side))
                })
            })
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut share = 0.0;
        for point in &mut points {
            share += point.1 / sum;
            point.1 = share;
        }
        points
    }

    fn modulation(&self, values: &[f64], per_mm: f64, sum: f64) -> Modulation {
        let along = |axis: usize| {
            let wave = values.iter().enumerate().map(|(i, v)| {
                let phase = TAU * per_mm * self.to_mm(self.pixel(i))[axis];
                *v * DVec2::from_angle(phase)
            });
            let own = PI * per_mm * self.pitch_mm[axis];
            let own = if own == 0.0 { 1.0 } else { own.sin() / own };
            wave.sum::<DVec2>().length() / (sum * own.abs())
        };
        Modulation {
            per_mm,
            contrast: [along(0), along(1)],
        }
    }
}

/// At most about 200 points of a curve, the last among them.
fn thinned(curve: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let step = curve.len().div_ceil(200).max(1);
    let picked = curve.iter().step_by(step).chain(curve.last());
    picked.copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::exr::{Channel, ImageMetadata};

    const SIDE: u32 = 120;
    const PITCH_MM: f64 = 0.002;

    /// An image of Y whose pixels hold the mean of a function of millimeters over 8 x 8 points.
    fn image(of: impl Fn(DVec2) -> f64) -> ExrImage {
        let value = |i: u32| {
            let corner = DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE));
            let points = (0..64).map(|k| {
                let within = (DVec2::new(f64::from(k % 8), f64::from(k / 8)) + 0.5) / 8.0;
                let at = corner + within - 0.5 * f64::from(SIDE);
                of(at * PITCH_MM * DVec2::new(1.0, -1.0))
            });
            (points.sum::<f64>() / 64.0) as f32
        };
        let text = |name: &str, text: &str| (name.to_owned(), MetadataValue::Text(text.to_owned()));
        ExrImage {
            width: SIDE,
            height: SIDE,
            crop: Crop::whole(SIDE, SIDE),
            channels: vec![Channel {
                name: "Y".to_owned(),
                values: (0..SIDE * SIDE).map(value).collect(),
            }],
            metadata: ImageMetadata {
                entries: vec![
                    text(PIXEL_PITCH, "0.000002 x 0.000002 m"),
                    text("unit", "photometric irradiance in lx, 683 lm/W"),
                ],
            },
        }
    }

    fn spot(image: &ExrImage, request: &SpotRequest) -> Spot {
        let found = measure(Path::new("image.exr"), image, request);
        found.unwrap_or_else(|e| panic!("{e}")).spots.remove(0)
    }

    fn assert_near(what: &str, found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found - expected).abs() <= tolerance,
            "{what}: {found}, expected {expected} within {tolerance}"
        );
    }

    /// A uniform disk: rms R/√2, half of the energy within R/√2, transfer 2 J₁(2πfR)/(2πfR).
    #[test]
    fn uniform_disk() {
        let (center, radius) = (DVec2::new(0.0123, -0.0231), 0.05);
        let image = image(|p| f64::from(u8::from(p.distance(center) <= radius)));
        let request = SpotRequest {
            frequencies: vec![2.0, 5.0],
            ..SpotRequest::default()
        };
        let found = spot(&image, &request);
        // 490 000 points at most at a border of 1250: 1e-3 of the area at the very most
        assert_near("power", found.power, PI * 2.5e-9, 1e-3 * PI * 2.5e-9);
        assert_near("x", found.centroid_mm.x, center.x, 1e-4 * radius);
        assert_near("y", found.centroid_mm.y, center.y, 1e-4 * radius);
        assert_near(
            "rms",
            found.rms_radius_mm(),
            radius / 2f64.sqrt(),
            1e-3 * radius,
        );
        let half = radius * 0.5f64.sqrt();
        assert_near("half", found.encircled_mm[0], half, 5e-3 * radius);
        // J₁(0.2 π) and J₁(0.5 π) by the series of Abramowitz and Stegun, 9.1.10
        for (m, bessel) in found.modulation.iter().zip([0.298_909, 0.566_824]) {
            let x = TAU * m.per_mm * radius;
            for contrast in m.contrast {
                assert_near("transfer", contrast, (2.0 * bessel / x).abs(), 1e-3);
            }
        }
    }

    /// An elliptic Gaussian on a background, in a window: σ of each axis, and its transfer
    /// exp(-2π²σ²f²).
    #[test]
    fn gaussian_on_a_background() {
        let sigma = DVec2::new(0.008, 0.005);
        let center = DVec2::new(0.03, 0.02);
        let image = image(|p| 7.0 * (-0.5 * ((p - center) / sigma).length_squared()).exp() + 0.5);
        let request = SpotRequest {
            window: Some(Crop {
                x0: 47,
                y0: 24,
                x1: 103,
                y1: 76,
            }),
            background: true,
            frequencies: vec![10.0, 25.0],
        };
        let found = spot(&image, &request);
        assert_near("x", found.centroid_mm.x, center.x, 1e-5);
        assert_near("y", found.centroid_mm.y, center.y, 1e-5);
        assert_near("sigma x", found.rms_mm.x, sigma.x, 1e-5);
        assert_near("sigma y", found.rms_mm.y, sigma.y, 1e-5);
        let power = 7.0 * TAU * sigma.x * sigma.y * 1e-6;
        assert_near("power", found.power, power, 1e-3 * power);
        for m in &found.modulation {
            for (axis, contrast) in m.contrast.into_iter().enumerate() {
                let expected = (-2.0 * (PI * sigma[axis] * m.per_mm).powi(2)).exp();
                assert_near("transfer", contrast, expected, 1e-3);
            }
        }
        // without the background the window is what is measured
        let all = SpotRequest {
            background: false,
            ..request
        };
        assert!(spot(&image, &all).rms_mm.x > 1.3 * sigma.x);
    }

    #[test]
    fn what_cannot_be_measured_is_named() {
        let dark = image(|_| 0.0);
        let fault = |image: &ExrImage, request: &SpotRequest| {
            let found = measure(Path::new("image.exr"), image, request);
            found.map(|_| ()).expect_err("refused").to_string()
        };
        let all = SpotRequest::default();
        assert_eq!(
            fault(&dark, &all),
            "image.exr: there is no light in the window"
        );
        let mut camera = dark.clone();
        camera.metadata.entries.clear();
        assert!(fault(&camera, &all).contains("no image of a detector"));
        let window = Some(Crop::whole(SIDE + 1, 3));
        let wide = SpotRequest { window, ..all };
        assert!(fault(&dark, &wide).contains("beyond an image of 120 x 120 pixels"));
        let fine = SpotRequest {
            frequencies: vec![300.0],
            ..SpotRequest::default()
        };
        assert!(fault(&dark, &fine).contains("up to 250"));
    }
}
