use burn::{
    module::{Module, ModuleMapper, Param, ParamId},
    tensor::{Tensor, TensorData},
};
use rand::{Rng, RngExt as _};

/// Draws the weights of every linear layer from `rng` and numbers the parameters in their order.
///
/// Weights and biases are uniform within 1/sqrt(inputs), as in `PyTorch`; other parameters keep
/// their values. The draws come from the caller's stream instead of the backend's global one, and
/// the numbers let an optimiser's state find its parameters again in another process.
pub fn seed_parameters<M: Module>(module: M, rng: &mut impl Rng) -> M {
    let mut mapper = Seeder {
        rng,
        containers: Vec::new(),
        inputs: 1,
        next: 1,
    };
    module.map(&mut mapper)
}

struct Seeder<'a, R> {
    rng: &'a mut R,
    containers: Vec<String>,
    inputs: usize,
    next: u64,
}

impl<R: Rng> ModuleMapper for Seeder<'_, R> {
    fn enter_module(&mut self, _name: &str, container_type: &str) {
        self.containers.push(container_type.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.containers.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let id = ParamId::from(self.next);
        self.next += 1;
        let value = param.val();
        let linear = self.containers.iter().any(|c| c.ends_with("Linear"));
        if !linear {
            return Param::initialized(id, value);
        }
        let shape = value.dims();
        // The weight, [inputs, outputs], comes before its bias.
        if D == 2 {
            self.inputs = shape[0];
        }
        let bound = 1.0 / (self.inputs as f32).sqrt();
        let count = shape.iter().product();
        let draw = |_| self.rng.random_range(-bound..bound);
        let values: Vec<f32> = (0..count).map(draw).collect();
        let tensor = Tensor::from_data(TensorData::new(values, shape), &value.device());
        // A device that records no gradients refuses to be asked for them.
        let trainable = value.is_require_grad();
        Param::initialized(
            id,
            if trainable {
                tensor.require_grad()
            } else {
                tensor
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use burn::{module::list_param_ids, tensor::Device};
    use rand_chacha::{ChaCha20Rng, rand_core::SeedableRng as _};

    use super::*;
    use crate::Mlp;

    #[derive(Module, Debug)]
    struct Net {
        layers: Mlp,
        own: Param<Tensor<1>>,
    }

    fn seeded(seed: u64) -> Net {
        let device = Device::flex();
        let net = Net {
            layers: Mlp::new([4, 9, 2], &device),
            own: Param::from_tensor(Tensor::ones([3], &device)),
        };
        seed_parameters(net, &mut ChaCha20Rng::seed_from_u64(seed))
    }

    #[test]
    fn the_seed_alone_decides_weights_and_numbers() {
        let bytes = |seed| crate::weights::to_bytes(&seeded(seed)).unwrap();
        assert_eq!(bytes(1), bytes(1));
        assert_ne!(bytes(1), bytes(2));
        let ids: BTreeSet<u64> = list_param_ids(&seeded(1))
            .iter()
            .map(ParamId::val)
            .collect();
        assert_eq!(ids, (1..=5).collect());
    }

    #[test]
    fn weights_stay_within_their_bound_and_other_parameters_as_they_are() {
        let net = seeded(1);
        let bytes = crate::weights::to_bytes(&net).unwrap();
        assert!(!bytes.is_empty());
        assert_eq!(
            net.own.val().into_data().iter::<f32>().collect::<Vec<_>>(),
            [1.0; 3]
        );
        let out = net
            .layers
            .forward(Tensor::zeros([1, 4], &Device::flex()))
            .into_data();
        // Biases within 1/2 of nine units, then weights and biases within 1/3.
        assert!(
            out.iter::<f32>()
                .all(|v| v != 0.0 && v.abs() <= 9.0 * 0.5 / 3.0 + 1.0 / 3.0)
        );
    }
}
