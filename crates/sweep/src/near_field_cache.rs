//! Near-field tables of unequal spheres: solved once for a size ratio, which takes seconds, and
//! kept in the user's cache.
//!
//! The cache only saves time: a missing, damaged or unwritable file is no error, and a table read
//! back has the same bits as the computed one.

use crate::system::files::{cache_folder, folder_of, read_whole, write_whole};
use crate::text::format::counted;
use sd_core::model::Sizes;
use sd_core::two_sphere::{NEAR_FIELD_VERSION, NearField};
use sd_core::{Error, NearFields, Params, start};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Maximum size of a table file, in bytes: tables have two megabytes.
const SIZE_LIMIT: u64 = 1 << 28;

/// Size ratios, larger over smaller, that runs with these parameters need besides 1.
///
/// # Errors
/// Errors of the solver about the parameters.
pub fn ratios<'p>(params: impl Iterator<Item = &'p Params>) -> Result<Vec<f64>, Error> {
    let mut seen = std::collections::HashSet::new();
    let mut all: Vec<f64> = Vec::new();
    for p in params.filter(|p| p.is_mixed() && p.hydrodynamics.needs_tables()) {
        let kind = (
            p.spheres,
            p.size_ratio.to_bits(),
            p.large_fraction.to_bits(),
            p.sizes.as_ref().map(Sizes::to_string),
        );
        if !seen.insert(kind) {
            continue;
        }
        for ratio in NearFields::ratios(&start::radii_and_side(p)?.0) {
            // Equal up to rounding, as in the solver.
            if !all
                .iter()
                .any(|known| (known - ratio).abs() <= 1e-12 * ratio)
            {
                all.push(ratio);
            }
        }
    }
    Ok(all)
}

/// The tables of these size ratios, from the cache or computed; `note` is called once before any
/// is computed.
///
/// # Errors
/// A size ratio out of range.
pub fn make(ratios: &[f64], note: impl FnMut(&str)) -> Result<NearFields, Error> {
    make_at(ratios, place_of, note)
}

/// [`make`] with the paths of the cached tables.
fn make_at(
    ratios: &[f64],
    place_of: impl Fn(f64) -> Option<PathBuf>,
    mut note: impl FnMut(&str),
) -> Result<NearFields, Error> {
    let mut tables = NearFields::default();
    let mut missing = Vec::new();
    for &ratio in ratios {
        match place_of(ratio).as_deref().and_then(read) {
            Some(table) => tables.insert(table),
            None => missing.push(ratio),
        }
    }
    if !missing.is_empty() {
        let number = counted(missing.len() as u64, "size ratio");
        note(&format!("computing the near fields of {number}, once"));
    }
    for ratio in missing {
        let table = NearField::new(ratio)?;
        if let Some(place) = &place_of(ratio) {
            // Without a cache it is computed again next time.
            let _ = write(place, &table);
        }
        tables.insert(table);
    }
    Ok(tables)
}

/// File of the table of a size ratio; `None` without a home.
fn place_of(ratio: f64) -> Option<PathBuf> {
    let name = format!("near-field-{NEAR_FIELD_VERSION}-{:016x}", ratio.to_bits());
    Some(cache_folder()?.join(name))
}

/// Reads a table; `None` if it is incomplete.
fn read(place: &Path) -> Option<NearField> {
    let bytes = read_whole(place, SIZE_LIMIT).ok()?;
    let (checksum, content) = bytes.split_first_chunk::<32>()?;
    (blake3::hash(content).as_bytes() == checksum)
        .then(|| postcard::from_bytes(content).ok())
        .flatten()
}

/// Writes a table, with its checksum before it.
fn write(place: &Path, table: &NearField) -> std::io::Result<()> {
    let content = postcard::to_stdvec(table).map_err(std::io::Error::other)?;
    std::fs::create_dir_all(folder_of(place))?;
    write_whole(place, |file| {
        file.write_all(blake3::hash(&content).as_bytes())?;
        file.write_all(&content)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::Hydrodynamics;

    #[test]
    fn two_sizes_need_their_ratio_in_layers_and_suspensions() {
        let layer = Params::builder()
            .spheres(200)
            .area_fraction(0.5)
            .roughness(0.01)
            .friction(0.3)
            .shear_rate(1.0)
            .hydrodynamics(Hydrodynamics::BallMelrose)
            .two_sizes(1.4, 0.25)
            .build()
            .unwrap();
        let suspension = Params {
            area_fraction: 0.0,
            volume_fraction: Some(0.4),
            ..layer.clone()
        };
        for params in [layer, suspension] {
            let found = ratios(std::iter::once(&params)).unwrap();
            assert!(
                matches!(found[..], [ratio] if (ratio - 1.4).abs() < 1e-12),
                "{found:?}"
            );
        }
    }

    #[test]
    fn missing_tables_are_reported_once() {
        let directory = tempfile::tempdir().unwrap();
        let place_of = |ratio: f64| Some(directory.path().join(format!("{ratio}")));
        let mut notes = Vec::new();
        let mut make = |ratios: &[f64]| {
            make_at(ratios, place_of, |note| notes.push(note.to_owned())).unwrap();
        };
        make(&[1.25, 1.5]);
        make(&[1.25, 1.5]);
        assert_eq!(notes, ["computing the near fields of 2 size ratios, once"]);
    }

    #[test]
    fn table_read_back_is_the_one_solved() {
        let directory = tempfile::tempdir().unwrap();
        let place = directory.path().join("deep/table");
        let table = NearField::equal_spheres();
        write(&place, &table).unwrap();
        let back = read(&place).unwrap();
        let xi = [1e-6, 1e-3, 0.01, 0.3, 1.7];
        for gap in xi {
            assert_eq!(back.evaluate(1.0, 1.0, gap), table.evaluate(1.0, 1.0, gap));
        }
        let mut bytes = std::fs::read(&place).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&place, bytes).unwrap();
        assert!(read(&place).is_none(), "damage is noticed");
    }
}
