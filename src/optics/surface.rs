//! Intersection of rays with lens surfaces, in the space of the surface (vertex at the origin, axis
//! along z).
//!
//! The line is first moved to its foot, the point nearest the vertex, so that nothing is lost to
//! the distance a ray has come. Conics have closed forms, written so that no root cancels. For the
//! others, the distance along the axis between ray and surface is bounded by interval arithmetic: a
//! stretch without a zero, or on which that distance is monotone, is decided; any other is halved.
//! The first crossing found is therefore the first there is.

use super::aperture::Aperture;
use super::interval::Interval;
use super::profile::Profile;
use arrayvec::ArrayVec;
use glam::DVec3;

/// Halvings of the stretch of a line near a surface; a stretch that is still undecided then is a
/// touch, not a crossing.
const MAX_DEPTH: u32 = 48;
/// Stretches looked at per line: bounds the time spent on a surface made to be slow.
const MAX_STRETCHES: u32 = 4096;

/// A point at which a line crosses a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance along the line from its origin.
    pub t: f64,
    /// The point, in the space of the surface.
    pub point: DVec3,
    /// Unit normal there, on the side of +z.
    pub normal: DVec3,
}

/// A shape with a clear aperture.
#[derive(Clone, Debug, PartialEq)]
pub struct LensSurface {
    /// The shape.
    pub profile: Profile,
    /// The clear aperture.
    pub aperture: Aperture,
    /// How far from the vertex lines are followed to shapes that have no closed form; with an
    /// aperture, at least its extent.
    pub reach: f64,
}

/// A line moved to its foot.
struct Line {
    o: DVec3,
    d: DVec3,
    /// Distance of the foot from the origin of the line.
    shift: f64,
}

impl Line {
    fn new(o: DVec3, d: DVec3) -> Self {
        let shift = -o.dot(d);
        Self {
            o: o + d * shift,
            d,
            shift,
        }
    }
}

impl LensSurface {
    /// A shape with an aperture.
    #[must_use]
    pub fn new(profile: Profile, aperture: Aperture) -> Self {
        let extent = aperture.extent();
        let reach = if extent.is_finite() {
            1.5 * extent
        } else {
            1e3
        };
        Self {
            profile,
            aperture,
            reach,
        }
    }

    /// Least and greatest sag within the reach of the aperture; `None` if it has no edge.
    #[must_use]
    pub fn sag_range(&self) -> Option<[f64; 2]> {
        let reach = self.aperture.extent();
        let sag = self.profile.sag_bounds(reach);
        (reach.is_finite() && sag.magnitude().is_finite()).then_some([sag.lo, sag.hi])
    }

    /// The first crossing with `t_min < t < t_max` inside the aperture. `d` is a unit vector. With
    /// `leaving`, `o` lies on this surface, and that point is none of its crossings.
    #[must_use]
    pub fn first_hit(
        &self,
        o: DVec3,
        d: DVec3,
        range: [f64; 2],
        leaving: bool,
    ) -> Option<Crossing> {
        self.first_hit_but(o, d, range, [leaving.then_some(0.0), None])
    }

    /// The same where up to two points of the line are known to lie on the surface, and are none of
    /// its crossings: at 0, and farther along.
    #[must_use]
    #[inline]
    pub fn first_hit_but(
        &self,
        o: DVec3,
        d: DVec3,
        [t_min, t_max]: [f64; 2],
        own: [Option<f64>; 2],
    ) -> Option<Crossing> {
        let is_within = |t: f64| t_min < t && t < t_max;
        let is_clear = |point: DVec3| self.aperture.contains(point.x, point.y);
        if let Profile::Conic { curvature, conic } = self.profile {
            // from cheap to dear: the normal is that of the one crossing which counts
            for t in conic_roots(curvature, conic, (o, d, 1.0), own) {
                if !is_within(t) {
                    continue;
                }
                let point = o + d * t;
                if is_clear(point)
                    && let Some(slope) = conic_slope(curvature, conic, point)
                {
                    let normal = slope.normalize();
                    return Some(Crossing { t, point, normal });
                }
            }
            return None;
        }
        let inside = |c: &Crossing| is_within(c.t) && is_clear(c.point);
        let reach = self.aperture.extent().min(self.reach);
        let [mut start, end] = own;
        let mut from = t_min;
        loop {
            let found = self.first_sign_change(o, d, [from, t_max], reach, [start, end])?;
            if inside(&found) {
                return Some(found);
            }
            (start, from) = (Some(found.t), found.t);
        }
    }

