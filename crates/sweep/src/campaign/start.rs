//! What the runs of a grid begin with, where it is not the packing of their seeds.

mod file;
mod runs;

use super::axis_values::of_axis;
use super::error::Problem;
use super::reader::{Entry, Reader, wrong_type};
use crate::model::axes::AXES;
use sd_core::model::{StartFrom, StartLayer};
use std::ops;
use std::path::Path;
use toml::de::DeValue;

/// The key of the start.
pub(super) const START: &str = "start";

/// The word for starts in thermal equilibrium.
const EQUILIBRIUM: &str = "equilibrium";

/// Whether that word is written.
pub(super) fn is_equilibrium(written: Entry<'_>) -> bool {
    matches!(written.get_ref(), DeValue::String(word) if word == EQUILIBRIUM)
}

/// The starts of a grid.
#[derive(Debug)]
pub(super) struct Start {
    pub(super) layers: Layers,
    pub(super) span: ops::Range<usize>,
    /// The file in which layers are, as written, and the place of its name.
    pub(super) file: Option<(String, ops::Range<usize>)>,
    /// The values that select a point of a store, as written.
    point: String,
}

/// One layer for all runs, one for each seed, or none.
#[derive(Debug)]
pub(super) enum Layers {
    /// None: the seeds make starts in equilibrium.
    Equilibrium,
    /// From a file.
    File(Box<StartLayer>),
    /// By seed, the end of the run with that seed at a point of another store.
    Runs(Vec<(u64, Box<StartLayer>)>),
}

impl Start {
    /// Reads the layer of a named file, or the ends of the runs of a point, if the grid has them.
    pub(super) fn read(grid: &Reader<'_>, folder: &Path) -> Option<Self> {
        let written = grid.get(START)?;
        let (span, faults) = (written.span(), grid.faults);
        let (found, file, point) = match written.get_ref() {
            DeValue::String(name) if name == EQUILIBRIUM => {
                (Ok(Layers::Equilibrium), None, String::new())
            }
            DeValue::String(name) => {
                let layer = file::read(&folder.join(name.as_ref()));
                let layers = layer.map(|layer| Layers::File(Box::new(layer)));
                let layers = layers
                    .map_err(|[what, allowed]| [what, format!("\"{EQUILIBRIUM}\", or {allowed}")]);
                (
                    layers,
                    Some((name.to_string(), span.clone())),
                    String::new(),
                )
            }
            DeValue::Table(entries) => {
                let keys = ["store", "point"];
                let table = Reader::new(entries, span.clone(), START, &keys, faults);
                let store = table.need("store", "\"results/first.sqlite\"");
                let store = store.and_then(|store| {
                    if let DeValue::String(name) = store.get_ref() {
                        return Some((name.to_string(), store.span()));
                    }
                    let allowed = "`store` is the name of a file";
                    faults.push(wrong_type(store, "store", allowed));
                    None
                });
                let known: Vec<&str> = AXES.iter().map(|axis| axis.key).collect();
                let example = "{ shear_stress = 1.0, friction = 0.5 }";
                let point = table.table("point", "point", &known, example);
                let values = AXES.iter().filter_map(|axis| {
                    let value = of_axis(point.as_ref()?.get(axis.key)?, axis);
                    Some((axis, faults.ok(value)?))
                });
                let values: Vec<_> = values.collect();
                let store = store.filter(|_| table.is_whole())?;
                let layers = runs::layers(&folder.join(&store.0), folder, &values);
                let boxed = |(seed, layer)| (seed, Box::new(layer));
                let layers = layers.map(|all| Layers::Runs(all.into_iter().map(boxed).collect()));
                let words = values
                    .iter()
                    .map(|(axis, value)| format!("{} = {value}", axis.key));
                (layers, Some(store), words.collect::<Vec<_>>().join(", "))
            }
            _ => {
                let allowed = "`start` is \"equilibrium\", the name of a file, or { store = \"FILE\", point = { KEY = VALUE, .. } }";
                faults.push(wrong_type(written, START, allowed));
                return None;
            }
        };
        let layers = found.map_err(|[message, allowed]| {
            Problem::at(&span, message, allowed).labelled("begins here")
        });
        Some(Self {
            layers: faults.ok(layers)?,
            span,
            file,
            point,
        })
    }

