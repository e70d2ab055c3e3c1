//! Layers over the shipped configuration: a file, then settings. A layer may only change what exists, to the same type.

use crate::{
    config::ConfigError,
    inputs::rebase,
    wording::{Place, quoted, unknown},
};
use std::path::Path;
use toml::{Table, Value, de::DeTable, de::DeValue};

/// The largest configuration file that is read (bytes).
const MAX_BYTES: u64 = 1 << 20;

/// Something that changes a configuration.
#[derive(Debug, Clone)]
pub(crate) enum Layer {
    /// A TOML file: its name and its text.
    File(String, String),
    /// `section.key=value`.
    Setting(String),
}

impl Layer {
    /// Reads a configuration file.
    pub(crate) fn file(path: &Path) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        let refuse = |message: String| ConfigError { origin: name.clone(), message };
        let length = std::fs::metadata(path).map_err(|error| refuse(format!("cannot be read: {error}")))?.len();
        if length > MAX_BYTES {
            return Err(refuse(format!("{length} bytes, expected a configuration of at most {MAX_BYTES}")));
        }
        let text = std::fs::read_to_string(path).map_err(|error| refuse(format!("cannot be read: {error}")))?;
        Ok(Self::File(name, text))
    }
}

/// `base` with every layer's values in turn; an unknown key or another type is refused with its place.
pub(crate) fn merge(mut base: Table, layers: &[Layer]) -> Result<Table, ConfigError> {
    for layer in layers {
        match layer {
            Layer::File(name, text) => {
                let mut over: Table = text.parse().map_err(|error: toml::de::Error| ConfigError {
                    origin: error
                        .span()
                        .map_or(name.clone(), |span| format!("{name}: {}", Place::of(text.as_bytes(), span.start))),
                    message: error.message().trim().to_owned(),
                })?;
                rebase(&mut over, Path::new(name).parent().unwrap_or(Path::new("")));
                overlay(&mut base, over, &mut Vec::new()).map_err(|Mismatch { path, message }| ConfigError {
                    origin: place(text, &path).map_or(name.clone(), |place| format!("{name}: {place}")),
                    message,
                })?;
            }
            Layer::Setting(setting) => {
                let refuse = |message: String| ConfigError { origin: format!("--set {}", quoted(setting)), message };
                let (key, text) =
                    setting.split_once('=').ok_or_else(|| refuse("no `=`, expected section.key=value".to_owned()))?;
                let path: Vec<&str> = key.split('.').map(str::trim).collect();
                let over = path.iter().rev().fold(value(&base, &path, text.trim()), |inner, &key| {
                    Value::Table(Table::from_iter([(key.to_owned(), inner)]))
                });
                if let Value::Table(over) = over {
                    overlay(&mut base, over, &mut Vec::new()).map_err(|mismatch| refuse(mismatch.message))?;
                }
            }
        }
    }
    Ok(base)
}

/// The value that `text` spells: TOML, or the bare text where that is no TOML or a string is wanted.
fn value(base: &Table, path: &[&str], text: &str) -> Value {
    let wanted = path.iter().skip(1).fold(base.get(path[0]), |inner, key| inner.and_then(|inner| inner.get(key)));
    match (text.parse::<Value>(), wanted) {
        (Ok(value @ Value::String(_)), _) => value,
        (Ok(_), Some(Value::String(_))) | (Err(_), _) => Value::String(text.to_owned()),
        (Ok(value), _) => value,
    }
}

/// A key that cannot take the value given.
struct Mismatch {
    path: Vec<String>,
    message: String,
}

fn overlay(base: &mut Table, over: Table, path: &mut Vec<String>) -> Result<(), Mismatch> {
    for (key, value) in over {
        let owner = if path.is_empty() { "the configuration".to_owned() } else { format!("section [{}]", path.join(".")) };
        let kind = if path.is_empty() { "section" } else { "key" };
        path.push(key.clone());
        let Some(present) = base.get_mut(&key) else {
            let message = unknown(owner, kind, &key, base.keys().map(String::as_str));
            return Err(Mismatch { path: path.clone(), message });
        };
        match (present, value) {
            (Value::Table(present), Value::Table(value)) => overlay(present, value, path)?,
            (present, value) => match fitted(present, value) {
                Ok(value) => *present = value,
                Err(value) => {
                    let message = format!("{}: {}, expected {}", path.join("."), described(&value), described(present));
                    return Err(Mismatch { path: path.clone(), message });
                }
            },
        }
        path.pop();
    }
    Ok(())
}

