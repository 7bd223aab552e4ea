use credence_types::{CLASS_COUNT, Category};

use super::{
    scene::{Shape, View, ball, eye},
    *,
};
use crate::Association;

const FIRST: ObjectId = ObjectId(1);
const SECOND: ObjectId = ObjectId(2);

/// Two like mugs 12 cm apart.
fn pair() -> [Shape; 2] {
    [ball(0.0, -0.06), ball(0.0, 0.06)]
}

#[test]
fn two_like_mugs_stay_two() {
    let mut map = empty();
    let shapes = pair();
    for azimuth in [0.0, 60.0, -60.0, 180.0, 90.0] {
        let objects = show(&mut map, &shapes, eye(azimuth), [0.0; 3]);
        // From 90 degrees one ball may hide the other, but what is seen keeps its id.
        for (shape, id) in objects {
            assert_eq!(id, [FIRST, SECOND][shape], "at {azimuth} degrees");
        }
        assert_eq!(ids(&map), [1, 2]);
    }
    for (id, shape) in [FIRST, SECOND].into_iter().zip(&shapes) {
        let object = map.object(id).unwrap();
        assert!((object.centroid() - shape.centre).norm() < 0.03);
        assert_eq!(object.category(), Category::Mug);
    }
}

/// A view in which nothing but one shape has a depth, and its detection.
fn alone(shapes: &[Shape], shape: usize, eye: [f64; 3]) -> (View, Instance) {
    let mut view = View::new(shapes, eye, [0.0; 3]);
    let mask = view.mask(shape);
    for (depth_m, masked) in view.depth_m.iter_mut().zip(&mask) {
        if !masked {
            *depth_m = f32::NAN;
        }
    }
    (view, Instance::certain(0, mask, Category::Mug).unwrap())
}

#[test]
fn like_mugs_that_nearly_touch_stay_two_in_views_of_one_each() {
    // 9 cm apart and 8 cm wide, each seen from all sides, the sides that face each other too.
    let shapes = [ball(0.0, -0.045), ball(0.0, 0.045)];
    for first in [0.0, 30.0, 60.0, 90.0, 120.0, 180.0] {
        for second in [0.0, -30.0, -60.0, -90.0, -120.0, 180.0] {
            let mut map = empty();
            for (shape, azimuth) in [(0, first), (1, second), (0, second), (1, first)] {
                let (view, instance) = alone(&shapes, shape, eye(azimuth));
                let report = map.insert(&view.frame(), &[instance]).unwrap();
                let id = [FIRST, SECOND][shape];
                assert_eq!(report.objects, [Some(id)], "{first} and {second} degrees");
            }
            assert_eq!(ids(&map), [1, 2]);
        }
    }
}

#[test]
fn opposite_sides_of_a_mug_are_one_object() {
    for azimuth in [0.0, 45.0] {
        let mut map = empty();
        for azimuth in [azimuth, azimuth + 180.0] {
            let (view, instance) = alone(&[ball(0.0, 0.0)], 0, eye(azimuth));
            map.insert(&view.frame(), &[instance]).unwrap();
        }
        assert_eq!(ids(&map), [1]);
    }
}

#[test]
fn ids_survive_views_that_do_not_overlap() {
    let shapes = [ball(0.0, -0.5), ball(0.0, 0.5)];
    let mut map = empty();
    for (y, shape) in [(-0.5, 0), (0.5, 1), (-0.5, 0), (0.5, 1)] {
        let objects = show(&mut map, &shapes, [0.5, y, 0.35], [0.0, y, 0.0]);
        assert_eq!(objects, BTreeMap::from([(shape, [FIRST, SECOND][shape])]));
    }
    // A view of an empty corner deletes neither.
    assert!(show(&mut map, &shapes, [3.0, 3.0, 0.4], [2.5, 2.5, 0.0]).is_empty());
    assert_eq!(ids(&map), [1, 2]);
}

