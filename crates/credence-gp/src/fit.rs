//! Hyperparameters by maximum marginal likelihood.

use std::cell::RefCell;

use argmin::{
    core::{
        CostFunction, Error, Executor, Gradient as ArgminGradient, State as _, TerminationReason,
    },
    solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS},
};

use crate::{
    GpError, Hyperparameters, Points, Smoothness,
    factor::Storage,
    hyperparameters::check_scale,
    kernel::Matern,
    likelihood::{Mean, evaluate},
    targets::Targets,
};

/// The lengthscale stays within these multiples of the extent (the diagonal of the bounding box of
/// the points fitted on): below, all points are strangers to each other, above, all are one.
const LENGTHSCALE_RANGE: (f64, f64) = (1e-4, 1e2);

/// The outputscale stays within this range. Targets differ by 6.6 at most, so useful values are
/// around 10; the wide range leaves room for processes that are nearly straight lines.
const OUTPUTSCALE_RANGE: (f64, f64) = (1e-4, 1e4);

/// Lengthscales, as shares of the extent, of which the likeliest is the start.
const STARTS: [f64; 3] = [1.0 / 32.0, 1.0 / 8.0, 1.0 / 2.0];

/// Likelihoods per iteration that all runs together may take before the search is given up.
const EVALUATIONS_PER_ITERATION: usize = 5;

/// Steps that the quasi-Newton method remembers.
const MEMORY: usize = 5;

/// Runs of the search: a line search that gets stuck short of a maximum starts anew there.
const RUNS: usize = 3;

/// How to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitConfig {
    /// Positions of the training points to fit on; all of them if `None`. The cost of a likelihood
    /// grows with the cube of their number.
    pub subset: Option<Vec<usize>>,
    /// Where to start; if `None`, the likeliest of three lengthscales between 1/32 and 1/2 of the
    /// points' extent, with the variance of the targets as outputscale.
    pub start: Option<Start>,
    /// Iterations of each of at most 3 runs of the search, by default 50. With 0 the start itself
    /// is returned.
    pub max_iterations: u64,
    /// The search ends where the norm of the gradient of the likelihood per datum, by the search
    /// coordinates, falls below this; by default 1e-5.
    pub gradient_tolerance: f64,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self {
            subset: None,
            start: None,
            max_iterations: 50,
            gradient_tolerance: 1e-5,
        }
    }
}

impl FitConfig {
    pub(crate) fn check(&self) -> Result<(), GpError> {
        if let Some(start) = self.start {
            check_scale("start.lengthscale", start.lengthscale)?;
            check_scale("start.outputscale", start.outputscale)?;
        }
        if self.gradient_tolerance >= 0.0 && self.gradient_tolerance.is_finite() {
            Ok(())
        } else {
            Err(GpError::Setting {
                name: "gradient_tolerance",
                value: self.gradient_tolerance,
                range: "finite and not negative",
            })
        }
    }
}

/// Where a search starts. The mean needs no start: the best one is computed in closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Lengthscale, in the units of the points.
    pub lengthscale: f64,
    /// Outputscale.
    pub outputscale: f64,
}

/// The outcome of a fit for one class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// The likeliest hyperparameters found.
    pub hyperparameters: Hyperparameters,
    /// Their log marginal likelihood per training point fitted on.
    pub per_datum: f64,
    /// Likelihoods and gradients computed.
    pub evaluations: usize,
    /// Jitter that the covariance needed at these hyperparameters to be factorised, 0 as a rule.
    pub jitter: f64,
    /// Whether the search ended by its tolerances; if not, it ran out of iterations or got stuck.
    pub converged: bool,
    /// Whether the lengthscale or the outputscale ended at the edge of the range searched:
    /// lengthscales 1e-4 to 100 times the diagonal of the points' bounding box, outputscales 1e-4
    /// to 1e4.
    pub at_bound: bool,
}

