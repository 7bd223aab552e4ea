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
        Param::initialized(id, tensor.require_grad())
    }
}
