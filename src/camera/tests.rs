//! Tests that every sensor must pass, whatever its kind.

use super::perspective::ThinLens;
use super::*;
use crate::geometry::{InstanceId, SurfaceId};
use glam::{DAffine3, DQuat};
use std::f64::consts::PI;

const RESOLUTION: Resolution = Resolution {
    width: 40,
    height: 30,
};

fn pose() -> DAffine3 {
    let axis = DVec3::new(0.3, 0.8, -0.2).normalize();
    let rotation = DQuat::from_axis_angle(axis, 1.1);
    DAffine3::from_rotation_translation(rotation, DVec3::new(5.0, -3.0, 2.0))
}

fn lens() -> ThinLens {
    ThinLens {
        radius_m: 0.1,
        focus_distance_m: 2.5,
    }
}

fn perspective(lens: Option<ThinLens>) -> Camera {
    Camera::perspective(Transform::fixed(pose()), RESOLUTION, 0.9, lens)
}

fn cameras() -> [Camera; 3] {
    let parallel = Camera::orthographic(Transform::fixed(pose()), RESOLUTION, 0.8);
    [perspective(None), perspective(Some(lens())), parallel]
}

fn detector() -> Camera {
    Camera::detector(pose(), 0.4, 0.2, RESOLUTION, false)
}

/// Raster positions on and around the film with lens numbers.
fn positions() -> impl Iterator<Item = (DVec2, DVec2)> {
    (0..200).map(|i| {
        let i = f64::from(i);
        let r = |k: f64| (i * k).fract();
        let raster = DVec2::new(r(0.618), r(0.414)) * 44.0 - 2.0;
        (raster, DVec2::new(r(0.732), r(0.236)))
    })
}

fn value(density: DirectionalDensity) -> f64 {
    match density {
        DirectionalDensity::SolidAngle(p) | DirectionalDensity::Perpendicular(p) => p,
    }
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-11 * a.abs().max(b.abs())
}

#[test]
fn density_is_that_of_the_sample() {
    let all = cameras().into_iter().chain([detector()]);
    for camera in all {
        for (raster, u) in positions() {
            let s = camera.sample_ray(raster, u, 0.0.into());
            assert!((s.direction.length() - 1.0).abs() < 1e-14);
            let (pdf_xk, pdf_direction) = camera.density(s.xk.p, s.direction, 0.0.into());
            assert_eq!(pdf_xk, s.pdf_xk);
            assert_eq!(
                std::mem::discriminant(&pdf_direction),
                std::mem::discriminant(&s.pdf_direction)
            );
            let difference = value(pdf_direction) - value(s.pdf_direction);
            assert!(difference.abs() < 1e-9 * value(pdf_direction));
        }
    }
}

#[test]
fn connection_inverts_the_ray() {
    for camera in cameras() {
        for (raster, u) in positions() {
            let s = camera.sample_ray(raster, u, 0.0.into());
            for distance in [0.3, 2.5, 70.0] {
                let x = s.xk.p + distance * s.direction;
                let c = camera.sample_connection(x, u, 0.0.into(), 50.0).unwrap();
                assert!((c.raster - raster).length() < 1e-9, "{raster} {}", c.raster);
                assert!((c.xk.p - s.xk.p).length() < 1e-12);
                assert!((c.toward + s.direction).length() < 1e-12);
                assert!(close(c.distance, distance));
                assert_eq!(c.pdf_xk, s.pdf_xk);
                // T_C = W_e cosθ/(pdf p_ω) ties the two: importance = T_C × area density of x per
                // cosine there
                let expected = s.weight * s.pdf_direction.area_density(1.0, distance * distance);
                assert!(close(c.importance, expected), "{} {expected}", c.importance);
            }
            assert!(
                camera
                    .sample_connection(s.xk.p - s.direction, u, 0.0.into(), 1e9)
                    .is_none()
            );
        }
    }
}

