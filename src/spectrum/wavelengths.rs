//! The wavelengths of one path, and the distribution they are drawn from.
//!
//! Wavelengths live on the measure "Lebesgue + one unit atom per emission line". The cumulative
//! distribution is piecewise linear over cells of at most 1 nm, with a jump at every atom; it is
//! inverted exactly. Lanes are rotated in primary space (u), as hero wavelength sampling (Wilkie et
//! al. 2014) over a warped wavelength axis, so each lane alone follows the distribution. Invariant:
//! a continuous sample never has bitwise the wavelength of an atom.

use super::emission::Line;
use super::integral::{cells, integrate, over_cell};
use super::{Curve, Emission, MAX_LANES, cie};

/// The wavelengths of one path: lane 0 is the hero, the others are its rotations in primary space.
///
/// Immutable for the life of a path: lanes die on a sub-path, never here.
#[derive(Clone, Copy, Debug)]
pub struct SampledWavelengths {
    lambda_nm: [f64; MAX_LANES],
    /// Density with respect to the wavelength measure: a probability at an atom, per nm elsewhere.
    pdf: [f64; MAX_LANES],
    /// Bit j: lane j sits on an atom (an emission line).
    atoms: u8,
    count: u8,
}

impl SampledWavelengths {
    /// Number of lanes in use: 1, 4 or 8.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// Wavelength of lane `lane` in nanometers.
    #[must_use]
    pub fn lambda_nm(&self, lane: usize) -> f64 {
        self.lambda_nm[lane]
    }

    /// Density of lane `lane`: a probability at an atom, per nanometer elsewhere.
    #[must_use]
    pub fn pdf(&self, lane: usize) -> f64 {
        self.pdf[lane]
    }

    /// Whether lane `lane` sits on an emission line.
    #[must_use]
    pub fn is_line(&self, lane: usize) -> bool {
        self.atoms & (1 << lane) != 0
    }

    /// Whether any lane sits on an emission line.
    #[must_use]
    pub fn has_lines(&self) -> bool {
        self.atoms != 0
    }

    /// Whether all lanes sit on emission lines.
    #[must_use]
    pub fn are_lines(&self) -> bool {
        self.atoms.count_ones() == u32::from(self.count)
    }

    /// Whether all lanes have the wavelengths of another set.
    #[must_use]
    pub fn are_those_of(&self, other: &Self) -> bool {
        self.count == other.count && self.lambda_nm == other.lambda_nm
    }

    /// How many lanes have exactly the wavelength of `lane` (itself included): 1 unless lanes
    /// coincide on an atom.
    #[must_use]
    pub fn multiplicity(&self, lane: usize) -> usize {
        let n = self.count();
        (0..n)
            .filter(|&k| self.lambda_nm[k] == self.lambda_nm[lane])
            .count()
    }
}

/// One piece of the cumulative distribution: a cell of constant density, or an atom (`low_nm ==
/// high_nm`).
#[derive(Clone, Copy, Debug)]
struct Piece {
    low_nm: f64,
    high_nm: f64,
    /// Strictly inside of a cell: its ends may be atoms.
    inner_nm: [f64; 2],
    /// Cumulative probability before the piece.
    before: f64,
    probability: f64,
    /// Width over probability.
    nm_per_unit: f64,
    /// Probability of an atom, density per nanometer of a cell.
    density: f64,
}

impl Piece {
    fn is_atom(&self) -> bool {
        self.low_nm == self.high_nm
    }
}

/// Share of the density that is uniform, whatever the emitters.
const UNIFORM_SHARE: f64 = 0.2;
/// The least a line gets, as a share of its emitter.
const LINE_FLOOR: f64 = 0.01;
/// Ends of the observer, where it jumps to 0.
const OBSERVER_NM: [f64; 2] = [cie::FIRST_NM, cie::LAST_NM];
/// Buckets of the guide table that starts the search of the inverse.
const GUIDE: usize = 1024;

/// The distribution `p_λ` of wavelengths over the measure Lebesgue + atoms.
#[derive(Clone, Debug)]
pub struct WavelengthDistribution {
    range_nm: [f64; 2],
    /// By wavelength; none has probability 0.
    pieces: Vec<Piece>,
    /// Cumulative probability before each, and infinity.
    starts: Vec<f64>,
    /// For u in bucket i: the first piece that may contain it.
    guide: Vec<u32>,
}

impl WavelengthDistribution {
    /// Uniform over `range_nm` (nanometers, finite and increasing), without atoms.
    #[must_use]
    pub fn uniform(range_nm: [f64; 2]) -> Self {
        Self::build(range_nm, &[], |_| 1.0, &[], 1.0)
    }

