//! Names of start layers: tables and legends show `end of forward` instead of the number on the
//! axis.

use sd_core::Params;
use std::path::Path;
use toml::{Table, Value};

/// The names of start layers by their numbers, from the points in the order of the file and from
/// its text. Without a name a layer keeps its number.
pub(super) fn names<'p>(
    text: &str,
    points: impl Iterator<Item = &'p Params>,
) -> Vec<(u64, String)> {
    let mut numbers: Vec<u64> = Vec::new();
    for start in points.filter_map(|params| params.start.as_ref()) {
        let number = start.number();
        if !numbers.contains(&number) {
            numbers.push(number);
        }
    }
    let file: Table = text.parse().unwrap_or_default();
    let grids = file.get("grid").and_then(Value::as_array);
    let mut written: Vec<&Value> = Vec::new();
    for start in grids
        .into_iter()
        .flatten()
        .filter_map(|grid| grid.get("start"))
    {
        if !written.contains(&start) {
            written.push(start);
        }
    }
    // Otherwise two of them are the same layer.
    if numbers.is_empty() || numbers.len() != written.len() {
        return Vec::new();
    }
    let stems: Vec<String> = written.iter().map(|start| stem(start)).collect();
    let name = |(start, stem): (&&Value, &String)| {
        let is_alone = stems.iter().filter(|other| *other == stem).count() == 1;
        match start.get("point").and_then(Value::as_table) {
            Some(point) if !is_alone => {
                let values = point
                    .iter()
                    .map(|(key, value)| format!("{key} = {}", word(value)));
                format!("{stem}, {}", values.collect::<Vec<_>>().join(", "))
            }
            _ => stem.clone(),
        }
    };
    let names = written.iter().zip(&stems).map(name);
    let named = numbers.into_iter().zip(names);
    std::iter::once((0, "new layer".into()))
        .chain(named)
        .collect()
}

/// A value that selects a point.
fn word(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Float(number) => number.to_string(),
        Value::Integer(number) => number.to_string(),
        other => format!("{other:?}"),
    }
}

/// Description of a start layer in a campaign file.
fn stem(start: &Value) -> String {
    let file = |value: &Value| Path::new(value.as_str().unwrap_or_default()).to_owned();
    match start.get("store") {
        Some(store) => {
            let store = file(store);
            format!("end of {}", store.file_stem().unwrap_or_default().display())
        }
        None => file(start)
            .file_name()
            .unwrap_or_default()
            .display()
            .to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;
    use sd_core::model::StartLayer;

    #[test]
    fn layers_have_the_names_of_the_files_they_come_from() {
        let begun = |origin| Params {
            start: Some(Box::new(StartLayer {
                side: 8.0,
                offset: 0.0,
                radii: Vec::new(),
                centres: Vec::new(),
                orientations: Vec::new(),
                springs: Vec::new(),
                rolling_springs: Vec::new(),
                origin: Some(origin),
            })),
            ..params()
        };
        let points = [params(), begun(7), begun(9), begun(7)];
        let text = "[[grid]]\n[[grid]]\nstart = { store = \"old/fwd.sqlite\", point = { shear_rate = 1.0 } }\n[[grid]]\nstart = ";
        let names = |last: &str| {
            let starts = super::names(&format!("{text}{last}"), points.iter());
            [0, 7, 9].map(|number| {
                let found = starts.iter().find(|(known, _)| *known == number);
                found.map(|(_, name)| name.clone())
            })
        };
        let some = |words: [&str; 3]| words.map(|word| Some(word.to_owned()));
        let file = names("\"layers/sheared.xyz\"");
        assert_eq!(file, some(["new layer", "end of fwd", "sheared.xyz"]));
        let other = names("{ store = \"fwd.sqlite\", point = { shear_rate = 2.0 } }");
        let ends = ["end of fwd, shear_rate = 1", "end of fwd, shear_rate = 2"];
        assert_eq!(other, some(["new layer", ends[0], ends[1]]));
        // Ambiguous layers have no name.
        let same = names("{ store = \"old/fwd.sqlite\", point = { shear_rate = 1.0 } }");
        assert_eq!(same, [const { None }; 3]);
    }
}
