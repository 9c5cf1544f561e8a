//! Messages that the broker has to acknowledge, in their order, until it has done so.

use std::collections::{BTreeMap, HashMap, VecDeque};

/// Largest number of unacknowledged messages of one connection: brokers allow 20 or more.
const WINDOW: usize = 20;

/// A message with its topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Message {
    pub(super) topic: String,
    pub(super) payload: Vec<u8>,
    /// Whether the broker keeps it for later subscribers.
    pub(super) is_retained: bool,
}

/// Name of a message within the queue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ticket {
    /// Event with this number.
    Event(u64),
    /// Value number `.1` of a retained topic.
    Retained(String, u64),
}

/// Latest value of a retained topic.
#[derive(Debug)]
struct Retained {
    payload: Vec<u8>,
    /// Number of the value.
    version: u64,
    /// Number of the value that the present connection was given; 0 for none.
    handed: u64,
    /// Number of the value that the present connection's broker has acknowledged; 0 for none.
    acknowledged: u64,
}

/// Numbers of events since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeliveryCounts {
    /// Events that were put in.
    pub events: u64,
    /// Events that the broker has acknowledged.
    pub acknowledged: u64,
    /// Events that were dropped because too many were waiting.
    pub dropped: u64,
    /// Events that wait for the broker or its acknowledgement now.
    pub waiting: u64,
}

/// The queue. It knows no network: a connection takes messages by [`Queue::next`], and reports what became of them.
#[derive(Debug)]
pub(super) struct Queue {
    most_events: usize,
    /// Events that are not acknowledged, by their numbers.
    events: BTreeMap<u64, Message>,
    next_number: u64,
    /// Number of the first event that the present connection has not been given.
    next_handed: u64,
    retained: BTreeMap<String, Retained>,
    /// Messages that the connection has been given and that have no packet identifier yet, in their order.
    handed: VecDeque<Ticket>,
    in_flight: HashMap<u16, Ticket>,
    acknowledged: u64,
    dropped: u64,
}

impl Queue {
    /// Queue that keeps at most so many events.
    pub(super) fn new(most_events: usize) -> Self {
        Self {
            most_events: most_events.max(1),
            events: BTreeMap::new(),
            next_number: 0,
            next_handed: 0,
            retained: BTreeMap::new(),
            handed: VecDeque::new(),
            in_flight: HashMap::new(),
            acknowledged: 0,
            dropped: 0,
        }
    }

    /// Adds an event. Returns whether an older one was dropped for it.
    pub(super) fn push(&mut self, topic: String, payload: Vec<u8>) -> bool {
        let is_full = self.events.len() >= self.most_events;
        if is_full {
            // Rather one that was not given to the connection: the others may arrive.
            let waiting = self.events.range(self.next_handed..).next().map(|(number, _)| *number);
            let oldest = waiting.or_else(|| self.events.keys().next().copied());
            if oldest.and_then(|number| self.events.remove(&number)).is_some() {
                self.dropped += 1;
            }
        }
        self.events.insert(self.next_number, Message { topic, payload, is_retained: false });
        self.next_number += 1;
        is_full
    }

    /// Sets the value of a retained topic. Only the latest value is sent.
    pub(super) fn retain(&mut self, topic: String, payload: Vec<u8>) {
        let entry = self.retained.entry(topic).or_insert(Retained {
            payload: Vec::new(),
            version: 0,
            handed: 0,
            acknowledged: 0,
        });
        if entry.version == 0 || entry.payload != payload {
            entry.payload = payload;
            entry.version += 1;
        }
    }

    /// Begins a connection: everything that is not acknowledged is sent again, and all retained values, since a broker
    /// that was started anew may have lost them.
    pub(super) fn begin(&mut self) {
        self.handed.clear();
        self.in_flight.clear();
        self.next_handed = 0;
        for retained in self.retained.values_mut() {
            (retained.handed, retained.acknowledged) = (0, 0);
        }
    }

    /// Next message for the connection, unless too many are unacknowledged. Retained values come first.
    pub(super) fn next(&self) -> Option<(Ticket, Message)> {
        if self.handed.len() + self.in_flight.len() >= WINDOW {
            return None;
        }
        let retained = self.retained.iter().find(|(_, value)| value.handed < value.version);
        if let Some((topic, value)) = retained {
            let ticket = Ticket::Retained(topic.clone(), value.version);
            let message = Message { topic: topic.clone(), payload: value.payload.clone(), is_retained: true };
            return Some((ticket, message));
        }
        let (number, message) = self.events.range(self.next_handed..).next()?;
        Some((Ticket::Event(*number), message.clone()))
    }

    /// Records that the connection has been given a message.
    pub(super) fn set_handed(&mut self, ticket: Ticket) {
        match &ticket {
            Ticket::Event(number) => self.next_handed = number + 1,
            Ticket::Retained(topic, version) => {
                if let Some(value) = self.retained.get_mut(topic) {
                    value.handed = *version;
                }
            }
        }
        self.handed.push_back(ticket);
    }

