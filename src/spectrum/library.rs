//! Spectra and refractive indices by name.
//!
//! The files of `spectra/` are built into the program; a folder with the same layout overrides and
//! adds. Names are the same in upper and lower case. Sources and licenses are at the top of each
//! file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use strsim::levenshtein;

use thiserror::Error;

use super::embedded::{FILES, columns};
use super::emission::Line;
use super::read::{MAX_FILE_BYTES, parse_table};
use super::vendors::parse_vendors;
use super::{Curve, Emission, Ior};

pub use super::read::{
    SpectrumFileError, fuzz_curve, fuzz_glass, parse_curve_csv, parse_glass_toml,
};

/// Folders a library is read from.
const FOLDERS: [&str; 5] = ["cie", "emission", "glass", "metal", "reflectance"];

static EMBEDDED: LazyLock<Library> = LazyLock::new(|| {
    let mut library = Library {
        spectra: BTreeMap::new(),
        glasses: BTreeMap::new(),
        by_full_name: BTreeSet::new(),
    };
    for (path, text) in FILES {
        library
            .add(Path::new(path), text)
            .expect("invariant: the built-in spectra are well formed");
    }
    library
});

/// Why a named thing was not found or a folder not read.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// No such name.
    #[error("unknown {kind} `{name}`{}", did_you_mean(suggestions))]
    Unknown {
        /// Kind of the entry that was looked for.
        kind: &'static str,
        /// The name as given.
        name: String,
        /// Near names, nearest first.
        suggestions: Vec<String>,
    },
    /// A bare name in several catalogs.
    #[error("`{name}` is in several catalogs: {}", candidates.join(", "))]
    Ambiguous {
        /// The name as given.
        name: String,
        /// The full names.
        candidates: Vec<String>,
    },
    /// Lines where a continuous spectrum is needed.
    #[error("`{0}` is made of lines and cannot be used as a continuous spectrum")]
    Lines(String),
    /// A file with an error in it.
    #[error("{}:{error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Fault and its place.
        error: SpectrumFileError,
    },
    /// A file or folder that cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
}

fn did_you_mean(suggestions: &[String]) -> String {
    match suggestions {
        [] => String::new(),
        names => format!(" (did you mean {}?)", names.join(", ")),
    }
}

#[derive(Clone, Debug)]
enum Spectrum {
    Curve(Curve),
    Lines(Vec<Line>),
}

/// Named spectra and refractive indices.
#[derive(Clone, Debug)]
pub struct Library {
    /// By lower-case name, with the name as written.
    spectra: BTreeMap<String, (String, Spectrum)>,
    /// By lower-case `catalog:name`.
    glasses: BTreeMap<String, Ior>,
    /// Those of `glasses` that give way to others of the same bare name.
    by_full_name: BTreeSet<String>,
}

