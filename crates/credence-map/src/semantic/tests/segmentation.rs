//! What a segmenter's errors in single views come to.

use std::collections::BTreeSet;

use credence_types::Category;

use super::{
    scene::{Shape, View, ball, eye, intrinsics},
    *,
};

const FIRST: ObjectId = ObjectId(1);
const SECOND: ObjectId = ObjectId(2);

/// A detection with these class scores.
fn detection(mask: Vec<bool>, scores: &[(Category, f64)], score: f64) -> Instance {
    let mut class_scores = [0.0; Category::ALL.len()];
    for (category, value) in scores {
        class_scores[usize::from(category.class()) - 1] = *value;
    }
    Instance::new(0, mask, class_scores, score).unwrap()
}

fn mug(mask: Vec<bool>, score: f64) -> Instance {
    detection(mask, &[(Category::Mug, score)], score)
}

/// The mask and all pixels within some pixels of it, by rows and columns.
fn grown(mask: &[bool], by: usize) -> Vec<bool> {
    let (width, height) = (intrinsics().width(), intrinsics().height());
    let near = |pixel: usize| {
        let (column, row) = (pixel % width, pixel / width);
        (row.saturating_sub(by)..=(row + by).min(height - 1)).any(|r| {
            (column.saturating_sub(by)..=(column + by).min(width - 1)).any(|c| mask[r * width + c])
        })
    };
    (0..mask.len()).map(near).collect()
}

/// Views of the shapes from these azimuths.
fn views(shapes: &[Shape], azimuths_deg: &[f64]) -> Vec<View> {
    let view = |azimuth_deg: &f64| View::new(shapes, eye(*azimuth_deg), [0.0; 3]);
    azimuths_deg.iter().map(view).collect()
}

/// The voxels that pixels with a property lie in.
fn keys(view: &View, has: impl Fn(usize) -> bool) -> BTreeSet<VoxelKey> {
    let frame = view.frame();
    let grid = *empty().occupancy().grid();
    let pixels = (0..view.shown.len()).filter(|pixel| has(*pixel));
    let points = pixels.filter_map(|pixel| frame.world_point(pixel));
    points.filter_map(|point| grid.key_of(&point)).collect()
}

/// The occupied voxels in which all views show a shape and nothing else.
fn shown_by_all(map: &SemanticMap, views: &[View], shape: Option<usize>) -> Vec<SemanticVoxel> {
    let of_view = |view: &View| keys(view, |pixel| view.shown[pixel] == shape);
    let others = |view: &View| keys(view, |pixel| view.shown[pixel] != shape);
    let mut shown = of_view(&views[0]);
    for view in views {
        let own = of_view(view);
        let others = others(view);
        shown.retain(|key| own.contains(key) && !others.contains(key));
    }
    map.voxels().filter(|v| shown.contains(&v.key)).collect()
}

#[test]
fn a_wrong_mask_and_category_in_one_view_are_outvoted() {
    let shapes = [ball(0.0, 0.0)];
    let views = views(&shapes, &[0.0, 4.0, 8.0, 12.0]);
    // Wherever the wrong view is in the order.
    for wrong in 0..4 {
        let mut map = empty();
        for (index, view) in views.iter().enumerate() {
            let instance = if index == wrong {
                let mask = grown(&view.mask(0), 3);
                detection(mask, &[(Category::Bowl, 0.9)], 0.9)
            } else {
                let scores = [(Category::Mug, 0.625), (Category::Can, 0.25)];
                detection(view.mask(0), &scores, 0.75)
            };
            let report = map.insert(&view.frame(), &[instance]).unwrap();
            assert_eq!(report.objects, [Some(FIRST)]);
        }
        assert_agreement(&map);
        let object = map.object(FIRST).unwrap();
        assert_eq!(object.category(), Category::Mug);
        let on_ball = shown_by_all(&map, &views, Some(0));
        assert!(on_ball.len() > 100, "{}", on_ball.len());
        // Three times .75 (.125, .625, .25) for none, mug and can, once .9 (.1, .9) for none, bowl.
        let expected = [0.37125, 0.0, 0.81, 0.0, 0.5625, 0.0, 1.40625];
        let mut whole = 0;
        for voxel in &on_ball {
            let mug = Category::Mug.class();
            assert_eq!((voxel.class, voxel.object), (mug, Some(FIRST)));
            let votes = voxel.histogram.iter().zip(expected);
            whole += usize::from(votes.clone().all(|(v, e)| (v - e).abs() < 1e-12));
        }
        // All but the few in which a lone pixel has no support.
        assert!(
            whole * 100 > on_ball.len() * 95,
            "{whole} of {}",
            on_ball.len()
        );

        // What the wrong mask took of the table is the background's again, and not in the cloud.
        let on_table = shown_by_all(&map, &views, None);
        let mask = grown(&views[wrong].mask(0), 3);
        let taken = keys(&views[wrong], |pixel| mask[pixel]);
        let taken: Vec<_> = on_table.iter().filter(|v| taken.contains(&v.key)).collect();
        assert!(taken.len() > 20, "{}", taken.len());
        assert!(taken.iter().all(|v| v.class == 0 && v.object.is_none()));
        assert!(
            taken
                .iter()
                .all(|v| object.voxels().binary_search(&v.key).is_err())
        );
        let grid = *map.occupancy().grid();
        let points = &object.cloud().points_world;
        for point in points {
            assert!(
                object
                    .voxels()
                    .binary_search(&grid.key_of(point).unwrap())
                    .is_ok()
            );
        }
        let pixels = |view: &View| view.mask(0).iter().filter(|m| **m).count();
        let own: usize = views.iter().map(pixels).sum();
        assert!(points.len() * 100 > own * 95, "{} of {own}", points.len());
    }
}

