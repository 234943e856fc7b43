//! Tests that every light must pass, whatever its kind, and closed forms of illumination.

use super::casters::{Ball, Casters};
use super::spot::Falloff;
use super::*;
use crate::geometry::{Accel, AreaSampler, Instance, InstanceId, Shape};
use crate::spectrum::{Curve, WavelengthDistribution};
use glam::DQuat;
use std::f64::consts::PI;

fn unit_emission() -> Emission {
    Emission::from_curve(Curve::Constant(1.0))
}

#[test]
fn spectrum_multiplies_every_value() {
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    let wavelengths = WavelengthDistribution::uniform([400.0, 700.0]).sample(0.3, 4);
    let x1 = DVec3::new(1.1, 0.1, 0.5);
    for light in lights() {
        let scaled = |factor: f64| {
            let mut light = light.clone();
            light.emission = unit_emission().scaled(factor);
            light
        };
        let u = DVec2::new(0.4, 0.7);
        let unit = light.start(&context, &none, 0.2, u, u).unwrap();
        let three = scaled(3.0)
            .sample_emission(&context, &none, &wavelengths, 0.2, u, u)
            .unwrap();
        assert!((three.weight[3] / unit.weight[3] - 3.0).abs() < 1e-6);
        let near = scaled(3.0).sample_direct(&context, &wavelengths, x1, 0.2, u);
        if let Some(unit) = light.connect(&context, x1, 0.2, u) {
            assert!((near.unwrap().value[1] / unit.value[1] - 3.0).abs() < 1e-6);
        }
        let power = |light: &Light| {
            light.emission.sampling_power([360.0, 830.0]) * light.flux_factor(&context)
        };
        assert!((power(&scaled(2.0)) / power(&light) - 2.0).abs() < 1e-12);
        let escaped = scaled(2.0).escaped_radiance(&context, DVec3::Z, &wavelengths)[0];
        let expected = if light.as_environment().is_some() {
            2.0
        } else {
            0.0
        };
        assert_eq!(escaped, expected);
    }
    let point = AreaSampler::default()
        .sample(
            &accel.instances()[0],
            InstanceId(0),
            0.0,
            0.5,
            DVec2::splat(0.5),
        )
        .point;
    assert_eq!(
        area(0, false).radiance(&point, point.ng, &wavelengths)[0],
        1.0
    );
    assert_eq!(
        area(0, false).radiance(&point, -point.ng, &wavelengths)[0],
        0.0
    );
    assert_eq!(
        area(0, true).radiance(&point, -point.ng, &wavelengths)[0],
        1.0
    );
}

/// A disk of radius 0.3, moved and turned, as instance 0 and a quad as instance 1.
fn accel() -> Accel {
    let scale = DAffine3::from_scale(DVec3::splat(0.3));
    let disk = Instance {
        shape: Shape::Disk { inner: 0.0 },
        transform: Transform::fixed(disk_pose() * scale),
    };
    let scale = DAffine3::from_scale(DVec3::new(0.5, 0.2, 1.0));
    let transform = Transform::fixed(DAffine3::from_translation(DVec3::X) * scale);
    let mut accel = Accel::build(vec![
        disk,
        Instance {
            shape: Shape::Quad,
            transform,
        },
    ]);
    accel.set_sphere(DVec3::new(0.1, 0.2, -0.3), 2.0);
    accel
}

fn disk_pose() -> DAffine3 {
    let rotation = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    DAffine3::from_rotation_translation(rotation, DVec3::new(-0.2, 0.1, 0.4))
}

fn context(accel: &Accel) -> AccelAt<'_> {
    accel.at(0.0)
}

fn area(instance: u32, two_sided: bool) -> Light {
    let area = AreaLight {
        instance: InstanceId(instance),
        pattern: None,
        sampler: AreaSampler::default(),
        two_sided,
    };
    Light::area(unit_emission(), area)
}

fn lights() -> Vec<Light> {
    let axis = DVec3::new(0.3, -0.5, 0.8);
    vec![
        area(0, false),
        area(1, true),
        Light::point(DVec3::X, unit_emission()),
        Light::spot(
            DVec3::X,
            axis,
            unit_emission(),
            SpotLight {
                cone_rad: 0.7,
                falloff_start_rad: 0.2,
                falloff: Falloff::SmoothStep,
            },
        ),
        Light::directional(axis, unit_emission()),
        Light::beam(DVec3::Y, axis, unit_emission(), 0.05),
        Light::environment(unit_emission(), None),
    ]
}

/// A sky with an image, which happens to be the same everywhere.
fn patterned_sky() -> Light {
    let image = Image::from_floats(8, 4, vec![[0.5; 3]; 32]).unwrap();
    let image = EnvironmentImage::new(Arc::new(image), DMat3::IDENTITY).unwrap();
    Light::environment(unit_emission(), Some(Arc::new(image)))
}

