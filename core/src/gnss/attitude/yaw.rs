//! The yaw angle ψ by kind of satellite, where it is not nominal.
//!
//! | block | near noon | near midnight | source |
//! |---|---|---|---|
//! | II, IIA | at 0.12°/s until it has caught up | the same in the shadow, one way; then 30 min of recovery | K, B |
//! | IIR | at 0.20°/s until it has caught up | the same | K |
//! | IIF | at 0.11°/s until it has caught up | evenly through the shadow | D1, Kg |
//! | III | β replaced by β + (±4.78° − β)/(1 + 13000 sin⁴μ) | the same | S |
//! | GLONASS-M | at 0.25°/s, centred | at 0.25°/s from entering the shadow, then fixed until its end | D2 |
//! | Galileo IOV | Sun vector kept 2° off the plane within 15° | the same | G |
//! | Galileo FOC | cosine of 5656 s within 10° if β below 4.1° | the same | G |
//! | BeiDou-2 | orbit-normal if β below 4° | the same | M |
//! | BeiDou-3 CAST | cosine of 3090 s (MEO), 5740 s (IGSO) within 6° if β below 3° | the same | D3 |
//! | BeiDou-3 SECM | β replaced by ±3° if below | the same | X |
//! | QZSS II | at 0.055°/s, centred | the same | Q |
//! | QZSS I | orbit-normal if β below 20° | the same | M |
//! | geostationary | orbit-normal always | | M |
//!
//! Sources: K Kouba 2009 (GPS Solutions 13) and his eclips notes of 2013; B Bar-Sever 1996 (J. Geodesy 70); D1 Dilssner
//! 2010 (InsideGNSS, September), Kg Kuang, Desai, Sibois 2017 (GPS Solutions 21); S Steigenberger et al. 2020 (GPS World);
//! D2 Dilssner et al. 2011 (Adv. Space Res. 47); G Galileo Satellite Metadata 3.1 (European GNSS Service Centre); M
//! Montenbruck et al. 2015 (Adv. Space Res. 56); D3 Dilssner 2017, Wang et al. 2018 (GPS Solutions 22); X Xia et al.
//! 2021 (arXiv:2112.13252); Q Cabinet Office, *QZS-2 Satellite Property Information*.
//!
//! Approximated: the orbit is a circle flown at the present rate during a turn, β stays as it is, the shadow is a cone of
//! fixed width. Turns begin where the nominal rate exceeds the limit, not where an on-board computer noticed. The rates are
//! the blocks' means: single IIA satellites make 0.08 to 0.14°/s. BeiDou-2 satellites switch modes when ψ is near 0, up to a
//! day after β passed 4°, and some were later reprogrammed to steer on (C13, C14, C16); QZSS switches are announced by
//! the operator and not known here. GLONASS-K has no published model. Where such a thing matters, the result says that it
//! is not reliable.

use super::{Block, OrbitFrame, Yaw};
use core::f64::consts::{FRAC_PI_2, PI, TAU};

const DEGREE: f64 = PI / 180.0;

/// Half the arc of the shadow as seen from the Earth's centre `[rad]`: GPS (K).
const GPS_SHADOW: f64 = 13.25 * DEGREE;
/// The same for GLONASS (K).
const GLONASS_SHADOW: f64 = 14.20 * DEGREE;
/// How long a IIA satellite may take to find the Sun again after the shadow `[s]` (B).
const RECOVERY: f64 = 1_800.0;
/// How near to the limit of a mode that is switched by hand it is not known which one is on `[rad]`.
const SWITCHING: f64 = 1.0 * DEGREE;
/// Steps of a bisection to 1e-12 rad.
const BISECTIONS: usize = 40;

/// A yaw angle.
pub(super) struct Steering {
    pub yaw: Yaw,
    pub angle: f64,
    pub reliable: bool,
}

