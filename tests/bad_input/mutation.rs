//! 20,000 seeded mutations of valid files through each reader: no panic, no large allocation.
//! `ABBE_TEST_SCALE` multiplies their number, for long runs by hand.

use super::binary::{valid_exr, valid_part};
use super::models::{valid_animated_glb, valid_glb};
use abbe::io::image_file;
use abbe::math::hash::random_bits;
use rayon::prelude::*;

const MUTATIONS: u64 = 20_000;

/// Mutation `index` of `valid`: bytes changed, cut out, repeated or replaced by pieces of
/// `dictionary`.
fn mutate(valid: &[u8], index: u64, dictionary: &[&[u8]]) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    let mut counter = 0;
    let mut below = |n: usize| {
        counter += 1;
        (random_bits(index, counter) % n.max(1) as u64) as usize
    };
    for _ in 0..=below(4) {
        let at = below(bytes.len());
        let end = (at + 1 + below(16)).min(bytes.len());
        match below(6) {
            0 if at < bytes.len() => bytes[at] = below(256) as u8,
            1 if at < bytes.len() => bytes[at] ^= 1 << below(8),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            4 => drop(bytes.splice(at..end, dictionary[below(dictionary.len())].iter().copied())),
            _ if below(4) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
    bytes
}

fn run(valid: &[u8], dictionary: &[&[u8]], read: fn(&[u8])) {
    let scale = std::env::var("ABBE_TEST_SCALE").ok();
    let scale = scale.and_then(|s| s.parse().ok()).unwrap_or(1);
    (0..MUTATIONS * scale).into_par_iter().for_each(|index| {
        let bytes = mutate(valid, index, dictionary);
        let outcome = std::panic::catch_unwind(|| read(&bytes));
        assert!(
            outcome.is_ok(),
            "mutation {index} panics: {:?}",
            String::from_utf8_lossy(&bytes)
        );
    });
}

#[test]
fn scenes() {
    let dictionary: [&[u8]; 12] = [
        b"nan",
        b"-1e308",
        b"inf",
        b"[]",
        b"{}",
        b"\"\"",
        b"9223372036854775807",
        b"[[",
        b"]",
        b" = ",
        b"0",
        b"\"ball\"",
    ];
    run(
        include_bytes!("valid.toml"),
        &dictionary,
        abbe::io::scene_file::fuzz_scene,
    );
}

#[test]
fn images() {
    run(
        &valid_exr(),
        &[
            &[0; 4],
            &[255; 4],
            &[0x7f, 0xff, 0xff, 0xff],
            &[0, 0, 0, 0x80],
            b"\0",
        ],
        abbe::io::exr::fuzz_exr,
    );
}

#[test]
fn parts() {
    run(
        &valid_part(),
        &[
            &[0; 4],
            &[255; 4],
            b"-1",
            b"18446744073709551615",
            b"}",
            b"[]",
        ],
        abbe::io::part::fuzz_part,
    );
}

#[test]
fn gltf() {
    let dictionary: [&[u8]; 12] = [
        b"1e999",
        b"-1",
        b"4294967296",
        b"99999999999999999999",
        b"null",
        b"[]",
        b"{}",
        b"\"\"",
        b"true",
        &[255; 4],
        &[0; 4],
        b"KHR_materials_volume",
    ];
    run(&valid_glb(), &dictionary, abbe::io::gltf::fuzz_gltf);
    run(
        &valid_animated_glb(),
        &dictionary,
        abbe::io::gltf::fuzz_gltf,
    );
}

#[test]
fn models_of_text() {
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0\nvt 0 0\nvn 0 0 1\no a\nusemtl m\nf 1/1/1 2/1/1 3/1/1\nf -1 -2 -3\n";
    let dictionary: [&[u8]; 8] = [
        b"nan",
        b"-1",
        b"99999999999",
        b"1e39",
        b"\n",
        b"/",
        b"f 1 2 3",
        b"usemtl",
    ];
    run(obj, &dictionary, abbe::io::mtl::fuzz_model);
    run(obj, &dictionary, abbe::io::obj::fuzz_obj);
    let mtl = b"newmtl a # x\nKd 1 \\\n 0 0\nKe 1 1 1\nKs 1 1 1\nNs 20\nNi 1.5\nd 0.5\nillum 4\nPr 0.5\nPm 1\nmap_Kd -s 1 1 1 a.png\nnorm b.png\nTr 0.2\n";
    run(mtl, &dictionary, abbe::io::mtl::fuzz_mtl);
}

#[test]
fn spectra() {
    use abbe::spectrum::library::{fuzz_curve, fuzz_glass};
    let dictionary: [&[u8]; 8] = [
        b"nan",
        b"-1",
        b"1e308",
        b"0",
        b",",
        b"\n",
        b"[[",
        b"coefficients = [",
    ];
    let curve = b"# a filter\nnm,value\n400,0.25\n550.5,1\n700,0\n";
    run(curve, &dictionary, fuzz_curve);
    let glass = b"catalog = \"c\"\n[[glass]]\nname = \"a\"\nsource = \"s\"\nformula = 1\n\
        coefficients = [0.0, 0.69, 0.06, 0.4, 0.1, 0.9, 9.9]\nrange_um = [0.21, 6.7]\nk_um = [[0.3, 1e-6], [0.7, 0.0]]\n\
        [[glass]]\nname = \"b\"\nsource = \"s\"\nnk_um = [[0.3, 1.5, 3.1], [0.5, 0.2, 2.0]]\nextrapolate = true\n";
    assert!(abbe::spectrum::library::parse_glass_toml(&String::from_utf8_lossy(glass)).is_ok());
    run(glass, &dictionary, fuzz_glass);
}

#[test]
fn ply() {
    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty list uchar short w\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let dictionary: [&[u8]; 8] = [
        b"-1",
        b"4294967295",
        b"property",
        b"list",
        b"double",
        b"\n",
        &[255; 4],
        b"nan",
    ];
    let ascii = format!("ply\nformat ascii 1.0\n{header}0 0 0 1 5\n1 0 0 0\n0 1 0 0\n3 0 1 2\n");
    run(ascii.as_bytes(), &dictionary, abbe::io::ply::fuzz_ply);
    let strips = "element vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement tristrips 1\n\
                  property list int int vertex_indices\nelement face 1\nproperty list uchar int vertex_indices\n\
                  property list uchar float texcoord\nend_header\n";
    let body = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 2\n3 0 1 2 6 0 0 1 0 1 1\n";
    let ascii = format!("ply\nformat ascii 1.0\n{strips}{body}");
    run(ascii.as_bytes(), &dictionary, abbe::io::ply::fuzz_ply);
    let mut binary = format!("ply\nformat binary_little_endian 1.0\n{header}").into_bytes();
    for p in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        binary.extend(p.iter().flat_map(|v| v.to_le_bytes()));
        binary.push(0);
    }
    binary.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    run(&binary, &dictionary, abbe::io::ply::fuzz_ply);
}

