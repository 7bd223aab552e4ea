use std::{fmt::Write as _, path::Path};

use credence_embed::{MetricEmbedder, metric::CLOUD_POINTS};
use credence_nn::weights::write_file;
use credence_types::{CLASS_COUNT, Category};

use super::{cloud::LabelledCloud, fitness::AngularFitness};
use crate::{TrainError, data::SceneCache, run::Figures};

/// The figures that the log of a training shows.
pub(super) const FIGURES: [&str; 6] = [
    "point_accuracy",
    "object_point_accuracy",
    "nearest_is_own",
    "within_mean_deg",
    "within_p95_deg",
    "between_min_deg",
];

/// What the network makes of scenes of objects it has not seen.
pub(super) struct Evaluated {
    /// Points by true class (row) and class of the largest logit (column), free space first.
    pub(super) confusion: [[u64; CLASS_COUNT]; CLASS_COUNT],
    /// Unit vectors of the objects' points with the index of their category.
    pub(super) points: Vec<(usize, [f64; 3])>,
    /// The learned directions of the categories.
    pub(super) directions: Vec<[f64; 3]>,
}

impl Evaluated {
    /// All figures by name; those of one class carry its name behind a slash.
    pub(super) fn figures(&self) -> Figures {
        let mut figures = Figures::new();
        let mut add = |name: String, value: f64| figures.insert(name, value);
        add("point_accuracy".to_owned(), accuracy(&self.confusion));
        // Free space is the first row.
        let objects = accuracy(&self.confusion[1..]);
        add("object_point_accuracy".to_owned(), objects);
        for (row, name) in self.confusion.iter().zip(class_names()) {
            let points: u64 = row.iter().sum();
            for (count, predicted) in row.iter().zip(class_names()) {
                let share = *count as f64 / points.max(1) as f64;
                add(format!("confusion/{name}/{predicted}"), share);
            }
        }
        let categories = Category::ALL.map(Category::name);
        let angles = AngularFitness::measure(&self.points, &self.directions, &categories);
        add("nearest_is_own".to_owned(), angles.nearest_is_own);
        add("within_mean_deg".to_owned(), angles.within_mean_deg);
        add("within_p95_deg".to_owned(), angles.within_p95_deg);
        add("between_mean_deg".to_owned(), angles.between_mean_deg);
        add("between_min_deg".to_owned(), angles.between_min_deg);
        add("fisher".to_owned(), angles.fisher);
        for class in angles.classes {
            let name = class.category;
            add(format!("within_mean_deg/{name}"), class.within_mean_deg);
            add(format!("within_p95_deg/{name}"), class.within_p95_deg);
            add(format!("nearest_class_deg/{name}"), class.nearest_class_deg);
        }
        figures
    }
}

fn class_names() -> impl Iterator<Item = &'static str> {
    std::iter::once("free").chain(Category::ALL.map(Category::name))
}

/// Embeds the scenes' clouds.
pub(super) fn evaluate(
    embedder: &MetricEmbedder,
    scenes: &SceneCache,
) -> Result<Evaluated, TrainError> {
    let mut confusion = [[0; CLASS_COUNT]; CLASS_COUNT];
    let mut points = Vec::new();
    for index in 0..scenes.len() {
        let cloud = LabelledCloud::from_scene(&scenes.get(index)?, CLOUD_POINTS);
        let embedded = embedder.embed_with_logits(&cloud.points)?;
        for (point, &class) in embedded.iter().zip(&cloud.classes) {
            confusion[usize::from(class)][largest(&point.logits)] += 1;
        }
        let occupied = cloud.occupied();
        points.extend(occupied.map(|(i, category)| (index_of(category), embedded[i].direction)));
    }
    Ok(Evaluated {
        confusion,
        points,
        directions: embedder.class_directions(),
    })
}

/// Position of a category in [`Category::ALL`].
fn index_of(category: Category) -> usize {
    usize::from(category.class()) - 1
}

fn largest(logits: &[f64]) -> usize {
    let at = |i: &usize| logits[*i];
    (0..logits.len())
        .max_by(|a, b| at(a).total_cmp(&at(b)))
        .unwrap_or(0)
}

/// Share of the diagonal in the last rows of a confusion matrix.
fn accuracy(rows: &[[u64; CLASS_COUNT]]) -> f64 {
    let first = CLASS_COUNT - rows.len();
    let right: u64 = rows.iter().enumerate().map(|(i, row)| row[first + i]).sum();
    let all: u64 = rows.iter().flatten().sum();
    right as f64 / all.max(1) as f64
}

/// Writes at most `limit` points per category, evenly chosen, and the learned directions as a
/// table: kind (point or direction), category, and the unit vector.
pub(super) fn write_table(
    evaluated: &Evaluated,
    limit: usize,
    path: &Path,
) -> Result<(), TrainError> {
    let mut table = String::from("kind,category,e1,e2,e3\n");
    let mut add = |kind: &str, category: usize, [x, y, z]: [f64; 3]| {
        let name = Category::ALL[category].name();
        writeln!(table, "{kind},{name},{x:.6},{y:.6},{z:.6}")
    };
    let mut lines = || {
        for (category, direction) in evaluated.directions.iter().enumerate() {
            add("direction", category, *direction)?;
        }
        for category in 0..Category::ALL.len() {
            let own: Vec<_> = evaluated
                .points
                .iter()
                .filter(|(c, _)| *c == category)
                .collect();
            let stride = own.len().div_ceil(limit.max(1)).max(1);
            for (_, direction) in own.into_iter().step_by(stride) {
                add("point", category, *direction)?;
            }
        }
        Ok::<(), std::fmt::Error>(())
    };
    lines().unwrap_or_else(|_| unreachable!("a string takes everything that is written to it"));
    Ok(write_file(path, table.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accuracies_by_hand() {
        let mut confusion = [[0; CLASS_COUNT]; CLASS_COUNT];
        confusion[0][0] = 60;
        confusion[0][3] = 20;
        confusion[3][3] = 15;
        confusion[3][6] = 5;
        assert_eq!(accuracy(&confusion), 0.75);
        assert_eq!(accuracy(&confusion[1..]), 0.75);
        confusion[6][6] = 20;
        assert_eq!(accuracy(&confusion[1..]), 35.0 / 40.0);
        assert_eq!(largest(&[0.0, 3.0, -1.0]), 1);
    }

    #[test]
    fn the_table_has_the_directions_and_a_sample_of_the_points() {
        let direction = [0.0, 0.6, -0.8];
        let evaluated = Evaluated {
            confusion: [[0; CLASS_COUNT]; CLASS_COUNT],
            directions: vec![direction; 6],
            points: vec![(5, direction); 10],
        };
        let figures = evaluated.figures();
        assert!(FIGURES.iter().all(|name| figures.contains_key(*name)));
        assert!(figures.values().all(|value| value.is_finite()));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.csv");
        write_table(&evaluated, 4, &path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "kind,category,e1,e2,e3");
        assert_eq!(lines[1], "direction,bottle,0.000000,0.600000,-0.800000");
        assert_eq!(lines[7..], ["point,mug,0.000000,0.600000,-0.800000"; 4]);
    }
}
