//! The vertices of all light sub-paths of a pass, as merging needs them, in a hash grid.
//!
//! A vertex takes 10 words of 4 bytes and one per lane: its position, apart so that a search reads
//! little else, and a record of direction, the three sums of [`SideTerms`], what names it, and
//! weight. Whatever else a slow sum may need is found by tracing the sub-path again.
//!
//! Invariant: a function of the sub-paths and the order in which they were added, not of the
//! threads that traced them.

use super::class::PathClass;
use super::connect::Receiver;
use super::context::PathContext;
use super::density::NO_COLUMN;
use super::merge::{MergeSide, SideTerms, side_terms};
use super::strategies::StrategySet;
use super::subpath::Subpath;
use glam::DVec3;

/// Bits of the number of a sub-path: a film has at most 2^28 pixels.
const PATH_BITS: u32 = 28;
/// Bits of the depth; deeper vertices are not stored.
const DEPTH_BITS: u32 = 10;
/// Labels kept for the class of a path; those of vertices farther from the light count as
/// non-specular.
const LABEL_BITS: u32 = 23;

/// Identity and flags of a stored vertex, packed into 64 bits from the low end in the order of the
/// fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Info {
    /// Number of the sub-path.
    path: u32,
    /// Scattering vertices before this one.
    depth: u32,
    /// Bit i: vertex i of the sub-path is specular.
    labels: u32,
    /// [`SideTerms::dispersive`].
    dispersive: bool,
    /// [`SideTerms::first_shared`].
    first_shared: bool,
    /// Densities of the sub-path differ between lanes.
    columns: bool,
}

impl Info {
    fn pack(self) -> u64 {
        let fields = [
            (self.path, PATH_BITS),
            (self.depth, DEPTH_BITS),
            (self.labels, LABEL_BITS),
            (self.dispersive.into(), 1),
            (self.first_shared.into(), 1),
            (self.columns.into(), 1),
        ];
        let mut shift = 0;
        fields.into_iter().fold(0, |bits, (field, width)| {
            let placed = u64::from(field) << shift;
            shift += width;
            bits | placed
        })
    }

    fn unpack(mut bits: u64) -> Self {
        let mut take = |width: u32| {
            let field = bits & ((1 << width) - 1);
            bits >>= width;
            field as u32
        };
        Self {
            path: take(PATH_BITS),
            depth: take(DEPTH_BITS),
            labels: take(LABEL_BITS),
            dispersive: take(1) == 1,
            first_shared: take(1) == 1,
            columns: take(1) == 1,
        }
    }
}

/// Words of a record before its weight.
const HEAD: usize = 7;

/// The record of a stored vertex of a light sub-path.
#[derive(Clone, Copy, Debug)]
pub struct Photon<'a> {
    /// Unit direction towards the previous vertex on the unfolded octahedron; the three sums;
    /// sub-path, depth, labels and flags from the low end.
    head: &'a [u32; HEAD],
    weight: &'a [u32],
}

/// Bytes of a stored vertex with `lanes` wavelengths, its place in the index included.
#[must_use]
pub fn bytes_per_vertex(lanes: usize) -> usize {
    size_of::<[f32; 3]>() + (HEAD + lanes) * size_of::<u32>() + size_of::<u32>()
}

impl<'a> Photon<'a> {
    /// From a whole record.
    fn new(record: &'a [u32]) -> Option<Self> {
        let (head, weight) = record.split_first_chunk()?;
        Some(Self { head, weight })
    }

    fn number(&self, i: usize) -> f64 {
        f32::from_bits(self.head[i]).into()
    }

    fn info(&self) -> Info {
        Info::unpack(u64::from(self.head[5]) | u64::from(self.head[6]) << 32)
    }

    /// Weight per lane.
    pub fn weight(&self) -> impl Iterator<Item = f32> + 'a {
        self.weight.iter().map(|&bits| f32::from_bits(bits))
    }

    /// Unit direction towards the previous vertex.
    #[must_use]
    pub fn toward_previous(&self) -> DVec3 {
        let (x, y) = (self.number(0), self.number(1));
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
    }

    /// The terms of the techniques on its side.
    #[must_use]
    pub fn terms(&self) -> SideTerms {
        let info = self.info();
        SideTerms {
            first: self.number(2),
            rest: self.number(3),
            rest_shared: self.number(4),
            first_shared: info.first_shared,
            dispersive: info.dispersive,
        }
    }

    /// The number of its sub-path.
    #[must_use]
    pub fn path(&self) -> u32 {
        self.info().path
    }

    /// Scattering vertices before it.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.info().depth as usize
    }

    /// Whether densities of its sub-path differ between lanes, which its sums leave out.
    #[must_use]
    pub fn has_columns(&self) -> bool {
        self.info().columns
    }

    /// The labels of the vertices before it.
    #[must_use]
    pub fn class(&self) -> PathClass {
        let info = self.info();
        let mut class = PathClass::new();
        for i in 0..info.depth {
            class.push(i < LABEL_BITS && info.labels & (1 << i) != 0);
        }
        class
    }
}

