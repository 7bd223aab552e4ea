//! What the heads should say: of the anchors and of the regions that are sampled for a step.

use credence_nn::nms::iou;
use credence_segment::maskrcnn::{
    ANCHOR_UNIT, Anchors, Edges, REGION_UNIT, Region, encode, proposals,
};
use rand::{Rng, seq::SliceRandom as _};

use super::truth::{LEAST_PIXELS, Truth, region_mask};

/// Anchors that overlap an object by at least the first are it, by less than the second nothing.
const ANCHOR_OVERLAP: [f32; 2] = [0.6, 0.3];
/// Anchors sampled of a picture, and how many of them objects at most.
const ANCHORS: usize = 96;
const OBJECT_ANCHORS: usize = 32;
/// Proposals of a picture; a region that overlaps an object by this is it.
const PROPOSALS: usize = 100;
const REGION_OVERLAP: f32 = 0.5;
/// Regions sampled of a picture, how many of them objects at most, and of how many the mask is
/// learned.
const REGIONS: usize = 48;
const OBJECT_REGIONS: usize = 16;
const MASKS: usize = 6;

/// An anchor that is sampled: its place, and the box that it should tell of if it is an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AnchorTarget {
    pub(super) anchor: usize,
    pub(super) told: Option<[f32; 4]>,
}

/// A region that is sampled.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RegionTarget {
    pub(super) region: Region,
    /// 0 for the background.
    pub(super) class: usize,
    /// The object's box, told from the region.
    pub(super) told: Option<[f32; 4]>,
    /// What of the region shows the object, where that is to be learned.
    pub(super) mask: Option<Vec<bool>>,
}

/// Anchors to learn from: those that overlap an object enough, the best of every object, and as
/// many that show nothing.
pub(super) fn anchor_targets(
    anchors: &Anchors,
    truths: &[Truth],
    rng: &mut impl Rng,
) -> Vec<AnchorTarget> {
    // An object's best anchors may overlap it by little; equals are all its best.
    let mut best = vec![0.0_f32; truths.len()];
    let overlaps: Vec<Vec<f32>> = anchors
        .edges()
        .iter()
        .map(|anchor| {
            let row: Vec<f32> = truths.iter().map(|t| iou(anchor, &t.edges)).collect();
            for (best, overlap) in best.iter_mut().zip(&row) {
                *best = best.max(*overlap);
            }
            row
        })
        .collect();
    let (mut objects, mut nothing) = (Vec::new(), Vec::new());
    for (anchor, row) in overlaps.iter().enumerate() {
        let (mut most, mut of) = (0.0, None);
        for (number, overlap) in row.iter().enumerate() {
            if *overlap > most {
                (most, of) = (*overlap, Some(number));
            }
        }
        let is_best = |number: &usize| row[*number] > 0.0 && row[*number] >= best[*number];
        let chosen = (0..row.len()).find(is_best).or(of);
        let learned = |number: usize| truths[number].pixels >= LEAST_PIXELS;
        match chosen {
            Some(number) if most >= ANCHOR_OVERLAP[0] || is_best(&number) => {
                // What hardly shows is neither an object nor nothing.
                objects.extend(learned(number).then_some((anchor, number)));
            }
            _ if most < ANCHOR_OVERLAP[1] => nothing.push(anchor),
            _ => {}
        }
    }
    let (objects, _) = objects.partial_shuffle(rng, OBJECT_ANCHORS);
    let rest = ANCHORS - objects.len();
    let (nothing, _) = nothing.partial_shuffle(rng, rest);
    let object = |(anchor, number): &(usize, usize)| AnchorTarget {
        anchor: *anchor,
        told: Some(encode(
            anchors.edges()[*anchor],
            truths[*number].edges,
            ANCHOR_UNIT,
        )),
    };
    let none = |anchor: &usize| AnchorTarget {
        anchor: *anchor,
        told: None,
    };
    objects
        .iter()
        .map(object)
        .chain(nothing.iter().map(none))
        .collect()
}

/// Regions to learn from: of the proposals and the true boxes, those that are objects and others.
pub(super) fn region_targets(
    (anchors, told): (&Anchors, &[(f32, [f32; 4])]),
    image: usize,
    (truths, owners): (&[Truth], &[u8]),
    rng: &mut impl Rng,
) -> Vec<RegionTarget> {
    let mut regions: Vec<Edges> = proposals(anchors, told, PROPOSALS);
    regions.extend(truths.iter().map(|truth| truth.edges));
    let (mut objects, mut nothing) = (Vec::new(), Vec::new());
    for edges in regions {
        let overlap = |truth: &Truth| iou(&edges, &truth.edges);
        let best = truths
            .iter()
            .max_by(|a, b| overlap(a).total_cmp(&overlap(b)));
        match best {
            Some(truth) if overlap(truth) >= REGION_OVERLAP => {
                objects.extend((truth.pixels >= LEAST_PIXELS).then_some((edges, *truth)));
            }
            _ => nothing.push(edges),
        }
    }
    let (objects, _) = objects.partial_shuffle(rng, OBJECT_REGIONS);
    let rest = REGIONS - objects.len();
    let (nothing, _) = nothing.partial_shuffle(rng, rest);
    let object = |(place, (edges, truth)): (usize, &(Edges, Truth))| RegionTarget {
        region: Region {
            image,
            edges: *edges,
        },
        class: usize::from(truth.category.class()),
        told: Some(encode(*edges, truth.edges, REGION_UNIT)),
        mask: (place < MASKS).then(|| region_mask(owners, truth.number, *edges)),
    };
    let none = |edges: &Edges| RegionTarget {
        region: Region {
            image,
            edges: *edges,
        },
        class: 0,
        told: None,
        mask: None,
    };
    let objects = objects.iter().enumerate().map(object);
    objects.chain(nothing.iter().map(none)).collect()
}

