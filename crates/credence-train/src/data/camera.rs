//! Where cameras stand and what they project: the simulator's wrist camera.

use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

/// Image size of the simulated D435, and its focal length at that size, pixels.
pub(super) const WIDTH: usize = 640;
pub(super) const HEIGHT: usize = 480;
pub(super) const FOCAL_PX: f64 = 616.0;
const CENTRE: [f64; 2] = [(WIDTH - 1) as f64 / 2.0, (HEIGHT - 1) as f64 / 2.0];

/// A camera that looks at a point; axes right, down, forward in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    pub(super) eye: Vector,
    axes: [Vector; 3],
}

impl Camera {
    /// Upright at `eye`, which is not above or below `target`.
    pub(super) fn looking(eye: Vector, target: Vector) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(Vector::Z).normalize();
        let axes = [right, forward.cross(right), forward];
        Self { eye, axes }
    }

    /// A world point in camera axes: right, down, depth.
    pub(super) fn camera_point(&self, world: Vector) -> Vector {
        let offset = world - self.eye;
        Vector::from_array(self.axes.map(|axis| axis.dot(offset)))
    }

    /// The pixel (u, v) of a point in camera axes with positive depth.
    pub(super) fn project(point: Vector) -> [f64; 2] {
        [
            FOCAL_PX * point.x / point.z + CENTRE[0],
            FOCAL_PX * point.y / point.z + CENTRE[1],
        ]
    }

    /// The world direction of a pixel's ray, of depth 1.
    pub(super) fn ray(&self, u: f64, v: f64) -> Vector {
        let [right, down, forward] = self.axes;
        let (x, y) = ((u - CENTRE[0]) / FOCAL_PX, (v - CENTRE[1]) / FOCAL_PX);
        x * right + y * down + forward
    }
}

/// Where the cameras of a scene may stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    span_deg: f64,
    elevation_deg: [f64; 2],
    distance_m: [f64; 2],
}

impl Arc {
    /// `sim_scenes.spec.Arc`'s defaults: one object.
    pub(super) const SINGLE: Self = Self {
        span_deg: 90.0,
        elevation_deg: [33.0, 60.0],
        distance_m: [0.34, 0.48],
    };
    /// That of `SceneSpec.clutter`: several objects, seen from further away.
    pub(super) const CLUTTER: Self = Self {
        span_deg: 70.0,
        elevation_deg: [40.0, 62.0],
        distance_m: [0.42, 0.55],
    };
    /// Wider than the robot's reach, so that nothing hangs on its exact limits.
    pub(super) const WIDE: Self = Self {
        span_deg: 90.0,
        elevation_deg: [20.0, 70.0],
        distance_m: [0.3, 0.7],
    };

    /// The arc as it grows for an object whose box has this radius (`sim_scenes.views`): half the
    /// image's height must hold most of the ball about it.
    pub(super) fn grown_for(self, radius: f64) -> Self {
        const FLAT: f64 = 0.65;
        const FARTHER: f64 = 1.3;
        let half_view = (HEIGHT as f64 / 2.0 / FOCAL_PX).atan();
        let near = self.distance_m[0].max(FLAT * radius / half_view.sin());
        let far = self.distance_m[1].max(FARTHER * near);
        Self {
            distance_m: [near, far],
            ..self
        }
    }

    /// A camera in view `number`'s share of the arc about `centre_rad`.
    pub(super) fn draw(
        &self,
        (number, count): (usize, usize),
        centre_rad: f64,
        target: Vector,
        rng: &mut impl Rng,
    ) -> Camera {
        let share = self.span_deg / count as f64;
        let offset = (number as f64 + rng.random::<f64>()) * share - self.span_deg / 2.0;
        let azimuth = centre_rad + offset.to_radians();
        let between = |[low, high]: [f64; 2], at: f64| low + (high - low) * at;
        let elevation = between(self.elevation_deg, rng.random()).to_radians();
        let distance = between(self.distance_m, rng.random());
        let direction = Vector::new(
            elevation.cos() * azimuth.cos(),
            elevation.cos() * azimuth.sin(),
            elevation.sin(),
        );
        Camera::looking(target + distance * direction, target)
    }
}
