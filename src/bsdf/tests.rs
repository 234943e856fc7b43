//! Tests of all lobes through [`Bsdf`]: densities, symmetry, energy, lanes.

use super::*;
use crate::math::chi_square::{integrate_cells, sphere_p_value, uniforms};
use crate::math::stats::{Moments, sidak};
use albedo::{AlbedoTables, Needs};
use lobe::conductor::{Conductor, Metal, Mirror};
use lobe::dielectric::Dielectric;
use lobe::diffuse::Diffuse;
use lobe::rough_dielectric::RoughDielectric;
use lobe::thin::Thin;
use microfacet::Ggx;
use std::sync::LazyLock;

pub(super) const ONE: SampledSpectrum = SampledSpectrum::ONE;

/// Albedos of all lobes here that scatter more than once.
static TABLES: LazyLock<AlbedoTables> = LazyLock::new(|| {
    let mut needs = Needs::default();
    needs.reflectors.add([0.2, 0.2]);
    needs.reflectors.add([0.9, 0.3]);
    needs.interfaces.add([0.2, 0.2]);
    needs.interfaces.add([0.7, 0.7]);
    needs.interfaces.add([0.2, 0.7]);
    needs.ratios = vec![[1.4995, 1.6]];
    AlbedoTables::new(&needs)
});

/// Indices that live as long as the tests.
fn kept(lanes: [f64; MAX_LANES]) -> &'static [f64; MAX_LANES] {
    Box::leak(Box::new(lanes))
}

pub(super) fn interface(above: &[f64], below: &[f64]) -> Interface<'static> {
    let fill = |v: &[f64]| kept(std::array::from_fn(|k| v[k.min(v.len() - 1)]));
    let dispersive = above
        .iter()
        .zip(below)
        .any(|(a, b)| a / b != above[0] / below[0]);
    Interface {
        eta_above: fill(above),
        eta_below: fill(below),
        count: above.len(),
        dispersive,
        coating: None,
        polarization: crate::optics::Polarization::Average,
        albedos: &TABLES,
    }
}

/// The same with lane `hero` of the first four in front.
fn turned(base: &Interface<'static>, hero: usize) -> Interface<'static> {
    let turn = |eta: &[f64; MAX_LANES]| {
        let mut eta = *eta;
        eta[..4].rotate_left(hero);
        kept(eta)
    };
    Interface {
        eta_above: turn(base.eta_above),
        eta_below: turn(base.eta_below),
        ..*base
    }
}

pub(super) fn bsdf(lobes: &[(f32, Lobe)], interface: Interface<'static>) -> Bsdf<'static> {
    Bsdf {
        lobes: lobes.to_vec().leak(),
        interface,
    }
}

fn diffuse(reflectance: f32) -> Lobe {
    Lobe::Diffuse(Diffuse {
        reflectance: SampledSpectrum::splat(reflectance),
    })
}

fn metal() -> Metal {
    Metal {
        n: SampledSpectrum::splat(0.2),
        k: SampledSpectrum::splat(3.0),
        tint: ONE,
    }
}

fn rough_metal(alpha: [f64; 2]) -> Lobe {
    Lobe::Conductor(Conductor::single(Ggx { alpha }, metal()))
}

fn rough_glass(alpha: [f64; 2]) -> Lobe {
    Lobe::RoughDielectric(RoughDielectric {
        ggx: Ggx { alpha },
        reflect_tint: ONE,
        transmit_tint: ONE,
        multiple: false,
    })
}

fn smooth_glass() -> Lobe {
    Lobe::Dielectric(Dielectric {
        reflect_tint: ONE,
        transmit_tint: ONE,
    })
}

pub(super) fn direction(degrees: f64, turn: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin * turn.cos(), sin * turn.sin(), cos)
}

/// A fixed pseudo-random unit vector.
fn random_direction(seed: u64, i: u64) -> DVec3 {
    let [a, b, _] = uniforms(seed, i);
    crate::math::sampling::uniform_sphere([a, b])
}

/// Four lanes of a strongly dispersive glass against air that is not quite 1.
fn dispersive_interface() -> Interface<'static> {
    interface(&[1.0, 1.0001, 1.0002, 1.0003], &[1.5, 1.52, 1.55, 1.6])
}

