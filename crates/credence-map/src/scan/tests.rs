use proptest::prelude::*;

use super::*;

fn grid(resolution_m: f64) -> Grid {
    Grid::new(resolution_m).unwrap()
}

fn trace(origin: [f64; 3], points: &[[f64; 3]], max_range_m: Option<f64>) -> ScanCells {
    let points: Vec<Point> = points.iter().map(|p| Point::from(*p)).collect();
    ScanCells::trace(&grid(1.0), &origin.into(), &points, max_range_m).unwrap()
}

/// Keys relative to the voxel that starts at coordinate 0.
fn keys(cells: &ScanCells, bits: fn(&Cells) -> u64) -> Vec<[i32; 3]> {
    let mut keys = Vec::new();
    for block in cells.blocks() {
        for bit in (0..64).filter(|bit| bits(block) >> bit & 1 == 1) {
            let key = VoxelKey::from_morton(block.code << 6 | bit);
            keys.push(key.axes().map(|k| i32::from(k) - 32768));
        }
    }
    keys.sort_unstable();
    keys
}

#[test]
fn a_ray_is_free_up_to_the_voxel_that_it_ends_in() {
    let cells = trace([0.5; 3], &[[3.5, 0.5, 0.5]], None);
    assert_eq!(keys(&cells, |b| b.free), [[0, 0, 0], [1, 0, 0], [2, 0, 0]]);
    assert_eq!(keys(&cells, |b| b.occupied), [[3, 0, 0]]);
    assert_eq!(
        cells.update(),
        ScanUpdate {
            free_voxels: 3,
            occupied_voxels: 1,
            points_outside: 0
        }
    );
    assert!(cells.is_free(VoxelKey::from_axes([32769, 32768, 32768])));
    assert!(!cells.is_free(VoxelKey::from_axes([32771, 32768, 32768])));
    assert!(!cells.is_free(VoxelKey::from_axes([40000, 32768, 32768])));
}

#[test]
fn an_oblique_ray_crosses_borders_in_order() {
    // From (0.5, 0.25) towards (-1.5, -1.75): y = 0 is crossed first, then x = 0, and so on.
    let cells = trace([0.5, 0.25, 0.5], &[[-1.5, -1.75, 0.5]], None);
    let free = [[-1, -2, 0], [-1, -1, 0], [0, -1, 0], [0, 0, 0]];
    assert_eq!(keys(&cells, |b| b.free), free);
    assert_eq!(keys(&cells, |b| b.occupied), [[-2, -2, 0]]);
}

#[test]
fn a_ray_within_one_voxel_only_occupies() {
    let cells = trace([0.2; 3], &[[0.8; 3]], None);
    assert!(keys(&cells, |b| b.free).is_empty());
    assert_eq!(keys(&cells, |b| b.occupied), [[0, 0, 0]]);
}

#[test]
fn ends_win_over_rays_of_the_same_scan() {
    let cells = trace([0.5; 3], &[[3.5, 0.5, 0.5], [1.5, 0.5, 0.5]], None);
    assert_eq!(keys(&cells, |b| b.free), [[0, 0, 0], [2, 0, 0]]);
    assert_eq!(keys(&cells, |b| b.occupied), [[1, 0, 0], [3, 0, 0]]);
}

#[test]
fn the_range_cuts_rays_and_their_ends() {
    let cells = trace([0.5; 3], &[[9.5, 0.5, 0.5]], Some(2.0));
    assert_eq!(keys(&cells, |b| b.free), [[0, 0, 0], [1, 0, 0]]);
    assert!(keys(&cells, |b| b.occupied).is_empty());
}

#[test]
fn points_outside_the_volume_are_counted() {
    let cells = trace(
        [0.5; 3],
        &[[1e5, 0.0, 0.0], [1e300, 0.0, 0.0], [0.5; 3]],
        None,
    );
    assert_eq!(cells.points_outside, 2);
    assert_eq!(keys(&cells, |b| b.occupied), [[0, 0, 0]]);
    // Cut at a range that ends inside, the ray counts again.
    assert_eq!(
        trace([0.5; 3], &[[1e5, 0.5, 0.5]], Some(3.0)).points_outside,
        0
    );
}

#[test]
fn rays_at_the_volumes_border_stay_inside() {
    let edge = 32767.9;
    let cells = trace([32765.5, edge, 0.5], &[[edge, edge, edge]], None);
    let inside = |k: &[i32; 3]| k.iter().all(|k| (0..32768).contains(k));
    assert!(keys(&cells, |b| b.free).iter().all(inside));
    assert_eq!(keys(&cells, |b| b.occupied), [[32767; 3]]);
}

#[test]
fn rays_too_short_for_f32_end() {
    for tiny in [1e-45, 1e-30, 1e-23, 1e-15] {
        let cells = trace([-tiny; 3], &[[tiny; 3], [tiny, tiny, -tiny]], None);
        assert!(cells.update().free_voxels <= 16);
        assert_eq!(cells.update().occupied_voxels, 2);
    }
}

#[test]
fn refuses_what_is_no_scan() {
    let message = |origin: [f64; 3], point: [f64; 3], range| {
        ScanCells::trace(&grid(0.005), &origin.into(), &[point.into()], range)
            .unwrap_err()
            .to_string()
    };
    let point = [1.0; 3];
    assert!(message([f64::NAN; 3], point, None).contains("origin_world[0] is not finite"));
    assert!(message([0.0; 3], [0.0, f64::INFINITY, 0.0], None).contains("points_world[0]"));
    assert!(message([200.0; 3], point, None).contains("which reaches 163.84 m"));
    for range in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(message([0.0; 3], point, Some(range)).contains("max_range_m is"));
    }
}

#[test]
fn far_points_cannot_take_all_memory() {
    let points: Vec<Point> = (0..1000)
        .map(|i| Point::new(30000.0, f64::from(i) * 20.0, -30000.0))
        .collect();
    let error = ScanCells::trace_within(&grid(1.0), &Point::origin(), &points, None, [1000, 1000]);
    let message = error.unwrap_err().to_string();
    assert!(message.contains("set max_range_m"), "{message}");
}

proptest! {
    #[test]
    fn sparse_marks_equal_dense_ones(
        origin in [-3.0..3.0, -3.0..3.0, -3.0..3.0],
        points in prop::collection::vec([-9.0..9.0, -9.0..9.0, -9.0..9.0], 1..40),
        range in prop::option::of(0.5..12.0),
    ) {
        let points: Vec<Point> = points.into_iter().map(Point::from).collect();
        let with = |limits| {
            ScanCells::trace_within(&grid(0.25), &origin.into(), &points, range, limits).unwrap()
        };
        prop_assert_eq!(with([1 << 20, 0]), with([0, 1 << 20]));
    }

    #[test]
    fn threads_do_not_change_the_outcome(
        points in prop::collection::vec([-9.0..9.0, -9.0..9.0, -9.0..9.0], 1..200),
    ) {
        let points: Vec<Point> = points.into_iter().map(Point::from).collect();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ScanCells::trace(&grid(0.25), &Point::origin(), &points, None).unwrap())
        };
        prop_assert_eq!(with(1), with(3));
    }
}
