use credence_nn::query::{Sample, Support};
use rand::{Rng, seq::SliceRandom as _};

use crate::{
    TrainError,
    augment::{Placement, SUPPORT, split},
    data::Scene,
};

/// One in this many of an example's queries lies anywhere around the object, the others in its box
/// or near its surface.
const AROUND: usize = 4;

/// One observation's queries and the offsets from them to the surface, in the frame's units.
#[derive(Debug, Clone)]
pub(super) struct Example {
    pub(super) sample: Sample,
    pub(super) offsets: Vec<[f32; 3]>,
}

/// An example for training: random support, random queries, and a frame that is a little wrong.
pub(super) fn training_example(
    scene: &Scene,
    queries: usize,
    rng: &mut impl Rng,
) -> Result<Example, TrainError> {
    let (object, _) = split(&scene.object, rng);
    let (free, _) = split(&scene.free, rng);
    let placement = Placement::varied(&object, scene, rng)?;
    let near = scene.queries.len();
    let mut chosen = drawn(0..near, queries - queries / AROUND, rng);
    chosen.extend(drawn(near..scene.nearest.len(), queries / AROUND, rng));
    example(scene, &placement, [&object, &free], &chosen)
}

/// An example for validation: the scene as it is, every query.
pub(super) fn validation_example(scene: &Scene) -> Result<Example, TrainError> {
    let most = |points: &[[f32; 3]]| points.len().min(SUPPORT.1 as usize);
    let object = &scene.object[..most(&scene.object)];
    let free = &scene.free[..most(&scene.free)];
    let placement = Placement::exact(object, scene)?;
    let all: Vec<usize> = (0..scene.nearest.len()).collect();
    example(scene, &placement, [object, free], &all)
}

fn drawn(range: std::ops::Range<usize>, count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut all: Vec<usize> = range.collect();
    all.partial_shuffle(rng, count).0.to_vec()
}

fn example(
    scene: &Scene,
    placement: &Placement,
    [object, free]: [&[[f32; 3]]; 2],
    chosen: &[usize],
) -> Result<Example, TrainError> {
    let placed = |points: &[[f32; 3]]| points.iter().map(|p| placement.place(p)).collect();
    let support = Support::new(placed(object), placed(free))?;
    let query = |index: &usize| match scene.queries.get(*index) {
        Some(point) => placement.place(point),
        None => placement.place(&scene.surroundings[index - scene.queries.len()]),
    };
    let queries: Vec<[f32; 3]> = chosen.iter().map(query).collect();
    let offsets = chosen.iter().zip(&queries).map(|(index, query)| {
        let nearest = placement.place(&scene.nearest[*index]);
        [0, 1, 2].map(|axis| nearest[axis] - query[axis])
    });
    Ok(Example {
        sample: Sample::new(&support, &queries)?,
        offsets: offsets.collect(),
    })
}