#[test]
fn an_object_that_leaves_is_deleted_and_its_votes_withdrawn() {
    let shapes = pair();
    let mut map = empty();
    show(&mut map, &shapes, eye(0.0), [0.0; 3]);
    show(&mut map, &shapes, eye(30.0), [0.0; 3]);
    let left = map.object_voxels(FIRST).unwrap();
    assert!(left.len() > 50);

    let view = View::new(&shapes[1..], eye(0.0), [0.0; 3]);
    let (instances, _) = view.instances(&shapes[1..]);
    let report = map.insert(&view.frame(), &instances).unwrap();
    assert_eq!(
        (report.objects, report.deleted),
        (vec![Some(SECOND)], vec![FIRST])
    );
    assert_eq!(ids(&map), [2]);
    assert!(map.voxels().all(|v| v.object != Some(FIRST)));
    assert_agreement(&map);
    // Two hits outweigh a miss, and the back was not in view: such voxels stay, without the label.
    let remain: Vec<SemanticVoxel> = left
        .iter()
        .filter_map(|v| map.voxel_at(&v.centre))
        .filter(|v| v.centre.z > 0.01)
        .collect();
    assert!(remain.len() > 50);
    for voxel in remain {
        assert_eq!((voxel.class, voxel.rgb), (0, [200, 0, 0]));
        assert_eq!(voxel.histogram, [0.0; CLASS_COUNT]);
    }
    assert_eq!(
        map.object(FIRST).unwrap_err(),
        MapError::UnknownObject { id: 1 }
    );
    // Its id is not given away again.
    assert_eq!(show(&mut map, &shapes, eye(0.0), [0.0; 3])[&0], ObjectId(3));
}

#[test]
fn a_hidden_object_is_not_deleted() {
    let mut map = empty();
    show(&mut map, &[ball(0.0, 0.0)], eye(0.0), [0.0; 3]);
    // A larger ball between the camera and the first one.
    let wall = Shape {
        centre: Point::new(0.2, 0.0, 0.12),
        radius_m: 0.12,
        ..ball(0.0, 0.0)
    };
    let objects = show(&mut map, &[ball(0.0, 0.0), wall], eye(0.0), [0.0; 3]);
    assert_eq!(objects, BTreeMap::from([(1, SECOND)]));
    assert_eq!(ids(&map), [1, 2]);
}

#[test]
fn an_object_that_the_segmenter_misses_is_not_deleted() {
    let shapes = pair();
    let mut map = empty();
    show(&mut map, &shapes, eye(0.0), [0.0; 3]);
    let view = View::new(&shapes, eye(0.0), [0.0; 3]);
    let report = map.insert(&view.frame(), &[]).unwrap();
    assert_eq!((ids(&map), report.deleted), (vec![1, 2], vec![]));
}

#[test]
fn an_object_seen_on_too_few_pixels_is_not_deleted() {
    let mut map = empty();
    show(&mut map, &[ball(0.0, 0.0)], eye(0.0), [0.0; 3]);
    // Most of it is gone, and what is left covers fewer than the ten pixels of a detection.
    let rest = |x: f64| Shape {
        centre: Point::new(x, 0.0, 0.07),
        radius_m: 0.005,
        ..ball(0.0, 0.0)
    };
    let view = View::new(&[rest(0.0)], eye(0.0), [0.0; 3]);
    let pixels = view.mask(0).iter().filter(|m| **m).count();
    assert!((1..10).contains(&pixels), "{pixels}");
    let (instances, _) = view.instances(&[rest(0.0)]);
    let report = map.insert(&view.frame(), &instances).unwrap();
    assert_eq!((report.objects, report.deleted), (vec![None], vec![]));
    assert_eq!(ids(&map), [1]);
    // As small a detection elsewhere says nothing of it.
    let view = View::new(&[rest(-0.15)], eye(0.0), [0.0; 3]);
    let (instances, _) = view.instances(&[rest(-0.15)]);
    let report = map.insert(&view.frame(), &instances).unwrap();
    assert_eq!((report.objects, report.deleted), (vec![None], vec![FIRST]));
}

#[test]
fn an_object_that_moves_a_little_leaves_nothing_behind() {
    let mut map = empty();
    show(&mut map, &[ball(0.0, 0.0)], eye(0.0), [0.0; 3]);
    for _ in 0..4 {
        let objects = show(&mut map, &[ball(0.0, 0.03)], eye(0.0), [0.0; 3]);
        assert_eq!(objects, BTreeMap::from([(0, FIRST)]));
    }
    let cloud = map.object(FIRST).unwrap().cloud();
    let stale = cloud.points_world.iter().filter(|p| p.y < -0.015).count();
    assert_eq!(stale, 0, "of {}", cloud.len());
}

