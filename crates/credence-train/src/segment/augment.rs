//! What training varies about a picture: mirror image, crop, colour, sharpness, noise, holes in the
//! depth.

use std::f32::consts::TAU;

use credence_nn::rgbd::{HEIGHT, RgbdImage, WIDTH};
use rand::{Rng, RngExt as _};

use super::pictures::LabelledPicture;

/// Range of the zoom, and the share of pictures that are zoomed.
const ZOOM: [f32; 2] = [0.8, 1.3];
const ZOOMED: f64 = 0.6;
/// Shift of the middle, as a share of the image's sides.
const SHIFT: f32 = 0.15;
/// Share of pictures with each change of colour.
const RECOLOURED: f64 = 0.8;
const SHUFFLED: f64 = 0.1;
const GREY: f64 = 0.05;
const BLURRED: f64 = 0.35;
const NOISY: f64 = 0.5;
/// Largest spread of the blur, pixels, and of the noise, levels.
const MOST_BLUR_PX: f32 = 1.4;
const MOST_NOISE: f32 = 12.0;
/// Share of pictures with holes in the depth, their number and radii, pixels.
const HOLED: f64 = 0.3;
const MOST_HOLES: u8 = 6;
const HOLE_PX: [f32; 2] = [2.0, 30.0];

/// A picture as training shows it.
pub(super) fn vary(picture: LabelledPicture, rng: &mut impl Rng) -> LabelledPicture {
    let mut picture = moved(picture, rng);
    recolour(&mut picture.image.rgb, rng);
    if rng.random::<f64>() < BLURRED {
        blur(&mut picture.image.rgb, rng.random_range(0.3..MOST_BLUR_PX));
    }
    if rng.random::<f64>() < NOISY {
        add_noise(
            &mut picture.image.rgb,
            MOST_NOISE * rng.random::<f32>(),
            rng,
        );
    }
    if rng.random::<f64>() < HOLED {
        for _ in 0..rng.random_range(1..=MOST_HOLES) {
            let at = [WIDTH, HEIGHT].map(|side| rng.random_range(0.0..side as f32));
            lose_depth(
                &mut picture.image.depth_m,
                at,
                rng.random_range(HOLE_PX[0]..HOLE_PX[1]),
            );
        }
    }
    picture
}

/// Mirrored, zoomed and shifted, by the nearest pixel.
fn moved(picture: LabelledPicture, rng: &mut impl Rng) -> LabelledPicture {
    let mirrored = rng.random::<bool>();
    let zoomed = rng.random::<f64>() < ZOOMED;
    let zoom = if zoomed {
        rng.random_range(ZOOM[0]..ZOOM[1])
    } else {
        1.0
    };
    let shift = [WIDTH, HEIGHT].map(|side| {
        let share = if zoomed {
            rng.random_range(-SHIFT..SHIFT)
        } else {
            0.0
        };
        share * side as f32
    });
    let source = |at: usize, side: usize, shift: f32| {
        let middle = (side - 1) as f32 / 2.0;
        let from = ((at as f32 - middle) / zoom + middle + shift).round();
        (0.0..side as f32).contains(&from).then_some(from as usize)
    };
    let places = (0..WIDTH * HEIGHT).map(|pixel| {
        let column = source(pixel % WIDTH, WIDTH, shift[0])?;
        let row = source(pixel / WIDTH, HEIGHT, shift[1])?;
        Some(row * WIDTH + if mirrored { WIDTH - 1 - column } else { column })
    });
    let owner = |place: Option<usize>| place.map_or(0, |at| picture.owners[at]);
    LabelledPicture {
        owners: places.clone().map(owner).collect(),
        image: RgbdImage::of_pixels(&picture.image.rgb, &picture.image.depth_m, places),
        categories: picture.categories,
    }
}

/// Other light, another camera's colours.
fn recolour(rgb: &mut [[u8; 3]], rng: &mut impl Rng) {
    let mut order = [0, 1, 2];
    if rng.random::<f64>() < SHUFFLED {
        order.rotate_left(rng.random_range(1..3));
    }
    let grey = rng.random::<f64>() < GREY;
    let recoloured = rng.random::<f64>() < RECOLOURED;
    let mut draw = |low: f32, high: f32| {
        let value = rng.random_range(low..high);
        if recoloured { value } else { 1.0 }
    };
    let brightness = draw(0.6, 1.4);
    let gains = [(); 3].map(|()| brightness * draw(0.88, 1.12));
    let gamma = draw(0.7, 1.4);
    let contrast = draw(0.7, 1.3);
    let table = gains.map(|gain| {
        let level = |level: usize| {
            let bright = (gain * level as f32 / 255.0).min(1.0).powf(gamma);
            (255.0 * (0.5 + contrast * (bright - 0.5)))
                .round()
                .clamp(0.0, 255.0) as u8
        };
        std::array::from_fn::<u8, 256, _>(level)
    });
    for pixel in rgb {
        let mut mixed = order.map(|channel| pixel[channel]);
        if grey {
            let sum: u16 = mixed.iter().map(|c| u16::from(*c)).sum();
            mixed = [(sum / 3) as u8; 3];
        }
        *pixel = [0, 1, 2].map(|channel| table[channel][usize::from(mixed[channel])]);
    }
}

