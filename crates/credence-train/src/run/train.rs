use std::{collections::BTreeMap, fs, path::PathBuf, sync::mpsc, thread};

use burn::{
    grad_clipping::GradientClippingConfig,
    module::Module,
    optim::{AdamWConfig, GradientsParams, ModuleOptimizer},
    tensor::Tensor,
};

use super::{Schedule, checkpoint, log::Log, progress::Progress};
use crate::TrainError;

/// Batches that are prepared ahead of the step they are for.
const AHEAD: usize = 2;

/// Figures on the validation data, by name.
pub type Figures = BTreeMap<String, f64>;

/// What is trained, and on what.
pub trait Task: Sync {
    /// The network.
    type Network: Module;
    /// A step's data, on the host.
    type Batch: Send;

    /// Names of the parts of the loss, as they stand in the log.
    fn parts(&self) -> &'static [&'static str];

    /// The data of a step, a function of its number alone; runs on another thread.
    ///
    /// # Errors
    /// Data that cannot be read.
    fn prepare(&self, step: u64) -> Result<Self::Batch, TrainError>;

    /// The loss of a batch at a step, and its parts.
    ///
    /// # Errors
    /// A batch that the network refuses.
    fn loss(
        &self,
        network: &Self::Network,
        batch: Self::Batch,
        step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError>;

    /// Names of the figures, as they stand in the log.
    fn figures(&self) -> Vec<String>;

    /// Figures on the validation data, of a network that records no gradients.
    ///
    /// # Errors
    /// Data that cannot be read.
    fn validate(&self, network: &Self::Network) -> Result<Figures, TrainError>;
}

/// How to train.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Learning rate and number of steps.
    pub schedule: Schedule,
    /// Of `AdamW`.
    pub weight_decay: f32,
    /// Largest norm of a parameter's gradient.
    pub clip: f32,
    /// Steps that a row of the log is the mean of; divides `checkpoint_every`.
    pub log_every: u64,
    /// Steps between checkpoints.
    pub checkpoint_every: u64,
    /// Steps between validations.
    pub validate_every: u64,
    /// Where checkpoints and logs are kept.
    pub folder: PathBuf,
    /// Names the run: one with another name does not resume from these checkpoints.
    pub run: String,
}

/// A trained network.
#[derive(Debug)]
pub struct Outcome<N> {
    /// The network, recording no gradients.
    pub network: N,
    /// Its figures on the validation data.
    pub figures: Figures,
    /// The log of the losses.
    pub loss_curve: PathBuf,
}

/// Trains a network, from the newest checkpoint in the plan's folder if there is one.
///
/// # Errors
/// A folder that cannot be written or holds another run's checkpoints, data that cannot be read,
/// or a loss that is not finite.
pub fn train<T: Task>(
    task: &T,
    network: T::Network,
    plan: &Plan,
) -> Result<Outcome<T::Network>, TrainError> {
    fs::create_dir_all(&plan.folder).map_err(|source| TrainError::Write {
        path: plan.folder.clone(),
        source,
    })?;
    let optimizer = AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(plan.weight_decay)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(plan.clip)))
        .init();
    let (done, network, optimizer) =
        checkpoint::resume(&plan.folder, &plan.run, network, optimizer)?;
    if done > 0 {
        super::note(&format!("resuming after step {done}"));
    }
    let mut columns = vec!["lr", "loss"];
    columns.extend(task.parts());
    let names = task.figures();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut state = State {
        task,
        plan,
        network,
        optimizer,
        sums: vec![0.0; columns.len() - 1],
        losses: Log::resume(plan.folder.join("loss.csv"), &columns, done)?,
        times: Log::resume(plan.folder.join("seconds.csv"), &["seconds"], done)?,
        figures: Log::resume(plan.folder.join("validation.csv"), &names, done)?,
        progress: Progress::new(done, plan.schedule.steps),
    };
    thread::scope(|scope| {
        let (send, receive) = mpsc::sync_channel(AHEAD);
        scope.spawn(move || {
            for step in done + 1..=plan.schedule.steps {
                // The other end is gone when a step has failed.
                if send.send(task.prepare(step)).is_err() {
                    break;
                }
            }
        });
        for (step, batch) in (done + 1..).zip(receive) {
            state.step(step, batch?)?;
        }
        Ok::<(), TrainError>(())
    })?;
    let network = state.network.valid();
    Ok(Outcome {
        figures: task.validate(&network)?,
        network,
        loss_curve: state.losses.path().to_path_buf(),
    })
}

/// A run under way.
struct State<'a, T: Task> {
    task: &'a T,
    plan: &'a Plan,
    network: T::Network,
    optimizer: ModuleOptimizer,
    /// Of the loss and its parts since the last row of the log.
    sums: Vec<f64>,
    losses: Log,
    times: Log,
    figures: Log,
    progress: Progress,
}

impl<T: Task> State<'_, T> {
    fn step(&mut self, step: u64, batch: T::Batch) -> Result<(), TrainError> {
        let plan = self.plan;
        let (loss, parts) = self.task.loss(&self.network, batch, step)?;
        let all = [loss.clone()].into_iter().chain(parts);
        let values: Vec<f64> = all.map(|t| f64::from(t.into_scalar::<f32>())).collect();
        if values.iter().any(|value| !value.is_finite()) {
            return Err(TrainError::Diverged { step });
        }
        for (sum, value) in self.sums.iter_mut().zip(&values) {
            *sum += value;
        }
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        let rate = plan.schedule.rate(step);
        let network = self.network.clone();
        self.network = self.optimizer.step(rate, network, gradients);
        self.progress.show(step, values[0]);
        let last = step == plan.schedule.steps;
        if step.is_multiple_of(plan.log_every) || last {
            let count = match step % plan.log_every {
                0 => plan.log_every,
                rest => rest,
            };
            let mut row = vec![rate];
            row.extend(self.sums.iter().map(|sum| sum / count as f64));
            self.losses.add(step, &row)?;
            self.times.add(step, &[self.progress.lap_s()])?;
            self.sums.fill(0.0);
        }
        if step.is_multiple_of(plan.validate_every) && !last {
            let figures = self.task.validate(&self.network.valid())?;
            let names = self.task.figures();
            let figure = |name: &String| figures.get(name).copied().unwrap_or(f64::NAN);
            let row: Vec<f64> = names.iter().map(figure).collect();
            self.figures.add(step, &row)?;
        }
        if step.is_multiple_of(plan.checkpoint_every) || last {
            checkpoint::save(
                &plan.folder,
                &plan.run,
                step,
                &self.network,
                &self.optimizer,
            )?;
        }
        Ok(())
    }
}
