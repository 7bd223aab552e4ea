"""Writes the reference files; run with pyoctomap 1.2.2 and numpy in the folder of the files."""

from __future__ import annotations

import numpy as np
import pyoctomap  # type: ignore[import-untyped]


def write(name: str, tree: pyoctomap.OcTree) -> None:
    tree.write(f"{name}.ot")
    tree.writeBinary(f"{name}.bt")  # turns the tree into its most likely one: last


def block(tree: pyoctomap.OcTree, corner: np.ndarray, edge: int, misses: list[int]) -> None:
    """Misses voxel i of a block (x fastest) misses[i % len(misses)] times."""
    for i in range(edge**3):
        offset = np.array([i % edge, i // edge % edge, i // edge**2])
        for _ in range(misses[i % len(misses)]):
            tree.updateNode(list((corner + offset + 0.5) * 0.05), False)


write("empty", pyoctomap.OcTree(0.1))

one = pyoctomap.OcTree(0.1)
one.updateNode([0.05, 0.05, 0.05], True)
write("one", one)

scan = pyoctomap.OcTree(0.02)
generator = np.random.default_rng(1)
for _ in range(2):
    rays = generator.normal(size=(60, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    origin = np.array([0.011, -0.02, 0.3])
    scan.insertPointCloud(origin + 0.1 * rays, origin)
write("scan", scan)


def uniform_blocks(tree: pyoctomap.OcTree) -> None:
    """Eight blocks of 2 x 2 x 2 voxels that touch; within each all log-odds are equal."""
    for i in range(8):
        corner = 2 * np.array([i % 2, i // 2 % 2, i // 4])
        block(tree, corner, 2, [1 + i % 3])


# The lowest level has nothing to merge, so that pruning ends before it reaches the eight blocks.
stopping = pyoctomap.OcTree(0.05)
uniform_blocks(stopping)
stopping.updateNode([-0.3, 0.2, 1.0], True)
write("stopping", stopping)

# One more block whose voxels only become equal: pruning goes on, to the eight blocks too.
merging = pyoctomap.OcTree(0.05)
uniform_blocks(merging)
block(merging, np.array([-16, 8, 4]), 2, [1, 2, 3])
write("merging", merging)
