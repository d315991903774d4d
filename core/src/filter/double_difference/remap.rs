//! Satellites that come, go, or give the reference to another: mean, covariance and R* follow exactly.
//!
//! The reference stays as long as it is seen without loss of lock, then the highest known satellite takes its place. With
//! the old reference o and the new one k, the ambiguity of i is N_io − N_ko, that of o is −N_ko, also in the epoch in which
//! o is not seen any more.

use super::super::adaptive::matrix::{Origin, remap};
use super::noise::fill_r0;
use super::{BANDS, DoubleDifferenceError, DoubleDifferenceFilter, KINEMATIC, Sight, TYPES, WholeNoise, differences};
use crate::linalg::{LinalgError, Mat, MatMut, copy, head};
use crate::real::Real;
use heapless::Vec;

impl<T: Real, const A: usize, const N: usize, const M: usize> DoubleDifferenceFilter<T, A, N, M> {
    /// The reference of this epoch, as index into its sights.
    fn choose_reference(&self, sights: &[Sight]) -> usize {
        let kept = |sight: &Sight| Some(sight.id) == self.reference && !sight.new_lock;
        let known = |sight: &Sight| self.satellites.contains(&sight.id) && !sight.new_lock;
        if let Some(same) = sights.iter().position(kept) {
            return same;
        }
        let highest = sights
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| known(a).cmp(&known(b)).then(a.sin_elevation.total_cmp(&b.sin_elevation)));
        highest.map_or(0, |(place, _)| place)
    }

    /// Where a satellite's ambiguities come from, by the order that was.
    fn origin(&self, sight: &Sight, reference: &Sight) -> Origin {
        let place = |id: u8| self.satellites.iter().position(|&other| other == id);
        if sight.new_lock || self.reference.is_none() {
            return Origin::New;
        }
        if self.reference == Some(reference.id) {
            return place(sight.id).filter(|_| !reference.new_lock).map_or(Origin::New, Origin::Same);
        }
        match (place(reference.id).filter(|_| !reference.new_lock), place(sight.id)) {
            (Some(new), _) if self.reference == Some(sight.id) => Origin::Negative(new),
            (Some(new), Some(own)) => Origin::Difference(own, new),
            _ => Origin::New,
        }
    }

    /// Takes the satellites of an epoch.
    pub(super) fn remap(
        &mut self,
        sights: &[Sight],
        whole: Option<&mut WholeNoise<T, M>>,
    ) -> Result<(), DoubleDifferenceError> {
        let chosen = self.choose_reference(sights);
        let Some(reference) = sights.get(chosen) else { return Err(DoubleDifferenceError::Satellites) };
        self.positions.clear();
        // There is room for all, as was checked.
        let _ = self.positions.push(*reference);
        let others = sights.iter().enumerate().filter(|(place, _)| *place != chosen).map(|(_, sight)| sight);
        let mut origins: Vec<Origin, A> = Vec::new();
        for sight in others {
            let _ = self.positions.push(*sight);
            let _ = origins.push(self.origin(sight, reference));
        }
        for (sight, to) in self.positions.iter().zip(&mut self.variances) {
            let variance = |noise: &crate::model::noise::Noise| T::from_f64(noise.variance(sight.sin_elevation, None));
            let overbound = T::from_f64(self.options.overbound);
            *to = [overbound * variance(&self.options.code), variance(&self.options.phase)];
        }
        let (before, s) = (self.satellites.len(), origins.len());
        let same = before == s && origins.iter().enumerate().all(|(i, origin)| *origin == Origin::Same(i));
        if !same {
            self.remap_density(&origins, before)?;
            self.remap_ratios(&origins, before);
        }
        self.satellites.clear();
        for sight in self.positions.iter().skip(1) {
            let _ = self.satellites.push(sight.id);
        }
        self.reference = self.positions.first().map(|sight| sight.id);
        if let Some(whole) = whole {
            self.remap_whole(&origins, before, same, whole)?;
        }
        Ok(())
    }

    fn remap_density(&mut self, origins: &[Origin], before: usize) -> Result<(), LinalgError> {
        let s = origins.len();
        let (old, n) = (KINEMATIC + BANDS * before, KINEMATIC + BANDS * s);
        let mut all: Vec<Origin, N> = (0..KINEMATIC).map(Origin::Same).collect();
        for band in 0..BANDS {
            for origin in origins {
                let _ = all.push(shifted(*origin, KINEMATIC + band * before));
            }
        }
        let Self { density, rows, noise, positions, options, .. } = self;
        let mut mean = [0.0; N];
        let value = |i: usize| density.mean.get(i).copied().unwrap_or(0.0);
        for (i, (to, origin)) in mean.iter_mut().zip(&all).enumerate() {
            *to = match *origin {
                Origin::Same(from) => value(from),
                Origin::Difference(from, other) => value(from) - value(other),
                Origin::Negative(from) => -value(from),
                Origin::New => {
                    let k = i.saturating_sub(KINEMATIC);
                    let (band, place) = (k.checked_div(s).unwrap_or(0), k.checked_rem(s).unwrap_or(0));
                    new_ambiguity(positions, place, band, &options.wavelengths)
                }
            };
        }
        let new = T::from_f64(options.new_ambiguity);
        let mut r0 = MatMut::new(noise.as_flattened_mut(), n, n, M)?;
        r0.fill(T::ZERO);
        (0..n).for_each(|i| r0.set(i, i, new));
        let mut to = MatMut::new(rows.as_flattened_mut(), n, n, N)?;
        remap(&mut to, density.view(old).1, r0.as_ref(), &all)?;
        density.cut(n)?.set(head(&mean, n), |i, j| to.as_ref().at(i, j)).commit();
        Ok(())
    }

    /// A ratio stays with its satellite; a new one begins with the mean of its type, as whoever comes back between trees is
    /// no better than those that stayed.
    fn remap_ratios(&mut self, origins: &[Origin], before: usize) {
        let s = origins.len();
        let old = self.learned.channels;
        for kind in 0..TYPES {
            let known = old.iter().skip(kind * before).take(before);
            let sum = known.fold(T::ZERO, |sum, &ratio| sum + ratio);
            let mean = if before > 0 { sum / T::from_f64(before as f64) } else { T::ONE };
            for (to, origin) in self.learned.channels.iter_mut().skip(kind * s).zip(origins) {
                *to = match *origin {
                    Origin::Same(from) | Origin::Difference(from, _) => {
                        old.get(kind * before + from).copied().unwrap_or(mean)
                    }
                    Origin::New | Origin::Negative(_) => mean,
                };
            }
        }
    }

    /// R* as a whole matrix, and its floor.
    fn remap_whole(
        &mut self,
        origins: &[Origin],
        before: usize,
        same: bool,
        whole: &mut WholeNoise<T, M>,
    ) -> Result<(), LinalgError> {
        let s = origins.len();
        let m = TYPES * s;
        if same && whole.rows == m {
            return Ok(());
        }
        let mut r0 = MatMut::new(self.noise.as_flattened_mut(), m, m, M)?;
        fill_r0(&mut r0, &self.variances, s);
        let mut all: Vec<Origin, M> = Vec::new();
        for kind in 0..TYPES {
            for origin in origins {
                let known = if whole.rows == TYPES * before { *origin } else { Origin::New };
                let _ = all.push(shifted(known, kind * before));
            }
        }
        let from = Mat::new(whole.r.as_flattened(), whole.rows, whole.rows, M)?;
        let mut to = MatMut::new(whole.spread.as_flattened_mut(), m, m, M)?;
        remap(&mut to, from, r0.as_ref(), &all)?;
        for (to, from) in whole.r.iter_mut().zip(to.as_ref().iter()) {
            copy(to, from);
        }
        whole.rows = m;
        whole.floor(r0.as_ref(), self.options.bounds)
    }
}

/// An origin among satellites, as one among states or measurements.
fn shifted(origin: Origin, by: usize) -> Origin {
    match origin {
        Origin::New => Origin::New,
        Origin::Same(i) => Origin::Same(i + by),
        Origin::Difference(i, j) => Origin::Difference(i + by, j + by),
        Origin::Negative(i) => Origin::Negative(i + by),
    }
}

/// Phase minus code of the same band, in cycles.
fn new_ambiguity(positions: &[Sight], place: usize, band: usize, wavelengths: &[f64; BANDS]) -> f64 {
    let (Some(reference), Some(sight), Some(wavelength)) =
        (positions.first(), positions.get(place + 1), wavelengths.get(band))
    else {
        return 0.0;
    };
    let (code, phase) = differences(sight, reference, band);
    (phase - code) / wavelength
}
