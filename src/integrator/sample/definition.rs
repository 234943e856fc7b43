//! The densities of real paths by definition, from nothing but the finished path: its points, normals, bsdfs and labels.
//!
//! Every path that a strategy makes in scenes with all kinds of vertices is taken apart again; every density that the strategy's
//! weight used (of its own side, of the other side, of the joining edge, of direct sampling) must be the one computed here.

use super::{Frame, Workspace, sample_pixel};
use crate::bsdf::{Bsdf, Label, Lobe};
use crate::film::{Crop, SensorResponse};
use crate::geometry::{EndPoint, Hit, Ray, SurfaceId};
use crate::io::scene_file::parse_str;
use crate::light::{HitMeasure, Light, LightId};
use crate::scene::{Scene, Settings};
use crate::spectrum::MAX_LANES;
use crate::transport::record::{Recorded, take};
use crate::transport::subpath::Vertex;
use crate::transport::{PassSettings, Subpath};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

type Column = [f64; MAX_LANES];

/// Rounding of positions (1e-16 of their size) is amplified by grazing angles and by narrow lobes.
const TOLERANCE: f64 = 1e-9;

/// A finished path: end points, and scattering vertices with their labels in between.
struct Finished<'a> {
    scene: &'a Scene,
    sensor: usize,
    light: LightId,
    x0: EndPoint,
    inner: Vec<(&'a Vertex, Label)>,
    xk: EndPoint,
}

/// The end of a connecting segment as an end point.
fn end_of(scene: &Scene, ray: &Ray) -> EndPoint {
    let normal = |id: SurfaceId| scene.accel.surface(ray, &Hit { t: ray.t_max, id, uv: DVec2::ZERO }).ng;
    if ray.t_max.is_infinite() {
        EndPoint { p: DVec3::ZERO, n: -ray.d, surface: None, infinite: true }
    } else {
        let p = ray.o + ray.d * ray.t_max;
        EndPoint { p, n: ray.end.map_or(DVec3::ZERO, normal), surface: ray.end, infinite: false }
    }
}

/// The light at the end of a connecting segment: the surface's, or the only one that is no surface.
fn light_of(scene: &Scene, ray: &Ray) -> LightId {
    match ray.end {
        Some(id) => scene.objects[id.instance.0 as usize].light.unwrap(),
        None => LightId(scene.lights.iter().position(|l| !matches!(l, Light::Area(_))).unwrap() as u32),
    }
}

fn surface_end(vertex: &Vertex) -> EndPoint {
    EndPoint { p: vertex.point.p, n: vertex.point.ng, surface: Some(vertex.point.id), infinite: false }
}

impl<'a> Finished<'a> {
    fn new(scene: &'a Scene, sensor: usize, light: &'a Subpath, camera: &'a Subpath, made: &Recorded) -> Self {
        let (s, t) = (made.s, made.t);
        let (mut x0, mut id) = (light.origin, light.light);
        let mut xk = camera.origin;
        let on_light = s.saturating_sub(1);
        let mut on_camera = t.saturating_sub(1);
        match (s, t) {
            (0, _) => {
                on_camera = t - 2;
                if let Some(escape) = camera.escape.as_ref().filter(|_| camera.vertices.len() == t - 2) {
                    x0 = EndPoint { p: DVec3::ZERO, n: -escape.direction, surface: None, infinite: true };
                    id = Some(scene.environments[0]);
                } else {
                    x0 = surface_end(&camera.vertices[t - 2]);
                    id = camera.vertices[t - 2].light;
                }
            }
            (_, 0) => {
                xk = light.sensor_hits.iter().find(|h| h.depth + 2 == s).unwrap().xk;
            }
            (1, 1) if !scene.sensors[sensor].camera.is_hittable() => {
                xk = end_of(scene, made.segment.as_ref().unwrap());
            }
            (1, _) => {
                let segment = made.segment.as_ref().unwrap();
                x0 = end_of(scene, segment);
                id = Some(light_of(scene, segment));
            }
            (_, 1) => xk = end_of(scene, made.segment.as_ref().unwrap()),
            _ => {}
        }
        let on_light = if t == 0 { s - 2 } else { on_light };
        // the label of a joined vertex is that of the joint; of the others, what was drawn
        let label = |path: &Subpath, i: usize, last: bool| {
            if last { Label::NonSpecular } else { path.densities[i + 1].label }
        };
        let mut inner: Vec<_> = (0..on_light)
            .map(|i| (&light.vertices[i], label(light, i, t > 0 && i + 1 == on_light)))
            .collect();
        inner.extend(
            (0..on_camera)
                .rev()
                .map(|i| (&camera.vertices[i], label(camera, i, s > 0 && i + 1 == on_camera))),
        );
        if xk.n == DVec3::ZERO && t == 1 {
            // a lens is no surface of the scene: its points share their normal
            xk.n = camera.origin.n;
        }
        Self { scene, sensor, light: id.unwrap(), x0, inner, xk }
    }

