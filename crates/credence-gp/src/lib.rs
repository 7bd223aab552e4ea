//! Exact Dirichlet Gaussian-process classification.
//!
//! **Latent function**: per class, a Gaussian process whose value at a point is large where the
//! point is likely of that class. **Targets**: what each label says of it, as a number with a known
//! noise variance (Milios et al. 2018, "Dirichlet-based Gaussian Processes for Large-scale
//! Calibrated Classification"), which turns classification into exact regression. **Posterior**:
//! the latent functions at test points, given the targets. **Confidence**: its variance, scaled to
//! \[0, 1\].
//!
//! [`Points`] and labels make a [`TrainingSet`]; [`DirichletGp::fit`] finds [`Hyperparameters`] for
//! each class, [`DirichletGp::posterior`] gives a [`Posterior`], and that gives classes, variances,
//! probabilities and confidences. [`Covariance`] chooses the space in which points are compared.
//! [`PriorMeans`] let another model speak first, and [`DirichletGp::evidence`] tells how well what
//! it says agrees with the training points.
//!
//! ```
//! use credence_gp::{Covariance, DirichletGp, FitConfig, Points, TrainingSet};
//!
//! let points = Points::from_rows("points", &[0.0, 0.1, 0.2, 1.0, 1.1, 1.2], 1)?;
//! let training = TrainingSet::new(points, &[0, 0, 0, 1, 1, 1], 2)?;
//! let test = Points::from_rows("test", &[0.05, 1.15], 1)?;
//!
//! let gp = DirichletGp::default();
//! let fits = gp.fit(&training, &Covariance::Classic, &FitConfig::default())?;
//! let hyperparameters: Vec<_> = fits.iter().map(|fit| fit.hyperparameters).collect();
//! let posterior = gp.posterior(&training, &Covariance::Classic, &hyperparameters, &test)?;
//! assert_eq!(posterior.class(), [0, 1]);
//! # Ok::<(), credence_gp::GpError>(())
//! ```

mod conditioned;
mod confidence;
mod covariance;
mod error;
mod exp;
mod factor;
mod fit;
mod hyperparameters;
mod kernel;
mod likelihood;
mod model;
mod points;
mod posterior;
mod prior;
mod softmax;
mod targets;
mod training;

pub use confidence::confidence;
pub use covariance::Covariance;
pub use error::GpError;
pub use fit::{Fit, FitConfig, Start};
pub use hyperparameters::Hyperparameters;
pub use kernel::Smoothness;
pub use likelihood::{Gradient, Likelihood};
pub use model::DirichletGp;
pub use points::Points;
pub use posterior::Posterior;
pub use prior::{Prior, PriorMeans};
pub use targets::Targets;
pub use training::TrainingSet;
