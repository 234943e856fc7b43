//! Vertices in single precision about an origin in double precision.
//!
//! Files in map coordinates have vertices millions of meters from zero that lie millimeters apart.
//! Single precision about zero loses them; about the middle of their mesh it does not.

use glam::DVec3;

/// An edge is kept if its ends move by less than this part of its length.
const FINE: f64 = 1e-3;
/// The least ratio of the largest coordinate about zero to that about the middle for which the
/// origin is moved.
const WORTH: f64 = 8.0;

/// Vertices about an origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// To be added to all positions.
    pub origin: DVec3,
    /// Positions about it.
    pub positions: Vec<[f32; 3]>,
    /// Warning where edges are coarser than they should be.
    pub note: Option<String>,
}

/// Positions of triangles in single precision, about zero where that is fine enough. Indices out of
/// range count for nothing.
#[must_use]
pub fn placed(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Placed {
    let about = |origin: DVec3| Placed {
        origin,
        positions: positions
            .iter()
            .map(|&p| (DVec3::from(p) - origin).as_vec3().to_array())
            .collect(),
        note: None,
    };
    let mut placed = about(DVec3::ZERO);
    let mut coarse = coarse_edges(positions, triangles, &placed);
    if coarse.0 > 0 {
        let all = positions.iter().copied().map(DVec3::from);
        let low = all.clone().fold(DVec3::INFINITY, DVec3::min);
        let high = all.fold(DVec3::NEG_INFINITY, DVec3::max);
        let middle = (low + high) / 2.0;
        let largest = low.abs().max(high.abs()).max_element();
        if largest > WORTH * (high - middle).max_element() {
            // whole numbers stay whole
            placed = about(middle.round());
            coarse = coarse_edges(positions, triangles, &placed);
        }
    }
    if let (1.., step) = coarse {
        placed.note = Some(format!(
            "coordinates are kept in single precision: the ends of {} are moved by more than a thousandth of the length (by up to {step:.1e})",
            match coarse.0 {
                1 => "one edge of a triangle".to_owned(),
                n => format!("{n} edges of triangles"),
            }
        ));
    }
    placed
}

/// How many sides of triangles are not kept, and how far their ends move at most.
fn coarse_edges(positions: &[[f64; 3]], triangles: &[[u32; 3]], placed: &Placed) -> (usize, f64) {
    let errors: Vec<f64> = positions
        .iter()
        .zip(&placed.positions)
        .map(|(&p, &q)| {
            let kept = placed.origin + DVec3::from(q.map(f64::from));
            (DVec3::from(p) - kept).length()
        })
        .collect();
    if errors.iter().all(|&e| e == 0.0) {
        return (0, 0.0);
    }
    let (mut count, mut step) = (0, 0.0f64);
    for triangle in triangles {
        let corners = triangle.map(|v| {
            let i = v as usize;
            Some((DVec3::from(*positions.get(i)?), errors[i]))
        });
        for i in 0..3 {
            if let (Some((a, ea)), Some((b, eb))) = (corners[i], corners[(i + 1) % 3]) {
                let (length, error) = ((b - a).length(), ea.max(eb));
                if length > 0.0 && error > FINE * length {
                    count += 1;
                    step = step.max(error);
                }
            }
        }
    }
    (count, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(at: f64, size: f64) -> Placed {
        let positions = [[at, 0.0, 0.0], [at + size, 0.0, 0.0], [at, size, 0.0]];
        placed(&positions, &[[0, 1, 2], [0, 1, 9]])
    }

    #[test]
    fn only_what_needs_it_is_moved() {
        for (at, size) in [(0.0, 0.1), (100.0, 1.0), (-3.0, 0.01)] {
            let near = strip(at, size);
            assert_eq!((near.origin, near.note), (DVec3::ZERO, None), "{at}");
        }
        let far = strip(4_649_776.0, 0.1);
        assert_eq!(far.origin, DVec3::new(4_649_776.0, 0.0, 0.0));
        assert_eq!(far.positions[1], [0.1, 0.0, 0.0]);
        assert_eq!(far.note, None);
    }

    #[test]
    fn what_stays_coarse_is_said() {
        let positions = [
            [1.0 / 3.0, 0.0, 0.0],
            [1.0 / 3.0 + 1e-6, 0.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let note = placed(&positions, &[[0, 1, 2]]).note.expect("coarse");
        assert!(note.contains("one edge of a triangle are moved"), "{note}");
    }
}
