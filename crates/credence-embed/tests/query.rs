//! The query embedding from outside: what changes it, what does not, and what it refuses.

use std::{fs, path::Path, time::Instant};

use burn::tensor::Device;
use credence_embed::{
    Observation, QueryEmbedder, QueryEmbedding,
    query::{QueryNetwork, Widths},
};
use credence_nn::{seed_parameters, weights};
use credence_types::{Point, stream};
use nalgebra::Vector3;
use rand::{RngExt as _, seq::SliceRandom as _};

fn network(seed: u64) -> QueryNetwork {
    let network = QueryNetwork::new(Widths::default(), &Device::flex());
    seed_parameters(network, &mut stream(seed, "test/network"))
}

fn embedder() -> QueryEmbedder {
    QueryEmbedder::new(network(3))
}

fn cloud(count: usize, purpose: &str) -> Vec<Point> {
    let mut rng = stream(1, purpose);
    let mut draw = || rng.random_range(-0.05..0.05);
    (0..count)
        .map(|_| Point::new(0.5 + draw(), draw(), 0.05 + draw()))
        .collect()
}

fn observation(object: usize, free: usize) -> Observation {
    Observation {
        object: cloud(object, "test/object"),
        free: cloud(free, "test/free"),
        viewpoint: Point::new(0.1, 0.3, 0.5),
        table_height_m: 0.0,
    }
}

fn whole(answers: &[QueryEmbedding]) -> bool {
    answers.iter().all(|a| {
        let norm = a.direction.iter().map(|c| c * c).sum::<f64>().sqrt();
        a.logit.is_finite() && (norm - 1.0).abs() < 1e-3
    })
}

#[test]
fn neither_order_nor_threads_nor_repetition_change_a_bit() {
    let (embedder, queries) = (embedder(), cloud(700, "test/queries"));
    let seen = observation(2500, 600);
    let expected = embedder.embed(&seen, &queries).unwrap();
    assert!(whole(&expected));
    let mut shuffled = seen.clone();
    shuffled.object.shuffle(&mut stream(2, "test/order"));
    shuffled.free.reverse();
    assert_eq!(embedder.embed(&shuffled, &queries).unwrap(), expected);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let again = pool.install(|| embedder.embed(&seen, &queries).unwrap());
        assert_eq!(again, expected, "{threads} threads");
    }
    // A query's answer does not depend on the other queries.
    let alone = embedder.embed(&seen, &queries[300..301]).unwrap();
    assert!((alone[0].logit - expected[300].logit).abs() < 1e-5);
}

#[test]
fn moving_the_scene_along_the_table_changes_nothing() {
    let embedder = embedder();
    let (seen, queries) = (observation(800, 400), cloud(300, "test/queries"));
    let expected = embedder.embed(&seen, &queries).unwrap();
    let by = Vector3::new(-0.7, 1.3, 0.0);
    let moved = |points: &[Point]| -> Vec<Point> { points.iter().map(|p| p + by).collect() };
    let other = Observation {
        object: moved(&seen.object),
        free: moved(&seen.free),
        viewpoint: seen.viewpoint + by,
        table_height_m: 0.0,
    };
    let found = embedder.embed(&other, &moved(&queries)).unwrap();
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found.logit - expected.logit).abs() < 1e-4);
        let apart = |i: usize| (found.direction[i] - expected.direction[i]).abs();
        assert!((0..3).all(|i| apart(i) < 1e-4));
    }
}

#[test]
fn few_equal_and_far_points_have_finite_answers() {
    let (embedder, queries) = (embedder(), cloud(40, "test/queries"));
    assert!(whole(
        &embedder.embed(&observation(1, 1), &queries).unwrap()
    ));
    let mut seen = observation(50, 50);
    seen.object = vec![seen.object[0]; 3000];
    seen.free = vec![seen.object[0]; 3];
    assert!(whole(&embedder.embed(&seen, &queries).unwrap()));
    let mut seen = observation(50, 50);
    seen.object.push(Point::new(40.0, -3.0, 1e5));
    seen.free.push(Point::new(-1e9, 0.0, 0.0));
    assert!(whole(&embedder.embed(&seen, &queries).unwrap()));
    seen.object.extend([Point::new(1e308, -1e308, 1e308); 2]);
    seen.viewpoint.x = -1e308;
    assert!(whole(&embedder.embed(&seen, &queries).unwrap()));
    assert!(embedder.embed(&seen, &[]).unwrap().is_empty());
}

