//! Spectra: one source, values fit for their use.

use super::document::Node;
use super::keys::{FINITE, Form, Keys, NON_NEGATIVE, POSITIVE, Range, Spec, Table, Value, keys};
use super::reader::{Reader, definitions};
use super::texture::Texture;
use super::value::{At, FileName, SpectrumName, number};
use crate::spectrum::coverage::held_stretches;
use crate::spectrum::emission::Line;
use crate::spectrum::{Curve, Emission, upsample};
use crate::texture::{ImageTexture, SpectrumTexture};
use std::ops::Range as Span;
use toml::de::DeValue;

const TEMPERATURE: Range = Range::closed(100.0, 1e6, "100 to 1e6 kelvin");

const BAND: Range = Range::closed(100.0, 20_000.0, "100 to 20000 nm");

/// Largest value of an emission: its products along a path stay far below what lanes can hold.
const MOST_EMISSION: f64 = 1e30;

/// Where the values of a spectrum come from.
#[derive(Clone, Debug)]
enum Source {
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
    /// 1 from the first wavelength to the second, nm, ascending.
    Band([f64; 2]),
    /// An image over the surface.
    Texture(Texture<true>),
}

/// A spectrum whose use is not known yet.
#[derive(Clone, Debug)]
pub struct Spectrum {
    source: Source,
    scale: f64,
    /// Y that it is scaled to, instead of by `scale`.
    luminance: Option<f64>,
    /// End values of a table may be held over any part of the working range.
    extrapolate: bool,
    /// Where it is used.
    at: Span<usize>,
}

keys! {
    /// A spectrum by exactly one of the first eight keys.
    SpectrumKeys = "spectrum" {
        /// The same value at all wavelengths.
        value: Option<f64>, in NON_NEGATIVE;
        /// A color, in linear sRGB.
        rgb: Option<[f64; 3]>, in NON_NEGATIVE;
        /// Name of the library.
        name: Option<SpectrumName>;
        /// CSV of `nm,value`, nm > 0, value >= 0; linear in between. End values are held beyond,
        /// over at most a tenth of the working range as the eye weights it.
        file: Option<At<FileName>>;
        /// Temperature of a blackbody: radiance by Planck's law, W/(m² sr nm).
        blackbody_k: Option<f64>, in TEMPERATURE, unit "kelvin";
        /// Emission lines [nm, power], no wavelength twice; power >= 0 in the unit of the use
        /// without the "per nm".
        lines: Option<At<Vec<[f64; 2]>>>;
        /// A flat band [from, to]: 1 at these wavelengths, 0 at all others.
        band_nm: Option<At<[f64; 2]>>, in BAND, unit "nm";
        /// An image over the surface; on materials and on `emission` of objects.
        texture: Option<Texture<true>>;
        /// Of a `file`: hold its end values over any part of the working range.
        extrapolate: bool, default false;
        /// Factor on the values.
        scale: Option<f64>, in NON_NEGATIVE, or "1";
        /// Of emission: scaled to this Y instead of by `scale` (unit equal-energy radiance has 1).
        luminance: Option<f64>, in NON_NEGATIVE;
    }
}

/// Kinds of value that may stand for a spectrum.
fn spectrum_form() -> Form {
    Form::Any(vec![
        f64::form(),
        <[f64; 3]>::form(),
        Form::Text("a `[spectrum.NAME]` or a spectrum of the library"),
        Form::Table(SpectrumKeys::KIND),
    ])
}

impl Spectrum {
    /// A spectrum where one is used.
    fn used(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        if let DeValue::String(name) = node.get_ref()
            && let Some(defined) = cx.spectra.get(name.as_ref())
        {
            // a definition that could not be read has been reported already
            return Some(Self {
                at: node.span(),
                ..defined.clone()?
            });
        }
        Self::defined(node, spec, cx)
    }

    /// A spectrum where it is defined.
    pub fn defined(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let before = cx.error_count();
        let spec = Spec {
            range: Some(NON_NEGATIVE),
            ..spec
        };
        let plain = |source| Self {
            source,
            scale: 1.0,
            luminance: None,
            extrapolate: false,
            at: node.span(),
        };
        let spectrum = match node.get_ref() {
            DeValue::Array(_) => <[f64; 3]>::read(node, spec, cx).map(Source::Rgb).map(plain),
            DeValue::String(name) => Some(plain(Source::Library(name.to_string()))),
            DeValue::Table(_) => {
                let table = Table::of(node, SpectrumKeys::NAMES, cx)?;
                SpectrumKeys::from_table(&table, cx)?.spectrum(&table, cx)
            }
            _ => {
                let expected = "a spectrum: a number, [r, g, b], a name or a table";
                number(node, spec, expected, cx)
                    .map(Source::Constant)
                    .map(plain)
            }
        };
        spectrum.filter(|_| cx.error_count() == before)
    }

