//! Coated interfaces, with a layer that absorbs: reflection from either side, and what passes.

use crate::harness::{line_mean, scene, test_scale, with};
use abbe::optics::coating::{Response, Thickness, interface};
use abbe::optics::{Layer, Stack};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};
use abbe::spectrum::{Curve, Ior};

const NM: f64 = 555.0;
const GLASS: f64 = 1.5;

/// The layers of the scene as light from air meets them.
fn layers() -> Stack {
    let layer = |ior, nm| Layer {
        ior,
        thickness: Thickness::Nm(nm),
    };
    Stack {
        name: String::new(),
        layers: vec![
            layer(Ior::constant(1.38), 100.0),
            layer(Ior::constant(0.2).with_k(Curve::Constant(3.3)), 15.0),
        ],
        backing: None,
    }
}

fn response(from_air: bool, cos: f64) -> Response {
    if from_air {
        interface(Some(&layers()), NM, 1.0, GLASS, cos)
    } else {
        interface(Some(&layers().reversed()), NM, GLASS, 1.0, cos)
    }
}

/// Irradiance on a detector of half edge 0.3 about x = -0.2 at height 0.7 by reflection of a lamp
/// of half edge 0.3 and radiance 1 about x = 1.2 at height 0.9: that of its mirror image.
fn reflected(from_air: bool) -> f64 {
    let n = 12;
    let at = |i: i32| 0.3 * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
    let mut sum = 0.0;
    for k in 0..n * n {
        for j in 0..n * n {
            let x = 1.2 + at(k / n) + 0.2 - at(j / n);
            let z = at(k % n) - at(j % n);
            let d2 = x * x + 1.6 * 1.6 + z * z;
            let cos2 = 1.6 * 1.6 / d2;
            sum += response(from_air, cos2.sqrt()).r * cos2 / d2;
        }
    }
    sum / f64::from(n).powi(4) * 0.36
}

#[test]
fn a_coating_that_absorbs_reflects_by_side() {
    let (front, back) = (reflected(true), reflected(false));
    assert!((front / back - 1.0).abs() > 0.1, "{front} {back}");
    // less is reflected from the front, so it takes more
    for (from_air, expected, passes) in [(true, front, 60), (false, back, 25)] {
        let sign = if from_air { 1.0 } else { -1.0 };
        // both face the interface
        let (u, v) = ("[0.3, 0, 0]", "[0, 0, 0.3]");
        let (u, v) = if from_air { (u, v) } else { (v, u) };
        let text = SCENE
            .replace(
                "METER",
                &format!("center = [-0.2, {}, 0], u = {u}, v = {v}", 0.7 * sign),
            )
            .replace(
                "LAMP",
                &format!("center = [1.2, {}, 0], u = {u}, v = {v}", 0.9 * sign),
            );
        let (scene, settings) = scene(&text);
        for (kind, passes) in [(Path, 2 * passes), (Light, 2 * passes), (Bdpt, passes)] {
            let measured = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
            measured.assert_is(&format!("from air {from_air} by {kind:?}"), expected, 2e-2);
        }
    }
}

#[test]
fn what_passes_a_coating_is_the_same_both_ways() {
    // seen along the normal, a large lamp behind the interface; radiance goes with n²
    for (from_air, n2) in [(true, GLASS * GLASS), (false, 1.0 / (GLASS * GLASS))] {
        let expected = response(from_air, 1.0).t * n2;
        let sign = if from_air { 1.0 } else { -1.0 };
        let (u, v) = ("[5, 0, 0]", "[0, 0, 5]");
        let (u, v) = if from_air { (u, v) } else { (v, u) };
        let text = SCENE
            .replace(
                "detector = { METER }",
                &format!("orthographic = {{ eye = [0, {}, 0], target = [0, 0, 0], up = [0, 0, 1], height = 0.2 }}", -sign),
            )
            .replace("LAMP", &format!("center = [0, {sign}, 0], u = {u}, v = {v}"));
        let (scene, settings) = scene(&text);
        for (kind, passes) in [(Path, 4), (Bdpt, 4)] {
            let measured = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
            measured.assert_is(&format!("from air {from_air} by {kind:?}"), expected, 2e-2);
        }
    }
}

const SCENE: &str = r#"
[render]
max_depth = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [16, 16]
detector = { METER }
[medium.glass]
ior = 1.5
[material.coated]
dielectric = {}
coating = [{ eta = 1.38, thickness_nm = 100 }, { eta = 0.2, k = 3.3, thickness_nm = 15 }]
[[object]]
box = { min = [-9, -9, -9], max = [9, 0, 9] }
material = "coated"
interior = "glass"
[[object]]
quad = { LAMP }
emission = 1
"#;
