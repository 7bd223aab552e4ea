//! Whether any of many points lies near another one.

use parry3d_f64::math::Vector;

/// Points sorted into cubes of the distance that is asked for.
#[derive(Debug)]
pub(super) struct NearGrid {
    low: Vector,
    cell_m: f64,
    size: [usize; 3],
    /// Where each cell's points begin in `points`; one more than there are cells.
    starts: Vec<u32>,
    points: Vec<Vector>,
}

impl NearGrid {
    /// A grid over the points in the box from `low` to `high`; the others are left out.
    pub(super) fn new(points: &[Vector], [low, high]: [Vector; 2], cell_m: f64) -> Self {
        let size = ((high - low) / cell_m)
            .to_array()
            .map(|cells| cells.floor().max(0.0) as usize + 1);
        let mut grid = Self {
            low,
            cell_m,
            size,
            starts: vec![0; size.iter().product::<usize>() + 1],
            points: Vec::new(),
        };
        let placed: Vec<(usize, Vector)> = points
            .iter()
            .filter_map(|point| Some((grid.index(grid.cell(*point)?), *point)))
            .collect();
        for (cell, _) in &placed {
            grid.starts[cell + 1] += 1;
        }
        for cell in 1..grid.starts.len() {
            grid.starts[cell] += grid.starts[cell - 1];
        }
        let mut next = grid.starts.clone();
        grid.points = vec![Vector::ZERO; placed.len()];
        for (cell, point) in placed {
            grid.points[next[cell] as usize] = point;
            next[cell] += 1;
        }
        grid
    }

    fn cell(&self, point: Vector) -> Option<[usize; 3]> {
        let cell = ((point - self.low) / self.cell_m).to_array();
        let inside = cell
            .iter()
            .zip(self.size)
            .all(|(at, size)| (0.0..size as f64).contains(at));
        inside.then(|| cell.map(|at| at as usize))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// Whether a grid's point lies nearer to `point`, which is in the box, than one cell's edge.
    pub(super) fn any_near(&self, point: Vector) -> bool {
        let Some([x, y, z]) = self.cell(point) else {
            return false;
        };
        let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let reach = self.cell_m * self.cell_m;
        let columns = around(x, self.size[0]);
        around(z, self.size[2]).any(|z| {
            around(y, self.size[1]).any(|y| {
                let first = self.starts[self.index([columns.start, y, z])] as usize;
                let last = self.starts[self.index([columns.end - 1, y, z]) + 1] as usize;
                self.points[first..last]
                    .iter()
                    .any(|other| other.distance_squared(point) < reach)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vector> {
        (-0.1..0.1, -0.1..0.1, 0.0..0.1).prop_map(|(x, y, z)| Vector::new(x, y, z))
    }

    proptest! {
        #[test]
        fn agrees_with_looking_at_every_point(
            points in proptest::collection::vec(point(), 0..60),
            asked in proptest::collection::vec(point(), 1..20),
        ) {
            let bounds = [Vector::new(-0.1, -0.1, 0.0), Vector::splat(0.1)];
            let grid = NearGrid::new(&points, bounds, 0.03);
            for point in asked {
                let near = points.iter().any(|other| other.distance(point) < 0.03);
                prop_assert_eq!(grid.any_near(point), near);
            }
        }
    }

    #[test]
    fn points_outside_its_box_are_left_out() {
        let bounds = [Vector::ZERO, Vector::ONE];
        let outside = [
            Vector::splat(-0.01),
            Vector::splat(1.2),
            Vector::splat(f64::NAN),
        ];
        let grid = NearGrid::new(&outside, bounds, 0.1);
        assert!(!grid.any_near(Vector::ZERO) && !grid.any_near(Vector::ONE));
    }
}
