//! A tracer of its own for scenes of boxes, balls, cylinders and rectangles: at every step it lists
//! all faces on the ray, takes those that are equally far for one crossing, and sorts them by the
//! rule. Which medium is where it asks of the point, not of a stack.

use std::collections::BTreeMap;

pub type V = [f64; 3];

/// Faces nearer than this along a ray are in one place; corners of the scenes lie on a grid.
const SAME: f64 = 1e-9;

#[derive(Clone, Debug)]
pub enum Form {
    Box {
        low: V,
        high: V,
    },
    Ball {
        center: V,
        radius: f64,
    },
    /// The side of a cylinder along a coordinate axis, open at both ends.
    Cylinder {
        center: V,
        axis: usize,
        half: f64,
        radius: f64,
    },
    /// Half edges; the front is on the side of u x v.
    Quad {
        center: V,
        u: V,
        v: V,
    },
}

#[derive(Clone, Debug)]
pub enum Kind {
    Glass {
        ior: f64,
        priority: i32,
    },
    /// Reflectance and coverage.
    Diffuse {
        albedo: f64,
        coverage: f64,
    },
    /// Radiance of the front.
    Lamp {
        radiance: f64,
    },
    Detector,
}

#[derive(Clone, Debug)]
pub struct Body {
    pub form: Form,
    pub kind: Kind,
}

pub fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn times(a: V, s: f64) -> V {
    a.map(|x| x * s)
}

pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: V) -> V {
    times(a, 1.0 / dot(a, a).sqrt())
}

impl Form {
    /// Distances at which a ray meets it, with outward or front normals.
    fn meet(&self, o: V, d: V, found: &mut Vec<(f64, V)>) {
        match self {
            Self::Box { low, high } => {
                for axis in 0..3 {
                    for (plane, sign) in [(low[axis], -1.0), (high[axis], 1.0)] {
                        let t = (plane - o[axis]) / d[axis];
                        let p = add(o, times(d, t));
                        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                        let inside = |i: usize| (low[i]..=high[i]).contains(&p[i]);
                        if t.is_finite() && inside(a) && inside(b) {
                            let mut n = [0.0; 3];
                            n[axis] = sign;
                            found.push((t, n));
                        }
                    }
                }
            }
            Self::Ball { center, radius } => {
                let from = add(o, times(*center, -1.0));
                let (b, c) = (dot(from, d), dot(from, from) - radius * radius);
                let root = b * b - c;
                if root > 0.0 {
                    for t in [-b - root.sqrt(), -b + root.sqrt()] {
                        found.push((t, times(add(from, times(d, t)), 1.0 / radius)));
                    }
                }
            }
            Self::Cylinder {
                center,
                axis,
                half,
                radius,
            } => {
                let across = |v: V| {
                    let mut v = v;
                    v[*axis] = 0.0;
                    v
                };
                let from = add(o, times(*center, -1.0));
                let (from2, d2) = (across(from), across(d));
                let (a, b) = (dot(d2, d2), dot(from2, d2));
                let root = b * b - a * (dot(from2, from2) - radius * radius);
                if root > 0.0 && a > 0.0 {
                    for t in [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a] {
                        let at = add(from, times(d, t));
                        if at[*axis].abs() <= *half {
                            found.push((t, times(across(at), 1.0 / radius)));
                        }
                    }
                }
            }
            Self::Quad { center, u, v } => {
                let n = unit(cross(*u, *v));
                let to = add(*center, times(o, -1.0));
                let t = dot(to, n) / dot(d, n);
                let at = add(times(d, t), times(to, -1.0));
                let inside = |e: &V| (dot(at, *e) / dot(*e, *e)).abs() <= 1.0;
                if t.is_finite() && inside(u) && inside(v) {
                    found.push((t, n));
                }
            }
        }
    }

    fn holds(&self, p: V) -> bool {
        match self {
            Self::Box { low, high } => (0..3).all(|i| (low[i]..=high[i]).contains(&p[i])),
            Self::Ball { center, radius } => {
                let from = add(p, times(*center, -1.0));
                dot(from, from) <= radius * radius
            }
            Self::Cylinder { .. } | Self::Quad { .. } => false,
        }
    }
}

/// Index of refraction at a point, and the solid that has it.
fn medium(bodies: &[Body], p: V) -> (f64, Option<usize>) {
    let mut best = (1.0, None, i32::MIN);
    for (i, body) in bodies.iter().enumerate() {
        if let Kind::Glass { ior, priority } = body.kind
            && body.form.holds(p)
            && priority >= best.2
        {
            best = (ior, Some(i), priority);
        }
    }
    (best.0, best.1)
}

