//! Computing times of the steps, split as in the paper's table 2.

use std::time::{Duration, Instant};

/// Time of each step, summed over all moments so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepTimes {
    /// Sobel gradients of all cameras ("画像処理" without the weights), wall time.
    pub edges: StepTimer,
    /// Resampling and prediction of hypotheses.
    pub hypotheses: StepTimer,
    /// Weights in each camera: contours and sums.
    pub weights: StepTimer,
    /// Integration of the cameras' weights, and exclusion.
    pub integration: StepTimer,
    /// Search for new people at the gates, as a whole.
    pub gates: StepTimer,
}

/// A stopwatch that accumulates.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepTimer {
    total: Duration,
    started: Option<Instant>,
}

impl StepTimer {
    /// Starts it.
    pub fn start(&mut self) {
        self.started = Some(Instant::now());
    }

    /// Stops it.
    pub fn stop(&mut self) {
        if let Some(started) = self.started.take() {
            self.total += started.elapsed();
        }
    }

    /// Total time between starts and stops, seconds.
    pub fn total_s(&self) -> f64 {
        self.total.as_secs_f64()
    }
}
