//! Any number of planes in a row, reflecting and transmitting; asked where several transmit.
//!
//! The optical path length Σ η_i |x_{i+1} − x_i| is convex in the positions on the planes (norms of
//! affine maps), so that it has one stationary point at most, and Fermat's principle says that this
//! is the chain. Damped Newton steps find it.

use super::surface::Surface;
use super::{Bounce, Far, MAX_CHAIN, Points};
use glam::{DMat3, DVec3};

/// Unknowns of the longest chain.
const MOST: usize = 2 * MAX_CHAIN;
/// Newton steps.
const MOST_STEPS: usize = 100;
/// So many times farther away than anything, there is no chain: total reflection of light from
/// infinity.
const LOST: f64 = 1e8;

/// Smoothing of lengths, of the size of everything, where they have kinks.
const SMOOTHINGS: [f64; 6] = [1.0, 0.1, 1e-2, 1e-3, 1e-4, 0.0];

/// All positions from the sensor's end of the chain.
struct Problem<'a> {
    eta: &'a [f64],
    far: Far,
    /// Lengths are √(v² + this²).
    smoothing: f64,
    origins: Points,
    tangents: arrayvec::ArrayVec<[DVec3; 2], MAX_CHAIN>,
}

/// The chain between `far` and `to` over planes, if there is one.
pub(super) fn solve(bounces: &[Bounce], eta: &[f64], far: &Far, to: DVec3) -> Option<Points> {
    let m = bounces.len();
    let mut problem = Problem {
        eta,
        far: match *far {
            Far::Point(x) => Far::Point(x - to),
            Far::Direction(w) => Far::Direction(w),
        },
        smoothing: 0.0,
        origins: Points::new(),
        tangents: arrayvec::ArrayVec::new(),
    };
    for (i, bounce) in bounces.iter().enumerate() {
        let Surface::Plane { origin, normal } = bounce.surface else {
            return None;
        };
        // the feet of evenly spaced points between the ends are the origins on the planes
        let start = match problem.far {
            Far::Point(x) => x * ((m - i) as f64 / (m + 1) as f64),
            Far::Direction(_) => DVec3::ZERO,
        };
        let foot = start - normal * (start - (origin - to)).dot(normal);
        problem.origins.push(foot);
        problem.tangents.push(normal.any_orthonormal_pair().into());
    }
    if is_shortest_over_edge(bounces, eta, &problem.far, to) {
        return None;
    }
    let mut z = [0.0; MOST];
    let mut points = problem.descend(&mut z);
    if points.is_none() {
        // caught at a kink, where planes meet: from lengths without kinks step by step to the true
        // ones
        let size = problem.size(&problem.origins);
        z = [0.0; MOST];
        for share in SMOOTHINGS {
            problem.smoothing = share * size;
            points = problem.descend(&mut z);
        }
    }
    Some(points?.into_iter().map(|p| p + to).collect())
}

impl Problem<'_> {
    fn points(&self, z: &[f64; MOST]) -> Points {
        let place = |(i, (&o, t)): (usize, (&DVec3, &[DVec3; 2]))| {
            o + t[0] * z[2 * i] + t[1] * z[2 * i + 1]
        };
        self.origins
            .iter()
            .zip(&self.tangents)
            .enumerate()
            .map(place)
            .collect()
    }

    /// Unit direction and length of segment `i`, towards the sensor; infinite from infinity.
    fn segment(&self, points: &Points, i: usize) -> (DVec3, f64) {
        let end = points.get(i).copied().unwrap_or(DVec3::ZERO);
        let start = match (i.checked_sub(1), self.far) {
            (Some(before), _) => points[before],
            (None, Far::Point(x)) => x,
            (None, Far::Direction(w)) => return (-w, f64::INFINITY),
        };
        let v = end - start;
        let length = (v.length_squared() + self.smoothing * self.smoothing).sqrt();
        (v / length, length)
    }

    /// The optical path length, but for a constant.
    fn path(&self, points: &Points) -> f64 {
        let length = |i: usize| match (self.segment(points, i), self.far) {
            ((_, d), Far::Direction(w)) if d.is_infinite() => -w.dot(points[0]),
            ((_, d), _) => d,
        };
        self.eta
            .iter()
            .enumerate()
            .map(|(i, eta)| eta * length(i))
            .sum()
    }

    /// Newton's method from `z`, which it moves; the points if it has converged.
    fn descend(&self, z: &mut [f64; MOST]) -> Option<Points> {
        let m = self.origins.len();
        let n = 2 * m;
        let size = self.size(&self.origins);
        let most_eta = self.eta.iter().fold(0.0, |m: f64, &v| m.max(v));
        let mut points = self.points(z);
        let mut value = self.path(&points);
        for _ in 0..MOST_STEPS {
            let (gradient, mut matrix) = self.derivatives(&points);
            let steepness = gradient[..n].iter().fold(0.0, |m: f64, g| m.max(g.abs()));
            if steepness <= f64::EPSILON * most_eta {
                break;
            }
            let mut step = gradient;
            if !solve_positive(&mut matrix, &mut step, n) {
                return None;
            }
            let slope: f64 = (0..n).map(|i| gradient[i] * step[i]).sum();
            let longest = step[..n].iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            if longest.is_nan() || longest > LOST * size {
                return None;
            }
            // rounding of the value ends the search for a shorter step
            let noise = 16.0 * f64::EPSILON * most_eta * self.size(&points);
            let mut share = 1.0;
            loop {
                let mut next = *z;
                (0..n).for_each(|i| next[i] -= share * step[i]);
                let moved = self.points(&next);
                let now = self.path(&moved);
                if now <= value - 1e-4 * share * slope + noise {
                    (*z, points, value) = (next, moved, now);
                    break;
                }
                share *= 0.5;
                if share < 1e-6 {
                    break;
                }
            }
            if share < 1e-6 {
                break;
            }
            if share == 1.0 && longest <= 4.0 * f64::EPSILON * size {
                break;
            }
        }
        self.is_settled(&points, most_eta).then_some(points)
    }

    /// The largest length there is.
    fn size(&self, points: &Points) -> f64 {
        let far = match self.far {
            Far::Point(x) => x.length(),
            Far::Direction(_) => 0.0,
        };
        points.iter().fold(far, |s, p| s.max(p.length()))
    }

    /// Whether the law of refraction holds as far as positions have digits.
    fn is_settled(&self, points: &Points, most_eta: f64) -> bool {
        let (gradient, _) = self.derivatives(points);
        let size = self.size(points);
        (0..points.len()).all(|i| {
            let shortest = self.segment(points, i).1.min(self.segment(points, i + 1).1);
            let tolerance = most_eta * (1e-11 + 64.0 * f64::EPSILON * size / shortest);
            gradient[2 * i].hypot(gradient[2 * i + 1]) <= tolerance
        })
    }

    /// Gradient and Hessian of the path length.
    fn derivatives(&self, points: &Points) -> ([f64; MOST], [[f64; MOST]; MOST]) {
        let m = points.len();
        let (mut gradient, mut hessian) = ([0.0; MOST], [[0.0; MOST]; MOST]);
        for (i, &eta) in self.eta.iter().enumerate() {
            let (u, length) = self.segment(points, i);
            // of the segment's start (plane i − 1) and end (plane i)
            let bend = (DMat3::IDENTITY - outer(u)) * (eta / length);
            let ends = [i.checked_sub(1), (i < m).then_some(i)];
            for (end, sign) in ends.iter().zip([-1.0, 1.0]) {
                let &Some(k) = end else { continue };
                for (r, t) in self.tangents[k].iter().enumerate() {
                    gradient[2 * k + r] += sign * eta * u.dot(*t);
                    let row = bend * *t;
                    for (other, other_sign) in ends.iter().zip([-1.0, 1.0]) {
                        let &Some(l) = other else { continue };
                        for (c, t) in self.tangents[l].iter().enumerate() {
                            hessian[2 * k + r][2 * l + c] += sign * other_sign * row.dot(*t);
                        }
                    }
                }
            }
        }
        (gradient, hessian)
    }
}

