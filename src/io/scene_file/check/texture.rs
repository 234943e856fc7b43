//! Textures: files, maps and numbers from images.

use super::super::plan::{ScalarPlan, TexturePlan};
use super::super::schema::{
    At, ChannelName, Encoding, NameOr, Scalar, TextureFilter, TextureSource, TextureWrap,
};
use super::{Allowed, Checker, FINITE, NON_NEGATIVE, UNIT_INTERVAL};
use crate::io::image_file::MAX_IMAGE_BYTES;
use crate::texture::{Filter, Wrap};
use glam::{DAffine2, DVec2};

impl Checker<'_> {
    /// An image on a surface. `encoding` is what its bytes are taken for unless the file says otherwise.
    pub(super) fn texture(
        &mut self,
        source: &At<TextureSource>,
        encoding: Encoding,
    ) -> Option<TexturePlan> {
        let at = source.span();
        let (name, table) = match source.get_ref() {
            NameOr::Name(name) => (At::new(at.clone(), name.clone()), None),
            NameOr::Table(table) => {
                let file = &table.file;
                (At::new(file.span(), file.get_ref().clone()), Some(table))
            }
        };
        let mut plan = TexturePlan {
            path: self.file(&name, MAX_IMAGE_BYTES)?,
            name: name.get_ref().clone(),
            at: name.span(),
            srgb: encoding == Encoding::Srgb,
            map: DAffine2::IDENTITY,
            wrap: Wrap::Repeat,
            filter: Filter::Bilinear,
        };
        let Some(table) = table else {
            return Some(plan);
        };
        plan.srgb = table.encoding.unwrap_or(encoding) == Encoding::Srgb;
        plan.wrap = match table.wrap {
            None | Some(TextureWrap::Repeat) => Wrap::Repeat,
            Some(TextureWrap::Mirror) => Wrap::Mirror,
            Some(TextureWrap::Clamp) => Wrap::Clamp,
        };
        let level = table
            .level
            .as_ref()
            .map_or(0.0, |l| self.number("level", l, NON_NEGATIVE));
        plan.filter = match table.filter {
            None | Some(TextureFilter::Bilinear) => Filter::Bilinear,
            Some(TextureFilter::Nearest) => Filter::Nearest,
            Some(TextureFilter::Mipmap) => Filter::Mipmap { level },
        };
        if let (Some(level), false) = (&table.level, matches!(plan.filter, Filter::Mipmap { .. })) {
            self.conflict(&level.span(), "level is for filter = \"mipmap\" only");
        }
        let mut pair = |what: &str, value: &Option<At<[f64; 2]>>, default: f64| {
            let Some(value) = value else {
                return DVec2::splat(default);
            };
            for v in value.get_ref() {
                self.number_at(what, *v, &value.span(), FINITE);
            }
            DVec2::from(*value.get_ref())
        };
        let scale = pair("scale", &table.scale, 1.0);
        let offset = pair("offset", &table.offset, 0.0);
        if scale.x == 0.0 || scale.y == 0.0 {
            self.conflict(
                &at,
                "the scale of a texture is 0 (allowed: any other number)",
            );
        }
        let angle = table
            .rotate_deg
            .as_ref()
            .map_or(0.0, |a| self.number("rotate_deg", a, FINITE));
        plan.map = DAffine2::from_scale_angle_translation(scale, angle.to_radians(), offset);
        Some(plan)
    }

    /// A number of `allowed` range, or an image of such numbers.
    pub(super) fn scalar(
        &mut self,
        what: &str,
        scalar: &At<Scalar>,
        allowed: Allowed,
    ) -> ScalarPlan {
        let [a, b] = self.scalars(what, scalar, allowed);
        if matches!(scalar.get_ref(), Scalar::Pair(_)) {
            self.conflict(&scalar.span(), format!("{what} is one number, not two"));
            return b;
        }
        a
    }

    /// The same along two axes.
    pub(super) fn scalars(
        &mut self,
        what: &str,
        scalar: &At<Scalar>,
        allowed: Allowed,
    ) -> [ScalarPlan; 2] {
        let at = scalar.span();
        match scalar.get_ref() {
            Scalar::Number(v) => {
                let v = self.number_at(what, *v, &at, allowed);
                [ScalarPlan::Constant(v), ScalarPlan::Constant(v)]
            }
            Scalar::Pair(pair) => {
                pair.map(|v| ScalarPlan::Constant(self.number_at(what, v, &at, allowed)))
            }
            Scalar::Image(image) => {
                let factor = image
                    .factor
                    .as_ref()
                    .map_or(1.0, |f| self.number("factor", f, UNIT_INTERVAL));
                let channel = match image.channel.unwrap_or_default() {
                    ChannelName::R => 0,
                    ChannelName::G => 1,
                    ChannelName::B => 2,
                    ChannelName::A => 3,
                };
                let plan = match self.texture(&image.texture, Encoding::Linear) {
                    None => ScalarPlan::Constant(factor),
                    Some(texture) => ScalarPlan::Image {
                        texture,
                        channel,
                        factor,
                    },
                };
                [plan.clone(), plan]
            }
        }
    }
}
