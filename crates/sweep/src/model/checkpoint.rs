//! The format of a checkpoint: the state of a run, versioned, with a checksum. The samples and
//! frames before it are rows of the store.

use crate::model::spaces::AnySnapshot;
use sd_core::Sample;
use sd_core::simulation::{Counters, SNAPSHOT_VERSION};
use serde::{Deserialize, Serialize};

/// First bytes of every checkpoint.
const MAGIC: [u8; 4] = *b"SWCP";
/// Version of the format: a hundred times its own, plus that of the snapshot in it.
const VERSION: u32 = 500 + SNAPSHOT_VERSION;
/// Bytes before the content: magic, version, checksum.
const HEADER: usize = 4 + 4 + 32;

/// An unfinished run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// State of the layer or suspension.
    pub snapshot: AnySnapshot,
    /// Digest of the samples so far, which must be those in the store; `None` without any.
    pub samples_digest: Option<i64>,
    /// Seconds of computing so far.
    pub wall_time_s: f64,
    /// CPU seconds so far.
    pub cpu_time_s: f64,
    /// Number of times the run was resumed from a checkpoint.
    pub resumed: u32,
}

/// Why bytes are not a usable checkpoint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BadCheckpoint {
    /// Too short, or something else.
    #[error("not a checkpoint")]
    Foreign,
    /// Whole, but of another format.
    #[error("format {found}, and this program reads {VERSION}")]
    Version {
        /// Its version.
        found: u32,
    },
    /// The checksum does not agree.
    #[error("torn or corrupt: the checksum does not agree")]
    Checksum,
    /// A number in it is not finite.
    #[error("not all numbers are finite")]
    Numbers,
    /// The content cannot be read in spite of an agreeing checksum.
    #[error("unreadable content: {0}")]
    Content(postcard::Error),
}

/// Whether a sample has the numbers that every row has. A viscosity of NaN is kept as such.
pub(crate) fn can_be_kept(sample: &Sample) -> bool {
    sample.strain.is_finite() && sample.normal_velocity.is_finite()
}

impl Checkpoint {
    /// As bytes.
    ///
    /// # Errors
    /// Those of the encoder, which cannot occur for this data.
    pub fn encode(&self) -> Result<Vec<u8>, postcard::Error> {
        let content = postcard::to_stdvec(self)?;
        let mut bytes = Vec::with_capacity(HEADER + content.len());
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(blake3::hash(&content).as_bytes());
        bytes.extend_from_slice(&content);
        Ok(bytes)
    }

    /// From bytes.
    ///
    /// # Errors
    /// [`BadCheckpoint`] if these are not the bytes of a whole checkpoint of this version.
    pub fn decode(bytes: &[u8]) -> Result<Self, BadCheckpoint> {
        let (header, content) = bytes
            .split_at_checked(HEADER)
            .ok_or(BadCheckpoint::Foreign)?;
        let rest = header.strip_prefix(&MAGIC).ok_or(BadCheckpoint::Foreign)?;
        let (version, checksum) = rest
            .split_first_chunk::<4>()
            .ok_or(BadCheckpoint::Foreign)?;
        if blake3::hash(content).as_bytes() != checksum {
            return Err(BadCheckpoint::Checksum);
        }
        let found = u32::from_le_bytes(*version);
        if found != VERSION {
            return Err(BadCheckpoint::Version { found });
        }
        let checkpoint: Self = postcard::from_bytes(content).map_err(BadCheckpoint::Content)?;
        if checkpoint.has_numbers() {
            Ok(checkpoint)
        } else {
            Err(BadCheckpoint::Numbers)
        }
    }

    /// Whether required numbers are finite.
    fn has_numbers(&self) -> bool {
        let counters = |c: &Counters| {
            !(c.worst_residual.is_nan()
                || c.worst_friction_error.is_nan()
                || c.minimum_gap.is_nan())
        };
        self.wall_time_s.is_finite()
            && self.cpu_time_s.is_finite()
            && counters(self.snapshot.counters())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::spaces::{AnySimulation, InSpace};
    use proptest::prelude::*;
    use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params};
    use std::sync::LazyLock;

