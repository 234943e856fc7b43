//! Aberrations of real rays against those of third order, and closed forms.

use super::super::{Aperture, Break, FieldKind, Medium, Profile, Surface, SystemAperture, seidel};
use super::*;
use crate::spectrum::Ior;

fn lens(surfaces: Vec<Surface>, pupil: f64, field: f64) -> Prescription {
    Prescription {
        name: String::from("test"),
        notes: Vec::new(),
        wavelengths: Prescription::default_wavelengths(),
        primary: 1,
        aperture: SystemAperture::EntrancePupil(pupil),
        field_kind: FieldKind::AngleDeg,
        fields: vec![[0.0, 0.0], [0.0, field]],
        object_distance: None,
        object_medium: Medium::air(),
        surfaces,
        stop: 0,
    }
}

fn glass(n: f64) -> Medium {
    Medium::new(Ior::constant(n))
}

fn surface(profile: Profile, thickness: f64, medium: Medium) -> Surface {
    Surface::new(profile, Aperture::OPEN, thickness, medium)
}

fn image() -> Surface {
    surface(Profile::PLANE, 0.0, Medium::air())
}

/// A bent singlet with its image at the paraxial focus.
fn singlet(pupil: f64, field: f64) -> Prescription {
    let profile = Profile::Conic {
        curvature: 1.0 / 60.0,
        conic: 0.4,
    };
    let front = surface(profile, 6.0, glass(1.6));
    let back = Profile::EvenAsphere {
        curvature: -1.0 / 200.0,
        conic: 0.0,
        even: vec![2e-5, 1e-7],
    };
    let mut lens = lens(
        vec![front, surface(back, 0.0, Medium::air()), image()],
        pupil,
        field,
    );
    let bfl = Paraxial::new(&lens, 587.6).first_order().bfl;
    lens.surfaces[1].thickness = bfl;
    lens
}

#[test]
fn a_plano_convex_lens_has_the_focal_length_of_the_lensmaker() {
    let (n, r, t) = (1.5, 50.0, 8.0);
    let front = surface(Profile::sphere(r), t, glass(n));
    let lens = lens(
        vec![front, surface(Profile::PLANE, 90.0, Medium::air()), image()],
        10.0,
        1.0,
    );
    let data = Paraxial::new(&lens, 587.6).first_order();
    assert!((data.efl - 100.0).abs() < 1e-12);
    assert!((data.bfl - (100.0 - t / n)).abs() < 1e-12);
    assert!((data.ffl + 100.0).abs() < 1e-12);
    assert!((data.principal[0]).abs() < 1e-12 && (data.principal[1] + t / n).abs() < 1e-12);
    assert!((data.f_number - 10.0).abs() < 1e-12);
    assert!((data.image_height - 100.0 * 1f64.to_radians().tan()).abs() < 1e-12);
}

#[test]
fn seidel_sums_are_the_limit_of_real_rays() {
    // The transverse aberrations of third order, from the wave aberration with W = S1/8 rho^4 +
    // S2/2 h rho^3 cos + ...
    let pupil = 4.0;
    let field = 2.0;
    let lens = singlet(pupil, field);
    let sums = seidel::total(&seidel::seidel(&lens)).s;
    let data = Paraxial::new(&lens, lens.primary_nm()).first_order();
    // n' u' of the marginal ray, negative when it converges
    let slope = -data.image_na;
    let beams = Beams::new(&lens, lens.primary_nm());
    let on_axis = beams.arrival(beams.launch([0.0; 2], DVec2::Y)).unwrap();
    let spherical = sums[0] / (2.0 * slope);
    assert!(
        (on_axis.point.y / spherical - 1.0).abs() < 0.01,
        "{} {spherical}",
        on_axis.point.y
    );
    let at = |share: DVec2| {
        beams
            .arrival(beams.launch([0.0, field], share))
            .unwrap()
            .point
    };
    // even in the pupil: coma, twice 3/2 and 1/2 of S_II
    let chief = at(DVec2::ZERO).y;
    let tangential = 0.5 * (at(DVec2::Y).y + at(DVec2::NEG_Y).y) - chief;
    let sagittal = at(DVec2::X).y - chief;
    assert!(
        (tangential / (1.5 * sums[1] / slope) - 1.0).abs() < 0.02,
        "{tangential}"
    );
    assert!(
        (sagittal / (0.5 * sums[1] / slope) - 1.0).abs() < 0.02,
        "{sagittal}"
    );
    // odd in the pupil, without the spherical part: astigmatism and field curvature
    let tangential = 0.5 * (at(DVec2::Y).y - at(DVec2::NEG_Y).y) - on_axis.point.y;
    let sagittal = 0.5 * (at(DVec2::X).x - at(DVec2::NEG_X).x) - on_axis.point.y;
    let expected = [
        0.5 * (3.0 * sums[2] + sums[3]) / slope,
        0.5 * (sums[2] + sums[3]) / slope,
    ];
    assert!(
        (tangential / expected[0] - 1.0).abs() < 0.02,
        "{tangential} {expected:?}"
    );
    assert!(
        (sagittal / expected[1] - 1.0).abs() < 0.02,
        "{sagittal} {expected:?}"
    );
    // distortion: the chief ray against the paraxial image height
    let distortion = chief - data.image_height;
    let expected = 0.5 * sums[4] / slope;
    assert!(
        (distortion - expected).abs() < 0.05 * expected.abs() + 1e-7,
        "{distortion} {expected}"
    );
}

