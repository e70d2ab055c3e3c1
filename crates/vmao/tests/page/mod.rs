//! The data that a report carries, read back the way a browser finds it.

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;
use serde_json::Value;
use std::io::Read;

/// The page's data, with the long texts of motions in their places.
#[track_caller]
pub(crate) fn carried(page: &str) -> Value {
    let (_, rest) = page.split_once(r#"<script type="text/plain" id="report-data">"#).expect("the page carries data");
    let (packed, _) = rest.split_once("</script").expect("the data ends");
    let packed = STANDARD.decode(packed).expect("the data is base64");
    let mut json = String::new();
    ZlibDecoder::new(&packed[..]).read_to_string(&mut json).expect("the data is packed text");
    let mut data: Value = serde_json::from_str(&json).expect("the data is JSON");
    let texts = data["texts"].take();
    let mut known: Vec<&Value> = texts.as_array().expect("a list of texts").iter().collect();
    known.sort_by_key(|text| text.as_str());
    assert!(known.windows(2).all(|pair| pair[0] != pair[1]), "each text is there once");
    put_back(&mut data, &texts);
    data
}

fn put_back(value: &mut Value, texts: &Value) {
    match value {
        Value::Object(fields) => {
            if fields.contains_key("body_count") {
                for name in ["bodies", "motion", "forces"] {
                    let number = fields[name].as_u64().expect("the number of a text");
                    fields.insert(name.into(), texts[number as usize].clone());
                }
            }
            fields.values_mut().for_each(|value| put_back(value, texts));
        }
        Value::Array(values) => values.iter_mut().for_each(|value| put_back(value, texts)),
        _ => (),
    }
}
