//! The parts of a job: which chunks are done, blocks that become one, and what is damaged.

use super::blocks::{Block, outermost};
use super::folder::{Folder, check_unlinked, modified, random_name};
use super::{Chunks, JobError};
use crate::io::atomic::{FileError, remove_left_behind};
use crate::io::part::{self, Part, PartError, PartHeader};
use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::time::Duration;

/// How often a merge begins anew because other processes have merged its parts.
const TRIES: usize = 20;

/// A part that was moved to `damaged/`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damaged {
    /// Chunks of the part, which are to be rendered again.
    pub block: Block,
    /// Where it is now.
    pub path: PathBuf,
    /// Fault, in words.
    pub message: String,
}

/// Result of reading a block.
enum Found {
    Part(Box<Part>),
    /// None any more: it has become part of a larger one.
    Gone,
    Damaged(Damaged),
}

fn name(block: &Block) -> String {
    format!("{:08}-{:08}.part", block.start, block.end)
}

fn parse(text: &str, chunks: &Chunks) -> Option<Block> {
    let (start, end) = text.strip_suffix(".part")?.split_once('-')?;
    let block = Block {
        start: start.parse().ok()?,
        end: end.parse().ok()?,
    };
    (name(&block) == text && chunks.is_block(&block)).then_some(block)
}

impl Folder {
    /// The blocks that there are parts of, those within others included.
    pub(super) fn blocks(&self) -> Result<Vec<Block>, JobError> {
        let chunks = self.manifest.chunks();
        let names = self.names("parts")?;
        Ok(names.iter().filter_map(|n| parse(n, &chunks)).collect())
    }

    fn part_path(&self, block: &Block) -> PathBuf {
        self.at("parts").join(name(block))
    }

    /// Writes the part of a block. Where it is there already, it becomes the same again.
    pub(super) fn put(&self, block: &Block, part: &Part) -> Result<(), PartError> {
        part::write_packed(&self.part_path(block), part)
    }

    /// Whether there is a part of a block.
    fn is_there(&self, block: &Block) -> bool {
        self.part_path(block).symlink_metadata().is_ok()
    }

    /// Whether there is a part that holds a block.
    pub(super) fn is_done(&self, block: &Block) -> bool {
        // upward: what becomes part of a larger block meanwhile is found there
        let chunks = self.manifest.chunks();
        chunks.holders(block).any(|holder| self.is_there(&holder))
    }

    /// Reads the part of a block; moves it out of the way where it is not as it has to be.
    fn take(&self, block: &Block) -> Result<Found, JobError> {
        let path = self.part_path(block);
        let found = check_unlinked(&path).map_err(|e| PartError::from(FileError::new(&path, e)));
        let expected = self.manifest.header_of(block);
        let check = |header: &PartHeader| part::check_identical(&expected, header);
        let read = found.and_then(|_| part::read_as(&path, check));
        let error = match read {
            Ok(read) => return Ok(Found::Part(Box::new(read))),
            Err(error) => error,
        };
        match &error {
            PartError::File(e) if e.source.kind() == ErrorKind::NotFound => Ok(Found::Gone),
            // a disk that does not answer says nothing of the file
            PartError::File(e) if e.source.kind() != ErrorKind::InvalidInput => Err(error.into()),
            _ => self.set_aside(block, &error).map(Found::Damaged),
        }
    }

    /// Moves a part to `damaged/`; its chunks are free again.
    fn set_aside(&self, block: &Block, error: &PartError) -> Result<Damaged, JobError> {
        let from = self.part_path(block);
        let to = self
            .at("damaged")
            .join(format!("{}.{}", name(block), random_name()));
        match fs::rename(&from, &to) {
            // somebody else has done so
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            moved => moved.map_err(|e| FileError::new(&from, e))?,
        }
        block.chunks().for_each(|chunk| self.release_all(chunk));
        Ok(Damaged {
            block: *block,
            path: to,
            message: error.to_string(),
        })
    }

