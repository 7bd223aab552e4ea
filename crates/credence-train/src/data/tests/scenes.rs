//! What views of boxes show, and what whole scenes hold.

use credence_types::{Category, stream};
use parry3d_f64::math::Vector;

use super::{
    super::{
        Scene,
        camera::Camera,
        observe::{Observed, observe},
        queries::{QUERIES, Query, SURROUNDINGS, ask, ask_around},
        sensor::Sensor,
        stage::{Placed, View},
    },
    boxes, cuboid_mesh, signed_distance,
};

/// Five standard deviations of depth at 0.5 m, over the least sine of a visible face's angle.
const NOISE_M: f64 = 0.012;

/// A box before the camera, which looks along -x from 0.45 m and above, and what is seen of it.
fn before_the_camera(size: [f32; 3], behind: Option<[f32; 3]>) -> (View, Observed) {
    let mesh = cuboid_mesh(size, Category::Can);
    let other = cuboid_mesh(behind.unwrap_or([0.05; 3]), Category::Mug);
    let mut placed = vec![Placed::new(&mesh, 1.0, 0.0, [0.0; 2])];
    if behind.is_some() {
        placed.push(Placed::new(&other, 1.0, 0.0, [0.0, 0.09]));
    }
    let middle = Vector::new(0.0, 0.0, 0.04);
    let camera = Camera::looking(middle + Vector::new(0.35, 0.0, 0.28), middle);
    let view = View::take(camera, &placed, Sensor { key: 11 }).unwrap();
    let views = [view];
    let observed = observe(&placed, &views, &mut stream(3, "test"));
    let [view] = views;
    (view, observed)
}

#[test]
fn a_box_shows_its_front_and_top_and_hides_the_rest() {
    let size = [0.08, 0.1, 0.08];
    let (_, observed) = before_the_camera(size, None);
    assert_eq!((observed.object.len(), observed.free.len()), (2048, 2048));
    assert!(observed.neighbours.is_empty());
    let size = size.map(f64::from);
    let (mut front, mut top) = (0, 0);
    let mut squares = 0.0;
    for point in &observed.object {
        let distance = signed_distance(size, *point);
        assert!(distance.abs() < NOISE_M, "{point} {distance}");
        squares += distance * distance;
        let on_front = (point.x - 0.04).abs() < 0.004;
        let on_top = (point.z - 0.08).abs() < 0.004;
        // An edge shared with a hidden side is at a visible one too.
        assert!(on_front || on_top || distance.abs() > 0.002, "{point}");
        front += usize::from(on_front && !on_top);
        top += usize::from(on_top && !on_front);
    }
    assert!(front > 500 && top > 500, "{front} {top}");
    // 1.3 mm along the ray, by the cosine to the normals (about 0.7).
    let spread = (squares / observed.object.len() as f64).sqrt();
    assert!((0.0005..0.0015).contains(&spread), "{spread}");
}

#[test]
fn free_space_is_before_the_box_and_never_in_or_behind_it() {
    let size = [0.08, 0.1, 0.08].map(f64::from);
    let (view, observed) = before_the_camera([0.08, 0.1, 0.08], None);
    for point in &observed.free {
        assert!(signed_distance(size, *point) > 0.0, "{point}");
        // Straight from the eye to the point, the box is not in between.
        let blocked = (1..1000).any(|step| {
            let at = view.camera.eye.lerp(*point, f64::from(step) / 1000.0);
            signed_distance(size, at) < -0.006
        });
        assert!(!blocked, "{point}");
        let nearest = observed.object.iter().map(|o| o.distance(*point));
        assert!(nearest.fold(f64::INFINITY, f64::min) >= 0.01);
        assert!((0.005..0.12).contains(&point.z));
        assert!(point.x.abs() < 0.08 && point.y.abs() < 0.09);
    }
    let before = observed.free.iter().filter(|point| point.x > 0.04).count();
    let behind = observed.free.iter().filter(|point| point.x < -0.04).count();
    assert!(before > 300 && behind < before, "{before} {behind}");
}

#[test]
fn neighbours_are_seen_and_keep_free_space_away() {
    let (_, observed) = before_the_camera([0.08, 0.08, 0.08], Some([0.08, 0.06, 0.06]));
    assert!(observed.neighbours.len() > 100);
    for (point, category) in &observed.neighbours {
        assert_eq!(*category, Category::Mug);
        let own = *point - Vector::new(0.0, 0.09, 0.0);
        assert!(signed_distance([0.08, 0.06, 0.06], own).abs() < NOISE_M);
        // In the target's box, padded by 3 cm and the noise of its extreme points.
        assert!(point.y < 0.04 + 0.03 + NOISE_M);
        let nearest = observed.free.iter().map(|free| free.distance(*point));
        assert!(nearest.fold(f64::INFINITY, f64::min) >= 0.01);
    }
}

#[test]
fn a_hidden_or_cut_target_makes_no_view() {
    let mesh = cuboid_mesh([0.06; 3], Category::Can);
    let wall = cuboid_mesh([0.02, 0.3, 0.2], Category::Laptop);
    let target = Placed::new(&mesh, 1.0, 0.0, [0.0; 2]);
    let screen = Placed::new(&wall, 1.0, 0.0, [0.1, 0.0]);
    let camera = Camera::looking(Vector::new(0.4, 0.0, 0.3), Vector::ZERO);
    let sensor = Sensor { key: 0 };
    assert!(View::take(camera, &[target], sensor).is_some());
    assert!(View::take(camera, &[target, screen], sensor).is_none());
    let aside = Camera::looking(Vector::new(0.4, 0.0, 0.3), Vector::new(0.0, 0.3, 0.0));
    assert!(View::take(aside, &[target], sensor).is_none());
    assert!(View::take(camera, &[], sensor).is_none());
}

