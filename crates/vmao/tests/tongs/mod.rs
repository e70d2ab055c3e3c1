//! Tongs as a file: two tapered bars of convex hulls that cross at a pin, unlike anything in the catalogue.

use nalgebra::Point3;
use serde_json::{Value, json};
use std::{fs, path::Path};
use vmao_core::convex_hull::ConvexHull;

/// A bar from x = `from` to `to` (m) that narrows from `wide` to `narrow`, between the heights `low` and `high`, six-sided.
fn bar([from, to]: [f64; 2], [wide, narrow]: [f64; 2], [low, high]: [f64; 2]) -> Value {
    let mut points = Vec::new();
    for (x, half) in [(from, wide / 2.0), (to, narrow / 2.0)] {
        let (middle, slope) = ((low + high) / 2.0, 0.15 * half);
        for side in [half, -half] {
            points.push(Point3::new(x, side, middle));
            points.push(Point3::new(x, side - side.signum() * slope, low));
            points.push(Point3::new(x, side - side.signum() * slope, high));
        }
    }
    let mut shape = serde_json::to_value(ConvexHull::around(&points, 64).unwrap()).unwrap();
    shape["type"] = json!("convex");
    shape
}

/// Length of a handle (m), one part above the other at the pin, side by side where they are held.
pub(crate) fn tongs(length: f64) -> Value {
    let part = |name: &str, angle: f64, low: f64, color: [f64; 3]| {
        let turn = [(angle / 2.0).cos(), 0.0, 0.0, (angle / 2.0).sin()];
        let pin = bar([-0.015, 0.05], [0.024, 0.024], [low, low + 0.011]);
        let handle = bar([0.045, length], [0.024, 0.018], [-0.012, 0.012]);
        let solid = |shape: Value| json!({"shape": shape, "pose": {"quaternion": turn}, "color": color});
        json!({"name": name, "mass": 0.12, "solids": [solid(pin), solid(handle)]})
    };
    json!({
        "schema": 1,
        "name": "tongs",
        "source": "drawn by a test",
        "parts": [part("under", -0.7, -0.012, [0.8, 0.3, 0.1]), part("over", 0.7, 0.001, [0.1, 0.4, 0.8])],
        "joints": [{"name": "pin", "type": "revolute", "parent": "under", "child": "over", "anchor": [0, 0, 0], "axis": [0, 0, 1],
                    "limits": [0, 1.1], "damping": 0.01, "friction": 0.02}],
    })
}

/// Writes the tongs into `folder` as `object.json`.
pub(crate) fn write(folder: &Path, length: f64) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("object.json"), serde_json::to_string_pretty(&tongs(length)).unwrap()).unwrap();
}
