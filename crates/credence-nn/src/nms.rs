//! Overlap of boxes, and suppression of those that a better one covers.

/// Intersection over union of two boxes (left, top, right, bottom), 0 to 1.
///
/// A box that is empty, turned inside out or not finite overlaps nothing.
pub fn iou(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    let common = area(&[
        a[0].max(b[0]),
        a[1].max(b[1]),
        a[2].min(b[2]),
        a[3].min(b[3]),
    ]);
    let (first, second) = (area(a), area(b));
    let union = first + second - common;
    // An edge that is no number passes `max` and `min`, but leaves its box without an area.
    if first.min(second).min(common) > 0.0 && union.is_finite() {
        (common / union).min(1.0)
    } else {
        0.0
    }
}

fn area([left, top, right, bottom]: &[f32; 4]) -> f32 {
    if left < right && top < bottom {
        (right - left) * (bottom - top)
    } else {
        0.0
    }
}

/// Greedy non-maximum suppression: the boxes that overlap no kept one of a higher score by more
/// than `threshold`.
///
/// Indices, highest score first; of equal scores the earlier box comes first, and scores that are
/// not numbers come last.
///
/// # Panics
/// When there are not as many scores as boxes.
pub fn nms(boxes: &[[f32; 4]], scores: &[f32], threshold: f32) -> Vec<usize> {
    assert_eq!(boxes.len(), scores.len(), "a score per box");
    let rank = |at: usize| {
        let score = scores[at];
        if score.is_nan() {
            f32::NEG_INFINITY
        } else {
            score
        }
    };
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|a, b| rank(*b).total_cmp(&rank(*a)));
    let mut kept: Vec<usize> = Vec::new();
    for at in order {
        if kept
            .iter()
            .all(|better| iou(&boxes[*better], &boxes[at]) <= threshold)
        {
            kept.push(at);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn overlaps_by_hand() {
        let unit = [0.0, 0.0, 2.0, 2.0];
        assert_eq!(iou(&unit, &unit), 1.0);
        // 1 of 4 + 4 - 1.
        assert_eq!(iou(&unit, &[1.0, 1.0, 3.0, 3.0]), 1.0 / 7.0);
        // A quarter inside.
        assert_eq!(iou(&unit, &[0.5, 0.5, 1.5, 1.5]), 0.25);
        // Side by side.
        assert_eq!(iou(&unit, &[2.0, 0.0, 4.0, 2.0]), 0.0);
    }

    #[test]
    fn boxes_without_an_area_overlap_nothing() {
        let unit = [0.0, 0.0, 2.0, 2.0];
        for odd in [
            [1.0, 1.0, 1.0, 1.0],
            [2.0, 2.0, 0.0, 0.0],
            [f32::NAN, 0.0, 2.0, 2.0],
            [f32::NEG_INFINITY, 0.0, f32::INFINITY, 2.0],
            [f32::MIN, f32::MIN, f32::MAX, f32::MAX],
        ] {
            assert_eq!(iou(&unit, &odd), 0.0, "{odd:?}");
            assert_eq!(iou(&odd, &odd), 0.0, "{odd:?}");
        }
    }

    #[test]
    fn the_better_of_two_that_overlap_stays() {
        let boxes = [
            [0.0, 0.0, 10.0, 10.0],
            [1.0, 0.0, 11.0, 10.0],
            [20.0, 0.0, 30.0, 10.0],
            [2.0, 0.0, 12.0, 10.0],
        ];
        // Overlaps of neighbours: 90 / 110 = .82; of the first and the last, 80 / 120 = .67.
        assert_eq!(nms(&boxes, &[0.5, 0.9, 0.7, 0.6], 0.7), [1, 2]);
        // The middle one covers both others; without it these are too far apart to matter.
        assert_eq!(nms(&boxes, &[0.9, 0.5, 0.7, 0.6], 0.7), [0, 2, 3]);
        assert_eq!(nms(&boxes, &[0.9, 0.5, 0.7, 0.6], 0.6), [0, 2]);
        assert!(nms(&[], &[], 0.5).is_empty());
    }

    #[test]
    fn equal_scores_stay_in_order_and_those_that_are_no_numbers_come_last() {
        let same = [[0.0, 0.0, 1.0, 1.0]; 3];
        assert_eq!(nms(&same, &[0.5; 3], 0.5), [0]);
        assert_eq!(nms(&same, &[f32::NAN, 0.5, -f32::NAN], 0.5), [1]);
        assert_eq!(nms(&same, &[f32::NAN, 0.5, -f32::NAN], 1.0), [1, 0, 2]);
    }

    #[test]
    #[should_panic(expected = "a score per box")]
    fn as_many_scores_as_boxes() {
        nms(&[[0.0; 4]], &[], 0.5);
    }

    fn scored() -> impl Strategy<Value = (Vec<[f32; 4]>, Vec<f32>)> {
        let one = (0.0_f32..8.0, 0.0_f32..8.0, 0.5_f32..6.0, 0.5_f32..6.0);
        prop::collection::vec((one, 0_u8..20), 0..30).prop_map(|all| {
            all.into_iter()
                .map(|((x, y, w, h), score)| ([x, y, x + w, y + h], f32::from(score) / 20.0))
                .unzip()
        })
    }

    proptest! {
        #[test]
        fn kept_boxes_are_apart_and_dropped_ones_are_covered(
            (boxes, scores) in scored(),
            threshold in 0.1_f32..0.9,
        ) {
            let kept = nms(&boxes, &scores, threshold);
            prop_assert!(kept.is_sorted_by(|a, b| (scores[*a], b) >= (scores[*b], a)));
            for (at, a) in kept.iter().enumerate() {
                for b in &kept[at + 1..] {
                    prop_assert!(iou(&boxes[*a], &boxes[*b]) <= threshold);
                }
            }
            for dropped in (0..boxes.len()).filter(|at| !kept.contains(at)) {
                let covered = kept.iter().any(|better| {
                    iou(&boxes[*better], &boxes[dropped]) > threshold
                        && (scores[*better], dropped) > (scores[dropped], *better)
                });
                prop_assert!(covered);
            }
        }

        /// Scores that differ decide alone: the order of the boxes does not matter.
        #[test]
        fn the_order_of_the_boxes_does_not_matter(
            (boxes, order) in scored().prop_flat_map(|(boxes, _)| {
                let order: Vec<usize> = (0..boxes.len()).collect();
                (Just(boxes), Just(order).prop_shuffle())
            }),
            threshold in 0.1_f32..0.9,
        ) {
            let scores: Vec<f32> = (0..boxes.len()).map(|at| ((at as f32) * 0.7).sin()).collect();
            let moved: Vec<[f32; 4]> = order.iter().map(|at| boxes[*at]).collect();
            let moved_scores: Vec<f32> = order.iter().map(|at| scores[*at]).collect();
            let kept: Vec<usize> = nms(&moved, &moved_scores, threshold)
                .into_iter()
                .map(|at| order[at])
                .collect();
            prop_assert_eq!(kept, nms(&boxes, &scores, threshold));
        }

        #[test]
        fn overlap_is_symmetric_and_at_most_one((boxes, _) in scored()) {
            for a in &boxes {
                for b in &boxes {
                    prop_assert_eq!(iou(a, b), iou(b, a));
                    prop_assert!((0.0..=1.0).contains(&iou(a, b)));
                }
            }
        }
    }
}
