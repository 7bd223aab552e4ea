use credence_complete::centersnap::{
    AutoEncoder, CenterSnap, CenterSnapNetwork, DECODED_POINTS, Detection, ObjectPose, Told,
    has_front,
};
use credence_nn::{knn, rgbd::RgbdImage};
use credence_types::{Category, Point, stream};
use nalgebra::Matrix3;
use rand::Rng;
use rayon::prelude::*;

use super::truth::{is_told, pose};
use crate::{
    TrainError,
    data::{MeshSet, Picture, Shown},
    run::Figures,
};

/// Pixels, of 320x240, between an object's projected centre and a cell that tells of it.
const NEAR_PX: f64 = 32.0;
/// A point within this distance of the surface is on it: the tolerance of the scores.
const ON_SURFACE_M: f64 = 0.005;

/// Pictures to try a network on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trial<'a> {
    pub(super) meshes: &'a MeshSet,
    /// Names the stream of the pictures.
    pub(super) purpose: &'static str,
    pub(super) pictures: usize,
}

/// An object of a picture with what the network made of it, if it found it.
pub(super) struct Found<'a> {
    pub(super) object: Shown<'a>,
    pub(super) told: Option<Told>,
}

impl<'a> Trial<'a> {
    /// Every object that the network is to tell of, with the telling cell nearest to its centre.
    /// Beside them, how many cells told of no object.
    pub(super) fn look(
        &self,
        centersnap: &CenterSnap,
    ) -> Result<(Vec<Found<'a>>, usize), TrainError> {
        let per_picture: Vec<(Vec<Found<'a>>, usize)> = (0..self.pictures)
            .into_par_iter()
            .map(|number| {
                let mut rng = stream(1, &format!("{}/{number}", self.purpose));
                let picture = Picture::draw(self.meshes, &mut rng)?;
                let image = RgbdImage {
                    rgb: picture.rgb,
                    depth_m: picture.depth_m,
                };
                let told = centersnap.look(&image)?;
                Ok(assign(&picture.objects, told))
            })
            .collect::<Result<_, TrainError>>()?;
        let strays = per_picture.iter().map(|(_, strays)| strays).sum();
        let found = per_picture.into_iter().flat_map(|(found, _)| found);
        Ok((found.collect(), strays))
    }
}

/// Each object takes the nearest telling cell that is left.
fn assign<'a>(objects: &[Shown<'a>], mut told: Vec<Told>) -> (Vec<Found<'a>>, usize) {
    let mut found = Vec::new();
    for object in objects {
        let centre = pose(object).0.pixel();
        let away = |told: &Told| {
            let [du, dv] = [0, 1].map(|i| told.anchor.pixel[i] - centre[i]);
            du.hypot(dv)
        };
        let nearest = (0..told.len())
            .filter(|index| away(&told[*index]) < NEAR_PX)
            .min_by(|a, b| away(&told[*a]).total_cmp(&away(&told[*b])));
        let told = nearest.map(|index| told.remove(index));
        // What is hidden or cut may be found; it need not.
        if is_told(object) {
            found.push(Found {
                object: *object,
                told,
            });
        }
    }
    (found, told.len())
}

/// What is measured on an object that was found.
struct Measured {
    category: Category,
    named: bool,
    centre_mm: f64,
    turn_deg: f64,
    size: f64,
    chamfer_mm: f64,
    on: f64,
}

/// Names of the figures, in the order of the log.
pub(super) fn figure_names() -> Vec<String> {
    let mut names: Vec<String> = [
        "found",
        "strays",
        "named",
        "centre_mm",
        "turn_deg",
        "size_percent",
        "chamfer_mm",
        "on_5mm",
    ]
    .map(str::to_owned)
    .to_vec();
    names.extend(Category::ALL.iter().map(|c| format!("chamfer_mm_{c}")));
    names
}

