use burn::tensor::Device;
use clap::Args;
use credence_embed::query::{QueryNetwork, Widths};
use credence_nn::seed_parameters;
use credence_types::stream;

use super::QueryTask;
use crate::{TrainError, command::RunArgs, run::train};

/// What to train the query embedding on, and where to put it.
#[derive(Debug, Clone, Args)]
pub struct QueryArgs {
    /// The run.
    #[command(flatten)]
    pub run: RunArgs,
    /// Optimiser steps; more is better, slowly: 10,000 take about half an hour on two cores [default:
    /// 10000; 40 with --quick]
    #[arg(long)]
    pub steps: Option<u64>,
}

impl QueryArgs {
    /// Trains and writes the weights.
    ///
    /// # Errors
    /// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        let args = &self.run;
        let run = args.begin("query", self.steps.unwrap_or(args.pick(10_000, 40)))?;
        let device = Device::flex().autodiff();
        let task = QueryTask {
            scenes: run.training()?,
            validation: run.validation()?,
            seed: args.seed,
            observations: args.pick(24, 4) as usize,
            queries: 256,
            device: device.clone(),
        };
        let network = QueryNetwork::new(Widths::default(), &device);
        let network = seed_parameters(network, &mut stream(args.seed, "train/query/weights"));
        let outcome = train(&task, network, &run.plan(1000))?;
        run.finish(outcome, &task.validation)
    }
}
