//! Options of the head filters.

use clap::Args;

use crate::method::condensation::CondensationOptions;
use crate::method::condensation::integration::Integration;

/// Options of the head filters on the command line.
#[derive(Debug, Args)]
#[command(next_help_heading = "Heads (--method condensation)")]
pub(super) struct HeadArguments {
    /// Number of hypotheses a person.
    #[arg(long, value_name = "N")]
    hypotheses: Option<usize>,
    /// Number of times that a moment's hypotheses are weighed, each time closer around the best.
    #[arg(long, value_name = "N")]
    layers: Option<usize>,
    /// Integration of the cameras' weights: product, sum, pairs, pairs-angle, or room (the product over the cameras
    /// that see the head past the room's geometry).
    #[arg(long, value_name = "NAME")]
    integration: Option<Integration>,
    /// Use all edges, also those of the empty scene.
    #[arg(long)]
    all_edges: bool,
}

impl HeadArguments {
    /// The requested integration.
    pub(super) fn integration(&self) -> Option<Integration> {
        self.integration
    }

    /// Options of the filters.
    pub(super) fn options(&self, seed: u64, published: bool) -> anyhow::Result<CondensationOptions> {
        let mut options =
            if published { CondensationOptions::published() } else { CondensationOptions::default() };
        options.seed = seed;
        options.hypotheses = self.hypotheses.unwrap_or(options.hypotheses);
        options.layers = self.layers.unwrap_or(options.layers);
        options.integration = self.integration.unwrap_or(options.integration);
        options.edges.moving_only &= !self.all_edges;
        options.validate()?;
        Ok(options)
    }
}
