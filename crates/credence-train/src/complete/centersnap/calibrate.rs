use burn::tensor::Device;
use credence_complete::centersnap::{
    AutoEncoder, CenterSnap, CenterSnapNetwork, LATENT, POSE, StatisticValues,
};
use credence_types::{Category, stream};
use rayon::prelude::*;

use super::{
    evaluate::{Found, Trial},
    example::CATEGORIES,
    truth::{Shapes, pose, raw_latent},
};
use crate::{TrainError, complete::autoencoder::Turn, data::MeshSet, run::Figures};

/// A category with fewer objects found takes its errors from all.
const FEWEST: usize = 12;
/// Every so many points have their distance to the surface measured.
const EVERY: usize = 8;

/// Mean and spread of the latents of all meshes, each as it is.
pub(super) fn latent_statistics(autoencoder: &AutoEncoder, meshes: &MeshSet) -> StatisticValues {
    let latents: Vec<[f32; LATENT]> = meshes
        .meshes()
        .par_iter()
        .enumerate()
        .map(|(number, mesh)| {
            let mut rng = stream(0, &format!("train/centersnap/latents/{number}"));
            raw_latent(autoencoder, mesh, Turn::NONE, &mut rng)
        })
        .collect();
    let count = latents.len().max(1) as f64;
    let mut mean = vec![0.0_f64; LATENT];
    for latent in &latents {
        for (sum, value) in mean.iter_mut().zip(latent) {
            *sum += f64::from(*value) / count;
        }
    }
    let square = |latent: &[f32; LATENT]| {
        let off = latent
            .iter()
            .zip(&mean)
            .map(|(v, m)| (f64::from(*v) - m).powi(2));
        off.sum::<f64>()
    };
    let variance = latents.iter().map(square).sum::<f64>() / (count * LATENT as f64);
    StatisticValues {
        latent_mean: mean.iter().map(|m| *m as f32).collect(),
        latent_scale: variance.sqrt().max(f64::MIN_POSITIVE) as f32,
        ..StatisticValues::default()
    }
}

/// The network with what its errors on pictures of unseen meshes are: their standard deviations,
/// from which its spread is sampled, and the factor that makes the spread, on average over a
/// category, the distance from the true surface. The figures say how well it does on other pictures.
///
/// # Errors
/// Meshes that nothing can be drawn from.
pub(super) fn calibrate(
    network: &CenterSnapNetwork,
    shapes: &Shapes,
    meshes: &MeshSet,
    pictures: usize,
) -> Result<(CenterSnapNetwork, Figures), TrainError> {
    let device = Device::flex();
    let trial = |purpose| Trial {
        meshes,
        purpose,
        pictures,
    };
    let mut values = shapes.statistics.clone();
    let with = |values: &StatisticValues| network.clone().with_statistics(values, &device);
    let served =
        |values: &StatisticValues| CenterSnap::new(with(values), shapes.autoencoder.clone());

    let (found, _) = trial("calibrate/centersnap/errors").look(&served(&values))?;
    let errors: Vec<(usize, [f32; LATENT], [f32; POSE])> = found
        .par_iter()
        .enumerate()
        .filter_map(|(number, found)| errors(number, found, shapes))
        .collect();
    let squares: Vec<(usize, Vec<f64>)> = errors
        .iter()
        .map(|(category, latent, pose)| {
            let both = latent.iter().chain(pose);
            (*category, both.map(|e| f64::from(*e).powi(2)).collect())
        })
        .collect();
    for category in 0..CATEGORIES {
        let deviations = root_means(&squares, category);
        let (latent, pose) = deviations.split_at(LATENT);
        values.latent_error[category].copy_from_slice(latent);
        values.pose_error[category].copy_from_slice(pose);
    }

    let judged = judge(&served(&values), &trial("calibrate/centersnap/factor"))?;
    for (category, factor) in values.spread_factor.iter_mut().enumerate() {
        *factor = ratio(&judged, category) as f32;
    }
    let judged = judge(&served(&values), &trial("calibrate/centersnap/check"))?;
    Ok((with(&values), figures(&judged)))
}

