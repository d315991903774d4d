//! The variances of process and measurements: what is learned, by which scheme, and the M-step of each.
//!
//! B = E[e²] of a row is (26) of Zhang et al. (2020), C = E[qᵀ shape⁻¹ q] of a step (24); see `findings` for what the paper
//! prints and what is meant. With r_g the mean of B over the pool g of a row:
//!
//! | scheme | R of a row | Q of a step |
//! |---|---|---|
//! | `epoch` (the paper's) | B | C/dim |
//! | pooled (`type`, `satellite`, `elevation`) | r_g | mean of C/dim |
//! | `window` | mean of B of the satellite, ±w epochs | mean of C/dim, ±w steps |
//! | `map`: inverse gamma about the pool | ((ν + 2) r_g + B)/(ν + 3) | ((ν + 2) q + C)/(ν + 2 + dim) |
//! | `student-t` | s²/u, u = (ν + 1)/(ν + B/s²), then s² = mean of u B | |
//!
//! `epoch` has one sample for each variance: its covariances cannot be used, [`Measurements::warning`]. Variances are held
//! above floors; a variance of 0 stays 0, exactly. Rows may have a shape: then B/shape takes the place of B, and R is the
//! above times the shape.

use super::pools::{Pools, Rule};
use super::tape::{Kind, Tape};
use super::{Class, Options};
use crate::smooth::model::{Parameter, Sums};
use std::collections::HashMap;

/// How variances of measurements are learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measurements {
    /// Not at all: as the engine has them.
    Fixed,
    /// One for each measurement, (27) of the paper.
    Epoch,
    /// One for each pool.
    Pooled(Rule),
    /// The mean of the satellite, signal and kind over so many epochs to either side.
    Window(usize),
    /// The mode under an inverse gamma distribution of ν degrees of freedom about the elevation pool.
    Map(f64),
    /// Student-t distributed errors of ν degrees of freedom with the scale of the elevation pool (variational EM).
    StudentT(f64),
}

impl Measurements {
    /// What has to be said of an answer.
    pub fn warning(self) -> Option<&'static str> {
        (self == Self::Epoch).then_some(
            "one variance for each measurement has one sample each: the covariances of this solution are far too small \
             and must not be used; take the default scheme for an answer with an accuracy",
        )
    }

    /// Whether EM on the parameters alone makes sense: pools.
    pub fn is_pooled(self) -> bool {
        matches!(self, Self::Fixed | Self::Pooled(_) | Self::StudentT(_))
    }

    /// Whether the M-step maximises the likelihood itself, so that ℓ never rises.
    pub fn is_likelihood(self) -> bool {
        matches!(self, Self::Fixed | Self::Epoch | Self::Pooled(_))
    }

    fn rule(self) -> Rule {
        match self {
            Self::Pooled(rule) => rule,
            Self::Map(_) | Self::StudentT(_) => Rule::Elevation,
            _ => Rule::Type,
        }
    }
}

/// How the variances of a class of process noise are learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Process {
    /// Not at all.
    Fixed,
    /// One for each step, (27) of the paper.
    Epoch,
    /// One for all steps.
    Pooled,
    /// The mean over so many steps to either side.
    Window(usize),
    /// The mode under an inverse gamma distribution of ν degrees of freedom about the mean of all steps.
    Map(f64),
}

impl Process {
    fn is_per_step(self) -> bool {
        matches!(self, Self::Epoch | Self::Window(_) | Self::Map(_))
    }

    /// Whether the M-step maximises the likelihood itself.
    pub fn is_likelihood(self) -> bool {
        matches!(self, Self::Fixed | Self::Epoch | Self::Pooled)
    }
}

/// A component of process noise: a class, and of the motion one axis of it.
#[derive(Clone, Copy, Debug)]
struct Component {
    class: Class,
    process: Process,
    /// Index of its first parameter, that of step 0 if it has one for each step.
    first: usize,
}

