use std::collections::HashMap;

use super::{
    BLOCK_BITS, Cells, bit_of, block_code,
    ray::{MARGIN, Marks},
};

/// Bits of an address per axis: a key, the margin below and above, and room to spare.
const AXIS_BITS: u32 = 20;
const AXIS_MASK: i64 = (1 << AXIS_BITS) - 1;

/// Marked voxels by block, for scans whose bounding box is too large for a dense bitmap.
///
/// Memory grows with the space that the rays cross, up to a limit.
pub(super) struct SparseMarks {
    limit: usize,
    /// Free and occupied voxels by block address.
    blocks: HashMap<[i32; 3], [u64; 2]>,
    /// The block that the ray is in, written back when the ray leaves it.
    current: [i32; 3],
    bits: u64,
}

impl SparseMarks {
    pub(super) fn new(limit: usize) -> Self {
        Self {
            limit,
            blocks: HashMap::new(),
            current: [0; 3],
            bits: 0,
        }
    }

    /// Notes a voxel in which a ray ends.
    pub(super) fn end(&mut self, keys: [u16; 3]) {
        let (block, bit) = split(keys.map(i32::from));
        self.blocks.entry(block).or_default()[1] |= 1 << bit;
    }

    fn flush(&mut self) {
        if self.bits != 0 && !self.is_full() {
            self.blocks.entry(self.current).or_default()[0] |= self.bits;
        }
        self.bits = 0;
    }

    /// Whether more blocks were marked than the limit allows.
    pub(super) fn is_full(&self) -> bool {
        self.blocks.len() > self.limit
    }

    /// Blocks with any voxel noted, in no particular order.
    pub(super) fn into_blocks(mut self) -> Vec<Cells> {
        self.flush();
        let cells = |(block, [free, occupied]): ([i32; 3], [u64; 2])| {
            Some(Cells {
                code: block_code(block)?,
                free,
                occupied,
            })
        };
        self.blocks.into_iter().filter_map(cells).collect()
    }
}

/// Block and bit of a voxel.
fn split(keys: [i32; 3]) -> ([i32; 3], u32) {
    let bit = bit_of(keys.map(|k| (k & 3) as u64));
    (keys.map(|k| k >> BLOCK_BITS), bit)
}

impl Marks for SparseMarks {
    fn address(&self, keys: [u16; 3]) -> i64 {
        let [x, y, z] = keys.map(|k| i64::from(i32::from(k) + MARGIN));
        x | y << AXIS_BITS | z << (2 * AXIS_BITS)
    }

    fn strides(&self) -> [i64; 3] {
        [1, 1 << AXIS_BITS, 1 << (2 * AXIS_BITS)]
    }

    fn pass(&mut self, address: i64) {
        let key = |axis: u32| (address >> (axis * AXIS_BITS) & AXIS_MASK) as i32 - MARGIN;
        let (block, bit) = split([key(0), key(1), key(2)]);
        if block != self.current {
            self.flush();
            self.current = block;
        }
        self.bits |= 1 << bit;
    }
}
