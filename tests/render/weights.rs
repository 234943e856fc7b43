//! The mean does not depend on how strategies are weighted or how often they are executed: `path`
//! against `bdpt` under every heuristic, under random variance factors of 1 to 100 for every
//! strategy, and with few or many light sub-paths and pairs or none, with and without cones.
//!
//! A comparison resolves 1 % of the mean and fails beyond 4.5 standard errors of the difference. A
//! numerator without its factor would move the mean by tens of percent.

use super::equality::compare;
use super::harness::{Estimate, full_crop, scene, test_scale};
use abbe::light::LightId;
use abbe::math::hash::{combine, random_bits, unit_f64};
use abbe::render::{EffortChoice, OutputRequest, PilotPasses, Render, VarianceFactors};
use abbe::scene::settings::{Heuristic, IntegratorKind, Regularize};
use abbe::scene::{Scene, Settings};
use abbe::transport::class::PathClass;
use abbe::transport::factors::{Cells, FactorKey, Factors};
use rayon::prelude::*;
use std::sync::Arc;

const BATCHES: u32 = 16;
const RESOLUTION: f64 = 1e-2;

/// Two lights, smooth glass, a half mirror; a film of 6 cells.
const ROOM: &str = r#"
[render]
max_depth = 4
[[sensor]]
resolution = [12, 8]
filter = "gaussian"
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80 }
[material.white]
diffuse = { reflectance = 0.6 }
[material.half_mirror]
mix = [{ weight = 0.4, mirror = {} }, { weight = 0.5, diffuse = { reflectance = 0.9 } }]
[material.glass]
dielectric = {}
[medium.flint]
glass = "schott:N-SF11"
[[object]]
box = { min = [-1, 0, -1], max = [1, 2, 1] }
material = "white"
[[object]]
quad = { center = [0.9, 1, 0], u = [0, 0, 0.5], v = [0, 0.5, 0] }
material = "half_mirror"
[[object]]
sphere = { center = [-0.3, 0.45, 0], radius = 0.4 }
material = "glass"
interior = "flint"
[[object]]
quad = { center = [0, 1.98, 0], u = [0.5, 0, 0], v = [0, 0, 0.5] }
emission = 5
[[object]]
quad = { center = [0.5, 0.02, 0.3], u = [0, 0, 0.2], v = [0.2, 0, 0] }
emission = 4
"#;

/// 1 to 100 for every strategy of every path of up to four scattering vertices.
fn random_factors(scene: &Scene) -> VarianceFactors {
    let crop = full_crop(scene);
    let cells = Cells {
        first: [0; 2],
        size: [crop.width(), crop.height()],
        side: 4,
    };
    let mut factors = Factors::new(cells);
    let mut counter = 0;
    let mut next = || {
        counter += 1;
        (1.0 + 99.0 * unit_f64(random_bits(18, counter))) as f32
    };
    for light in 0..scene.lights.len() as u32 {
        for (depth, labels) in (0..=4).flat_map(|d| (0..1_u32 << d).map(move |l| (d, l))) {
            let mut class = PathClass::new();
            (0..depth).for_each(|i| class.push(labels >> i & 1 == 1));
            let key = FactorKey::new(LightId(light), class).expect("short");
            let values: Vec<f32> = (0..cells.count() * key.strategies())
                .map(|_| next())
                .collect();
            factors.insert(key, &values).expect("as many as cells");
        }
    }
    VarianceFactors {
        factors,
        passes: PilotPasses(0),
        samples: 0,
        found: Vec::new(),
    }
}

/// Mean Y of independent images.
fn mean(
    scene: &Arc<Scene>,
    settings: &Settings,
    passes: u32,
    factors: Option<&VarianceFactors>,
) -> Estimate {
    mean_of(scene, settings, passes, |render| {
        if let Some(factors) = factors {
            render.set_factors(Some(factors.clone()));
        }
    })
}

/// The same of renders that were changed before their first pass.
fn mean_of(
    scene: &Arc<Scene>,
    settings: &Settings,
    passes: u32,
    change: impl Fn(&mut Render) + Sync,
) -> Estimate {
    let batch = |batch: u32| {
        let settings = Settings {
            seed: combine(settings.seed, u64::from(batch) + 1),
            ..settings.clone()
        };
        let crop = full_crop(scene);
        let mut render = Render::new(scene, 0, &settings, crop, &OutputRequest::default());
        change(&mut render);
        (0..passes).for_each(|pass| render.add_pass(pass));
        let y = render.xyz().into_iter().skip(1).step_by(3);
        y.sum::<f64>() / crop.pixels() as f64
    };
    let values: Vec<f64> = (0..BATCHES).into_par_iter().map(batch).collect();
    Estimate::from_batches(&values)
}