    /// The sum of all parts that are there, one after the other; `None` without any. Damaged ones
    /// are set aside and told.
    ///
    /// # Errors
    /// The folder cannot be read, or sums overflow.
    pub fn sum(&self, mut damaged: impl FnMut(&Damaged)) -> Result<Option<Part>, JobError> {
        for _ in 0..TRIES {
            let blocks = outermost(&self.blocks()?);
            if blocks.is_empty() {
                return Ok(None);
            }
            if let Some(sum) = self.sum_of(&blocks, &mut damaged)? {
                return Ok(Some(sum));
            }
        }
        Err(JobError::Restless(self.path().to_owned()))
    }

    /// The sum of these blocks; `None` where one of them is not there any more.
    fn sum_of(
        &self,
        blocks: &[Block],
        damaged: &mut impl FnMut(&Damaged),
    ) -> Result<Option<Part>, JobError> {
        let mut is_whole = true;
        let parts = blocks.iter().map_while(|block| {
            match self.take(block) {
                Ok(Found::Part(part)) => return Some(Ok(*part)),
                Ok(Found::Gone) => {}
                Ok(Found::Damaged(found)) => damaged(&found),
                Err(error) => return Some(Err(error)),
            }
            is_whole = false;
            None
        });
        let sum = match part::merge_each(parts) {
            // the first was gone
            Err(JobError::Part(PartError::Empty)) => return Ok(None),
            sum => sum?,
        };
        Ok(is_whole.then_some(sum))
    }

    /// Makes one part of four wherever the blocks that hold `block` are complete.
    pub(super) fn merge_up(
        &self,
        mut block: Block,
        damaged: &mut impl FnMut(&Damaged),
    ) -> Result<(), JobError> {
        let chunks = self.manifest.chunks();
        while let Some(parent) = chunks.parent(&block) {
            let children = chunks.children(&parent);
            if self.is_done(&parent) || !children.iter().all(|child| self.is_there(child)) {
                return Ok(());
            }
            match self.sum_of(&children, damaged)? {
                Some(sum) => self.put(&parent, &sum)?,
                None => return Ok(()),
            }
            block = parent;
        }
        Ok(())
    }

    /// Removes parts that larger ones hold, with the claims of their chunks: those that hold them
    /// must be so old, so that who has begun to read the small ones, or has seen neither, can
    /// finish. Removes temporary files of killed workers, too.
    ///
    /// # Errors
    /// The folder cannot be read, or not be written at all.
    pub fn sweep(&self, age: Duration) -> Result<(), JobError> {
        for folder in ["parts", "workers"] {
            remove_left_behind(&self.at(folder));
        }
        let all = self.blocks()?;
        let outer = outermost(&all);
        if all.len() == outer.len() {
            return Ok(());
        }
        let now = self.now()?;
        for holder in outer {
            let mut held = all
                .iter()
                .filter(|b| **b != holder && holder.holds(b))
                .peekable();
            if held.peek().is_none() {
                continue;
            }
            let written = modified(&self.part_path(&holder)).ok();
            let is_old = written
                .and_then(|at| now.duration_since(at).ok())
                .is_some_and(|old| old >= age);
            if is_old {
                for block in held {
                    if block.len() == 1 {
                        self.release_all(block.start);
                    }
                    // one that stays does no harm
                    _ = fs::remove_file(self.part_path(block));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_parts_are_exact() {
        let chunks = Chunks {
            passes: 40,
            size: 2,
        };
        let block = Block { start: 4, end: 8 };
        assert_eq!(name(&block), "00000004-00000008.part");
        assert_eq!(parse("00000004-00000008.part", &chunks), Some(block));
        for bad in [
            "00000004-00000007.part",
            "00000016-00000024.part",
            "4-8.part",
            "00000004-00000008.part.lock",
            "+0000004-00000008.part",
            ".abbe-a.tmp",
        ] {
            assert_eq!(parse(bad, &chunks), None, "{bad}");
        }
    }
}
