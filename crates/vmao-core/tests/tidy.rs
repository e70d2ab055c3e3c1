//! The house rules that no compiler checks, over every text file of the workspace.
//!
//! A rule is a function from files to complaints, each naming file and line. Every rule is run twice: on the
//! workspace, which must give none, and on files made to break it, which must give the expected complaint.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A file of the workspace; the text of one that is not UTF-8 is empty.
struct File {
    path: String,
    text: String,
}

type Rule = fn(&[File]) -> Vec<String>;

/// Folders that hold nothing of ours; `.git` is a file in a linked working tree.
const NOT_OURS: [&str; 7] = [".git", "target", "third_party", "runs", "node_modules", "__pycache__", ".venv"];
/// Built by `viewer/build.sh` from `viewer/src`.
const GENERATED: [&str; 1] = ["crates/vmao/src/report/viewer.js"];
const MOST_LINES: usize = 500;
const DEVIATIONS: &str = "docs/deviations.md";

fn workspace() -> Vec<File> {
    fn walk(root: &Path, folder: &Path, files: &mut Vec<File>) {
        let entries = fs::read_dir(folder).unwrap_or_else(|error| panicked(folder, &error));
        let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        paths.sort();
        for path in paths {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if NOT_OURS.contains(&&*name) {
                continue;
            }
            if path.is_dir() {
                walk(root, &path, files);
            } else if path.is_file() {
                let relative = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
                let text = fs::read(&path).ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
                files.push(File { path: relative, text });
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Vec::new();
    walk(&root, &root, &mut files);
    assert!(files.len() > 100, "only {} files found under {}", files.len(), root.display());
    files
}

#[expect(clippy::panic, reason = "a test that cannot read the workspace has failed")]
fn panicked(folder: &Path, error: &std::io::Error) -> ! {
    panic!("{}: {error}", folder.display())
}

impl File {
    fn has_extension(&self, extensions: &[&str]) -> bool {
        self.path.rsplit_once('.').is_some_and(|(_, extension)| extensions.contains(&extension))
    }

    fn is_source(&self) -> bool {
        self.has_extension(&["rs", "py", "js", "mjs", "sh"]) && !GENERATED.contains(&self.path.as_str())
    }

    /// Numbered lines, from one.
    fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        self.text.lines().enumerate().map(|(index, line)| (index + 1, line))
    }

    /// Complains of every line that contains one of `words`.
    fn refuse(&self, words: &[String], why: &str) -> Vec<String> {
        let hit = |(number, line): (usize, &str)| {
            let word = words.iter().find(|word| line.contains(word.as_str()))?;
            Some(format!("{}:{number}: `{word}`: {why}", self.path))
        };
        self.lines().filter_map(hit).collect()
    }
}

fn in_folder<'a>(files: &'a [File], folder: &'a str) -> impl Iterator<Item = &'a File> {
    files.iter().filter(move |file| file.path.starts_with(folder))
}

/// Dependencies of a manifest: (line, name).
fn dependencies(manifest: &File) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut listed = false;
    for (number, line) in manifest.lines() {
        if let Some(section) = line.trim().strip_prefix('[').map(|section| section.trim_end_matches(']')) {
            listed = section.ends_with("dependencies");
            if let Some((_, name)) = section.split_once("dependencies.") {
                found.push((number, name));
            }
        } else if listed && let Some((key, _)) = line.split_once('=') {
            found.push((number, key.split('.').next().unwrap_or(key).trim()));
        }
    }
    found
}

fn crates_depend_on_no_more_than_they_may(files: &[File]) -> Vec<String> {
    let walls: [(&str, &[&str]); 4] = [
        ("crates/vmao-core/Cargo.toml", &["mujoco", "burn", "vmao", "rayon", "parquet", "arrow", "safetensors"]),
        ("crates/vmao-sim/Cargo.toml", &["vmao-net", "burn", "safetensors", "parquet", "arrow"]),
        ("crates/vmao-net/Cargo.toml", &["vmao-sim", "mujoco", "parquet", "arrow"]),
        ("crates/vmao-import/Cargo.toml", &["vmao-sim", "vmao-net", "mujoco", "burn", "parquet", "arrow"]),
    ];
    let mut complaints = Vec::new();
    for (path, forbidden) in walls {
        let Some(manifest) = files.iter().find(|file| file.path == path) else {
            complaints.push(format!("{path}: missing"));
            continue;
        };
        for (number, name) in dependencies(manifest) {
            if forbidden.iter().any(|wall| name == *wall || name.starts_with(&format!("{wall}-"))) {
                complaints.push(format!("{path}:{number}: depends on `{name}`, expected none of {forbidden:?}"));
            }
        }
    }
    complaints
}

/// Modules of std that a text names: `std::x`, or `std::{x, y::z}`, with their line.
fn std_modules(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let identifier = |text: &str| text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    for (at, matched) in text.match_indices("std::") {
        let line = text[..at].matches('\n').count() + 1;
        let after = &text[at + matched.len()..];
        if !after.starts_with('{') {
            found.push((line, &after[..identifier(after)]));
            continue;
        }
        let mut depth = 0;
        for (offset, c) in after.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                break;
            }
            if depth == 1 && matches!(c, '{' | ',') {
                let item = after[offset + 1..].trim_start();
                found.push((line, &item[..identifier(item)]));
            }
        }
    }
    found
}