#[test]
fn every_weighting_has_the_same_mean() {
    let (scene, settings) = scene(ROOM);
    let passes = 40 * test_scale();
    let factors = random_factors(&scene);
    let path = Settings {
        integrator: IntegratorKind::Path,
        ..settings.clone()
    };
    let path = mean(&scene, &path, 2 * passes, None);
    let with = |heuristic| Settings {
        heuristic,
        ..settings.clone()
    };
    for heuristic in [
        Heuristic::VarianceAware,
        Heuristic::Balance,
        Heuristic::Power2,
    ] {
        let found = mean(&scene, &with(heuristic), passes, None);
        compare("weights", &heuristic.to_string(), &path, &found, RESOLUTION);
    }
    for heuristic in [Heuristic::VarianceAware, Heuristic::Power2] {
        let found = mean(&scene, &with(heuristic), passes, Some(&factors));
        let what = format!("random factors, {heuristic}");
        compare("weights", &what, &path, &found, RESOLUTION);
    }
    let effort = |settings: &Settings, light_paths, pairs| Settings {
        light_paths: Some(light_paths),
        pair_probability: Some(pairs),
        ..settings.clone()
    };
    let efforts = [(0.0625, 0.25), (0.3, 1.0), (2.0, 0.25), (2.5, 0.7)];
    for (light_paths, pairs) in efforts {
        let settings = effort(&settings, light_paths, pairs);
        let found = mean(&scene, &settings, passes, None);
        let what = format!("{light_paths} light sub-paths, {pairs} of the pairs");
        compare("weights", &what, &path, &found, RESOLUTION);
    }
    // with cones narrow enough to leave no bias that would be resolved
    let mut regularized = settings.clone();
    regularized.regularization.mode = Regularize::Mis;
    regularized.regularization.epsilon = Some(0.02);
    for (what, factors) in [
        ("cones", None),
        ("cones and random factors", Some(&factors)),
    ] {
        let found = mean(&scene, &regularized, passes, factors);
        compare("weights", what, &path, &found, RESOLUTION);
    }
    let few = mean(&scene, &effort(&regularized, 0.3, 0.25), passes, None);
    compare(
        "weights",
        "cones, few light sub-paths",
        &path,
        &few,
        RESOLUTION,
    );
}

/// Nothing specular, with a lamp, before a lens.
const ROUGH: &str = r#"
[render]
max_depth = 4
regularize = "off"
[[sensor]]
resolution = [12, 8]
filter = "gaussian"
perspective = { eye = [0, 1, 0.95], target = [0, 0.9, 0], fov_deg = 80, aperture_radius = 0.02, focus_distance = 1 }
[material.white]
diffuse = { reflectance = 0.6 }
[material.gold]
conductor = { metal = "Au", roughness = 0.3 }
[[object]]
quad = { center = [0, 0, 0], u = [2, 0, 0], v = [0, 0, -2] }
material = "white"
[[object]]
quad = { center = [0, 1, -1], u = [1, 0, 0], v = [0, 1, 0] }
material = "white"
[[object]]
sphere = { center = [-0.3, 0.45, 0], radius = 0.4 }
material = "gold"
[[object]]
quad = { center = [0.5, 1.2, -0.4], u = [0.2, 0, 0], v = [0, 0.1, 0.2] }
emission = 5
"#;
/// Glass and a mirror beside it.
const SMOOTH: &str = r#"
[material.clear]
dielectric = {}
[material.mirror]
mirror = {}
[medium.glass]
ior = 1.5
[[object]]
sphere = { center = [0.5, 0.35, 0.1], radius = 0.3 }
material = "clear"
interior = "glass"
[[object]]
quad = { center = [-0.9, 1, 0], u = [0, 0, -0.5], v = [0, 0.5, 0] }
material = "mirror"
"#;
/// Light that cannot be hit.
const POINT: &str = r#"
[[light]]
point = { position = [0.6, 0.8, 0.3], intensity = 0.2 }
"#;
const SKY: &str = r#"
[[light]]
environment = { radiance = 0.3 }
"#;

