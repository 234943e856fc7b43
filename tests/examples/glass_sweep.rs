//! A sweep over glasses: how far a prism of each bends the lines C, d and F, and how that agrees
//! with Snell's law.
//!
//!     cargo run --release --example glass_sweep

#![allow(clippy::print_stdout, reason = "a program that prints its results")]

use abbe::geometry::Mesh;
use abbe::glam::{DAffine3, DVec3};
use abbe::light::Light;
use abbe::material::Material;
use abbe::render::{OutputRequest, Session, SessionOptions};
use abbe::scene::settings::IntegratorKind;
use abbe::scene::{SceneBuilder, Settings};
use abbe::spectrum::emission::Line;
use abbe::spectrum::library::Library;
use abbe::spectrum::{Emission, SpectralChannels};
use std::error::Error;
use std::f64::consts::FRAC_PI_3;

const GLASSES: [&str; 4] = [
    "schott:N-FK51A",
    "schott:N-BK7",
    "schott:F2",
    "schott:N-SF11",
];
/// Fraunhofer's lines C, d and F, in nanometers.
const LINES_NM: [f64; 3] = [656.2725, 587.5618, 486.1327];
/// Angle at the apex.
const APEX: f64 = FRAC_PI_3;
/// Angle of incidence on the first face.
const INCIDENCE: f64 = 1.05;
/// Side of the prism in meters.
const SIDE: f64 = 2e-3;
/// Distance of the detector in meters.
const DISTANCE: f64 = 2.0;
/// Deviation that meets the middle of the detector.
const MIDDLE: f64 = 0.95;
/// Columns of the detector.
const COLUMNS: u32 = 2048;
const PASSES: u32 = 4;

/// The unit vector at an angle from the x axis, in the plane of the prism's cross-section.
fn direction(angle: f64) -> DVec3 {
    DVec3::new(angle.cos(), angle.sin(), 0.0)
}

/// A prism along z about the origin, with its apex upwards.
fn prism() -> Result<Mesh, Box<dyn Error>> {
    let (half, height) = (0.5 * SIDE, (0.5 * APEX).cos() * SIDE);
    let corners = [
        [-half, -0.5 * height],
        [half, -0.5 * height],
        [0.0, 0.5 * height],
    ];
    let ends = [-SIDE, SIDE];
    let positions: Vec<[f32; 3]> = ends
        .iter()
        .flat_map(|&z| corners.map(|[x, y]| [x as f32, y as f32, z as f32]))
        .collect();
    let mut triangles = vec![[0, 2, 1], [3, 4, 5]];
    for i in 0..3 {
        let j = (i + 1) % 3;
        triangles.extend([[i, j, j + 3], [i, j + 3, i + 3]]);
    }
    Ok(Mesh::new(&positions, None, None, triangles)?)
}

/// Deviation of each line as it lands on a detector.
fn measured(glass: &str) -> Result<[f64; 3], Box<dyn Error>> {
    let mut scene = SceneBuilder::new();
    let inside = scene.glass(glass)?;
    let clear = scene.material(Material::interface(0.0));
    scene
        .mesh("prism", prism()?, DAffine3::IDENTITY)
        .of(clear)
        .filled_with(inside);
    // onto the left face, from below, so that it is bent downwards to the base
    let first_normal = std::f64::consts::PI - 0.5 * APEX;
    let along = direction(first_normal + std::f64::consts::PI + INCIDENCE);
    let face = 0.5 * SIDE * DVec3::new(-0.5, 0.0, 0.0);
    let lines = LINES_NM.map(|lambda_nm| Line {
        lambda_nm,
        value: 1.0,
    });
    let light = Emission::from_lines(lines.to_vec());
    scene.light(
        "beam",
        Light::beam(face - along * 0.1, along, light, 0.05 * SIDE),
    );
    // the detector faces the prism; columns run with the deviation
    let out = along.y.atan2(along.x) - MIDDLE;
    let u = -direction(out + std::f64::consts::FRAC_PI_2);
    let v = DVec3::Z * 0.01;
    let half = 0.4 * DISTANCE;
    scene.detector(
        "screen",
        [COLUMNS, 1],
        direction(out) * DISTANCE,
        u * half,
        v,
    );
    let settings = Settings {
        integrator: IntegratorKind::Light,
        spp: PASSES,
        ..Settings::default()
    };
    let outputs = OutputRequest {
        spectral: Some(SpectralChannels::new([360.0, 830.0], 0, LINES_NM.to_vec())),
        ..OutputRequest::default()
    };
    let options = SessionOptions {
        outputs,
        ..SessionOptions::default()
    };
    let mut session = Session::new(scene.build()?, &settings, options)?;
    session.run();
    let render = session.render();
    let (channels, film) = render
        .outputs()
        .spectral
        .as_ref()
        .ok_or("no spectral film")?;
    let image = film.image(render.passes().len() as u64);
    Ok(LINES_NM.map(|nm| {
        // lines are kept in ascending order
        let line = channels
            .lines_nm()
            .iter()
            .position(|&l| l == nm)
            .unwrap_or(0);
        // the brightest column: what is reflected inside the prism lands elsewhere
        let columns = image.iter().skip(line).step_by(film.channels());
        let brightest = columns.enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let column = brightest.map_or(0.0, |(i, _)| i as f64 + 0.5);
        let position = 2.0 * column / f64::from(COLUMNS) - 1.0;
        MIDDLE + (position * half / DISTANCE).atan()
    }))
}

/// Deviation of each line by Snell's law at both faces.
fn expected(glass: &str) -> Result<[f64; 3], Box<dyn Error>> {
    let ior = Library::embedded().ior(glass)?;
    Ok(LINES_NM.map(|nm| {
        let n = ior.n(nm);
        let second = APEX - (INCIDENCE.sin() / n).asin();
        INCIDENCE + (n * second.sin()).asin() - APEX
    }))
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "glass                C        d        F    by Snell: C        d        F   (degrees)"
    );
    for glass in GLASSES {
        let [c, d, f] = measured(glass)?.map(f64::to_degrees);
        let [x, y, z] = expected(glass)?.map(f64::to_degrees);
        println!("{glass:<14}{c:>8.3} {d:>8.3} {f:>8.3} {x:>14.3} {y:>8.3} {z:>8.3}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prisms_bend_as_snell_says() {
        for glass in GLASSES {
            let found = measured(glass).expect("renders");
            let expected = expected(glass).expect("a glass of the library");
            for (found, expected) in found.iter().zip(expected) {
                // the ray leaves within half a side of the origin; a column is 0.8 mm wide, less
                // than the other half
                let tolerance = SIDE / DISTANCE;
                assert!(
                    (found - expected).abs() < tolerance,
                    "{glass}: {found} for {expected}"
                );
            }
            assert!(
                found[0] < found[1] && found[1] < found[2],
                "blue most: {found:?}"
            );
        }
    }
}