impl Library {
    /// Library that is built in.
    #[must_use]
    pub fn embedded() -> &'static Self {
        &EMBEDDED
    }

    /// Library that is built in, overridden and extended by the files of `folder` (layout as
    /// `spectra/`), if any.
    ///
    /// # Errors
    /// If the folder or a file in it cannot be read or is not well formed.
    pub fn with_folder(folder: Option<&Path>) -> Result<Self, LibraryError> {
        let mut library = Self::embedded().clone();
        let Some(folder) = folder else {
            return Ok(library);
        };
        let io_error = |path: &Path| {
            let path = path.to_owned();
            move |source| LibraryError::Io { path, source }
        };
        std::fs::read_dir(folder).map_err(io_error(folder))?;
        for name in FOLDERS {
            let inner = folder.join(name);
            if !inner.is_dir() {
                continue;
            }
            let mut paths = Vec::new();
            for entry in std::fs::read_dir(&inner).map_err(io_error(&inner))? {
                paths.push(entry.map_err(io_error(&inner))?.path());
            }
            paths.sort();
            for path in paths {
                if !path
                    .extension()
                    .is_some_and(|e| ["csv", "toml", "txt"].iter().any(|x| e == *x))
                {
                    continue;
                }
                let size = std::fs::metadata(&path).map_err(io_error(&path))?.len();
                if size > MAX_FILE_BYTES as u64 {
                    let message = format!("the file is larger than {MAX_FILE_BYTES} bytes");
                    let error = SpectrumFileError {
                        line: 1,
                        column: 1,
                        message,
                    };
                    return Err(LibraryError::File { path, error });
                }
                let text = std::fs::read_to_string(&path).map_err(io_error(&path))?;
                library
                    .add(&path, &text)
                    .map_err(|error| LibraryError::File { path, error })?;
            }
        }
        Ok(library)
    }

    fn add(&mut self, path: &Path, text: &str) -> Result<(), SpectrumFileError> {
        if path.extension().is_some_and(|e| e == "toml") {
            for glass in parse_glass_toml(text)? {
                self.add_glass(glass);
            }
            return Ok(());
        }
        if path.extension().is_some_and(|e| e == "txt") {
            for glass in parse_vendors(text)? {
                self.by_full_name.insert(glass.name().to_lowercase());
                self.add_glass(glass);
            }
            return Ok(());
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let table = parse_table(text)?;
        let single = table.columns.len() == 1;
        if single && table.columns[0].0 == "line" {
            let rows = table.nm.iter().zip(&table.columns[0].1);
            let lines = rows
                .map(|(&lambda_nm, &value)| Line { lambda_nm, value })
                .collect();
            self.spectra.insert(
                stem.to_lowercase(),
                (stem.into_owned(), Spectrum::Lines(lines)),
            );
            return Ok(());
        }
        for (column, curve) in columns(table) {
            let name = if single {
                stem.to_string()
            } else {
                format!("{stem}/{column}")
            };
            self.spectra
                .insert(name.to_lowercase(), (name, Spectrum::Curve(curve)));
        }
        Ok(())
    }

    /// Adds a refractive index under its name, in place of one of the same name.
    pub fn add_glass(&mut self, ior: Ior) {
        self.glasses.insert(ior.name().to_lowercase(), ior);
    }

    fn spectrum(&self, name: &str) -> Result<&Spectrum, LibraryError> {
        match self.spectra.get(&name.to_lowercase()) {
            Some((_, spectrum)) => Ok(spectrum),
            None => Err(LibraryError::Unknown {
                kind: "spectrum",
                name: name.to_owned(),
                suggestions: suggestions(name, self.spectrum_names()),
            }),
        }
    }

    /// A continuous spectrum: `D65`, `colorchecker/red`.
    ///
    /// # Errors
    /// If there is none of this name, or it is made of lines.
    pub fn curve(&self, name: &str) -> Result<Curve, LibraryError> {
        match self.spectrum(name)? {
            Spectrum::Curve(curve) => Ok(curve.clone()),
            Spectrum::Lines(_) => Err(LibraryError::Lines(name.to_owned())),
        }
    }

    /// A spectrum as emission, continuous or of lines, in the unit of its file (illuminants: 100 at
    /// 560 nm; [`Emission::with_luminance`] makes it absolute).
    ///
    /// # Errors
    /// If there is none of this name.
    pub fn emission(&self, name: &str) -> Result<Emission, LibraryError> {
        Ok(match self.spectrum(name)? {
            Spectrum::Curve(curve) => Emission::from_curve(curve.clone()),
            Spectrum::Lines(lines) => Emission::from_lines(lines.clone()),
        })
    }

    /// A refractive index: `schott:N-SF11`, or `N-SF11` where only one catalog has it; metals by
    /// symbol, `Au`.
    ///
    /// A bare name never means a glass of `glass/vendors.txt` if another file has one of that name.
    ///
    /// # Errors
    /// If there is none of this name, or several.
    pub fn ior(&self, name: &str) -> Result<Ior, LibraryError> {
        let key = name.trim().to_lowercase();
        if let Some(ior) = self.glasses.get(&key) {
            return Ok(ior.clone());
        }
        let bare = |full: &str| full.split_once(':').map_or(full, |p| p.1).to_owned();
        let named: Vec<_> = self.glasses.iter().filter(|g| bare(g.0) == key).collect();
        let first: Vec<&Ior> = named
            .iter()
            .filter(|g| !self.by_full_name.contains(g.0))
            .map(|g| g.1)
            .collect();
        let matches = if first.is_empty() {
            named.iter().map(|g| g.1).collect()
        } else {
            first
        };
        match matches.as_slice() {
            [ior] => Ok((*ior).clone()),
            [] => {
                let names: Vec<String> = if key.contains(':') {
                    self.glasses().map(|g| g.name().to_owned()).collect()
                } else {
                    self.glasses().map(|g| bare(g.name())).collect()
                };
                Err(LibraryError::Unknown {
                    kind: "glass",
                    name: name.to_owned(),
                    suggestions: suggestions(name, names.iter().map(String::as_str)),
                })
            }
            several => Err(LibraryError::Ambiguous {
                name: name.to_owned(),
                candidates: several.iter().map(|g| g.name().to_owned()).collect(),
            }),
        }
    }

    /// A glass of a lens file: `name` in the first of `catalogs` that has it, else in the only
    /// catalog that does. Qualified names are taken as they are. Metals and other materials are no
    /// glasses of a bare name.
    ///
    /// # Errors
    /// If there is none of this name, or several.
    pub fn glass_in(&self, name: &str, catalogs: &[String]) -> Result<Ior, LibraryError> {
        if name.contains(':') {
            return self.ior(name);
        }
        let full = |catalog: &str| format!("{catalog}:{name}").to_lowercase();
        if let Some(ior) = catalogs.iter().find_map(|c| self.glasses.get(&full(c))) {
            return Ok(ior.clone());
        }
        let everywhere = self.catalogs().into_iter().filter(|c| c != "metal");
        let found: Vec<&Ior> = everywhere
            .filter_map(|c| self.glasses.get(&full(&c)))
            .collect();
        match found.as_slice() {
            [ior] => Ok((*ior).clone()),
            [] => self.ior(name),
            several => Err(LibraryError::Ambiguous {
                name: name.to_owned(),
                candidates: several.iter().map(|g| g.name().to_owned()).collect(),
            }),
        }
    }

    /// The catalogs that glasses are qualified with, sorted.
    #[must_use]
    pub fn catalogs(&self) -> Vec<String> {
        let names: BTreeSet<&str> = self
            .glasses
            .keys()
            .filter_map(|k| Some(k.split_once(':')?.0))
            .collect();
        names.into_iter().map(str::to_owned).collect()
    }

    /// Refractive indices whose name or provenance holds `text`, in any case.
    pub fn search(&self, text: &str) -> impl Iterator<Item = &Ior> {
        let text = text.to_lowercase();
        self.glasses.values().filter(move |ior| {
            ior.name().to_lowercase().contains(&text) || ior.source().to_lowercase().contains(&text)
        })
    }

    /// Names of the spectra, sorted.
    pub fn spectrum_names(&self) -> impl Iterator<Item = &str> {
        self.spectra.values().map(|(name, _)| name.as_str())
    }

    /// The refractive indices, sorted by `catalog:name`.
    pub fn glasses(&self) -> impl Iterator<Item = &Ior> {
        self.glasses.values()
    }
}

