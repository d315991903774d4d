//! A model of many epochs, as the smoother sees it.
//!
//! ```text
//! x_{k+1} = F_k x_k + b_k + q_k     q_k ~ N(0, Q_k(θ)),  F_k rectangular where states are born or die
//! y_k     = h_k(x_k) + e_k          e_k ~ N(0, R_k(θ)),  linear in all but a few states
//! ```
//! Greiff et al., *Adaptive Smoothing with Ambiguity Fixation for GNSS Post-Processing* (2023), eqs. (1), (6), (11).
//! Some states are integers in truth ([`Model::integers`]); once their values are known ([`Model::fix`]) the model drops
//! them, and F, b and h with them.

use surefix_core::filter::update::{Gauge, UpdateError};
use surefix_core::smooth::step::{Block, SparseMap, Step};

/// N(m, P) of any dimension, reused from epoch to epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Density {
    /// m, n entries.
    pub mean: Vec<f64>,
    /// P, n × n by rows, of which the lower triangle counts.
    pub covariance: Vec<f64>,
}

impl Density {
    /// Number of states n.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// P_ij from the lower triangle.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.covariance[i.max(j) * self.dim() + i.min(j)]
    }

    /// Becomes n independent states of mean and variance 0.
    pub fn reset(&mut self, n: usize) {
        self.mean.clear();
        self.mean.resize(n, 0.0);
        self.covariance.clear();
        self.covariance.resize(n * n, 0.0);
    }
}

/// x⁺ = F x + b + q under construction; the owned form of [`Step`].
#[derive(Clone, Debug, Default)]
pub struct Transition {
    columns: usize,
    ends: Vec<usize>,
    entries: Vec<(usize, f64)>,
    offset: Vec<f64>,
    /// Q.
    pub noise: Vec<Block<f64>>,
}

impl Transition {
    /// No rows yet, from `columns` states.
    pub fn reset(&mut self, columns: usize) {
        self.columns = columns;
        self.ends.clear();
        self.entries.clear();
        self.offset.clear();
        self.noise.clear();
    }

    /// Appends a state of x⁺ as `b + Σ coefficient · x_column`; returns its index.
    pub fn push(&mut self, offset: f64, entries: &[(usize, f64)]) -> usize {
        self.entries.extend_from_slice(entries);
        self.ends.push(self.entries.len());
        self.offset.push(offset);
        self.ends.len() - 1
    }

    /// Appends a state that is born with the given mean and variance; returns its index.
    pub fn birth(&mut self, mean: f64, variance: f64) -> usize {
        let state = self.push(mean, &[]);
        self.noise(&[state], &[&[1.0]], variance, None);
        state
    }

    /// Adds a block of noise to states of x⁺.
    pub fn noise(&mut self, states: &[usize], shape: &[&[f64]], scale: f64, component: Option<usize>) {
        let mut block = Block { states: [0; 3], dim: states.len(), shape: [[0.0; 3]; 3], scale, component };
        block.states[..states.len()].copy_from_slice(states);
        for (to, from) in block.shape.iter_mut().zip(shape) {
            to[..from.len()].copy_from_slice(from);
        }
        self.noise.push(block);
    }

    /// As the steps of the core take it.
    pub fn step(&self) -> Step<'_, f64> {
        let map = SparseMap { ends: &self.ends, entries: &self.entries, columns: self.columns };
        Step { map, offset: &self.offset, noise: &self.noise }
    }
}

/// A variance (or spectral density) that EM may learn.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// What it is, for people: "phase noise GPS L1, at the zenith".
    pub name: String,
    /// Unit of its square root: "m", "m/s", "m/s^1.5", "cycles/√s".
    pub unit: &'static str,
    /// Its value, a variance; positive.
    pub variance: f64,
    /// Bounds of the variance.
    pub bounds: [f64; 2],
    /// Whether EM changes it.
    pub learned: bool,
}

/// What one epoch, or many, say of the parameters: E[quadratic form] and the number of terms. The sums of two spans add.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sums {
    /// For each parameter the sum of E[eᵀ shape⁻¹ e], in units of the parameter.
    pub quadratic: Vec<f64>,
    /// For each parameter the number of scalars in that sum.
    pub count: Vec<f64>,
    /// For each parameter the sum of ln det shape, which only the value of the EM objective needs.
    pub log_determinant: Vec<f64>,
}

