//! Boxes on a table, ray cast: frames whose truth the tests can compute by hand.

use std::collections::BTreeMap;

use credence_types::{Category, Frame, FrameTruth, Intrinsics, Point, Pose};
use nalgebra::Vector3;

const WIDTH: usize = 96;
const HEIGHT: usize = 72;
const FOCAL_PX: f64 = 90.0;

/// An upright box on the table z = 0.
#[derive(Clone, Copy)]
pub(crate) struct Solid {
    pub(crate) low: Point,
    pub(crate) high: Point,
    pub(crate) category: Category,
}

impl Solid {
    /// A cube of 8 cm about (x, y).
    pub(crate) fn cube(category: Category, [x, y]: [f64; 2]) -> Self {
        Self {
            low: Point::new(x - 0.04, y - 0.04, 0.0),
            high: Point::new(x + 0.04, y + 0.04, 0.08),
            category,
        }
    }

    /// Distance from the surface, negative inside.
    pub(crate) fn signed_distance_m(&self, point: &Point) -> f64 {
        let outside: Vector3<f64> = (self.low - point).sup(&(point - self.high));
        let apart = outside.sup(&Vector3::zeros()).norm();
        if apart > 0.0 { apart } else { outside.max() }
    }

    /// Depth at which a ray enters.
    fn meet(&self, eye: &Point, ray: &Vector3<f64>) -> Option<f64> {
        let near_far = |axis: usize| {
            let a = (self.low[axis] - eye[axis]) / ray[axis];
            let b = (self.high[axis] - eye[axis]) / ray[axis];
            (a.min(b), a.max(b))
        };
        let (enter, leave) = (0..3)
            .map(near_far)
            .fold((0.0_f64, f64::INFINITY), |(e, l), (near, far)| {
                (e.max(near), l.min(far))
            });
        (enter < leave).then_some(enter)
    }
}

/// A view from 0.6 m away, 35 degrees above the table; instance i + 1 is solid i.
pub(crate) fn view(solids: &[Solid], azimuth_deg: f64) -> Frame {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let eye = Point::new(0.49 * cos, 0.49 * sin, 0.344);
    let forward = (-eye.coords).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let row = |i: usize| [right[i], down[i], forward[i], eye[i]];
    let rows = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    let pose = Pose::from_matrix("world_from_camera", &rows).unwrap();
    let centre = [(WIDTH - 1) as f64 / 2.0, (HEIGHT - 1) as f64 / 2.0];
    let intrinsics = Intrinsics::new([WIDTH, HEIGHT], [FOCAL_PX; 2], centre).unwrap();

    let (mut depth_m, mut instance_ids) = (Vec::new(), Vec::new());
    for pixel in 0..WIDTH * HEIGHT {
        let ray = intrinsics.ray((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
        let ray = pose.transform_vector(&ray);
        let table = -eye.z / ray.z;
        let mut nearest = (if table > 0.0 { table as f32 } else { f32::NAN }, 0);
        for (id, solid) in (1..).zip(solids) {
            if let Some(depth) = solid.meet(&eye, &ray).map(|depth| depth as f32)
                && (nearest.0.is_nan() || depth < nearest.0)
            {
                nearest = (depth, id);
            }
        }
        depth_m.push(nearest.0);
        instance_ids.push(nearest.1);
    }
    let categories: BTreeMap<u16, Category> = (1..)
        .zip(solids.iter().map(|solid| solid.category))
        .collect();
    let truth = FrameTruth {
        instance_ids,
        categories,
    };
    let rgb = vec![[0; 3]; WIDTH * HEIGHT];
    Frame::new(rgb, depth_m, intrinsics, pose, Some(truth)).unwrap()
}
