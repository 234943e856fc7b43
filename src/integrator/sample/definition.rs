//! The densities of real paths by definition, from nothing but the finished path: its points,
//! normals, bsdfs and labels.
//!
//! Every path that a strategy makes in scenes with all kinds of vertices is taken apart again;
//! every density that the strategy's weight used (of its own side, of the other side, of the
//! joining edge, of direct sampling) must be the one computed here.

mod cases;

use super::{SensorJob, Workspace, begin, sample_pixel};
use crate::bsdf::{Label, Lobe};
use crate::geometry::{EndPoint, Hit, Placements, Ray, SurfaceId};
use crate::light::{HitMeasure, LightId};
use crate::scene::{Scene, SceneAt, Settings};
use crate::spectrum::{MAX_LANES, SensorResponse};
use crate::transport::oracle::{FullPath, random_factors};
use crate::transport::record::{Recorded, take};
use crate::transport::subpath::{Scatterer, Vertex};
use crate::transport::{Cone, MediaMemory, PassSettings, PathContext, Subpath};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

type Column = [f64; MAX_LANES];

/// Rounding of positions (1e-16 of their size) is amplified by grazing angles and by narrow lobes.
const TOLERANCE: f64 = 1e-9;

/// A scattering vertex.
#[derive(Clone, Copy)]
struct Inner<'a> {
    vertex: &'a Vertex,
    scatterer: Scatterer<'a>,
    label: Label,
}

/// A finished path: end points, and scattering vertices with their labels in between.
struct Finished<'a> {
    scene: SceneAt<'a>,
    sensor: usize,
    light: LightId,
    x0: EndPoint,
    inner: Vec<Inner<'a>>,
    /// Which of the inner vertices are joined: there a specular label's direction need only be near
    /// the exact one.
    joined: Vec<bool>,
    x_sensor: EndPoint,
}

/// The end of a connecting segment as an end point.
fn end_of(scene: &SceneAt, ray: &Ray) -> EndPoint {
    let normal = |id: SurfaceId| {
        scene
            .geometry
            .surface(
                ray,
                &Hit {
                    t: ray.t_max,
                    id,
                    uv: DVec2::ZERO,
                },
            )
            .ng
    };
    if ray.t_max.is_infinite() {
        EndPoint::toward_infinity(-ray.d)
    } else {
        let p = ray.o + ray.d * ray.t_max;
        EndPoint {
            n: ray.end.map_or(DVec3::ZERO, normal),
            surface: ray.end,
            ..EndPoint::at(p)
        }
    }
}

/// The light at the end of a connecting segment: the surface's, or the only one that is no surface.
fn light_of(scene: &Scene, ray: &Ray) -> LightId {
    match ray.end {
        Some(id) => scene.object(id.instance).light.unwrap(),
        None => LightId(
            scene
                .lights
                .iter()
                .position(|l| l.as_area().is_none())
                .unwrap() as u32,
        ),
    }
}

