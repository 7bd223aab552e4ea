mod map;
mod scene;
mod segmentation;
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

/// Holds the map to its word: the octree's occupied voxels, one by one, are those with semantics,
/// and an object's are those of them that name it.
fn assert_agreement(map: &SemanticMap) {
    let grid = map.occupancy().grid();
    let mut occupied = Vec::new();
    for leaf in map.occupancy().leaves().filter(|leaf| !leaf.is_free()) {
        let edge = (leaf.size_m / map.occupancy().resolution_m()).round() as usize;
        let low = leaf.aabb().min() + nalgebra::Vector3::repeat(grid.resolution_m() / 2.0);
        for i in 0..edge.pow(3) {
            let steps = [i % edge, i / edge % edge, i / edge.pow(2)].map(|s| s as f64);
            let point = low + nalgebra::Vector3::from(steps) * grid.resolution_m();
            occupied.push(grid.key_of(&point).unwrap());
        }
    }
    occupied.sort_unstable();
    let shown: Vec<SemanticVoxel> = map.voxels().collect();
    let keys: Vec<VoxelKey> = shown.iter().map(|v| v.key).collect();
    assert_eq!(keys, occupied);
    for voxel in &shown {
        assert_eq!(map.voxel_at(&voxel.centre).as_ref(), Some(voxel));
    }
    for object in map.objects() {
        let of_object = shown.iter().filter(|v| v.object == Some(object.id()));
        let expected: Vec<SemanticVoxel> = of_object.cloned().collect();
        assert!(map.object_voxels(object.id()) == Ok(expected));
    }
    let named = shown.iter().filter_map(|v| v.object);
    assert!(named.into_iter().all(|id| map.object(id).is_ok()));
}

fn ids(map: &SemanticMap) -> Vec<u32> {
    map.objects().map(|o| o.id().0).collect()
}
