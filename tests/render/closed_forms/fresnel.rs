//! Fresnel reflection of smooth glass: a slab, Brewster's angle, total reflection.

use crate::harness::{Estimate, assert_close, line_mean, scene, test_scale, with};
use abbe::io::scene_file::parse_str;
use abbe::scene::Scene;
use abbe::scene::settings::IntegratorKind::{Bdpt, Light};
use std::f64::consts::PI;
use std::path::Path;

/// Normal incidence on a slab, all reflections between its faces included: T = 2n/(n² + 1) and R =
/// 1 - T.
#[test]
fn slab_at_normal_incidence() {
    let cases = [
        ("ior = 1.5", "550", 12.0 / 13.0),
        (
            "glass = \"schott:N-BK7\"\nuse_k = false",
            "587.5618",
            0.919_082_7,
        ),
    ];
    for (index, line, transmittance) in cases {
        let (scene, settings) = scene(&SLAB.replace("INDEX", index).replace("LINE", line));
        let per_flux = 4.0 * 4.0 / PI;
        // a path is transmitted or not: the variance is T R
        let light = with(&settings, Light);
        let behind = line_mean(&scene, 0, &light, 32, 6 * test_scale()).scaled(per_flux);
        behind.assert_is(&format!("{index} transmits"), transmittance, 8e-4);
        let before = line_mean(&scene, 1, &light, 32, 6 * test_scale()).scaled(per_flux);
        before.assert_is(&format!("{index} reflects"), 1.0 - transmittance, 1e-2);
        let both = line_mean(&scene, 0, &with(&settings, Bdpt), 32, test_scale()).scaled(per_flux);
        both.assert_is(&format!("{index} transmits by bdpt"), transmittance, 2.5e-3);
    }
}

const SLAB: &str = r#"
[render]
wavelengths = { line_nm = LINE }
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 0, 2], u = [-2, 0, 0], v = [0, 2, 0] }
[[sensor]]
resolution = [32, 32]
detector = { center = [0, 0, -2], u = [2, 0, 0], v = [0, 2, 0], transparent = true }
[medium.glass]
INDEX
[material.clear]
dielectric = {}
[[object]]
box = { min = [-3, -3, -0.5], max = [3, 3, 0.5] }
material = "clear"
interior = "glass"
[[light]]
beam = { position = [0, 0, -4], direction = [0, 0, 1], radius = 1, irradiance = 1 }
"#;

/// Light at Brewster's angle: R_p = 0, and R_s = cos²(2θ).
#[test]
fn brewster_angle() {
    let angle = 56.603_83_f64.to_radians();
    let r_s = (2.0 * angle).cos().powi(2);
    for (fresnel, reflectance) in [("average", 0.5 * r_s), ("s", r_s), ("p", 0.0)] {
        let measured = reflected_at_brewster(fresnel, angle);
        let name = format!("Brewster reflectance, {fresnel}");
        if reflectance > 0.0 {
            measured.assert_is(&name, reflectance, 8e-3);
        } else {
            // what the angle's last digit leaves
            assert!(measured.mean < 1e-12, "{name}: {measured:?}");
        }
    }
}

fn reflected_at_brewster(fresnel: &str, angle: f64) -> Estimate {
    let (x, y) = (angle.sin(), angle.cos());
    let text = format!(
        r#"
[render]
integrator = "light"
fresnel = "{fresnel}"
wavelengths = {{ line_nm = 587.5618 }}
[[sensor]]
resolution = [32, 32]
detector = {{ center = [{0}, {1}, 0], normal = [-{x}, -{y}, 0], width = 4, height = 4, up = [0, 0, 1] }}
[medium.glass]
glass = "schott:N-BK7"
use_k = false
[material.clear]
dielectric = {{}}
[[object]]
quad = {{ center = [0, 0, 0], u = [0, 0, 20], v = [20, 0, 0] }}
material = "clear"
interface = {{ below = "glass" }}
[[light]]
beam = {{ position = [-{0}, {1}, 0], direction = [{x}, -{y}, 0], radius = 1, irradiance = 1 }}
"#,
        8.0 * x,
        8.0 * y
    );
    let (scene, settings) = scene(&text);
    line_mean(&scene, 0, &settings, 32, 12 * test_scale()).scaled(16.0 / PI)
}