#[test]
fn a_class_misread_once_is_outvoted() {
    let shapes = [ball(0.0, 0.0)];
    let mut map = empty();
    for (azimuth, category) in [
        (0.0, Category::Bowl),
        (40.0, Category::Mug),
        (80.0, Category::Mug),
    ] {
        let view = View::new(&shapes, eye(azimuth), [0.0; 3]);
        let instance = Instance::certain(0, view.mask(0), category).unwrap();
        map.insert(&view.frame(), &[instance]).unwrap();
    }
    let object = map.object(FIRST).unwrap();
    assert_eq!(object.category(), Category::Mug);
    assert_eq!(
        object.class_histogram(),
        &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0]
    );
    assert_eq!((object.views(), object.score()), (3, 1.0));
}

#[test]
fn halves_of_a_plate_are_one_object() {
    let plate = Shape {
        centre: Point::new(0.0, 0.0, 0.02),
        radius_m: 0.1,
        flat: true,
        category: Category::Bowl,
    };
    let halves = |association| {
        let mut config = SemanticMapConfig::default();
        config.tracker.association = association;
        let mut map = SemanticMap::new(config).unwrap();
        let view = View::new(&[plate_like(&plate)], eye(0.0), [0.0; 3]);
        let frame = view.frame();
        for side in [-1.0, 1.0] {
            let on_side = |i: usize| frame.world_point(i).is_some_and(|p| p.y * side > -0.01);
            let mask = view.mask(0);
            let mask: Vec<bool> = mask
                .iter()
                .enumerate()
                .map(|(i, m)| *m && on_side(i))
                .collect();
            let instance = Instance::certain(0, mask, Category::Bowl).unwrap();
            map.insert(&frame, &[instance]).unwrap();
        }
        ids(&map)
    };
    assert_eq!(halves(Association::default()), [1]);
    // The centroids are 8 cm apart: a gate that keeps mugs apart splits the plate.
    assert_eq!(halves(Association::Centroid { gate_m: 0.06 }), [1, 2]);
    assert_eq!(halves(Association::Centroid { gate_m: 0.1 }), [1]);
}

fn plate_like(shape: &Shape) -> Shape {
    Shape { ..*shape }
}

#[test]
fn the_order_of_detections_does_not_matter() {
    let shapes = [ball(0.0, -0.06), ball(0.0, 0.06), ball(0.1, 0.0)];
    let map_of = |orders: [[usize; 3]; 2]| {
        let mut map = empty();
        for (order, azimuth) in orders.into_iter().zip([10.0, 50.0]) {
            let view = View::new(&shapes, eye(azimuth), [0.0; 3]);
            let (mut instances, _) = view.instances(&shapes);
            // A second detection that overlaps the first two with the same score.
            let both = (0..view.shown.len()).map(|i| view.mask(0)[i] || view.mask(1)[i]);
            instances[2] = Instance::certain(0, both.collect(), Category::Can).unwrap();
            let instances: Vec<Instance> = order.map(|i| instances[i].clone()).to_vec();
            map.insert(&view.frame(), &instances).unwrap();
        }
        let objects: Vec<_> = map
            .objects()
            .map(|o| (o.id(), o.cloud().clone(), *o.class_histogram()))
            .collect();
        (objects, map.voxels().collect::<Vec<_>>())
    };
    let expected = map_of([[0, 1, 2]; 2]);
    assert_eq!(expected.0.len(), 2);
    assert_eq!(map_of([[2, 1, 0], [1, 2, 0]]), expected);
}

#[test]
fn refuses_settings_out_of_range() {
    let message = |change: fn(&mut SemanticMapConfig)| {
        let mut config = SemanticMapConfig::default();
        change(&mut config);
        SemanticMap::new(config).unwrap_err().to_string()
    };
    let gate =
        |c: &mut SemanticMapConfig| c.tracker.association = Association::Surface { gate_m: 0.0 };
    assert!(message(gate).contains("association.gate_m is 0"));
    assert!(message(|c| c.tracker.delete_free_share = 1.5).contains("delete_free_share is 1.5"));
    assert!(message(|c| c.max_range_m = Some(f64::NAN)).contains("max_range_m is NaN"));
    assert!(message(|c| c.resolution_m = -1.0).contains("resolution_m is -1"));
}
