//! Scenes made of random parts on a coarse grid, so that many nest, overlap and touch: every
//! integrator has the means of the reference, by class of path, at any scale and far from the
//! origin.

use super::super::equality::LIMIT;
use super::super::harness::{Estimate, measure, with};
use super::ALL;
use super::reference::{Body, Form, Kind, V, sample};
use abbe::io::scene_file::parse_str;
use abbe::math::hash::{combine, random_bits, unit_f64};
use abbe::scene::{BuildError, Scene};
use abbe::spectrum::xyz;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

const SCENES: u64 = 20;
const BATCHES: u32 = 64;
const PASSES: u32 = 4;
const SIDE: u32 = 4;
const MAX_DEPTH: usize = 5;
const SKY: f64 = 0.3;
/// Quantities compared: all, and classes by what they hold.
const CLASSES: [&str; 3] = ["L[DS]?E", "LD+E", "L[DS]*S[DS]+E"];

struct Numbers {
    key: u64,
    count: u64,
}

impl Numbers {
    fn unit(&mut self) -> f64 {
        self.count += 1;
        unit_f64(random_bits(self.key, self.count))
    }

    /// 0 to `n` - 1.
    fn below(&mut self, n: u64) -> u64 {
        (self.unit() * n as f64) as u64
    }

    /// A place on the grid, -1 to 1 by halves.
    fn place(&mut self) -> f64 {
        self.below(5) as f64 / 2.0 - 1.0
    }

    /// Two places, in order.
    fn span(&mut self) -> [f64; 2] {
        loop {
            let (a, b) = (self.place(), self.place());
            if a < b {
                return [a, b];
            }
        }
    }
}

/// A rectangle on the grid that faces along an axis.
fn rectangle(numbers: &mut Numbers) -> Form {
    let axis = numbers.below(3) as usize;
    let (mut center, mut u, mut v) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    center[axis] = numbers.place();
    for (i, half) in [((axis + 1) % 3, &mut u), ((axis + 2) % 3, &mut v)] {
        let [low, high] = numbers.span();
        center[i] = (low + high) / 2.0;
        half[i] = (high - low) / 2.0;
    }
    if numbers.below(2) == 0 {
        u = u.map(|x| -x);
    }
    Form::Quad { center, u, v }
}

fn parts(numbers: &mut Numbers) -> Vec<Body> {
    let mut bodies = Vec::new();
    for _ in 0..2 + numbers.below(3) {
        let spans = [numbers.span(), numbers.span(), numbers.span()];
        let form = if numbers.below(4) == 0 {
            let center = [numbers.place(), numbers.place(), numbers.place()];
            let radius = 0.5 * (1.0 + numbers.below(2) as f64);
            Form::Ball { center, radius }
        } else {
            Form::Box {
                low: spans.map(|s| s[0]),
                high: spans.map(|s| s[1]),
            }
        };
        let ior = [1.0, 1.3, 1.5, 1.8][numbers.below(4) as usize];
        let priority = numbers.below(3) as i32 - 1;
        let kind = if numbers.below(6) == 0 {
            let (albedo, coverage) = (0.7, 1.0);
            Kind::Diffuse { albedo, coverage }
        } else {
            Kind::Glass { ior, priority }
        };
        bodies.push(Body { form, kind });
        if numbers.below(5) == 0 {
            // twice the same solid
            let mut again = bodies[bodies.len() - 1].clone();
            if let Kind::Glass { ior, .. } = &mut again.kind {
                *ior = 1.5;
            }
            bodies.push(again);
        }
    }
    for _ in 0..2 {
        let coverage = [1.0, 0.5, 0.0][numbers.below(3) as usize];
        let kind = Kind::Diffuse {
            albedo: 0.6,
            coverage,
        };
        let form = rectangle(numbers);
        bodies.push(Body { form, kind });
    }
    if numbers.below(2) == 0 {
        // one around the other, in the same place
        let form = Form::Cylinder {
            center: [numbers.place(), numbers.place(), numbers.place()],
            axis: numbers.below(3) as usize,
            half: 0.5 * (1.0 + numbers.below(2) as f64),
            radius: 0.5,
        };
        for albedo in [0.4, 0.8] {
            let form = form.clone();
            let coverage = [1.0, 0.5][numbers.below(2) as usize];
            let kind = Kind::Diffuse { albedo, coverage };
            bodies.push(Body { form, kind });
        }
    }
    for _ in 0..2 {
        let kind = Kind::Lamp { radiance: 2.0 };
        let form = rectangle(numbers);
        bodies.push(Body { form, kind });
    }
    // the order in the file decides where things touch
    for i in (1..bodies.len()).rev() {
        bodies.swap(i, numbers.below(i as u64 + 1) as usize);
    }
    let form = rectangle(numbers);
    bodies.push(Body {
        form,
        kind: Kind::Detector,
    });
    bodies
}