/// All variances.
#[derive(Clone, Debug)]
pub struct Noise {
    parameters: Vec<Parameter>,
    components: Vec<Component>,
    steps: usize,
    measurements: Measurements,
    pools: Pools,
    first_pool: usize,
    floors: [f64; 2],
    kinds: Vec<Kind>,
    /// Shape of each row: what its variance is in units of its pool's.
    shapes: Vec<f64>,
    /// u of each row: how far it is trusted.
    trust: Vec<f64>,
    /// R of each row `[m²]`.
    rows: Vec<f64>,
    /// By how much errors that last make R larger, codes and phases.
    correlation: [f64; 2],
    /// Whether R stays as it is.
    frozen: bool,
    /// What the last M-step of [`Measurements::Map`] and [`Process::Map`] had as centres: by pool, by component.
    centres: [Vec<f64>; 2],
}

/// Bounds of parameters that nothing else bounds: variances of 1e-15 m to 1e6 m.
const BOUNDS: [f64; 2] = [1e-30, 1e12];

impl Noise {
    /// The start.
    pub fn new(tape: &Tape, options: &Options, active: &[bool]) -> Self {
        let steps = tape.epochs.len().saturating_sub(1);
        let mut parameters = Vec::new();
        let mut components = Vec::new();
        for class in Class::ALL {
            let walk = options.walk(class);
            let (axes, unit): (&[&str], _) = match class {
                Class::Motion => (&[" x", " y", " z"], options.motion.unit()),
                _ => (&[""], "m/√s"),
            };
            for axis in axes {
                let variance = walk.sigma * walk.sigma;
                let (per_step, learned) =
                    (walk.learned.is_per_step(), walk.learned != Process::Fixed && variance > 0.0);
                components.push(Component { class, process: walk.learned, first: parameters.len() });
                for step in 0..if per_step { steps } else { 1 } {
                    let step = if per_step { format!(", step {step}") } else { String::new() };
                    let name = format!("{}{axis}{step}", class.name());
                    let bounds = [options.process_floor.max(BOUNDS[0]), BOUNDS[1]];
                    parameters.push(Parameter { name, unit, variance, bounds, learned });
                }
            }
        }
        let start = |i: usize| {
            let row = &tape.rows[i];
            options.start.map_or(row.variance, |sigmas| sigmas[row.kind as usize].powi(2))
        };
        let rows: Vec<f64> = (0..tape.rows.len()).map(start).collect();
        let pools = Pools::new(tape, active, options.measurements.rule(), options.minimum);
        let first_pool = parameters.len();
        let floors = options.floors.map(|sigma| sigma * sigma);
        let scales = pools.means(|i| rows[i] / tape.rows[i].shape, |_| 1.0);
        for (pool, variance) in pools.list().iter().zip(scales) {
            let bounds = [floors[pool.kind as usize].max(BOUNDS[0]), BOUNDS[1]];
            let learned = options.measurements != Measurements::Fixed;
            parameters.push(Parameter { name: pool.name.clone(), unit: "m", variance, bounds, learned });
        }
        let (kinds, trust) = (tape.rows.iter().map(|row| row.kind).collect(), vec![1.0; rows.len()]);
        let (measurements, shapes) = (options.measurements, tape.rows.iter().map(|row| row.shape).collect());
        let centres = [Vec::new(), Vec::new()];
        let mut noise = Self {
            parameters,
            components,
            steps,
            measurements,
            pools,
            first_pool,
            floors,
            kinds,
            shapes,
            trust,
            rows,
            correlation: [1.0; 2],
            frozen: false,
            centres,
        };
        noise.spread();
        noise
    }

    /// All parameters: of process noise, then of pools.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Sets all parameters.
    pub fn set(&mut self, variances: &[f64]) {
        self.parameters.iter_mut().zip(variances).for_each(|(parameter, &variance)| parameter.variance = variance);
        self.spread();
    }

    /// The pools.
    pub fn pools(&self) -> &Pools {
        &self.pools
    }

