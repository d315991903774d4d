//! Relative positioning with double differences while both ends move: KF, AKF and IAVAKF of one engine.
//!
//! L. Wang et al., *Integrity monitoring of moving base RTK by an adaptive Kalman filter based on integer ambiguity
//! verification* (GPS Solutions 26, 2022), with what the paper leaves open or has wrong settled as below.
//! ```text
//! x = (r, v, N₁, N₂)      r⁺ = r + h v,  q the spectral density of the acceleration
//! y = (P₁, P₂, L₁, L₂)    P = ρ_ir(r),   L = ρ_ir(r) + λ N_ir,   i minus reference
//! R₀ = 2 (σᵢ² δᵢⱼ + σ_r²) for each type of measurement                                (9)
//! R* by [`Adaptation`], β by [`Forgetting`](super::adaptive::forgetting::Forgetting)   (24)–(26)
//! integers by [`subset`], never fed back; protection levels given the integers         (27)–(31)
//! ```
//! [`RtkFilter`](crate::rtk::RtkFilter) is what a receiver runs; this filter is small, of one constellation on two bands,
//! and exact about the paper, whose claims it is made to check.
//!
//! * `remap`: satellites that come, go, or give the reference to another; nothing is lost by that.
//! * [`noise`]: R₀, ratios, R* as a whole matrix.
//! * `fix`: integers and protection levels.
//!
//! Means are `f64` whatever the scalar T of covariances. One epoch with n states and m = 4 s measurements takes about
//! m³/6 + m² n/2 + m n²/2 multiply-adds and one search for integers; with [`Options::two_passes`] the update twice.
//! Memory: N² + M² + M N scalars and the integer workspace; whole matrices R* 6 M² more, outside the filter. Stack: some
//! 100 bytes for each satellite. Panic contract: none; an epoch that fails leaves the filter as predicted.

mod fix;
pub mod noise;
mod options;
mod remap;
#[cfg(test)]
mod tests;

pub use fix::Answer;
pub use noise::WholeNoise;
pub use options::{Adaptation, Options};

use super::adaptive::forgetting::Beta;
use super::density::Density;
use super::update::{Form, Rows, Stage, UpdateError, VECTORS, Work};
use crate::integer::IntegerError;
use crate::integer::subset::SubsetWorkspace;
use crate::integrity::protection::{ConfigError, Factors};
use crate::integrity::window::NisWindow;
use crate::linalg::{LinalgError, Mat, MatMut, head, head_mut, symmetric};
use crate::real::Real;
use heapless::Vec;
use nalgebra::Vector3;
use noise::Learned;

/// Position and velocity.
pub(crate) const KINEMATIC: usize = 6;
/// P1, P2, L1, L2.
pub const TYPES: usize = 4;
/// Bands.
const BANDS: usize = 2;

/// What both receivers have of a satellite: differences rover minus base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Its number.
    pub id: u8,
    /// Its position from the base, in the frame of the state `[m]`.
    pub position: Vector3<f64>,
    /// Sine of its elevation.
    pub sin_elevation: f64,
    /// Code on both bands `[m]`.
    pub code: [f64; BANDS],
    /// Phase on both bands `[m]`.
    pub phase: [f64; BANDS],
    /// Lock was lost, or is new: its ambiguities are others than before.
    pub new_lock: bool,
}

impl Sight {
    fn is_finite(&self) -> bool {
        self.position.iter().chain([&self.sin_elevation]).chain(&self.code).chain(&self.phase).all(|x| x.is_finite())
    }
}

/// Why an epoch or a start was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoubleDifferenceError {
    /// Options contradict themselves.
    Options,
    /// Risk or alert limits contradict themselves.
    Integrity(ConfigError),
    /// The filter was not started.
    NotStarted,
    /// Fewer than two satellites, or one of them twice.
    Satellites,
    /// More satellites than there is room for.
    Capacity,
    /// A number is not finite, or a variance not positive.
    NotFinite,
    /// [`Adaptation::Residual`] and [`Adaptation::Literal`] need a [`WholeNoise`].
    NoWholeNoise,
    /// R*, or the covariance of the innovations, is not positive definite.
    Update(UpdateError),
    /// Integer estimation failed.
    Integer(IntegerError),
}

