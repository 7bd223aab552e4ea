use burn::{
    module::{Module, Param},
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData, activation::relu},
};
use credence_nn::{
    Roi, RowNorm,
    conv::{Block, Conv3, Grid, Layer, enlarge},
    rgbd::{HEIGHT, RgbdImage, WIDTH},
    roi_align,
};
use credence_types::Category;

use super::{
    anchors::{FIRST_PROPOSING, PER_CELL, STRIDES, level_grid, to_cells},
    boxes::{Edges, sides},
};

/// Categories and the background, which is class 0.
pub const CLASSES: usize = Category::ALL.len() + 1;

/// Pixels of a side of the blocks that the stems take in as one row.
const BLOCK: usize = 2;
const BLOCK_VALUES: usize = 3 * BLOCK * BLOCK;
/// Channels of the stems for colour and depth, at strides 2 and 4.
const COLOUR: [usize; 2] = [16, 32];
const DEPTH: [usize; 2] = [12, 16];
/// Channels of the backbone at strides 4 to 32, and its residual blocks.
const WIDTHS: [usize; 4] = [COLOUR[1] + DEPTH[1], 64, 112, 160];
const BLOCKS: [usize; 4] = [1, 2, 2, 2];
/// Channels of the pyramid.
const PYRAMID: usize = 64;
/// Bins of a region's side that the heads of class and box, and of the mask, look at.
const BOX_BINS: usize = 7;
const MASK_BINS: usize = 14;
/// Samples of a bin's side.
const SAMPLES: usize = 2;
/// Width of the head of class and box.
const HIDDEN: usize = 256;
/// Convolutions of the mask's head, and its channels at twice the resolution.
const MASK_LAYERS: usize = 3;
const MASK_CHANNELS: usize = 32;
/// Values of a mask's side.
pub const MASK_SIDE: usize = 2 * MASK_BINS;
/// Regions at least this large, root of the area in pixels, are looked at in the second level.
const SECOND_LEVEL_PX: f32 = 96.0;

/// Mask R-CNN (He et al. 2017) on a residual feature pyramid, sized for a CPU: stems for colour and
/// depth, region proposals, and heads of class, box and mask that look at the regions by `RoIAlign`.
#[derive(Module, Debug)]
pub struct MaskRcnnNetwork {
    colour: Stem,
    depth: Stem,
    stages: Vec<Vec<Block>>,
    laterals: Vec<Linear>,
    smooth: Vec<Layer>,
    proposals: ProposalHead,
    boxes: BoxHead,
    masks: MaskHead,
    temperatures: Param<Tensor<1>>,
}

/// Images for the network, on a device.
#[derive(Debug)]
pub struct ImageBatch {
    colour: Tensor<2>,
    depth: Tensor<2>,
    images: usize,
}

/// An image's rows for the stems.
#[derive(Debug, Clone)]
pub struct ImageRows {
    colour: Vec<f32>,
    depth: Vec<f32>,
}

impl ImageRows {
    /// With depth, or with depth withheld.
    pub fn new(image: &RgbdImage, with_depth: bool) -> Self {
        Self {
            colour: image.colour_rows(BLOCK),
            depth: if with_depth {
                image.depth_rows(BLOCK)
            } else {
                vec![0.0; 3 * WIDTH * HEIGHT]
            },
        }
    }
}

impl ImageBatch {
    /// Images side by side.
    pub fn new(images: Vec<ImageRows>, device: &Device) -> Self {
        let count = images.len();
        let (colour, depth): (Vec<_>, Vec<_>) =
            images.into_iter().map(|i| (i.colour, i.depth)).unzip();
        let tensor = |rows: Vec<Vec<f32>>| {
            let shape = [stem_grid(count).rows(), BLOCK_VALUES];
            Tensor::from_data(TensorData::new(rows.concat(), shape), device)
        };
        Self {
            colour: tensor(colour),
            depth: tensor(depth),
            images: count,
        }
    }
}

const fn stem_grid(images: usize) -> Grid {
    Grid {
        images,
        height: HEIGHT / BLOCK,
        width: WIDTH / BLOCK,
    }
}

/// Features at strides 4 to 32 of a number of images.
#[derive(Debug)]
pub struct Pyramid {
    levels: Vec<Tensor<2>>,
    images: usize,
}

/// A part of an image that the heads look at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Index of the image.
    pub image: usize,
    /// Its edges.
    pub edges: Edges,
}