#[test]
fn the_id_survives_a_missed_detection() {
    let shapes = [ball(0.0, -0.06), ball(0.0, 0.06)];
    let mut map = empty();
    for (index, view) in views(&shapes, &[0.0, 20.0, 40.0, 60.0]).iter().enumerate() {
        let detected: Vec<usize> = match index {
            1 => vec![1],
            2 => vec![],
            _ => vec![0, 1],
        };
        let instances: Vec<Instance> = detected.iter().map(|i| mug(view.mask(*i), 0.8)).collect();
        let report = map.insert(&view.frame(), &instances).unwrap();
        let expected: Vec<_> = detected.iter().map(|i| Some([FIRST, SECOND][*i])).collect();
        assert_eq!((report.objects, report.deleted), (expected, vec![]));
        assert_eq!(ids(&map), [1, 2]);
    }
    assert_eq!(map.object(FIRST).unwrap().views(), 2);
    assert_eq!(map.object(SECOND).unwrap().views(), 3);
    // Views that miss an object take nothing from what was seen of it.
    let points = |id| map.object(id).unwrap().cloud().len();
    let pixels = |views: &[View], shape: usize| -> usize {
        let count = |view: &View| view.mask(shape).iter().filter(|m| **m).count();
        views.iter().map(count).sum()
    };
    let seen = views(&shapes, &[0.0, 60.0]);
    assert!(points(FIRST) * 100 > pixels(&seen, 0) * 95);
    assert!((map.object(FIRST).unwrap().score() - 0.8).abs() < 1e-12);
}

#[test]
fn a_false_detection_in_one_view_steals_no_voxels() {
    let shapes = [ball(0.0, 0.0)];
    let views = views(&shapes, &[0.0, 4.0, 8.0, 12.0]);
    let upper = |view: &View| -> Vec<bool> {
        let frame = view.frame();
        let high = |pixel: usize| frame.world_point(pixel).is_some_and(|p| p.z > 0.04);
        let mask = view.mask(0).into_iter().enumerate();
        mask.map(|(pixel, own)| own && high(pixel)).collect()
    };
    // A double of the object, a part of it and the object with all around it, each better than the
    // right detection.
    type Masks<'a> = &'a dyn Fn(&View) -> Vec<bool>;
    let falses: [Masks<'_>; 3] = [&|view| view.mask(0), &upper, &|view| {
        grown(&view.mask(0), 10)
    }];
    for (case, false_mask) in falses.iter().enumerate() {
        for wrong in 0..views.len() {
            let mut map = empty();
            for (index, view) in views.iter().enumerate() {
                let mut instances = vec![mug(view.mask(0), 0.8)];
                if index == wrong {
                    let mask = false_mask(view);
                    instances.push(detection(mask, &[(Category::Can, 0.95)], 0.95));
                }
                map.insert(&view.frame(), &instances).unwrap();
            }
            assert_agreement(&map);
            let on_ball = shown_by_all(&map, &views, Some(0));
            let owner = on_ball[0].object;
            for voxel in &on_ball {
                let found = (voxel.class, voxel.object);
                let expected = (Category::Mug.class(), owner);
                assert_eq!(found, expected, "case {case}, view {wrong}");
            }
            let on_table = shown_by_all(&map, &views, None);
            assert!(on_table.iter().all(|v| v.class == 0 && v.object.is_none()));
            let object = map.object(owner.unwrap()).unwrap();
            assert_eq!(object.category(), Category::Mug);
            assert!(object.views() >= 3);
        }
    }
}

