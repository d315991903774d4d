//! A drive and its filter, whose epochs a [`FixedLag`] smooths: the example of a smoother on a target.
//!
//! A receiver drives a circle. Up to [`SATELLITES`] satellites are tracked by code and phase, differenced with a base close
//! by; e is the direction to a satellite, λ the wavelength:
//! ```text
//! x = (p, v, c; n_1 … n_s)      ENU [m], [m/s], clock [m], ambiguities [cycles]
//! y_P = −eᵀ p + c + ε_P,    y_Φ = −eᵀ p + c + λ n + ε_Φ
//! ```
//! Satellites rise and set, and slip now and then, all of which a lock-time indicator tells: rows of the [`Step`] are born
//! and left out. The clock is born anew at each epoch. Noise comes from a linear congruential generator, so that the drive
//! is the same on every machine.
//!
//! This file needs nothing but the core and `random.rs`: the test that compares host and target includes both too.

use crate::random::Noise;
use core::fmt;
use heapless::Vec;
use surefix_core::linalg::MatMut;
use surefix_core::linalg::sequential::{Row, update_scalar};
use surefix_core::model::motion::Motion;
use surefix_core::real::Real;
use surefix_core::smooth::fixed_lag::{FixedLag, FixedLagError, packed};
use surefix_core::smooth::predict::predict;
use surefix_core::smooth::rts::buffer_len;
use surefix_core::smooth::step::{Block, SparseMap, Step};
use surefix_core::smooth::{Moments, MomentsMut, SmoothError};

/// Epochs of the drive.
pub const EPOCHS: u32 = 120;
/// The smoother looks so many epochs back.
pub const LAG: usize = 10;
/// Most satellites.
const SATELLITES: usize = 8;
/// Position, velocity and clock.
const AMBIGUITIES_FROM: usize = 7;
const CLOCK: usize = 6;
/// Most states.
pub const STATES: usize = AMBIGUITIES_FROM + SATELLITES;
/// Most entries of F: position and velocity, and each ambiguity that lives on.
const ENTRIES: usize = 9 + SATELLITES;
/// Most blocks of Q: the axes and the clock, and the ambiguities born at one epoch, of which there are many at the start
/// only.
const BLOCKS_AT_START: usize = 4 + SATELLITES;
const BLOCKS: usize = 8;

/// Time between epochs `[s]`.
const INTERVAL: f64 = 1.0;
/// Wavelength of the carrier `[m]`.
const WAVELENGTH: f64 = 0.19;
/// Radius of the circle `[m]`, and the angle driven in an epoch `[rad]`.
const CIRCLE: (f64, f64) = (40.0, 0.08);
/// Power spectral density of the acceleration `[m²/s³]`.
const ACCELERATION: f64 = 0.1;
/// Standard deviations of code and phase `[m]`.
const SIGMAS: [f64; 2] = [0.3, 0.003];
/// Standard deviations before the first measurement: position `[m]`, velocity `[m/s]`, clock `[m]`, ambiguity `[cycles]`.
const PRIOR_POSITION: f64 = 3.0;
const PRIOR_VELOCITY: f64 = 3.0;
const PRIOR_CLOCK: f64 = 3.0;
const PRIOR_AMBIGUITY: f64 = 10.0;

/// The ring of this drive.
pub type Ring<T> =
    FixedLag<T, { LAG + 1 }, STATES, { packed(STATES) }, { buffer_len(STATES, STATES) }, ENTRIES, BLOCKS>;

/// Why an epoch failed; no epoch of this drive does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveError {
    /// More states, entries or blocks than there is room for.
    Capacity,
    /// The filter failed.
    Filter(SmoothError),
    /// The smoother failed.
    Smoother(FixedLagError),
}

impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capacity => f.write_str("no room for the step"),
            Self::Filter(error) => error.fmt(f),
            Self::Smoother(error) => error.fmt(f),
        }
    }
}

impl From<SmoothError> for DriveError {
    fn from(error: SmoothError) -> Self {
        Self::Filter(error)
    }
}

impl From<FixedLagError> for DriveError {
    fn from(error: FixedLagError) -> Self {
        Self::Smoother(error)
    }
}

/// The position at an epoch, starting at the origin `[m]`.
pub fn position(epoch: u32) -> [f64; 3] {
    let (radius, rate) = CIRCLE;
    let angle = rate * f64::from(epoch);
    [radius * libm::sin(angle), radius * (1.0 - libm::cos(angle)), 0.0]
}

/// The direction to a satellite at an epoch, ENU.
fn direction(satellite: usize, epoch: u32) -> [f64; 3] {
    let azimuth = 2.4 * satellite as f64 + 1.5e-4 * f64::from(epoch);
    let elevation = 0.35 + 0.14 * satellite as f64;
    let horizontal = libm::cos(elevation);
    [horizontal * libm::sin(azimuth), horizontal * libm::cos(azimuth), libm::sin(elevation)]
}

