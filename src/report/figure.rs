//! An image as a figure for print: the picture with its scale, values along a row and a column, and
//! the flux where the image is a detector's.

use super::html::png_url;
use super::svg::{self, Axis, Diagram, color};
use crate::io::exr::{ExrImage, MetadataValue};
use crate::io::identity::{self, PIXEL_ANGLE, PIXEL_PITCH};
use crate::spectrum::SensorResponse;
use glam::DVec2;
use std::fmt::Write as _;

/// Longest side of the picture, pixels of the drawing.
const SIDE: f64 = 420.0;
/// Corner of the picture.
const CORNER: DVec2 = DVec2::new(24.0, 44.0);
/// Distance from the picture to the diagram, which the numbers of its axis stand in.
const GAP: f64 = 96.0;
/// Size of the diagram.
const DIAGRAM: DVec2 = DVec2::new(400.0, 260.0);
/// Share of the picture's width that its scale has at most.
const SCALE_SHARE: f64 = 0.3;

/// The figure of an image, or of a layer of it with these interleaved XYZ values, as SVG: its
/// picture, which is given as PNG, and values along the row and the column of `at`, a pixel of the
/// film, or of the centroid of the light.
///
/// # Errors
/// Where `at` is not on the image: what is wrong.
pub fn figure(
    image: &ExrImage,
    xyz: &[f64],
    png: &[u8],
    title: &str,
    at: Option<[u32; 2]>,
) -> Result<String, String> {
    let (width, height) = (image.crop.width(), image.crop.height());
    let unit = Unit::of(image);
    let y: Vec<f64> = xyz.chunks(3).map(|v| unit.scale * v[1]).collect();
    let [column, row] = match at {
        Some(at) => on_image(image, at)?,
        None => centroid(&y, [width, height]),
    };
    let pixel = unit.pixel;
    let across = DVec2::new(f64::from(width) * pixel.x, f64::from(height) * pixel.y);
    let size = SIDE / across.max_element() * across;
    let diagram_at = DVec2::new(CORNER.x + size.x + GAP, CORNER.y);
    let lines = flux(image);
    let lower = (CORNER.y + size.y + 40.0).max(diagram_at.y + DIAGRAM.y + 84.0);
    let total = DVec2::new(
        diagram_at.x + DIAGRAM.x + 24.0,
        lower + 20.0 * lines.len() as f64 + 12.0,
    );
    let mut svg = svg::titled(total.x, total.y, title);
    _ = writeln!(
        svg,
        r#"<image x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}" preserveAspectRatio="none" style="image-rendering:pixelated" href="{}"/>"#,
        CORNER.x,
        CORNER.y,
        size.x,
        size.y,
        png_url(png)
    );
    svg += &svg::frame(CORNER, size);
    let place = CORNER
        + size
            * DVec2::new(
                (f64::from(column) + 0.5) / f64::from(width),
                (f64::from(row) + 0.5) / f64::from(height),
            );
    svg += &marks(place, size);
    svg += &scale(
        size.x / across.x,
        across.x,
        unit.length,
        CORNER + size.with_x(0.0),
    );
    let section = Sections {
        y: &y,
        width: width as usize,
        at: [column as usize, row as usize],
        pixel,
    };
    svg += &section.diagram(diagram_at, &unit, [image.crop.x0, image.crop.y0]);
    for (i, line) in lines.iter().enumerate() {
        let at = DVec2::new(CORNER.x, lower + 20.0 * i as f64);
        _ = writeln!(svg, "{}", svg::text(at, "start", line));
    }
    Ok(svg + "</svg>\n")
}

/// Units of the values and lengths of an image.
struct Unit {
    /// Of Y.
    name: &'static str,
    /// Value in the unit over that of the channel.
    scale: f64,
    /// Width and height of a pixel.
    pixel: DVec2,
    /// Of the pixel.
    length: &'static str,
}

impl Unit {
    fn of(image: &ExrImage) -> Self {
        let text = |name| match image.metadata.get(name) {
            Some(MetadataValue::Text(text)) => Some(text.as_str()),
            _ => None,
        };
        let response = text(identity::UNIT).map_or(SensorResponse::Xyz, identity::response_of_unit);
        let pitch = text(PIXEL_PITCH).and_then(identity::pitch_of_text);
        let angle = text(PIXEL_ANGLE).and_then(identity::angle_of_text);
        let (pixel, length) = match (pitch, angle) {
            (Some(pitch), _) => (1e3 * DVec2::from_array(pitch), "mm"),
            (None, Some(angle)) => (DVec2::from_array(angle), "degrees"),
            (None, None) => (DVec2::ONE, "pixels"),
        };
        Self {
            name: identity::photometric_unit(text(identity::UNIT).unwrap_or_default()),
            scale: response.photometric_unit(),
            pixel,
            length,
        }
    }
}

