//! `--tev`: a stand-in for the viewer checks what it is sent, byte by byte.

use super::{command, fail, folder, text};
use abbe::spectrum::xyz::xyz_to_linear_srgb;
use std::io::Read;
use std::net::TcpListener;

/// Reads a message bit by bit.
struct Message<'a>(&'a [u8]);

impl Message<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.0.split_first_chunk().expect("longer");
        self.0 = rest;
        *first
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn name(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).expect("an end");
        let name = text(&self.0[..end]);
        self.0 = &self.0[end + 1..];
        name
    }

    fn channels(&mut self) {
        let names = ["R", "G", "B"].map(str::to_owned);
        assert_eq!([self.name(), self.name(), self.name()], names);
    }
}

#[test]
fn the_viewer_is_sent_the_picture_of_the_last_pass() {
    let dir = folder();
    let listener = TcpListener::bind("127.0.0.1:0").expect("binds");
    let at = listener.local_addr().expect("an address");
    let viewer = std::thread::spawn(move || {
        let mut all = Vec::new();
        let (mut stream, _) = listener.accept().expect("a client");
        stream.read_to_end(&mut all).expect("reads");
        all
    });
    let arguments = format!("render scene.toml --spp 5 -q -o a.exr --tev {at}");
    let output = command(dir.path(), &arguments).output().expect("runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let all = viewer.join().expect("ends");
    let image = abbe::io::exr::read(&dir.path().join("a.exr")).expect("reads");
    let xyz = image.xyz().expect("channels");

    let (mut rest, mut created, mut pictures) = (&all[..], 0, Vec::new());
    while !rest.is_empty() {
        let length = Message(rest).u32() as usize;
        let mut message = Message(&rest[4..length]);
        rest = &rest[length..];
        let [kind, _focus] = message.bytes();
        assert_eq!(message.name(), "abbe: camera");
        if kind == 4 {
            // a new image
            assert_eq!([message.u32(), message.u32(), message.u32()], [24, 16, 3]);
            message.channels();
            assert!(message.0.is_empty() && pictures.is_empty());
            created += 1;
            continue;
        }
        // pixels, third version
        assert_eq!(kind, 6);
        assert_eq!(message.u32(), 3);
        message.channels();
        let place = [(); 4].map(|()| message.u32());
        assert_eq!(place, [0, 0, 24, 16]);
        let layout = [(); 6].map(|()| u64::from_le_bytes(message.bytes()));
        assert_eq!(layout, [0, 1, 2, 3, 3, 3]);
        let values = [(); 3 * 24 * 16].map(|()| f32::from_le_bytes(message.bytes()));
        assert!(message.0.is_empty());
        pictures.push(values);
    }
    assert_eq!(created, 1);
    let last = pictures.last().expect("a picture");
    let (pixels, _) = xyz.as_chunks::<3>();
    for (pixel, rgb) in pixels.iter().zip(last.chunks(3)) {
        // the image holds XYZ in single precision
        for (value, expected) in rgb.iter().zip(xyz_to_linear_srgb(*pixel)) {
            let most = pixel.iter().fold(0.0, |a: f64, b| a.max(*b));
            assert!(
                (f64::from(*value) - expected).abs() <= 1e-5 * most,
                "{value} {expected}"
            );
        }
    }
}

#[test]
fn a_viewer_that_is_not_there_is_told_before_the_render() {
    let dir = folder();
    let listener = TcpListener::bind("127.0.0.1:0").expect("binds");
    let at = listener.local_addr().expect("an address");
    drop(listener);
    let message = fail(dir.path(), &format!("render scene.toml --tev {at}"), 1);
    assert!(
        message.starts_with(&format!("error: tev at {at}: ")),
        "{message}"
    );
    let message = fail(dir.path(), "render scene.toml --tev here", 2);
    assert!(message.contains("expected HOST:PORT"), "{message}");
}
