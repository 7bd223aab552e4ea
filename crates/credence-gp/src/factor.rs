//! Cholesky factor of a noisy kernel matrix, computed in fixed tiles.
//!
//! The tiles are tasks of a rayon pool and each is computed by one thread in one order, so the
//! factor has the same bits whatever the number of threads. A library's own parallel kernels split
//! by the number of threads and promise nothing of the kind; these tiles are also a little faster.

use faer::{
    Accum, MatMut, MatRef, Par, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::{
            matmul,
            triangular::{self, BlockStructure},
        },
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
};
use rayon::prelude::*;

use crate::{GpError, Points, kernel::Matern};

/// Side of the tiles. 128 columns keep a core's multiplications busy; wider ones gain nothing.
pub(crate) const TILE: usize = 128;

/// Added to the diagonal, in units of the outputscale, until the factorisation succeeds.
const JITTERS: [f64; 5] = [0.0, 1e-10, 1e-8, 1e-6, 1e-4];

/// Memory of an n x n matrix of which only the lower triangle is touched, column by column.
///
/// Zeroed pages that are never written cost no memory, so it takes about 4 n^2 bytes. Keep it to
/// factorise several matrices of one size.
#[derive(Debug, Default)]
pub(crate) struct Storage {
    entries: Vec<f64>,
    n: usize,
    stride: usize,
}

impl Storage {
    pub(crate) fn new(n: usize) -> Self {
        // Columns a multiple of 4 KiB apart would fall into the same cache sets.
        let stride = n.next_multiple_of(8);
        let stride = if stride.is_multiple_of(512) {
            stride + 8
        } else {
            stride
        };
        Self {
            entries: vec![0.0; n * stride],
            n,
            stride,
        }
    }

    fn matrix_mut(&mut self) -> MatMut<'_, f64> {
        MatMut::from_column_major_slice_with_stride_mut(
            &mut self.entries,
            self.n,
            self.n,
            self.stride,
        )
    }

    fn matrix(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice_with_stride(&self.entries, self.n, self.n, self.stride)
    }

    /// Writes the lower triangle of K + diag(noise + jitter).
    fn assemble(&mut self, kernel: &Matern, points: &Points, noise: &[f64], jitter: f64) {
        let (n, stride) = (self.n, self.stride);
        self.entries
            .par_chunks_mut(stride * TILE)
            .with_max_len(1)
            .enumerate()
            .for_each(|(tile, columns)| {
                for (offset, column) in columns.chunks_exact_mut(stride).enumerate() {
                    let j = tile * TILE + offset;
                    kernel.column(points, j..n, points, j, &mut column[j..n]);
                    column[j] += noise[j] + jitter;
                }
            });
    }
}

/// Lower Cholesky factor L of K + diag(noise + jitter).
#[derive(Debug)]
pub(crate) struct Factor {
    storage: Storage,
    jitter: f64,
}

impl Factor {
    /// Factorises the covariance of `points` under `kernel`, with `noise` on its diagonal.
    ///
    /// A matrix that is not positive definite gets the [`JITTERS`] one after the other; `class` is
    /// whose error it is when even the last does not help.
    pub(crate) fn new(
        mut storage: Storage,
        kernel: &Matern,
        points: &Points,
        noise: &[f64],
        class: usize,
    ) -> Result<Self, GpError> {
        let mut jitter = 0.0;
        for relative in JITTERS {
            jitter = relative * kernel.outputscale;
            storage.assemble(kernel, points, noise, jitter);
            if factorise(storage.matrix_mut()) {
                return Ok(Self { storage, jitter });
            }
        }
        Err(GpError::NotPositiveDefinite {
            class,
            jitter,
            outputscale: kernel.outputscale,
        })
    }

    /// What was added to the diagonal.
    pub(crate) const fn jitter(&self) -> f64 {
        self.jitter
    }

    /// The memory, for the next matrix.
    pub(crate) fn into_storage(self) -> Storage {
        self.storage
    }

