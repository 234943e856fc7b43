//! Scenes made in Rust, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::geometry::{Hit, Ray};
use crate::light::area::AreaLight;
use crate::material::LobeSpec;
use glam::DVec3;

/// A lamp and a camera.
fn lit() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    scene
        .sphere("lamp", [0.0, 3.0, 0.0], 0.5)
        .emits(Emission::from_rgb([1.0; 3]));
    let view = look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0]);
    scene.pinhole("main", [8, 4], view, 0.8);
    scene
}

/// A lamp above a white floor, before a camera of these columns and rows.
pub fn lit_floor(resolution: [u32; 2]) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::diffuse(0.7));
    scene
        .quad("floor", [0.0; 3], [0.0, 0.0, 3.0], [3.0, 0.0, 0.0])
        .of(white);
    scene
        .sphere("lamp", [1.0, 2.5, 0.5], 0.3)
        .emits(Emission::from_rgb([10.0; 3]));
    let view = look_at([0.0, 1.5, 4.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0]);
    scene.pinhole("main", resolution, view, 40_f64.to_radians());
    scene
}

fn refused(scene: SceneBuilder) -> String {
    scene.build().map(|_| ()).unwrap_err().to_string()
}

#[test]
fn surfaces_lie_where_their_numbers_say() {
    let mut builder = lit();
    builder.sphere("ball", [1.0, 0.0, 0.0], 0.5);
    builder.cuboid("box", [-2.0, -1.0, -1.0], [-1.0, 1.0, 3.0]);
    builder.quad("floor", [0.0, -2.0, 0.0], [0.0, 0.0, 9.0], [9.0, 0.0, 0.0]);
    builder.disk("disk", [0.0, 0.0, -4.0], [0.0, 0.0, 2.0], 0.25);
    let scene = builder.build().unwrap();
    let hit = |from: [f64; 3], toward: [f64; 3]| -> Option<(String, f64)> {
        let ray = Ray::leaving(from.into(), toward.into(), None);
        let Hit { t, id, .. } = scene.accel.at(0.0).closest(&ray, |_| true)?;
        Some((scene.objects[id.instance.0 as usize].name.clone(), t))
    };
    let found = |name: &str, t: f64, from, toward| {
        let (what, distance) = hit(from, toward).unwrap();
        assert_eq!(what, name);
        assert!((distance - t).abs() < 1e-6, "{name}: {distance}");
    };
    found("ball", 1.5, [1.0, 0.0, 2.0], [0.0, 0.0, -1.0]);
    found("box", 2.0, [-1.5, 0.0, 5.0], [0.0, 0.0, -1.0]);
    found("floor", 1.0, [8.5, -1.0, 8.5], [0.0, -1.0, 0.0]);
    found("disk", 4.0, [0.24, 0.0, 0.0], [0.0, 0.0, -1.0]);
    assert_eq!(hit([0.26, 0.0, 0.0], [0.0, 0.0, -1.0]), None);
    // the normal of u × v
    let floor = scene
        .objects
        .iter()
        .position(|o| o.name == "floor")
        .unwrap();
    let transform = &scene.accel.instances()[floor].transform;
    let normal = transform.at(0.0).normal_to_world(DVec3::Z);
    assert!((normal - DVec3::Y).length() < 1e-12);
}

#[test]
fn the_camera_looks_at_its_target() {
    let scene = lit().build().unwrap();
    let camera = &scene.sensors[0].camera;
    let along = |x, y| camera.sample_ray(glam::DVec2::new(x, y), glam::DVec2::ZERO, 0.0.into());
    let middle = along(4.0, 2.0);
    assert!((middle.direction - DVec3::NEG_Z).length() < 1e-12);
    assert!((middle.xk.p - DVec3::new(0.0, 0.0, 5.0)).length() < 1e-12);
    // up is up, and right is right
    assert!(along(4.0, 0.0).direction.y > 0.3);
    assert!(along(8.0, 2.0).direction.x > 0.3);
}

#[test]
fn parts_of_the_same_scene_are_known() {
    let hash = |scene: SceneBuilder| scene.build().unwrap().hash;
    assert_eq!(hash(lit()), hash(lit()));
    let mut other = lit();
    other.sphere("ball", [0.0; 3], 0.5);
    assert_ne!(hash(lit()), hash(other.clone()));
    other.identity("mine");
    let mut named = lit();
    named.identity("mine");
    assert_eq!(hash(other), hash(named));
}

