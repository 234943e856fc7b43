//! Where things touch: segments through all they meet, and surfaces in one place.
//!
//! Numbers that are compared come with standard errors, and differ by less than 4.5 of them.

mod limits;
mod random;
mod reference;
mod solids;

use super::equality::LIMIT;
use super::harness::{Estimate, line_images, mean, measure, scene, with};
use abbe::scene::settings::IntegratorKind::{self, Bdpt, Light, Path, Vcm};

const ALL: [IntegratorKind; 4] = [Path, Bdpt, Light, Vcm];

/// The power on the only line, mean over the film, of a text, in independent batches.
fn batches(text: &str, kind: IntegratorKind, passes: u32) -> Vec<f64> {
    let (scene, settings) = scene(text);
    let images = line_images(&scene, 0, &with(&settings, kind), 32, passes);
    images.iter().map(|image| mean(&image[0])).collect()
}

fn power(text: &str, kind: IntegratorKind, passes: u32) -> Estimate {
    Estimate::from_batches(&batches(text, kind, passes))
}

fn assert_near(what: &str, found: &Estimate, expected: f64) {
    println!("{what}: {found:?} for {expected}");
    let deviation = (found.mean - expected).abs();
    assert!(
        deviation <= LIMIT * found.error + 1e-5 * expected.abs(),
        "{what}: {found:?}, expected {expected}"
    );
}

const HEAD: &str = r#"
[render]
wavelengths = { line_nm = 550 }
regularize = "off"
[medium.glass]
ior = 1.5
[medium.air]
ior = 1
[material.clear]
dielectric = {}
[[light]]
point = { position = [0, 0, -1], intensity = 1 }
[[sensor]]
resolution = [1, 1]
detector = { center = [0, 0, 2], normal = [0, 0, -1], width = 0.5, height = 0.5 }
"#;

/// A lamp and a detector with two faces of glass between them: a segment that starts in glass is
/// stopped by its own solid's faces, and what arrives is refracted twice.
#[test]
fn a_segment_is_stopped_by_faces_of_its_own_solid() {
    let cut = "[[object]]\nbox = { min = [-5, -5, -2], max = [5, 5, 3] }\nmaterial = \"clear\"\ninterior = \"glass\"
[[object]]\nbox = { min = [-6, -6, 0], max = [6, 6, 1] }\nmaterial = \"clear\"\ninterior = \"air\"\npriority = 1\n";
    let gap = "[[object]]\nbox = { min = [-5, -5, -2], max = [5, 5, 0] }\nmaterial = \"clear\"\ninterior = \"glass\"
[[object]]\nbox = { min = [-5, -5, 1], max = [5, 5, 3] }\nmaterial = \"clear\"\ninterior = \"glass\"\n";
    for (name, objects) in [("cut", cut), ("gap", gap)] {
        for kind in [Path, Bdpt, Vcm] {
            let (scene, settings) = scene(&format!("{HEAD}{objects}"));
            let settings = with(&settings, kind);
            let found = measure(&scene, &settings, 8, 50, &["LE", "LSSE"]);
            assert_eq!(
                found.classes[0].mean, 0.0,
                "{name} by {kind:?}: bare segments"
            );
        }
        let found = power(&format!("{HEAD}{objects}"), Light, 2_000);
        assert!(found.mean > 0.0, "{name}: refracted light arrives");
    }
}