    /// L^-1 `columns`, in place, on the calling thread.
    pub(crate) fn solve_lower(&self, columns: MatMut<'_, f64>) {
        solve_lower_triangular_in_place(self.storage.matrix(), columns, Par::Seq);
    }

    /// L^-T `columns`, in place, on the calling thread.
    pub(crate) fn solve_upper(&self, columns: MatMut<'_, f64>) {
        solve_upper_triangular_in_place(self.storage.matrix().transpose(), columns, Par::Seq);
    }

    /// ln det of the matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        let l = self.storage.matrix();
        2.0 * (0..self.storage.n).map(|i| l[(i, i)].ln()).sum::<f64>()
    }

    /// Columns `start..start + block.ncols()` of the inverse, from row `start` down, into `block`.
    ///
    /// They depend on the trailing part of L alone: with T = L\[start.., start..\] they are
    /// T^-T T^-1 E, E the first columns of the identity. Over all blocks that is 2 n^3 / 3
    /// operations, as few as any way to the lower triangle of the inverse, and the blocks are
    /// independent of each other.
    pub(crate) fn inverse_columns(&self, start: usize, mut block: MatMut<'_, f64>) {
        let rows = self.storage.n - start;
        block.fill(0.0);
        for i in 0..block.ncols() {
            block[(i, i)] = 1.0;
        }
        let trailing = self.storage.matrix().submatrix(start, start, rows, rows);
        solve_lower_triangular_in_place(trailing, block.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(trailing.transpose(), block, Par::Seq);
    }
}

/// Left-looking Cholesky factorisation of the lower triangle, in place; false when a pivot is not
/// positive and finite.
///
/// For each tile column: subtract what the columns to its left explain, factorise the diagonal
/// tile, solve the tiles below against it. Left-looking, as it writes each entry once; the
/// right-looking order moves twice the memory.
fn factorise(mut matrix: MatMut<'_, f64>) -> bool {
    let n = matrix.nrows();
    for start in (0..n).step_by(TILE) {
        let width = TILE.min(n - start);
        let (left, right) = matrix.as_mut().split_at_col_mut(start);
        let left = left.as_ref().subrows(start, n - start);
        let panel = right.subrows_mut(start, n - start).subcols_mut(0, width);
        let (mut diagonal, mut below) = panel.split_at_row_mut(width);
        let (left_diagonal, left_below) = left.split_at_row(width);

        let (positive, ()) = rayon::join(
            || {
                triangular::matmul(
                    diagonal.as_mut(),
                    BlockStructure::TriangularLower,
                    Accum::Add,
                    left_diagonal,
                    BlockStructure::Rectangular,
                    left_diagonal.transpose(),
                    BlockStructure::Rectangular,
                    -1.0,
                    Par::Seq,
                );
                factorise_tile(diagonal.as_mut())
            },
            || {
                below
                    .as_mut()
                    .par_row_chunks_mut(TILE)
                    .zip(left_below.par_row_chunks(TILE))
                    .with_max_len(1)
                    .for_each(|(tile, left)| {
                        matmul(
                            tile,
                            Accum::Add,
                            left,
                            left_diagonal.transpose(),
                            -1.0,
                            Par::Seq,
                        );
                    });
            },
        );
        if !positive {
            return false;
        }
        let diagonal = diagonal.as_ref();
        below
            .par_row_chunks_mut(TILE)
            .with_max_len(1)
            .for_each(|tile| {
                solve_lower_triangular_in_place(diagonal, tile.transpose_mut(), Par::Seq);
            });
    }
    true
}

