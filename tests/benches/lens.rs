//! The double Gauss: sequential tracing, rays per second of twelve surfaces each, and the same rays
//! in a scene, surface by surface.
//!
//! `surfaces`: each surface alone against the rays that come to it. `whole_lens`: the next surface
//! among all there are, edges and stop included. `sphere`: a sphere alone against rays that meet
//! it, the yardstick. Run on one thread.

#![allow(clippy::unwrap_used, reason = "a benchmark fails by panicking")]

use abbe::geometry::{self, Accel, Instance, InstanceId, Shape, SurfaceId, Transform};
use abbe::io::scene_file::parse_str;
use abbe::medium::Boundary;
use abbe::optics::{Ray, System};
use abbe::spectrum::Library;
use divan::counter::ItemsCount;
use glam::{DAffine3, DVec3};
use std::path::Path;

fn main() {
    divan::main();
}

/// A thousand rays that fill the pupil.
#[divan::bench]
fn double_gauss(bencher: divan::Bencher) {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/scenes/lenses/double_gauss.zmx"
    );
    let lens = abbe::io::lens::read(path.as_ref(), Library::embedded()).unwrap();
    let system = System::new(&lens, 587.5618);
    let rays: Vec<Ray> = (0..1000)
        .map(|i| {
            let r = 15.0 * (f64::from(i) / 1000.0).sqrt();
            let (y, x) = (f64::from(i) * 2.399_963).sin_cos();
            let o = DVec3::new(r * x, r * y, -10.0);
            Ray { o, d: DVec3::Z }
        })
        .collect();
    bencher
        .counter(divan::counter::ItemsCount::new(
            rays.len() * lens.surfaces.len(),
        ))
        .bench(|| {
            let trace = |ray: &Ray| system.trace(*ray, false, |_| ()).map_or(0.0, |end| end.o.x);
            rays.iter().map(trace).sum::<f64>()
        });
}

/// The lens in a scene, and the rays of a beam on their way: per ray, what comes to each surface.
fn on_their_way() -> (Vec<Instance>, Vec<(usize, geometry::Ray)>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lenses");
    let text = "[[sensor]]\ndetector = { center = [0, 0, 1], u = [-1, 0, 0], v = [0, 1, 0] }\n\
                [[lens]]\nfile = \"double_gauss.zmx\"\n";
    let objects = parse_str(text, &folder).unwrap().description.objects;
    let is_surface = |i: &usize| matches!(objects[*i].boundary, Boundary::Interface { .. });
    let surfaces: Vec<usize> = (0..objects.len()).filter(is_surface).collect();
    let instances: Vec<Instance> = objects
        .iter()
        .map(|o| Instance {
            shape: o.shape.clone(),
            transform: o.transform.clone(),
        })
        .collect();
    let lens = abbe::io::lens::read(&folder.join("double_gauss.zmx"), Library::embedded()).unwrap();
    let system = System::new(&lens, 587.5618);
    let mut rays = Vec::new();
    for i in 0..1000 {
        let r = 9.0 * (f64::from(i) / 1000.0).sqrt();
        let (y, x) = (f64::from(i) * 2.399_963).sin_cos();
        let mut from = DVec3::new(r * x, r * y, -10.0) * 1e-3;
        let mut start = None;
        let mut next = surfaces.iter();
        let arrived = system.trace(
            Ray {
                o: from * 1e3,
                d: DVec3::Z,
            },
            true,
            |e| {
                // the stop and the image bend nothing
                if e.incoming == e.outgoing {
                    return;
                }
                let to = system.frames()[e.surface].to_system(e.point) * 1e-3;
                let instance = *next.next().unwrap();
                rays.push((
                    instance,
                    geometry::Ray::leaving(from, (to - from).normalize(), start),
                ));
                let instance = InstanceId(instance as u32);
                (from, start) = (to, Some(SurfaceId { instance, prim: 0 }));
            },
        );
        assert!(arrived.is_ok());
    }
    (instances, rays)
}

#[divan::bench]
fn surfaces(bencher: divan::Bencher) {
    let (instances, rays) = on_their_way();
    let alone: Vec<Accel> = instances
        .into_iter()
        .map(|i| Accel::build(vec![i]))
        .collect();
    let rays: Vec<_> = rays
        .into_iter()
        .map(|(i, ray)| (i, geometry::Ray { start: None, ..ray }))
        .collect();
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let hit = |(i, ray): &(usize, geometry::Ray)| alone[*i].at(0.0).closest(ray, |_| true);
        rays.iter().filter_map(hit).map(|hit| hit.t).sum::<f64>()
    });
}

#[divan::bench]
fn whole_lens(bencher: divan::Bencher) {
    let (instances, rays) = on_their_way();
    let lens = Accel::build(instances);
    for (i, ray) in &rays {
        let hit = lens.at(0.0).closest(ray, |_| true).unwrap();
        assert_eq!(hit.id.instance.0 as usize, *i);
    }
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let hit = |(_, ray): &(usize, geometry::Ray)| lens.at(0.0).closest(ray, |_| true);
        rays.iter().filter_map(hit).map(|hit| hit.t).sum::<f64>()
    });
}

#[divan::bench]
fn sphere(bencher: divan::Bencher) {
    let transform = Transform::fixed(DAffine3::from_scale(DVec3::splat(0.03)));
    let shape = Shape::Sphere;
    let alone = Accel::build(vec![Instance { shape, transform }]);
    let rays: Vec<_> = on_their_way().1.into_iter().map(|(_, ray)| ray).collect();
    let rays: Vec<_> = rays
        .into_iter()
        // through the middle, as they are
        .map(|ray| geometry::Ray::new(-ray.d * 0.1 + DVec3::X * ray.o.x, ray.d))
        .collect();
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let hit = |ray: &geometry::Ray| alone.at(0.0).closest(ray, |_| true);
        rays.iter().filter_map(hit).map(|hit| hit.t).sum::<f64>()
    });
}
