use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::{
    BLOCK_BITS, Cells, bit_of, block_code,
    ray::{MARGIN, Marks},
};

/// A bit per voxel over the bounding box of a scan's rays. Bits only ever turn on, so the order in
/// which threads set them does not matter.
pub(super) struct DenseMarks {
    /// Key of the first voxel; below 0 at the volume's border, where the margin sticks out.
    first_key: [i32; 3],
    /// Voxels along each axis, multiples of 4.
    shape: [usize; 3],
    free: Vec<AtomicU64>,
    occupied: Vec<AtomicU64>,
}

impl DenseMarks {
    /// Marks for voxels from `low` to `high`; `None` if that takes more than `limit` words.
    pub(super) fn new(low: [u16; 3], high: [u16; 3], limit: usize) -> Option<Self> {
        let first_key = low.map(|k| (i32::from(k) - MARGIN) & !3);
        let last_key = high.map(|k| (i32::from(k) + MARGIN) | 3);
        let shape = [0, 1, 2].map(|i| (last_key[i] + 1 - first_key[i]) as usize);
        let words = shape.iter().product::<usize>().div_ceil(64);
        if words > limit {
            return None;
        }
        let zeros = || (0..words).map(|_| AtomicU64::new(0)).collect();
        Some(Self {
            first_key,
            shape,
            free: zeros(),
            occupied: zeros(),
        })
    }

    /// Notes a voxel in which a ray ends.
    pub(super) fn end(&self, keys: [u16; 3]) {
        set(&self.occupied, (&self).address(keys));
    }

    /// Blocks with any voxel noted, in no particular order.
    #[expect(
        clippy::cast_possible_wrap,
        reason = "the limit on words bounds every edge"
    )]
    pub(super) fn into_blocks(self) -> Vec<Cells> {
        let [width, height, depth] = self.shape;
        let free: Vec<u64> = self.free.into_iter().map(AtomicU64::into_inner).collect();
        let occupied: Vec<u64> = self
            .occupied
            .into_iter()
            .map(AtomicU64::into_inner)
            .collect();
        let mut blocks = Vec::new();
        for z in (0..depth).step_by(4) {
            for y in (0..height).step_by(4) {
                for x in (0..width).step_by(4) {
                    let first = x + width * (y + height * z);
                    let free = gather(&free, first, width, width * height);
                    let occupied = gather(&occupied, first, width, width * height);
                    let at = [x, y, z];
                    let block = [0, 1, 2].map(|i| (self.first_key[i] + at[i] as i32) >> BLOCK_BITS);
                    if free | occupied != 0
                        && let Some(code) = block_code(block)
                    {
                        blocks.push(Cells {
                            code,
                            free,
                            occupied,
                        });
                    }
                }
            }
        }
        blocks
    }
}

/// The 64 bits of the block that starts at bit `first`, in Morton order.
fn gather(words: &[u64], first: usize, row: usize, plane: usize) -> u64 {
    let mut block = 0;
    for z in 0..4 {
        for y in 0..4 {
            // Rows start at multiples of 4: four neighbours along x share a word.
            let at = first + y * row + z * plane;
            let four = words[at / 64] >> (at % 64) & 0xf;
            for x in 0..4 {
                block |= (four >> x & 1) << bit_of([x, y as u64, z as u64]);
            }
        }
    }
    block
}

impl Marks for &DenseMarks {
    fn address(&self, keys: [u16; 3]) -> i64 {
        let strides = self.strides();
        let part = |i: usize| i64::from(i32::from(keys[i]) - self.first_key[i]) * strides[i];
        part(0) + part(1) + part(2)
    }

    #[expect(
        clippy::cast_possible_wrap,
        reason = "the limit on words bounds every edge"
    )]
    fn strides(&self) -> [i64; 3] {
        let [width, height, _] = self.shape.map(|s| s as i64);
        [1, width, width * height]
    }

    fn pass(&mut self, address: i64) {
        set(&self.free, address);
    }
}

/// Sets a bit. Most are set already, and a load is far cheaper than an atomic write.
fn set(words: &[AtomicU64], address: i64) {
    let bit = 1 << (address & 63);
    if let Some(word) = words.get((address >> 6) as usize)
        && word.load(Relaxed) & bit == 0
    {
        word.fetch_or(bit, Relaxed);
    }
}
