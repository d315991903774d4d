//! The filters that are compared.

use surefix_core::filter::adaptive::forgetting::Forgetting;
use surefix_core::filter::double_difference::{Adaptation, Options};
use surefix_core::model::noise::Noise;

/// A filter and its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// Name in tables.
    pub name: &'static str,
    /// What it is told.
    pub options: Options,
}

/// The paper's eq. (24) and (26), as printed.
const PRINTED: Forgetting = Forgetting::SuccessRate { threshold: 0.95, b: 0.97, bounds: [0.0, 1.0] };
/// Kept within bounds.
const BOUNDED: Forgetting = Forgetting::IAVAKF;

/// By elevation, not overbounding.
const ELEVATION: Options = Options {
    code: Noise { constant: 0.0, elevation: 0.3 },
    phase: Noise { constant: 0.0, elevation: 0.005 },
    ..Options::PAPER
};

/// Recommended without adaptation, ratio test, gate and inflation.
const OVERBOUND: Options = Options {
    adaptation: Adaptation::Off,
    ambiguity_walk: 0.0,
    gate: f64::INFINITY,
    ratio: 0.0,
    veto: 0.0,
    inflate: false,
    ..Options::RECOMMENDED
};

const fn adaptive(adaptation: Adaptation, forgetting: Forgetting) -> Options {
    Options { adaptation, forgetting, warm_up: 30, ..Options::PAPER }
}

const SAGE_HUSA: Forgetting = Forgetting::SageHusa { b: 0.97 };
/// Sage–Husa with the memory that IAVAKF ends up with.
const LONG: Forgetting = Forgetting::SageHusa { b: 0.999 };

/// All of them.
pub const VARIANTS: [Variant; 16] = [
    Variant { name: "KF", options: Options::PAPER },
    Variant { name: "KF, elevation", options: ELEVATION },
    Variant { name: "AKF literal, floor", options: adaptive(Adaptation::Literal, SAGE_HUSA) },
    Variant { name: "IAVAKF literal, floor", options: adaptive(Adaptation::Literal, PRINTED) },
    Variant { name: "AKF residual, floor", options: adaptive(Adaptation::Residual, SAGE_HUSA) },
    Variant { name: "IAVAKF residual, floor", options: adaptive(Adaptation::Residual, PRINTED) },
    Variant { name: "AKF residual, b = 0.999", options: adaptive(Adaptation::Residual, LONG) },
    Variant { name: "AKF per channel", options: adaptive(Adaptation::Channel, SAGE_HUSA) },
    Variant { name: "IAVAKF per channel", options: adaptive(Adaptation::Channel, PRINTED) },
    Variant { name: "AKF per type", options: adaptive(Adaptation::Type, SAGE_HUSA) },
    Variant { name: "IAVAKF per type", options: adaptive(Adaptation::Type, PRINTED) },
    Variant { name: "KF overbound", options: OVERBOUND },
    Variant { name: "KF overbound, tests", options: Options { adaptation: Adaptation::Off, ..Options::RECOMMENDED } },
    Variant { name: "recommended", options: Options::RECOMMENDED },
    Variant {
        name: "recommended, per type",
        options: Options { adaptation: Adaptation::Type, ..Options::RECOMMENDED },
    },
    Variant {
        name: "recommended, IAVAKF",
        options: Options { adaptation: Adaptation::Type, forgetting: BOUNDED, ..Options::RECOMMENDED },
    },
];

/// Names of the paper's three filters in the form closest to it that works: rows of Tables 3 and 4.
pub const PAPERS: [(&str, &str); 3] =
    [("KF", "KF"), ("AKF", "AKF residual, floor"), ("IAVAKF", "IAVAKF residual, floor")];
/// The default.
pub const RECOMMENDED: &str = "recommended";

impl Variant {
    /// Whether R* is a whole matrix, for which a run takes minutes.
    pub fn is_whole(&self) -> bool {
        matches!(self.options.adaptation, Adaptation::Residual | Adaptation::Literal)
    }
}
