//! Broadcast orbits and clocks against precise ones of the same day.

use super::case::{Context, Outputs};
use super::inputs::{CaseError, Inputs};
use nalgebra::Vector3;
use serde_json::json;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::antenna::AntennaBand;
use surefix_core::gnss::attitude::Axes;
use surefix_core::gnss::celestial;
use surefix_core::gnss::earth_rotation::EarthOrientation;
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::orbit::store::{EphemerisStore, SelectionRule};
use surefix_core::gnss::precise::{clock, orbit};
use surefix_core::gnss::relativity::clock_correction;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;

/// Messages of one satellite in a day, with room to spare.
type OneSatellite = EphemerisStore<512>;

/// The day of the files of vectors: 2020-06-25.
const DAY: (i32, f64) = (2111, 345_600.0);
/// BeiDou messages of one station are sparse: older ones are off by up to 160 m.
const BEIDOU_AGE: f64 = 3_600.0;

/// A difference, broadcast minus precise.
struct Difference {
    time: GpsTime,
    /// Of positions as they are, antenna minus centre of mass, ECEF `[m]`.
    raw: Vector3<f64>,
    /// The antenna from the centre of mass, ECEF `[m]`, where it is calibrated.
    antenna: Option<Vector3<f64>>,
    /// Unit vector outward.
    radial: Vector3<f64>,
    /// Of clocks `[m]`.
    clock: Option<f64>,
}

/// Statistics of the differences of a constellation over a day.
pub fn comparison(context: &Context, inputs: Inputs) -> Result<Outputs, CaseError> {
    let constellation = inputs.text("system")?.chars().next().and_then(Constellation::from_letter);
    let constellation = constellation.ok_or_else(|| CaseError::Absurd("\"system\" is not known".to_owned()))?;
    let step = inputs.number("step_s")?;
    let differences = differences(context, inputs, constellation, step)?;

    let raw = differences.iter().map(|d| d.raw);
    let after: Vec<(Vector3<f64>, Vector3<f64>)> =
        differences.iter().filter_map(|d| Some((d.raw - d.antenna?, d.radial))).collect();
    let mut sizes: Vec<f64> = after.iter().map(|(d, _)| d.norm()).collect();
    sizes.sort_by(f64::total_cmp);
    Ok(Outputs::from([
        ("n", json!(differences.len())),
        ("rms_3d_raw", json!(rms(raw.map(|d| d.norm())))),
        ("rms_3d_after_antenna_offset", json!(rms(sizes.iter().copied()))),
        ("mean_radial_raw", json!(mean(differences.iter().map(|d| d.raw.dot(&d.radial))))),
        ("mean_radial_after_offset", json!(mean(after.iter().map(|(d, radial)| d.dot(radial))))),
        ("rms_radial_after_offset", json!(rms(after.iter().map(|(d, radial)| d.dot(radial))))),
        ("rms_clock_m_minus_epoch_median", json!(rms(clocks_about_their_median(&differences).into_iter()))),
        ("median_3d_after_offset", json!(median(&sizes))),
        ("max_3d_after_offset", json!(sizes.last())),
    ]))
}

fn differences(
    context: &Context,
    inputs: Inputs,
    constellation: Constellation,
    step: f64,
) -> Result<Vec<Difference>, CaseError> {
    let data = &context.source.data;
    let navigation = data.navigation(inputs.text("nav")?)?;
    let sp3 = data.sp3(inputs.text("sp3")?)?;
    let antex = data.antex("igs14.atx")?;
    let max_gap = sp3.headers.first().map_or(0.0, |header| header.interval);
    let start = GpsTime::from_week_tow(DAY.0, DAY.1);
    let mut differences = Vec::new();
    for satellite in sp3.satellites().filter(|satellite| satellite.constellation() == constellation) {
        let mut store = OneSatellite::new();
        for ephemeris in navigation.ephemerides.iter().filter(|ephemeris| ephemeris.satellite() == satellite) {
            store.insert(*ephemeris);
        }
        for epoch in 0..=(86_400.0 / step) as usize {
            let time = start.plus_seconds(epoch as f64 * step);
            let usable = |ephemeris: &&Ephemeris| {
                let age = time.since(ephemeris.toe()).abs();
                ephemeris.healthy() && (constellation != Constellation::BeiDou || age <= BEIDOU_AGE)
            };
            let selected = store.select(satellite, time, &SelectionRule::RTKLIB).filter(usable);
            let Some(Ok(broadcast)) = selected.map(|ephemeris| ephemeris.state(time)) else { continue };
            let Ok(precise) = orbit(sp3.orbit(satellite), time) else { continue };
            let bias = clock(sp3.clock(satellite), time, max_gap).ok();
            let relativity = clock_correction(&precise.position, &precise.velocity);
            let sun = celestial::sun(time, &EarthOrientation::default());
            let axes = Axes::nominal(&precise.position, &sun);
            let offset = antex.satellite(satellite, time).and_then(|antenna| {
                let of = |band| antenna.calibrations.iter().find(|entry| entry.band == band).map(|entry| entry.offset);
                ionosphere_free(satellite, of)
            });
            differences.push(Difference {
                time,
                raw: broadcast.position - precise.position,
                antenna: axes.zip(offset).map(|(axes, offset)| axes.to_ecef(&offset)),
                radial: precise.position.normalize(),
                clock: bias.map(|bias| (broadcast.clock - bias.bias - relativity) * SPEED_OF_LIGHT),
            });
        }
    }
    Ok(differences)
}

/// The ionosphere-free combination of the offsets of two bands `[m]`, body frame: L1 and L2, E1 and E5b, G1 and G2. None is
/// defined for BeiDou.
fn ionosphere_free(satellite: SatelliteId, offset: impl Fn(AntennaBand) -> Option<[f64; 3]>) -> Option<Vector3<f64>> {
    let constellation = satellite.constellation();
    let second = match constellation {
        Constellation::Gps | Constellation::Qzss | Constellation::Glonass => b'2',
        Constellation::Galileo => b'7',
        Constellation::BeiDou => return None,
    };
    let (first, second) = (AntennaBand::new(constellation, b'1')?, AntennaBand::new(constellation, second)?);
    Some(super::antenna::ionosphere_free(
        [first.frequency()?, second.frequency()?],
        [offset(first)?.into(), offset(second)?.into()],
    ))
}

/// Clock differences, of each epoch less their median.
fn clocks_about_their_median(differences: &[Difference]) -> Vec<f64> {
    let mut clocks: Vec<(GpsTime, f64)> = differences.iter().filter_map(|d| Some((d.time, d.clock?))).collect();
    clocks.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let epochs = clocks.chunk_by(|a, b| a.0 == b.0);
    epochs
        .flat_map(|epoch| {
            let values: Vec<f64> = epoch.iter().map(|entry| entry.1).collect();
            let middle = median(&values).unwrap_or_default();
            values.into_iter().map(move |value| value - middle)
        })
        .collect()
}

/// The median of sorted values.
fn median(sorted: &[f64]) -> Option<f64> {
    let (low, high) = (sorted.get(sorted.len().checked_sub(1)? / 2)?, sorted.get(sorted.len() / 2)?);
    Some(0.5 * (low + high))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    mean(values.map(|value| value * value)).sqrt()
}
