//! Which light a method finds. Light that it misses leaves no sign in its noise: a class of paths
//! that others hit often and this one never is the only sign there is.

use crate::render::Render;
use crate::report::readable::{counted, percent};
use crate::report::statistics::FEW_HITS;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Share of the light below which a class is not told.
const TOLD_SHARE: f64 = 1e-3;
/// Classes that a sentence names.
const NAMED: usize = 4;

/// Light of one class of paths, as one render found it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassLight {
    /// The class, such as `LSDE`.
    pub class: String,
    /// Non-zero contributions.
    pub hits: u64,
    /// Mean of Y over pixels and passes.
    pub mean: f64,
}

/// The classes of a render, over all strategies; none where its table was not kept.
#[must_use]
pub fn of_render(render: &Render) -> Vec<ClassLight> {
    let samples = render.crop().pixels() as f64 * render.passes().len() as f64;
    let mut classes: BTreeMap<String, (u64, f64)> = BTreeMap::new();
    for ((class, _, _), row) in render.table().rows() {
        let (hits, mean) = classes.entry(class.to_string()).or_default();
        *hits += row.hits;
        *mean += row.weighted / samples;
    }
    let light = |(class, (hits, mean))| ClassLight { class, hits, mean };
    classes.into_iter().map(light).collect()
}

/// A class that a method found too rarely to be trusted, or never.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassMissed {
    /// The class.
    pub class: String,
    /// Share of the light of the image, by the method that hit it most often.
    pub share: f64,
    /// Non-zero contributions.
    pub hits: u64,
}

/// Light that a method misses of what all methods found together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Missed {
    /// Classes, the brightest first.
    pub classes: Vec<ClassMissed>,
}

/// Light that each table lacks of what all of them hold. A class is taken from the table that
/// hit it most often, where that is often enough to be trusted.
#[must_use]
pub fn missed(tables: &[&[ClassLight]]) -> Vec<Missed> {
    let mut best: BTreeMap<&str, &ClassLight> = BTreeMap::new();
    for light in tables.iter().copied().flatten() {
        let known = best.entry(&light.class).or_insert(light);
        if light.hits > known.hits {
            *known = light;
        }
    }
    best.retain(|_, light| light.hits >= FEW_HITS);
    let all: f64 = best.values().map(|light| light.mean).sum();
    let of = |table: &&[ClassLight]| {
        let missed = |(class, light): (&&str, &&ClassLight)| {
            let found = table.iter().find(|own| own.class == **class);
            let hits = found.map_or(0, |own| own.hits);
            let share = light.mean / all;
            (hits < FEW_HITS && share >= TOLD_SHARE).then(|| ClassMissed {
                class: (*class).to_owned(),
                share,
                hits,
            })
        };
        let mut classes: Vec<ClassMissed> = best.iter().filter_map(missed).collect();
        classes.sort_by(|a, b| b.share.total_cmp(&a.share));
        Missed { classes }
    };
    tables.iter().map(of).collect()
}

impl Missed {
    /// Share of the light that was never found, and that of classes found too rarely to be trusted.
    #[must_use]
    pub fn shares(&self) -> [f64; 2] {
        let sum = |never: bool| {
            let classes = self.classes.iter().filter(|c| (c.hits == 0) == never);
            classes.fold(0.0, |sum, c| sum + c.share)
        };
        [sum(true), sum(false)]
    }

    /// Text of what is missed; empty where nothing is.
    #[must_use]
    pub fn words(&self) -> String {
        let [never, rarely] = self.shares();
        let part = |share: f64, what: &str, is_named: fn(u64) -> bool| {
            if share == 0.0 {
                return String::new();
            }
            let classes = || self.classes.iter().filter(|c| is_named(c.hits));
            let named: Vec<String> = classes()
                .take(NAMED)
                .map(|c| format!("{} {}", c.class, percent(c.share)))
                .collect();
            let more = match classes().count().saturating_sub(NAMED) {
                0 => String::new(),
                n => format!(", {}", counted(n as u64, "more class", "more classes")),
            };
            format!(
                "{what} {} of the light ({}{more})",
                percent(share),
                named.join(", ")
            )
        };
        let rare = format!("finds by fewer than {FEW_HITS} paths");
        let parts = [
            part(never, "misses", |h| h == 0),
            part(rarely, &rare, |h| h > 0),
        ];
        let parts: Vec<String> = parts.into_iter().filter(|p| !p.is_empty()).collect();
        parts.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(&str, u64, f64)]) -> Vec<ClassLight> {
        let light = |&(class, hits, mean): &(&str, u64, f64)| ClassLight {
            class: class.to_owned(),
            hits,
            mean,
        };
        rows.iter().map(light).collect()
    }

    #[test]
    fn what_others_hit_often_is_missed() {
        let path = table(&[("LDE", 5000, 0.5), ("LSDE", 3, 7.0)]);
        let bdpt = table(&[("LDE", 9000, 0.6), ("LSDE", 400, 0.3), ("LSSE", 2, 90.0)]);
        let aimed = table(&[("LDE", 8000, 0.6), ("LSDE", 300, 0.3), ("LSDSE", 200, 0.1)]);
        let missed = missed(&[&path, &bdpt, &aimed]);
        let [of_path, of_bdpt, of_aimed] = [0, 1, 2].map(|i| &missed[i]);
        assert_eq!(
            of_path.words(),
            "misses 10 % of the light (LSDSE 10 %); finds by fewer than 100 paths 30 % of the light (LSDE 30 %)"
        );
        assert_eq!(of_bdpt.words(), "misses 10 % of the light (LSDSE 10 %)");
        let [never, rarely] = of_path.shares();
        assert!((never - 0.1).abs() < 1e-12 && (rarely - 0.3).abs() < 1e-12);
        // two hits of anything prove nothing
        assert_eq!(of_aimed.words(), "");
    }

    #[test]
    fn few_classes_are_named() {
        let names = ["LDE", "LDDE", "LDDDE", "LSE", "LSSE", "LSSSE"];
        let all = table(&names.map(|name| (name, 1000, 1.0)));
        let missed = missed(&[&all, &[]]);
        assert!(
            missed[1].words().ends_with(", 2 more classes)"),
            "{missed:?}"
        );
        assert_eq!(missed[1].classes.len(), 6);
    }
}