/// Where a unit direction lies on the octahedron, its lower half folded out.
fn octahedral(w: DVec3) -> [f32; 2] {
    let w = w / (w.x.abs() + w.y.abs() + w.z.abs());
    let (x, y) = if w.z >= 0.0 {
        (w.x, w.y)
    } else {
        (
            (1.0 - w.y.abs()).copysign(w.x),
            (1.0 - w.x.abs()).copysign(w.y),
        )
    };
    [x as f32, y as f32]
}

/// Stored vertices in the order of their sub-paths.
#[derive(Debug, Default)]
pub struct PhotonBuffer {
    /// From the center of the map, in meters.
    positions: Vec<[f32; 3]>,
    /// As [`Photon`] reads them.
    records: Vec<u32>,
}

impl PhotonBuffer {
    /// Number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether it holds nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Empties it; its memory is kept.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.records.clear();
    }

    /// Makes room for `factor` times what it holds.
    pub fn reserve_times(&mut self, factor: usize) {
        let more = factor.saturating_sub(1);
        self.positions.reserve(self.positions.len() * more);
        self.records.reserve(self.records.len() * more);
    }

    /// Adds the vertices of another.
    pub fn append(&mut self, other: &Self) {
        self.positions.extend_from_slice(&other.positions);
        self.records.extend_from_slice(&other.records);
    }

    /// Adds a vertex by its offset from the center.
    fn push(
        &mut self,
        offset: DVec3,
        toward_previous: DVec3,
        terms: &SideTerms,
        info: Info,
        weight: &[f32],
    ) {
        let single = |v: f64| (v as f32).min(f32::MAX);
        let [x, y] = octahedral(toward_previous);
        let numbers = [
            x,
            y,
            single(terms.first),
            single(terms.rest),
            single(terms.rest_shared),
        ];
        let info = Info {
            dispersive: terms.dispersive,
            first_shared: terms.first_shared,
            ..info
        }
        .pack();
        self.positions.push(offset.as_vec3().to_array());
        self.records.extend(numbers.map(f32::to_bits));
        self.records.extend([info as u32, (info >> 32) as u32]);
        self.records.extend(weight.iter().map(|w| w.to_bits()));
    }

    /// Adds the vertices of a light sub-path at which paths can be merged.
    pub fn add(
        &mut self,
        context: &PathContext,
        strategies: &StrategySet,
        light: &Subpath,
        path: u32,
    ) {
        let Some(id) = light.light else { return };
        let source = context.scene.light(id);
        let direct = light.direct / light.densities[0].own;
        let count = context.count();
        let (mut labels, mut columns) = (0_u32, false);
        for (i, vertex) in light.vertices.iter().enumerate().take(1 << DEPTH_BITS) {
            columns |= light.densities[i + 1].own_column != NO_COLUMN;
            if i >= 1 {
                columns |= light.densities[i - 1].other_column != NO_COLUMN;
            }
            let weight = vertex
                .throughput
                .lanes
                .map(|v| (f64::from(v) * vertex.throughput.scale) as f32);
            let usable = vertex.has_non_specular
                && vertex.sides_agree(vertex.toward_previous)
                && !weight.is_black(count)
                && weight.0[..count].iter().all(|v| v.is_finite());
            if usable {
                let factor = light.factor_before(i, || {
                    let receiver =
                        Receiver::of_light(source, &light.origin, vertex.toward_previous);
                    receiver.factor(vertex.distance)
                });
                let densities = &light.densities[..i + 2];
                let terms = side_terms(densities, factor, MergeSide::Light { direct }, strategies);
                self.push(
                    vertex.p - context.scene.accel.center(),
                    vertex.toward_previous,
                    &terms,
                    Info {
                        path,
                        depth: i as u32,
                        labels,
                        columns,
                        ..Info::default()
                    },
                    &weight.0[..count],
                );
            }
            if i < LABEL_BITS as usize && light.densities[i + 1].label.is_specular() {
                labels |= 1 << i;
            }
        }
    }
}

/// Cells of a block along each axis, as a power of 2.
const BLOCK_BITS: u32 = 2;
/// Cells of a block.
const BLOCK: usize = 1 << (3 * BLOCK_BITS);

/// Photons sorted between two looks at whether to go on.
const CANCELLED_EVERY: usize = 1 << 16;

