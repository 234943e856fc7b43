//! Part files: the exact sums of a film after some passes, to be added to others or resumed.
//!
//! Integer sums: any order of merging gives the same bits. A part may also hold what is done of one
//! pass that is not whole: no image shows it, only a render that goes on uses it. Where detectors
//! share light sub-paths, one part holds the films of all of them, for they have the same passes.

mod format;
mod merge;
mod spectral;

pub use format::{fuzz_part, is_part, read, read_as, write, write_packed};
pub use merge::{check_identical, merge, merge_each};
pub use spectral::SpectralFilm;

use super::atomic::FileError;
use super::identity;
use crate::film::{Blocks, Crop, Film};
use crate::render::pass::{tile_count, tile_pixels};
use crate::render::{PilotPasses, Render, Session, UnfinishedPass};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The two half buffers of a film.
const HALVES: u64 = 2;
const MAX_CHANNELS: u32 = 4096;

/// Passes `start..end` that were rendered with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassRange {
    /// Seed.
    pub seed: u64,
    /// First pass.
    pub start: u64,
    /// One past the last pass.
    pub end: u64,
}

/// Quantity that the sums are of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartHeader {
    /// Program version, for messages.
    pub version: String,
    /// Hash of the scene.
    pub scene_hash: u64,
    /// Hash of all settings that change the estimate but seed and passes.
    pub settings_hash: u64,
    /// Name of the sensor.
    pub sensor: String,
    /// Columns of the whole film.
    pub width: u32,
    /// Rows of the whole film.
    pub height: u32,
    /// Rendered part: x0, y0, x1, y1.
    pub crop: [u32; 4],
    /// Channels per pixel.
    pub channels: u32,
    /// Blocks of the pixels whose samples have brought the light of a detector: each half of a film
    /// has sums by them behind its own ([`Film::with_sources`]).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub blocks: u32,
    /// The sums count multiples of 2^(exponent − 64).
    pub exponent: i32,
    /// Passes per group of the pilot that found the variance factors of the weights; 0: by rule, or
    /// none.
    pub pilot: u32,
    /// Settings as the image tells them: attribute and text.
    pub image: BTreeMap<String, String>,
    /// Passes in the sums: sorted, disjoint, not touching.
    pub passes: Vec<PassRange>,
    /// A pass that is not whole, which has sums of its own.
    pub unfinished: Option<UnfinishedName>,
    /// Further films of the same passes, whose sums follow.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub companions: Vec<CompanionFilm>,
    /// Channels of spectral films, if they are held: the sums of each sensor's stand behind those
    /// of its image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral: Option<SpectralFilm>,
}

/// A detector that the light sub-paths of another one have filled: its film, where it differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompanionFilm {
    /// Hash of all settings that change the estimate but seed and passes.
    pub settings_hash: u64,
    /// Name of the sensor.
    pub sensor: String,
    /// Columns of the film, all of which is rendered.
    pub width: u32,
    /// Rows of the film.
    pub height: u32,
    /// Passes per group of the pilot, as of the part.
    pub pilot: u32,
    /// Settings as the image tells them: attribute and text.
    pub image: BTreeMap<String, String>,
}

impl CompanionFilm {
    /// Of the header of its own render.
    #[must_use]
    pub fn of(header: PartHeader) -> Self {
        let PartHeader {
            settings_hash,
            sensor,
            width,
            height,
            pilot,
            image,
            ..
        } = header;
        Self {
            settings_hash,
            sensor,
            width,
            height,
            pilot,
            image,
        }
    }
}

/// Name of a pass that is not whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnfinishedName {
    /// Seed.
    pub seed: u64,
    /// Index.
    pub pass: u32,
}

impl PartHeader {
    /// The rendered part of the film.
    #[must_use]
    pub fn crop(&self) -> Crop {
        let [x0, y0, x1, y1] = self.crop;
        Crop { x0, y0, x1, y1 }
    }

    /// Number of passes in the sums.
    #[must_use]
    pub fn pass_count(&self) -> u64 {
        self.passes
            .iter()
            .map(|p| p.end - p.start)
            .fold(0, u64::saturating_add)
    }

    /// Number of sums of the image of the sensor, those of companions and spectral films left out;
    /// `None` beyond 64 bits.
    #[must_use]
    pub fn image_sum_count(&self) -> Option<u64> {
        let places = self.places(&self.crop())?;
        let sums = places.checked_mul(self.channels.into())?;
        sums.checked_mul(HALVES)
    }

    /// Pixels and blocks of a film.
    fn places(&self, crop: &Crop) -> Option<u64> {
        crop.pixels().checked_add(self.blocks.into())
    }