/// Fits one class.
///
/// L-BFGS on the logarithms of lengthscale and outputscale, each squeezed into its range by a
/// logistic function, so that no step can leave it. The constant mean is profiled out: it enters
/// the likelihood as a quadratic, whose maximum is known.
pub(crate) fn fit_class(
    smoothness: Smoothness,
    points: &Points,
    targets: &Targets,
    class: usize,
    config: &FitConfig,
) -> Result<Fit, GpError> {
    let extent = match points.extent() {
        // All points in one place: their likelihood does not depend on the lengthscale.
        0.0 => 1.0,
        extent => extent,
    };
    let objective = Objective {
        smoothness,
        points,
        targets,
        class,
        ranges: [
            LogRange::new(LENGTHSCALE_RANGE, extent),
            LogRange::new(OUTPUTSCALE_RANGE, 1.0),
        ],
        trace: RefCell::new(Trace {
            storage: Some(Storage::new(points.len())),
            last: None,
            best: None,
            evaluations: 0,
        }),
        budget: usize::try_from(config.max_iterations)
            .unwrap_or(usize::MAX)
            .saturating_mul(EVALUATIONS_PER_ITERATION)
            .saturating_add(STARTS.len()),
    };

    let starts = match config.start {
        Some(start) => vec![start],
        None => STARTS
            .map(|share| Start {
                lengthscale: share * extent,
                outputscale: variance(&targets.target),
            })
            .to_vec(),
    };
    for start in starts {
        objective.evaluate(&objective.coordinates(start))?;
    }
    let mut converged = false;
    for _ in 0..RUNS {
        let before = objective.best()?.cost;
        converged = objective.search(config)?;
        if converged || objective.best()?.cost >= before {
            break;
        }
    }
    objective.outcome(converged)
}

fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

/// A range of a positive number, searched on a logarithmic scale.
#[derive(Debug, Clone, Copy)]
struct LogRange {
    low: f64,
    width: f64,
}

impl LogRange {
    fn new((low, high): (f64, f64), unit: f64) -> Self {
        Self {
            low: low.ln() + unit.ln(),
            width: (high / low).ln(),
        }
    }

    /// The number at search coordinate `u`, and its derivative by `u` relative to itself.
    fn value(&self, u: f64) -> (f64, f64) {
        let share = 1.0 / (1.0 + (-u).exp());
        let value = (self.low + self.width * share).exp();
        (value, self.width * share * (1.0 - share))
    }

    /// The search coordinate of `value`, which is moved inside the range if it lies outside.
    fn coordinate(&self, value: f64) -> f64 {
        let share = ((value.ln() - self.low) / self.width).clamp(1e-4, 1.0 - 1e-4);
        (share / (1.0 - share)).ln()
    }

    fn is_at_edge(&self, value: f64) -> bool {
        let share = (value.ln() - self.low) / self.width;
        !(1e-3..=1.0 - 1e-3).contains(&share)
    }
}

/// Negative log likelihood per datum over the search coordinates of lengthscale and outputscale.
struct Objective<'a> {
    smoothness: Smoothness,
    points: &'a Points,
    targets: &'a Targets,
    class: usize,
    ranges: [LogRange; 2],
    trace: RefCell<Trace>,
    budget: usize,
}

/// What the search has seen. The solver asks for cost and gradient apart, but both come out of one
/// factorisation, hence `last`; and it may end on a worse point than it has passed, hence `best`.
struct Trace {
    storage: Option<Storage>,
    last: Option<Seen>,
    best: Option<Seen>,
    evaluations: usize,
}

#[derive(Debug, Clone)]
struct Seen {
    coordinates: Vec<f64>,
    cost: f64,
    gradient: Vec<f64>,
    hyperparameters: Hyperparameters,
    jitter: f64,
}

