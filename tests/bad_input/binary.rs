//! Damaged images and part files, and files that promise more than they hold.

use abbe::film::Crop;
use abbe::io::{exr, part};
use std::fs;
use std::path::Path;

/// A small valid image as bytes.
pub fn valid_exr() -> Vec<u8> {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("a.exr");
    let xyz: Vec<f64> = (0..8 * 6 * 3).map(|i| f64::from(i).sin().abs()).collect();
    let mut metadata = exr::ImageMetadata::default();
    metadata.entries.push((
        "integrator".to_owned(),
        exr::MetadataValue::Text("bdpt".to_owned()),
    ));
    let crop = Crop::whole(8, 6);
    let image = exr::ExrImage {
        width: 8,
        height: 6,
        crop,
        channels: exr::xyz_channels(&xyz),
        metadata,
    };
    exr::write(&path, &image).expect("writes");
    fs::read(&path).expect("reads")
}

/// A small valid part as bytes.
pub fn valid_part() -> Vec<u8> {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("a.part");
    let header = part::PartHeader {
        image: std::collections::BTreeMap::new(),
        version: "0.1.0".to_owned(),
        scene_hash: 1,
        settings_hash: 2,
        sensor: "view".to_owned(),
        width: 4,
        height: 2,
        crop: [0, 0, 4, 2],
        channels: 3,
        blocks: 0,
        exponent: 0,
        pilot: 0,
        passes: vec![part::PassRange {
            seed: 0,
            start: 0,
            end: 4,
        }],
        unfinished: Some(part::UnfinishedName { seed: 0, pass: 4 }),
        companions: Vec::new(),
        spectral: None,
    };
    part::write(
        &path,
        &part::Part {
            header,
            sums: (0..48).map(|i| i * 1_000_000_007).collect(),
            unfinished: Some(abbe::render::UnfinishedPass {
                pass: 4,
                done: vec![5],
                sums: (0..24).map(|i| i * 1_000_003).collect(),
            }),
        },
    )
    .expect("writes");
    fs::read(&path).expect("reads")
}

fn read_error<T>(bytes: &[u8], read: impl Fn(&Path) -> Result<T, String>) -> String {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("bad");
    fs::write(&path, bytes).expect("writes");
    let Err(message) = read(&path) else {
        panic!("no error")
    };
    message
        .strip_prefix(&format!("{}: ", path.display()))
        .expect("the message begins with the path")
        .to_owned()
}

fn part_error(bytes: &[u8]) -> String {
    read_error(bytes, |p| part::read(p).map_err(|e| e.to_string()))
}

fn exr_error(bytes: &[u8]) -> String {
    read_error(bytes, |p| exr::read(p).map_err(|e| e.to_string()))
}

#[test]
fn damaged_parts() {
    let valid = valid_part();
    let with = |at: usize, new: &[u8]| {
        let mut bytes = valid.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        bytes
    };
    let with_header = |from: &str, to: &str| {
        let header_len = u32::from_le_bytes([valid[12], valid[13], valid[14], valid[15]]) as usize;
        let header = String::from_utf8(valid[16..16 + header_len].to_vec())
            .expect("json")
            .replace(from, to);
        assert!(header.contains(to), "{from}");
        [
            &valid[..12],
            &(header.len() as u32).to_le_bytes(),
            header.as_bytes(),
            &valid[16 + header_len..],
        ]
        .concat()
    };
    for (bytes, message) in [
        (Vec::new(), "the file is cut short"),
        (valid[..10].to_vec(), "the file is cut short"),
        (valid[..40].to_vec(), "the file is cut short"),
        (valid[..valid.len() - 1].to_vec(), "the file is cut short"),
        (
            [&valid[..], &[0]].concat(),
            "there is more after the last sum",
        ),
        (with(0, b"x"), "no part file begins like this"),
        (
            with(8, &[9]),
            "version 9, this program reads versions 6 and 7",
        ),
        (
            with(8, &[2]),
            "version 2, this program reads versions 6 and 7: render the passes again",
        ),
        (
            with(12, &[255; 4]),
            "a header of 4294967295 bytes, allowed: at most 1048576",
        ),
        (
            with(valid.len() - 40, &[1, 2, 3]),
            "the checksum does not match: the file is damaged",
        ),
        (
            with_header("[0,0,4,2]", "[0,0,5,2]"),
            "the crop is empty or outside the film",
        ),
        (
            with_header("\"channels\":3", "\"channels\":0"),
            "the number of channels is not 1 to 4096",
        ),
        (
            with_header("\"exponent\":0", "\"exponent\":9999"),
            "the exponent of the sums is not -512 to 512",
        ),
        (
            with_header("\"end\":4", "\"end\":0"),
            "a range of passes is empty",
        ),
        (
            with_header(
                "\"width\":4,\"height\":2,\"crop\":[0,0,4,2]",
                "\"width\":4000000000,\"height\":4000000000,\"crop\":[0,0,4000000000,4000000000]",
            ),
            "the header promises more sums than any file holds",
        ),
        (
            with_header(
                "\"width\":4,\"height\":2,\"crop\":[0,0,4,2]",
                "\"width\":40000,\"height\":40000,\"crop\":[0,0,40000,40000]",
            ),
            "the file is cut short",
        ),
    ] {
        assert_eq!(
            part_error(&bytes),
            format!("not a valid part file ({message})")
        );
    }
}

#[test]
fn damaged_images() {
    let valid = valid_exr();
    for length in [0, 3, 8, 40, 200, valid.len() / 2, valid.len() - 1] {
        let message = exr_error(&valid[..length]);
        assert!(
            message.starts_with("not a readable OpenEXR image ("),
            "{length}: {message}"
        );
    }
    assert_eq!(
        exr_error(b"\x89PNG\r\n\x1a\n0000"),
        "not a readable OpenEXR image (invalid: file identifier missing)"
    );
}

#[test]
fn an_image_that_promises_too_much_is_refused_before_it_is_allocated() {
    let mut bytes = valid_exr();
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes
            .windows(name.len())
            .position(|w| w == name)
            .expect("attribute")
            + name.len()
            + 4;
        // xMax and yMax
        bytes[at + 8..at + 12].copy_from_slice(&99_999_i32.to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&99_999_i32.to_le_bytes());
    }
    let message = exr_error(&bytes);
    assert!(
        message == "the number of samples is 30000000000 (allowed: at most 1073741824)"
            || message.starts_with("not a readable OpenEXR image ("),
        "{message}"
    );
}

#[test]
fn missing_files_are_named() {
    for message in [
        exr::read(Path::new("no/such.exr"))
            .expect_err("missing")
            .to_string(),
        part::read(Path::new("no/such.exr"))
            .expect_err("missing")
            .to_string(),
    ] {
        assert_eq!(
            message,
            "no/such.exr: No such file or directory (os error 2)"
        );
    }
}
