//! The query network's gradient against finite differences, on a network of a few units.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::{
    module::{Module as _, ModuleMapper, ModuleVisitor, Param},
    optim::GradientsParams,
    tensor::{Device, Tensor, TensorData},
};
use credence_embed::query::{Batch, QueryNetwork, Sample, Support, Widths};
use credence_nn::seed_parameters;
use credence_types::stream;
use rand::RngExt as _;

fn points(count: usize, purpose: &str) -> Vec<[f32; 3]> {
    let mut rng = stream(1, purpose);
    (0..count)
        .map(|_| [0; 3].map(|_| rng.random_range(-0.5..0.5)))
        .collect()
}

/// Two observations of different size.
fn samples() -> [Sample; 2] {
    [(11, 5, "a"), (20, 9, "b")].map(|(object, free, name)| {
        let support = Support::new(
            points(object, &format!("{name}/object")),
            points(free, &format!("{name}/free")),
        );
        Sample::new(&support.unwrap(), &points(6, &format!("{name}/queries"))).unwrap()
    })
}

fn network(device: &Device) -> QueryNetwork {
    let network = QueryNetwork::new(Widths { point: 5, code: 7 }, device);
    seed_parameters(network, &mut stream(5, "test/network"))
}

/// A sum of all outputs with weights that tell them apart.
fn total(network: &QueryNetwork, device: &Device) -> Tensor<1> {
    let (encoded, decoded) = network.forward(&Batch::new(&samples(), device).unwrap());
    let weighed = |values: Tensor<1>| {
        let count = values.dims()[0];
        let weights: Vec<f32> = (0..count).map(|i| (i as f32 * 1.7).sin()).collect();
        (values * Tensor::from_data(TensorData::new(weights, [count]), device)).sum()
    };
    weighed(decoded.logits)
        + weighed(
            decoded
                .directions
                .matmul(network.anchors().transpose())
                .flatten(0, 1),
        )
        + weighed(encoded.class_logits.flatten(0, 1))
}

/// Moves one parameter along a fixed direction.
struct Move {
    parameter: usize,
    by: f32,
    at: usize,
}

fn direction(shape: &[usize], parameter: usize) -> Vec<f32> {
    let mut rng = stream(parameter as u64, "test/direction");
    (0..shape.iter().product())
        .map(|_| rng.random_range(-1.0..1.0))
        .collect()
}

impl ModuleMapper for Move {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let here = self.at == self.parameter;
        self.at += 1;
        if !here {
            return param;
        }
        let by = self.by;
        let parameter = self.parameter;
        param.map(|value| {
            let along = direction(&value.dims(), parameter);
            let along = TensorData::new(along, value.dims());
            value.clone() + Tensor::from_data(along, &value.device()) * by
        })
    }
}

/// The gradients of the parameters in their order, and their shapes.
struct Collect {
    gradients: GradientsParams,
    found: Vec<(Vec<usize>, Vec<f32>)>,
}

impl ModuleVisitor for Collect {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let gradient = self.gradients.get::<D>(param.id).unwrap();
        let shape = gradient.dims().to_vec();
        self.found
            .push((shape, gradient.into_data().iter().collect()));
    }
}

#[test]
fn the_gradient_of_every_parameter_agrees_with_finite_differences() {
    let (plain, recording) = (Device::flex(), Device::flex().autodiff());
    let trained = network(&recording);
    let gradients = total(&trained, &recording).backward();
    let mut collect = Collect {
        gradients: GradientsParams::from_grads(gradients, &trained),
        found: Vec::new(),
    };
    trained.visit(&mut collect);
    assert_eq!(collect.found.len(), 33);
    let still = network(&plain);
    let value = |parameter: usize, by: f32| {
        let mut mapper = Move {
            parameter,
            by,
            at: 0,
        };
        let moved = still.clone().map(&mut mapper);
        f64::from(total(&moved, &plain).into_scalar::<f32>())
    };
    for (parameter, (shape, gradient)) in collect.found.into_iter().enumerate() {
        let along = direction(&shape, parameter);
        let products = gradient.iter().zip(along).map(|(g, v)| f64::from(g * v));
        let expected: f64 = products.sum();
        // Wide enough to see past single precision, narrow enough to cross few kinks.
        const STEP: f32 = 4e-4;
        let found = (value(parameter, STEP) - value(parameter, -STEP)) / (2.0 * f64::from(STEP));
        let tolerance = 0.02 * expected.abs() + 0.003;
        assert!(
            (found - expected).abs() < tolerance,
            "{parameter}: {found} {expected}"
        );
    }
}

#[test]
fn observations_of_a_batch_do_not_see_each_other() {
    let device = Device::flex();
    let network = network(&device);
    let logits = |samples: &[Sample]| -> Vec<f32> {
        let (_, decoded) = network.forward(&Batch::new(samples, &device).unwrap());
        decoded.logits.into_data().iter::<f32>().collect()
    };
    let [first, second] = samples();
    let together = logits(&[first.clone(), second.clone()]);
    let apart = [logits(std::slice::from_ref(&first)), logits(&[second])].concat();
    assert!(
        together
            .iter()
            .zip(&apart)
            .all(|(a, b)| (a - b).abs() < 1e-5)
    );

    let support = Support::new(points(9, "object"), points(9, "free")).unwrap();
    let other = Sample::new(&support, &points(2, "queries")).unwrap();
    let message = Batch::new(&[first, other], &device)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("observation 1 has 2 queries, the first one has 6"),
        "{message}"
    );
    let message = Batch::new(&[], &device).unwrap_err().to_string();
    assert_eq!(message, "the batch has no observations; pass at least one");
}
