//! Where an output came from: program, commit, configuration, seed and command, saved beside every output.

use crate::{
    config::{Config, ConfigError},
    json::{Document, DocumentError, JsonPath},
    output::write_whole,
    wording::listed,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{collections::BTreeSet, io, io::Write, path::Path};

/// The program's version.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The commit that the program was built from; `unknown` outside a checkout.
pub const COMMIT: &str = env!("VMAO_COMMIT");

/// `run.json`: enough to make an output again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunInfo {
    /// Version of this layout.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Commit of the program.
    pub commit: String,
    /// The command line, the program's own path cut to its name.
    pub command: Vec<String>,
    /// Seed of the run.
    pub seed: u64,
    /// SHA-256 of `config.toml`.
    pub config_sha256: String,
}

impl RunInfo {
    /// What is known of the run that executes `arguments` with this configuration.
    pub fn new(arguments: &[String], seed: u64, config: &Config) -> Result<Self, ConfigError> {
        let command = std::iter::once("vmao".to_owned()).chain(arguments.iter().skip(1).cloned()).collect();
        let (version, commit) = (VERSION.to_owned(), COMMIT.to_owned());
        Ok(Self { schema: 1, version, commit, command, seed, config_sha256: config.sha256()? })
    }

    /// Reads the `run.json` of `directory`.
    pub fn load(directory: &Path) -> Result<Self, DocumentError> {
        Document::read(&directory.join("run.json"))?.parse()
    }

    /// Refuses to go on with the run in `directory` under another seed or configuration: it would mix two runs.
    pub fn check_same_run(&self, directory: &Path) -> Result<(), DocumentError> {
        if !directory.join("run.json").exists() {
            let file = directory.display().to_string();
            let message = "nothing to resume: no `run.json`, expected a run that was begun; leave out --resume to begin one";
            return Err(DocumentError { file, path: String::new(), place: None, message: message.to_owned() });
        }
        let document = Document::read(&directory.join("run.json"))?;
        let there: Self = document.parse()?;
        if there.seed != self.seed {
            let message = format!("a run with seed {}, expected {} to resume it", there.seed, self.seed);
            return Err(document.refuse(&JsonPath::key("seed"), message));
        }
        if there.config_sha256 != self.config_sha256 {
            let message = "a run with another configuration; compare the config.toml beside it".to_owned();
            return Err(document.refuse(&JsonPath::key("config_sha256"), message));
        }
        Ok(())
    }

    /// [`Self::check_same_run`] for the run that is to go on with `config`; names the values that differ.
    pub fn check_resumes(&self, directory: &Path, config: &Config) -> Result<(), DocumentError> {
        self.check_same_run(directory).map_err(|mut error| {
            let there = std::fs::read_to_string(directory.join("config.toml")).ok().and_then(|text| text.parse().ok());
            let here = config.to_toml().ok().and_then(|text| text.parse().ok());
            if let (true, Some(there), Some(here)) = (self.differs_in_config(directory), there, here) {
                let mut differences = Vec::new();
                differ("", &there, &here, &mut differences);
                let listed = listed(differences.iter().map(String::as_str));
                error.message = format!("a run with another configuration: {listed}");
            }
            error
        })
    }

    fn differs_in_config(&self, directory: &Path) -> bool {
        Self::load(directory).is_ok_and(|there| there.seed == self.seed && there.config_sha256 != self.config_sha256)
    }

    /// Writes `config.toml`, `run.json` and copies of the files that the configuration names into `directory`.
    pub fn save(&self, directory: &Path, config: &Config) -> io::Result<()> {
        self.save_as(&directory.join("config.toml"), &directory.join("run.json"), config)
    }

    /// Writes `NAME.config.toml` and `NAME.run.json` beside an output `NAME.xml` or the like.
    pub fn save_beside(&self, output: &Path, config: &Config) -> io::Result<()> {
        self.save_as(&output.with_extension("config.toml"), &output.with_extension("run.json"), config)
    }

    fn save_as(&self, config_file: &Path, run_file: &Path, config: &Config) -> io::Result<()> {
        let text = config.to_toml().map_err(io::Error::other)?;
        config.inputs.save(config_file.parent().unwrap_or(Path::new("")))?;
        write_whole(config_file, |file| file.write_all(text.as_bytes()))?;
        let json = serde_json::to_string_pretty(self)?;
        write_whole(run_file, |file| writeln!(file, "{json}"))
    }
}

/// Adds every value in which two configurations differ, with what is there and what was asked for.
fn differ(path: &str, there: &toml::Table, here: &toml::Table, differences: &mut Vec<String>) {
    let keys: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    for key in keys {
        let name = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match (there.get(key), here.get(key)) {
            (Some(toml::Value::Table(there)), Some(toml::Value::Table(here))) => differ(&name, there, here, differences),
            (there, here) if there == here => {}
            (there, here) => {
                let show = |value: Option<&toml::Value>| value.map_or("nothing".to_owned(), ToString::to_string);
                differences.push(format!("{name} is {} there, {} here", show(there), show(here)));
            }
        }
    }
}

/// SHA-256 in lower-case hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// Bytes in lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_resumed_with_its_own_seed_and_configuration_only() {
        let directory = tempfile::tempdir().unwrap();
        let run = |seed, setting: &str| {
            let config = Config::load(None, &[setting.to_owned()]).unwrap();
            (RunInfo::new(&["bin/vmao".into(), "explore".into()], seed, &config).unwrap(), config)
        };
        let (info, config) = run(3, "explore.radius=0.03");
        info.save(directory.path(), &config).unwrap();
        assert_eq!(RunInfo::load(directory.path()).unwrap(), info);
        assert_eq!(info.command, ["vmao", "explore"]);
        run(3, "explore.radius=0.030").0.check_same_run(directory.path()).unwrap();
        let refused = |(info, _): (RunInfo, Config)| info.check_same_run(directory.path()).unwrap_err().to_string();
        let (info, config) = run(3, "explore.radius=0.04");
        let named = info.check_resumes(directory.path(), &config).unwrap_err().to_string();
        assert!(named.ends_with("a run with another configuration: explore.radius is 0.03 there, 0.04 here"), "{named}");
        assert!(refused(run(4, "explore.radius=0.03")).contains("seed (line 9, column 11): a run with seed 3, expected 4"));
        assert!(refused(run(3, "explore.radius=0.04")).contains("config_sha256 (line 10"));
    }

    #[test]
    fn the_hash_is_the_published_one() {
        // FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_hex(b"abc"), abc);
    }
}
