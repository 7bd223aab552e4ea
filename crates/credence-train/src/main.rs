//! Trains Credence's networks.

use std::{
    io::{self, Write as _},
    process::ExitCode,
};

use clap::Parser as _;
use credence_train::cli::Cli;

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _unread = writeln!(io::stderr(), "credence-train: {error}");
            ExitCode::from(2)
        }
    }
}
