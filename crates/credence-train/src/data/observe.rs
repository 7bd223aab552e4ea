//! What the map would know after some views: the pipeline's training points.
//!
//! Follows `credence-pipeline`'s `TrainingSet::draw` and `credence-map`'s `sample_free`.

use credence_types::Category;
use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

use super::{
    near::NearGrid,
    stage::{Placed, View},
};

/// Most points of each kind that a scene keeps.
pub(super) const MAX_OBJECT: usize = 2048;
pub(super) const MAX_NEIGHBOURS: usize = 1024;
pub(super) const MAX_FREE: usize = 2048;
/// Measured points of the target, and of its neighbours, that free space keeps away from.
const KEPT_AWAY_FROM: usize = 8192;
/// The pipeline's `box_padding_m` and `free_margin_m`.
const BOX_PADDING_M: f64 = 0.03;
const FREE_MARGIN_M: f64 = 0.01;
/// A ray frees space up to about a voxel of the map before its end.
const VOXEL_M: f64 = 0.005;
/// Candidates for free points: enough where a fiftieth of the box is free.
const FREE_DRAWS: usize = 50 * MAX_FREE;

/// Points in random order, in the world, metres.
#[derive(Debug)]
pub(super) struct Observed {
    pub(super) object: Vec<Vector>,
    pub(super) neighbours: Vec<(Vector, Category)>,
    pub(super) free: Vec<Vector>,
}

/// What the views show of the first of the placed objects and around it.
pub(super) fn observe(placed: &[Placed<'_>], views: &[View], rng: &mut impl Rng) -> Observed {
    let mut object: Vec<Vector> = measured(placed, views, |owner| owner == 0, rng)
        .map(|(point, _)| point)
        .take(KEPT_AWAY_FROM)
        .collect();
    let unbounded = Vector::splat(f64::INFINITY);
    let (low, high) = object
        .iter()
        .fold((unbounded, -unbounded), |(low, high), point| {
            (low.min(*point), high.max(*point))
        });
    let padding = Vector::splat(BOX_PADDING_M);
    let (low, high) = (low - padding, high + padding);

    let is_neighbour = |owner: u32| owner != 0 && owner != u32::MAX;
    let around: Vec<(Vector, Category)> = measured(placed, views, is_neighbour, rng)
        .take(KEPT_AWAY_FROM)
        .collect();
    let mut avoid: Vec<Vector> = around.iter().map(|(point, _)| *point).collect();
    avoid.extend(&object);
    let within = |point: Vector| point.cmpge(low).all() && point.cmple(high).all();
    let neighbours = around
        .into_iter()
        .filter(|(point, _)| within(*point))
        .take(MAX_NEIGHBOURS)
        .collect();

    let margin = Vector::splat(FREE_MARGIN_M);
    let avoid = NearGrid::new(&avoid, [low - margin, high + margin], FREE_MARGIN_M);
    // The voxels at the table's height are occupied.
    let low = low.max(Vector::new(low.x, low.y, VOXEL_M));
    let free = (0..FREE_DRAWS)
        .map(|_| {
            let shares = [(); 3].map(|()| rng.random::<f64>());
            low + (high - low) * Vector::from_array(shares)
        })
        .filter(|point| !avoid.any_near(*point))
        .filter(|point| views.iter().any(|view| view.sees_through(*point, VOXEL_M)))
        .take(MAX_FREE)
        .collect();
    object.truncate(MAX_OBJECT);
    Observed {
        object,
        neighbours,
        free,
    }
}

/// Measured points of the pixels, of all views, whose owner is wanted, drawn without replacement.
fn measured<'a>(
    placed: &'a [Placed<'_>],
    views: &'a [View],
    wanted: impl Fn(u32) -> bool,
    rng: &'a mut impl Rng,
) -> impl Iterator<Item = (Vector, Category)> + 'a {
    let mut pixels: Vec<(u32, u32)> = Vec::new();
    for (number, view) in (0..).zip(views) {
        let owners = (0..).zip(&view.raster.owners);
        pixels.extend(
            owners
                .filter(|(_, o)| wanted(o.object))
                .map(|(pixel, _)| (number, pixel)),
        );
    }
    (0..pixels.len()).filter_map(move |at| {
        let chosen = rng.random_range(at..pixels.len());
        pixels.swap(at, chosen);
        let (number, pixel) = pixels[at];
        let (view, pixel) = (&views[number as usize], pixel as usize);
        let category = placed[view.raster.owners[pixel].object as usize]
            .mesh
            .category;
        Some((view.measure(pixel, placed)?, category))
    })
}
