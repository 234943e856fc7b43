//! Animated models: nodes go where the same motions of a scene file take them, bones bend and morph
//! targets blend what hangs on them, at every time of the shutter.

use super::gltf::Builder;
use super::harness::{Estimate, line_images, mean, scene_in};
use abbe::geometry::{Instance, Shape, Transform};
use abbe::scene::Scene;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// A scene of the model with the key lines `model`.
fn model(folder: &Path, builder: &Builder, model: &str, rest: &str) -> Arc<Scene> {
    std::fs::write(folder.join("a.glb"), builder.glb()).expect("file");
    let text = format!("[[model]]\ngltf = \"a.glb\"\n{model}\n{rest}");
    scene_in(folder, &text).0
}

fn times() -> impl Iterator<Item = f64> {
    (0..=40).map(|i| f64::from(i) / 40.0)
}

fn assert_same_way(what: &str, a: &Transform, b: &Transform) {
    assert!(a.is_moving() && b.is_moving(), "{what} does not move");
    for t in times() {
        let (x, y) = (a.at(t).to_world, b.at(t).to_world);
        let off = (x.matrix3 - y.matrix3).to_cols_array();
        let off = off.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let off = off.max((x.translation - y.translation).length());
        // the file's numbers are f32
        assert!(off < 2e-6, "{what} at {t}: {x} {y}");
    }
}

/// A quaternion of the file.
fn turn(axis: DVec3, deg: f64) -> [f32; 4] {
    let q = DQuat::from_axis_angle(axis.normalize(), deg.to_radians());
    q.to_array().map(|v| v as f32)
}

/// An arm that turns, on it a box that slides and jumps in size, a camera and a lamp.
fn arm() -> Builder {
    let mut b = Builder::default();
    let paint = b.material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1] },
        "extensions": { "KHR_materials_unlit": {} },
    }));
    b.cube([-0.5; 3], [0.5; 3], paint);
    b.quad([-4.0, -4.0, -2.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0], paint);
    let arm = b.node(
        json!({ "children": [0, 4, 3], "translation": [0, 0.25, 0], "rotation": [1, 0, 0, 0] }),
    );
    assert_eq!(arm, 2);
    b.node(json!({ "camera": 0, "translation": [0, 0, 4] }));
    b.node(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } }, "translation": [1, 2, 3] }));
    let z = DVec3::Z;
    b.animate(
        (arm, "rotation"),
        "LINEAR",
        &[0.0, 1.0, 2.0],
        &[turn(z, 0.0), turn(z, 80.0), turn(z, 30.0)],
    );
    // slopes of Catmull and Rom: (0.5, 2, 0) to the only neighbor, half the whole way in the middle
    let (p0, p1, p2) = ([0.0f32, 0.0, 0.0], [0.5, 2.0, 0.0], [0.0, 1.0, 1.0]);
    let (m0, m1, m2) = ([0.5f32, 2.0, 0.0], [0.0, 0.5, 0.5], [-0.5, -1.0, 1.0]);
    b.animate(
        (0, "translation"),
        "CUBICSPLINE",
        &[0.0, 1.0, 2.0],
        &[m0, p0, m0, m1, p1, m1, m2, p2, m2],
    );
    b.animate(
        (0, "scale"),
        "STEP",
        &[0.0, 0.75],
        &[[1.0, 1.0, 1.0], [0.5, 1.0, 1.5]],
    );
    b.root.insert("cameras".into(), json!([{ "type": "perspective", "perspective": { "yfov": 0.7, "aspectRatio": 1, "znear": 0.1 } }]));
    b.root.insert("extensions".into(), json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "intensity": 683, "spot": { "innerConeAngle": 1.0, "outerConeAngle": 1.0 } }] } }));
    b.root.insert("scenes".into(), json!([{ "nodes": [1, 2] }]));
    b
}

