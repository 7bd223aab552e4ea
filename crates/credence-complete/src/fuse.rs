use std::collections::HashMap;

use credence_types::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::{CompleteError, even_order};

/// A guess may lie on a surer surface if it is within this many of its own spreads: of errors of
/// Laplace's distribution, 2 % are larger.
const SPREADS: f64 = 4.0;

/// And within this, metres: spreads are guesses too.
const FARTHEST_M: f64 = 0.01;

/// Clearly surer is a spread below this share of the other's.
const SURER: f64 = 0.8;

/// Largest distance that thinned points keep, metres, and how often the search for it halves.
const WIDEST_M: f64 = 0.1;
const HALVINGS: usize = 10;

/// Points on a surface and their expected distances from the true one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SpreadCloud {
    /// World coordinates, metres.
    pub points_world: Vec<Point>,
    /// Spread of each point, metres.
    pub spread_m: Vec<f64>,
}

impl SpreadCloud {
    /// A point and its spread; a point without one is taken at its word.
    fn entry(&self, index: usize) -> (Point, f64) {
        let spread_m = self.spread_m.get(index).copied().unwrap_or(0.0);
        (self.points_world[index], spread_m)
    }
}

/// What all views together say of the space that completions claim.
pub struct SeenSpace<'a> {
    /// Whether a view looked through a place, with whatever margin its noise asks for.
    pub is_free: &'a dyn Fn(&Point) -> bool,
    /// Points measured on the object, world, metres.
    pub observed_world: &'a [Point],
    /// What lies this near to one of them is there, whatever `is_free` says, metres.
    pub near_m: f64,
}

/// The completions that several views gave of one object as one cloud.
///
/// It has at most `count` points, in an even order. A single view's completion stays as it is.
///
/// 1. Points in space that a view looked through are dropped, unless measured points are near.
/// 2. A guess that may lie on the surface of which another view is clearly surer (within
///    four of its own spreads, at most 1 cm) is dropped: it says nothing that the other does not.
/// 3. What is left is thinned, the surest first, to points that keep a distance.
///
/// # Errors
/// More points than a neighbour search can hold.
pub fn fuse(
    views: &[SpreadCloud],
    seen: &SeenSpace<'_>,
    count: usize,
) -> Result<SpreadCloud, CompleteError> {
    if let [view] = views {
        return Ok(view.clone());
    }
    let mut guesses: Vec<Guess> = Vec::new();
    for (view, cloud) in views.iter().enumerate() {
        for index in 0..cloud.points_world.len() {
            let (point, spread_m) = cloud.entry(index);
            guesses.push(Guess {
                point,
                spread_m,
                view,
                index,
            });
        }
    }
    drop_seen_through(&mut guesses, seen)?;
    // Views take turns among equally sure points, which come in an even order each.
    guesses.sort_by(|a, b| {
        let by_spread = a.spread_m.total_cmp(&b.spread_m);
        by_spread
            .then(a.index.cmp(&b.index))
            .then(a.view.cmp(&b.view))
    });
    let guesses = unexplained(guesses);
    let kept = thinned(&guesses, count);
    let points: Vec<Point> = kept.iter().map(|guess| guess.point).collect();
    let order = even_order(&points, count);
    Ok(SpreadCloud {
        points_world: order.iter().map(|at| kept[*at].point).collect(),
        spread_m: order.iter().map(|at| kept[*at].spread_m).collect(),
    })
}

/// A point of a view's completion.
#[derive(Debug, Clone, Copy)]
struct Guess {
    point: Point,
    spread_m: f64,
    view: usize,
    index: usize,
}

fn drop_seen_through(guesses: &mut Vec<Guess>, seen: &SeenSpace<'_>) -> Result<(), CompleteError> {
    let rows: Vec<[f64; 3]> = seen.observed_world.iter().map(|p| (*p).into()).collect();
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&rows)
        .map_err(|_overflow| CompleteError::TooManyPoints { count: rows.len() })?;
    let is_observed = |point: &Point| {
        let at: [f64; 3] = (*point).into();
        let nearest = tree.query(&at).nearest_one::<SquaredEuclidean<f64>>();
        nearest.execute().distance <= seen.near_m.powi(2)
    };
    let is_near = |point: &Point| !rows.is_empty() && is_observed(point);
    guesses.retain(|guess| !(seen.is_free)(&guess.point) || is_near(&guess.point));
    Ok(())
}

