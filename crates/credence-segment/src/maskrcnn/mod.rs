//! Mask R-CNN: region proposals from a feature pyramid, and class, box and mask of each region.

mod anchors;
mod boxes;
mod detection;
mod detector;
mod letterbox;
mod network;
mod proposals;

pub use anchors::Anchors;
pub use boxes::{Edges, clip, decode, encode, sides};
pub use detection::{Detection, mask_iou};
pub use detector::{Input, LEAST_TOLD, MaskRcnn, REGION_UNIT, softmax};
pub use network::{
    CLASSES, ImageBatch, ImageRows, MASK_SIDE, MaskRcnnNetwork, Pyramid, Regarded, Region,
    in_order, mask_row,
};
pub use proposals::{ANCHOR_UNIT, proposals};