#[test]
fn an_animated_model_moves_like_the_same_motions_of_a_scene_file() {
    let folder = tempfile::tempdir().expect("folder");
    let render = "[render]\nwavelengths = { line_nm = 555 }\nlanes = 1\nfilter = \"box\"\n";
    let file = model(
        folder.path(),
        &arm(),
        "at = 0.5\nshutter = [0, 1]\nresolution = [24, 24]",
        render,
    );
    let turning = "{ about = [0, 0, 0], keys = [{ time = -0.5, rotate = { axis = [0, 0, 1], deg = 0 } }, { time = 0.5, rotate = { axis = [0, 0, 1], deg = 80 } }, { time = 1.5, rotate = { axis = [0, 0, 1], deg = 30 } }] }";
    let lifted = "{ keys = [{ time = 0, translate = [0, 0.25, 0] }] }";
    let scale = 683.0 * abbe::io::gltf::PER_NIT;
    let text = format!(
        r#"{render}
[[sensor]]
resolution = [24, 24]
shutter = [0, 1]
perspective = {{ eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40.107045659157627 }}
motion = [{turning}, {lifted}]
[material.paint]
diffuse = {{ reflectance = 0.5 }}
[[object]]
quad = {{ center = [0, 0, -2], u = [4, 0, 0], v = [0, 4, 0] }}
material = "paint"
[[object]]
box = {{ min = [-0.5, -0.5, -0.5], max = [0.5, 0.5, 0.5] }}
material = "paint"
motion = [
    {{ interpolation = "step", keys = [{{ time = -0.5, scale = [1, 1, 1] }}, {{ time = 0.25, scale = [0.5, 1, 1.5] }}] }},
    {{ interpolation = "cubic", keys = [{{ time = -0.5, translate = [0, 0, 0] }}, {{ time = 0.5, translate = [0.5, 2, 0] }}, {{ time = 1.5, translate = [0, 1, 1] }}] }},
    {turning}, {lifted},
]
[[light]]
spot = {{ position = [1, 2, 3], direction = [0, 0, -1], outer_deg = 57.295779513082323, inner_deg = 57.295779513082323, intensity = {{ rgb = [1, 1, 1], scale = {scale} }} }}
motion = [{turning}, {lifted}]
"#
    );
    let toml = scene_in(folder.path(), &text);
    let boxes = |scene: &Scene, i: usize| scene.accel.instances()[i].transform.clone();
    let scaled = DAffine3::from_scale(DVec3::splat(0.5));
    // the canonical box has half edges of 1
    let own = boxes(&file, 1);
    for t in times() {
        let (x, y) = (
            own.at(t).to_world * scaled,
            boxes(&toml.0, 1).at(t).to_world,
        );
        let off = (x.matrix3 - y.matrix3).to_cols_array();
        assert!(off.iter().all(|v| v.abs() < 2e-6), "{t}: {x} {y}");
        assert!(
            (x.translation - y.translation).length() < 2e-6,
            "{t}: {x} {y}"
        );
    }
    let camera = |scene: &Scene| scene.sensors[0].camera.transform().clone();
    assert_same_way("camera", &camera(&file), &camera(&toml.0));
    let lamp = |scene: &Scene| scene.lights[0].transform.clone().expect("a spot");
    let (a, b) = (lamp(&file), lamp(&toml.0));
    for t in times() {
        let (x, y) = (a.at(t).to_world, b.at(t).to_world);
        assert!((x.translation - y.translation).length() < 2e-6);
        assert!((x.matrix3.z_axis - y.matrix3.z_axis).length() < 2e-6);
    }
    // and in the picture
    let picture = |scene: &Arc<Scene>| {
        let images = line_images(scene, 0, &toml.1, 8, 8);
        let means: Vec<f64> = images.iter().map(|image| mean(&image[0])).collect();
        Estimate::from_batches(&means)
    };
    let (x, y) = (picture(&file), picture(&toml.0));
    assert!(y.error < 0.02 * y.mean, "{y:?}");
    // the same random numbers: all that differs is which texels of the film f32 moves across an
    // edge
    assert!((x.mean / y.mean - 1.0).abs() < 2e-3, "{x:?} {y:?}");
}