fn pdf_of(bsdf: &Bsdf, given: DVec3, generate: Side, w: DVec3) -> f64 {
    match generate {
        Side::Camera => bsdf.eval(given, w).pdf_camera,
        Side::Light => bsdf.eval(w, given).pdf_light,
    }
}

/// Every lobe or mixture with a non-specular label, over interfaces in both orders.
fn non_specular_cases() -> Vec<Bsdf<'static>> {
    let glass = interface(&[1.0], &[1.5]);
    let flipped = interface(&[1.5], &[1.0]);
    vec![
        bsdf(&[(0.7, diffuse(0.5))], glass),
        bsdf(&[(1.0, rough_metal([0.1, 0.1]))], glass),
        bsdf(&[(1.0, rough_metal([0.9, 0.3]))], glass),
        bsdf(&[(1.0, rough_glass([0.1, 0.1]))], glass),
        bsdf(&[(1.0, rough_glass([0.6, 0.6]))], glass),
        bsdf(&[(1.0, rough_glass([0.2, 0.7]))], flipped),
        bsdf(&[(1.0, rough_glass([0.4, 0.4]))], dispersive_interface()),
        bsdf(
            &[
                (0.3, diffuse(0.8)),
                (0.2, rough_metal([0.3, 0.3])),
                (0.4, rough_glass([0.3, 0.3])),
            ],
            glass,
        ),
        bsdf(&[(0.3, diffuse(0.8)), (0.5, smooth_glass())], glass),
    ]
}

/// Lobes with multiple scattering.
fn multiple_cases() -> Vec<Bsdf<'static>> {
    let glass = interface(&[1.0], &[1.5]);
    let flipped = interface(&[1.6], &[1.0]);
    let metal = |alpha| Lobe::Conductor(Conductor::new(Ggx { alpha }, metal(), &glass));
    let interface = |alpha: [f64; 2]| {
        Lobe::RoughDielectric(RoughDielectric {
            ggx: Ggx { alpha },
            reflect_tint: SampledSpectrum::splat(0.9),
            transmit_tint: ONE,
            multiple: true,
        })
    };
    vec![
        bsdf(&[(1.0, metal([0.2, 0.2]))], glass),
        bsdf(&[(1.0, metal([0.9, 0.3]))], glass),
        bsdf(&[(1.0, interface([0.7, 0.7]))], glass),
        bsdf(&[(1.0, interface([0.2, 0.7]))], flipped),
        bsdf(&[(1.0, interface([0.7, 0.7]))], dispersive_interface()),
        bsdf(
            &[
                (0.3, diffuse(0.8)),
                (0.2, metal([0.2, 0.2])),
                (0.4, interface([0.2, 0.2])),
            ],
            dispersive_interface(),
        ),
    ]
}

fn all_cases() -> Vec<Bsdf<'static>> {
    [non_specular_cases(), multiple_cases()].concat()
}

#[test]
fn samples_have_their_density() {
    let cases = all_cases();
    let givens = [0.0, 50.0, 85.0, 120.0, 178.0];
    let level = sidak(0.01, cases.len() * givens.len() * 2);
    for (i, bsdf) in cases.iter().enumerate() {
        for degrees in givens {
            let given = direction(degrees, 0.7);
            for generate in [Side::Camera, Side::Light] {
                let draw = |u| {
                    let s = bsdf.sample(given, generate, u)?;
                    (s.label == Label::NonSpecular).then_some(s.w)
                };
                // the specular labels of a mixture count as failed: the density holds the label's
                // probability
                let pdf = |w| pdf_of(bsdf, given, generate, w);
                let p = sphere_p_value(11, 20_000, draw, &pdf);
                assert!(p > level, "case {i}, {degrees}°, {generate:?}: p = {p}");
            }
        }
    }
}