    /// One fifth uniform, the rest as x + y + z of the observer over `range_nm`; no atoms.
    #[must_use]
    pub fn visible(range_nm: [f64; 2]) -> Self {
        Self::scene(
            &[(Emission::from_curve(Curve::Constant(1.0)), 1.0)],
            range_nm,
        )
    }

    /// For a scene with these emitters, each with the weight of its power (any common unit) over
    /// `range_nm`.
    ///
    /// One fifth uniform, the rest in proportion to weight times emission times (x + y + z), lines
    /// by the same rule, each with at least 1 % of its emitter's share. Without any continuous
    /// emission there are atoms only; without any emission the distribution is uniform.
    #[must_use]
    pub fn scene(emitters: &[(Emission, f64)], range_nm: [f64; 2]) -> Self {
        let inside = |l: f64| (range_nm[0]..=range_nm[1]).contains(&l);
        let mut knots = OBSERVER_NM.to_vec();
        let mut lines: Vec<Line> = Vec::new();
        // Continuous parts with their factor, and whether they are seen (weighted by the observer).
        let mut continuous: Vec<(&Curve, f64, bool)> = Vec::new();
        for (emission, weight) in emitters {
            let own: Vec<&Line> = emission
                .lines
                .iter()
                .filter(|l| inside(l.lambda_nm) && l.value > 0.0)
                .collect();
            let factor = weight * emission.scale;
            if factor <= 0.0 || (own.is_empty() && emission.continuous.is_none()) {
                continue;
            }
            let power = |seen: bool| -> f64 {
                let response = |l: f64| if seen { cie::cmf_sum(l) } else { 1.0 };
                let smooth = emission.continuous.as_ref().map_or(0.0, |c| {
                    let mut knots = OBSERVER_NM.to_vec();
                    c.append_knots_nm(&mut knots);
                    let [power] = integrate(range_nm, &knots, |l| [c.eval(l) * response(l)]);
                    power
                });
                smooth
                    + own
                        .iter()
                        .map(|l| l.value * response(l.lambda_nm))
                        .sum::<f64>()
            };
            // An emitter that nobody sees still reaches spectral channels: it counts by its plain
            // power.
            let visible = power(true);
            let seen = visible > 0.0;
            let share = if seen { visible } else { power(false) };
            if let Some(curve) = &emission.continuous {
                curve.append_knots_nm(&mut knots);
                continuous.push((curve, factor, seen));
            }
            for line in own {
                let response = if seen {
                    cie::cmf_sum(line.lambda_nm)
                } else {
                    1.0
                };
                let value = factor * (line.value * response).max(LINE_FLOOR * share);
                lines.push(Line {
                    lambda_nm: line.lambda_nm,
                    value,
                });
            }
        }
        let lines = Emission::from_lines(lines).lines;
        let uniform_share = match (continuous.is_empty(), lines.is_empty()) {
            (true, true) => 1.0,
            (true, false) => return Self::weighted_lines(&lines),
            _ => UNIFORM_SHARE,
        };
        let density = |l: f64| {
            let seen_weight = cie::cmf_sum(l);
            let at = |&(c, factor, seen): &(&Curve, f64, bool)| {
                factor * c.eval(l).max(0.0) * if seen { seen_weight } else { 1.0 }
            };
            continuous.iter().map(at).sum()
        };
        Self::build(range_nm, &knots, density, &lines, uniform_share)
    }