/// Pieces that mutations of textures take in.
const IN_TEXTURES: [&[u8]; 6] = [
    &[0; 4],
    &[255; 4],
    b"IDAT",
    b"PLTE",
    &[0xff, 0xc0],
    &[0xff, 0xda],
];

fn run_texture(valid: &[u8]) {
    assert!(image_file::decode(valid, image_file::Encoding::Stated).is_ok());
    run(valid, &IN_TEXTURES, image_file::fuzz_image);
}

#[test]
fn png_textures() {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 8, 8);
    encoder.set_color(png::ColorType::Rgba);
    let data: Vec<u8> = (0..256).map(|i| (i * 37 % 251) as u8).collect();
    let mut writer = encoder.write_header().expect("header");
    writer.write_image_data(&data).expect("data");
    writer.finish().expect("end");
    run_texture(&png);
}

#[test]
fn jpeg_textures() {
    run_texture(include_bytes!("tiny.jpg"));
    run_texture(include_bytes!(
        "../models/cases/damaged/jpeg_scan_per_component.jpg"
    ));
}

#[test]
fn jpeg_textures_with_a_profile() {
    // a segment after the first marker
    let profile = moxcms::ColorProfile::new_display_p3()
        .encode()
        .expect("encodes");
    let mut profiled = b"\xff\xd8\xff\xe2".to_vec();
    profiled.extend((profile.len() as u16 + 16).to_be_bytes());
    profiled.extend(b"ICC_PROFILE\0\x01\x01");
    profiled.extend(profile);
    profiled.extend(&include_bytes!("tiny.jpg")[2..]);
    run_texture(&profiled);
}

#[test]
fn openexr_textures() {
    run_texture(&valid_exr());
}

#[test]
fn radiance_textures() {
    let mut picture = b"#?RADIANCE\nEXPOSURE=2\nPRIMARIES=.64 .33 .29 .6 .15 .06 .333 .333\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n".to_vec();
    for _ in 0..2 {
        picture.extend([
            2, 2, 0, 8, 136, 128, 8, 1, 2, 3, 4, 5, 6, 7, 8, 136, 0, 136, 129,
        ]);
    }
    run_texture(&picture);
}
