use credence_map::{Association, SemanticMapConfig, TrackerConfig};
use serde::{Deserialize, Serialize};

use crate::AssociationChoice;

/// Settings of the semantic map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MapConfig {
    /// Edge of the smallest voxel, metres.
    pub resolution_m: f64,
    /// Rays are cut at this range, metres.
    pub max_range_m: f64,
    /// How a detection finds its object.
    pub association: AssociationChoice,
    /// Largest distance of a detection from its object, by that measure, metres.
    pub association_gate_m: f64,
}

impl Default for MapConfig {
    fn default() -> Self {
        let map = SemanticMapConfig::default();
        let (association, association_gate_m) = match map.tracker.association {
            Association::Surface { gate_m } => (AssociationChoice::Surface, gate_m),
            Association::Centroid { gate_m } => (AssociationChoice::Centroid, gate_m),
        };
        Self {
            resolution_m: map.resolution_m,
            max_range_m: map.max_range_m.unwrap_or(2.0),
            association,
            association_gate_m,
        }
    }
}

impl MapConfig {
    /// What the map is made with.
    pub(crate) fn settings(&self) -> SemanticMapConfig {
        let gate_m = self.association_gate_m;
        SemanticMapConfig {
            resolution_m: self.resolution_m,
            max_range_m: Some(self.max_range_m),
            tracker: TrackerConfig {
                association: match self.association {
                    AssociationChoice::Surface => Association::Surface { gate_m },
                    AssociationChoice::Centroid => Association::Centroid { gate_m },
                },
                ..TrackerConfig::default()
            },
            ..SemanticMapConfig::default()
        }
    }
}
