mod observed;
#[cfg(test)]
mod tests;

use std::cmp::Ordering;

use credence_map::{Aabb, FreeSampling, KeepAway, MapError, ObjectId, SemanticMap, TrackedObject};
use credence_types::{CLASS_COUNT, Category, FREE_CLASS, Point, stream};
use nalgebra::Vector3;
pub(crate) use observed::{Observed, Viewpoints};
use rand::seq::{SliceRandom as _, index};

use crate::{PipelineError, TrainingConfig, config::MAX_POINTS};

/// Seed of the order of a caller's points: fixed, so that the points alone decide it.
const ORDER_SEED: u64 = 0;

/// What a classifier learns about one object: observed points of its surroundings, labelled with
/// their category, and points known to be free.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    points_world: Vec<Point>,
    classes: Vec<u8>,
    source: Source,
}

/// Where a set comes from, which decides what is known of the objects in it.
#[derive(Debug, Clone, PartialEq)]
enum Source {
    /// A caller's points, and the viewpoint if it gave one.
    Given { viewpoint_world: Option<Point> },
    /// The map: the object first, then its neighbours.
    Map(Vec<Observed>),
}

impl TrainingSet {
    /// Points (world coordinates, metres) and the class of each: 0 is free space, 1 to 6 the
    /// categories. Their order decides which of them a fit of
    /// hyperparameters sees, and how `metric_literal` divides them into clouds; nothing else.
    ///
    /// # Errors
    /// Lists of different lengths, more points than a classifier has memory for, a class past the
    /// last category.
    pub fn new(points_world: Vec<Point>, classes: Vec<u8>) -> Result<Self, PipelineError> {
        if classes.len() != points_world.len() {
            return Err(PipelineError::TrainingLength {
                found: classes.len(),
                expected: points_world.len(),
            });
        }
        if points_world.len() > MAX_POINTS {
            return Err(PipelineError::TooManyTrainingPoints {
                found: points_world.len(),
                most: MAX_POINTS,
            });
        }
        let unknown = |class: &u8| usize::from(*class) >= CLASS_COUNT;
        if let Some(index) = classes.iter().position(unknown) {
            return Err(PipelineError::TrainingClass {
                index,
                class: classes[index],
                last: CLASS_COUNT - 1,
            });
        }
        Ok(Self {
            points_world,
            classes,
            source: Source::Given {
                viewpoint_world: None,
            },
        })
    }

    /// The set with the viewpoint from which its points were seen (world coordinates, metres; the
    /// mean camera centre of several views), which networks need. The points of each category then
    /// count as one object's.
    ///
    /// # Errors
    /// A viewpoint that is not finite.
    pub fn with_viewpoint(self, viewpoint_world: Point) -> Result<Self, PipelineError> {
        if !viewpoint_world.iter().all(|c| c.is_finite()) {
            return Err(PipelineError::Viewpoint {
                value: viewpoint_world.into(),
            });
        }
        Ok(Self {
            source: Source::Given {
                viewpoint_world: Some(viewpoint_world),
            },
            ..self
        })
    }

    /// World coordinates, metres; of a drawn set the object's observed points first, then those of
    /// its neighbours, then free ones, each in random order.
    pub fn points_world(&self) -> &[Point] {
        &self.points_world
    }

    /// Class of each point: 0 is free space, 1 to 6 the categories.
    pub fn classes(&self) -> &[u8] {
        &self.classes
    }

    /// Where the object was seen from, if that is known: world coordinates, metres.
    pub fn viewpoint_world(&self) -> Option<Point> {
        match &self.source {
            Source::Given { viewpoint_world } => *viewpoint_world,
            Source::Map(observed) => observed.first().map(|object| object.viewpoint_world),
        }
    }

    /// What was seen of each object, the one of `category` that is asked about first.
    pub(crate) fn observed(&self, category: Category) -> Result<Vec<Observed>, PipelineError> {
        match &self.source {
            Source::Map(observed) => {
                let asked = observed.first().filter(|own| own.category == category);
                asked.ok_or(PipelineError::CategoryNotTrained { category })?;
                Ok(observed.clone())
            }
            Source::Given { viewpoint_world } => {
                let viewpoint_world = viewpoint_world.ok_or(PipelineError::NoViewpoint)?;
                if !self.classes.contains(&category.class()) {
                    return Err(PipelineError::CategoryNotTrained { category });
                }
                let others = Category::ALL.into_iter().filter(|other| *other != category);
                let observed = std::iter::once(category)
                    .chain(others)
                    .map(|category| Observed {
                        category,
                        points_world: self.of_class(category.class()),
                        free_world: self.of_class(FREE_CLASS),
                        viewpoint_world,
                    })
                    .filter(|object| !object.points_world.is_empty());
                Ok(observed.collect())
            }
        }
    }

