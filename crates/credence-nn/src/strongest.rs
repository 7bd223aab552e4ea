//! Which row has the largest value in every column: the pooling of networks on points.
//!
//! A maximum passes its gradient to one row only. Networks therefore look for that row outside
//! autodiff, and compute or gather its value once more inside.

use burn::tensor::{Int, Tensor, TensorData};
use rayon::prelude::*;

/// Columns that are compared at once.
const LANES: usize = 16;

/// Columns of a task: together with their winners they stay in the innermost cache.
const TASK_COLUMNS: usize = 256;

/// The values of a tensor on the host, without a copy where nobody else holds it.
///
/// # Panics
///
/// When they are not in single precision.
pub(crate) fn host_values(tensor: Tensor<2>) -> TensorData {
    let data = tensor.inner().into_data();
    assert_eq!(data.dtype(), burn::tensor::DType::F32, "networks are f32");
    data
}

/// For each of `groups` equal runs of rows of `values`, `[rows, columns]`, and each column, the
/// row with the largest value, the first of equals: `[groups * columns]`.
///
/// # Panics
///
/// When there are no rows, or not equally many per group.
pub fn strongest_rows(values: Tensor<2>, groups: usize) -> Tensor<1, Int> {
    let [rows, columns] = values.dims();
    assert!(
        groups > 0 && rows > 0 && rows.is_multiple_of(groups),
        "{rows} rows are not {groups} equal groups"
    );
    let device = values.device();
    let data = host_values(values);
    let values: &[f32] = data.as_slice().unwrap_or_default();
    let per_group = rows / groups;
    let mut winners = vec![0_i32; groups * columns];
    let tasks: Vec<(usize, &mut [i32])> = winners
        .chunks_mut(columns)
        .enumerate()
        .flat_map(|(group, winners)| {
            winners
                .chunks_mut(TASK_COLUMNS)
                .enumerate()
                .map(move |(i, winners)| (group * per_group * columns + i * TASK_COLUMNS, winners))
        })
        .collect();
    tasks.into_par_iter().for_each(|(start, winners)| {
        let first = start / columns;
        let row = |i: usize| &values[start + i * columns..][..winners.len()];
        let mut best = row(0).to_vec();
        let number = |i: usize| ((first + i) as u32).cast_signed();
        let mut indices = vec![number(0); winners.len()];
        for i in 1..per_group {
            keep_larger(&mut best, &mut indices, row(i), number(i));
        }
        winners.copy_from_slice(&indices);
    });
    Tensor::from_data(TensorData::new(winners, [groups * columns]), &device)
}

/// Where a candidate's value is larger than the best, it becomes the best and the winner.
///
/// Never inlined: in the place of its call the compiler no longer sees that the rows are apart,
/// and leaves it scalar.
#[inline(never)]
pub(crate) fn keep_larger(best: &mut [f32], winners: &mut [i32], values: &[f32], candidate: i32) {
    let (best, best_rest) = best.as_chunks_mut::<LANES>();
    let (winners, winners_rest) = winners.as_chunks_mut::<LANES>();
    let (values, values_rest) = values.as_chunks::<LANES>();
    for ((best, winners), values) in best.iter_mut().zip(winners).zip(values) {
        // Selections by bits instead of branches: the compiler turns them into vector code.
        for lane in 0..LANES {
            let larger = -i32::from(values[lane] > best[lane]);
            winners[lane] ^= (winners[lane] ^ candidate) & larger;
        }
        for lane in 0..LANES {
            best[lane] = if values[lane] > best[lane] {
                values[lane]
            } else {
                best[lane]
            };
        }
    }
    for ((best, winner), &value) in best_rest.iter_mut().zip(winners_rest).zip(values_rest) {
        if value > *best {
            (*best, *winner) = (value, candidate);
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn two_groups_by_hand() {
        let values = [[1.0_f32, 5.0], [3.0, 5.0], [-1.0, 0.0], [-2.0, 7.0]];
        let values = Tensor::<2>::from_data(values, &Device::flex());
        let found: Vec<i32> = strongest_rows(values, 2).into_data().iter().collect();
        assert_eq!(found, [1, 0, 2, 3]);
    }

    proptest! {
        /// Few distinct values, so that many are equal; widths around the lanes and the tasks.
        #[test]
        fn agrees_with_a_plain_search(
            columns in prop::sample::select(vec![1, 15, 16, 17, 40, 256, 300]),
            per_group in 1..6_usize,
            seed in prop::collection::vec(0..4_u8, 7 * 11),
        ) {
            let rows = 2 * per_group;
            let values: Vec<f32> = (0..rows * columns)
                .map(|i| f32::from(seed[i * 5 % seed.len()]))
                .collect();
            let data = TensorData::new(values.clone(), [rows, columns]);
            let found = strongest_rows(Tensor::from_data(data, &Device::flex()), 2);
            let found: Vec<usize> = found.into_data().iter::<i64>().map(|i| i as usize).collect();
            for group in 0..2 {
                for column in 0..columns {
                    let at = |row: usize| values[row * columns + column];
                    let rows = group * per_group..(group + 1) * per_group;
                    let largest = rows.clone().map(at).fold(f32::MIN, f32::max);
                    let expected = rows.clone().find(|row| at(*row) == largest);
                    prop_assert_eq!(Some(found[group * columns + column]), expected);
                }
            }
        }
    }
}