    /// Variance of a pool `[m²]`; of [`Measurements::StudentT`] s².
    pub fn pool_variance(&self, pool: usize) -> f64 {
        self.parameters.get(self.first_pool + pool).map_or(f64::NAN, |parameter| parameter.variance)
    }

    /// What a row's pool says of its variance `[m²]`; of [`Measurements::StudentT`] s² of the row.
    pub fn scale(&self, row: usize) -> f64 {
        self.pool_variance(self.pools.of(row)) * self.shapes.get(row).copied().unwrap_or(1.0)
    }

    /// R of a row `[m²]`.
    pub fn row(&self, row: usize) -> f64 {
        self.rows.get(row).copied().unwrap_or(f64::NAN)
    }

    /// u of a row: 1 but for [`Measurements::StudentT`], where it is small for outliers.
    pub fn trust(&self, row: usize) -> f64 {
        self.trust.get(row).copied().unwrap_or(1.0)
    }

    /// Trusts all rows alike: for other measurements than those that were learned from.
    pub fn trust_all(&mut self) {
        self.trust.fill(1.0);
        self.spread();
    }

    /// Index and variance (or spectral density) of the parameter of a class (and axis) in a step.
    pub fn process(&self, class: Class, axis: usize, step: usize) -> (usize, f64) {
        let found = self.components.iter().filter(|component| component.class == class).nth(axis);
        let index = found.map_or(0, |c| c.first + if c.process.is_per_step() { step } else { 0 });
        (index, self.parameters.get(index).map_or(0.0, |parameter| parameter.variance))
    }

