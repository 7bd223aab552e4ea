use burn::tensor::Device;
use proptest::prelude::*;

use super::*;

fn pool(
    values: &[f32],
    channels: usize,
    grid: Grid,
    rois: &[Roi],
    bins: usize,
    samples: usize,
) -> Vec<f32> {
    let data = TensorData::new(values.to_vec(), [grid.rows(), channels]);
    let x = Tensor::<2>::from_data(data, &Device::flex());
    let out = roi_align(x, grid, rois, bins, samples);
    assert_eq!(out.dims(), [rois.len() * bins * bins, channels]);
    out.into_data().iter().collect()
}

/// Two maps of 2 x 3 cells, one channel: 1 to 6 and 11 to 16.
const SMALL: Grid = Grid {
    images: 2,
    height: 2,
    width: 3,
};
const VALUES: [f32; 12] = [
    1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0,
];

fn small(image: usize, edges: [f32; 4], bins: usize, samples: usize) -> Vec<f32> {
    pool(&VALUES, 1, SMALL, &[Roi { image, edges }], bins, samples)
}

#[test]
fn regions_of_a_small_map_by_hand() {
    // Around the centre of the second cell, and halfway between four of them.
    assert_eq!(small(0, [0.5, -0.5, 1.5, 0.5], 1, 1), [2.0]);
    assert_eq!(small(1, [0.0, 0.0, 1.0, 1.0], 1, 1), [13.0]);
    // A sample at (1.25, 0.5): 3/8 of 2 and 5, 1/8 of 3 and 6.
    assert_eq!(small(0, [1.0, 0.0, 1.5, 1.0], 1, 1), [3.75]);
    // The samples at 0.25 and 0.75 of each axis have the mean of the middle.
    assert_eq!(small(1, [0.0, 0.0, 1.0, 1.0], 1, 2), [13.0]);
    // Bins row by row: their centres are the first two cells of both rows.
    let cells = small(0, [-0.5, -0.5, 1.5, 1.5], 2, 1);
    assert_eq!(cells, [1.0, 2.0, 4.0, 5.0]);
}

#[test]
fn samples_just_outside_read_the_rim_and_those_beyond_a_cell_nothing() {
    // At (-0.75, 0), and at (2.75, 1).
    assert_eq!(small(0, [-1.0, -0.5, -0.5, 0.5], 1, 1), [1.0]);
    assert_eq!(small(0, [2.5, 0.5, 3.0, 1.5], 1, 1), [6.0]);
    // At (-1.5, 0) nothing; with a sample at (-0.5, 0), half of the first cell.
    assert_eq!(small(0, [-2.0, -0.5, -1.0, 0.5], 1, 1), [0.0]);
    assert_eq!(small(0, [-2.0, 0.0, 0.0, 0.0], 1, 2), [0.5]);
}

#[test]
fn a_region_outside_the_map_or_not_finite_is_zero() {
    for edges in [
        [10.0, 0.0, 14.0, 2.0],
        [0.0, -9.0, 3.0, -5.0],
        [f32::NAN, 0.0, 1.0, 1.0],
        [0.0, 0.0, f32::INFINITY, 1.0],
        [f32::MIN, 0.0, f32::MAX, 1.0],
    ] {
        let found = small(0, edges, 2, 2);
        assert_eq!(found, [0.0; 4], "{edges:?}");
    }
}

#[test]
fn no_region_and_no_cell_are_no_rows() {
    let none = Grid {
        images: 1,
        height: 0,
        width: 4,
    };
    let roi = Roi {
        image: 0,
        edges: [0.0, 0.0, 1.0, 1.0],
    };
    assert_eq!(pool(&[], 2, none, &[roi], 1, 2), [0.0, 0.0]);
    assert!(pool(&VALUES, 1, SMALL, &[], 7, 2).is_empty());
}

#[test]
#[should_panic(expected = "regions are of the 2 images of the grid")]
fn a_region_of_an_image_that_is_not_there() {
    small(2, [0.0, 0.0, 1.0, 1.0], 1, 1);
}

#[derive(Debug, Clone)]
struct Problem {
    pooling: Pooling,
    channels: usize,
    values: Vec<f32>,
}

fn problem() -> impl Strategy<Value = Problem> {
    let grid = (1..4_usize, 1..6_usize, 1..6_usize).prop_map(|(images, height, width)| Grid {
        images,
        height,
        width,
    });
    (grid, 1..4_usize, 1..4_usize, 1..4_usize).prop_flat_map(|(grid, channels, bins, samples)| {
        let edges = prop::array::uniform4(-3.0_f32..8.0);
        let roi = (0..grid.images, edges).prop_map(|(image, edges)| Roi { image, edges });
        let rois = prop::collection::vec(roi, 0..5);
        let values = prop::collection::vec(-1.0_f32..1.0, grid.rows() * channels);
        (rois, values).prop_map(move |(rois, values)| Problem {
            pooling: Pooling {
                grid,
                rois,
                bins,
                samples,
            },
            channels,
            values,
        })
    })
}