fn factorise_tile(tile: MatMut<'_, f64>) -> bool {
    let scratch =
        llt::factor::cholesky_in_place_scratch::<f64>(tile.nrows(), Par::Seq, Spec::default());
    llt::factor::cholesky_in_place(
        tile,
        llt::factor::LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Spec::default(),
    )
    .is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Smoothness;

    const KERNEL: Matern = Matern {
        smoothness: Smoothness::FiveHalves,
        lengthscale: 0.3,
        outputscale: 2.0,
    };

    fn line(count: usize) -> Points {
        let rows: Vec<f64> = (0..count).map(|i| i as f64 / count as f64).collect();
        Points::from_rows("points", &rows, 1).unwrap()
    }

    fn covariance(points: &Points, noise: f64) -> Vec<Vec<f64>> {
        let n = points.len();
        (0..n)
            .map(|j| {
                let mut column = vec![0.0; n];
                KERNEL.column(points, 0..n, points, j, &mut column);
                column[j] += noise;
                column
            })
            .collect()
    }

    /// One point, less than a tile, exact tiles, and a tile of one column.
    const SIZES: [usize; 5] = [1, 5, TILE, TILE + 1, 2 * TILE + 37];

    #[test]
    fn factor_times_its_transpose_is_the_matrix() {
        for n in SIZES {
            let points = line(n);
            let factor = Factor::new(Storage::new(n), &KERNEL, &points, &vec![0.5; n], 0).unwrap();
            assert_eq!(factor.jitter(), 0.0);
            let l = factor.storage.matrix();
            for (j, column) in covariance(&points, 0.5).iter().enumerate() {
                for (i, expected) in column.iter().enumerate().skip(j) {
                    let product: f64 = (0..=j).map(|k| l[(i, k)] * l[(j, k)]).sum();
                    assert!((product - expected).abs() < 1e-13, "{n}: ({i}, {j})");
                }
            }
        }
    }

    #[test]
    fn inverse_columns_are_those_of_the_inverse() {
        for n in SIZES {
            let points = line(n);
            let factor = Factor::new(Storage::new(n), &KERNEL, &points, &vec![0.5; n], 0).unwrap();
            let matrix = covariance(&points, 0.5);
            for start in (0..n).step_by(TILE) {
                let width = TILE.min(n - start);
                let mut block = faer::Mat::zeros(n - start, width);
                factor.inverse_columns(start, block.as_mut());
                // The last rows are complete: times the matrix's columns they give the identity.
                if start == 0 {
                    let (i, j) = (n - 1, width - 1);
                    let product: f64 = (0..n).map(|k| matrix[i][k] * block[(k, j)]).sum();
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((product - expected).abs() < 1e-11, "{n}: {product:e}");
                }
                // Any column of the whole inverse, by two solves.
                let mut column = vec![0.0; n];
                column[start + width - 1] = 1.0;
                let mut column = MatMut::from_column_major_slice_mut(&mut column, n, 1);
                factor.solve_lower(column.as_mut());
                factor.solve_upper(column.as_mut());
                for row in start..n {
                    let ours = block[(row - start, width - 1)];
                    assert!((ours - column[(row, 0)]).abs() < 1e-11, "{n}: {row}");
                }
            }
        }
    }

    #[test]
    fn a_matrix_just_short_of_positive_definite_gets_jitter_and_says_how_much() {
        // Two points in one place: the smaller eigenvalue is the noise.
        let points = Points::from_rows("points", &[0.1, 0.1], 1).unwrap();
        let factor = Factor::new(Storage::new(2), &KERNEL, &points, &[-1e-11; 2], 0).unwrap();
        assert_eq!(factor.jitter(), 1e-10 * KERNEL.outputscale);
    }

    #[test]
    fn an_indefinite_matrix_is_refused_with_the_largest_jitter_tried() {
        let points = line(3);
        for noise in [-3.0, f64::NAN, f64::INFINITY] {
            let error = Factor::new(Storage::new(3), &KERNEL, &points, &[noise; 3], 4).unwrap_err();
            assert_eq!(
                error.to_string(),
                "the covariance of class 4 is not positive definite, not even with 2e-4 added to \
                 its diagonal; lower its outputscale (2e0)"
            );
        }
    }
}
