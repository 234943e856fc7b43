//! Extra layers of an XYZ image: errors, strategies, classes of paths, first hits.

use super::exr::{Channel, ExrImage, MetadataValue, noise_channel, xyz_channels};
use super::image::flux_entry;
use super::loaded::Loaded;
use crate::film::Film;
use crate::render::bias::bias_image;
use crate::render::expression::{DIRECT, GHOSTS, PathExpression};
use crate::render::guides::{Guide, guides};
use crate::render::{OutputRequest, Render};
use std::str::FromStr;
use std::sync::PoisonError;

/// An extra layer of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Standard error of Y.
    Error,
    /// One sample of the standard error of each pixel, of Y and of all that is measured besides.
    Noise,
    /// One image per strategy (s, t).
    Strategies,
    /// Distance of the first hit.
    Depth,
    /// Shading normal of the first hit.
    Normal,
    /// Reflectance of the first hit.
    Albedo,
    /// Contributions joined at specular vertices.
    Regularized,
    /// All other contributions.
    Unbiased,
    /// Difference of the halves of a render with `bias_estimate`, as a bias.
    Bias,
    /// Paths that an expression over classes chooses ([`PathExpression`]).
    Class(String),
}

impl FromStr for Layer {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "error" => Self::Error,
            "noise" => Self::Noise,
            "strategies" => Self::Strategies,
            "depth" => Self::Depth,
            "normal" => Self::Normal,
            "albedo" => Self::Albedo,
            "regularized" => Self::Regularized,
            "unbiased" => Self::Unbiased,
            "bias" => Self::Bias,
            DIRECT | GHOSTS => Self::Class(text.to_owned()),
            _ => {
                let expression = text
                    .strip_prefix("class:")
                    .ok_or("expected error, noise, strategies, regularized, unbiased, bias, depth, normal, albedo, direct, ghosts or class:REGEX")?;
                PathExpression::check(expression)?;
                Self::Class(expression.to_owned())
            }
        })
    }
}

impl Layer {
    /// Name of the layer's channels, and what an attribute of the image says of them.
    fn meaning(&self) -> (&'static str, &'static str) {
        match self {
            Self::Error => (
                "error",
                "standard error of Y, in its unit; infinite while it is unknown",
            ),
            Self::Noise => (
                "noise",
                "difference of the two halves of the passes, scaled so that its square has the \
                 variance of the pixel as its mean; infinite while it is unknown",
            ),
            Self::Strategies => (
                "sNtM",
                "X, Y, Z of paths made with N vertices from the light and M from the sensor",
            ),
            Self::Depth => (
                "depth",
                "distance from the camera to the first hit along the ray through the pixel's \
                 center, in m, in the middle of the shutter; 0 where nothing is hit",
            ),
            Self::Normal => (
                "normal",
                "unit shading normal of the first hit in world space, in the middle of the \
                 shutter; 0, 0, 0 where nothing is hit",
            ),
            Self::Albedo => (
                "albedo",
                "X, Y, Z of the reflectance of the first hit under equal-energy light, in the \
                 middle of the shutter; 0, 0, 0 where nothing is hit",
            ),
            Self::Regularized => (
                "regularized",
                "X, Y, Z of strategies that join at specular surfaces",
            ),
            Self::Unbiased => (
                "unbiased",
                "X, Y, Z of strategies that do not join at specular surfaces",
            ),
            Self::Bias => (
                "bias",
                "estimated bias of Y by regularization, in its unit; infinite while it is unknown",
            ),
            Self::Class(_) => (
                "class",
                "X, Y, Z of paths whose class matches the expression of attribute classN",
            ),
        }
    }
}

