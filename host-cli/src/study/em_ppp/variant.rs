//! The schemes that are compared.

use super::scenario::Motion;
use crate::smooth::ppp::learn::Learning;
use crate::smooth::ppp::noise::{Measurements, Process};
use crate::smooth::ppp::pools::Rule;
use crate::smooth::ppp::{Class, Options};

/// A scheme under its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// For people.
    pub name: &'static str,
    /// What it is, by plain EM.
    pub options: Options,
}

/// Names that the acceptance table refers to.
pub mod names {
    /// The paper's, without floors.
    pub const EPOCH: &str = "epoch";
    /// The same with floors.
    pub const FLOORS: &str = "epoch, floors";
    /// Pools by constellation and signal.
    pub const TYPE: &str = "type";
    /// Pools by elevation.
    pub const ELEVATION: &str = "elevation";
    /// The recommended one.
    pub const STUDENT: &str = "student-t";
}

/// What all start with: 3 m and 0.03 m, 1 mm from epoch to epoch or 10 m²/s³, as in the paper.
pub fn start(motion: Motion) -> Options {
    let mut options = match motion {
        Motion::Rest => Options::at_rest(),
        Motion::Drive => Options::moving(),
    };
    options.start = Some([3.0, 0.03]);
    options.learning = Learning { scan: Vec::new(), accelerated: 0, ..options.learning };
    options
}

/// All schemes for a kind of motion.
pub fn variants(motion: Motion) -> Vec<Variant> {
    let base = start(motion);
    let with = |measurements, process| {
        let mut options = Options { measurements, ..base.clone() };
        options.walks[Class::Motion as usize].learned = process;
        options
    };
    let unfloored = |options: Options| Options { floors: [1e-6; 2], ..options };
    let mut only_q = unfloored(base.clone().by_epoch());
    only_q.measurements = Measurements::Fixed;
    let pooled = |rule| with(Measurements::Pooled(rule), Process::Pooled);
    let list: Vec<(&'static str, Options)> = match motion {
        Motion::Rest => vec![
            (names::EPOCH, unfloored(base.clone().by_epoch())),
            (names::FLOORS, base.clone().by_epoch()),
            ("epoch, R only", unfloored(with(Measurements::Epoch, Process::Fixed))),
            ("epoch, Q only", only_q),
            (names::TYPE, pooled(Rule::Type)),
            ("satellite", pooled(Rule::Satellite)),
            (names::ELEVATION, pooled(Rule::Elevation)),
            ("window ±20", with(Measurements::Window(20), Process::Pooled)),
            ("map", with(Measurements::Map(6.0), Process::Map(4.0))),
            (names::STUDENT, with(Measurements::StudentT(5.0), Process::Pooled)),
        ],
        Motion::Drive => vec![
            (names::EPOCH, unfloored(base.clone().by_epoch())),
            (names::FLOORS, base.clone().by_epoch()),
            (names::TYPE, pooled(Rule::Type)),
            (names::ELEVATION, with(Measurements::Pooled(Rule::Elevation), Process::Window(5))),
            ("student-t, Q pooled", with(Measurements::StudentT(5.0), Process::Pooled)),
            (names::STUDENT, with(Measurements::StudentT(5.0), Process::Window(5))),
        ],
    };
    list.into_iter().map(|(name, options)| Variant { name, options }).collect()
}