    /// Number of sums; `None` beyond 64 bits.
    #[must_use]
    pub fn sum_count(&self) -> Option<u64> {
        let spectral = self.spectral.as_ref();
        let channels = u64::from(self.channels) + spectral.map_or(0, SpectralFilm::count);
        let companions = self.companions.iter();
        let companions = companions.map(|film| Crop::whole(film.width, film.height));
        let mut films = std::iter::once(self.crop()).chain(companions);
        let places = films.try_fold(0, |sum: u64, film| sum.checked_add(self.places(&film)?))?;
        places.checked_mul(channels)?.checked_mul(HALVES)
    }

    /// Headers of its films, each as that of a part of its own.
    #[must_use]
    pub fn each(&self) -> Vec<Self> {
        let lead = Self {
            companions: Vec::new(),
            ..self.clone()
        };
        let companions = self.companions.iter().map(|film| Self {
            settings_hash: film.settings_hash,
            sensor: film.sensor.clone(),
            width: film.width,
            height: film.height,
            crop: [0, 0, film.width, film.height],
            pilot: film.pilot,
            image: film.image.clone(),
            unfinished: None,
            ..lead.clone()
        });
        std::iter::once(lead.clone()).chain(companions).collect()
    }

    /// Whether it can be that of a part.
    ///
    /// # Errors
    /// Fault, in words.
    pub fn check(&self) -> Result<(), &'static str> {
        let [x0, y0, x1, y1] = self.crop;
        if x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height {
            return Err("the crop is empty or outside the film");
        }
        if self
            .companions
            .iter()
            .any(|f| f.width == 0 || f.height == 0)
        {
            return Err("the film of a companion is empty");
        }
        if self.channels == 0 || self.channels > MAX_CHANNELS {
            return Err("the number of channels is not 1 to 4096");
        }
        if self.blocks > Blocks::MOST {
            return Err("the number of blocks is not 0 to 64");
        }
        if let Some(spectral) = &self.spectral {
            spectral.check()?;
        }
        if !(-512..=512).contains(&self.exponent) {
            return Err("the exponent of the sums is not -512 to 512");
        }
        if self.passes.iter().any(|p| p.start >= p.end) {
            return Err("a range of passes is empty");
        }
        // passes are counted in 32 bits
        if self.passes.iter().any(|p| p.end > u64::from(u32::MAX)) {
            return Err("a pass is beyond 2^32 - 2");
        }
        let apart = |w: &[PassRange]| {
            w[0].seed < w[1].seed || w[0].seed == w[1].seed && w[0].end < w[1].start
        };
        if !self.passes.windows(2).all(apart) {
            return Err("ranges of passes are not sorted and apart");
        }
        let holds = |u: &UnfinishedName| {
            let within = |p: &PassRange| (p.start..p.end).contains(&u64::from(u.pass));
            self.passes.iter().any(|p| p.seed == u.seed && within(p))
        };
        if self.unfinished.as_ref().is_some_and(holds) {
            return Err("a pass is whole and unfinished");
        }
        Ok(())
    }
}

fn is_zero(n: &u32) -> bool {
    *n == 0
}

/// A part: header and sums.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Quantity that the sums are of.
    pub header: PartHeader,
    /// Fixed-point sums, film by film, half by half, row by row and then block by block, channels
    /// innermost.
    pub sums: Vec<i128>,
    /// The pass that is not whole, if the header names one.
    pub unfinished: Option<UnfinishedPass>,
}

impl Part {
    /// The films, each as a part of its own, with whole passes alone.
    #[must_use]
    pub fn each(self) -> Vec<Self> {
        let Self { header, sums, .. } = self;
        let mut headers = header.each();
        if headers.len() == 1 {
            let header = headers.remove(0);
            return vec![Self {
                header: PartHeader {
                    unfinished: None,
                    ..header
                },
                sums,
                unfinished: None,
            }];
        }
        let mut sums = sums.into_iter();
        let film = |header: PartHeader| {
            let count = header.sum_count().unwrap_or(0) as usize;
            Self {
                header: PartHeader {
                    unfinished: None,
                    ..header
                },
                sums: sums.by_ref().take(count).collect(),
                unfinished: None,
            }
        };
        headers.into_iter().map(film).collect()
    }

    fn check(&self) -> Result<(), String> {
        self.header.check()?;
        if self.header.sum_count() != Some(self.sums.len() as u64) {
            return Err(format!("{} sums do not fit the header", self.sums.len()));
        }
        let named = self.header.unfinished.map(|name| name.pass);
        if named != self.unfinished.as_ref().map(|found| found.pass) {
            return Err("the unfinished pass is not the one of the header".to_owned());
        }
        if let Some(UnfinishedPass { done, sums, .. }) = &self.unfinished {
            let crop = self.header.crop();
            let within = |(all, done): (u16, &u16)| *done <= all;
            let fits =
                tile_count(&crop) == done.len() as u64 && tile_pixels(&crop).zip(done).all(within);
            if !fits || 2 * sums.len() != self.sums.len() {
                return Err("the pixels done of the unfinished pass do not fit the film".to_owned());
            }
        }
        Ok(())
    }
}

