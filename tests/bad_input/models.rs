//! Hostile models and images: each gets an exact message, whatever it claims.

#[path = "../support/gltf.rs"]
mod gltf;

use abbe::geometry::Shutter;
use abbe::io::model::Staging;
use abbe::io::{gltf as reader, image_file};
use gltf::Builder;
use serde_json::{Value, json};
use std::path::Path;

/// A textured triangle pair and a cube of glass with everything a reader may trip over.
fn builder() -> Builder {
    let mut b = Builder::default();
    let texture = b.texture(2, 1, &[[255, 0, 0, 255], [0, 255, 0, 99]], true);
    let paint = b.material(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": texture, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0], "rotation": 1, "scale": [2, 2] } } } },
        "alphaMode": "MASK", "emissiveFactor": [0, 0, 0],
    }));
    let glass = b.material(json!({ "name": "glass", "pbrMetallicRoughness": { "metallicFactor": 0 }, "extensions": {
        "KHR_materials_transmission": { "transmissionFactor": 1 },
        "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [0.1, 0.2, 1] },
        "KHR_materials_dispersion": { "dispersion": 0.5 },
        "KHR_materials_ior": { "ior": 1.6 },
    }, "extras": {} }));
    b.quad([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], paint);
    b.cube([0.0; 3], [1.0; 3], glass);
    b.node(json!({ "children": [], "translation": [0, 1, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    b.root.insert(
        "extensions".into(),
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {} }] } }),
    );
    b
}

/// The message on a file whose JSON was changed.
fn changed(pointer: &str, value: Value) -> String {
    let b = builder();
    let mut json = b.json();
    let (parent, key) = pointer.rsplit_once('/').expect("pointer");
    let parent = json.pointer_mut(parent).expect("there");
    match parent {
        Value::Array(items) => items[key.parse::<usize>().expect("index")] = value,
        other => other[key] = value,
    }
    message(&b.glb_with(&json))
}

fn message(bytes: &[u8]) -> String {
    let staging = Staging {
        shutter: Shutter {
            open_s: 0.25,
            close_s: 0.75,
        },
        ..Staging::default()
    };
    match reader::read(bytes, Path::new("/nonexistent"), &staging) {
        Ok(_) => "no error".to_owned(),
        Err(message) => message,
    }
}

#[test]
fn the_valid_file_is_read() {
    let model = reader::read(
        &builder().glb(),
        Path::new("/nonexistent"),
        &Staging::default(),
    )
    .expect("valid");
    assert_eq!(
        (model.objects.len(), model.lights.len(), model.media.len()),
        (2, 1, 1)
    );
    let note = "material \"glass\": a Cauchy glass with n_d 1.6 and V_d 40.0, all that the file gives (extras.glass names a real one)";
    assert!(model.notes.iter().any(|n| n == note), "{:?}", model.notes);
}

