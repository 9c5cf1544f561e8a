//! Connection and queue of MQTT as metrics.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;

use crate::publish::mqtt::ConnectionCounts;

/// Reader of the counts, at each request.
pub(super) struct BrokerMetrics(Box<dyn Fn() -> ConnectionCounts + Send + Sync>);

impl BrokerMetrics {
    pub(super) fn new(read: impl Fn() -> ConnectionCounts + Send + Sync + 'static) -> Self {
        Self(Box::new(read))
    }
}

impl fmt::Debug for BrokerMetrics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("BrokerMetrics").finish_non_exhaustive()
    }
}

impl Collector for BrokerMetrics {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> Result<(), fmt::Error> {
        let ConnectionCounts { is_connected, delivery, skipped } = (self.0)();
        let mut write =
            |name: &str, help: &str, metric: &dyn WriteMetric| metric.write(&mut encoder, name, help);
        write(
            "mqtt_connected",
            "1 while there is a connection to the broker",
            &ConstGauge::new(i64::from(is_connected)),
        )?;
        let help = "Events that wait for the broker or its acknowledgement";
        write("mqtt_waiting", help, &ConstGauge::new(delivery.waiting as i64))?;
        let help = "Events that the broker has acknowledged";
        write("mqtt_acknowledged", help, &ConstCounter::new(delivery.acknowledged))?;
        let help = "Events that were dropped because too many were waiting";
        write("mqtt_dropped", help, &ConstCounter::new(delivery.dropped))?;
        let help = "Messages of people that were not sent because the connection was absent or busy";
        write("mqtt_skipped", help, &ConstCounter::new(skipped))
    }
}

/// A metric of any type, with its description.
trait WriteMetric {
    fn write(&self, encoder: &mut DescriptorEncoder<'_>, name: &str, help: &str) -> Result<(), fmt::Error>;
}

impl<M: EncodeMetric> WriteMetric for M {
    fn write(&self, encoder: &mut DescriptorEncoder<'_>, name: &str, help: &str) -> Result<(), fmt::Error> {
        self.encode(encoder.encode_descriptor(name, help, None, self.metric_type())?)
    }
}
