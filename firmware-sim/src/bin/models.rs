//! Every model of `gnss`, and the engine of precise point positioning under a sky, a configuration and observations that the
//! compiler cannot see, so that `cargo xtask panics` sees also what the drives of `ppp64` do not need. What the models
//! answer does not matter.
#![no_std]
#![no_main]

use core::hint::black_box as hide;
use heapless::Vec;
use nalgebra::Vector3;
use surefix_core::gnss::antenna::{
    AntennaBand, Calibration, Variations, choose_receiver, choose_satellite, nadir_angle,
};
use surefix_core::gnss::atmosphere::gpt3::{Gpt3Cell, Gpt3Grid, Gpt3Weather};
use surefix_core::gnss::atmosphere::mapping::MappingFunction;
use surefix_core::gnss::atmosphere::tec::{Axis, SingleLayer, TecMap, TecMaps, code_delay};
use surefix_core::gnss::atmosphere::troposphere::{Troposphere, TroposphereModel, ZenithModel};
use surefix_core::gnss::attitude::{Block, attitude};
use surefix_core::gnss::bias::{
    AbsoluteBias, BiasDifference, BiasKey, BiasTable, Observable, absolute, clock_references,
};
use surefix_core::gnss::celestial::SunMoon;
use surefix_core::gnss::earth_rotation::{EarthOrientation, gcrs_to_itrs, mean_sidereal_time_1982};
use surefix_core::gnss::epoch::{EpochView, Observation};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle};
use surefix_core::gnss::precise::{ClockNode, NODES, OrbitNode, clock, orbit};
use surefix_core::gnss::relativity::{clock_correction, shapiro_delay};
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::tide::{self, OceanLoading};
use surefix_core::gnss::time::GpsTime;
use surefix_core::gnss::wind_up::{ReceiverDipole, wind_up};
use surefix_core::ppp::products::{Missing, PreciseState};
use surefix_core::ppp::{PppConfig, PppFilter, Products};
use surefix_firmware::board::{self, Board};

#[cortex_m_rt::entry]
fn main() -> ! {
    static mut ENGINE: PppFilter<4, 27> = PppFilter::new(PppConfig::DEFAULT);
    let Some(_board) = Board::take() else { board::exit(1) };
    let time = hide(GpsTime::from_week_tow(2111, 345_600.0));
    models(time);
    products(time);
    atmosphere(time);
    engine(hide(ENGINE), time);
    defmt::info!("every model returned");
    board::exit(0)
}

fn place() -> Geodetic {
    hide(Geodetic { latitude: 0.83, longitude: 0.2, height: 300.0 })
}

fn satellite() -> (Vector3<f64>, Vector3<f64>) {
    hide((Vector3::new(2.2e7, 1.2e7, 9e6), Vector3::new(-900.0, 300.0, 2_900.0)))
}

fn look() -> LookAngle {
    hide(LookAngle { azimuth: 1.0, elevation: 0.7 })
}

/// The Earth, the Sun, attitudes, antennas.
fn models(time: GpsTime) {
    let earth = hide(EarthOrientation { xp: 1e-6, yp: 2e-6, ut1_minus_utc: 0.1 });
    hide((gcrs_to_itrs(time, &earth), mean_sidereal_time_1982(time, &earth)));
    let SunMoon { sun, .. } = SunMoon::at(time, &earth);
    let receiver = place().to_ecef();
    let ocean = OceanLoading::new(&hide([[0.01; 11]; 3]), &hide([[0.7; 11]; 3]));
    hide(tide::displacement(&receiver, time, &hide(tide::Model { orientation: Some(&earth), ocean: Some(&ocean) })));

    let ((position, velocity), direction) = (satellite(), hide(Vector3::x()));
    hide((clock_correction(&position, &velocity), shapiro_delay(&receiver, &position)));
    let block = Block::from_antex(hide("BLOCK IIF"));
    if let Some(attitude) = attitude(hide(block), &position, &velocity, &sun) {
        hide(wind_up(&attitude.axes, &ReceiverDipole::level(&place()), &direction, hide(Some(0.3))));
        let calibration = hide(calibration());
        hide(calibration.satellite_correction(&attitude.axes, &direction, nadir_angle(&position, &direction)));
        hide(calibration.receiver_correction(&direction, look()));
    }
    let (bands, wanted) = (hide([calibration().band; 3]), calibration().band);
    hide((choose_receiver(bands.into_iter(), wanted), choose_satellite(bands.into_iter(), wanted)));
    hide(time.calendar());
}

fn calibration() -> Calibration<'static> {
    static MEAN: [f64; 4] = [0.0, 0.001, 0.002, 0.003];
    static ROWS: [f64; 12] = [0.001; 12];
    let (constellation, signal) = hide((Constellation::Gps, signal()));
    let (mean, rows) = (hide(&MEAN[..]), hide(&ROWS[..]));
    let variations = Variations { first: hide(0.0), step: hide(30.0), mean, azimuth_step: hide(180.0), rows };
    Calibration { band: AntennaBand::of(constellation, signal), offset: hide([0.1, 0.2, 0.3]), variations }
}

fn signal() -> Signal {
    hide(clock_references(hide(Constellation::Gps))[0][0])
}