    /// Bytes with a header that is right, so that the decoder itself is reached.
    fn with_true_checksum(content: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(blake3::hash(content).as_bytes());
        bytes.extend_from_slice(content);
        bytes
    }

    /// A small layer after a few steps, and its parameters.
    static LAYER: LazyLock<(Params, AnySnapshot)> = LazyLock::new(|| {
        let params = Params::builder()
            .spheres(16)
            .area_fraction(0.4)
            .roughness(0.05)
            .friction(0.3)
            .shear_rate(1.0)
            .hydrodynamics(Hydrodynamics::BallMelrose)
            .contact(ContactScheme::Procedure)
            .time_step(0.005)
            .build()
            .unwrap();
        let mut layer = AnySimulation::new(&params, 3, &NearFields::default()).unwrap();
        for _ in 0..20 {
            layer.step().unwrap();
        }
        let snapshot = layer.snapshot();
        (params, snapshot)
    });

    #[test]
    fn a_length_beyond_the_bytes_takes_no_memory() {
        // A list with a length of 2^60 in its header.
        let mut content = vec![1, 12];
        content.extend_from_slice(&[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x0f]);
        assert!(Checkpoint::decode(&with_true_checksum(&content)).is_err());
    }

    fn checkpoint() -> Checkpoint {
        Checkpoint {
            snapshot: crate::test_support::snapshot(12),
            samples_digest: Some(-7),
            wall_time_s: 0.25,
            cpu_time_s: 0.2,
            resumed: 1,
        }
    }

    #[test]
    fn round_trip_keeps_every_bit() {
        let bytes = checkpoint().encode().unwrap();
        assert_eq!(Checkpoint::decode(&bytes).unwrap(), checkpoint());
    }

    #[test]
    fn what_is_no_number_in_a_forged_one_is_noticed() {
        let forge: [fn(&mut Checkpoint); 2] = [
            |c| c.wall_time_s = f64::NAN,
            |c| match &mut c.snapshot {
                InSpace::Layer(layer) => layer.counters.minimum_gap = f64::NAN,
                InSpace::Suspension(_) => unreachable!("a layer was made"),
            },
        ];
        for forge in forge {
            let mut forged = checkpoint();
            forge(&mut forged);
            let bytes = forged.encode().unwrap();
            assert_eq!(Checkpoint::decode(&bytes), Err(BadCheckpoint::Numbers));
        }
    }

    #[test]
    fn torn_at_any_byte_is_noticed() {
        let bytes = checkpoint().encode().unwrap();
        for length in 0..bytes.len() {
            assert!(Checkpoint::decode(&bytes[..length]).is_err());
        }
    }

    proptest! {
        #[test]
        fn a_changed_bit_is_noticed(at in 0usize..600, bit in 0u8..8) {
            let mut bytes = checkpoint().encode().unwrap();
            let at = at % bytes.len();
            bytes[at] ^= 1 << bit;
            prop_assert!(Checkpoint::decode(&bytes).is_err());
        }

        #[test]
        fn no_bytes_crash_the_decoder(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(Checkpoint::decode(&bytes).is_err());
        }

        #[test]
        fn no_content_crashes_the_decoder(content in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = Checkpoint::decode(&with_true_checksum(&content));
        }

        #[test]
        fn no_damaged_content_crashes_the_decoder_or_the_run(
            at in 0usize..2000, put in proptest::collection::vec(any::<u8>(), 0..6), cut in 0usize..6,
        ) {
            let layer = &*LAYER;
            let bytes = Checkpoint { snapshot: layer.1.clone(), ..checkpoint() }.encode().unwrap();
            let mut content = bytes[HEADER..].to_vec();
            let at = at % content.len();
            let end = (at + cut).min(content.len());
            content.splice(at..end, put);
            if let Ok(found) = Checkpoint::decode(&with_true_checksum(&content))
                && let Ok(mut run) = AnySimulation::from_snapshot(&layer.0, found.snapshot, &NearFields::default())
            {
                let _ = run.step();
            }
        }
    }
}
