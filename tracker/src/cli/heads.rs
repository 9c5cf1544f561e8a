//! The options of the head filters.

use clap::Args;
use tracker::method::condensation::CondensationOptions;
use tracker::method::condensation::integration::Integration;

/// The filters as the user asks for them.
#[derive(Debug, Args)]
#[command(next_help_heading = "Heads (--method condensation)")]
pub(super) struct HeadArguments {
    /// Hypotheses a person.
    #[arg(long, value_name = "N")]
    hypotheses: Option<usize>,
    /// How often a moment's hypotheses are drawn again around the best.
    #[arg(long, value_name = "N")]
    layers: Option<usize>,
    /// How the cameras' weights become one: product, sum, pairs, pairs-angle, or room (the product over the cameras
    /// that the room's geometry leaves a view of the head).
    #[arg(long, value_name = "NAME")]
    integration: Option<Integration>,
    /// Use all edges, also those of the empty scene.
    #[arg(long)]
    all_edges: bool,
}

impl HeadArguments {
    /// The integration that was asked for.
    pub(super) fn integration(&self) -> Option<Integration> {
        self.integration
    }

    /// The filters' options.
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
