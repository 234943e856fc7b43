//! Writes the large meshes of `scenes/bench`: `cargo run --release --example bench_meshes`.

use std::f64::consts::{PI, TAU};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

fn main() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/bench/generated");
    fs::create_dir_all(&folder)?;
    torus(&folder.join("torus.obj"))?;
    bumpy_sphere(&folder.join("bumpy_sphere.obj"))?;
    glb(
        &folder.join("bumpy_sphere.obj"),
        &folder.join("bumpy_sphere.glb"),
    )
}

/// The same vertices and triangles as a GLB file.
fn glb(obj: &Path, path: &Path) -> io::Result<()> {
    let text = fs::read_to_string(obj)?;
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let (kind, rest) = line.split_at(2);
        for word in rest.split(' ') {
            if kind == "v " {
                positions.extend(word.parse::<f32>().unwrap_or(0.0).to_le_bytes());
            } else {
                let vertex: u32 = word.parse().unwrap_or(1);
                indices.extend((vertex - 1).to_le_bytes());
            }
        }
    }
    let (vertices, corners) = (positions.len() / 12, indices.len() / 4);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{total}}}],"bufferViews":[{{"buffer":0,"byteLength":{split}}},{{"buffer":0,"byteOffset":{split},"byteLength":{rest}}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3"}},{{"bufferView":1,"componentType":5125,"count":{corners},"type":"SCALAR"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}]}}"#,
        total = positions.len() + indices.len(),
        split = positions.len(),
        rest = indices.len(),
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let data = positions.len() + indices.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let mut out = BufWriter::new(File::create(path)?);
    out.write_all(b"glTF")?;
    out.write_all(&word(2))?;
    out.write_all(&word(28 + json.len() + data))?;
    out.write_all(&word(json.len()))?;
    out.write_all(b"JSON")?;
    out.write_all(json.as_bytes())?;
    out.write_all(&word(data))?;
    out.write_all(b"BIN\0")?;
    out.write_all(&positions)?;
    out.write_all(&indices)?;
    out.flush()
}

/// R = 0.6, r = 0.22, axis +y, 128 × 64 quads as flat triangles.
fn torus(path: &Path) -> io::Result<()> {
    let (around, across) = (128, 64);
    let mut out = BufWriter::new(File::create(path)?);
    for i in 0..around {
        let phi = TAU * f64::from(i) / f64::from(around);
        for j in 0..across {
            let theta = TAU * f64::from(j) / f64::from(across);
            let radius = 0.6 + 0.22 * theta.cos();
            writeln!(
                out,
                "v {} {} {}",
                radius * phi.cos(),
                0.22 * theta.sin(),
                radius * phi.sin()
            )?;
        }
    }
    let vertex = |i: i32, j: i32| (i % around) * across + j % across + 1;
    for i in 0..around {
        for j in 0..across {
            let [a, b, c, d] = [
                vertex(i, j),
                vertex(i, j + 1),
                vertex(i + 1, j + 1),
                vertex(i + 1, j),
            ];
            writeln!(out, "f {a} {b} {c}\nf {a} {c} {d}")?;
        }
    }
    out.flush()
}

/// Radius 1 + 0.05 sin 12θ sin 16φ + 0.01 sin 60θ sin 80φ; θ from +y, φ from +x to +z; 501 rows,
/// 1000 columns, poles of one vertex each: about a million flat triangles.
fn bumpy_sphere(path: &Path) -> io::Result<()> {
    let (rows, columns) = (501, 1000);
    let mut out = BufWriter::new(File::create(path)?);
    writeln!(out, "v 0 1 0")?;
    for row in 1..rows {
        let theta = PI * f64::from(row) / f64::from(rows);
        for column in 0..columns {
            let phi = TAU * f64::from(column) / f64::from(columns);
            let r = 1.0
                + 0.05 * (12.0 * theta).sin() * (16.0 * phi).sin()
                + 0.01 * (60.0 * theta).sin() * (80.0 * phi).sin();
            writeln!(
                out,
                "v {} {} {}",
                r * theta.sin() * phi.cos(),
                r * theta.cos(),
                r * theta.sin() * phi.sin()
            )?;
        }
    }
    writeln!(out, "v 0 -1 0")?;
    let vertex = |row: i32, column: i32| 2 + (row - 1) * columns + column % columns;
    let south = 2 + (rows - 1) * columns;
    for column in 0..columns {
        writeln!(out, "f 1 {} {}", vertex(1, column + 1), vertex(1, column))?;
        for row in 1..rows - 1 {
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column + 1), vertex(row + 1, column)];
            writeln!(out, "f {a} {b} {c}\nf {a} {c} {d}")?;
        }
        writeln!(
            out,
            "f {} {} {south}",
            vertex(rows - 1, column),
            vertex(rows - 1, column + 1)
        )?;
    }
    out.flush()
}
