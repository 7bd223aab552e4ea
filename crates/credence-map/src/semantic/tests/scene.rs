//! A table with balls and plates on it, ray cast: frames with known masks.

use credence_types::{Category, Frame, Instance, Intrinsics, Point, Pose};
use nalgebra::Vector3;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
const FOCAL_PX: f64 = 140.0;

pub(super) struct Shape {
    pub(super) centre: Point,
    pub(super) radius_m: f64,
    /// Whether it is a flat disc at the centre's height rather than a ball.
    pub(super) flat: bool,
    pub(super) category: Category,
}

/// A ball as large as a mug, standing on the table.
pub(super) fn ball(x: f64, y: f64) -> Shape {
    Shape {
        centre: Point::new(x, y, 0.04),
        radius_m: 0.04,
        flat: false,
        category: Category::Mug,
    }
}

impl Shape {
    /// Depth at which a ray meets the shape.
    fn meet(&self, eye: &Point, ray: &Vector3<f64>) -> Option<f64> {
        let from_centre = eye - self.centre;
        if self.flat {
            let depth = -from_centre.z / ray.z;
            let off_axis = (from_centre + ray * depth).norm();
            return (depth > 0.0 && off_axis < self.radius_m).then_some(depth);
        }
        let a = ray.norm_squared();
        let b = ray.dot(&from_centre);
        let discriminant = b * b - a * (from_centre.norm_squared() - self.radius_m.powi(2));
        (discriminant > 0.0).then(|| (-b - discriminant.sqrt()) / a)
    }
}

/// One view: images, and which shape each pixel shows.
pub(super) struct View {
    pub(super) depth_m: Vec<f32>,
    pub(super) rgb: Vec<[u8; 3]>,
    pub(super) shown: Vec<Option<usize>>,
    pose: Pose,
}

impl View {
    pub(super) fn new(shapes: &[Shape], eye: [f64; 3], target: [f64; 3]) -> Self {
        let (eye, target) = (Point::from(eye), Point::from(target));
        let forward = (target - eye).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        let down = forward.cross(&right);
        let row = |i: usize| [right[i], down[i], forward[i], eye[i]];
        let rows = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
        let mut view = Self {
            depth_m: Vec::new(),
            rgb: Vec::new(),
            shown: Vec::new(),
            pose: Pose::from_matrix("world_from_camera", &rows).unwrap(),
        };
        for pixel in 0..WIDTH * HEIGHT {
            let ray = intrinsics().ray((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
            let ray = view.pose.transform_vector(&ray);
            let table = -eye.z / ray.z;
            let mut nearest = (if table > 0.0 { table } else { f64::INFINITY }, None);
            for (i, shape) in shapes.iter().enumerate() {
                if let Some(depth) = shape.meet(&eye, &ray)
                    && depth < nearest.0
                {
                    nearest = (depth, Some(i));
                }
            }
            view.depth_m.push(if nearest.0.is_finite() {
                nearest.0 as f32
            } else {
                f32::NAN
            });
            view.rgb.push(if nearest.1.is_some() {
                [200, 0, 0]
            } else {
                [0, 0, 50]
            });
            view.shown.push(nearest.1);
        }
        view
    }

    pub(super) fn frame(&self) -> Frame {
        let (rgb, depth_m) = (self.rgb.clone(), self.depth_m.clone());
        Frame::new(rgb, depth_m, intrinsics(), self.pose, None).unwrap()
    }

    /// Pixels on which shape `index` is seen.
    pub(super) fn mask(&self, index: usize) -> Vec<bool> {
        self.shown.iter().map(|s| *s == Some(index)).collect()
    }

    /// A certain detection of every shape in view, and the shape of each.
    pub(super) fn instances(&self, shapes: &[Shape]) -> (Vec<Instance>, Vec<usize>) {
        let seen: Vec<usize> = (0..shapes.len())
            .filter(|i| self.mask(*i).contains(&true))
            .collect();
        let instance =
            |i: &usize| Instance::certain(0, self.mask(*i), shapes[*i].category).unwrap();
        (seen.iter().map(instance).collect(), seen)
    }
}

pub(super) fn intrinsics() -> Intrinsics {
    let centre = [(WIDTH - 1) as f64 / 2.0, (HEIGHT - 1) as f64 / 2.0];
    Intrinsics::new([WIDTH, HEIGHT], [FOCAL_PX; 2], centre).unwrap()
}

/// A camera position 0.6 m from the origin, 35 degrees above the table.
pub(super) fn eye(azimuth_deg: f64) -> [f64; 3] {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    [0.49 * cos, 0.49 * sin, 0.344]
}
