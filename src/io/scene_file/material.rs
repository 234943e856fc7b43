//! `[material.NAME]`: lobes and their mixtures.

use super::coating::Coating;
use super::document::Node;
use super::error::Problem;
use super::keys::{
    Build, Built, Form, Given, Keys, NON_NEGATIVE, POSITIVE, Spec, Table, UNIT_INTERVAL, Value,
    first_given, keys,
};
use super::medium::{INDEX, library_index, validated};
use super::reader::{Reader, definitions};
use super::spectrum::Reflectance;
use super::texture::{Scalar, Scalars, Texture};
use super::value::{At, GlassName, MetalName};
use crate::bsdf::lobe::coated::Coat;
use crate::material::{Coverage, LobeSpec, MAX_LOBES, Material, MaterialId, NormalMap};
use crate::spectrum::{Curve, Ior};
use crate::texture::ScalarTexture;
use std::ops::Range as Span;

/// Facts of a material that its uses need.
#[derive(Clone, Debug)]
pub struct MaterialFacts {
    /// Index of the material.
    pub id: MaterialId,
    /// Whether it needs a medium on each side.
    pub is_dielectric: bool,
    /// Whether it is there in part only.
    pub has_coverage: bool,
    /// A place where it names an image.
    pub image_at: Option<Span<usize>>,
}

/// The lobes that a table of `[material.NAME]` or of its `mix` makes: the layer of a coat is one of
/// its own. A place where an image is named comes with them.
type Lobes = (Vec<LobeSpec>, Option<Span<usize>>);

/// A first image of several things.
fn image_of<const N: usize>(places: [&Option<Span<usize>>; N]) -> Option<Span<usize>> {
    places.into_iter().flatten().next().cloned()
}

fn alpha(roughness: Scalars) -> ([ScalarTexture; 2], Option<Span<usize>>) {
    let at = image_of([&roughness.0[0].image_at]);
    (roughness.0.map(|s| s.value), at)
}

keys! {
    /// Light goes everywhere alike.
    DiffuseKeys = "diffuse" {
        /// Share of the light that is reflected.
        reflectance: Reflectance;
    }
}

impl Build for DiffuseKeys {
    type Output = Lobes;

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Lobes> {
        let Reflectance { value, image_at } = self.reflectance;
        Some((vec![LobeSpec::Diffuse { reflectance: value }], image_at))
    }
}

keys! {
    /// A perfect mirror.
    MirrorKeys = "mirror" {
        /// Share of the light that is reflected.
        reflectance: Reflectance, default Reflectance::constant(1.0);
    }
}

impl Build for MirrorKeys {
    type Output = Lobes;

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Lobes> {
        let Reflectance { value, image_at } = self.reflectance;
        Some((vec![LobeSpec::Mirror { reflectance: value }], image_at))
    }
}

keys! {
    /// Metal: `metal`, or `eta` and `k`, or `color` (without `tint`).
    ConductorKeys = "conductor" {
        /// GGX alpha, or [x, y] along the two tangents; smooth below 0.001 (a texture never is).
        roughness: Scalars, in UNIT_INTERVAL, default Scalars::default();
        /// Reflectance at normal incidence.
        color: Option<Reflectance>;
        /// Factor on the reflectance.
        tint: Option<Reflectance>, or "1";
        /// `"Ag"`, `"Al"`, `"Au"` or `"Cu"`.
        metal: Option<At<MetalName>>;
        /// Real part of the index.
        eta: Option<f64>, in POSITIVE;
        /// Imaginary part of the index.
        k: Option<f64>, in NON_NEGATIVE;
    }
}

