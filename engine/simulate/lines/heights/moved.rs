//! Light of a line by its displacement along z.

/// Light of a mask step by its displacement, rows downwards; more than a row counts as one.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moved {
    /// All light.
    pub light: f32,
    /// Light times displacement.
    pub displaced: f32,
    /// Light times distance.
    pub distance: f32,
    /// Light times the square of displacement.
    pub square: f32,
}

impl Moved {
    /// Adds light that is displaced so far, rows.
    pub(crate) fn add(&mut self, light: f32, displacement: f32) {
        // More than a row takes no more light out of its own.
        let displacement = displacement.clamp(-1.0, 1.0);
        self.light += light;
        self.displaced += light * displacement;
        self.distance += light * displacement.abs();
        self.square += light * displacement * displacement;
    }

    /// Adds a share of other light to a share of this.
    pub(crate) fn mix(&mut self, own: f32, share: f32, other: &Self) {
        self.light = own * self.light + share * other.light;
        self.displaced = own * self.displaced + share * other.displaced;
        self.distance = own * self.distance + share * other.distance;
        self.square = own * self.square + share * other.square;
    }
}
