//! `[[light]]`: lights that are no surfaces. Directions point the way the light travels.

use super::document::Node;
use super::keys::{
    Build, Built, Form, Given, Keys, POSITIVE, Range, Spec, Table, Value, first_given, keys,
};
use super::motion::Motion;
use super::object::MediumUse;
use super::reader::Reader;
use super::spectrum::Emitted;
use super::texture::image;
use super::transform::euler;
use super::value::{At, Direction, FileName, Length, Name, Point, items};
use crate::io::model::studio;
use crate::light::Light;
use crate::light::environment_image::EnvironmentImage;
use crate::light::spot::{Falloff, SpotLight};
use crate::medium::MediumId;
use crate::scene::Subject;
use crate::scene::description::LightDescription;
use crate::spectrum::Emission;
use glam::DVec3;
use std::sync::Arc;

/// The image of an environment that is built in.
const STUDIO: &str = "builtin:studio";
const HALF_ANGLE: Range = Range::above(0.0, 180.0, "above 0, at most 180 degrees");

keys! {
    /// A light without extent that shines the same in all directions.
    PointKeys = "point" {
        /// Where it is.
        position: Point;
        /// Radiant intensity.
        intensity: Emitted, unit "W/(sr nm)";
    }
}

impl Build for PointKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        table.sound(cx)?;
        Some(Light::point(self.position.0, self.intensity.0))
    }
}

keys! {
    /// A light without extent that shines into a cone.
    SpotKeys = "spot" {
        /// Where it is.
        position: Point;
        /// Axis of the cone.
        direction: Direction;
        /// Half-angle from which on it is dark.
        outer_deg: f64, in HALF_ANGLE, unit "degrees";
        /// Half-angle up to which it shines fully, at most `outer_deg`.
        inner_deg: Option<f64>, in HALF_ANGLE, unit "degrees", or "`outer_deg`";
        /// Radiant intensity within `inner_deg`.
        intensity: Emitted, unit "W/(sr nm)";
    }
}

impl Build for SpotKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        let (outer, inner) = (self.outer_deg, self.inner_deg.unwrap_or(self.outer_deg));
        if inner > outer {
            let message = "inner_deg is larger than outer_deg";
            cx.conflict(&table.span("inner_deg"), message);
        }
        table.sound(cx)?;
        let cone = SpotLight {
            cone_rad: outer.to_radians(),
            falloff_start_rad: inner.to_radians(),
            falloff: Falloff::SmoothStep,
        };
        let (position, direction) = (self.position.0, self.direction.0);
        Some(Light::spot(position, direction, self.intensity.0, cone))
    }
}

keys! {
    /// Parallel light from infinity, everywhere.
    DirectionalKeys = "directional" {
        /// The way it travels.
        direction: Direction;
        /// Irradiance of a surface at right angles to the light, as it arrives at the scene.
        irradiance: Emitted, unit "W/(m² nm)";
    }
}

impl Build for DirectionalKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        table.sound(cx)?;
        Some(Light::directional(self.direction.0, self.irradiance.0))
    }
}

keys! {
    /// Parallel light inside a circle.
    BeamKeys = "beam" {
        /// Center of the circle.
        position: Point;
        /// The way it travels.
        direction: Direction;
        /// Radius of the circle.
        radius: Length, in POSITIVE;
        /// Irradiance of a surface at right angles to the light.
        irradiance: Emitted, unit "W/(m² nm)";
    }
}

impl Build for BeamKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        table.sound(cx)?;
        Some(Light::beam(
            self.position.0,
            self.direction.0,
            self.irradiance.0,
            self.radius.0,
        ))
    }
}

keys! {
    /// Light from all around: `radiance`, `image` or both.
    EnvironmentKeys = "environment" {
        /// Radiance as it arrives at the scene, the same from everywhere, or factor on the image.
        radiance: Option<Emitted>, unit "W/(m² sr nm)", or "with `image`: white of Y = 1";
        /// OpenEXR, Radiance HDR, PNG or JPEG file of linear sRGB around the scene, row 0 up (+y),
        /// its middle towards -z, or `"builtin:studio"`, a gray room with lamps.
        image: Option<At<FileName>>, or "none";
        /// With `image`: turns it about x, then y, then z.
        euler_deg: Option<[f64; 3]>, unit "degrees", or "[0, 0, 0]";
    }
}

