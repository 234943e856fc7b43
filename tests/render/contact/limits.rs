//! Contact is the limit of a small overlap or gap, by every integrator.
//!
//! Each scene is built twice: with its parts in contact, and with one of them moved by 2^-20 so
//! that which comes first is a matter of geometry. Both must have one mean, and all integrators
//! that of the first.

use super::super::equality::LIMIT;
use super::super::harness::Estimate;
use super::{ALL, batches};

const HEAD: &str = r#"
[render]
wavelengths = { line_nm = 550 }
regularize = "off"
max_depth = 6
merge_radius = 0.01
[medium.glass]
ior = 1.5
[medium.flint]
ior = 1.8
[medium.water]
ior = 1.33
[material.clear]
dielectric = {}
[material.gray]
diffuse = { reflectance = 0.6 }
[material.white]
diffuse = { reflectance = 0.9 }
[material.half]
diffuse = { reflectance = 0.9 }
coverage = 0.5
[material.both]
diffuse = { reflectance = 0.75 }
"#;

/// A detector that looks down from a height of 2, and a lamp beside it.
const ABOVE: &str = r#"
[[sensor]]
resolution = [2, 2]
detector = { center = [0.5, 0, 2], normal = [0, 0, -1], width = 1, height = 1 }
[[object]]
quad = { center = [-1, 0, 1.5], u = [0.8, 0, 0], v = [0, -0.8, 0] }
emission = { lines = [[550, 1]] }
"#;

fn solid(form: &str, medium: &str, priority: i32) -> String {
    format!(
        "[[object]]\n{form}\nmaterial = \"clear\"\ninterior = \"{medium}\"\npriority = {priority}\n"
    )
}

fn sheet(z: f64, half: f64, material: &str) -> String {
    format!(
        "[[object]]\nquad = {{ center = [0, 0, {z}], u = [{half}, 0, 0], v = [0, {half}, 0] }}\n{material}\n"
    )
}

fn block(low: f64, high: f64) -> String {
    format!("box = {{ min = [-1, -1, {low}], max = [1, 1, {high}] }}")
}

/// Fails unless every integrator finds the same mean in both scenes, and all of them one mean. The
/// two scenes are rendered with the same numbers, so that their difference is known far better than
/// either.
fn same(what: &str, contact: &str, limit: &str) {
    let mut reference: Option<Estimate> = None;
    for kind in ALL {
        let [a, b] = [contact, limit].map(|objects| batches(&format!("{HEAD}{objects}"), kind, 60));
        let differences: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let [a, b, difference] = [a, b, differences].map(|v| Estimate::from_batches(&v));
        println!("{what} by {kind:?}: {a:?}, less the limit {difference:?}");
        assert!(
            a.mean > 0.0 && a.error < 0.2 * a.mean,
            "{what} by {kind:?}: {a:?} resolves nothing"
        );
        // the limit itself is as far away as its parts are
        assert!(
            difference.mean.abs() <= LIMIT * difference.error.min(a.error) + 1e-5 * a.mean,
            "{what} by {kind:?}: {a:?}, in the limit {b:?}, difference {difference:?}"
        );
        let first = *reference.get_or_insert(a);
        assert!(
            (a.mean - first.mean).abs() <= LIMIT * a.error.hypot(first.error),
            "{what} by {kind:?}: {a:?}, by the first {first:?}"
        );
    }
}

/// A step that is exact in the numbers used here.
const STEP: f64 = 1.0 / 1_048_576.0;

#[test]
fn a_block_on_a_floor() {
    let text = |z| {
        ABOVE.to_owned()
            + &solid(&block(z, 0.5), "glass", 0)
            + &sheet(0.0, 3.0, "material = \"gray\"")
    };
    same("floor", &text(0.0), &text(-STEP));
    // whatever comes first in the file
    let text = |z| {
        ABOVE.to_owned()
            + &sheet(0.0, 3.0, "material = \"gray\"")
            + &solid(&block(z, 0.5), "glass", 0)
    };
    same("floor first", &text(0.0), &text(-STEP));
}

#[test]
fn a_pair_of_slabs_and_a_block_in_a_surface_of_water() {
    let slabs = |z| {
        ABOVE.to_owned()
            + &solid(&block(0.25, 0.5), "glass", 1)
            + &solid(&block(0.0, z), "flint", 0)
            + &sheet(-0.25, 3.0, "material = \"gray\"")
    };
    same("slabs", &slabs(0.25), &slabs(0.25 + STEP));
    // flush with the surface: its top is the block's
    let water = |z| {
        ABOVE.to_owned()
            + &solid("box = { min = [-2, -2, 0], max = [2, 2, 0.5] }", "water", 0)
            + &solid(&block(0.25, z), "flint", 1)
            + &sheet(-0.25, 3.0, "material = \"gray\"")
    };
    same("block in water", &water(0.5), &water(0.5 + STEP));
}

