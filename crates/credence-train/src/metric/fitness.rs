/// How far the points of a class spread on the sphere.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ClassSpread {
    /// The category.
    pub(super) category: &'static str,
    /// Its points.
    pub(super) points: usize,
    /// Mean angle between a point and its class's mean direction, degrees.
    pub(super) within_mean_deg: f64,
    /// The angle that 95 % of the points stay below, degrees.
    pub(super) within_p95_deg: f64,
    /// Angle to the nearest other class's mean direction, degrees.
    pub(super) nearest_class_deg: f64,
}

/// Whether classes are narrow and far apart on the sphere.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AngularFitness {
    /// One entry per category that has points.
    pub(super) classes: Vec<ClassSpread>,
    /// Mean over all points of the angle to their class's mean direction, degrees.
    pub(super) within_mean_deg: f64,
    /// Its 95th percentile, degrees.
    pub(super) within_p95_deg: f64,
    /// Mean angle between two classes' mean directions, degrees.
    pub(super) between_mean_deg: f64,
    /// The smallest such angle, degrees.
    pub(super) between_min_deg: f64,
    /// Share of points whose nearest learned class direction is their own.
    pub(super) nearest_is_own: f64,
    /// Angular Fisher score (Liu et al. 2017): the sum over points of 1 - cos to their class's
    /// mean direction over the sum over classes of n (1 - cos) to the mean of all; less is better.
    pub(super) fisher: f64,
}

type Direction = [f64; 3];

impl AngularFitness {
    /// Of unit vectors with the index of their class, whose learned directions and names are
    /// given; all angles are 0 when there are no points.
    pub(super) fn measure(
        points: &[(usize, Direction)],
        learned: &[Direction],
        names: &[&'static str],
    ) -> Self {
        let of_class = |class: usize| points.iter().filter(move |(c, _)| *c == class);
        let means: Vec<Option<Direction>> = (0..names.len())
            .map(|class| mean_direction(of_class(class).map(|(_, e)| *e)))
            .collect();
        let between = |a: usize, b: usize| Some(angle_deg(means[a]?, means[b]?));
        let pairs: Vec<f64> = (0..names.len())
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .filter_map(|(a, b)| between(a, b))
            .collect();
        let mut all_within = Vec::with_capacity(points.len());
        let mut classes = Vec::new();
        for (class, name) in names.iter().enumerate() {
            let Some(mean) = means[class] else { continue };
            let mut within: Vec<f64> = of_class(class).map(|(_, e)| angle_deg(*e, mean)).collect();
            all_within.extend(&within);
            let others: Vec<f64> = (0..names.len())
                .filter(|other| *other != class)
                .filter_map(|other| between(class, other))
                .collect();
            classes.push(ClassSpread {
                category: name,
                points: within.len(),
                within_mean_deg: average(&within),
                within_p95_deg: percentile_95(&mut within),
                nearest_class_deg: smallest(&others),
            });
        }
        let own = |(class, e): &&(usize, Direction)| nearest(*e, learned) == Some(*class);
        Self {
            classes,
            within_mean_deg: average(&all_within),
            within_p95_deg: percentile_95(&mut all_within),
            between_mean_deg: average(&pairs),
            between_min_deg: smallest(&pairs),
            nearest_is_own: points.iter().filter(own).count() as f64 / points.len().max(1) as f64,
            fisher: fisher(points, &means),
        }
    }
}

fn fisher(points: &[(usize, Direction)], means: &[Option<Direction>]) -> f64 {
    let Some(centre) = mean_direction(points.iter().map(|(_, e)| *e)) else {
        return 0.0;
    };
    let (mut within, mut between) = (0.0, 0.0);
    for (class, e) in points {
        if let Some(mean) = means[*class] {
            within += 1.0 - dot(*e, mean);
            between += 1.0 - dot(mean, centre);
        }
    }
    if between > 0.0 { within / between } else { 0.0 }
}

/// The class whose direction makes the smallest angle.
fn nearest(e: Direction, learned: &[Direction]) -> Option<usize> {
    let cosine = |class: &usize| dot(e, learned[*class]);
    (0..learned.len()).max_by(|a, b| cosine(a).total_cmp(&cosine(b)))
}

/// The direction of the sum; `None` when there is none.
fn mean_direction(vectors: impl Iterator<Item = Direction>) -> Option<Direction> {
    let sum = vectors.fold([0.0; 3], |s, v| [s[0] + v[0], s[1] + v[1], s[2] + v[2]]);
    let length = dot(sum, sum).sqrt();
    (length > 1e-12).then(|| sum.map(|c| c / length))
}

fn dot(a: Direction, b: Direction) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn angle_deg(a: Direction, b: Direction) -> f64 {
    dot(a, b).clamp(-1.0, 1.0).acos().to_degrees()
}

/// 0 of none.
fn smallest(values: &[f64]) -> f64 {
    values.iter().copied().reduce(f64::min).unwrap_or(0.0)
}

fn average(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The smallest value that at least 95 % of the values do not exceed; sorts them.
fn percentile_95(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (values.len() * 95).div_ceil(100).max(1);
    values.get(rank - 1).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_equator(degrees: f64) -> Direction {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [cos, sin, 0.0]
    }

    #[test]
    fn two_classes_by_hand() {
        // One class at 0 and 20 degrees, mean 10; another at 90 alone; a third without points.
        let points = [
            (0, on_equator(0.0)),
            (0, on_equator(20.0)),
            (1, on_equator(90.0)),
        ];
        let learned = [on_equator(10.0), on_equator(70.0), on_equator(-90.0)];
        let found = AngularFitness::measure(&points, &learned, &["a", "b", "c"]);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} is not {b}");
        assert_eq!(found.classes.len(), 2);
        close(found.classes[0].within_mean_deg, 10.0);
        close(found.classes[1].within_p95_deg, 0.0);
        close(found.classes[1].nearest_class_deg, 80.0);
        close(found.within_mean_deg, 20.0 / 3.0);
        close(found.within_p95_deg, 10.0);
        close(found.between_mean_deg, 80.0);
        close(found.between_min_deg, 80.0);
        close(found.nearest_is_own, 1.0);
        let centre = mean_direction(points.iter().map(|(_, e)| *e)).unwrap();
        let within = 2.0 * (1.0 - 10.0_f64.to_radians().cos());
        let between = 2.0 * (1.0 - dot(centre, on_equator(10.0))) + 1.0 - centre[1];
        close(found.fisher, within / between);
    }

    #[test]
    fn the_nearest_learned_direction_counts() {
        let points = [(0, on_equator(0.0)), (0, on_equator(40.0))];
        let learned = [on_equator(0.0), on_equator(50.0)];
        let found = AngularFitness::measure(&points, &learned, &["a", "b"]);
        assert_eq!(found.nearest_is_own, 0.5);
        let none = AngularFitness::measure(&[], &learned, &["a", "b"]);
        assert_eq!((none.within_p95_deg, none.fisher), (0.0, 0.0));
    }

    #[test]
    fn the_percentile_is_a_value_that_occurs() {
        assert_eq!(percentile_95(&mut [3.0]), 3.0);
        let mut hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(percentile_95(&mut hundred), 95.0);
    }
}