/// Why parts could not be read, written or merged.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a part file, or a broken one.
    #[error("{}: not a valid part file ({message})", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// A render that is not the one that the part is of.
    #[error("{}: cannot resume: {message}", path.display())]
    Resume {
        /// The file.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// Parts that do not belong together.
    #[error("parts differ in {what}: {first} and {second}")]
    Mismatch {
        /// Setting that differs.
        what: &'static str,
        /// In the first part.
        first: String,
        /// In the other one.
        second: String,
    },
    /// The same passes twice.
    #[error("passes {}..{} of seed {} are in more than one part", .0.start, .0.end, .0.seed)]
    Overlap(PassRange),
    /// Nothing to merge.
    #[error("no parts to merge")]
    Empty,
    /// Sums left the range of 128 bits.
    #[error("the sums overflow")]
    Overflow,
}

/// The part that a session has done.
#[must_use]
pub fn of(session: &Session) -> Part {
    let render = session.render();
    let unfinished = session.unfinished();
    let seed = render.settings().seed;
    Part {
        header: PartHeader {
            unfinished: unfinished.as_ref().map(|found| UnfinishedName {
                seed,
                pass: found.pass,
            }),
            ..header_of(&render)
        },
        sums: render
            .and_companions()
            .flat_map(|film| film.outputs().part_films())
            .flat_map(Film::sums)
            .collect(),
        unfinished,
    }
}

/// Header of the part of a render and its companions.
#[must_use]
pub fn header_of(render: &Render) -> PartHeader {
    let companions = render.companions().iter().map(identity::header);
    PartHeader {
        companions: companions.map(CompanionFilm::of).collect(),
        spectral: (render.outputs().spectral.as_ref()).map(|(c, _)| SpectralFilm::of(c)),
        ..identity::header(render)
    }
}

/// A part with which a session is to go on.
#[derive(Debug)]
pub struct Resumed {
    path: PathBuf,
    part: Part,
    /// Pilot of the session, so that its weights are those of the part.
    pub pilot: PilotPasses,
}

impl Resumed {
    /// Reads a part.
    ///
    /// # Errors
    /// The file cannot be read or is not a valid part.
    pub fn read(path: &Path) -> Result<Self, PartError> {
        let (path, part) = (path.to_owned(), read(path)?);
        let named = part.header.pilot;
        match PilotPasses::known(named) {
            Some(pilot) => Ok(Self { path, part, pilot }),
            None => Err(PartError::Resume {
                path,
                message: format!("it names a pilot of {named} passes"),
            }),
        }
    }

    /// Adds the passes of the part to a session, which will not do them again.
    ///
    /// # Errors
    /// The part is one of another render.
    pub fn restore(self, session: &mut Session) -> Result<(), PartError> {
        let Self { path, part, .. } = self;
        restore(session, part).map_err(|message| PartError::Resume { path, message })
    }
}

/// Names of the companions.
fn sensors(header: &PartHeader) -> impl Iterator<Item = &String> {
    header.companions.iter().map(|film| &film.sensor)
}

fn restore(session: &mut Session, part: Part) -> Result<(), String> {
    let Part {
        header,
        sums,
        unfinished,
    } = part;
    let (expected, seed) = {
        let render = session.render();
        (header_of(&render), render.settings().seed)
    };
    let seeds = header.passes.iter().map(|p| p.seed);
    let mut seeds = seeds.chain(header.unfinished.map(|u| u.seed));
    if seeds.any(|s| s != seed) {
        return Err(format!("it holds passes of another seed than {seed}"));
    }
    let expected = PartHeader {
        passes: header.passes.clone(),
        unfinished: header.unfinished,
        ..expected
    };
    if header != expected {
        let what = [
            ("version of the program", header.version == expected.version),
            ("scene", header.scene_hash == expected.scene_hash),
            ("sensor", header.sensor == expected.sensor),
            (
                "set of detectors (--together)",
                sensors(&header).eq(sensors(&expected)),
            ),
            ("crop", header.crop == expected.crop),
            (
                "spectral image (--spectral)",
                header.spectral == expected.spectral,
            ),
        ];
        let what = what.iter().find(|w| !w.1).map_or("settings", |w| w.0);
        return Err(format!("it was made with another {what}"));
    }
    let ranges = header.passes.iter().map(|p| p.start..p.end);
    let passes: Vec<u32> = ranges.flatten().map(|p| p as u32).collect();
    session
        .restore(&passes, &sums)
        .and_then(|()| unfinished.map_or(Ok(()), |pass| session.restore_unfinished(pass)))
        .map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests;
