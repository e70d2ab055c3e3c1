//! Reading JSON documents that people write: bounded, and every refusal says where in the file it is.

use crate::wording::Place;
use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, MapAccess, Visitor, value::MapAccessDeserializer},
};
use std::{
    fmt::{self, Display},
    io::Read,
    marker::PhantomData,
    path::Path,
};
use vmao_core::geometry::Pose;
pub use vmao_core::json_pose::{JsonPose, normalized};

/// The largest document that is read (bytes).
pub const MAX_BYTES: u64 = 64 << 20;

/// A refused document: which file, where in it, and what was found and expected there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {}{message}", position(path, place.as_ref()))]
pub struct DocumentError {
    /// The file as the user named it.
    pub file: String,
    /// Where in the document: `object.joints[2].axis`; empty for the whole.
    pub path: String,
    /// Line and column, where known.
    pub place: Option<Place>,
    /// What was found, what was expected, what exists.
    pub message: String,
}

fn position(path: &str, place: Option<&Place>) -> String {
    match (path, place) {
        ("", None) => String::new(),
        ("", Some(place)) => format!("{place}: "),
        (path, None) => format!("{path}: "),
        (path, Some(place)) => format!("{path} ({place}): "),
    }
}

/// One step into a JSON document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// The value of this key.
    Key(String),
    /// The element with this index.
    Index(usize),
}

/// A way into a JSON document, shown as `object.joints[2].axis`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JsonPath(pub Vec<Step>);

impl JsonPath {
    /// The path of `key` in the document itself.
    pub fn key(key: &str) -> Self {
        Self::default().then(key)
    }

    /// The path of `key` within the value at this path.
    #[must_use]
    pub fn then(mut self, key: &str) -> Self {
        self.0.push(Step::Key(key.to_owned()));
        self
    }

    /// The path of element `index` of the list at this path.
    #[must_use]
    pub fn at(mut self, index: usize) -> Self {
        self.0.push(Step::Index(index));
        self
    }
}

impl Display for JsonPath {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (depth, step) in self.0.iter().enumerate() {
            match step {
                Step::Index(index) => write!(formatter, "[{index}]")?,
                Step::Key(key) => {
                    let dot = if depth == 0 { "" } else { "." };
                    write!(formatter, "{dot}{}", crate::wording::quoted(key).trim_matches('`'))?;
                }
            }
        }
        Ok(())
    }
}

/// A `T` that a document writes as an object; serde alone would also take a list of its fields.
#[derive(Debug)]
struct Object<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Fields<T> {
            type Value = T;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_map(Fields(PhantomData)).map(Self)
    }
}

/// For `#[serde(deserialize_with)]`: a value written as an object.
pub fn object<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    Object::deserialize(deserializer).map(|Object(value)| value)
}

/// For `#[serde(deserialize_with)]`: a list of values, each written as an object.
pub fn objects<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    Vec::<Object<T>>::deserialize(deserializer).map(|list| list.into_iter().map(|Object(value)| value).collect())
}

/// A JSON text and the name of the file it came from.
#[derive(Debug)]
pub struct Document {
    file: String,
    text: String,
}

impl Document {
    /// Reads `path`, or standard input for `-`: at most [`MAX_BYTES`] of UTF-8, a byte order mark is skipped.
    pub fn read(path: &Path) -> Result<Self, DocumentError> {
        let file = if path == Path::new("-") { "<stdin>".to_owned() } else { path.display().to_string() };
        let refuse = |message: String| DocumentError { file: file.clone(), path: String::new(), place: None, message };
        let mut bytes = Vec::new();
        let read = if path == Path::new("-") {
            std::io::stdin().lock().take(MAX_BYTES + 1).read_to_end(&mut bytes)
        } else {
            std::fs::File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
        };
        read.map_err(|error| refuse(format!("cannot be read: {error}")))?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(refuse(format!("longer than {MAX_BYTES} bytes, the most that is read")));
        }
        if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
            return Err(refuse("UTF-16 text, expected UTF-8".to_owned()));
        }
        if bytes.starts_with(&[0xef, 0xbb, 0xbf]) {
            bytes.drain(..3);
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            let offset = error.utf8_error().valid_up_to();
            let bytes = error.as_bytes();
            let place = Some(Place::of(bytes, offset));
            DocumentError { place, ..refuse(format!("byte {:#04x} is not UTF-8 text", bytes[offset])) }
        })?;
        Ok(Self { file, text })
    }

    /// What was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The document as `T`, an object; unknown fields, wrong types and text after the end are refused with their place.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, DocumentError> {
        let mut deserializer = serde_json::Deserializer::from_str(&self.text);
        let Object(value) = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
            let path = error.path().to_string();
            self.refuse_syntax(if path == "." { String::new() } else { path }, error.inner())
        })?;
        deserializer.end().map_err(|error| self.refuse_syntax(String::new(), &error))?;
        Ok(value)
    }

    fn refuse_syntax(&self, path: String, error: &serde_json::Error) -> DocumentError {
        let text = error.to_string();
        let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message);
        let message = match error.classify() {
            serde_json::error::Category::Data => message.to_owned(),
            _ if message == "number out of range" => format!("{message}, expected a finite double"),
            _ if message == "expected value" => format!("not JSON: {message} (NaN and Infinity are not JSON numbers)"),
            _ => format!("not JSON: {message}"),
        };
        // serde_json counts columns in bytes and calls the end of a line column 0.
        let place = Some(Place { line: error.line(), column: error.column().max(1) });
        DocumentError { file: self.file.clone(), path, place, message }
    }

    /// The pose at `path`, or a refusal of its zero quaternion.
    pub fn pose(&self, pose: &JsonPose, path: &JsonPath) -> Result<Pose, DocumentError> {
        let message = "a zero quaternion, expected a rotation [w, x, y, z]";
        pose.to_pose().ok_or_else(|| self.refuse(&path.clone().then("quaternion"), message.to_owned()))
    }

    /// A refusal of the value at `path`, with its line and column.
    pub fn refuse(&self, path: &JsonPath, message: String) -> DocumentError {
        let place = crate::json_place::offset(&self.text, &path.0).map(|offset| Place::of(self.text.as_bytes(), offset));
        DocumentError { file: self.file.clone(), path: path.to_string(), place, message }
    }
}