    /// Variances (or spectral densities) of a class and axis: one for each step, or one.
    pub fn history(&self, class: Class, axis: usize) -> impl Iterator<Item = f64> + '_ {
        let found = self.components.iter().filter(move |component| component.class == class).nth(axis);
        let range = found.map_or(0..0, |c| c.first..c.first + if c.process.is_per_step() { self.steps } else { 1 });
        self.parameters[range].iter().map(|parameter| parameter.variance)
    }

    /// Sets the variance of a class in all steps and axes; 0 is never learned again.
    pub fn set_class(&mut self, class: Class, variance: f64) {
        for component in self.components.iter().filter(|component| component.class == class) {
            let count = if component.process.is_per_step() { self.steps } else { 1 };
            for parameter in self.parameters.iter_mut().skip(component.first).take(count) {
                parameter.variance = variance;
                parameter.learned &= variance > 0.0;
            }
        }
    }

    /// Sets R of all rows `[m²]`: for those who know it, and for schemes without pools.
    pub fn set_rows(&mut self, variances: &[f64]) {
        self.rows.clear();
        self.rows.extend_from_slice(variances);
    }

    /// R of the rows from their pools, where they have it from there.
    fn spread(&mut self) {
        if !matches!(self.measurements, Measurements::Pooled(_) | Measurements::StudentT(_)) {
            return;
        }
        for i in 0..self.rows.len() {
            let factor = self.correlation[self.kinds[i] as usize];
            self.rows[i] = self.floored(i, self.scale(i) / self.trust[i]) * factor;
        }
    }

    /// Multiplies R by what errors that last make of it, codes and phases, and learns no R any more. Only of schemes with pools.
    pub fn correlate(&mut self, factors: [f64; 2]) {
        if matches!(self.measurements, Measurements::Pooled(_) | Measurements::StudentT(_)) {
            (self.correlation, self.frozen) = (factors, true);
            self.spread();
        }
    }

    /// Whether any process noise is learned.
    pub fn learns_process(&self) -> bool {
        self.parameters.iter().take(self.first_pool).any(|parameter| parameter.learned)
    }

    /// Those factors.
    pub fn correlation(&self) -> [f64; 2] {
        self.correlation
    }

    fn floored(&self, row: usize, variance: f64) -> f64 {
        variance.max(self.floors[self.kinds[row] as usize])
    }

    /// Adds what a row with E[e²] = `square` says of the pools that learn from it.
    pub fn gather(&self, row: usize, square: f64, sums: &mut Sums) {
        if self.measurements.is_pooled() {
            sums.add(self.first_pool + self.pools.of(row), self.trust(row) * square / self.shapes[row], 1.0);
        }
    }

    /// The M-step. `squares` is B of each row, NaN of those that were not used; `sums` has C of the steps.
    pub fn maximize(&mut self, tape: &Tape, squares: &[f64], sums: &Sums) {
        self.maximize_process(sums);
        if self.frozen {
            return;
        }
        let floored = |noise: &Self, rows: &mut dyn FnMut(usize) -> f64| -> Vec<f64> {
            let of = |i: usize| if squares[i].is_nan() { noise.rows[i] } else { noise.floored(i, rows(i)) };
            (0..squares.len()).map(of).collect()
        };
        match self.measurements {
            Measurements::Fixed => {}
            Measurements::Epoch => self.rows = floored(self, &mut |i| squares[i]),
            Measurements::Pooled(_) => {
                let means = self.pool_means(|i| squares[i] / self.shapes[i]);
                self.set_pools(&means);
                self.spread();
            }
            Measurements::Window(width) => {
                let unit: Vec<f64> = squares.iter().zip(&self.shapes).map(|(square, shape)| square / shape).collect();
                let means = window(tape, &unit, width);
                self.rows = floored(self, &mut |i| means[i] * self.shapes[i]);
            }
            Measurements::Map(nu) => {
                let means = self.pool_means(|i| squares[i] / self.shapes[i]);
                self.set_pools(&means);
                let mode = |i: usize| ((nu + 2.0) * means[self.pools.of(i)] * self.shapes[i] + squares[i]) / (nu + 3.0);
                self.rows = floored(self, &mut |i| mode(i));
                self.centres[0] = means;
            }
            Measurements::StudentT(nu) => {
                for (i, &square) in squares.iter().enumerate().filter(|(_, square)| !square.is_nan()) {
                    self.trust[i] = (nu + 1.0) / (nu + square / self.scale(i));
                }
                let means = self.pool_means(|i| self.trust[i] * squares[i] / self.shapes[i]);
                self.set_pools(&means);
                self.spread();
            }
        }
    }

    fn pool_means(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.pools.means(value, |pool| self.pool_variance(pool))
    }

    fn set_pools(&mut self, variances: &[f64]) {
        for (parameter, &variance) in self.parameters.iter_mut().skip(self.first_pool).zip(variances) {
            parameter.variance = variance.clamp(parameter.bounds[0], parameter.bounds[1]);
        }
    }

    fn maximize_process(&mut self, sums: &Sums) {
        self.centres[1] = vec![f64::NAN; self.components.len()];
        for (nth, component) in self.components.iter().enumerate() {
            let count = if component.process.is_per_step() { self.steps } else { 1 };
            let range = component.first..component.first + count;
            let (quadratic, counts) = (&sums.quadratic[range.clone()], &sums.count[range.clone()]);
            let mean = |range: std::ops::Range<usize>| {
                let number: f64 = counts[range.clone()].iter().sum();
                (number > 0.0).then(|| quadratic[range].iter().sum::<f64>() / number)
            };
            let all = mean(0..count);
            if let (Some(all), Process::Map(_)) = (all, component.process) {
                self.centres[1][nth] = all;
            }
            for (i, parameter) in self.parameters[range].iter_mut().enumerate().filter(|(_, p)| p.learned) {
                let new = match component.process {
                    Process::Fixed => None,
                    Process::Pooled => all,
                    Process::Epoch => mean(i..i + 1),
                    Process::Window(width) => mean(i.saturating_sub(width)..(i + width + 1).min(count)),
                    Process::Map(nu) => all.map(|all| {
                        let (c, dim) = (quadratic[i], counts[i]);
                        ((nu + 2.0) * all + c) / (nu + 2.0 + dim)
                    }),
                };
                if let Some(new) = new {
                    parameter.variance = new.clamp(parameter.bounds[0], parameter.bounds[1]);
                }
            }
        }
    }

    /// What is added to ℓ = −2 ln p so that the scheme minimises the sum: 0 for schemes of maximum likelihood; for
    /// Student-t the variational bound, ν Σ (u − 1 − ln u); for inverse gamma −2 ln of the prior density about the
    /// centres of `about`, whose last M-step they are from. Rows that are not active do not count.
    pub fn penalty(&self, active: &[bool], about: &Self) -> f64 {
        let rows = (0..self.rows.len()).filter(|&i| active[i]);
        let mut penalty = match self.measurements {
            Measurements::StudentT(nu) => rows.map(|i| nu * (self.trust[i] - 1.0 - self.trust[i].ln())).sum(),
            Measurements::Map(nu) if !about.centres[0].is_empty() => {
                rows.map(|i| inverse_gamma(nu, about.centres[0][self.pools.of(i)] * self.shapes[i], self.rows[i])).sum()
            }
            _ => 0.0,
        };
        for (component, &centre) in self.components.iter().zip(&about.centres[1]) {
            if let (Process::Map(nu), false) = (component.process, centre.is_nan()) {
                let of = self.parameters.iter().skip(component.first).take(self.steps).filter(|p| p.learned);
                penalty += of.map(|parameter| inverse_gamma(nu, centre, parameter.variance)).sum::<f64>();
            }
        }
        penalty
    }

    /// Greatest |Δ ln θ| against another state of the same noise: of pools where R is pooled, else of rows; variances
    /// that are 0 do not count.
    pub fn change(&self, other: &Self) -> f64 {
        let log = |a: f64, b: f64| if a > 0.0 && b > 0.0 { (a / b).ln().abs() } else { 0.0 };
        let count = if self.measurements.is_pooled() { self.parameters.len() } else { self.first_pool };
        let parameters = self.parameters.iter().zip(&other.parameters).take(count);
        let most = parameters.map(|(a, b)| log(a.variance, b.variance)).fold(0.0, f64::max);
        if self.measurements.is_pooled() {
            return most;
        }
        self.rows.iter().zip(&other.rows).map(|(&a, &b)| log(a, b)).fold(most, f64::max)
    }

    /// Whether all variances are numbers, none below 0.
    pub fn is_valid(&self) -> bool {
        let sound = |variance: f64| variance >= 0.0 && variance.is_finite();
        self.parameters.iter().all(|parameter| sound(parameter.variance)) && self.rows.iter().all(|&row| sound(row))
    }
}

