//! Sequences of smooth surfaces that all paths of a render can be held to, such as the ghost that
//! two surfaces of a lens reflect.
//!
//! A sample draws one sequence, each with the same probability, and its sub-paths follow it from
//! both ends: at each surface they take the label that is listed, with the reflectance or
//! transmittance as weight, and end where they meet another surface. So each sequence costs its own
//! paths only, however little light goes that way.

use super::description::ObjectDescription;
use crate::bsdf::{Label, Side};
use crate::geometry::InstanceId;
use crate::medium::Boundary;
use std::fmt::Write;

/// Most sequences of a render.
pub const MOST_SEQUENCES: usize = 10_000;
/// Most surfaces of a sequence, each as often as it is met.
pub const MOST_STEPS: usize = 1000;

/// The objects that a name in parentheses means: a number, surfaces of that number in any lens; a
/// text in quotation marks, the object of that name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceName<'a>(&'a str);

impl<'a> SurfaceName<'a> {
    /// Reads what stands between the parentheses.
    ///
    /// # Errors
    /// A fault, in words: neither of them.
    pub fn new(text: &'a str) -> Result<Self, String> {
        let name = Self(text.trim());
        let is_number = !name.0.is_empty() && name.0.bytes().all(|b| b.is_ascii_digit());
        if is_number || name.quoted().is_some() {
            return Ok(name);
        }
        Err(format!(
            "`{}` names no surface: expected its number in the lens, or the name of an object in quotation marks",
            name.0
        ))
    }

    fn quoted(self) -> Option<&'a str> {
        self.0.strip_prefix('"')?.strip_suffix('"')
    }

    /// The objects, by index, of all those with these names.
    ///
    /// # Errors
    /// There is none, in words.
    pub fn find<'n>(self, names: impl Iterator<Item = &'n str>) -> Result<Vec<usize>, String> {
        let suffix = format!(": surface {}", self.0);
        let is_it = |object: &str| match self.quoted() {
            Some(quoted) => object == quoted,
            None => object.ends_with(&suffix),
        };
        let found = names.enumerate().filter(|(_, name)| is_it(name));
        let found: Vec<usize> = found.map(|(i, _)| i).collect();
        match (found.is_empty(), self.quoted()) {
            (false, _) => Ok(found),
            (true, Some(_)) => Err(format!("there is no object {}", self.0)),
            (true, None) => Err(format!("no lens of the scene has a surface {}", self.0)),
        }
    }
}

/// A surface of a sequence, and what it does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// [`Label::SpecularReflect`] or [`Label::SpecularTransmit`].
    pub label: Label,
    /// Surfaces that it may be; `None`: any.
    surfaces: Option<Vec<InstanceId>>,
}

impl Step {
    /// Whether it may be on this surface.
    #[must_use]
    pub fn is_on(&self, surface: InstanceId) -> bool {
        self.surfaces.as_ref().is_none_or(|s| s.contains(&surface))
    }

    /// Whether two steps may be the same scattering.
    fn overlaps(&self, other: &Self) -> bool {
        let shared = match (&self.surfaces, &other.surfaces) {
            (Some(a), Some(b)) => a.iter().any(|surface| b.contains(surface)),
            _ => true,
        };
        self.label == other.label && shared
    }
}

/// Surfaces in the order in which light meets them between light and sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sequence {
    expression: String,
    steps: Vec<Step>,
}

impl Sequence {
    /// As it was given, or as it could have been.
    #[must_use]
    pub fn expression(&self) -> &str {
        &self.expression
    }

    /// Number of surfaces, each as often as it is met.
    #[must_use]
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The step of vertex `index` of a sub-path that generates directions of side `generate`: the
    /// first vertex of a light sub-path has the first step, that of a camera sub-path the last.
    #[must_use]
    pub fn step(&self, generate: Side, index: usize) -> Option<&Step> {
        match generate {
            Side::Camera => self.steps.get(index),
            Side::Light => {
                let from_end = self.steps.len().checked_sub(index + 1)?;
                self.steps.get(from_end)
            }
        }
    }

    /// Whether the vertices of a path between its ends, `count` of them, are those of the sequence.
    #[must_use]
    pub fn holds(&self, count: usize, vertex: impl Fn(usize) -> (Label, InstanceId)) -> bool {
        let is_it = |(i, step): (usize, &Step)| {
            let (label, surface) = vertex(i);
            label == step.label && step.is_on(surface)
        };
        count == self.steps.len() && self.steps.iter().enumerate().all(is_it)
    }

