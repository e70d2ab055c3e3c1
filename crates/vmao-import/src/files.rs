//! The folder an import may read from: nothing outside it, nothing but plain files, and not without end.

use crate::{
    error::Error,
    repairs::{Quirk, Repairs},
};
use std::{
    cell::Cell,
    fs,
    io::Read,
    path::{Path, PathBuf},
};
use vmao_core::wording::{Place, quoted};

/// The most that one import reads from all files together (bytes).
pub const MAX_TOTAL_BYTES: u64 = 256 << 20;

/// A folder to read from.
#[derive(Debug)]
pub struct Files {
    root: PathBuf,
    /// Where names begin; in the root or the root itself.
    start: PathBuf,
    /// What may still be read (bytes).
    left: Cell<u64>,
}

impl Files {
    /// The folder at `root`.
    pub fn below(root: &Path) -> Result<Self, Error> {
        Self::from(root, root)
    }

    /// The folder at `root`; names are seen from `start`, which lies in it.
    pub fn from(root: &Path, start: &Path) -> Result<Self, Error> {
        let canonical =
            |path: &Path| path.canonicalize().map_err(|error| Error::refused(path, format!("cannot be found: {error}")));
        let files = Self { root: canonical(root)?, start: canonical(start)?, left: Cell::new(MAX_TOTAL_BYTES) };
        if !files.start.starts_with(&files.root) {
            return Err(Error::refused(start, format!("lies outside {}, the only folder that is read", files.root.display())));
        }
        Ok(files)
    }

    /// Whether the folder has something of this name.
    pub fn has(&self, name: &str) -> bool {
        self.start.join(name).exists()
    }

    /// The plain file that `name` means; neither `..` nor a link may lead outside.
    fn find(&self, name: &str) -> Result<PathBuf, Error> {
        let refuse = |message: String| Error::refused(quoted(name).trim_matches('`'), message);
        if name.contains('\0') {
            return Err(refuse("is no path: it holds a zero byte".to_owned()));
        }
        let path = self.start.join(name).canonicalize().map_err(|error| refuse(format!("cannot be found: {error}")))?;
        if !path.starts_with(&self.root) {
            return Err(refuse(format!("lies outside {}, the only folder that is read", self.root.display())));
        }
        let metadata = path.metadata().map_err(|error| refuse(format!("cannot be read: {error}")))?;
        if metadata.is_file() { Ok(path) } else { Err(refuse("is not a plain file".to_owned())) }
    }

    /// The bytes of the file `name`, at most `most`.
    pub fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, Error> {
        let path = self.find(name)?;
        let refuse = |message: String| Error::refused(quoted(name).trim_matches('`'), message);
        let (most, kind) = if self.left.get() < most { (self.left.get(), "left for all files") } else { (most, "read") };
        let mut bytes = Vec::new();
        let read = fs::File::open(&path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
        read.map_err(|error| refuse(format!("cannot be read: {error}")))?;
        if bytes.len() as u64 > most {
            return Err(refuse(format!("longer than {most} bytes, the most that is {kind}")));
        }
        self.left.set(self.left.get() - bytes.len() as u64);
        Ok(bytes)
    }

    /// The text of the file `name`, UTF-8 with or without a byte order mark.
    pub fn read_text(&self, name: &str, most: u64) -> Result<String, Error> {
        let bytes = self.read(name, most)?;
        text(bytes).map_err(|message| Error::refused(quoted(name).trim_matches('`'), message))
    }

    /// The path that a description's name for a file means, seen from this folder.
    ///
    /// `package://x/y` is y, or x/y, here or in the root; backslashes separate folders, too.
    pub fn resolved(&self, name: &str, repairs: &mut Repairs) -> String {
        let plain = name.trim().replace('\\', "/");
        if plain != name {
            repairs.add(Quirk::Path, name, "backslashes or blanks in a path");
        }
        if let Some(rest) = plain.strip_prefix("file://") {
            return rest.to_owned();
        }
        let Some(rest) = plain.strip_prefix("package://").or(plain.strip_prefix("model://")) else { return plain };
        let inner = rest.split_once('/').map_or(rest, |(_, inner)| inner);
        let below_root = |rest: &str| self.root.join(rest).to_string_lossy().into_owned();
        let candidates = [inner.to_owned(), rest.to_owned(), below_root(inner), below_root(rest)];
        let found = candidates.iter().find(|name| self.has(name)).unwrap_or(&candidates[0]).clone();
        repairs.add(Quirk::Path, name, "a package's path: looked for in the folder itself");
        found
    }
}

/// Bytes as text: UTF-8, with or without a byte order mark.
pub fn text(bytes: Vec<u8>) -> Result<String, String> {
    check_encoding(&bytes)?;
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        format!("{}: byte {:#04x} is not UTF-8 text", Place::of(bytes, offset), bytes[offset])
    })?;
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}

/// Refuses UTF-16.
pub(crate) fn check_encoding(bytes: &[u8]) -> Result<(), String> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err("UTF-16 text, expected UTF-8".to_owned());
    }
    Ok(())
}
