/// Marks a child that does not exist.
const UNKNOWN: u32 = u32::MAX;
/// Marks a node without children.
const LEAF: u32 = u32::MAX - 1;

/// A node by value: its log-odds and where its children are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    pub(super) log_odds: f32,
    children: u32,
}

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Unknown,
    Leaf,
    /// The index of the block of children.
    Inner(u32),
}

impl Node {
    pub(super) const UNKNOWN: Self = Self {
        log_odds: 0.0,
        children: UNKNOWN,
    };

    pub(super) const fn leaf(log_odds: f32) -> Self {
        Self {
            log_odds,
            children: LEAF,
        }
    }

    pub(super) const fn kind(self) -> Kind {
        match self.children {
            UNKNOWN => Kind::Unknown,
            LEAF => Kind::Leaf,
            block => Kind::Inner(block),
        }
    }

    pub(super) const fn is_known(self) -> bool {
        self.children != UNKNOWN
    }
}

/// The eight children of one node, 64 bytes: one cache line.
pub(super) type Block = [Node; 8];

/// All blocks of a tree in one allocation, freed ones reused.
///
/// A block index is 32 bits wide: the last one would sit at 256 GiB.
#[derive(Debug, Clone, Default)]
pub(super) struct Arena {
    blocks: Vec<Block>,
    free: Vec<u32>,
}

impl Arena {
    pub(super) fn block(&self, index: u32) -> &Block {
        &self.blocks[index as usize]
    }

    /// Stores eight children in a new block.
    pub(super) fn allocate(&mut self, children: Block) -> u32 {
        if let Some(index) = self.free.pop() {
            self.blocks[index as usize] = children;
            return index;
        }
        self.blocks.push(children);
        (self.blocks.len() - 1) as u32
    }

    /// The parent of `children`, which are written back to the block: a leaf if all eight are
    /// leaves with equal log-odds (pruning), else an inner node with the highest log-odds of them.
    pub(super) fn close(&mut self, index: u32, children: Block) -> Node {
        let first = children[0];
        if first.kind() == Kind::Leaf && children.iter().all(|c| *c == first) {
            self.free.push(index);
            return first;
        }
        self.blocks[index as usize] = children;
        self.inner(index)
    }

    /// The inner node over a block, with the highest log-odds of its children.
    pub(super) fn inner(&self, index: u32) -> Node {
        let known = self.block(index).iter().filter(|c| c.is_known());
        Node {
            log_odds: known.fold(f32::MIN, |max, c| max.max(c.log_odds)),
            children: index,
        }
    }

    /// Bytes allocated.
    pub(super) const fn bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<Block>() + self.free.capacity() * size_of::<u32>()
    }
}