/// Solids hidden inside one of higher priority, and solids of the same medium, stop nothing: I/d²
/// is left.
#[test]
fn a_segment_passes_what_is_hidden_and_what_is_the_same() {
    let hidden = "[[object]]\nbox = { min = [-5, -5, -2], max = [5, 5, 3] }\nmaterial = \"clear\"\ninterior = \"glass\"\npriority = 1
[[object]]\nbox = { min = [-6, -6, 0], max = [6, 6, 1] }\nmaterial = \"clear\"\ninterior = \"air\"\n";
    // the segment starts in a solid that ends on its way, inside another of the same medium
    let same = "[[object]]\nbox = { min = [-5, -5, -2], max = [5, 5, 1] }\nmaterial = \"clear\"\ninterior = \"glass\"
[[object]]\nbox = { min = [-6, -6, 0], max = [6, 6, 3] }\nmaterial = \"clear\"\ninterior = \"glass\"\n";
    // in contact, not overlapping
    let contact = "[[object]]\nbox = { min = [-5, -5, -2], max = [5, 5, 0.1] }\nmaterial = \"clear\"\ninterior = \"glass\"
[[object]]\nbox = { min = [-6, -6, 0.1], max = [6, 6, 3] }\nmaterial = \"clear\"\ninterior = \"glass\"\n";
    for kind in ALL {
        let bare = |objects: &str| {
            let (scene, settings) = scene(&format!("{HEAD}{objects}"));
            let mut found = measure(&scene, &with(&settings, kind), 8, 100, &["LE"]);
            found.classes.swap_remove(0)
        };
        let free = bare("");
        for (name, objects) in [("hidden", hidden), ("same", same), ("contact", contact)] {
            let found = bare(objects);
            println!("{name} by {kind:?}: {found:?} for {free:?}");
            let error = LIMIT * found.error.hypot(free.error) + 1e-9 * free.mean;
            assert!(
                free.mean > 0.0 && (found.mean - free.mean).abs() <= error,
                "{name} by {kind:?}: {found:?} for {free:?}"
            );
        }
    }
}

/// A block of index 1 on a gray floor under a uniform sky: 0.5 everywhere.
#[test]
fn a_block_of_air_on_a_floor_shows_the_floor() {
    let text = r#"
[render]
wavelengths = { line_nm = 550 }
merge_radius = 0.001
[[sensor]]
resolution = [6, 6]
perspective = { eye = [0.3, 4, 0.2], target = [0, 0, 0], up = [0, 0, 1], fov_deg = 10 }
[medium.g]
ior = 1
[material.clear]
dielectric = {}
[material.gray]
diffuse = { reflectance = 0.5 }
[[object]]
box = { min = [-1, 0, -1], max = [1, 1, 1] }
material = "clear"
interior = "g"
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 30], v = [30, 0, 0] }
material = "gray"
[[light]]
environment = { radiance = { lines = [[550, 1]] } }
"#;
    for kind in [Path, Bdpt, Vcm] {
        let what = format!("floor by {kind:?}");
        assert_near(&what, &power(text, kind, 8), 0.5);
    }
}

/// Slabs of index 1.5 and 1.8 in optical contact, at normal incidence: three interfaces with all
/// their reflections. A film of air between them takes more.
#[test]
fn slabs_in_optical_contact_have_three_interfaces() {
    let text = |gap: f64| {
        format!(
            r#"
[render]
wavelengths = {{ line_nm = 550 }}
[[sensor]]
resolution = [1, 1]
detector = {{ center = [0, 0, -1], normal = [0, 0, 1], width = 2, height = 2 }}
[medium.a]
ior = 1.5
[medium.b]
ior = 1.8
[material.clear]
dielectric = {{}}
[[object]]
box = {{ min = [-2, -2, {}], max = [2, 2, 0.2] }}
material = "clear"
interior = "a"
[[object]]
box = {{ min = [-2, -2, 0], max = [2, 2, 0.1] }}
material = "clear"
interior = "b"
[[light]]
beam = {{ position = [0, 0, 2], direction = [0, 0, -1], radius = 0.5, irradiance = 1 }}
"#,
            0.1 + gap
        )
    };
    // incoherent stack: transmittances of plates in series
    let through = |indices: &[f64]| {
        let (mut t, mut r) = (1.0, 0.0);
        for pair in indices.windows(2) {
            let face = ((pair[0] - pair[1]) / (pair[0] + pair[1])).powi(2);
            (t, r) = (
                t * (1.0 - face) / (1.0 - r * face),
                face + (1.0 - face).powi(2) * r / (1.0 - r * face),
            );
        }
        t * std::f64::consts::PI * 0.25 / 4.0
    };
    for kind in [Light, Bdpt] {
        let contact = power(&text(0.0), kind, 4000);
        assert_near("contact", &contact, through(&[1.0, 1.5, 1.8, 1.0]));
        let film = power(&text(1e-6), kind, 4000);
        assert_near("film of air", &film, through(&[1.0, 1.5, 1.0, 1.8, 1.0]));
    }
}
