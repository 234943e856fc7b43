//! Scenes with every kind of vertex, light and sensor, for the check of densities.

use super::check;
use crate::camera::CameraKind;
use crate::camera::detector::{Aim, Toward};
use crate::camera::perspective::ThinLens;
use crate::geometry::Mesh;
use crate::light::Light;
use crate::light::spot::{Falloff, SpotLight};
use crate::material::{LobeSpec, Material, MaterialId};
use crate::medium::MediumId;
use crate::optics::coating::Thickness;
use crate::optics::{Layer, Stack};
use crate::scene::builder::look_at;
use crate::scene::settings::Aiming;
use crate::scene::{Scene, SceneBuilder, Settings};
use crate::spectrum::library::Library;
use crate::spectrum::{Curve, Emission, Ior};
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// A sphere of `n` rings with interpolated normals.
fn smooth_sphere(n: usize) -> Mesh {
    let columns = 2 * n;
    let mut points = Vec::new();
    for ring in 0..=n {
        for column in 0..columns {
            let theta = std::f64::consts::PI * ring as f64 / n as f64;
            let phi = std::f64::consts::TAU * column as f64 / columns as f64;
            let point = [
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            ];
            points.push(point.map(|v| v as f32));
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..n {
        for column in 0..columns {
            // all corners at a pole are one
            let at = |r: usize, c: usize| {
                let column = if r.is_multiple_of(n) { 0 } else { c % columns };
                (r * columns + column) as u32
            };
            let [a, b, c, d] = [
                at(ring, column),
                at(ring, column + 1),
                at(ring + 1, column + 1),
                at(ring + 1, column),
            ];
            if ring > 0 {
                triangles.push([a, b, c]);
            }
            if ring + 1 < n {
                triangles.push([a, c, d]);
            }
        }
    }
    Mesh::new(&points, Some(points.clone()), None, triangles).unwrap()
}

fn diffuse(reflectance: f64) -> LobeSpec {
    LobeSpec::Diffuse {
        reflectance: reflectance.into(),
    }
}

fn interface(alpha: f64) -> LobeSpec {
    LobeSpec::Dielectric {
        alpha: [alpha.into(), alpha.into()],
        reflect_tint: 1.0.into(),
        transmit_tint: 1.0.into(),
    }
}

/// A mirror, rough silver and a diffuse surface in one.
fn coat() -> Material {
    let mirror = LobeSpec::Mirror {
        reflectance: 1.0.into(),
    };
    let silver = LobeSpec::Conductor {
        ior: Library::embedded().ior("Ag").unwrap(),
        alpha: [0.3.into(), 0.3.into()],
        tint: 1.0.into(),
    };
    Material::mix([(0.3, mirror), (0.3, silver), (0.4, diffuse(0.7))])
}

fn clear() -> Material {
    Material::interface(0.0)
}

fn frost() -> Material {
    Material::interface(0.3)
}

/// Smooth and rough.
fn partly() -> Material {
    Material::mix([(0.5, interface(0.0)), (0.5, interface(0.4))])
}

/// A scene in the making, with what its parts are made of.
struct Parts {
    scene: SceneBuilder,
    settings: Settings,
    flint: MediumId,
    coat: MaterialId,
}

impl Parts {
    /// A floor with a coat, a white wall, a spherical and a two-sided lamp.
    fn new() -> Self {
        let mut scene = SceneBuilder::new();
        let flint = scene.glass("schott:N-SF11").unwrap();
        let matte = scene.material(Material::diffuse(0.8));
        let coat = scene.material(coat());
        scene
            .quad("floor", [0.0; 3], [0.0, 0.0, 3.0], [3.0, 0.0, 0.0])
            .of(coat);
        let wall = [0.0, 1.0, -1.5];
        scene
            .quad("wall", wall, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
            .of(matte);
        scene
            .sphere("ball lamp", [1.0, 2.2, 0.4], 0.4)
            .of(matte)
            .emits(white(3.0));
        let panel = scene.quad("panel", [-1.2, 1.5, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.4]);
        panel.emits(white(2.0));
        if let Some(area) = &mut panel.emission {
            area.two_sided = true;
        }
        let settings = Settings {
            // paths with solved chains have a definition of their own
            aim: Aiming::Off,
            max_depth: Some(6),
            pair_probability: Some(0.5),
            ..Settings::default()
        };
        Self {
            scene,
            settings,
            flint,
            coat,
        }
    }

    /// A ball of flint with a surface, and a thin sheet.
    fn balls(mut self, surface: Material) -> Self {
        let surface = self.scene.material(surface);
        let sheet = self.scene.material(Material::mix([(
            1.0,
            LobeSpec::Thin {
                ior: Ior::constant(1.5),
                transmit_tint: 1.0.into(),
            },
        )]));
        self.scene
            .sphere("ball", [-0.4, 0.6, 0.0], 0.5)
            .of(surface)
            .filled_with(self.flint);
        self.scene
            .quad("sheet", [0.6, 0.7, 0.6], [0.3, 0.0, 0.1], [0.0, 0.5, 0.0])
            .of(sheet);
        self
    }

    fn light(mut self, light: Light) -> Self {
        self.scene.light("light", light);
        self
    }

    fn built(self) -> (Scene, Settings) {
        (self.scene.build().unwrap(), self.settings)
    }

    fn pinhole(mut self) -> (Scene, Settings) {
        self.scene
            .pinhole("main", [12; 2], view(), 50_f64.to_radians());
        self.built()
    }
}

fn view() -> DAffine3 {
    look_at([0.1, 1.0, 3.5], [0.0, 0.7, 0.0], [0.0, 1.0, 0.0])
}

/// The same power at all wavelengths.
fn white(value: f64) -> Emission {
    Emission::from_curve(Curve::Constant(value))
}

fn sky() -> Light {
    Light::environment(white(0.3), None)
}

#[test]
fn densities_by_definition_of_clear_glass_before_area_lights() {
    let seen = check("clear", Parts::new().balls(clear()).pinhole(), 40, 1.0);
    for strategy in [
        (0, 3),
        (1, 1),
        (1, 4),
        (2, 2),
        (3, 2),
        (2, 3),
        (4, 1),
        (5, 3),
    ] {
        assert!(seen.contains_key(&strategy), "{strategy:?}");
    }
}

#[test]
fn densities_by_definition_of_a_coating_that_absorbs() {
    let silver = Layer {
        ior: Library::embedded().ior("metal:Ag").unwrap(),
        thickness: Thickness::Nm(15.0),
    };
    let cover = Layer {
        ior: Ior::constant(1.38),
        thickness: Thickness::Nm(120.0),
    };
    let coating = Stack {
        name: "silver".to_owned(),
        layers: vec![cover, silver],
        backing: None,
    };
    let surface = Material::coated_interface(Arc::new(coating));
    check("coated", Parts::new().balls(surface).pinhole(), 20, 1.0);
}

#[test]
fn densities_by_definition_of_rough_glass_mixtures_and_lens() {
    for (name, material) in [("frost", frost()), ("partly", partly())] {
        let mut parts = Parts::new().balls(material);
        parts.settings.lanes = 8;
        let lens = ThinLens {
            radius_m: 0.2,
            focus_distance_m: 3.0,
        };
        let fov_y_rad = 50_f64.to_radians();
        parts
            .scene
            .thin_lens("main", [12; 2], view(), fov_y_rad, lens);
        check(name, parts.built(), 40, 1.0);
    }
}

#[test]
fn densities_by_definition_of_every_kind_of_light() {
    let position = DVec3::new(0.5, 2.0, 1.0);
    let aim = DVec3::new(-0.5, -1.0, -0.6);
    let [outer, inner] = [40_f64, 20.0].map(f64::to_radians);
    let cone = SpotLight {
        cone_rad: outer,
        falloff_start_rad: inner,
        falloff: Falloff::SmoothStep,
    };
    let along = DVec3::new(-0.5, -0.8, -0.6);
    let lights = [
        ("point", Light::point(position, white(1.0))),
        ("spot", Light::spot(position, aim, white(9.0), cone)),
        ("directional", Light::directional(aim, white(1.0))),
        ("beam", Light::beam(position, along, white(9.0), 0.4)),
        (
            "Gaussian beam",
            Light::beam(position, along, white(9.0), 0.4).with_waist(0.3),
        ),
        ("environment", sky()),
    ];
    for (name, light) in lights {
        let parts = Parts::new().balls(partly()).light(light);
        check(name, parts.pinhole(), 20, 1.0);
    }
}

#[test]
fn densities_by_definition_of_parallel_projection() {
    let mut parts = Parts::new().balls(partly()).light(sky());
    parts.scene.orthographic("main", [12; 2], view(), 2.5);
    let seen = check("orthographic", parts.built(), 20, 1.0);
    assert!(seen.contains_key(&(0, 2)) && seen.contains_key(&(3, 1)));
}

#[test]
fn densities_by_definition_at_detectors() {
    let aim = Aim {
        center: DVec3::new(-0.1, 0.9, 0.2),
        normal: DVec3::new(0.2, -0.9, 0.1).normalize(),
        radius_m: 0.6,
    };
    for (name, transparent, aim) in [
        ("detector", false, None),
        ("transparent detector", true, None),
        ("aimed detector", false, Some(Toward::Disk(aim))),
    ] {
        let mut parts = Parts::new().balls(partly()).light(sky());
        parts.settings.max_depth = Some(5);
        let center = [0.2, 0.05, 0.3];
        let (u, v) = ([0.8, 0.0, 0.0], [0.0, 0.0, -0.8]);
        let sensor = parts.scene.detector("main", [8; 2], center, u, v);
        if let CameraKind::Detector(detector) = &mut sensor.camera.kind {
            detector.transparent = transparent;
            detector.aim = aim;
        }
        let seen = check(name, parts.built(), 60, 1.0);
        for strategy in [(0, 2), (1, 1), (2, 0), (4, 0), (3, 1), (2, 2)] {
            assert!(seen.contains_key(&strategy), "{name}: {strategy:?}");
        }
    }
}

#[test]
fn densities_by_definition_of_interpolated_normals() {
    let place = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::splat(0.6)),
        DVec3::new(0.0, 0.7, 0.0),
    );
    for (name, material) in [
        ("frost", Some(frost())),
        ("clear", Some(clear())),
        ("coat", None),
    ] {
        let mut parts = Parts::new();
        let flint = parts.flint;
        let surface = material.map(|m| parts.scene.material(m));
        let ball = parts.scene.mesh("ball", smooth_sphere(6), place);
        match surface {
            Some(surface) => ball.of(surface).filled_with(flint),
            None => ball.of(parts.coat),
        };
        check(&format!("interpolated {name}"), parts.pinhole(), 40, 1.0);
    }
}

#[test]
#[should_panic(expected = "by definition")]
fn a_planted_error_of_a_millionth_is_seen() {
    let scene = Parts::new().balls(clear()).pinhole();
    check("planted", scene, 1, 1.0 + 1e-6);
}