    fn overlaps(&self, other: &Self) -> bool {
        let pairs = self.steps.iter().zip(&other.steps);
        self.steps.len() == other.steps.len() && pairs.into_iter().all(|(a, b)| a.overlaps(b))
    }

    /// Reads `L T(1) R(2) R(1) T(2) E`: what light does at each surface, T or R, and on which, by
    /// its number in the lens or the name of the object in quotation marks (any without), with or
    /// without `^` before it and `$` behind. `find` gives the objects of a name.
    fn parse(
        text: &str,
        find: &impl Fn(SurfaceName) -> Result<Vec<usize>, String>,
    ) -> Result<Self, String> {
        let body = text.trim();
        let body = body.strip_prefix('^').unwrap_or(body);
        let body = body.strip_suffix('$').unwrap_or(body).trim();
        let inner = body.strip_prefix('L').and_then(|b| b.strip_suffix('E'));
        let mut rest = inner.ok_or_else(|| {
            format!("`{text}` is no sequence: expected one from L to E, such as `L T(1) R(2) R(1) T(2) E`")
        })?;
        let mut steps = Vec::new();
        loop {
            rest = rest.trim_start();
            let Some(letter) = rest.chars().next() else {
                break;
            };
            rest = &rest[letter.len_utf8()..];
            let label = match letter {
                'R' => Label::SpecularReflect,
                'T' => Label::SpecularTransmit,
                _ => {
                    return Err(format!(
                        "`{letter}` has no place in a sequence: expected L, then R or T for each surface, each with a surface in parentheses or without, then E"
                    ));
                }
            };
            let mut surfaces = None;
            if let Some(open) = rest.trim_start().strip_prefix('(') {
                // the name of an object may hold a parenthesis
                let quoted = open.trim_start().strip_prefix('"');
                let end = match quoted.and_then(|name| name.find('"')) {
                    Some(length) => {
                        let behind = open.len() - quoted.map_or(0, str::len) + length + 1;
                        open[behind..].find(')').map(|close| behind + close)
                    }
                    None => open.find(')'),
                };
                let end = end.ok_or_else(|| format!("a parenthesis of `{text}` is not closed"))?;
                let found = find(SurfaceName::new(&open[..end])?)?;
                surfaces = Some(found.into_iter().map(instance).collect());
                rest = &open[end + 1..];
            }
            if steps.len() == MOST_STEPS {
                return Err(format!(
                    "a sequence of more than {MOST_STEPS} surfaces (allowed: {MOST_STEPS})"
                ));
            }
            steps.push(Step { label, surfaces });
        }
        Ok(Self {
            expression: body.to_owned(),
            steps,
        })
    }
}

fn instance(object: usize) -> InstanceId {
    InstanceId(object as u32)
}

/// Sequences that the paths of a render are held to, at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sequences {
    source: String,
    all: Vec<Sequence>,
}

impl Sequences {
    /// Checks what can be checked of an expression without a scene.
    ///
    /// # Errors
    /// Fault, in words.
    pub fn check(expression: &str) -> Result<(), String> {
        Sequence::parse(expression, &|_| Ok(Vec::new())).map(|_| ())
    }

    /// Sequences by their expressions, such as `L T(1) R(2) R(1) T(2) E`, over the objects of a
    /// description.
    ///
    /// # Errors
    /// Fault, in words: no expression, none of this form, a surface that does not exist, two that
    /// hold the same paths, or too many.
    pub fn listed(expressions: &[&str], objects: &[ObjectDescription]) -> Result<Self, String> {
        let find = |name: SurfaceName| name.find(objects.iter().map(|object| object.name.as_str()));
        if expressions.len() > MOST_SEQUENCES {
            return Err(too_many(expressions.len()));
        }
        let all = expressions.iter().map(|e| Sequence::parse(e, &find));
        let all: Vec<Sequence> = all.collect::<Result<_, _>>()?;
        for (i, sequence) in all.iter().enumerate() {
            if let Some(other) = all[..i].iter().find(|other| other.overlaps(sequence)) {
                return Err(format!(
                    "`{}` and `{}` hold the same paths (allowed: sequences that differ in what a surface does, or in the surface)",
                    other.expression, sequence.expression
                ));
            }
        }
        if all.is_empty() {
            return Err("no sequence is listed (allowed: at least one)".to_owned());
        }
        Ok(Self {
            source: expressions.join("; "),
            all,
        })
    }

