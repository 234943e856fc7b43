//! Names of kinds of chains, and the choice of some by name.

use super::{ChainKind, ChainLink, Chains};
use crate::scene::Scene;
use crate::spectrum::library::suggestions;
use std::collections::BTreeSet;
use thiserror::Error;

/// A name that no kind of chains has.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("no kind of chains is called `{name}` ({allowed})")]
pub struct UnknownChain {
    /// The name.
    pub name: String,
    /// Near names, or where to find them.
    pub allowed: String,
}

impl Chains {
    /// R (reflects) or T (transmits) and the object of each surface of a kind, from the light to
    /// the sensor: `T ball, T ball`. Kinds over other faces of the same objects share it.
    #[must_use]
    pub fn name(kind: &ChainKind, scene: &Scene) -> String {
        let link = |link: &ChainLink| {
            let label = if link.transmits { "T" } else { "R" };
            format!("{label} {}", scene.object(link.id.instance).name)
        };
        let links: Vec<String> = kind.iter().map(link).collect();
        links.join(", ")
    }

    /// The kinds of these names alone.
    ///
    /// # Errors
    /// A name that no kind has.
    pub(in crate::scene) fn only(
        &self,
        scene: &Scene,
        names: &[String],
    ) -> Result<Self, UnknownChain> {
        let named: Vec<String> = (self.kinds.iter())
            .map(|kind| Self::name(kind, scene))
            .collect();
        let known: BTreeSet<&str> = named.iter().map(String::as_str).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(name.as_str())) {
            let near = suggestions(name, known.into_iter());
            return Err(UnknownChain {
                name: name.clone(),
                allowed: match near.as_slice() {
                    [] => "allowed: kinds that `abbe info` lists without this key".to_owned(),
                    near => format!("did you mean `{}`?", near.join("`, `")),
                },
            });
        }
        let mut kept = Self {
            kinds: (self.kinds.iter().zip(&named))
                .filter(|(_, name)| names.contains(name))
                .map(|(kind, _)| kind.clone())
                .collect(),
            left_out: self.left_out,
            facets: self.facets.clone(),
            smooth: self.smooth.clone(),
            ..Self::default()
        };
        kept.index_kinds();
        if kept.kinds.len() == self.kinds.len() {
            kept.length_listed = self.length_listed;
        }
        Ok(kept)
    }
}
