#[cfg(test)]
mod tests;

use std::collections::HashMap;

use credence_types::Point;

use crate::{
    CompleteError, even_order,
    refine::misfit_m,
    search::{Nearest, distinct, median},
};

/// A view is clearly wrong whose completion lies this many times as far from what all views
/// measured as the best one's.
const MISFIT: f64 = 1.4;

/// Misfits below this are all as good, metres: the sensor's noise decides between them.
const LEAST_MISFIT_M: f64 = 0.001;

/// A guess may lie on a surer surface if it is within this many of its own spreads: of errors of
/// Laplace's distribution, 2 % are larger.
const SPREADS: f64 = 4.0;

/// And within this, metres: spreads are guesses too.
const FARTHEST_M: f64 = 0.01;

/// Clearly surer is a spread below this share of the other's.
const SURER: f64 = 0.8;

/// A view shares a guess if one of its own points is within this many of their spacings.
const SPACINGS: f64 = 1.5;

/// Clearly unsure is a spread above this many of the median one.
const UNSURE: f64 = 1.5;

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
/// 1. Views whose completion fits what all of them measured clearly worse than the best one's are
///    left out: a wrong pose, or a wrong shape.
/// 2. Points in space that a view looked through are dropped, unless measured points are near.
/// 3. A guess that is clearly less sure than most and that no other view shares is dropped, unless
///    measured points are near, or no other view is left.
/// 4. A guess that may lie on the surface of which another view is clearly surer (within
///    four of its own spreads, at most 1 cm) is dropped: it says nothing that the other does not.
/// 5. What is left is thinned, the surest first, to points that keep a distance.
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
    let views = fitting(views, seen.observed_world)?;
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
    drop_refuted(&mut guesses, &views, seen)?;
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

/// The views whose completion is not clearly wrong.
fn fitting<'a>(
    views: &'a [SpreadCloud],
    observed_world: &[Point],
) -> Result<Vec<&'a SpreadCloud>, CompleteError> {
    if views.len() < 2 || observed_world.is_empty() {
        return Ok(views.iter().collect());
    }
    let misfits = views
        .iter()
        .map(|view| misfit_m(&view.points_world, observed_world))
        .collect::<Result<Vec<f64>, _>>()?;
    let least_m = misfits.iter().copied().fold(f64::INFINITY, f64::min);
    let least_m = least_m.max(LEAST_MISFIT_M);
    let pairs = views.iter().zip(&misfits);
    Ok(pairs
        .filter(|(_, misfit)| **misfit <= MISFIT * least_m)
        .map(|(view, _)| view)
        .collect())
}

/// A point of a view's completion.
#[derive(Debug, Clone, Copy)]
struct Guess {
    point: Point,
    spread_m: f64,
    view: usize,
    index: usize,
}

/// Drops what the measurements or the other views speak against.
fn drop_refuted(
    guesses: &mut Vec<Guess>,
    views: &[&SpreadCloud],
    seen: &SeenSpace<'_>,
) -> Result<(), CompleteError> {
    let observed = Nearest::new(seen.observed_world)?;
    let shares = views
        .iter()
        .map(|view| {
            let places = distinct(&view.points_world).into_iter();
            let places: Vec<Point> = places.map(|index| view.points_world[index]).collect();
            let nearest = Nearest::new(&places)?;
            let reach_m = SPACINGS * nearest.spacing_m(&places);
            Ok((nearest, reach_m))
        })
        .collect::<Result<Vec<_>, CompleteError>>()?;
    let unsure_m = UNSURE * median(guesses.iter().map(|guess| guess.spread_m).collect());
    let is_alone = |guess: &Guess| {
        let mut others = shares.iter().enumerate();
        shares.len() > 1
            && !others.any(|(view, (nearest, reach_m))| {
                view != guess.view && nearest.reaches(&guess.point, *reach_m)
            })
    };
    guesses.retain(|guess| {
        let is_refuted =
            (seen.is_free)(&guess.point) || (guess.spread_m > unsure_m && is_alone(guess));
        !is_refuted || observed.reaches(&guess.point, seen.near_m)
    });
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