/// The scene file, every length times `scale` from `origin`.
fn text(bodies: &[Body], scale: f64, origin: V, as_mesh: bool) -> String {
    let place = |p: V| {
        let [x, y, z]: V = std::array::from_fn(|i| origin[i] + scale * p[i]);
        format!("[{x:?}, {y:?}, {z:?}]")
    };
    let along = |p: V| {
        let [x, y, z] = p.map(|x| scale * x);
        format!("[{x:?}, {y:?}, {z:?}]")
    };
    let mut text = format!(
        "[render]\nwavelengths = {{ line_nm = 550 }}\nregularize = \"off\"\nmax_depth = {MAX_DEPTH}\nmerge_radius = {}\n",
        0.005 * scale
    );
    text += "[material.clear]\ndielectric = {}\n";
    _ = writeln!(
        text,
        "[[light]]\nenvironment = {{ radiance = {{ lines = [[550, {SKY}]] }} }}"
    );
    for (i, body) in bodies.iter().enumerate() {
        let form = match &body.form {
            Form::Box { low, high } if as_mesh && i % 2 == 0 => {
                let middle: V = std::array::from_fn(|i| (low[i] + high[i]) / 2.0);
                let half: V = std::array::from_fn(|i| (high[i] - low[i]) / 2.0);
                format!(
                    "mesh = {{ obj = \"assets/cube.obj\" }}\ntransform = [{{ scale = {} }}, {{ translate = {} }}]",
                    along(half),
                    place(middle)
                )
            }
            Form::Box { low, high } => {
                format!("box = {{ min = {}, max = {} }}", place(*low), place(*high))
            }
            Form::Ball { center, radius } => {
                format!(
                    "sphere = {{ center = {}, radius = {:?} }}",
                    place(*center),
                    scale * radius
                )
            }
            Form::Cylinder {
                center,
                axis,
                half,
                radius,
            } => {
                let end = |sign: f64| {
                    let mut end = *center;
                    end[*axis] += sign * half;
                    place(end)
                };
                format!(
                    "cylinder = {{ from = {}, to = {}, radius = {:?} }}",
                    end(-1.0),
                    end(1.0),
                    scale * radius
                )
            }
            Form::Quad { center, u, v } => {
                let what = if matches!(body.kind, Kind::Detector) {
                    "detector"
                } else {
                    "quad"
                };
                format!(
                    "{what} = {{ center = {}, u = {}, v = {} }}",
                    place(*center),
                    along(*u),
                    along(*v)
                )
            }
        };
        _ = match &body.kind {
            Kind::Glass { ior, priority } => writeln!(
                text,
                "[medium.m{i}]\nior = {ior}\n[[object]]\n{form}\nmaterial = \"clear\"\ninterior = \"m{i}\"\npriority = {priority}"
            ),
            Kind::Diffuse { albedo, coverage } => {
                let coverage = if *coverage < 1.0 {
                    format!("coverage = {coverage}\n")
                } else {
                    String::new()
                };
                writeln!(
                    text,
                    "[material.d{i}]\ndiffuse = {{ reflectance = {albedo} }}\n{coverage}[[object]]\n{form}\nmaterial = \"d{i}\""
                )
            }
            Kind::Lamp { radiance } => {
                writeln!(
                    text,
                    "[[object]]\n{form}\nemission = {{ lines = [[550, {radiance}]] }}"
                )
            }
            Kind::Detector => writeln!(text, "[[sensor]]\nresolution = [{SIDE}, {SIDE}]\n{form}"),
        };
    }
    text
}