impl Region {
    /// Level of the pyramid that shows it at about the resolution of the heads.
    pub fn level(&self) -> usize {
        let [width, height] = sides(self.edges);
        usize::from(width * height >= SECOND_LEVEL_PX * SECOND_LEVEL_PX)
    }

    fn roi(&self) -> Roi {
        Roi {
            image: self.image,
            edges: self.edges.map(|at| to_cells(at, self.level())),
        }
    }
}

/// What the heads say of regions.
#[derive(Debug)]
pub struct Regarded {
    /// Logits of the classes, `[regions, 7]`.
    pub classes: Tensor<2>,
    /// The object's box told from the region, `[regions, 4]`.
    pub boxes: Tensor<2>,
}

impl MaskRcnnNetwork {
    /// A network with unseeded weights.
    pub fn new(device: &Device) -> Self {
        let mut stages = Vec::with_capacity(WIDTHS.len());
        let mut inputs = WIDTHS[0];
        for (number, (width, blocks)) in WIDTHS.into_iter().zip(BLOCKS).enumerate() {
            let mut stage = Vec::with_capacity(blocks);
            for block in 0..blocks {
                let stride = if number > 0 && block == 0 { 2 } else { 1 };
                stage.push(Block::new(inputs, width, stride, device));
                inputs = width;
            }
            stages.push(stage);
        }
        let lateral = |width| LinearConfig::new(width, PYRAMID).init(device);
        let smooth = |_| Layer::new(PYRAMID, PYRAMID, 1, device);
        Self {
            colour: Stem::new(COLOUR, device),
            depth: Stem::new(DEPTH, device),
            stages,
            laterals: WIDTHS.map(lateral).to_vec(),
            smooth: WIDTHS.map(smooth).to_vec(),
            proposals: ProposalHead::new(device),
            boxes: BoxHead::new(device),
            masks: MaskHead::new(device),
            temperatures: temperatures([1.0; 2], device),
        }
    }

    /// The features of images.
    pub fn features(&self, images: &ImageBatch) -> Pyramid {
        let grid = stem_grid(images.images);
        let colour = self.colour.forward(images.colour.clone(), grid);
        let depth = self.depth.forward(images.depth.clone(), grid);
        let mut x = Tensor::cat(vec![colour, depth], 1);
        let mut grid = grid.every(2);
        let mut stages = Vec::with_capacity(self.stages.len());
        for stage in &self.stages {
            for block in stage {
                (x, grid) = block.forward(x, grid);
            }
            stages.push((x.clone(), grid));
        }
        let mut coarser: Option<Tensor<2>> = None;
        let mut levels = Vec::with_capacity(stages.len());
        let layers = self.laterals.iter().zip(&self.smooth);
        for ((stage, grid), (lateral, smooth)) in stages.into_iter().zip(layers).rev() {
            let own = lateral.forward(stage);
            let merged = match coarser {
                Some(coarser) => own + enlarge(coarser, grid),
                None => own,
            };
            levels.push(smooth.forward(merged.clone(), grid));
            coarser = Some(merged);
        }
        levels.reverse();
        Pyramid {
            levels,
            images: images.images,
        }
    }

    /// Logits of objectness, `[anchors, 1]`, and boxes told from the anchors, `[anchors, 4]`, in the
    /// order of [`Anchors::row`](super::Anchors::row).
    pub fn propose(&self, pyramid: &Pyramid) -> (Tensor<2>, Tensor<2>) {
        self.proposals.forward(pyramid)
    }

    /// What the heads of class and box say of regions. The regions come in an order of their own:
    /// [`in_order`].
    ///
    /// # Panics
    /// Without regions, or with regions in another order.
    pub fn regard(&self, pyramid: &Pyramid, regions: &[Region]) -> Regarded {
        self.boxes.forward(look(pyramid, regions, BOX_BINS))
    }

    /// Logits of the masks of regions, `[regions * 28 * 28, 6]`: one for each category. The rows of
    /// a region lie by [`mask_row`].
    ///
    /// # Panics
    /// Without regions, or with regions in another order than that of [`in_order`].
    pub fn masks(&self, pyramid: &Pyramid, regions: &[Region]) -> Tensor<2> {
        self.masks
            .forward(look(pyramid, regions, MASK_BINS), regions.len())
    }

