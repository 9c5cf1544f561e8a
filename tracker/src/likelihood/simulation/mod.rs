//! Counts of a changing state, updated from the changed pixels alone.

#[cfg(test)]
mod tests;

use super::cover::{Change, Cover, MAX_BODIES};
use super::{Counts, Layers};
use crate::observation::Mask;
use crate::silhouette::{Silhouette, View};

/// Simulated masks of all layers, and the foreground masks of the moment.
///
/// A state's bodies are added once a frame by [`Self::insert`]; after that each step computes by [`Self::try_change`]
/// the counts after a change of one body, and [`Self::commit`] applies an accepted change. Nothing allocates after the
/// first frames.
#[derive(Debug, Clone)]
pub struct Simulation {
    layers: Vec<SimulatedLayer>,
    bodies: usize,
}

#[derive(Debug, Clone)]
struct SimulatedLayer {
    cover: Cover,
    camera: usize,
    /// Whether the camera has a mask at this moment.
    in_use: bool,
    counts: Counts,
    /// Change of the counts by the removal that was tried.
    removal: Change,
    tried: Counts,
}

/// Mask at the resolution of a view, as packed words, row by row; bit 0 is the leftmost pixel. A view's pixel that
/// stands for a block of the mask's is foreground when half of the block is.
pub fn pack(mask: &Mask, view: &View) -> Vec<u64> {
    let block = u32::from(view.block);
    if block == 1 {
        return mask.words().to_vec();
    }
    let mut packed = Vec::with_capacity(view.words_per_row * view.height as usize);
    // Number of foreground pixels in each block of a row of blocks.
    let mut found = vec![0_u32; view.width as usize];
    for first in (0..mask.height()).step_by(block as usize) {
        let rows = first..(first + block).min(mask.height());
        found.fill(0);
        for row in rows.clone() {
            for (word, mut bits) in (0_u32..).zip(mask.row(row).iter().copied()) {
                while bits != 0 {
                    found[((word * 64 + bits.trailing_zeros()) / block) as usize] += 1;
                    bits &= bits - 1;
                }
            }
        }
        let is_foreground = |column: u32| {
            // The last block of a row may be narrower than the others.
            let width = block.min(mask.width() - column * block);
            2 * found[column as usize] >= width * rows.len() as u32
        };
        packed.extend((0..view.words_per_row as u32).map(|word| {
            let blocks = (word * 64..((word + 1) * 64).min(view.width)).rev();
            blocks.fold(0, |word, column| word << 1 | u64::from(is_foreground(column)))
        }));
    }
    packed
}

impl Simulation {
    /// Largest number of bodies in a state.
    pub const MAX_BODIES: usize = MAX_BODIES;

    /// Empty simulation of these layers.
    pub fn new(layers: &Layers) -> Self {
        let layer = |i: usize| {
            let camera = layers.camera(i);
            let view = &layers.views()[camera];
            SimulatedLayer {
                cover: Cover::new(view.words_per_row, view.height as usize),
                camera,
                in_use: false,
                counts: Counts::default(),
                removal: Change::default(),
                tried: Counts::default(),
            }
        };
        Self { layers: (0..layers.count()).map(layer).collect(), bodies: 0 }
    }

    /// Sets the masks of a new moment, one a camera, packed by [`pack`]; `None` leaves a camera out. Removes all
    /// bodies.
    pub fn restart(&mut self, masks: &[Option<Vec<u64>>]) {
        self.bodies = 0;
        for layer in &mut self.layers {
            let mask = &masks[layer.camera];
            layer.in_use = mask.is_some();
            if let Some(mask) = mask {
                layer.cover.restart(mask);
                let foreground = mask.iter().map(|w| i64::from(w.count_ones())).sum();
                layer.counts = Counts { foreground, ..Counts::default() };
                layer.tried = layer.counts;
            }
        }
    }

