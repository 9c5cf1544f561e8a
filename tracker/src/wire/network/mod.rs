//! The two ends in the network: [`Uplink`] and [`Downlink`] over Zenoh.

mod downlink;
pub(super) mod session;
#[cfg(test)]
mod tests;
mod uplink;

pub use self::downlink::Downlink;
pub use self::uplink::Uplink;
