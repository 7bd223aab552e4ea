//! What training varies about an observation, whatever a network is asked about it.

use credence_types::{InvalidInput, ObjectFrame, Point, Stream, stream};
use rand::{Rng, RngExt as _, seq::SliceRandom as _};
use rayon::prelude::*;

use crate::{
    TrainError,
    data::{Scene, SceneCache},
};

/// Units of the object's frame per metre.
pub(crate) const UNITS_PER_M: f64 = 1.0 / ObjectFrame::UNIT_M;

/// Support points of a kind, the fewest and the most.
pub(crate) const SUPPORT: (f64, f64) = (200.0, 1800.0);

/// Range of the scale.
const SCALE: (f64, f64) = (0.9, 1.1);

/// Standard deviation of the frame's error, metres: of the midrange, and of the table's height.
const JITTER_M: [f64; 3] = [0.005, 0.005, 0.008];

/// From a scene's world to the frame that the network sees.
pub(crate) struct Placement {
    frame: ObjectFrame,
    /// 1, or -1 for a mirrored scene.
    mirror: f64,
    pub(crate) scale: f64,
    shift: [f64; 3],
}

impl Placement {
    /// The frame of a scene's observed points as it is.
    pub(crate) fn exact(object: &[[f32; 3]], scene: &Scene) -> Result<Self, InvalidInput> {
        let world: Vec<Point> = object.iter().map(wide).collect();
        Ok(Self {
            frame: ObjectFrame::new(&world, wide(&scene.viewpoint), 0.0)?,
            mirror: 1.0,
            scale: 1.0,
            shift: [0.0; 3],
        })
    }

    /// A frame that is a little wrong, of a scene that is a little larger or smaller, or mirrored.
    pub(crate) fn varied(
        object: &[[f32; 3]],
        scene: &Scene,
        rng: &mut impl Rng,
    ) -> Result<Self, InvalidInput> {
        let scale = rng.random_range(SCALE.0..SCALE.1);
        let mirror = if rng.random() { -1.0 } else { 1.0 };
        let shift = JITTER_M.map(|sigma_m| sigma_m * UNITS_PER_M * normal(rng));
        Ok(Self {
            mirror,
            scale,
            shift,
            ..Self::exact(object, scene)?
        })
    }

    /// A world point in the frame's units.
    pub(crate) fn place(&self, point: &[f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.frame.locate(&wide(point));
        let at = [x, y * self.mirror, z];
        [0, 1, 2].map(|axis| (at[axis] * self.scale + self.shift[axis]) as f32)
    }
}

/// A step's examples, each of a scene drawn by the seed, the run's name, the step and its place.
pub(crate) fn examples<E: Send>(
    scenes: &SceneCache,
    (seed, name, step): (u64, &str, u64),
    count: usize,
    example: impl Fn(&Scene, &mut Stream) -> Result<E, TrainError> + Sync,
) -> Result<Vec<E>, TrainError> {
    let drawn = |slot| {
        let mut rng = stream(seed, &format!("train/{name}/{step}/{slot}"));
        let index = rng.random_range(0..scenes.len());
        example(&scenes.get(index)?, &mut rng)
    };
    (0..count).into_par_iter().map(drawn).collect()
}

/// A random part of the points for the support, as likely of one size as of twice that, and the
/// rest.
pub(crate) fn split(points: &[[f32; 3]], rng: &mut impl Rng) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let most = (points.len() as f64).min(SUPPORT.1).max(SUPPORT.0);
    let count = rng.random_range(SUPPORT.0.ln()..=most.ln()).exp().round() as usize;
    let mut points = points.to_vec();
    let (chosen, rest) = points.partial_shuffle(rng, count);
    (chosen.to_vec(), rest.to_vec())
}

fn wide(point: &[f32; 3]) -> Point {
    Point::from(point.map(f64::from))
}

/// A standard normal number, by Box and Muller.
fn normal(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
