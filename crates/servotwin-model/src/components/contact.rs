//! Contact forces between solid bodies: dry friction and end stops, each written once for all components.
//!
//! ```text
//! F = b v + n F_C (1 + (κ − 1) e^{−(v/v_s)²}) tanh(v/v_0)                  (CO1)
//! ```
//!
//! n is the load on the surfaces, relative to that at which F_C holds. κ is the ratio of static to Coulomb
//! friction, v_s the Stribeck velocity and v_0 the smoothing velocity.
//! Equation (Y6) of the cylinder describes end stops. Both functions return a force, or an acceleration if
//! the constants are divided by the mass.

use crate::scalar::Scalar;

/// Number of constants of [`stribeck`].
pub(crate) const STRIBECK_CONSTANTS: usize = 5;

/// The parameters of (CO1), for a force or an acceleration.
pub(crate) struct Stribeck<S> {
    /// b, the viscous friction.
    pub(crate) viscous: S,
    /// F_C, the Coulomb friction.
    pub(crate) coulomb: S,
    /// κ, the static over the Coulomb friction.
    pub(crate) static_ratio: S,
    /// v_s, the Stribeck velocity, m/s.
    pub(crate) velocity: S,
    /// v_0, the smoothing velocity, m/s.
    pub(crate) smoothing: S,
}

/// The constants of [`stribeck`].
pub(crate) fn stribeck_constants<S: Scalar<Base = S>>(of: Stribeck<S>) -> [S; STRIBECK_CONSTANTS] {
    let one = S::constant(1.0);
    let excess = of.coulomb * (of.static_ratio - one);
    [of.viscous, of.coulomb, excess, one / of.velocity, one / of.smoothing]
}

/// Equation (CO1): the friction that opposes a velocity, with the relative load on the surfaces.
#[inline(always)]
pub(crate) fn stribeck<S: Scalar>(
    velocity: S,
    load: S,
    &[viscous, coulomb, excess, per_stribeck, per_smoothing]: &[S::Base; STRIBECK_CONSTANTS],
) -> S {
    let relative = velocity * per_stribeck;
    let level = (-(relative * relative)).exp() * excess + coulomb;
    velocity * viscous + load * level * (velocity * per_smoothing).tanh()
}

/// Number of constants of [`end_stop`].
pub(crate) const END_STOP_CONSTANTS: usize = 4;

/// The constants of [`end_stop`], with stops at ± `limit`.
pub(crate) fn end_stop_constants<S: Scalar<Base = S>>(
    limit: S,
    stiffness: S,
    damping: S,
) -> [S; END_STOP_CONSTANTS] {
    [limit, stiffness, damping, S::constant(1e3) / limit]
}

/// Equation (Y6): the force or acceleration with which end stops at both ends oppose a
/// motion, depending on the constants.
#[inline(always)]
pub(crate) fn end_stop<S: Scalar>(
    position: S,
    velocity: S,
    &[limit, stiffness, damping, per_fade]: &[S::Base; END_STOP_CONSTANTS],
) -> S {
    let zero = S::constant(0.0);
    let high = S::from_base(limit);
    let excess = position - position.clamp(-high, high);
    let contact = (excess.abs() * per_fade).min(S::constant(1.0));
    let push = excess * stiffness + velocity * contact * damping;
    // A stop does not pull a body that moves away from it.
    S::select(excess.less(zero), push.min(zero), push.max(zero))
}