#[test]
fn queries_know_their_distance() {
    let size = [0.08_f32, 0.1, 0.06];
    let mesh = cuboid_mesh(size, Category::Can);
    let (scale, yaw, centre) = (1.1, 0.6, [0.03, -0.2]);
    let target = Placed::new(&mesh, scale, yaw, centre);
    let queries = ask(&target, &mut stream(1, "test"));
    assert_eq!(queries.len(), QUERIES);
    let grown = size.map(|side| f64::from(side) * scale);
    let (sin, cos) = f64::sin_cos(yaw);
    let mut near = 0;
    let mut in_box = 0;
    for query in &queries {
        let Query { point, nearest } = *query;
        // By hand: back to the box's own axes.
        let (x, y) = (point.x - centre[0], point.y - centre[1]);
        let own = Vector::new(cos * x + sin * y, cos * y - sin * x, point.z);
        let expected = signed_distance(grown, own).abs();
        let distance = query.distance_m();
        assert!((distance - expected).abs() < 1e-8, "{distance} {expected}");
        let on_surface = target.local_point(nearest) * scale;
        assert!(signed_distance(grown, on_surface).abs() < 1e-8);
        near += usize::from(distance < 0.005);
        let padded = Vector::new(grown[0], grown[1], 0.0) / 2.0 + Vector::splat(0.01);
        let inside = own.x.abs() <= padded.x && own.y.abs() <= padded.y;
        in_box += usize::from(inside && (0.0..=grown[2] + 0.01).contains(&own.z));
    }
    // Of the half about the surface most are near it: sigma 1 and 3 mm nearly all.
    assert!((250..700).contains(&near), "{near}");
    assert!(in_box >= QUERIES / 2);
    let around = ask_around(&target, &mut stream(1, "test"));
    assert_eq!(around.len(), SURROUNDINGS);
    let farthest = around.iter().map(Query::distance_m).fold(0.0, f64::max);
    // The padded box's upper corners are farthest: 6 cm along each of three axes.
    assert!((0.08..0.104).contains(&farthest), "{farthest}");
}

#[test]
fn scenes_are_a_function_of_seed_and_index() {
    let (_folder, meshes) = boxes();
    let scene = |seed, index| Scene::generate(&meshes, seed, index).unwrap();
    assert_eq!(scene(1, 2), scene(1, 2));
    assert_ne!(scene(1, 2), scene(1, 3));
    assert_ne!(scene(1, 2), scene(2, 2));
}

#[test]
fn scenes_are_whole_and_of_every_kind() {
    let (_folder, meshes) = boxes();
    let mut of_category = [0; 6];
    let (mut with_neighbours, mut shifted) = (0, 0);
    for index in 0..120 {
        let scene = Scene::generate(&meshes, 5, index).unwrap();
        of_category[usize::from(scene.category.class()) - 1] += 1;
        with_neighbours += usize::from(!scene.neighbours.is_empty());
        assert!((200..=2048).contains(&scene.object.len()));
        assert!((200..=2048).contains(&scene.free.len()));
        assert!(scene.neighbours.len() <= 1024);
        assert_eq!(scene.queries.len(), 1024);
        assert_eq!(scene.distances_m.len(), 1024);
        assert_eq!((scene.surroundings.len(), scene.nearest.len()), (512, 1536));
        let lowest = scene
            .free
            .iter()
            .map(|point| point[2])
            .fold(f32::INFINITY, f32::min);
        shifted += usize::from(lowest < 0.005 - 1e-6);
        let points = [&scene.object, &scene.free, &scene.queries]
            .into_iter()
            .flatten();
        let neighbours = scene.neighbours.iter().map(|(point, _)| point);
        for point in points.chain(neighbours) {
            assert!(point.iter().all(|c| c.abs() < 0.5), "{point:?}");
        }
        assert!(scene.distances_m.iter().all(|d| (0.0..0.2).contains(d)));
        assert!((0.1..0.9).contains(&scene.viewpoint[2]));
    }
    assert!(
        of_category.iter().all(|count| *count >= 8),
        "{of_category:?}"
    );
    assert!((10..50).contains(&with_neighbours), "{with_neighbours}");
    assert!((2..20).contains(&shifted), "{shifted}");
}

#[test]
fn a_prefix_is_a_random_sample() {
    let (_folder, meshes) = boxes();
    let mean = |points: &[[f32; 3]], axis: usize| {
        points.iter().map(|point| point[axis]).sum::<f32>() / points.len() as f32
    };
    for index in 0..6 {
        let scene = Scene::generate(&meshes, 9, index).unwrap();
        for points in [&scene.object, &scene.free, &scene.queries] {
            for axis in 0..3 {
                let (all, some) = (mean(points, axis), mean(&points[..points.len() / 4], axis));
                // Spreads are at most 6 cm, samples at least 250 points.
                assert!((all - some).abs() < 0.012, "{all} {some}");
            }
        }
    }
}

#[test]
fn an_unseeable_object_is_an_error() {
    let (folder, _) = boxes();
    let speck = super::cuboid([0.002; 3]);
    let bytes = super::ply_bytes(&speck.vertices, &speck.faces);
    for category in Category::ALL {
        for number in 0..2 {
            let name = format!("{category}-{number}.ply");
            std::fs::write(folder.path().join(name), &bytes).unwrap();
        }
    }
    let meshes = super::MeshSet::open(folder.path()).unwrap();
    let message = Scene::generate(&meshes, 0, 4).unwrap_err().to_string();
    assert!(message.starts_with("scene 4 shows too little of its object in 200 draws; use meshes"));
}