/// Figures of a network on pictures of meshes that it has not seen: the share of objects found, the
/// cells that tell of none per picture, the share named rightly; the mean errors of centre,
/// rotation (of the vertical where a category has no front) and size; the distance between
/// completed and true surface, both ways, and the share of points within 5 mm.
///
/// # Errors
/// Meshes that nothing can be drawn from.
pub(super) fn evaluate(
    network: CenterSnapNetwork,
    autoencoder: &AutoEncoder,
    trial: &Trial<'_>,
) -> Result<Figures, TrainError> {
    let centersnap = CenterSnap::new(network, autoencoder.clone());
    let (found, strays) = trial.look(&centersnap)?;
    let all = found.len().max(1) as f64;
    let measured: Vec<Measured> = found
        .into_par_iter()
        .enumerate()
        .filter_map(|(number, Found { object, told })| {
            let mut rng = stream(1, &format!("{}/surface/{number}", trial.purpose));
            let told = told?;
            let detection = centersnap.detections(&[told]).map(|mut d| d.pop());
            match detection {
                Ok(detection) => Some(measure(&object, &detection?, &mut rng)),
                Err(error) => Some(Err(error.into())),
            }
        })
        .collect::<Result<_, TrainError>>()?;
    let count = measured.len().max(1) as f64;
    let mean = |value: &dyn Fn(&Measured) -> f64| measured.iter().map(value).sum::<f64>() / count;
    let mut values = vec![
        measured.len() as f64 / all,
        strays as f64 / trial.pictures.max(1) as f64,
        mean(&|m| f64::from(m.named)),
        mean(&|m| m.centre_mm),
        mean(&|m| m.turn_deg),
        mean(&|m| m.size),
        mean(&|m| m.chamfer_mm),
        mean(&|m| m.on),
    ];
    values.extend(Category::ALL.iter().map(|category| {
        let of: Vec<f64> = measured
            .iter()
            .filter(|m| m.category == *category)
            .map(|m| m.chamfer_mm)
            .collect();
        of.iter().sum::<f64>() / of.len().max(1) as f64
    }));
    Ok(figure_names().into_iter().zip(values).collect())
}

fn measure(
    object: &Shown<'_>,
    detection: &Detection,
    rng: &mut impl Rng,
) -> Result<Measured, TrainError> {
    let category = object.mesh.category;
    let (truth, _) = pose(object);
    let surface: Vec<[f32; 3]> = (0..DECODED_POINTS)
        .map(|_| narrow(&object.camera_point(object.mesh.surface_point(rng))))
        .collect();
    let completed: Vec<[f32; 3]> = detection.points_camera.iter().map(narrow).collect();
    let there = distances(&completed, &surface)?;
    let back = distances(&surface, &completed)?;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    // To the surface itself, not to points on it.
    let on = detection
        .points_camera
        .iter()
        .filter(|point| object.distance_m(point) <= ON_SURFACE_M);
    Ok(Measured {
        category,
        named: detection.category == category,
        centre_mm: 1e3 * (detection.pose.centre_m - truth.centre_m).norm(),
        turn_deg: turn(category, &detection.pose, &truth).to_degrees(),
        size: 100.0 * (detection.pose.scale_m / truth.scale_m - 1.0).abs(),
        chamfer_mm: 1e3 * mean(&there).midpoint(mean(&back)),
        on: on.count() as f64 / completed.len().max(1) as f64,
    })
}

/// Angle between two rotations, or of their verticals for a category without a front.
fn turn(category: Category, told: &ObjectPose, truth: &ObjectPose) -> f64 {
    let between: Matrix3<f64> = told.rotation.transpose() * truth.rotation;
    let cosine = if has_front(category) {
        (between.trace() - 1.0) / 2.0
    } else {
        between[(2, 2)]
    };
    cosine.clamp(-1.0, 1.0).acos()
}

fn distances(from: &[[f32; 3]], to: &[[f32; 3]]) -> Result<Vec<f64>, TrainError> {
    let nearest = knn::nearest(to, from, 1)?;
    let length = |(p, index): (&[f32; 3], &u32)| {
        let q = to[*index as usize];
        (0..3)
            .map(|axis| f64::from(p[axis] - q[axis]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    Ok(from.iter().zip(&nearest).map(length).collect())
}

fn narrow(point: &Point) -> [f32; 3] {
    [point.x, point.y, point.z].map(|c| c as f32)
}
