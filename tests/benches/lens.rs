//! Sequential tracing of the double Gauss: rays per second, twelve surfaces each.

#![allow(clippy::unwrap_used, reason = "a benchmark fails by panicking")]

use abbe::optics::{Ray, System};
use abbe::spectrum::Library;
use glam::DVec3;

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