    fn conflict(&self, message: impl Into<String>, cx: &mut Reader<'_>) {
        cx.conflict(&self.at, message);
    }

    /// Fault that no reflectance, transmittance or coefficient may have.
    fn check_no_emission(&self, what: &str, cx: &mut Reader<'_>) {
        if matches!(self.source, Source::Lines(_) | Source::Blackbody(_)) {
            self.conflict(
                format!("{what} cannot be a spectrum of lines or a blackbody (these are emission)"),
                cx,
            );
        }
        if self.luminance.is_some() {
            let message = format!("{what} has no luminance (luminance scales emission)");
            self.conflict(message, cx);
        }
    }

    /// An image is for materials and objects, and has no luminance.
    fn check_texture(&self, what: &str, allowed: bool, cx: &mut Reader<'_>) {
        if !matches!(self.source, Source::Texture(_)) {
            return;
        }
        if !allowed {
            self.conflict(
                format!("{what} cannot be a texture (allowed on materials and on the emission of objects)"),
                cx,
            );
        }
        if self.luminance.is_some() {
            self.conflict("a texture has no luminance of its own (use scale)", cx);
        }
    }

    /// The values as they are, for all but lines and images.
    fn curve(&self, cx: &mut Reader<'_>) -> Option<Curve> {
        let curve = match &self.source {
            Source::Constant(value) => Curve::Constant(*value),
            Source::Rgb(rgb) => upsample::reflectance(*rgb),
            Source::Library(name) => match cx.library.curve(name) {
                Ok(curve) => curve,
                Err(error) => {
                    cx.not_in_library(&self.at, error);
                    return None;
                }
            },
            Source::Table(rows) => {
                let nm: Vec<f64> = rows.iter().map(|r| r[0]).collect();
                let values: Vec<f64> = rows.iter().map(|r| r[1]).collect();
                let curve = Curve::table(&nm, &values);
                let held = cx
                    .range_nm
                    .map(|range_nm| held_stretches(&curve, range_nm, self.extrapolate));
                if let Some(Err(error)) = held {
                    self.conflict(error.to_string(), cx);
                    return None;
                }
                curve
            }
            Source::Blackbody(temp_k) => Curve::Blackbody {
                temp_k: *temp_k,
                scale: 1.0,
            },
            // its edges are as steep as wavelengths can be told apart
            Source::Band([low, high]) => Curve::table(
                &[low.next_down(), *low, *high, high.next_up()],
                &[0.0, 1.0, 1.0, 0.0],
            ),
            Source::Lines(_) | Source::Texture(_) => return None,
        };
        Some(curve)
    }

    fn scaled_curve(&self, cx: &mut Reader<'_>) -> Option<Curve> {
        Some(match (self.curve(cx)?, self.scale) {
            (Curve::Constant(value), scale) => Curve::Constant(value * scale),
            (curve, 1.0) => curve,
            (curve, scale) => curve.scaled(scale),
        })
    }

    /// A curve within 0 and 1.
    fn fraction(&self, what: &str, cx: &mut Reader<'_>) -> Option<Curve> {
        let before = cx.error_count();
        self.check_no_emission(what, cx);
        let largest = match &self.source {
            Source::Constant(v) => *v,
            Source::Band(_) => 1.0,
            Source::Rgb(rgb) => rgb.iter().copied().fold(0.0, f64::max),
            Source::Table(rows) => rows.iter().map(|r| r[1]).fold(0.0, f64::max),
            // texels reach 1
            Source::Texture(_) => 1.0,
            // told below
            _ => 0.0,
        } * self.scale;
        if FINITE.contains(largest) && largest > 1.0 {
            cx.out_of_range(what, largest.to_string(), &self.at, "0 to 1");
        }
        let curve = self
            .scaled_curve(cx)
            .filter(|_| cx.error_count() == before)?;
        let largest = curve.bounds().1;
        if largest > 1.0 {
            let what = "the largest value of a reflectance or transmittance";
            cx.out_of_range(what, largest.to_string(), &self.at, "0 to 1");
        }
        Some(curve)
    }

