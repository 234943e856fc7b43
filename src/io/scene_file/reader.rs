//! The reader: what the parts of a scene file share while they are read. Nothing stops at the first
//! problem; a part that cannot be made sense of is left out, and its uses are not reported too.

use super::document::{Node, Source};
use super::error::{Place, Problem, SceneFileErrors, number_text};
use super::keys::Range;
use super::material::MaterialFacts;
use super::model::Unread;
use super::render::VISIBLE_NM;
use super::shape::Placed;
use super::spectrum::Spectrum;
use super::value::{At, FileName, MediumName};
use crate::film::Filter;
use crate::geometry::Shutter;
use crate::io::files::{self, FileProblem};
use crate::math::hash::{combine, hash_bytes};
use crate::medium::MediumId;
use crate::scene::Subject;
use crate::scene::settings::FilterKind;
use crate::spectrum::library::{Library, LibraryError};
use crate::texture::Image;
use std::collections::BTreeMap;
use std::ops::Range as Span;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeString, DeValue};

/// Further problems of a file are counted only.
pub const MAX_ERRORS: usize = 100;

/// Things by name; `None` where the definition is wrong, which has been reported.
pub type Definitions<T> = BTreeMap<String, Option<T>>;
/// Files, each at its moment: what a mesh is made of.
pub type MeshKey = Vec<(u64, PathBuf)>;

/// State of a reading: what it gathers and looks up.
pub struct Reader<'s> {
    source: &'s Source,
    /// Where files are looked for; `None`: there are none.
    folder: Option<&'s Path>,
    /// The spectra and glasses that are built in.
    pub library: &'static Library,
    /// Metres per unit of length.
    pub unit_m: f64,
    /// Working range of wavelengths; `None` where the file does not say it in a readable way.
    pub range_nm: Option<[f64; 2]>,
    /// Filter of sensors that name none, and its radius in pixels.
    pub filter: (Option<FilterKind>, Option<f64>),
    /// From the first sensor to open to the last to close.
    pub shutter: Option<Shutter>,
    /// Name of the medium where no solid is.
    pub ambient: Option<At<MediumName>>,
    /// `[spectrum.NAME]`.
    pub spectra: Definitions<Spectrum>,
    /// `[medium.NAME]` by name.
    pub media: BTreeMap<String, MediumId>,
    /// `[material.NAME]`.
    pub materials: Definitions<MaterialFacts>,
    /// `[mesh.NAME]`.
    pub meshes: Definitions<Placed>,
    /// Meshes that have been read; `None` where they could not.
    pub mesh_files: BTreeMap<MeshKey, Option<Placed>>,
    /// Images by file, encoding and whether with a pyramid; `None` where they could not be read.
    pub images: BTreeMap<(PathBuf, bool, bool), Option<Arc<Image>>>,
    /// `[[model]]`, which are read last.
    pub models: Vec<Unread>,
    /// Index of the material of objects that name none.
    pub black: u32,
    /// Whether anything has a motion.
    pub moves: bool,
    /// Warnings of what is legal but surely not meant.
    pub warnings: Vec<String>,
    /// Notes on what was not understood of other files, one line each.
    pub notes: Vec<String>,
    /// The media that emissions, lights and sensors are said to be in.
    pub named_media: Vec<(Subject, MediumId)>,
    /// Those of sensors, by index, which are looked up once media are known.
    pub sensor_media: Vec<(usize, At<MediumName>)>,
    /// Hashes of the files that were read, in the order in which they are named.
    pub file_hashes: Vec<u64>,
    /// Number of these when `[[object]]` is reached.
    pub files_before_objects: usize,
    hash_of_file: BTreeMap<PathBuf, u64>,
    /// Files that models name.
    pub model_files: Vec<PathBuf>,
    errors: Vec<(Span<usize>, Problem)>,
    error_count: usize,
}