/// Column and row in the image of a pixel of the film.
fn on_image(image: &ExrImage, [x, y]: [u32; 2]) -> Result<[u32; 2], String> {
    let [left, top] = [image.crop.x0, image.crop.y0];
    let (width, height) = (image.crop.width(), image.crop.height());
    let place = [x.checked_sub(left), y.checked_sub(top)];
    match place {
        [Some(column), Some(row)] if column < width && row < height => Ok([column, row]),
        _ => Err(format!(
            "has no pixel {x},{y} (allowed: {left},{top} to {},{})",
            left + width - 1,
            top + height - 1
        )),
    }
}

/// The pixel at the mean place of the light; the middle where there is none.
fn centroid(y: &[f64], [width, height]: [u32; 2]) -> [u32; 2] {
    let (mut sum, mut place) = (0.0, DVec2::ZERO);
    for (i, value) in y.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        let (column, row) = (i % width as usize, i / width as usize);
        place += *value * DVec2::new(column as f64, row as f64);
        sum += value;
    }
    let middle = [width / 2, height / 2];
    if sum > 0.0 && sum.is_finite() {
        let place = (place / sum).round();
        [
            (place.x as u32).min(width - 1),
            (place.y as u32).min(height - 1),
        ]
    } else {
        middle
    }
}

/// Short lines outside of the picture at the row and the column of the diagram.
fn marks(place: DVec2, size: DVec2) -> String {
    let (DVec2 { x, y }, end) = (place, CORNER + size);
    let (left, top) = (CORNER.x - 10.0, CORNER.y - 10.0);
    format!(
        "<path d=\"M{left:.1} {y:.1}h8M{:.1} {y:.1}h8\" stroke=\"{}\" stroke-width=\"2\"/>\n\
         <path d=\"M{x:.1} {top:.1}v8M{x:.1} {:.1}v8\" stroke=\"{}\" stroke-width=\"2\"/>\n",
        end.x + 2.0,
        color(0),
        end.y + 2.0,
        color(1)
    )
}

/// A bar of a round length below the picture, at `pixels` of the drawing for each unit of length.
fn scale(pixels: f64, width: f64, unit: &str, below: DVec2) -> String {
    let length = svg::round_down(SCALE_SHARE * width);
    let at = below + DVec2::new(0.0, 20.0);
    let end = at.x + length * pixels;
    format!(
        "<path d=\"M{:.1} {:.1}v8M{:.1} {:.1}H{end:.1}M{end:.1} {:.1}v8\" stroke=\"#333\" \
         stroke-width=\"2\" fill=\"none\"/>{}\n",
        at.x,
        at.y - 4.0,
        at.x,
        at.y,
        at.y - 4.0,
        svg::text(
            DVec2::new(end + 8.0, at.y + 4.5),
            "start",
            &format!("{} {unit}", svg::number(length))
        )
    )
}

/// Values along a row and a column.
struct Sections<'a> {
    y: &'a [f64],
    width: usize,
    at: [usize; 2],
    pixel: DVec2,
}

impl Sections<'_> {
    fn diagram(&self, corner: DVec2, unit: &Unit, origin: [u32; 2]) -> String {
        let [column, row] = self.at;
        let along = |values: &mut dyn Iterator<Item = f64>, step: f64| -> Vec<DVec2> {
            let values: Vec<f64> = values.collect();
            let middle = 0.5 * values.len() as f64;
            let place = |(i, value)| DVec2::new((i as f64 + 0.5 - middle) * step, value);
            values.into_iter().enumerate().map(place).collect()
        };
        let rows = self.y.chunks(self.width);
        let in_row = self.y[row * self.width..][..self.width].iter().copied();
        let curves = [
            along(&mut in_row.into_iter(), self.pixel.x),
            along(&mut rows.map(|r| r[column]), self.pixel.y),
        ];
        let all = || curves.iter().flatten();
        let reach = all().fold(0.0, |most: f64, p| most.max(p.x.abs()));
        let most = all().fold(0.0, |most: f64, p| most.max(p.y));
        let diagram = Diagram {
            corner,
            size: DIAGRAM,
            x: Axis {
                low: -reach,
                high: reach,
                log: false,
            },
            y: Axis::up_to(if most > 0.0 { 1.05 * most } else { 1.0 }),
        };
        let along = format!("{} from the middle", unit.length);
        let mut svg = diagram.grid(&along, unit.name, 64.0);
        svg += &svg::frame(corner, DIAGRAM);
        let [left, top] = origin.map(|o| o as usize);
        let names = [
            format!("row {}, from left to right", top + row),
            format!("column {}, from top to bottom", left + column),
        ];
        for (i, (points, name)) in curves.iter().zip(&names).enumerate() {
            let style = format!("stroke=\"{}\" stroke-width=\"1.5\"", color(i));
            svg += &diagram.line(points.iter().copied(), &style);
            let at = corner + DVec2::new(8.0 + 200.0 * i as f64, DIAGRAM.y + 62.0);
            svg += &svg::key(&svg::dot(i, at), at, name);
        }
        svg
    }
}

