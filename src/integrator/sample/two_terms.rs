//! Paths of two terms: weights from the end of a path alone are those of the whole path.

use super::{SensorJob, Workspace, sample_pixel};
use crate::light::Light;
use crate::material::{LobeSpec, Material};
use crate::medium::Medium;
use crate::scene::builder::look_at;
use crate::scene::settings::{Heuristic, IntegratorKind};
use crate::scene::{Scene, SceneBuilder, Settings};
use crate::spectrum::emission::Line;
use crate::spectrum::{Curve, Emission, Ior, SensorResponse};
use crate::transport::{Cone, PassSettings};

/// Matte, smooth and rough surfaces, smoke and dispersion, below a lamp with two emission lines or,
/// without lines, below one of all wavelengths and a sky.
fn scene(has_lines: bool) -> Scene {
    let mut scene = SceneBuilder::new();
    scene.ambient(Medium {
        name: "smoke".to_owned(),
        ior: Ior::constant(1.0),
        absorption: Some(Curve::Constant(0.1)),
        use_k: false,
    });
    let flint = scene.glass("schott:N-SF11").unwrap();
    let clear = scene.material(Material::interface(0.0));
    let frosted = scene.material(Material::interface(0.3));
    let matte = scene.material(Material::diffuse(0.7));
    let mirror = LobeSpec::Mirror {
        reflectance: 0.9.into(),
    };
    let diffuse = LobeSpec::Diffuse {
        reflectance: 0.6.into(),
    };
    let half = scene.material(Material::mix([(0.4, mirror), (0.6, diffuse)]));
    scene
        .quad("floor", [0.0, -1.0, 0.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0])
        .of(matte);
    scene
        .quad("wall", [0.0, 1.0, -2.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])
        .of(half);
    for (name, x, material) in [("clear", -0.8, clear), ("frosted", 0.8, frosted)] {
        let ball = scene.sphere(name, [x, -0.2, 0.4], 0.7);
        ball.of(material).filled_with(flint);
    }
    let lamp = if has_lines {
        let line = |lambda_nm, value| Line { lambda_nm, value };
        Emission::from_lines(vec![line(486.1, 300.0), line(656.3, 900.0)])
    } else {
        Emission::from_curve(Curve::Constant(6.0))
    };
    scene
        .quad("lamp", [0.0, 2.5, 0.5], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6])
        .emits(lamp);
    if !has_lines {
        let sky = Emission::from_curve(Curve::Constant(0.4));
        scene.light("sky", Light::environment(sky, None));
    }
    let view = look_at([0.0, 0.3, 5.0], [0.0; 3], [0.0, 1.0, 0.0]);
    scene.pinhole("camera", [24, 18], view, 45_f64.to_radians());
    scene.build().unwrap()
}

#[test]
fn weights_from_the_end_of_a_path_are_those_of_all_of_it() {
    let mut compared = [0; 2];
    for (has_lines, heuristic) in [
        (false, Heuristic::VarianceAware),
        (false, Heuristic::Power2),
        (true, Heuristic::Balance),
    ] {
        let scene = scene(has_lines);
        let settings = Settings {
            integrator: IntegratorKind::Path,
            heuristic,
            ..Settings::default()
        };
        let crop = scene.sensors[0].whole_film();
        // a table asks for the classes of all paths, so that each is looked at as a whole
        let jobs = [false, true].map(|raw| SensorJob::new(&scene, 0, &settings, &crop, raw));
        let mut workspaces = [Workspace::default(), Workspace::default()];
        for index in 0..24 {
            let pass = PassSettings {
                index,
                cone: (index % 2 == 1).then(|| Cone::new(0.2)),
                ..PassSettings::default()
            };
            for pixel in (0..18).flat_map(|y| (0..24).map(move |x| (x, y))) {
                for (job, workspace) in jobs.iter().zip(&mut workspaces) {
                    sample_pixel(job, &pass, pixel, SensorResponse::Xyz, workspace);
                }
                let [short, whole] = &workspaces;
                let (short, whole) = (&short.contributions, &whole.contributions);
                assert_eq!(short.len(), whole.len(), "{pixel:?}");
                for (a, b) in short.iter().zip(whole) {
                    assert_eq!((a.s, a.t, a.target), (b.s, b.t, b.target), "{pixel:?}");
                    compared[a.s as usize] += 1;
                    for (x, y) in a.lanes.iter().zip(b.lanes) {
                        let error = (x - y).abs();
                        assert!(
                            error <= 1e-14 * y.abs(),
                            "{pixel:?} ({}, {}): {x} {y}",
                            a.s,
                            a.t
                        );
                    }
                }
            }
        }
    }
    println!("{compared:?}");
    assert!(compared.iter().all(|&n| n > 5_000), "{compared:?}");
}
