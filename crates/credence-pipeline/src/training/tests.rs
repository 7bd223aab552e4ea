use credence_types::Category::{Bowl, Mug};

use super::*;
use crate::{
    Config, Pipeline,
    scene::{Solid, view},
};

/// Depth images are f32 and a pixel's point is on the surface up to that.
const ROUNDING_M: f64 = 1e-6;

fn mapped(solids: &[Solid], training: &str) -> Pipeline {
    let settings = format!(r#"{{"segmenter": "oracle", "training": {training}}}"#);
    let config = Config::from_json(&settings).unwrap();
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
    let of = |category: Category| of_class[usize::from(category.class())];
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

/// Where the camera of [`view`] stands.
fn camera(azimuth_deg: f64) -> Point {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    Point::new(0.49 * cos, 0.49 * sin, 0.344)
}

#[test]
fn a_drawn_set_knows_where_the_object_was_seen_from() {
    let mug = Solid::cube(Mug, [0.0, 0.0]);
    let mut pipeline = mapped(&[mug], r#"{"points": 50}"#);
    let id = object_at(&pipeline, &mug);
    let viewpoint = pipeline.training_set(id, 0).unwrap().viewpoint_world();
    let mean = nalgebra::center(&camera(-60.0), &camera(20.0));
    assert!((viewpoint.unwrap() - mean).norm() < 1e-12);
    pipeline.add_frame(&view(&[mug], 20.0)).unwrap();
    let viewpoint = pipeline.training_set(id, 0).unwrap().viewpoint_world();
    let mean = (camera(-60.0).coords + 2.0 * camera(20.0).coords) / 3.0;
    assert!((viewpoint.unwrap().coords - mean).norm() < 1e-12);
}

#[test]
fn a_neighbour_is_observed_as_its_own_set_would_have_it() {
    let (mug, bowl) = (Solid::cube(Mug, [0.0, 0.0]), Solid::cube(Bowl, [0.1, 0.0]));
    let mut pipeline = mapped(&[mug, bowl], r#"{"points": 600}"#);
    let id = object_at(&pipeline, &mug);
    let set = pipeline.training_set(id, 0).unwrap();
    let observed = set.observed(Mug).unwrap();
    let categories: Vec<Category> = observed.iter().map(|object| object.category).collect();
    assert_eq!(categories, [Mug, Bowl]);
    let own = set.classes().partition_point(|c| *c == Mug.class());
    assert_eq!(observed[0].points_world, set.points_world()[..own]);
    assert_eq!(observed[0].free_world, set.points_world()[300..]);

    let cloud = &pipeline.map().object(id).unwrap().cloud().points_world;
    let within = padded_box(cloud, &pipeline.config().training).unwrap();
    let Observed {
        points_world,
        free_world,
        ..
    } = &observed[1];
    assert_eq!((points_world.len(), free_world.len()), (300, 300));
    assert!(points_world.iter().any(|point| !within.contains(point)));
    let mut distances = points_world.iter().map(|p| bowl.signed_distance_m(p).abs());
    assert!(distances.all(|distance| distance < ROUNDING_M));
    let beyond = |p: &&Point| p.x > 0.14 + 0.01;
    assert!(free_world.iter().filter(beyond).count() > 20);
    assert_eq!(observed[0].viewpoint_world, observed[1].viewpoint_world);
}

#[test]
fn a_set_is_of_the_object_that_it_was_drawn_for() {
    let (mug, bowl) = (Solid::cube(Mug, [0.0, 0.0]), Solid::cube(Bowl, [0.1, 0.0]));
    let mut pipeline = mapped(&[mug, bowl], r#"{"points": 60}"#);
    let id = object_at(&pipeline, &mug);
    let set = pipeline.training_set(id, 0).unwrap();
    let refused = set.observed(Bowl).unwrap_err().to_string();
    assert!(refused.contains("draw the training set for this object"));
}

#[test]
fn in_a_given_set_the_points_of_a_category_are_one_object() {
    let points: Vec<Point> = (0..5).map(|i| Point::new(f64::from(i), 0.0, 0.0)).collect();
    let classes = vec![Bowl.class(), 0, Mug.class(), 0, Bowl.class()];
    let set = TrainingSet::new(points.clone(), classes).unwrap();
    assert_eq!(set.viewpoint_world(), None);
    let refused = set.observed(Mug).unwrap_err().to_string();
    assert!(refused.contains("has no viewpoint"));
    let viewpoint_world = Point::new(0.5, 0.0, 0.5);
    let set = set.with_viewpoint(viewpoint_world).unwrap();
    assert_eq!(set.viewpoint_world(), Some(viewpoint_world));
    let object = |category, of: &[usize]| Observed {
        category,
        points_world: of.iter().map(|i| points[*i]).collect(),
        free_world: vec![points[1], points[3]],
        viewpoint_world,
    };
    let mut observed = set.observed(Mug).unwrap();
    for object in &mut observed {
        let by_x = |a: &Point, b: &Point| a.x.total_cmp(&b.x);
        object.points_world.sort_by(by_x);
        object.free_world.sort_by(by_x);
    }
    assert_eq!(observed, [object(Mug, &[2]), object(Bowl, &[0, 4])]);
    let refused = set.with_viewpoint(Point::new(0.0, f64::NAN, 0.0));
    assert_eq!(
        refused.unwrap_err().to_string(),
        "the viewpoint [0.0, NaN, 0.0] is not finite; pass the camera's centre in world metres"
    );
}

#[test]
fn more_points_than_memory_are_refused() {
    let refused = TrainingSet::new(vec![Point::origin(); 1_000_000], vec![0; 1_000_000]);
    assert_eq!(
        refused.unwrap_err().to_string(),
        "there are 1000000 training points; pass at most 50000, as the classifier's memory grows \
         with their square"
    );
}