    /// The same distribution with the atoms of `other`, at their probability there: so that a
    /// uniform choice finds the lines of a scene too.
    #[must_use]
    pub fn with_atoms_of(&self, other: &Self) -> Self {
        let atoms = other.atoms().map(|(nm, p)| (nm, nm, p));
        let share: f64 = other.atoms().map(|(_, p)| p).sum();
        let cells = self
            .pieces
            .iter()
            .map(|p| (p.low_nm, p.high_nm, p.probability * (1.0 - share)));
        let mut all: Vec<_> = cells.chain(atoms).collect();
        all.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.total_cmp(&q.1)));
        Self::from_masses(self.range_nm, all.into_iter())
    }

    /// The same distribution, its atoms as probable as each other and in all as before.
    #[must_use]
    pub fn with_equal_atoms(&self) -> Self {
        let count = self.atoms().count() as f64;
        let share: f64 = self.atoms().map(|(_, p)| p).sum();
        let mass = |p: &Piece| {
            if p.is_atom() {
                share / count
            } else {
                p.probability
            }
        };
        let all = self.pieces.iter().map(|p| (p.low_nm, p.high_nm, mass(p)));
        Self::from_masses(self.range_nm, all)
    }

    /// Atoms only, equally probable, at these wavelengths (nanometers, at least one; repetitions
    /// count once).
    #[must_use]
    pub fn lines(lines_nm: &[f64]) -> Self {
        let mut nm = lines_nm.to_vec();
        nm.sort_by(f64::total_cmp);
        nm.dedup();
        let lines: Vec<Line> = nm
            .into_iter()
            .map(|l| Line {
                lambda_nm: l,
                value: 1.0,
            })
            .collect();
        Self::weighted_lines(&lines)
    }

    /// Atoms only, with probabilities in proportion to their values (> 0); sorted, without
    /// repetition, at least one.
    #[must_use]
    pub fn weighted_lines(lines: &[Line]) -> Self {
        let range_nm = [lines[0].lambda_nm, lines[lines.len() - 1].lambda_nm];
        let atoms = lines.iter().map(|l| (l.lambda_nm, l.lambda_nm, l.value));
        Self::from_masses(range_nm, atoms)
    }

    /// Cells broken at `knots` and atoms; `uniform_share` uniform, the rest as `density` and the
    /// lines.
    fn build(
        range_nm: [f64; 2],
        knots: &[f64],
        density: impl Fn(f64) -> f64,
        lines: &[Line],
        uniform_share: f64,
    ) -> Self {
        let mut breaks = knots.to_vec();
        breaks.extend(lines.iter().map(|l| l.lambda_nm));
        let masses: Vec<(f64, f64, f64)> = cells(range_nm, &breaks)
            .map(|(a, b)| {
                let [mass] = over_cell((a, b), |l| [density(l)]);
                (a, b, mass)
            })
            .collect();
        let total =
            masses.iter().map(|m| m.2).sum::<f64>() + lines.iter().map(|l| l.value).sum::<f64>();
        let uniform_share = if total > 0.0 { uniform_share } else { 1.0 };
        let scale = if total > 0.0 {
            (1.0 - uniform_share) / total
        } else {
            0.0
        };
        let width = range_nm[1] - range_nm[0];
        let cells = masses
            .iter()
            .map(|&(a, b, mass)| (a, b, uniform_share * (b - a) / width + scale * mass));
        let atoms = lines
            .iter()
            .map(|l| (l.lambda_nm, l.lambda_nm, scale * l.value));
        let mut all: Vec<_> = cells.chain(atoms).collect();
        all.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.total_cmp(&q.1)));
        Self::from_masses(range_nm, all.into_iter())
    }

    /// From pieces `(low, high, mass)` by wavelength.
    fn from_masses(range_nm: [f64; 2], masses: impl Iterator<Item = (f64, f64, f64)>) -> Self {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut total = 0.0;
        for (low_nm, high_nm, probability) in masses.filter(|m| m.2 > 0.0) {
            pieces.push(Piece {
                low_nm,
                high_nm,
                inner_nm: [low_nm.next_up(), high_nm.next_down()],
                before: total,
                probability,
                nm_per_unit: 0.0,
                density: 0.0,
            });
            total += probability;
        }
        for piece in &mut pieces {
            piece.before /= total;
            piece.probability /= total;
            piece.nm_per_unit = (piece.high_nm - piece.low_nm) / piece.probability;
            piece.density = if piece.is_atom() {
                piece.probability
            } else {
                piece.probability / (piece.high_nm - piece.low_nm)
            };
        }
        let starts = pieces.iter().map(|p| p.before);
        let starts = starts.chain([f64::INFINITY]).collect();
        let guide = (0..GUIDE)
            .map(|i| {
                let u = i as f64 / GUIDE as f64;
                (pieces.partition_point(|p| p.before <= u).max(1) - 1) as u32
            })
            .collect();
        Self {
            range_nm,
            pieces,
            starts,
            guide,
        }
    }

    /// `count` lanes at `frac(u + j / count)`, j = 0, 1, ... of the inverse CDF. `u` in [0, 1).
    #[must_use]
    pub fn sample(&self, u: f64, count: usize) -> SampledWavelengths {
        debug_assert!((1..=MAX_LANES).contains(&count) && (0.0..1.0).contains(&u));
        let mut out = SampledWavelengths {
            lambda_nm: [0.0; MAX_LANES],
            pdf: [1.0; MAX_LANES],
            atoms: 0,
            count: count as u8,
        };
        for lane in 0..count {
            let rotated = u + lane as f64 / count as f64;
            let rotated = if rotated >= 1.0 {
                rotated - 1.0
            } else {
                rotated
            };
            let piece = self.piece_at(rotated);
            out.pdf[lane] = piece.density;
            out.lambda_nm[lane] = if piece.is_atom() {
                out.atoms |= 1 << lane;
                piece.low_nm
            } else {
                let lambda_nm = piece.low_nm + (rotated - piece.before) * piece.nm_per_unit;
                lambda_nm.max(piece.inner_nm[0]).min(piece.inner_nm[1])
            };
        }
        out
    }

    fn piece_at(&self, u: f64) -> &Piece {
        let mut i = self.guide[((u * GUIDE as f64) as usize).min(GUIDE - 1)] as usize;
        // most buckets have at most one start, which none foretells: a sum in place of a branch
        i += usize::from(self.starts[i + 1] <= u);
        while self.starts[i + 1] <= u {
            i += 1;
        }
        &self.pieces[i]
    }

    /// The density at `lambda_nm`: the probability if it is bitwise an atom, else per nanometer; 0
    /// out of range.
    #[must_use]
    pub fn density(&self, lambda_nm: f64) -> f64 {
        let after = self.pieces.partition_point(|p| p.low_nm <= lambda_nm);
        let candidates = self.pieces[after.saturating_sub(2)..after].iter();
        let found = candidates
            .filter(|p| lambda_nm <= p.high_nm)
            .min_by_key(|p| !p.is_atom());
        found.map_or(0.0, |p| p.density)
    }

    /// The atoms by wavelength: nanometers and probability.
    pub fn atoms(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.pieces
            .iter()
            .filter(|p| p.is_atom())
            .map(|p| (p.low_nm, p.probability))
    }

    /// First and last wavelength, nanometers.
    #[must_use]
    pub fn range_nm(&self) -> [f64; 2] {
        self.range_nm
    }

    /// Whether there is only one wavelength: then one lane says it all.
    #[must_use]
    pub fn is_single(&self) -> bool {
        self.pieces.len() == 1 && self.pieces[0].is_atom()
    }
}