#[test]
fn a_query_metres_away_is_free() {
    let far = [Point::new(3.0, 0.0, 0.0), Point::new(-1e12, 1e12, 1e300)];
    let answers = embedder().embed(&observation(300, 300), &far).unwrap();
    assert!(
        whole(&answers) && answers.iter().all(|a| a.logit == -10.0),
        "{answers:?}"
    );
}

#[test]
fn a_million_points_are_thinned_quickly() {
    let embedder = embedder();
    let (seen, queries) = (observation(1_000_000, 1_000_000), cloud(10, "test/queries"));
    let start = Instant::now();
    let answers = embedder.embed(&seen, &queries).unwrap();
    assert!(whole(&answers) && start.elapsed().as_secs() < 10);
    let mut reversed = seen;
    reversed.object.reverse();
    assert_eq!(embedder.embed(&reversed, &queries).unwrap(), answers);
}

#[test]
fn what_cannot_be_embedded_has_its_message() {
    let embedder = embedder();
    let message = |change: fn(&mut Observation), queries: &[Point]| {
        let mut seen = observation(30, 30);
        change(&mut seen);
        embedder.embed(&seen, queries).unwrap_err().to_string()
    };
    let here = [Point::new(0.5, 0.0, 0.05)];
    let nan = Point::new(0.0, f64::NAN, 0.0);
    assert_eq!(
        message(|seen| seen.object.clear(), &here),
        "the observation has no object points; ask about an object only once it has been seen"
    );
    assert!(message(|seen| seen.free.clear(), &here).contains("no free points; sample them"));
    assert!(message(|_| (), &[here[0], nan]).starts_with("queries[1] is not finite"));
    let text = message(|seen| seen.object[7].x = f64::INFINITY, &here);
    assert!(
        text.starts_with("object[7] is not finite; remove"),
        "{text}"
    );
    let text = message(|seen| seen.free[3].z = f64::NAN, &here);
    assert!(text.starts_with("free[3] is not finite"), "{text}");
    let text = message(|seen| seen.viewpoint.y = f64::NAN, &here);
    assert!(text.starts_with("viewpoint[0] is not finite"), "{text}");
    let text = message(|seen| seen.table_height_m = f64::NAN, &here);
    assert!(text.contains("table_height_m is NaN"), "{text}");
}

#[test]
fn weight_files_are_read_whole_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("query.safetensors");
    let message = |path: &Path| QueryEmbedder::from_file(path).unwrap_err().to_string();
    assert!(
        message(&path).contains("credence-train"),
        "{}",
        message(&path)
    );

    weights::save(&network(3), &path).unwrap();
    let (seen, queries) = (observation(300, 300), cloud(10, "test/queries"));
    let read = QueryEmbedder::from_file(&path)
        .unwrap()
        .embed(&seen, &queries)
        .unwrap();
    assert_eq!(read, embedder().embed(&seen, &queries).unwrap());

    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(message(&path).contains("is not a whole safetensors file"));
    fs::write(&path, b"weights").unwrap();
    assert!(message(&path).contains("is not a whole safetensors file"));

    let other = QueryNetwork::new(Widths { point: 8, code: 8 }, &Device::flex());
    weights::save(&other, &path).unwrap();
    assert!(
        message(&path).contains("another network"),
        "{}",
        message(&path)
    );
}

#[test]
fn the_built_in_weights_are_this_network_s() {
    let embedder = QueryEmbedder::embedded().unwrap();
    for anchor in embedder.anchors().unwrap() {
        let norm = anchor.iter().map(|c| c * c).sum::<f64>();
        assert!((norm - 1.0).abs() < 1e-5, "{anchor:?}");
    }
    let answers = embedder
        .embed(&observation(300, 300), &cloud(50, "test/queries"))
        .unwrap();
    assert!(whole(&answers));
}