/// Facets have no one plane of incidence: in one polarization they are refused by name.
#[test]
fn rough_glass_is_refused_in_one_polarization() {
    let build = |fresnel: &str, roughness: f64| {
        let text = format!(
            r#"
[render]
fresnel = "{fresnel}"
[[sensor]]
perspective = {{ eye = [0, 0, 5], target = [0, 0, 0], fov_deg = 40 }}
[medium.water]
ior = 1.33
[material.pane]
dielectric = {{ roughness = {roughness} }}
[[object]]
name = "frosted"
sphere = {{ center = [0, 0, 0], radius = 1 }}
material = "pane"
interior = "water"
[[light]]
point = {{ position = [0, 3, 3], intensity = 1 }}
"#
        );
        let loaded = parse_str(&text, Path::new("tests/render")).unwrap_or_else(|e| panic!("{e}"));
        Scene::build(loaded.description)
            .map(|_| ())
            .map_err(|e| e.to_string())
    };
    assert_eq!(build("average", 0.2), Ok(()));
    assert_eq!(build("p", 0.0), Ok(()));
    let message = build("p", 0.2).expect_err("rough");
    assert!(message.contains("\"frosted\""), "{message}");
}

/// About the critical angle of N-BK7 at the d line (41.245189°), from inside: below it the
/// textbook's R and T, beyond it R = 1 without noise and no light outside.
#[test]
fn total_reflection() {
    for degrees in [30.0_f64, 41.0, 41.2451, 41.2453, 42.0, 70.0] {
        let angle = degrees.to_radians();
        let (x, y) = (angle.sin(), angle.cos());
        let text = TOTAL
            .replace("REFLECTED", &format!("[{}, {}, 0]", 5.0 * x, -5.0 * y))
            .replace("TOWARD", &format!("[{}, {y}, 0]", -x))
            .replace("POSITION", &format!("[{}, {}, 0]", -5.0 * x, -5.0 * y))
            .replace("DIRECTION", &format!("[{x}, {y}, 0]"));
        let (scene, settings) = scene(&text);
        let reflected =
            line_mean(&scene, 0, &settings, 32, 4 * test_scale()).scaled(4.0 / (PI * 0.01));
        let outside =
            line_mean(&scene, 1, &settings, 32, 4 * test_scale()).scaled(80.0 * 80.0 / (PI * 0.01));
        let sin_t = 1.5168 * angle.sin();
        if sin_t > 1.0 {
            assert_close(
                &format!("reflectance at {degrees}"),
                reflected.mean,
                1.0,
                1e-5,
            );
            assert_eq!(
                outside.mean, 0.0,
                "light beyond the critical angle at {degrees}"
            );
        } else {
            let cos_t = (1.0 - sin_t * sin_t).sqrt();
            let r_s = (1.5168 * y - cos_t) / (1.5168 * y + cos_t);
            let r_p = (y - 1.5168 * cos_t) / (y + 1.5168 * cos_t);
            let reflectance = 0.5 * (r_s * r_s + r_p * r_p);
            reflected.assert_is(&format!("reflectance at {degrees}"), reflectance, 3e-2);
            // far out a grazing ray misses the detector
            if degrees < 41.2 {
                outside.assert_is(
                    &format!("transmittance at {degrees}"),
                    1.0 - reflectance,
                    1e-2,
                );
            }
        }
    }
}

const TOTAL: &str = r#"
[render]
integrator = "light"
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [16, 16]
detector = { center = REFLECTED, normal = TOWARD, width = 2, height = 2, up = [0, 0, 1] }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, 1, 0], u = [40, 0, 0], v = [0, 0, 40] }
[medium.glass]
glass = "schott:N-BK7"
use_k = false
[material.clear]
dielectric = {}
[[object]]
box = { min = [-50, -50, -50], max = [50, 0, 50] }
material = "clear"
interior = "glass"
[[light]]
beam = { position = POSITION, direction = DIRECTION, radius = 0.1, irradiance = 1 }
"#;
