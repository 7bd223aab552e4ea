//! Pictures in colour and depth of several objects, for networks that look at images.

use std::f64::consts::TAU;

use credence_types::Point;
use nalgebra::{Matrix3, Vector3};
use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

use super::{
    camera::{Arc, Camera, HEIGHT, WIDTH},
    mesh_set::{Mesh, MeshSet},
    raster::{Owner, Raster, Window},
    sensor::{Sensor, Surroundings},
    stage::{Placed, any_category, surround},
    texture::{Colour, Texture},
};
use crate::TrainError;

/// Every second pixel of the camera is kept.
const STEP: usize = 2;
/// Share of pictures of an empty table.
const EMPTY: f64 = 0.03;
/// Most objects.
const MOST_OBJECTS: usize = 4;
/// Share of pictures whose camera does not look straight at the first object, and how far beside.
const ASIDE: f64 = 0.6;
const MOST_ASIDE_M: f64 = 0.12;
/// Metres that a table's texture repeats after.
const TABLE_PERIOD_M: [f64; 2] = [0.3, 2.0];
/// Draws after which a picture is given up.
const MOST_DRAWS: u32 = 50;

/// What a camera shows: images of 320x240 pixels, row-major.
#[derive(Debug)]
pub(crate) struct Picture<'a> {
    /// Colour.
    pub(crate) rgb: Vec<[u8; 3]>,
    /// What the sensor measures, metres; NaN where it is lost.
    pub(crate) depth_m: Vec<f32>,
    /// True depth, metres; infinite beyond the horizon.
    pub(crate) true_depth_m: Vec<f32>,
    /// Index of the object that a pixel shows.
    pub(crate) owners: Vec<Option<u8>>,
    /// All objects, also those that are hidden or beyond the border.
    pub(crate) objects: Vec<Shown<'a>>,
}

/// An object of a picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shown<'a> {
    /// The object's mesh.
    pub(crate) mesh: &'a Mesh,
    /// Its size as a multiple of the mesh's.
    pub(crate) scale: f64,
    /// Rotation `camera_from_mesh`.
    pub(crate) rotation: Matrix3<f64>,
    /// Middle of its box in the camera frame, metres.
    pub(crate) centre_m: Vector3<f64>,
    /// Pixels that show it.
    pub(crate) pixels: usize,
}

impl Shown<'_> {
    /// A point of the mesh in the camera frame, metres.
    pub(crate) fn camera_point(&self, local: Vector) -> Point {
        let from_middle = local - self.middle();
        let from_middle = Vector3::from(from_middle.to_array());
        (self.rotation * from_middle * self.scale + self.centre_m).into()
    }

    /// Distance of a point in the camera frame from the surface, metres.
    pub(crate) fn distance_m(&self, point: &Point) -> f64 {
        let local = self.rotation.transpose() * (point.coords - self.centre_m) / self.scale;
        let local = Vector::new(local.x, local.y, local.z) + self.middle();
        self.scale * (local - self.mesh.nearest(local)).length()
    }

    /// Of the mesh's box, in its own frame.
    fn middle(&self) -> Vector {
        Vector::new(0.0, 0.0, self.mesh.height / 2.0)
    }
}

impl<'a> Picture<'a> {
    /// Pixels across and down.
    pub(crate) const SIZE: [usize; 2] = [WIDTH / STEP, HEIGHT / STEP];

    /// A picture of objects, table, light and camera that are all drawn.
    ///
    /// # Errors
    /// In many draws something always stands too near to the lens.
    pub(crate) fn draw(meshes: &'a MeshSet, rng: &mut impl Rng) -> Result<Self, TrainError> {
        (0..MOST_DRAWS)
            .find_map(|_| Self::try_draw(meshes, rng))
            .ok_or(TrainError::Picture { draws: MOST_DRAWS })
    }

    fn try_draw(meshes: &'a MeshSet, rng: &mut impl Rng) -> Option<Self> {
        let mut placed = vec![Placed::draw(meshes, any_category(rng), rng)];
        let neighbours = rng.random_range(0..MOST_OBJECTS);
        surround(&mut placed, neighbours, meshes, rng);
        let camera = camera(&placed[0], placed.len(), rng);
        if rng.random::<f64>() < EMPTY {
            placed.clear();
        }
        let whole = Window {
            left: 0,
            top: 0,
            width: WIDTH,
            height: HEIGHT,
        };
        let mut raster = Raster::table(&camera, whole);
        for (number, object) in (0..).zip(&placed) {
            if !raster.draw(&camera, object, number) {
                return None;
            }
        }
        let look = Look::draw(placed.len(), rng);
        let sensor = Sensor { key: rng.random() };
        Some(Self::take(&camera, &placed, &raster, &look, sensor))
    }