impl core::fmt::Display for DoubleDifferenceError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Options => f.write_str(
                "options contradict themselves: wavelengths, noise and bounds are above 0, bounds in order, the overbound is 1 or \
                 more, a veto not above the ratio",
            ),
            Self::Integrity(error) => error.fmt(f),
            Self::NotStarted => f.write_str("the filter was not started"),
            Self::Satellites => f.write_str("fewer than two satellites, or one of them twice"),
            Self::Capacity => f.write_str("more satellites than the filter has room for"),
            Self::NotFinite => f.write_str("a number is not finite, or a variance not positive"),
            Self::NoWholeNoise => f.write_str("R* as a whole matrix needs its memory"),
            Self::Update(error) => write!(f, "update: {error}"),
            Self::Integer(error) => write!(f, "integers: {error}"),
        }
    }
}

impl core::error::Error for DoubleDifferenceError {}

impl From<UpdateError> for DoubleDifferenceError {
    fn from(error: UpdateError) -> Self {
        Self::Update(error)
    }
}

impl From<LinalgError> for DoubleDifferenceError {
    fn from(error: LinalgError) -> Self {
        Self::Update(error.into())
    }
}

impl From<IntegerError> for DoubleDifferenceError {
    fn from(error: IntegerError) -> Self {
        Self::Integer(error)
    }
}

/// Measurement rows: geometry for each double difference, and λ on its ambiguity for phases.
struct Geometry<'a, T> {
    directions: &'a [[T; 3]],
    wavelengths: [T; BANDS],
}

impl<T: Real> Rows<T> for Geometry<'_, T> {
    fn for_each(&self, row: usize, entry: &mut dyn FnMut(usize, T)) {
        let s = self.directions.len();
        let (Some(kind), Some(i)) = (row.checked_div(s), row.checked_rem(s)) else { return };
        for (axis, &h) in self.directions.get(i).into_iter().flatten().enumerate() {
            entry(axis, h);
        }
        if let Some((band, &wavelength)) = kind.checked_sub(BANDS).and_then(|b| Some((b, self.wavelengths.get(b)?))) {
            entry(KINEMATIC + band * s + i, wavelength);
        }
    }
}

/// |s − r| − |s|, without cancellation `[m]`.
fn range_difference(satellite: &Vector3<f64>, r: &Vector3<f64>) -> f64 {
    let apart = satellite - r;
    let (x, y) = (libm::sqrt(apart.dot(&apart)), libm::sqrt(satellite.dot(satellite)));
    (r - satellite * 2.0).dot(r) / (x + y)
}

/// Direction from the satellite, ∂|s − r|/∂r.
fn direction(satellite: &Vector3<f64>, r: &Vector3<f64>) -> Vector3<f64> {
    let apart = r - satellite;
    apart / libm::sqrt(apart.dot(&apart))
}

/// The filter: A ambiguities (two for each satellite but the reference), N = A + 6 states, M = 2 A measurements at most.
/// Suits a `static`.
#[derive(Debug)]
pub struct DoubleDifferenceFilter<T, const A: usize, const N: usize, const M: usize> {
    options: Options,
    factors: Option<Factors>,
    density: Density<T, N>,
    started: bool,
    first: bool,
    /// Satellites in the order of their ambiguities, without the reference.
    satellites: Vec<u8, A>,
    reference: Option<u8>,
    /// Epochs with an update.
    epochs: u32,
    beta: Beta,
    /// Success rate of all ambiguities in the latest epoch.
    success: f64,
    assumed_success: Option<f64>,
    learned: Learned<T, M>,
    /// Of the current epoch: directions, variances of satellites for code and phase, those of the reference first.
    directions: [[T; 3]; A],
    variances: [[T; 2]; M],
    positions: Vec<Sight, A>,
    order: Vec<u8, A>,
    innovation: [T; M],
    residual: [T; M],
    noise: [[T; M]; M],
    rows: [[T; N]; M],
    vectors: [[T; N]; VECTORS],
    integers: fix::Integers<T, A>,
    workspace: SubsetWorkspace<T, A>,
    window: NisWindow<30>,
    gated: u32,
}

