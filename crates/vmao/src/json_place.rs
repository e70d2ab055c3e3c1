//! Where in a JSON text the value at a path begins. The text is known to be valid; nothing is recursive.

use crate::json::Step;

/// Byte offset of the value that `path` leads to; of the deepest value on the way that exists, if it does not.
pub(crate) fn offset(text: &str, path: &[Step]) -> Option<usize> {
    let mut at = skip_space(text, 0);
    for step in path {
        match find(text, at, step) {
            Some(next) => at = next,
            None => break,
        }
    }
    (at < text.len()).then_some(at)
}

/// Offset of the key's or index's value in the object or list that begins at `at`.
fn find(text: &str, at: usize, step: &Step) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut cursor = skip_space(text, at + 1);
    let mut found = None;
    match (bytes.get(at)?, step) {
        (b'{', Step::Key(key)) => {
            while *bytes.get(cursor)? == b'"' {
                let end = skip_value(text, cursor)?;
                let name: String = serde_json::from_str(&text[cursor..end]).ok()?;
                let value = skip_space(text, skip_space(text, end) + 1);
                if name == *key {
                    // The last one, as a reader of a repeated key expects: it is the one refused.
                    found = Some(value);
                }
                cursor = skip_comma(text, skip_value(text, value)?);
            }
        }
        (b'[', Step::Index(index)) => {
            for _ in 0..*index {
                cursor = skip_comma(text, skip_value(text, cursor)?);
            }
            found = (*bytes.get(cursor)? != b']').then_some(cursor);
        }
        _ => {}
    }
    found
}

fn skip_space(text: &str, at: usize) -> usize {
    let space = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\n' | b'\r');
    at + text.as_bytes().get(at..).map_or(0, |rest| rest.iter().take_while(|byte| space(byte)).count())
}

fn skip_comma(text: &str, at: usize) -> usize {
    let at = skip_space(text, at);
    if text.as_bytes().get(at) == Some(&b',') { skip_space(text, at + 1) } else { at }
}

/// The offset behind the value that begins at `at`.
fn skip_value(text: &str, at: usize) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut depth, mut cursor) = (0_usize, at);
    loop {
        match bytes.get(cursor)? {
            b'"' => {
                cursor += 1;
                while *bytes.get(cursor)? != b'"' {
                    cursor += if bytes[cursor] == b'\\' { 2 } else { 1 };
                }
                cursor += 1;
            }
            b'{' | b'[' => {
                depth += 1;
                cursor += 1;
                continue;
            }
            b'}' | b']' => {
                depth = depth.checked_sub(1)?;
                cursor += 1;
            }
            b',' | b':' | b' ' | b'\t' | b'\n' | b'\r' => {
                cursor += 1;
                continue;
            }
            _ => {
                let scalar = |byte: &u8| !matches!(byte, b',' | b':' | b'}' | b']' | b' ' | b'\t' | b'\n' | b'\r');
                cursor += bytes[cursor..].iter().take_while(|byte| scalar(byte)).count();
            }
        }
        if depth == 0 {
            return Some(cursor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json::JsonPath;

    #[track_caller]
    fn check(text: &str, path: &JsonPath, rest: &str) {
        let offset = offset(text, &path.0).unwrap();
        assert!(text[offset..].starts_with(rest), "{path} leads to {}", &text[offset..]);
    }

    #[test]
    fn values_are_found_past_nested_and_escaped_ones() {
        let text = r#" {"a\"]" : [ {"x":"}{"}, [1, -2.5e3 , true] ], "b": {"c\u0041":  null}, "d": [] }"#;
        check(text, &JsonPath::default(), "{");
        check(text, &JsonPath::key("a\"]").at(1).at(1), "-2.5e3");
        check(text, &JsonPath::key("a\"]").at(0).then("x"), "\"}{\"");
        check(text, &JsonPath::key("b").then("cA"), "null");
        // What is not there is placed at what should hold it.
        check(text, &JsonPath::key("d").at(0), "[]");
        check(text, &JsonPath::key("b").then("e").at(3), "{\"c");
    }

    #[test]
    fn the_deepest_allowed_nesting_is_walked() {
        let text = format!("{}7{}", "[".repeat(100_000), "]".repeat(100_000));
        let path = (0..3).fold(JsonPath::default(), |path, _| path.at(0));
        assert_eq!(offset(&text, &path.0), Some(3));
        assert_eq!(offset("", &[]), None);
    }
}
