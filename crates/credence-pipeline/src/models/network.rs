//! The query network: what it says of any point, given what was seen.

use credence_embed::{Observation, QueryEmbedder, QueryEmbedding};
use credence_types::{FREE_CLASS, Point};

use super::{Answer, NetworkView, Question, Stopwatch, most_likely};
use crate::{Config, MetricConfig, PipelineError, training::Observed};

/// The network alone.
pub(super) fn answer(
    question: &Question<'_>,
    config: &Config,
    embedder: &QueryEmbedder,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let belief = watch.time("embed", || {
        Belief::new(question, &config.metric, 1, embedder)
    })?;
    let probabilities = belief.test.probabilities.clone();
    Ok(Answer {
        class: most_likely(&probabilities, question.classes.len()),
        probabilities,
        network: Some(belief.view(question)),
        ..Answer::default()
    })
}

/// What the network says of training and test points.
#[derive(Debug)]
pub(super) struct Belief {
    pub(super) training: Embedded,
    pub(super) test: Embedded,
}

/// What it says of a list of points.
#[derive(Debug)]
pub(super) struct Embedded {
    /// Probability of each of the question's classes per point, row-major.
    pub(super) probabilities: Vec<f64>,
    /// Place of each point in the unit ball, by the object that is asked about.
    pub(super) embeddings: Vec<[f64; 3]>,
}

impl Belief {
    /// Asks the network about all points, given each object's observation in so many parts.
    pub(super) fn new(
        question: &Question<'_>,
        config: &MetricConfig,
        parts: usize,
        embedder: &QueryEmbedder,
    ) -> Result<Self, PipelineError> {
        let trained = question.training.points_world();
        let queries = [trained, question.test].concat();
        let mut embeddings = Vec::new();
        // Logits per object, each with the position of its class.
        let mut logits: Vec<(usize, Vec<f64>)> = Vec::new();
        for object in question.training.observed(question.category)? {
            let Ok(class) = question.classes.binary_search(&object.category.class()) else {
                // None of its points was drawn: it is not among the classes.
                continue;
            };
            let embedded = pooled(embedder, &object, parts, config.table_height_m, &queries)?;
            if embeddings.is_empty() {
                embeddings = embedded.iter().map(in_the_ball).collect();
            }
            let of_object = embedded.iter().map(|query| query.logit).collect();
            logits.push((class, of_object));
        }
        let classes = question.classes.len();
        let mut probabilities = vec![0.0; queries.len() * classes];
        for (query, row) in probabilities.chunks_exact_mut(classes).enumerate() {
            let scaled: Vec<(usize, f64)> = logits
                .iter()
                .map(|(class, of_object)| (*class, of_object[query] / config.temperature))
                .collect();
            at_most_one(&scaled, row);
        }
        let of_test = probabilities.split_off(trained.len() * classes);
        let embeddings_of_test = embeddings.split_off(trained.len());
        Ok(Self {
            training: Embedded {
                probabilities,
                embeddings,
            },
            test: Embedded {
                probabilities: of_test,
                embeddings: embeddings_of_test,
            },
        })
    }

    pub(super) fn view(self, question: &Question<'_>) -> NetworkView {
        let classes = question.classes.len();
        let rows = self.training.probabilities.chunks_exact(classes);
        let surprise: f64 = rows
            .zip(&question.labels)
            .map(|(row, label)| -row[*label].max(f64::MIN_POSITIVE).ln())
            .sum();
        let of_asked = self.test.probabilities.iter().skip(question.asked);
        NetworkView {
            probability: of_asked.step_by(classes).copied().collect(),
            embedding: self.test.embeddings,
            ood: surprise / question.labels.len() as f64,
        }
    }
}

/// Embeds points by what was seen of an object.
pub(crate) fn embed_from(
    embedder: &QueryEmbedder,
    object: &Observed,
    table_height_m: f64,
    queries: &[Point],
) -> Result<Vec<QueryEmbedding>, PipelineError> {
    let observation = Observation {
        object: object.points_world.clone(),
        free: object.free_world.clone(),
        viewpoint: object.viewpoint_world,
        table_height_m,
    };
    Ok(embedder.embed(&observation, queries)?)
}

/// Fewest points of a kind in a part. On validation scenes parts of 450 pool as well as parts of
/// 600, and parts of 225 no better than one look at everything: the network learned from 200 on.
const PART_POINTS: usize = 450;

/// The network's answers given disjoint random parts of an observation, pooled: the mean of the
/// logits, and of the directions.
///
/// A query looks at its nearest few points only, so parts are looks with independent noise, and
/// the mean of their log odds (a logarithmic opinion pool; Genest and Zidek 1986, "Combining
/// probability distributions") errs less than one look at everything.
fn pooled(
    embedder: &QueryEmbedder,
    object: &Observed,
    parts: usize,
    table_height_m: f64,
    queries: &[Point],
) -> Result<Vec<QueryEmbedding>, PipelineError> {
    let fewest = object.points_world.len().min(object.free_world.len());
    let parts = parts.min(fewest / PART_POINTS).max(1);
    let mut sum: Vec<QueryEmbedding> = Vec::new();
    for part in 0..parts {
        let embedded = embed_from(embedder, &object.part(part, parts), table_height_m, queries)?;
        if sum.is_empty() {
            sum = embedded;
            continue;
        }
        for (sum, query) in sum.iter_mut().zip(embedded) {
            sum.logit += query.logit;
            for (sum, axis) in sum.direction.iter_mut().zip(query.direction) {
                *sum += axis;
            }
        }
    }
    for query in &mut sum {
        query.logit /= parts as f64;
        let norm = query
            .direction
            .iter()
            .map(|axis| axis * axis)
            .sum::<f64>()
            .sqrt();
        // Directions that cancel out say nothing of the class: the zero vector is their mean.
        for axis in &mut query.direction {
            *axis /= norm.max(f64::EPSILON);
        }
    }
    Ok(sum)
}

