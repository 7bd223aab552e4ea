//! The edge convolution of DGCNN (Wang et al. 2019) in its gather-max form.
//!
//! An edge convolution maps every point to the strongest response over its edges,
//! `max_j lrelu(W [x_i, x_j - x_i])` with `W = [P | Q]`. The layer is linear in the edge and the
//! activation rises monotonically, so the maximum moves inwards:
//!
//! `max_j lrelu(W [x_i, x_j - x_i]) = lrelu(A x_i + max_j B x_j)`, `A = P - Q`, `B = Q`.
//!
//! Two products per point replace one per edge, and only the winning neighbour of each channel
//! carries a gradient: it is found outside autodiff and gathered inside.

use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Int, Tensor, TensorData},
};
use rayon::prelude::*;

use crate::{
    NnError, RowNorm, knn, leaky_relu,
    strongest::{host_values, keep_larger},
};

/// Rows per task of the search for winners: enough work to be worth a steal.
const ROWS_PER_TASK: usize = 64;

/// Every row's k neighbours among the rows of one batch of clouds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NeighbourGraph {
    neighbours: Vec<u32>,
    k: usize,
}

impl NeighbourGraph {
    /// Row `i`'s neighbours are `neighbours[i * k..(i + 1) * k]`.
    ///
    /// # Errors
    ///
    /// When `k` is zero, the list is no multiple of it, or a neighbour is not a row.
    pub fn new(neighbours: Vec<u32>, k: usize) -> Result<Self, NnError> {
        if k == 0 || !neighbours.len().is_multiple_of(k) {
            return Err(NnError::RaggedNeighbours {
                entries: neighbours.len(),
                k,
            });
        }
        let rows = neighbours.len() / k;
        match neighbours.iter().find(|&&j| j as usize >= rows) {
            Some(&neighbour) => Err(NnError::NeighbourOutOfRange { neighbour, rows }),
            None => Ok(Self { neighbours, k }),
        }
    }

    /// The k nearest points of every point in its own cloud, itself among them, nearest first;
    /// rows number the points of all clouds in turn.
    ///
    /// # Errors
    ///
    /// When a cloud has fewer than `k` points.
    pub fn nearest(clouds: &[&[[f32; 3]]], k: usize) -> Result<Self, NnError> {
        let lists: Vec<Vec<u32>> = clouds
            .par_iter()
            .map(|cloud| knn::nearest(cloud, cloud, k))
            .collect::<Result<_, _>>()?;
        let mut neighbours = Vec::with_capacity(lists.iter().map(Vec::len).sum());
        let mut first_row = 0;
        for (list, cloud) in lists.iter().zip(clouds) {
            neighbours.extend(list.iter().map(|j| j + first_row));
            first_row += cloud.len() as u32;
        }
        Self::new(neighbours, k)
    }

    /// Number of points.
    pub fn rows(&self) -> usize {
        self.neighbours.len() / self.k
    }

    /// Which neighbour has the largest value, for every row and channel of `[rows, channels]`;
    /// the first of equals.
    fn winners(&self, values: &Tensor<2>) -> Tensor<2, Int> {
        let [rows, channels] = values.dims();
        assert_eq!(rows, self.rows(), "one row of features per point");
        let device = values.device();
        let data = host_values(values.clone());
        let values: &[f32] = data.as_slice().unwrap_or_default();
        let row = |j: u32| &values[j as usize * channels..(j as usize + 1) * channels];
        let mut winners = vec![0_i32; rows * channels];
        winners
            .par_chunks_mut(ROWS_PER_TASK * channels)
            .zip(self.neighbours.par_chunks(ROWS_PER_TASK * self.k))
            .for_each(|(winners, neighbours)| {
                let mut best = vec![0.0_f32; channels];
                for (winners, neighbours) in winners
                    .chunks_exact_mut(channels)
                    .zip(neighbours.chunks_exact(self.k))
                {
                    best.copy_from_slice(row(neighbours[0]));
                    winners.fill(neighbours[0].cast_signed());
                    for &j in &neighbours[1..] {
                        keep_larger(&mut best, winners, row(j), j.cast_signed());
                    }
                }
            });
        Tensor::from_data(TensorData::new(winners, [rows, channels]), &device)
    }
}

/// `lrelu(norm(A x_i + max_j B x_j))`: one edge convolution with batch normalisation.
///
/// The normalisation stands after the maximum. Before it, as in the textbook form, it would turn
/// the maximum of a channel with a negative scale into a minimum; without it both forms agree.
#[derive(Module, Debug)]
pub struct EdgeConv {
    linear: Linear,
    norm: RowNorm,
}

impl EdgeConv {
    /// A layer from `inputs` to `outputs` channels per point.
    pub fn new(inputs: usize, outputs: usize, device: &Device) -> Self {
        Self {
            linear: LinearConfig::new(inputs, 2 * outputs)
                .with_bias(false)
                .init(device),
            norm: RowNorm::new(outputs, device),
        }
    }