impl<'s> Reader<'s> {
    /// A reader of a document whose files are in `folder`; `None`: every file is missing.
    pub fn new(source: &'s Source, folder: Option<&'s Path>) -> Self {
        Self {
            source,
            folder,
            library: Library::embedded(),
            unit_m: 1.0,
            range_nm: Some(VISIBLE_NM),
            filter: (None, None),
            shutter: None,
            ambient: None,
            spectra: BTreeMap::new(),
            media: BTreeMap::new(),
            materials: BTreeMap::new(),
            meshes: BTreeMap::new(),
            mesh_files: BTreeMap::new(),
            images: BTreeMap::new(),
            models: Vec::new(),
            black: 0,
            moves: false,
            warnings: Vec::new(),
            notes: Vec::new(),
            named_media: Vec::new(),
            sensor_media: Vec::new(),
            file_hashes: Vec::new(),
            files_before_objects: 0,
            hash_of_file: BTreeMap::new(),
            model_files: Vec::new(),
            errors: Vec::new(),
            error_count: 0,
        }
    }

    /// All problems so far; `None` when there are none.
    pub fn into_errors(self) -> Option<SceneFileErrors> {
        let more = self.error_count - self.errors.len();
        let told = self.errors.into_iter();
        let told = told.map(|(at, problem)| self.source.error(&at, problem));
        SceneFileErrors::from_unsorted(told.collect(), more)
    }

    /// The place of a byte of the file.
    pub fn place(&self, offset: usize) -> Place {
        self.source.place(offset)
    }

    /// Number of problems so far.
    pub fn error_count(&self) -> usize {
        self.error_count
    }

    /// Reports a problem. It is worked out only if it will be told.
    pub fn error(&mut self, at: &Span<usize>, problem: impl FnOnce() -> Problem) {
        self.error_count += 1;
        if self.errors.len() < MAX_ERRORS {
            self.errors.push((at.clone(), problem()));
        }
    }

    /// Reports keys that contradict each other.
    pub fn conflict(&mut self, at: &Span<usize>, message: impl Into<String>) {
        self.error(at, || Problem::Conflict(message.into()));
    }

    /// Reports a value of another type than expected.
    pub fn wrong_type(&mut self, node: Node<'_>, expected: &str) {
        let found = match node.get_ref() {
            DeValue::String(s) => format!("string {s:?}"),
            DeValue::Integer(n) => format!("integer \"{n}\""),
            DeValue::Float(x) => format!("floating point \"{x}\""),
            DeValue::Boolean(b) => format!("boolean \"{b}\""),
            DeValue::Datetime(_) => "date".to_owned(),
            DeValue::Array(_) => "array".to_owned(),
            DeValue::Table(_) => "table".to_owned(),
        };
        self.error(&node.span(), || {
            Problem::Form(format!("invalid type: {found}, expected {expected}"))
        });
    }

    /// Reports a list of another length than expected.
    pub fn wrong_length(&mut self, node: Node<'_>, length: usize, expected: &str) {
        self.error(&node.span(), || {
            Problem::Form(format!("invalid length {length}, expected {expected}"))
        });
    }

    /// Reports a number that is not allowed.
    pub fn out_of_range(
        &mut self,
        what: &str,
        value: String,
        at: &Span<usize>,
        allowed: &'static str,
    ) {
        self.error(at, || Problem::Range {
            what: what.to_owned(),
            value,
            allowed,
        });
    }

    /// Reports a number outside its range.
    pub fn in_range(&mut self, what: &str, value: f64, at: &Span<usize>, range: Range) {
        if !range.contains(value) {
            self.out_of_range(what, number_text(value), at, range.text);
        }
    }

    /// Reports a name that the library does not know, or knows as something else.
    pub fn not_in_library(&mut self, at: &Span<usize>, error: LibraryError) {
        self.error(at, || match error {
            LibraryError::Unknown {
                kind,
                name,
                suggestions,
            } => Problem::Unknown {
                what: kind,
                name,
                suggestion: suggestions.into_iter().next(),
                known: Vec::new(),
            },
            other => Problem::Conflict(other.to_string()),
        });
    }

    /// Reports a file that was found but cannot be used.
    pub fn bad_file(&mut self, name: &At<FileName>, message: impl Into<String>) {
        let problem = FileProblem::Bad {
            path: name.value.0.clone(),
            message: message.into(),
        };
        self.error(&name.at, || problem.into());
    }

    /// Notes what the reader of a file has to say about it.
    pub fn file_notes(&mut self, name: &At<FileName>, notes: Vec<String>) {
        let said = notes
            .into_iter()
            .map(|note| format!("{}: {note}", name.value.0));
        self.notes.extend(said);
    }

