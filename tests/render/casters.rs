//! Lights send half of their sub-paths toward what casts caustics: the light of a small glass is
//! the same, and far less noisy.

use super::harness::{Measured, measure, scene, test_scale};

/// A floor of which the camera sees what lies under a small ball of glass, in whose light there is
/// a plate, too, larger than what any light can be aimed at.
const SCENE: &str = r#"
[render]
aim = "off"
max_depth = 4
filter = "box"
caster_share = SHARE

[[sensor]]
name = "camera"
resolution = [4, 4]
perspective = { eye = [0.3, 0.5, 0.9], target = [0, 0, 0], fov_deg = 30 }

[medium.glass]
ior = 1.5

[material.floor]
diffuse = { reflectance = 0.5 }

[material.glass]
dielectric = {}

[material.mirror]
mirror = {}

[[object]]
name = "floor"
quad = { center = [0, 0, 0], u = [0, 0, 1], v = [1, 0, 0] }
material = "floor"

[[object]]
name = "plate"
quad = { center = [0, 2, -1], u = [2, 0, 0], v = [0, 2, 0] }
material = "mirror"

[[object]]
name = "ball"
sphere = { center = [0, 0.12, 0], radius = 0.08 }
material = "glass"
interior = "glass"
"#;

/// Lights that a ball takes up little of.
const LIGHTS: [(&str, &str); 4] = [
    (
        "point",
        "[[light]]\nname = \"l\"\npoint = { position = [0.3, 2.2, 0.2], intensity = 1 }\n",
    ),
    (
        "spot",
        "[[light]]\nname = \"l\"\nspot = { position = [0.3, 2.2, 0.2], direction = [-0.3, -2.2, 0], inner_deg = 30, outer_deg = 40, intensity = 1 }\n",
    ),
    (
        "area",
        "[[object]]\nname = \"l\"\nquad = { center = [0.3, 2.2, 0.2], u = [0.05, 0, 0], v = [0, 0, 0.05] }\nemission = 1\n",
    ),
    (
        "directional",
        "[[light]]\nname = \"l\"\ndirectional = { direction = [-0.1, -1, 0], irradiance = 1 }\n",
    ),
];

const BATCHES: u32 = 64;

fn caustic(light: &str, share: f64) -> Measured {
    let text = SCENE.replace("SHARE", &share.to_string()) + light;
    let (scene, settings) = scene(&text);
    let aimed = scene.casters.count();
    assert_eq!(aimed, if share > 0.0 { 2 } else { 0 });
    measure(&scene, &settings, BATCHES, 160 * test_scale(), &["LSSDE"])
}

#[test]
fn a_small_glass_is_found() {
    for (name, light) in LIGHTS {
        let [plain, aimed] = [0.0, 0.5].map(|share| caustic(light, share).classes[0]);
        println!("{name}: {plain:?} without casters, {aimed:?} with");
        // rare events have a skewed mean: its own error is that of what it has found
        assert!(aimed.error < 0.05 * aimed.mean, "{name}: {aimed:?}");
        assert!(aimed.deviation(&plain) < 4.5, "{name}: not the same");
        let less = (plain.error / aimed.error).powi(2);
        println!("{name}: {less:.0} times less variance");
        // 4.5 standard errors of the logarithm of a quotient of two variances
        let chance = 4.5 * (4.0 / f64::from(BATCHES - 1)).sqrt();
        assert!(less.ln() > chance, "{name}: {less} times less variance");
    }
}