/// Corners of the triangles of a mesh that changes its form, in the world.
fn corners(instance: &Instance, t: f64) -> Vec<DVec3> {
    let Shape::Deforming(mesh) = &instance.shape else {
        panic!("does not change its form: {:?}", instance.shape)
    };
    let world = instance.transform.at(t).to_world;
    (0..mesh.triangle_count() as u32)
        .flat_map(|prim| mesh.corners(prim, t))
        .map(|p| world.transform_point3(p))
        .collect()
}

/// Every corner is where `at` takes one of `rest`, and none of `rest` is missing.
fn assert_vertices(
    instance: &Instance,
    t: f64,
    rest: &[DVec3],
    within: f64,
    at: impl Fn(DVec3) -> DVec3,
) {
    let found = corners(instance, t);
    for p in rest {
        let wanted = at(*p);
        let off = found
            .iter()
            .map(|q| q.distance(wanted))
            .fold(f64::MAX, f64::min);
        assert!(
            off <= within,
            "at {t}: {p} should be at {wanted}, {off:.1e} from anything"
        );
    }
}

const LIT: &str = "[[light]]\nenvironment = { radiance = 1 }\n";

#[test]
fn two_bones_bend_what_hangs_on_them() {
    let mut b = Builder::default();
    let rest: Vec<[f32; 3]> = (0..5)
        .flat_map(|i| [[-0.5, i as f32 / 2.0, 0.0], [0.5, i as f32 / 2.0, 0.0]])
        .collect();
    let indices: Vec<u16> = (0..4u16)
        .flat_map(|i| [0, 1, 3, 0, 3, 2].map(|v| v + 2 * i))
        .collect();
    let share = |y: f32| (y - 0.5).clamp(0.0, 1.0);
    let joints: Vec<[f32; 4]> = rest.iter().map(|_| [0.0, 1.0, 0.0, 0.0]).collect();
    let weights: Vec<[f32; 4]> = rest
        .iter()
        .map(|p| [1.0 - share(p[1]), share(p[1]), 0.0, 0.0])
        .collect();
    let (joints, weights) = (b.floats(&joints, "VEC4"), b.floats(&weights, "VEC4"));
    let more = json!({ "attributes": { "JOINTS_0": joints, "WEIGHTS_0": weights } });
    let mesh = b.bare_mesh(&rest, &indices, &more);
    // the node's own place must not matter, that of the joints and the model's must
    b.node(json!({ "mesh": mesh, "skin": 0, "translation": [7, 7, 7] }));
    b.node(json!({ "children": [2], "translation": [0, 0, 1] }));
    b.node(json!({ "translation": [0, 1, 0] }));
    let bind = |y: f32| {
        let mut m = [0.0; 16];
        for i in [0, 5, 10, 15] {
            m[i] = 1.0;
        }
        m[13] = -y;
        m
    };
    b.skin(&[1, 2], &[bind(0.0), bind(1.0)]);
    b.animate(
        (2, "rotation"),
        "LINEAR",
        &[0.0, 2.0],
        &[turn(DVec3::Z, 0.0), turn(DVec3::Z, 170.0)],
    );
    b.root.insert("scenes".into(), json!([{ "nodes": [0, 1] }]));
    let folder = tempfile::tempdir().expect("folder");
    let staging = "at = 0.5\nshutter = [0, 1]\ntransform = [{ translate = [3, 0, 0] }]";
    let scene = model(folder.path(), &b, staging, LIT);
    let rest: Vec<DVec3> = rest.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    for t in times() {
        let bend = DQuat::from_rotation_z((85.0 * (t + 0.5)).to_radians());
        let at = |p: DVec3| {
            let w = f64::from(share(p.y as f32));
            let bent = DVec3::Y + bend * (p - DVec3::Y);
            p.lerp(bent, w) + dvec3(3.0, 0.0, 1.0)
        };
        // lines instead of arcs: a ten-thousandth of the mesh, whose diagonal is 2.59 as the
        // shutter opens
        assert_vertices(&scene.accel.instances()[0], t, &rest, 2.59e-4, at);
    }
    // at a moment it is an ordinary mesh
    let still = model(folder.path(), &b, "at = 1.5", LIT);
    assert!(matches!(still.accel.instances()[0].shape, Shape::Mesh(_)));
    assert!(!still.is_moving);
}