/// Well spread points of the unit square with a third coordinate.
fn points(count: u32) -> impl Iterator<Item = (f64, DVec2, DVec2)> {
    // additive recurrence (Roberts 2018)
    (0..count).map(|i| {
        let r = |k: f64| (0.5 + f64::from(i + 1) * k).fract();
        (
            r(0.856_674_88),
            DVec2::new(r(0.733_891_86), r(0.628_706_72)),
            { DVec2::new(r(0.538_597_26), r(0.461_401_62)) },
        )
    })
}

#[test]
fn emission_density_is_that_of_the_sample() {
    let accel = accel();
    let context = context(&accel);
    for (light, casters) in (lights().iter().chain([&patterned_sky()]))
        .flat_map(|l| [(l, Casters::default()), (l, casters())])
    {
        for (u_face, u_pos, u_dir) in points(200) {
            let Some(s) = light.start(&context, &casters, u_face, u_pos, u_dir) else {
                continue;
            };
            assert!((s.direction.length() - 1.0).abs() < 1e-14);
            let x1 = s.origin + 1.3 * s.direction;
            let density =
                |casters| light.emission_density(&context, casters, &s.x0, s.direction, x1);
            let (pdf_x0, pdf_direction) = density(&casters);
            assert!((pdf_x0 / s.pdf_x0 - 1.0).abs() < 1e-12, "{light:?}");
            assert_eq!(
                std::mem::discriminant(&pdf_direction),
                std::mem::discriminant(&s.pdf_direction)
            );
            let ratio = pdf_direction.value() / s.pdf_direction.value();
            assert!((ratio - 1.0).abs() < 1e-9, "{light:?}");
            // what it emits is the same however it is drawn
            let (_, own) = density(&Casters::default());
            let emitted = f64::from(s.weight[0]) * s.pdf_x0 * pdf_direction.value();
            let plain = light
                .start(&context, &Casters::default(), u_face, u_pos, u_dir)
                .unwrap();
            let expected = f64::from(plain.weight[0]) * plain.pdf_x0 * own.value();
            assert!(
                (emitted - expected).abs() <= 1e-6 * expected,
                "{light:?}: {emitted} {expected}"
            );
        }
    }
}

/// Smooth things at two places.
fn casters() -> Casters {
    let around = |p: DVec3, r: f64| Ball::around_round((p - DVec3::splat(r), p + DVec3::splat(r)));
    let balls = [
        around(DVec3::new(1.4, -0.8, 1.3), 0.1),
        around(DVec3::new(-0.6, 0.9, 0.5), 0.05),
    ];
    Casters::new(0.5, balls.to_vec())
}

#[test]
fn half_of_the_light_goes_toward_casters() {
    let accel = accel();
    let context = context(&accel);
    let casters = casters();
    let count = 4000;
    // a beam goes one way, and a sky that is the same everywhere makes no caustic
    let aimed = [true, true, true, true, true, false, false, true];
    for (light, aimed) in lights().iter().chain([&patterned_sky()]).zip(aimed) {
        let is_aimed = |(u_face, u_pos, u_dir)| {
            let s = light
                .start(&context, &casters, u_face, u_pos, u_dir)
                .unwrap();
            let x1 = s.origin + s.direction;
            let density = |c| {
                light
                    .emission_density(&context, c, &s.x0, s.direction, x1)
                    .1
                    .value()
            };
            density(&casters) > density(&Casters::default())
        };
        let share = points(count).filter(|&u| is_aimed(u)).count() as f64 / f64::from(count);
        // a little of the other half goes there as well
        let expected = if aimed { 0.5..0.56 } else { 0.0..0.001 };
        assert!(expected.contains(&(share + 1e-4)), "{light:?}: {share}");
    }
}

#[test]
fn weight_is_the_flux() {
    // every kind is sampled in proportion to what it emits
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    let spot = 2.0 * PI * (1.0 - 0.5 * (0.7_f64.cos() + 0.2_f64.cos()));
    let expected = [
        PI * PI * 0.09,
        2.0 * PI * 0.4,
        4.0 * PI,
        spot,
        4.0 * PI,
        PI * 0.0025,
        16.0 * PI * PI,
    ];
    for (light, flux) in lights().into_iter().zip(expected) {
        assert!(
            (light.flux_factor(&context) / flux - 1.0).abs() < 1e-12,
            "{light:?}"
        );
        for (u_face, u_pos, u_dir) in points(50) {
            let s = light.start(&context, &none, u_face, u_pos, u_dir).unwrap();
            assert!(
                (f64::from(s.weight[0]) / flux - 1.0).abs() < 1e-6,
                "{light:?}"
            );
        }
    }
}

