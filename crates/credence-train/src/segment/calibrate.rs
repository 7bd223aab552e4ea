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
/// Bins of the scores.
const BINS: usize = 15;

/// The network with the temperatures at which its detections in the pictures are most likely what
/// they are, and how far its scores are from frequencies before and after.
///
/// # Errors
/// Pictures that cannot be read.
pub(super) fn calibrate(
    network: &MaskRcnnNetwork,
    pictures: &PictureSet,
    count: usize,
) -> Result<(MaskRcnnNetwork, Figures), TrainError> {
    let mut temperatures = network.temperatures();
    let mut figures = Figures::new();
    for ((input, name), temperature) in INPUTS.into_iter().zip(&mut temperatures) {
        let segmenter = MaskRcnn::new(network.clone(), input).uncalibrated();
        let judged = judge(&segmenter, pictures, count)?.detections;
        let best = likeliest(&judged);
        *temperature = best as f32;
        figures.insert(format!("temperature_{name}"), best);
        figures.insert(
            format!("ece_before_{name}"),
            calibration_error(&judged, 1.0),
        );
        figures.insert(format!("ece_{name}"), calibration_error(&judged, best));
    }
    let network = network
        .clone()
        .with_temperatures(temperatures, &Device::flex());
    Ok((network, figures))
}

/// By golden sections of the logarithm: the likelihood has one peak.
fn likeliest(judged: &[Judged]) -> f64 {
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

/// Probabilities at another temperature than that of 1.
fn at(classes: &[f64; CLASSES], temperature: f64) -> [f64; CLASSES] {
    let powers = classes.map(|p| p.powf(1.0 / temperature));
    let sum: f64 = powers.iter().sum();
    powers.map(|power| power / sum)
}

/// Mean distance of score and frequency over bins of equal width, weighted by their detections.
fn calibration_error(judged: &[Judged], temperature: f64) -> f64 {
    let mut bins = [(0.0, 0.0); BINS];
    for detection in judged {
        let classes = at(&detection.classes, temperature);
        let score = classes[usize::from(detection.best.0.class())];
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
        assert!((calibration_error(&judged, 1.0) - 0.3).abs() < 1e-9);
        let temperature = likeliest(&judged);
        // ln 9 / T = ln 1.5.
        assert!(
            (temperature - 9.0_f64.ln() / 1.5_f64.ln()).abs() > 0.4,
            "out of range"
        );
        assert!((temperature - RANGE[1]).abs() < 1e-3);
        let judged = detections(80, 100);
        let temperature = likeliest(&judged);
        assert!((temperature - 9.0_f64.ln() / 4.0_f64.ln()).abs() < 1e-4);
        assert!(calibration_error(&judged, temperature) < 1e-4);
    }
}