#[test]
fn morph_targets_blend_by_their_weights() {
    let mut b = Builder::default();
    let rest = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let (first, second) = (
        b.floats(
            &[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
            "VEC3",
        ),
        b.floats(
            &[[0.0f32, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.0]],
            "VEC3",
        ),
    );
    let more = json!({ "targets": [{ "POSITION": first }, { "POSITION": second }] });
    let mesh = b.bare_mesh(&rest, &[0, 1, 2], &more);
    b.node(json!({ "mesh": mesh, "translation": [0, 0, 1] }));
    b.node(json!({ "mesh": mesh, "weights": [0, 0.5] }));
    b.animate(
        (0, "weights"),
        "LINEAR",
        &[0.0, 0.5, 1.0],
        &[[0.0f32], [1.0], [1.0], [0.25], [-1.0], [0.25]],
    );
    let folder = tempfile::tempdir().expect("folder");
    let moving = |interpolation: &str| {
        let mut json = b.json();
        json["animations"][0]["samplers"][0]["interpolation"] = json!(interpolation);
        std::fs::write(folder.path().join("a.glb"), b.glb_with(&json)).expect("file");
        let text = format!("[[model]]\ngltf = \"a.glb\"\nshutter = [0, 1]\n{LIT}");
        scene_in(folder.path(), &text).0
    };
    let rest: Vec<DVec3> = rest.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    let morphed = |p: DVec3, a: f64, b: f64| p + dvec3(p.x * a, 0.0, p.y * 2.0 * b + 1.0);
    let linear = moving("LINEAR");
    let step = moving("STEP");
    for t in times() {
        let (u, v) = (2.0 * t.min(0.5), 2.0 * t.max(0.5) - 1.0);
        let (wa, wb) = (u - 2.0 * v, 1.0 - 0.75 * u);
        let at = |p: DVec3| morphed(p, wa, wb);
        assert_vertices(&linear.accel.instances()[0], t, &rest, 1e-6, at);
        let (wa, wb) = match t {
            t if t < 0.5 => (0.0, 1.0),
            t if t < 1.0 => (1.0, 0.25),
            _ => (-1.0, 0.25),
        };
        let at = |p: DVec3| morphed(p, wa, wb);
        assert_vertices(&step.accel.instances()[0], t, &rest, 1e-6, at);
    }
    // the other node has weights of its own, which rest
    let Shape::Mesh(still) = &linear.accel.instances()[1].shape else {
        panic!("moves")
    };
    assert!((still.area() - 0.5 * 2f64.sqrt()).abs() < 1e-6);
}

#[test]
fn a_camera_under_an_uneven_scale_stays_a_camera() {
    let mut b = arm();
    b.animate(
        (2, "scale"),
        "LINEAR",
        &[0.0, 2.0],
        &[[1.0, 1.0, 1.0], [3.0, 1.0, 2.0]],
    );
    let folder = tempfile::tempdir().expect("folder");
    let scene = model(folder.path(), &b, "at = 0.5\nshutter = [0, 1]", "");
    let camera = scene.sensors[0].camera.transform();
    for t in times() {
        let here = camera.at(t).to_world;
        let gram = here.matrix3.transpose() * here.matrix3;
        let off = (gram - glam::DMat3::IDENTITY).to_cols_array();
        assert!(off.iter().all(|v| v.abs() < 1e-12), "{t}: {here}");
        // on the axis of the turn: at 4 times the scale along z, which goes from 1.25 to 1.75
        let wanted = dvec3(0.0, 0.25, 4.0 * (1.25 + 0.5 * t));
        assert!((here.translation - wanted).length() < 1e-5, "{t}: {here}");
    }
}
