//! Path classes: `L`, then `S` (specular) or `D` (anything else) for each scattering vertex, then
//! `E`.

use super::density::PathView;
use std::fmt;

/// The labels of a path's scattering vertices from the light to the sensor; beyond 64 vertices
/// every one is called `D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PathClass {
    length: u32,
    /// Bit i: vertex i (from the light) is specular.
    specular: u64,
}

impl PathClass {
    /// The class with no scattering vertex (`LE`).
    #[must_use]
    pub const fn new() -> Self {
        Self::rough(0)
    }

    /// The class of `length` vertices of which none is specular.
    #[must_use]
    pub const fn rough(length: u32) -> Self {
        Self {
            length,
            specular: 0,
        }
    }

    /// The class of a path.
    #[must_use]
    pub fn of(path: &PathView) -> Self {
        let mut class = Self::new();
        for i in 1..path.len().saturating_sub(1) {
            class.push(path.is_specular(i));
        }
        class
    }

    /// One more vertex on the sensor side.
    pub fn push(&mut self, specular: bool) {
        if specular && self.length < 64 {
            self.specular |= 1 << self.length;
        }
        self.length += 1;
    }

    /// Number of scattering vertices.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.length
    }

    /// Number of the class among all of at most so many vertices that it fits: its labels as binary
    /// digits behind a leading 1.
    pub(super) fn number(&self) -> usize {
        1 << self.length | self.specular as usize
    }

    /// Whether each vertex is specular, from the light on.
    pub fn labels(&self) -> impl Iterator<Item = bool> {
        let specular = self.specular;
        (0..self.length).map(move |i| i < 64 && specular & (1 << i) != 0)
    }

    /// Whether any vertex is specular.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        self.specular != 0
    }
}

impl fmt::Display for PathClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("L")?;
        for i in 0..self.length {
            f.write_str(if i < 64 && self.specular & (1 << i) != 0 {
                "S"
            } else {
                "D"
            })?;
        }
        f.write_str("E")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spells_labels_from_the_light() {
        let mut class = PathClass::new();
        class.push(true);
        class.push(false);
        assert_eq!(class.to_string(), "LSDE");
        assert_eq!(class.depth(), 2);
    }
}