    /// Records the packet identifier of the oldest message that has none.
    pub(super) fn set_sent(&mut self, packet: u16) {
        if let Some(ticket) = self.handed.pop_front() {
            self.in_flight.insert(packet, ticket);
        }
    }

    /// Records an acknowledgement.
    pub(super) fn acknowledge(&mut self, packet: u16) {
        match self.in_flight.remove(&packet) {
            Some(Ticket::Event(number)) if self.events.remove(&number).is_some() => self.acknowledged += 1,
            Some(Ticket::Retained(topic, version)) => {
                if let Some(value) = self.retained.get_mut(&topic) {
                    value.acknowledged = value.acknowledged.max(version);
                }
            }
            Some(Ticket::Event(_)) | None => {}
        }
    }

    /// Whether the broker has acknowledged all events and the latest value of each retained topic.
    pub(super) fn is_delivered(&self) -> bool {
        self.events.is_empty() && self.retained.values().all(|value| value.acknowledged == value.version)
    }

    pub(super) fn counts(&self) -> DeliveryCounts {
        DeliveryCounts {
            events: self.next_number,
            acknowledged: self.acknowledged,
            dropped: self.dropped,
            waiting: self.events.len() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A broker and the connection to it, which may break at any time.
    #[derive(Default)]
    struct Broker {
        received: Vec<Vec<u8>>,
        retained: BTreeMap<String, Vec<u8>>,
        /// Packets that were received and not acknowledged.
        open: VecDeque<u16>,
        last_packet: u16,
    }

    impl Broker {
        fn take(&mut self, queue: &mut Queue) {
            let Some((ticket, message)) = queue.next() else { return };
            queue.set_handed(ticket);
            self.last_packet += 1;
            queue.set_sent(self.last_packet);
            self.open.push_back(self.last_packet);
            if message.is_retained {
                self.retained.insert(message.topic, message.payload);
            } else {
                self.received.push(message.payload);
            }
        }

        fn acknowledge(&mut self, queue: &mut Queue) {
            if let Some(packet) = self.open.pop_front() {
                queue.acknowledge(packet);
            }
        }
    }

    fn number(payload: &[u8]) -> u32 {
        String::from_utf8_lossy(payload).parse().unwrap()
    }

    proptest! {
        /// Whatever breaks and whenever, every event arrives at least once, for the first time in its order, and the
        /// broker ends with the latest retained values.
        #[test]
        fn every_event_arrives(steps in prop::collection::vec(0..10_u8, 1..400)) {
            let (mut queue, mut broker, mut events, mut latest) = (Queue::new(1000), Broker::default(), 0_u32, None);
            for step in steps {
                match step {
                    0..=2 => {
                        prop_assert!(!queue.push("event".into(), events.to_string().into_bytes()));
                        events += 1;
                    }
                    3 => {
                        latest = Some(events.to_string().into_bytes());
                        queue.retain("count".into(), events.to_string().into_bytes());
                    }
                    4..=6 => broker.take(&mut queue),
                    7 | 8 => broker.acknowledge(&mut queue),
                    _ => {
                        queue.begin();
                        broker.open.clear();
                        broker.retained.clear();
                    }
                }
                prop_assert!(broker.open.len() <= WINDOW);
            }
            while !queue.is_delivered() {
                broker.take(&mut queue);
                broker.acknowledge(&mut queue);
            }
            let mut first = Vec::new();
            for event in broker.received.iter().map(|payload| number(payload)) {
                if !first.contains(&event) {
                    first.push(event);
                }
            }
            prop_assert_eq!(first, (0..events).collect::<Vec<_>>());
            prop_assert_eq!(broker.retained.get("count").cloned(), latest);
            let counts = queue.counts();
            prop_assert_eq!((counts.acknowledged, counts.waiting, counts.dropped), (u64::from(events), 0, 0));
        }
    }

    #[test]
    fn a_full_queue_drops_the_oldest_that_waits() {
        let (mut queue, mut broker) = (Queue::new(3), Broker::default());
        let dropped: Vec<bool> = (0..3).map(|i| queue.push("event".into(), vec![b'0' + i])).collect();
        assert_eq!(dropped, [false; 3]);
        // The first is on its way and may still arrive.
        broker.take(&mut queue);
        assert!(queue.push("event".into(), b"3".to_vec()));
        while !queue.is_delivered() {
            broker.take(&mut queue);
            broker.acknowledge(&mut queue);
        }
        assert_eq!(broker.received, [b"0", b"2", b"3"].map(|p| p.to_vec()));
        let expected = DeliveryCounts { events: 4, acknowledged: 3, dropped: 1, waiting: 0 };
        assert_eq!(queue.counts(), expected);
    }
}
