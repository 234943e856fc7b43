//! From what the file says to a [`Plan`]: ranges, units, names, files. Nothing here stops at the first problem.

mod motion;
mod object;
mod optics;
mod render;
mod sensor;
mod spectrum;
mod texture;
mod transform;

use super::document::Source;
use super::error::{Problem, SceneFileError};
use super::plan::{
    IorPlan, LightPlan, MaterialPlan, MediumPlan, MeshPlan, Plan, Span, SpectrumPlan,
};
use super::schema::{At, Named, SceneFile};
use crate::io::files;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Which numbers are allowed, and how to say so.
#[derive(Clone, Copy)]
struct Allowed {
    text: &'static str,
    test: fn(f64) -> bool,
}

/// Beyond this, squares and products of lengths overflow.
const LARGEST: f64 = 1e30;

const FINITE: Allowed = Allowed {
    text: "a finite number",
    test: |v| v.abs() <= LARGEST,
};
const POSITIVE: Allowed = Allowed {
    text: "a finite number > 0",
    test: |v| v > 1.0 / LARGEST && v <= LARGEST,
};
const NON_NEGATIVE: Allowed = Allowed {
    text: "a finite number >= 0",
    test: |v| (0.0..=LARGEST).contains(&v),
};
const UNIT_INTERVAL: Allowed = Allowed {
    text: "0 to 1",
    test: |v| (0.0..=1.0).contains(&v),
};

/// Names defined in the file, including those whose definition is wrong (so that their uses are not reported too).
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// `[spectrum.NAME]`.
    pub spectra: Vec<String>,
    /// `[medium.NAME]`.
    pub media: Vec<String>,
    /// `[material.NAME]`.
    pub materials: Vec<String>,
    /// `[mesh.NAME]`.
    pub meshes: Vec<String>,
}

/// What checking gathers.
pub struct Checker<'a> {
    source: &'a Source,
    folder: &'a Path,
    names: &'a Names,
    unit_m: f64,
    spectra: BTreeMap<String, SpectrumPlan>,
    meshes: Vec<MeshPlan>,
    /// Problems found.
    pub errors: Vec<SceneFileError>,
    /// What is legal but surely not meant.
    pub warnings: Vec<String>,
    /// Files the scene refers to.
    pub files: Vec<PathBuf>,
}

/// Checks a scene file. The plan is complete only if `errors` stays empty.
pub fn check<'a>(
    file: &SceneFile,
    source: &'a Source,
    folder: &'a Path,
    names: &'a Names,
) -> (Plan, Checker<'a>) {
    let mut checker = Checker {
        source,
        folder,
        names,
        unit_m: file.unit.unwrap_or_default().in_m(),
        spectra: BTreeMap::new(),
        meshes: Vec::new(),
        errors: Vec::new(),
        warnings: Vec::new(),
        files: Vec::new(),
    };
    let plan = checker.plan(file);
    (plan, checker)
}

