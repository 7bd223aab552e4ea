//! Registration of a completed cloud to what was observed of the object.

mod surface;
#[cfg(test)]
mod tests;
mod visible;
mod warp;

use credence_types::{Completion, InvalidInput, Point};
use nalgebra::{Matrix3, Vector3};
use surface::Surface;
use warp::{Information, Parameters, Warp};

use crate::{CompleteError, search::distinct};

/// Most observed points that are looked at.
const MOST_OBSERVED: usize = 1500;

/// A point farther away counts as this far in the residual, metres: a few that the completion
/// misses altogether do not outweigh the rest.
const CAP_M: f64 = 0.02;

/// Coarse to fine.
const STAGES: [Stage; 4] = [
    Stage::new(0.02, 4, true),
    Stage::new(0.01, 2, true),
    Stage::new(0.005, 1, true),
    Stage::new(0.003, 1, false),
];

/// Steps of a stage, at most.
const MOST_STEPS: usize = 5;

/// A part of the search.
struct Stage {
    /// Distance at which an observed point has lost three quarters of its weight, metres.
    scale_m: f64,
    /// Every how many observed points are looked at.
    every: usize,
    /// Whether they can only lie where a camera sees the completed surface. The inside of a wall
    /// attracts what was seen of its outside unless it counts as hidden; but of a noisy surface,
    /// what is seen is nearer than the middle, so that the last stage must not tell them apart.
    seen_only: bool,
}

impl Stage {
    const fn new(scale_m: f64, every: usize, seen_only: bool) -> Self {
        Self {
            scale_m,
            every,
            seen_only,
        }
    }
}

/// Noise of a completed point beside its own spread, metres.
const NOISE_M: f64 = 0.0015;

/// How many independent measurements the observed points are worth, for neighbours err together.
const INDEPENDENT: f64 = 100.0;

/// A step that moves no point farther than this ends a stage, metres.
const STILL_M: f64 = 5e-5;

/// A completion after its registration, and how well it lay on the observed points before and
/// after.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// The completion moved, or as it was if that did not bring it nearer. Its score stays what the
    /// completer said: the spreads tell what the registration has mended.
    pub completion: Completion,
    /// Mean distance of the observed points from the completed surface before, each at most 2 cm,
    /// metres; NaN without observed points.
    pub residual_before_m: f64,
    /// The same after: never more than before.
    pub residual_after_m: f64,
}

/// Registers a completion to the points observed on its object: a rotation about the vertical, a
/// translation and scales, vertical and horizontal, that bring the completed surface onto them.
///
/// Robust iterated closest points (Besl and `McKay` 1992; point to plane: Chen and Medioni 1992):
/// every observed point pulls its nearest place of the completed surface, on which each completed
/// point stands for a flat disc, with the weight of Geman and `McClure` (1985) and less where the
/// completer is in doubt. A prior holds what one side of an object does not show, the more the
/// better the completion fits at the outset; scales stay between 1 / 1.4 and 1.4. The completion
/// is moved only if the residual falls, and its spreads shrink by as much: what observation has
/// mended is no longer in doubt.
///
/// # Arguments
///
/// * `observed_camera`: points measured on the object, camera frame, metres.
/// * `up_camera`: the vertical in the camera frame, of any length.
///
/// # Errors
/// A point that is not finite, a vertical of no length, more points than a search can hold.
pub fn refine(
    completion: &Completion,
    observed_camera: &[Point],
    up_camera: &Vector3<f64>,
) -> Result<Refined, CompleteError> {
    check_finite("completed points", &completion.points_camera)?;
    check_finite("observed points", observed_camera)?;
    let level = upright(up_camera)?;
    let unchanged = |residual_m| Refined {
        completion: completion.clone(),
        residual_before_m: residual_m,
        residual_after_m: residual_m,
    };
    if observed_camera.is_empty() || completion.points_camera.is_empty() {
        return Ok(unchanged(f64::NAN));
    }
    let observed: Vec<Point> = thinned(observed_camera).map(|p| level * p).collect();
    let completed: Vec<Point> = completion.points_camera.iter().map(|p| level * p).collect();
    let centre = completed.iter().map(|p| p.coords).sum::<Vector3<f64>>() / completed.len() as f64;
    let places = distinct(&completed);
    let at_places =
        |points: &[Point]| -> Vec<Point> { places.iter().map(|index| points[*index]).collect() };
    let spread = |index: &usize| completion.spread_m.get(*index).copied().unwrap_or(0.0);
    let registration = Registration {
        surface: Surface::new(&at_places(&completed))?,
        spread_m: places.iter().map(spread).collect(),
    };
    let before = residual_m(&registration.surface, &observed)?;
    let warp = registration.search(Warp::identity(centre, before), &observed)?;
    let linear = warp.linear();
    let moved: Vec<Point> = completed
        .iter()
        .map(|point| warp.apply(&linear, point))
        .collect();
    // Discs of the moved points, not the moved discs: the residual is of the cloud alone.
    let after = residual_m(&Surface::new(&at_places(&moved))?, &observed)?;
    if after >= before {
        return Ok(unchanged(before));
    }
    let back = level.transpose();
    let mended = after / before;
    Ok(Refined {
        completion: Completion {
            points_camera: moved.iter().map(|point| back * point).collect(),
            spread_m: completion.spread_m.iter().map(|s| s * mended).collect(),
            ..completion.clone()
        },
        residual_before_m: before,
        residual_after_m: after,
    })
}