/// Up to 11 satellites besides the reference.
pub type DoubleDifference22<T> = DoubleDifferenceFilter<T, 22, 28, 44>;

impl<T: Real, const A: usize, const N: usize, const M: usize> DoubleDifferenceFilter<T, A, N, M> {
    const CAPACITIES_FIT: () = assert!(N == A + KINEMATIC && M == 2 * A && A >= 6 && A <= 100, "N = A + 6, M = 2 A");

    /// A filter that was not started.
    pub const fn new(options: Options) -> Self {
        let () = Self::CAPACITIES_FIT;
        Self {
            options,
            factors: None,
            density: Density::new(),
            started: false,
            first: true,
            satellites: Vec::new(),
            reference: None,
            epochs: 0,
            beta: Beta::new(options.first_beta),
            success: 0.0,
            assumed_success: None,
            learned: Learned::new(),
            directions: [[T::ZERO; 3]; A],
            variances: [[T::ZERO; 2]; M],
            positions: Vec::new(),
            order: Vec::new(),
            innovation: [T::ZERO; M],
            residual: [T::ZERO; M],
            noise: [[T::ZERO; M]; M],
            rows: [[T::ZERO; N]; M],
            vectors: [[T::ZERO; N]; VECTORS],
            integers: fix::Integers::new(),
            workspace: SubsetWorkspace::new(),
            window: NisWindow::new(),
            gated: 0,
        }
    }

    /// Starts anew from position and velocity `[m, m/s]` with these variances, without ambiguities.
    pub fn start(
        &mut self,
        state: &[f64; KINEMATIC],
        variances: &[f64; KINEMATIC],
    ) -> Result<(), DoubleDifferenceError> {
        if !self.options.is_sound() {
            return Err(DoubleDifferenceError::Options);
        }
        let factors = self.options.integrity.factors().map_err(DoubleDifferenceError::Integrity)?;
        let fits = |&variance: &f64| variance > 0.0 && T::from_f64(variance).is_finite();
        if !(state.iter().all(|x| x.is_finite()) && variances.iter().all(fits)) {
            return Err(DoubleDifferenceError::NotFinite);
        }
        let of = |i: usize, j: usize| variances.get(i).filter(|_| i == j).map_or(T::ZERO, |&x| T::from_f64(x));
        self.density.cut(KINEMATIC)?.set(state, of).commit();
        self.factors = Some(factors);
        (self.started, self.first, self.reference) = (true, true, None);
        self.satellites.clear();
        self.forget_noise();
        self.integers.clear();
        self.window.clear();
        Ok(())
    }

    /// One epoch, `step` seconds after the one before. The first one has no prediction. `whole` is for R* as a whole matrix.
    ///
    /// On an error the state is as predicted, R* begins anew from R₀ with its warm-up, and the next epoch may go on from
    /// there. Integers that cannot be found make no error: the answer is the float one.
    pub fn step(
        &mut self,
        step: f64,
        sights: &[Sight],
        mut whole: Option<&mut WholeNoise<T, M>>,
    ) -> Result<Answer, DoubleDifferenceError> {
        if !self.started {
            return Err(DoubleDifferenceError::NotStarted);
        }
        let wants_whole = matches!(self.options.adaptation, Adaptation::Residual | Adaptation::Literal);
        if wants_whole && whole.is_none() {
            return Err(DoubleDifferenceError::NoWholeNoise);
        }
        let sound = step > 0.0 && step.is_finite() && sights.iter().all(Sight::is_finite);
        if !sound {
            return Err(DoubleDifferenceError::NotFinite);
        }
        self.check_satellites(sights)?;
        self.integers.clear();
        if !self.first {
            self.predict(step)?;
        }
        self.first = false;
        let updated =
            self.remap(sights, whole.as_deref_mut()).and_then(|()| self.update_and_learn(whole.as_deref_mut()));
        if let Err(error) = updated {
            self.forget_noise();
            if let Some(whole) = whole {
                whole.forget();
            }
            return Err(error);
        }
        self.density.cut(self.states())?.commit();
        self.answer()
    }

