//! Files that a configuration names: objects and demonstrations. They are read once, checked, and kept beside the output.
//!
//! In the resolved configuration such a file is called `inputs/NAME-HASH.json`, after what is in it. A copy of that name is
//! saved beside every `config.toml`, so that a run can be repeated when its sources have moved or changed.

use crate::{
    config::{Config, ConfigError},
    demonstrations::DemonstrationsFile,
    json::{Document, DocumentError, JsonPath},
    output::write_whole,
    provenance::sha256_hex,
};
use std::{
    collections::BTreeMap,
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};
use toml::{Table, Value};
use vmao_core::{
    catalogue::CatalogueItem,
    object_file::{FILE_NAME, ObjectFile, Step},
};

/// The folder of the copies.
const FOLDER: &str = "inputs";
/// The keys that may name files.
const KEYS: [(&str, &str); 4] = [("object", "name"), ("object", "sizes"), ("object", "held_out"), ("explore", "demonstrations")];

/// The files that a configuration names, by the name of their copy.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Inputs {
    texts: BTreeMap<String, String>,
    objects: BTreeMap<String, CatalogueItem>,
    demonstrations: BTreeMap<String, DemonstrationsFile>,
}

/// Whether a value names a file: it has a `/` or ends in `.json` or `.toml`. Names of the catalogue do neither.
pub fn is_path(name: &str) -> bool {
    name.contains('/') || name.contains('\\') || name.ends_with(".json") || name.ends_with(".toml")
}

/// Makes the paths in a configuration file relative to its folder, as one expects who moves the folder.
pub(crate) fn rebase(over: &mut Table, folder: &Path) {
    let moved = |value: &mut Value| {
        if let Value::String(name) = value
            && is_path(name)
        {
            *name = folder.join(&*name).to_string_lossy().into_owned();
        }
    };
    for (section, key) in KEYS {
        match over.get_mut(section).and_then(|section| section.get_mut(key)) {
            Some(Value::Array(values)) => values.iter_mut().for_each(moved),
            Some(value) => moved(value),
            None => {}
        }
    }
}

/// Reads an object file, or the one in a folder: the object and its text, or what is wrong where.
pub fn read_object(path: &Path) -> Result<(CatalogueItem, Document), DocumentError> {
    let file = if path.is_dir() { path.join(FILE_NAME) } else { path.to_owned() };
    let document = Document::read(&file)?;
    let item = document.parse::<ObjectFile>()?.item().map_err(|error| {
        let place = error.place.iter().fold(JsonPath::default(), |place, step| match step {
            Step::Key(key) => place.then(key),
            Step::Index(index) => place.at(*index),
        });
        document.refuse(&place, error.message)
    })?;
    Ok((item, document))
}

impl Inputs {
    /// Reads every file that `config` names, and calls it by the name of its copy from now on.
    pub(crate) fn resolve(config: &mut Config) -> Result<(), ConfigError> {
        let mut inputs = Self::default();
        let object = &mut config.object;
        for name in [&mut object.name].into_iter().chain(&mut object.sizes).chain(&mut object.held_out) {
            if is_path(name) {
                inputs.take_object(name).map_err(|error| refused("object", &error))?;
            }
        }
        let name = &mut config.explore.demonstrations;
        if is_path(name) {
            inputs.take_demonstrations(name).map_err(|error| refused("explore.demonstrations", &error))?;
        }
        config.inputs = inputs;
        Ok(())
    }

    fn take_object(&mut self, name: &mut String) -> Result<(), DocumentError> {
        let (item, document) = read_object(Path::new(name))?;
        *name = copy_name(&item.object.name, document.text(), "json");
        self.texts.insert(name.clone(), document.text().to_owned());
        self.objects.insert(name.clone(), item);
        Ok(())
    }

    fn take_demonstrations(&mut self, name: &mut String) -> Result<(), DocumentError> {
        let document = Document::read(Path::new(name))?;
        let file = DemonstrationsFile::parse(&document)?;
        let extension = if name.ends_with(".json") { "json" } else { "toml" };
        *name = copy_name("demonstrations", document.text(), extension);
        self.texts.insert(name.clone(), document.text().to_owned());
        self.demonstrations.insert(name.clone(), file);
        Ok(())
    }

    /// The object of this name of a copy.
    pub fn object(&self, name: &str) -> Option<&CatalogueItem> {
        self.objects.get(name)
    }

    /// The demonstrations of this name of a copy.
    pub fn demonstrations(&self, name: &str) -> Option<&DemonstrationsFile> {
        self.demonstrations.get(name)
    }

    /// Writes the copies into `directory`.
    pub fn save(&self, directory: &Path) -> io::Result<()> {
        for (name, text) in &self.texts {
            let path: PathBuf = directory.join(name);
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder)?;
            }
            write_whole(&path, |file| file.write_all(text.as_bytes()))?;
        }
        Ok(())
    }
}

fn refused(key: &str, error: &DocumentError) -> ConfigError {
    ConfigError { origin: key.to_owned(), message: error.to_string() }
}

fn copy_name(name: &str, text: &str, extension: &str) -> String {
    format!("{FOLDER}/{name}-{}.{extension}", &sha256_hex(text.as_bytes())[..12])
}