/// −2 ln of the inverse gamma density of ν degrees of freedom with its mode at `centre`, without constants that do not
/// depend on the variance: α = ν/2, β = (ν/2 + 1) centre.
fn inverse_gamma(nu: f64, centre: f64, variance: f64) -> f64 {
    (nu + 2.0) * (variance.ln() + centre / variance)
}

/// The mean of the squares of the same satellite, signal and kind, so many epochs to either side; NaN where there is none.
fn window(tape: &Tape, squares: &[f64], width: usize) -> Vec<f64> {
    let mut series: HashMap<_, Vec<(usize, usize)>> = HashMap::new();
    for (k, epoch) in tape.epochs.iter().enumerate() {
        for i in epoch.rows.clone().filter(|&i| !squares[i].is_nan()) {
            let row = &tape.rows[i];
            series.entry((row.satellite.to_string(), row.group, row.kind)).or_default().push((k, i));
        }
    }
    let mut means = vec![f64::NAN; squares.len()];
    for list in series.values() {
        let (mut first, mut end) = (0, 0);
        for &(k, i) in list {
            while end < list.len() && list[end].0 <= k + width {
                end += 1;
            }
            while list[first].0 + width < k {
                first += 1;
            }
            let part = &list[first..end];
            means[i] = part.iter().map(|&(_, i)| squares[i]).sum::<f64>() / part.len() as f64;
        }
    }
    means
}
