//! Scenes with every kind of vertex, light and sensor, for the check of densities.

use super::check;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A sphere of `n` rings with interpolated normals.
fn smooth_sphere(n: usize) -> String {
    let mut obj = String::new();
    let columns = 2 * n;
    for ring in 0..=n {
        for column in 0..columns {
            let theta = std::f64::consts::PI * ring as f64 / n as f64;
            let phi = std::f64::consts::TAU * column as f64 / columns as f64;
            let [x, y, z] = [
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            ];
            writeln!(obj, "v {x} {y} {z}\nvn {x} {y} {z}").unwrap();
        }
    }
    for ring in 0..n {
        for column in 0..columns {
            // all corners at a pole are one
            let at = |r: usize, c: usize| {
                1 + r * columns + if r.is_multiple_of(n) { 0 } else { c % columns }
            };
            let corners = [
                at(ring, column),
                at(ring, column + 1),
                at(ring + 1, column + 1),
                at(ring + 1, column),
            ];
            let face = |a: usize, b: usize, c: usize| format!("f {a}//{a} {b}//{b} {c}//{c}");
            if ring > 0 {
                writeln!(obj, "{}", face(corners[0], corners[1], corners[2])).unwrap();
            }
            if ring + 1 < n {
                writeln!(obj, "{}", face(corners[0], corners[2], corners[3])).unwrap();
            }
        }
    }
    obj
}

const MATERIALS: &str = r#"
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.8 }
[material.coat]
mix = [{ weight = 0.3, mirror = {} }, { weight = 0.3, conductor = { metal = "Ag", roughness = 0.3 } }, { weight = 0.4, diffuse = { reflectance = 0.7 } }]
[material.clear]
dielectric = {}
[material.frost]
dielectric = { roughness = 0.3 }
[material.partly]
mix = [{ weight = 0.5, dielectric = {} }, { weight = 0.5, dielectric = { roughness = 0.4 } }]
[material.sheet]
thin = { ior = 1.5 }
"#;

const PINHOLE: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [12, 12]
perspective = { eye = [0.1, 1, 3.5], target = [0, 0.7, 0], fov_deg = 50 }
"#;

const LENS: &str = r#"
[render]
max_depth = 6
lanes = 8
[[sensor]]
resolution = [12, 12]
perspective = { eye = [0.1, 1, 3.5], target = [0, 0.7, 0], fov_deg = 50, aperture_radius = 0.2, focus_distance = 3 }
"#;

const FLOOR: &str = r#"
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "coat"
[[object]]
quad = { center = [0, 1, -1.5], u = [1, 0, 0], v = [0, 1, 0] }
material = "white"
"#;

const LAMP: &str = r#"
[[object]]
sphere = { center = [1, 2.2, 0.4], radius = 0.4 }
material = "white"
emission = 3
[[object]]
quad = { center = [-1.2, 1.5, 0], u = [0, 0.4, 0], v = [0, 0, 0.4] }
emission = 2
two_sided = true
"#;

fn balls(material: &str) -> String {
    format!(
        r#"
[[object]]
sphere = {{ center = [-0.4, 0.6, 0], radius = 0.5 }}
material = "{material}"
interior = "flint"
[[object]]
quad = {{ center = [0.6, 0.7, 0.6], u = [0.3, 0, 0.1], v = [0, 0.5, 0] }}
material = "sheet"
"#
    )
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

#[test]
fn densities_by_definition_of_clear_glass_before_area_lights() {
    let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &balls("clear")].concat();
    let seen = check("clear", &text, &scenes(), 40, 1.0);
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
fn densities_by_definition_of_rough_glass_mixtures_and_lens() {
    for material in ["frost", "partly"] {
        let text = [LENS, MATERIALS, FLOOR, LAMP, &balls(material)].concat();
        check(material, &text, &scenes(), 40, 1.0);
    }
}

#[test]
fn densities_by_definition_of_every_kind_of_light() {
    for (name, light) in [
        (
            "point",
            "[[light]]\npoint = { position = [0.5, 2, 1], intensity = 1 }",
        ),
        (
            "spot",
            "[[light]]\nspot = { position = [0.5, 2, 1], direction = [-0.5, -1, -0.6], outer_deg = 40, inner_deg = 20, intensity = 9 }",
        ),
        (
            "directional",
            "[[light]]\ndirectional = { direction = [-0.5, -1, -0.6], irradiance = 1 }",
        ),
        (
            "beam",
            "[[light]]\nbeam = { position = [0.5, 2, 1], direction = [-0.5, -0.8, -0.6], radius = 0.4, irradiance = 9 }",
        ),
        ("environment", "[[light]]\nenvironment = { radiance = 0.3 }"),
    ] {
        let text = [PINHOLE, MATERIALS, FLOOR, LAMP, light, &balls("partly")].concat();
        check(name, &text, &scenes(), 20, 1.0);
    }
}

#[test]
fn densities_by_definition_of_parallel_projection() {
    let view = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [12, 12]
orthographic = { eye = [0.1, 1, 3.5], target = [0, 0.7, 0], height = 2.5 }
"#;
    let light = "[[light]]\nenvironment = { radiance = 0.3 }";
    let text = [view, MATERIALS, FLOOR, LAMP, light, &balls("partly")].concat();
    let seen = check("orthographic", &text, &scenes(), 20, 1.0);
    assert!(seen.contains_key(&(0, 2)) && seen.contains_key(&(3, 1)));
}

#[test]
fn densities_by_definition_at_detectors() {
    for (name, kind) in [("detector", "false"), ("transparent detector", "true")] {
        let sensor = format!(
            r#"
[render]
max_depth = 5
[[sensor]]
resolution = [8, 8]
detector = {{ center = [0.2, 0.05, 0.3], u = [0.8, 0, 0], v = [0, 0, -0.8], transparent = {kind} }}
"#
        );
        let light = "[[light]]\nenvironment = { radiance = 0.3 }";
        let text = [&sensor, MATERIALS, FLOOR, LAMP, light, &balls("partly")].concat();
        let seen = check(name, &text, &scenes(), 60, 1.0);
        for strategy in [(0, 2), (1, 1), (2, 0), (4, 0), (3, 1), (2, 2)] {
            assert!(seen.contains_key(&strategy), "{name}: {strategy:?}");
        }
    }
}

#[test]
fn densities_by_definition_of_interpolated_normals() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.obj"), smooth_sphere(6)).unwrap();
    for material in ["frost", "clear", "coat"] {
        let interior = if material == "coat" {
            ""
        } else {
            "interior = \"flint\""
        };
        let ball = format!(
            r#"
[[object]]
mesh = {{ obj = "ball.obj" }}
transform = [{{ scale = 0.6 }}, {{ translate = [0, 0.7, 0] }}]
material = "{material}"
{interior}
"#
        );
        let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &ball].concat();
        check(
            &format!("interpolated {material}"),
            &text,
            folder.path(),
            40,
            1.0,
        );
    }
}

#[test]
#[should_panic(expected = "by definition")]
fn a_planted_error_of_a_millionth_is_seen() {
    let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &balls("clear")].concat();
    check("planted", &text, &scenes(), 1, 1.0 + 1e-6);
}
