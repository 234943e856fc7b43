//! Saving: the files of a render, written again and again while it goes on. A save that fails is
//! told once and tried again; the part comes first, since images can be made of it.

use super::args::RenderOptions;
use super::image_output::write_image;
use super::interrupt::Interrupts;
use super::{CliError, tell};
use crate::io::layers::Layer;
use crate::io::lock::FileLock;
use crate::io::{image, layers, part};
use crate::render::guides::Guide;
use crate::render::{Render, Session};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Images are rewritten at least this often.
const IMAGE_INTERVAL: Duration = Duration::from_secs(60);
/// Parts are rewritten this often, or as often as takes a twentieth of the time.
const PART_INTERVAL: Duration = Duration::from_secs(10);
const TIMES_A_SAVE: u32 = 20;
/// How long the last save is tried, and how often.
const PATIENCE: Duration = Duration::from_secs(600);
const RETRY: Duration = Duration::from_secs(2);

/// Where the results of one sensor go.
#[derive(Clone, Debug)]
pub struct Targets {
    pub image: PathBuf,
    pub preview: Option<PathBuf>,
    pub spectral: Option<PathBuf>,
}

/// Takes a part for this process, and refuses to begin anew one that holds passes.
///
/// # Errors
/// Another process has it, or it holds something and neither `--resume` nor `--overwrite` is given.
pub fn take_part(options: &RenderOptions) -> Result<Option<FileLock>, CliError> {
    let Some(path) = &options.part else {
        return Ok(None);
    };
    let lock = FileLock::acquire(path)?;
    if !path.exists() || options.resume || options.overwrite {
        return Ok(Some(lock));
    }
    let message = match part::read(path) {
        Ok(part) => match part.header.pass_count() {
            0 if part.unfinished.is_none() => return Ok(Some(lock)),
            0 => "holds a pass that is not whole: --resume goes on with it, --overwrite begins \
                  anew"
                .to_owned(),
            1 => "holds 1 pass: --resume goes on with it, --overwrite begins anew".to_owned(),
            n => format!("holds {n} passes: --resume goes on with them, --overwrite begins anew"),
        },
        Err(_) => "is there and no part of this program: --overwrite replaces it".to_owned(),
    };
    Err(CliError::file(path, message))
}

/// The time after which a session saves, before the first save.
#[must_use]
pub fn first_interval(options: &RenderOptions) -> Duration {
    if options.part.is_some() {
        PART_INTERVAL
    } else {
        IMAGE_INTERVAL
    }
}

/// Saves the files of a session: of its sensor and the companions.
pub struct Saver<'a> {
    pub options: &'a RenderOptions,
    /// Of each sensor.
    pub targets: &'a [&'a Targets],
    /// Of each sensor.
    pub guides: &'a [Vec<Guide>],
    pub interrupts: &'a Interrupts,
    /// Whether the last save failed, which has been told.
    failing: bool,
}

impl<'a> Saver<'a> {
    pub fn new(
        options: &'a RenderOptions,
        targets: &'a [&'a Targets],
        guides: &'a [Vec<Guide>],
        interrupts: &'a Interrupts,
    ) -> Self {
        Self {
            options,
            targets,
            guides,
            interrupts,
            failing: false,
        }
    }

    /// Saves while the render goes on, and sets when the next save is due. Whether it could.
    pub fn save(&mut self, session: &mut Session) -> bool {
        let began = Instant::now();
        let written = self.write(session);
        if self.options.part.is_some() {
            let interval = PART_INTERVAL.max(TIMES_A_SAVE * began.elapsed());
            session.set_save_interval(Some(interval));
        }
        match &written {
            Ok(_) => self.tell_relief(),
            Err(error) if !std::mem::replace(&mut self.failing, true) => {
                tell(&format!(
                    "warning: cannot save: {error}; the render goes on and saves again later"
                ));
            }
            Err(_) => {}
        }
        written.is_ok()
    }

    fn tell_relief(&mut self) {
        if std::mem::take(&mut self.failing) {
            tell("warning: saving works again: nothing is lost");
        }
    }

    /// Saves what the render has come to, and waits where that fails, for a while or until another
    /// interrupt. Says of each sensor's preview what a user should know.
    ///
    /// # Errors
    /// Where it could not be saved.
    pub fn finish(&mut self, session: &Session) -> Result<Vec<Option<String>>, CliError> {
        let (began, interrupts) = (Instant::now(), self.interrupts.count());
        loop {
            let error = match self.write(session) {
                Ok(preview) => {
                    self.tell_relief();
                    return Ok(preview);
                }
                Err(error) => error,
            };
            let gives_up = began.elapsed() > PATIENCE || self.interrupts.count() > interrupts;
            if gives_up || !error.may_pass() {
                return Err(error);
            }
            if !std::mem::replace(&mut self.failing, true) {
                let minutes = PATIENCE.as_secs() / 60;
                tell(&format!(
                    "warning: cannot save: {error}; tried again for {minutes} minutes (an interrupt gives up)"
                ));
            }
            std::thread::sleep(RETRY);
        }
    }

    fn write(&self, session: &Session) -> Result<Vec<Option<String>>, CliError> {
        let part = self.options.part.as_deref();
        let written = part.map(|path: &Path| part::write(path, &part::of(session)));
        let render = session.render();
        // of no pass there is no image
        let image = if render.passes().is_empty() {
            Ok(vec![None; self.targets.len()])
        } else {
            let files = self.targets.iter().zip(self.guides);
            let renders = render.and_companions().zip(files);
            renders
                .map(|(r, (to, guides))| self.write_images(r, to, guides))
                .collect()
        };
        // an image that fails does not keep the part from being written, nor the other way round
        written.transpose()?;
        image
    }

    fn write_images(
        &self,
        render: &Render,
        targets: &Targets,
        guides: &[Guide],
    ) -> Result<Option<String>, CliError> {
        let mut image = image::of(render);
        layers::add(&mut image, &self.options.aov, render, guides);
        let (preview, exposure) = (targets.preview.as_deref(), self.options.exposure);
        let preview = write_image(&targets.image, &image, preview, exposure)?;
        if let Some(path) = &targets.spectral {
            let with_noise = self.options.aov.iter().any(|l| matches!(l, Layer::Noise));
            if let Some(image) = image::spectral_of(render, with_noise) {
                write_image(path, &image, None, None)?;
            }
        }
        Ok(preview)
    }
}
