//! Enclosures: where a point may be inside of anything, told from bounds, so that media are looked
//! for with rays only there.

use crate::geometry::Accel;
use crate::medium::Boundary;
use crate::scene::Object;
use glam::DVec3;

/// Bounds of all solids over the shutter.
#[derive(Debug, Default)]
pub(super) struct Enclosures {
    /// Sorted by their least x.
    bounds: Vec<(DVec3, DVec3)>,
    /// Largest x of the bounds up to each of them.
    reach: Vec<f64>,
    /// Surfaces that name their media say something about all places.
    everywhere: bool,
}

impl Enclosures {
    pub fn new(accel: &Accel, objects: &[Object]) -> Self {
        let boundaries = accel.instances().iter().zip(objects);
        let solids = boundaries.filter(|(_, o)| matches!(o.boundary, Boundary::Solid { .. }));
        let bounds = solids
            .map(|(instance, _)| {
                let (low, high) = instance.bounds();
                // far more than rounding: who is close is looked at with rays
                let margin = 1e-6 * low.abs().max(high.abs()).max_element();
                (low - margin, high + margin)
            })
            .collect();
        let interface = |o: &Object| matches!(o.boundary, Boundary::Interface { .. });
        Self::of(bounds, objects.iter().any(interface))
    }

    fn of(mut bounds: Vec<(DVec3, DVec3)>, everywhere: bool) -> Self {
        bounds.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
        let mut most = f64::NEG_INFINITY;
        let reach = bounds.iter().map(|(_, high)| {
            most = most.max(high.x);
            most
        });
        Self {
            reach: reach.collect(),
            everywhere,
            bounds,
        }
    }

    /// Whether a point may be inside of a solid, or beside a surface that names its media; if not,
    /// it is in the ambient medium.
    pub fn may_hold(&self, p: DVec3) -> bool {
        let end = self.bounds.partition_point(|(low, _)| low.x <= p.x);
        let candidates = self.bounds[..end].iter().zip(&self.reach[..end]).rev();
        let holds = |(low, high): &(DVec3, DVec3)| p.cmpge(*low).all() && p.cmple(*high).all();
        self.everywhere
            || candidates
                .take_while(|(_, reach)| **reach >= p.x)
                .any(|(bounds, _)| holds(bounds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};

    #[test]
    fn boxes_are_found_as_one_by_one() {
        let random = |i: u64| 10.0 * unit_f64(random_bits(3, i));
        let at = |i: u64| DVec3::new(random(3 * i), random(3 * i + 1), random(3 * i + 2));
        let bounds = |i: u64| {
            let half = DVec3::splat(0.02 + 0.1 * random(1000 + i));
            (at(i) - half, at(i) + half)
        };
        let all: Vec<_> = (0..60).map(bounds).collect();
        let enclosures = Enclosures::of(all.clone(), false);
        let mut inside = 0;
        for p in (100..1100).map(at) {
            let expected = all
                .iter()
                .any(|(low, high)| p.cmpge(*low).all() && p.cmple(*high).all());
            assert_eq!(enclosures.may_hold(p), expected, "{p}");
            inside += usize::from(expected);
        }
        assert!((50..950).contains(&inside), "{inside}");
    }
}
