//! How messages name what was found and list what exists: short, bounded, safe to print on a terminal.

use std::fmt::{self, Display};

/// Names longer than this are cut in messages.
const NAME_LENGTH: usize = 60;
/// Excerpts longer than this are cut in messages: room for a configuration's field, its type and twenty names.
const EXCERPT_LENGTH: usize = 600;
/// Lists longer than this are cut in messages.
const LIST_LENGTH: usize = 20;

/// A name in backticks, escaped and cut so that hostile input cannot spoil a terminal.
pub fn quoted(name: &str) -> String {
    format!("`{}`", shown(name, NAME_LENGTH))
}

/// What a library says of hostile input, or a value of it, escaped and cut likewise but longer.
pub fn excerpt(text: &str) -> String {
    shown(text, EXCERPT_LENGTH)
}

fn shown(text: &str, most: usize) -> String {
    let cut = text.char_indices().nth(most).map_or(text, |(end, _)| &text[..end]);
    let dots = if cut.len() < text.len() { "…" } else { "" };
    let shown = |letter: char| match letter {
        '"' | '\'' | '\\' => letter.to_string(),
        _ => letter.escape_debug().to_string(),
    };
    cut.chars().map(shown).collect::<String>() + dots
}

/// The names, comma-separated; cut with a count if there are many.
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    if names.is_empty() {
        return "none".to_owned();
    }
    let escape = |name: &&str| quoted(name).trim_matches('`').to_owned();
    let mut text = names.iter().take(LIST_LENGTH).map(escape).collect::<Vec<_>>().join(", ");
    if names.len() > LIST_LENGTH {
        text += &format!(", … ({} in all)", names.len());
    }
    text
}

/// "object has no part `lid`; parts are: base, screen".
pub fn unknown<'a>(owner: impl Display, kind: &str, name: &str, available: impl IntoIterator<Item = &'a str>) -> String {
    format!("{owner} has no {kind} {}; {kind}s are: {}", quoted(name), listed(available))
}

/// Line and column, both from one; the column counts characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl Place {
    /// The place of byte `offset` of `text`.
    pub fn of(text: &[u8], offset: usize) -> Self {
        let before = &text[..offset.min(text.len())];
        let line_start = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
        let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
        let column = String::from_utf8_lossy(&before[line_start..]).chars().count() + 1;
        Self { line, column }
    }
}

impl Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "line {}, column {}", self.line, self.column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_are_answered_with_what_exists() {
        assert_eq!(unknown("object", "part", "lid", ["base", "screen"]), "object has no part `lid`; parts are: base, screen");
        assert_eq!(unknown("object", "joint", "", []), "object has no joint ``; joints are: none");
    }

    #[test]
    fn hostile_names_are_escaped_and_cut() {
        assert_eq!(quoted("\u{1b}[31m\n"), "`\\u{1b}[31m\\n`");
        assert!(quoted(&"ä".repeat(10_000)).chars().count() < 70);
        assert_eq!(excerpt("unknown field `a`\u{7}"), "unknown field `a`\\u{7}");
        assert!(excerpt(&"ä".repeat(10_000)).chars().count() < 610);
        let many: Vec<String> = (0..1000).map(|i| format!("part-{i}")).collect();
        assert!(listed(many.iter().map(String::as_str)).ends_with("part-19, … (1000 in all)"));
    }

    #[test]
    fn places_count_lines_and_characters() {
        assert_eq!(Place::of("é\nab".as_bytes(), 4), Place { line: 2, column: 2 });
        assert_eq!(Place::of(b"", 9), Place { line: 1, column: 1 });
    }
}
