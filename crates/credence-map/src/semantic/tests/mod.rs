mod map;
mod scene;
mod tracking;

use scene::{Shape, View};

use super::*;

fn empty() -> SemanticMap {
    SemanticMap::new(SemanticMapConfig::default()).unwrap()
}

/// Inserts a view with all its shapes detected; returns the object of each shape in view.
fn show(
    map: &mut SemanticMap,
    shapes: &[Shape],
    eye: [f64; 3],
    target: [f64; 3],
) -> BTreeMap<usize, ObjectId> {
    let view = View::new(shapes, eye, target);
    let (instances, seen) = view.instances(shapes);
    let report = map.insert(&view.frame(), &instances).unwrap();
    let pair = |(shape, id): (usize, Option<ObjectId>)| Some((shape, id?));
    seen.into_iter()
        .zip(report.objects)
        .filter_map(pair)
        .collect()
}

fn ids(map: &SemanticMap) -> Vec<u32> {
    map.objects().map(|o| o.id().0).collect()
}
