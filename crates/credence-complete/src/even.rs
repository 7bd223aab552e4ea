use std::ops::Range;

use credence_types::Point;

/// Most points of a bucket.
const BUCKET: usize = 32;

/// Squared distance of a point that is in the order already: below every other.
const TAKEN: f64 = -1.0;

/// Indices of `count` of the points, all if there are fewer, of which every prefix is even.
///
/// Farthest-point sampling (Gonzalez 1985): the first is the point farthest from the mean, and
/// each further one the farthest from those before it, ties by index.
///
/// Points keep their distance to the order in buckets of a k-d tree's leaves; a new one reaches
/// only buckets whose farthest point may be nearer to it than to all before, so that 2,048 of
/// 8,000 points take milliseconds, and the outcome is that of the full search.
pub fn even_order(points: &[Point], count: usize) -> Vec<usize> {
    let count = count.min(points.len());
    let mean: Point = (points
        .iter()
        .map(|p| p.coords)
        .sum::<nalgebra::Vector3<f64>>()
        / points.len() as f64)
        .into();
    let mut slots: Vec<Slot> = points
        .iter()
        .enumerate()
        .map(|(index, point)| Slot {
            point: *point,
            index,
            squared: (point - mean).norm_squared(),
        })
        .collect();
    let mut buckets = Vec::new();
    divide(&mut slots, 0, &mut buckets);
    for bucket in &mut buckets {
        bucket.find_farthest(&slots);
    }

    let mut order = Vec::with_capacity(count);
    while order.len() < count {
        let farthest = buckets.iter().map(|bucket| bucket.farthest);
        let Some(next) = farthest.reduce(|a, b| if farther(&slots[b], &slots[a]) { b } else { a })
        else {
            break;
        };
        let point = slots[next].point;
        if order.is_empty() {
            // The distances from the mean have chosen the first; those to the order begin with it.
            for slot in &mut slots {
                slot.squared = f64::INFINITY;
            }
        }
        order.push(slots[next].index);
        slots[next].squared = TAKEN;
        let begins = order.len() == 1;
        for bucket in &mut buckets {
            // A bucket at exactly the bound is searched too: it may hold the point just taken.
            if begins || bucket.squared_to(&point) <= slots[bucket.farthest].squared.max(0.0) {
                bucket.approach(&mut slots, &point);
            }
        }
    }
    order
}

/// A point, and how far it is from the order.
struct Slot {
    point: Point,
    index: usize,
    squared: f64,
}

/// Whether `a` comes before `b` in the order.
fn farther(a: &Slot, b: &Slot) -> bool {
    a.squared > b.squared || (a.squared == b.squared && a.index < b.index)
}

/// Neighbouring points and their box.
struct Bucket {
    slots: Range<usize>,
    low: Point,
    high: Point,
    farthest: usize,
}

impl Bucket {
    /// Squared distance of a point to the box: rounded as those to the points in it, so never more.
    fn squared_to(&self, point: &Point) -> f64 {
        let outside = (self.low - point).sup(&(point - self.high));
        outside.map(|axis| axis.max(0.0)).norm_squared()
    }

    /// Takes in that `point` is in the order now.
    fn approach(&mut self, slots: &mut [Slot], point: &Point) {
        for slot in &mut slots[self.slots.clone()] {
            slot.squared = slot.squared.min((slot.point - point).norm_squared());
        }
        self.find_farthest(slots);
    }

    fn find_farthest(&mut self, slots: &[Slot]) {
        self.farthest = self.slots.start;
        for at in self.slots.clone() {
            if farther(&slots[at], &slots[self.farthest]) {
                self.farthest = at;
            }
        }
    }
}