#[test]
fn a_wrong_density_is_noticed() {
    let given = direction(50.0, 0.7);
    let right = bsdf(&[(1.0, rough_glass([0.4, 0.4]))], interface(&[1.0], &[1.5]));
    let wrong = bsdf(
        &[(1.0, rough_glass([0.44, 0.4]))],
        interface(&[1.0], &[1.5]),
    );
    let draw = |u| right.sample(given, Side::Camera, u).map(|s| s.w);
    let p = sphere_p_value(3, 20_000, draw, &|w| pdf_of(&wrong, given, Side::Camera, w));
    assert!(p < 1e-6, "{p}");
    // the density of the other side is a different function
    let p = sphere_p_value(3, 20_000, draw, &|w| right.eval(given, w).pdf_light);
    assert!(p < 1e-6, "{p}");
}

#[test]
fn kernel_is_symmetric_and_densities_swap() {
    let mut cases = all_cases();
    cases.push(bsdf(
        &[(0.5, rough_glass([0.3, 0.5])), (0.2, diffuse(0.3))],
        dispersive_interface(),
    ));
    let mut transmitted = 0;
    for (i, bsdf) in cases.iter().enumerate() {
        for n in 0..2000 {
            let (a, b) = (random_direction(5, 2 * n), random_direction(5, 2 * n + 1));
            let (ab, ba) = (bsdf.eval(a, b), bsdf.eval(b, a));
            for k in 0..bsdf.interface.count {
                let (x, y) = (ab.g[k], ba.g[k]);
                assert!(
                    (x - y).abs() <= 1e-5 * x.abs(),
                    "case {i} lane {k}: {x} {y}"
                );
                transmitted += usize::from(a.z * b.z < 0.0 && x > 0.0);
            }
            let close = |x: f64, y: f64| (x - y).abs() <= 1e-9 * x.abs();
            assert!(close(ab.pdf_camera, ba.pdf_light) && close(ab.pdf_light, ba.pdf_camera));
            assert_eq!(ab.columns.is_some(), ba.columns.is_some());
            if let (Some(x), Some(y)) = (ab.columns, ba.columns) {
                for k in 0..bsdf.interface.count {
                    assert!(close(x.0.lanes[k], y.1.lanes[k]) && close(x.1.lanes[k], y.0.lanes[k]));
                }
            }
        }
    }
    assert!(transmitted > 1000, "{transmitted}");
}

#[test]
fn sample_agrees_with_eval() {
    for bsdf in all_cases() {
        for n in 0..3000 {
            let given = random_direction(9, n);
            let generate = if n % 2 == 0 {
                Side::Camera
            } else {
                Side::Light
            };
            let Some(s) = bsdf.sample(given, generate, uniforms(8, n)) else {
                continue;
            };
            if s.label != Label::NonSpecular {
                continue;
            }
            let (e, pdf, reverse) = match generate {
                Side::Camera => {
                    let e = bsdf.eval(given, s.w);
                    (e, e.pdf_camera, e.pdf_light)
                }
                Side::Light => {
                    let e = bsdf.eval(s.w, given);
                    (e, e.pdf_light, e.pdf_camera)
                }
            };
            assert!(s.pdf == pdf && s.pdf_reverse == reverse && s.pdf > 0.0);
            assert!((s.w.length() - 1.0).abs() < 1e-9);
            let eta = if s.w.z > 0.0 {
                bsdf.interface.eta_above
            } else {
                bsdf.interface.eta_below
            };
            for (k, eta) in eta.iter().enumerate().take(bsdf.interface.count) {
                let want = f64::from(e.g[k]) * eta * eta * s.w.z.abs() / s.pdf;
                assert!((f64::from(s.weight[k]) - want).abs() <= 1e-5 * want);
            }
            if let Some((own, _)) = s.columns {
                let camera = generate == Side::Camera;
                let columns = e.columns.unwrap();
                assert_eq!(own, if camera { columns.0 } else { columns.1 });
                assert!((own.lanes[0] - s.pdf).abs() <= 1e-12 * s.pdf);
            }
        }
    }
}

