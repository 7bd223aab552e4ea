use burn::tensor::{Int, Tensor, activation::log_softmax};

/// Cross entropy of scaled cosines, with the true class's cosine lowered by a margin.
///
/// For unit directions u and unit anchors w: -log softmax(scale (u.w - margin onehot)), the
/// additive margin of Wang et al. 2018 (`CosFace`).
#[derive(Debug, Clone, Copy)]
pub struct AngularMargin {
    /// Inverse temperature.
    pub scale: f64,
    /// What the true class's cosine must exceed the others by.
    pub margin: f64,
}

impl AngularMargin {
    /// One loss per row of `directions` (rows, 3); `anchors` is (classes, 3), `onehot` marks each
    /// row's class.
    pub fn forward(
        &self,
        directions: Tensor<2>,
        anchors: Tensor<2>,
        onehot: Tensor<2>,
    ) -> Tensor<1> {
        let cosines = directions.matmul(anchors.transpose());
        let lowered = (cosines - onehot.clone() * self.margin) * self.scale;
        -(log_softmax(lowered, 1) * onehot)
            .sum_dim(1)
            .squeeze_dim::<1>(1)
    }
}

/// Rows of zeros with a one at each class.
pub fn one_hot(classes: Tensor<1, Int>, count: usize) -> Tensor<2> {
    classes.one_hot::<2>(count).float()
}
