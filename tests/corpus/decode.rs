//! Decodes images and reads models, one outcome a line, for `run.py`, which compares them with
//! other programs.
//!
//! `corpus FOLDER FILE...` writes, per file, its number, `right`, `refused` or `panic`, what is
//! known (columns and rows, or triangles), and the message; texels go to FOLDER/NUMBER.f32 as
//! linear red, green, blue and coverage.

#![allow(clippy::print_stdout, reason = "a script reads it")]

use abbe::io::image_file::{self, Encoding};
use abbe::io::model::Staging;
use abbe::io::model_file::{self, ModelKind};
use abbe::texture::Image;
use std::error::Error;
use std::fs;
use std::path::Path;

type Outcome = Result<(String, Vec<String>), String>;

fn texels(image: &Image) -> Vec<u8> {
    let (width, height) = (image.width(), image.height());
    (0..width * height)
        .flat_map(|i| image.texel(0, i % width, i / width))
        .flat_map(f32::to_le_bytes)
        .collect()
}

fn image(path: &Path, out: &Path) -> Outcome {
    let bytes = fs::read(path).map_err(|e| e.to_string())?;
    let decoded = image_file::decode(&bytes, Encoding::Stated)?;
    fs::write(out, texels(&decoded.image)).map_err(|e| e.to_string())?;
    let size = format!("{} {}", decoded.image.width(), decoded.image.height());
    Ok((size, decoded.notes))
}

fn model(path: &Path, kind: ModelKind) -> Outcome {
    let model = model_file::load(path, kind, &Staging::default())?;
    let triangles: usize = model
        .objects
        .iter()
        .map(|o| match &o.shape {
            abbe::geometry::Shape::Mesh(mesh) => mesh.triangle_count() + mesh.dropped(),
            abbe::geometry::Shape::Deforming(mesh) => mesh.triangle_count(),
            _ => 0,
        })
        .sum();
    Ok((triangles.to_string(), model.notes))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let folder = arguments.next().ok_or("no folder")?;
    for (i, path) in arguments.enumerate() {
        let path = Path::new(&path);
        let out = Path::new(&folder).join(format!("{i}.f32"));
        let outcome = std::panic::catch_unwind(|| match ModelKind::of(path) {
            Some(kind) => model(path, kind),
            None => image(path, &out),
        });
        let line = match outcome {
            Err(_) => "panic\t\t".to_owned(),
            Ok(Err(message)) => format!("refused\t\t{}", message.replace(['\n', '\t'], " | ")),
            Ok(Ok((known, notes))) => format!("right\t{known}\t{}", notes.join("; ")),
        };
        println!("{i}\t{line}");
    }
    Ok(())
}