#[test]
fn hostile_files_get_exact_messages() {
    let cases = [
        (
            "/nodes/0",
            json!({ "children": [2] , "mesh": 0 }),
            "node 2 is reached twice: the hierarchy is no tree",
        ),
        (
            "/nodes/2",
            json!({ "children": [2] }),
            "node 2 is reached twice: the hierarchy is no tree",
        ),
        ("/nodes/0/mesh", json!(7), "mesh 7 does not exist"),
        ("/scenes/0/nodes", json!([9]), "node 9 does not exist"),
        (
            "/accessors/0/count",
            json!(1_000_000_000u64),
            "accessor 0 claims 1000000000 elements of 12 bytes, but buffer view 1 has 48 bytes",
        ),
        (
            "/accessors/0/bufferView",
            json!(99),
            "buffer view 99 does not exist",
        ),
        (
            "/accessors/0/type",
            json!("VEC2"),
            "accessor 0 has elements of 2 numbers (needed: 3)",
        ),
        (
            "/bufferViews/1/byteLength",
            json!(1_u64 << 40),
            "buffer view 1: bytes 72 to 1099511627848 of buffer 0, which has 332",
        ),
        ("/buffers/0/byteLength", json!(1_000_000), "buffer 0 has"),
        (
            "/buffers/0/uri",
            json!("../secret.bin"),
            "buffer 0: file \"../secret.bin\" is outside the scene's folder",
        ),
        (
            "/buffers/0/uri",
            json!("/etc/passwd"),
            "buffer 0: file \"/etc/passwd\" is outside the scene's folder",
        ),
        (
            "/buffers/0/uri",
            json!("file:///etc/passwd"),
            "buffer 0: URI \"file:///etc/passwd\" is not read",
        ),
        (
            "/nodes/0/matrix",
            json!(vec![1e300; 16]),
            "the transform of node 0 is not finite",
        ),
        (
            "/nodes/0/matrix",
            json!(vec![3e38; 16]),
            "the transform of node 0 is not finite",
        ),
        (
            "/nodes/0/rotation",
            json!([0, 0, 0, 0]),
            "the transform of node 0 is not finite",
        ),
        (
            "/meshes/0/primitives/0/material",
            json!(5),
            "material 5 does not exist",
        ),
        (
            "/meshes/0/primitives/0/indices",
            json!(0),
            "accessor 0 is no list of indices",
        ),
        (
            "/meshes/0/primitives/0/attributes",
            json!({}),
            "mesh 0, primitive 0 has no POSITION",
        ),
        ("/textures/0/source", json!(3), "image 3 does not exist"),
        (
            "/images/0",
            json!({ "bufferView": 1 }),
            "image 0: not an image",
        ),
        (
            "/nodes/2/extensions/KHR_lights_punctual/light",
            json!(4),
            "light 4 does not exist",
        ),
        (
            "/asset/version",
            json!("1.0"),
            "glTF version \"1.0\" (supported: 2)",
        ),
        (
            "/materials/1/extras",
            json!({ "glass": "schott:N-XX" }),
            "material \"glass\", extras.glass: unknown glass",
        ),
    ];
    let mut wrong = Vec::new();
    for (pointer, value, expected) in cases {
        let found = changed(pointer, value.clone());
        if !found.starts_with(expected) {
            wrong.push(format!(
                "{pointer} = {value}\n  expected: {expected}\n  found: {found}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for name in [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_texture_basisu",
    ] {
        let b = builder();
        let mut json = b.json();
        json["extensionsRequired"] = json!([name, "KHR_materials_ior"]);
        assert_eq!(
            message(&b.glb_with(&json)),
            format!("the file requires extensions that are not supported: {name}")
        );
    }
    let glb = builder().glb();
    assert!(message(&glb[..40]).starts_with("truncated GLB file: 40 bytes of"));
    assert_eq!(message(b"glTF"), "truncated GLB file");
    assert_eq!(
        message(b"glTF\x01\0\0\0\x0c\0\0\0"),
        "GLB version 1 (supported: 2)"
    );
    assert!(message(b"{\"asset\":").starts_with("not glTF: EOF while parsing"));
}

#[test]
fn sparse_values_beyond_their_accessor_are_refused() {
    let sparse = |index: &[u8], count: u64| {
        let b = builder();
        let mut json = b.json();
        let uri = |bytes: &[u8]| format!("data:application/octet-stream;base64,{}", base64(bytes));
        json["buffers"].as_array_mut().expect("list").extend([
            json!({ "byteLength": 4, "uri": uri(index) }),
            json!({ "byteLength": 12, "uri": uri(&[0; 12]) }),
        ]);
        let n = json["bufferViews"].as_array().expect("list").len();
        json["bufferViews"].as_array_mut().expect("list").extend([
            json!({ "buffer": 1, "byteLength": 4 }),
            json!({ "buffer": 2, "byteLength": 12 }),
        ]);
        json["accessors"][0]["sparse"] = json!({
            "count": count, "indices": { "bufferView": n, "componentType": 5125 }, "values": { "bufferView": n + 1 },
        });
        message(&b.glb_with(&json))
    };
    assert_eq!(sparse(&[1, 0, 0, 0], 1), "no error");
    assert_eq!(
        sparse(&[9, 0, 0, 0], 1),
        "accessor 0, sparse: element 9 of 4"
    );
    assert!(
        sparse(&[1, 0, 0, 0], 1 << 40)
            .starts_with("accessor 0, sparse claims 1099511627776 elements of 4 bytes")
    );
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    bytes
        .chunks(3)
        .map(|c| {
            let n = c.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - c.len()));
            let digits =
                (0..=c.len()).map(|i| char::from(DIGITS[(n >> (18 - 6 * i) & 63) as usize]));
            digits.collect::<String>() + &"=".repeat(3 - c.len())
        })
        .collect()
}

#[test]
fn images_that_claim_more_than_they_hold() {
    let b = builder();
    let json = b.json();
    let view = &json["bufferViews"][0];
    let glb = b.glb();
    let start = glb.len() - 8 - json["buffers"][0]["byteLength"].as_u64().expect("n") as usize + 8;
    let png = glb[start..start + view["byteLength"].as_u64().expect("n") as usize].to_vec();
    assert!(image_file::decode(&png, image_file::Encoding::Srgb).is_ok());
    assert!(image_file::decode(&png[..png.len() - 20], image_file::Encoding::Srgb).is_err());
    let mut huge = png.clone();
    huge[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    // the checksum of the header is wrong as well: either is said
    assert!(image_file::decode(&huge, image_file::Encoding::Srgb).is_err());
}

/// A triangle with a morph target that two joints bend, all animated.
fn animated() -> Builder {
    let mut b = Builder::default();
    let rest = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let target = b.floats(&[[0.5f32; 3]; 3], "VEC3");
    let joints = b.floats(&[[0.0f32, 1.0, 0.0, 0.0]; 3], "VEC4");
    let weights = b.floats(&[[0.5f32, 0.5, 0.0, 0.0]; 3], "VEC4");
    let more = json!({
        "attributes": { "JOINTS_0": joints, "WEIGHTS_0": weights },
        "targets": [{ "POSITION": target }],
    });
    let mesh = b.bare_mesh(&rest, &[0, 1, 2], &more);
    b.node(json!({ "mesh": mesh, "skin": 0, "weights": [0.5] }));
    b.node(json!({ "children": [2] }));
    b.node(json!({}));
    let identity: [f32; 16] = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
    b.skin(&[1, 2], &[identity; 2]);
    b.animate((0, "weights"), "LINEAR", &[0.0, 1.0], &[[0.0f32], [1.0]]);
    let (here, there) = ([0.0f32, 0.0, 0.0, 1.0], [0.0f32, 0.6, 0.0, 0.8]);
    let rotations = [here, here, here, there, there, there];
    b.animate((1, "rotation"), "CUBICSPLINE", &[0.0, 1.0], &rotations);
    b.animate((2, "scale"), "STEP", &[0.0, 0.5], &[[1.0f32; 3], [2.0; 3]]);
    b.root.insert("scenes".into(), json!([{ "nodes": [0, 1] }]));
    b
}

#[test]
fn hostile_animations_get_exact_messages() {
    let b = animated();
    assert_eq!(message(&b.glb()), "no error");
    let cases = [
        (
            "/animations/0/channels/0/sampler",
            json!(9),
            "animation 0, channel 0: sampler 9 does not exist",
        ),
        (
            "/animations/0/channels/0/target/node",
            json!(9),
            "animation 0, channel 0: node 9 does not exist",
        ),
        (
            "/animations/0/samplers/0/interpolation",
            json!("WILD"),
            "animation 0, sampler 0: unknown interpolation",
        ),
        (
            "/animations/0/samplers/0/interpolation",
            json!("CUBICSPLINE"),
            "animation 0, sampler 0: 2 outputs for 2 keys (needed: 6)",
        ),
        (
            "/animations/0/samplers/0/output",
            json!(0),
            "animation 0, sampler 0: 3 outputs for 2 keys (needed: 2)",
        ),
        (
            "/animations/0/samplers/0/input",
            json!(77),
            "accessor 77 does not exist",
        ),
        (
            "/animations/0/samplers/1/input",
            json!(1),
            "accessor 1 has elements of 4 numbers (needed: 1)",
        ),
        (
            "/accessors/6/count",
            json!(0),
            "animation 0, sampler 0: 0 keys (allowed: 1 to 1048576)",
        ),
        (
            "/accessors/6",
            json!({ "componentType": 5126, "count": 2, "type": "SCALAR" }),
            "animation 0, sampler 0: the time of key 1 is not above that of the key before",
        ),
        (
            "/accessors/6",
            json!({ "componentType": 5126, "count": 4_000_000_000u64, "type": "SCALAR" }),
            "animation 0, sampler 0: 4000000000 keys (allowed: 1 to 1048576)",
        ),
        (
            "/nodes/1/matrix",
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "node 1 is animated, but placed by a matrix (allowed: translation, rotation, scale)",
        ),
        ("/nodes/0/skin", json!(3), "skin 3 does not exist"),
        (
            "/skins/0/joints",
            json!([1, 2, 0, 0]),
            "skin 0: 2 inverse bind matrices for 4 joints",
        ),
        (
            "/skins/0/joints",
            json!([1, 8]),
            "skin 0: joint 8 is not in the scene",
        ),
        ("/skins/0/joints", json!([1]), "mesh 0: joint 1 of 1"),
        (
            "/meshes/0/primitives/0/targets",
            json!([{ "POSITION": 0 }, { "POSITION": 0 }]),
            "animation 0, sampler 0: 2 outputs for 2 keys (needed: 4)",
        ),
        (
            "/meshes/0/primitives/0/targets",
            json!([{ "POSITION": 7 }]),
            "mesh 0, primitive 0: POSITION of a morph target has 2 entries for 3 positions",
        ),
        (
            "/meshes/0/primitives/0/attributes/WEIGHTS_0",
            json!(6),
            "mesh 0, primitive 0: WEIGHTS has 2 entries for 3 positions",
        ),
    ];
    let mut wrong = Vec::new();
    for (pointer, value, expected) in cases {
        let mut json = b.json();
        let (parent, key) = pointer.rsplit_once('/').expect("pointer");
        match json.pointer_mut(parent).expect("there") {
            Value::Array(items) => items[key.parse::<usize>().expect("index")] = value,
            other => other[key] = value,
        }
        let found = message(&b.glb_with(&json));
        if !found.starts_with(expected) {
            wrong.push(format!(
                "{pointer}\n  expected: {expected}\n  found: {found}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // without an animation of the weights, those of the node are looked at
    let mut json = b.json();
    json["animations"] = json!([]);
    json["nodes"][0]["weights"] = json!([1, 2, 3]);
    assert_eq!(
        message(&b.glb_with(&json)),
        "node 0: 3 weights for 1 morph targets"
    );
}

/// A valid animated file for mutations.
pub fn valid_animated_glb() -> Vec<u8> {
    animated().glb()
}

/// A valid file for mutations.
pub fn valid_glb() -> Vec<u8> {
    builder().glb()
}