impl Build for ConductorKeys {
    type Output = Lobes;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Lobes> {
        let (alpha, rough_at) = alpha(self.roughness);
        let ior = match (&self.metal, self.eta, self.k, self.color) {
            (None, None, None, Some(color)) if self.tint.is_none() => {
                let image_at = image_of([&color.image_at, &rough_at]);
                let color = color.value;
                return Some((vec![LobeSpec::ColoredMetal { color, alpha }], image_at));
            }
            (Some(metal), None, None, None) => library_index(&metal.value.0, &metal.at, true, cx)?,
            (None, Some(n), Some(k), None) => {
                table.sound(cx)?;
                let n = Ior::constant(n);
                let ior = if k > 0.0 {
                    n.with_k(Curve::Constant(k))
                } else {
                    n
                };
                validated(ior, true, &table.at, cx)
            }
            _ => {
                let message = "conductor needs either metal, or eta and k, or color (without tint)";
                cx.conflict(&table.at, message);
                return None;
            }
        };
        let tint = self.tint.unwrap_or(Reflectance::constant(1.0));
        let image_at = image_of([&tint.image_at, &rough_at]);
        let tint = tint.value;
        Some((vec![LobeSpec::Conductor { ior, alpha, tint }], image_at))
    }
}

keys! {
    /// An interface between media; the object names them, by `interior` or `interface`.
    DielectricKeys = "dielectric" {
        /// GGX alpha, or [x, y] along the two tangents; smooth below 0.001 (a texture never is).
        roughness: Scalars, in UNIT_INTERVAL, default Scalars::default();
        /// Factor on what is reflected.
        reflect_tint: Reflectance, default Reflectance::constant(1.0);
        /// Factor on what passes.
        transmit_tint: Reflectance, default Reflectance::constant(1.0);
    }
}

impl Build for DielectricKeys {
    type Output = Lobes;

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Lobes> {
        let (alpha, rough_at) = alpha(self.roughness);
        let (reflect, transmit) = (self.reflect_tint, self.transmit_tint);
        let image_at = image_of([&reflect.image_at, &transmit.image_at, &rough_at]);
        let lobe = LobeSpec::Dielectric {
            alpha,
            reflect_tint: reflect.value,
            transmit_tint: transmit.value,
        };
        Some((vec![lobe], image_at))
    }
}

keys! {
    /// A thin sheet: `ior` or `glass`.
    ThinKeys = "thin" {
        /// Index of the sheet.
        ior: Option<f64>, in INDEX;
        /// Glass of the sheet.
        glass: Option<At<GlassName>>;
        /// Factor on what passes.
        transmit_tint: Reflectance, default Reflectance::constant(1.0);
    }
}

impl Build for ThinKeys {
    type Output = Lobes;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Lobes> {
        table.exactly_one(&["ior", "glass"], "thin", cx)?;
        let ior = match (self.ior, &self.glass) {
            (_, Some(glass)) => library_index(&glass.value.0, &glass.at, false, cx)?,
            (n, None) => Ior::constant(n?),
        };
        let Reflectance { value, image_at } = self.transmit_tint;
        let lobe = LobeSpec::Thin {
            ior,
            transmit_tint: value,
        };
        Some((vec![lobe], image_at))
    }
}

keys! {
    /// A diffuse base under a dielectric layer.
    CoatedKeys = "coated" {
        /// Share of the light that the base reflects.
        reflectance: Reflectance;
        /// Index of the layer.
        ior: f64, in INDEX, default 1.5;
        /// Roughness of the layer: GGX alpha, or [x, y] along the two tangents.
        roughness: Scalars, in UNIT_INTERVAL, default Scalars::default();
    }
}

impl Build for CoatedKeys {
    type Output = Lobes;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Lobes> {
        table.sound(cx)?;
        let (alpha, rough_at) = alpha(self.roughness);
        let Reflectance { value, image_at } = self.reflectance;
        let coat = Coat::new(self.ior, 1.0);
        let layer = LobeSpec::Coat {
            index: coat.index,
            alpha: alpha.clone(),
            tint: Curve::Constant(1.0).into(),
        };
        let base = LobeSpec::CoatedDiffuse {
            reflectance: value,
            coat,
            strength: 1.0.into(),
            alpha,
        };
        Some((vec![layer, base], image_of([&image_at, &rough_at])))
    }
}

/// The keys of lobes, in the order in which they are named.
const LOBES: [&str; 6] = [
    "diffuse",
    "mirror",
    "conductor",
    "dielectric",
    "thin",
    "coated",
];

