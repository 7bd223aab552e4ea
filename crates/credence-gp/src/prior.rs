use crate::{GpError, Points, covariance::check_length, targets::target};

/// Prior mean of each class's latent function at a list of points, on top of the constant mean
/// among its hyperparameters.
///
/// It lets another model, which sees more than coordinates, say what to expect where no training
/// point is near; the process then corrects it by its training points.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorMeans {
    /// Per class, per point.
    means: Vec<Vec<f64>>,
}

impl PriorMeans {
    /// See [`DirichletGp::prior_means`](crate::DirichletGp::prior_means).
    pub(crate) fn new(
        probabilities: &[f64],
        classes: usize,
        alpha_epsilon: f64,
    ) -> Result<Self, GpError> {
        if classes < 2 {
            return Err(GpError::TooFewClasses { classes });
        }
        if !probabilities.len().is_multiple_of(classes) {
            return Err(GpError::RaggedPoints {
                name: "probabilities",
                values: probabilities.len(),
                dim: classes,
            });
        }
        let in_range = |p: &f64| (0.0..=1.0).contains(p);
        if let Some(place) = probabilities.iter().position(|p| !in_range(p)) {
            return Err(GpError::Setting {
                name: "a prior probability",
                value: probabilities[place],
                range: "between 0 and 1",
            });
        }
        let of_class = |class| {
            let column = probabilities.iter().skip(class).step_by(classes);
            column.map(|p| target(alpha_epsilon + p)).collect()
        };
        Ok(Self {
            means: (0..classes).map(of_class).collect(),
        })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.means[0].len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Prior mean per class and point.
    pub fn means(&self) -> &[Vec<f64>] {
        &self.means
    }

    /// Leaves of one class's values what the prior does not expect.
    pub(crate) fn take_off(&self, class: usize, values: &mut [f64]) {
        for (value, mean) in values.iter_mut().zip(&self.means[class]) {
            *value -= mean;
        }
    }

    /// Adds what the prior expects to one class's values.
    pub(crate) fn add_to(&self, class: usize, values: &mut [f64]) {
        for (value, mean) in values.iter_mut().zip(&self.means[class]) {
            *value += mean;
        }
    }

    pub(crate) fn check(
        &self,
        name: &'static str,
        points: &Points,
        classes: usize,
    ) -> Result<(), GpError> {
        check_length(name, self.means.len(), classes, "class")?;
        check_length(name, self.len(), points.len(), "point")
    }
}

/// Prior means where a posterior needs them.
#[derive(Debug, Clone, Copy)]
pub struct Prior<'a> {
    /// At the training points.
    pub training: &'a PriorMeans,
    /// At the test points.
    pub test: &'a PriorMeans,
}
