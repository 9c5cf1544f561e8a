//! Limit on the number of people that a tracker follows at once; reaching it is logged.

/// Maximum number of people at one time.
#[derive(Debug, Clone)]
pub(super) struct Capacity {
    most: usize,
    is_logged: bool,
}

impl Capacity {
    /// Creates a limit of `most` people.
    pub(super) fn new(most: usize) -> Self {
        Self { most, is_logged: false }
    }

    /// Whether a track can be added to `people` existing ones.
    pub(super) fn has_room(&self, people: usize) -> bool {
        people < self.most
    }

    /// Records the number of tracked people, and logs once that the limit is reached.
    pub(super) fn note(&mut self, people: usize) {
        if !self.has_room(people) && !self.is_logged {
            self.is_logged = true;
            tracing::warn!(
                "{people} people are tracked, the limit: new people are ignored until one leaves; --most-people N raises it"
            );
        }
    }
}
