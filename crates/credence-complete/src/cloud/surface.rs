//! From a displacement field to points on the surface.

use super::field::Answer;
use crate::CompleteError;

/// Cells of the grid that is searched for the surface, about.
const CELLS: f64 = 3500.0;

/// Least edge of a cell, 6 mm in the frame's units: finer than what the sensor resolves is no use.
const LEAST_CELL: f64 = 0.06;

/// How far beyond what was seen is searched, in the frame's units: to the sides, up, and at the
/// least behind.
const BESIDE: f64 = 0.25;
const ABOVE: f64 = 0.3;
const BEHIND: f64 = 0.3;

/// An object is at most this much deeper behind what was seen of it than it is wide.
const BEHIND_PER_WIDTH: f64 = 0.6;

/// A cell may hold a piece of the surface when it is nearer to the cell's centre than this many
/// edges: half a diagonal, and a little for the answer's error.
const REACH: f64 = 1.1;

/// Starting points that are led to the surface, about.
const STARTS: usize = 6000;

/// A point has come to rest when its next step is shorter than this, 6 mm in the frame's units.
const REST: f32 = 0.06;

/// Points on the surface and their spread, in the units of the object's frame.
#[derive(Debug, Default)]
pub(super) struct SurfacePoints {
    pub(super) points: Vec<[f32; 3]>,
    pub(super) spreads: Vec<f32>,
}

/// Finds the surface, by what `ask` says of query points: looks for it in the cells of a grid, and
/// leads points in those that may hold a piece of it along the answers until they rest.
pub(super) fn find_surface(
    ask: impl Fn(&[[f32; 3]]) -> Result<Vec<Answer>, CompleteError>,
    observed: &[[f32; 3]],
) -> Result<SurfacePoints, CompleteError> {
    let grid = Grid::around(observed);
    let centres: Vec<[f32; 3]> = grid.centres().collect();
    let reach = (REACH * grid.cell) as f32;
    let answers = ask(&centres)?;
    let near: Vec<[f32; 3]> = centres
        .into_iter()
        .zip(&answers)
        .filter(|(_, answer)| length(answer.offset) < reach)
        .map(|(centre, _)| centre)
        .collect();
    let per_cell = STARTS.div_ceil(near.len().max(1));
    let starts = near.iter().flat_map(|centre| {
        (0..per_cell).map(move |number| {
            let share = spread_out(number);
            [0, 1, 2].map(|axis| centre[axis] + (grid.cell * (share[axis] - 0.5)) as f32)
        })
    });
    let mut points: Vec<[f32; 3]> = starts.collect();
    let answers = ask(&points)?;
    step(&mut points, &answers);
    let answers = ask(&points)?;
    step(&mut points, &answers);
    let mut found = SurfacePoints::default();
    for (point, answer) in points.into_iter().zip(answers) {
        if length(answer.offset) < REST {
            found.points.push(point);
            found.spreads.push(answer.spread);
        }
    }
    Ok(found)
}

/// Leads points along their answers, never below the table.
fn step(points: &mut [[f32; 3]], answers: &[Answer]) {
    for (point, answer) in points.iter_mut().zip(answers) {
        for (coordinate, offset) in point.iter_mut().zip(answer.offset) {
            *coordinate += offset;
        }
        point[2] = point[2].max(0.0);
    }
}

fn length(offset: [f32; 3]) -> f32 {
    offset.iter().map(|c| c * c).sum::<f32>().sqrt()
}

/// Cubes that fill the box in which the object may be.
struct Grid {
    low: [f64; 3],
    cell: f64,
    size: [usize; 3],
}

impl Grid {
    /// x points towards the viewpoint: what is hidden lies behind.
    fn around(observed: &[[f32; 3]]) -> Self {
        let bound = |axis: usize, pick: fn(f32, f32) -> f32| {
            let values = observed.iter().map(|point| point[axis]);
            f64::from(values.reduce(pick).unwrap_or_default())
        };
        let width = bound(1, f32::max) - bound(1, f32::min);
        let behind = BEHIND.max(BEHIND_PER_WIDTH * width);
        let low = [
            bound(0, f32::min) - behind,
            bound(1, f32::min) - BESIDE,
            0.0,
        ];
        let high = [
            bound(0, f32::max) + BESIDE,
            bound(1, f32::max) + BESIDE,
            bound(2, f32::max).max(0.0) + ABOVE,
        ];
        let sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let cell = (sides.iter().product::<f64>() / CELLS)
            .cbrt()
            .max(LEAST_CELL);
        Self {
            low,
            cell,
            size: sides.map(|side| (side / cell).ceil() as usize),
        }
    }

    fn centres(&self) -> impl Iterator<Item = [f32; 3]> {
        let [x, y, z] = self.size;
        (0..x * y * z).map(move |index| {
            let at = [index % x, index / x % y, index / (x * y)];
            [0, 1, 2].map(|axis| (self.low[axis] + (at[axis] as f64 + 0.5) * self.cell) as f32)
        })
    }
}

