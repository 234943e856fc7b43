//! Ray differentials through a chain: the solid angle at one end per area at the other.
//!
//! Igehy, "Tracing Ray Differentials" (1999), with the shape operator of the surface for the change
//! of its normal.

use super::{Bounce, Far};
use glam::DVec3;

/// A ray with its derivatives by two perpendicular angles at its start.
pub(super) struct Differential {
    direction: DVec3,
    /// Of the position.
    pub p: [DVec3; 2],
    /// Of the direction.
    pub d: [DVec3; 2],
}

impl Differential {
    /// At its start; the angles are about the pair of axes that `any_orthonormal_pair` gives.
    pub fn leaving(direction: DVec3) -> Self {
        let (x, y) = direction.any_orthonormal_pair();
        Self {
            direction,
            p: [DVec3::ZERO; 2],
            d: [x, y],
        }
    }

    /// To the surface at `distance`, whose own normal is `n`.
    pub fn advance(&mut self, distance: f64, n: DVec3) {
        let d = self.direction;
        for (p, turn) in self.p.iter_mut().zip(self.d) {
            *p += distance * turn;
            *p -= d * (p.dot(n) / d.dot(n));
        }
    }

    /// Scatters where the bounce is, at `place` with its `normal`, from the first index of `eta` to
    /// the second, into unit `direction`.
    pub fn scatter(
        &mut self,
        bounce: &Bounce,
        (place, normal): (DVec3, DVec3),
        eta: [f64; 2],
        direction: DVec3,
    ) {
        let d = self.direction;
        // against the ray
        let side = -d.dot(normal).signum();
        let n = normal * side;
        for (p, turn) in self.p.iter().zip(&mut self.d) {
            let dn = bounce.surface.turn(place, *p) * side;
            let delta = turn.dot(n) + d.dot(dn);
            if bounce.transmits {
                let e = eta[0] / eta[1];
                let cos = -direction.dot(n);
                let (mu, dmu) = (cos + e * d.dot(n), (e + e * e * d.dot(n) / cos) * delta);
                *turn = e * *turn - (dn * mu + n * dmu);
            } else {
                *turn -= 2.0 * (dn * d.dot(n) + n * delta);
            }
        }
        self.direction = direction;
    }
}

/// `|dω_b/dA_a|` with the area perpendicular to the chain's segment at x_a: solid angle at x_b =
/// `to` per area at x_a = `far` through the chain; per solid angle where x_a is infinitely far
/// away. Steradians per square meter. Not finite where the chain is on a fold. Surfaces are
/// triangles where they were meshes. [theory (9.2), (9.3)]
#[must_use]
pub fn jacobian(bounces: &[Bounce], points: &[DVec3], eta: &[f64], far: &Far, to: DVec3) -> f64 {
    let m = points.len();
    let unit = |from: DVec3, to: DVec3| (to - from).normalize();
    let mut ray = Differential::leaving(unit(to, points[m - 1]));
    let mut origin = to;
    for i in (0..m).rev() {
        let (p, bounce) = (points[i], &bounces[i]);
        let [normal, face] = bounce.surface.normals(p);
        let next = match i.checked_sub(1) {
            Some(before) => unit(p, points[before]),
            None => far.direction_from(p),
        };
        ray.advance(origin.distance(p), face);
        ray.scatter(bounce, (p, normal), [eta[i + 1], eta[i]], next);
        origin = p;
    }
    let across = match *far {
        Far::Point(x) => {
            ray.advance(origin.distance(x), ray.direction);
            ray.p[0].cross(ray.p[1])
        }
        Far::Direction(_) => ray.d[0].cross(ray.d[1]),
    };
    1.0 / across.dot(ray.direction).abs()
}
