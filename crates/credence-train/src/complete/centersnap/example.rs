use credence_complete::centersnap::{Anchor, BLOCK, CELLS, LATENT, POSE, STRIDE, anchors};
use credence_nn::rgbd::RgbdImage;
use credence_types::Category;
use rand::Rng;

use super::truth::{Shapes, is_told, pose};
use crate::data::{Picture, Shown};

/// Number of categories.
pub(super) const CATEGORIES: usize = Category::ALL.len();
/// Shape and pose are learned where the heat is above this.
const WARM: f64 = 0.3;
/// Spread of an object's heat as a share of its diagonal in the image, and its limits, cells.
const HEAT_SHARE: f64 = 0.1;
const HEAT_CELLS: [f64; 2] = [1.0, 2.5];
/// Middle and spread of the auxiliary depth, metres.
const DEPTH_M: [f32; 2] = [0.5, 0.2];

/// A picture and what the network should say of it.
#[derive(Debug, Clone)]
pub(super) struct Example {
    pub(super) colour: Vec<f32>,
    pub(super) depth: Vec<f32>,
    /// Of each cell and category.
    pub(super) heat: Vec<f32>,
    /// Cells that tell of an object, with the object's place among the latents and its pose.
    pub(super) warm: Vec<(usize, usize, [f32; POSE])>,
    /// Of each object.
    pub(super) latents: Vec<[f32; LATENT]>,
    /// Of each cell, in units of the network; `None` beyond the horizon.
    pub(super) seen_depth: Vec<Option<f32>>,
    /// Of each cell, 0 the background.
    pub(super) segments: Vec<usize>,
}

impl Example {
    pub(super) fn new(picture: Picture<'_>, shapes: &Shapes, rng: &mut impl Rng) -> Self {
        let [across, down] = CELLS;
        let middle = |cell: usize| {
            let at = |place: usize| place * STRIDE + STRIDE / 2;
            at(cell / across) * Picture::SIZE[0] + at(cell % across)
        };
        let seen_depth = (0..across * down)
            .map(|cell| {
                let depth = picture.true_depth_m[middle(cell)];
                depth.is_finite().then(|| (depth - DEPTH_M[0]) / DEPTH_M[1])
            })
            .collect();
        let segments = (0..across * down)
            .map(|cell| {
                let owner = picture.owners[middle(cell)];
                owner.map_or(0, |number| class_of(&picture.objects[usize::from(number)]))
            })
            .collect();
        let told: Vec<Shown<'_>> = picture.objects.iter().copied().filter(is_told).collect();
        let image = RgbdImage {
            rgb: picture.rgb,
            depth_m: picture.depth_m,
        };
        let anchors = anchors(&image);
        let (heat, warm) = heat(&told, &anchors);
        let latents = told.iter().map(|object| {
            let (_, turn) = pose(object);
            shapes.latent(object.mesh, turn, rng)
        });
        Self {
            latents: latents.collect(),
            heat,
            warm,
            seen_depth,
            segments,
            colour: image.colour_rows(BLOCK),
            depth: image.depth_rows(BLOCK),
        }
    }
}

fn class_of(object: &Shown<'_>) -> usize {
    usize::from(object.mesh.category.class())
}

type Warm = Vec<(usize, usize, [f32; POSE])>;

/// The heat of each cell, exp(-d^2 / 2 s^2) at a distance of d cells from an object's projected
/// centre, the highest of its category; and for cells warmer than 0.3 the pose of the object that
/// warms them most, told from there.
fn heat(objects: &[Shown<'_>], anchors: &[Anchor]) -> (Vec<f32>, Warm) {
    let mut heats = vec![0.0_f32; anchors.len() * CATEGORIES];
    let mut warm = Vec::new();
    let places: Vec<([f64; 2], f64)> = objects.iter().map(centre_and_spread).collect();
    for (cell, anchor) in anchors.iter().enumerate() {
        let mut warmest = (WARM, None);
        for (number, (object, (centre, spread))) in objects.iter().zip(&places).enumerate() {
            let [du, dv] = [0, 1].map(|i| (anchor.pixel[i] - centre[i]) / STRIDE as f64);
            let heat = (-(du * du + dv * dv) / (2.0 * spread * spread)).exp();
            let slot = &mut heats[cell * CATEGORIES + class_of(object) - 1];
            *slot = slot.max(heat as f32);
            if heat > warmest.0 {
                warmest = (heat, Some(number));
            }
        }
        if let Some(number) = warmest.1 {
            let (pose, _) = pose(&objects[number]);
            warm.push((cell, number, anchor.encode(&pose)));
        }
    }
    (heats, warm)
}

/// Pixel of an object's centre, and the spread of its heat in cells.
fn centre_and_spread(object: &Shown<'_>) -> ([f64; 2], f64) {
    let (pose, _) = pose(object);
    let diagonal = pose.diagonal_px() / STRIDE as f64;
    (
        pose.pixel(),
        (HEAT_SHARE * diagonal).clamp(HEAT_CELLS[0], HEAT_CELLS[1]),
    )
}
