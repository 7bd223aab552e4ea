//! From detections to observations: which pixels, points and voxels show which object.
//!
//! Where masks overlap, a pixel goes to the detection with the higher score, then to the smaller
//! mask, so that the caller's order does not matter.
//!
//! Depth sensors report values between object and background along a silhouette ("flying
//! pixels"), and a mask that is a pixel too wide takes in background. Such points hang in the air,
//! thin out along the ray, and would bend every fit. A point is kept only if enough pixels of the
//! same mask lie near it in space, where near is a few pixel spacings at its own depth: that
//! adapts to distance, keeps surfaces up to about 85 degrees from facing the camera, and tolerates
//! the sensor's axial noise, which grows with distance too. Since a neighbour within n spacings
//! lies within n pixels, the image itself is the search structure.

use std::cmp::Ordering;

use credence_types::{Frame, Instance, Point, PointCloud};

use crate::{MapError, VoxelKey, tracker::Observation};

/// When a point of an object's mask counts as lying on its surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SupportConfig {
    /// Radius in pixel spacings at the point's depth. Default 4.
    pub radius_px: usize,
    /// Fewest other points of the mask within the radius; 0 keeps every point. Default 4, of about
    /// 50 on a surface that faces the camera.
    pub min_neighbours: usize,
}

impl Default for SupportConfig {
    fn default() -> Self {
        Self {
            radius_px: 4,
            min_neighbours: 4,
        }
    }
}

/// A pixel's world point and voxel.
pub(super) type Hit = (Point, VoxelKey);

/// The observations of at least `min_points` points, in an order that depends on the detections
/// but not on the order of their list, and the voxels of each detection with fewer. `hits` holds a pixel's point and voxel where it has one.
pub(super) fn observe(
    frame: &Frame,
    instances: &[Instance],
    hits: &[Option<Hit>],
    support: SupportConfig,
    min_points: usize,
) -> Result<(Vec<Observation>, Vec<Vec<VoxelKey>>), MapError> {
    let owners = owners(frame, instances, hits)?;
    let mut observations: Vec<Observation> = (0..instances.len())
        .map(|instance| Observation {
            instance,
            pixels: Vec::new(),
            cloud: PointCloud::default(),
            keys: Vec::new(),
            voxels: Vec::new(),
        })
        .collect();
    let mut seen = vec![Vec::new(); instances.len()];
    for (pixel, hit) in hits.iter().enumerate() {
        let (Some((point, key)), Some(owner)) = (hit, owners[pixel]) else {
            continue;
        };
        seen[owner].push(*key);
        if is_supported(frame, hits, &owners, pixel, support) {
            let observation = &mut observations[owner];
            observation.pixels.push(pixel);
            observation.cloud.push(*point, frame.rgb()[pixel]);
            observation.keys.push(*key);
        }
    }
    let mut glimpses = Vec::new();
    observations.retain(|o| {
        let is_large = o.pixels.len() >= min_points.max(1);
        if !is_large && !seen[o.instance].is_empty() {
            // Too few pixels to support each other count here.
            glimpses.push(std::mem::take(&mut seen[o.instance]));
        }
        is_large
    });
    observations.sort_unstable_by_key(|o| o.pixels[0]);
    for observation in &mut observations {
        observation.voxels.clone_from(&observation.keys);
        observation.voxels.sort_unstable();
        observation.voxels.dedup();
    }
    Ok((observations, glimpses))
}

/// The detection that each pixel with a point belongs to.
fn owners(
    frame: &Frame,
    instances: &[Instance],
    hits: &[Option<Hit>],
) -> Result<Vec<Option<usize>>, MapError> {
    for instance in instances {
        instance.check_fits(frame.intrinsics())?;
    }
    let mut order: Vec<usize> = (0..instances.len()).collect();
    order.sort_by(|a, b| precedence(&instances[*a], &instances[*b]));
    let mut owners = vec![None; hits.len()];
    for index in order {
        for (pixel, _) in instances[index]
            .mask()
            .iter()
            .enumerate()
            .filter(|(_, m)| **m)
        {
            if hits[pixel].is_some() && owners[pixel].is_none() {
                owners[pixel] = Some(index);
            }
        }
    }
    Ok(owners)
}

/// Which of two detections takes the pixels that both cover: the lesser one.
fn precedence(a: &Instance, b: &Instance) -> Ordering {
    let area = |i: &Instance| i.mask().iter().filter(|m| **m).count();
    let scores = a.class_scores().iter().zip(b.class_scores());
    b.score()
        .total_cmp(&a.score())
        .then_with(|| area(a).cmp(&area(b)))
        .then_with(|| a.mask().cmp(b.mask()))
        .then_with(|| scores.fold(Ordering::Equal, |o, (a, b)| o.then(b.total_cmp(a))))
}

fn is_supported(
    frame: &Frame,
    hits: &[Option<Hit>],
    owners: &[Option<usize>],
    pixel: usize,
    support: SupportConfig,
) -> bool {
    let Some((point, _)) = hits[pixel] else {
        return false;
    };
    let intrinsics = frame.intrinsics();
    let spacing = intrinsics.ray(1.0, 1.0) - intrinsics.ray(0.0, 0.0);
    let depth_m = f64::from(frame.depth_m()[pixel]);
    let radius_m = support.radius_px as f64 * depth_m * spacing.x.max(spacing.y);
    let (column, row) = (pixel % intrinsics.width(), pixel / intrinsics.width());
    let window = |centre: usize, end: usize| {
        centre.saturating_sub(support.radius_px)
            ..=centre.saturating_add(support.radius_px).min(end - 1)
    };
    let near = window(row, intrinsics.height())
        .flat_map(|row| {
            window(column, intrinsics.width()).map(move |c| row * intrinsics.width() + c)
        })
        .filter(|other| *other != pixel && owners[*other] == owners[pixel])
        .filter(|other| hits[*other].is_some_and(|(p, _)| (p - point).norm() <= radius_m));
    near.take(support.min_neighbours).count() == support.min_neighbours
}