    /// What the logits of the classes are divided by, without and with depth.
    pub fn temperatures(&self) -> [f32; 2] {
        let values: Vec<f32> = self.temperatures.val().into_data().iter().collect();
        [values[0], values[1]]
    }

    /// The network with other temperatures.
    #[must_use]
    pub fn with_temperatures(mut self, values: [f32; 2], device: &Device) -> Self {
        self.temperatures = temperatures(values, device);
        self
    }
}

fn temperatures(values: [f32; 2], device: &Device) -> Param<Tensor<1>> {
    Param::from_tensor(Tensor::from_data(values, device)).set_require_grad(false)
}

/// Sorts regions as the heads take them: those of the first level first.
pub fn in_order(regions: &mut [Region]) {
    regions.sort_by_key(Region::level);
}

/// Place, among a region's mask logits, of a value of its mask: the layer that doubles the
/// resolution tells four values of a bin side by side.
pub const fn mask_row(row: usize, column: usize) -> usize {
    let bin = row / 2 * MASK_BINS + column / 2;
    4 * bin + 2 * (row % 2) + column % 2
}

/// What regions show, `[regions * bins * bins, 64]`.
fn look(pyramid: &Pyramid, regions: &[Region], bins: usize) -> Tensor<2> {
    let sorted = regions.is_sorted_by_key(Region::level);
    assert!(sorted && !regions.is_empty(), "regions in their order");
    let first = regions.iter().filter(|r| r.level() == 0).count();
    let (first, second) = regions.split_at(first);
    let parts = [first, second].into_iter().enumerate();
    let parts = parts.filter(|(_, regions)| !regions.is_empty());
    let looked = parts.map(|(level, regions)| {
        let rois: Vec<Roi> = regions.iter().map(Region::roi).collect();
        let grid = level_grid(level, pyramid.images);
        roi_align(pyramid.levels[level].clone(), grid, &rois, bins, SAMPLES)
    });
    Tensor::cat(looked.collect(), 0)
}

/// Two convolutions to stride 4.
#[derive(Module, Debug)]
struct Stem {
    first: Layer,
    second: Layer,
}

impl Stem {
    fn new([half, quarter]: [usize; 2], device: &Device) -> Self {
        Self {
            first: Layer::new(BLOCK_VALUES, half, 1, device),
            second: Layer::new(half, quarter, 2, device),
        }
    }

    fn forward(&self, rows: Tensor<2>, grid: Grid) -> Tensor<2> {
        self.second.forward(self.first.forward(rows, grid), grid)
    }
}

/// Region proposals: one head for all levels, whose statistics are those of all together.
#[derive(Module, Debug)]
struct ProposalHead {
    conv: Conv3,
    norm: RowNorm,
    objectness: Linear,
    boxes: Linear,
}

impl ProposalHead {
    fn new(device: &Device) -> Self {
        Self {
            conv: Conv3::new(PYRAMID, PYRAMID, 1, device),
            norm: RowNorm::new(PYRAMID, device),
            objectness: LinearConfig::new(PYRAMID, PER_CELL).init(device),
            boxes: LinearConfig::new(PYRAMID, 4 * PER_CELL).init(device),
        }
    }

    fn forward(&self, pyramid: &Pyramid) -> (Tensor<2>, Tensor<2>) {
        let levels = FIRST_PROPOSING..STRIDES.len();
        let seen = levels.map(|level| {
            let grid = level_grid(level, pyramid.images);
            self.conv.forward(pyramid.levels[level].clone(), grid)
        });
        let seen = relu(self.norm.forward(Tensor::cat(seen.collect(), 0)));
        let [cells, _] = seen.dims();
        let objectness = self.objectness.forward(seen.clone());
        let boxes = self.boxes.forward(seen);
        (
            objectness.reshape([cells * PER_CELL, 1]),
            boxes.reshape([cells * PER_CELL, 4]),
        )
    }
}

/// Class and box of a region.
#[derive(Module, Debug)]
struct BoxHead {
    first: Linear,
    norm: RowNorm,
    second: Linear,
    classes: Linear,
    boxes: Linear,
}

impl BoxHead {
    fn new(device: &Device) -> Self {
        let linear = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        Self {
            first: LinearConfig::new(BOX_BINS * BOX_BINS * PYRAMID, HIDDEN)
                .with_bias(false)
                .init(device),
            norm: RowNorm::new(HIDDEN, device),
            second: linear(HIDDEN, HIDDEN),
            classes: linear(HIDDEN, CLASSES),
            boxes: linear(HIDDEN, 4),
        }
    }

