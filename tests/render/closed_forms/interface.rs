//! Plane interfaces: η² in both media orders, the sun over water, and interfaces that are none.

use crate::harness::{line_images, line_mean, scene, test_scale, with};
use abbe::scene::settings::IntegratorKind::{Bdpt, Light, Path};

/// Unpolarized transmittance by the textbook's amplitudes.
fn transmittance(n_from: f64, n_to: f64, sin_from: f64) -> f64 {
    let (cos_from, sin_to) = ((1.0 - sin_from * sin_from).sqrt(), n_from / n_to * sin_from);
    let cos_to = (1.0 - sin_to * sin_to).sqrt();
    let r_s = (n_from * cos_from - n_to * cos_to) / (n_from * cos_from + n_to * cos_to);
    let r_p = (n_to * cos_from - n_from * cos_to) / (n_to * cos_from + n_from * cos_to);
    1.0 - 0.5 * (r_s * r_s + r_p * r_p)
}

/// Two planes with an interface between them: the light at distance `from` in index `n_from`, the
/// detector at `to` in `n_to`.
struct Sheet {
    n_from: f64,
    from: f64,
    n_to: f64,
    to: f64,
}

impl Sheet {
    /// Lateral distance of a ray by the sine of its angle on the detector's side.
    fn reach(&self, sin: f64) -> f64 {
        let sin_from = self.n_to / self.n_from * sin;
        self.to * sin / (1.0 - sin * sin).sqrt()
            + self.from * sin_from / (1.0 - sin_from * sin_from).sqrt()
    }

    /// Irradiance per unit radiance and unit area of a light patch at lateral distance `s`:
    /// (n_to/n_from)² T cosθ dω/dA.
    fn irradiance(&self, s: f64) -> f64 {
        let (mut low, mut high) = (0.0, (self.n_from / self.n_to).min(1.0));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.reach(middle) < s {
                low = middle;
            } else {
                high = middle;
            }
        }
        let sin = 0.5 * (low + high);
        let step = 1e-5;
        // cosθ dω = sinθ d(sinθ) dφ and dA = s ds dφ
        let slope = (self.reach(sin + step) - self.reach(sin - step)) / (2.0 * step);
        let sin_from = self.n_to / self.n_from * sin;
        let ratio = self.n_to / self.n_from;
        ratio * ratio * transmittance(self.n_from, self.n_to, sin_from) * sin / (slope * s)
    }

    /// Mean over a square detector of half edge `detector` under a parallel square light of half
    /// edge `light`.
    fn mean(&self, light: f64, detector: f64) -> f64 {
        let n = 24;
        // midpoints; the detector's are shifted against the light's, so that no distance is 0
        let at = |i: u32, half: f64| half * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
        let mut sum = 0.0;
        for k in 0..n * n {
            let (x, y) = (at(k / n, light), at(k % n, light));
            for j in 0..n * n / 4 {
                // by symmetry a quarter of the detector is enough
                let (u, v) = (
                    at(n / 2 + j / (n / 2), detector),
                    at(n / 2 + j % (n / 2), detector),
                );
                sum += self.irradiance((x - u).hypot(y - v));
            }
        }
        let count = f64::from(n).powi(4) / 4.0;
        sum / count * (2.0 * light).powi(2)
    }
}

/// Light in one medium, detector in the other, by the strategies that find the light, the detector,
/// or both.
fn compare_orders(scene_text: &str, sheet: &Sheet) {
    let (scene, settings) = scene(scene_text);
    let expected = sheet.mean(0.5, 0.4);
    for (kind, passes) in [(Path, 40), (Light, 60), (Bdpt, 24)] {
        let measured = line_mean(&scene, 0, &with(&settings, kind), 32, passes * test_scale());
        let what = format!("from index {} to {} by {kind:?}", sheet.n_from, sheet.n_to);
        measured.assert_is(&what, expected, 1e-2);
    }
}

#[test]
fn light_in_air_and_detector_in_glass() {
    compare_orders(
        &ORDERS
            .replace("LIGHT", "0.9, 0], u = [0.5, 0, 0], v = [0, 0, 0.5]")
            .replace("METER", "-0.7"),
        &Sheet {
            n_from: 1.0,
            from: 0.9,
            n_to: 1.5,
            to: 0.7,
        },
    );
}

#[test]
fn light_in_glass_and_detector_in_air() {
    let text = ORDERS
        .replace("LIGHT", "-0.7, 0], u = [0, 0, 0.5], v = [0.5, 0, 0]")
        .replace("METER", "0.9")
        .replace(
            "u = [0, 0, 0.4], v = [0.4, 0, 0]",
            "u = [0.4, 0, 0], v = [0, 0, 0.4]",
        );
    compare_orders(
        &text,
        &Sheet {
            n_from: 1.5,
            from: 0.7,
            n_to: 1.0,
            to: 0.9,
        },
    );
}