#[test]
fn film_ends_at_the_margin() {
    for camera in cameras() {
        let u = DVec2::new(0.3, 0.7);
        let seen = |raster: DVec2, margin: f64| {
            let s = camera.sample_ray(raster, u, 0.0.into());
            camera
                .sample_connection(s.xk.p + 3.0 * s.direction, u, 0.0.into(), margin)
                .is_some()
        };
        for (outside, reach) in [
            (DVec2::new(-1.0, 10.0), 1.0),
            (DVec2::new(41.5, 31.5), 1.5),
            (DVec2::new(3.0, 32.0), 2.0),
        ] {
            assert!(!seen(outside, 0.0));
            assert!(!seen(outside, reach - 1e-6));
            assert!(seen(outside, reach + 1e-6));
        }
        assert!(seen(DVec2::new(0.001, 0.001), 0.0));
        assert!(seen(DVec2::new(39.999, 29.999), 0.0));
    }
}

#[test]
fn directions_of_the_film_integrate_to_one() {
    // solid angle of the film from a lens point, by triangles of adjacent rays (Van Oosterom and
    // Strackee 1983)
    let solid_angle = |a: DVec3, b: DVec3, c: DVec3| {
        let denominator = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
        2.0 * a.dot(b.cross(c)).abs().atan2(denominator)
    };
    for camera in [perspective(None), perspective(Some(lens()))] {
        let u = DVec2::new(0.9, 0.3);
        let n = 200;
        let ray = |x: f64, y: f64| {
            camera
                .sample_ray(
                    DVec2::new(x, y) / f64::from(n) * RESOLUTION.size(),
                    u,
                    0.0.into(),
                )
                .direction
        };
        let mut total = 0.0;
        for j in 0..n {
            for i in 0..n {
                let (x, y) = (f64::from(i), f64::from(j));
                let corners = [
                    ray(x, y),
                    ray(x + 1.0, y),
                    ray(x + 1.0, y + 1.0),
                    ray(x, y + 1.0),
                ];
                let [a, b, c, d] = corners;
                let (_, pdf) = camera.density(DVec3::ZERO, ray(x + 0.5, y + 0.5), 0.0.into());
                total += value(pdf) * (solid_angle(a, b, c) + solid_angle(a, c, d));
            }
        }
        assert!((total - 1.0).abs() < 1e-4, "{total}");
    }
}

#[test]
fn weights_are_importance_over_density() {
    for (raster, u) in positions() {
        let film = (2.0 * 0.45_f64.tan()).powi(2) * 4.0 / 3.0;
        for (camera, lens_area) in [
            (perspective(None), 1.0),
            (
                perspective(Some(lens())),
                PI * lens().radius_m * lens().radius_m,
            ),
        ] {
            let s = camera.sample_ray(raster, u, 0.0.into());
            let cos = s.direction.dot(pose().transform_vector3(DVec3::NEG_Z));
            let importance = 1.0 / (film * lens_area * cos.powi(4));
            let weight = importance * cos / (s.pdf_xk * value(s.pdf_direction));
            assert!(close(weight, s.weight), "{weight}");
        }
        let detector = detector();
        let s = detector.sample_ray(raster, u, 0.0.into());
        let weight = s.xk.cos(s.direction) / 0.08 / (s.pdf_xk * value(s.pdf_direction));
        assert!(close(weight, PI) && s.weight == PI, "{weight}");
    }
}