    fn take(
        camera: &Camera,
        placed: &[Placed<'a>],
        raster: &Raster,
        look: &Look,
        sensor: Sensor,
    ) -> Self {
        let [width, height] = Self::SIZE;
        let mut picture = Self {
            rgb: Vec::with_capacity(width * height),
            depth_m: Vec::with_capacity(width * height),
            true_depth_m: Vec::with_capacity(width * height),
            owners: Vec::with_capacity(width * height),
            objects: placed.iter().map(|object| shown(object, camera)).collect(),
        };
        for row in (0..HEIGHT).step_by(STEP) {
            for column in (0..WIDTH).step_by(STEP) {
                picture.add(row * WIDTH + column, camera, placed, raster, look, sensor);
            }
        }
        picture
    }

    /// Adds a pixel of the camera.
    fn add(
        &mut self,
        pixel: usize,
        camera: &Camera,
        placed: &[Placed<'a>],
        raster: &Raster,
        look: &Look,
        sensor: Sensor,
    ) {
        let depth = raster.depth(pixel);
        self.true_depth_m.push(depth as f32);
        if !depth.is_finite() {
            self.rgb.push(quantised(look.beyond));
            self.depth_m.push(f32::NAN);
            self.owners.push(None);
            return;
        }
        let owner = raster.owners[pixel];
        let ray = camera.ray((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
        let world = camera.eye + depth * ray;
        let (normal, colour) = if owner == Owner::TABLE {
            self.owners.push(None);
            (Vector::Z, look.table(world))
        } else {
            let number = owner.object as usize;
            self.owners.push(Some(owner.object as u8));
            self.objects[number].pixels += 1;
            let object = &placed[number];
            let normal = object.turn(object.mesh.normal(owner.face as usize));
            (normal, look.object(number, object, world))
        };
        let towards = if normal.dot(ray) > 0.0 {
            -normal
        } else {
            normal
        };
        let light = look.ambient + look.diffuse * towards.dot(look.light).max(0.0);
        self.rgb.push(quantised(colour.map(|c| c * light)));
        let surroundings = Surroundings {
            depth_range_m: raster.depth_range(pixel),
            cosine: normal.dot(ray) / ray.length(),
        };
        let lost = sensor.loses(pixel, depth, surroundings);
        let measured = || sensor.depth(pixel, depth) as f32;
        self.depth_m.push(if lost { f32::NAN } else { measured() });
    }
}

/// A camera that looks at the first object, or somewhat beside it.
fn camera(target: &Placed<'_>, objects: usize, rng: &mut impl Rng) -> Camera {
    let arc = match rng.random::<f64>() {
        ..0.35 => Arc::WIDE,
        _ if objects > 1 => Arc::CLUTTER,
        _ => Arc::SINGLE,
    };
    let height = target.scale * target.mesh.height / 2.0;
    let corner = target.radius().hypot(height);
    let mut middle = Vector::new(0.0, 0.0, height);
    if rng.random::<f64>() < ASIDE {
        let away = MOST_ASIDE_M * rng.random::<f64>();
        let (sin, cos) = (TAU * rng.random::<f64>()).sin_cos();
        middle += Vector::new(away * cos, away * sin, 0.0);
    }
    let azimuth = TAU * rng.random::<f64>();
    arc.grown_for(corner).draw((0, 1), azimuth, middle, rng)
}

fn shown<'a>(object: &Placed<'a>, camera: &Camera) -> Shown<'a> {
    let column = |axis: Vector| {
        let direction = camera.camera_point(camera.eye + object.turn(axis));
        Vector3::from(direction.to_array())
    };
    let middle = object.world_point(Vector::new(0.0, 0.0, object.mesh.height / 2.0));
    Shown {
        mesh: object.mesh,
        scale: object.scale,
        rotation: Matrix3::from_columns(&[column(Vector::X), column(Vector::Y), column(Vector::Z)]),
        centre_m: Vector3::from(camera.camera_point(middle).to_array()),
        pixels: 0,
    }
}

/// Light and colours of a picture.
struct Look {
    ambient: f64,
    diffuse: f64,
    /// Where the light comes from.
    light: Vector,
    table: Texture,
    period_m: f64,
    objects: Vec<Texture>,
    /// Colour beyond the table's horizon.
    beyond: Colour,
}

impl Look {
    fn draw(objects: usize, rng: &mut impl Rng) -> Self {
        let azimuth = TAU * rng.random::<f64>();
        let rise: f64 = rng.random_range(0.25..1.0);
        let level = (1.0 - rise * rise).sqrt();
        let table = Texture::of_table(rng);
        Self {
            ambient: rng.random_range(0.3..0.7),
            diffuse: rng.random_range(0.25..0.7),
            light: Vector::new(level * azimuth.cos(), level * azimuth.sin(), rise),
            table,
            period_m: rng.random_range(TABLE_PERIOD_M[0]..TABLE_PERIOD_M[1]),
            objects: (0..objects).map(|_| Texture::of_object(rng)).collect(),
            beyond: [rng.random(), rng.random(), rng.random()],
        }
    }

    fn table(&self, world: Vector) -> Colour {
        self.table
            .at(world.x / self.period_m, world.y / self.period_m)
    }

    /// Around the object's vertical and up along it.
    fn object(&self, number: usize, object: &Placed<'_>, world: Vector) -> Colour {
        let local = object.local_point(world);
        let around = local.y.atan2(local.x) / TAU;
        let up = local.z / object.mesh.height.max(f64::MIN_POSITIVE);
        self.objects[number].at(around, up)
    }
}

fn quantised(colour: Colour) -> [u8; 3] {
    colour.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8)
}