    fn len(&self) -> usize {
        self.inner.len() + 2
    }

    fn position(&self, i: usize) -> DVec3 {
        match i {
            0 => self.x0.p,
            _ if i + 1 == self.len() => self.xk.p,
            _ => self.inner[i - 1].0.point.p,
        }
    }

    /// Unit direction from x_i to x_{i+1}.
    fn forward(&self, i: usize) -> DVec3 {
        let parallel = matches!(self.scene.lights[self.light.0 as usize], Light::Directional(_) | Light::Environment(_));
        if i == 0 && parallel { self.x0.n } else { (self.position(i + 1) - self.position(i)).normalize() }
    }

    fn cos(&self, i: usize, w: DVec3) -> f64 {
        match i {
            0 => self.x0.cos(w),
            _ if i + 1 == self.len() => self.xk.cos(w),
            _ => w.dot(self.inner[i - 1].0.point.ng).abs(),
        }
    }

    fn d2(&self, i: usize) -> f64 {
        self.position(i).distance_squared(self.position(i + 1))
    }

    fn hittable(&self) -> f64 {
        if self.scene.sensors[self.sensor].camera.is_hittable() { 1.0 } else { 0.0 }
    }

    /// Density of direction at inner vertex i: towards the sensor, and towards the light.
    fn scattered(&self, i: usize) -> (Column, Column) {
        let (vertex, label) = self.inner[i - 1];
        let w_light = vertex.frame.to_local(-self.forward(i - 1));
        let w_camera = vertex.frame.to_local(self.forward(i));
        let bsdf: &Bsdf = &vertex.bsdf;
        if label.is_specular() {
            let (forward, backward) =
                (bsdf.label_probability(label, w_light), bsdf.label_probability(label, w_camera));
            return ([forward; MAX_LANES], [backward; MAX_LANES]);
        }
        let eval = bsdf.eval(w_light, w_camera);
        match eval.columns {
            Some((camera, light)) => (camera.lanes, light.lanes),
            None => ([eval.pdf_camera; MAX_LANES], [eval.pdf_light; MAX_LANES]),
        }
    }

    /// `pf`, `pr` and the density of direct sampling.
    fn densities(&self) -> (Vec<Column>, Vec<Column>, f64) {
        let n = self.len();
        let light = &self.scene.lights[self.light.0 as usize];
        let context = self.scene.light_context(0.0);
        let camera = &self.scene.sensors[self.sensor].camera;
        let chosen = self.scene.selection.probability(self.light);
        let scaled = |c: Column, f: f64| c.map(|v| v * f);
        let mut pf = vec![[0.0; MAX_LANES]; n];
        let mut pr = pf.clone();

        let (position, direction) = light.emission_density(&context, &self.x0, self.forward(0));
        pf[0] = [chosen * position; MAX_LANES];
        let next = direction.area_density(self.cos(1, self.forward(0)), self.d2(0));
        pf[1] = [next * if n == 2 { self.hittable() } else { 1.0 }; MAX_LANES];

        let (position, direction) = camera.density(&self.xk, -self.forward(n - 2), 0.0);
        pr[n - 1] = [position; MAX_LANES];
        let to_light = match light.hit_measure() {
            HitMeasure::Area => self.cos(0, self.forward(0)) / self.d2(0),
            HitMeasure::SolidAngle => 1.0,
            HitMeasure::Never => 0.0,
        };
        pr[n - 2] = [if n == 2 {
            direction.area_density(1.0, 1.0) * to_light
        } else {
            direction.area_density(self.cos(n - 2, self.forward(n - 2)), self.d2(n - 2))
        }; MAX_LANES];

        for i in 1..n - 1 {
            let (forward, backward) = self.scattered(i);
            let measure = self.cos(i + 1, self.forward(i)) / self.d2(i);
            pf[i + 1] = scaled(forward, if i + 2 == n { measure * self.hittable() } else { measure });
            let measure =
                if i == 1 { to_light } else { self.cos(i - 1, self.forward(i - 1)) / self.d2(i - 1) };
            pr[i - 1] = scaled(backward, measure);
        }
        let direct = if n == 2 && self.hittable() == 0.0 {
            // image cameras see x₀ itself, where it is a point
            if self.x0.infinite { 0.0 } else { pf[0][0] }
        } else {
            chosen * light.direct_density(&context, self.position(1), &self.x0)
        };
        (pf, pr, direct)
    }

