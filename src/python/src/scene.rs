//! Scenes: what is read, the keys that were set, and what was built of both.

use super::attend::pool;
use abbe::io::loaded::{Loaded, build};
use abbe::io::scene_file::{self, SceneFileErrors};
use abbe::scene::effects::Effect;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

pyo3::create_exception!(
    abbe,
    SceneError,
    PyValueError,
    "A scene with problems, one line each: file, line, column, what is wrong, what is allowed."
);

/// Dotted keys and values, as `--set` takes them.
pub type Overrides = Vec<(String, String)>;

/// Origin of a scene.
#[derive(Clone)]
enum Origin {
    File(PathBuf),
    Text { text: String, folder: PathBuf },
}

impl Origin {
    fn load(&self, overrides: &[(String, String)]) -> Result<Loaded, SceneFileErrors> {
        match self {
            Self::File(path) => build(scene_file::load(path, overrides)?, path),
            Self::Text { text, folder } => {
                let name = "scene";
                let read = scene_file::read_str(text, name, folder, overrides)?;
                build(read, name.as_ref())
            }
        }
    }
}

/// State of a scene: keys that were set, and what was built with them.
struct State {
    overrides: Overrides,
    loaded: Arc<Loaded>,
    /// The same with settings of a render, which the next render may have as well.
    with_settings: Option<(Overrides, Arc<Loaded>)>,
}

/// A scene.
#[pyclass(frozen, module = "abbe")]
pub struct Scene {
    origin: Origin,
    state: Mutex<State>,
}

impl Scene {
    fn open(py: Python, origin: Origin, overrides: Overrides) -> PyResult<Self> {
        let loaded = load(py, &origin, &overrides)?;
        let state = State {
            overrides,
            loaded,
            with_settings: None,
        };
        Ok(Self {
            origin,
            state: Mutex::new(state),
        })
    }

    fn state<T>(&self, read: impl FnOnce(&mut State) -> T) -> T {
        // a poisoned lock means that a thread has panicked; what it left is whole
        read(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The scene with settings of a render over its own.
    pub fn loaded(&self, py: Python, settings: Overrides) -> PyResult<Arc<Loaded>> {
        let (known, overrides) = self.state(|state| {
            let kept = state.with_settings.as_ref();
            let kept = kept.filter(|(of, _)| *of == settings);
            let known = if settings.is_empty() {
                Some(Arc::clone(&state.loaded))
            } else {
                kept.map(|(_, loaded)| Arc::clone(loaded))
            };
            (known, state.overrides.clone())
        });
        if let Some(known) = known {
            return Ok(known);
        }
        let all: Overrides = overrides.iter().chain(&settings).cloned().collect();
        let loaded = load(py, &self.origin, &all)?;
        self.state(|state| {
            // keys may have been set meanwhile
            if state.overrides == overrides {
                state.with_settings = Some((settings, Arc::clone(&loaded)));
            }
        });
        Ok(loaded)
    }
}

fn load(py: Python, origin: &Origin, overrides: &[(String, String)]) -> PyResult<Arc<Loaded>> {
    let pool = pool(0)?;
    let loaded = py.detach(|| pool.install(|| origin.load(overrides)));
    match loaded {
        Ok(loaded) => Ok(Arc::new(loaded)),
        Err(errors) => Err(SceneError::new_err(errors.to_string())),
    }
}

#[pymethods]
impl Scene {
    /// Reads a scene file or a model.
    #[staticmethod]
    fn from_file(py: Python, path: PathBuf, overrides: Overrides) -> PyResult<Self> {
        Self::open(py, Origin::File(path), overrides)
    }

    /// Reads a scene from TOML text; files it names are looked for in `folder`.
    #[staticmethod]
    fn from_text(
        py: Python,
        text: String,
        folder: PathBuf,
        overrides: Overrides,
    ) -> PyResult<Self> {
        Self::open(py, Origin::Text { text, folder }, overrides)
    }

    /// Sets keys. The scene stays as it was where the outcome is no scene.
    fn set(&self, py: Python, more: Overrides) -> PyResult<()> {
        let mut overrides = self.state(|state| state.overrides.clone());
        // the last word on a key counts; others keep their order
        overrides.retain(|(key, _)| more.iter().all(|(k, _)| k != key));
        overrides.extend(more);
        let loaded = load(py, &self.origin, &overrides)?;
        self.state(|state| {
            *state = State {
                overrides,
                loaded,
                with_settings: None,
            };
        });
        Ok(())
    }

    /// Keys that were set, with their values as TOML.
    #[getter]
    fn overrides(&self) -> Overrides {
        self.state(|state| state.overrides.clone())
    }

    /// Name, columns and rows of each sensor.
    #[getter]
    fn sensors(&self) -> Vec<(String, u32, u32)> {
        let loaded = self.state(|state| Arc::clone(&state.loaded));
        let sensors = loaded.scene.sensors.iter();
        let sensors = sensors.map(|s| {
            let size = s.camera.resolution();
            (s.name.clone(), size.width, size.height)
        });
        sensors.collect()
    }

    /// Name of each effect, whether the scene calls for it, and what in it does.
    #[getter]
    fn effects(&self) -> Vec<(String, bool, String)> {
        let loaded = self.state(|state| Arc::clone(&state.loaded));
        let tell = |e: &Effect| (e.kind.to_string(), e.on, e.reason.clone());
        loaded.scene.effects.iter().map(tell).collect()
    }

    /// Things that are legal but surely not meant.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.state(|state| state.loaded.warnings.clone())
    }

    /// Files that were read.
    #[getter]
    fn files(&self) -> Vec<PathBuf> {
        self.state(|state| state.loaded.files.clone())
    }

    /// Hash of the scene, as images of it say it.
    #[getter]
    fn hash(&self) -> String {
        self.state(|state| format!("{:016x}", state.loaded.scene.hash))
    }

    fn __repr__(&self) -> String {
        let origin = match &self.origin {
            Origin::File(path) => path.display().to_string(),
            Origin::Text { .. } => "from text".to_owned(),
        };
        let loaded = self.state(|state| Arc::clone(&state.loaded));
        let (objects, sensors) = (loaded.scene.objects.len(), loaded.scene.sensors.len());
        format!("<abbe.Scene {origin}: {objects} objects, {sensors} sensors>")
    }
}