impl Build for EnvironmentKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        if self.radiance.is_none() && self.image.is_none() {
            let message = "environment needs radiance, image or both";
            cx.conflict(&table.at, message);
        }
        if self.euler_deg.is_some() && self.image.is_none() {
            let message = "euler_deg is for environments with an image only";
            cx.conflict(&table.span("euler_deg"), message);
        }
        let radiance = self
            .radiance
            .map_or_else(|| Emission::from_rgb([1.0; 3]), |r| r.0);
        let Some(name) = &self.image else {
            return Some(Light::environment(radiance, None));
        };
        let to_world = euler(self.euler_deg.map_or(DVec3::ZERO, DVec3::from_array));
        if name.value.0 == STUDIO {
            return Some(studio(radiance, to_world));
        }
        let image = image(name, true, false, cx)?;
        let image = EnvironmentImage::new(image, to_world);
        if image.is_none() {
            cx.bad_file(name, "the image is black");
        }
        Some(Light::environment(radiance, image.map(Arc::new)))
    }
}

const LIGHTS: [&str; 5] = ["point", "spot", "directional", "beam", "environment"];

keys! {
    /// A light of exactly one kind.
    LightKeys = "light" {
        /// Name for messages and for `--set`.
        name: Option<Name>, or "`light 0`, ...";
        /// A light without extent.
        point: Option<Given<PointKeys>>;
        /// A cone of light.
        spot: Option<Given<SpotKeys>>;
        /// Parallel light everywhere.
        directional: Option<Given<DirectionalKeys>>;
        /// Parallel light inside a circle.
        beam: Option<Given<BeamKeys>>;
        /// Light from all around.
        environment: Option<Given<EnvironmentKeys>>;
        /// Motion, without `scale`; of the motion of an environment only turns matter.
        motion: Motion<false>;
        /// The medium it is in; checked, and needed only where solids are open.
        medium: Option<MediumUse>, or "what is there";
    }
}

impl Build for LightKeys {
    type Output = (Option<String>, Light, Option<MediumId>);

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output> {
        table.exactly_one(&LIGHTS, "light", cx)?;
        let light = first_given([
            self.point.map(|g| g.0),
            self.spot.map(|g| g.0),
            self.directional.map(|g| g.0),
            self.beam.map(|g| g.0),
            self.environment.map(|g| g.0),
        ])??;
        let is_uniform = light.as_environment().is_some_and(|e| e.image.is_none());
        if is_uniform && table.get("motion").is_some() {
            let message =
                "an environment without an image is the same from everywhere: it cannot move";
            cx.conflict(&first_item(table, "motion"), message);
        }
        table.sound(cx)?;
        let light = if self.motion.0.is_empty() {
            light
        } else {
            light.under(&self.motion.0, cx.shutter.unwrap_or_default())
        };
        Some((self.name.map(|n| n.0), light, self.medium.map(|m| m.0)))
    }
}

/// The place of the first item of a list.
fn first_item(table: &Table<'_>, key: &str) -> std::ops::Range<usize> {
    let list = table.get(key).and_then(|node| node.get_ref().as_array());
    let first = list.and_then(|list| list.iter().next());
    first.map_or_else(|| table.span(key), |item| item.span())
}

/// `[[light]]`, each with its place.
#[derive(Debug, Default)]
pub struct Lights(pub Vec<At<LightDescription>>);

impl Value for Lights {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(LightKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut lights = Vec::new();
        for (i, item) in items(node, "an array", cx)?.into_iter().enumerate() {
            let Some(Built((name, light, medium))) = Built::<LightKeys>::read(item, spec, cx)
            else {
                continue;
            };
            let subject = Subject::Light(lights.len());
            cx.named_media.extend(medium.map(|m| (subject, m)));
            lights.push(At {
                value: LightDescription {
                    name: name.unwrap_or_else(|| format!("light {i}")),
                    light,
                },
                at: item.span(),
            });
        }
        Some(Self(lights))
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}
