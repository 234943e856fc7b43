//! The images a render writes: XYZ with its extra layers, the spectral image, the preview, the part file.
//!
//! The image is made from the film and a part header alone, so that merged parts and whole renders give the same bytes.

use super::CliError;
use super::args::Aov;
use crate::film::Film;
use crate::io::exr::{
    Channel, ExrImage, ImageMetadata, MetadataValue, spectral_channel_name, xyz_channels,
};
use crate::io::part::{Part, PartHeader};
use crate::io::{exr, part, png};
use crate::render::Render;
use crate::render::bias::bias_image;
use crate::render::guides::{Guide, guides};
use crate::scene::Scene;
use crate::spectrum::xyz::xyz_to_linear_srgb;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;

/// The XYZ image of a film.
#[must_use]
pub fn xyz_image(film: &Film, header: &PartHeader) -> ExrImage {
    ExrImage {
        width: header.width,
        height: header.height,
        crop: header.crop(),
        channels: xyz_channels(&film.image(header.pass_count())),
        metadata: metadata(header),
    }
}

/// What the image says about itself.
fn metadata(header: &PartHeader) -> ImageMetadata {
    let text = |name: &str, value: String| (name.to_owned(), MetadataValue::Text(value));
    let one_seed = header
        .passes
        .iter()
        .all(|p| p.seed == header.passes[0].seed);
    let ranges = header.passes.iter().map(|p| {
        let seed = if one_seed {
            String::new()
        } else {
            format!("{}:", p.seed)
        };
        format!("{seed}{}..{}", p.start, p.end)
    });
    let mut seeds: Vec<String> = header.passes.iter().map(|p| p.seed.to_string()).collect();
    seeds.dedup();
    let mut entries = vec![
        text("abbeVersion", header.version.clone()),
        text("sceneHash", format!("{:016x}", header.scene_hash)),
        text("sensor", header.sensor.clone()),
        text("passes", ranges.collect::<Vec<_>>().join(",")),
        text("seed", seeds.join(",")),
    ];
    entries.extend(
        header
            .image
            .iter()
            .map(|(name, value)| text(name, value.clone())),
    );
    ImageMetadata { entries }
}

/// Writes an XYZ image and, where a path is given, its preview.
///
/// # Errors
/// Where a file cannot be written; the other is then untouched or new.
pub fn write_image(
    path: &Path,
    image: &ExrImage,
    preview: Option<&Path>,
    exposure_ev: f64,
) -> Result<(), CliError> {
    exr::write(path, image)?;
    let Some(preview) = preview else {
        return Ok(());
    };
    let xyz = image.xyz().unwrap_or_default();
    let size = (image.crop.x1 - image.crop.x0, image.crop.y1 - image.crop.y0);
    Ok(png::write_preview(
        preview,
        size.0,
        size.1,
        &xyz,
        exposure_ev,
        xyz_to_linear_srgb,
    )?)
}

/// The preview beside an image.
#[must_use]
pub fn preview_path(image: &Path) -> PathBuf {
    image.with_extension("png")
}

/// The film that a part holds.
///
/// # Errors
/// Where the sums do not fit the header.
pub fn film_of(part: &Part) -> Result<Film, CliError> {
    let header = &part.header;
    // nothing is splatted any more: the filter does not matter
    let mut film = Film::new(
        header.crop(),
        crate::film::Filter::Box,
        header.channels as usize,
    );
    film.add_sums(&part.sums)?;
    Ok(film)
}

/// Writes the sums of a render.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_part(path: &Path, film: &Film, header: PartHeader) -> Result<(), CliError> {
    Ok(part::write(
        path,
        &Part {
            header,
            sums: film.sums(),
        },
    )?)
}