    /// The crossing that a sequential trace takes, apertures aside: the first on the whole line
    /// that goes through the surface in the sense of the ray. `d` is a unit vector.
    #[must_use]
    pub fn sequential(&self, o: DVec3, d: DVec3) -> Option<Crossing> {
        if let Profile::Conic { curvature, conic } = self.profile {
            let line = Line::new(o, d);
            let quadratic = conic_quadratic(curvature, conic, &line, 1.0);
            let (_, b, c) = quadratic;
            let root = discriminant(quadratic)?.sqrt();
            let denominator = root.copysign(d.z) - b;
            let t = if c == 0.0 { 0.0 } else { c / denominator };
            let point = line.o + d * t;
            let normal = conic_slope(curvature, conic, point)?.normalize();
            let t = t + line.shift;
            return Some(Crossing { t, point, normal });
        }
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let mut range = everywhere;
        let mut start = None;
        loop {
            let hit = self.first_sign_change(o, d, range, self.reach, [start, None])?;
            if hit.normal.dot(d) * d.z >= 0.0 {
                return Some(hit);
            }
            (range[0], start) = (hit.t, Some(hit.t));
        }
    }

    /// The first place in a range of the line, within `reach` of the axis, where it passes from one
    /// side of the surface to the other. `own`: places that are crossings already and do not
    /// count.
    fn first_sign_change(
        &self,
        o: DVec3,
        d: DVec3,
        range: [f64; 2],
        reach: f64,
        own: [Option<f64>; 2],
    ) -> Option<Crossing> {
        let line = Line::new(o, d);
        let reach = reach.min(self.profile.domain_radius() * (1.0 - 1e-12));
        let [mut lo, mut hi] = range.map(|t| t - line.shift);
        // within the cylinder of the reach
        let flat = |v: DVec3| v.truncate();
        let (a, b) = (flat(d).length_squared(), flat(line.o).dot(flat(d)));
        let c = flat(line.o).length_squared() - reach * reach;
        if a > 0.0 {
            let root = (b * b - a * c).sqrt();
            if root.is_nan() {
                return None;
            }
            (lo, hi) = (lo.max((-b - root) / a), hi.min((-b + root) / a));
        } else if c > 0.0 {
            return None;
        }
        // between the planes of least and greatest sag
        let sag = self.profile.sag_bounds(reach);
        let margin = 1e-9 * (reach + sag.magnitude());
        if d.z.abs() > 0.0 {
            let planes = Interval::new(
                (sag.lo - margin - line.o.z) / d.z,
                (sag.hi + margin - line.o.z) / d.z,
            );
            (lo, hi) = (lo.max(planes.lo), hi.min(planes.hi));
        } else if line.o.z < sag.lo - margin || line.o.z > sag.hi + margin {
            return None;
        }
        if lo.partial_cmp(&hi) != Some(std::cmp::Ordering::Less) || !(hi - lo).is_finite() {
            return None;
        }
        let own = own.map(|own| own.map(|t| t - line.shift));
        let t = self.search(&line, [lo, hi], own)?;
        let point = line.o + d * t;
        let [_, zx, zy] = self.profile.sag_and_slopes(point.x, point.y);
        Some(Crossing {
            t: t + line.shift,
            point,
            normal: DVec3::new(-zx, -zy, 1.0).normalize(),
        })
    }