/// Whether a satellite is in view: it hides for 20 epochs of 97.
fn in_view(satellite: usize, epoch: u32) -> bool {
    (epoch as usize + 23 * satellite) % 97 >= 20
}

/// Whether a satellite slips at an epoch.
fn slips(satellite: usize, epoch: u32) -> bool {
    epoch % 31 == 30 && (epoch / 31) as usize % SATELLITES == satellite
}

/// A step, as it is put together.
struct StepParts<T> {
    ends: Vec<usize, STATES>,
    entries: Vec<(usize, T), ENTRIES>,
    offset: Vec<T, STATES>,
    blocks: Vec<Block<T>, BLOCKS_AT_START>,
}

impl<T: Real> StepParts<T> {
    /// Position and velocity move on, the clock is born.
    fn motion() -> Result<Self, DriveError> {
        let mut parts = Self { ends: Vec::new(), entries: Vec::new(), offset: Vec::new(), blocks: Vec::new() };
        let noise = Motion::Velocity.process_noise(INTERVAL, 1.0).map(|row| row.map(T::from_f64));
        for axis in 0..3 {
            parts.row(&[(axis, T::ONE), (axis + 3, T::from_f64(INTERVAL))])?;
            parts.block(Block {
                states: [axis, axis + 3, 0],
                dim: 2,
                shape: noise,
                scale: T::from_f64(ACCELERATION),
                component: Some(0),
            })?;
        }
        (3..6).try_for_each(|velocity| parts.row(&[(velocity, T::ONE)]))?;
        parts.birth(PRIOR_CLOCK)?;
        Ok(parts)
    }

    /// The next state of x⁺ from states of x.
    fn row(&mut self, entries: &[(usize, T)]) -> Result<(), DriveError> {
        self.entries.extend_from_slice(entries).map_err(|_| DriveError::Capacity)?;
        self.ends.push(self.entries.len()).map_err(|_| DriveError::Capacity)?;
        self.offset.push(T::ZERO).map_err(|_| DriveError::Capacity)
    }

    /// The next state of x⁺ from nothing.
    fn birth(&mut self, sigma: f64) -> Result<(), DriveError> {
        let state = self.ends.len();
        self.row(&[])?;
        let shape = [[T::ONE, T::ZERO, T::ZERO], [T::ZERO; 3], [T::ZERO; 3]];
        self.block(Block { states: [state, 0, 0], dim: 1, shape, scale: T::from_f64(sigma * sigma), component: None })
    }

    fn block(&mut self, block: Block<T>) -> Result<(), DriveError> {
        self.blocks.push(block).map_err(|_| DriveError::Capacity)
    }

    fn step(&self, columns: usize) -> Step<'_, T> {
        let map = SparseMap { ends: &self.ends, entries: &self.entries, columns };
        Step { map, offset: &self.offset, noise: &self.blocks }
    }
}

/// N(m, P), P packed by rows of n.
#[derive(Clone, Copy, Debug)]
struct Density<T> {
    n: usize,
    mean: [T; STATES],
    covariance: [T; STATES * STATES],
}

impl<T: Real> Density<T> {
    const EMPTY: Self = Self { n: 0, mean: [T::ZERO; STATES], covariance: [T::ZERO; STATES * STATES] };

    /// Position, velocity and clock before the first epoch.
    fn prior() -> Self {
        let mut prior = Self { n: AMBIGUITIES_FROM, ..Self::EMPTY };
        let sigmas = [[PRIOR_POSITION; 3], [PRIOR_VELOCITY; 3]].into_iter().flatten().chain([PRIOR_CLOCK]);
        let diagonal = prior.covariance.iter_mut().step_by(AMBIGUITIES_FROM + 1);
        diagonal.zip(sigmas).for_each(|(variance, sigma)| *variance = T::from_f64(sigma * sigma));
        prior
    }

    fn moments(&self) -> Result<Moments<'_, T>, SmoothError> {
        Moments::packed(self.mean.get(..self.n).unwrap_or_default(), &self.covariance)
    }

    fn moments_mut(&mut self) -> Result<MomentsMut<'_, T>, SmoothError> {
        MomentsMut::packed(self.mean.get_mut(..self.n).unwrap_or_default(), &mut self.covariance)
    }
}

/// The world, the filter and the smoother, for a `static`.
pub struct Drive<T> {
    epoch: u32,
    noise: Noise,
    /// The true ambiguities.
    cycles: [f64; SATELLITES],
    /// Which satellites have a state.
    tracked: [bool; SATELLITES],
    filtered: Density<T>,
    predicted: Density<T>,
    work: [T; STATES * STATES],
    ring: Ring<T>,
}