fn outer(u: DVec3) -> DMat3 {
    DMat3::from_cols(u * u.x, u * u.y, u * u.z)
}

/// Solves `a x = b` of the first `n` unknowns for a symmetric positive definite `a` (Cholesky), `b`
/// becoming x. `false` where it is none.
fn solve_positive(a: &mut [[f64; MOST]; MOST], b: &mut [f64; MOST], n: usize) -> bool {
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                a[i][j] -= a[i][k] * a[j][k];
            }
        }
        let pivot = a[j][j];
        if pivot <= 0.0 || !pivot.is_finite() {
            return false;
        }
        let root = pivot.sqrt();
        (j..n).for_each(|i| a[i][j] /= root);
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    true
}

/// Whether the shortest optical path over two planes leads over the edge where they meet: then it
/// is no chain, and there is none. There the path is shortest along the edge, and what the segment
/// between the planes would have to carry on (its index times its direction) is shorter than its
/// index.
fn is_shortest_over_edge(bounces: &[Bounce], eta: &[f64], far: &Far, to: DVec3) -> bool {
    let [
        Surface::Plane {
            origin: o1,
            normal: n1,
        },
        Surface::Plane {
            origin: o2,
            normal: n2,
        },
    ] = (match bounces {
        [one, two] => [one.surface, two.surface],
        _ => return false,
    })
    else {
        return false;
    };
    let across = n1.cross(n2);
    let sine2 = across.length_squared();
    if sine2 < 1e-8 {
        return false;
    }
    // the edge, from the sensor's end
    let (h1, h2) = ((o1 - to).dot(n1), (o2 - to).dot(n2));
    let foot = (n2.cross(across) * h1 + across.cross(n1) * h2) / sine2;
    let along = across / sine2.sqrt();
    let from_light = |e: DVec3| match *far {
        Far::Point(x) => (e - x, (e - x).length()),
        Far::Direction(w) => (-w, 1.0),
    };
    // the shortest way over the edge: its slope along the edge rises
    let mut e = foot;
    for step in 0.. {
        let ((v, d), length) = (from_light(e), e.length());
        let (a, b) = (v.dot(along) / d, e.dot(along) / length);
        let slope = eta[0] * a + eta[2] * b;
        let bend = match far {
            Far::Point(_) => eta[0] * (1.0 - a * a) / d,
            Far::Direction(_) => 0.0,
        } + eta[2] * (1.0 - b * b) / length;
        if slope.abs() < 1e-9 {
            break;
        }
        let change = slope / bend;
        // far out: the search below decides
        if step == 12 || change.abs() > 1e3 * (d + length) || !change.is_finite() {
            return false;
        }
        e -= along * change;
    }
    let ((v, d), length) = (from_light(e), e.length());
    let (arriving, leaving) = (v * (eta[0] / d), -e * (eta[2] / length));
    let (t1, t2) = (n1.cross(along), n2.cross(along));
    let (c, p1, p2) = (t1.dot(t2), arriving.dot(t1), leaving.dot(t2));
    let carried = arriving.dot(along).powi(2) + (p1 * p1 + p2 * p2 - 2.0 * c * p1 * p2) / sine2;
    carried < eta[1] * eta[1] * (1.0 - 1e-6)
}
