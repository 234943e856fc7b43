//! Fans of camera sub-paths: whichever wavelength is the hero finds the same one.

use super::{SensorJob, begin, walk_from};
use crate::camera::perspective::ThinLens;
use crate::geometry::{Placements, Shape, Transform};
use crate::light::Light;
use crate::material::Material;
use crate::scene::builder::look_at;
use crate::scene::{Scene, SceneBuilder, Settings};
use crate::spectrum::{Curve, Emission, SensorResponse};
use crate::transport::aim::fan::Fan;
use crate::transport::context::SharedSample;
use crate::transport::{Counters, MediaMemory, PassSettings, Subpath};
use glam::{DAffine3, DQuat, DVec2, DVec3};

/// A wall and a sky behind dispersive glass of several shapes.
fn scene() -> Scene {
    let mut scene = SceneBuilder::new();
    let flint = scene.glass("schott:N-SF11").unwrap();
    let glass = scene.material(Material::interface(0.0));
    let matte = scene.material(Material::diffuse(0.5));
    scene
        .quad("wall", [1.0, 0.0, -2.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0])
        .of(matte);
    scene
        .sphere("ball", [-1.2, 0.8, 0.0], 0.7)
        .of(glass)
        .filled_with(flint);
    let egg = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.7, 0.4, 0.7),
        DQuat::from_rotation_z(0.4),
        DVec3::new(1.0, 0.8, 0.0),
    );
    let shape = scene.object("egg", Shape::Sphere, Transform::fixed(egg));
    shape.of(glass).filled_with(flint);
    let block = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.7, 0.5, 0.5),
        DQuat::from_rotation_y(0.5),
        DVec3::new(-0.6, -0.7, 0.0),
    );
    let shape = scene.object("block", Shape::Box, Transform::fixed(block));
    shape.of(glass).filled_with(flint);
    let sky = Emission::from_curve(Curve::Constant(1.0));
    scene.light("sky", Light::environment(sky, None));
    let view = look_at([0.0, 0.0, 6.0], [0.0; 3], [0.0, 1.0, 0.0]);
    let lens = ThinLens {
        radius_m: 0.02,
        focus_distance_m: 6.0,
    };
    scene.thin_lens("camera", [40, 30], view, 40_f64.to_radians(), lens);
    scene.build().unwrap()
}

#[test]
fn every_hero_finds_the_same_fan() {
    let (scene, settings) = (scene(), Settings::default());
    let crop = scene.sensors[0].whole_film();
    let job = SensorJob::new(&scene, 0, &settings, &crop, false);
    assert!(job.strategies.fans);
    let (mut placements, mut media) = (Placements::default(), MediaMemory::default());
    let (mut first, mut again) = (Subpath::default(), Subpath::default());
    let (mut vertices, mut escapes, mut others) = (0, 0, 0);
    for index in 0..4 {
        for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
            let raster = DVec2::new(f64::from(x) + 0.43, f64::from(y) + 0.71);
            let lens = DVec2::new(0.3, 0.8);
            let mut trace = |path: &mut Subpath, raster: DVec2, turn: usize| {
                let u = (0.07 + 0.25 * f64::from(index) * 0.3 + turn as f64 / 4.0).fract();
                let pass = PassSettings {
                    index,
                    shared: Some(SharedSample {
                        u_wavelength: u,
                        heroes: 1,
                        time: 0.0,
                    }),
                    ..PassSettings::default()
                };
                let sampler = job.sampler(&pass, (x, y));
                let xyz = SensorResponse::Xyz;
                let context = begin(
                    &job,
                    &pass,
                    (&sampler, (x, y)),
                    xyz,
                    &mut placements,
                    &mut media,
                );
                let strategies = job.strategies_of(&pass, (x, y));
                let mut counters = Counters::default();
                walk_from(
                    &context,
                    &job,
                    &strategies,
                    path,
                    (raster, lens),
                    &sampler,
                    &mut counters,
                );
            };
            trace(&mut first, raster, 0);
            let Some(fan) = first.fan else { continue };
            assert!((fan.rasters[0] - raster).length() < 1e-9);
            for hero in 1..4 {
                if fan.throughput.lanes[hero] == 0.0 {
                    continue;
                }
                trace(&mut again, fan.rasters[hero], hero);
                // a label may be drawn otherwise, where its probability is another
                let surfaces = |path: &Subpath| {
                    let count = fan.vertex.min(path.vertices.len());
                    path.vertices[..count]
                        .iter()
                        .map(|v| v.id.instance)
                        .collect::<Vec<_>>()
                };
                let labels = |path: &Subpath| {
                    let all = path.densities.iter().skip(1).take(fan.vertex);
                    all.map(|d| d.label).collect::<Vec<_>>()
                };
                if surfaces(&first) != surfaces(&again) || labels(&first) != labels(&again) {
                    others += 1;
                    continue;
                }
                let what = format!("pixel {x} {y}, hero {hero}");
                let found = again.fan.unwrap_or_else(|| panic!("{what}: no fan"));
                assert_eq!(fan.vertex, found.vertex, "{what}");
                match first.vertices.get(fan.vertex) {
                    Some(vertex) => {
                        vertices += 1;
                        let p = again.vertices[fan.vertex].p;
                        assert!(p.distance(vertex.p) < 1e-6, "{what}: {p} {}", vertex.p);
                    }
                    None => {
                        escapes += 1;
                        let [a, b] = [&first, &again].map(|path| path.escape.map(|e| e.direction));
                        let off = a.zip(b).map(|(a, b)| a.distance(b));
                        assert!(off.is_some_and(|off| off < 1e-6), "{what}: {off:?}");
                    }
                }
                assert!((found.raster - fan.raster).length() < 1e-5, "{what}");
                for j in 0..4 {
                    let i = (j + hero) % 4;
                    let weight = |fan: &Fan, j: usize| {
                        fan.throughput.scale * f64::from(fan.throughput.lanes[j])
                    };
                    let [a, b] = [weight(&fan, i), weight(&found, j)];
                    assert_eq!(a > 0.0, b > 0.0, "{what}, lane {i}");
                    if a == 0.0 {
                        continue;
                    }
                    assert!((a / b - 1.0).abs() < 1e-5, "{what}, lane {i}: {a} {b}");
                    let off = (found.rasters[j] - fan.rasters[i]).length();
                    assert!(off < 1e-5, "{what}, lane {i}: {off} pixels");
                    let share = found.shares[j] / fan.shares[i];
                    assert!((share - 1.0).abs() < 1e-5, "{what}, lane {i}: {share}");
                }
            }
        }
    }
    println!("{vertices} vertices, {escapes} directions, {others} of other labels");
    assert!(vertices > 500 && escapes > 500, "{vertices} {escapes}");
    assert!(others < (vertices + escapes) / 20, "{others}");
}