/// Mean distance of observed points from a completed cloud in the same frame, each at most 2 cm,
/// metres; NaN without points of either.
pub(crate) fn misfit_m(completed: &[Point], observed: &[Point]) -> Result<f64, CompleteError> {
    if completed.is_empty() || observed.is_empty() {
        return Ok(f64::NAN);
    }
    let places = distinct(completed).into_iter();
    let surface = Surface::new(&places.map(|index| completed[index]).collect::<Vec<_>>())?;
    residual_m(&surface, &thinned(observed).copied().collect::<Vec<_>>())
}

/// Mean distance of observed points from a surface, each at most [`CAP_M`].
fn residual_m(surface: &Surface, observed: &[Point]) -> Result<f64, CompleteError> {
    let feet = surface.feet(observed, &surface.all())?;
    let sum: f64 = feet.iter().map(|foot| foot.offset_m.abs().min(CAP_M)).sum();
    Ok(sum / feet.len() as f64)
}

fn check_finite(name: &'static str, points: &[Point]) -> Result<(), CompleteError> {
    match points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        None => Ok(()),
        Some(index) => Err(InvalidInput::NonFinitePoint { name, index }.into()),
    }
}

/// The rotation to coordinates with z up.
fn upright(up: &Vector3<f64>) -> Result<Matrix3<f64>, CompleteError> {
    let length = up.norm();
    if !(length.is_finite() && length > 0.0) {
        return Err(CompleteError::Vertical {
            value: (*up).into(),
        });
    }
    let z = up / length;
    let mut beside = Vector3::zeros();
    beside[z.iamin()] = 1.0;
    let x = beside.cross(&z).normalize();
    let y = z.cross(&x);
    Ok(Matrix3::from_rows(&[
        x.transpose(),
        y.transpose(),
        z.transpose(),
    ]))
}

/// At most [`MOST_OBSERVED`] of the points, spread over their order.
fn thinned(points: &[Point]) -> impl Iterator<Item = &Point> {
    let count = points.len().min(MOST_OBSERVED);
    (0..count).map(move |i| &points[i * points.len() / count])
}

/// The completed surface and its doubts.
struct Registration {
    surface: Surface,
    spread_m: Vec<f64>,
}

impl Registration {
    fn search(&self, start: Warp, observed: &[Point]) -> Result<Warp, CompleteError> {
        let mut warp = start;
        for stage in &STAGES {
            let observed: Vec<Point> = observed.iter().step_by(stage.every).copied().collect();
            // What is seen hardly changes within a stage.
            let among = if stage.seen_only {
                self.surface.moved(&warp).seen()
            } else {
                self.surface.all()
            };
            for _ in 0..MOST_STEPS {
                let next = warp.moved(&self.step(&warp, &observed, &among, stage.scale_m)?);
                let moved_m = self.largest_move_m(&warp, &next);
                warp = next;
                if moved_m < STILL_M {
                    break;
                }
            }
        }
        Ok(warp)
    }

    /// The Gauss-Newton step of the weighted distances and the prior.
    fn step(
        &self,
        warp: &Warp,
        observed: &[Point],
        among: &[usize],
        scale_m: f64,
    ) -> Result<Parameters, CompleteError> {
        let feet = self.surface.moved(warp).feet(observed, among)?;
        let tangents = warp.tangents();
        let share = (INDEPENDENT / feet.len() as f64).min(1.0);
        let (mut information, mut pull): (Information, Parameters) = warp.prior();
        pull = -pull;
        for foot in &feet {
            let doubt_m = self.spread_m[foot.index];
            let robust = (1.0 + (foot.offset_m / scale_m).powi(2)).powi(-2);
            let weight = share * robust / (NOISE_M.powi(2) + doubt_m.powi(2));
            let row = tangents
                .at(&self.surface.discs[foot.index].centre)
                .tr_mul(&foot.direction);
            information.syger(weight, &row, &row, 1.0);
            pull.axpy(weight * foot.offset_m, &row, 1.0);
        }
        information.fill_upper_triangle_with_lower_triangle();
        // The prior makes the matrix positive definite.
        let solved = information.cholesky().map(|factor| factor.solve(&pull));
        Ok(solved.unwrap_or_else(Parameters::zeros))
    }

    /// How far the points move, at most, by every sixteenth of them, metres.
    fn largest_move_m(&self, from: &Warp, to: &Warp) -> f64 {
        let (before, after) = (from.linear(), to.linear());
        let some = self.surface.discs.iter().step_by(16);
        let moves = some.map(|disc| {
            (from.apply(&before, &disc.centre) - to.apply(&after, &disc.centre)).norm()
        });
        moves.fold(0.0, f64::max)
    }
}