#[cfg(test)]
mod tests {
    use super::super::library::Library;
    use super::*;

    const RANGE: [f64; 2] = [360.0, 830.0];

    fn named(name: &str) -> Emission {
        Library::embedded().emission(name).unwrap()
    }

    fn mixed() -> WavelengthDistribution {
        WavelengthDistribution::scene(&[(named("D65"), 1.0), (named("Hg"), 2.0)], RANGE)
    }

    fn all() -> Vec<WavelengthDistribution> {
        vec![
            WavelengthDistribution::uniform([400.5, 700.25]),
            WavelengthDistribution::visible(RANGE),
            mixed(),
            WavelengthDistribution::scene(&[(named("Na"), 1.0)], RANGE),
            WavelengthDistribution::scene(&[], RANGE),
            WavelengthDistribution::scene(&[(named("A"), 1.0)], [300.0, 2500.0]),
            WavelengthDistribution::lines(&[587.5618, 486.1327, 587.5618]),
        ]
    }

    #[test]
    fn the_densities_integrate_to_one() {
        for d in all() {
            let atoms: f64 = d.atoms().map(|a| a.1).sum();
            let breaks: Vec<f64> = d.pieces.iter().map(|p| p.low_nm).collect();
            let cells: f64 =
                if d.range_nm[0] < d.range_nm[1] && d.pieces.iter().any(|p| !p.is_atom()) {
                    cells(d.range_nm, &breaks)
                        .map(|(a, b)| (b - a) * d.density(0.5 * (a + b)))
                        .sum()
                } else {
                    0.0
                };
            assert!((atoms + cells - 1.0).abs() < 1e-12, "{atoms} {cells}");
        }
    }

    #[test]
    fn every_lane_inverts_the_cumulative_distribution() {
        for d in all() {
            for i in 0..2000 {
                let u = (f64::from(i) + 0.37) / 2000.0;
                let s = d.sample(u, 8);
                for lane in 0..8 {
                    let (lambda, v) = (s.lambda_nm(lane), (u + lane as f64 / 8.0).fract());
                    assert_eq!(s.pdf(lane), d.density(lambda));
                    assert_eq!(s.is_line(lane), d.atoms().any(|a| a.0 == lambda));
                    let low: f64 = d
                        .pieces
                        .iter()
                        .map(|p| {
                            if p.is_atom() {
                                if p.low_nm < lambda {
                                    p.probability
                                } else {
                                    0.0
                                }
                            } else {
                                let width = p.high_nm - p.low_nm;
                                let part = ((lambda - p.low_nm) / width).clamp(0.0, 1.0);
                                p.probability * part
                            }
                        })
                        .sum();
                    let jump = if s.is_line(lane) { s.pdf(lane) } else { 0.0 };
                    assert!(
                        low - 1e-9 <= v && v <= low + jump + 1e-9,
                        "{lambda} {v} {low} {jump}"
                    );
                }
            }
        }
    }

