//! Intersections against closed forms and dense scans.

use super::*;
use crate::math::hash::mix64;

fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut i = seed << 32;
    move || {
        i += 1;
        mix64(i) as f64 / 2f64.powi(64)
    }
}

fn shapes() -> Vec<LensSurface> {
    let open = |profile| LensSurface {
        reach: 9.0,
        ..LensSurface::new(profile, Aperture::circle(9.0))
    };
    vec![
        open(Profile::EvenAsphere {
            curvature: 0.03,
            conic: -0.5,
            even: vec![0.0, -3e-4, 4e-6],
        }),
        // a wave of several periods, so that lines cross often
        open(Profile::EvenAsphere {
            curvature: 0.0,
            conic: 0.0,
            even: vec![0.3, -2.2e-2, 4.6e-4, -2.9e-6],
        }),
        open(Profile::OddAsphere {
            curvature: -0.02,
            conic: 0.2,
            powers: vec![-0.3, 2e-2, 1e-3, -2e-4],
        }),
        open(Profile::Toroid {
            curvature_x: 0.05,
            curvature_y: -0.02,
            conic_y: 0.0,
            even_y: vec![0.0, 1e-4],
        }),
    ]
}

/// The first change of sign of z - sag along a line, by steps far below the size of any feature.
fn scan(s: &LensSurface, o: DVec3, d: DVec3, range: [f64; 2]) -> Option<f64> {
    let steps = 400_000;
    let f = |t: f64| {
        let p = o + d * t;
        let inside = s.aperture.contains(p.x, p.y);
        (inside, p.z - s.profile.sag(p.x, p.y))
    };
    let at = |i: i32| range[0] + (range[1] - range[0]) * f64::from(i) / f64::from(steps);
    let mut last = f(at(0));
    for i in 1..=steps {
        let next = f(at(i));
        if last.0 && next.0 && (last.1 > 0.0) != (next.1 > 0.0) {
            return Some(at(i));
        }
        last = next;
    }
    None
}

#[test]
fn the_first_crossing_of_an_asphere_is_the_first() {
    let mut random = numbers(1);
    let mut hits = 0;
    for surface in shapes() {
        for _ in 0..40 {
            let mut between = |a: f64, b: f64| a + (b - a) * random();
            let from = DVec3::new(
                between(-20.0, 20.0),
                between(-20.0, 20.0),
                between(-8.0, 8.0),
            );
            let to = DVec3::new(between(-7.0, 7.0), between(-7.0, 7.0), between(-1.0, 1.0));
            let d = (to - from).normalize();
            let range = [0.0, 60.0];
            let found = surface.first_hit(from, d, range, false).map(|c| c.t);
            match (found, scan(&surface, from, d, range)) {
                (Some(t), Some(near)) => {
                    assert!((t - near).abs() < 4e-4, "{t} {near} {surface:?} {from} {d}");
                    hits += 1;
                }
                (None, None) => {}
                // a scan sees no pair of crossings closer than a step, and not those within a step
                // of the rim
                (Some(t), None) => {
                    let p = from + d * t;
                    assert!(p.truncate().length() > 8.99, "{t} {surface:?} {from} {d}");
                }
                (None, Some(near)) => panic!("missed {near}: {surface:?} {from} {d}"),
            }
        }
    }
    assert!(hits > 80, "{hits}");
}

#[test]
fn crossings_lie_on_the_surface_and_one_that_is_left_is_not_met_again() {
    let mut random = numbers(2);
    let mut again = 0;
    for surface in shapes() {
        for _ in 0..200 {
            let mut between = |a: f64, b: f64| a + (b - a) * random();
            let o = DVec3::new(between(-9.0, 9.0), between(-9.0, 9.0), -30.0);
            let to = DVec3::new(between(-8.0, 8.0), between(-8.0, 8.0), 0.0);
            let d = (to - o).normalize();
            let Some(hit) = surface.first_hit(o, d, [0.0, 1e9], false) else {
                continue;
            };
            let residual = hit.point.z - surface.profile.sag(hit.point.x, hit.point.y);
            assert!(residual.abs() < 1e-13, "{residual} {surface:?}");
            assert!((o + d * hit.t - hit.point).length() < 1e-13);
            // from the point, in a direction along the surface
            let along =
                (d.cross(hit.normal).normalize() + hit.normal * between(-0.2, 0.2)).normalize();
            if let Some(next) = surface.first_hit(hit.point, along, [0.0, 1e9], true) {
                assert!(next.t > 1e-6, "{} {surface:?}", next.t);
                let p = next.point;
                assert!((p.z - surface.profile.sag(p.x, p.y)).abs() < 1e-13);
                again += 1;
            }
        }
    }
    assert!(again > 50, "{again}");
}

