//! Satellites on circles about the centre of the Earth, seen from a fixed point; geometry G2 of the study.
//!
//! ```text
//! s(t) = x₀ cos(n t) + c sin(n t) − p,   ṡ(t) = n (c cos(n t) − x₀ sin(n t))
//! ```
//! t = 0 in the middle of a run. Appendix A of Greiff (2023) gives neither site nor epoch nor axes. G2 is a geometry whose
//! fixed position covariances are those of the paper's Table 2: ten satellites above 30° in a sector of 180° of azimuth,
//! axes (p^X, p^Y, p^Z) = (east, up, north), a base 10 km away. It was the best of 150 random ones. The other geometry is
//! a nominal one: ten satellites anywhere above 5°, axes (east, north, up), another sky for each run.

use nalgebra::Vector3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surefix_core::model::multi_band::Satellite;

/// A circular orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Position at t = 0 `[m]`, from the centre.
    pub start: Vector3<f64>,
    /// Position a quarter of a turn later `[m]`.
    pub quarter: Vector3<f64>,
}

/// Satellites, base and the fixed point.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// n, angular rate of all satellites `[rad/s]`.
    pub rate: f64,
    /// The linearisation point `[m]`, from the centre.
    pub point: Vector3<f64>,
    /// The base relative to the point `[m]`.
    pub base: Vector3<f64>,
    /// Orbits; the first satellite is the positive one of all differences.
    pub circles: Vec<Circle>,
}

/// Number of satellites in both geometries.
pub const SATELLITES: usize = 10;
/// Radius of the orbits `[m]`: half a sidereal day.
const RADIUS: f64 = 26.56e6;
/// Radius of the Earth `[m]`.
const EARTH: f64 = 6.371e6;
/// Elevation above which satellites of the nominal geometry are `[°]`.
const MASK: f64 = 5.0;

/// Angular rate of G2 relative to the rotating Earth `[rad/s]`.
const RATE: f64 = 0.00012398287722937865;

/// x₀ and c of G2 `[m]`.
#[rustfmt::skip]
const CIRCLES: [([f64; 3], [f64; 3]); 10] = [
    ([19374998.047730763, 18164496.858775884, -280534.8499746627], [-17305479.6623871, 18329551.46049471, -8364574.83652834]),
    ([6861746.873311588, 25491990.681891322, 2914281.421734109], [1084093.4759489333, 2725957.777954939, -26397198.540987488]),
    ([5962183.730554441, 25859864.765354864, 1066749.6260932242], [21333557.957711585, -5530068.534445198, 14822814.92002784]),
    ([18294990.730230995, 17906683.040017627, 7075465.4948778385], [-15353092.354000662, 19457515.463269208, -9544938.053767875]),
    ([14244113.878153842, 21047935.625324093, 7714131.255202875], [-22090802.29192081, 11625949.91693968, 9069285.413535995]),
    ([16800664.09495964, 19511507.167784013, 6515901.264901683], [-11149147.341609515, 15707017.071957238, -18286725.336714216]),
    ([4052820.419589221, 24879467.819535375, 8366894.462544897], [8980317.707565604, -9269394.632950604, 23213151.709621646]),
    ([6375607.008733912, 22940419.98726938, 11768898.052153168], [22418411.957920726, 1055771.0815398153, -14202758.464201294]),
    ([8864548.93598156, 21993961.71392797, -11962592.343299123], [24281294.833122455, -10646078.177342933, -1580485.986329284]),
    ([16806467.5316424, 19872489.108870506, -5295754.999032042], [-18976469.17595101, 12348111.194825117, -13886538.90710409]),
];

impl Geometry {
    /// Geometry G2.
    pub fn g2() -> Self {
        let circle = |&(start, quarter): &([f64; 3], [f64; 3])| Circle { start: start.into(), quarter: quarter.into() };
        Self {
            rate: RATE,
            point: Vector3::new(0.0, 6_371_000.0, 0.0),
            base: Vector3::new(-6000.0, 0.0, 8000.0),
            circles: CIRCLES.iter().map(circle).collect(),
        }
    }

    /// Ten satellites spread evenly over what is above 5° of a shell of GPS's radius, moving in any direction; the highest
    /// is the first.
    pub fn nominal(random: &mut ChaCha8Rng) -> Self {
        let point = Vector3::new(0.0, 0.0, EARTH);
        let elevation = |circle: &Circle| {
            let line = circle.start - point;
            (line.z / line.norm()).asin()
        };
        let mut circles = Vec::with_capacity(SATELLITES);
        while circles.len() < SATELLITES {
            let radial = direction(random);
            let circle =
                Circle { start: RADIUS * radial, quarter: RADIUS * radial.cross(&direction(random)).normalize() };
            if elevation(&circle) > MASK.to_radians() {
                circles.push(circle);
            }
        }
        circles.sort_by(|a, b| elevation(b).total_cmp(&elevation(a)));
        Self { rate: RATE, point, base: Vector3::new(-6000.0, 8000.0, 0.0), circles }
    }

    /// The satellites at a time `[s]`, relative to the point.
    pub fn satellites(&self, time: f64) -> Vec<Satellite> {
        let (sin, cos) = (time * self.rate).sin_cos();
        let at = |circle: &Circle| Satellite {
            position: circle.start * cos + circle.quarter * sin - self.point,
            velocity: (circle.quarter * cos - circle.start * sin) * self.rate,
        };
        self.circles.iter().map(at).collect()
    }
}

/// Evenly distributed on the sphere.
fn direction(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize()
}

#[cfg(test)]
mod tests {
    use super::super::super::monte_carlo::stream;
    use super::*;

    #[test]
    fn the_nominal_sky_is_above_the_mask_and_new_for_each_run() {
        let skies: Vec<Geometry> = (0..20).map(|run| Geometry::nominal(&mut stream(1, run))).collect();
        for sky in &skies {
            let satellites = sky.satellites(0.0);
            let elevation = |s: &Satellite| (s.position.z / s.position.norm()).asin().to_degrees();
            assert!(satellites.len() == SATELLITES && satellites.iter().all(|s| elevation(s) > MASK));
            assert!(satellites.iter().all(|s| elevation(s) <= elevation(&satellites[0])));
            for circle in &sky.circles {
                assert!(circle.start.dot(&circle.quarter).abs() < 1e-3 * RADIUS);
            }
        }
        assert_ne!(skies[0], skies[1]);
        assert_eq!(skies[0], Geometry::nominal(&mut stream(1, 0)));
    }

    #[test]
    fn satellites_of_g2_are_high_in_half_the_sky() {
        let geometry = Geometry::g2();
        assert_eq!(geometry.satellites(0.0).len(), 10);
        for satellite in geometry.satellites(0.0) {
            let s = satellite.position;
            assert!((s.y / s.norm()).asin().to_degrees() > 30.0 && s.norm() < 2.5e7, "up is the second axis: {s}");
            // A satellite keeps its distance from the centre: 26.56e6 m, that of GPS.
            let from_centre = s + geometry.point;
            assert!((from_centre.norm() - 26.56e6).abs() < 1e4);
            assert!(from_centre.dot(&satellite.velocity).abs() < 1e-6 * from_centre.norm() * satellite.velocity.norm());
        }
        let (before, after) = (geometry.satellites(-0.5), geometry.satellites(0.5));
        for ((before, now), after) in before.iter().zip(geometry.satellites(0.0)).zip(after) {
            // The central difference is off by n²/24 of the velocity: 2e-6 m/s.
            assert!((after.position - before.position - now.velocity).amax() < 1e-5);
        }
    }
}