    #[test]
    fn stratified_sampling_estimates_integrals_without_bias() {
        // Midpoint rule over u with n points: the error of the estimate is O(1 / n) per jump.
        let d = mixed();
        let n = 200_000;
        let (mut power, mut hg) = (0.0, 0.0);
        let (d65, lamp) = (named("D65"), named("Hg"));
        for i in 0..n {
            let s = d.sample((f64::from(i) + 0.5) / f64::from(n), 1);
            power += f64::from(d65.sample(&s)[0]) / s.pdf(0);
            hg += f64::from(lamp.sample(&s)[0]) / s.pdf(0);
        }
        let want_hg: f64 = lamp.lines.iter().map(|l| l.value).sum();
        let want: f64 = (0..4700)
            .map(|i| 0.1 * d65.density(360.05 + 0.1 * f64::from(i)))
            .sum();
        assert!((power / f64::from(n) / want - 1.0).abs() < 1e-3);
        assert!((hg / f64::from(n) / want_hg - 1.0).abs() < 3e-3);
    }

    #[test]
    fn the_scene_rule_holds() {
        let d = mixed();
        assert_eq!(d.atoms().count(), 11);
        // Uniform floor everywhere, 80 % shared by power.
        assert!((360..830).all(|l| d.density(f64::from(l) + 0.3) >= 0.2 / 470.0 * (1.0 - 1e-12)));
        let seen = |emission: &Emission| {
            let lines = emission.lines.iter();
            let lines: f64 = lines.map(|l| l.value * cie::cmf_sum(l.lambda_nm)).sum();
            let smooth = emission.continuous.as_ref().map_or(0.0, |c| {
                integrate(RANGE, &c.knots_nm(), |l| [c.eval(l) * cie::cmf_sum(l)])[0]
            });
            emission.scale * (lines + smooth)
        };
        let (d65, hg) = (seen(&named("D65")), 2.0 * seen(&named("Hg")));
        let floored: f64 = hg
            + named("Hg")
                .lines
                .iter()
                .map(|l| (0.01 * hg - 2.0 * l.value * cie::cmf_sum(l.lambda_nm)).max(0.0))
                .sum::<f64>();
        let atoms: f64 = d.atoms().map(|a| a.1).sum();
        assert!(
            (atoms / (0.8 * floored / (floored + d65)) - 1.0).abs() < 1e-4,
            "{atoms}"
        );
        for (_, p) in d.atoms() {
            assert!(p >= 0.8 * 0.01 * hg / (floored + d65) * (1.0 - 1e-4));
        }
        // 546 nm against 365 nm: by power, with the floor below.
        assert!(d.density(546.0735) > 10.0 * d.density(365.0153));
    }

    #[test]
    fn equal_atoms_keep_their_share() {
        let d = mixed();
        let even = d.with_equal_atoms();
        let share = |d: &WavelengthDistribution| d.atoms().map(|a| a.1).sum::<f64>();
        assert!((share(&even) - share(&d)).abs() < 1e-12);
        let each = share(&d) / 11.0;
        assert!(even.atoms().all(|(_, p)| (p - each).abs() < 1e-12));
        assert!((even.density(600.25) / d.density(600.25) - 1.0).abs() < 1e-12);
        // without lines nothing changes
        let smooth = WavelengthDistribution::uniform(RANGE).with_equal_atoms();
        assert!((smooth.density(500.0) * 470.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn lines_alone_make_atoms_alone() {
        let d = WavelengthDistribution::scene(&[(named("Na"), 1.0)], RANGE);
        assert_eq!(d.pieces.len(), 2);
        let single = WavelengthDistribution::lines(&[587.5618]);
        assert!(single.is_single() && !d.is_single());
        assert_eq!(single.density(587.5618), 1.0);
        assert_eq!(single.density(587.5), 0.0);
        let s = WavelengthDistribution::lines(&[486.1, 656.3]).sample(0.1, 4);
        assert_eq!(s.multiplicity(0), 2);
        assert!((0..4).all(|lane| s.is_line(lane) && s.pdf(lane) == 0.5));
        // An invisible emitter still gets its wavelengths.
        let infrared = Emission::from_lines(vec![Line {
            lambda_nm: 1064.0,
            value: 1.0,
        }]);
        let d = WavelengthDistribution::scene(&[(infrared, 1.0)], [360.0, 1100.0]);
        assert!(d.is_single());
        assert_eq!(
            WavelengthDistribution::uniform([400.0, 500.0]).density(399.0),
            0.0
        );
    }
}