/// Without light sub-paths nothing is lost: what they would have made is made by camera sub-paths,
/// at the weight of all.
#[test]
fn camera_sub_paths_alone_make_all_light() {
    without_light_sub_paths(&format!("{ROUGH}{POINT}{SKY}"), 40 * test_scale());
    without_light_sub_paths(&format!("{ROUGH}{SMOOTH}{SKY}"), 160 * test_scale());
}

fn without_light_sub_paths(text: &str, passes: u32) {
    let (scene, settings) = scene(text);
    let with = |light_paths, pairs| {
        mean_of(&scene, &settings, passes, |render| {
            render.set_effort(EffortChoice {
                light_paths,
                pairs,
                samples: 0,
            });
        })
    };
    let (usual, none) = (with(1.0, 0.25), with(0.0, 0.0));
    compare("weights", "no light sub-paths", &usual, &none, RESOLUTION);
    let path = Settings {
        integrator: IntegratorKind::Path,
        ..settings.clone()
    };
    let path = mean(&scene, &path, passes, None);
    compare(
        "weights",
        "no light sub-paths, path",
        &path,
        &none,
        RESOLUTION,
    );
}

/// A lamp that shines at the ceiling next to it: camera sub-paths alone are not taken, however few
/// of them find its light.
#[test]
fn light_sub_paths_are_kept_where_they_find_the_light() {
    let (scene, settings) = scene(
        r#"
[render]
max_depth = 8
[[sensor]]
resolution = [160, 120]
perspective = { eye = [0, 1.2, 1.9], target = [0, 1, 0], fov_deg = 60 }
[material.wall]
diffuse = { reflectance = 0.8 }
[[object]]
box = { min = [-2, 0, -2], max = [2, 2.4, 2] }
material = "wall"
[[object]]
quad = { center = [0, 2.3, 0], u = [0, 0, 0.1], v = [0.1, 0, 0] }
emission = 8
"#,
    );
    let crop = full_crop(&scene);
    let render = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
    let effort = render.choices().effort.expect("a pilot of full length");
    assert!(effort.light_paths > 0.0, "{effort}");
}

/// Where light sub-paths bring less than they cost, none are taken; where they alone find caustics,
/// they are kept.
#[test]
fn light_sub_paths_are_taken_where_they_pay() {
    let of = |integrator, more: &str| {
        let floor = r#"
[[sensor]]
resolution = [160, 120]
perspective = { eye = [0, 1.5, 2], target = [0, 0, 0], fov_deg = 40 }
[material.white]
diffuse = { reflectance = 0.6 }
[[object]]
quad = { center = [0, 0, 0], u = [4, 0, 0], v = [0, 0, -4] }
material = "white"
[[object]]
sphere = { center = [0.9, 0.3, 0.2], radius = 0.3 }
material = "white"
[[light]]
environment = { radiance = 1 }
"#;
        let (scene, settings) = scene(&format!("{floor}{more}"));
        let settings = Settings {
            integrator,
            ..settings
        };
        let crop = full_crop(&scene);
        let render = Render::new(&scene, 0, &settings, crop, &OutputRequest::default());
        render.choices().effort
    };
    let under_sky = of(IntegratorKind::Bdpt, "").expect("a pilot of full length");
    assert_eq!(under_sky.light_paths, 0.0, "{under_sky}");
    let ball = r#"
[material.mirror]
mirror = {}
[[object]]
sphere = { center = [0, 0.4, 0], radius = 0.4 }
material = "mirror"
"#;
    let mirror_under_sky = of(IntegratorKind::Bdpt, ball).expect("a pilot of full length");
    assert_eq!(mirror_under_sky.light_paths, 0.0, "{mirror_under_sky}");
    let lens = r#"
[material.clear]
dielectric = {}
[medium.glass]
ior = 1.5
[[object]]
sphere = { center = [-0.4, 0.4, 0], radius = 0.3 }
material = "clear"
interior = "glass"
[[object]]
quad = { center = [-1, 1.5, 0], u = [0.01, 0, 0], v = [0, 0, 0.01] }
emission = 5000
"#;
    let under_lamp = of(IntegratorKind::Bdpt, lens).expect("a pilot of full length");
    assert_eq!(under_lamp.light_paths, 1.0, "{under_lamp}");
    let point = "[[light]]\npoint = { position = [-1, 1.5, 0], intensity = 1 }\n";
    assert_eq!(of(IntegratorKind::Bdpt, &format!("{ball}{point}")), None);
    assert_eq!(of(IntegratorKind::Vcm, ""), None);
    assert_eq!(of(IntegratorKind::Path, ""), None);
}