/// Outputs that a render must keep for these layers, for a spectral image of `bins`, and for the
/// table of classes in its statistics.
///
/// # Errors
/// A layer is asked for twice, or an expression over classes names what the scene does not have.
pub fn request(
    loaded: &Loaded,
    layers: &[Layer],
    bins: Option<u16>,
    class_table: bool,
) -> Result<OutputRequest, String> {
    for (i, layer) in layers.iter().enumerate() {
        if layers[..i].contains(layer) {
            return Err(format!(
                "the layer {} is asked for twice",
                layer.meaning().0
            ));
        }
    }
    let spectral = bins.map(|bins| loaded.spectral_channels(bins));
    let class = |layer: &Layer| match layer {
        Layer::Class(source) => {
            let compiled = PathExpression::new(source, &loaded.scene);
            Some(compiled.map_err(|e| format!("layer class:{source}: {e}")))
        }
        _ => None,
    };
    let is_share = |l: &Layer| matches!(l, Layer::Unbiased | Layer::Regularized);
    Ok(OutputRequest {
        response: loaded.response(),
        spectral,
        strategies: layers.iter().any(|l| matches!(l, Layer::Strategies)),
        classes: layers.iter().filter_map(class).collect::<Result<_, _>>()?,
        shares: layers.iter().any(is_share),
        class_table,
    })
}

/// Requirements of layers that a render does not meet.
///
/// # Errors
/// A layer that needs another integrator, or another setting, than the render has.
pub fn check(layers: &[Layer], render: &Render) -> Result<(), &'static str> {
    let tells_bias = render.epsilon().is_some() && render.tells_bias();
    if layers.iter().any(|a| matches!(a, Layer::Bias)) && !tells_bias {
        return Err("the layer bias needs regularization and --set render.bias_estimate=true");
    }
    if layers.iter().any(|a| matches!(a, Layer::Noise)) && render.chains().is_some() {
        return Err(
            "the layer noise needs pixels that err independently, which those of pssmlt do not: \
             choose another integrator",
        );
    }
    let needs = |(expression, _): &(PathExpression, Film)| expression.needs_events();
    if render.radius().is_some() && render.outputs().classes.iter().any(needs) {
        return Err(
            "layers of paths by reflections and surfaces need an integrator without photons",
        );
    }
    Ok(())
}

fn strategy_name((s, t, mark): &(u32, u32, &str)) -> String {
    format!("s{s}t{t}{mark}")
}

/// Names of the layers of a render in its images. Those of strategies come as paths are met.
#[must_use]
pub fn names(layers: &[Layer], render: &Render) -> Vec<String> {
    let mut names = Vec::new();
    let mut class_count = 0;
    for layer in layers {
        match layer {
            Layer::Strategies => {
                if let Some(films) = &render.outputs().strategies {
                    let films = films.read().unwrap_or_else(PoisonError::into_inner);
                    names.extend(films.keys().map(strategy_name));
                }
            }
            Layer::Class(_) => {
                names.push(format!("class{class_count}"));
                class_count += 1;
            }
            _ => names.push(layer.meaning().0.to_owned()),
        }
    }
    names
}

/// Adds the extra layers asked for to an XYZ image.
pub fn add(image: &mut ExrImage, layers: &[Layer], render: &Render, guides: &[Guide]) {
    add_chosen(image, layers, render, guides, |_| true);
}