    fn forward(&self, looked: Tensor<2>) -> Regarded {
        let [rows, channels] = looked.dims();
        let values = BOX_BINS * BOX_BINS;
        let flat = looked.reshape([rows / values, values * channels]);
        let x = relu(self.norm.forward(self.first.forward(flat)));
        let x = relu(self.second.forward(x));
        Regarded {
            classes: self.classes.forward(x.clone()),
            boxes: self.boxes.forward(x),
        }
    }
}

/// The mask of a region, per category.
#[derive(Module, Debug)]
struct MaskHead {
    layers: Vec<Layer>,
    /// A transposed convolution of 2x2 pixels and stride 2: four pixels of each.
    enlarge: Linear,
    logits: Linear,
}

impl MaskHead {
    fn new(device: &Device) -> Self {
        let layer = |_| Layer::new(PYRAMID, PYRAMID, 1, device);
        Self {
            layers: (0..MASK_LAYERS).map(layer).collect(),
            enlarge: LinearConfig::new(PYRAMID, 4 * MASK_CHANNELS).init(device),
            logits: LinearConfig::new(MASK_CHANNELS, Category::ALL.len()).init(device),
        }
    }

    fn forward(&self, looked: Tensor<2>, regions: usize) -> Tensor<2> {
        let grid = Grid {
            images: regions,
            height: MASK_BINS,
            width: MASK_BINS,
        };
        let mut x = looked;
        for layer in &self.layers {
            x = layer.forward(x, grid);
        }
        let [rows, _] = x.dims();
        let x = relu(self.enlarge.forward(x));
        self.logits.forward(x.reshape([4 * rows, MASK_CHANNELS]))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn mask_rows_are_each_value_once_and_four_to_a_bin() {
        let all = (0..MASK_SIDE).flat_map(|y| (0..MASK_SIDE).map(move |x| mask_row(y, x)));
        let all: BTreeSet<usize> = all.collect();
        assert_eq!(all.len(), MASK_SIDE * MASK_SIDE);
        assert_eq!(all.last(), Some(&(MASK_SIDE * MASK_SIDE - 1)));
        assert_eq!([mask_row(0, 0), mask_row(0, 1), mask_row(1, 0)], [0, 1, 2]);
        assert_eq!([mask_row(0, 2), mask_row(2, 0)], [4, 4 * MASK_BINS]);
    }

    #[test]
    fn each_part_tells_of_as_much_as_it_is_asked() {
        let device = Device::flex();
        let network = MaskRcnnNetwork::new(&device);
        let image = RgbdImage {
            rgb: vec![[90, 120, 10]; WIDTH * HEIGHT],
            depth_m: vec![0.5; WIDTH * HEIGHT],
        };
        let rows = [true, false].map(|depth| ImageRows::new(&image, depth));
        let pyramid = network.features(&ImageBatch::new(rows.to_vec(), &device));
        let (objectness, boxes) = network.propose(&pyramid);
        assert_eq!(objectness.dims(), [2 * 1580 * 6, 1]);
        assert_eq!(boxes.dims(), [2 * 1580 * 6, 4]);
        let region = |image, side: f32| Region {
            image,
            edges: [10.0, 10.0, 10.0 + side, 10.0 + side],
        };
        let mut regions = vec![region(1, 120.0), region(0, 40.0), region(1, 60.0)];
        in_order(&mut regions);
        assert_eq!(regions[2], region(1, 120.0));
        let regarded = network.regard(&pyramid, &regions);
        assert_eq!(regarded.classes.dims(), [3, CLASSES]);
        assert_eq!(regarded.boxes.dims(), [3, 4]);
        assert_eq!(network.masks(&pyramid, &regions).dims(), [3 * 784, 6]);
    }

    #[test]
    fn temperatures_are_kept_with_the_weights() {
        let device = Device::flex();
        let network = MaskRcnnNetwork::new(&device).with_temperatures([1.5, 0.75], &device);
        let bytes = credence_nn::weights::to_bytes(&network).unwrap();
        let read = MaskRcnnNetwork::new(&device);
        let read = credence_nn::weights::from_bytes(read, bytes, "test").unwrap();
        assert_eq!(read.temperatures(), [1.5, 0.75]);
    }
}
