use std::{
    io::{self, IsTerminal as _, Write as _},
    time::{Duration, Instant},
};

/// Writes a line for the person at the terminal; that nobody can read it stops no training.
pub fn note(text: &str) {
    let _unread = writeln!(io::stderr(), "{text}");
}

/// A line on stderr: how far, how well, how long still.
pub(super) struct Progress {
    start: Instant,
    lap: Instant,
    first: u64,
    steps: u64,
    shown: Option<Instant>,
    terminal: bool,
}

impl Progress {
    pub(super) fn new(first: u64, steps: u64) -> Self {
        Self {
            start: Instant::now(),
            lap: Instant::now(),
            first,
            steps,
            shown: None,
            terminal: io::stderr().is_terminal(),
        }
    }

    /// Seconds since this was last asked, or since the run began or was resumed.
    pub(super) fn lap_s(&mut self) -> f64 {
        let seconds = self.lap.elapsed().as_secs_f64();
        self.lap = Instant::now();
        seconds
    }

    /// Shows a step: in place on a terminal, now and then a line elsewhere.
    pub(super) fn show(&mut self, step: u64, loss: f64) {
        let pause = Duration::from_millis(if self.terminal { 500 } else { 30_000 });
        let last = step == self.steps;
        if !last && self.shown.is_some_and(|at| at.elapsed() < pause) {
            return;
        }
        self.shown = Some(Instant::now());
        let per_step = self.start.elapsed().as_secs_f64() / (step - self.first).max(1) as f64;
        let left = (self.steps - step) as f64 * per_step;
        let line = format!(
            "step {step}/{}  loss {loss:.4}  {:.0} ms/step  {} left",
            self.steps,
            per_step * 1e3,
            clock(left)
        );
        if self.terminal && !last {
            let _unread = write!(io::stderr(), "\r\x1b[K{line}");
            let _unflushed = io::stderr().flush();
        } else if self.terminal {
            note(&format!("\r\x1b[K{line}"));
        } else {
            note(&line);
        }
    }
}

fn clock(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours}:{minutes:02}:{:02}", seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_written_as_a_clock() {
        assert_eq!(clock(59.6), "0:01:00");
        assert_eq!(clock(3723.0), "1:02:03");
    }
}