fn core_opens_no_file_clock_or_thread(files: &[File]) -> Vec<String> {
    let forbidden = ["fs", "time", "thread", "env", "process", "net"];
    let mut complaints = Vec::new();
    for file in in_folder(files, "crates/vmao-core/src/") {
        for (line, module) in std_modules(&file.text) {
            if forbidden.contains(&module) {
                complaints
                    .push(format!("{}:{line}: `std::{module}`: core knows no files, clock, threads or surroundings", file.path));
            }
        }
    }
    complaints
}

/// Every line of `crates/*/src` with `word` lies in `home`, and there is at least one.
fn only_in(files: &[File], word: &str, home: &str) -> Vec<String> {
    let sources = in_folder(files, "crates/").filter(|file| file.path.contains("/src/") && file.has_extension(&["rs"]));
    let (there, elsewhere): (Vec<&File>, Vec<&File>) = sources.partition(|file| file.path == home);
    let why = format!("belongs in {home}");
    let mut complaints: Vec<String> = elsewhere.iter().flat_map(|file| file.refuse(&[word.to_owned()], &why)).collect();
    if !there.iter().any(|file| file.text.contains(word)) {
        complaints.push(format!("{home}:1: `{word}` is not there"));
    }
    complaints
}

fn one_file_converts_quaternions_and_one_runs_trials(files: &[File]) -> Vec<String> {
    let mut complaints = only_in(files, "xquat", "crates/vmao-sim/src/convention.rs");
    complaints.extend(only_in(files, "quat=", "crates/vmao-sim/src/convention.rs"));
    complaints.extend(only_in(files, "pub fn run_trial(", "crates/vmao-sim/src/trial.rs"));
    complaints
}

/// Labels say what a point lies on: they are for exploration and analysis, and a network that saw them would know its answer.
fn no_network_sees_labels(files: &[File]) -> Vec<String> {
    let learns = |path: &str| {
        path.starts_with("crates/vmao-net/src/")
            || ["learning.rs", "learned_contacts.rs"].iter().any(|name| path == format!("crates/vmao/src/{name}"))
    };
    let mut complaints = Vec::new();
    for file in files.iter().filter(|file| learns(&file.path)) {
        for (line, text) in (1..).zip(file.text.lines()) {
            if text.contains("PointLabel") || text.contains("observation.labels") {
                complaints.push(format!("{}:{line}: labels of points are not for networks", file.path));
            }
        }
    }
    complaints
}

/// What a line of Markdown says between backticks, and the targets of its links.
fn mentions(line: &str) -> (Vec<&str>, Vec<&str>) {
    let code = line.split('`').skip(1).step_by(2).collect();
    let targets = line.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target).collect();
    (code, targets)
}

/// Whether this code is meant as a path of the repository: it begins with a top-level name of it, or names a source file.
///
/// Placeholders, globs, commands and what a run leaves behind are none.
fn is_path(code: &str, top: &BTreeSet<&str>) -> bool {
    let plain = !code.is_empty() && code.chars().all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c));
    let first = code.split('/').next().unwrap_or(code);
    let source = [".rs", ".md", ".mjs", ".js", ".sh"].iter().any(|extension| code.len() > 4 && code.ends_with(extension));
    plain && !NOT_OURS.contains(&first) && ((code.contains('/') && top.contains(first)) || source)
}

