//! Memory and room on disk that runs take.

use crate::trajectory;
use sd_core::simulation::{Frame, FrameContact};
use sd_core::{Params, memory_bytes};

/// Bytes a thread takes besides the layer it computes: its stack, samples, checkpoints on their way to the store; measured.
const THREAD_BYTES: f64 = 1.0e6;
/// Bytes the program takes beyond what it has taken when a plan begins: the store's cache, the report; measured.
const PROGRAM_BYTES: f64 = 4.0e6;
/// Resident bytes where the system does not tell; measured.
const USUAL_RESIDENT_BYTES: f64 = 9.0e6;

/// Resident memory of a program that computes nothing yet: this one, now.
pub(super) fn resident_bytes() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<f64>().ok());
    let resident = pages.map_or(USUAL_RESIDENT_BYTES, |pages| {
        pages * rustix::param::page_size() as f64
    });
    resident + PROGRAM_BYTES
}

/// Memory of one run.
pub(super) fn run_bytes(params: &Params) -> f64 {
    memory_bytes(params) + THREAD_BYTES
}

/// Bytes of a stored frame of a layer with one contact for every sphere.
pub(super) fn frame_bytes(params: &Params) -> f64 {
    let n = params.spheres;
    let contact = |i: usize| FrameContact {
        i,
        j: i,
        normal: [0.6, 0.8],
        gap: 0.01,
        normal_force: 1.0,
        tangential_force: 0.1,
        rolling_force: 0.0,
        state: sd_core::contact::ContactState::Rolling,
    };
    let frame = Frame {
        radii: (0..n)
            .map(|i| {
                if params.size_ratio > 1.0 {
                    i as f64
                } else {
                    1.0
                }
            })
            .collect(),
        centres: vec![[0.1; 2]; n],
        orientations: vec![0.1; n],
        stresslets: vec![[0.1; 3]; n],
        contacts: (0..n).map(contact).collect(),
        ..Frame::default()
    };
    // Frames of such layers always have an encoding.
    trajectory::encode(&frame).map_or(0.0, |bytes| bytes.len() as f64)
}
