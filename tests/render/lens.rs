//! Lenses of surfaces rendered: spots against the trace of the same prescription, ghosts, and
//! integrators against each other.

use crate::harness::{Estimate, line_images, measure, scene_in, with};
use abbe::io::lens;
use abbe::io::scene_file::parse_str;
use abbe::optics::analysis::Beams;
use abbe::optics::ghosts::{expression, ghosts, route};
use abbe::optics::paraxial::Paraxial;
use abbe::optics::{
    Aperture, Event, FieldKind, Medium, Prescription, Profile, Ray, Surface, System,
    SystemAperture, stacks,
};
use abbe::scene::Scene;
use abbe::scene::settings::IntegratorKind;
use abbe::spectrum::{Library, xyz};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const D_NM: f64 = 587.5618;

pub fn lenses() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lenses")
}

fn vector(v: DVec3) -> String {
    format!("[{}, {}, {}]", v.x, v.y, v.z)
}

/// Power and place of the light of a beam behind a lens.
#[derive(Clone, Copy, Debug)]
struct Spot {
    /// Share of the beam that arrives.
    share: f64,
    centroid: DVec2,
    rms: f64,
}

impl Spot {
    /// Of weighted points, whose weights are shares of `total`.
    fn new(points: &[(f64, DVec2)], total: f64) -> Self {
        let power: f64 = points.iter().map(|p| p.0).sum();
        let centroid = points.iter().map(|p| p.0 * p.1).sum::<DVec2>() / power;
        let off = |p: &(f64, DVec2)| p.0 * (p.1 - centroid).length_squared();
        Self {
            share: power / total,
            centroid,
            rms: (points.iter().map(off).sum::<f64>() / power).sqrt(),
        }
    }
}

/// Transmittance of a surface without polarization.
pub fn transmittance(event: &Event, before: f64, after: f64) -> f64 {
    let cos_in = event.incoming.dot(event.normal).abs();
    let cos_out = event.outgoing.dot(event.normal).abs();
    let s = (before * cos_in - after * cos_out) / (before * cos_in + after * cos_out);
    let p = (after * cos_in - before * cos_out) / (after * cos_in + before * cos_out);
    1.0 - 0.5 * (s * s + p * p)
}

/// A beam, millimeters.
struct Beam {
    start: DVec3,
    direction: DVec3,
    radius: f64,
}

impl Beam {
    /// A beam at `degrees` to the axis in the yz plane, toward the vertex of the first surface.
    fn tilted(degrees: f64, radius: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let direction = DVec3::new(0.0, sin, cos);
        Self {
            start: -30.0 * direction,
            direction,
            radius,
        }
    }