keys! {
    /// A lobe of a mixture: exactly one of the lobes, and its weight.
    LobeKeys = "lobe" {
        /// Share of the lobe. The sum of all is at most 1; what is missing is absorbed.
        weight: Scalar, in UNIT_INTERVAL;
        /// Diffuse reflection.
        diffuse: Option<Given<DiffuseKeys>>;
        /// A perfect mirror.
        mirror: Option<Given<MirrorKeys>>;
        /// Metal.
        conductor: Option<Given<ConductorKeys>>;
        /// An interface between media.
        dielectric: Option<Given<DielectricKeys>>;
        /// A thin sheet.
        thin: Option<Given<ThinKeys>>;
        /// A diffuse base under a layer; counts as two lobes.
        coated: Option<Given<CoatedKeys>>;
    }
}

/// A lobe of a mixture, with its weight.
#[derive(Debug)]
pub struct Mixed {
    weight: Scalar,
    lobes: Vec<LobeSpec>,
    image_at: Option<Span<usize>>,
}

impl Build for LobeKeys {
    type Output = Mixed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Mixed> {
        table.exactly_one(&LOBES, "lobe", cx)?;
        let (lobes, lobe_at) = first_given([
            self.diffuse.map(|g| g.0),
            self.mirror.map(|g| g.0),
            self.conductor.map(|g| g.0),
            self.dielectric.map(|g| g.0),
            self.thin.map(|g| g.0),
            self.coated.map(|g| g.0),
        ])??;
        let image_at = image_of([&self.weight.image_at, &lobe_at]);
        Some(Mixed {
            weight: self.weight,
            lobes,
            image_at,
        })
    }
}

keys! {
    /// A normal map.
    NormalKeys = "normal map" {
        /// The image: x along growing u, y along growing v, z out of the surface.
        texture: Texture<false>;
        /// Factor on how far it bends.
        scale: f64, default 1.0;
    }
}

impl Build for NormalKeys {
    type Output = (NormalMap, Span<usize>);

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Self::Output> {
        let map = NormalMap {
            texture: self.texture.texture?,
            scale: self.scale,
        };
        Some((map, self.texture.file.at))
    }
}

keys! {
    /// A material: exactly one lobe, or `mix`.
    MaterialKeys = "material" {
        /// Diffuse reflection.
        diffuse: Option<Given<DiffuseKeys>>;
        /// A perfect mirror.
        mirror: Option<Given<MirrorKeys>>;
        /// Metal.
        conductor: Option<Given<ConductorKeys>>;
        /// An interface between media.
        dielectric: Option<Given<DielectricKeys>>;
        /// A thin sheet.
        thin: Option<Given<ThinKeys>>;
        /// A diffuse base under a dielectric layer.
        coated: Option<Given<CoatedKeys>>;
        /// A mixture of at most 4 lobes. `thin` and `dielectric` do not mix.
        mix: Option<Vec<At<Built<LobeKeys>>>>;
        /// Layers on a smooth `dielectric`, in the order in which light from outside meets them
        /// (from the side of the normal, where the surface has an `interface`).
        coating: Option<At<Coating>>, or "none";
        /// A normal map.
        normal: Option<Built<NormalKeys>>, or "none";
        /// The share of the surface that is there; light passes the rest straight. Not for objects
        /// with `emission`, `interior` or `interface`.
        coverage: Option<Scalar>, in UNIT_INTERVAL, or "1";
        /// With `coverage`: all from this coverage on, nothing below.
        cutoff: Option<f64>, in UNIT_INTERVAL, or "none";
        /// Light that meets several facets of a rough surface leaves it, so that what absorbs
        /// nothing loses nothing; else only light of a single facet does.
        multiscatter: bool, default true;
    }
}

