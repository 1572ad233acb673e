//! Memory and disk space of runs.

use crate::model::spaces::InSpace;
use crate::trajectory;
use sd_core::simulation::{Frame, FrameContact};
use sd_core::{Bulk, Layer, Params, Space, memory_bytes};

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
    let frame = if params.volume_fraction.is_some() {
        InSpace::Suspension(some_frame::<Bulk>(params))
    } else {
        InSpace::Layer(some_frame::<Layer>(params))
    };
    // Such frames can always be encoded.
    trajectory::encode(&frame).map_or(0.0, |bytes| bytes.len() as f64)
}

/// A frame as long as those of a run.
fn some_frame<S: Space>(params: &Params) -> Frame<S> {
    let n = params.spheres;
    let contact = |i: usize| FrameContact {
        i,
        j: i,
        normal: S::Point::default(),
        gap: 0.01,
        normal_force: 1.0,
        tangential_force: S::Tangent::default(),
        rolling_force: S::Tangent::default(),
        state: sd_core::contact::ContactState::Sticking,
    };
    let mixed = params.is_mixed();
    Frame {
        radii: (0..n).map(|i| if mixed { i as f64 } else { 1.0 }).collect(),
        centres: vec![S::Point::default(); n],
        orientations: vec![S::UPRIGHT; n],
        stresslets: vec![S::Tensor::default(); n],
        contacts: (0..n).map(contact).collect(),
        ..Frame::default()
    }
}
