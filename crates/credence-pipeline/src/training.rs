use credence_map::{Aabb, FreeSampling, KeepAway, MapError, ObjectId, SemanticMap};
use credence_types::{CLASS_COUNT, FREE_CLASS, Point, stream};
use nalgebra::Vector3;
use rand::seq::index;

use crate::{PipelineError, TrainingConfig};

/// What a classifier learns about one object: observed points of its surroundings, labelled with
/// their category, and points known to be free.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    points_world: Vec<Point>,
    classes: Vec<u8>,
}

impl TrainingSet {
    /// Points (world coordinates, metres) and the class of each: 0 is free space, 1 to 6 the
    /// categories. Their order does not matter.
    ///
    /// # Errors
    /// Lists of different lengths, a class past the last category.
    pub fn new(points_world: Vec<Point>, classes: Vec<u8>) -> Result<Self, PipelineError> {
        if classes.len() != points_world.len() {
            return Err(PipelineError::TrainingLength {
                found: classes.len(),
                expected: points_world.len(),
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

    /// Draws the training points of an object: see [`TrainingConfig`].
    pub(crate) fn draw(
        map: &SemanticMap,
        id: ObjectId,
        config: &TrainingConfig,
        seed: u64,
    ) -> Result<Self, PipelineError> {
        let object = map.object(id)?;
        let own = &object.cloud().points_world;
        let surroundings = padded_box(own, config)?;
        let neighbours: Vec<(Point, u8)> = map
            .objects()
            .filter(|other| other.id() != id)
            .flat_map(|object| {
                let class = object.category().class();
                let points = &object.cloud().points_world;
                points.iter().map(move |point| (*point, class))
            })
            .filter(|(point, _)| surroundings.contains(point))
            .collect();
        let wanted = ((config.points as f64 * config.object_share).round() as usize)
            .clamp(1, config.points - 1);
        let (from_own, from_neighbours) = shares(wanted, own.len(), neighbours.len());
        let mut rng = stream(seed, "pipeline/observed");
        let mut points_world: Vec<Point> = index::sample(&mut rng, own.len(), from_own)
            .iter()
            .map(|index| own[index])
            .collect();
        let mut classes = vec![object.category().class(); from_own];
        for index in index::sample(&mut rng, neighbours.len(), from_neighbours) {
            let (point, class) = neighbours[index];
            points_world.push(point);
            classes.push(class);
        }

        let sampling = FreeSampling {
            within: surroundings,
            count: config.points - points_world.len(),
            min_distance_m: config.free_margin_m,
            seed,
        };
        let free = map
            .sample_free(&sampling, KeepAway::Objects)
            .map_err(|err| match err {
                MapError::NoFreeSpace { .. } => PipelineError::NoFreeSpace {
                    id: id.0,
                    box_padding_m: config.box_padding_m,
                    free_margin_m: config.free_margin_m,
                },
                err => err.into(),
            })?;
        points_world.extend(free);
        classes.resize(points_world.len(), FREE_CLASS);
        Ok(Self {
            points_world,
            classes,
        })
    }
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

#[cfg(test)]
mod tests {
    use credence_types::Category::{Bowl, Mug};

    use super::*;
    use crate::{
        Config, Pipeline,
        scene::{Solid, view},
    };

    /// Depth images are f32 and a pixel's point is on the surface up to that.
    const ROUNDING_M: f64 = 1e-6;

    fn mapped(solids: &[Solid], training: &str) -> Pipeline {
        let config = Config::from_json(&format!(r#"{{"training": {training}}}"#)).unwrap();
        let mut pipeline = Pipeline::new(config).unwrap();
        for azimuth_deg in [-60.0, 20.0] {
            pipeline.add_frame(&view(solids, azimuth_deg)).unwrap();
        }
        pipeline
    }

    /// The object that stands about a solid's centre.
    fn object_at(pipeline: &Pipeline, solid: &Solid) -> ObjectId {
        let centre = nalgebra::center(&solid.low, &solid.high);
        let found = pipeline
            .map()
            .objects()
            .find(|object| (object.centroid() - centre).norm() < 0.05);
        found.unwrap().id()
    }

    fn observed_and_free(set: &TrainingSet) -> (&[Point], &[Point]) {
        let observed = set.classes().iter().filter(|c| **c != FREE_CLASS).count();
        assert!(set.classes()[observed..].iter().all(|c| *c == FREE_CLASS));
        set.points_world().split_at(observed)
    }

    fn nearest_m(points: &[Point], to: &Point) -> f64 {
        let distances = points.iter().map(|point| (point - to).norm());
        distances.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn half_are_observed_points_and_half_are_seen_free_space() {
        let mug = Solid::cube(Mug, [0.0, 0.0]);
        let mut pipeline = mapped(&[mug], r#"{"points": 400}"#);
        let id = object_at(&pipeline, &mug);
        let set = pipeline.training_set(id, 7).unwrap();
        let cloud = pipeline
            .map()
            .object(id)
            .unwrap()
            .cloud()
            .points_world
            .clone();
        let (observed, free) = observed_and_free(&set);
        assert_eq!((observed.len(), free.len()), (200, 200));

        assert!(set.classes()[..200].iter().all(|c| *c == Mug.class()));
        let mut indices: Vec<usize> = observed
            .iter()
            .map(|point| cloud.iter().position(|p| p == point).unwrap())
            .collect();
        assert!(!indices.is_sorted());
        indices.sort_unstable();
        indices.dedup();
        assert_eq!(indices.len(), 200, "no point is drawn twice");
        for point in observed {
            assert!(mug.signed_distance_m(point).abs() < ROUNDING_M);
        }

        let config = &pipeline.config().training;
        let within = padded_box(&cloud, config).unwrap();
        for point in free {
            assert!(within.contains(point));
            assert!(nearest_m(&cloud, point) >= config.free_margin_m);
            assert!(point.z > -0.005);
        }
        let inside = |point: &&Point| mug.signed_distance_m(point) < 0.0;
        let inside = free.iter().filter(inside).count();
        assert!(inside * 50 < free.len(), "{inside} of {}", free.len());
    }

    #[test]
    fn neighbours_take_their_share_but_at_most_half() {
        // (wanted, own, neighbours) -> (from own, from neighbours)
        for (of, expected) in [
            ((100, 300, 0), (100, 0)),
            ((100, 300, 100), (75, 25)),
            ((100, 300, 900), (50, 50)),
            ((100, 30, 9000), (30, 50)),
            ((100, 1, 9000), (1, 50)),
            ((100, 30, 10), (30, 10)),
            ((1, 1, 9000), (1, 0)),
            ((3, 9, 9000), (2, 1)),
        ] {
            let (wanted, own, neighbours) = of;
            assert_eq!(shares(wanted, own, neighbours), expected, "{of:?}");
        }
    }

    #[test]
    fn a_tiny_object_keeps_its_points_beside_a_big_one() {
        let corners = |low: [f64; 3], high: [f64; 3], category| Solid {
            low: low.into(),
            high: high.into(),
            category,
        };
        let mug = corners([-0.015, -0.015, 0.0], [0.015, 0.015, 0.03], Mug);
        let bowl = corners([-0.2, -0.1, 0.0], [-0.03, 0.1, 0.1], Bowl);
        let settings = r#"{"points": 200, "box_padding_m": 0.08}"#;
        let mut pipeline = mapped(&[mug, bowl], settings);
        let of = |category| {
            let objects = pipeline.map().objects();
            let mut objects = objects.filter(move |object| object.category() == category);
            objects.next().unwrap()
        };
        let (id, own) = (of(Mug).id(), of(Mug).cloud().clone());
        let within = padded_box(&own.points_world, &pipeline.config().training).unwrap();
        let beside = &of(Bowl).cloud().points_world;
        let beside = beside.iter().filter(|p| within.contains(p)).count();
        assert!(own.len() > 10 && beside > 3 * own.len());
        let set = pipeline.training_set(id, 0).unwrap();
        let mut of_class = [0; CLASS_COUNT];
        for class in set.classes() {
            of_class[usize::from(*class)] += 1;
        }
        let from_own = own.len().min(50);
        assert_eq!(
            [Mug.class(), Bowl.class(), FREE_CLASS].map(|class| of_class[usize::from(class)]),
            [from_own, 50, 150 - from_own]
        );
    }

    #[test]
    fn a_seed_fixes_the_set() {
        let mug = Solid::cube(Mug, [0.0, 0.0]);
        let draw = |seed| {
            let mut pipeline = mapped(&[mug], r#"{"points": 50}"#);
            let id = object_at(&pipeline, &mug);
            pipeline.training_set(id, seed).unwrap()
        };
        let set = draw(3);
        assert_eq!(set, draw(3));
        let other = draw(4);
        let (observed, free) = observed_and_free(&set);
        let (other_observed, other_free) = observed_and_free(&other);
        assert!(observed != other_observed && free != other_free);
    }

    #[test]
    fn free_space_fills_what_an_object_lacks() {
        let mug = Solid::cube(Mug, [0.0, 0.0]);
        let mut pipeline = mapped(&[mug], r#"{"points": 3000, "object_share": 0.9}"#);
        let id = object_at(&pipeline, &mug);
        let seen = pipeline.map().object(id).unwrap().cloud().len();
        assert!((100..2700).contains(&seen));
        let set = pipeline.training_set(id, 0).unwrap();
        let (observed, free) = observed_and_free(&set);
        assert_eq!((observed.len(), free.len()), (seen, 3000 - seen));
    }

    #[test]
    fn both_kinds_are_drawn_however_small_the_share() {
        let mug = Solid::cube(Mug, [0.0, 0.0]);
        for (share, observed) in [(0.001, 1), (0.999, 9)] {
            let settings = format!(r#"{{"points": 10, "object_share": {share}}}"#);
            let mut pipeline = mapped(&[mug], &settings);
            let id = object_at(&pipeline, &mug);
            let set = pipeline.training_set(id, 0).unwrap();
            assert_eq!(observed_and_free(&set).0.len(), observed);
        }
    }

    #[test]
    fn a_neighbour_is_neither_free_nor_the_object() {
        let (mug, bowl) = (Solid::cube(Mug, [0.0, 0.0]), Solid::cube(Bowl, [0.1, 0.0]));
        let mut pipeline = mapped(&[mug, bowl], r#"{"points": 600}"#);
        let id = object_at(&pipeline, &mug);
        let set = pipeline.training_set(id, 0).unwrap();
        let cloud = &pipeline.map().object(id).unwrap().cloud().points_world;
        let neighbour = object_at(&pipeline, &bowl);
        let neighbours = &pipeline
            .map()
            .object(neighbour)
            .unwrap()
            .cloud()
            .points_world;
        let config = &pipeline.config().training;
        let within = padded_box(cloud, config).unwrap();
        let mut of_class = [0; CLASS_COUNT];
        for (point, class) in set.points_world().iter().zip(set.classes()) {
            of_class[usize::from(*class)] += 1;
            assert!(within.contains(point));
            let on = |solid: &Solid| solid.signed_distance_m(point).abs() < ROUNDING_M;
            match *class {
                FREE_CLASS => {
                    assert!(nearest_m(cloud, point) >= config.free_margin_m);
                    assert!(nearest_m(neighbours, point) >= config.free_margin_m);
                }
                class => assert!(on(if class == Mug.class() { &mug } else { &bowl })),
            }
        }
        let of = |category: credence_types::Category| of_class[usize::from(category.class())];
        assert!(of(Mug) > 0 && of(Bowl) > 0);
        assert_eq!((of(Mug) + of(Bowl), of_class[0]), (300, 300));
    }

    #[test]
    fn says_what_is_missing() {
        let mug = Solid::cube(Mug, [0.0, 0.0]);
        let mut pipeline = mapped(&[mug], r#"{"points": 10, "free_margin_m": 0.5}"#);
        let id = object_at(&pipeline, &mug);
        assert_eq!(
            pipeline.training_set(id, 0).unwrap_err().to_string(),
            format!(
                "object {} has no free space within 0.03 m of its box and at least 0.5 m away \
                 from observed points; insert views that look past it, raise \
                 training.box_padding_m or lower training.free_margin_m",
                id.0
            )
        );
        let message = pipeline
            .training_set(ObjectId(99), 0)
            .unwrap_err()
            .to_string();
        assert!(message.contains("there is no object 99"));
    }

    #[test]
    fn refuses_lists_that_do_not_belong_together() {
        let message = |classes: &[u8]| {
            let points = vec![Point::origin(); 2];
            TrainingSet::new(points, classes.to_vec())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            message(&[0]),
            "classes has 1 entries; 2 training points need one each"
        );
        assert_eq!(
            message(&[0, 7]),
            "classes[1] is 7; 0 is free space and the categories run from 1 to 6"
        );
    }
}