#[cfg(test)]
mod tests {
    use credence_nn::rgbd::{HEIGHT, WIDTH};
    use credence_segment::maskrcnn::decode;
    use credence_types::{Category, stream};

    use super::*;

    fn truth(edges: Edges, pixels: usize) -> Truth {
        Truth {
            number: 1,
            category: Category::Mug,
            edges,
            pixels,
        }
    }

    #[test]
    fn every_object_has_an_anchor_and_is_told_from_it() {
        let anchors = Anchors::new();
        // The second is too long for any anchor to overlap it by 0.6.
        let truths = [
            truth([100.5, 80.5, 160.5, 140.5], 3600),
            truth([10.5, 200.5, 210.5, 212.5], 2400),
        ];
        let targets = anchor_targets(&anchors, &truths, &mut stream(0, "test/anchors"));
        assert_eq!(targets.len(), ANCHORS);
        for truth in &truths {
            let tells = |target: &AnchorTarget| {
                target.told.is_some_and(|told| {
                    let edges = decode(anchors.edges()[target.anchor], told, ANCHOR_UNIT);
                    edges
                        .iter()
                        .zip(truth.edges)
                        .all(|(a, b)| (a - b).abs() < 0.01)
                })
            };
            assert!(targets.iter().any(tells));
        }
        for target in targets.iter().filter(|target| target.told.is_none()) {
            let anchor = &anchors.edges()[target.anchor];
            assert!(
                truths
                    .iter()
                    .all(|t| iou(anchor, &t.edges) < ANCHOR_OVERLAP[1])
            );
        }
    }

    #[test]
    fn what_hardly_shows_is_neither_an_object_nor_nothing() {
        let anchors = Anchors::new();
        let glimpse = [truth([100.5, 80.5, 160.5, 140.5], 20)];
        let rng = &mut stream(0, "test/anchors");
        let targets = anchor_targets(&anchors, &glimpse, rng);
        let apart = |edges: &Edges| iou(edges, &glimpse[0].edges) < ANCHOR_OVERLAP[1];
        assert!(
            targets
                .iter()
                .all(|t| t.told.is_none() && apart(&anchors.edges()[t.anchor]))
        );
        let told = vec![(0.0, [0.0; 4]); anchors.edges().len()];
        let owners = vec![0; WIDTH * HEIGHT];
        let regions = region_targets((&anchors, &told), 0, (&glimpse, &owners), rng);
        assert!(regions.iter().all(|r| r.class == 0));
        assert!(
            regions
                .iter()
                .all(|r| iou(&r.region.edges, &glimpse[0].edges) < REGION_OVERLAP)
        );
        assert!(
            anchor_targets(&anchors, &[], rng)
                .iter()
                .all(|t| t.told.is_none())
        );
    }

    #[test]
    fn regions_are_objects_by_half_and_learn_its_mask() {
        let anchors = Anchors::new();
        let told = vec![(0.0, [0.0; 4]); anchors.edges().len()];
        let truths = [truth([100.5, 80.5, 160.5, 140.5], 1800)];
        let mut owners = vec![0; WIDTH * HEIGHT];
        for row in 81..=140 {
            owners[row * WIDTH + 101..row * WIDTH + 131].fill(1);
        }
        let rng = &mut stream(0, "test/regions");
        let regions = region_targets((&anchors, &told), 3, (&truths, &owners), rng);
        assert!(regions.iter().all(|r| r.region.image == 3));
        let objects: Vec<_> = regions.iter().filter(|r| r.class > 0).collect();
        assert!(!objects.is_empty() && objects.len() <= OBJECT_REGIONS);
        for region in &objects {
            assert_eq!(region.class, usize::from(Category::Mug.class()));
            let back = decode(region.region.edges, region.told.unwrap(), REGION_UNIT);
            assert!(iou(&back, &truths[0].edges) > 0.999);
        }
        let masks: Vec<_> = objects.iter().filter_map(|r| r.mask.as_ref()).collect();
        assert_eq!(masks.len(), objects.len().min(MASKS));
        // The left half of the object's box shows it.
        assert!(
            masks
                .iter()
                .all(|mask| mask.contains(&true) && mask.contains(&false))
        );
    }
}