/// Halves the slots at the median of their longest side until they fit into buckets; `start` is
/// the place of the first among all.
fn divide(slots: &mut [Slot], start: usize, buckets: &mut Vec<Bucket>) {
    let Some(first) = slots.first() else {
        return;
    };
    let (low, high) = slots
        .iter()
        .fold((first.point, first.point), |(low, high), slot| {
            (low.inf(&slot.point), high.sup(&slot.point))
        });
    if slots.len() <= BUCKET {
        buckets.push(Bucket {
            slots: start..start + slots.len(),
            low,
            high,
            farthest: start,
        });
        return;
    }
    let axis = (high - low).imax();
    let middle = slots.len() / 2;
    slots.select_nth_unstable_by(middle, |a, b| {
        let by_axis = a.point[axis].total_cmp(&b.point[axis]);
        by_axis.then(a.index.cmp(&b.index))
    });
    let (left, right) = slots.split_at_mut(middle);
    divide(left, start, buckets);
    divide(right, start + middle, buckets);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The textbook's loop.
    fn full_search(points: &[Point], count: usize) -> Vec<usize> {
        let farthest = |squared: &[f64]| {
            (0..squared.len()).fold(
                0,
                |best, i| if squared[i] > squared[best] { i } else { best },
            )
        };
        let sum: nalgebra::Vector3<f64> = points.iter().map(|p| p.coords).sum();
        let mean: Point = (sum / points.len() as f64).into();
        let from_mean: Vec<f64> = points.iter().map(|p| (p - mean).norm_squared()).collect();
        let mut order = Vec::new();
        let mut squared = vec![f64::INFINITY; points.len()];
        while order.len() < count.min(points.len()) {
            let next = farthest(if order.is_empty() {
                &from_mean
            } else {
                &squared
            });
            order.push(next);
            for (squared, point) in squared.iter_mut().zip(points) {
                *squared = squared.min((point - points[next]).norm_squared());
            }
            squared[next] = TAKEN;
        }
        order
    }

    #[test]
    fn of_points_in_a_row_come_the_ends_then_the_middle() {
        let row: Vec<Point> = [0.0, 1.0, 2.0, 3.0, 4.0, 10.0]
            .map(|x| Point::new(x, 0.0, 0.0))
            .into();
        // The mean is 3.33; 10 is farthest from it, 0 from 10, 4 from both, 2 from all three.
        assert_eq!(even_order(&row, 4), [5, 0, 4, 2]);
        assert_eq!(even_order(&row, 99), [5, 0, 4, 2, 1, 3]);
        assert_eq!(even_order(&row, 0), [0; 0]);
        assert_eq!(even_order(&[], 5), [0; 0]);
    }

    #[test]
    fn equal_points_come_last_and_in_their_order() {
        let twice = [1.0, 0.0, 1.0, 1.0].map(|x| Point::new(x, 0.0, 0.0));
        assert_eq!(even_order(&twice, 4), [1, 0, 2, 3]);
    }

    proptest! {
        /// Coordinates on a coarse lattice, so that many distances are equal.
        #[test]
        fn agrees_with_the_full_search(
            cells in prop::collection::vec([0..6_i32, 0..6, 0..2], 0..400),
            fine in prop::collection::vec([-1.0..1.0, -0.1..0.1, -9.0..9.0_f64], 0..400),
            count in 0..500_usize,
        ) {
            let cells = cells.into_iter().map(|p| Point::from(p.map(f64::from)));
            let points: Vec<Point> = cells.chain(fine.into_iter().map(Point::from)).collect();
            prop_assert_eq!(even_order(&points, count), full_search(&points, count));
        }

        /// Gonzalez: no point is farther from a prefix than twice the best that as many centres
        /// can do; what the order guarantees is that the prefix's own points are that far apart.
        #[test]
        fn every_prefix_is_as_far_apart_as_the_rest_is_from_it(
            fine in prop::collection::vec([-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], 3..200),
            prefix in 2..50_usize,
        ) {
            let points: Vec<Point> = fine.into_iter().map(Point::from).collect();
            let order = even_order(&points, points.len());
            let (head, tail) = order.split_at(prefix.min(points.len() - 1));
            let gap = |a: usize, b: usize| (points[a] - points[b]).norm();
            let apart = head.iter().enumerate().flat_map(|(i, a)| head[..i].iter().map(move |b| gap(*a, *b)));
            let apart = apart.fold(f64::INFINITY, f64::min);
            for rest in tail {
                let near = head.iter().map(|h| gap(*h, *rest)).fold(f64::INFINITY, f64::min);
                prop_assert!(near <= apart);
            }
        }
    }
}