    /// The directions of specular vertices are the ones their labels stand for, and dispersive where the index says so.
    fn assert_labels(&self, made: &Recorded) {
        for (i, (vertex, label)) in self.inner.iter().enumerate() {
            let (w_light, w_camera) = (-self.forward(i), self.forward(i + 1));
            let n = vertex.point.ng;
            let transmitted = w_light.dot(n) * w_camera.dot(n) < 0.0;
            assert_eq!(made.specular[i + 1], label.is_specular(), "label of x{}", i + 1);
            let (a, b) = (vertex.frame.to_local(w_light), vertex.frame.to_local(w_camera));
            match label {
                Label::NonSpecular => assert!(!made.dispersive[i + 1]),
                Label::SpecularReflect => {
                    assert!(!transmitted && !made.dispersive[i + 1]);
                    assert!((a.truncate() + b.truncate()).length() < 1e-9, "not mirrored at x{}", i + 1);
                }
                Label::SpecularTransmit => {
                    assert!(transmitted);
                    let smooth = vertex.bsdf.lobes.iter().any(|(_, l)| matches!(l, Lobe::Dielectric(_)));
                    assert_eq!(made.dispersive[i + 1], smooth && vertex.bsdf.interface.dispersive);
                    let interface = &vertex.bsdf.interface;
                    let (eta_a, eta_b) = (interface.near(a.z > 0.0)[0], interface.near(b.z > 0.0)[0]);
                    let bent = if smooth { a.truncate() * eta_a + b.truncate() * eta_b } else { a.truncate() + b.truncate() };
                    assert!(bent.length() < 1e-9, "Snell's law at x{}: {bent}", i + 1);
                }
            }
        }
        for i in [0, self.len() - 1] {
            assert!(!made.specular[i] && !made.dispersive[i]);
        }
    }
}

fn differs(a: f64, b: f64) -> bool {
    // NaN differs from everything
    !((a - b).abs() <= TOLERANCE * a.abs().max(b.abs()))
}

/// The weight by definition: products of all densities of each strategy.
fn weight_by_definition(pf: &[Column], pr: &[Column], direct: f64, multipliers: &[f64], s: usize) -> f64 {
    let n = pf.len();
    let density = |s: usize| -> f64 {
        let all = (0..n).map(|i| match (i, s) {
            (0, 1) => direct,
            _ if i < s => pf[i][0],
            _ => pr[i][0],
        });
        all.product::<f64>() * multipliers[s]
    };
    density(s) / (0..=n).map(density).sum::<f64>()
}

