//! Rigid motions: how the sample is placed in a view. No other module spells a rotation of views.

use beamlet_core::{Error, Result};
use glam::{DMat3, DQuat, DVec3};

/// A rotation, then a translation (m): a point p goes to R p + t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    rotation: DMat3,
    translation: DVec3,
}

impl Motion {
    /// No motion, exactly.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Rotation about +z by an angle (rad). At 0 it is [`Self::IDENTITY`].
    #[must_use]
    pub fn about_z(angle: f64) -> Self {
        Self::with_z_axis(libm::cos(angle), libm::sin(angle))
    }

    /// Rotation about z that takes a direction of the plane z = 0 to +x.
    pub(crate) fn onto_x([x, y]: [f64; 2]) -> Self {
        let length = libm::hypot(x, y);
        Self::with_z_axis(x / length, -y / length)
    }

    fn with_z_axis(cos: f64, sin: f64) -> Self {
        let [x, y] = [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0)];
        Self { rotation: DMat3::from_cols(x, y, DVec3::Z), translation: DVec3::ZERO }
    }

    /// Rotation about +x or +y by an angle (rad). At 0 it is [`Self::IDENTITY`].
    pub(super) fn about_x_or_y(axis: [f64; 3], angle: f64) -> Self {
        let (axis, (sine, cosine)) = (DVec3::from_array(axis), libm::sincos(angle));
        let turned = |v: DVec3| {
            let along = axis * axis.dot(v);
            along + (v - along) * cosine + axis.cross(v) * sine + DVec3::ZERO
        };
        let rotation = DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z));
        Self { rotation, translation: DVec3::ZERO }
    }

    /// Rotation about an axis of any length through the origin by an angle (rad), right-handed.
    ///
    /// # Errors
    /// [`Error::Argument`] for an axis without a direction, or an angle that is not finite.
    pub fn about(axis: [f64; 3], angle: f64) -> Result<Self> {
        let unit = DVec3::from_array(axis).try_normalize();
        let Some(unit) = unit.filter(|_| angle.is_finite()) else {
            let found = format!("the axis {axis:?} and the angle {angle} rad");
            return Err(Error::argument(
                "motion",
                found,
                "an axis with a direction, finite numbers",
            ));
        };
        let [x, y, z] = (unit * libm::sin(angle / 2.0)).to_array();
        let turn = DQuat::from_xyzw(x, y, z, libm::cos(angle / 2.0)).normalize();
        Ok(Self { rotation: DMat3::from_quat(turn), translation: DVec3::ZERO })
    }

    /// Rotation that takes +x, +y and +z to these directions, which are unit vectors at right angles to
    /// each other, right-handed.
    ///
    /// # Errors
    /// [`Error::Argument`] where they are not, to 1e-9.
    pub(super) fn with_axes([x, y, z]: [[f64; 3]; 3]) -> Result<Self> {
        let rotation = DMat3::from_cols(x.into(), y.into(), z.into());
        let left = rotation.transpose() * rotation - DMat3::IDENTITY;
        let is_rotation = left.to_cols_array().iter().all(|it| it.abs() < 1e-9);
        if is_rotation && rotation.determinant() > 0.0 {
            return Ok(Self { rotation, translation: DVec3::ZERO });
        }
        let found = format!("the directions {x:?}, {y:?} and {z:?}");
        Err(Error::argument("motion", found, "unit vectors at right angles, right-handed, to 1e-9"))
    }

    /// Rotation by a unit quaternion w, x, y, z.
    pub(super) fn of_quaternion([w, x, y, z]: [f64; 4]) -> Self {
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        Self { rotation, translation: DVec3::ZERO }
    }

    /// Directions that +x, +y and +z are rotated to, where there is a rotation, and the translation, m.
    pub(super) fn parts(&self) -> (Option<[[f64; 3]; 3]>, [f64; 3]) {
        let columns = self.rotation.to_cols_array_2d();
        let turn = (self.rotation != DMat3::IDENTITY).then_some(columns);
        (turn, self.translation.to_array())
    }

    /// Motion by its 3 × 4 matrix `[R | t]`, row after row, t in m.
    ///
    /// # Errors
    /// [`Error::Argument`] where R is no rotation to 1e-9, or a number is not finite.
    pub fn of_matrix(matrix: [f64; 12]) -> Result<Self> {
        let column = |axis: usize| [matrix[axis], matrix[axis + 4], matrix[axis + 8]];
        let translation = DVec3::from_array(column(3));
        if !translation.is_finite() {
            let found = format!("the translation {translation:?}");
            return Err(Error::argument("motion", found, "finite numbers"));
        }
        Ok(Self { translation, ..Self::with_axes([0, 1, 2].map(column))? })
    }

    /// The 3 × 4 matrix `[R | t]`, row after row, t in m.
    #[must_use]
    pub fn matrix(&self) -> [f64; 12] {
        let mut matrix = [0.0; 12];
        for (axis, row) in self.rows().into_iter().enumerate() {
            matrix[4 * axis..4 * axis + 3].copy_from_slice(&row.to_array());
            matrix[4 * axis + 3] = self.translation[axis];
        }
        matrix
    }

    /// Translation, m.
    #[must_use]
    pub const fn translation(by: [f64; 3]) -> Self {
        Self { rotation: DMat3::IDENTITY, translation: DVec3::from_array(by) }
    }

    /// This motion, and then another one.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            rotation: next.rotation * self.rotation,
            translation: next.rotation * self.translation + next.translation,
        }
    }

    /// The motion back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Place of a point, m.
    #[must_use]
    pub fn point(&self, point: [f64; 3]) -> [f64; 3] {
        self.at(DVec3::from_array(point)).to_array()
    }

    /// Direction of a vector. None of its components is -0.
    #[must_use]
    pub fn direction(&self, vector: [f64; 3]) -> [f64; 3] {
        (self.rotation * DVec3::from_array(vector) + DVec3::ZERO).to_array()
    }

    /// Position of a point, m.
    #[doc(hidden)]
    pub fn at(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The rotation.
    #[doc(hidden)]
    pub const fn rotation(&self) -> DMat3 {
        self.rotation
    }

    /// The directions that go to +x, +y and +z.
    #[doc(hidden)]
    pub fn rows(&self) -> [DVec3; 3] {
        let t = self.rotation.transpose();
        [t.x_axis, t.y_axis, t.z_axis]
    }

    /// Where the origin goes, m.
    #[doc(hidden)]
    pub const fn offset(&self) -> DVec3 {
        self.translation
    }

    /// Only a rotation about z: what most scans consist of.
    #[doc(hidden)]
    pub fn is_turn(&self) -> bool {
        self.keeps_upright() && self.translation == DVec3::ZERO
    }

    /// +z goes to +z: upright surfaces stay upright.
    #[doc(hidden)]
    pub fn keeps_upright(&self) -> bool {
        self.rows()[2] == DVec3::Z
    }

    /// No component is infinite or not a number.
    pub(crate) fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.translation.is_finite()
    }
}