/// Errors of the numbers told of an object, if it was found and named rightly.
fn errors(
    number: usize,
    found: &Found<'_>,
    shapes: &Shapes,
) -> Option<(usize, [f32; LATENT], [f32; POSE])> {
    let object = &found.object;
    let told = found
        .told
        .as_ref()
        .filter(|t| t.category == object.mesh.category)?;
    let (pose, turn) = pose(object);
    let mut rng = stream(1, &format!("calibrate/centersnap/latent/{number}"));
    let mut latent = shapes.latent(object.mesh, turn, &mut rng);
    for (value, told) in latent.iter_mut().zip(told.latent) {
        *value -= told;
    }
    let mut pose = told.anchor.encode(&pose);
    for (value, told) in pose.iter_mut().zip(told.pose) {
        *value -= told;
    }
    Some((usize::from(told.category.class()) - 1, latent, pose))
}

/// Roots of the mean squares of a category, or of all where it has too few.
fn root_means(squares: &[(usize, Vec<f64>)], category: usize) -> Vec<f32> {
    let own = squares.iter().filter(|(c, _)| *c == category).count();
    let mut sums = vec![0.0; LATENT + POSE];
    let mut count = 0.0;
    for (_, row) in squares
        .iter()
        .filter(|(c, _)| own < FEWEST || *c == category)
    {
        count += 1.0;
        for (sum, square) in sums.iter_mut().zip(row) {
            *sum += square;
        }
    }
    sums.iter()
        .map(|sum| (sum / f64::max(count, 1.0)).sqrt() as f32)
        .collect()
}

/// A category, the spread of one of its points, and the point's distance from the surface, metres.
type Judged = (Category, f64, f64);

fn judge(centersnap: &CenterSnap, trial: &Trial<'_>) -> Result<Vec<Judged>, TrainError> {
    let (found, _) = trial.look(centersnap)?;
    let per_object: Vec<Vec<Judged>> = found
        .par_iter()
        .filter_map(|found| Some((&found.object, found.told.as_ref()?)))
        .map(|(object, told)| {
            let detections = centersnap.detections(std::slice::from_ref(told))?;
            let points = detections
                .iter()
                .flat_map(|d| d.points_camera.iter().zip(&d.spread_m))
                .step_by(EVERY);
            Ok(points
                .map(|(point, spread_m)| (told.category, *spread_m, object.distance_m(point)))
                .collect())
        })
        .collect::<Result<_, TrainError>>()?;
    Ok(per_object.concat())
}

/// Sum of the distances over that of the spreads: of a category, or of all if it has no points.
fn ratio(judged: &[Judged], category: usize) -> f64 {
    let sums = |wanted: &dyn Fn(Category) -> bool| {
        let of = judged.iter().filter(|(c, ..)| wanted(*c));
        of.fold((0.0, 0.0), |(spread, distance), (_, s, d)| {
            (spread + s, distance + d)
        })
    };
    let (mut spread, mut distance) = sums(&|c| usize::from(c.class()) - 1 == category);
    if spread <= 0.0 {
        (spread, distance) = sums(&|_| true);
    }
    if spread > 0.0 { distance / spread } else { 1.0 }
}

/// Of all points: mean spread and distance, and the mean distance of the halves with the smaller
/// and the larger spread.
fn figures(judged: &[Judged]) -> Figures {
    let mut sorted: Vec<(f64, f64)> = judged.iter().map(|(_, s, d)| (*s, *d)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |values: &[(f64, f64)], of: fn(&(f64, f64)) -> f64| {
        1e3 * values.iter().map(of).sum::<f64>() / values.len().max(1) as f64
    };
    let (surer, less_sure) = sorted.split_at(sorted.len() / 2);
    Figures::from([
        ("spread_mm".to_owned(), mean(&sorted, |p| p.0)),
        ("distance_mm".to_owned(), mean(&sorted, |p| p.1)),
        (
            "distance_mm_of_the_surer_half".to_owned(),
            mean(surer, |p| p.1),
        ),
        (
            "distance_mm_of_the_other_half".to_owned(),
            mean(less_sure, |p| p.1),
        ),
    ])
}
