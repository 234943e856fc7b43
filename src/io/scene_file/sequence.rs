//! `render.sequences`: the sequences of surfaces that all paths are held to.

use super::document::Node;
use super::keys::{Build, Built, Form, Keys, Spec, Table, Value, keys};
use super::lens::Lenses;
use super::reader::Reader;
use super::value::{At, Name, items};
use crate::math::named::{Named, named};
use crate::scene::{SceneDescription, Sequences};
use toml::de::DeValue;

named! {
    /// Sequences that follow from the scene.
    pub enum SequenceName {
        Ghosts = "ghosts": "All of two reflections of the only lens",
    }
}

keys! {
    /// Sequences of the lenses of the scene.
    GhostKeys = "sequences" {
        /// Names of lenses in the order in which light meets them: all sequences of two reflections
        /// of their surfaces.
        ghosts: Vec<At<Name>>;
    }
}

impl Build for GhostKeys {
    type Output = Vec<At<Name>>;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Vec<At<Name>>> {
        if self.ghosts.is_empty() {
            let message = "ghosts names no lens (allowed: names of [[lens]])";
            cx.conflict(&table.span("ghosts"), message);
            return None;
        }
        Some(self.ghosts)
    }
}

/// Sequences as they are asked for, until the surfaces are known.
#[derive(Clone, Debug)]
pub enum SequenceChoice {
    /// All of two reflections, of these lenses or of the only one.
    Ghosts(Option<Vec<At<Name>>>),
    /// By their expressions.
    Listed(Vec<At<Name>>),
}

impl SequenceChoice {
    fn expression(node: Node<'_>, cx: &mut Reader<'_>) -> Option<At<Name>> {
        let Some(text) = node.get_ref().as_str() else {
            cx.wrong_type(node, "a sequence such as \"L T(1) R(2) R(1) T(2) E\"");
            return None;
        };
        match Sequences::check(text) {
            Ok(()) => Some(At {
                value: Name(text.to_owned()),
                at: node.span(),
            }),
            Err(message) => {
                cx.conflict(&node.span(), message);
                None
            }
        }
    }
}

impl Value for SequenceChoice {
    fn form() -> Form {
        let text = Form::Text("a sequence such as `L T(1) R(2) R(1) T(2) E`");
        Form::Any(vec![
            SequenceName::form(),
            text.clone(),
            Form::List(Box::new(text)),
            Form::Table(GhostKeys::KIND),
        ])
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        match node.get_ref() {
            DeValue::String(text) if SequenceName::named(text).is_some() => {
                Some(Self::Ghosts(None))
            }
            DeValue::String(_) => Self::expression(node, cx).map(|e| Self::Listed(vec![e])),
            DeValue::Table(_) => {
                Built::<GhostKeys>::read(node, spec, cx).map(|built| Self::Ghosts(Some(built.0)))
            }
            _ => {
                let expected = "\"ghosts\", a sequence, a list of them or a table";
                let all = items(node, expected, cx)?.into_iter();
                let all: Vec<Option<At<Name>>> = all.map(|i| Self::expression(i, cx)).collect();
                all.into_iter().collect::<Option<_>>().map(Self::Listed)
            }
        }
    }
}

/// Names of the lenses of a scene.
pub fn lens_names(lenses: &Lenses) -> Vec<String> {
    let names = lenses.0.iter().map(|lens| lens.value.name().to_owned());
    names.collect()
}

/// The sequences over the surfaces of a scene whose lenses have these names.
pub fn resolve(
    At { value, at }: &At<SequenceChoice>,
    description: &SceneDescription,
    lenses: &[String],
    cx: &mut Reader<'_>,
) -> Option<Sequences> {
    let known = || {
        let names: Vec<String> = lenses.iter().map(|name| format!("\"{name}\"")).collect();
        names.join(", ")
    };
    let objects = &description.objects;
    let resolved = match value {
        SequenceChoice::Listed(all) => {
            let all: Vec<&str> = all.iter().map(|e| e.value.0.as_str()).collect();
            Sequences::listed(&all, objects)
        }
        SequenceChoice::Ghosts(None) => match lenses {
            [] => Err("the scene has no [[lens]] whose ghosts there could be".to_owned()),
            [only] => Sequences::ghosts(&[only], objects),
            _ => Err(format!(
                "the scene has several lenses (allowed: {{ ghosts = [...] }} with their names in the order in which light meets them, of {})",
                known()
            )),
        },
        SequenceChoice::Ghosts(Some(named)) => {
            for name in named {
                if !lenses.contains(&name.value.0) {
                    let message = format!(
                        "lens \"{}\" is not defined (allowed: {})",
                        name.value.0,
                        if lenses.is_empty() {
                            "the scene has no [[lens]]".to_owned()
                        } else {
                            known()
                        }
                    );
                    cx.conflict(&name.at, message);
                    return None;
                }
            }
            let named: Vec<&str> = named.iter().map(|n| n.value.0.as_str()).collect();
            Sequences::ghosts(&named, objects)
        }
    };
    resolved.map_err(|message| cx.conflict(at, message)).ok()
}