#[test]
fn a_doublet_of_two_meshes() {
    // two wedges that share a slanted face; of the limit, one reaches into the other
    let wedges = |z: f64, priority| {
        let mesh = |name: &str, at: f64| {
            format!(
                "mesh = {{ obj = \"assets/{name}.obj\" }}\ntransform = [{{ translate = [0, 0, {at}] }}]"
            )
        };
        ABOVE.to_owned()
            + &solid(&mesh("wedge_low", 0.0), "glass", priority)
            + &solid(&mesh("wedge_high", z), "flint", 0)
            + &sheet(-0.25, 3.0, "material = \"gray\"")
    };
    same("doublet", &wedges(0.0, 1), &wedges(-STEP, 1));
}

#[test]
fn a_cover_on_a_detector_and_a_die_under_a_lens() {
    let cover = |z| {
        "[[sensor]]\nresolution = [2, 2]\ndetector = { center = [0, 0, 0], normal = [0, 0, 1], width = 1, height = 1 }\n".to_owned()
            + &solid(&block(z, 0.5), "glass", 0)
            + "[[object]]\nquad = { center = [0, 0, 1], u = [0.5, 0, 0], v = [0, -0.5, 0] }\nemission = { lines = [[550, 1]] }\n"
            + "[[light]]\nenvironment = { radiance = { lines = [[550, 0.2]] } }\n"
    };
    same("cover", &cover(0.0), &cover(-STEP));
    let die = |z| {
        "[[sensor]]\nresolution = [2, 2]\ndetector = { center = [0, 0, 1], normal = [0, 0, -1], width = 1, height = 1 }\n".to_owned()
            + &sheet(0.0, 0.25, "emission = { lines = [[550, 1]] }")
            + &solid(&block(z, 0.5), "glass", 0)
    };
    same("die", &die(0.0), &die(-STEP));
}

#[test]
fn a_decal_a_poster_and_a_lamp_in_a_ceiling() {
    let wall = sheet(0.0, 3.0, "material = \"gray\"");
    let on = |z, material: &str| {
        ABOVE.to_owned() + &wall + &sheet(z, 0.5, &format!("material = \"{material}\""))
    };
    same("poster", &on(0.0, "white"), &on(STEP, "white"));
    // half of the decal and half of the wall; at a distance, light would pass the decal twice
    same("decal", &on(0.0, "half"), &on(STEP, "both"));
    for material in ["white", "half"] {
        let under = |z| {
            let sheet = sheet(z, 0.5, &format!("material = \"{material}\""));
            ABOVE.to_owned() + &sheet + &wall
        };
        same("wall over a sheet", &under(0.0), &under(-STEP));
    }
    let room = |before: &str, z: f64, after: &str| {
        let lamp = format!(
            "[[object]]\nquad = {{ center = [0, 0, {z}], u = [0.5, 0, 0], v = [0, -0.5, 0] }}\nemission = {{ lines = [[550, 1]] }}\n"
        );
        "[[sensor]]\nresolution = [2, 2]\ndetector = { center = [0, 0, 0], normal = [0, 0, 1], width = 2, height = 2 }\n".to_owned()
            + before
            + &lamp
            + after
            + "[[object]]\nquad = { center = [2, 0, 1], u = [0, 0, 1], v = [0, 1, 0] }\nemission = { lines = [[550, 0.5]] }\ntwo_sided = true\n"
    };
    let ceiling = sheet(2.0, 3.0, "material = \"gray\"");
    same(
        "lamp",
        &room(&ceiling, 2.0, ""),
        &room(&ceiling, 2.0 - STEP, ""),
    );
    // a ceiling that comes later covers the lamp, and a decal half of it
    same(
        "covered lamp",
        &room("", 2.0, &ceiling),
        &room("", 2.0 + STEP, &ceiling),
    );
    let decal = |z| sheet(z, 0.5, "material = \"half\"");
    let low = 2.0 - STEP;
    same(
        "lamp under a decal",
        &room(&ceiling, low, &decal(low)),
        &room(&ceiling, low, &decal(low - STEP)),
    );
}

#[test]
fn a_ball_on_a_plane() {
    let ball = |z: f64| {
        ABOVE.to_owned()
            + &solid(
                &format!("sphere = {{ center = [0, 0, {z}], radius = 0.5 }}"),
                "glass",
                0,
            )
            + &sheet(0.0, 3.0, "material = \"gray\"")
    };
    same("ball", &ball(0.5), &ball(0.5 - STEP));
}