/// Takes apart every path of `passes` passes; `factor` plants an error in `pr` of x₁. Returns how many there were of each strategy.
fn check(name: &str, text: &str, folder: &Path, passes: u32, planted: f64) -> BTreeMap<(usize, usize), usize> {
    let loaded = parse_str(text, folder).unwrap_or_else(|e| panic!("{name}: {e}"));
    let settings = Settings { pair_probability: 0.5, ..loaded.settings };
    let scene = Scene::build(loaded.description).unwrap();
    let resolution = scene.sensors[0].camera.resolution();
    let crop = Crop { x0: 0, y0: 0, x1: resolution.width, y1: resolution.height };
    let frame = Frame::new(&scene, 0, &settings, &crop, false);
    let mut workspace = Workspace::default();
    let mut strategies: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for index in 0..passes {
        let pass = PassSettings { index, ..PassSettings::default() };
        for (x, y) in (0..resolution.height).flat_map(|y| (0..resolution.width).map(move |x| (x, y))) {
            take();
            let wavelengths = sample_pixel(&frame, &pass, (x, y), &SensorResponse::Xyz, &mut workspace);
            for made in take() {
                let path = Finished::new(&scene, 0, &workspace.light, &workspace.camera, &made);
                let what = || {
                    let labels: Vec<_> = path.inner.iter().map(|v| v.1).collect();
                    format!("{name}, pass {index}, pixel {x} {y}, strategy ({}, {}), {labels:?}", made.s, made.t)
                };
                assert_eq!(path.len(), made.s + made.t, "{}", what());
                path.assert_labels(&made);
                let (pf, mut pr, direct) = path.densities();
                for lane in &mut pr[1] {
                    *lane *= planted;
                }
                for i in 0..path.len() {
                    for k in 0..wavelengths.count() {
                        let pairs = [("pf", made.pf[i][k], pf[i][k]), ("pr", made.pr[i][k], pr[i][k])];
                        for (side, found, expected) in pairs {
                            assert!(
                                !differs(found, expected),
                                "{}: {side} of x{i}, lane {k}, is {found:e}, by definition {expected:e}",
                                what()
                            );
                        }
                    }
                }
                assert!(!differs(made.direct, direct), "{}: direct {:e}, by definition {direct:e}", what(), made.direct);
                let weight = weight_by_definition(&pf, &pr, direct, &made.multipliers, made.s);
                assert!(
                    (made.weight - weight).abs() < 10.0 * TOLERANCE,
                    "{}: weight {}, by definition {weight}",
                    what(),
                    made.weight
                );
                *strategies.entry((made.s, made.t)).or_default() += 1;
            }
        }
    }
    assert_eq!(workspace.counters.medium_mismatches, 0, "{name}");
    println!("{name}: {strategies:?}");
    strategies
}

/// A sphere of `n` rings with interpolated normals.
fn smooth_sphere(n: usize) -> String {
    let mut obj = String::new();
    let columns = 2 * n;
    for ring in 0..=n {
        for column in 0..columns {
            let theta = std::f64::consts::PI * ring as f64 / n as f64;
            let phi = std::f64::consts::TAU * column as f64 / columns as f64;
            let [x, y, z] = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
            writeln!(obj, "v {x} {y} {z}\nvn {x} {y} {z}").unwrap();
        }
    }
    for ring in 0..n {
        for column in 0..columns {
            // all corners at a pole are one
            let at = |r: usize, c: usize| 1 + r * columns + if r % n == 0 { 0 } else { c % columns };
            let corners =
                [at(ring, column), at(ring, column + 1), at(ring + 1, column + 1), at(ring + 1, column)];
            let face = |a: usize, b: usize, c: usize| format!("f {a}//{a} {b}//{b} {c}//{c}");
            if ring > 0 {
                writeln!(obj, "{}", face(corners[0], corners[1], corners[2])).unwrap();
            }
            if ring + 1 < n {
                writeln!(obj, "{}", face(corners[0], corners[2], corners[3])).unwrap();
            }
        }
    }
    obj
}

const MATERIALS: &str = r#"
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.8 }
[material.coat]
mix = [{ weight = 0.3, mirror = {} }, { weight = 0.3, conductor = { metal = "Ag", roughness = 0.3 } }, { weight = 0.4, diffuse = { reflectance = 0.7 } }]
[material.clear]
dielectric = {}
[material.frost]
dielectric = { roughness = 0.3 }
[material.partly]
mix = [{ weight = 0.5, dielectric = {} }, { weight = 0.5, dielectric = { roughness = 0.4 } }]
[material.sheet]
thin = { ior = 1.5 }
"#;

const PINHOLE: &str = r#"
[render]
max_depth = 6
[[sensor]]
resolution = [12, 12]
perspective = { eye = [0.1, 1, 3.5], target = [0, 0.7, 0], fov_deg = 50 }
"#;

const LENS: &str = r#"
[render]
max_depth = 6
lanes = 8
[[sensor]]
resolution = [12, 12]
perspective = { eye = [0.1, 1, 3.5], target = [0, 0.7, 0], fov_deg = 50, aperture_radius = 0.2, focus_distance = 3 }
"#;

const FLOOR: &str = r#"
[[object]]
quad = { center = [0, 0, 0], u = [0, 0, 3], v = [3, 0, 0] }
material = "coat"
[[object]]
quad = { center = [0, 1, -1.5], u = [1, 0, 0], v = [0, 1, 0] }
material = "white"
"#;

