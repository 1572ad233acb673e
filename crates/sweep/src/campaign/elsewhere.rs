//! A campaign file for a copy in another folder: its relative paths become absolute.

use crate::model::campaign::Campaign;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a campaign for a copy in another folder: relative paths of start layers become
/// absolute; nothing else changes.
pub fn text_elsewhere(campaign: &Campaign) -> String {
    let folder = campaign.file.parent().unwrap_or(Path::new(""));
    let mut text = campaign.text.clone();
    let Ok(document) = DeTable::parse(&campaign.text) else {
        return text;
    };
    let mut paths: Vec<(Range<usize>, String)> = document
        .get_ref()
        .get("grid")
        .into_iter()
        .flat_map(|grid| match grid.get_ref() {
            DeValue::Array(grids) => grids.iter().collect(),
            _ => vec![grid],
        })
        .filter_map(start_path)
        .filter_map(|path| {
            let DeValue::String(name) = path.get_ref() else {
                return None;
            };
            let full = folder.join(name.as_ref());
            Some((path.span(), basic_string(full.to_str()?)))
        })
        .collect();
    // From the end, so that earlier positions stay valid.
    paths.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    for (span, full) in paths {
        text.replace_range(span, &full);
    }
    text
}

/// Where a grid names the file of its start layer, or the store of its start runs.
fn start_path<'t>(grid: &'t Spanned<DeValue<'t>>) -> Option<&'t Spanned<DeValue<'t>>> {
    let DeValue::Table(entries) = grid.get_ref() else {
        return None;
    };
    let start = entries.get("start")?;
    match start.get_ref() {
        DeValue::Table(of_runs) => of_runs.get("store"),
        _ => Some(start),
    }
}

/// A text as a basic string of TOML.
fn basic_string(text: &str) -> String {
    let mut written = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => written.extend(['\\', character]),
            c if c.is_control() => written.extend(format!("\\u{:04X}", u32::from(c)).chars()),
            c => written.push(c),
        }
    }
    written + "\""
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::protocol::Protocol;

    fn campaign(file: &str, text: &str) -> Campaign {
        Campaign {
            name: "small".into(),
            file: file.into(),
            text: text.into(),
            protocol: Protocol::default(),
            cases: Vec::new(),
            rules: Vec::new(),
            folded: 0,
            written: crate::model::campaign::Written::default(),
        }
    }

    #[test]
    fn start_layers_are_named_in_full_and_all_else_stays() {
        let text = "name = \"small\" # start = \"no.xyz\"\n[[grid]]\nstart = 'layer.xyz' # the first\nseeds = 1\n\
                    [[grid]]\nstart = { point = { friction = 0.3 }, store = \"results/one.sqlite\" }\n\
                    [[grid]]\nstart = \"/elsewhere/layer.xyz\"\n";
        let full = "name = \"small\" # start = \"no.xyz\"\n[[grid]]\nstart = \"/odd \\\" folder/layer.xyz\" # the first\nseeds = 1\n\
                    [[grid]]\nstart = { point = { friction = 0.3 }, store = \"/odd \\\" folder/results/one.sqlite\" }\n\
                    [[grid]]\nstart = \"/elsewhere/layer.xyz\"\n";
        let given = campaign("/odd \" folder/small.toml", text);
        assert_eq!(text_elsewhere(&given), full);
        // Copying the copy changes nothing.
        assert_eq!(text_elsewhere(&campaign("/plan/small.toml", full)), full);
        let plain = "name = \"small\"\n[[grid]]\nseeds = 1\n";
        assert_eq!(text_elsewhere(&campaign("/a/small.toml", plain)), plain);
    }

    #[test]
    fn odd_paths_come_back_from_what_is_written() {
        for odd in ["a\tb\\c\"d", "ä/ß", "\u{7f}"] {
            let text = format!("x = {}", basic_string(odd));
            let table = DeTable::parse(&text).unwrap();
            let DeValue::String(read) = table.get_ref()["x"].get_ref() else {
                panic!("{text}");
            };
            assert_eq!(read, odd);
        }
    }
}