    fn check_satellites(&self, sights: &[Sight]) -> Result<(), DoubleDifferenceError> {
        if sights.len() > A / BANDS + 1 {
            return Err(DoubleDifferenceError::Capacity);
        }
        let twice =
            sights.iter().enumerate().any(|(i, sight)| head(sights, i).iter().any(|other| other.id == sight.id));
        if sights.len() < 2 || twice { Err(DoubleDifferenceError::Satellites) } else { Ok(()) }
    }

    /// r ← r + h v and its noise, white acceleration of density q; ambiguities walk.
    fn predict(&mut self, h: f64) -> Result<(), DoubleDifferenceError> {
        let n = self.states();
        let q = self.options.motion_noise;
        let mut cut = self.density.cut(n)?;
        for axis in 0..3 {
            if let Ok([r, v]) = cut.mean.get_disjoint_mut([axis, 3 + axis]) {
                *r += h * *v;
            }
            symmetric::shear(&mut cut.p, axis, 3 + axis, T::from_f64(h));
            cut.p.add(axis, axis, T::from_f64(q * h * h * h / 3.0));
            cut.p.add(3 + axis, axis, T::from_f64(q * h * h / 2.0));
            cut.p.add(3 + axis, 3 + axis, T::from_f64(q * h));
        }
        let s = self.satellites.len();
        let walk = T::from_f64(self.options.ambiguity_walk * self.options.ambiguity_walk * h);
        if walk > T::ZERO {
            // Differences to one reference walk with it.
            for (band, i) in (0..BANDS).flat_map(|band| (0..s).map(move |i| (band, i))) {
                for j in 0..=i {
                    let both = if i == j { walk + walk } else { walk };
                    cut.p.add(KINEMATIC + band * s + i, KINEMATIC + band * s + j, both);
                }
            }
        }
        cut.commit();
        Ok(())
    }

    /// Updates once, learns R*, and if so configured updates again.
    fn update_and_learn(&mut self, mut whole: Option<&mut WholeNoise<T, M>>) -> Result<(), DoubleDifferenceError> {
        let options = self.options;
        self.linearize();
        if let Some(whole) = whole.as_deref_mut() {
            self.prior_spread(whole)?;
        }
        let learns = options.adaptation != Adaptation::Off && self.epochs >= options.warm_up;
        self.update(whole.as_deref())?;
        if learns {
            let again = self.learn_and_update(whole);
            if again.is_err() {
                self.density.cut(self.states())?.roll_back();
            }
            again?;
        }
        self.epochs = self.epochs.saturating_add(1);
        Ok(())
    }

    /// Learns from an update, and if so configured makes it anew.
    fn learn_and_update(&mut self, mut whole: Option<&mut WholeNoise<T, M>>) -> Result<(), DoubleDifferenceError> {
        let two_passes = self.options.two_passes;
        if let Some(assumed) = self.assumed_success {
            self.success = assumed;
        } else if two_passes {
            self.success = self.full_success_rate()?;
        }
        self.learn(whole.as_deref_mut())?;
        if two_passes {
            self.density.cut(self.states())?.roll_back();
            self.update(whole.as_deref())?;
        }
        Ok(())
    }

    /// Forgets what was learned.
    fn forget_noise(&mut self) {
        (self.epochs, self.success, self.beta) = (0, 0.0, Beta::new(self.options.first_beta));
        self.learned = Learned::new();
    }

    /// Directions and innovations at the predicted mean.
    fn linearize(&mut self) {
        let r = self.position();
        let Some(reference) = self.positions.first() else { return };
        let own = direction(&reference.position, &r);
        for (sight, to) in self.positions.iter().skip(1).zip(&mut self.directions) {
            let difference = direction(&sight.position, &r) - own;
            *to = [0, 1, 2].map(|axis| T::from_f64(difference[axis]));
        }
        let Self { options, positions, density, innovation, .. } = self;
        misclosures(options, positions, &density.mean, innovation);
    }