impl<'a> Finished<'a> {
    fn new(
        context: &PathContext<'a>,
        light: &'a Subpath,
        camera: &'a Subpath,
        made: &Recorded,
    ) -> Self {
        let (scene, sensor) = (context.scene, context.sensor);
        let (s, t) = (made.s, made.t);
        let (mut x0, mut id) = (light.origin, light.light);
        let mut x_sensor = camera.origin;
        let on_light = s.saturating_sub(1);
        let mut on_camera = t.saturating_sub(1);
        match (s, t) {
            (0, _) => {
                on_camera = t - 2;
                if let Some(escape) = camera
                    .escape
                    .as_ref()
                    .filter(|_| camera.vertices.len() == t - 2)
                {
                    x0 = EndPoint::toward_infinity(-escape.direction);
                    id = Some(scene.environments[0]);
                } else {
                    x0 = camera.vertices[t - 2].end_point();
                    let hit = camera.light_hits.iter().find(|h| h.vertex == t - 2);
                    id = hit.map(|h| h.light);
                }
            }
            (_, 0) => {
                x_sensor = light
                    .sensor_hits
                    .iter()
                    .find(|h| h.sensor == sensor && h.depth + 2 == s)
                    .unwrap()
                    .x_sensor;
            }
            (1, 1) if !scene.sensors[sensor].camera.is_hittable() => {
                x_sensor = end_of(&scene, made.segment.as_ref().unwrap());
            }
            (1, _) => {
                let segment = made.segment.as_ref().unwrap();
                x0 = end_of(&scene, segment);
                id = Some(light_of(&scene, segment));
            }
            (_, 1) => x_sensor = end_of(&scene, made.segment.as_ref().unwrap()),
            _ => {}
        }
        let on_light = if t == 0 { s - 2 } else { on_light };
        // the label of a joined vertex is that of the joint; of the others, what was drawn
        let vertex = |path: &'a Subpath, i: usize, last: bool| Inner {
            vertex: &path.vertices[i],
            scatterer: path.scatterer(i, context),
            label: if last {
                Label::NonSpecular
            } else {
                path.densities[i + 1].label
            },
        };
        let mut inner: Vec<_> = (0..on_light)
            .map(|i| vertex(light, i, t > 0 && i + 1 == on_light))
            .collect();
        let of_camera = |i| vertex(camera, i, s > 0 && i + 1 == on_camera);
        inner.extend((0..on_camera).rev().map(of_camera));
        if x_sensor.n == DVec3::ZERO && t == 1 {
            // a lens is no surface of the scene: its points share their normal
            x_sensor.n = camera.origin.n;
        }
        let joined = (0..inner.len())
            .map(|i| s > 0 && t > 0 && (i + 1 == s || i + 2 == s))
            .collect();
        let mut path = Self {
            scene,
            sensor,
            light: id.unwrap(),
            x0,
            inner,
            joined,
            x_sensor,
        };
        for i in 0..path.inner.len() {
            if path.joined[i] && made.specular[i + 1] {
                let n = path.inner[i].vertex.ng;
                let through = path.forward(i).dot(n) * path.forward(i + 1).dot(n) > 0.0;
                path.inner[i].label = if through {
                    Label::SpecularTransmit
                } else {
                    Label::SpecularReflect
                };
            }
        }
        path
    }

    fn len(&self) -> usize {
        self.inner.len() + 2
    }

    fn position(&self, i: usize) -> DVec3 {
        match i {
            0 => self.x0.p,
            _ if i + 1 == self.len() => self.x_sensor.p,
            _ => self.inner[i - 1].vertex.p,
        }
    }

    /// Unit direction from x_i to x_{i+1}.
    fn forward(&self, i: usize) -> DVec3 {
        let parallel = self.scene.light(self.light).is_infinite();
        if i == 0 && parallel {
            self.x0.n
        } else {
            (self.position(i + 1) - self.position(i)).normalize()
        }
    }

    fn cos(&self, i: usize, w: DVec3) -> f64 {
        match i {
            0 => self.x0.cos(w),
            _ if i + 1 == self.len() => self.x_sensor.cos(w),
            _ => self.inner[i - 1].vertex.cos(w),
        }
    }

    fn d2(&self, i: usize) -> f64 {
        self.position(i).distance_squared(self.position(i + 1))
    }

    fn hittable(&self) -> f64 {
        if self.scene.sensors[self.sensor].camera.is_hittable() {
            1.0
        } else {
            0.0
        }
    }

    /// Density of direction at inner vertex i: towards the sensor, and towards the light.
    fn scattered(&self, i: usize) -> (Column, Column) {
        let Inner {
            vertex,
            scatterer,
            label,
        } = self.inner[i - 1];
        let (w_light, w_camera) = (-self.forward(i - 1), self.forward(i));
        if label.is_specular() {
            let probability = |w| {
                let local = vertex.frame.to_local(w);
                scatterer.bsdf.label_probability(label, local)
            };
            let (forward, backward) = (probability(w_light), probability(w_camera));
            return ([forward; MAX_LANES], [backward; MAX_LANES]);
        }
        let eval = scatterer.eval(w_light, w_camera);
        match eval.columns {
            Some((camera, light)) => (camera.lanes, light.lanes),
            None => ([eval.pdf_camera; MAX_LANES], [eval.pdf_light; MAX_LANES]),
        }
    }

    /// `pf`, `pr` and the density of direct sampling.
    fn densities(&self) -> (Vec<Column>, Vec<Column>, f64) {
        let n = self.len();
        let light = self.scene.light(self.light);
        let geometry = &self.scene.geometry;
        let camera = &self.scene.sensors[self.sensor].camera;
        let chosen = self.scene.selection.probability(self.light);
        let scaled = |c: Column, f: f64| c.map(|v| v * f);
        let mut pf = vec![[0.0; MAX_LANES]; n];
        let mut pr = pf.clone();

        let casters = &self.scene.casters;
        let (position, direction) = light.emission_density(
            geometry,
            casters,
            &self.x0,
            self.forward(0),
            self.position(1),
        );
        pf[0] = [chosen * position; MAX_LANES];
        let next = direction.area_density(self.cos(1, self.forward(0)), self.d2(0));
        pf[1] = [next * if n == 2 { self.hittable() } else { 1.0 }; MAX_LANES];

        let (position, direction) =
            camera.density(self.x_sensor.p, -self.forward(n - 2), self.scene.moment());
        pr[n - 1] = [position; MAX_LANES];
        let to_light = match light.hit_measure() {
            HitMeasure::Area => self.cos(0, self.forward(0)) / self.d2(0),
            HitMeasure::SolidAngle => 1.0,
            HitMeasure::Never => 0.0,
        };
        let (cos, d2) = (self.cos(n - 2, self.forward(n - 2)), self.d2(n - 2));
        pr[n - 2] = [match light.hit_measure() {
            HitMeasure::SolidAngle if n == 2 => direction.area_density(1.0, 1.0),
            HitMeasure::Never if n == 2 => 0.0,
            _ => direction.area_density(cos, d2),
        }; MAX_LANES];

        for i in 1..n - 1 {
            let (forward, backward) = self.scattered(i);
            let measure = self.cos(i + 1, self.forward(i)) / self.d2(i);
            pf[i + 1] = scaled(
                forward,
                if i + 2 == n {
                    measure * self.hittable()
                } else {
                    measure
                },
            );
            let measure = if i == 1 {
                to_light
            } else {
                self.cos(i - 1, self.forward(i - 1)) / self.d2(i - 1)
            };
            pr[i - 1] = scaled(backward, measure);
        }
        let direct = if n == 2 && self.hittable() == 0.0 {
            // image cameras see x₀ itself, where it is a point
            if self.x0.infinite { 0.0 } else { pf[0][0] }
        } else {
            chosen * light.direct_density(geometry, self.position(1), &self.x0)
        };
        (pf, pr, direct)
    }

    /// The directions of specular vertices are the ones their labels stand for, and dispersive
    /// where the index says so.
    fn assert_labels(&self, made: &Recorded) {
        for (i, inner) in self.inner.iter().enumerate() {
            let (vertex, bsdf, label) = (inner.vertex, &inner.scatterer.bsdf, inner.label);
            let (w_light, w_camera) = (-self.forward(i), self.forward(i + 1));
            let n = vertex.ng;
            let transmitted = w_light.dot(n) * w_camera.dot(n) < 0.0;
            assert_eq!(
                made.specular[i + 1],
                label.is_specular(),
                "label of x{}",
                i + 1
            );
            let (a, b) = (
                vertex.frame.to_local(w_light),
                vertex.frame.to_local(w_camera),
            );
            match label {
                Label::NonSpecular => assert!(!made.dispersive[i + 1]),
                Label::SpecularReflect => {
                    assert!(!transmitted && !made.dispersive[i + 1]);
                    assert!(
                        self.joined[i] || (a.truncate() + b.truncate()).length() < 1e-9,
                        "not mirrored at x{}",
                        i + 1
                    );
                }
                Label::SpecularTransmit => {
                    assert!(transmitted);
                    let smooth = bsdf
                        .lobes
                        .iter()
                        .any(|(_, l)| matches!(l, Lobe::Dielectric(_)));
                    assert_eq!(made.dispersive[i + 1], smooth && bsdf.interface.dispersive);
                    let interface = &bsdf.interface;
                    let (eta_a, eta_b) =
                        (interface.near(a.z > 0.0)[0], interface.near(b.z > 0.0)[0]);
                    let bent = if smooth {
                        a.truncate() * eta_a + b.truncate() * eta_b
                    } else {
                        a.truncate() + b.truncate()
                    };
                    assert!(
                        self.joined[i] || bent.length() < 1e-9,
                        "Snell's law at x{}: {bent}",
                        i + 1
                    );
                }
            }
        }
        for i in [0, self.len() - 1] {
            assert!(!made.specular[i] && !made.dispersive[i]);
        }
    }

    /// The light and the place on the film that the weights look at are those of the path.
    fn assert_place(&self, made: &Recorded) {
        assert_eq!(made.emitter, self.light);
        let camera = &self.scene.sensors[self.sensor].camera;
        if camera.is_delta() && self.len() > 2 {
            let x = self.position(self.len() - 2);
            let seen = camera.sample_connection(x, DVec2::ZERO, self.scene.moment(), 1e3);
            let raster = seen.expect("in front of the camera").raster;
            let difference = (raster - made.raster).length();
            assert!(difference < 1e-6, "{raster} is not {}", made.raster);
        }
    }

    /// The path as the oracle of weights has it.
    fn full(&self, pf: &[Column], pr: &[Column], direct: f64, made: &Recorded) -> FullPath {
        let before = |i: usize| {
            i.checked_sub(1)
                .map_or(f64::INFINITY, |i| self.d2(i).sqrt())
        };
        FullPath {
            pf: pf.to_vec(),
            pr: pr.to_vec(),
            direct,
            specular: made.specular.clone(),
            dispersive: made.dispersive.clone(),
            lengths: (0..self.len()).map(|i| before(i) as f32).collect(),
            hittable_light: self.scene.light(self.light).hit_measure() != HitMeasure::Never,
            emitter: made.emitter,
            raster: made.raster,
            bridges: [None; 2],
            made: None,
        }
    }

    /// Strategy `s`, which counts in the weights, could have made the path.
    fn assert_made_by(&self, s: usize) {
        let camera = &self.scene.sensors[self.sensor].camera;
        let (n, t) = (self.len(), self.len() - s);
        let on_surface = self.x0.surface.is_some();
        if s == 0 {
            assert!(
                on_surface || self.x0.infinite,
                "a camera path cannot hit the light"
            );
        }
        if t == 1 && self.hittable() == 0.0 {
            assert!(
                s > 1 || on_surface,
                "the light itself is no point to be seen"
            );
            // (a lens has its own view from each of its points)
            if self.x_sensor.n == DVec3::ZERO {
                let margin = self.scene.sensors[self.sensor].filter.margin();
                let seen = camera.sample_connection(
                    self.position(n - 2),
                    DVec2::ZERO,
                    self.scene.moment(),
                    margin,
                );
                assert!(seen.is_some(), "x{} is not seen", n - 2);
            }
        }
        if t == 0 {
            assert!(camera.is_hittable(), "the sensor cannot be hit");
        }
    }
}

