//! Double Gauss traced by abbe, for `tests/peers/lens_rays.py`, which traces the same rays with
//! other programs: prints them, the points where they meet each surface and the CPU time as JSON.
//!
//! `trace` follows rays surface by surface as a design program does; `scene` asks the lens of a
//! scene, with its edges and its stop, for what each of these rays meets next.

#![allow(clippy::unwrap_used, reason = "a benchmark fails by panicking")]
#![allow(clippy::print_stdout, reason = "a script reads it")]

use abbe::geometry::{self, Accel, Instance, InstanceId, SurfaceId};
use abbe::io::scene_file::parse_str;
use abbe::medium::Boundary;
use abbe::optics::{Ray, System};
use abbe::spectrum::Library;
use cpu_time::ProcessTime;
use glam::DVec3;
use serde_json::json;
use std::hint::black_box;
use std::path::Path;

const NM: f64 = 587.5618;
const RAYS: u32 = 1000;
/// Times that are measured, of so many traces of all rays each.
const TIMES: usize = 21;
const TRACES: u32 = 100;

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lenses");
    let lens = abbe::io::lens::read(&folder.join("double_gauss.zmx"), Library::embedded()).unwrap();
    let system = System::new(&lens, NM);
    let rays: Vec<Ray> = (0..RAYS)
        .map(|i| {
            let r = 9.0 * (f64::from(i) / f64::from(RAYS)).sqrt();
            let (y, x) = (f64::from(i) * 2.399_963).sin_cos();
            let (o, d) = (DVec3::new(r * x, r * y, -10.0), DVec3::Z);
            Ray { o, d }
        })
        .collect();
    let points: Vec<Vec<[f64; 3]>> = rays
        .iter()
        .map(|ray| {
            let mut points = Vec::new();
            let on_way = |e: &abbe::optics::Event| {
                points.push(system.frames()[e.surface].to_system(e.point).to_array());
            };
            system.trace(*ray, true, on_way).unwrap();
            points
        })
        .collect();
    let trace = seconds(|| {
        let end = |ray: &Ray| system.trace(*ray, false, |_| ()).map_or(0.0, |end| end.o.x);
        black_box(&rays).iter().map(end).sum()
    });

    let text = "[[sensor]]\ndetector = { center = [0, 0, 1], u = [-1, 0, 0], v = [0, 1, 0] }\n\
                [[lens]]\nfile = \"double_gauss.zmx\"\n";
    let objects = parse_str(text, &folder).unwrap().description.objects;
    let is_surface = |i: &usize| matches!(objects[*i].boundary, Boundary::Interface { .. });
    let surfaces: Vec<usize> = (0..objects.len()).filter(is_surface).collect();
    let mut segments = Vec::new();
    for (ray, points) in rays.iter().zip(&points) {
        let (mut from, mut start) = (ray.o * 1e-3, None);
        let bends = |i: &usize| lens.medium_before(*i).ior != lens.surfaces[*i].medium.ior;
        let met = (0..lens.surfaces.len() - 1).filter(bends).zip(&surfaces);
        for (at, &instance) in met {
            let to = DVec3::from(points[at]) * 1e-3;
            let d = (to - from).normalize();
            segments.push((instance, geometry::Ray::leaving(from, d, start)));
            let instance = InstanceId(instance as u32);
            (from, start) = (to, Some(SurfaceId { instance, prim: 0 }));
        }
    }
    let instances = objects.iter().map(|o| Instance {
        shape: o.shape.clone(),
        transform: o.transform.clone(),
    });
    let scene = Accel::build(instances.collect());
    for (i, ray) in &segments {
        let hit = scene.at(0.0).closest(ray, |_| true).unwrap();
        assert_eq!(hit.id.instance.0 as usize, *i);
    }
    let in_scene = seconds(|| {
        let hit = |(_, ray): &(usize, geometry::Ray)| scene.at(0.0).closest(ray, |_| true);
        let hits = black_box(&segments).iter().filter_map(hit);
        hits.map(|hit| hit.t).sum()
    });
    let vertices: Vec<f64> = system.frames().iter().map(|f| f.origin.z).collect();
    let curvatures: Vec<f64> = lens
        .surfaces
        .iter()
        .map(|s| s.shape.profile.base().0)
        .collect();
    let out = json!({
        "nm": NM,
        "indices": system.indices(),
        "vertices": vertices,
        "curvatures": curvatures,
        "rays": rays.iter().map(|r| [r.o.to_array(), r.d.to_array()]).collect::<Vec<_>>(),
        "points": points,
        "trace_s": trace,
        "scene_s": in_scene,
        "scene_intersections": segments.len(),
    });
    println!("{out}");
}

/// CPU seconds of a trace of all rays, several times.
fn seconds(mut trace: impl FnMut() -> f64) -> Vec<f64> {
    let mut once = || {
        let start = ProcessTime::now();
        for _ in 0..TRACES {
            black_box(trace());
        }
        start.elapsed().as_secs_f64() / f64::from(TRACES)
    };
    (0..TIMES).map(|_| once()).collect()
}