    /// Whether a layer's camera takes part in this moment.
    pub fn in_use(&self, layer: usize) -> bool {
        self.layers[layer].in_use
    }

    /// Whether any camera takes part in this moment.
    pub fn sees_anything(&self) -> bool {
        self.layers.iter().any(|l| l.in_use)
    }

    /// Counts of the present state in each layer; `None` for a camera that is left out.
    pub fn counts(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.layers.iter().map(|l| l.in_use.then_some(l.counts))
    }

    /// Counts of the change that was tried last.
    pub fn tried(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.layers.iter().map(|l| l.in_use.then_some(l.tried))
    }

    /// Computes the counts that would follow if the body drawn as `old` (one silhouette a layer; now in the state) were
    /// drawn as `new`. Without `old` a body is added, without `new` removed.
    pub fn try_change(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        self.try_removal(old);
        for layer in 0..self.layers.len() {
            self.try_addition(layer, old, new);
        }
    }

    /// First half of a change: removes `old` from every layer. Until [`Self::try_addition`], the tried counts of a
    /// layer are an upper bound for any addition: all foreground is explained, and nothing else is expected.
    pub fn try_removal(&mut self, old: Option<&[Silhouette]>) {
        for (i, layer) in self.layers.iter_mut().enumerate().filter(|(_, l)| l.in_use) {
            layer.removal = old.map_or(Change::default(), |old| layer.cover.removal(&old[i]));
        }
        self.try_again();
    }

    /// Forgets the additions that were tried since [`Self::try_removal`], so that another one of the same body can be
    /// tried.
    pub fn try_again(&mut self) {
        for layer in self.layers.iter_mut().filter(|l| l.in_use) {
            let Counts { foreground, simulated, both } = layer.counts;
            let in_vain = simulated - both + layer.removal.simulated - layer.removal.both;
            layer.tried = Counts { foreground, simulated: foreground + in_vain, both: foreground };
        }
    }

    /// Second half of a change, in one layer: adds `new` after [`Self::try_removal`] of the same `old`. Does nothing in
    /// a layer that is not in use.
    pub fn try_addition(&mut self, layer: usize, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        let SimulatedLayer { cover, in_use, counts, tried, removal, .. } = &mut self.layers[layer];
        if *in_use {
            let old = old.map(|s| &s[layer]);
            let addition = new.map_or(Change::default(), |new| cover.addition(&new[layer], old));
            *tried = Counts {
                foreground: counts.foreground,
                simulated: counts.simulated + removal.simulated + addition.simulated,
                both: counts.both + removal.both + addition.both,
            };
        }
    }

    /// Applies the change that was tried last, with the same arguments.
    pub fn commit(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        self.bodies = self.bodies + usize::from(new.is_some()) - usize::from(old.is_some());
        debug_assert!(
            self.bodies <= MAX_BODIES || !self.sees_anything(),
            "more bodies than the digits of a pixel can count"
        );
        for (i, layer) in self.layers.iter_mut().enumerate().filter(|(_, l)| l.in_use) {
            if let Some(old) = old {
                layer.cover.remove(&old[i]);
            }
            if let Some(new) = new {
                layer.cover.add(&new[i]);
            }
            layer.counts = layer.tried;
        }
    }

    /// Adds a body.
    pub fn insert(&mut self, silhouettes: &[Silhouette]) {
        self.try_change(None, Some(silhouettes));
        self.commit(None, Some(silhouettes));
    }

    /// Number of a silhouette's visible pixels that are foreground in one layer, whichever other bodies cover them.
    pub fn foreground_under(&self, layer: usize, silhouette: &Silhouette) -> u32 {
        self.layers[layer].cover.foreground_under(silhouette)
    }

    /// Foreground that the present state leaves unexplained in one layer, packed like the masks.
    pub fn unexplained(&self, layer: usize) -> impl Iterator<Item = u64> + '_ {
        self.layers[layer].cover.unexplained()
    }
}
