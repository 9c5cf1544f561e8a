//! Representative colours of a person (seed 000, section 3.1).

/// A colour of cloth: hue and saturation, which shade changes little, and brightness, which it does.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Colour {
    /// Hue, degrees, 0 to 360.
    pub hue_deg: f32,
    /// Saturation, 0 (grey) to 1.
    pub saturation: f32,
    /// Brightness, 0 to 1.
    pub value: f32,
}

/// The representative colours that one camera shows of a person at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Looks {
    /// Three colours, from the head down.
    pub colours: [Colour; 3],
}