    /// The spot that rays of the whole beam make in the trace: apertures, Fresnel's losses and the
    /// absorption of the glasses included.
    fn traced(&self, lens: &Prescription) -> Spot {
        let system = System::new(lens, D_NM);
        let indices = system.indices();
        let (x, y) = (DVec3::X, self.direction.cross(DVec3::X));
        let mut points = Vec::new();
        let n = 400;
        for i in 0..n * n {
            let [u, v] = [i / n, i % n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            let at = DVec2::from_angle(TAU * v) * (u.sqrt() * self.radius);
            let ray = Ray {
                o: self.start + x * at.x + y * at.y,
                d: self.direction,
            };
            let mut weight = 1.0;
            let image = lens.surfaces.len() - 1;
            let arrived = system.trace(ray, true, |e| {
                let k = lens.medium_before(e.surface).ior.k(D_NM);
                weight *= (-4.0 * PI * k / (D_NM * 1e-6) * e.distance).exp();
                if e.surface < image {
                    weight *= transmittance(e, indices[e.surface], indices[e.surface + 1]);
                }
            });
            if let Ok(end) = arrived {
                points.push((weight, end.o.truncate()));
            }
        }
        Spot::new(&points, f64::from(n * n))
    }

    /// The share of the beam that arrives along the route of a ghost in a square of half edge
    /// `half`, with Fresnel's losses and the absorption of the glasses.
    fn traced_ghost(
        &self,
        lens: &Prescription,
        pair: [usize; 2],
        (center, half): (DVec2, f64),
    ) -> f64 {
        let system = System::along(lens, D_NM, route(lens, pair));
        let (x, y) = (DVec3::X, self.direction.cross(DVec3::X));
        let (n, image) = (400, lens.surfaces.len() - 1);
        let mut sum = 0.0;
        for i in 0..n * n {
            let [u, v] = [i / n, i % n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            let at = DVec2::from_angle(TAU * v) * (u.sqrt() * self.radius);
            let ray = Ray {
                o: self.start + x * at.x + y * at.y,
                d: self.direction,
            };
            let mut weight = 1.0;
            let arrived = system.trace(ray, true, |e| {
                let passage = &system.route()[e.surface];
                let sides = [lens.in_front(passage), lens.behind(passage)];
                let k = sides[0].ior.k(D_NM);
                weight *= (-4.0 * PI * k / (D_NM * 1e-6) * e.distance).exp();
                // where surfaces cross beyond their apertures, a line may meet the next one behind
                if e.surface > 0 && e.distance < 0.0 {
                    weight = 0.0;
                }
                if passage.surface == image {
                    return;
                }
                let [before, after] = sides.map(|medium| medium.ior.n(D_NM));
                let cos = e.incoming.dot(e.normal).abs();
                let sin = before / after * (1.0 - cos * cos).sqrt();
                let bent = (1.0 - sin * sin).max(0.0).sqrt();
                let s = (before * cos - after * bent) / (before * cos + after * bent);
                let p = (after * cos - before * bent) / (after * cos + before * bent);
                let reflected = 0.5 * (s * s + p * p);
                weight *= if passage.reflects {
                    reflected
                } else {
                    1.0 - reflected
                };
            });
            let is_on = |end: Ray| (end.o.truncate() - center).abs().max_element() < half;
            if arrived.is_ok_and(is_on) {
                sum += weight;
            }
        }
        sum / f64::from(n * n)
    }

    fn text(&self, place: &Place) -> String {
        let start = place.at(self.start);
        let [s, d] = [start, self.direction].map(vector);
        let radius = self.radius * place.scale;
        format!(
            "[[light]]\nbeam = {{ position = {s}, direction = {d}, radius = {radius}, irradiance = \
             1 }}\n"
        )
    }
}

/// Where a bench stands, and how large it is.
struct Place {
    offset: DVec3,
    scale: f64,
    /// Whether its glasses absorb, which they do over lengths of their own.
    absorbs: bool,
}

impl Place {
    const HERE: Self = Self {
        offset: DVec3::ZERO,
        scale: 1.0,
        absorbs: true,
    };

    fn at(&self, p: DVec3) -> DVec3 {
        self.offset + p * self.scale
    }
}

/// Columns and rows of detectors.
const PIXELS: u32 = 192;
/// Half the edge of a detector, in rms radii of the spot that is expected.
const HALF: f64 = 8.0;

const SPOT: &str = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = DEPTH
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [192, 192]
detector = { center = CENTER, u = [-HALF, 0, 0], v = [0, HALF, 0] }
[[lens]]
file = "FILE"
transform = [{ scale = SCALE }, { translate = OFFSET }]
"#;

/// Spots in batches, on a detector around the one that is expected.
fn rendered(
    file: &str,
    beam: &Beam,
    lens: &Prescription,
    around: &Spot,
    integrator: IntegratorKind,
    batches: u32,
    place: &Place,
) -> Vec<Spot> {
    let n = PIXELS;
    let half = HALF * around.rms;
    let z = lens.frames().last().expect("an image").origin.z;
    let at = around.centroid;
    // surfaces that bend light: one path only, and none that is reflected
    let bends = (0..lens.surfaces.len() - 1)
        .filter(|&i| lens.medium_before(i).ior != lens.surfaces[i].medium.ior)
        .count();
    let text = SPOT
        .replace("DEPTH", &bends.to_string())
        .replace("CENTER", &vector(place.at(at.extend(z))))
        .replace("HALF", &(half * place.scale).to_string())
        .replace("SCALE", &place.scale.to_string())
        .replace("OFFSET", &vector(place.offset))
        .replace("FILE", file)
        + &beam.text(place);
    let loaded = parse_str(&text, &lenses()).unwrap_or_else(|e| panic!("{e}"));
    let (mut description, settings) = (loaded.description, loaded.settings);
    for medium in &mut description.media {
        medium.use_k &= place.absorbs;
    }
    let scene = Arc::new(Scene::build(description).unwrap_or_else(|e| panic!("{e}")));
    let pitch = 2.0 * half / f64::from(n);
    let beam_area = PI * beam.radius * beam.radius;
    line_images(&scene, 0, &with(&settings, integrator), batches, 1)
        .into_iter()
        .map(|lines| {
            let points: Vec<(f64, DVec2)> = (0..n * n)
                .map(|i| {
                    let x = (f64::from(i % n) + 0.5) * pitch - half;
                    let y = half - (f64::from(i / n) + 0.5) * pitch;
                    let power = lines[0][i as usize] * pitch * pitch;
                    // u points along -x, so that the detector faces the light
                    (power, at + DVec2::new(-x, y))
                })
                .collect();
            let mut spot = Spot::new(&points, beam_area);
            // a pixel spreads what falls on it over pitch²/12 in each direction
            spot.rms = (spot.rms * spot.rms - pitch * pitch / 6.0).max(0.0).sqrt();
            spot
        })
        .collect()
}

/// Centroid within 0.1 pixel, rms within 0.5 %, and the share of the beam, each with standard
/// errors below a third of that.
fn compare(what: &str, found: &[Spot], expected: &Spot, share: f64) {
    let pitch = 2.0 * HALF * expected.rms / f64::from(PIXELS);
    let of = |f: &dyn Fn(&Spot) -> f64| {
        let values: Vec<f64> = found.iter().map(f).collect();
        Estimate::from_batches(&values)
    };
    let near = |name: &str, found: Estimate, expected: f64, tolerance: f64| {
        println!("{what}: {name} {found:?}, traced {expected}");
        assert!(
            found.error <= tolerance / 3.0,
            "{what}: {name}: {found:?} does not tell"
        );
        assert!(
            (found.mean - expected).abs() <= tolerance,
            "{what}: {name} {found:?}, traced {expected}, allowed {tolerance}"
        );
    };
    near("x", of(&|s| s.centroid.x), expected.centroid.x, 0.1 * pitch);
    near("y", of(&|s| s.centroid.y), expected.centroid.y, 0.1 * pitch);
    near("rms", of(&|s| s.rms), expected.rms, 5e-3 * expected.rms);
    near("share", of(&|s| s.share), expected.share, share);
}

pub fn read(file: &str) -> Prescription {
    lens::read(&lenses().join(file), Library::embedded()).unwrap_or_else(|e| panic!("{e}"))
}

/// A cemented achromat at d, off the axis, by light tracing and by bdpt.
#[test]
fn achromat_spot() {
    let (file, place) = ("achromat.zmx", &Place::HERE);
    let lens = read(file);
    let beam = Beam::tilted(2.0, 10.0);
    let expected = beam.traced(&lens);
    let (light, bdpt) = (IntegratorKind::Light, IntegratorKind::Bdpt);
    for (integrator, batches, share) in [(light, 40, 1e-3), (bdpt, 16, 2e-3)] {
        let found = rendered(file, &beam, &lens, &expected, integrator, batches, place);
        compare(&format!("{integrator:?}"), &found, &expected, share);
    }
}

/// Six elements, a stop between, 10 degrees off the axis: what the apertures cut is cut.
#[test]
fn double_gauss_spot() {
    let (file, place) = ("double_gauss.zmx", &Place::HERE);
    let lens = read(file);
    let beam = Beam::tilted(10.0, 16.0);
    let expected = beam.traced(&lens);
    let light = IntegratorKind::Light;
    let found = rendered(file, &beam, &lens, &expected, light, 24, place);
    compare("double Gauss", &found, &expected, 2e-3);
}

/// The bench 10 m from the origin, in micrometers and in kilometers: the same spot, of the same
/// random numbers, but for light at the border of two pixels.
#[test]
fn benches_may_be_anywhere_and_of_any_size() {
    let lens = read("achromat.zmx");
    let beam = Beam::tilted(2.0, 10.0);
    let expected = beam.traced(&lens);
    let spot = |offset, scale| {
        let place = &Place {
            offset,
            scale,
            absorbs: false,
        };
        let light = IntegratorKind::Light;
        rendered("achromat.zmx", &beam, &lens, &expected, light, 1, place)[0]
    };
    let here = spot(DVec3::ZERO, 1.0);
    let far = DVec3::new(10_000.0, -7_000.0, 3_000.0);
    for (offset, scale) in [(far, 1.0), (DVec3::ZERO, 1e-3), (DVec3::ZERO, 1e6)] {
        let there = spot(offset, scale);
        let what = format!("{offset} {scale}: {there:?}, here {here:?}");
        let moved = (there.centroid - here.centroid).length();
        assert!(moved < 1e-5 * here.rms, "{what}");
        assert!((there.rms / here.rms - 1.0).abs() < 1e-5, "{what}");
        assert!((there.share / here.share - 1.0).abs() < 1e-5, "{what}");
    }
}

/// Spheres of N-SF66 and air in turn, with their radii and thicknesses, millimeters.
fn of_flint(rows: &[(f64, f64)]) -> Prescription {
    let ior = Library::embedded().ior("schott:N-SF66").expect("known");
    let media = [Medium::new(ior), Medium::air()];
    let aperture = Aperture::circle(10.0);
    let surfaces = rows.iter().enumerate().map(|(i, &(radius, thickness))| {
        let medium = media[i % 2].clone();
        Surface::new(Profile::sphere(radius), aperture, thickness, medium)
    });
    let image = Surface::new(Profile::PLANE, Aperture::OPEN, 0.0, Medium::air());
    Prescription {
        name: String::new(),
        notes: Vec::new(),
        wavelengths: Prescription::default_wavelengths(),
        primary: 1,
        aperture: SystemAperture::EntrancePupil(8.0),
        field_kind: FieldKind::AngleDeg,
        fields: vec![[0.0; 2]],
        object_distance: None,
        object_medium: Medium::air(),
        surfaces: surfaces.chain([image]).collect(),
        stop: 0,
    }
}

/// Light that the back and then the front of a singlet reflect, by itself: the power of real rays
/// along its route, and R² of the power of the light that none reflects, less what its way
/// through the glass takes.
#[test]
fn ghost_of_a_singlet() {
    let text = r#"
unit = "mm"
[render]
integrator = "light"
wavelengths = { line_nm = 587.5618 }
sequences = ["L T(1) T(2) E", "L T(1) R(2) R(1) T(2) E"]
[[sensor]]
resolution = [128, 128]
detector = { center = [0, 0, 30], u = [-20, 0, 0], v = [0, 20, 0] }
[[lens]]
surface = [
    { radius = 60, thickness = 2, glass = "schott:N-SF66", semi_diameter = 10 },
    { radius = -60, semi_diameter = 10 },
]
[[light]]
beam = { position = [0, 0, -5], direction = [0, 0, 1], radius = 4, irradiance = 1 }
"#;
    let (scene, settings) = scene_in(&lenses(), text);
    let classes = ["LSSE", "LSSSSE", "L T(1) T(2) E", "L T(1) R(2) R(1) T(2) E"];
    let found = measure(&scene, &settings, 16, 1, &classes);
    let [direct, ghost, by_name, ghost_by_name] = [0, 1, 2, 3].map(|i| found.classes[i].mean);
    assert_eq!([direct, ghost], [by_name, ghost_by_name]);
    let lens = of_flint(&[(60.0, 2.0), (-60.0, 28.0)]);
    let traced = ghosts(&lens, D_NM, [0.0; 2], 40);
    let [traced] = traced.as_slice() else {
        panic!("one ghost: {traced:?}");
    };
    let power = mean_y(traced.power, 4.0, 20.0);
    found.classes[1].assert_is("ghost of a singlet", power, 0.01 / 3.0);
    // closed form of a ray along the axis: the glass is passed three times in place of once
    let Medium { ior, .. } = &lens.surfaces[0].medium;
    let reflectance = ((ior.n(D_NM) - 1.0) / (ior.n(D_NM) + 1.0)).powi(2);
    let further = (-4.0 * PI * ior.k(D_NM) / (D_NM * 1e-6) * 4.0).exp();
    let (ratio, closed) = (ghost / direct, reflectance * reflectance * further);
    println!("ghost over direct light {ratio}, on the axis {closed}");
    assert!((ratio / closed - 1.0).abs() < 0.01, "{ratio} {closed}");
}

/// Mean Y over a square of half edge `half_mm` that gets this share of a beam of radius `radius_mm`
/// and irradiance 1.
fn mean_y(share: f64, radius_mm: f64, half_mm: f64) -> f64 {
    share * PI * radius_mm * radius_mm / (4.0 * half_mm * half_mm) * xyz::cmf(D_NM)[1] / xyz::N_Y
}

/// Light through a coated achromat: by the characteristic matrix at each surface, and Beer's law.
#[test]
fn coated_lens_transmits_what_its_trace_does() {
    let text = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = 3
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [64, 64]
detector = { center = [0, 0, 100], u = [-10, 0, 0], v = [0, 10, 0] }
[[lens]]
file = "achromat.zmx"
coating = "MgF2"
[[light]]
beam = { position = [0, 0, -5], direction = [0, 0, 1], radius = 10, irradiance = 1 }
"#;
    let (scene, settings) = scene_in(&lenses(), text);
    let found = measure(&scene, &settings, 32, 2, &["L T(1) T(2) T(3) E"]);
    let mut lens = read("achromat.zmx");
    let transmission = |lens: &Prescription| {
        let beams = Beams::new(lens, D_NM);
        let t = beams.mean_transmission([0.0; 2], 24).expect("arrives");
        t.surfaces * t.media
    };
    let bare = transmission(&lens);
    let mgf2 = stacks::named("MgF2", Library::embedded()).expect("a library");
    lens.coat(&mgf2.expect("a coating"));
    let coated = transmission(&lens);
    // far more than the standard error: a coating left out would be seen
    assert!(coated > bare + 0.04, "{coated} {bare}");
    found.classes[0].assert_is("coated", mean_y(coated, 10.0, 10.0), 1e-3);
}

/// Every ghost of two lenses of dense flint by itself, against real rays along its route.
#[test]
fn ghosts_have_the_power_of_their_routes() {
    let rows = [(60.0, 3.0), (-200.0, 4.0), (-50.0, 2.0), (80.0, 40.0)];
    let lens = of_flint(&rows);
    let expected = ghosts(&lens, D_NM, [0.0; 2], 40);
    assert_eq!(expected.len(), 6);
    let names = expected.iter().map(|g| expression(&lens, g.surfaces));
    let names: Vec<String> = names.collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let table: Vec<String> = rows
        .iter()
        .enumerate()
        .map(|(i, (radius, thickness))| {
            let glass = ["glass = \"schott:N-SF66\", ", ""][i % 2];
            format!("{{ radius = {radius}, thickness = {thickness}, {glass}semi_diameter = 10 }}")
        })
        .collect();
    let text = GHOSTS.replace("SURFACES", &table.join(",\n"));
    let (scene, settings) = scene_in(&lenses(), &text);
    let found = measure(&scene, &settings, 16, 4, &names);
    for ((ghost, name), found) in expected.iter().zip(&names).zip(&found.classes) {
        found.assert_is(name, mean_y(ghost.power, 4.0, 40.0), 0.02);
    }
    // held to these sequences, a quarter of the paths tells far more: each its ghost, and no other
    let text = text.replace("[render]", "[render]\nsequences = \"ghosts\"");
    let (scene, settings) = scene_in(&lenses(), &text);
    let held = measure(&scene, &settings, 16, 1, &names);
    let mut sum = 0.0;
    for ((ghost, name), held) in expected.iter().zip(&names).zip(&held.classes) {
        let power = mean_y(ghost.power, 4.0, 40.0);
        sum += power;
        let share = held.scaled(ghost.power / power);
        println!(
            "held to {name}: {:.6e} ({:.0e}) of the beam, traced {:.6e}",
            share.mean, share.error, ghost.power
        );
        held.assert_is(&format!("held to {name}"), power, 0.01 / 3.0);
    }
    held.y.assert_is("all ghosts", sum, 0.01 / 3.0);
}

/// One ghost of the double Gauss, 10 degrees off the axis, held to its sequence: the share of the
/// beam that arrives along its route, to 1 %.
#[test]
fn ghost_of_the_double_gauss() {
    let lens = read("double_gauss.zmx");
    let pupil = Paraxial::new(&lens, D_NM).first_order().entrance_pupil;
    let mut beam = Beam::tilted(10.0, 11.0);
    beam.start = DVec3::Z * pupil.position - 100.0 * beam.direction;
    // surfaces 11 and 9: a spot of 3.4 mm, all of it on the detector
    let (pair, center, half) = ([10, 8], DVec2::new(0.0, 17.6), 12.0);
    let expected = beam.traced_ghost(&lens, pair, (center, half));
    let sequence = expression(&lens, pair);
    let (y, z) = (center.y, lens.frames().last().expect("an image").origin.z);
    let text = format!(
        r#"
unit = "mm"
[render]
integrator = "light"
sequences = "{sequence}"
wavelengths = {{ line_nm = 587.5618 }}
[[sensor]]
resolution = [64, 64]
detector = {{ center = [0, {y}, {z}], u = [-{half}, 0, 0], v = [0, {half}, 0] }}
[[lens]]
file = "double_gauss.zmx"
{}"#,
        beam.text(&Place::HERE)
    );
    let (scene, settings) = scene_in(&lenses(), &text);
    let found = measure(&scene, &settings, 16, 1, &[]).y;
    let share = mean_y(expected, beam.radius, half);
    let told = found.scaled(expected / share);
    println!(
        "held to {sequence}: {:.6e} ({:.0e}) of the beam, traced {expected:.6e}",
        told.mean, told.error
    );
    found.assert_is("ghost of the double Gauss", share, 0.01 / 3.0);
}

/// A lamp through a singlet, held to its light and its ghost: from the lamp, from the detector and
/// by both the same, and the ghost as bright as among all paths.
#[test]
fn integrators_agree_on_sequences() {
    let text = r#"
unit = "mm"
[render]
wavelengths = { line_nm = 587.5618 }
sequences = ["L T(1) T(2) E", "L T(1) R(2) R(1) T(2) E"]
[[sensor]]
resolution = [8, 8]
detector = { center = [0, 0, 12], u = [-6, 0, 0], v = [0, 6, 0] }
[[lens]]
surface = [
    { radius = 30, thickness = 3, glass = "schott:N-SF66", semi_diameter = 8 },
    { radius = -30, semi_diameter = 8 },
]
[[object]]
disk = { center = [0, 0, -4], normal = [0, 0, 1], radius = 5 }
emission = { value = 1 }
"#;
    let classes = ["L T(1) T(2) E", "L T(1) R(2) R(1) T(2) E"];
    let of = |text: &str, integrator, passes| {
        let (scene, settings) = scene_in(&lenses(), text);
        let found = measure(&scene, &with(&settings, integrator), 16, passes, &classes);
        assert!(
            !text.contains("sequences")
                || (found.classes[0].mean + found.classes[1].mean - found.y.mean).abs()
                    < 1e-6 * found.y.mean
        );
        found.classes
    };
    let path = of(text, IntegratorKind::Path, 64);
    let free = text.lines().filter(|line| !line.starts_with("sequences"));
    let free: Vec<&str> = free.collect();
    let free = of(&free.join("\n"), IntegratorKind::Path, 256);
    let others = [IntegratorKind::Light, IntegratorKind::Bdpt];
    let others = others.map(|integrator| of(text, integrator, 64));
    for other in std::iter::once(&free).chain(&others) {
        println!("path {path:?}, other {other:?}");
        for (path, other) in path.iter().zip(other) {
            assert!(path.error < 0.02 * path.mean, "{path:?}");
            // of all paths, few are ghosts
            assert!(other.error < 0.1 * other.mean, "{other:?}");
            assert!(path.deviation(other) < 4.5, "{path:?} {other:?}");
        }
    }
    for other in others.iter().flatten() {
        assert!(other.error < 0.03 * other.mean, "{other:?}");
    }
    // a ghost is 1 % of the light, and as well known as the light
    let [light, ghost] = [0, 1].map(|i| path[i].error / path[i].mean);
    let among_all = free[1].error / free[1].mean;
    assert!(ghost < 3.0 * light, "{ghost} {light}");
    assert!(2.0 * ghost < among_all, "{ghost} {among_all}");
}

const GHOSTS: &str = r#"
unit = "mm"
[render]
integrator = "light"
max_depth = 10
wavelengths = { line_nm = 587.5618 }
[[sensor]]
resolution = [128, 128]
detector = { center = [0, 0, 49], u = [-40, 0, 0], v = [0, 40, 0] }
[[lens]]
surface = [
SURFACES
]
[[light]]
beam = { position = [0, 0, -5], direction = [0, 0, 1], radius = 4, irradiance = 1 }
"#;

/// A lamp through a lens with a cemented surface, an asphere, a stop, ground edges, and an air gap
/// of 1 um: from the lamp, from the detector and by both the same.
#[test]
fn integrators_agree_behind_a_lens() {
    let text = r#"
unit = "mm"
[render]
max_depth = 6
[[sensor]]
resolution = [8, 8]
detector = { center = [1, 0, 24], u = [-4, 0, 0], v = [0, 4, 0] }
[material.ground]
diffuse = { reflectance = 0.6 }
[[lens]]
barrel = 8
edge = "ground"
surface = [
    { radius = 20, thickness = 4, glass = "schott:N-BK7", semi_diameter = 7 },
    { radius = -22, thickness = 2, glass = "schott:SF5", semi_diameter = 7 },
    { radius = -60, thickness = 0.001, semi_diameter = 7 },
    { radius = -60, thickness = 2, glass = "schott:N-BK7", semi_diameter = 7 },
    { radius = 50, even = [0, 2e-5], thickness = 1, semi_diameter = 6.5 },
    { semi_diameter = 5 },
]
transform = [{ rotate = { axis = [1, 0, 0], deg = 5 } }]
[[object]]
disk = { center = [0, 0, -12], normal = [0, 0, 1], radius = 9 }
emission = { name = "D65", luminance = 1 }
"#;
    let (scene, settings) = scene_in(&lenses(), text);
    let of = |integrator, passes| measure(&scene, &with(&settings, integrator), 16, passes, &[]).y;
    let path = of(IntegratorKind::Path, 128);
    // camera sub-paths toward the last surface: the same light, with less noise
    let aim = "v = [0, 4, 0], aim = { target = [0, 0, 9], radius = 6 } }";
    let (aimed, settings) = scene_in(&lenses(), &text.replace("v = [0, 4, 0] }", aim));
    for integrator in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let aimed = measure(&aimed, &with(&settings, integrator), 16, 128, &[]).y;
        println!("path {path:?}, aimed {integrator:?} {aimed:?}");
        // a share of 0.14 of the cosine hemisphere is seen 6.6 times as often
        assert!(aimed.error < 0.7 * path.error, "{path:?} {aimed:?}");
        assert!(path.deviation(&aimed) < 4.5, "{path:?} {aimed:?}");
    }
    for integrator in [IntegratorKind::Light, IntegratorKind::Bdpt] {
        let other = of(integrator, 512);
        println!("path {path:?}, {integrator:?} {other:?}");
        assert!(path.mean > 0.0 && path.error < 0.02 * path.mean, "{path:?}");
        assert!(other.error < 0.02 * other.mean, "{other:?}");
        assert!(
            path.deviation(&other) < 4.5,
            "path {path:?}, {integrator:?} {other:?}"
        );
    }
}
