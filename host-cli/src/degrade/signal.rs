//! What becomes of one signal of one satellite.

use super::body::{Reflector, View};
use super::events::{Event, What};
use super::scenario::Scenario;
use crate::simulate::errors::GaussMarkov;
use crate::simulate::thousandths;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use surefix_core::gnss::epoch::Observation;
use surefix_core::gnss::time::GpsTime;

/// A reflected field stays below this part of the direct one: the phase then stays below λ/4.
const WEAKER: f64 = 0.95;
/// Greatest change of an ambiguity at a new lock `[cycles]`.
const NEW_LOCK: u32 = 1_000;

/// A signal: its own random numbers, its ambiguity against that in the input.
pub struct Channel {
    rng: ChaCha8Rng,
    /// Carrier wavelength `[m]`.
    wavelength: f64,
    /// In-phase and quadrature part of the reflected field.
    field: GaussMarkov,
    /// Cycles added to the phase.
    cycles: f64,
    /// What the phase was locked to, once it was.
    locked: Option<Lock>,
    /// Whether that lock was lost.
    lost: bool,
    /// A loss of lock in an observation that was taken away, still to be told.
    untold: bool,
    /// Latest epoch seen.
    last: Option<GpsTime>,
}

/// What a phase follows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lock {
    /// The direct signal.
    Direct,
    /// A reflection.
    Reflected,
}

impl Channel {
    /// A signal not seen yet.
    pub fn new(rng: ChaCha8Rng, wavelength: f64) -> Self {
        let field = GaussMarkov::default();
        Self { rng, wavelength, field, cycles: 0.0, locked: None, lost: false, untold: false, last: None }
    }

    /// What is left of an observation; `None` if nothing is. Jumps of the ambiguity are added to `events`.
    pub fn degrade(
        &mut self,
        time: GpsTime,
        input: &Observation,
        view: &View,
        scenario: &Scenario,
        events: &mut Vec<Event>,
    ) -> Option<Observation> {
        let step = self.last.map_or(0.0, |last| time.since(last));
        self.last = Some(time);
        let field = self.field.next(time, scenario.reflections.time_s, &mut self.rng);
        let mut output = Observation { loss_of_lock: input.loss_of_lock || self.untold, ..*input };
        self.untold = false;
        match view {
            View::Open => {}
            View::Between { amplitude, delay } => self.reflect(&mut output, field, *amplitude, *delay, scenario),
            View::Reflected(reflector) => self.follow(&mut output, reflector),
            View::Hidden => {
                self.untold = output.loss_of_lock;
                self.lost = self.locked.is_some();
                return None;
            }
        }
        if input.phase.is_none() {
            return Some(output);
        }
        if output.phase.is_none() {
            self.lost = self.locked.is_some();
            self.untold = output.loss_of_lock;
            output.loss_of_lock = false;
            return Some(output);
        }
        let lock = if matches!(view, View::Reflected(_)) { Lock::Reflected } else { Lock::Direct };
        let before = self.locked.replace(lock);
        if self.lost || before.is_some_and(|before| before != lock) {
            let size = f64::from(self.rng.random_range(1..=NEW_LOCK));
            let flagged = self.rng.random_bool(scenario.slips.reacquired_flagged);
            output.loss_of_lock |= flagged;
            self.jump(time, input, What::Reacquired, size, flagged, events);
        } else if before.is_some() && matches!(view, View::Between { .. }) {
            let probability = 1.0 - (-scenario.slips.per_hour * step / 3600.0).exp();
            if self.rng.random_bool(probability.clamp(0.0, 1.0)) {
                let size = f64::from(self.rng.random_range(1..=scenario.slips.largest.max(1)));
                self.jump(time, input, What::Slip, size, false, events);
            }
        }
        self.lost = false;
        if self.cycles != 0.0 {
            output.phase = output.phase.map(|phase| thousandths(phase + self.cycles));
        }
        Some(output)
    }

    /// The direct signal with a reflection.
    fn reflect(&self, output: &mut Observation, field: [f64; 2], amplitude: f64, delay: f64, scenario: &Scenario) {
        let [real, imaginary] = field.map(|part| part * amplitude / std::f64::consts::SQRT_2);
        let size = real.hypot(imaginary);
        let shrink = if size > WEAKER { WEAKER / size } else { 1.0 };
        let [real, imaginary] = [real, imaginary].map(|part| shrink * part);
        let cycles = imaginary.atan2(1.0 + real) / std::f64::consts::TAU;
        let gain = 20.0 * imaginary.hypot(1.0 + real).log10() - scenario.reflections.cn0_drop_db;
        output.code = output.code.map(|code| thousandths(code + delay * real));
        output.phase = output.phase.map(|phase| thousandths(phase + cycles));
        output.cn0 = output.cn0.map(|cn0| weaker(cn0, -gain));
    }

    /// Only a reflection.
    fn follow(&self, output: &mut Observation, reflector: &Reflector) {
        let [excess, rate] = [reflector.excess, reflector.rate].map(|length| length / self.wavelength);
        output.code = output.code.map(|code| thousandths(code + reflector.excess));
        output.phase = output.phase.filter(|_| reflector.phase).map(|phase| thousandths(phase + excess));
        output.doppler = output.doppler.map(|doppler| thousandths(doppler - rate));
        output.cn0 = output.cn0.map(|cn0| weaker(cn0, reflector.cn0_drop));
    }

    /// Changes the ambiguity by `size`, up or down.
    fn jump(&mut self, time: GpsTime, of: &Observation, what: What, size: f64, flagged: bool, events: &mut Vec<Event>) {
        let size = if self.rng.random_bool(0.5) { size } else { -size };
        self.cycles += size;
        let (satellite, signal) = (Some(of.satellite), Some(of.signal));
        events.push(Event { time, satellite, signal, what, size, flagged: Some(flagged) });
    }
}

/// C/N0 `[dB-Hz]` with so much less `[dB]`, as files have it.
fn weaker(cn0: f32, loss: f64) -> f32 {
    thousandths((f64::from(cn0) - loss).max(0.001)) as f32
}
