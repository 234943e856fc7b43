//! Gamut mapping: colors that a display cannot show, at the same hue and lightness.
//!
//! Hue and lightness are those of Oklab (Ottosson 2020). What the display can show stays as it is.
//! Beyond, chroma falls from the edge of the gamut to a smooth hull inside it: the edge itself has
//! a cusp at every primary, where a spectrum cut at the edge would show steps.

use super::Display;
use crate::spectrum::xyz::{oklab_to_xyz, xyz_to_oklab};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Excess over 0..1 that is rounding of the matrices (published to seven digits).
const ROUNDING: f64 = 1e-6;
/// Hues around the circle and lightnesses from 0 to 1 of the tables.
const HUES: usize = 180;
const LIGHTNESSES: usize = 65;
/// Reach of the hull's smoothing, in hues (16 degrees) and lightnesses (0.05).
const REACH: [usize; 2] = [8, 3];
/// Chroma that no color of a display has, and the steps up to it.
const MOST_CHROMA: f64 = 0.45;
const CHROMA_STEPS: u32 = 512;
/// Bisections for the edge: to 1e-7 of the color's chroma.
const EDGE_STEPS: u32 = 23;
/// How fast chroma falls to the hull, per distance between hull and edge.
const FALL: f64 = 10.0;

fn fits(rgb: [f64; 3]) -> bool {
    rgb.iter().all(|v| (-ROUNDING..=1.0 + ROUNDING).contains(v))
}

/// Linear red, green and blue of the display for XYZ with Y up to 1.
#[must_use]
pub fn into_gamut(xyz: [f64; 3], display: Display) -> [f64; 3] {
    let rgb = display.linear(xyz);
    if fits(rgb) {
        return rgb.map(|v| v.clamp(0.0, 1.0));
    }
    let [lightness, a, b] = xyz_to_oklab(xyz);
    let lightness = lightness.clamp(0.0, 1.0);
    let chroma = a.hypot(b);
    let at = |share: f64| display.linear(oklab_to_xyz([lightness, a * share, b * share]));
    // shares of the color's own chroma
    let hull = hull(display).at(lightness, b.atan2(a)) / chroma.max(1e-9);
    if hull >= 1.0 {
        return at(1.0).map(|v| v.clamp(0.0, 1.0));
    }
    let (mut edge, mut outside) = (hull, 1.0);
    for _ in 0..EDGE_STEPS {
        let middle = 0.5 * (edge + outside);
        if fits(at(middle)) {
            edge = middle;
        } else {
            outside = middle;
        }
    }
    let beyond = (1.0 - edge) / (edge - hull).max(1e-9);
    let shown = hull + (edge - hull) * (-FALL * beyond).exp();
    at(shown).map(|v| v.clamp(0.0, 1.0))
}

/// Chroma of the smooth hull.
fn hull(display: Display) -> &'static Table {
    static SRGB: LazyLock<Table> = LazyLock::new(|| edge(Display::Srgb).hull());
    static P3: LazyLock<Table> = LazyLock::new(|| edge(Display::P3).hull());
    match display {
        Display::Srgb => &SRGB,
        Display::P3 => &P3,
    }
}

/// The largest chroma that a display can show.
fn edge(display: Display) -> Table {
    Table::of(|lightness, hue| {
        let (b, a) = hue.sin_cos();
        let chroma = |step: u32| MOST_CHROMA * f64::from(step) / f64::from(CHROMA_STEPS);
        // the first way out: the gamut is not convex at every hue
        let out = (1..=CHROMA_STEPS).find(|&step| {
            let c = chroma(step);
            !fits(display.linear(oklab_to_xyz([lightness, a * c, b * c])))
        });
        chroma(out.map_or(CHROMA_STEPS, |step| step - 1))
    })
}

/// Values by lightness (rows) and hue (columns).
struct Table(Vec<[f64; HUES]>);

impl Table {
    fn of(value: impl Fn(f64, f64) -> f64) -> Self {
        let row = |i: usize| {
            let lightness = i as f64 / (LIGHTNESSES - 1) as f64;
            std::array::from_fn(|j| value(lightness, TAU * j as f64 / HUES as f64))
        };
        Self((0..LIGHTNESSES).map(row).collect())
    }