/// A Gaussian blur, first across, then down.
fn blur(rgb: &mut [[u8; 3]], spread_px: f32) {
    let reach = (2.0 * spread_px).ceil() as usize;
    let weight = |offset: usize| {
        let away = offset as f32 - reach as f32;
        (-away * away / (2.0 * spread_px * spread_px)).exp()
    };
    let weights: Vec<f32> = (0..=2 * reach).map(weight).collect();
    let sum: f32 = weights.iter().sum();
    let pass = |from: &[[f32; 3]], step: usize, place: &dyn Fn(usize) -> (usize, usize)| {
        let mut to = Vec::with_capacity(from.len());
        for pixel in 0..from.len() {
            let (at, side) = place(pixel);
            let mut mixed = [0.0; 3];
            for (offset, weight) in weights.iter().enumerate() {
                // The border's pixel goes on beyond it.
                let other = (at + offset).saturating_sub(reach).min(side - 1);
                let source = from[pixel + other * step - at * step];
                for (mixed, value) in mixed.iter_mut().zip(source) {
                    *mixed += weight / sum * value;
                }
            }
            to.push(mixed);
        }
        to
    };
    let exact: Vec<[f32; 3]> = rgb.iter().map(|pixel| pixel.map(f32::from)).collect();
    let across = pass(&exact, 1, &|pixel| (pixel % WIDTH, WIDTH));
    let both = pass(&across, WIDTH, &|pixel| (pixel / WIDTH, HEIGHT));
    for (pixel, mixed) in rgb.iter_mut().zip(both) {
        *pixel = mixed.map(|value| value.round().clamp(0.0, 255.0) as u8);
    }
}

/// Gaussian noise of a spread in levels.
fn add_noise(rgb: &mut [[u8; 3]], spread: f32, rng: &mut impl Rng) {
    for pixel in rgb {
        for channel in pixel {
            // Box and Muller's method.
            let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
            let normal = radius * (TAU * rng.random::<f32>()).cos();
            *channel = (f32::from(*channel) + spread * normal)
                .round()
                .clamp(0.0, 255.0) as u8;
        }
    }
}

/// A disc without measurements.
fn lose_depth(depth_m: &mut [f32], [x, y]: [f32; 2], radius_px: f32) {
    for (pixel, depth) in depth_m.iter_mut().enumerate() {
        let (column, row) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
        if (column - x).hypot(row - y) < radius_px {
            *depth = f32::NAN;
        }
    }
}

#[cfg(test)]
mod tests {
    use credence_types::{Category, stream};

    use super::*;

    /// Every pixel tells where it was: column in red, row in green, and by owner and depth.
    fn map() -> LabelledPicture {
        let pixels = || (0..WIDTH * HEIGHT).map(|p| (p % WIDTH, p / WIDTH));
        LabelledPicture {
            image: RgbdImage {
                rgb: pixels().map(|(x, y)| [(x / 2) as u8, y as u8, 0]).collect(),
                depth_m: pixels().map(|(x, y)| (1 + x + y) as f32).collect(),
            },
            owners: pixels().map(|(x, _)| (x / 40) as u8).collect(),
            categories: vec![Some(Category::Mug); 8],
        }
    }

    #[test]
    fn colour_depth_and_owner_move_together() {
        let mut seen = [0; 2];
        for seed in 0..20 {
            let moved = moved(map(), &mut stream(seed, "test/augment"));
            for (pixel, depth) in moved.image.depth_m.iter().enumerate() {
                let [red, row, _] = moved.image.rgb[pixel].map(usize::from);
                if depth.is_nan() {
                    assert_eq!((moved.owners[pixel], moved.image.rgb[pixel]), (0, [127; 3]));
                    continue;
                }
                let column = *depth as usize - 1 - row;
                assert_eq!(
                    (column / 2, column / 40),
                    (red, usize::from(moved.owners[pixel]))
                );
            }
            let [left, right] = [120 * WIDTH + 120, 120 * WIDTH + 200].map(|p| moved.owners[p]);
            seen[usize::from(left > right)] += 1;
        }
        assert!(
            seen.iter().all(|count| *count > 3),
            "mirrored or not: {seen:?}"
        );
    }

    #[test]
    fn blur_keeps_the_mean_and_spreads_a_point_evenly() {
        let mut rgb = vec![[0; 3]; WIDTH * HEIGHT];
        let middle = 100 * WIDTH + 100;
        rgb[middle] = [255; 3];
        blur(&mut rgb, 1.0);
        let around = [1, WIDTH, 2, 2 * WIDTH].map(|step| [rgb[middle - step], rgb[middle + step]]);
        assert_eq!(around[0], around[1]);
        assert_eq!(around[2], around[3]);
        assert!(rgb[middle][0] > around[0][0][0] && around[0][0][0] > around[2][0][0]);
        let mut even = vec![[77; 3]; WIDTH * HEIGHT];
        blur(&mut even, 1.3);
        assert!(even.iter().all(|pixel| *pixel == [77; 3]));
    }

    #[test]
    fn noise_has_its_spread_and_holes_their_size() {
        let mut rgb = vec![[128; 3]; WIDTH * HEIGHT];
        add_noise(&mut rgb, 10.0, &mut stream(0, "test/noise"));
        let off = rgb
            .iter()
            .flatten()
            .map(|c| (f64::from(*c) - 128.0).powi(2));
        let spread = (off.sum::<f64>() / (3 * rgb.len()) as f64).sqrt();
        assert!((spread - 10.0).abs() < 0.1, "{spread}");
        let mut depth = vec![1.0; WIDTH * HEIGHT];
        lose_depth(&mut depth, [160.0, 120.0], 20.0);
        let lost = depth.iter().filter(|d| d.is_nan()).count() as f64;
        assert!(
            (lost / (400.0 * std::f64::consts::PI) - 1.0).abs() < 0.02,
            "{lost}"
        );
    }

    #[test]
    fn a_picture_is_varied_by_its_stream_alone() {
        let varied = |seed| vary(map(), &mut stream(seed, "test/augment"));
        assert_eq!(varied(1).image.rgb, varied(1).image.rgb);
        assert_ne!(varied(1).image.rgb, varied(2).image.rgb);
    }
}
