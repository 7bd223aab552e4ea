//! The distance to the nearest observed point: a baseline that any classifier must beat.

use credence_types::{FREE_CLASS, Point};

use super::{Answer, Question, most_likely};

/// Distance at which object and free space are equally likely, metres: within it, a point counts
/// as on a surface.
const TOLERANCE_M: f64 = 0.005;

/// The nearest observed point's class has the probability 2^(-d / 5 mm), and free space the rest.
/// So a point is on the object when it is closer than 5 mm to what was seen of it.
pub(super) fn answer(question: &Question<'_>) -> Answer {
    let classes = question.classes.len();
    let observed: Vec<(Point, usize)> = question
        .training
        .points_world()
        .iter()
        .zip(&question.labels)
        .filter(|(_, label)| question.classes[**label] != FREE_CLASS)
        .map(|(point, label)| (*point, *label))
        .collect();
    let mut probabilities = vec![0.0; question.test.len() * classes];
    for (row, test) in probabilities.chunks_exact_mut(classes).zip(question.test) {
        let (square, label) = observed
            .iter()
            .map(|(point, label)| ((point - test).norm_squared(), *label))
            .fold((f64::INFINITY, question.asked), |nearest, found| {
                if found.0 < nearest.0 { found } else { nearest }
            });
        let probability = (-square.sqrt() / TOLERANCE_M).exp2();
        // Free space comes first among the classes.
        row[0] = 1.0 - probability;
        row[label] = probability;
    }
    Answer {
        class: most_likely(&probabilities, classes),
        probabilities,
        ..Answer::default()
    }
}
