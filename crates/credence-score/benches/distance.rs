//! Distances of 100,000 points to bumpy tori of 500 to 128,000 faces.

use std::f64::consts::TAU;

use credence_score::MeshTruth;
use credence_types::{Point, TriMesh};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const QUERIES: usize = 100_000;

/// Margin around the mesh in which queries lie, metres: the test box of the seed's protocol.
const PADDING_M: f64 = 0.03;

/// A torus the size of a bowl, of `4 around^2 / 5` faces, its tube's radius wavy by 15 %.
fn bumpy_torus(around: u32) -> TriMesh {
    let (rings, sides) = (around, around * 2 / 5);
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let a = TAU * f64::from(ring) / f64::from(rings);
            let b = TAU * f64::from(side) / f64::from(sides);
            let tube = 0.015 * (1.0 + 0.15 * (5.0 * a).sin() * (3.0 * b).cos());
            let radius = 0.04 + tube * b.cos();
            vertices.push(Point::new(
                radius * a.cos(),
                radius * a.sin(),
                tube * b.sin(),
            ));
            let at = |r: u32, s: u32| (r % rings) * sides + s % sides;
            faces.push([at(ring, side), at(ring + 1, side), at(ring + 1, side + 1)]);
            faces.push([at(ring, side), at(ring + 1, side + 1), at(ring, side + 1)]);
        }
    }
    TriMesh::new(vertices, faces).expect("a torus is a mesh")
}

/// Points spread evenly over the padded box of a mesh: the R3 sequence (Roberts 2018).
fn queries(mesh: &TriMesh) -> Vec<Point> {
    let low = mesh
        .vertices()
        .iter()
        .fold(Point::origin(), |l, v| l.inf(v));
    let high = mesh
        .vertices()
        .iter()
        .fold(Point::origin(), |h, v| h.sup(v));
    let root = 1.220_744_084_605_76_f64;
    (1..=QUERIES)
        .map(|i| {
            let at = |axis: usize, power: i32| {
                let share = (i as f64 * root.powi(-power)).fract();
                low[axis] - PADDING_M + share * (high[axis] - low[axis] + 2.0 * PADDING_M)
            };
            Point::new(at(0, 1), at(1, 2), at(2, 3))
        })
        .collect()
}

fn distances(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("distances");
    group.sample_size(10);
    group.throughput(Throughput::Elements(QUERIES as u64));
    for around in [25, 50, 100, 200, 400] {
        let mesh = bumpy_torus(around);
        let points = queries(&mesh);
        let truth = MeshTruth::new(&mesh).expect("a torus has faces");
        let id = BenchmarkId::from_parameter(mesh.faces().len());
        group.bench_function(id, |bencher| bencher.iter(|| truth.distances(&points)));
    }
    group.finish();

    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    for around in [100, 400] {
        let mesh = bumpy_torus(around);
        let id = BenchmarkId::from_parameter(mesh.faces().len());
        group.bench_function(id, |bencher| bencher.iter(|| MeshTruth::new(&mesh)));
    }
    group.finish();
}

criterion_group!(benches, distances);
criterion_main!(benches);
