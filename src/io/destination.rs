//! Destinations of outputs: the file that a path leads to, and whether a command may write there.
//!
//! Files are the same where their canonical paths are, or, since names may be hard links, their
//! device and inode.

use super::atomic::{FileError, check_writable, folder};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Most symbolic links that are followed from one path.
const MOST_LINKS: usize = 40;

/// The file that `path` leads to through symbolic links, whether there is one yet or not.
///
/// # Errors
/// The folder is missing, or what is there is no regular file: nothing may take its place.
pub fn destination(path: &Path) -> io::Result<PathBuf> {
    let refused = |kind, text| Err(io::Error::new(kind, text));
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Some(name) = path.file_name() else {
            return refused(io::ErrorKind::IsADirectory, "is a folder, not a file");
        };
        let folder = folder(&path).canonicalize().map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => io::Error::new(e.kind(), "the folder does not exist"),
            _ => e,
        })?;
        let file = folder.join(name);
        // links there lead to open files of this process, such as /dev/stdout
        if file.starts_with("/proc") {
            return refused(io::ErrorKind::InvalidInput, "is a stream, not a file");
        }
        match file.symlink_metadata() {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(file),
            Err(e) => return Err(e),
            Ok(found) if found.is_symlink() => path = folder.join(file.read_link()?),
            Ok(found) if found.is_file() => return Ok(file),
            Ok(found) if found.is_dir() => {
                return refused(io::ErrorKind::IsADirectory, "is a folder, not a file");
            }
            Ok(_) => {
                let text = "is a device or a pipe, not a file";
                return refused(io::ErrorKind::InvalidInput, text);
            }
        }
    }
    refused(io::ErrorKind::InvalidInput, "symbolic links go round")
}

/// Device and inode of a file that is there.
#[cfg(unix)]
fn inode(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    path.metadata().ok().map(|m| (m.dev(), m.ino()))
}

#[cfg(not(unix))]
fn inode(_: &Path) -> Option<(u64, u64)> {
    None
}

/// Why an output is refused.
#[derive(Debug, thiserror::Error)]
pub enum ClaimError {
    /// The file cannot be written.
    #[error(transparent)]
    Unwritable(#[from] FileError),
    /// The file is an input of the same command.
    #[error("{} is read by this command: it would be lost (allowed: another file)", .0.display())]
    Input(PathBuf),
    /// The file is another output of the same command.
    #[error("{} would be written twice{}", path.display(), also(path, other))]
    Twice {
        /// As it was named.
        path: PathBuf,
        /// As the other output was named.
        other: PathBuf,
    },
}

fn also(path: &Path, other: &Path) -> String {
    if path == other {
        String::new()
    } else {
        format!(", also as {}", other.display())
    }
}

/// Role of a file in a command.
#[derive(Clone, Debug)]
enum Role {
    Read,
    /// Written, under this name.
    Written(PathBuf),
}

/// Files of one command: those it has read, and those it is going to write.
#[derive(Debug, Default)]
pub struct Claims {
    by_path: BTreeMap<PathBuf, Role>,
    by_inode: BTreeMap<(u64, u64), Role>,
}

impl Claims {
    /// Claims of a command that has read `files`.
    pub fn of_inputs<P: AsRef<Path>>(files: impl IntoIterator<Item = P>) -> Self {
        let mut claims = Self::default();
        for file in files {
            if let Ok(path) = file.as_ref().canonicalize() {
                claims.take(path, Role::Read);
            }
        }
        claims
    }

    fn take(&mut self, path: PathBuf, role: Role) {
        if let Some(inode) = inode(&path) {
            self.by_inode.insert(inode, role.clone());
        }
        self.by_path.insert(path, role);
    }

    /// Claims a file for an output. Leaves nothing behind.
    ///
    /// # Errors
    /// The file cannot be written, or is an input or another output.
    pub fn output(&mut self, path: &Path) -> Result<(), ClaimError> {
        check_writable(path)?;
        let file = destination(path).map_err(|e| FileError::new(path, e))?;
        let by_inode = || self.by_inode.get(&inode(&file)?);
        match self.by_path.get(&file).or_else(by_inode) {
            Some(Role::Read) => return Err(ClaimError::Input(path.to_owned())),
            Some(Role::Written(other)) => {
                let (path, other) = (path.to_owned(), other.clone());
                return Err(ClaimError::Twice { path, other });
            }
            None => {}
        }
        self.take(file, Role::Written(path.to_owned()));
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn files_are_known_by_whatever_name() {
        let folder = tempfile::tempdir().expect("folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("scene.toml"), "a").expect("file");
        std::fs::create_dir(at("sub")).expect("folder");
        symlink(at("scene.toml"), at("link")).expect("link");
        std::fs::hard_link(at("scene.toml"), at("hard")).expect("link");
        symlink("new.exr", at("dangling")).expect("link");
        let mut claims = Claims::of_inputs([at("scene.toml")]);
        for input in ["scene.toml", "sub/../scene.toml", "link", "hard"] {
            let error = claims.output(&at(input)).expect_err(input);
            assert!(matches!(error, ClaimError::Input(_)), "{error}");
        }
        claims.output(&at("dangling")).expect("a new file");
        let twice = claims.output(&at("sub/../new.exr")).expect_err("the same");
        assert!(twice.to_string().ends_with("/dangling"), "{twice}");
        claims.output(&at("other.exr")).expect("another");
    }

    #[test]
    fn nothing_takes_the_place_of_what_is_no_file() {
        let folder = tempfile::tempdir().expect("folder");
        let at = |name: &str| folder.path().join(name);
        let socket = std::os::unix::net::UnixListener::bind(at("socket"));
        symlink("round", at("round")).expect("link");
        for (path, text) in [
            (at("socket"), "is a device or a pipe, not a file"),
            ("/dev/null".into(), "is a device or a pipe, not a file"),
            ("/dev/stdout".into(), "is a stream, not a file"),
            (at("round"), "symbolic links go round"),
            (at("no/a.exr"), "the folder does not exist"),
            (folder.path().to_owned(), "is a folder, not a file"),
        ] {
            let error = destination(&path).expect_err("refused");
            assert_eq!(error.to_string(), text, "{}", path.display());
        }
        drop(socket);
    }
}
