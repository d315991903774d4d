//! How a satellite is turned: the axes of its body, which the antenna offset and the wind-up need.
//!
//! IGS axes (O. Montenbruck et al., *GNSS satellite geometry and attitude models*, Adv. Space Res. 56 (2015)): z to the
//! Earth's centre, y along the solar panels, x completes the right-handed frame and is on the side of the Sun. ANTEX
//! offsets and wind-up refer to them whatever the manufacturer calls his axes.
//!
//! *Nominal* attitude keeps y perpendicular to the Sun: y ∥ z × Sun. In the orbit's frame x is turned from the direction of
//! motion by the yaw angle ψ = atan2(−tan β, sin μ), where β is the Sun's elevation above the orbital plane and μ the
//! satellite's angle in it since midnight (J. Kouba, *A simplified yaw-attitude model for eclipsing GPS satellites*, GPS
//! Solutions 13 (2009), eq. 1). Where the Sun is near the plane it asks for turns faster than a satellite makes, near noon
//! and midnight; what satellites do then is in `yaw`, by [`Block`].
//!
//! Everything is a function of the present geometry: there is no state that a restart could lose. Cost: three square
//! roots, about five trigonometric functions, up to twenty in a turn. Panic contract: none; all returned values are finite.

mod block;
mod yaw;

pub use block::Block;

use super::geodesy::EARTH_ROTATION_RATE;
use nalgebra::Vector3;

/// Body axes of a satellite: orthogonal unit vectors, ECEF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Towards the side of the Sun (nominally).
    pub x: Vector3<f64>,
    /// Along the solar panels.
    pub y: Vector3<f64>,
    /// To the Earth's centre.
    pub z: Vector3<f64>,
}

impl Axes {
    /// A vector of the body frame, in ECEF.
    pub fn to_ecef(&self, body: &Vector3<f64>) -> Vector3<f64> {
        self.x * body.x + self.y * body.y + self.z * body.z
    }

    /// Nominal attitude of a satellite at `position`, with the Sun at `sun`, both ECEF of one time `[m]`. `None` where
    /// satellite, Earth and Sun are on a line, or an input is not finite.
    pub fn nominal(position: &Vector3<f64>, sun: &Vector3<f64>) -> Option<Self> {
        let z = -position.try_normalize(1.0)?;
        let y = z.cross(&(sun - position).try_normalize(1.0)?).try_normalize(1e-12)?;
        let axes = Self { x: y.cross(&z), y, z };
        (axes.x + axes.y + axes.z).iter().all(|value| value.is_finite()).then_some(axes)
    }
}

/// What a satellite is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Yaw {
    /// It follows the Sun.
    Nominal,
    /// It turns, near the point of its orbit nearest to the Sun, otherwise than the Sun asks for.
    NoonTurn,
    /// It turns, near the point farthest from the Sun or in the Earth's shadow, otherwise than the Sun asks for.
    MidnightTurn,
    /// x is along the velocity, y across the orbit.
    OrbitNormal,
}

/// How a satellite is turned, and how sure that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Body axes.
    pub axes: Axes,
    /// What the satellite is doing.
    pub yaw: Yaw,
    /// Yaw angle ψ `[rad]`: from the direction of motion to x, about z.
    pub yaw_angle: f64,
    /// Elevation of the Sun above the orbital plane `[rad]`.
    pub beta: f64,
    /// Angle in the orbit since midnight `[rad]`, −π…π.
    pub orbit_angle: f64,
    /// Whether the axes can be trusted. Where not, wind-up may be off by half a cycle and horizontal offsets by their
    /// double: give the satellite's phase less weight, or none.
    pub reliable: bool,
}

/// The attitude of a satellite of a block at `position` `[m]`, moving with `velocity` in the rotating frame `[m/s]`, and the
/// Sun at `sun` `[m]`; all ECEF of one time. `None` where the geometry is degenerate or an input is not finite.
pub fn attitude(
    block: Block,
    position: &Vector3<f64>,
    velocity: &Vector3<f64>,
    sun: &Vector3<f64>,
) -> Option<Attitude> {
    let frame = OrbitFrame::new(position, velocity, sun)?;
    let steering = yaw::steering(block, &frame);
    // Nominal axes come from the vectors: through angles they lose digits when the Sun is near the plane.
    let nominal = (steering.yaw == Yaw::Nominal).then(|| Axes::nominal(position, sun)).flatten();
    let axes = nominal.unwrap_or_else(|| frame.axes(steering.angle));
    let finite = (axes.x + axes.y + axes.z).iter().all(|value| value.is_finite()) && steering.angle.is_finite();
    finite.then_some(Attitude {
        axes,
        yaw: steering.yaw,
        yaw_angle: steering.angle,
        beta: frame.beta,
        orbit_angle: frame.orbit_angle,
        reliable: steering.reliable,
    })
}

/// The orbital plane and the Sun.
struct OrbitFrame {
    /// Unit vectors outward, along the motion, along the orbital momentum; ECEF.
    radial: Vector3<f64>,
    along: Vector3<f64>,
    normal: Vector3<f64>,
    /// Elevation of the Sun above the plane `[rad]`.
    beta: f64,
    /// Angle since midnight μ `[rad]`, −π…π.
    orbit_angle: f64,
    /// Rate of μ `[rad/s]`; the Sun's own motion (2e-7 rad/s) is left out.
    rate: f64,
}

impl OrbitFrame {
    fn new(position: &Vector3<f64>, velocity: &Vector3<f64>, sun: &Vector3<f64>) -> Option<Self> {
        let inertial = velocity + Vector3::new(-position.y, position.x, 0.0) * EARTH_ROTATION_RATE;
        let radial = position.try_normalize(1.0)?;
        let momentum = position.cross(&inertial);
        let normal = momentum.try_normalize(1.0)?;
        let along = normal.cross(&radial);
        let to_sun = sun.try_normalize(1.0)?;
        let beta = libm::asin(normal.dot(&to_sun).clamp(-1.0, 1.0));
        let orbit_angle = libm::atan2(to_sun.dot(&along), -to_sun.dot(&radial));
        let rate = momentum.norm() / position.norm_squared();
        (beta.is_finite() && orbit_angle.is_finite() && rate.is_finite() && rate > 0.0).then_some(Self {
            radial,
            along,
            normal,
            beta,
            orbit_angle,
            rate,
        })
    }

    /// Body axes at a yaw angle `[rad]`.
    fn axes(&self, yaw: f64) -> Axes {
        let (sin, cos) = libm::sincos(yaw);
        let (x, z) = (self.along * cos - self.normal * sin, -self.radial);
        Axes { x, y: z.cross(&x), z }
    }
}

#[cfg(test)]
mod tests;
