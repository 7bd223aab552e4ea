use burn::tensor::Tensor;

use crate::NnError;

/// A tensor's values on the host, row by row.
///
/// # Errors
/// Values that the device does not hand back, or that are not in single precision.
pub fn read<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, NnError> {
    tensor
        .into_data()
        .try_to_vec()
        .map_err(|e| NnError::Output {
            why: format!("{e:?}"),
        })
}