fn matches(class: &str, i: usize) -> bool {
    let pattern = regex::Regex::new(&format!("^{}$", CLASSES[i])).expect("valid");
    pattern.is_match(class)
}

/// All, and the classes, by the reference.
fn reference(bodies: &[Body], key: u64) -> Vec<Estimate> {
    let unit = xyz::cmf(550.0)[1] / xyz::N_Y;
    let samples = PASSES * SIDE * SIDE;
    let mut values = vec![Vec::new(); 1 + CLASSES.len()];
    for batch in 0..BATCHES {
        let mut numbers = Numbers {
            key: combine(key, u64::from(batch)),
            count: 0,
        };
        let mut found = BTreeMap::new();
        for _ in 0..samples {
            sample(bodies, SKY, MAX_DEPTH, &mut || numbers.unit(), &mut found);
        }
        let mean = |keep: &dyn Fn(&str) -> bool| {
            let kept = found.iter().filter(|(class, _)| keep(class));
            kept.map(|(_, value)| value).sum::<f64>() * unit / f64::from(samples)
        };
        values[0].push(mean(&|_| true));
        for i in 0..CLASSES.len() {
            values[i + 1].push(mean(&|class| matches(class, i)));
        }
    }
    values.iter().map(|v| Estimate::from_batches(v)).collect()
}

#[test]
fn nests_overlaps_and_contacts_have_the_means_of_the_reference() {
    let (mut made, mut compared, mut failed) = (0, 0, Vec::new());
    let mut with_contacts = 0;
    for number in 0.. {
        if made == SCENES {
            break;
        }
        let mut numbers = Numbers {
            key: combine(0x434f_4e54, number),
            count: 0,
        };
        let bodies = parts(&mut numbers);
        let scale = [1.0, 1e-3, 1e3][(made % 3) as usize];
        let origin = [[0.0; 3], [1e4, -1e4, 1e4]][(made % 2) as usize];
        let text = text(&bodies, scale, origin, made % 4 > 1);
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/render");
        let loaded = parse_str(&text, &folder).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let scene = match Scene::build(loaded.description) {
            Ok(scene) => Arc::new(scene),
            // a lamp or the detector is cut by a surface
            Err(BuildError::UnclearMedium { .. }) => continue,
            Err(e) => panic!("{e}\n{text}"),
        };
        with_contacts += usize::from(scene.contacts.iter().any(|c| c.certain));
        let expected = reference(&bodies, number);
        if expected[0].mean == 0.0 {
            continue;
        }
        made += 1;
        println!("scene {number}, scale {scale}, from {origin:?}");
        if std::env::var("ABBE_TEST_SCENES").is_ok_and(|wanted| wanted == number.to_string()) {
            println!("{text}");
        }
        for kind in ALL {
            let settings = with(&loaded.settings, kind);
            let found = measure(&scene, &settings, BATCHES, PASSES, &CLASSES);
            let all = std::iter::once(&found.y).chain(&found.classes);
            for (i, (a, b)) in all.zip(&expected).enumerate() {
                let error = a.error.hypot(b.error);
                // what few samples carry has no error to speak of, and is a small part of the whole
                let rare = [a, b]
                    .iter()
                    .any(|e| e.error > 0.1 * e.mean || e.mean == 0.0);
                let most = a.mean.max(b.mean);
                if rare && (most < 0.02 * expected[0].mean || error > 0.1 * most) {
                    continue;
                }
                compared += 1;
                let deviation = (a.mean - b.mean).abs() / error.max(1e-9 * b.mean);
                if deviation > LIMIT {
                    let what = if i == 0 { "all" } else { CLASSES[i - 1] };
                    failed.push(format!(
                        "scene {number} by {kind:?}, {what}: {a:?}, expected {b:?} ({deviation:.1} standard errors)"
                    ));
                }
            }
        }
    }
    println!("{compared} means of {made} scenes compared, {with_contacts} of them with contacts");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(
        compared > 120 && with_contacts > SCENES as usize / 2,
        "too few: {compared}, {with_contacts}"
    );
}
