use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, activation::relu},
};

/// Two linear layers with a rectifier between them.
#[derive(Module, Debug)]
pub struct Mlp {
    first: Linear,
    second: Linear,
}

impl Mlp {
    /// A network of the given widths.
    pub fn new([inputs, hidden, outputs]: [usize; 3], device: &Device) -> Self {
        Self {
            first: LinearConfig::new(inputs, hidden).init(device),
            second: LinearConfig::new(hidden, outputs).init(device),
        }
    }

    /// Rows in, rows out.
    pub fn forward(&self, rows: Tensor<2>) -> Tensor<2> {
        self.second.forward(relu(self.first.forward(rows)))
    }
}

/// x + MLP(relu(x)): a block whose gradient has a path around it.
#[derive(Module, Debug)]
pub struct ResidualMlp {
    mlp: Mlp,
}

impl ResidualMlp {
    /// A block of one width throughout.
    pub fn new(width: usize, device: &Device) -> Self {
        Self {
            mlp: Mlp::new([width; 3], device),
        }
    }

    /// Rows in, rows out.
    pub fn forward(&self, rows: Tensor<2>) -> Tensor<2> {
        rows.clone() + self.mlp.forward(relu(rows))
    }
}
