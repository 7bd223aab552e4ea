//! Temperatures that make the scores probabilities (Guo et al. 2017, "On Calibration of Modern
//! Neural Networks").

use burn::tensor::Device;
use credence_segment::maskrcnn::{CLASSES, MaskRcnn, MaskRcnnNetwork};

use super::{
    evaluate::{INPUTS, Judged, judge},
    pictures::PictureSet,
};
use crate::{TrainError, run::Figures};

/// Range that a temperature is searched in.
const RANGE: [f64; 2] = [0.2, 5.0];
/// Rounds of the search; each leaves 0.618 of the range.
const ROUNDS: usize = 40;
/// Times that the temperature is fitted.
const FITS: usize = 2;
/// Bins of the scores.
const BINS: usize = 15;

/// The network with the temperatures at which its detections in the pictures are most likely what
/// they are, and how far its scores in the same pictures are from frequencies, before and after.
///
/// # Errors
/// Pictures that cannot be read.
pub(super) fn calibrate(
    network: &MaskRcnnNetwork,
    pictures: &PictureSet,
    count: usize,
) -> Result<(MaskRcnnNetwork, Figures), TrainError> {
    let device = Device::flex();
    let mut network = network.clone().with_temperatures([1.0; 2], &device);
    let mut figures = Figures::new();
    for (place, (input, name)) in INPUTS.into_iter().enumerate() {
        let detections = |network: &MaskRcnnNetwork| {
            let segmenter = MaskRcnn::new(network.clone(), input);
            Ok::<_, TrainError>(judge(&segmenter, pictures, count)?.detections)
        };
        let mut judged = detections(&network)?;
        figures.insert(format!("ece_before_{name}"), calibration_error(&judged));
        // Another temperature lets other detections over the least score: fit, look, fit again.
        for _ in 0..FITS {
            let mut temperatures = network.temperatures();
            temperatures[place] *= likeliest(&judged) as f32;
            network = network.with_temperatures(temperatures, &device);
            judged = detections(&network)?;
        }
        let temperature = f64::from(network.temperatures()[place]);
        figures.insert(format!("temperature_{name}"), temperature);
        figures.insert(format!("ece_{name}"), calibration_error(&judged));
    }
    Ok((network, figures))
}

/// What the temperature should be multiplied by, by golden sections of its logarithm: the
/// likelihood has one peak.
fn likeliest(judged: &[Judged]) -> f64 {
    if judged.is_empty() {
        return 1.0;
    }
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = RANGE.map(f64::ln);
    for _ in 0..ROUNDS {
        let [a, b] = [high - golden * (high - low), low + golden * (high - low)];
        if surprise(judged, a.exp()) < surprise(judged, b.exp()) {
            high = b;
        } else {
            low = a;
        }
    }
    f64::midpoint(low, high).exp()
}

/// Mean negative log likelihood of what the detections are.
fn surprise(judged: &[Judged], temperature: f64) -> f64 {
    let of = |detection: &Judged| {
        let object = detection.object;
        let class = object.map_or(0, |(category, _)| usize::from(category.class()));
        -at(&detection.classes, temperature)[class]
            .max(f64::MIN_POSITIVE)
            .ln()
    };
    judged.iter().map(of).sum::<f64>() / judged.len().max(1) as f64
}

/// Probabilities at a multiple of their temperature.
fn at(classes: &[f64; CLASSES], temperature: f64) -> [f64; CLASSES] {
    let powers = classes.map(|p| p.powf(1.0 / temperature));
    let sum: f64 = powers.iter().sum();
    powers.map(|power| power / sum)
}

/// Mean distance of score and frequency over bins of equal width, weighted by their detections.
fn calibration_error(judged: &[Judged]) -> f64 {
    let mut bins = [(0.0, 0.0); BINS];
    for detection in judged {
        let (_, score) = detection.best;
        let bin = ((score * BINS as f64) as usize).min(BINS - 1);
        bins[bin].0 += score;
        bins[bin].1 += f64::from(u8::from(detection.is_right()));
    }
    let off = bins.iter().map(|(scores, right)| f64::abs(scores - right));
    off.sum::<f64>() / judged.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use credence_types::Category;

    use super::*;

    /// Detections of mugs with a probability of 0.9, of which a share are right.
    fn detections(right: usize, of: usize) -> Vec<Judged> {
        let mut classes = [0.0; CLASSES];
        classes[0] = 0.1;
        classes[6] = 0.9;
        (0..of)
            .map(|number| Judged {
                classes,
                best: (Category::Mug, 0.9),
                object: (number < right).then_some((Category::Mug, 0.8)),
            })
            .collect()
    }

    #[test]
    fn scores_become_frequencies() {
        let judged = detections(60, 100);
        assert!((calibration_error(&judged) - 0.3).abs() < 1e-9);
        // ln 9 / ln 1.5 is beyond the range.
        assert!((likeliest(&judged) - RANGE[1]).abs() < 1e-3);
        let judged = detections(80, 100);
        let temperature = likeliest(&judged);
        assert!((temperature - 9.0_f64.ln() / 4.0_f64.ln()).abs() < 1e-4);
        let [.., mug] = at(&judged[0].classes, temperature);
        assert!((mug - 0.8).abs() < 1e-4);
        assert_eq!(likeliest(&[]), 1.0);
    }
}
