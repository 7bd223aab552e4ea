//! From what is told of the anchors to the regions that are looked at.

use credence_nn::nms;

use super::{
    anchors::Anchors,
    boxes::{Edges, clip, decode, sides},
};

/// Unit of what is told of anchors.
pub const ANCHOR_UNIT: [f32; 2] = [1.0, 1.0];
/// Best anchors of a level that become proposals.
const PER_LEVEL: usize = 200;
/// Proposals that overlap a better one by more are dropped.
const OVERLAP: f32 = 0.7;
/// Least side of a proposal, pixels.
const LEAST_SIDE: f32 = 3.0;

/// The best `count` regions of an image: their edges, the surest first. `told` is each anchor's
/// objectness and box.
pub fn proposals(anchors: &Anchors, told: &[(f32, [f32; 4])], count: usize) -> Vec<Edges> {
    let mut edges = Vec::new();
    let mut scores = Vec::new();
    for level in anchors.levels() {
        let mut order: Vec<usize> = level.collect();
        let best_first = |a: &usize, b: &usize| told[*b].0.total_cmp(&told[*a].0).then(a.cmp(b));
        if order.len() > PER_LEVEL {
            order.select_nth_unstable_by(PER_LEVEL - 1, best_first);
            order.truncate(PER_LEVEL);
        }
        // Of equals the first in the image comes first.
        order.sort_unstable_by(best_first);
        for anchor in order {
            let (score, deltas) = told[anchor];
            let region = clip(decode(anchors.edges()[anchor], deltas, ANCHOR_UNIT));
            if sides(region).iter().all(|side| *side >= LEAST_SIDE) {
                edges.push(region);
                scores.push(score);
            }
        }
    }
    let kept = nms::nms(&edges, &scores, OVERLAP).into_iter().take(count);
    kept.map(|index| edges[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_anchors_become_regions_once_each() {
        let anchors = Anchors::new();
        let mut told = vec![(-9.0, [0.0; 4]); anchors.edges().len()];
        // Two shapes of one size about one cell overlap by half; a box told twice is one.
        let first = 6 * (40 * 15 + 20) + 1;
        told[first] = (3.0, [0.0; 4]);
        told[first + 1] = (2.0, [0.0; 4]);
        let other = 7200 + 6 * (20 * 7 + 10) + 1;
        told[other] = (1.0, [0.0, 0.0, 0.5, 0.0]);
        told[other + 6] = (0.5, [-16.0 / 57.0, 0.0, 0.5, 0.0]);
        let regions = proposals(&anchors, &told, 3);
        let close = |a: &Edges, b: &Edges| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(close(&regions[0], &anchors.edges()[first]));
        assert!(close(&regions[1], &anchors.edges()[first + 1]));
        let width = 57.0 * 0.5_f32.exp();
        assert!((sides(regions[2])[0] - width).abs() < 1e-3);
        let fourth = proposals(&anchors, &told, 4)[3];
        assert!(
            (fourth[0] - regions[2][0]).abs() > 1.0,
            "the second telling is dropped"
        );
    }

    #[test]
    fn regions_stay_in_the_image() {
        let anchors = Anchors::new();
        let told = vec![(0.0, [-2.0, -2.0, 1.0, 1.0]); anchors.edges().len()];
        for [left, top, right, bottom] in proposals(&anchors, &told, 1000) {
            assert!(left >= -0.5 && top >= -0.5 && right <= 319.5 && bottom <= 239.5);
            assert!(right - left >= LEAST_SIDE && bottom - top >= LEAST_SIDE);
        }
    }
}
