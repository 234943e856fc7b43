//! `[[light]]`: lights that are no surfaces. Directions point the way the light travels.

use super::aim::{AimKeys, Disk};
use super::document::Node;
use super::keys::{
    Build, Built, Form, Given, Keys, NON_NEGATIVE, POSITIVE, Range, Spec, Table, Value,
    first_given, keys,
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
use crate::light::beam::BeamProfile;
use crate::light::beam::profile::RingProfile;
use crate::light::environment_image::EnvironmentImage;
use crate::light::spot::{Falloff, SpotLight};
use crate::medium::MediumId;
use crate::scene::Subject;
use crate::scene::description::LightDescription;
use crate::spectrum::{Emission, SensorResponse};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// The image of an environment that is built in.
const STUDIO: &str = "builtin:studio";
/// Sine of the angle between a beam and `up` below which they are one.
const LEAST_SINE: f64 = 1e-9;
const FIELD: Range = Range::closed(-89.0, 89.0, "-89 to 89 degrees");
const ORDER: Range = Range::closed(1.0, 100.0, "1 to 100");
const HALF_ANGLE: Range = Range::above(0.0, 180.0, "above 0, at most 180 degrees");

keys! {
    /// A light without extent that shines the same in all directions.
    PointKeys = "point" {
        /// Where it is.
        position: Point;
        /// Radiant intensity.
        intensity: Emitted, unit "W/(sr nm)";
        /// Power in all, 360 to 830 nm and all lines, to which `intensity` is scaled.
        power_w: Option<f64>, in NON_NEGATIVE, unit "W";
        /// The same in lumens.
        power_lm: Option<f64>, in NON_NEGATIVE, unit "lm";
    }
}

impl Build for PointKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        let light = Light::point(self.position.0, self.intensity.0);
        let light = powered(light, [self.power_w, self.power_lm], table, cx);
        table.sound(cx)?;
        Some(light)
    }
}

/// The light scaled to a power in watts or in lumens, where one is given.
fn powered(
    mut light: Light,
    [watts, lumens]: [Option<f64>; 2],
    table: &Table<'_>,
    cx: &mut Reader<'_>,
) -> Light {
    let Some(factor) = light.own_flux_factor() else {
        return light;
    };
    let (key, per_unit) = match (watts, lumens) {
        (None, None) => return light,
        (Some(_), Some(_)) => {
            let message = "power_w and power_lm exclude each other";
            cx.conflict(&table.span("power_lm"), message);
            return light;
        }
        (Some(watts), None) => ("power_w", watts / factor),
        (None, Some(lumens)) => {
            let unit = SensorResponse::Xyz.photometric_unit();
            ("power_lm", lumens / factor / unit)
        }
    };
    let own = std::mem::take(&mut light.emission);
    light.emission = if watts.is_some() {
        own.with_power(per_unit)
    } else {
        own.with_luminance(per_unit)
    };
    if per_unit > 0.0 && light.emission.largest() == 0.0 {
        let message = format!("{key} of a light whose spectrum has none");
        cx.conflict(&table.span(key), message);
    }
    light
}

keys! {
    /// A light without extent that shines into a cone.
    SpotKeys = "spot" {
        /// Where it is.
        position: Point;
        /// Axis of the cone.
        direction: Option<Direction>, or "with `aim` none";
        /// Half-angle from which on it is dark.
        outer_deg: Option<f64>, in HALF_ANGLE, unit "degrees", or "with `aim` none";
        /// Half-angle up to which it shines fully, at most `outer_deg`.
        inner_deg: Option<f64>, in HALF_ANGLE, unit "degrees", or "`outer_deg`";
        /// In place of `direction` and angles: the cone that just covers a disk, such as a stop.
        aim: Option<Given<AimKeys>>;
        /// Radiant intensity within `inner_deg`.
        intensity: Emitted, unit "W/(sr nm)";
        /// Power in all, 360 to 830 nm and all lines, to which `intensity` is scaled.
        power_w: Option<f64>, in NON_NEGATIVE, unit "W";
        /// The same in lumens.
        power_lm: Option<f64>, in NON_NEGATIVE, unit "lm";
    }
}

