use burn::{
    module::{Module, Param},
    nn::{Linear, LinearConfig},
    tensor::{Device, Int, Tensor, TensorData},
};
use credence_nn::{
    Mlp,
    conv::{Block, Grid, Layer, enlarge},
    rgbd::RgbdImage,
};
use credence_types::Category;

use super::{
    autoencoder::LATENT,
    image::{BLOCK, BLOCK_VALUES, stem_grid},
    pose::POSE,
};

/// Number of categories.
pub(super) const CATEGORIES: usize = Category::ALL.len();

/// Channels of each stem, and of the backbone at strides 4 to 32.
const STEM: usize = 12;
const WIDTHS: [usize; 4] = [2 * STEM, 48, 96, 160];
/// Residual blocks at those strides.
const BLOCKS: [usize; 4] = [1, 2, 2, 2];
/// Channels of the pyramid, and of the features that the heads look at.
const PYRAMID: usize = 64;
const FEATURES: usize = 96;

/// The network of `CenterSnap`: small stems for colour and depth, a residual network, a feature
/// pyramid, and heads at stride 8.
#[derive(Module, Debug)]
pub struct CenterSnapNetwork {
    colour: Stem,
    depth: Stem,
    stages: Vec<Vec<Block>>,
    laterals: Vec<Linear>,
    smooth: Layer,
    features: Layer,
    heat: Linear,
    shape: Mlp,
    pose: Mlp,
    seen_depth: Linear,
    segments: Linear,
    statistics: Statistics,
}

/// What the network says of every cell of its images, a row each.
#[derive(Debug)]
pub struct Cells {
    /// What the heads of shape and pose look at, `[cells, 96]`.
    pub features: Tensor<2>,
    /// How near the centre of an object of each category is, `[cells, 6]`: 1 at it.
    pub heat: Tensor<2>,
    /// Auxiliary: depth, in the units of the network, `[cells, 1]`.
    pub depth: Tensor<2>,
    /// Auxiliary: logits of background and the categories, `[cells, 7]`.
    pub segments: Tensor<2>,
}

/// Images for the network, on a device.
#[derive(Debug)]
pub struct ImageBatch {
    colour: Tensor<2>,
    depth: Tensor<2>,
    images: usize,
}

impl ImageBatch {
    /// Images side by side.
    pub fn new(images: &[RgbdImage], device: &Device) -> Self {
        let colour = images.iter().map(|i| i.colour_rows(BLOCK)).collect();
        let depth = images.iter().map(|i| i.depth_rows(BLOCK)).collect();
        Self::of_rows(colour, depth, device)
    }

    /// The same from the images' rows.
    pub fn of_rows(colour: Vec<Vec<f32>>, depth: Vec<Vec<f32>>, device: &Device) -> Self {
        let images = colour.len();
        let tensor = |rows: Vec<Vec<f32>>| {
            let data = TensorData::new(rows.concat(), [stem_grid(images).rows(), BLOCK_VALUES]);
            Tensor::from_data(data, device)
        };
        Self {
            colour: tensor(colour),
            depth: tensor(depth),
            images,
        }
    }
}

impl CenterSnapNetwork {
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
        let linear = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        Self {
            colour: Stem::new(device),
            depth: Stem::new(device),
            stages,
            laterals: WIDTHS[1..]
                .iter()
                .map(|width| linear(*width, PYRAMID))
                .collect(),
            smooth: Layer::new(PYRAMID, PYRAMID, 1, device),
            features: Layer::new(PYRAMID, FEATURES, 1, device),
            heat: linear(FEATURES, CATEGORIES),
            shape: Mlp::new([FEATURES, 2 * FEATURES, LATENT], device),
            pose: Mlp::new([FEATURES, 2 * FEATURES, POSE], device),
            seen_depth: linear(FEATURES, 1),
            segments: linear(FEATURES, CATEGORIES + 1),
            statistics: Statistics::new(device),
        }
    }

    /// What the network says of each cell, image by image, row by row.
    pub fn forward(&self, images: &ImageBatch) -> Cells {
        let mut grid = stem_grid(images.images);
        let colour = self.colour.forward(images.colour.clone(), grid);
        let depth = self.depth.forward(images.depth.clone(), grid);
        let mut x = Tensor::cat(vec![colour, depth], 1);
        let mut levels = Vec::with_capacity(self.stages.len());
        for stage in &self.stages {
            for block in stage {
                (x, grid) = block.forward(x, grid);
            }
            levels.push((x.clone(), grid));
        }
        // From the coarsest level down to stride 8; stride 4 has no lateral.
        let mut pyramid: Option<Tensor<2>> = None;
        for ((level, grid), lateral) in levels.into_iter().skip(1).zip(&self.laterals).rev() {
            let own = lateral.forward(level);
            pyramid = Some(match pyramid {
                Some(coarser) => own + enlarge(coarser, grid),
                None => own,
            });
        }
        let grid = stem_grid(images.images).every(2);
        let pyramid = pyramid.unwrap_or(x);
        let features = self
            .features
            .forward(self.smooth.forward(pyramid, grid), grid);
        Cells {
            heat: self.heat.forward(features.clone()),
            depth: self.seen_depth.forward(features.clone()),
            segments: self.segments.forward(features.clone()),
            features,
        }
    }

    /// Shape, `[cells, 128]` in units of the statistics, and pose, `[cells, 13]`, told at some of
    /// the cells.
    pub fn objects(&self, features: &Tensor<2>, cells: &[usize]) -> (Tensor<2>, Tensor<2>) {
        let rows: Vec<i32> = cells.iter().map(|c| (*c as u32).cast_signed()).collect();
        let rows = TensorData::new(rows, [cells.len()]);
        let rows = Tensor::<1, Int>::from_data(rows, &features.device());
        let features = features.clone().select(0, rows);
        (
            self.shape.forward(features.clone()),
            self.pose.forward(features),
        )
    }

    /// Numbers that belong to the weights but are not learned from gradients.
    pub const fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// The network with other such numbers.
    #[must_use]
    pub fn with_statistics(mut self, values: &StatisticValues, device: &Device) -> Self {
        self.statistics = Statistics::of(values, device);
        self
    }
}