    /// All sequences of two reflections of lenses, named in the order in which light meets them:
    /// every pair of their surfaces that reflects and transmits.
    ///
    /// # Errors
    /// Fault, in words: a lens that does not exist, fewer than two such surfaces, or too many.
    pub fn ghosts(lenses: &[&str], objects: &[ObjectDescription]) -> Result<Self, String> {
        let mut way = Vec::new();
        for lens in lenses {
            let prefix = format!("{lens}: surface ");
            let number = |object: &ObjectDescription| -> Option<usize> {
                object.name.strip_prefix(&prefix)?.parse().ok()
            };
            let surfaces = objects.iter().enumerate();
            let mut surfaces: Vec<(usize, usize)> = surfaces
                .filter_map(|(i, object)| Some((number(object)?, i)))
                .collect();
            surfaces.sort_unstable();
            if surfaces.is_empty() {
                return Err(format!("there is no lens \"{lens}\""));
            }
            way.extend(surfaces);
        }
        let transmits = |(_, object): (usize, usize)| {
            matches!(objects[object].boundary, Boundary::Interface { .. })
        };
        let glass: Vec<usize> = (0..way.len()).filter(|&k| transmits(way[k])).collect();
        let count = glass.len() * glass.len().saturating_sub(1) / 2;
        if count == 0 {
            return Err(
                "fewer than two surfaces reflect and transmit: there are no ghosts".to_owned(),
            );
        }
        if count > MOST_SEQUENCES {
            return Err(too_many(count));
        }
        let passage = |k: usize, reflects: bool| Step {
            label: if reflects || !transmits(way[k]) {
                Label::SpecularReflect
            } else {
                Label::SpecularTransmit
            },
            surfaces: Some(vec![instance(way[k].1)]),
        };
        let name = |k: usize| match lenses {
            [_] => way[k].0.to_string(),
            _ => format!("\"{}\"", objects[way[k].1].name),
        };
        let mut all = Vec::with_capacity(count);
        for (i, &first) in glass.iter().enumerate() {
            for &second in &glass[..i] {
                let there = (0..first).map(|k| (k, false)).chain([(first, true)]);
                let back = (second + 1..first).rev().map(|k| (k, false));
                let again = (second + 1..way.len()).map(|k| (k, false));
                let passages = there.chain(back).chain([(second, true)]).chain(again);
                let mut expression = "L".to_owned();
                let mut steps = Vec::new();
                for (k, reflects) in passages {
                    let step = passage(k, reflects);
                    let letter = match step.label {
                        Label::SpecularReflect => 'R',
                        _ => 'T',
                    };
                    _ = write!(expression, " {letter}({})", name(k));
                    steps.push(step);
                }
                if steps.len() > MOST_STEPS {
                    return Err(format!(
                        "ghosts meet more than {MOST_STEPS} surfaces (allowed: {MOST_STEPS})"
                    ));
                }
                expression += " E";
                all.push(Sequence { expression, steps });
            }
        }
        Ok(Self {
            source: format!("ghosts of {}", lenses.join(", ")),
            all,
        })
    }

    /// The sequences.
    #[must_use]
    pub fn all(&self) -> &[Sequence] {
        &self.all
    }

    /// As they were asked for: what tells renders apart, together with the scene.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The sequence of a number in [0, 1), each with the same probability.
    #[must_use]
    pub fn draw(&self, u: f64) -> &Sequence {
        let index = (u * self.all.len() as f64) as usize;
        &self.all[index.min(self.all.len() - 1)]
    }
}