/// The yaw angle of a satellite of `block`.
pub(super) fn steering(block: Block, frame: &OrbitFrame) -> Steering {
    let turn = Turn::new(frame);
    let beta = libm::fabs(frame.beta);
    let manoeuvre = match block {
        Block::GpsIIR => turn.catch_up(0.20 * DEGREE, 0.0).map(reliable),
        Block::GpsIIF if turn.noon => turn.catch_up(0.11 * DEGREE, -0.7 * DEGREE).map(reliable),
        Block::GpsIIF => turn.even_through(GPS_SHADOW).map(reliable),
        Block::GpsIIA => turn.block_iia(0.12 * DEGREE).map(unreliable),
        Block::GpsIII => turn.lifted(4.78 * DEGREE, 13_000.0).map(reliable),
        Block::GlonassM if turn.noon => turn.centred(0.25 * DEGREE).map(reliable),
        Block::GlonassM => turn.turn_and_wait(0.25 * DEGREE, GLONASS_SHADOW).map(reliable),
        Block::GalileoIov => turn.auxiliary_sun(15.0 * DEGREE, 2.0 * DEGREE).map(reliable),
        Block::GalileoFoc => turn.cosine(4.1 * DEGREE, turn.within(10.0 * DEGREE), 5_656.0).map(reliable),
        Block::BeiDou3CastMeo => turn.cosine(3.0 * DEGREE, Some(6.0 * DEGREE), 3_090.0).map(reliable),
        Block::BeiDou3CastIgso => turn.cosine(3.0 * DEGREE, Some(6.0 * DEGREE), 5_740.0).map(reliable),
        Block::BeiDou3Secm => (beta < 3.0 * DEGREE).then(|| reliable(nominal(turn.sign() * 3.0 * DEGREE, turn.mu))),
        Block::QzssII => turn.centred(0.055 * DEGREE).map(unreliable),
        Block::GlonassK | Block::Unknown => turn.catch_up(0.10 * DEGREE, 0.0).map(|_| unreliable(turn.nominal)),
        Block::Geostationary | Block::BeiDou2 | Block::QzssI => None,
    };
    let orbit_normal = |angle, reliable| Steering { yaw: Yaw::OrbitNormal, angle, reliable };
    match (block, manoeuvre) {
        (Block::Geostationary, _) => orbit_normal(0.0, true),
        (Block::BeiDou2, _) if beta < 4.0 * DEGREE => orbit_normal(0.0, beta < 4.0 * DEGREE - SWITCHING),
        // (Which way x of the first QZSS satellite points then is assumed: with the nominal yaw that it has at large β.)
        (Block::QzssI, _) if beta < 20.0 * DEGREE => orbit_normal(PI, false),
        (Block::BeiDou2, _) => follow(&turn, beta > 4.0 * DEGREE + SWITCHING),
        (_, Some((angle, reliable))) => {
            let yaw = if turn.noon { Yaw::NoonTurn } else { Yaw::MidnightTurn };
            Steering { yaw, angle: wrapped(angle), reliable }
        }
        (Block::GpsIIA, None) => follow(&turn, !turn.recovers_from(GPS_SHADOW, RECOVERY)),
        (_, None) => follow(&turn, true),
    }
}

fn follow(turn: &Turn, reliable: bool) -> Steering {
    Steering { yaw: Yaw::Nominal, angle: turn.nominal, reliable }
}

fn reliable(angle: f64) -> (f64, bool) {
    (angle, true)
}

fn unreliable(angle: f64) -> (f64, bool) {
    (angle, false)
}

/// Nominal yaw angle `[rad]`.
fn nominal(beta: f64, mu: f64) -> f64 {
    libm::atan2(-libm::tan(beta), libm::sin(mu))
}

/// An angle in −π…π `[rad]`.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * libm::floor(angle / TAU + 0.5)
}