/// `value` as the type that `present` has; whole numbers serve as real ones.
fn fitted(present: &Value, value: Value) -> Result<Value, Value> {
    match (present, value) {
        (Value::Float(_), Value::Integer(value)) => Ok(Value::Float(value as f64)),
        (Value::Array(present), Value::Array(values)) => match present.first() {
            None => Ok(Value::Array(values)),
            Some(first) => {
                let fitted: Result<Vec<Value>, Value> = values.iter().map(|value| fitted(first, value.clone())).collect();
                fitted.map(Value::Array).map_err(|_unfit| Value::Array(values))
            }
        },
        (present, value) if present.same_type(&value) => Ok(value),
        (_, value) => Err(value),
    }
}

fn described(value: &Value) -> String {
    let text = quoted(&value.to_string());
    match value {
        Value::Table(_) => "a section of keys".to_owned(),
        Value::String(_) => format!("a string like {text}"),
        Value::Integer(_) => format!("a whole number like {text}"),
        Value::Float(_) => format!("a number like {text}"),
        Value::Boolean(_) => format!("true or false like {text}"),
        Value::Datetime(_) => format!("a date like {text}"),
        Value::Array(_) => format!("a list like {text}"),
    }
}

/// Where the key that `path` leads to stands in a TOML text.
fn place(text: &str, path: &[String]) -> Option<Place> {
    let document = DeTable::parse(text).ok()?;
    let (mut table, mut offset) = (document.get_ref(), 0);
    for key in path {
        let (name, value) = table.iter().find(|(name, _)| name.get_ref() == key)?;
        offset = name.span().start;
        if let DeValue::Table(inner) = value.get_ref() {
            table = inner;
        }
    }
    Some(Place::of(text.as_bytes(), offset))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(layer: Layer, expected: &str) {
        let base: Table = "[goal]\nlift = [0.1, 0.2]\nname = \"a\"\n[trial]\nsteps = 3\n[train]\n".parse().unwrap();
        assert_eq!(merge(base, &[layer]).unwrap_err().to_string(), expected);
    }

    #[test]
    fn settings_name_what_is_wrong_and_what_exists() {
        let set = |text: &str| Layer::Setting(text.to_owned());
        check(set("goal.lfit=3"), "--set `goal.lfit=3`: section [goal] has no key `lfit`; keys are: lift, name");
        check(
            set("gaol.lift=3"),
            "--set `gaol.lift=3`: the configuration has no section `gaol`; sections are: goal, train, trial",
        );
        check(set("goal.lift"), "--set `goal.lift`: no `=`, expected section.key=value");
        check(
            set("trial.steps=x"),
            "--set `trial.steps=x`: trial.steps: a string like `\"x\"`, expected a whole number like `3`",
        );
        check(set("goal=1"), "--set `goal=1`: goal: a whole number like `1`, expected a section of keys");
        check(
            set("goal.lift=[1, x]"),
            "--set `goal.lift=[1, x]`: goal.lift: a string like `\"[1, x]\"`, expected a list like `[0.1, 0.2]`",
        );
        check(
            set("goal.lift=[true]"),
            "--set `goal.lift=[true]`: goal.lift: a list like `[true]`, expected a list like `[0.1, 0.2]`",
        );
        check(set("train.epochs=3"), "--set `train.epochs=3`: section [train] has no key `epochs`; keys are: none");
    }

    #[test]
    fn files_name_the_line_and_column() {
        let file = |text: &str| Layer::File("a.toml".to_owned(), text.to_owned());
        check(
            file("[goal]\nname = \"b\"\n  lfit = 3"),
            "a.toml: line 3, column 3: section [goal] has no key `lfit`; keys are: lift, name",
        );
        check(
            file("trial.steps = 2.5"),
            "a.toml: line 1, column 7: trial.steps: a number like `2.5`, expected a whole number like `3`",
        );
        assert!(
            merge(Table::new(), &[file("[goal]\nlift = = 1")]).unwrap_err().to_string().starts_with("a.toml: line 2, column 8: ")
        );
    }
}