#[test]
fn pictures_are_the_right_way_round() {
    let identity = Transform::fixed(DAffine3::IDENTITY);
    let top_left = DVec2::ZERO;
    let u = DVec2::new(0.0, 0.0);
    // a camera at rest looks along -z: the top left is at -x, +y
    let camera = Camera::perspective(identity.clone(), RESOLUTION, 0.9, None);
    let d = camera.sample_ray(top_left, u, 0.0.into()).direction;
    assert!(d.x < 0.0 && d.y > 0.0 && d.z < 0.0);
    assert!(close(-d.y / d.z, 0.45_f64.tan()));
    let camera = Camera::orthographic(identity, RESOLUTION, 0.8);
    let s = camera.sample_ray(top_left, u, 0.0.into());
    assert!((s.xk.p - DVec3::new(-0.4, 0.3, 0.0)).length() < 1e-15);
    assert_eq!(s.direction, DVec3::NEG_Z);
    // a detector receives from u × v = +z, row 0 at +v, columns along +u
    let u = DVec2::new(0.3, 0.6);
    let camera = Camera::detector(DAffine3::IDENTITY, 0.4, 0.2, RESOLUTION, false);
    let s = camera.sample_ray(top_left, u, 0.0.into());
    assert!((s.xk.p - DVec3::new(-0.2, 0.1, 0.0)).length() < 1e-15);
    assert_eq!(s.xk.n, DVec3::Z);
    assert!(s.direction.z > 0.0);
    let s = camera.sample_ray(DVec2::new(40.0, 30.0), u, 0.0.into());
    assert!((s.xk.p - DVec3::new(0.2, -0.1, 0.0)).length() < 1e-15);
}

#[test]
fn thin_lens_is_sharp_at_the_focus_distance() {
    let camera = perspective(Some(lens()));
    let axis = pose().transform_vector3(DVec3::NEG_Z);
    let raster = DVec2::new(31.0, 4.5);
    let through = |u: DVec2| {
        let s = camera.sample_ray(raster, u, 0.0.into());
        assert!((s.xk.p - pose().translation).length() <= 0.1);
        let t = (2.5 - (s.xk.p - pose().translation).dot(axis)) / s.direction.dot(axis);
        s.xk.p + t * s.direction
    };
    let first = through(DVec2::new(0.0, 0.0));
    for (_, u) in positions() {
        assert!((through(u) - first).length() < 1e-13);
    }
}

#[test]
fn detector_connects_and_is_hit_alike() {
    let mut camera = detector();
    assert!(
        camera
            .detector_area(0.0.into())
            .is_some_and(|area| close(area, 0.08))
    );
    assert_eq!(perspective(None).detector_area(0.0.into()), None);
    if let CameraKind::Detector(detector) = &mut camera.kind {
        detector.instance = Some(InstanceId(3));
    }
    let x = pose().transform_point3(DVec3::new(0.3, 0.4, 1.5));
    for (_, u) in positions() {
        let c = camera.sample_connection(x, u, 0.0.into(), 0.0).unwrap();
        let cos = c.xk.cos(c.toward);
        assert!(close(c.importance, cos / (c.distance * c.distance)));
        assert!(close(c.pdf_xk, 1.0 / 0.08));
        let id = c.xk.surface.unwrap();
        let point = SurfacePoint {
            p: c.xk.p,
            ng: c.xk.n,
            ns: c.xk.n,
            uv: DVec2::ZERO,
            id,
        };
        let (raster, importance) = camera.arrive(&point, -c.toward, 0.0.into()).unwrap();
        assert!((raster - c.raster).length() < 1e-10);
        assert!(close(importance, 1.0 / 0.08));
        assert!((raster - u * RESOLUTION.size()).length() < 1e-10);
        // the back is blind, and other surfaces are not the detector
        assert!(camera.arrive(&point, c.toward, 0.0.into()).is_none());
        let id = SurfaceId {
            instance: InstanceId(4),
            prim: 0,
        };
        assert!(
            camera
                .arrive(&SurfacePoint { id, ..point }, -c.toward, 0.0.into())
                .is_none()
        );
        let (_, pdf) = camera.density(c.xk.p, c.toward, 0.0.into());
        assert_eq!(value(pdf), 0.0);
    }
    let behind = pose().transform_point3(DVec3::new(0.0, 0.0, -1.0));
    assert!(
        camera
            .sample_connection(behind, DVec2::splat(0.5), 0.0.into(), 0.0)
            .is_none()
    );
    assert!(camera.is_hittable() && !camera.is_delta());
    assert!(!perspective(None).is_hittable() && perspective(None).is_delta());
}
