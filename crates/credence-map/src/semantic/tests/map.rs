use credence_types::Category;

use super::{
    scene::{View, ball, eye},
    *,
};
use crate::Occupancy;

const BALL: ObjectId = ObjectId(1);

/// A map of one ball at the origin, seen from two sides.
fn one_ball() -> SemanticMap {
    let mut map = empty();
    for azimuth in [0.0, 90.0] {
        show(&mut map, &[ball(0.0, 0.0)], eye(azimuth), [0.0; 3]);
    }
    map
}

/// A voxel of the table beside the ball.
fn on_table(map: &SemanticMap) -> SemanticVoxel {
    let within = Aabb::new(Point::new(0.09, 0.09, -0.01), Point::new(0.11, 0.11, 0.01)).unwrap();
    map.voxels_within(&within).next().unwrap()
}

#[test]
fn a_voxel_holds_what_table_i_lists() {
    let map = one_ball();
    let top = map.voxel_at(&Point::new(0.001, 0.001, 0.079)).unwrap();
    assert_eq!(top.rgb, [200, 0, 0]);
    assert_eq!(top.histogram, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    assert_eq!(Category::from_class(top.class), Some(Category::Mug));
    assert_eq!((top.object, top.confidence), (Some(BALL), None));
    assert!((top.centre - Point::new(0.0025, 0.0025, 0.0775)).norm() < 1e-12);

    let table = on_table(&map);
    assert_eq!(
        (table.rgb, table.class, table.object),
        ([0, 0, 50], 0, None)
    );
    assert!(map.voxel_at(&Point::new(0.0, 0.0, 0.3)).is_none());
    assert!(map.voxel_at(&Point::new(1e9, 0.0, 0.0)).is_none());
}

#[test]
fn records_and_octree_agree() {
    let map = one_ball();
    assert_agreement(&map);
    let within = Aabb::new(Point::new(-0.05, -0.05, 0.01), Point::new(0.05, 0.05, 0.1)).unwrap();
    let owned = map
        .voxels_within(&within)
        .filter(|v| v.object == Some(BALL))
        .count();
    let all = map.object_voxels(BALL).unwrap();
    assert!(owned > 100 && owned == all.iter().filter(|v| v.centre.z > 0.01).count());
    let surface = |v: &SemanticVoxel| ((v.centre - Point::new(0.0, 0.0, 0.04)).norm() - 0.04).abs();
    // Half a voxel's diagonal.
    assert!(all.iter().all(|v| surface(v) < 0.0044));
}

#[test]
fn one_view_of_an_object_does_not_outweigh_many_of_empty_space() {
    let mut map = empty();
    for _ in 0..6 {
        show(&mut map, &[], eye(0.0), [0.0; 3]);
    }
    let above_table = |v: &SemanticVoxel| v.centre.z > 0.01;
    for seen in 1..=3 {
        show(&mut map, &[ball(0.0, 0.0)], eye(0.0), [0.0; 3]);
        assert_agreement(&map);
        // Free space is at its clamp: -2.0, then -1.15, -0.31 and 0.54.
        let shown = map.object_voxels(BALL).unwrap();
        let count = shown.iter().filter(|v| above_table(v)).count();
        assert_eq!(count > 100, seen == 3, "{count} after {seen}");
        assert_eq!(map.voxels().any(|v| above_table(&v)), seen == 3);
        // What was seen is evidence all the same: of the object at once, of a voxel in the end.
        let object = map.object(BALL).unwrap();
        assert!(object.cloud().len() > 100 && object.voxels().len() > 100);
        let mugs = |v: &SemanticVoxel| v.histogram[usize::from(Category::Mug.class())];
        assert!(
            shown
                .iter()
                .filter(|v| above_table(v))
                .all(|v| mugs(v) > 2.0)
        );
    }
}

#[test]
fn the_cloud_has_full_resolution() {
    let shapes = [ball(0.0, 0.0)];
    let view = View::new(&shapes, eye(0.0), [0.0; 3]);
    let mut map = empty();
    show(&mut map, &shapes, eye(0.0), [0.0; 3]);
    let cloud = map.object(BALL).unwrap().cloud();
    let pixels = view.mask(0).iter().filter(|m| **m).count();
    assert!(
        cloud.len() <= pixels && cloud.len() * 10 > pixels * 9,
        "{} of {pixels}",
        cloud.len()
    );
    for point in &cloud.points_world {
        assert!(((point - shapes[0].centre).norm() - 0.04).abs() < 1e-6);
    }
}

#[test]
fn flying_pixels_stay_out_of_the_cloud() {
    let shapes = [ball(0.0, 0.0)];
    let mut view = View::new(&shapes, eye(0.0), [0.0; 3]);
    let clean = view.depth_m.clone();
    let mask = view.mask(0);
    // The first and last pixel of every row of the mask hang between ball and table.
    let mut flying = 0;
    for pixel in 1..mask.len() - 1 {
        if mask[pixel] && !(mask[pixel - 1] && mask[pixel + 1]) {
            view.depth_m[pixel] = clean[pixel] + 0.02 + 0.013 * (flying % 7) as f32;
            flying += 1;
        }
    }
    assert!(flying > 30);
    let mut map = empty();
    let instance = Instance::certain(0, mask, Category::Mug).unwrap();
    map.insert(&view.frame(), &[instance]).unwrap();
    let off = |p: &&Point| (*p - shapes[0].centre).norm() > 0.05;
    let points = &map.object(BALL).unwrap().cloud().points_world;
    assert!(points.len() > 150);
    let strays = points.iter().filter(off).count();
    assert!(
        strays * 20 < flying,
        "{strays} of {flying} flying pixels were kept"
    );
}

#[test]
fn a_mask_without_depth_is_no_object() {
    let shapes = [ball(0.0, 0.0)];
    let mut view = View::new(&shapes, eye(0.0), [0.0; 3]);
    let mask = view.mask(0);
    for (depth_m, masked) in view.depth_m.iter_mut().zip(&mask) {
        if *masked {
            *depth_m = f32::NAN;
        }
    }
    let mut map = empty();
    let instance = Instance::certain(0, mask, Category::Mug).unwrap();
    let report = map.insert(&view.frame(), &[instance]).unwrap();
    assert_eq!(report.objects, [None]);
    assert_eq!(map.objects().count(), 0);
}

#[test]
fn the_better_detection_takes_shared_pixels() {
    let shapes = [ball(0.0, 0.0)];
    let view = View::new(&shapes, eye(0.0), [0.0; 3]);
    let mut scores = [0.0; 6];
    scores[1] = 0.9;
    let weak = Instance::new(0, vec![true; view.shown.len()], scores, 0.5).unwrap();
    let strong = Instance::certain(1, view.mask(0), Category::Mug).unwrap();
    let mut map = empty();
    let report = map.insert(&view.frame(), &[weak, strong]).unwrap();
    let top = map.voxel_at(&Point::new(0.001, 0.001, 0.079)).unwrap();
    assert_eq!(
        (top.class, top.object),
        (Category::Mug.class(), report.objects[1])
    );
    // The detection's score weights its vote; what the class scores leave of 1 is background's.
    let table = on_table(&map);
    assert!((table.histogram[0] - 0.05).abs() < 1e-12);
    assert!((table.histogram[2] - 0.45).abs() < 1e-12);
    let object = map.object(report.objects[0].unwrap()).unwrap();
    assert_eq!(object.class_histogram(), &table.histogram);
    assert_eq!((table.class, table.object), (2, report.objects[0]));
}

#[test]
fn confidences_are_means_per_voxel() {
    let mut map = one_ball();
    let voxels = map.object_voxels(BALL).unwrap();
    let (a, b) = (voxels[0].centre, voxels[1].centre);
    let shift = nalgebra::Vector3::repeat(0.001);
    let points = [
        a,
        a + shift,
        b,
        Point::new(0.1, 0.1, 0.0),
        Point::new(1e9, 0.0, 0.0),
    ];
    assert_eq!(map.object_confidence(BALL), Ok(None));
    assert_eq!(
        map.set_confidences(BALL, &points, &[0.25, 0.75, 1.0, 0.0, 0.0]),
        Ok(2)
    );
    assert_eq!(map.voxel_at(&a).unwrap().confidence, Some(0.5));
    assert_eq!(map.voxel_at(&b).unwrap().confidence, Some(1.0));
    assert_eq!(map.object_confidence(BALL), Ok(Some(0.75)));
}

#[test]
fn confidences_come_from_the_last_call() {
    let mut map = one_ball();
    let voxels = map.object_voxels(BALL).unwrap();
    let (a, b) = (voxels[0].centre, voxels[1].centre);
    assert_eq!(map.set_confidences(BALL, &[a], &[0.25]), Ok(1));
    assert_eq!(map.set_confidences(BALL, &[b], &[0.75]), Ok(1));
    assert_eq!(map.voxel_at(&a).unwrap().confidence, None);
    assert_eq!(map.object_confidence(BALL), Ok(Some(0.75)));
    assert_eq!(map.set_confidences(BALL, &[], &[]), Ok(0));
    assert_eq!(map.object_confidence(BALL), Ok(None));
}

#[test]
fn a_new_owner_does_not_take_over_a_confidence() {
    let mut map = one_ball();
    let top = Point::new(0.001, 0.001, 0.079);
    assert_eq!(map.set_confidences(BALL, &[top], &[0.75]), Ok(1));
    let view = View::new(&[ball(0.0, 0.0)], eye(0.0), [0.0; 3]);
    for confidence in [Some(0.75), None] {
        // Two views found the ball there; from the second without it, the background has as many.
        map.insert(&view.frame(), &[]).unwrap();
        assert_eq!(map.voxel_at(&top).unwrap().confidence, confidence);
    }
}

#[test]
fn free_space_keeps_away_from_objects() {
    let map = one_ball();
    let sampling = FreeSampling {
        within: Aabb::new(Point::new(-0.07, -0.07, 0.0), Point::new(0.07, 0.07, 0.11)).unwrap(),
        count: 500,
        min_distance_m: 0.01,
        seed: 3,
    };
    let cloud = map.object(BALL).unwrap().cloud();
    let by_id = map.sample_free(&sampling, KeepAway::Object(BALL)).unwrap();
    for point in &by_id {
        assert!(
            cloud
                .points_world
                .iter()
                .all(|p| (p - point).norm() >= 0.01)
        );
        assert_eq!(map.occupancy().occupancy(point), Occupancy::Free);
    }
    assert_eq!(
        map.sample_free(&sampling, KeepAway::Objects).unwrap(),
        by_id
    );
    let points = KeepAway::Points(&cloud.points_world);
    assert_eq!(map.sample_free(&sampling, points).unwrap(), by_id);
}

#[test]
fn threads_do_not_change_the_map() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let map = one_ball();
            let cloud = map.object(BALL).unwrap().cloud().clone();
            (
                map.occupancy().to_tree(),
                map.voxels().collect::<Vec<_>>(),
                cloud,
            )
        })
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn bad_input_leaves_the_map_as_it_was() {
    let mut map = one_ball();
    let before = map.occupancy().to_tree();
    let view = View::new(&[], eye(0.0), [0.0; 3]);
    let narrow = Instance::certain(0, vec![true; 7], Category::Mug).unwrap();
    let message = map
        .insert(&view.frame(), &[narrow])
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("mask holds 7 values; a 160 x 120 image needs 19200"),
        "{message}"
    );
    let far = View::new(&[], [900.0, 0.0, 1.0], [0.0; 3]);
    let message = map.insert(&far.frame(), &[]).unwrap_err().to_string();
    assert!(message.contains("lies outside the map"), "{message}");
    assert_eq!(map.occupancy().to_tree(), before);

    let nobody = ObjectId(9);
    let error = MapError::UnknownObject { id: 9 };
    assert_eq!(map.object_voxels(nobody), Err(error.clone()));
    assert_eq!(map.set_confidences(nobody, &[], &[]), Err(error));
    let message = map
        .set_confidences(BALL, &[Point::origin()], &[])
        .unwrap_err()
        .to_string();
    assert!(message.contains("confidences holds 0 values; 1 points need one each"));
    let message = map
        .set_confidences(BALL, &[Point::origin()], &[2.0])
        .unwrap_err()
        .to_string();
    assert!(message.contains("confidences is 2"));
}
