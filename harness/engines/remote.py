"""What a node of a cluster does with a job."""

from __future__ import annotations

import pickle
import platform
from typing import TYPE_CHECKING

from harness.engines.identity import code_identity, differences, other_files
from harness.engines.worker import Done, Raised, Unusable, compute, load_target, one_line

if TYPE_CHECKING:
    from collections.abc import Mapping


def serve(
    expected: Mapping[str, str], files: Mapping[str, str], packed: bytes
) -> Done | Raised | Unusable:
    """Compute a job, unless this node's code or files are not the caller's.

    Parameters
    ----------
    expected
        The caller's `code_identity`.
    files
        The sha256 of each of the caller's files by its path.
    packed
        Pickle of the target, the job and the further arguments; it is opened once the code is
        known to be the same.
    """
    if unlike := differences(ours=expected, theirs=code_identity()):
        return Unusable(
            f"node {platform.node()} has other code ({unlike}); give it the same checkout, built "
            "wheel and virtual environment, or take it out of the cluster"
        )
    if unlike := other_files(files):
        return Unusable(
            f"node {platform.node()} has other meshes ({unlike}); give it the same objects under "
            "the same paths, or take it out of the cluster"
        )
    target, job, arguments = pickle.loads(packed)
    try:
        function = load_target(target)
    except Exception as error:
        return Unusable(f"node {platform.node()}: {one_line(error)}")
    return compute(function, (job, *arguments))