fn documents_name_what_exists(files: &[File]) -> Vec<String> {
    let top: BTreeSet<&str> = files.iter().filter_map(|file| file.path.split('/').next()).collect();
    let exists = |path: &str| {
        let path = path.trim_start_matches("./").trim_end_matches('/');
        files.iter().any(|file| file.path == path || file.path.strip_prefix(path).is_some_and(|rest| rest.starts_with('/')))
    };
    let base_names: BTreeSet<&str> = files.iter().filter_map(|file| file.path.rsplit('/').next()).collect();
    let mut complaints = Vec::new();
    for file in files.iter().filter(|file| file.has_extension(&["md"])) {
        let folder = file.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        let mut fenced = false;
        for (number, line) in file.lines() {
            if line.trim_start().starts_with("```") {
                fenced = !fenced;
            }
            if fenced {
                continue;
            }
            let (code, targets) = mentions(line);
            for path in code.into_iter().filter(|code| is_path(code, &top)) {
                let found = if path.contains('/') { exists(path) } else { base_names.contains(path) };
                if !found {
                    complaints.push(format!("{}:{number}: `{path}` does not exist", file.path));
                }
            }
            for target in targets.into_iter().filter(|target| !target.contains(':') && !target.starts_with('#')) {
                let path = target.split('#').next().unwrap_or(target);
                let mut place: Vec<&str> = folder.split('/').filter(|name| !name.is_empty()).collect();
                for name in path.split('/') {
                    if name == ".." { _ = place.pop() } else { place.push(name) }
                }
                if !exists(&place.join("/")) {
                    complaints.push(format!("{}:{number}: the link to `{target}` leads nowhere", file.path));
                }
            }
        }
    }
    complaints
}

fn no_source_is_too_long(files: &[File]) -> Vec<String> {
    let long = |file: &&File| file.is_source() && file.text.lines().count() > MOST_LINES;
    let complaint = |file: &File| {
        format!("{}:{}: {} lines, expected at most {MOST_LINES}", file.path, MOST_LINES + 1, file.text.lines().count())
    };
    files.iter().filter(long).map(complaint).collect()
}

fn nothing_is_left_undone(files: &[File]) -> Vec<String> {
    // Put together here, so that this file does not complain of itself.
    let words = ["to-do!", "unimp-lemented!", "#[ig-nore]", "FIX-ME", "TO-DO"].map(|word| word.replace('-', ""));
    let ours = files.iter().filter(|file| file.is_source() || file.has_extension(&["toml", "md"]));
    ours.flat_map(|file| file.refuse(&words, "finish it or leave it out")).collect()
}

fn no_file_speaks_of_one_machine(files: &[File]) -> Vec<String> {
    let words = ["work", "root", "home", "Users"].map(|name| format!("/{name}/"));
    files.iter().flat_map(|file| file.refuse(&words, "a path of one machine")).collect()
}

/// The `D<number>` tokens of a line.
fn deviations_in(line: &str) -> Vec<usize> {
    let token = |c: char| c.is_alphanumeric() || c == '_';
    line.split(|c| !token(c)).filter_map(|word| word.strip_prefix('D')?.parse().ok()).collect()
}

fn deviations_are_numbered_and_explained(files: &[File]) -> Vec<String> {
    let mut complaints = Vec::new();
    let mut sections: BTreeMap<usize, (usize, String)> = BTreeMap::new();
    for file in files.iter().filter(|file| file.path == DEVIATIONS) {
        let mut current = 0;
        for (number, line) in file.lines() {
            if let Some(heading) = line.strip_prefix("## D") {
                current = heading.split('.').next().and_then(|digits| digits.parse().ok()).unwrap_or(0);
                if current != sections.len() + 1 {
                    complaints.push(format!("{DEVIATIONS}:{number}: D{current}, expected D{}", sections.len() + 1));
                }
                sections.insert(current, (number, String::new()));
            } else if let Some((_, text)) = sections.get_mut(&current) {
                text.push_str(line);
            }
        }
    }
    for (deviation, (number, text)) in &sections {
        for label in ["**What.**", "**Why.**", "**Effect.**"] {
            if !text.contains(label) {
                complaints.push(format!("{DEVIATIONS}:{number}: D{deviation} lacks {label}"));
            }
        }
    }
    let speaks =
        |file: &&File| (file.has_extension(&["rs", "toml", "md"]) || file.is_source()) && !file.path.ends_with("tests/tidy.rs");
    for file in files.iter().filter(speaks) {
        for (number, line) in file.lines() {
            for deviation in deviations_in(line).into_iter().filter(|deviation| !sections.contains_key(deviation)) {
                complaints.push(format!("{}:{number}: D{deviation} is not in {DEVIATIONS}", file.path));
            }
        }
    }
    complaints
}

const RULES: [(&str, Rule); 9] = [
    ("walls between crates", crates_depend_on_no_more_than_they_may),
    ("what core may use", core_opens_no_file_clock_or_thread),
    ("one place for each thing", one_file_converts_quaternions_and_one_runs_trials),
    ("what networks see", no_network_sees_labels),
    ("paths in documents", documents_name_what_exists),
    ("length of files", no_source_is_too_long),
    ("nothing undone", nothing_is_left_undone),
    ("no machine's paths", no_file_speaks_of_one_machine),
    ("deviations", deviations_are_numbered_and_explained),
];

#[test]
fn the_house_is_tidy() {
    let files = workspace();
    let complaints: Vec<String> = RULES
        .iter()
        .flat_map(|(name, rule)| rule(&files).into_iter().map(move |complaint| format!("{complaint} ({name})")))
        .collect();
    assert!(complaints.is_empty(), "{} complaints:\n{}", complaints.len(), complaints.join("\n"));
}