    /// New features `[rows, outputs]` from `x`, `[rows, inputs]`.
    ///
    /// # Panics
    ///
    /// When the graph has another number of rows than `x`.
    pub fn forward(&self, x: Tensor<2>, graph: &NeighbourGraph) -> Tensor<2> {
        let strongest = edge_max(self.linear.forward(x), graph);
        leaky_relu(self.norm.forward(strongest))
    }
}

/// `A x_i + max_j B x_j` from the two products side by side, `[rows, 2 * channels]`.
fn edge_max(products: Tensor<2>, graph: &NeighbourGraph) -> Tensor<2> {
    let [own, neighbours]: [Tensor<2>; 2] = products
        .chunk(2, 1)
        .try_into()
        .unwrap_or_else(|_| unreachable!("two halves of an even width"));
    let winners = graph.winners(&neighbours);
    own + neighbours.gather(0, winners)
}

#[cfg(test)]
mod tests {
    use burn::module::Module as _;
    use proptest::prelude::*;

    use super::*;

    const K: usize = 3;
    const INPUTS: usize = 2;
    const OUTPUTS: usize = 4;

    fn tensor(values: &[f32], columns: usize, device: &Device) -> Tensor<2> {
        let shape = [values.len() / columns, columns];
        Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
    }

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.into_data().try_to_vec().unwrap()
    }

    fn lrelu(x: f64) -> f64 {
        x.max(0.2 * x)
    }

    /// The textbook form: `max_j lrelu(P x_i + Q (x_j - x_i))` with `P = A + B`, `Q = B`.
    fn textbook(x: &[f64], weight: &[f64], graph: &NeighbourGraph) -> Vec<f64> {
        let a = |i: usize, o: usize| weight[i * 2 * OUTPUTS + o];
        let b = |i: usize, o: usize| weight[i * 2 * OUTPUTS + OUTPUTS + o];
        let edge = |i: usize, j: usize, o: usize| -> f64 {
            (0..INPUTS)
                .map(|c| {
                    let (own, other) = (x[i * INPUTS + c], x[j * INPUTS + c]);
                    (a(c, o) + b(c, o)) * own + b(c, o) * (other - own)
                })
                .sum()
        };
        (0..graph.rows() * OUTPUTS)
            .map(|at| {
                let (i, o) = (at / OUTPUTS, at % OUTPUTS);
                graph.neighbours[i * K..(i + 1) * K]
                    .iter()
                    .map(|&j| lrelu(edge(i, j as usize, o)))
                    .fold(f64::NEG_INFINITY, f64::max)
            })
            .collect()
    }

    fn gather_max(x: Tensor<2>, weight: Tensor<2>, graph: &NeighbourGraph) -> Tensor<2> {
        leaky_relu(edge_max(x.matmul(weight), graph))
    }

    fn widen(values: &[f32]) -> Vec<f64> {
        values.iter().map(|&v| f64::from(v)).collect()
    }

    /// Features, weights and neighbours of `rows` points.
    fn problem(rows: usize) -> impl Strategy<Value = (Vec<f32>, Vec<f32>, NeighbourGraph)> {
        (
            prop::collection::vec(-1.0_f32..1.0, rows * INPUTS),
            prop::collection::vec(-1.0_f32..1.0, INPUTS * 2 * OUTPUTS),
            prop::collection::vec(0..rows as u32, rows * K),
        )
            .prop_map(|(x, weight, neighbours)| {
                (x, weight, NeighbourGraph::new(neighbours, K).unwrap())
            })
    }

    #[test]
    fn one_point_and_its_neighbours_by_hand() {
        // A = 1, B = 2 in one dimension: lrelu(x_i + max 2 x_j).
        let graph = NeighbourGraph::new(vec![0, 1, 1, 2, 2, 0], 2).unwrap();
        let device = Device::flex();
        let x = tensor(&[1.0, -3.0, 2.0], 1, &device);
        let weight = tensor(&[1.0, 2.0], 2, &device);
        let out = values(gather_max(x, weight, &graph));
        assert_eq!(out, [1.0 + 2.0, -3.0 + 4.0, 2.0 + 4.0]);
    }

    proptest! {
        #[test]
        fn equals_the_textbook_form((x, weight, graph) in problem(6)) {
            let device = Device::flex();
            let fast = gather_max(
                tensor(&x, INPUTS, &device),
                tensor(&weight, 2 * OUTPUTS, &device),
                &graph,
            );
            let slow = textbook(&widen(&x), &widen(&weight), &graph);
            for (fast, slow) in values(fast).into_iter().zip(slow) {
                prop_assert!((f64::from(fast) - slow).abs() < 1e-5, "{fast} is not {slow}");
            }
        }

        #[test]
        fn a_permutation_of_the_points_permutes_the_features(
            (x, weight, graph) in problem(6),
            order in Just((0..6).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            // Row `new` of the permuted problem is row `order[new]` of the first.
            let device = Device::flex();
            let mut position = [0_u32; 6];
            for (new, &old) in order.iter().enumerate() {
                position[old] = new as u32;
            }
            let permuted_x: Vec<f32> = order
                .iter()
                .flat_map(|&old| x[old * INPUTS..(old + 1) * INPUTS].to_vec())
                .collect();
            let permuted = order
                .iter()
                .flat_map(|&old| &graph.neighbours[old * K..(old + 1) * K])
                .map(|&j| position[j as usize])
                .collect();
            let permuted = NeighbourGraph::new(permuted, K).unwrap();
            let layer = EdgeConv {
                linear: Linear {
                    weight: burn::module::Param::from_tensor(tensor(&weight, 2 * OUTPUTS, &device)),
                    bias: None,
                },
                norm: RowNorm::new(OUTPUTS, &device),
            };
            let first = values(layer.forward(tensor(&x, INPUTS, &device), &graph));
            let second = values(layer.forward(tensor(&permuted_x, INPUTS, &device), &permuted));
            for (new, &old) in order.iter().enumerate() {
                prop_assert_eq!(
                    &second[new * OUTPUTS..(new + 1) * OUTPUTS],
                    &first[old * OUTPUTS..(old + 1) * OUTPUTS]
                );
            }
        }

        #[test]
        fn gradients_are_those_of_finite_differences(
            (x, weight, graph) in problem(5),
            upstream in prop::collection::vec(-1.0_f32..1.0, 5 * OUTPUTS),
        ) {
            let device = Device::flex().autodiff();
            let (x64, weight64) = (widen(&x), widen(&weight));
            let x = tensor(&x, INPUTS, &device).require_grad();
            let weight = tensor(&weight, 2 * OUTPUTS, &device).require_grad();
            let out = gather_max(x.clone(), weight.clone(), &graph);
            let loss = (out * tensor(&upstream, OUTPUTS, &device)).sum();
            let grads = loss.backward();
            let loss_of = |x: &[f64], weight: &[f64]| -> f64 {
                textbook(x, weight, &graph)
                    .iter()
                    .zip(&upstream)
                    .map(|(y, &g)| y * f64::from(g))
                    .sum()
            };
            // Away from its kinks the function is linear in each factor: where the two one-sided
            // differences disagree, a kink lies within the step, and nothing is compared.
            let step = 1e-6;
            let compare = |analytic: Vec<f32>, at: &[f64], f: &dyn Fn(&[f64]) -> f64| {
                let centre = f(at);
                for (i, analytic) in analytic.into_iter().enumerate() {
                    let mut moved = at.to_vec();
                    moved[i] = at[i] + step;
                    let up = (f(&moved) - centre) / step;
                    moved[i] = at[i] - step;
                    let down = (centre - f(&moved)) / step;
                    if (up - down).abs() < 1e-4 {
                        prop_assert!((f64::from(analytic) - up).abs() < 1e-3, "{analytic}, {up}");
                    }
                }
                Ok(())
            };
            compare(values(x.grad(&grads).unwrap()), &x64, &|x| loss_of(x, &weight64))?;
            compare(values(weight.grad(&grads).unwrap()), &weight64, &|w| loss_of(&x64, w))?;
        }
    }

    #[test]
    fn neighbours_stay_within_their_cloud_and_begin_with_the_point() {
        let line = |from: f32| {
            [
                [from, 0.0, 0.0],
                [from + 1.0, 0.0, 0.0],
                [from + 3.0, 0.0, 0.0],
            ]
        };
        let graph = NeighbourGraph::nearest(&[&line(0.0), &line(0.5)], 2).unwrap();
        assert_eq!(graph.neighbours, [0, 1, 1, 0, 2, 1, 3, 4, 4, 3, 5, 4]);
    }

    #[test]
    fn a_layer_normalises_what_it_learns_from() {
        let device = Device::flex().autodiff();
        let layer = EdgeConv::new(1, 2, &device);
        let points: Vec<[f32; 3]> = (0..50).map(|i| [(i * i) as f32, 0.0, 0.0]).collect();
        let graph = NeighbourGraph::nearest(&[&points], 4).unwrap();
        let x: Vec<f32> = points.iter().map(|p| p[0]).collect();
        let trained = values(layer.forward(tensor(&x, 1, &device), &graph));
        assert!(
            trained.iter().all(|y| y.abs() < 10.0),
            "batch statistics scale the features"
        );
        let served = values(
            layer
                .valid()
                .forward(tensor(&x, 1, &Device::flex()), &graph),
        );
        assert_ne!(
            trained, served,
            "running statistics have seen one batch only"
        );
    }

    #[test]
    fn bad_neighbours_are_refused() {
        let message = |neighbours, k| NeighbourGraph::new(neighbours, k).unwrap_err().to_string();
        assert_eq!(
            message(vec![0, 1, 0], 2),
            "3 neighbours are not 2 for every point; pass k >= 1 of each"
        );
        assert!(message(vec![], 0).contains("k >= 1"));
        assert_eq!(
            message(vec![0, 2, 1, 0], 2),
            "neighbour 2 is not one of 2 points; number them from 0"
        );
        let few = NeighbourGraph::nearest(&[&[[0.0; 3]; 3]], 4).unwrap_err();
        assert!(few.to_string().contains("4 nearest of 3 points"), "{few}");
    }
}