const ORDERS: &str = r#"
[render]
max_depth = 1
wavelengths = { line_nm = 555 }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, METER, 0], u = [0, 0, 0.4], v = [0.4, 0, 0] }
[medium.glass]
ior = 1.5
[material.clear]
dielectric = {}
[[object]]
box = { min = [-9, -9, -9], max = [9, 0, 9] }
material = "clear"
interior = "glass"
[[object]]
quad = { center = [0, LIGHT }
emission = 1
"#;

/// The sun at 30° and 60° from the zenith on water: E cosθ T(θ) below the surface.
#[test]
fn sun_over_water() {
    for degrees in [30.0_f64, 60.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (scene, settings) = scene(&WATER.replace("DIRECTION", &format!("[{sin}, -{cos}, 0]")));
        let expected = 3.0 * cos * transmittance(1.0, 1.333, sin);
        for kind in [Light, Bdpt] {
            let measured = line_mean(&scene, 0, &with(&settings, kind), 32, 50 * test_scale());
            measured.assert_is(&format!("sun at {degrees} by {kind:?}"), expected, 1.2e-2);
        }
    }
}

const WATER: &str = r#"
[render]
wavelengths = { line_nm = 550 }
[[sensor]]
resolution = [16, 16]
detector = { center = [0, -0.3, 0], u = [0, 0, 0.6], v = [0.6, 0, 0] }
[medium.water]
ior = 1.333
[material.clear]
dielectric = {}
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 1.5], v = [1.5, 0, 0] }
material = "clear"
interface = { below = "water" }
[[light]]
directional = { direction = DIRECTION, irradiance = 3 }
"#;

/// A solid of the medium around it is not there: not one bit of the image changes.
#[test]
fn object_of_the_surrounding_medium_is_not_there() {
    let ball = r#"
[[object]]
sphere = { center = [0.1, 0.1, 0], radius = 0.6 }
material = "clear"
interior = "air"
"#;
    let without = scene(MATCHED);
    let same = scene(&format!("{MATCHED}{ball}"));
    for kind in [Path, Light, Bdpt] {
        let [a, b] = [&without, &same].map(|(scene, settings)| {
            line_images(scene, 0, &with(settings, kind), 1, 16)
                .remove(0)
                .remove(0)
        });
        let bits = |image: &[f64]| {
            image
                .iter()
                .map(|v| (*v as f32).to_bits())
                .collect::<Vec<_>>()
        };
        let different = bits(&a)
            .iter()
            .zip(bits(&b))
            .filter(|(a, b)| **a != *b)
            .count();
        assert_eq!(
            different,
            0,
            "{kind:?}: {different} of {} pixels differ",
            a.len()
        );
    }
}

/// A solid of another medium of the same index has surfaces, but R = 0 and the ray goes straight
/// on: the same mean.
#[test]
fn object_of_equal_index_is_not_seen() {
    let ball = r#"
[medium.other]
ior = 1.1
[[object]]
sphere = { center = [0.1, 0.1, 0], radius = 0.6 }
material = "clear"
interior = "other"
"#;
    let without = scene(MATCHED);
    let (matched, settings) = scene(&format!("{MATCHED}{ball}"));
    let reference = line_mean(&without.0, 0, &with(&settings, Bdpt), 32, 16 * test_scale());
    for (kind, passes) in [(Path, 32), (Bdpt, 24)] {
        let measured = line_mean(
            &matched,
            0,
            &with(&settings, kind),
            32,
            passes * test_scale(),
        );
        assert!(
            measured.error.hypot(reference.error) < 6e-3 * reference.mean,
            "{measured:?} {reference:?}"
        );
        let deviation = measured.deviation(&reference);
        assert!(
            deviation < 4.5,
            "{kind:?}: {measured:?} and {reference:?} without the ball"
        );
    }
}

const MATCHED: &str = r#"
ambient = "air"
[render]
wavelengths = { line_nm = 550 }
[medium.air]
ior = 1.1
[material.clear]
dielectric = {}
[material.white]
diffuse = { reflectance = 0.7 }
[[sensor]]
resolution = [16, 16]
perspective = { eye = [0, 0.2, 2.5], target = [0, 0, 0], fov_deg = 45 }
[[object]]
quad = { center = [0, -1, 0], u = [0, 0, 1.5], v = [1.5, 0, 0] }
material = "white"
[[object]]
quad = { center = [0, 0, -1], u = [1.5, 0, 0], v = [0, 1.5, 0] }
material = "white"
[[object]]
quad = { center = [0, 1.5, 0], u = [0.8, 0, 0], v = [0, 0, 0.8] }
emission = 3
"#;