impl Objective<'_> {
    fn coordinates(&self, start: Start) -> Vec<f64> {
        let [lengthscale, outputscale] = self.ranges;
        vec![
            lengthscale.coordinate(start.lengthscale),
            outputscale.coordinate(start.outputscale),
        ]
    }

    fn evaluate(&self, coordinates: &[f64]) -> Result<Seen, GpError> {
        let mut trace = self.trace.borrow_mut();
        if let Some(last) = trace.last.as_ref().filter(|l| l.coordinates == coordinates) {
            return Ok(last.clone());
        }
        let (lengthscale, lengthscale_slope) = self.ranges[0].value(coordinates[0]);
        let (outputscale, outputscale_slope) = self.ranges[1].value(coordinates[1]);
        let kernel = Matern {
            smoothness: self.smoothness,
            lengthscale,
            outputscale,
        };
        let storage = trace
            .storage
            .take()
            .unwrap_or_else(|| Storage::new(self.points.len()));
        let evaluation = evaluate(
            storage,
            &kernel,
            self.points,
            self.targets,
            Mean::BestFit,
            self.class,
        )?;
        let gradient = evaluation.likelihood.gradient;
        let seen = Seen {
            coordinates: coordinates.to_vec(),
            cost: -evaluation.likelihood.per_datum,
            gradient: vec![
                -gradient.lengthscale * lengthscale * lengthscale_slope,
                -gradient.outputscale * outputscale * outputscale_slope,
            ],
            hyperparameters: Hyperparameters {
                lengthscale,
                outputscale,
                mean: evaluation.mean,
            },
            jitter: evaluation.jitter,
        };
        if !(seen.cost.is_finite() && seen.gradient.iter().all(|g| g.is_finite())) {
            return Err(seen.hyperparameters.overflow("the likelihood", self.class));
        }
        trace.storage = Some(evaluation.storage);
        trace.evaluations += 1;
        if trace.best.as_ref().is_none_or(|best| seen.cost < best.cost) {
            trace.best = Some(seen.clone());
        }
        trace.last = Some(seen.clone());
        Ok(seen)
    }

    fn best(&self) -> Result<Seen, GpError> {
        match &self.trace.borrow().best {
            Some(best) => Ok(best.clone()),
            None => Err(GpError::NoTrainingPoints),
        }
    }

    /// One run from the best point seen; whether it ended by its tolerances.
    ///
    /// The solver's own failures (a line search without progress, the budget) only end the run, as
    /// the best point seen stands; `Err` is left to settings that the solver refuses.
    fn search(&self, config: &FitConfig) -> Result<bool, GpError> {
        let refused = |_: Error| GpError::Setting {
            name: "gradient_tolerance",
            value: config.gradient_tolerance,
            range: "finite and not negative",
        };
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY)
            .with_tolerance_grad(config.gradient_tolerance)
            .and_then(|solver| solver.with_tolerance_cost(1e-12))
            .map_err(refused)?;
        let start = self.best()?.coordinates;
        let result = Executor::new(self, solver)
            .configure(|state| state.param(start).max_iters(config.max_iterations))
            .ctrlc(false)
            .timer(false)
            .run();
        let ended_by_tolerance = result.is_ok_and(|result| {
            result.state().get_termination_reason() == Some(&TerminationReason::SolverConverged)
        });
        let gradient = self.best()?.gradient;
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        Ok(ended_by_tolerance || norm < config.gradient_tolerance)
    }

    fn outcome(&self, converged: bool) -> Result<Fit, GpError> {
        let best = self.best()?;
        let Hyperparameters {
            lengthscale,
            outputscale,
            ..
        } = best.hyperparameters;
        Ok(Fit {
            hyperparameters: best.hyperparameters,
            per_datum: -best.cost,
            evaluations: self.trace.borrow().evaluations,
            jitter: best.jitter,
            converged,
            at_bound: self.ranges[0].is_at_edge(lengthscale)
                || self.ranges[1].is_at_edge(outputscale),
        })
    }

    fn within_budget(&self) -> Result<(), Error> {
        let spent = self.trace.borrow().evaluations;
        if spent < self.budget {
            Ok(())
        } else {
            Err(Error::msg(format!("gave up after {spent} likelihoods")))
        }
    }
}

impl CostFunction for &Objective<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, param: &Self::Param) -> Result<f64, Error> {
        self.within_budget()?;
        Ok(self.evaluate(param)?.cost)
    }
}

impl ArgminGradient for &Objective<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, param: &Self::Param) -> Result<Vec<f64>, Error> {
        self.within_budget()?;
        Ok(self.evaluate(param)?.gradient)
    }
}
