//! The moving-direction constraint (section 5 of the paper, equation 1): a track that enters a detection over link *l*
//! may leave it over link *m* only where the velocities of the two differ by no more than a threshold.

/// Velocities of the links and the threshold on their difference, in the detections' units per frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Directions {
    /// Velocity of each link of the graph.
    pub velocities: Vec<[f64; 2]>,
    /// Largest difference of a track's two velocities at a detection.
    pub threshold: f64,
}

impl Directions {
    /// Whether a track may enter over one link and leave over another.
    pub fn allow(&self, come: usize, go: usize) -> bool {
        let (a, b) = (self.velocities[come], self.velocities[go]);
        (b[0] - a[0]).hypot(b[1] - a[1]) <= self.threshold
    }
}