    /// One update of the prior by the noise of now. The density may be rolled back to before afterwards.
    fn update(&mut self, whole: Option<&WholeNoise<T, M>>) -> Result<(), DoubleDifferenceError> {
        self.fill_noise(whole)?;
        let (n, m, s) = (self.states(), self.measurements(), self.satellites.len());
        let wavelengths = self.options.wavelengths.map(T::from_f64);
        let geometry = Geometry { directions: head(&self.directions, s), wavelengths };
        let mut cut = self.density.cut(n)?;
        cut.begin();
        let mut noise = MatMut::new(self.noise.as_flattened_mut(), m, m, M)?;
        let innovation = head_mut(&mut self.residual, m);
        innovation.copy_from_slice(head(&self.innovation, m));
        let work = Work {
            rows: MatMut::new(self.rows.as_flattened_mut(), m, n, N)?,
            vectors: MatMut::new(self.vectors.as_flattened_mut(), VECTORS, n, N)?,
        };
        let mut stage = Stage::begin(Form::Sequential, cut.correction, cut.p.reborrow(), work)?;
        let done = stage.correlated(&geometry, 0, innovation, &mut noise).and_then(|()| stage.finish());
        match done {
            Ok(gauge) => {
                cut.correct();
                self.learned.gauge = (gauge.normalized_innovation_squared.to_f64(), gauge.rows);
                Ok(())
            }
            Err(error) => {
                cut.roll_back();
                Err(error.into())
            }
        }
    }

    /// Lets β of the coming epochs follow this success rate of all ambiguities instead of the filter's own, which depends
    /// on how they are decorrelated: to repeat what another program did.
    pub fn assume_success_rate(&mut self, success: Option<f64>) {
        self.assumed_success = success;
    }

    /// Position of the rover from the base `[m]`.
    pub fn position(&self) -> Vector3<f64> {
        Vector3::new(self.density.mean[0], self.density.mean[1], self.density.mean[2])
    }

    /// Number of states.
    fn states(&self) -> usize {
        KINEMATIC + BANDS * self.satellites.len()
    }

    /// Number of measurements.
    fn measurements(&self) -> usize {
        TYPES * self.satellites.len()
    }

    /// Mean (r, v, N₁, N₂); ambiguities in cycles, in the order of [`Self::satellites`].
    pub fn mean(&self) -> &[f64] {
        self.density.view(self.states()).0
    }

    /// Its covariance.
    pub fn covariance(&self) -> Mat<'_, T> {
        self.density.view(self.states()).1
    }

    /// Satellites of the ambiguities on each band.
    pub fn satellites(&self) -> &[u8] {
        &self.satellites
    }

    /// The reference satellite.
    pub fn reference(&self) -> Option<u8> {
        self.reference
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }
}

/// Measurements minus what the mean says of them `[m]`.
fn misclosures<T: Real>(options: &Options, positions: &[Sight], mean: &[f64], to: &mut [T]) {
    let s = positions.len().saturating_sub(1);
    let (Some(reference), [x, y, z, ..]) = (positions.first(), mean) else { return };
    let r = Vector3::new(*x, *y, *z);
    let to_reference = range_difference(&reference.position, &r);
    for (i, sight) in positions.iter().skip(1).enumerate() {
        let computed = range_difference(&sight.position, &r) - to_reference;
        for (band, wavelength) in options.wavelengths.iter().enumerate() {
            let (code, phase) = differences(sight, reference, band);
            let ambiguity = mean.get(KINEMATIC + band * s + i).copied().unwrap_or(0.0);
            for (kind, value) in [(band, code - computed), (BANDS + band, phase - computed - wavelength * ambiguity)] {
                if let Some(to) = to.get_mut(kind * s + i) {
                    *to = T::from_f64(value);
                }
            }
        }
    }
}

/// Code and phase double differences on a band `[m]`.
fn differences(sight: &Sight, reference: &Sight, band: usize) -> (f64, f64) {
    let of = |values: &[f64; BANDS]| values.get(band).copied().unwrap_or(0.0);
    (of(&sight.code) - of(&reference.code), of(&sight.phase) - of(&reference.phase))
}
