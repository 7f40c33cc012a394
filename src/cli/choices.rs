//! Wishes that are one of a few words.

use crate::image::ToneMap;
use crate::load::LightUnits;
use crate::scene::Filter;
use crate::trace::{Integrator, Sampling};
use clap::ValueEnum;

/// See [`Integrator`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum IntegratorArg {
    /// Direct light, also in mirrors and through glass.
    Direct,
    /// Global illumination.
    Path,
}

/// See [`Sampling`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SamplingArg {
    /// Each number by itself.
    Independent,
    /// A jittered grid of 4 x 4 cells, over and over.
    Stratified,
    /// Sobol' points with a random shift.
    Shifted,
    /// Sobol' points with Owen's scrambling: the default.
    Sobol,
}

/// See [`Filter`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum FilterArg {
    /// The texel under the point.
    Nearest,
    /// Linear between four texels.
    Bilinear,
}

/// See [`ToneMap`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ToneMapArg {
    /// Cut off.
    Clip,
    /// Khronos PBR Neutral.
    Neutral,
    /// As film does: bright colours fade to white.
    Agx,
    /// ACES, by its usual fit.
    Aces,
}

/// See [`LightUnits`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum LightUnitsArg {
    /// Candela and lux, 683 to the watt: Blender's "Standard".
    Candela,
    /// W/sr and W/m2, or candela beside surfaces in cd/m2: Blender's "Unitless".
    Watts,
    /// W of the whole lamp, W/m2 of directional ones: Blender's "Raw".
    Raw,
}

impl From<LightUnitsArg> for LightUnits {
    fn from(arg: LightUnitsArg) -> Self {
        match arg {
            LightUnitsArg::Candela => Self::Candela,
            LightUnitsArg::Watts => Self::Watts,
            LightUnitsArg::Raw => Self::Raw,
        }
    }
}

impl From<IntegratorArg> for Integrator {
    fn from(arg: IntegratorArg) -> Self {
        match arg {
            IntegratorArg::Direct => Self::Direct,
            IntegratorArg::Path => Self::Path,
        }
    }
}

impl From<SamplingArg> for Sampling {
    fn from(arg: SamplingArg) -> Self {
        match arg {
            SamplingArg::Independent => Self::Independent,
            SamplingArg::Stratified => Self::Stratified,
            SamplingArg::Shifted => Self::Shifted,
            SamplingArg::Sobol => Self::Sobol,
        }
    }
}

impl From<FilterArg> for Filter {
    fn from(arg: FilterArg) -> Self {
        match arg {
            FilterArg::Nearest => Self::Nearest,
            FilterArg::Bilinear => Self::Bilinear,
        }
    }
}

impl From<ToneMapArg> for ToneMap {
    fn from(arg: ToneMapArg) -> Self {
        match arg {
            ToneMapArg::Clip => Self::Clip,
            ToneMapArg::Neutral => Self::Neutral,
            ToneMapArg::Agx => Self::AgX,
            ToneMapArg::Aces => Self::Aces,
        }
    }
}