impl Checker<'_> {
    fn plan(&mut self, file: &SceneFile) -> Plan {
        for (name, spectrum) in &file.spectrum {
            let plan = self.spectrum_definition(name.get_ref(), spectrum);
            self.spectra.insert(name.get_ref().clone(), plan);
        }
        let (settings, wavelengths) = self.render(&file.render);
        let media = self.media(file.ambient.as_ref(), &file.medium);
        let medium_ids: Vec<&str> = media.iter().map(|m| m.name.as_str()).collect();
        let mut materials: Vec<_> = file.material.values().map(|m| self.material(m)).collect();
        materials.push(MaterialPlan::default());
        let mesh_ids = self.named_meshes(&file.mesh);
        let models: Vec<_> = file
            .model
            .iter()
            .filter_map(|m| self.model(m, &file.render))
            .collect();
        let objects = self.objects(
            &file.object,
            &file.material,
            &materials,
            &medium_ids,
            &mesh_ids,
        );
        let lights: Vec<LightPlan> = file
            .light
            .iter()
            .enumerate()
            .filter_map(|(i, l)| self.light(i, l))
            .collect();
        // a scene with models takes their cameras, or one that sees them
        let sensors = if file.sensor.is_empty() && !file.model.is_empty() {
            Vec::new()
        } else {
            self.sensors(&file.sensor, &file.render)
        };
        self.still_motion(&objects, &lights, &sensors);
        Plan {
            media,
            materials,
            meshes: std::mem::take(&mut self.meshes),
            models,
            objects,
            lights,
            sensors,
            wavelengths,
            settings,
            units: file.render.units.unwrap_or_default(),
        }
    }

    fn media(
        &mut self,
        ambient: Option<&At<String>>,
        defined: &Named<At<super::schema::Medium>>,
    ) -> Vec<MediumPlan> {
        let mut media: Vec<MediumPlan> = defined
            .iter()
            .map(|(name, m)| self.medium(name.get_ref(), m))
            .collect();
        if let Some(name) = ambient {
            if let Some(i) = media.iter().position(|m| m.name == *name.get_ref()) {
                let chosen = media.remove(i);
                media.insert(0, chosen);
                return media;
            }
            self.unknown("medium", name, &self.names.media);
        }
        let ior = IorPlan::Constant { n: 1.0, k: 0.0 };
        media.insert(
            0,
            MediumPlan {
                name: "ambient".to_owned(),
                ior,
                absorption: None,
                use_k: false,
            },
        );
        media
    }

    fn error(&mut self, at: &Span, problem: Problem) {
        self.errors.push(self.source.error(at, problem));
    }

    fn conflict(&mut self, at: &Span, message: impl Into<String>) {
        self.error(at, Problem::Conflict(message.into()));
    }

    /// Reports a name that is not among `known`; silent where its definition is there but wrong.
    fn unknown(&mut self, what: &'static str, name: &At<String>, known: &[String]) {
        if !known.contains(name.get_ref()) {
            let problem = Problem::unknown(what, name.get_ref(), known.iter().map(String::as_str));
            self.error(&name.span(), problem);
        }
    }

    fn number_at(&mut self, what: &str, value: f64, at: &Span, allowed: Allowed) -> f64 {
        if !(allowed.test)(value) {
            self.error(
                at,
                Problem::Range {
                    what: what.to_owned(),
                    value: value.to_string(),
                    allowed: allowed.text,
                },
            );
        }
        value
    }

    fn number(&mut self, what: &str, value: &At<f64>, allowed: Allowed) -> f64 {
        self.number_at(what, *value.get_ref(), &value.span(), allowed)
    }

    /// An integer of `low..=high`.
    fn integer(
        &mut self,
        what: &str,
        value: &At<i64>,
        low: i64,
        high: i64,
        allowed: &'static str,
    ) -> i64 {
        let v = *value.get_ref();
        if !(low..=high).contains(&v) {
            self.error(
                &value.span(),
                Problem::Range {
                    what: what.to_owned(),
                    value: v.to_string(),
                    allowed,
                },
            );
        }
        v.clamp(low, high)
    }

    /// A length in metres.
    fn length(&mut self, what: &str, value: &At<f64>, allowed: Allowed) -> f64 {
        self.number(what, value, allowed) * self.unit_m
    }

    fn vector(&mut self, what: &str, value: &At<[f64; 3]>) -> DVec3 {
        for component in value.get_ref() {
            self.number_at(what, *component, &value.span(), FINITE);
        }
        DVec3::from_array(*value.get_ref())
    }

    /// A point or length vector in metres.
    fn point(&mut self, what: &str, value: &At<[f64; 3]>) -> DVec3 {
        self.vector(what, value) * self.unit_m
    }

    /// A unit vector along `value`, which must not be zero.
    fn direction(&mut self, what: &str, value: &At<[f64; 3]>) -> DVec3 {
        let v = self.vector(what, value);
        // scaled first: the square of a tiny or huge component leaves the range of f64
        let unit = (v / v.abs().max_element()).try_normalize();
        if unit.is_none() && v.is_finite() {
            self.conflict(
                &value.span(),
                format!("{what} has no direction (allowed: a vector other than zero)"),
            );
        }
        unit.unwrap_or(DVec3::Z)
    }

    /// The index of the only `Some` among `choices`; otherwise says so and gives `None`.
    fn exactly_one(&mut self, at: &Span, owner: &str, choices: &[(&str, bool)]) -> Option<usize> {
        let mut given = choices
            .iter()
            .enumerate()
            .filter(|(_, c)| c.1)
            .map(|(i, _)| i);
        match (given.next(), given.next()) {
            (Some(i), None) => Some(i),
            (first, _) => {
                let all: Vec<&str> = choices.iter().map(|c| c.0).collect();
                let found = if first.is_some() {
                    "more than one"
                } else {
                    "none"
                };
                self.conflict(
                    at,
                    format!(
                        "{owner} needs exactly one of {} (found {found})",
                        all.join(", ")
                    ),
                );
                None
            }
        }
    }

    fn file(&mut self, name: &At<String>, limit: u64) -> Option<PathBuf> {
        match files::find(self.folder, name.get_ref(), limit) {
            Ok(path) => {
                self.files.push(path.clone());
                Some(path)
            }
            Err(problem) => {
                self.error(&name.span(), problem.into());
                None
            }
        }
    }

    /// Rows of a table file; empty where there is an error.
    fn csv<const N: usize>(&mut self, name: &At<String>) -> Vec<[f64; N]> {
        let Some(path) = self.file(name, files::MAX_CSV_BYTES) else {
            return Vec::new();
        };
        files::read_csv(&path, name.get_ref()).unwrap_or_else(|problem| {
            self.error(&name.span(), problem.into());
            Vec::new()
        })
    }
}

