//! `coating` of materials: layers by the name of a design, or one by one.

use super::document::Node;
use super::error::Problem;
use super::keys::{Build, Built, Form, Keys, NON_NEGATIVE, POSITIVE, Spec, Table, Value, keys};
use super::medium::{library_index, validated};
use super::reader::Reader;
use super::value::{At, GlassName};
use crate::optics::coating::Thickness;
use crate::optics::{Layer, Stack, stacks};
use crate::spectrum::{Curve, Ior};
use std::sync::Arc;
use toml::de::DeValue;

keys! {
    /// A layer of a coating: its index by `glass` or by `eta` (and `k`), its thickness by
    /// `thickness_nm` or by `quarter_waves`.
    LayerKeys = "layer" {
        /// A glass, material or metal of the library, such as `"material:MGF2-O"` or `"metal:Ag"`.
        glass: Option<At<GlassName>>;
        /// Real part of the index.
        eta: Option<f64>, in POSITIVE;
        /// Imaginary part of the index.
        k: Option<f64>, in NON_NEGATIVE, or "0";
        /// Thickness.
        thickness_nm: Option<f64>, in NON_NEGATIVE, unit "nm";
        /// Optical thickness at normal incidence, in quarters of the wavelength `at_nm`.
        quarter_waves: Option<f64>, in NON_NEGATIVE;
        /// With `quarter_waves`: the wavelength.
        at_nm: f64, in POSITIVE, unit "nm", default stacks::DESIGN_NM;
    }
}

impl Build for LayerKeys {
    type Output = Layer;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Layer> {
        let ior = match (&self.glass, self.eta) {
            (Some(glass), None) if self.k.is_none() => {
                library_index(&glass.value.0, &glass.at, true, cx)
            }
            (None, Some(n)) => {
                table.sound(cx)?;
                let n = Ior::constant(n);
                let ior = match self.k {
                    Some(k) if k > 0.0 => n.with_k(Curve::Constant(k)),
                    _ => n,
                };
                Some(validated(ior, true, &table.at, cx))
            }
            _ => {
                let message = "a layer needs either glass, or eta (and k)";
                cx.conflict(&table.at, message);
                None
            }
        };
        let thickness = match (self.thickness_nm, self.quarter_waves) {
            (Some(nm), None) => Thickness::Nm(nm),
            (None, Some(count)) => Thickness::QuarterWaves {
                count,
                at_nm: self.at_nm,
            },
            _ => {
                let message = "a layer needs either thickness_nm or quarter_waves";
                cx.conflict(&table.at, message);
                return None;
            }
        };
        ior.map(|ior| Layer { ior, thickness })
    }
}

/// A coating by name or by its layers.
#[derive(Clone, Debug)]
pub struct Coating(pub Arc<Stack>);

impl Value for Coating {
    fn form() -> Form {
        let name = Form::Text("name of a coating: `\"MgF2\"`, `\"V-coat\"` or `\"broadband\"`");
        Form::Any(vec![
            name,
            Form::List(Box::new(Form::Table(LayerKeys::KIND))),
        ])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let stack = match node.get_ref() {
            DeValue::String(name) => match stacks::named(name, cx.library) {
                Ok(Some(stack)) => stack,
                Ok(None) => {
                    let known = stacks::NAMES.into_iter();
                    cx.error(&node.span(), || Problem::unknown("coating", name, known));
                    return None;
                }
                Err(error) => {
                    cx.not_in_library(&node.span(), error);
                    return None;
                }
            },
            DeValue::Array(_) => {
                let layers = Vec::<Built<LayerKeys>>::read(node, spec, cx)?;
                Stack {
                    name: format!("of {} layers", layers.len()),
                    layers: layers.into_iter().map(|layer| layer.0).collect(),
                    backing: None,
                }
            }
            _ => {
                cx.wrong_type(node, "a name or a list of layers");
                return None;
            }
        };
        Some(Self(Arc::new(stack)))
    }
}
