//! Flux of a point light through a detector: its intensity times a solid angle.

use crate::harness::{scene, test_scale, with};
use abbe::film::Crop;
use abbe::math::hash::combine;
use abbe::render::{OutputRequest, Render};
use abbe::scene::Settings;
use abbe::scene::settings::IntegratorKind::Path;
use abbe::spectrum::SpectralChannels;

const SEEDS: u32 = 16;

#[test]
fn flux_is_intensity_times_solid_angle_within_its_errors() {
    let (scene, settings) = scene(SCENE);
    // of a rectangle of half edges a and b at distance d over its center
    let (a, b, d) = (0.4_f64, 0.3, 0.5);
    let solid_angle = 4.0 * (a * b / (d * (a * a + b * b + d * d).sqrt())).atan();
    let watts = 2.0 * solid_angle;
    let request = OutputRequest {
        spectral: Some(SpectralChannels::new([555.0; 2], 0, vec![555.0])),
        ..OutputRequest::default()
    };
    for (kind, passes) in [(Path, 16)] {
        let mut squares = 0.0;
        for seed in 0..SEEDS {
            let settings = Settings {
                seed: combine(settings.seed, u64::from(seed)),
                ..with(&settings, kind)
            };
            let crop = Crop::whole(16, 12);
            let mut render = Render::new(&scene, 0, &settings, crop, &request);
            for pass in 0..passes * test_scale() {
                render.add_pass(pass);
            }
            let flux = render.flux().expect("a detector");
            let (nm, line) = flux.lines_w[0];
            let error = line.error.expect("both halves");
            assert!(nm == 555.0 && flux.lines_w.len() == 1 && flux.continuum_w.is_none());
            assert!(error < 2e-2 * watts, "{kind:?}: {line:?}");
            let deviation = (line.value - watts) / error;
            assert!(deviation.abs() < 4.5, "{kind:?}: {line:?}, not {watts}");
            squares += deviation * deviation;
            // 683 lm/W at 555 nm
            let lumens = flux.luminous_lm;
            assert!((lumens.value / line.value / 683.0 - 1.0).abs() < 1e-4);
        }
        // the mean of 16 squares of standard deviations is above 3 with a probability of 1e-5
        assert!(squares / f64::from(SEEDS) < 3.0, "{kind:?}: {squares}");
    }
}

const SCENE: &str = r#"
[render]
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [16, 12]
detector = { center = [0, 0, 0], u = [0.4, 0, 0], v = [0, 0.3, 0] }
[[light]]
point = { position = [0, 0, 0.5], intensity = 2 }
"#;