#[test]
fn what_is_not_possible_is_named() {
    assert_eq!(refused(SceneBuilder::new()), "the scene has no sensor");
    type Change = fn(&mut SceneBuilder);
    let cases: [(Change, &str); 18] = [
        (
            |s| s.caster_share(1.0),
            "casters \"share\": 1 (allowed: 0 to 0.9)",
        ),
        (
            |s| {
                s.sphere("ball", [0.0; 3], 0.5).of(MaterialId(7));
            },
            "object \"ball\": material 7 is of another builder: this one has 1",
        ),
        (
            |s| {
                s.sphere("ball", [0.0; 3], 0.5).filled_with(MediumId(7));
            },
            "object \"ball\": medium 7 is of another builder: this one has 1",
        ),
        (
            |s| {
                s.sphere("ball", [0.0; 3], 0.0);
            },
            "object \"ball\": its place is not finite or has no extent (is a size 0, or are two directions parallel?)",
        ),
        (
            |s| {
                s.quad("floor", [0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
            },
            "object \"floor\": its place is not finite or has no extent (is a size 0, or are two directions parallel?)",
        ),
        (
            |s| {
                let clear = s.material(Material::interface(0.0));
                s.sphere("ball", [0.0; 3], 0.5).of(clear);
            },
            "object \"ball\": its material is an interface, which needs the media on both sides: fill it, or name them",
        ),
        (
            |s| {
                let air = MediumId::AMBIENT;
                s.disk("lid", [0.0; 3], [0.0, 1.0, 0.0], 1.0)
                    .filled_with(air);
            },
            "object \"lid\": its shape is not closed, so it has no inside (allowed: a sphere, a box, a closed mesh)",
        ),
        (
            |s| {
                s.sphere("sun", [0.0; 3], 0.5)
                    .emits(Emission::from_rgb([1.0; 3]).scaled(-1.0));
            },
            "object \"sun\": its emission is negative or not finite",
        ),
        (
            |s| {
                s.material(Material::diffuse(1.5));
            },
            "material \"1\": the reflectance reaches from 1.5 to 1.5 (allowed: 0 to 1)",
        ),
        (
            |s| {
                s.material(Material::interface(-0.5));
            },
            "material \"1\": a roughness is -0.5 (allowed: 0 to 1)",
        ),
        (
            |s| {
                let lobe = || LobeSpec::Diffuse {
                    reflectance: 0.5.into(),
                };
                s.material(Material::mix([(0.75, lobe()), (0.5, lobe())]));
            },
            "material \"1\": the sum of the weights is 1.25 (allowed: at most 1)",
        ),
        (
            |s| {
                let lobe = || LobeSpec::Diffuse {
                    reflectance: 0.5.into(),
                };
                s.material(Material::mix([0.1; 5].map(|w| (w, lobe()))));
            },
            "material \"1\": 5 lobes (allowed: at most 4)",
        ),
        (
            |s| {
                s.clear("foam", Ior::constant(0.5));
            },
            "medium \"foam\": n = 0.5 has the refractive index 0.5 at 360 nm (allowed: 1 to 10)",
        ),
        (
            |s| {
                let light = AreaLight {
                    instance: crate::geometry::InstanceId(0),
                    pattern: None,
                    sampler: crate::geometry::AreaSampler::default(),
                    two_sided: false,
                };
                s.light("panel", Light::area(Emission::from_rgb([1.0; 3]), light));
            },
            "light \"panel\": a surface that emits is an object with emission",
        ),
        (
            |s| {
                let white = Emission::from_rgb([1.0; 3]);
                s.light("laser", Light::beam(DVec3::ZERO, DVec3::Z, white, 0.0));
            },
            "light \"laser\": radius 0 m (allowed: above 0)",
        ),
        (
            |s| {
                let white = Emission::from_rgb([1.0; 3]);
                s.light("star", Light::point(DVec3::NAN, white));
            },
            "light \"star\": its place is not finite or has no extent (is a size 0, or are two directions parallel?)",
        ),
        (
            |s| {
                let view = look_at([0.0; 3], [0.0; 3], [0.0, 1.0, 0.0]);
                s.pinhole("second", [8, 4], view, 0.8);
            },
            "sensor \"second\": its place is not finite or has no extent (is a size 0, or are two directions parallel?)",
        ),
        (
            |s| {
                let view = look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
                s.pinhole("second", [8, 0], view, 0.8);
            },
            "sensor \"second\": 8 x 0 pixels (allowed: 1 to 65536 each)",
        ),
    ];
    for (change, expected) in cases {
        let mut scene = lit();
        change(&mut scene);
        assert_eq!(refused(scene), expected);
    }
    let view = look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
    for fov in [0.0, -1.0, 4.0, f64::NAN] {
        let mut scene = lit();
        scene.pinhole("second", [8, 4], view, fov);
        assert!(
            refused(scene).starts_with("sensor \"second\": its film or field of view"),
            "{fov}"
        );
    }
}

#[test]
fn a_glass_that_there_is_not_is_refused_at_once() {
    let error = SceneBuilder::new().glass("schott:N-SF12").unwrap_err();
    assert!(error.to_string().contains("N-SF12"), "{error}");
    let mut dark = SceneBuilder::new();
    dark.pinhole(
        "main",
        [8, 4],
        look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0]),
        0.8,
    );
    let error = refused(dark);
    assert!(error.starts_with("the scene has no light"), "{error}");
}
