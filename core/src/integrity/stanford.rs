//! Errors against protection levels: the classes of the Stanford diagram.
//!
//! | class | | |
//! |---|---|---|
//! | nominal | PE ≤ PL < AL | what is promised |
//! | misleading | PL < PE ≤ AL | the bound is broken, without harm |
//! | hazardously misleading | PL < AL < PE | the bound is broken, and nobody is warned |
//! | unavailable | PL ≥ AL, PE ≤ PL | warned; PE ≤ AL: for nothing |
//! | unavailable and misleading | PL ≥ AL, PE > PL | warned, and the bound is broken |
//!
//! PE error, PL protection level, AL alert limit. PE = PL is nominal. T. Walter & A. Hansen, *Development of the Stanford
//! diagram* (as in EUROCONTROL's definition); what Wang et al. (2022) call a false alarm (PE > PL) is misleading
//! information. No panics.

/// Class of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Class {
    /// PE ≤ PL < AL.
    Nominal,
    /// PL < PE, both within the alert limit (PL < AL, PE ≤ AL).
    Misleading,
    /// PL < AL < PE.
    HazardouslyMisleading,
    /// PL ≥ AL, PE ≤ PL.
    Unavailable,
    /// PL ≥ AL, PE > PL.
    UnavailableMisleading,
}

impl Class {
    /// Of an error and a protection level, with an alert limit, all `[m]`. `None` if one of them is NaN.
    pub fn of(error: f64, protection_level: f64, alert_limit: f64) -> Option<Self> {
        if error.is_nan() || protection_level.is_nan() || alert_limit.is_nan() {
            return None;
        }
        Some(match (protection_level < alert_limit, error > protection_level) {
            (true, false) => Self::Nominal,
            (true, true) if error <= alert_limit => Self::Misleading,
            (true, true) => Self::HazardouslyMisleading,
            (false, false) => Self::Unavailable,
            (false, true) => Self::UnavailableMisleading,
        })
    }
}

/// Numbers of epochs by class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// [`Class::Nominal`].
    pub nominal: u64,
    /// [`Class::Misleading`].
    pub misleading: u64,
    /// [`Class::HazardouslyMisleading`].
    pub hazardously_misleading: u64,
    /// [`Class::Unavailable`].
    pub unavailable: u64,
    /// [`Class::UnavailableMisleading`].
    pub unavailable_misleading: u64,
    /// Epochs that are unavailable although their error is within the alert limit.
    pub false_alerts: u64,
    /// Epochs that are unavailable and whose error exceeds the alert limit.
    pub true_alerts: u64,
}

impl Counts {
    /// Counts an epoch; returns its class, `None` where a number is NaN, which is not counted.
    pub fn add(&mut self, error: f64, protection_level: f64, alert_limit: f64) -> Option<Class> {
        let class = Class::of(error, protection_level, alert_limit)?;
        *match class {
            Class::Nominal => &mut self.nominal,
            Class::Misleading => &mut self.misleading,
            Class::HazardouslyMisleading => &mut self.hazardously_misleading,
            Class::Unavailable => &mut self.unavailable,
            Class::UnavailableMisleading => &mut self.unavailable_misleading,
        } += 1;
        if protection_level >= alert_limit {
            *if error <= alert_limit { &mut self.false_alerts } else { &mut self.true_alerts } += 1;
        }
        Some(class)
    }

    /// All epochs.
    pub fn total(&self) -> u64 {
        self.nominal + self.misleading + self.hazardously_misleading + self.unavailable + self.unavailable_misleading
    }

    /// Epochs with PE > PL.
    pub fn beyond(&self) -> u64 {
        self.misleading + self.hazardously_misleading + self.unavailable_misleading
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By the definitions in the head of this file.
    #[test]
    fn classes() {
        let cases = [
            (0.5, 0.6, 1.0, Class::Nominal),
            (0.6, 0.6, 1.0, Class::Nominal),
            (0.7, 0.6, 1.0, Class::Misleading),
            (1.0, 0.6, 1.0, Class::Misleading),
            (1.1, 0.6, 1.0, Class::HazardouslyMisleading),
            (0.5, 1.0, 1.0, Class::Unavailable),
            (1.1, 1.2, 1.0, Class::Unavailable),
            (1.3, 1.2, 1.0, Class::UnavailableMisleading),
        ];
        let mut counts = Counts::default();
        for (error, level, limit, class) in cases {
            assert_eq!(counts.add(error, level, limit), Some(class), "{error} {level}");
        }
        assert_eq!((counts.total(), counts.beyond()), (8, 4));
        assert_eq!((counts.false_alerts, counts.true_alerts), (1, 2));
        assert_eq!(counts.add(f64::NAN, 1.0, 1.0), None);
        assert_eq!(counts.total(), 8);
    }

    proptest! {
        #[test]
        fn each_epoch_has_one_class(error in 0.0..3.0, level in 0.0..3.0, limit in 0.0..3.0) {
            let mut counts = Counts::default();
            counts.add(error, level, limit).unwrap();
            prop_assert_eq!(counts.total(), 1);
            prop_assert_eq!(counts.beyond() == 1, error > level);
            prop_assert_eq!(counts.false_alerts + counts.true_alerts == 1, level >= limit);
        }
    }
}