impl Build for SpotKeys {
    type Output = Light;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Light> {
        let position = self.position.0;
        let (direction, outer, inner) = match (self.aim, self.direction, self.outer_deg) {
            (Some(Given(aim)), None, None) if self.inner_deg.is_none() => {
                let Disk { target, radius_m } = aim?;
                let way = target - position;
                if way == DVec3::ZERO {
                    cx.conflict(
                        &table.span("aim"),
                        "the light is in the middle of what it aims at",
                    );
                    return None;
                }
                let angle = radius_m.atan2(way.length()).to_degrees();
                (way, angle, angle)
            }
            (None, Some(direction), Some(outer)) => {
                (direction.0, outer, self.inner_deg.unwrap_or(outer))
            }
            _ => {
                let message = "spot needs direction and outer_deg, or aim alone";
                cx.conflict(&table.at, message);
                return None;
            }
        };
        if inner > outer {
            let message = "inner_deg is larger than outer_deg";
            cx.conflict(&table.span("inner_deg"), message);
        }
        let cone = SpotLight {
            cone_rad: outer.to_radians(),
            falloff_start_rad: inner.to_radians(),
            falloff: Falloff::SmoothStep,
        };
        let light = Light::spot(position, direction, self.intensity.0, cone);
        let light = powered(light, [self.power_w, self.power_lm], table, cx);
        table.sound(cx)?;
        Some(light)
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
        /// Irradiance of a surface at right angles to the light, on the axis of the beam.
        irradiance: Emitted, unit "W/(m² nm)";
        /// Distance from the axis at which the irradiance of a Gaussian beam is 1/e² of that on it.
        waist: Option<Length>, in POSITIVE, or "uniform";
        /// With `waist`: the irradiance is exp(-2 (r/waist)^order) of that on the axis, from order
        /// 2 (Gaussian) on flatter with steeper edges.
        order: Option<f64>, in ORDER, or "2";
        /// Instead of `waist`: rows [distance from the axis, factor on the irradiance], linear in
        /// between, the first at 0 and the last at `radius` or beyond; or a CSV file of such rows.
        profile: Option<At<BeamRows>>, or "uniform";
        /// Way of the light from the circle in which it starts to `position`, such as the center of
        /// an entrance pupil inside a lens.
        before: Option<Length>, in NON_NEGATIVE, or "0";
        /// Several beams, each turned by so much from `direction` toward `up`, about `position`.
        fields_deg: Option<Vec<f64>>, in FIELD, unit "degrees", or "one, not turned";
        /// With `fields_deg`: where positive fields go.
        up: Option<Direction>, or "[0, 1, 0]";
        /// Power of each beam, 360 to 830 nm and all lines, to which `irradiance` is scaled.
        power_w: Option<f64>, in NON_NEGATIVE, unit "W";
        /// The same in lumens.
        power_lm: Option<f64>, in NON_NEGATIVE, unit "lm";
    }
}

/// Rows of the profile of a beam: distances from the axis in meters, and values.
#[derive(Debug)]
pub struct BeamRows(Vec<[f64; 2]>);

impl Value for BeamRows {
    fn form() -> Form {
        Form::Any(vec![Vec::<[f64; 2]>::form(), FileName::form()])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let rows = if node.get_ref().is_str() {
            let name = At::<FileName>::read(node, spec, cx)?;
            cx.csv::<2>(&name)?
        } else {
            Vec::<[f64; 2]>::read(node, spec, cx)?
        };
        let unit = cx.unit_m;
        Some(Self(rows.into_iter().map(|[r, v]| [r * unit, v]).collect()))
    }
}