/// The `number`-th of points that fill the unit cube evenly: multiples of the inverse powers of
/// the plastic number's relative in three dimensions, the root of x^4 = x + 1 (Roberts 2018).
fn spread_out(number: usize) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_5;
    [1, 2, 3].map(|power| (0.5 + number as f64 / ROOT.powi(power)).fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_reaches_behind_what_was_seen_and_down_to_the_table() {
        let grid = Grid::around(&[[0.0, -0.5, 0.2], [0.4, 0.5, 0.9]]);
        let reach = |axis: usize| {
            let values: Vec<f32> = grid.centres().map(|centre| centre[axis]).collect();
            let half = grid.cell as f32 / 2.0;
            let low = values.iter().copied().fold(f32::INFINITY, f32::min) - half;
            let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max) + half;
            [low, high]
        };
        // 1 wide: 0.6 behind; 0.25 beside; from the table to 0.3 above; less than a cell more.
        for (axis, [low, high]) in [[-0.6, 0.65], [-0.75, 0.75], [0.0, 1.2]]
            .into_iter()
            .enumerate()
        {
            let [found_low, found_high] = reach(axis);
            assert!((found_low - low).abs() < 1e-5, "{axis}: {found_low}");
            let beyond = found_high - high;
            assert!(
                (-1e-5..grid.cell as f32).contains(&beyond),
                "{axis}: {found_high}"
            );
        }
        let cells = grid.size.iter().product::<usize>() as f64;
        assert!((CELLS..1.4 * CELLS).contains(&cells), "{cells}");
    }

    /// The upper part of a ball on the table, 0.8 wide, of which the front half was seen.
    const CENTRE: [f32; 3] = [0.0, 0.0, 0.3];
    const RADIUS: f32 = 0.4;

    fn ball(queries: &[[f32; 3]]) -> Vec<Answer> {
        let answer = |query: &[f32; 3]| {
            let out = [0, 1, 2].map(|axis| query[axis] - CENTRE[axis]);
            let far = length(out).max(1e-6);
            Answer {
                offset: out.map(|c| c * (RADIUS / far - 1.0)),
                spread: 0.01 + query[0].abs(),
            }
        };
        queries.iter().map(answer).collect()
    }

    #[test]
    fn points_come_to_rest_all_over_the_surface_and_never_below_the_table() {
        let observed = [
            [0.0, -0.4, 0.3],
            [0.4, 0.0, 0.3],
            [0.0, 0.4, 0.3],
            [0.0, 0.0, 0.7],
        ];
        let found = find_surface(|queries| Ok(ball(queries)), &observed).unwrap();
        assert_eq!(found.points.len(), found.spreads.len());
        assert!(
            (STARTS..3 * STARTS).contains(&found.points.len()),
            "{}",
            found.points.len()
        );
        let mut octants = [0_usize; 8];
        for (point, spread) in found.points.iter().zip(&found.spreads) {
            let out = [0, 1, 2].map(|axis| point[axis] - CENTRE[axis]);
            // A point that the table stops has moved off the ball.
            let stopped = point[2] == 0.0;
            assert!(stopped || (length(out) - RADIUS).abs() < 1e-4, "{point:?}");
            assert!((spread - 0.01 - point[0].abs()).abs() < 1e-3 || stopped);
            assert!(point[2] >= 0.0);
            let [x, y, z] = out.map(|c| usize::from(c > 0.0));
            octants[x + 2 * y + 4 * z] += 1;
        }
        // The hidden back as much as the seen front; below, the table cuts the ball.
        assert!(
            octants[4..].iter().all(|count| *count > STARTS / 16),
            "{octants:?}"
        );
        assert!(
            octants[..4].iter().all(|count| *count > STARTS / 24),
            "{octants:?}"
        );
    }

    #[test]
    fn points_that_do_not_rest_are_no_surface() {
        // Every answer leads 7 mm on: there is no surface anywhere.
        let restless = |queries: &[[f32; 3]]| {
            let answer = Answer {
                offset: [0.07, 0.0, 0.0],
                spread: 0.1,
            };
            Ok(vec![answer; queries.len()])
        };
        let found = find_surface(restless, &[[0.0; 3], [0.3, 0.3, 0.3]]).unwrap();
        assert!(found.points.is_empty());
    }

    #[test]
    fn starting_points_fill_the_cell() {
        // Each eighth of the cube has about its share of 4,096.
        let mut eighths = [0; 8];
        for number in 0..4096 {
            let [x, y, z] = spread_out(number).map(|share| usize::from(share >= 0.5));
            eighths[x + 2 * y + 4 * z] += 1;
        }
        assert!(
            eighths.iter().all(|count| (490..=534).contains(count)),
            "{eighths:?}"
        );
    }
}
