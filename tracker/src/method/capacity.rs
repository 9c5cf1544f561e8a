//! How many people a tracker follows at once: who comes beyond that is not found, and that is said.

/// The most people at one time.
#[derive(Debug, Clone)]
pub(super) struct Capacity {
    most: usize,
    is_told: bool,
}

impl Capacity {
    /// Of so many people.
    pub(super) fn new(most: usize) -> Self {
        Self { most, is_told: false }
    }

    /// Whether there is room for another beside so many.
    pub(super) fn has_room(&self, people: usize) -> bool {
        people < self.most
    }

    /// Takes in how many are followed now: that no more are, the log says once.
    pub(super) fn note(&mut self, people: usize) {
        if !self.has_room(people) && !self.is_told {
            self.is_told = true;
            tracing::warn!(
                "{people} people are followed, and no more are found until somebody leaves; --most-people N takes more"
            );
        }
    }
}