/// All stored vertices of a pass, by the cells of a grid. The grid is cut into blocks of 4 x 4 x 4
/// cells; a hash finds the place of a block, so that neighbors in space are mostly neighbors in
/// memory.
#[derive(Debug)]
pub struct PhotonMap {
    photons: PhotonBuffer,
    /// Words of a record.
    stride: usize,
    /// First photon of each bucket, and the end of the last.
    starts: Vec<u32>,
    center: DVec3,
    radius: f64,
}

impl PhotonMap {
    /// Sorts stored vertices into a grid of cells 2 `radius` wide; `lanes` wavelengths per photon.
    /// Takes no memory beyond what is held after it. `None` beyond 2^32 - 1 photons. Where
    /// `is_cancelled` says so, the map is left unsorted, of no use to anyone.
    #[must_use]
    pub fn build(
        mut buffer: PhotonBuffer,
        lanes: usize,
        center: DVec3,
        radius: f64,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Option<Self> {
        u32::try_from(buffer.len()).ok()?;
        buffer.positions.shrink_to_fit();
        buffer.records.shrink_to_fit();
        let blocks = buffer.len().div_ceil(BLOCK).max(1);
        let mut map = Self {
            starts: vec![0; blocks * BLOCK + 1],
            photons: buffer,
            stride: HEAD + lanes,
            center,
            radius,
        };
        map.sort(is_cancelled);
        Some(map)
    }

    /// Brings the photons into the order of their buckets, in place.
    fn sort(&mut self, is_cancelled: &dyn Fn() -> bool) {
        let mut steps = 0_usize;
        let mut stops = || {
            steps += 1;
            steps.is_multiple_of(CANCELLED_EVERY) && is_cancelled()
        };
        for i in 0..self.len() {
            if stops() {
                return;
            }
            let bucket = self.bucket_of(i);
            self.starts[bucket] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // buckets are filled from their ends; all places before i are final
        for i in 0..self.len() {
            loop {
                let bucket = self.bucket_of(i);
                if stops() {
                    return;
                }
                if i >= self.starts[bucket] as usize {
                    break;
                }
                self.starts[bucket] -= 1;
                self.swap(i, self.starts[bucket] as usize);
            }
        }
    }

    fn swap(&mut self, i: usize, j: usize) {
        let PhotonBuffer { positions, records } = &mut self.photons;
        positions.swap(i, j);
        for word in 0..self.stride {
            records.swap(i * self.stride + word, j * self.stride + word);
        }
    }

    /// The offset of photon `i` from the center.
    fn offset(&self, i: usize) -> DVec3 {
        DVec3::from_array(self.photons.positions[i].map(f64::from))
    }

    /// The cell of an offset from the center.
    fn cell(&self, offset: DVec3) -> [i64; 3] {
        (offset / (2.0 * self.radius))
            .floor()
            .to_array()
            .map(|v| v as i64)
    }

    fn bucket_of(&self, i: usize) -> usize {
        self.bucket(self.cell(self.offset(i)))
    }

    /// The place of a cell: that of its block, and one in it. Blocks that share a place are
    /// unlikely to have it for like cells.
    fn bucket(&self, cell: [i64; 3]) -> usize {
        let [x, y, z] = cell.map(|v| (v >> BLOCK_BITS) as u64);
        let mixed = x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(21)
            ^ z.wrapping_mul(0x1656_67b1_9e37_79f9).rotate_left(42);
        let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let blocks = (self.starts.len() / BLOCK) as u64;
        let block = ((mixed >> 32) * blocks) >> 32;
        let [x, y, z] = cell.map(|v| v as usize & ((1 << BLOCK_BITS) - 1));
        let inner = (z << BLOCK_BITS | y) << BLOCK_BITS | x;
        block as usize * BLOCK + (inner ^ (mixed as usize % BLOCK))
    }

    /// Number of photons.
    #[must_use]
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.photons.positions.capacity() * size_of::<[f32; 3]>()
            + (self.photons.records.capacity() + self.starts.capacity()) * size_of::<u32>())
            as u64
    }

