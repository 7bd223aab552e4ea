use credence_types::Point;
use nalgebra::Vector3;

use super::surface::Disc;

/// A point as near to a disc's plane is on it, not behind it, metres: less than a mug's wall.
const THICKNESS_M: f64 = 0.0015;

/// Discs hide what lies behind them as if this much larger, so that an uneven cloud has no holes.
const OVERLAP: f64 = 1.4;

/// Most cells along a side of the grid.
const MOST_CELLS: f64 = 128.0;

/// Which discs a camera at the origin sees the centres of: those whose ray no other disc cuts.
pub(super) fn visible(discs: &[Disc]) -> Vec<bool> {
    let Some(grid) = Grid::new(discs) else {
        return vec![true; discs.len()];
    };
    let is_seen = |(index, disc): (usize, &Disc)| {
        let others = grid.around(&disc.centre);
        !others
            .filter(|other| *other != index)
            .any(|other| hides(&discs[other], &disc.centre))
    };
    discs.iter().enumerate().map(is_seen).collect()
}

/// Whether a disc lies before a point.
fn hides(disc: &Disc, point: &Point) -> bool {
    let height_m = disc.normal.dot(&disc.centre.coords);
    let along = disc.normal.dot(&point.coords);
    // The ray s * point cuts the plane at s = height / along, before the point if s < 1.
    let s = height_m / along;
    (along - height_m).abs() > THICKNESS_M
        && (0.0..1.0).contains(&s)
        && (point.coords * s - disc.centre.coords).norm() <= OVERLAP * disc.radius_m
}

/// Discs by the direction that they lie in: an image with cells as wide as the widest disc.
struct Grid {
    axes: [Vector3<f64>; 3],
    low: [f64; 2],
    cell: f64,
    columns: usize,
    rows: usize,
    cells: Vec<Vec<usize>>,
}

impl Grid {
    /// `None` if a disc lies beside the camera or behind it: there is no such image then.
    fn new(discs: &[Disc]) -> Option<Self> {
        let sum: Vector3<f64> = discs.iter().map(|disc| disc.centre.coords).sum();
        let forward = sum.try_normalize(f64::MIN_POSITIVE)?;
        let mut beside = Vector3::zeros();
        beside[forward.iamin()] = 1.0;
        let right = forward.cross(&beside).normalize();
        let axes = [right, forward.cross(&right), forward];
        let mut grid = Self {
            axes,
            low: [f64::INFINITY; 2],
            cell: 0.0,
            columns: 0,
            rows: 0,
            cells: Vec::new(),
        };
        let mut high = [f64::NEG_INFINITY; 2];
        for disc in discs {
            let depth_m = disc.centre.coords.dot(&forward);
            if depth_m <= OVERLAP * disc.radius_m {
                return None;
            }
            let place = grid.project(&disc.centre);
            for axis in 0..2 {
                grid.low[axis] = grid.low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
            let reach = OVERLAP * disc.radius_m / (depth_m - OVERLAP * disc.radius_m);
            grid.cell = grid.cell.max(reach);
        }
        let widest = (high[0] - grid.low[0]).max(high[1] - grid.low[1]);
        grid.cell = grid.cell.max(widest / MOST_CELLS).max(f64::MIN_POSITIVE);
        let cells = |axis: usize| ((high[axis] - grid.low[axis]) / grid.cell) as usize + 1;
        (grid.columns, grid.rows) = (cells(0), cells(1));
        grid.cells = vec![Vec::new(); grid.columns * grid.rows];
        for (index, disc) in discs.iter().enumerate() {
            let [column, row] = grid.cell_of(&disc.centre);
            grid.cells[row * grid.columns + column].push(index);
        }
        Some(grid)
    }

    fn project(&self, point: &Point) -> [f64; 2] {
        let [right, down, forward] = self.axes.map(|axis| axis.dot(&point.coords));
        [right / forward, down / forward]
    }

    fn cell_of(&self, point: &Point) -> [usize; 2] {
        let place = self.project(point);
        let at = |axis: usize, count: usize| {
            (((place[axis] - self.low[axis]) / self.cell) as usize).min(count - 1)
        };
        [at(0, self.columns), at(1, self.rows)]
    }

    /// Discs that may lie on the ray of a point.
    fn around(&self, point: &Point) -> impl Iterator<Item = usize> {
        let [column, row] = self.cell_of(point);
        let window = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        window(row, self.rows)
            .flat_map(move |row| window(column, self.columns).map(move |c| row * self.columns + c))
            .flat_map(|cell| self.cells[cell].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(centre: [f64; 3], normal: [f64; 3]) -> Disc {
        Disc {
            centre: centre.into(),
            normal: Vector3::from(normal).normalize(),
            radius_m: 0.01,
        }
    }

    #[test]
    fn a_disc_hides_what_lies_behind_it_and_not_what_lies_on_it() {
        let front = disc([0.0, 0.0, 0.5], [0.0, 0.0, 1.0]);
        let behind = disc([0.005, 0.0, 0.503], [0.0, 0.0, 1.0]);
        let touching = disc([0.005, 0.0, 0.501], [0.0, 0.0, 1.0]);
        let beside = disc([0.1, 0.0, 0.6], [0.0, 0.0, -1.0]);
        let edge_on = disc([0.05, 0.0, 0.5], [0.0, 1.0, 0.0]);
        assert_eq!(
            visible(&[front, behind, touching, beside, edge_on]),
            [true, false, true, true, true]
        );
    }

    #[test]
    fn everything_around_the_camera_counts_as_seen() {
        let around = [0.5, -0.5].map(|z| disc([0.0, 0.0, z], [0.0, 0.0, 1.0]));
        assert_eq!(visible(&around), [true, true]);
        assert_eq!(visible(&[]), [true; 0]);
    }
}