    /// The first zero in `range`, by halving what is undecided, nearest first.
    fn search(&self, line: &Line, range: [f64; 2], own: [Option<f64>; 2]) -> Option<f64> {
        // a half waits at each depth
        let mut pending = ArrayVec::<_, { MAX_DEPTH as usize + 2 }>::new();
        pending.push((range, 0));
        let mut looked_at = 0;
        while let Some(([a, b], depth)) = pending.pop() {
            looked_at += 1;
            let (distance, slope) = self.distance_bounds(line, Interval::new(a, b));
            if !distance.contains_zero() || looked_at > MAX_STRETCHES {
                continue;
            }
            let near_own = own.into_iter().flatten().any(|t| {
                let slack = 1e-9 * (b - a);
                a - slack <= t && t <= b + slack
            });
            if !slope.contains_zero() {
                // monotone: its only zero is its own, or lies where the signs differ
                if !near_own && let Some(t) = self.refine(line, a, b) {
                    return Some(t);
                }
                continue;
            }
            if depth < MAX_DEPTH {
                let middle = 0.5 * (a + b);
                pending.push(([middle, b], depth + 1));
                pending.push(([a, middle], depth + 1));
            } else if !near_own && let Some(t) = self.refine(line, a, b) {
                return Some(t);
            }
        }
        None
    }

    /// Bounds over a stretch of the line of z - sag and of its derivative along the line.
    fn distance_bounds(&self, line: &Line, t: Interval) -> (Interval, Interval) {
        let (o, d) = (line.o, line.d);
        let along = |o: f64, d: f64| Interval::new(o + d * t.lo, o + d * t.hi);
        let (x, y, z) = (along(o.x, d.x), along(o.y, d.y), along(o.z, d.z));
        let at = |t: f64| (o + d * t).truncate();
        // r^2 is convex along the line: its range is that of its ends, down to the nearest point of
        // the axis
        let flat = d.truncate();
        let (u0, u1) = (at(t.lo).length_squared(), at(t.hi).length_squared());
        let half_rate = Interval::new(at(t.lo).dot(flat), at(t.hi).dot(flat));
        let mut u = Interval::new(u0, u1);
        if half_rate.contains_zero() && flat.length_squared() > 0.0 {
            let nearest = -o.truncate().dot(flat) / flat.length_squared();
            u.lo = u.lo.min(at(nearest).length_squared());
        }
        let (sag, [first, second]) = self.profile.bounds(u, x, y);
        let climb = match self.profile {
            Profile::Conic { .. } | Profile::EvenAsphere { .. } => half_rate.scaled(2.0) * first,
            Profile::OddAsphere { .. } => {
                // dr/dt grows from -|d| to |d| along the line
                let speed = flat.length();
                let rate = |rate: f64, u: f64| {
                    let r = u.sqrt();
                    if r > 0.0 {
                        (rate / r).clamp(-speed, speed)
                    } else {
                        f64::NAN
                    }
                };
                let (mut lo, mut hi) = (rate(half_rate.lo, u0), rate(half_rate.hi, u1));
                if half_rate.lo > half_rate.hi || lo.is_nan() {
                    lo = -speed;
                }
                if hi.is_nan() {
                    hi = speed;
                }
                half_rate.scaled(2.0) * first + Interval::new(lo, hi) * second
            }
            Profile::Toroid { .. } => first.scaled(d.x) + second.scaled(d.y),
        };
        let rounding = 8.0 * f64::EPSILON * (z.magnitude() + sag.magnitude());
        ((z - sag).widened(rounding), Interval::point(d.z) - climb)
    }

    /// z - sag and its derivative at one place of the line.
    fn distance(&self, line: &Line, t: f64) -> (f64, f64) {
        let p = line.o + line.d * t;
        let [z, zx, zy] = self.profile.sag_and_slopes(p.x, p.y);
        (p.z - z, line.d.z - zx * line.d.x - zy * line.d.y)
    }