impl Sums {
    /// Nothing yet, for so many parameters.
    pub fn new(parameters: usize) -> Self {
        let zeros = vec![0.0; parameters];
        Self { quadratic: zeros.clone(), count: zeros.clone(), log_determinant: zeros }
    }

    /// Adds one term.
    pub fn add(&mut self, parameter: usize, quadratic: f64, count: f64) {
        self.quadratic[parameter] += quadratic;
        self.count[parameter] += count;
    }

    /// Adds ln det shape of a term.
    pub fn add_log_determinant(&mut self, parameter: usize, log_determinant: f64) {
        self.log_determinant[parameter] += log_determinant;
    }

    /// Adds those of another span.
    pub fn merge(&mut self, other: &Self) {
        let lists = [
            (&mut self.quadratic, &other.quadratic),
            (&mut self.count, &other.count),
            (&mut self.log_determinant, &other.log_determinant),
        ];
        for (sums, more) in lists {
            sums.iter_mut().zip(more).for_each(|(sum, &more)| *sum += more);
        }
    }

    /// The M-step (Greiff 2023, eq. 12): the variance that maximises the expected likelihood, `None` without terms.
    pub fn variance(&self, parameter: usize) -> Option<f64> {
        (self.count[parameter] > 0.0).then(|| self.quadratic[parameter] / self.count[parameter])
    }
}

/// One state that is an integer in truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integer {
    /// Its index in x_k.
    pub state: usize,
    /// The same for as long as the integer is the same: from birth or slip to the next.
    pub arc: usize,
}

/// Memory of [`Model::update`] and [`Model::residuals`], reused from epoch to epoch; a model uses it as it likes.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Lists of numbers.
    pub buffers: [Vec<f64>; 8],
    /// A list of decisions.
    pub flags: Vec<bool>,
}

/// A model of epochs 0 to K, whose parameters θ and integers can be set.
pub trait Model {
    /// K + 1, the number of epochs.
    fn epochs(&self) -> usize;

    /// n_k, the number of states of epoch k.
    fn states(&self, k: usize) -> usize;

    /// N(m, P) before the measurements of epoch 0.
    fn prior(&self, density: &mut Density);

    /// The step from epoch k to k + 1, with the parameters in force.
    fn transition(&self, k: usize, transition: &mut Transition);

    /// Before a pass that detects: forgets what [`Model::detect`] found in an earlier one.
    fn forget_detections(&mut self) {}

    /// Before the update of epoch k > 0 of a pass that detects: finds what changes the step k − 1 → k (slips), given the
    /// predicted density; true if the step is another one now and the prediction has to be repeated. In all other passes
    /// the steps stay as they were found.
    fn detect(&mut self, _k: usize, _predicted: &Density, _scratch: &mut Scratch) -> bool {
        false
    }

    /// Updates the predicted density with the measurements of epoch k; the gauge of an epoch without any has no rows.
    fn update(&self, k: usize, density: &mut Density, scratch: &mut Scratch) -> Result<Gauge<f64>, UpdateError>;

    /// Adds to `sums` what the measurement residuals of epoch k say of the parameters of R, given the smoothed density.
    fn residuals(&self, _k: usize, _smoothed: &Density, _scratch: &mut Scratch, _sums: &mut Sums) {}

    /// All parameters, those of Q and of R; blocks of [`Transition::noise`] refer to them by index.
    fn parameters(&self) -> &[Parameter];

    /// Sets the variances of all parameters, in the order of [`Model::parameters`].
    fn set_variances(&mut self, variances: &[f64]);

    /// The integers among the states of epoch k that are not fixed.
    fn integers(&self, k: usize, integers: &mut Vec<Integer>);

    /// Fixes integers of epoch k, by their arcs, to values `[cycles]`; the states are gone from this and, where the model
    /// knows arcs, from the other epochs of the arc, once all fixes of a round were given and [`Model::settle`] is called.
    /// (Where arcs are fixed as a whole, this is called with the same value at each of their epochs, so that a model need
    /// not know arcs.) Returns how many contradict what was fixed before and were left out.
    fn fix(&mut self, k: usize, integers: &[Integer], values: &[f64]) -> usize;

    /// Makes the fixes given since the last call effective: numbers of states change.
    fn settle(&mut self);

    /// Forgets all fixes.
    fn release(&mut self);
}
