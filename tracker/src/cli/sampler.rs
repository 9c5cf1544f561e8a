//! Options of the MCMC sampler.

use anyhow::bail;
use clap::{Args, ValueEnum};
use shell::ranges::shown;

use crate::likelihood::LikelihoodRule;
use crate::method::mcmc::{Acceptance, McmcOptions};

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LikelihoodName {
    /// The published overlap ratio, to a power.
    Overlap,
    /// A foreground probability for every pixel.
    Bernoulli,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum AcceptanceName {
    /// min(1, `L_new` / `L_old`).
    Published,
    /// The posterior ratio times the proposal ratio.
    ReversibleJump,
}

/// Largest useful lag, seconds: later observations add nothing, and ids that people exchanged are found within this time.
const MOST_LAG_S: f64 = 20.0;

/// Largest number of steps: more would make a frame take too long.
const MOST_STEPS: u32 = 1_000_000;

/// Largest power of the overlap ratio: beyond, every weight is 0.
const MOST_POWER: f64 = 10_000.0;

/// Options of the sampler on the command line.
#[derive(Debug, Args)]
#[command(next_help_heading = "Sampler (--method mcmc)")]
pub(super) struct SamplerArguments {
    /// Steps a frame, half of them burn-in; more when there are more than three people.
    #[arg(long, value_name = "N")]
    steps: Option<u32>,
    /// Comparison of the masks.
    #[arg(long, value_enum, value_name = "NAME")]
    likelihood: Option<LikelihoodName>,
    /// Power of the overlap ratio (published: 1, which hardly discriminates; 40 to 100 do).
    #[arg(long, value_name = "POWER")]
    overlap_power: Option<f64>,
    /// Acceptance of a proposal.
    #[arg(long, value_enum, value_name = "NAME")]
    acceptance: Option<AcceptanceName>,
    /// People may sit down and crouch: by masks, a person is followed in each posture, and `height` tells it. Off by
    /// default, because of two people who come in as one, fewer are told apart
    #[arg(long)]
    postures: bool,
    /// Lag of the output, seconds: estimates are smoothed by the observations of that time, which also decide who had
    /// just come in. 0 writes at once [default: 0.4 for recordings, of boxes alone 10, 0 for streams]
    #[arg(long, value_name = "SECONDS")]
    pub(super) lag: Option<f64>,
    /// The method as published (any --method); its other options still change it. For the sampler that is likelihood,
    /// acceptance, number of steps, births in zones alone and prediction. Points that its paper leaves open stay:
    /// identities (a deleted person may come back with the same id), step lengths, the confirmation of tracks, and the
    /// update of position and velocity by the mean of a person's states (as a measurement with its covariance)
    #[arg(long)]
    pub(super) published: bool,
}

impl SamplerArguments {
    /// Options of the sampler as the tracking method.
    pub(super) fn options(&self, seed: u64) -> anyhow::Result<McmcOptions> {
        self.changed(if self.published { McmcOptions::published() } else { McmcOptions::default() }, seed)
    }

    /// Options of the sampler for a detector's boxes alone.
    pub(super) fn of_boxes(&self, seed: u64) -> anyhow::Result<McmcOptions> {
        if self.postures {
            bail!("--postures: boxes alone tell no posture; add --video or --masks, or leave it out");
        }
        self.changed(if self.published { McmcOptions::published() } else { McmcOptions::of_boxes() }, seed)
    }

    /// Options of the sampler as the image tracking of agents, for either of their rules.
    pub(super) fn image_tracking(&self, seed: u64) -> anyhow::Result<McmcOptions> {
        self.changed(McmcOptions::default(), seed)
    }

    fn changed(&self, mut options: McmcOptions, seed: u64) -> anyhow::Result<McmcOptions> {
        options.seed = seed;
        if let Some(steps) = self.steps {
            if !(2..=MOST_STEPS).contains(&steps) {
                bail!("--steps {steps}: give 2 to {MOST_STEPS}");
            }
            options.burn_in_steps = steps / 2;
            options.kept_steps = steps - steps / 2;
        }
        match self.likelihood {
            Some(LikelihoodName::Overlap) => options.likelihood = LikelihoodRule::Overlap { exponent: 1.0 },
            Some(LikelihoodName::Bernoulli) => options.likelihood = McmcOptions::default().likelihood,
            None => {}
        }
        if let Some(power) = self.overlap_power {
            if !(power > 0.0 && power <= MOST_POWER) {
                bail!("--overlap-power {}: give a number above 0, at most {MOST_POWER}", shown(power));
            }
            let LikelihoodRule::Overlap { exponent } = &mut options.likelihood else {
                bail!(
                    "--overlap-power {power}: only the overlap ratio has a power; add --likelihood overlap"
                );
            };
            *exponent = power;
        }
        match self.acceptance {
            Some(AcceptanceName::Published) => options.acceptance = Acceptance::Published,
            Some(AcceptanceName::ReversibleJump) => options.acceptance = Acceptance::ReversibleJump,
            None => {}
        }
        if self.postures {
            if options.acceptance == Acceptance::Published {
                bail!("--postures: the published acceptance has no prior of sizes; leave one of both out");
            }
            options.sits_down_per_s = McmcOptions::SITS_DOWN_PER_S;
        }
        if let Some(lag) = self.lag {
            if !(0.0..=MOST_LAG_S).contains(&lag) {
                bail!("--lag {lag}: give 0 to {MOST_LAG_S} seconds");
            }
            options.lag_s = lag;
        }
        options.validate()?;
        Ok(options)
    }
}