fn too_many(count: usize) -> String {
    format!("{count} sequences (allowed: {MOST_SEQUENCES})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Shape, Transform};
    use crate::material::MaterialId;
    use crate::medium::MediumId;
    use glam::DAffine3;

    fn object(name: &str, boundary: Boundary) -> ObjectDescription {
        ObjectDescription {
            name: name.to_owned(),
            shape: Shape::Sphere,
            transform: Transform::fixed(DAffine3::IDENTITY),
            material: MaterialId(0),
            boundary,
            emission: None,
        }
    }

    /// Two lenses: a singlet, its second surface before the first; and one with a mirror.
    fn objects() -> Vec<ObjectDescription> {
        let glass = Boundary::Interface {
            above: MediumId(0),
            below: MediumId(1),
        };
        vec![
            object("front: surface 2", glass),
            object("front: surface 1", glass),
            object("front: edge", Boundary::None),
            object("rear: surface 1", glass),
            object("rear: surface 2", Boundary::None),
            object("a (b)", Boundary::None),
        ]
    }

    fn faults(expressions: &[&str]) -> String {
        Sequences::listed(expressions, &objects()).expect_err("no sequences")
    }

    #[test]
    fn expressions_become_steps_from_both_ends() {
        let all = Sequences::listed(&["^L T(1) R(\"a (b)\")T E$", "LE"], &objects());
        let all = all.expect("sequences");
        let [sequence, direct] = all.all() else {
            panic!("{all:?}");
        };
        assert_eq!((sequence.count(), direct.count()), (3, 0));
        let on = |generate, index| {
            let step = sequence.step(generate, index)?;
            let is_on = |i: &u32| step.is_on(InstanceId(*i));
            Some((step.label, (0..6).filter(is_on).collect::<Vec<_>>()))
        };
        let (t, r) = (Label::SpecularTransmit, Label::SpecularReflect);
        assert_eq!(on(Side::Camera, 0), Some((t, vec![1, 3])));
        assert_eq!(on(Side::Light, 1), Some((r, vec![5])));
        assert_eq!(on(Side::Light, 0), Some((t, (0..6).collect())));
        assert_eq!((on(Side::Light, 3), on(Side::Camera, 3)), (None, None));
        let path = |surface| move |i| ([t, r, t][i], InstanceId([surface, 5, 0][i]));
        assert!(sequence.holds(3, path(3)) && !sequence.holds(3, path(0)));
        assert!(!sequence.holds(2, path(3)));
        assert_eq!(all.draw(0.49).count(), 3);
        assert_eq!(all.draw(0.51).count(), 0);
    }

    #[test]
    fn faults_are_named() {
        for (expressions, fault) in [
            (&["T(1) E"][..], "is no sequence"),
            (&["L T(1) D E"], "`D` has no place"),
            (&["L T(1 E"], "is not closed"),
            (&["L T(\"a E"], "is not closed"),
            (&["L T(one) E"], "`one` names no surface"),
            (&["L T(7) E"], "has a surface 7"),
            (&["L T(\"none\") E"], "no object \"none\""),
            (&["L T(1) E", "L T E"], "hold the same paths"),
            (&[], "no sequence is listed"),
        ] {
            let found = faults(expressions);
            assert!(found.contains(fault), "{expressions:?}: {found}");
        }
        let long = format!("L {} E", "T".repeat(MOST_STEPS + 1));
        assert!(faults(&[&long]).contains("more than 1000"));
        let ghosts = |lenses: &[&str]| Sequences::ghosts(lenses, &objects()).expect_err("none");
        assert!(ghosts(&["rear"]).contains("fewer than two"));
        assert!(ghosts(&["side"]).contains("no lens \"side\""));
    }

    #[test]
    fn ghosts_are_all_pairs_along_the_way() {
        let expressions = |lenses: &[&str]| -> Vec<String> {
            let ghosts = Sequences::ghosts(lenses, &objects()).expect("ghosts");
            let all = ghosts.all().iter();
            all.map(|s| s.expression().replace(": surface ", ""))
                .collect()
        };
        assert_eq!(expressions(&["front"]), ["L T(1) R(2) R(1) T(2) E"]);
        let [f1, f2, r1, r2] = ["\"front1\"", "\"front2\"", "\"rear1\"", "\"rear2\""];
        assert_eq!(
            expressions(&["front", "rear"]),
            [
                format!("L T({f1}) R({f2}) R({f1}) T({f2}) T({r1}) R({r2}) E"),
                format!("L T({f1}) T({f2}) R({r1}) T({f2}) R({f1}) T({f2}) T({r1}) R({r2}) E"),
                format!("L T({f1}) T({f2}) R({r1}) R({f2}) T({r1}) R({r2}) E"),
            ]
        );
    }
}