impl<T: Real> Default for Drive<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Drive<T> {
    /// Before the first epoch: all zero, so that a `static` takes no flash.
    pub const fn new() -> Self {
        Self {
            epoch: 0,
            noise: Noise::new(0),
            cycles: [0.0; SATELLITES],
            tracked: [false; SATELLITES],
            filtered: Density::EMPTY,
            predicted: Density::EMPTY,
            work: [T::ZERO; STATES * STATES],
            ring: Ring::new(),
        }
    }

    /// Drives to the next epoch, filters its measurements and stores the outcome in the ring. Returns the position
    /// filtered.
    pub fn advance(&mut self) -> Result<[f64; 3], DriveError> {
        let is_first = self.epoch == 0;
        if is_first {
            self.noise = Noise::new(2023);
            self.filtered = Density::prior();
        }
        let parts = self.change_satellites()?;
        let step = parts.step(self.filtered.n);
        let (before, after) = (step.map.columns, step.map.rows());
        self.predicted.n = after;
        let mut predicted = self.predicted.moments_mut()?;
        let mut work = MatMut::new(&mut self.work, after, before, before).map_err(SmoothError::from)?;
        predict(&step, self.filtered.moments()?, &mut predicted, &mut work)?;
        predicted.covariance.mirror_lower();
        core::mem::swap(&mut self.filtered, &mut self.predicted);
        self.measure()?;
        self.ring.push(Some(&step).filter(|_| !is_first), self.filtered.moments()?)?;
        self.epoch += 1;
        Ok(position_of(&self.filtered.mean))
    }

    /// The density [`LAG`] epochs before the latest one; `None` before there were so many.
    pub fn smooth(&mut self) -> Option<Result<Moments<'_, T>, DriveError>> {
        let is_ready = self.ring.len() > LAG;
        is_ready.then(|| self.ring.smooth(LAG).map_err(DriveError::from))
    }

    /// The step to this epoch, with the satellites in view.
    fn change_satellites(&mut self) -> Result<StepParts<T>, DriveError> {
        let mut parts = StepParts::motion()?;
        let mut state = AMBIGUITIES_FROM;
        for (satellite, (tracked, cycles)) in self.tracked.iter_mut().zip(&mut self.cycles).enumerate() {
            let (was_tracked, is_in_view) = (*tracked, in_view(satellite, self.epoch));
            if was_tracked && is_in_view && !slips(satellite, self.epoch) {
                parts.row(&[(state, T::ONE)])?;
            } else if is_in_view {
                *cycles = self.noise.cycles();
                parts.birth(PRIOR_AMBIGUITY)?;
            }
            state += usize::from(was_tracked);
            *tracked = is_in_view;
        }
        Ok(parts)
    }

    /// Measures code and phase of each satellite, and takes them into the filter.
    fn measure(&mut self) -> Result<(), DriveError> {
        let truth = position(self.epoch);
        let clock = PRIOR_CLOCK * self.noise.normal();
        let mut density = self.filtered.moments_mut()?;
        let gain = self.work.get_mut(..density.mean.len()).unwrap_or_default();
        let in_view = self.tracked.iter().zip(&self.cycles).enumerate().filter(|(_, (tracked, _))| **tracked);
        for (ambiguity, (satellite, (_, &cycles))) in (AMBIGUITIES_FROM..).zip(in_view) {
            let [east, north, up] = direction(satellite, self.epoch);
            let range = clock - (east * truth[0] + north * truth[1] + up * truth[2]);
            for (wavelength, sigma) in [0.0, WAVELENGTH].into_iter().zip(SIGMAS) {
                let measured = range + wavelength * cycles + sigma * self.noise.normal();
                let states = [0, 1, 2, CLOCK, ambiguity];
                let row = [-east, -north, -up, 1.0, wavelength].map(T::from_f64);
                let predicted = states.iter().zip(row).filter_map(|(&i, h)| density.mean.get(i).map(|&x| h * x));
                let innovation = predicted.fold(T::from_f64(measured), |sum, term| sum - term);
                let row = Row::Sparse { indices: &states, values: &row };
                let variance = T::from_f64(sigma * sigma);
                update_scalar(density.mean, &mut density.covariance, row, innovation, variance, gain)
                    .map_err(SmoothError::from)?;
            }
        }
        Ok(())
    }
}

/// The first three states.
pub fn position_of<T: Real>(mean: &[T]) -> [f64; 3] {
    mean.first_chunk().map(|first: &[T; 3]| first.map(T::to_f64)).unwrap_or_default()
}

/// Gives `sink` a density as bytes, all that counts of it: means and lower triangle as `f64`, little endian.
pub fn write<T: Real, E>(density: Moments<'_, T>, mut sink: impl FnMut(&[u8]) -> Result<(), E>) -> Result<(), E> {
    density.mean.iter().try_for_each(|number| sink(&number.to_f64().to_le_bytes()))?;
    for i in 0..density.covariance.rows() {
        let row = density.covariance.row(i).iter().take(i + 1);
        row.copied().try_for_each(|number| sink(&number.to_f64().to_le_bytes()))?;
    }
    Ok(())
}
