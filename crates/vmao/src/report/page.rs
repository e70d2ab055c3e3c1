//! The page: the template with title, style, data and script put in their places.

use super::data::ReportData;
use crate::rollouts::squeeze;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io;

const TEMPLATE: &str = include_str!("template.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("viewer.js");

/// Texts of a rollout that are long; what moves is the same for many.
const LONG: [&str; 3] = ["bodies", "motion", "forces"];

/// One self-contained HTML page. The same data gives the same bytes; what is not finite becomes a gap.
pub fn render(data: &ReportData) -> io::Result<String> {
    let packed = squeeze(&serde_json::to_vec(&carried(data)?)?)?;
    Ok(fill(TEMPLATE, |name| match name {
        "title" => Some(escape_text(&data.title)),
        "style" => Some(STYLE.into()),
        "data" => Some(packed.clone()),
        "script" => Some(SCRIPT.into()),
        _ => None,
    }))
}

/// The data as JSON, with the long texts of rollouts in a list of their own, `texts`: once each, and the short ones side by side.
fn carried(data: &ReportData) -> serde_json::Result<Value> {
    let mut carried = serde_json::to_value(data)?;
    let mut numbers = BTreeMap::new();
    let mut texts = Vec::new();
    take_apart(&mut carried, &mut |text| {
        *numbers.entry(text).or_insert_with_key(|text| {
            texts.push(Value::from(text.as_str()));
            texts.len() - 1
        })
    });
    carried["texts"] = Value::Array(texts);
    Ok(carried)
}

/// Replaces the long texts of every rollout by their numbers.
fn take_apart(value: &mut Value, number: &mut impl FnMut(String) -> usize) {
    match value {
        Value::Object(fields) if LONG.iter().all(|name| fields.get(*name).is_some_and(Value::is_string)) => {
            for name in LONG {
                if let Some(Value::String(text)) = fields.get_mut(name).map(Value::take) {
                    fields.insert(name.into(), Value::from(number(text)));
                }
            }
        }
        Value::Object(fields) => fields.values_mut().for_each(|value| take_apart(value, number)),
        Value::Array(values) => values.iter_mut().for_each(|value| take_apart(value, number)),
        _ => (),
    }
}

/// Replaces each `{{name}}` of the template once; what is put in is not looked at again, so data cannot name a place.
fn fill(template: &str, value: impl Fn(&str) -> Option<String>) -> String {
    let mut page = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        page.push_str(before);
        match after.split_once("}}").and_then(|(name, tail)| value(name).map(|text| (text, tail))) {
            Some((text, tail)) => {
                page.push_str(&text);
                rest = tail;
            }
            None => {
                page.push_str("{{");
                rest = after;
            }
        }
    }
    page + rest
}

fn escape_text(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_put_in_are_not_searched_for_places() {
        let page = fill("a {{x}} b {{y}} {{z}} {{", |name| match name {
            "x" => Some("{{y}}".into()),
            "y" => Some("1".into()),
            _ => None,
        });
        assert_eq!(page, "a {{y}} b 1 {{z}} {{");
    }

    #[test]
    fn the_template_has_each_place_once() {
        for place in ["{{title}}", "{{style}}", "{{data}}", "{{script}}"] {
            assert_eq!(TEMPLATE.matches(place).count(), 1, "{place}");
        }
    }

    #[test]
    fn the_script_cannot_end_its_own_element_and_carries_the_notice_of_three_js() {
        let script = SCRIPT.to_lowercase();
        assert!(!script.contains("</script") && !script.contains("<!--"));
        assert!(script.contains("three.js authors") && script.contains("permission is hereby granted"));
    }
}