    fn emission(&self, cx: &mut Reader<'_>) -> Option<Emission> {
        let emission = match &self.source {
            Source::Rgb(rgb) => Emission::from_rgb(*rgb),
            Source::Library(name) => match cx.library.emission(name) {
                Ok(emission) => emission,
                Err(error) => {
                    cx.not_in_library(&self.at, error);
                    return None;
                }
            },
            Source::Lines(rows) => Emission::from_lines(
                rows.iter()
                    .map(|&[lambda_nm, value]| Line { lambda_nm, value })
                    .collect(),
            ),
            _ => Emission::from_curve(self.curve(cx)?),
        };
        // before any integral of it, which would overflow
        self.check_emission(&emission, cx)?;
        let emission = match self.luminance {
            Some(y) => emission.with_luminance(y),
            None => emission.scaled(self.scale),
        };
        self.check_emission(&emission, cx)?;
        Some(emission)
    }

    fn check_emission(&self, emission: &Emission, cx: &mut Reader<'_>) -> Option<()> {
        let largest = emission.largest();
        if largest <= MOST_EMISSION {
            return Some(());
        }
        let what = "the largest value of an emission";
        cx.out_of_range(what, format!("{largest:e}"), &self.at, "0 to 1e30");
        None
    }
}

impl SpectrumKeys {
    fn spectrum(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Spectrum> {
        if self.luminance.is_some() && self.scale.is_some() {
            let message = "scale and luminance exclude each other";
            cx.conflict(&table.span("scale"), message);
        }
        let (scale, luminance) = (self.scale.unwrap_or(1.0), self.luminance);
        let extrapolate = self.extrapolate;
        table.exactly_one(&Self::NAMES[..8], "spectrum", cx)?;
        Some(Spectrum {
            source: self.source(cx)?,
            scale,
            luminance,
            extrapolate,
            at: table.at.clone(),
        })
    }

    fn source(self, cx: &mut Reader<'_>) -> Option<Source> {
        if let Some(file) = &self.file {
            return table_of(file, cx).map(Source::Table);
        }
        if let Some(lines) = self.lines {
            return Some(Source::Lines(sorted_lines(lines, cx)));
        }
        if let Some(At { value, at }) = self.band_nm {
            if value[0] >= value[1] {
                cx.conflict(&at, "band_nm is empty (allowed: [from, to] with from < to)");
                return None;
            }
            return Some(Source::Band(value));
        }
        let value = self.value.map(Source::Constant);
        let rgb = self.rgb.map(Source::Rgb);
        let name = self.name.map(|name| Source::Library(name.0));
        let blackbody = self.blackbody_k.map(Source::Blackbody);
        let texture = self.texture.map(Source::Texture);
        value.or(rgb).or(name).or(blackbody).or(texture)
    }
}

fn table_of(file: &At<FileName>, cx: &mut Reader<'_>) -> Option<Vec<[f64; 2]>> {
    let rows = cx.csv::<2>(file)?;
    if let Some([nm, value]) = rows.iter().find(|r| r[0] <= 0.0 || r[1] < 0.0) {
        let allowed = "(allowed: wavelengths > 0 in nm, values >= 0)";
        cx.bad_file(file, format!("row {nm}, {value} {allowed}"));
        return None;
    }
    Some(rows)
}

fn sorted_lines(lines: At<Vec<[f64; 2]>>, cx: &mut Reader<'_>) -> Vec<[f64; 2]> {
    let At { mut value, at } = lines;
    for &[nm, power] in &value {
        cx.in_range("wavelength of a line", nm, &at, POSITIVE);
        cx.in_range("power of a line", power, &at, NON_NEGATIVE);
    }
    value.sort_by(|a, b| a[0].total_cmp(&b[0]));
    if value.is_empty() {
        cx.conflict(&at, "lines is empty (allowed: a list of [nm, power])");
    }
    if let Some(pair) = value.windows(2).find(|p| p[0][0] == p[1][0]) {
        cx.conflict(&at, format!("line {} nm is given twice", pair[0][0]));
    }
    value
}

/// A reflectance or tint of a surface, within 0 and 1.
#[derive(Clone, Debug)]
pub struct Reflectance {
    /// The spectrum.
    pub value: SpectrumTexture,
    /// Where an image is named.
    pub image_at: Option<Span<usize>>,
}

impl Reflectance {
    /// The same at all wavelengths.
    pub fn constant(value: f64) -> Self {
        Self {
            value: Curve::Constant(value).into(),
            image_at: None,
        }
    }
}

impl Value for Reflectance {
    fn form() -> Form {
        spectrum_form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spectrum = Spectrum::used(node, spec, cx)?;
        spectrum.check_texture(spec.name, true, cx);
        let Source::Texture(image) = &spectrum.source else {
            let value = spectrum.fraction(spec.name, cx)?.into();
            return Some(Self {
                value,
                image_at: None,
            });
        };
        if spectrum.scale > 1.0 {
            let value = spectrum.scale.to_string();
            cx.out_of_range(spec.name, value, &spectrum.at, "0 to 1");
        } else {
            image.hold(spectrum.scale, 0..3, cx);
        }
        Some(Self {
            value: SpectrumTexture::Image {
                texture: image.texture.clone()?,
                factor: [spectrum.scale as f32; 3],
            },
            image_at: Some(image.file.at.clone()),
        })
    }