impl BeamKeys {
    /// The profile of the beam, where it is not uniform.
    fn profile(&self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<BeamProfile> {
        if self.order.is_some() && self.waist.is_none() {
            cx.conflict(&table.span("order"), "order is for beams with waist only");
            return None;
        }
        let radius_m = self.radius.0;
        match (&self.waist, &self.profile) {
            (None, None) => None,
            (Some(_), Some(rows)) => {
                let message = "waist and profile exclude each other";
                cx.conflict(&rows.at, message);
                None
            }
            (Some(waist), None) => Some(match self.order {
                None | Some(2.0) => BeamProfile::Gaussian { waist_m: waist.0 },
                Some(order) => {
                    let rings = RingProfile::super_gaussian(radius_m, waist.0, order);
                    BeamProfile::Rings(Arc::new(rings))
                }
            }),
            (None, Some(At { value, at })) => match RingProfile::table(radius_m, &value.0) {
                Ok(rings) => Some(BeamProfile::Rings(Arc::new(rings))),
                Err(error) => {
                    cx.conflict(at, error.to_string());
                    None
                }
            },
        }
    }
}

impl Build for BeamKeys {
    /// With the field of each in degrees, where fields are given.
    type Output = Vec<(Option<f64>, Light)>;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output> {
        let along = self.direction.0;
        let up = self.up.map_or(DVec3::Y, |up| up.0);
        let across = along.cross(up);
        let fields = match &self.fields_deg {
            None => vec![None],
            Some(fields) => fields.iter().copied().map(Some).collect(),
        };
        if fields.is_empty() {
            cx.conflict(&table.span("fields_deg"), "fields_deg is empty");
        }
        if self.fields_deg.is_some() && across.length() < LEAST_SINE {
            let message = "up is along direction (allowed: a direction across it)";
            let key = if self.up.is_some() { "up" } else { "direction" };
            cx.conflict(&table.span(key), message);
            return None;
        }
        if self.up.is_some() && self.fields_deg.is_none() {
            cx.conflict(&table.span("up"), "up is for fields_deg only");
        }
        let profile = self.profile(table, cx);
        let mut lights = Vec::new();
        for field in fields {
            let direction = field.map_or(along, |deg| {
                DQuat::from_axis_angle(across.normalize(), deg.to_radians()) * along
            });
            let position = self.position.0 - self.before.map_or(0.0, |b| b.0) * direction;
            let emission = self.irradiance.0.clone();
            let mut light = Light::beam(position, direction, emission, self.radius.0);
            if let Some(profile) = &profile {
                light = light.with_profile(profile.clone());
            }
            let light = powered(light, [self.power_w, self.power_lm], table, cx);
            lights.push((field, light));
        }
        table.sound(cx)?;
        Some(lights)
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
    /// Name, lights of it with the field of each, and medium.
    type Output = (Option<String>, Vec<(Option<f64>, Light)>, Option<MediumId>);

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output> {
        table.exactly_one(&LIGHTS, "light", cx)?;
        let one = |light: Option<Light>| light.map(|light| vec![(None, light)]);
        let lights = first_given([
            self.point.map(|g| one(g.0)),
            self.spot.map(|g| one(g.0)),
            self.directional.map(|g| one(g.0)),
            self.beam.map(|g| g.0),
            self.environment.map(|g| one(g.0)),
        ])??;
        let is_uniform = |light: &Light| light.as_environment().is_some_and(|e| e.image.is_none());
        if lights.iter().any(|(_, l)| is_uniform(l)) && table.get("motion").is_some() {
            let message =
                "an environment without an image is the same from everywhere: it cannot move";
            cx.conflict(&first_item(table, "motion"), message);
        }
        table.sound(cx)?;
        let shutter = cx.shutter.unwrap_or_default();
        let moved = |(field, light): (Option<f64>, Light)| {
            let moves = !self.motion.0.is_empty();
            let light = if moves {
                light.under(&self.motion.0, shutter)
            } else {
                light
            };
            (field, light)
        };
        let lights = lights.into_iter().map(moved).collect();
        Some((self.name.map(|n| n.0), lights, self.medium.map(|m| m.0)))
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
            let Some(Built((name, several, medium))) = Built::<LightKeys>::read(item, spec, cx)
            else {
                continue;
            };
            let name = name.unwrap_or_else(|| format!("light {i}"));
            for (field, light) in several {
                let subject = Subject::Light(lights.len());
                cx.named_media.extend(medium.map(|m| (subject, m)));
                let name = match field {
                    None => name.clone(),
                    Some(deg) => format!("{name}, field {deg}"),
                };
                lights.push(At {
                    value: LightDescription { name, light },
                    at: item.span(),
                });
            }
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