#[test]
fn chromatic_sums_are_those_of_paraxial_rays() {
    let ior = crate::spectrum::Library::embedded()
        .ior("schott:N-BK7")
        .unwrap();
    let front = surface(Profile::sphere(60.0), 5.0, Medium::new(ior));
    let lens = lens(
        vec![
            front,
            surface(Profile::sphere(-90.0), 60.0, Medium::air()),
            image(),
        ],
        10.0,
        2.0,
    );
    let sums = seidel::total(&seidel::seidel(&lens));
    let at = |nm| Paraxial::new(&lens, nm).first_order();
    use crate::spectrum::ior::{LINE_C_NM, LINE_F_NM};
    let shift = at(LINE_F_NM).bfl - at(LINE_C_NM).bfl;
    // C_I = n' u'^2 times the longitudinal shift, to first order in the dispersion
    let na = at(lens.primary_nm()).image_na;
    assert!(
        (sums.c[0] / (-na * na * shift) - 1.0).abs() < 0.02,
        "{} {}",
        sums.c[0],
        na * na * shift
    );
}

#[test]
fn a_paraboloid_images_a_distant_point_without_error_and_best_focus_finds_it() {
    let profile = Profile::Conic {
        curvature: -1.0 / 200.0,
        conic: -1.0,
    };
    let mut mirror = surface(profile, -99.0, Medium::air());
    mirror.interaction = Interaction::Reflect;
    let lens = lens(vec![mirror, image()], 60.0, 0.0);
    let beams = Beams::new(&lens, 550.0);
    let spot = beams.spot([0.0; 2], 8);
    assert_eq!(spot.rays.len(), spot.sent);
    assert!((Spot::best_focus(&[&spot]) + 1.0).abs() < 1e-12);
    assert!(spot.measure(-1.0).1 < 1e-13);
    let data = Paraxial::new(&lens, 550.0).first_order();
    assert!((data.efl - 100.0).abs() < 1e-12 && (data.bfl + 100.0).abs() < 1e-12);
}

#[test]
fn a_folded_system_is_the_straight_one() {
    let straight = singlet(8.0, 1.0);
    let mut folded = straight.clone();
    let tilt = Break {
        decenter: DVec3::ZERO,
        tilt_deg: DVec3::new(45.0, 0.0, 0.0),
        reversed: false,
        thickness: 0.0,
    };
    let total = folded.surfaces[1].thickness;
    folded.surfaces[1].thickness = 30.0;
    let mut mirror = surface(Profile::PLANE, 30.0 - total, Medium::air());
    mirror.interaction = Interaction::Reflect;
    mirror.before = vec![tilt];
    mirror.after = vec![tilt];
    folded.surfaces.insert(2, mirror);
    let (one, two) = (Beams::new(&straight, 587.6), Beams::new(&folded, 587.6));
    for share in pupil_rings(3) {
        let a = one.arrival(one.aimed([0.3, 1.0], share).unwrap()).unwrap();
        let b = two.arrival(two.aimed([0.3, 1.0], share).unwrap()).unwrap();
        // the fold turns y over
        assert!(
            (a.point.abs() - b.point.abs()).length() < 1e-12,
            "{a:?} {b:?}"
        );
    }
    // the image stands beside the axis
    let center = two.system.frames()[3].origin;
    assert!((center.y.abs() - (total - 30.0)).abs() < 1e-12, "{center}");
}

#[test]
fn aimed_rays_fill_the_stop() {
    let mut lens = singlet(8.0, 10.0);
    lens.surfaces.insert(
        2,
        surface(
            Profile::PLANE,
            lens.surfaces[1].thickness - 10.0,
            Medium::air(),
        ),
    );
    lens.surfaces[1].thickness = 10.0;
    lens.stop = 2;
    let beams = Beams::new(&lens, 486.0);
    for share in pupil_rings(4) {
        let ray = beams.aimed([0.0, 10.0], share).unwrap();
        let at = at_stop(&beams.system, 2, ray).unwrap();
        assert!((at - share * beams.stop_radius).length() < 1e-11);
    }
}

#[test]
fn transmission_of_a_plate() {
    let k = 1e-6;
    let ior = Ior::constant(1.5).with_k(crate::spectrum::Curve::Constant(k));
    let mut plate = lens(
        vec![
            surface(Profile::PLANE, 10.0, Medium::new(ior)),
            surface(Profile::PLANE, 10.0, Medium::air()),
            image(),
        ],
        4.0,
        0.0,
    );
    let through = |plate: &Prescription| {
        Beams::new(plate, 500.0)
            .mean_transmission([0.0; 2], 3)
            .unwrap()
    };
    let bare = through(&plate);
    assert!((bare.surfaces - 0.96f64.powi(2)).abs() < 1e-14);
    assert!((bare.media - (-4.0 * std::f64::consts::PI * k * 10.0 / 500e-6).exp()).abs() < 1e-14);
    let library = crate::spectrum::Library::embedded();
    plate.coat(
        &super::super::stacks::named("MgF2", library)
            .unwrap()
            .unwrap(),
    );
    let coated = through(&plate).surfaces;
    assert!(coated > 0.965 && coated < 0.985, "{coated}");
}

#[test]
fn rings_of_rays_have_the_moments_of_the_disk() {
    let points = pupil_rings(16);
    let n = points.len() as f64;
    let square: f64 = points.iter().map(|p| p.length_squared()).sum::<f64>() / n;
    assert!((square - 0.5).abs() < 1e-3, "{square}");
}