    /// What the run with a seed begins with.
    pub(super) fn of_seed(&self, seed: u64) -> Result<StartFrom, Problem> {
        match &self.layers {
            Layers::Equilibrium => Ok(StartFrom::Equilibrium),
            Layers::File(layer) => Ok(StartFrom::Layer(layer.clone())),
            Layers::Runs(layers) => {
                let found = layers.iter().find(|layer| layer.0 == seed);
                found
                    .map(|(_, layer)| StartFrom::Layer(layer.clone()))
                    .ok_or_else(|| {
                        let seeds = layers.iter().map(|layer| layer.0.to_string());
                        let seeds: Vec<String> = seeds.collect();
                        Problem::at(
                            &self.span,
                            format!("no finished run of that point has seed {seed}"),
                            format!("`seeds` among those of that point: {}", seeds.join(", ")),
                        )
                    })
            }
        }
    }

    /// The numbers of its layers on the axis; all runs of a point have the same, unless their
    /// lengths differ.
    fn numbers(&self) -> Vec<u64> {
        let mut numbers = match &self.layers {
            Layers::Equilibrium => vec![StartFrom::EQUILIBRIUM.into()],
            Layers::File(layer) => vec![layer.number()],
            Layers::Runs(layers) => layers.iter().map(|(_, layer)| layer.number()).collect(),
        };
        numbers.dedup();
        numbers
    }

    /// The name of its file.
    fn name(&self) -> Option<&str> {
        self.file.as_ref().map(|file| file.0.as_str())
    }

    fn stem(&self) -> String {
        let file = Path::new(self.name().unwrap_or_default());
        let name = |name: Option<&std::ffi::OsStr>| name.unwrap_or_default().display().to_string();
        match self.layers {
            Layers::Equilibrium => EQUILIBRIUM.to_owned(),
            Layers::File(_) => name(file.file_name()),
            Layers::Runs(_) => format!("end of {}", name(file.file_stem())),
        }
    }
}

/// The names of start layers by their numbers: tables and legends show `end of forward` instead of
/// the number on the axis. Without names layers keep their numbers.
pub(super) fn names<'g>(starts: impl Iterator<Item = &'g Start>) -> Vec<(u64, String)> {
    let mut named: Vec<(u64, &Start)> = Vec::new();
    for start in starts {
        let [number] = start.numbers()[..] else {
            return Vec::new();
        };
        match named.iter().find(|(known, _)| *known == number) {
            None => named.push((number, start)),
            Some((_, same)) if same.name() == start.name() && same.point == start.point => {}
            // Two descriptions of the same layer.
            Some(_) => return Vec::new(),
        }
    }
    let name = |start: &Start| {
        let stem = start.stem();
        let same = named.iter().filter(|(_, other)| other.stem() == stem);
        if same.count() > 1 && !start.point.is_empty() {
            format!("{stem}, {}", start.point)
        } else {
            stem
        }
    };
    let new = (!named.is_empty()).then(|| (0, "packing".to_owned()));
    let names = named.iter().map(|(number, start)| (*number, name(start)));
    new.into_iter().chain(names).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A start whose layer has that number.
    fn start(number: u32, file: &str, point: &str) -> Start {
        let layer = Box::new(StartLayer {
            side: 8.0,
            offset: 0.0,
            radii: Vec::new(),
            centres: Vec::new(),
            orientations: Vec::new(),
            springs: Vec::new(),
            rolling_springs: Vec::new(),
            origin: Some(number),
        });
        Start {
            layers: match point {
                "" => Layers::File(layer),
                _ => Layers::Runs(vec![(1, layer.clone()), (2, layer)]),
            },
            span: 0..0,
            file: Some((file.into(), 0..0)),
            point: point.into(),
        }
    }

    #[test]
    fn layers_have_the_names_of_the_files_they_come_from() {
        let names = |starts: &[Start]| {
            let names = super::names(starts.iter());
            [0, 7, 9].map(|number| {
                let found = names.iter().find(|(known, _)| *known == number);
                found.map(|(_, name)| name.clone())
            })
        };
        let some = |words: [&str; 3]| words.map(|word| Some(word.to_owned()));
        let forward = || start(7, "old/fwd.sqlite", "shear_rate = 1");
        let file = names(&[forward(), start(9, "layers/sheared.xyz", ""), forward()]);
        assert_eq!(file, some(["packing", "end of fwd", "sheared.xyz"]));
        let other = names(&[forward(), start(9, "fwd.sqlite", "shear_rate = 2")]);
        let ends = ["end of fwd, shear_rate = 1", "end of fwd, shear_rate = 2"];
        assert_eq!(other, some(["packing", ends[0], ends[1]]));
        // The same layer under two descriptions has no name.
        let same = names(&[forward(), start(7, "fwd.sqlite", "shear_rate = 1")]);
        assert_eq!(same, [const { None }; 3]);
        assert!(super::names([].iter()).is_empty());
    }
}