impl Problem {
    /// One number of the result, straight from the definition.
    fn direct(&self, roi: &Roi, bin: [usize; 2], channel: usize) -> f64 {
        let Pooling {
            grid,
            bins,
            samples,
            ..
        } = self.pooling;
        let [left, top, right, bottom] = roi.edges.map(f64::from);
        let place = |from: f64, to: f64, bin: usize, sample: usize| {
            let within = (sample as f64 + 0.5) / samples as f64;
            from + (bin as f64 + within) * (to - from) / bins as f64
        };
        let value = |y: usize, x: usize| {
            let cell = (roi.image * grid.height + y) * grid.width + x;
            f64::from(self.values[cell * self.channels + channel])
        };
        let (height, width) = (grid.height as f64, grid.width as f64);
        let mut sum = 0.0;
        for v in 0..samples {
            for u in 0..samples {
                let y = place(top, bottom, bin[0], v);
                let x = place(left, right, bin[1], u);
                if y < -1.0 || y > height || x < -1.0 || x > width {
                    continue;
                }
                let (y, x) = (y.clamp(0.0, height - 1.0), x.clamp(0.0, width - 1.0));
                let (y0, x0) = (y.floor() as usize, x.floor() as usize);
                let (y1, x1) = ((y0 + 1).min(grid.height - 1), (x0 + 1).min(grid.width - 1));
                let (fy, fx) = (y.fract(), x.fract());
                sum += (1.0 - fy) * ((1.0 - fx) * value(y0, x0) + fx * value(y0, x1))
                    + fy * ((1.0 - fx) * value(y1, x0) + fx * value(y1, x1));
            }
        }
        sum / (samples * samples) as f64
    }
}

proptest! {
    #[test]
    fn agrees_with_the_definition(problem in problem()) {
        let Pooling { grid, bins, samples, ref rois } = problem.pooling;
        let found = pool(&problem.values, problem.channels, grid, rois, bins, samples);
        let mut found = found.into_iter();
        for roi in rois {
            for bin in 0..bins * bins {
                for channel in 0..problem.channels {
                    let expected = problem.direct(roi, [bin / bins, bin % bins], channel);
                    let found = f64::from(found.next().unwrap());
                    prop_assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
                }
            }
        }
    }

    /// The weights of a bin sum to one where the map holds all of its samples.
    #[test]
    fn a_constant_map_gives_the_constant(
        edges in prop::array::uniform4(-0.9_f32..4.9),
        bins in 1..8_usize,
        samples in 1..4_usize,
    ) {
        let grid = Grid { images: 1, height: 5, width: 5 };
        let roi = Roi { image: 0, edges };
        for value in pool(&[3.0; 50], 2, grid, &[roi], bins, samples) {
            prop_assert!((value - 3.0).abs() < 1e-5);
        }
    }

    /// The operation is linear, so differences of any size give its gradient: of a weighted
    /// sum, the change when one input grows by 1.
    #[test]
    fn gradients_are_those_of_finite_differences(problem in problem()) {
        let Problem { pooling, channels, values } = problem;
        let device = Device::flex().autodiff();
        let shape = [pooling.grid.rows(), channels];
        let x = Tensor::<2>::from_data(TensorData::new(values.clone(), shape), &device)
            .require_grad();
        let weights: Vec<f32> = (0..pooling.rows() * channels)
            .map(|i| (i as f32 * 0.7).sin())
            .collect();
        let weight = TensorData::new(weights.clone(), [pooling.rows(), channels]);
        let weight = Tensor::<2>::from_data(weight, &device);
        let out = roi_align(x.clone(), pooling.grid, &pooling.rois, pooling.bins, pooling.samples);
        let gradients = (out * weight).sum().backward();
        let found: Vec<f32> = x.grad(&gradients).unwrap().into_data().iter().collect();
        let loss = |x: &[f32]| -> f64 {
            let out = pooling.forward(x, channels);
            out.iter().zip(&weights).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let before = loss(&values);
        for (at, found) in found.into_iter().enumerate() {
            let mut moved = values.clone();
            moved[at] += 1.0;
            let expected = loss(&moved) - before;
            prop_assert!((f64::from(found) - expected).abs() < 1e-4, "{found} is not {expected}");
        }
    }
}
