//! Surfaces' colours, as `sim_scenes.textures` draws them.

use std::f64::consts::TAU;

use rand::{Rng, RngExt as _};

/// Texels of a texture's side, and the spread of their noise.
const SIDE: f64 = 256.0;
const NOISE: f64 = 0.03;

/// A colour, each part in \[0, 1\].
pub(super) type Colour = [f64; 3];

/// Waves of a clouded surface.
const WAVES: usize = 5;

/// What mixes two colours, over texture coordinates of period 1.
#[derive(Debug, Clone, Copy)]
enum Pattern {
    Plain,
    Stripes { turns: [f64; 2], share: f64 },
    Checks { counts: [f64; 2] },
    Dots { count: f64, radius: f64 },
    Clouds { waves: [[f64; 3]; WAVES] },
    Grain { rings: f64, waver: [f64; 2] },
}

/// A surface's look.
#[derive(Debug, Clone, Copy)]
pub(super) struct Texture {
    ground: Colour,
    figure: Colour,
    /// Share of the way from the ground to the figure where the pattern is 1.
    contrast: f64,
    pattern: Pattern,
    key: u64,
}

impl Texture {
    /// An object's: any colours, strong patterns.
    pub(super) fn of_object(rng: &mut impl Rng) -> Self {
        let pattern = match rng.random_range(0..5) {
            0 => Pattern::Plain,
            1 => Pattern::Stripes {
                turns: [(); 2].map(|()| f64::from(rng.random_range(0..9_u8))),
                share: rng.random_range(0.2..0.7),
            },
            2 => Pattern::Checks {
                counts: [(); 2].map(|()| f64::from(2 * rng.random_range(2..9_u8))),
            },
            3 => Pattern::Dots {
                count: f64::from(rng.random_range(4..11_u8)),
                radius: rng.random_range(0.15..0.4),
            },
            _ => clouds(rng),
        };
        Self::new(pattern, [0.9, 0.25], 1.0, rng)
    }

    /// A table's: pale colours, faint patterns.
    pub(super) fn of_table(rng: &mut impl Rng) -> Self {
        let pattern = match rng.random_range(0..3) {
            0 => Pattern::Plain,
            1 => Pattern::Grain {
                rings: f64::from(rng.random_range(6..20_u8)),
                waver: [f64::from(rng.random_range(1..4_u8)), rng.random()],
            },
            _ => clouds(rng),
        };
        Self::new(pattern, [0.6, 0.25], 0.4, rng)
    }

    fn new(pattern: Pattern, limits: [f64; 2], contrast: f64, rng: &mut impl Rng) -> Self {
        let [ground, figure] = [(); 2].map(|()| colour(limits, rng));
        Self {
            ground,
            figure,
            contrast,
            pattern,
            key: rng.random(),
        }
    }

    /// The colour at texture coordinates.
    pub(super) fn at(&self, u: f64, v: f64) -> Colour {
        let weight = self.contrast * self.pattern.weight(u, v);
        let noise = NOISE * (self.grain(u, v) - 0.5);
        [0, 1, 2].map(|i| {
            let mixed = self.ground[i] + weight * (self.figure[i] - self.ground[i]);
            (mixed + noise).clamp(0.0, 1.0)
        })
    }

    /// A number in \[0, 1) for each texel.
    fn grain(&self, u: f64, v: f64) -> f64 {
        let texel = |at: f64| (at * SIDE).floor().rem_euclid(SIDE) as u64;
        let mut z = self.key ^ (texel(u) << 32 | texel(v)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Pattern {
    fn weight(&self, u: f64, v: f64) -> f64 {
        match *self {
            Self::Plain => 0.0,
            Self::Stripes { turns, share } => {
                let band = (turns[0] * u + turns[1] * v).rem_euclid(1.0);
                f64::from(band < share)
            }
            Self::Checks { counts } => {
                ((counts[0] * u).floor() + (counts[1] * v).floor()).rem_euclid(2.0)
            }
            Self::Dots { count, radius } => {
                let row = (count * v).floor();
                let x = (count * u + 0.5 * row.rem_euclid(2.0)).rem_euclid(1.0) - 0.5;
                let y = (count * v).rem_euclid(1.0) - 0.5;
                f64::from(x.hypot(y) < radius)
            }
            Self::Clouds { waves } => {
                let wave = |[a, b, phase]: [f64; 3]| (TAU * (a * u + b * v + phase)).cos();
                let total: f64 = waves.into_iter().map(wave).sum();
                (0.5 + total / 6.0).clamp(0.0, 1.0)
            }
            Self::Grain { rings, waver } => {
                let waver = 0.05 * (TAU * (u * waver[0] + waver[1])).sin();
                0.5 + 0.5 * (TAU * rings * (v + waver)).sin()
            }
        }
    }
}

fn clouds(rng: &mut impl Rng) -> Pattern {
    let turns = |at: f64| (13.0 * at).floor() - 6.0;
    Pattern::Clouds {
        waves: [(); WAVES].map(|()| [turns(rng.random()), turns(rng.random()), rng.random()]),
    }
}

/// Any hue, saturation and value below and above their limits.
fn colour([most_saturated, least_value]: [f64; 2], rng: &mut impl Rng) -> Colour {
    let hue = 6.0 * rng.random::<f64>();
    let saturation = most_saturated * rng.random::<f64>();
    let value = rng.random_range(least_value..1.0);
    // The usual conversion from hue, saturation and value.
    [5.0, 3.0, 1.0].map(|offset| {
        let k = (offset + hue).rem_euclid(6.0);
        value * (1.0 - saturation * k.min(4.0 - k).clamp(0.0, 1.0))
    })
}

#[cfg(test)]
mod tests {
    use credence_types::stream;

    use super::*;

    #[test]
    fn every_texture_is_a_colour_everywhere_and_repeats() {
        let mut rng = stream(1, "test/texture");
        for number in 0..40 {
            let texture = if number % 2 == 0 {
                Texture::of_object(&mut rng)
            } else {
                Texture::of_table(&mut rng)
            };
            for at in 0..50 {
                let (u, v) = (0.037 * f64::from(at) + 0.001, 0.011 * f64::from(at) + 0.002);
                let colour = texture.at(u, v);
                assert!(
                    colour.iter().all(|c| (0.0..=1.0).contains(c)),
                    "{texture:?}"
                );
                let again = texture.at(u + 1.0, v);
                let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6;
                assert!(
                    colour.iter().zip(&again).all(close),
                    "{texture:?} at {u}, {v}"
                );
            }
        }
    }
}