/// Mean weight of each lane and its standard error over `n` samples.
fn furnace(bsdf: &Bsdf, given: DVec3, n: u64) -> Vec<Moments> {
    let mut moments = vec![Moments::default(); bsdf.interface.count];
    for i in 0..n {
        let s = bsdf.sample(given, Side::Light, uniforms(21, i));
        for (k, m) in moments.iter_mut().enumerate() {
            m.push(s.map_or(0.0, |s| f64::from(s.weight[k])));
        }
    }
    moments
}

#[test]
fn no_energy_is_created() {
    let thin = Lobe::Thin(Thin {
        n: SampledSpectrum::splat(1.5),
        transmit_tint: ONE,
    });
    let air = interface(&[1.0], &[1.0]);
    let mut cases: Vec<(Bsdf, f64)> = non_specular_cases()
        .into_iter()
        .map(|bsdf| (bsdf, f64::NAN))
        .collect();
    // lossless smooth lobes keep everything
    cases.push((
        bsdf(&[(1.0, smooth_glass())], interface(&[1.0], &[1.5])),
        1.0,
    ));
    cases.push((bsdf(&[(1.0, thin)], air), 1.0));
    cases.push((bsdf(&[(1.0, Lobe::Mirror(Mirror::Perfect(ONE)))], air), 1.0));
    cases.push((
        bsdf(
            &[(0.5, thin), (0.5, Lobe::Mirror(Mirror::Perfect(ONE)))],
            air,
        ),
        1.0,
    ));
    for (i, (bsdf, exact)) in cases.iter().enumerate() {
        for degrees in [0.0, 30.0, 60.0, 80.0, 89.0, 100.0, 150.0] {
            let n = 20_000;
            for (k, m) in furnace(bsdf, direction(degrees, 0.3), n).iter().enumerate() {
                // four standard errors of the mean of n samples
                let tolerance = 4.0 * m.standard_error() + 1e-5;
                assert!(
                    m.mean <= 1.0 + tolerance,
                    "case {i} {degrees}° lane {k}: {}",
                    m.mean
                );
                if exact.is_finite() {
                    assert!(
                        (m.mean - exact).abs() <= tolerance,
                        "case {i} {degrees}°: {}",
                        m.mean
                    );
                }
            }
        }
    }
    // a diffuse lobe of weight 0.7 and reflectance 0.5, whatever the direction
    let m = furnace(&cases[0].0, direction(70.0, 0.0), 100)[0];
    assert!((m.mean - 0.35).abs() < 1e-6, "{}", m.mean);
}

#[test]
fn densities_integrate_to_at_most_one() {
    for bsdf in all_cases() {
        for degrees in [10.0, 80.0, 130.0] {
            let given = direction(degrees, 1.0);
            let total: f64 = integrate_cells(&|w| bsdf.eval(given, w).pdf_camera)
                .iter()
                .sum();
            assert!(total < 1.0 + 1e-4 && total > 0.2, "{degrees}° {total}");
        }
    }
}

#[test]
fn barely_rough_glass_splits_like_smooth_glass() {
    for (above, below) in [(1.0, 1.5), (1.5, 1.0)] {
        let interface = interface(&[above], &[below]);
        let rough = bsdf(&[(1.0, rough_glass([0.002, 0.002]))], interface);
        let given = direction(35.0, 0.4);
        let want = fresnel::dielectric(given.z, above, below);
        let refracted = fresnel::refract(given, DVec3::Z, above, below).unwrap();
        let (mut reflected, mut far, n) = (Moments::default(), 0, 20_000);
        for i in 0..n {
            let Some(s) = rough.sample(given, Side::Camera, uniforms(2, i)) else {
                far += 1;
                continue;
            };
            let up = s.w.z > 0.0;
            reflected.push(f64::from(u8::from(up)));
            let exact = if up {
                DVec3::new(-given.x, -given.y, given.z)
            } else {
                refracted
            };
            far += u64::from((s.w - exact).length() > 0.1 || (s.weight[0] - 1.0).abs() > 0.02);
        }
        // the tail of GGX beyond a facet angle of 0.05 rad holds (alpha/0.05)^2 = 1.6e-3
        assert!(far < n / 250, "{far}");
        // four standard errors of 20 000 samples, and O(alpha)
        assert!((reflected.mean - want).abs() < 4.0 * reflected.standard_error() + 2e-3);
    }
}