#[test]
fn connections_find_what_emission_sends() {
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    for light in lights() {
        for (u_face, u_pos, u_dir) in points(200) {
            let s = light.start(&context, &none, u_face, u_pos, u_dir).unwrap();
            let x1 = s.origin + 1.3 * s.direction;
            let direct = light.direct_density(&context, x1, &s.x0);
            assert!(direct > 0.0, "{light:?}");
            // same measure and, for every kind so far, the same density
            assert!((direct / s.pdf_x0 - 1.0).abs() < 1e-12, "{light:?}");
            let Some(c) = light.connect(&context, x1, u_face, u_pos) else {
                continue;
            };
            assert!((c.toward.length() - 1.0).abs() < 1e-14);
            let again = light.direct_density(&context, x1, &c.x0);
            assert!((again / c.pdf - 1.0).abs() < 1e-12, "{light:?}");
            // F is one function: weight·pdf's of emission and value·pdf of connection share L or I
            // or E
            let (pdf_x0, pdf_direction) =
                light.emission_density(&context, &none, &c.x0, -c.toward, x1);
            let flux = f64::from(s.weight[0]) * pdf_x0;
            let distance = if c.distance.is_finite() {
                c.distance
            } else {
                1.0
            };
            let sent = flux * pdf_direction.area_density(1.0, distance * distance);
            let found = f64::from(c.value[0]) * c.pdf;
            assert!(
                (sent / found - 1.0).abs() < 1e-6,
                "{light:?}: {sent} {found}"
            );
        }
    }
}

#[test]
fn disk_illuminates_by_its_form_factor() {
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    let light = area(0, false);
    let h = 0.5;
    let normal = disk_pose().transform_vector3(DVec3::Z);
    let x1 = disk_pose().translation + h * normal;
    let n = 20_000;
    let irradiance: f64 = points(n)
        .filter_map(|(u_face, u, _)| light.connect(&context, x1, u_face, u))
        .map(|c| f64::from(c.value[0]) * c.toward.dot(-normal) / f64::from(n))
        .sum();
    let expected = PI * 0.09 / (0.09 + h * h);
    // well spread points: error of order 1/n times a small factor
    assert!(
        (irradiance / expected - 1.0).abs() < 2e-3,
        "{irradiance} {expected}"
    );
    // the back is dark unless two-sided
    let behind = disk_pose().translation - h * normal;
    assert!(
        light
            .connect(&context, behind, 0.5, DVec2::splat(0.3))
            .is_none()
    );
    let c = area(0, true)
        .connect(&context, behind, 0.5, DVec2::splat(0.3))
        .unwrap();
    assert_eq!(light.direct_density(&context, behind, &c.x0), 0.0);
    let (_, pdf) = light.emission_density(&context, &none, &c.x0, -c.toward, behind);
    assert_eq!(pdf.value(), 0.0);
    // a point of another surface is not of this light
    let quad = area(1, true)
        .connect(&context, x1, 0.5, DVec2::splat(0.3))
        .unwrap();
    assert_eq!(light.direct_density(&context, x1, &quad.x0), 0.0);
}

#[test]
fn two_sided_light_leaves_both_sides_evenly() {
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    let light = area(1, true);
    let n = 2000;
    let front = points(n)
        .filter_map(|(u_face, u_pos, u_dir)| light.start(&context, &none, u_face, u_pos, u_dir))
        .filter(|s| s.direction.dot(s.x0.n) > 0.0)
        .count();
    assert!((front as f64 / f64::from(n) - 0.5).abs() < 0.01);
}

#[test]
fn far_lights_start_outside_and_cover_the_scene() {
    let accel = accel();
    let context = context(&accel);
    let none = Casters::default();
    for light in lights().into_iter().skip(4).step_by(2) {
        for (u_face, u_pos, u_dir) in points(200) {
            let s = light.start(&context, &none, u_face, u_pos, u_dir).unwrap();
            let from_center = s.origin - accel.center();
            assert!(from_center.length() >= accel.radius() * (1.0 - 1e-12));
            assert!((from_center.dot(s.direction) + accel.radius()).abs() < 1e-12);
            let offset = from_center - from_center.dot(s.direction) * s.direction;
            assert!(offset.length() <= accel.radius() * (1.0 + 1e-12));
            assert!(s.x0.infinite && s.x0.n == s.direction);
        }
    }
}

#[test]
fn environment_irradiates_by_pi() {
    let accel = accel();
    let context = context(&accel);
    let light = Light::environment(unit_emission(), None);
    let n = 20_000;
    let irradiance: f64 = points(n)
        .filter_map(|(u_face, u, _)| light.connect(&context, DVec3::ZERO, u_face, u))
        .map(|c| f64::from(c.value[0]) * c.toward.z.max(0.0) / f64::from(n))
        .sum();
    assert!((irradiance / PI - 1.0).abs() < 2e-3, "{irradiance}");
}

#[test]
fn only_surfaces_and_the_environment_can_be_hit() {
    let measures: Vec<HitMeasure> = lights().iter().map(Light::hit_measure).collect();
    use HitMeasure::{Area, Never, SolidAngle};
    assert_eq!(
        measures,
        [Area, Area, Never, Never, Never, Never, SolidAngle]
    );
    assert!(
        lights()
            .iter()
            .all(|l| l.is_delta() == (l.hit_measure() == Never))
    );
}
