//! How much of an image's error is the same all along a line of one color: the mark of samples that
//! share a wavelength or a time.
//!
//! The pixels of a region are put into groups along the lines of one color (columns, rows or
//! rings). Independent errors scatter within a group as they do between groups; shared ones move
//! whole groups: the F-ratio of a one-way analysis of variance (Fisher 1925) tells them apart
//! without knowing how the image was made.

/// Pixels to each side of a group over which its expected mean is taken where there is no
/// reference.
const SMOOTHING: usize = 4;

/// The direction in which color (or the moment) changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// Along x: groups are columns.
    X,
    /// Along y: groups are rows.
    Y,
    /// With the distance from a point, in pixels: groups are rings of one pixel.
    Distance([f64; 2]),
}

impl Axis {
    /// The group of the pixel with this middle.
    fn group(self, x: f64, y: f64) -> usize {
        let position = match self {
            Self::X => x,
            Self::Y => y,
            Self::Distance([cx, cy]) => (x - cx).hypot(y - cy),
        };
        position as usize
    }
}

/// Bands of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Banding {
    /// Groups of at least two pixels.
    pub groups: usize,
    /// Mean square between groups over that within: 1 for independent errors; above 2 there are
    /// bands.
    pub f_ratio: f64,
    /// Root mean square of the errors that whole groups share, over the mean of the region.
    pub coherent_rms: f64,
    /// Effective share of the groups that have their energy: 1/(G Σ h²) with h a group's value over
    /// the reference's, in sum 1. `None` without a reference.
    pub participation: Option<f64>,
}

#[derive(Clone, Copy, Default)]
struct Group {
    count: f64,
    sum: f64,
    squares: f64,
    image: f64,
    reference: f64,
}

impl Group {
    fn mean(&self) -> f64 {
        self.sum / self.count
    }
}

/// Measures the pixels `columns` x `rows` of an image of `width` columns, row by row. `None` where
/// there are fewer than three groups or nothing varies within them.
#[must_use]
pub fn banding(
    image: &[f64],
    reference: Option<&[f64]>,
    width: usize,
    (columns, rows): (std::ops::Range<usize>, std::ops::Range<usize>),
    axis: Axis,
) -> Option<Banding> {
    let mut groups: Vec<Group> = Vec::new();
    for y in rows {
        for x in columns.clone() {
            let index = y * width + x;
            let g = axis.group(x as f64 + 0.5, y as f64 + 0.5);
            if g >= groups.len() {
                groups.resize(g + 1, Group::default());
            }
            let expected = reference.map_or(0.0, |r| r[index]);
            let residual = image[index] - expected;
            let group = &mut groups[g];
            group.count += 1.0;
            group.sum += residual;
            group.squares += residual * residual;
            group.image += image[index];
            group.reference += expected;
        }
    }
    groups.retain(|g| g.count >= 2.0);
    let count = groups.len();
    if count < 3 {
        return None;
    }
    let means: Vec<f64> = groups.iter().map(Group::mean).collect();
    let shifts: Vec<f64> = if reference.is_some() {
        means.clone()
    } else {
        (0..count)
            .map(|g| {
                let near = g.saturating_sub(SMOOTHING)..(g + SMOOTHING + 1).min(count);
                let width = near.len() as f64;
                means[g] - means[near].iter().sum::<f64>() / width
            })
            .collect()
    };
    let total: f64 = groups.iter().map(|g| g.count).sum();
    let weighted = |values: &[f64]| {
        let sum: f64 = groups.iter().zip(values).map(|(g, v)| g.count * v).sum();
        sum / total
    };
    let middle = weighted(&shifts);
    let squares: Vec<f64> = shifts.iter().map(|s| (s - middle).powi(2)).collect();
    let between = weighted(&squares) * total / (count as f64 - 1.0);
    let scatter: f64 = groups
        .iter()
        .map(|g| g.squares - g.count * g.mean() * g.mean())
        .sum();
    let within = scatter / (total - count as f64);
    if within.is_nan() || within <= 0.0 {
        return None;
    }
    let level = groups
        .iter()
        .map(|g| {
            if reference.is_some() {
                g.reference
            } else {
                g.image
            }
        })
        .sum::<f64>()
        / total;
    let noise = within * count as f64 / total;
    Some(Banding {
        groups: count,
        f_ratio: between / within,
        coherent_rms: (weighted(&squares) - noise).max(0.0).sqrt() / level,
        participation: reference.map(|_| participation(&groups)),
    })
}

fn participation(groups: &[Group]) -> f64 {
    let shares = groups
        .iter()
        .filter(|g| g.reference > 0.0)
        .map(|g| (g.image / g.reference).max(0.0));
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for share in shares {
        count += 1.0;
        sum += share;
        squares += share * share;
    }
    sum * sum / (count * squares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};

    /// A flat image of 128 x 64 pixels with uniform noise, plus `shift` of each column.
    fn noisy(key: u64, shift: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..128 * 64)
            .map(|i| 10.0 + unit_f64(random_bits(key, i)) - 0.5 + shift(i as usize % 128))
            .collect()
    }

    fn of(image: &[f64], with_reference: bool, axis: Axis) -> Banding {
        let reference = vec![10.0; image.len()];
        let reference = with_reference.then_some(&reference[..]);
        banding(image, reference, 128, (0..128, 0..64), axis).expect("groups")
    }

    #[test]
    fn independent_noise_has_an_f_ratio_of_one() {
        for key in 0..20 {
            let image = noisy(key, |_| 0.0);
            for axis in [Axis::X, Axis::Y, Axis::Distance([64.0, 32.0])] {
                let found = of(&image, true, axis);
                // F(127, 8064) has a standard deviation of 0.13; that of fewer groups 0.2
                assert!((0.3..1.9).contains(&found.f_ratio), "{found:?}");
                assert!(found.participation.is_some_and(|p| p > 0.999));
            }
        }
    }

    #[test]
    fn what_columns_share_is_found_along_x_alone() {
        let column = |x: usize| 0.3 * (unit_f64(random_bits(99, x as u64)) - 0.5);
        let image = noisy(5, column);
        let found = of(&image, true, Axis::X);
        // 1 + 64 (0.09/12) / (1/12), the column shifts having 11 % of standard deviation in their
        // variance
        assert!((found.f_ratio / 6.76 - 1.0).abs() < 0.5, "{found:?}");
        assert!((found.coherent_rms / (0.3 / 12_f64.sqrt() / 10.0) - 1.0).abs() < 0.3);
        assert!(of(&image, false, Axis::X).f_ratio > 3.0);
        assert!(of(&image, true, Axis::Y).f_ratio < 2.0);
    }

    #[test]
    fn two_lit_columns_take_part_alone() {
        let mut image = noisy(7, |x| if x == 20 || x == 90 { 0.0 } else { -10.0 });
        image.iter_mut().for_each(|v| *v = v.max(0.0));
        let found = of(&image, true, Axis::X);
        let share = found.participation.expect("with a reference");
        assert!(share < 0.05, "{share}");
        assert!(found.f_ratio > 100.0);
    }

    #[test]
    fn too_few_groups_tell_nothing() {
        assert_eq!(banding(&[1.0; 8], None, 2, (0..2, 0..4), Axis::X), None);
    }
}