/// The attributes with flux, as lines of text.
fn flux(image: &ExrImage) -> Vec<String> {
    let entries = image.metadata.entries.iter();
    let told = entries.filter_map(|(name, value)| {
        let of = name.strip_prefix("flux")?;
        let MetadataValue::Text(text) = value else {
            return None;
        };
        let of = of
            .strip_prefix(':')
            .map_or_else(String::new, |of| format!(" of {of}"));
        Some(format!("flux{of}: {}", shortened(text)))
    });
    told.collect()
}

/// A text that begins with a number of many digits, with five of them.
fn shortened(text: &str) -> String {
    let number = text.split_once(' ').and_then(|(number, rest)| {
        let value: f64 = number.parse().ok()?;
        let value: f64 = format!("{value:.4e}").parse().ok()?;
        Some(format!("{} {rest}", svg::number(value)))
    });
    number.unwrap_or_else(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Crop;
    use crate::io::exr::{Channel, ImageMetadata};

    fn image(metadata: &[(&str, &str)]) -> ExrImage {
        // light in the third column of the second row, which is 30 x 20 of the film
        let values = |v: f32| (0..12).map(|i| if i == 6 { v } else { 0.0 }).collect();
        let channel = |name: &str, v| Channel {
            name: name.to_owned(),
            values: values(v),
        };
        let text = |(name, value): &(&str, &str)| {
            ((*name).to_owned(), MetadataValue::Text((*value).to_owned()))
        };
        ExrImage {
            width: 64,
            height: 48,
            crop: Crop {
                x0: 28,
                y0: 19,
                x1: 32,
                y1: 22,
            },
            channels: vec![channel("X", 1.0), channel("Y", 2.0), channel("Z", 3.0)],
            metadata: ImageMetadata {
                entries: metadata.iter().map(text).collect(),
            },
        }
    }

    #[test]
    fn a_detector_has_millimeters_lux_and_flux() {
        let image = image(&[
            ("sensorKind", "detector"),
            ("pixelPitch", "0.001 x 0.002 m"),
            ("unit", "photometric irradiance in lx, 683 lm/W"),
            ("flux", "4.0000123456e-6 lm, standard error 1e-7 lm"),
            ("flux:<b>", "3e-6 lm"),
        ]);
        let xyz = image.xyz().expect("there");
        let svg = figure(&image, &xyz, b"", "a <spot>", None).expect("drawn");
        for part in [
            "a &lt;spot&gt;",
            "row 20, from left to right",
            "column 30, from top to bottom",
            "mm from the middle",
            ">lx<",
            ">1 mm<",
            "flux: 4e-6 lm, standard error 1e-7 lm",
            "flux of &lt;b&gt;: 3e-6 lm",
        ] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        // four columns of 1 mm beside three rows of 2 mm
        assert!(svg.contains(r#"width="280.0" height="420.0""#), "{svg}");
        let places = svg.matches("<polyline").count();
        assert_eq!(places, 2, "{svg}");
    }

    #[test]
    fn a_detector_over_directions_has_degrees_and_candela() {
        let image = image(&[
            ("pixelAngle", "0.5 x 0.25 deg"),
            ("unit", "photometric intensity in cd, 683 lm/W"),
        ]);
        let svg = figure(&image, &[1.0; 36], b"", "", None).expect("drawn");
        assert!(
            svg.contains("degrees from the middle") && svg.contains(">cd<"),
            "{svg}"
        );
    }

    #[test]
    fn a_pixel_that_is_not_there_is_told() {
        let image = image(&[]);
        let draw = |at| figure(&image, &[0.0; 36], b"", "", Some(at));
        assert!(draw([28, 19]).is_ok_and(|svg| svg.contains("pixels from the middle")));
        let message = "has no pixel 32,19 (allowed: 28,19 to 31,21)";
        assert_eq!(draw([32, 19]).err().as_deref(), Some(message));
        assert!(draw([0, 0]).is_err());
    }
}