/// Adds the extra layers asked for to an XYZ image.
pub fn add_layers(image: &mut ExrImage, aov: &[Aov], render: &Render, guides: &[Guide]) {
    let passes = render.passes().len() as u64;
    let mut classes = render.outputs().classes.iter();
    let mut class_count = 0;
    for layer in aov {
        let channels = &mut image.channels;
        match layer {
            Aov::Error => {
                let [even, odd] = render.pass_counts();
                // unknown while one half has no passes
                let errors = render.outputs().image.standard_error(1, even, odd);
                let errors =
                    errors.unwrap_or_else(|| vec![f64::INFINITY; render.crop().pixels() as usize]);
                channels.push(channel("error.Y", errors.iter().copied()));
            }
            Aov::Strategies => {
                let Some(films) = &render.outputs().strategies else {
                    continue;
                };
                // a poisoned lock means that a render thread has panicked, and so has this one
                for ((s, t, merged), film) in
                    films.read().unwrap_or_else(PoisonError::into_inner).iter()
                {
                    let mark = if *merged { "merged" } else { "" };
                    channels.extend(layer_channels(&format!("s{s}t{t}{mark}"), film, passes));
                }
            }
            Aov::Unbiased | Aov::Regularized => {
                let Some([unbiased, regularized]) = &render.outputs().shares else {
                    continue;
                };
                channels.extend(if matches!(layer, Aov::Unbiased) {
                    layer_channels("unbiased", unbiased, passes)
                } else {
                    layer_channels("regularized", regularized, passes)
                });
            }
            Aov::Bias => {
                let [even, odd] = render.pass_counts();
                // unknown while one half has no passes
                let bias = bias_image(&render.outputs().image, even, odd)
                    .unwrap_or_else(|| vec![f64::INFINITY; render.crop().pixels() as usize]);
                channels.push(channel("bias.Y", bias.iter().copied()));
            }
            Aov::Depth => channels.push(channel("depth.Z", guides.iter().map(|g| g.depth))),
            Aov::Normal => {
                for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                    channels.push(channel(
                        &format!("normal.{axis}"),
                        guides.iter().map(|g| g.normal[i]),
                    ));
                }
            }
            Aov::Albedo => {
                for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                    channels.push(channel(
                        &format!("albedo.{axis}"),
                        guides.iter().map(|g| g.albedo[i]),
                    ));
                }
            }
            Aov::Class(_) => {
                let Some((regex, film)) = classes.next() else {
                    continue;
                };
                let name = format!("class{class_count}");
                class_count += 1;
                channels.extend(layer_channels(&name, film, passes));
                image
                    .metadata
                    .entries
                    .push((name, MetadataValue::Text(regex.to_string())));
            }
        }
    }
}

/// First hits, where a layer needs them.
#[must_use]
pub fn guides_for(aov: &[Aov], scene: &Scene, sensor: usize, render: &Render) -> Vec<Guide> {
    let needed = aov
        .iter()
        .any(|a| matches!(a, Aov::Depth | Aov::Normal | Aov::Albedo));
    if needed {
        guides(scene, sensor, &render.crop())
    } else {
        Vec::new()
    }
}

fn channel(name: &str, values: impl Iterator<Item = f64>) -> Channel {
    Channel {
        name: name.to_owned(),
        values: values.map(|v| v as f32).collect(),
    }
}

fn layer_channels(layer: &str, film: &Film, passes: u64) -> Vec<Channel> {
    let mut channels = xyz_channels(&film.image(passes));
    for channel in &mut channels {
        channel.name = format!("{layer}.{}", channel.name);
    }
    channels
}

/// The spectral image; `None` where none was kept. Bins hold the mean per nanometer, lines (layer `line`) their power.
#[must_use]
pub fn spectral_image(render: &Render, header: &PartHeader) -> Option<ExrImage> {
    let (spectral, film) = render.outputs().spectral.as_ref()?;
    let bins = spectral.bin_centers_nm().map(spectral_channel_name);
    let lines = spectral
        .lines_nm()
        .iter()
        .map(|nm| format!("line.{}", spectral_channel_name(*nm)));
    let values = film.image(header.pass_count());
    let count = film.channels();
    let channels = bins
        .chain(lines)
        .enumerate()
        .map(|(c, name)| channel(&name, values.iter().skip(c).step_by(count).copied()));
    let mut metadata = metadata(header);
    // readers know a spectral image by these two; per nanometer is understood
    for (name, value) in [
        ("spectralLayoutVersion", "1.0"),
        ("emissiveUnits", "W.m^-2.sr^-1"),
    ] {
        let value = MetadataValue::Text(value.to_owned());
        metadata.entries.push((name.to_owned(), value));
    }
    // the one unit that the response has, whatever that of the XYZ image
    metadata.entries.retain(|(name, _)| name != "unit");
    Some(ExrImage {
        width: header.width,
        height: header.height,
        crop: header.crop(),
        channels: channels.collect(),
        metadata,
    })
}