/// The name given, or the kind and position of a thing.
fn label(name: Option<&At<String>>, kind: &str, index: usize) -> String {
    name.map_or_else(|| format!("{kind} {index}"), |n| n.get_ref().clone())
}

#[cfg(test)]
mod tests {
    use super::super::check_str;
    use super::super::plan::{Plan, SensorKind};
    use super::*;
    use crate::scene::description::WavelengthChoice;

    fn plan(text: &str) -> Plan {
        let sensor = "[[sensor]]\nperspective = { eye = [1, 2, 3], target = [1, 2, -7], fov_deg = 90, f_number = 2, \
                      focal_length = 50, focus_distance = 100 }\n";
        let text = format!("unit = \"mm\"\n{sensor}{text}");
        check_str(&text, "test", Path::new("/nonexistent"), &[])
            .unwrap_or_else(|e| panic!("{e}"))
            .plan
    }

    fn near(a: DVec3, b: [f64; 3]) {
        assert!(
            (a - DVec3::from_array(b)).length() < 1e-15,
            "{a} is not {b:?}"
        );
    }

    #[test]
    fn cameras_look_along_minus_z() {
        let SensorKind::Perspective {
            to_world,
            fov_rad,
            aperture_radius_m,
            focus_distance_m,
        } = plan("").sensors[0].kind
        else {
            panic!("another kind")
        };
        near(
            to_world.transform_point3(DVec3::ZERO),
            [0.001, 0.002, 0.003],
        );
        near(to_world.transform_vector3(DVec3::X), [1.0, 0.0, 0.0]);
        near(to_world.transform_vector3(DVec3::Y), [0.0, 1.0, 0.0]);
        near(to_world.transform_vector3(DVec3::Z), [0.0, 0.0, 1.0]);
        assert_eq!(fov_rad, std::f64::consts::FRAC_PI_2);
        assert!(
            (aperture_radius_m - 0.0125).abs() < 1e-15 && (focus_distance_m - 0.1).abs() < 1e-15
        );
    }

    #[test]
    fn canonical_shapes_land_where_the_file_says() {
        let objects = plan(
            "[[object]]\ncylinder = { from = [0, 0, 0], to = [4, 0, 0], radius = 1 }\nemission = 1\n\
             [[object]]\nquad = { center = [1, 0, 0], u = [2, 0, 0], v = [0, 3, 0] }\nemission = 1\n\
             [[object]]\nbox = { min = [0, 0, 0], max = [2, 4, 6] }\nemission = 1\n\
             [[object]]\ndisk = { normal = [0, -1, 0], radius = 2 }\nemission = 1\n\
             [[object]]\nsphere = { radius = 1 }\nemission = 1\ntransform = [{ scale = [2, 1, 1] }, { rotate = { axis = [0, 0, 1], deg = 90 } }, { translate = [10, 0, 0] }]\n",
        )
        .objects;
        let at = |i: usize, p: [f64; 3]| objects[i].to_world.transform_point3(DVec3::from_array(p));
        near(at(0, [0.0, 0.0, 1.0]), [0.004, 0.0, 0.0]);
        near(at(0, [0.0, 0.0, -1.0]), [0.0; 3]);
        near(at(1, [1.0, 1.0, 0.0]), [0.003, 0.003, 0.0]);
        near(at(2, [-1.0; 3]), [0.0; 3]);
        near(at(2, [1.0; 3]), [0.002, 0.004, 0.006]);
        near(at(3, [0.0, 0.0, 0.5]).normalize(), [0.0, -1.0, 0.0]);
        // scaled, then turned, then moved
        near(at(4, [1.0, 0.0, 0.0]), [0.01, 0.002, 0.0]);
    }

    #[test]
    fn detectors_face_u_cross_v() {
        let text = "[[sensor]]\nname = \"d\"\ndetector = { center = [0, 0, 0], normal = [0, 0, 2], width = 20, height = 10, pitch = 0.5 }\n\
                    [render]\nwavelengths = { lines_nm = [656, 486, 656] }\n";
        let p = plan(text);
        let SensorKind::Detector { u, v, .. } = p.sensors[1].kind else {
            panic!("another kind")
        };
        near(u, [0.01, 0.0, 0.0]);
        near(v, [0.0, 0.005, 0.0]);
        assert_eq!(p.sensors[1].resolution, [40, 20]);
        assert_eq!(
            p.wavelengths.choice,
            WavelengthChoice::Lines(vec![486.0, 656.0])
        );
    }
}