/// The geometry about the nearer of noon and midnight.
struct Turn {
    beta: f64,
    mu: f64,
    /// Rate of μ `[rad/s]`.
    rate: f64,
    nominal: f64,
    /// Whether noon is nearer.
    noon: bool,
    /// Angle in the orbit since noon or midnight `[rad]`, −π/2…π/2.
    since: f64,
}

impl Turn {
    fn new(frame: &OrbitFrame) -> Self {
        let (beta, mu) = (frame.beta, frame.orbit_angle);
        let noon = libm::fabs(mu) > FRAC_PI_2;
        let since = if noon { wrapped(mu - PI) } else { mu };
        Self { beta, mu, rate: frame.rate, nominal: nominal(beta, mu), noon, since }
    }

    /// Nominal yaw at an angle `since` noon or midnight.
    fn nominal_at(&self, since: f64) -> f64 {
        nominal(self.beta, if self.noon { PI + since } else { since })
    }

    /// Sign of β.
    fn sign(&self) -> f64 {
        if self.beta < 0.0 { -1.0 } else { 1.0 }
    }

    /// Sense in which nominal yaw turns: ψ' ∝ tan β cos μ.
    fn sense(&self) -> f64 {
        if self.noon { -self.sign() } else { self.sign() }
    }

    /// Time since an angle before noon or midnight `[s]`.
    fn elapsed(&self, start: f64) -> f64 {
        (self.since + start) / self.rate
    }

    /// Half the arc within which Sun, Earth and satellite are less than `angle` off a line: cos a = cos(angle)/cos β.
    fn within(&self, angle: f64) -> Option<f64> {
        let cos = libm::cos(angle) / libm::cos(self.beta);
        (cos < 1.0).then(|| libm::acos(cos))
    }

    /// How far before noon or midnight nominal yaw becomes faster than `limit` `[rad/s]`, if it does: where
    /// μ' tan β cos a / (sin²a + tan²β) = limit.
    fn onset(&self, limit: f64) -> Option<f64> {
        let tan = libm::tan(libm::fabs(self.beta));
        let k = self.rate / limit * tan;
        let cos = 0.5 * (libm::sqrt(k * k + 4.0 * (1.0 + tan * tan)) - k);
        (cos < 1.0).then(|| libm::acos(cos))
    }

    /// How far nominal yaw has turned since `start` in a sense, 0…2π.
    fn turned(&self, start: f64, sense: f64) -> f64 {
        let angle = wrapped(sense * (self.nominal - start));
        if angle < 0.0 { angle + TAU } else { angle }
    }

    /// Turns at `limit` from where that is too slow, until nominal yaw is caught up with. A `bias` that the satellite
    /// adds to its Sun sensor makes it turn the other way when β is between 0 and the bias.
    fn catch_up(&self, limit: f64, bias: f64) -> Option<f64> {
        let start = self.onset(limit)?;
        let reversed = self.beta * bias > 0.0 && libm::fabs(self.beta) < libm::fabs(bias);
        let sense = if reversed { -self.sense() } else { self.sense() };
        let (from, ramp) = (self.nominal_at(-start), limit * self.elapsed(start));
        (ramp > 0.0 && ramp < self.turned(from, sense)).then_some(from + sense * ramp)
    }

    /// Turns evenly from where the shadow begins to where it ends.
    fn even_through(&self, shadow: f64) -> Option<f64> {
        let half = self.within(shadow).filter(|&half| libm::fabs(self.since) < half)?;
        let (from, to) = (self.nominal_at(-half), self.nominal_at(half));
        Some(from + wrapped(to - from) * (self.since + half) / (2.0 * half))
    }

    /// Turns at `limit` from the beginning of the shadow until the yaw of its end is reached, and waits.
    fn turn_and_wait(&self, limit: f64, shadow: f64) -> Option<f64> {
        let half = self.within(shadow).filter(|&half| libm::fabs(self.since) < half)?;
        let (from, to) = (self.nominal_at(-half), self.nominal_at(half));
        let whole = wrapped(to - from);
        let turned = (limit * self.elapsed(half)).min(libm::fabs(whole));
        Some(from + if whole < 0.0 { -turned } else { turned })
    }

