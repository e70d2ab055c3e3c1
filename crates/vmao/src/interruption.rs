//! Ctrl-C and a scheduler's SIGTERM: the file that is being written gets finished, then the program says what is kept and ends.
//!
//! Every file is there whole or not at all, so there is nothing else to put in order, and no computation has to be waited for.

use crate::output::log;
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    iterator::Signals,
    low_level,
};
use std::{
    io,
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

/// How long a file that is being written may take to be finished.
const PATIENCE: Duration = Duration::from_millis(1200);
const GLANCE: Duration = Duration::from_millis(20);

/// What is kept if the program is stopped now, and how to go on; for people.
static KEPT: Mutex<String> = Mutex::new(String::new());
/// Held while a file is being written.
static WRITING: Mutex<()> = Mutex::new(());

/// Says what will be kept, from now on, and how to go on with it.
pub fn keeps(what: impl Into<String>) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = what.into();
}

/// Keeps an interruption waiting, up to a second, for as long as the value lives.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on, an interruption ends the program as it should be: exit code 128 + the signal's number, as shells have it.
pub(crate) fn heed() -> io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    let watch = move || {
        if let Some(signal) = signals.forever().next() {
            // The guard is held until the end: no other file is begun.
            let _writing = written();
            let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let kept = if kept.is_empty() { "nothing was begun that could be kept".to_owned() } else { kept };
            log(&format!("\nstopped: {kept}"));
            low_level::exit(128 + signal);
        }
    };
    thread::Builder::new().name("interruption".to_owned()).spawn(watch).map(drop)
}

/// Waits until no file is being written, for a while.
fn written() -> Option<MutexGuard<'static, ()>> {
    for _ in 0..PATIENCE.as_millis() / GLANCE.as_millis() {
        if let Ok(guard) = WRITING.try_lock() {
            return Some(guard);
        }
        thread::sleep(GLANCE);
    }
    None
}