    /// Calls `f` for every photon nearer to `p` than the radius, in an order that is always the
    /// same.
    pub fn for_each_near(&self, p: DVec3, mut f: impl FnMut(&Photon)) {
        let offset = p - self.center;
        let [x, y, z] = self.cell(offset - self.radius);
        // look all eight buckets up first, so that their cache misses overlap
        let ranges: [(u32, u32); 8] = std::array::from_fn(|i| {
            let i = i as i64;
            let bucket = self.bucket([x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)]);
            (self.starts[bucket], self.starts[bucket + 1])
        });
        for (i, &(start, end)) in ranges.iter().enumerate() {
            // cells may share a bucket
            if ranges[..i].contains(&(start, end)) {
                continue;
            }
            for index in start as usize..end as usize {
                let distance = self.offset(index) - offset;
                if distance.length_squared() < self.radius * self.radius {
                    let first = index * self.stride;
                    let record = &self.photons.records[first..first + self.stride];
                    Photon::new(record).iter().for_each(&mut f);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use std::collections::BTreeSet;

    fn random(count: usize) -> PhotonBuffer {
        let number = |i: usize, k: u64| unit_f64(random_bits(i as u64, k));
        let mut buffer = PhotonBuffer::default();
        for i in 0..count {
            let offset = DVec3::from_array([0, 1, 2].map(|k| 4.0 * number(i, k) - 2.0));
            let info = Info {
                path: i as u32,
                depth: i as u32 % 7,
                ..Info::default()
            };
            buffer.push(
                offset,
                DVec3::Z,
                &SideTerms::default(),
                info,
                &[i as f32, 0.5],
            );
        }
        buffer
    }

    #[test]
    fn a_stored_vertex_is_as_small_as_said() {
        let map = PhotonMap::build(random(6400), 2, DVec3::ZERO, 0.1, &|| false).expect("few");
        // one place more ends the last bucket
        assert_eq!(map.bytes(), 6400 * bytes_per_vertex(2) as u64 + 4);
        assert_eq!(bytes_per_vertex(4), 60);
    }

    #[test]
    fn the_grid_finds_what_a_search_through_all_finds() {
        let center = DVec3::new(10.0, -3.0, 5.0);
        for radius in [0.03, 0.2, 1.5] {
            let all = random(3000);
            let map = PhotonMap::build(random(3000), 2, center, radius, &|| false).expect("few");
            assert_eq!(map.len(), 3000);
            let mut total = 0;
            for i in 0..300 {
                let position = |i: usize| DVec3::from_array(all.positions[i].map(f64::from));
                let at = position(i) + DVec3::splat(0.3 * radius);
                let near = |&i: &u32| position(i as usize).distance(at) < radius;
                let expected: BTreeSet<u32> = (0..3000).filter(near).collect();
                let mut found = BTreeSet::new();
                map.for_each_near(center + at, |photon| {
                    assert!(found.insert(photon.path()), "found twice");
                    assert_eq!(photon.depth(), photon.path() as usize % 7);
                    let weight: Vec<f32> = photon.weight().collect();
                    assert_eq!(weight, [photon.path() as f32, 0.5]);
                });
                assert_eq!(found, expected);
                total += found.len();
            }
            assert!(total >= 300);
        }
    }

    #[test]
    fn packing_keeps_every_field_at_its_largest() {
        let info = Info {
            path: (1 << PATH_BITS) - 1,
            depth: (1 << DEPTH_BITS) - 1,
            labels: (1 << LABEL_BITS) - 1,
            dispersive: true,
            first_shared: true,
            columns: true,
        };
        assert_eq!(info.pack(), u64::MAX);
        let one_clear = [
            Info { path: 5, ..info },
            Info { depth: 5, ..info },
            Info { labels: 5, ..info },
            Info {
                dispersive: false,
                ..info
            },
            Info {
                first_shared: false,
                ..info
            },
            Info {
                columns: false,
                ..info
            },
        ];
        for info in one_clear {
            assert_eq!(Info::unpack(info.pack()), info);
        }
    }

    #[test]
    fn directions_sums_and_labels_survive_storage() {
        let random = (0..1000).map(|i| {
            let number = |k| 2.0 * unit_f64(random_bits(i, k)) - 1.0;
            // two roundings to f32
            (
                DVec3::new(number(0), number(1), number(2)).normalize(),
                3e-7,
            )
        });
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|w| [(w, 1e-300), (-w, 1e-300)]);
        for (w, tolerance) in random.chain(axes.into_iter().flatten()) {
            let terms = SideTerms {
                first: 0.5,
                rest: 4.0,
                rest_shared: 2.0,
                first_shared: w.x > 0.0,
                dispersive: w.y > 0.0,
            };
            let info = Info {
                depth: 3,
                labels: 0b101,
                ..Info::default()
            };
            let mut buffer = PhotonBuffer::default();
            buffer.push(DVec3::ZERO, w, &terms, info, &[1.0]);
            let photon = Photon::new(&buffer.records).expect("a record");
            assert!(photon.toward_previous().distance(w) < tolerance);
            assert_eq!(photon.class().to_string(), "LSDSE");
            assert_eq!(photon.terms(), terms);
            assert!(!photon.has_columns());
        }
    }

    #[test]
    fn an_empty_map_holds_nothing() {
        let map = PhotonMap::build(PhotonBuffer::default(), 4, DVec3::ZERO, 0.1, &|| false)
            .expect("none");
        assert!(map.is_empty());
        map.for_each_near(DVec3::ONE, |_| panic!("found"));
    }
}
