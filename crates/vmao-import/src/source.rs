//! Finds out what a path holds, and reads all that describes the object but not its meshes.

use crate::{
    description::Description,
    error::Error,
    files::Files,
    mjcf,
    partnet::{self, BoundingBox},
    repairs::{Quirk, Repairs},
    urdf, xml,
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vmao_core::wording::quoted;

/// What kind of thing an object was imported from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SourceKind {
    /// A PartNet-Mobility folder.
    PartNet,
    /// A URDF file.
    Urdf,
    /// A MuJoCo model.
    Mjcf,
}

impl SourceKind {
    /// The name in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::PartNet => "PartNet-Mobility",
            Self::Urdf => "URDF",
            Self::Mjcf => "MJCF",
        }
    }
}

/// A description and what was found beside it.
#[derive(Debug)]
pub struct Source {
    /// What it is.
    pub kind: SourceKind,
    /// The file that was read, below the folder.
    pub file: String,
    /// The folder that meshes may be read from.
    pub files: Files,
    /// Links and joints.
    pub description: Description,
    /// The category, as `Bottle`.
    pub category: Option<String>,
    /// What links are called, by their names in the description.
    pub names: BTreeMap<String, String>,
    /// Links to leave out.
    pub junk: Vec<String>,
    /// The extent of the raw meshes, their y axis up.
    pub raw_box: Option<BoundingBox>,
}

impl Source {
    /// Reads what lies at `path`; meshes may lie below `root`, or below the description's own folder.
    pub fn read(path: &Path, root: Option<&Path>, body: Option<&str>) -> Result<Self, Error> {
        let metadata = path.metadata().map_err(|error| Error::refused(path, format!("cannot be found: {error}")))?;
        if metadata.is_dir() { Self::folder(path) } else { Self::file(path, root, body) }
    }

    fn folder(path: &Path) -> Result<Self, Error> {
        let files = Files::below(path)?;
        let Some(file) = partnet::URDFS.into_iter().find(|name| files.has(name)) else {
            let expected = partnet::URDFS.join(", ");
            return Err(Error::refused(
                path,
                format!("no PartNet-Mobility folder: has none of {expected}; name a URDF or MJCF file"),
            ));
        };
        let refuse = |name: &str, message: String| Error::refused(path.join(name), message);
        let text = files.read_text(file, xml::MAX_BYTES)?;
        let mut description = urdf::read(&text).map_err(|message| refuse(file, message))?;
        // The hash in the file says nothing; the folder's number does.
        let name = path.canonicalize().ok().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
        description.name = name.unwrap_or(description.name);
        let side = |name: &str| match files.has(name) {
            true => files.read_text(name, partnet::MAX_BYTES).map(Some),
            false => Ok(None),
        };
        let meta = side("meta.json")?.map(|text| partnet::meta(&text).map_err(|message| refuse("meta.json", message)));
        let mobility =
            side("mobility_v2.json")?.map(|text| partnet::mobility(&text).map_err(|message| refuse("mobility_v2.json", message)));
        let names =
            side("semantics.txt")?.map(|text| partnet::semantics(&text).map_err(|message| refuse("semantics.txt", message)));
        let raw_box = side("bounding_box.json")?
            .map(|text| partnet::bounding_box(&text).map_err(|message| refuse("bounding_box.json", message)));
        let junk = mobility.transpose()?.unwrap_or_default();
        let junk = junk.iter().filter(|link| link.joint == "junk").map(|link| format!("link_{}", link.id)).collect();
        Ok(Self {
            kind: SourceKind::PartNet,
            file: file.to_owned(),
            description,
            category: meta.transpose()?.map(|meta| meta.model_cat),
            names: names.transpose()?.unwrap_or_default(),
            junk,
            raw_box: raw_box.transpose()?,
            files,
        })
    }

    fn file(path: &Path, root: Option<&Path>, body: Option<&str>) -> Result<Self, Error> {
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let own = Files::below(parent)?;
        let text = own.read_text(&name, xml::MAX_BYTES)?;
        let refuse = |message: String| Error::refused(path, message);
        let kind = match xml::root_name(&text).map_err(refuse)?.as_str() {
            "robot" => SourceKind::Urdf,
            "mujoco" => SourceKind::Mjcf,
            other => {
                return Err(refuse(format!("the root element is {}, expected `robot` (URDF) or `mujoco` (MJCF)", quoted(other))));
            }
        };
        let mut description = match kind {
            SourceKind::Mjcf => mjcf::read(&text, body),
            SourceKind::Urdf | SourceKind::PartNet => urdf::read(&text),
        }
        .map_err(refuse)?;
        if description.name.is_empty() {
            description.name = Path::new(&name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        }
        let files = match root {
            None => own,
            Some(root) => Files::from(root, parent)?,
        };
        Ok(Self { kind, file: name, files, description, category: None, names: BTreeMap::new(), junk: Vec::new(), raw_box: None })
    }

    /// What links are called, where the folder says better than the description.
    pub fn name_of<'a>(&'a self, link: &'a str, repairs: &mut Repairs) -> &'a str {
        let name = self.names.get(link).map(String::as_str);
        if let Some(name) = name {
            repairs.add(Quirk::Name, link, format!("called {}, as its folder does", quoted(name)));
        }
        name.unwrap_or(link)
    }

    /// The path of the file that was read, for messages.
    pub fn shown(&self, path: &Path) -> PathBuf {
        if self.kind == SourceKind::PartNet { path.join(&self.file) } else { path.to_owned() }
    }
}