    fn show(&self) -> String {
        match &self.value {
            SpectrumTexture::Uniform(Curve::Constant(value)) => value.to_string(),
            _ => String::new(),
        }
    }
}

/// Share of light that is left in a medium, within 0 and 1.
#[derive(Clone, Debug)]
pub struct Transmittance(pub Curve);

impl Value for Transmittance {
    fn form() -> Form {
        spectrum_form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spectrum = Spectrum::used(node, spec, cx)?;
        spectrum.check_texture(spec.name, false, cx);
        spectrum.fraction(spec.name, cx).map(Self)
    }
}

/// Absorption in 1/m.
#[derive(Clone, Debug)]
pub struct Coefficient(pub Curve);

impl Value for Coefficient {
    fn form() -> Form {
        spectrum_form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spectrum = Spectrum::used(node, spec, cx)?;
        spectrum.check_texture(spec.name, false, cx);
        spectrum.check_no_emission(spec.name, cx);
        if matches!(spectrum.source, Source::Rgb(_)) {
            let message = format!("{} cannot be [r, g, b] (use color and distance)", spec.name);
            spectrum.conflict(message, cx);
        }
        spectrum.scaled_curve(cx).map(Self)
    }
}

/// Emission of a light that is no surface.
#[derive(Clone, Debug)]
pub struct Emitted(pub Emission);

impl Value for Emitted {
    fn form() -> Form {
        spectrum_form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spectrum = Spectrum::used(node, spec, cx)?;
        spectrum.check_texture(spec.name, false, cx);
        spectrum.emission(cx).map(Self)
    }
}

/// Emission of a surface.
#[derive(Clone, Debug)]
pub struct SurfaceEmission {
    /// The same over the surface.
    pub radiance: Emission,
    /// Factor over the surface.
    pub pattern: Option<SpectrumTexture>,
    /// Where an image is named.
    pub image_at: Option<Span<usize>>,
}

impl Value for SurfaceEmission {
    fn form() -> Form {
        spectrum_form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spectrum = Spectrum::used(node, spec, cx)?;
        spectrum.check_texture(spec.name, true, cx);
        let Source::Texture(image) = &spectrum.source else {
            return Some(Self {
                radiance: spectrum.emission(cx)?,
                pattern: None,
                image_at: None,
            });
        };
        let pattern = |texture: ImageTexture| SpectrumTexture::Image {
            texture,
            factor: [1.0; 3],
        };
        Some(Self {
            radiance: Emission::from_rgb([spectrum.scale; 3]),
            pattern: image.texture.clone().map(pattern),
            image_at: Some(image.file.at.clone()),
        })
    }
}

/// `[spectrum.NAME]`, which are known by name from then on.
#[derive(Debug)]
pub struct Spectra;

impl Value for Spectra {
    fn form() -> Form {
        Form::Map(Box::new(spectrum_form()))
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let spec = Spec {
            name: "spectrum",
            range: None,
        };
        // a name of the library here, whatever other definitions are called
        let defined = definitions(node, cx, |_, node, cx| Spectrum::defined(node, spec, cx))?;
        cx.spectra = defined;
        Some(Self)
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self)
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}