impl Build for MaterialKeys {
    type Output = (Material, Option<Span<usize>>);

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output> {
        if self.cutoff.is_some() && self.coverage.is_none() {
            let message = "cutoff is for materials with coverage only";
            cx.conflict(&table.span("cutoff"), message);
        }
        let normal = self.normal.map(|n| n.0);
        let normal_at = normal.as_ref().map(|n| n.1.clone());
        let cover_at = self.coverage.as_ref().and_then(|c| c.image_at.clone());
        let (lobes, lobe_at) = match self.mix {
            Some(mix) => {
                if LOBES.iter().any(|lobe| table.get(lobe).is_some()) {
                    let message =
                        "a material is either mix or a single lobe (put every lobe into mix)";
                    cx.conflict(&table.at, message);
                }
                mixture(mix, &table.span("mix"), cx)
            }
            None => {
                table.exactly_one(&LOBES, "material", cx)?;
                let (lobes, image_at) = first_given([
                    self.diffuse.map(|g| g.0),
                    self.mirror.map(|g| g.0),
                    self.conductor.map(|g| g.0),
                    self.dielectric.map(|g| g.0),
                    self.thin.map(|g| g.0),
                    self.coated.map(|g| g.0),
                ])??;
                let whole = |lobe| (ScalarTexture::from(1.0), lobe);
                (lobes.into_iter().map(whole).collect(), image_at)
            }
        };
        let material = Material {
            lobes,
            normal: normal.map(|n| n.0),
            coverage: self.coverage.map(|alpha| Coverage {
                alpha: alpha.value,
                cutoff: self.cutoff,
            }),
            coating: None,
            single_scattering: !self.multiscatter,
        };
        if let (Some(coating), Some(range_nm)) = (&self.coating, cx.range_nm)
            && let Err(message) = material.check_coating(&coating.value.0, range_nm)
        {
            cx.conflict(&coating.at, message);
        }
        let coating = self.coating.map(|coating| coating.value.0);
        let material = Material {
            coating,
            ..material
        };
        Some((material, image_of([&lobe_at, &normal_at, &cover_at])))
    }
}

type Weighted = Vec<(ScalarTexture, LobeSpec)>;

fn mixture(
    mix: Vec<At<Built<LobeKeys>>>,
    at: &Span<usize>,
    cx: &mut Reader<'_>,
) -> (Weighted, Option<Span<usize>>) {
    let mix: Vec<Mixed> = mix.into_iter().map(|lobe| lobe.value.0).collect();
    let image_at = mix.iter().find_map(|m| m.image_at.clone());
    let count: usize = mix.iter().map(|m| m.lobes.len()).sum();
    if count > MAX_LOBES {
        let message = format!("mix has {count} lobes (allowed: at most {MAX_LOBES})");
        cx.conflict(at, message);
    }
    let has = |kind: fn(&LobeSpec) -> bool| mix.iter().any(|m| m.lobes.iter().any(kind));
    if has(|l| matches!(l, LobeSpec::Thin { .. }))
        && has(|l| matches!(l, LobeSpec::Dielectric { .. }))
    {
        let message =
            "thin and dielectric do not mix: one passes light straight, the other bends it";
        cx.conflict(at, message);
    }
    let sum: f64 = mix.iter().map(|m| m.weight.largest).sum();
    if sum > 1.0 + 1e-9 {
        let value = ((sum * 1e6).round() / 1e6).to_string();
        cx.error(at, || Problem::Range {
            what: "the sum of the weights".to_owned(),
            value,
            allowed: "at most 1",
        });
    }
    let each = |m: Mixed| {
        let weight = m.weight.value;
        m.lobes.into_iter().map(move |lobe| (weight.clone(), lobe))
    };
    (mix.into_iter().flat_map(each).collect(), image_at)
}

/// `[material.NAME]`, which are known by name from then on; the last one is black.
#[derive(Debug)]
pub struct Materials(pub Vec<Material>);

impl Value for Materials {
    fn form() -> Form {
        Form::Map(Box::new(Form::Table(MaterialKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut materials = Vec::new();
        let defined = definitions(node, cx, |_, node, cx| {
            let id = MaterialId(materials.len() as u32);
            let (material, image_at) = match Built::<MaterialKeys>::read(node, spec, cx) {
                Some(Built(built)) => built,
                None => {
                    materials.push(Material::default());
                    return None;
                }
            };
            let is_dielectric =
                |lobe: &(_, LobeSpec)| matches!(lobe.1, LobeSpec::Dielectric { .. });
            let facts = MaterialFacts {
                id,
                is_dielectric: material.lobes.iter().any(is_dielectric),
                has_coverage: material.coverage.is_some(),
                image_at,
            };
            materials.push(material);
            Some(facts)
        })?;
        cx.materials = defined;
        cx.black = materials.len() as u32;
        materials.push(Material::default());
        Some(Self(materials))
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self(vec![Material::default()]))
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}
