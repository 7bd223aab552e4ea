use credence_types::{Frame, Instance, Observation, Point, Pose, stream};
use nalgebra::Vector3;
use rand::RngExt as _;
use rayon::prelude::*;

use crate::{CompleteError, observed_points, search::Nearest};

/// Free points of an observation, and draws among which they are looked for.
const FREE: usize = 1800;
const FREE_DRAWS: usize = 50 * FREE;

/// The box around what was seen in which they lie, and how far they keep from measured surfaces.
const BOX_PADDING_M: f64 = 0.03;
const FREE_MARGIN_M: f64 = 0.01;

/// A ray frees space up to this far before its end.
const RAY_MARGIN_M: f64 = 0.005;

/// What a frame shows of its instances: as the map would know it after this frame alone, which is
/// also how the network's training scenes are observed.
pub(super) fn observe(
    frame: &Frame,
    instances: &[Instance],
    table_height_m: f64,
) -> Result<Vec<Observation>, CompleteError> {
    let pose = frame.world_from_camera();
    let clouds = instances.iter().map(|instance| {
        let points = observed_points(frame, instance)?;
        Ok(points.iter().map(|p| pose.transform_point(p)).collect())
    });
    let clouds: Vec<Vec<Point>> = clouds.collect::<Result<_, CompleteError>>()?;
    let camera_from_world = pose.inverse();
    let measured = Nearest::new(&clouds.concat())?;
    let observation = |object: Vec<Point>| Observation {
        free: free_points(
            frame,
            &camera_from_world,
            &object,
            &measured,
            table_height_m,
        ),
        object,
        viewpoint: pose.origin(),
        table_height_m,
    };
    Ok(clouds.into_par_iter().map(observation).collect())
}

/// Points around an object that the camera looked through, away from the points that were
/// measured on any.
fn free_points(
    frame: &Frame,
    camera_from_world: &Pose,
    object: &[Point],
    measured: &Nearest,
    table_height_m: f64,
) -> Vec<Point> {
    let Some(first) = object.first() else {
        return Vec::new();
    };
    let (low, high) = object.iter().fold((*first, *first), |(low, high), point| {
        (low.inf(point), high.sup(point))
    });
    let padding = Vector3::repeat(BOX_PADDING_M);
    let (mut low, high) = (low - padding, high + padding);
    low.z = low.z.max(table_height_m + RAY_MARGIN_M);
    let size = high - low;
    let mut rng = stream(0, "complete/cloud/free");
    let points = (0..FREE_DRAWS)
        .map(|_| {
            let share = Vector3::from_fn(|_, _| rng.random::<f64>());
            low + size.component_mul(&share)
        })
        .filter(|point| sees_through(frame, &camera_from_world.transform_point(point)))
        .filter(|point| !measured.reaches(point, FREE_MARGIN_M))
        .take(FREE);
    points.collect()
}

/// Whether the sensor looked through a point of the camera frame.
fn sees_through(frame: &Frame, point_camera: &Point) -> bool {
    let intrinsics = frame.intrinsics();
    let Some([u, v]) = intrinsics.project(point_camera) else {
        return false;
    };
    let (column, row) = (u.round(), v.round());
    let inside = (0.0..intrinsics.width() as f64).contains(&column)
        && (0.0..intrinsics.height() as f64).contains(&row);
    // A depth that is not known is NaN, which nothing is below.
    inside
        && point_camera.z + RAY_MARGIN_M
            <= f64::from(frame.depth_m()[row as usize * intrinsics.width() + column as usize])
}

#[cfg(test)]
mod tests {
    use credence_types::{Category, Intrinsics};

    use super::*;

    /// 81 x 61 pixels that look straight down from 0.5 m above the table, x right and y up in the
    /// image; on it a block 0.1 high whose top fills the middle third of the columns.
    fn frame() -> (Frame, Instance) {
        let (width, height) = (81, 61);
        let intrinsics = Intrinsics::new([width, height], [100.0; 2], [40.0, 30.0]).unwrap();
        let pose = [
            [1.0, 0.0, 0.0, 0.2],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 0.5],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let pose = Pose::from_matrix("world_from_camera", &pose).unwrap();
        let inside = |pixel: usize| (27..54).contains(&(pixel % width));
        let depth = (0..width * height).map(|p| if inside(p) { 0.4 } else { 0.5 });
        let frame = Frame::new(
            vec![[0; 3]; width * height],
            depth.collect(),
            intrinsics,
            pose,
            None,
        );
        let mask = (0..width * height).map(inside).collect();
        let block = Instance::certain(0, mask, Category::Can).unwrap();
        (frame.unwrap(), block)
    }

    #[test]
    fn free_space_is_where_rays_passed_and_nothing_was_measured() {
        let (frame, block) = frame();
        let seen = observe(&frame, &[block], 0.0).unwrap();
        let [seen] = &seen[..] else {
            panic!("one instance, one observation");
        };
        assert_eq!(seen.object.len(), 27 * 61);
        assert!(seen.object.iter().all(|p| (p.z - 0.1).abs() < 1e-6));
        assert_eq!(seen.viewpoint, Point::new(0.2, 0.0, 0.5));
        assert_eq!(seen.free.len(), FREE);
        // The top reaches from -0.052 to 0.052 m about x = 0.2, the padded box 3 cm farther, where
        // the table is seen; the box ends 3 cm above and below the top.
        for point in &seen.free {
            assert!((point.x - 0.2).abs() <= 0.082 + 1e-9, "{point}");
            assert!((0.07..0.13 + 1e-9).contains(&point.z), "{point}");
            let nearest = seen.object.iter().map(|p| (p - point).norm());
            assert!(nearest.fold(f64::INFINITY, f64::min) >= FREE_MARGIN_M);
            // In the shadow of the top nothing is known.
            let shadow = 0.052 / 0.4 * (0.5 - point.z);
            let beside = (point.x - 0.2).abs() > shadow;
            assert!(point.z >= 0.105 || beside, "{point}");
        }
        let below = seen.free.iter().filter(|point| point.z < 0.1).count();
        assert!(below > 100, "{below}");
    }

    #[test]
    fn other_instances_keep_free_space_away_and_an_unmeasured_one_has_none() {
        let (frame, block) = frame();
        let table = block.mask().iter().map(|inside| !inside).collect();
        let table = Instance::certain(1, table, Category::Laptop).unwrap();
        let alone = observe(&frame, std::slice::from_ref(&table), 0.0).unwrap();
        // Where the block hides nothing from it, the table's padded box holds the block's top.
        let beside_the_top = |p: &&Point| (p.z - 0.1).abs() < 0.01 && (p.x - 0.2).abs() < 0.05;
        assert_eq!(alone[0].free.iter().filter(beside_the_top).count(), 0);
        let unmeasured: Vec<f32> = frame
            .depth_m()
            .iter()
            .zip(block.mask())
            .map(|(depth, inside)| if *inside { f32::NAN } else { *depth })
            .collect();
        let frame = Frame::new(
            frame.rgb().to_vec(),
            unmeasured,
            *frame.intrinsics(),
            *frame.world_from_camera(),
            None,
        );
        let seen = observe(&frame.unwrap(), &[block, table], 0.0).unwrap();
        assert!(seen[0].object.is_empty() && seen[0].free.is_empty());
        assert_eq!(seen[1].object, alone[0].object);
    }
}
