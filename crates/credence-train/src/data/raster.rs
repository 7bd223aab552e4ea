//! Exact depth of meshes and table at pixel centres.
//!
//! The image of a face's inverse depth is affine, and so is the table's; so a depth buffer gives
//! what a ray through each pixel's centre would hit, at a small part of the rays' cost. A test
//! holds it against parry's ray caster.

use parry3d_f64::math::Vector;

use super::{
    camera::{Camera, HEIGHT, WIDTH},
    stage::Placed,
};

/// Nothing nearer than this before the lens is drawn; see [`Raster::draw`].
const NEAR_M: f64 = 0.1;

/// A rectangle of the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Window {
    /// The pixels of the image that see any part of the box around these points.
    pub(super) fn around(camera: &Camera, corners: impl Iterator<Item = Vector>) -> Self {
        let mut low = [WIDTH as f64, HEIGHT as f64];
        let mut high = [-1.0, -1.0];
        for corner in corners {
            let mut point = camera.camera_point(corner);
            point.z = point.z.max(NEAR_M);
            for (axis, at) in Camera::project(point).into_iter().enumerate() {
                low[axis] = at.min(low[axis]);
                high[axis] = at.max(high[axis]);
            }
        }
        let [left, top] = low.map(|at| at.floor().max(0.0) as usize);
        let end = |at: f64, size: usize| ((at.ceil() + 1.0).max(0.0) as usize).min(size);
        Self {
            left,
            top,
            width: end(high[0], WIDTH).saturating_sub(left),
            height: end(high[1], HEIGHT).saturating_sub(top),
        }
    }
}

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Owner {
    /// Index of the object; [`Owner::TABLE`] is none.
    pub(super) object: u32,
    pub(super) face: u32,
}

impl Owner {
    /// The table, or nothing.
    pub(super) const TABLE: Self = Self {
        object: u32::MAX,
        face: u32::MAX,
    };
}

/// A window's inverse depth (0: nothing is hit) and owners, row by row.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) window: Window,
    pub(super) inverse_depth: Vec<f32>,
    pub(super) owners: Vec<Owner>,
}

impl Raster {
    /// An empty table, the plane z = 0.
    pub(super) fn table(camera: &Camera, window: Window) -> Self {
        let mut inverse_depth = Vec::with_capacity(window.width * window.height);
        for row in 0..window.height {
            for column in 0..window.width {
                let (u, v) = (window.left + column, window.top + row);
                let down = -camera.ray(u as f64, v as f64).z;
                inverse_depth.push((down / camera.eye.z).max(0.0) as f32);
            }
        }
        Self {
            window,
            owners: vec![Owner::TABLE; inverse_depth.len()],
            inverse_depth,
        }
    }

    /// Adds an object. `false` when a part of it is too near to the lens, or behind it, to be drawn:
    /// then the view is worthless.
    pub(super) fn draw(&mut self, camera: &Camera, placed: &Placed<'_>, object: u32) -> bool {
        let mut projected = Vec::with_capacity(placed.mesh.vertices.len());
        for vertex in &placed.mesh.vertices {
            let point = camera.camera_point(placed.world_point(*vertex));
            if point.z < NEAR_M {
                return false;
            }
            let [u, v] = Camera::project(point);
            projected.push(Vector::new(
                u - self.window.left as f64,
                v - self.window.top as f64,
                point.z.recip(),
            ));
        }
        for (face, corners) in placed.mesh.faces.iter().enumerate() {
            let corners = corners.map(|corner| projected[corner as usize]);
            let face = face as u32;
            self.draw_face(corners, Owner { object, face });
        }
        true
    }

    /// Fills a face given by (u, v, inverse depth) in the window's pixels, whichever way it turns.
    fn draw_face(&mut self, corners: [Vector; 3], owner: Owner) {
        let [a, mut b, mut c] = corners;
        let cross = |p: Vector, q: Vector| p.x * q.y - p.y * q.x;
        let mut doubled_area = cross(b - a, c - a);
        if doubled_area < 0.0 {
            (b, c) = (c, b);
            doubled_area = -doubled_area;
        }
        let (width, height) = (self.window.width as f64, self.window.height as f64);
        let first_row = a.y.min(b.y).min(c.y).ceil().max(0.0);
        let last_row = a.y.max(b.y).max(c.y).floor().min(height - 1.0);
        let (left, right) = (a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x));
        if doubled_area <= 0.0 || first_row > last_row || right < 0.0 || left > width - 1.0 {
            return;
        }
        let (ab, ac) = (b - a, c - a);
        let slope_u = (ab.z * ac.y - ac.z * ab.y) / doubled_area;
        let slope_v = (ac.z * ab.x - ab.z * ac.x) / doubled_area;
        for row in first_row as usize..=last_row as usize {
            let v = row as f64;
            // Inside is on the left of each edge p -> q: (q - p) x (pixel - p) >= 0, linear in u.
            let (mut begin, mut end) = (left.max(0.0), right.min(width - 1.0));
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let edge = q - p;
                let at = edge.x * (v - p.y) + edge.y * p.x;
                if edge.y > 0.0 {
                    end = end.min(at / edge.y);
                } else if edge.y < 0.0 {
                    begin = begin.max(at / edge.y);
                } else if at < 0.0 {
                    end = -1.0;
                }
            }
            if begin > end {
                continue;
            }
            let first = begin.ceil() as usize;
            let start = row * self.window.width;
            for column in first..=end.floor() as usize {
                let inverse = a.z + slope_u * (column as f64 - a.x) + slope_v * (v - a.y);
                let inverse = inverse as f32;
                let pixel = start + column;
                if inverse > self.inverse_depth[pixel] {
                    self.inverse_depth[pixel] = inverse;
                    self.owners[pixel] = owner;
                }
            }
        }
    }

    /// The window's pixel that a point projects to, if it does.
    pub(super) fn pixel_at(&self, [u, v]: [f64; 2]) -> Option<usize> {
        let column = u.round() - self.window.left as f64;
        let row = v.round() - self.window.top as f64;
        let inside = (0.0..self.window.width as f64).contains(&column)
            && (0.0..self.window.height as f64).contains(&row);
        inside.then(|| row as usize * self.window.width + column as usize)
    }

    /// The image coordinates of a window's pixel.
    pub(super) fn image_pixel(&self, pixel: usize) -> [usize; 2] {
        [
            self.window.left + pixel % self.window.width,
            self.window.top + pixel / self.window.width,
        ]
    }

    /// Depth, metres; infinite where nothing is hit.
    pub(super) fn depth(&self, pixel: usize) -> f64 {
        f64::from(self.inverse_depth[pixel]).recip()
    }

    /// The least and the greatest depth among a pixel and its eight neighbours in the window.
    pub(super) fn depth_range(&self, pixel: usize) -> [f64; 2] {
        let (row, column) = (pixel / self.window.width, pixel % self.window.width);
        let (mut nearest, mut farthest) = (f32::NEG_INFINITY, f32::INFINITY);
        for row in row.saturating_sub(1)..(row + 2).min(self.window.height) {
            for column in column.saturating_sub(1)..(column + 2).min(self.window.width) {
                let inverse = self.inverse_depth[row * self.window.width + column];
                nearest = nearest.max(inverse);
                farthest = farthest.min(inverse);
            }
        }
        [nearest, farthest].map(|inverse| f64::from(inverse).recip())
    }
}
