use crate::key::Grid;

/// How many voxels a ray may stray from the box of its two ends, at most. Rounding carries a ray
/// one voxel past its end; only ends so close that f32 cannot hold their distance stray further,
/// and [`SPARE_STEPS`] stops those.
pub(super) const MARGIN: i32 = 8;
/// Steps granted beyond the number that leads from one end to the other.
const SPARE_STEPS: u32 = 4;

/// Where the voxels of a scan's rays are noted, by an address that is linear in the keys.
pub(super) trait Marks {
    /// Address of a voxel.
    fn address(&self, keys: [u16; 3]) -> i64;
    /// Distance of neighbours' addresses along each axis.
    fn strides(&self) -> [i64; 3];
    /// Notes a voxel that a ray passes.
    fn pass(&mut self, address: i64);
}

/// Notes every voxel that the ray from `origin` to `end` passes, without the one that holds `end`.
///
/// Amanatides & Woo 1987 in the exact arithmetic of `OctoMap`'s `computeRayKeys`: f32 direction
/// and length, f64 parameters that accumulate along the ray. Both ends lie inside the volume.
pub(super) fn trace(
    grid: &Grid,
    (origin, origin_keys): ([f32; 3], [u16; 3]),
    (end, end_keys): ([f32; 3], [u16; 3]),
    marks: &mut impl Marks,
) {
    if origin_keys == end_keys {
        return;
    }
    let offset = [0, 1, 2].map(|axis| end[axis] - origin[axis]);
    let length = norm(offset) as f32;
    let strides = marks.strides();
    let mut step = [0; 3];
    // Ray length at which the next border along each axis is crossed, and between two borders.
    let mut next = [f64::MAX; 3];
    let mut delta = [f64::MAX; 3];
    for axis in 0..3 {
        let direction = offset[axis] / length;
        if direction == 0.0 {
            continue;
        }
        let sign = if direction > 0.0 { 1.0 } else { -1.0 };
        step[axis] = sign as i64 * strides[axis];
        let direction = f64::from(direction);
        let border = grid.axis_centre(origin_keys[axis])
            + f64::from((sign * grid.resolution_m() * 0.5) as f32);
        next[axis] = (border - f64::from(origin[axis])) / direction;
        delta[axis] = grid.resolution_m() / direction.abs();
    }
    let length = f64::from(length);
    let [mut next_x, mut next_y, mut next_z] = next;
    let [delta_x, delta_y, delta_z] = delta;
    let [step_x, step_y, step_z] = step;

    let end_address = marks.address(end_keys);
    let mut address = marks.address(origin_keys);
    let apart = |axis: usize| u32::from(origin_keys[axis].abs_diff(end_keys[axis]));
    for _ in 0..apart(0) + apart(1) + apart(2) + SPARE_STEPS {
        marks.pass(address);
        // Which axis comes first is a coin toss to the branch predictor: selects, not branches.
        let x_before_y = next_x < next_y;
        let before_z = lesser(next_x, next_y) < next_z;
        let (x, y) = (x_before_y & before_z, !x_before_y & before_z);
        next_x += if x { delta_x } else { 0.0 };
        next_y += if y { delta_y } else { 0.0 };
        next_z += if before_z { 0.0 } else { delta_z };
        address += if x { step_x } else { 0 };
        address += if y { step_y } else { 0 };
        address += if before_z { 0 } else { step_z };
        // Rounding can carry the ray past the end's voxel: then its length stops it.
        if address == end_address || lesser(lesser(next_x, next_y), next_z) > length {
            return;
        }
    }
}

/// The smaller number; none is NaN, so that one instruction does it.
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Euclidean length, squared and summed in f32 and rooted in f64 as `OctoMap` does.
pub(super) fn norm([x, y, z]: [f32; 3]) -> f64 {
    f64::from(x * x + y * y + z * z).sqrt()
}