/// Numbers that are measured, not learned from gradients.
#[derive(Module, Debug)]
pub struct Statistics {
    latent_mean: Param<Tensor<1>>,
    latent_scale: Param<Tensor<1>>,
    latent_error: Param<Tensor<2>>,
    pose_error: Param<Tensor<2>>,
    spread_factor: Param<Tensor<1>>,
}

/// The numbers of [`Statistics`] on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct StatisticValues {
    /// Mean latent of the training meshes.
    pub latent_mean: Vec<f32>,
    /// Root mean square deviation from it: the unit of the network's latents.
    pub latent_scale: f32,
    /// Standard deviation of the error of each number of the latent, in that unit, by category.
    pub latent_error: Vec<[f32; LATENT]>,
    /// The same of each number of the pose.
    pub pose_error: Vec<[f32; POSE]>,
    /// What the spread of the samples is multiplied by to be the distance from the truth, by
    /// category.
    pub spread_factor: Vec<f32>,
}

impl Default for StatisticValues {
    /// Those of a network that has not been measured: no spread.
    fn default() -> Self {
        Self {
            latent_mean: vec![0.0; LATENT],
            latent_scale: 1.0,
            latent_error: vec![[0.0; LATENT]; CATEGORIES],
            pose_error: vec![[0.0; POSE]; CATEGORIES],
            spread_factor: vec![1.0; CATEGORIES],
        }
    }
}

impl Statistics {
    fn new(device: &Device) -> Self {
        Self::of(&StatisticValues::default(), device)
    }

    fn of(values: &StatisticValues, device: &Device) -> Self {
        fn param<const D: usize>(
            values: Vec<f32>,
            shape: [usize; D],
            device: &Device,
        ) -> Param<Tensor<D>> {
            let tensor = Tensor::from_data(TensorData::new(values, shape), device);
            Param::from_tensor(tensor).set_require_grad(false)
        }
        Self {
            latent_mean: param(values.latent_mean.clone(), [LATENT], device),
            latent_scale: param(vec![values.latent_scale], [1], device),
            latent_error: param(values.latent_error.concat(), [CATEGORIES, LATENT], device),
            pose_error: param(values.pose_error.concat(), [CATEGORIES, POSE], device),
            spread_factor: param(values.spread_factor.clone(), [CATEGORIES], device),
        }
    }

    /// The numbers on the host.
    pub fn values(&self) -> StatisticValues {
        fn read<const D: usize>(param: &Param<Tensor<D>>) -> Vec<f32> {
            param.val().into_data().iter::<f32>().collect()
        }
        StatisticValues {
            latent_mean: read(&self.latent_mean),
            latent_scale: read(&self.latent_scale)[0],
            latent_error: read(&self.latent_error).as_chunks().0.to_vec(),
            pose_error: read(&self.pose_error).as_chunks().0.to_vec(),
            spread_factor: read(&self.spread_factor),
        }
    }
}

/// Blocks of 4x4 pixels and their neighbours: what a convolution of 12x12 pixels sees.
#[derive(Module, Debug)]
struct Stem {
    layer: Layer,
}

impl Stem {
    fn new(device: &Device) -> Self {
        Self {
            layer: Layer::new(BLOCK_VALUES, STEM, 1, device),
        }
    }

    fn forward(&self, rows: Tensor<2>, grid: Grid) -> Tensor<2> {
        self.layer.forward(rows, grid)
    }
}
