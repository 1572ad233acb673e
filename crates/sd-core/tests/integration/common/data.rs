//! Numbers computed independently of this program, and their difference from ours.

use nalgebra::SVector;
use serde_json::Value;

/// A file of `tests/data`.
pub(crate) fn data(name: &str) -> Value {
    let path = format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Numbers of a JSON list.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap();
    list.iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Vectors of a JSON list.
pub(crate) fn vectors<const DIMENSIONS: usize>(value: &Value) -> Vec<SVector<f64, DIMENSIONS>> {
    let list = value.as_array().unwrap();
    list.iter()
        .map(|x| SVector::from_column_slice(&numbers(x)))
        .collect()
}

/// Largest difference relative to the largest reference number.
pub(crate) fn difference(ours: impl IntoIterator<Item = f64>, reference: &[f64]) -> f64 {
    let scale = reference.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    ours.into_iter()
        .zip(reference)
        .map(|(a, b)| (a - b).abs() / scale)
        .fold(0.0, f64::max)
}
