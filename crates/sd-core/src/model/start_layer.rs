//! What a run begins with instead of the packing that its seed makes.

use serde::{Deserialize, Serialize};

/// What a run begins with, where that is not the packing that its seed makes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StartFrom {
    /// Hard spheres of radius `a_i + h/2` in thermal equilibrium, drawn by the seed.
    Equilibrium,
    /// A layer from another run or program.
    Layer(Box<StartLayer>),
}

impl From<StartLayer> for StartFrom {
    fn from(layer: StartLayer) -> Self {
        Self::Layer(Box::new(layer))
    }
}

impl StartFrom {
    /// The number of a start in equilibrium in tables.
    pub const EQUILIBRIUM: u32 = 1;

    /// The layer, if it is one.
    pub fn layer(&self) -> Option<&StartLayer> {
        match self {
            Self::Equilibrium => None,
            Self::Layer(layer) => Some(layer),
        }
    }

    /// A positive 32-bit number that identifies it in tables; 0 is left for the packing of the
    /// seed.
    pub fn number(&self) -> u64 {
        match self {
            Self::Equilibrium => Self::EQUILIBRIUM.into(),
            Self::Layer(layer) => layer.number(),
        }
    }
}

/// A layer from another run or program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartLayer {
    /// Side of the square cell, in a.
    pub side: f64,
    /// Offset of the upper image cell along the flow, in a.
    pub offset: f64,
    /// Radii, in a, the largest first.
    pub radii: Vec<f64>,
    /// Centres, in a.
    pub centres: Vec<[f64; 2]>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Stretches of tangential springs, in a, of pairs (i, j) with i < j, ordered; others are
    /// unstretched.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub springs: Vec<(u32, u32, f64)>,
    /// Stretches of the springs of rolling friction, likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rolling_springs: Vec<(u32, u32, f64)>,
    /// A number above 1 for all layers of the same origin, such as the ends of all runs of a
    /// point: runs from them belong to one point too. `None`: a single layer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<u32>,
}

impl StartLayer {
    /// A 32-bit number above 1 that identifies it in tables: that of its origin, or a hash of its
    /// data.
    pub fn number(&self) -> u64 {
        if let Some(origin) = self.origin {
            return origin.into();
        }
        let scalars = [self.side, self.offset];
        let lists = [
            self.radii.as_slice(),
            self.centres.as_flattened(),
            self.orientations.as_slice(),
        ];
        // FNV-1a, by Fowler, Noll & Vo, over the bits of all numbers.
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let springs = self.springs.iter().chain(&self.rolling_springs);
        let stretches = springs.map(|spring| &spring.2);
        let lists = lists.into_iter().flatten().chain(stretches);
        for value in scalars.iter().chain(lists) {
            for byte in value.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        ((hash >> 32) ^ (hash & 0xffff_ffff)).max(2)
    }
}

#[cfg(test)]
mod tests {
    use super::StartLayer;

    #[test]
    fn number_follows_every_part_of_the_layer() {
        let layer = StartLayer {
            side: 10.0,
            offset: 1.0,
            radii: vec![1.0, 1.0],
            centres: vec![[0.0, 0.0], [3.0, 0.0]],
            orientations: vec![0.0, 0.0],
            springs: vec![(0, 1, 1e-3)],
            rolling_springs: vec![(0, 1, 1e-3)],
            origin: None,
        };
        let mut others = vec![layer.clone(); 7];
        others[0].side = 11.0;
        others[1].offset = 1.5;
        others[2].radii[1] = 0.9;
        others[3].centres[1][1] = 1e-9;
        others[4].orientations[0] = 0.1;
        others[5].springs[0].2 = 2e-3;
        others[6].rolling_springs[0].2 = 2e-3;
        for other in others {
            assert_ne!(other.number(), layer.number());
        }
        assert_eq!(layer.clone().number(), layer.number());
        assert!(layer.number() > 1 && layer.number() < 1 << 32);
        let origin = Some(7);
        assert_eq!(StartLayer { origin, ..layer }.number(), 7);
    }
}
