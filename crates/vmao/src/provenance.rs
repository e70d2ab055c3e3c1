//! Where an output came from: program, commit, configuration, seed and command, saved beside every output.

use crate::{
    config::{Config, ConfigError},
    output::write_whole,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{io, io::Write, path::Path};

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

    /// Writes `config.toml` and `run.json` into `directory`.
    pub fn save(&self, directory: &Path, config: &Config) -> io::Result<()> {
        let text = config.to_toml().map_err(io::Error::other)?;
        write_whole(&directory.join("config.toml"), |file| file.write_all(text.as_bytes()))?;
        let json = serde_json::to_string_pretty(self)?;
        write_whole(&directory.join("run.json"), |file| writeln!(file, "{json}"))
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
    #[test]
    fn the_hash_is_the_published_one() {
        // FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(super::sha256_hex(b"abc"), abc);
    }
}