impl Default for Motion {
    fn default() -> Self {
        Self::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, TAU};

    fn any() -> Motion {
        let turn = Motion::about([1.0, -2.0, 0.5], 0.7).unwrap();
        turn.then(&Motion::translation([1e-3, -2e-3, 5e-3])).then(&Motion::about_z(2.0))
    }

    fn bits(vector: [f64; 3]) -> [u64; 3] {
        vector.map(f64::to_bits)
    }

    fn near(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15)
    }

    #[test]
    fn identity_changes_no_bit_and_no_turn_is_the_identity() {
        assert_eq!(Motion::about_z(0.0), Motion::IDENTITY);
        assert_eq!(Motion::about([1.0, 2.0, 3.0], 0.0).unwrap(), Motion::IDENTITY);
        assert_eq!(Motion::IDENTITY.inverse(), Motion::IDENTITY);
        for motion in [any(), Motion::about_z(1.0)] {
            assert_eq!(Motion::IDENTITY.then(&motion), motion);
            assert_eq!(motion.then(&Motion::IDENTITY), motion);
        }
        let point = [0.1, -0.2, 1.0 / 3.0];
        assert_eq!(bits(Motion::IDENTITY.point(point)), bits(point));
    }

    #[test]
    fn rotations_are_right_handed() {
        let x = [1.0, 0.0, 0.0];
        assert!(near(Motion::about_z(FRAC_PI_2).point(x), [0.0, 1.0, 0.0]));
        let about_y = Motion::about([0.0, 4.0, 0.0], FRAC_PI_2).unwrap();
        assert!(near(about_y.point(x), [0.0, 0.0, -1.0]));
        // By hand: a third of a turn about the diagonal takes x to y, y to z, z to x.
        let third = Motion::about([1.0; 3], TAU / 3.0).unwrap();
        assert!(near(third.point([1.0, 2.0, 3.0]), [3.0, 1.0, 2.0]));
        assert!(near(Motion::onto_x([3.0, 4.0]).point([0.6, 0.8, 7.0]), [1.0, 0.0, 7.0]));
    }

    #[test]
    fn composition_is_one_motion_after_the_other() {
        let (first, next) = (any(), Motion::about([0.0, 1.0, 1.0], -0.3).unwrap());
        let point = [2e-3, 3e-3, -1e-3];
        assert!(near(first.then(&next).point(point), next.point(first.point(point))));
        assert!(near(first.then(&first.inverse()).point(point), point));
        assert!(near(first.inverse().then(&first).point(point), point));
        // Directions do not see a translation.
        let moved = Motion::translation([1.0, 2.0, 3.0]);
        assert_eq!(bits(moved.direction(point)), bits(point));
        assert_eq!(bits(moved.point([0.0; 3])), bits([1.0, 2.0, 3.0]));
    }

    #[test]
    fn only_rotations_about_z_are_turns_and_translations_keep_upright() {
        for turn in [Motion::IDENTITY, Motion::about_z(0.3), Motion::onto_x([-1.0, 0.2])] {
            assert!(turn.is_turn() && turn.keeps_upright());
        }
        assert!(Motion::about([0.0, 0.0, 2.0], 0.3).unwrap().is_turn());
        let moved = Motion::about_z(0.3).then(&Motion::translation([0.0, 0.0, 1e-6]));
        assert!(!moved.is_turn() && moved.keeps_upright());
        let tilted = Motion::about([1.0, 0.0, 0.0], 1e-9).unwrap();
        assert!(!tilted.is_turn() && !tilted.keeps_upright());
    }

    #[test]
    fn matrices_are_row_after_row() {
        let (motion, point) = (any(), DVec3::new(2e-3, 3e-3, -1e-3));
        let matrix = motion.matrix();
        assert_eq!(Motion::of_matrix(matrix).unwrap(), motion);
        let row = |n: usize| DVec3::from_slice(&matrix[4 * n..]).dot(point) + matrix[4 * n + 3];
        assert!(near([0, 1, 2].map(row), motion.point(point.to_array())));
        let mut mirrored = matrix;
        (0..3).for_each(|row| mirrored[4 * row] *= -1.0);
        assert!(Motion::of_matrix(mirrored).is_err());
        let mut endless = matrix;
        endless[7] = f64::INFINITY;
        assert!(Motion::of_matrix(endless).is_err());
    }

    #[test]
    fn axis_without_direction_is_refused() {
        let found = |axis, angle| Motion::about(axis, angle).unwrap_err().to_string();
        assert!(found([0.0; 3], 1.0).contains("[0.0, 0.0, 0.0]"), "{}", found([0.0; 3], 1.0));
        assert!(found([1.0, 0.0, 0.0], f64::NAN).contains("NaN"));
    }
}