/// Breaks a rule with one file and expects this complaint among the rule's.
#[track_caller]
fn breaks(rule: Rule, path: &str, text: &str, complaint: &str) {
    let file = |path: &str, text: &str| File { path: path.to_owned(), text: text.to_owned() };
    let complaints = rule(&[file("crates/x/src/lib.rs", ""), file(path, text)]);
    assert!(complaints.iter().any(|found| found.contains(complaint)), "{complaint:?} is not in {complaints:#?}");
}

#[test]
fn dependencies_across_a_wall_are_found() {
    let rule = crates_depend_on_no_more_than_they_may;
    breaks(rule, "crates/vmao-core/Cargo.toml", "[dependencies]\nmujoco-rs = \"7\"", "Cargo.toml:2: depends on `mujoco-rs`");
    breaks(rule, "crates/vmao-sim/Cargo.toml", "[dev-dependencies]\nvmao-net.workspace = true", ":2: depends on `vmao-net`");
    breaks(rule, "crates/vmao-net/Cargo.toml", "\n[dependencies.vmao-sim]", ":2: depends on `vmao-sim`");
    breaks(rule, "elsewhere", "", "crates/vmao-core/Cargo.toml: missing");
}

#[test]
fn surroundings_in_core_are_found_however_they_are_imported() {
    let rule = core_opens_no_file_clock_or_thread;
    breaks(rule, "crates/vmao-core/src/a.rs", "\nlet x = std::env::var(\"X\");", "a.rs:2: `std::env`");
    breaks(rule, "crates/vmao-core/src/a.rs", "use std::{\n    fmt,\n    time::Instant,\n};", "a.rs:1: `std::time`");
}

#[test]
fn things_out_of_their_one_place_are_found() {
    let rule = one_file_converts_quaternions_and_one_runs_trials;
    breaks(rule, "crates/vmao-sim/src/b.rs", "\n\ndata.xquat()", "b.rs:3: `xquat`: belongs in crates/vmao-sim/src/convention.rs");
    breaks(rule, "crates/vmao/src/b.rs", "pub fn run_trial() {}\npub fn run_trial(", "b.rs:2: `pub fn run_trial(`");
    breaks(rule, "none", "", "convention.rs:1: `xquat` is not there");
    breaks(
        no_network_sees_labels,
        "crates/vmao-net/src/a.rs",
        "\nuse b::PointLabel;",
        "a.rs:2: labels of points are not for networks",
    );
    breaks(no_network_sees_labels, "crates/vmao/src/learning.rs", "seen.observation.labels", "learning.rs:1: labels");
}

#[test]
fn paths_that_do_not_exist_are_found() {
    let rule = documents_name_what_exists;
    breaks(rule, "docs/a.md", "see\n`crates/x/src/gone.rs`", "docs/a.md:2: `crates/x/src/gone.rs` does not exist");
    breaks(rule, "a.md", "`gone.rs` and `lib.rs`", "a.md:1: `gone.rs`");
    breaks(rule, "docs/a.md", "[x](../crates/x) [y](../crates/y#z)", "the link to `../crates/y#z` leads nowhere");
    let fine = "`crates/x/src/lib.rs` `crates/x/` `crates/*/src` `runs/demo/a.md` `crates/<name>/b.rs` [d](../crates/x) [u](https://a.b/c)";
    let file = |path: &str, text: &str| File { path: path.to_owned(), text: text.to_owned() };
    assert_eq!(rule(&[file("crates/x/src/lib.rs", ""), file("docs/a.md", fine)]), Vec::<String>::new());
}

#[test]
fn length_leftovers_machine_paths_and_lost_deviations_are_found() {
    breaks(no_source_is_too_long, "crates/x/src/long.rs", &"\n".repeat(501), "long.rs:501: 501 lines");
    breaks(nothing_is_left_undone, "a.rs", &format!("\n{}", ["to", "do!()"].concat()), "a.rs:2: `to");
    breaks(no_file_speaks_of_one_machine, "a.toml", &format!("x = \"{}\"", ["/ho", "me/me"].concat()), "a.toml:1: `/ho");
    let rule = deviations_are_numbered_and_explained;
    breaks(rule, "configs/a.toml", "\nx = 1 # D7: because", "configs/a.toml:2: D7 is not in docs/deviations.md");
    breaks(rule, DEVIATIONS, "## D1. A\n**What.** **Why.** **Effect.**\n## D3. B", "deviations.md:3: D3, expected D2");
    breaks(rule, DEVIATIONS, "## D1. A\n**What.** **Why.**", "deviations.md:1: D1 lacks **Effect.**");
}
