//! What stands on the table and where it is seen from.

use std::f64::consts::TAU;

use credence_types::Category;
use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

use super::{
    camera::{Arc, Camera, HEIGHT, WIDTH},
    mesh_set::{Mesh, MeshSet},
    raster::{Owner, Raster, Window},
    sensor::Sensor,
};

/// Scales that a mesh may be drawn at.
const SCALE: [f64; 2] = [0.9, 1.1];
/// Probability of neighbours, their number, and the gap between the circles about the objects.
const CLUTTERED: f64 = 0.3;
const MAX_NEIGHBOURS: usize = 3;
const MAX_GAP_M: f64 = 0.06;
const PLACEMENT_TRIES: usize = 8;
/// Poses tried per view (`sim_scenes.views`).
const CANDIDATES: usize = 32;
/// The target keeps this share of the image's width from the border (`sim_scenes.views`).
const BORDER_SHARE: f64 = 0.0125;
/// It is visible when this share of the image, and of its own outline, shows it.
const VISIBLE_IMAGE_SHARE: f64 = 1e-3;
const VISIBLE_OUTLINE_SHARE: f64 = 0.4;
/// Free space reaches this far around the target's box, and noise a little further.
const WINDOW_PADDING_M: f64 = 0.04;

/// A mesh on the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) scale: f64,
    yaw: [f64; 2],
    centre: [f64; 2],
}

impl<'a> Placed<'a> {
    /// Turned about the vertical; the middle of its box stands at `centre`.
    pub(super) fn new(mesh: &'a Mesh, scale: f64, yaw_rad: f64, centre: [f64; 2]) -> Self {
        Self {
            mesh,
            scale,
            yaw: [yaw_rad.cos(), yaw_rad.sin()],
            centre,
        }
    }

    /// A mesh of a category, its size and its azimuth drawn, at the origin.
    pub(super) fn draw(meshes: &'a MeshSet, category: Category, rng: &mut impl Rng) -> Self {
        let mesh = meshes.draw(category, rng);
        let scale = SCALE[0] + (SCALE[1] - SCALE[0]) * rng.random::<f64>();
        Self::new(mesh, scale, rng.random::<f64>() * TAU, [0.0; 2])
    }

    pub(super) fn world_point(&self, local: Vector) -> Vector {
        let turned = self.turn(local) * self.scale;
        turned + Vector::new(self.centre[0], self.centre[1], 0.0)
    }

    /// The direction of the mesh's frame in the world.
    pub(super) fn turn(&self, local: Vector) -> Vector {
        let [cos, sin] = self.yaw;
        Vector::new(
            cos * local.x - sin * local.y,
            sin * local.x + cos * local.y,
            local.z,
        )
    }

    pub(super) fn local_point(&self, world: Vector) -> Vector {
        let [cos, sin] = self.yaw;
        let [x, y] = [world.x - self.centre[0], world.y - self.centre[1]];
        Vector::new(cos * x + sin * y, cos * y - sin * x, world.z) / self.scale
    }

    /// The surface's world point nearest to a world point.
    pub(super) fn nearest(&self, world: Vector) -> Vector {
        self.world_point(self.mesh.nearest(self.local_point(world)))
    }

    /// Radius of the circle about its centre that holds it.
    pub(super) fn radius(&self) -> f64 {
        self.scale * self.mesh.radius
    }

    /// The corners, in the world, of the box of its own frame, padded.
    fn corners(&self, padding_m: f64) -> impl Iterator<Item = Vector> {
        let padding = padding_m / self.scale;
        let [x, y] = self.mesh.half_extents.map(|half| half + padding);
        let z = [-padding, self.mesh.height + padding];
        (0..8).map(move |corner| {
            let side = |bit: usize, half: f64| if corner & bit == 0 { -half } else { half };
            self.world_point(Vector::new(side(1, x), side(2, y), z[corner >> 2]))
        })
    }
}

/// Objects on the table, the target first, at the origin.
pub(super) fn place<'a>(
    meshes: &'a MeshSet,
    category: Category,
    rng: &mut impl Rng,
) -> Vec<Placed<'a>> {
    let mut placed = vec![Placed::draw(meshes, category, rng)];
    if rng.random::<f64>() < CLUTTERED {
        let count = rng.random_range(1..=MAX_NEIGHBOURS);
        surround(&mut placed, count, meshes, rng);
    }
    placed
}

/// Adds neighbours about the first of the placed objects, those that find room.
pub(super) fn surround<'a>(
    placed: &mut Vec<Placed<'a>>,
    count: usize,
    meshes: &'a MeshSet,
    rng: &mut impl Rng,
) {
    for _ in 0..count {
        let mut neighbour = Placed::draw(meshes, any_category(rng), rng);
        for _ in 0..PLACEMENT_TRIES {
            let gap = rng.random::<f64>() * MAX_GAP_M;
            let away = placed[0].radius() + gap + neighbour.radius();
            let (sin, cos) = (rng.random::<f64>() * TAU).sin_cos();
            neighbour.centre = [away * cos, away * sin];
            let apart = |other: &Placed<'_>| {
                let [dx, dy] = [0, 1].map(|i| other.centre[i] - neighbour.centre[i]);
                dx.hypot(dy) >= other.radius() + neighbour.radius()
            };
            if placed[1..].iter().all(apart) {
                placed.push(neighbour);
                break;
            }
        }
    }
}

