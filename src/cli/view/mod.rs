//! `abbe view`: a scene while it renders, or an image, as a page in the browser.
//!
//! The server is bound to 127.0.0.1, answers only who has its token ([`guard`]), writes no file and
//! takes nothing from the page but values of a fixed list of settings. Renders are those of
//! `abbe render`: the same passes, in the same order, so that what is saved has the same bytes.

mod guard;
mod http;
mod pages;
mod picture;
mod settings;
mod studio;

use super::args::ViewOptions;
use super::{CliError, Outcome, print, threads};
use guard::Guard;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use studio::Studio;

/// Runs the command, until the process is interrupted.
pub fn run(options: &ViewOptions) -> Result<Outcome, CliError> {
    let failed = |e: std::io::Error| CliError::Failed(format!("cannot serve the page: {e}"));
    let pool = threads::pool(options.threads)?;
    let studio = Arc::new(Studio::open(options)?);
    let place = (Ipv4Addr::LOCALHOST, options.port.unwrap_or(0));
    let listener = TcpListener::bind(place).map_err(failed)?;
    let port = listener.local_addr().map_err(failed)?.port();
    let guard = Guard::new(port).map_err(failed)?;
    print(&format!(
        "{}\n  open this address in a browser on this machine; Ctrl-C ends\n",
        guard.address()
    ))?;
    let watched = Arc::clone(&studio);
    let worker = Arc::clone(&studio);
    let start = |name: &str, work: Box<dyn FnOnce() + Send>| {
        let named = std::thread::Builder::new().name(name.to_owned());
        named.spawn(work).map(drop).map_err(failed)
    };
    start("render", Box::new(move || worker.work(&pool)))?;
    start("files", Box::new(move || watched.watch()))?;
    http::serve(&listener, move |request| {
        pages::answer(request, &guard, &studio)
    });
    Ok(Outcome::Done)
}