#[test]
fn conics_are_met_from_far_away_near_the_vertex_and_at_steep_slopes() {
    for (radius, conic) in [
        (50.0, 0.0),
        (-20.0, -1.0),
        (-3.0, 1.5),
        (8.0, -3.0),
        (1e6, 0.0),
    ] {
        let Profile::Conic { curvature, .. } = Profile::sphere(radius) else {
            unreachable!("a sphere is a conic")
        };
        let profile = Profile::Conic { curvature, conic };
        let size = profile.domain_radius().min(radius.abs()) * 0.999;
        let surface = LensSurface::new(profile.clone(), Aperture::circle(size));
        for distance in [1e-9, 1.0, 1e4, 1e7] {
            for height in [0.0, 1e-7, 0.3, 0.9, 0.999] {
                let to = DVec3::new(0.6 * size * height, -0.8 * size * height, 0.0);
                let to = to.with_z(profile.sag(to.x, to.y));
                let [_, zx, zy] = profile.sag_and_slopes(to.x, to.y);
                let normal = DVec3::new(-zx, -zy, 1.0).normalize();
                let d = (normal + DVec3::new(0.1, -0.05, 0.1)).normalize();
                let o = to - d * distance;
                // rounding of an origin of this size
                let allowed = 2e-15 * (distance + radius.abs());
                let hit = surface.sequential(o, d).expect("aimed at");
                assert!(
                    (hit.point - to).length() <= allowed.max(1e-15),
                    "{radius} {conic} {distance} {height}: {:e} {allowed:e}",
                    (hit.point - to).length()
                );
                let (x, y) = (hit.point.x, hit.point.y);
                let [_, zx, zy] = profile.sag_and_slopes(x, y);
                let normal = DVec3::new(-zx, -zy, 1.0).normalize();
                assert!((hit.normal - normal).length() < 1e-6);
            }
        }
    }
}

#[test]
fn of_a_sphere_only_the_cap_is_there() {
    let cap = LensSurface::new(Profile::sphere(10.0), Aperture::circle(8.0));
    let o = DVec3::new(1.0, 0.0, -5.0);
    let hit = cap.first_hit(o, DVec3::Z, [0.0, 1e9], false).expect("cap");
    assert!((hit.t - 5.0 - (10.0 - 99f64.sqrt())).abs() < 1e-13);
    // on through the far side of the sphere, which is not part of it
    assert_eq!(cap.first_hit(hit.point, DVec3::Z, [0.0, 1e9], true), None);
    // across the bowl: both crossings count, and the first of them is the first
    let across = cap.first_hit(DVec3::new(-20.0, 0.0, 2.0), DVec3::X, [0.0, 1e9], false);
    let first = across.expect("bowl");
    assert!((first.point.x + 6.0).abs() < 1e-13);
    let second = cap
        .first_hit(first.point, DVec3::X, [0.0, 1e9], true)
        .expect("bowl");
    assert!((second.t - 12.0).abs() < 1e-13);
    assert_eq!(cap.first_hit(o, DVec3::Z, [0.0, 5.0], false), None);
    assert_eq!(cap.first_hit(o, DVec3::X, [0.0, 1e9], false), None);
}

#[test]
fn an_asphere_without_coefficients_is_its_conic() {
    let mut random = numbers(3);
    for conic in [0.0, -1.0, -2.5, 0.7] {
        let curvature = 0.04;
        let aperture = Aperture::circle(12.0);
        let plain = LensSurface::new(Profile::Conic { curvature, conic }, aperture);
        let even = vec![0.0; 3];
        let asphere = Profile::EvenAsphere {
            curvature,
            conic,
            even,
        };
        let asphere = LensSurface::new(asphere, aperture);
        for _ in 0..100 {
            let mut between = |a: f64, b: f64| a + (b - a) * random();
            let o = DVec3::new(between(-9.0, 9.0), between(-9.0, 9.0), -20.0);
            let d = DVec3::new(between(-0.3, 0.3), between(-0.3, 0.3), 1.0).normalize();
            match (plain.sequential(o, d), asphere.sequential(o, d)) {
                (Some(a), Some(b)) => {
                    assert!((a.t - b.t).abs() < 1e-13 && (a.normal - b.normal).length() < 1e-13);
                }
                (a, b) => {
                    let reach = a.or(b).map_or(99.0, |c| c.point.truncate().length());
                    assert!(reach > 17.9, "{a:?} {b:?}");
                }
            }
        }
    }
}