#[test]
fn columns_are_the_densities_of_rotated_heroes() {
    let single = rough_glass([0.3, 0.4]);
    let multiple = multiple_cases()[4].lobes[0].1;
    for glass in [single, multiple] {
        columns_rotate(&[(0.5, glass), (0.3, diffuse(0.4))]);
    }
}

fn columns_rotate(lobes: &[(f32, Lobe)]) {
    let base = dispersive_interface();
    let own = bsdf(lobes, base);
    let mut different = 0;
    for n in 0..500 {
        let (a, b) = (random_direction(31, 2 * n), random_direction(31, 2 * n + 1));
        let e = own.eval(a, b);
        assert_eq!(e.columns.is_some(), a.z * b.z < 0.0);
        let Some((camera, light)) = e.columns else {
            continue;
        };
        for k in 0..base.count {
            let hero = bsdf(lobes, turned(&base, k)).eval(a, b);
            let close = |x: f64, y: f64| (x - y).abs() <= 1e-12 * x.max(y);
            assert!(close(camera.lanes[k], hero.pdf_camera), "lane {k}");
            assert!(close(light.lanes[k], hero.pdf_light), "lane {k}");
            assert!((e.g[k] - hero.g[0]).abs() <= 1e-6 * e.g[k]);
            different += usize::from((camera.lanes[k] / camera.lanes[0] - 1.0).abs() > 0.01);
        }
    }
    assert!(different > 100, "{different}");
}

/// The balance heuristic over heroes with the columns as densities gives every lane its own albedo,
/// the one it has alone: values, lanes' densities and the lobe choice are consistent.
#[test]
fn lanes_combined_over_heroes_keep_their_energy() {
    let base = dispersive_interface();
    let lobes = [(1.0, rough_glass([0.3, 0.3]))];
    let set = bsdf(&lobes, base);
    for degrees in [20.0, 145.0] {
        let given = direction(degrees, 0.9);
        let n = 20_000;
        let mut lanes = [Moments::default(); 4];
        for hero in 0..4 {
            let turned = bsdf(&lobes, turned(&base, hero));
            for i in 0..n {
                let drawn = turned.sample(given, Side::Camera, uniforms(hero as u64, i));
                for (k, moments) in lanes.iter_mut().enumerate() {
                    let value = drawn.map_or(0.0, |s| {
                        let e = set.eval(given, s.w);
                        let density = e.columns.map_or(e.pdf_camera, |(camera, _)| {
                            camera.lanes[..4].iter().sum::<f64>() / 4.0
                        });
                        let eta = if s.w.z > 0.0 {
                            base.eta_above[k]
                        } else {
                            base.eta_below[k]
                        };
                        f64::from(e.g[k]) * eta * eta * s.w.z.abs() / density
                    });
                    moments.push(value);
                }
            }
        }
        for (k, lane) in lanes.iter().enumerate() {
            let alone = bsdf(
                &lobes,
                interface(&[base.eta_above[k]], &[base.eta_below[k]]),
            );
            let want = furnace(&alone, given, n)[0];
            // four standard errors of the difference
            let error = lane.standard_error().hypot(want.standard_error());
            assert!(error < 0.01, "{error}");
            let gap = (lane.mean - want.mean).abs();
            assert!(
                gap < 4.0 * error,
                "{degrees}°, lane {k}: {} {}",
                lane.mean,
                want.mean
            );
        }
    }
}