    /// A smooth table below this one: the mean, over a neighborhood, of the least value within the
    /// same reach, among which the point's own is each time.
    fn hull(&self) -> Self {
        let least = self.gather(|values| values.fold(f64::INFINITY, f64::min));
        least.gather(|values| {
            let (count, sum) = values.fold((0, 0.0), |(n, sum), v| (n + 1, sum + v));
            sum / f64::from(count)
        })
    }

    fn gather(&self, value: impl Fn(&mut dyn Iterator<Item = f64>) -> f64) -> Self {
        let [hues, lightnesses] = REACH;
        let at = |i: usize, j: usize| {
            let rows = i.saturating_sub(lightnesses)..=(i + lightnesses).min(LIGHTNESSES - 1);
            let columns = (j + HUES - hues)..=(j + HUES + hues);
            let mut values =
                rows.flat_map(|row| columns.clone().map(move |c| self.0[row][c % HUES]));
            value(&mut values)
        };
        Self(
            (0..LIGHTNESSES)
                .map(|i| std::array::from_fn(|j| at(i, j)))
                .collect(),
        )
    }

    /// Bilinear; `hue` in radians.
    fn at(&self, lightness: f64, hue: f64) -> f64 {
        let x = (hue / TAU).rem_euclid(1.0) * HUES as f64;
        let y = lightness * (LIGHTNESSES - 1) as f64;
        let (i, j) = ((y as usize).min(LIGHTNESSES - 2), x as usize);
        let (v, u) = (y - i as f64, x - j as f64);
        let row = |i: usize| {
            let row = &self.0[i];
            row[j % HUES] * (1.0 - u) + row[(j + 1) % HUES] * u
        };
        row(i) * (1.0 - v) + row(i + 1) * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::xyz::{cmf, linear_srgb_to_xyz};

    #[test]
    fn colors_of_the_gamut_stay() {
        for rgb in [[0.2, 0.7, 0.1], [1.0, 0.0, 0.0], [1.0; 3], [0.0; 3]] {
            let shown = into_gamut(linear_srgb_to_xyz(rgb), Display::Srgb);
            for (a, b) in shown.iter().zip(rgb) {
                assert!((a - b).abs() < 3e-6, "{shown:?} for {rgb:?}");
            }
        }
    }

    #[test]
    fn others_keep_hue_and_lightness() {
        for nm in [440.0, 480.0, 520.0, 560.0, 600.0, 640.0] {
            for scale in [0.1, 0.3, 0.9] {
                // a mixture with gray, so that lightness stays below that of white
                let xyz = cmf(nm).map(|v| 0.2 * v * scale / cmf(nm)[1].max(0.2));
                let rgb = into_gamut(xyz, Display::Srgb);
                let [want_l, a, b] = xyz_to_oklab(xyz);
                let [got_l, c, d] = xyz_to_oklab(linear_srgb_to_xyz(rgb));
                // the tables are interpolated over a curved edge: what they leave outside is cut
                assert!(
                    (got_l - want_l).abs() < 0.01,
                    "{nm} nm: {got_l} for {want_l}"
                );
                let turn = (a * d - b * c).atan2(a * c + b * d);
                assert!(turn.abs() < 0.02, "{nm} nm: {turn}");
            }
        }
    }

    #[test]
    fn mapping_is_continuous_across_the_edge() {
        for display in [Display::Srgb, Display::P3] {
            for step in 0..36 {
                let (b, a) = (TAU * f64::from(step) / 36.0).sin_cos();
                let color = |c: f64| oklab_to_xyz([0.6, a * c, b * c]);
                let (mut inside, mut outside) = (0.0, MOST_CHROMA);
                for _ in 0..40 {
                    let middle = 0.5 * (inside + outside);
                    if fits(display.linear(color(middle))) {
                        inside = middle;
                    } else {
                        outside = middle;
                    }
                }
                let shown = |c: f64| into_gamut(color(c), display);
                let pair = shown(inside).into_iter().zip(shown(outside + 1e-6));
                let change = pair.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                assert!(change < 1e-3, "{display} at hue {step}: {change}");
            }
        }
    }

    #[test]
    fn what_is_brighter_than_white_is_white() {
        assert_eq!(
            into_gamut([3.0, 4.0, 5.0], Display::Srgb).map(f64::round),
            [1.0; 3]
        );
    }
}