/// sigmoid(logit) times the direction.
fn in_the_ball(query: &QueryEmbedding) -> [f64; 3] {
    let radius = 1.0 / (1.0 + (-query.logit).exp());
    query.direction.map(|axis| radius * axis)
}

/// Probabilities of the classes at one point, given for each object its class and the logit of
/// its being there: free space comes first.
///
/// The network judges every object by itself, but a point lies on one of them at most. With
/// independent `p_j`, and all cases with two or more objects at the point excluded,
///
/// ```text
/// P(j) = p_j prod_{i != j} (1 - p_i) / Z,   P(free) = prod_i (1 - p_i) / Z
/// ```
///
/// which is the softmax over 0 and the logits. One object alone keeps its p.
fn at_most_one(logits: &[(usize, f64)], row: &mut [f64]) {
    let largest = logits.iter().map(|(_, l)| *l).fold(0.0, f64::max);
    row[usize::from(FREE_CLASS)] = (-largest).exp();
    for (class, logit) in logits {
        row[*class] += (logit - largest).exp();
    }
    let total: f64 = row.iter().sum();
    for value in row {
        *value /= total;
    }
}

#[cfg(test)]
mod tests {
    use credence_types::Category;

    use super::{super::tests::untrained, *};

    #[test]
    fn a_pool_is_the_mean_of_what_the_network_says_of_each_part() {
        let at =
            |x: f64, i: u32| Point::new(x, 0.007 * f64::from(i % 5), 0.005 * f64::from(i / 5 % 5));
        let object = Observed {
            category: Category::Mug,
            points_world: (0..1000).map(|i| at(1e-6 * f64::from(i), i)).collect(),
            free_world: (0..900)
                .map(|i| at(0.03 + 1e-6 * f64::from(i), i))
                .collect(),
            viewpoint_world: Point::new(0.5, 0.0, 0.4),
        };
        let queries = [at(0.001, 7), at(0.02, 3)];
        let embedder = untrained().query.unwrap();
        let ask = |part: &Observed| embed_from(&embedder, part, 0.0, &queries).unwrap();
        let whole = pooled(&embedder, &object, 1, 0.0, &queries).unwrap();
        assert!(
            whole
                .iter()
                .zip(ask(&object))
                .all(|(a, b)| a.logit == b.logit)
        );

        let parts = [0, 1].map(|part| ask(&object.part(part, 2)));
        let pool = pooled(&embedder, &object, 2, 0.0, &queries).unwrap();
        for (query, pooled) in pool.iter().enumerate() {
            let [a, b] = [&parts[0][query], &parts[1][query]];
            assert!((pooled.logit - f64::midpoint(a.logit, b.logit)).abs() < 1e-12);
            let sum = [0, 1, 2].map(|axis| a.direction[axis] + b.direction[axis]);
            let norm = sum.iter().map(|axis| axis * axis).sum::<f64>().sqrt();
            for (axis, sum) in pooled.direction.iter().zip(sum) {
                assert!((axis - sum / norm).abs() < 1e-12);
            }
        }
        // Of 900 free points no third part is big enough, and half as many are not divided.
        let thirds = pooled(&embedder, &object, 3, 0.0, &queries).unwrap();
        assert_eq!(thirds[0].logit, pool[0].logit);
        let half = object.part(0, 2);
        let whole = pooled(&embedder, &half, 3, 0.0, &queries).unwrap();
        assert_eq!(whole[0].logit, ask(&half)[0].logit);
    }

    #[test]
    fn parts_are_disjoint_and_make_up_the_whole() {
        let object = Observed {
            category: Category::Bowl,
            points_world: (0..7).map(|i| Point::new(f64::from(i), 0.0, 0.0)).collect(),
            free_world: (0..3).map(|i| Point::new(0.0, f64::from(i), 0.0)).collect(),
            viewpoint_world: Point::origin(),
        };
        let x = |part| -> Vec<f64> {
            object
                .part(part, 3)
                .points_world
                .iter()
                .map(|p| p.x)
                .collect()
        };
        assert_eq!(
            [x(0), x(1), x(2)],
            [vec![0.0, 3.0, 6.0], vec![1.0, 4.0], vec![2.0, 5.0]]
        );
        assert_eq!(object.part(2, 3).free_world, [Point::new(0.0, 2.0, 0.0)]);
    }

    fn sigmoid(logit: f64) -> f64 {
        1.0 / (1.0 + (-logit).exp())
    }

    #[test]
    fn one_object_keeps_its_probability() {
        for logit in [-800.0, -3.0, 0.0, 0.5, 800.0] {
            let mut row = [0.0; 2];
            at_most_one(&[(1, logit)], &mut row);
            assert!((row[1] - sigmoid(logit)).abs() < 1e-15);
            assert!((row[0] - sigmoid(-logit)).abs() < 1e-15);
        }
    }

    #[test]
    fn several_objects_exclude_each_other() {
        let logits = [(1, 0.3), (2, -1.0), (1, 2.0)];
        let p = logits.map(|(_, logit)| sigmoid(logit));
        let alone = |j: usize| -> f64 {
            let others = (0..3).filter(|i| *i != j).map(|i| 1.0 - p[i]);
            p[j] * others.product::<f64>()
        };
        let none: f64 = p.iter().map(|p| 1.0 - p).product();
        let total = none + (0..3).map(alone).sum::<f64>();
        let expected = [none, alone(0) + alone(2), alone(1)].map(|value| value / total);
        let mut row = [0.0; 3];
        at_most_one(&logits, &mut row);
        for (value, expected) in row.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-15);
        }
    }
}