#[test]
fn a_false_detection_on_the_table_is_the_backgrounds_again() {
    let shapes = [ball(0.0, 0.0)];
    let mut map = empty();
    let views = views(&shapes, &[0.0, 4.0, 8.0]);
    let patch = |view: &View| -> Vec<bool> {
        let frame = view.frame();
        let near = |p: Point| (p - Point::new(0.0, 0.12, 0.0)).norm() < 0.03;
        let pixels = 0..view.shown.len();
        pixels
            .map(|i| frame.world_point(i).is_some_and(near))
            .collect()
    };
    for (index, view) in views.iter().enumerate() {
        let mut instances = vec![mug(view.mask(0), 0.8)];
        if index == 1 {
            instances.push(detection(patch(view), &[(Category::Bowl, 0.95)], 0.95));
        }
        let report = map.insert(&view.frame(), &instances).unwrap();
        assert_eq!(report.objects[0], Some(FIRST));
    }
    let mask = patch(&views[1]);
    let taken = keys(&views[1], |pixel| mask[pixel]);
    let on_table = shown_by_all(&map, &views, None);
    let taken = on_table.iter().filter(|v| taken.contains(&v.key)).count();
    assert!(taken > 10, "{taken}");
    assert!(on_table.iter().all(|v| v.class == 0 && v.object.is_none()));
    let on_ball = shown_by_all(&map, &views, Some(0));
    assert!(on_ball.iter().all(|v| v.object == Some(FIRST)));
}

#[test]
fn like_mugs_with_overlapping_masks_stay_two() {
    // 9 cm apart and 8 cm wide, beside each other and one before the other.
    let shapes = [ball(0.0, -0.045), ball(0.0, 0.045)];
    for azimuths in [[0.0, 10.0, 20.0, 30.0], [50.0, 40.0, 30.0, 20.0]] {
        let views = views(&shapes, &azimuths);
        for scores in [[0.8, 0.9], [0.9, 0.8], [0.8, 0.8]] {
            let mut map = empty();
            for view in &views {
                let [first, second] = [0, 1].map(|shape| grown(&view.mask(shape), 4));
                let shared = first.iter().zip(&second).filter(|(a, b)| **a && **b);
                assert!(shared.count() > 20);
                let instances = [mug(first, scores[0]), mug(second, scores[1])];
                let report = map.insert(&view.frame(), &instances).unwrap();
                assert_eq!(report.objects, [Some(FIRST), Some(SECOND)]);
            }
            assert_eq!(ids(&map), [1, 2]);
            assert_agreement(&map);
            for (shape, id) in [FIRST, SECOND].into_iter().enumerate() {
                let object = map.object(id).unwrap();
                assert_eq!((object.category(), object.views()), (Category::Mug, 4));
                let own = shown_by_all(&map, &views, Some(shape));
                let stolen = own.iter().filter(|v| v.object != Some(id)).count();
                // The masks err by 4 of the 19 pixels of a ball, in all views alike.
                assert!(stolen * 4 < own.len(), "{stolen} of {}", own.len());
            }
        }
    }
}

#[test]
fn a_mask_over_two_mugs_in_one_view_joins_them_in_none() {
    let shapes = [ball(0.0, -0.045), ball(0.0, 0.045)];
    let mut map = empty();
    let views = views(&shapes, &[0.0, 5.0, 10.0, 15.0, 20.0]);
    for (index, view) in views.iter().enumerate() {
        let both = view.shown.iter().map(Option::is_some).collect();
        let instances = match index {
            1 => vec![mug(both, 0.95)],
            // The mug that the joint mask did not go to is alone.
            2 => vec![mug(view.mask(1), 0.8)],
            _ => vec![mug(view.mask(0), 0.8), mug(view.mask(1), 0.8)],
        };
        let report = map.insert(&view.frame(), &instances).unwrap();
        let expected = match index {
            1 => vec![report.objects[0]],
            2 => vec![Some(SECOND)],
            _ => vec![Some(FIRST), Some(SECOND)],
        };
        assert_eq!(report.objects, expected, "view {index}");
    }
    assert_eq!(ids(&map), [1, 2]);
    for (shape, id) in [FIRST, SECOND].into_iter().enumerate() {
        let object = map.object(id).unwrap();
        let of_other = shown_by_all(&map, &views, Some(1 - shape));
        assert!(of_other.len() > 80, "{}", of_other.len());
        for voxel in of_other {
            assert!(object.voxels().binary_search(&voxel.key).is_err());
            assert_ne!(voxel.object, Some(id));
        }
    }
}
