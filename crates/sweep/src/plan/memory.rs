//! Memory and disk space of runs.

use sd_core::{Params, memory_bytes};

/// Bytes of a thread apart from the layer it computes: stack, samples, checkpoints being stored;
/// measured.
const THREAD_BYTES: f64 = 1.0e6;
/// Bytes that the program allocates after a plan begins: the store's cache, the report; measured.
const PROGRAM_BYTES: f64 = 4.0e6;
/// Resident bytes where the system does not report them; measured.
const DEFAULT_RESIDENT_BYTES: f64 = 9.0e6;

/// Resident memory of this process before it computes anything.
pub(super) fn resident_bytes() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<f64>().ok());
    let resident = pages.map_or(DEFAULT_RESIDENT_BYTES, |pages| {
        pages * rustix::param::page_size() as f64
    });
    resident + PROGRAM_BYTES
}

/// Memory of one run.
pub(super) fn run_bytes(params: &Params) -> f64 {
    memory_bytes(params) + THREAD_BYTES
}

/// Bytes of a stored frame with one contact for every sphere.
pub(super) fn frame_bytes(params: &Params) -> f64 {
    let of_space = if params.volume_fraction.is_some() {
        84.0
    } else {
        48.0
    };
    let radius = if params.is_mixed() { 4.0 } else { 0.0 };
    params.spheres as f64 * (of_space + radius)
}