/// Adds those of the extra layers asked for whose names are chosen.
pub fn add_chosen(
    image: &mut ExrImage,
    layers: &[Layer],
    render: &Render,
    guides: &[Guide],
    is_chosen: impl Fn(&str) -> bool,
) {
    let passes = render.passes().len() as u64;
    let mut classes = render.outputs().classes.iter();
    let mut class_count = 0;
    let flux = render.flux();
    for layer in layers {
        let (name, meaning) = layer.meaning();
        let is_one = !matches!(layer, Layer::Strategies | Layer::Class(_));
        if is_one && !is_chosen(name) {
            continue;
        }
        let attribute = format!("layer:{name}");
        // several classes have one meaning
        if image.metadata.get(&attribute).is_none() {
            let meaning = MetadataValue::Text(meaning.to_owned());
            image.metadata.entries.push((attribute, meaning));
        }
        let channels = &mut image.channels;
        match layer {
            Layer::Error => {
                let [even, odd] = render.pass_counts();
                // unknown while one half has no passes
                let errors = render.outputs().image.standard_error(1, even, odd);
                let errors =
                    errors.unwrap_or_else(|| vec![f64::INFINITY; render.crop().pixels() as usize]);
                channels.push(channel("error.Y", errors.iter().copied()));
            }
            Layer::Noise => {
                channels.push(noise("Y", &render.outputs().image, render));
                let classes = render.outputs().classes.iter().enumerate();
                channels.extend(
                    classes.map(|(i, (_, film))| noise(&format!("class{i}.Y"), film, render)),
                );
            }
            Layer::Strategies => {
                let Some(films) = &render.outputs().strategies else {
                    continue;
                };
                // a poisoned lock means that a render thread has panicked, and so has this one
                let films = films.read().unwrap_or_else(PoisonError::into_inner);
                let films = films.iter().map(|(key, film)| (strategy_name(key), film));
                for (name, film) in films.filter(|(name, _)| is_chosen(name)) {
                    channels.extend(layer_channels(&name, film, passes));
                }
            }
            Layer::Unbiased | Layer::Regularized => {
                let Some([unbiased, regularized]) = &render.outputs().shares else {
                    continue;
                };
                channels.extend(if matches!(layer, Layer::Unbiased) {
                    layer_channels("unbiased", unbiased, passes)
                } else {
                    layer_channels("regularized", regularized, passes)
                });
            }
            Layer::Bias => {
                let [even, odd] = render.pass_counts();
                // unknown while one half has no passes
                let bias = bias_image(&render.outputs().image, even, odd)
                    .unwrap_or_else(|| vec![f64::INFINITY; render.crop().pixels() as usize]);
                channels.push(channel("bias.Y", bias.iter().copied()));
            }
            Layer::Depth => channels.push(channel("depth.Z", guides.iter().map(|g| g.depth))),
            Layer::Normal => {
                for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                    channels.push(channel(
                        &format!("normal.{axis}"),
                        guides.iter().map(|g| g.normal[i]),
                    ));
                }
            }
            Layer::Albedo => {
                for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                    channels.push(channel(
                        &format!("albedo.{axis}"),
                        guides.iter().map(|g| g.albedo[i]),
                    ));
                }
            }
            Layer::Class(_) => {
                let Some((expression, film)) = classes.next() else {
                    continue;
                };
                let name = format!("class{class_count}");
                if !is_chosen(&name) {
                    class_count += 1;
                    continue;
                }
                channels.extend(layer_channels(&name, film, passes));
                let total = flux.as_ref().and_then(|f| f.classes_lm.get(class_count));
                let total = total.map(|(_, total)| flux_entry(&name, total, "lm"));
                class_count += 1;
                let entries = &mut image.metadata.entries;
                entries.extend(total);
                entries.push((name, MetadataValue::Text(expression.source().to_owned())));
            }
        }
    }
}

/// First hits, where a layer needs them.
#[must_use]
pub fn guides_for(layers: &[Layer], render: &Render) -> Vec<Guide> {
    let needed = layers
        .iter()
        .any(|a| matches!(a, Layer::Depth | Layer::Normal | Layer::Albedo));
    if needed {
        guides(render.scene(), render.sensor(), &render.crop())
    } else {
        Vec::new()
    }
}

/// Noise of the Y of a film, which the image has in this channel.
fn noise(of: &str, film: &Film, render: &Render) -> Channel {
    let [even, odd] = render.pass_counts();
    let unknown = || vec![f64::INFINITY; render.crop().pixels() as usize];
    let noise = film.noise(1, even, odd).unwrap_or_else(unknown);
    channel(&noise_channel(of), noise.into_iter())
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
