//! `abbe view`: a scene while it renders, an image or a job, as a page in the browser.
//!
//! The server is bound to 127.0.0.1, answers only who has its token ([`guard`]), writes no file and
//! takes nothing from the page but values of a fixed list of settings. Renders are those of
//! `abbe render`: the same passes, in the same order, so that what is saved has the same bytes.

mod guard;
mod http;
mod pages;
mod picture;
mod settings;
mod source;
mod stage;
mod studio;

use super::args::ViewOptions;
use super::{CliError, Outcome, print, tell, threads};
use crate::io::layers::Layer;
use crate::io::loaded::Loaded;
use crate::render::guides::Guide;
use crate::render::{Progress, Session};
use guard::Guard;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use studio::Studio;

/// An error of the system, for a reader.
#[allow(
    clippy::needless_pass_by_value,
    reason = "it stands where one is mapped"
)]
fn failed(error: std::io::Error) -> CliError {
    CliError::Failed(format!("cannot serve the page: {error}"))
}

/// A port of this machine alone, and the lock of its door.
fn open_door(port: u16) -> Result<(TcpListener, Guard), CliError> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
    let port = listener.local_addr().map_err(failed)?.port();
    Ok((listener, Guard::new(port).map_err(failed)?))
}

fn start(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), CliError> {
    let named = std::thread::Builder::new().name(name.to_owned());
    named.spawn(work).map(drop).map_err(failed)
}

/// Runs the command, until the process is interrupted.
pub fn run(options: &ViewOptions) -> Result<Outcome, CliError> {
    let pool = threads::pool(options.threads)?;
    let studio = Arc::new(Studio::open(options)?);
    let (listener, guard) = open_door(options.port.unwrap_or(0))?;
    print(&format!(
        "{}\n  open this address in a browser on this machine; Ctrl-C ends\n",
        guard.address()
    ))?;
    let watched = Arc::clone(&studio);
    let worker = Arc::clone(&studio);
    start("render", move || worker.work(&pool))?;
    start("files", move || watched.watch())?;
    http::serve(&listener, move |request| {
        pages::answer(request, &guard, &studio)
    });
    Ok(Outcome::Done)
}

/// The page of a render that another command does, until the process ends.
#[derive(Debug)]
pub struct Page(Arc<Studio>);

impl Page {
    /// Serves the page of a scene or model, and tells its address.
    ///
    /// # Errors
    /// There is no port, or there are no random numbers.
    pub fn open(scene: &Path) -> Result<Self, CliError> {
        let (listener, guard) = open_door(0)?;
        tell(&format!(
            "{}\n  open this address in a browser on this machine",
            guard.address()
        ));
        let studio = Arc::new(Studio::beside(scene));
        let shown = Arc::clone(&studio);
        start("page", move || {
            http::serve(&listener, move |request| {
                pages::answer(request, &guard, &shown)
            });
        })?;
        Ok(Self(studio))
    }

    /// Shows a render from now on.
    pub fn show(&self, loaded: &Loaded, session: &Session, layers: &[Layer], guides: &[Guide]) {
        self.0.watch_render(loaded, session, layers, guides);
    }

    /// Takes note of how far it is.
    pub fn follow(&self, session: &Session, state: &Progress) {
        self.0.follow(session, state);
    }
}