    /// Turns at `limit`, such that half of the turn is made at noon or midnight: from the angle a before it that solves
    /// limit · a/μ' = atan2(sin a, tan β).
    fn centred(&self, limit: f64) -> Option<f64> {
        let tan = libm::tan(libm::fabs(self.beta));
        let (mut low, mut high) = (0.0, (FRAC_PI_2 * self.rate / limit).min(FRAC_PI_2));
        // Otherwise nominal yaw is never too fast, or the satellite is past all turns.
        if tan >= self.rate / limit || libm::fabs(self.since) >= high {
            return None;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            let behind = limit * middle / self.rate < libm::atan2(libm::sin(middle), tan);
            (low, high) = if behind { (middle, high) } else { (low, middle) };
        }
        let start = high;
        let ramp = self.sense() * limit * self.elapsed(start);
        (libm::fabs(self.since) < start).then(|| self.nominal_at(-start) + ramp)
    }

    /// As [`Turn::catch_up`] at noon, and one way through the shadow, in the sense of the bias of +0.5°.
    fn block_iia(&self, limit: f64) -> Option<f64> {
        if self.noon {
            return self.catch_up(limit, 0.5 * DEGREE);
        }
        let half = self.within(GPS_SHADOW).filter(|&half| libm::fabs(self.since) < half)?;
        Some(self.nominal_at(-half) + limit * self.elapsed(half))
    }

    /// Whether a shadow ended less than `duration` `[s]` ago.
    fn recovers_from(&self, shadow: f64, duration: f64) -> bool {
        let since_end = |half: f64| (self.since - half) / self.rate;
        !self.noon && self.within(shadow).is_some_and(|half| (0.0..duration).contains(&since_end(half)))
    }

    /// Nominal yaw with β lifted towards ±`limit`, the more so the nearer to noon or midnight.
    fn lifted(&self, limit: f64, steepness: f64) -> Option<f64> {
        let sin = libm::sin(self.mu);
        let lift = (self.sign() * limit - self.beta) / (1.0 + steepness * sin * sin * sin * sin);
        (libm::fabs(self.beta) < limit).then(|| nominal(self.beta + lift, self.mu))
    }

    /// Nominal yaw towards a Sun whose vector is kept off the orbital plane: where its components along the motion and
    /// across the plane are below sin(`along`) and sin(`across`), the latter becomes
    /// ½(±sin(across) + S) + ½(±sin(across) − S) cos(π |along| / sin(along limit)).
    fn auxiliary_sun(&self, along: f64, across: f64) -> Option<f64> {
        let (sin_beta, cos_beta) = libm::sincos(self.beta);
        let (s_along, s_across) = (cos_beta * libm::sin(self.mu), -sin_beta);
        let (limit_along, limit_across) = (libm::sin(along), libm::sin(across));
        if libm::fabs(s_along) >= limit_along || libm::fabs(s_across) >= limit_across {
            return None;
        }
        let target = -self.sign() * limit_across;
        let fade = libm::cos(PI * libm::fabs(s_along) / limit_along);
        let auxiliary = 0.5 * (target + s_across) + 0.5 * (target - s_across) * fade;
        Some(libm::atan2(auxiliary, s_along))
    }

    /// Within `half` of noon or midnight, if |β| is below `limit`: ψ = ±90° + (ψ₀ ∓ 90°) cos(2π t/period), t and ψ₀
    /// from the beginning.
    fn cosine(&self, limit: f64, half: Option<f64>, period: f64) -> Option<f64> {
        let half = half.filter(|&half| libm::fabs(self.beta) < limit && libm::fabs(self.since) < half)?;
        let from = self.nominal_at(-half);
        let middle = if from < 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
        Some(middle + (from - middle) * libm::cos(TAU * self.elapsed(half) / period))
    }
}