    /// The path of a file, which must be in the folder of the scene and of at most `limit` bytes.
    pub fn find(&mut self, name: &At<FileName>, limit: u64) -> Option<PathBuf> {
        let missing = || FileProblem::Missing(name.value.0.clone());
        let found = self.folder.ok_or_else(missing);
        match found.and_then(|folder| files::find(folder, &name.value.0, limit)) {
            Ok(path) => Some(path),
            Err(problem) => {
                self.error(&name.at, || problem.into());
                None
            }
        }
    }

    /// The bytes of a file that was found, which enter the hash of the scene.
    pub fn bytes(&mut self, name: &At<FileName>, path: &Path) -> Option<Vec<u8>> {
        match files::read_regular(path, u64::MAX) {
            Ok(bytes) => {
                let hash = hash_of(&bytes);
                self.hash_of_file.insert(path.to_owned(), hash);
                self.file_hashes.push(hash);
                Some(bytes)
            }
            Err(error) => {
                self.bad_file(name, error.to_string());
                None
            }
        }
    }

    /// Files that were read.
    pub fn files(&self) -> Vec<PathBuf> {
        let named = self.hash_of_file.keys().cloned();
        named.chain(self.model_files.iter().cloned()).collect()
    }

    /// Notes that a file which has been read before is named again.
    pub fn named_again(&mut self, path: &Path) {
        self.file_hashes.extend(self.hash_of_file.get(path));
    }

    /// Rows of a table of numbers: of `N` columns, the first ascending.
    pub fn csv<const N: usize>(&mut self, name: &At<FileName>) -> Option<Vec<[f64; N]>> {
        let path = self.find(name, files::MAX_CSV_BYTES)?;
        let bytes = self.bytes(name, &path)?;
        match files::read_csv(&bytes) {
            Ok(rows) => Some(rows),
            Err(message) => {
                self.bad_file(name, message);
                None
            }
        }
    }

    /// The definition of a name; `None` where it is wrong. Reports a name that is not defined.
    pub fn defined<T: Clone>(
        &mut self,
        what: &'static str,
        name: &str,
        at: &Span<usize>,
        definitions: impl Fn(&Self) -> &BTreeMap<String, T>,
    ) -> Option<T> {
        let found = definitions(self).get(name).cloned();
        if found.is_none() {
            let known: Vec<String> = if self.errors.len() < MAX_ERRORS {
                definitions(self).keys().cloned().collect()
            } else {
                Vec::new()
            };
            let known = known.iter().map(String::as_str);
            self.error(at, || Problem::unknown(what, name, known));
        }
        found
    }

    /// The filter of a sensor: what it names, else what the file does, else the default of its
    /// kind.
    pub fn film_filter(
        &self,
        kind: Option<FilterKind>,
        radius: Option<f64>,
        is_detector: bool,
    ) -> Filter {
        match (kind.or(self.filter.0), radius.or(self.filter.1)) {
            (Some(FilterKind::Box), _) => Filter::Box,
            (None, _) if is_detector => Filter::Box,
            (Some(FilterKind::Tent), radius) => Filter::Tent {
                radius: radius.unwrap_or(1.0),
            },
            (_, None) => Filter::default(),
            (_, Some(radius)) => Filter::Gaussian {
                sigma: radius / 3.0,
                radius,
            },
        }
    }
}

/// The definitions of `[section.NAME]`, each read on its own.
pub fn definitions<T>(
    node: Node<'_>,
    cx: &mut Reader<'_>,
    mut read: impl FnMut(&str, Node<'_>, &mut Reader<'_>) -> Option<T>,
) -> Option<Definitions<T>> {
    let Some(table) = node.get_ref().as_table() else {
        cx.wrong_type(node, "a table");
        return None;
    };
    let each = |(name, node): (&Spanned<DeString<'_>>, _)| {
        let name = name.get_ref().as_ref();
        (name.to_owned(), read(name, node, cx))
    };
    Some(table.iter().map(each).collect())
}

/// The hash of a file, in blocks of 64 KiB.
fn hash_of(bytes: &[u8]) -> u64 {
    let blocks = bytes.chunks(1 << 16);
    blocks.fold(0, |hash, block| combine(hash, hash_bytes(block)))
}
