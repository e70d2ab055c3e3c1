//! The page: the template with title, style, data and script put in their places.

use super::data::ReportData;

const TEMPLATE: &str = include_str!("template.html");
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("viewer.js");

/// One self-contained HTML page. The same data gives the same bytes; what is not finite becomes a gap.
pub fn render(data: &ReportData) -> String {
    // Every map key of the data is a string and no serializer here fails, so the fallback is never seen.
    let json = serde_json::to_string(data).unwrap_or_else(|_unreachable| "{}".into());
    fill(TEMPLATE, |name| match name {
        "title" => Some(escape_text(&data.title)),
        "style" => Some(STYLE.into()),
        "data" => Some(escape_json(&json)),
        "script" => Some(SCRIPT.into()),
        _ => None,
    })
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

/// JSON that cannot end or open an element: `<`, `>` and `&` stand only inside JSON strings, where an escape is equal.
fn escape_json(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
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

    #[test]
    fn escaped_json_reads_as_before() {
        let text = serde_json::to_string("</script><!-- & \u{2028}").unwrap();
        let escaped = escape_json(&text);
        assert!(!escaped.contains(['<', '>', '&']));
        assert_eq!(serde_json::from_str::<String>(&escaped).unwrap(), "</script><!-- & \u{2028}");
    }
}