/// A category, each as likely.
pub(crate) fn any_category(rng: &mut impl Rng) -> Category {
    Category::ALL[rng.random_range(0..Category::ALL.len())]
}

/// One camera's picture.
#[derive(Debug)]
pub(super) struct View {
    pub(super) camera: Camera,
    pub(super) raster: Raster,
    pub(super) sensor: Sensor,
}

impl View {
    /// The picture from a pose; `None` when it would not serve: the target cut or hidden, or
    /// something too near to the lens.
    pub(super) fn take(camera: Camera, placed: &[Placed<'_>], sensor: Sensor) -> Option<Self> {
        let target = placed.first()?;
        if !in_image(&camera, target) {
            return None;
        }
        let window = Window::around(&camera, target.corners(WINDOW_PADDING_M));
        let mut raster = Raster::table(&camera, window);
        let shown = |raster: &Raster| raster.owners.iter().filter(|o| o.object == 0).count();
        if !raster.draw(&camera, target, 0) {
            return None;
        }
        let outline = shown(&raster);
        for (object, other) in (1..).zip(&placed[1..]) {
            if !raster.draw(&camera, other, object) {
                return None;
            }
        }
        let visible = shown(&raster) as f64;
        let serves = visible >= VISIBLE_IMAGE_SHARE * (WIDTH * HEIGHT) as f64
            && visible >= VISIBLE_OUTLINE_SHARE * outline as f64;
        serves.then_some(Self {
            camera,
            raster,
            sensor,
        })
    }
}

/// Views of the target, each from its share of an arc; `None` where one has no pose that serves.
pub(super) fn look(placed: &[Placed<'_>], rng: &mut impl Rng) -> Option<Vec<View>> {
    let target = placed.first()?;
    let kind = rng.random::<f64>();
    let count = match kind {
        ..0.35 => 1,
        0.35..0.5 => 2,
        0.5..0.9 => 3,
        _ => rng.random_range(4..=5),
    };
    let arc = if count == 1 && rng.random::<f64>() < 0.5 {
        Arc::WIDE
    } else if placed.len() > 1 && rng.random::<f64>() < 0.5 {
        Arc::CLUTTER
    } else {
        Arc::SINGLE
    };
    let middle = Vector::new(0.0, 0.0, target.scale * target.mesh.height / 2.0);
    let corner = target.radius().hypot(middle.z);
    let arc = arc.grown_for(corner);
    let azimuth = rng.random::<f64>() * TAU;
    (0..count)
        .map(|number| {
            (0..CANDIDATES).find_map(|_| {
                let camera = arc.draw((number, count), azimuth, middle, rng);
                View::take(camera, placed, Sensor { key: rng.random() })
            })
        })
        .collect()
}

fn in_image(camera: &Camera, target: &Placed<'_>) -> bool {
    let border = BORDER_SHARE * WIDTH as f64;
    let limits = [WIDTH, HEIGHT].map(|size| (size - 1) as f64 - border);
    target.mesh.vertices.iter().all(|vertex| {
        let point = camera.camera_point(target.world_point(*vertex));
        let [u, v] = Camera::project(point);
        point.z > 0.0 && (border..=limits[0]).contains(&u) && (border..=limits[1]).contains(&v)
    })
}

impl View {
    /// The measured world point of an object's pixel, unless the sensor loses it.
    pub(super) fn measure(&self, pixel: usize, placed: &[Placed<'_>]) -> Option<Vector> {
        let Owner { object, face } = self.raster.owners[pixel];
        let owner = &placed[object as usize];
        let [u, v] = self.raster.image_pixel(pixel);
        let ray = self.camera.ray(u as f64, v as f64);
        let normal = owner.turn(owner.mesh.normal(face as usize));
        let depth = self.raster.depth(pixel);
        let surroundings = super::sensor::Surroundings {
            depth_range_m: self.raster.depth_range(pixel),
            cosine: normal.dot(ray) / ray.length(),
        };
        if self.sensor.loses(pixel, depth, surroundings) {
            return None;
        }
        Some(self.camera.eye + self.sensor.depth(pixel, depth) * ray)
    }

    /// Whether the sensor looked through a point and `margin_m` beyond it, measured along the depth.
    pub(super) fn sees_through(&self, world: Vector, margin_m: f64) -> bool {
        let point = self.camera.camera_point(world);
        if point.z <= 0.0 {
            return false;
        }
        let Some(pixel) = self.raster.pixel_at(Camera::project(point)) else {
            return false;
        };
        let depth = self.raster.depth(pixel);
        // Beyond the horizon there is no measurement, hence nothing known.
        depth.is_finite() && self.sensor.depth(pixel, depth) >= point.z + margin_m
    }
}
