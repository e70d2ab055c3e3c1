//! What leaves the program: data to stdout, words and bars to stderr, files whole or not at all.

use crate::interruption::writing;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::{
    fs::{self, File, TryLockError},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

/// How a JSON document is laid out on stdout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// One line, for programs.
    Line,
    /// Indented, for people.
    Indented,
}

/// Writes one JSON document and a newline to stdout. A reader that has gone away is no failure.
pub fn print_json<T: Serialize>(document: &T, layout: Layout) -> io::Result<()> {
    let text = match layout {
        Layout::Line => serde_json::to_string(document)?,
        Layout::Indented => serde_json::to_string_pretty(document)?,
    };
    print(&text)
}

/// Writes text and a newline to stdout. A reader that has gone away is no failure.
pub fn print(text: &str) -> io::Result<()> {
    let mut stdout = BufWriter::new(io::stdout().lock());
    let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.write_all(b"\n")).and_then(|()| stdout.flush());
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
            // What is left in the buffer has no reader; dropping the writer must not try again.
            drop(stdout.into_parts());
            Ok(())
        }
        written => written,
    }
}

/// Writes a line to stderr; a closed stderr is ignored, as there is nowhere left to say so.
pub fn log(line: &str) {
    drop(writeln!(io::stderr().lock(), "{line}"));
}

/// A progress bar over `length` units on stderr; invisible unless stderr is a terminal.
pub fn progress_bar(label: &str, length: u64) -> ProgressBar {
    let bar = ProgressBar::new(length).with_message(label.to_owned());
    let template = "{msg:<24} {bar:30} {pos}/{len}  {per_sec}, {elapsed} elapsed, {eta} left  {prefix}";
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style.progress_chars("━╸ ")),
        Err(_) => bar,
    }
}

/// Where [`write_whole`] builds a file before it gets its name.
pub fn partial_path(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.partial"))
}

/// Writes a file that is there whole or not at all, even if the machine stops: beside it, synced, renamed, synced.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let partial = partial_path(path);
    let _writing = writing();
    let mut writer = BufWriter::new(File::create(&partial)?);
    let written = write(&mut writer).and_then(|()| writer.flush()).and_then(|()| writer.get_ref().sync_all());
    if let Err(error) = written {
        // The disk may be full: give back what was taken. The first error is the one to report.
        drop(writer.into_parts());
        drop(fs::remove_file(&partial));
        return Err(error);
    }
    fs::rename(&partial, path)?;
    File::open(directory)?.sync_all()
}

/// Holds `directory`, made if need be, for this process alone as long as the file lives; none if another process does.
///
/// The system releases it however the process ends.
pub fn hold(directory: &Path) -> io::Result<Option<File>> {
    fs::create_dir_all(directory)?;
    let lock = File::options().create(true).append(true).open(directory.join(".lock"))?;
    match lock.try_lock() {
        Ok(()) => Ok(Some(lock)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_fails_half_way_leaves_the_old_one_and_no_partial() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("results.json");
        write_whole(&path, |file| file.write_all(b"old")).unwrap();
        let failed = write_whole(&path, |file| file.write_all(b"ne").and_then(|()| Err(io::Error::other("disk full"))));
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