/// Up to three of `candidates` that differ from `name` by few edits (a third of its length, at
/// least 2).
#[must_use]
pub fn suggestions<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Vec<String> {
    let limit = (name.chars().count() / 3).max(2);
    let mut near: Vec<(usize, &str)> = candidates
        .map(|c| (levenshtein(&name.to_lowercase(), &c.to_lowercase()), c))
        .filter(|(distance, _)| *distance <= limit)
        .collect();
    near.sort_unstable();
    near.dedup();
    near.into_iter()
        .take(3)
        .map(|(_, c)| c.to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case() {
        let library = Library::embedded();
        assert!((library.curve("d65").unwrap().eval(560.0) - 100.0).abs() < 1e-12);
        assert_eq!(library.curve("A").unwrap().eval(560.0), 100.0);
        assert!(library.curve("colorchecker/Red").is_ok());
        assert_eq!(library.emission("hg").unwrap().lines.len(), 11);
        assert_eq!(
            library.ior("n-sf11").unwrap(),
            library.ior("SCHOTT:N-SF11").unwrap()
        );
        assert_eq!(library.ior("au").unwrap().name(), "metal:Au");
        let patches = library
            .spectrum_names()
            .filter(|n| n.starts_with("colorchecker/"));
        assert_eq!(patches.count(), 24);
    }

    #[test]
    fn unknown_names_come_with_near_ones() {
        let library = Library::embedded();
        let text = |e: LibraryError| e.to_string();
        assert!(text(library.ior("N-BK8").unwrap_err()).contains("N-BK7"));
        assert!(text(library.ior("schot:N-SF11").unwrap_err()).contains("schott:N-SF11"));
        assert!(text(library.curve("D66").unwrap_err()).contains("D65"));
        assert_eq!(
            text(library.curve("nothing-like-it").unwrap_err()),
            "unknown spectrum `nothing-like-it`"
        );
        assert!(matches!(library.curve("Hg"), Err(LibraryError::Lines(_))));
    }

    #[test]
    fn glasses_of_lens_files_come_from_their_catalogs() {
        let library = Library::embedded();
        let from = |name: &str, catalogs: &[&str]| {
            let catalogs: Vec<String> = catalogs.iter().map(|c| (*c).to_owned()).collect();
            library
                .glass_in(name, &catalogs)
                .map(|ior| ior.name().to_owned())
        };
        assert_eq!(from("f2", &["HIKARI", "SCHOTT"]).unwrap(), "hikari:F2");
        assert_eq!(from("F2", &["schott"]).unwrap(), "schott:F2");
        assert_eq!(from("N-LAF34", &[]).unwrap(), "schott:N-LAF34");
        assert!(matches!(
            from("F2", &[]),
            Err(LibraryError::Ambiguous { .. })
        ));
        assert!(from("Al", &["schott"]).is_ok_and(|n| n == "metal:Al"));
        assert!(from("N-LAF99", &["schott"]).is_err());
        // in a scene, a bare name means what it meant before there were six makers
        assert_eq!(library.ior("F2").unwrap().name(), "schott:F2");
        assert_eq!(library.ior("FCD1").unwrap().name(), "hoya:FCD1");
        assert!(
            library
                .search("acrylic")
                .any(|g| g.name() == "material:PMMA")
        );
        let catalogs = [
            "cdgm", "hikari", "hoya", "material", "metal", "ohara", "schott", "sumita",
        ];
        assert_eq!(library.catalogs(), catalogs);
    }

    #[test]
    fn a_folder_overrides_and_adds() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write("cie/D65.csv", "400,1\n");
        write("reflectance/brick.csv", "nm,value\n400,0.1\n700,0.5\n");
        write(
            "glass/mine.toml",
            "catalog = \"mine\"\n[[glass]]\nname = \"F2\"\nnk_um = [[0.5, 1.6, 0.0]]\n",
        );
        let library = Library::with_folder(Some(folder.path())).unwrap();
        assert_eq!(library.curve("D65").unwrap().eval(500.0), 1.0);
        assert!((library.curve("brick").unwrap().eval(550.0) - 0.3).abs() < 1e-12);
        assert!(matches!(
            library.ior("F2"),
            Err(LibraryError::Ambiguous { .. })
        ));
        assert_eq!(library.ior("mine:f2").unwrap().n(500.0), 1.6);
        write("reflectance/bad.csv", "400,x\n");
        let error = Library::with_folder(Some(folder.path())).unwrap_err();
        assert!(error.to_string().contains("bad.csv:1:5:"), "{error}");
        assert!(Library::with_folder(Some(&folder.path().join("missing"))).is_err());
    }
}
