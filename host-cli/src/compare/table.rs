//! The comparison as a table for people: centimetres where errors are small, metres where they are not.

use super::{Errors, Normalized, Report};
use std::fmt;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let qualities: Vec<String> = ["fixed", "partial", "float", "code"]
            .iter()
            .filter_map(|name| Some((name, *self.by_quality.get(name)?)))
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{count} {name}"))
            .collect();
        writeln!(f, "epochs         {}; with a position {} ({})", self.epochs, self.positions, qualities.join(", "))?;
        writeln!(f, "with truth     {}", self.matched)?;
        writeln!(f, "fix rate       {:.2} %", 100.0 * self.fix_rate)?;
        let threshold = length(self.wrong_threshold_m);
        let (rate, wrong) = (100.0 * self.wrong_fix_rate, self.wrong_fixes);
        writeln!(f, "wrong fixes    {rate:.2} % ({wrong} of the fixed epochs are off by more than {threshold})")?;
        writeln!(f, "first fix      {}", seconds(self.first_fix_s))?;
        if self.first_right_fix_s != self.first_fix_s {
            writeln!(f, "first right    {}", seconds(self.first_right_fix_s))?;
        }
        let gaps = &self.gaps;
        write!(f, "interval       {} s", gaps.interval_s)?;
        match gaps.count {
            0 => writeln!(f, ", no gaps")?,
            count => writeln!(f, ", {count} gaps, the longest {} s", gaps.longest_s)?,
        }
        if self.unreadable != [0, 0] {
            writeln!(
                f,
                "unreadable     {} rows of the solution, {} of the truth",
                self.unreadable[0], self.unreadable[1]
            )?;
        }
        if self.all.is_none() {
            return writeln!(f, "no epoch has a truth: compare the times of the two files, or raise --tolerance");
        }
        writeln!(f)?;
        writeln!(
            f,
            "{:<7} {:>7}  {:^29}  {:^29}  {:^29}  {:^29}",
            "errors", "epochs", "mean e, n, u", "sd e, n, u", "rms H, V, 3D", "3D p50, p95, max"
        )?;
        for (name, errors) in [("fixed", &self.fixed), ("float", &self.float), ("code", &self.code), ("all", &self.all)]
        {
            if let Some(errors) = errors {
                row(f, name, errors)?;
            }
        }
        if let Some(stanford) = &self.stanford {
            writeln!(f)?;
            stanford.rows().iter().try_for_each(|row| writeln!(f, "{row}"))?;
        }
        if self.all_normalized.is_none() {
            return Ok(());
        }
        writeln!(f)?;
        writeln!(
            f,
            "{:<7} {:>7}  {:^26}  {:>10}  {:>8}  {:>9}",
            "error/σ", "epochs", "rms e, n, u", "NEES (3)", "worst", "over 10 σ"
        )?;
        for (name, normalized) in [("fixed", &self.fixed_normalized), ("all", &self.all_normalized)] {
            if let Some(normalized) = normalized {
                normalized_row(f, name, normalized)?;
            }
        }
        Ok(())
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, errors: &Errors) -> fmt::Result {
    let three = |values: [f64; 3]| values.map(|value| format!("{:>9}", length(value))).join(" ");
    let (mean, sd) = (errors.mean_m, errors.sd_m);
    writeln!(
        f,
        "{name:<7} {:>7}  {}  {}  {}  {}",
        errors.count,
        three([mean.east, mean.north, mean.up]),
        three([sd.east, sd.north, sd.up]),
        three([errors.rms_horizontal_m, errors.rms_vertical_m, errors.rms_3d_m]),
        three([errors.three_d_m.p50, errors.three_d_m.p95, errors.three_d_m.max]),
    )
}

fn normalized_row(f: &mut fmt::Formatter<'_>, name: &str, normalized: &Normalized) -> fmt::Result {
    let rms = normalized.rms;
    writeln!(
        f,
        "{name:<7} {:>7}  {:8.2} {:8.2} {:8.2}  {:10.2}  {:8.2}  {:9}",
        normalized.count,
        rms.east,
        rms.north,
        rms.up,
        normalized.nees_mean,
        normalized.worst,
        normalized.beyond_10_sigma
    )
}

/// `1.23 cm` or `12.345 m`.
fn length(meters: f64) -> String {
    if meters.abs() < 1.0 { format!("{:.2} cm", 100.0 * meters) } else { format!("{meters:.3} m") }
}

fn seconds(value: Option<f64>) -> String {
    value.map_or_else(|| "never".to_owned(), |value| format!("{value} s"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_their_unit() {
        assert_eq!([length(0.0123), length(-0.5), length(12.3456)], ["1.23 cm", "-50.00 cm", "12.346 m"]);
        assert_eq!([seconds(None), seconds(Some(17.0))], ["never", "17 s"]);
    }
}
