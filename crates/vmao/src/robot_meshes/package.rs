//! Whose files these are: the installed package around a file, and its licence.
//!
//! Package and version come from the `*.dist-info` beside the package's folder, licence texts from there and from
//! the folders between the file and the package's top.

use serde::{Deserialize, Serialize};
use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
};

/// The longest licence, list of files or metadata that is read (bytes).
const MAX_TEXT: u64 = 8 << 20;
/// The most licence texts that are kept of one package.
const MAX_TEXTS: usize = 16;

/// An installed package.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Package {
    /// Its name; none if the files belong to no installed package.
    pub name: Option<String>,
    /// Its version.
    pub version: Option<String>,
    /// Its licence in short, as the package says it or else the first line of the text.
    pub licence: Option<String>,
    /// The licence texts.
    pub texts: Vec<LicenceText>,
}

/// A licence text.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LicenceText {
    /// Its file, from the folder that packages are installed in, or from the folder that was imported from.
    pub file: String,
    /// The text.
    pub text: String,
}

impl Package {
    /// The package that installed `file`, which lies below `from`. Both are canonical.
    pub(super) fn of(file: &Path, from: &Path) -> Self {
        let Some((site, information)) = installed(file) else {
            let mut package = Self::default();
            package.add_texts(&folders(file, from), from);
            package.licence = package.first_line();
            return package;
        };
        let metadata = read(&information.join("METADATA")).unwrap_or_default();
        let headers: Vec<(&str, &str)> =
            metadata.lines().take_while(|line| !line.is_empty()).filter_map(|line| line.split_once(": ")).collect();
        let header = |key: &str| {
            let found = headers.iter().find(|(name, _)| name.eq_ignore_ascii_case(key)).map(|(_, value)| value.trim());
            found.filter(|value| !value.is_empty() && *value != "UNKNOWN").map(str::to_owned)
        };
        let classified = || {
            let classifiers = headers.iter().filter(|(name, _)| name.eq_ignore_ascii_case("Classifier"));
            let licences: Vec<&str> = classifiers.filter_map(|(_, value)| value.trim().strip_prefix("License :: ")).collect();
            (!licences.is_empty()).then(|| licences.join("; "))
        };
        let mut package = Self { name: header("Name"), version: header("Version"), licence: None, texts: Vec::new() };
        let top = file.strip_prefix(&site).ok().and_then(|inside| inside.components().next());
        let top = top.map_or_else(|| site.clone(), |top| site.join(top));
        let mut places = folders(file, &top);
        places.extend([information.clone(), information.join("licenses"), information.join("license_files")]);
        package.add_texts(&places, &site);
        package.licence = header("License-Expression").or(header("License")).or_else(classified).or_else(|| package.first_line());
        package
    }

    /// The texts of files named like a licence in these folders.
    fn add_texts(&mut self, folders: &[PathBuf], root: &Path) {
        for folder in folders {
            let entries = fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
            let mut files: Vec<PathBuf> = entries.filter(|path| is_licence(path)).collect();
            files.sort();
            for path in files {
                let Some(text) = read(&path).filter(|text| !text.trim().is_empty()) else { continue };
                if self.texts.len() < MAX_TEXTS && self.texts.iter().all(|known| known.text != text) {
                    let file = path.strip_prefix(root).unwrap_or(&path).display().to_string();
                    self.texts.push(LicenceText { file, text });
                }
            }
        }
    }

    fn first_line(&self) -> Option<String> {
        let line = self.texts.first()?.text.lines().map(str::trim).find(|line| !line.is_empty())?;
        Some(line.chars().take(120).collect())
    }

    /// Name, version and licence for a person; what could not be found is said.
    pub fn summary(&self) -> String {
        let name = self.name.as_deref().map_or("no installed package owns these files".to_owned(), |name| {
            format!("package {name} {}", self.version.as_deref().unwrap_or("of unknown version"))
        });
        match &self.licence {
            Some(licence) => format!("{name}\nlicence: {licence}"),
            None => format!("{name}\nlicence: none found; check yourself that you may use these meshes"),
        }
    }
}

fn is_licence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_uppercase();
    ["LICENSE", "LICENCE", "COPYING", "NOTICE"].iter().any(|word| name.starts_with(word)) && path.is_file()
}

/// The folders from the file's own up to `top`.
fn folders(file: &Path, top: &Path) -> Vec<PathBuf> {
    file.ancestors().skip(1).take_while(|folder| folder.starts_with(top)).map(Path::to_owned).collect()
}

fn read(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    fs::File::open(path).ok()?.take(MAX_TEXT).read_to_end(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// The nearest folder that packages are installed in, and the `*.dist-info` there that owns the file.
fn installed(file: &Path) -> Option<(PathBuf, PathBuf)> {
    file.ancestors().skip(1).find_map(|site| {
        let top = file.strip_prefix(site).ok()?.components().next()?;
        let top = top.as_os_str().to_string_lossy();
        let entries = fs::read_dir(site).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
        let mut all: Vec<PathBuf> =
            entries.filter(|path| path.extension().is_some_and(|extension| extension == "dist-info")).collect();
        all.sort();
        let owner = all.into_iter().find(|information| owns(information, &top))?;
        Some((site.to_owned(), owner))
    })
}

/// Whether the package installed the folder `top`: its list of files says so, or, without one, its name.
fn owns(information: &Path, top: &str) -> bool {
    match read(&information.join("RECORD")) {
        Some(record) => {
            let inside = |line: &str| line.strip_prefix(top).is_some_and(|rest| rest.starts_with('/'));
            record.lines().any(|line| inside(line.trim_start_matches('"')))
        }
        None => {
            let stem = information.file_stem().unwrap_or_default().to_string_lossy();
            let name = stem.split_once('-').map_or(&*stem, |(name, _)| name);
            name.replace('-', "_").eq_ignore_ascii_case(&top.replace('-', "_"))
        }
    }
}