/// Orbits, clocks and biases.
fn products(time: GpsTime) {
    let node = |k: u32| OrbitNode { time: time.plus_seconds(900.0 * f64::from(k)), position: satellite().0 };
    let nodes: [OrbitNode; NODES] = core::array::from_fn(|k| node(k as u32));
    hide(orbit(hide(&nodes), time).is_ok());
    let nodes = [0.0, 30.0, 60.0].map(|seconds| ClockNode { time: time.plus_seconds(seconds), bias: 1e-5 });
    hide(clock(hide(&nodes), time, hide(300.0)).is_ok());

    let mut table = BiasTable::<4>::new();
    for number in 1..=hide(6) {
        let Some(satellite) = SatelliteId::new(hide(Constellation::Galileo), number) else { continue };
        let key = hide(BiasKey { satellite, observable: Observable::Code, signal: signal() });
        hide(table.insert(AbsoluteBias { key, value: 1.0 }).is_ok());
        hide(table.get(key));
    }
    let differences = hide([BiasDifference { first: signal(), second: signal(), value: 1.0 }; 3]);
    let constellation = hide(Constellation::Qzss);
    hide(absolute(constellation, clock_references(constellation), &differences));
}

/// A grid of one weather.
struct Weather;

impl Gpt3Grid for Weather {
    fn step(&self) -> u8 {
        hide(5)
    }

    fn cell(&self, _: u16, _: u16) -> Option<Gpt3Cell> {
        let (season, value) = hide(([1.0; 5], 1.0));
        hide(Some(Gpt3Cell {
            pressure: season,
            temperature: season,
            humidity: season,
            lapse_rate: season,
            undulation: value,
            height: value,
            mapping: [season; 2],
            decrease: season,
            mean_temperature: season,
            gradients: [season; 4],
        }))
    }
}

/// Troposphere and ionosphere.
fn atmosphere(time: GpsTime) {
    if let Some(weather) = Gpt3Weather::at(&Weather, time, &place()) {
        hide(weather.zenith_delay(&place()));
    }
    let troposphere = Troposphere::new(time, &place(), &model());
    hide(troposphere.slant(look()).map(|slant| slant.delay(hide(0.1), hide([0.0; 2]))));

    let values = hide([10; 12]);
    let axis = |count| hide(Axis { first: 0.0, step: 30.0, count });
    let map = TecMap { time, latitudes: axis(3), longitudes: axis(4), unit: 0.1, values: hide(&values) };
    let layer = hide(SingleLayer { base_radius: 6.371e6, shell_height: 4.5e5, with_receiver_height: true });
    let content = hide(TecMaps { before: map, after: map, turned: true }).slant(&layer, time, &place(), look());
    hide(code_delay(content.unwrap_or(1.0), hide(1.5e9)));
}

fn model() -> TroposphereModel {
    let vmf1 = MappingFunction::Vmf1 { hydrostatic: 1.2e-3, wet: 6e-4, at_sea_level: true };
    hide(TroposphereModel { zenith: hide(ZenithModel::Standard), mapping: hide(vmf1), humidity: 0.5 })
}

/// Whatever is asked for is as it was hidden.
struct Sky;

impl Products for Sky {
    fn state(&self, _: SatelliteId, _: GpsTime) -> Result<PreciseState, Missing> {
        let (position, velocity) = satellite();
        hide(Ok(PreciseState { position, velocity, clock: 1e-5, variance: 0.0, phase_centre: false }))
    }

    fn block(&self, _: SatelliteId, _: GpsTime) -> Block {
        hide(Block::GlonassM)
    }

    fn satellite_antenna(&self, _: SatelliteId, _: GpsTime, _: Signal) -> Option<Calibration<'_>> {
        hide(Some(calibration()))
    }

    fn receiver_antenna(&self, _: Constellation, _: Signal) -> Option<Calibration<'_>> {
        hide(Some(calibration()))
    }

    fn code_bias(&self, _: SatelliteId, _: Signal, _: GpsTime) -> Option<f64> {
        hide(Some(0.1))
    }

    fn earth_orientation(&self, _: GpsTime) -> Option<EarthOrientation> {
        hide(Some(EarthOrientation::default()))
    }

    fn ocean_loading(&self, _: GpsTime) -> Option<Vector3<f64>> {
        hide(Some(Vector3::zeros()))
    }
}

/// The engine, and all that can be said to it.
fn engine(engine: &mut PppFilter<4, 27>, time: GpsTime) {
    engine.reconfigure(hide(PppConfig { troposphere: model(), ..PppConfig::DEFAULT }));
    engine.set_antenna(hide(Vector3::zeros()));
    engine.set_approximate(hide(Some(place().to_ecef())));
    let mut all = Vec::<Observation, 12>::new();
    for observation in (1..=6).flat_map(observations) {
        let _ = all.push(observation);
    }
    for epoch in 0..hide(3) {
        let time = time.plus_seconds(30.0 * f64::from(epoch));
        hide(engine.push(EpochView { time, observations: hide(&all) }, &Sky).zenith_total());
        hide((engine.links(), engine.ended(), engine.station(), engine.states()));
    }
    if let Some(satellite) = SatelliteId::new(Constellation::Glonass, hide(7)) {
        engine.set_channel(satellite, hide(-3));
    }
    engine.restart();
}

/// Both bands of a satellite.
fn observations(number: u8) -> impl Iterator<Item = Observation> {
    [hide(*b"1C"), hide(*b"2W")].into_iter().filter_map(move |[band, attribute]| {
        let satellite = SatelliteId::new(hide(Constellation::Gps), hide(number))?;
        let mut observation = Observation::new(satellite, Signal::new(band, attribute)?);
        (observation.code, observation.phase) = hide((Some(2.2e7), Some(1.2e8)));
        Some(observation)
    })
}