/// The guesses, sorted by spread, that no clearly surer one of another view explains.
fn unexplained(guesses: Vec<Guess>) -> Vec<Guess> {
    let mut kept = Cells::new(FARTHEST_M);
    for guess in guesses {
        let reach_m = (SPREADS * guess.spread_m).min(FARTHEST_M);
        let explains = |other: &Guess| {
            other.view != guess.view
                && other.spread_m < SURER * guess.spread_m
                && (other.point - guess.point).norm() <= reach_m
        };
        if !kept.any_near(&guess.point, explains) {
            kept.push(guess);
        }
    }
    kept.guesses
}

/// Those of the guesses that keep the largest distance from all before them of which at least
/// `count` remain; all if there are no more.
fn thinned(guesses: &[Guess], count: usize) -> Vec<Guess> {
    if guesses.len() <= count {
        return guesses.to_vec();
    }
    let (mut low_m, mut high_m) = (0.0, WIDEST_M);
    let mut best = guesses.to_vec();
    for _ in 0..HALVINGS {
        let gap_m = f64::midpoint(low_m, high_m);
        let mut kept = Cells::new(gap_m);
        for guess in guesses {
            let crowds = |other: &Guess| (other.point - guess.point).norm() < gap_m;
            if !kept.any_near(&guess.point, crowds) {
                kept.push(*guess);
            }
        }
        if kept.guesses.len() >= count {
            low_m = gap_m;
            best = kept.guesses;
        } else {
            high_m = gap_m;
        }
    }
    best
}

/// Guesses by the cube of space that they lie in.
struct Cells {
    edge_m: f64,
    guesses: Vec<Guess>,
    by_cell: HashMap<[i64; 3], Vec<usize>>,
}

impl Cells {
    fn new(edge_m: f64) -> Self {
        Self {
            edge_m,
            guesses: Vec::new(),
            by_cell: HashMap::new(),
        }
    }

    fn cell(&self, point: &Point) -> [i64; 3] {
        let cell = |axis: usize| (point[axis] / self.edge_m).floor() as i64;
        [cell(0), cell(1), cell(2)]
    }

    fn push(&mut self, guess: Guess) {
        let cell = self.cell(&guess.point);
        self.by_cell
            .entry(cell)
            .or_default()
            .push(self.guesses.len());
        self.guesses.push(guess);
    }