fn differs(a: f64, b: f64) -> bool {
    // NaN differs from everything
    // densities far out in a tail of order one lose digits to the cosines they come from
    let near = (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()) + 1e-15;
    !near
}

/// `m(s) P̃(s)`: the product of all densities of strategy `s`, times what it is executed with.
fn density(pf: &[Column], pr: &[Column], direct: f64, multipliers: &[f64], s: usize) -> f64 {
    let all = (0..pf.len()).map(|i| match (i, s) {
        (0, 1) => direct,
        _ if i < s => pf[i][0],
        _ => pr[i][0],
    });
    all.product::<f64>() * multipliers[s]
}

fn weight_by_definition(
    pf: &[Column],
    pr: &[Column],
    direct: f64,
    multipliers: &[f64],
    s: usize,
) -> f64 {
    let of = |s| density(pf, pr, direct, multipliers, s);
    of(s) / (0..=pf.len()).map(of).sum::<f64>()
}

/// Half-aperture of the cones: wide, so that many paths are joined at specular vertices.
const EPSILON: f64 = 0.4;

/// Takes apart every path of `passes` passes, half of them with cones; `factor` plants an error in
/// `pr` of x₁. Returns how many there were of each strategy.
fn check(
    name: &str,
    (scene, settings): (Scene, Settings),
    passes: u32,
    planted: f64,
) -> BTreeMap<(usize, usize), usize> {
    let resolution = scene.sensors[0].camera.resolution();
    let crop = scene.sensors[0].whole_film();
    let mut job = SensorJob::new(&scene, 0, &settings, &crop, false);
    let factors = random_factors();
    job.strategies.factors = Some(&factors);
    let mut workspace = Workspace::default();
    let mut strategies: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut regularized = 0;
    for index in 0..passes {
        let pass = PassSettings {
            index,
            cone: (index % 2 == 1).then(|| Cone::new(EPSILON)),
            ..PassSettings::default()
        };
        for (x, y) in
            (0..resolution.height).flat_map(|y| (0..resolution.width).map(move |x| (x, y)))
        {
            take();
            let response = sample_pixel(&job, &pass, (x, y), SensorResponse::Xyz, &mut workspace);
            let (mut placements, mut media) = (Placements::default(), MediaMemory::default());
            let (placements, media) = (&mut placements, &mut media);
            let xyz = SensorResponse::Xyz;
            let sampler = job.sampler(&pass, (x, y));
            let context = begin(&job, &pass, (&sampler, (x, y)), xyz, placements, media);
            for made in take() {
                let path = Finished::new(&context, &workspace.light, &workspace.camera, &made);
                let what = || {
                    let labels: Vec<_> = path.inner.iter().map(|v| v.label).collect();
                    format!(
                        "{name}, pass {index}, pixel {x} {y}, strategy ({}, {}), {labels:?}",
                        made.s, made.t
                    )
                };
                assert_eq!(path.len(), made.s + made.t, "{}", what());
                path.assert_labels(&made);
                let (pf, mut pr, direct) = path.densities();
                for lane in &mut pr[1] {
                    *lane *= planted;
                }
                for i in 0..path.len() {
                    for k in 0..response.wavelengths.count() {
                        let pairs = [
                            ("pf", made.pf[i][k], pf[i][k]),
                            ("pr", made.pr[i][k], pr[i][k]),
                        ];
                        for (side, found, expected) in pairs {
                            assert!(
                                !differs(found, expected),
                                "{}: {side} of x{i}, lane {k}, is {found:e}, by definition {expected:e}",
                                what()
                            );
                        }
                    }
                }
                assert!(
                    !differs(made.direct, direct),
                    "{}: direct {:e}, by definition {direct:e}",
                    what(),
                    made.direct
                );
                for s in 0..=path.len() {
                    if density(&pf, &pr, direct, &made.multipliers, s) > 0.0 {
                        path.assert_made_by(s);
                    }
                }
                let weight = weight_by_definition(&pf, &pr, direct, &made.multipliers, made.s);
                assert!(
                    (made.weight - weight).abs() < 10.0 * TOLERANCE,
                    "{}: weight {}, by definition {weight}",
                    what(),
                    made.weight
                );
                path.assert_place(&made);
                let sum = path.full(&pf, &pr, direct, &made);
                let sum = sum.weight_sum(&job.strategies_of(&pass, (x, y)));
                assert!((sum - 1.0).abs() < 1e-9, "{}: weights sum to {sum}", what());
                regularized += usize::from(
                    (0..path.inner.len()).any(|i| path.joined[i] && made.specular[i + 1]),
                );
                *strategies.entry((made.s, made.t)).or_default() += 1;
            }
        }
    }
    assert_eq!(workspace.counters.medium_mismatches, 0, "{name}");
    println!("{name}: {strategies:?}, {regularized} regularized");
    let specular = scene
        .objects
        .iter()
        .any(|o| scene.material(o.material).has_specular() && !o.transparent_sensor);
    assert_eq!(specular && passes > 1, regularized > 0, "{name}");
    strategies
}