    /// The zero between two places of different sign: Newton's steps, halving where they leave the
    /// bracket or are slow.
    fn refine(&self, line: &Line, a: f64, b: f64) -> Option<f64> {
        let (fa, fb) = (self.distance(line, a).0, self.distance(line, b).0);
        if fa == 0.0 {
            return Some(a);
        }
        if fb == 0.0 {
            return Some(b);
        }
        if fa.is_nan() || fb.is_nan() || (fa > 0.0) == (fb > 0.0) {
            return None;
        }
        let (mut lo, mut hi) = (a, b);
        // the end nearer to the surface is the better first guess of a secant
        let mut t = a + (b - a) * (fa / (fa - fb));
        let mut step = b - a;
        for _ in 0..200 {
            let (f, slope) = self.distance(line, t);
            if f == 0.0 {
                return Some(t);
            }
            if (f > 0.0) == (fa > 0.0) {
                lo = t;
            } else {
                hi = t;
            }
            let newton = t - f / slope;
            let last = step;
            let inside = lo < newton && newton < hi;
            let next = if inside && (newton - t).abs() <= 0.6 * last.abs() {
                newton
            } else {
                0.5 * (lo + hi)
            };
            step = next - t;
            if step.abs() <= f64::EPSILON * t.abs() || next == lo || next == hi {
                return Some(next);
            }
            t = next;
        }
        Some(t)
    }
}

/// a, b and c of `a t^2 + 2 b t + c = 0`, t measured from the foot in units of a direction of
/// squared length `square`.
#[inline(always)]
fn conic_quadratic(c: f64, k: f64, line: &Line, square: f64) -> (f64, f64, f64) {
    let (o, d) = (line.o, line.d);
    (
        c * (square + k * d.z * d.z),
        c * (o.dot(d) + k * o.z * d.z) - d.z,
        c * (o.length_squared() + k * o.z * o.z) - 2.0 * o.z,
    )
}

#[inline(always)]
fn discriminant((a, b, rest): (f64, f64, f64)) -> Option<f64> {
    let value = b * b - a * rest;
    (value >= 0.0).then_some(value)
}

/// Places, in order, at which a line from `o` along `d`, of squared length `square`, meets the
/// quadric; NaN for those that do not exist or are its own.
#[inline(always)]
pub(crate) fn conic_roots(
    c: f64,
    k: f64,
    (o, d, square): (DVec3, DVec3, f64),
    own: [Option<f64>; 2],
) -> [f64; 2] {
    // of a point on it, its own root is known and the other has a closed form
    let other = |o: DVec3| {
        let (a, b, _) = conic_quadratic(c, k, &Line { o, d, shift: 0.0 }, square);
        -2.0 * b / a
    };
    match own {
        [Some(_), Some(_)] => return [f64::NAN; 2],
        [Some(t), None] | [None, Some(t)] => return [t + other(o + d * t), f64::NAN],
        [None, None] => {}
    }
    let shift = -o.dot(d) / square;
    let o = o + d * shift;
    let quadratic = conic_quadratic(c, k, &Line { o, d, shift }, square);
    let (a, b, rest) = quadratic;
    let Some(square) = discriminant(quadratic) else {
        return [f64::NAN; 2];
    };
    let q = -(b + square.sqrt().copysign(b));
    let (first, second) = (q / a + shift, rest / q + shift);
    if first < second || second.is_nan() {
        [first, second]
    } else {
        [second, first]
    }
}

/// The gradient, on the side of +z, at a point of the quadric if it lies on the sheet of the
/// vertex.
#[inline(always)]
pub(crate) fn conic_slope(c: f64, k: f64, point: DVec3) -> Option<DVec3> {
    let up = 1.0 - c * (1.0 + k) * point.z;
    (point.is_finite() && up >= 0.0).then(|| DVec3::new(-c * point.x, -c * point.y, up))
}

#[cfg(test)]
mod tests;
