//! The moving-direction constraint (section 5 of the paper, equation 1): a track that comes to a detection over link *l* may go
//! on over link *m* only where the velocities of the two differ by no more than a threshold.

/// Which link may follow which: velocities of the links, in the detections' units per frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Directions {
    /// Of each link of the graph.
    pub velocities: Vec<[f64; 2]>,
    /// Greatest difference of two links' velocities that a track may have at a detection.
    pub threshold: f64,
}

impl Directions {
    /// Whether a track may come over one link and go on over another.
    pub fn allow(&self, come: usize, go: usize) -> bool {
        let (a, b) = (self.velocities[come], self.velocities[go]);
        (b[0] - a[0]).hypot(b[1] - a[1]) <= self.threshold
    }
}