#[test]
fn smooth_dispersive_glass_follows_its_hero() {
    let base = dispersive_interface();
    let glass = bsdf(&[(1.0, smooth_glass())], base);
    let given = direction(40.0, 0.2);
    let reflect = glass.label_probability(Label::SpecularReflect, given);
    let mean: f64 = (0..4)
        .map(|k| fresnel::dielectric(given.z, base.eta_above[k], base.eta_below[k]) / 4.0)
        .sum();
    assert!((reflect - mean).abs() < 1e-15);
    let s = glass.sample(given, Side::Camera, [0.5, 0.0, 0.0]).unwrap();
    assert!(s.label == Label::SpecularTransmit && s.dispersive && s.columns.is_none());
    let sin = |w: DVec3| w.truncate().length();
    assert!((1.5 * sin(s.w) - sin(given)).abs() < 1e-12);
    assert!((s.pdf - (1.0 - mean)).abs() < 1e-15);
    assert_eq!(
        s.pdf_reverse,
        glass.label_probability(Label::SpecularTransmit, s.w)
    );
    assert!(s.pdf_reverse != s.pdf && (s.pdf_reverse - s.pdf).abs() < 0.1);
    // basic units: T/q, no factor of the index
    let t = 1.0 - fresnel::dielectric(given.z, 1.0, 1.5);
    assert!((f64::from(s.weight[0]) - t / s.pdf).abs() < 1e-6);
    let s = glass.sample(given, Side::Camera, [0.01, 0.0, 0.0]).unwrap();
    assert!(s.label == Label::SpecularReflect && !s.dispersive && s.pdf == s.pdf_reverse);
    // the hero's total reflection after transmission was chosen for the others' sake
    let hero_last = interface(&[1.6, 1.5], &[1.0, 1.0]);
    let glass = bsdf(&[(1.0, smooth_glass())], hero_last);
    assert!(
        glass
            .sample(direction(40.0, 0.0), Side::Light, [0.99, 0.0, 0.0])
            .is_none()
    );
}

#[test]
fn mixed_labels_share_their_lobes() {
    let air = interface(&[1.0], &[1.0]);
    let mirror = Lobe::Mirror(Mirror::Perfect(SampledSpectrum::splat(0.5)));
    let thin = Lobe::Thin(Thin {
        n: SampledSpectrum::splat(1.5),
        transmit_tint: ONE,
    });
    let mixed = bsdf(&[(0.4, mirror), (0.2, thin), (0.2, diffuse(0.9))], air);
    let given = direction(0.0, 0.0);
    let sheet = 2.0 * 0.04 / 1.04;
    let q = (0.4 + 0.2 * sheet) / 0.8;
    let s = mixed.sample(given, Side::Light, [0.1, 0.0, 0.0]).unwrap();
    assert!(s.label == Label::SpecularReflect && (s.pdf - q).abs() < 1e-7);
    let weight = (0.4 * 0.5 + 0.2 * sheet) / q;
    assert!((f64::from(s.weight[0]) - weight).abs() < 1e-6);
    let labels = [
        Label::NonSpecular,
        Label::SpecularReflect,
        Label::SpecularTransmit,
    ];
    let sum: f64 = labels
        .iter()
        .map(|&l| mixed.label_probability(l, given))
        .sum();
    assert!((sum - 1.0).abs() < 1e-15);
    assert!((mixed.eval(given, given).pdf_camera - 0.25 / std::f64::consts::PI).abs() < 1e-7);
    let black = bsdf(&[], air);
    assert!(black.sample(given, Side::Light, [0.5; 3]).is_none());
    assert_eq!(black.label_probability(Label::NonSpecular, given), 0.0);
    assert_eq!(black.eval(given, given).pdf_camera, 0.0);
}

#[test]
fn matched_indices_are_not_there() {
    let same = interface(&[1.3, 1.4], &[1.3, 1.4]);
    let given = direction(88.0, 0.5);
    let s = bsdf(&[(1.0, smooth_glass())], same)
        .sample(given, Side::Light, [0.0; 3])
        .unwrap();
    assert_eq!(
        (s.w, s.label, s.pdf),
        (-given, Label::SpecularTransmit, 1.0)
    );
    assert_eq!(s.weight[1], 1.0);
}