const LAMP: &str = r#"
[[object]]
sphere = { center = [1, 2.2, 0.4], radius = 0.4 }
material = "white"
emission = 3
[[object]]
quad = { center = [-1.2, 1.5, 0], u = [0, 0.4, 0], v = [0, 0, 0.4] }
emission = 2
two_sided = true
"#;

fn balls(material: &str) -> String {
    format!(
        r#"
[[object]]
sphere = {{ center = [-0.4, 0.6, 0], radius = 0.5 }}
material = "{material}"
interior = "flint"
[[object]]
quad = {{ center = [0.6, 0.7, 0.6], u = [0.3, 0, 0.1], v = [0, 0.5, 0] }}
material = "sheet"
"#
    )
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

#[test]
fn densities_by_definition_of_clear_glass_before_area_lights() {
    let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &balls("clear")].concat();
    let seen = check("clear", &text, &scenes(), 40, 1.0);
    for strategy in [(0, 3), (1, 1), (1, 4), (2, 2), (3, 2), (2, 3), (4, 1), (5, 3)] {
        assert!(seen.contains_key(&strategy), "{strategy:?}");
    }
}

#[test]
fn densities_by_definition_of_rough_glass_mixtures_and_lens() {
    for material in ["frost", "partly"] {
        let text = [LENS, MATERIALS, FLOOR, LAMP, &balls(material)].concat();
        check(material, &text, &scenes(), 40, 1.0);
    }
}

#[test]
fn densities_by_definition_of_every_kind_of_light() {
    for (name, light) in [
        ("point", "[[light]]\npoint = { position = [0.5, 2, 1], intensity = 1 }"),
        ("spot", "[[light]]\nspot = { position = [0.5, 2, 1], direction = [-0.5, -1, -0.6], outer_deg = 40, inner_deg = 20, intensity = 9 }"),
        ("directional", "[[light]]\ndirectional = { direction = [-0.5, -1, -0.6], irradiance = 1 }"),
        ("beam", "[[light]]\nbeam = { position = [0.5, 2, 1], direction = [-0.5, -0.8, -0.6], radius = 0.4, irradiance = 9 }"),
        ("environment", "[[light]]\nenvironment = { radiance = 0.3 }"),
    ] {
        let text = [PINHOLE, MATERIALS, FLOOR, LAMP, light, &balls("partly")].concat();
        check(name, &text, &scenes(), 20, 1.0);
    }
}

#[test]
fn densities_by_definition_at_detectors() {
    for (name, kind) in [("detector", "false"), ("transparent detector", "true")] {
        let sensor = format!(
            r#"
[render]
max_depth = 5
[[sensor]]
resolution = [8, 8]
detector = {{ center = [0.2, 0.05, 0.3], u = [0.8, 0, 0], v = [0, 0, -0.8], transparent = {kind} }}
"#
        );
        let light = "[[light]]\nenvironment = { radiance = 0.3 }";
        let text = [&sensor, MATERIALS, FLOOR, LAMP, light, &balls("partly")].concat();
        let seen = check(name, &text, &scenes(), 60, 1.0);
        for strategy in [(0, 2), (1, 1), (2, 0), (4, 0), (3, 1), (2, 2)] {
            assert!(seen.contains_key(&strategy), "{name}: {strategy:?}");
        }
    }
}

#[test]
fn densities_by_definition_of_interpolated_normals() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.obj"), smooth_sphere(6)).unwrap();
    for material in ["frost", "clear", "coat"] {
        let interior = if material == "coat" { "" } else { "interior = \"flint\"" };
        let ball = format!(
            r#"
[[object]]
mesh = {{ obj = "ball.obj" }}
transform = [{{ scale = 0.6 }}, {{ translate = [0, 0.7, 0] }}]
material = "{material}"
{interior}
"#
        );
        let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &ball].concat();
        check(&format!("interpolated {material}"), &text, folder.path(), 40, 1.0);
    }
}

#[test]
#[should_panic(expected = "by definition")]
fn a_planted_error_of_a_millionth_is_seen() {
    let text = [PINHOLE, MATERIALS, FLOOR, LAMP, &balls("clear")].concat();
    check("planted", &text, &scenes(), 1, 1.0 + 1e-6);
}