    /// A caller's points of a class, in a random order that does not depend on theirs: a network
    /// is asked about random parts of them.
    fn of_class(&self, class: u8) -> Vec<Point> {
        let labelled = self.points_world.iter().zip(&self.classes);
        let own = labelled.filter(|(_, c)| **c == class);
        let mut points: Vec<Point> = own.map(|(point, _)| *point).collect();
        points.sort_by(|a, b| {
            let axes = a.iter().zip(b.iter());
            axes.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
        });
        points.shuffle(&mut stream(ORDER_SEED, "pipeline/given"));
        points
    }

    /// Draws the training points of an object: see [`TrainingConfig`].
    pub(crate) fn draw(
        map: &SemanticMap,
        viewpoints: &Viewpoints,
        id: ObjectId,
        config: &TrainingConfig,
        seed: u64,
    ) -> Result<Self, PipelineError> {
        let object = map.object(id)?;
        let own = &object.cloud().points_world;
        let surroundings = padded_box(own, config)?;
        let beside: Vec<(&TrackedObject, Vec<Point>)> = map
            .objects()
            .filter(|other| other.id() != id)
            .map(|other| {
                let points = other.cloud().points_world.iter();
                let within = points.filter(|point| surroundings.contains(point));
                (other, within.copied().collect())
            })
            .filter(|(_, within): &(_, Vec<Point>)| !within.is_empty())
            .collect();
        let neighbours: Vec<(Point, u8)> = beside
            .iter()
            .flat_map(|(other, within)| {
                let class = other.category().class();
                within.iter().map(move |point| (*point, class))
            })
            .collect();
        let (from_own, from_neighbours) = shares(wanted(config), own.len(), neighbours.len());
        let mut rng = stream(seed, "pipeline/observed");
        let mut points_world: Vec<Point> = index::sample(&mut rng, own.len(), from_own)
            .iter()
            .map(|index| own[index])
            .collect();
        let mut observed = vec![Observed {
            category: object.category(),
            points_world: points_world.clone(),
            free_world: Vec::new(),
            viewpoint_world: viewpoints.of(id)?,
        }];
        let mut classes = vec![object.category().class(); from_own];
        for index in index::sample(&mut rng, neighbours.len(), from_neighbours) {
            let (point, class) = neighbours[index];
            points_world.push(point);
            classes.push(class);
        }

        let count = config.points - points_world.len();
        let free = sample_free(map, id, surroundings, count, config, seed)?;
        observed[0].free_world.clone_from(&free);
        points_world.extend(free);
        classes.resize(points_world.len(), FREE_CLASS);
        for (other, _) in beside {
            let free = &observed[0].free_world;
            let neighbour = Observed::whole(map, other, viewpoints, config, seed, free)?;
            observed.push(neighbour);
        }
        Ok(Self {
            points_world,
            classes,
            source: Source::Map(observed),
        })
    }
}

/// How many observed points a training set should have.
fn wanted(config: &TrainingConfig) -> usize {
    ((config.points as f64 * config.object_share).round() as usize).clamp(1, config.points - 1)
}

fn sample_free(
    map: &SemanticMap,
    id: ObjectId,
    within: Aabb,
    count: usize,
    config: &TrainingConfig,
    seed: u64,
) -> Result<Vec<Point>, PipelineError> {
    let sampling = FreeSampling {
        within,
        count,
        min_distance_m: config.free_margin_m,
        seed,
    };
    map.sample_free(&sampling, KeepAway::Objects)
        .map_err(|err| match err {
            MapError::NoFreeSpace { .. } => PipelineError::NoFreeSpace {
                id: id.0,
                box_padding_m: config.box_padding_m,
                free_margin_m: config.free_margin_m,
            },
            err => err.into(),
        })
}

/// How many of `wanted` observed points come from the object's `own` and how many from its
/// `neighbours`' points: these take their proportional share, but at most half.
fn shares(wanted: usize, own: usize, neighbours: usize) -> (usize, usize) {
    let proportional = wanted * neighbours / (own + neighbours).max(1);
    let from_neighbours = proportional.min(wanted / 2).min(neighbours);
    ((wanted - from_neighbours).min(own), from_neighbours)
}

fn padded_box(points: &[Point], config: &TrainingConfig) -> Result<Aabb, PipelineError> {
    let padding = Vector3::repeat(config.box_padding_m);
    let (low, high) = points.iter().fold(
        (
            Point::from(Vector3::repeat(f64::INFINITY)),
            Point::from(Vector3::repeat(f64::NEG_INFINITY)),
        ),
        |(low, high), point| (low.inf(point), high.sup(point)),
    );
    Ok(Aabb::new(low - padding, high + padding)?)
}
