//! Where the time of a moment goes, split as in the paper's table 2.

use std::time::{Duration, Instant};

/// Time by step, summed over all moments so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spent {
    /// Sobel gradients of all cameras ("画像処理" without the weights), wall time.
    pub edges: Watch,
    /// Drawing and moving hypotheses.
    pub hypotheses: Watch,
    /// Each camera's weights: contours and sums.
    pub weights: Watch,
    /// From weights of cameras to weights in space, and keeping people apart.
    pub integration: Watch,
    /// Looking for new people at the gates, all of it.
    pub gates: Watch,
}

/// A watch that adds up.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watch {
    total: Duration,
    started: Option<Instant>,
}

impl Watch {
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

    /// All time between starts and stops, seconds.
    pub fn total_s(&self) -> f64 {
        self.total.as_secs_f64()
    }
}