/// Unpolarized reflectance from index 1 to index `eta`.
fn fresnel(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inner = (1.0 - sin2).sqrt();
    let s = (cos - eta * inner) / (cos + eta * inner);
    let p = (eta * cos - inner) / (eta * cos + inner);
    (s * s + p * p) / 2.0
}

fn cosine_about(n: V, u: f64, v: f64) -> V {
    let helper = if n[0].abs() < 0.5 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let x = unit(cross(helper, n));
    let y = cross(n, x);
    let (r, phi) = (u.sqrt(), std::f64::consts::TAU * v);
    let flat = add(times(x, r * phi.cos()), times(y, r * phi.sin()));
    unit(add(flat, times(n, (1.0 - u).sqrt())))
}

/// Irradiance on the detector (the last body), by class of path: one sample. `sky` is the radiance
/// from infinity.
pub fn sample(
    bodies: &[Body],
    sky: f64,
    max_depth: usize,
    random: &mut impl FnMut() -> f64,
    out: &mut BTreeMap<String, f64>,
) {
    let Form::Quad { center, u, v } = bodies[bodies.len() - 1].form else {
        panic!("a detector is a rectangle");
    };
    let (a, b) = (2.0 * random() - 1.0, 2.0 * random() - 1.0);
    let mut o = add(center, add(times(u, a), times(v, b)));
    let mut d = cosine_about(unit(cross(u, v)), random(), random());
    let start = medium(bodies, add(o, times(d, 1e-6)));
    // of radiance over index squared
    let mut weight = std::f64::consts::PI * start.0 * start.0;
    let mut class = Vec::new();
    let mut arrive = |class: &[char], value: f64| {
        let name: String = class.iter().rev().collect();
        *out.entry(format!("L{name}E")).or_default() += value;
    };
    loop {
        // all faces ahead, and of them those in the first place
        let mut faces: Vec<(f64, V, usize)> = Vec::new();
        for (i, body) in bodies.iter().enumerate() {
            let mut found = Vec::new();
            body.form.meet(o, d, &mut found);
            faces.extend(
                found
                    .into_iter()
                    .filter(|f| f.0 > SAME)
                    .map(|(t, n)| (t, n, i)),
            );
        }
        let first = faces.iter().map(|f| f.0).fold(f64::INFINITY, f64::min);
        if first == f64::INFINITY {
            arrive(&class, weight * sky);
            return;
        }
        faces.retain(|f| f.0 < first + SAME);
        faces.sort_by_key(|f| f.2);
        let step = |t: f64| add(o, times(d, t));
        let (before, after) = (
            medium(bodies, step(first - 1e-6)),
            medium(bodies, step(first + 1e-6)),
        );
        let p = step(first);
        // what stands by itself, the last of it; what is not there is left out
        let mut alone = None;
        for &(_, n, i) in &faces {
            match bodies[i].kind {
                Kind::Glass { .. } => {}
                Kind::Diffuse { coverage, .. } if random() >= coverage => {}
                _ => alone = Some((n, i)),
            }
        }
        if let Some((n, i)) = alone {
            let facing = if dot(n, d) < 0.0 { 1.0 } else { -1.0 };
            match bodies[i].kind {
                Kind::Lamp { radiance } => {
                    if facing > 0.0 {
                        arrive(&class, weight * radiance / (before.0 * before.0));
                    }
                    return;
                }
                Kind::Diffuse { albedo, .. } if class.len() < max_depth => {
                    class.push('D');
                    weight *= albedo;
                    d = cosine_about(times(n, facing), random(), random());
                    o = p;
                }
                _ => return,
            }
            continue;
        }
        o = p;
        // media of one index are still two
        if before.1 == after.1 {
            continue;
        }
        if class.len() >= max_depth {
            return;
        }
        class.push('S');
        // in one place all faces of glass have one plane
        let n = faces
            .iter()
            .find(|f| matches!(bodies[f.2].kind, Kind::Glass { .. }))
            .map_or([0.0; 3], |f| f.1);
        let n = if dot(n, d) < 0.0 { n } else { times(n, -1.0) };
        let (cos, eta) = (-dot(n, d), after.0 / before.0);
        if random() < fresnel(cos, eta) {
            d = unit(add(d, times(n, 2.0 * cos)));
        } else {
            let inner = (1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt();
            d = unit(add(times(d, 1.0 / eta), times(n, cos / eta - inner)));
        }
    }
}