    /// Whether any guess within an edge of the point, and perhaps some farther away, is as asked.
    fn any_near(&self, point: &Point, is_asked: impl Fn(&Guess) -> bool) -> bool {
        let [x, y, z] = self.cell(point);
        let around = |c: i64| c.saturating_sub(1)..=c.saturating_add(1);
        around(x).any(|x| {
            around(y).any(|y| {
                around(z).any(|z| {
                    let cell = self.by_cell.get(&[x, y, z]);
                    cell.is_some_and(|cell| cell.iter().any(|at| is_asked(&self.guesses[*at])))
                })
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points along x, millimetres, each with its spread.
    fn row(points_mm: &[(f64, f64)]) -> SpreadCloud {
        SpreadCloud {
            points_world: points_mm
                .iter()
                .map(|(x, _)| Point::new(x / 1e3, 0.0, 0.0))
                .collect(),
            spread_m: points_mm.iter().map(|(_, spread)| spread / 1e3).collect(),
        }
    }

    /// Where the fused points lie, sorted, millimetres.
    fn fused_mm(views: &[SpreadCloud], seen: &SeenSpace<'_>, count: usize) -> Vec<f64> {
        let fused = fuse(views, seen, count).unwrap();
        let mut places: Vec<f64> = fused
            .points_world
            .iter()
            .map(|p| (p.x * 1e3).round())
            .collect();
        places.sort_by(f64::total_cmp);
        places
    }

    const UNSEEN: SeenSpace<'_> = SeenSpace {
        is_free: &|_| false,
        observed_world: &[],
        near_m: 0.005,
    };

    #[test]
    fn a_guess_on_a_surer_surface_says_nothing() {
        // Of the second view, the guess at 3 may lie on the sure point at 0, that at 9 may not,
        // that at 20 is as sure as its neighbour, and the one at 41 has only its own view beside it.
        let sure = row(&[(0.0, 0.5), (21.0, 1.0)]);
        let guesses = row(&[
            (3.0, 1.0),
            (9.0, 2.0),
            (20.0, 1.2),
            (40.0, 0.5),
            (41.0, 2.0),
        ]);
        assert_eq!(
            fused_mm(&[sure, guesses], &UNSEEN, 99),
            [0.0, 9.0, 20.0, 21.0, 40.0, 41.0]
        );
    }

    #[test]
    fn no_spread_reaches_farther_than_a_centimetre() {
        let sure = row(&[(0.0, 1.0)]);
        let lost = row(&[(9.0, 50.0), (11.0, 50.0)]);
        assert_eq!(fused_mm(&[sure, lost], &UNSEEN, 99), [0.0, 11.0]);
    }

    #[test]
    fn what_was_looked_through_goes_unless_it_was_measured() {
        let views = [row(&[(0.0, 1.0), (30.0, 1.0)]), row(&[(60.0, 1.0)])];
        let measured = [Point::new(0.064, 0.0, 0.0)];
        let seen = SeenSpace {
            is_free: &|p| p.x > 0.02,
            observed_world: &measured,
            near_m: 0.005,
        };
        assert_eq!(fused_mm(&views, &seen, 99), [0.0, 60.0]);
    }

    #[test]
    fn thinning_keeps_the_surest() {
        let first = row(&[(0.0, 1.0), (8.5, 2.0), (20.0, 1.0)]);
        let second = row(&[(2.0, 1.5), (11.0, 1.5), (22.0, 1.5)]);
        assert_eq!(fused_mm(&[first, second], &UNSEEN, 3), [0.0, 11.0, 20.0]);
    }

    #[test]
    fn one_view_is_left_alone() {
        let view = row(&[(5.0, 1.0), (5.0, 9.0), (7.0, 2.0)]);
        let free = SeenSpace {
            is_free: &|_| true,
            ..UNSEEN
        };
        assert_eq!(fuse(std::slice::from_ref(&view), &free, 2).unwrap(), view);
        assert_eq!(fuse(&[], &UNSEEN, 5).unwrap(), SpreadCloud::default());
        assert_eq!(
            fuse(&[view, row(&[])], &free, 5).unwrap(),
            SpreadCloud::default()
        );
    }

    proptest! {
        #[test]
        fn fused_points_are_the_views_own_and_no_more_than_asked(
            views in prop::collection::vec(
                prop::collection::vec(([-0.05..0.05_f64, -0.05..0.05, -0.05..0.05], 0.0..0.02_f64), 0..80),
                2..4,
            ),
            count in 0..150_usize,
        ) {
            let clouds: Vec<SpreadCloud> = views.iter().map(|view| SpreadCloud {
                points_world: view.iter().map(|(p, _)| Point::from(*p)).collect(),
                spread_m: view.iter().map(|(_, s)| *s).collect(),
            }).collect();
            let fused = fuse(&clouds, &UNSEEN, count).unwrap();
            prop_assert!(fused.points_world.len() <= count);
            prop_assert_eq!(fused.points_world.len(), fused.spread_m.len());
            for (point, spread) in fused.points_world.iter().zip(&fused.spread_m) {
                let is_own = views.iter().flatten().any(|(p, s)| Point::from(*p) == *point && s == spread);
                prop_assert!(is_own);
            }
            // The surest guess of all is never explained and never thinned out.
            let surest = views.iter().flatten().map(|(_, s)| *s).fold(f64::INFINITY, f64::min);
            if count >= views.iter().map(Vec::len).sum::<usize>() && surest.is_finite() {
                prop_assert!(fused.spread_m.contains(&surest));
            }
        }
    }
}
