"""Check what the statistics promise on simulated runs whose truth is known, as Markdown.

    python -m harness.benchmarks.statistics_check [--trials 2000] [--seed 0]

A simulated difference is an object's own part plus a scene's, both of one distribution with mean
0 and variance 1, mixed so that the object's part is the share `ICC` of the variance; an object has
2 or 3 scenes. Takes well under a minute.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import bootstrap

from harness.statistics import ALPHA, POWER, benjamini_hochberg, bootstrap_interval
from harness.statistics.paired import attainable_level, detectable_errors, sign_change_p

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import numpy.typing as npt

    from harness.statistics.paired import Alternative

    Floats = npt.NDArray[np.float64]
    Draw = Callable[[np.random.Generator, tuple[int, ...]], Floats]

_SIGMA = 0.8
_RESAMPLES = 2000


def _lognormal(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    mean, spread = math.exp(_SIGMA**2 / 2), math.sqrt(math.expm1(_SIGMA**2))
    return (rng.lognormal(0.0, _SIGMA, shape) / mean - 1.0) / spread


DISTRIBUTIONS: dict[str, Draw] = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "exponential": lambda rng, shape: rng.standard_exponential(shape) - 1.0,
    "log-normal": _lognormal,
}


@dataclass(frozen=True)
class Design:
    """Scenes of objects, and how alike those of one object are.

    Attributes
    ----------
    sizes : (objects,) int
        Number of scenes of each object.
    icc
        Share of the variance that is the objects'.
    """

    sizes: npt.NDArray[np.intp]
    icc: float

    @classmethod
    def of(cls, objects: int, *, icc: float) -> Design:
        """Give the first half of the objects 3 scenes, the others 2."""
        return cls(np.where(np.arange(objects) < objects / 2, 3, 2), icc)

    @property
    def standard_error(self) -> float:
        """True standard error of the mean."""
        variance = self.icc * np.sum(self.sizes**2) + (1 - self.icc) * np.sum(self.sizes)
        return math.sqrt(variance) / float(np.sum(self.sizes))

    def draw(self, trials: int, *, kind: str, rng: np.random.Generator) -> Floats:
        """Draw differences (trials, scenes)."""
        draw, count = DISTRIBUTIONS[kind], self.sizes.size
        own = np.repeat(draw(rng, (trials, count)), self.sizes, axis=1)
        rest = draw(rng, own.shape)
        return math.sqrt(self.icc) * own + math.sqrt(1 - self.icc) * rest

    def totals(self, differences: Floats) -> Floats:
        """Sum each object's scenes: (trials, objects)."""
        starts = np.concatenate(([0], np.cumsum(self.sizes)[:-1]))
        return np.add.reduceat(differences, starts, axis=1)


def rejected(totals: Floats, *, alternative: Alternative = "two-sided") -> float:
    """Share of trials (trials, objects) in which the test rejects at `ALPHA`."""
    found = [sign_change_p(row, seed=0, alternative=alternative) <= ALPHA for row in totals]
    return float(np.mean(found))


def type_one_errors(trials: int, rng: np.random.Generator) -> Iterable[Sequence[str]]:
    """Yield how often a true null is rejected, on two sides and on each."""
    for kind, objects, icc in product(DISTRIBUTIONS, (8, 12, 21), (0.3, 0.85)):
        design = Design.of(objects, icc=icc)
        totals = design.totals(design.draw(trials, kind=kind, rng=rng))
        sides: tuple[Alternative, ...] = ("two-sided", "less", "greater")
        shares = [f"{rejected(totals, alternative=side):.3f}" for side in sides]
        level = attainable_level(objects, alternative="two-sided")
        yield kind, str(objects), str(icc), f"{level:.3f}", *shares


def coverages(trials: int, rng: np.random.Generator) -> Iterable[Sequence[str]]:
    """Yield how often the 95 % interval holds the true mean, and SciPy's BCa interval.

    Objects have 2 scenes each, so that SciPy's resamples of their means are ours of the objects.
    """
    for kind, objects in product(DISTRIBUTIONS, (5, 8, 12, 16, 21)):
        design = Design(np.full(objects, 2), 0.6)
        names = np.repeat([f"{i:02d}" for i in range(objects)], design.sizes)
        differences = design.draw(trials, kind=kind, rng=rng)
        hits = 0
        for trial, row in enumerate(differences):
            bounds = bootstrap_interval(row, objects=names, seed=trial % 4, resamples=_RESAMPLES)
            hits += bounds is not None and bounds[0] <= 0.0 <= bounds[1]
        plain = bootstrap(
            (design.totals(differences[: trials // 2]) / 2,),
            np.mean,
            axis=-1,
            n_resamples=_RESAMPLES // 2,
            batch=100,
            method="BCa",
            rng=rng,
        ).confidence_interval
        theirs = np.mean((plain.low <= 0.0) & (plain.high >= 0.0))
        yield kind, str(objects), f"{hits / trials:.3f}", f"{theirs:.3f}"


def powers(trials: int, rng: np.random.Generator) -> Iterable[Sequence[str]]:
    """Yield how often a true difference of the minimum detectable size is found."""
    for kind, objects, icc in product(DISTRIBUTIONS, (6, 8, 12, 21), (0.3, 0.85)):
        design = Design.of(objects, icc=icc)
        errors = detectable_errors(objects, alternative="two-sided")
        true = (errors or 0.0) * design.standard_error
        differences = design.draw(trials, kind=kind, rng=rng)
        # Of a skewed distribution the two directions are unlike.
        shares = [f"{rejected(design.totals(differences + sign * true)):.3f}" for sign in (1, -1)]
        yield kind, str(objects), str(icc), f"{true:.3f}", *shares


def false_discoveries(trials: int, rng: np.random.Generator) -> Iterable[Sequence[str]]:
    """Yield what share of a table's discoveries is false, and of its true differences found.

    A table has 4 classes and test sets with objects of their own, and in each 12 differences,
    which depend on each other for they are of the same scenes.
    """
    tables, cells, columns = max(trials // 4, 1), 4, 12
    for kind, true_share in product(DISTRIBUTIONS, (0.0, 0.25, 0.75)):
        design, false, power = Design.of(12, icc=0.6), [], []
        for _ in range(tables):
            shared = design.draw(cells, kind=kind, rng=rng)[:, np.newaxis]
            own = design.draw(cells * columns, kind=kind, rng=rng).reshape(cells, columns, -1)
            effects = (rng.uniform(size=(cells, columns)) < true_share) * 1.0
            values = math.sqrt(0.5) * (shared + own) + effects[..., np.newaxis]
            totals = design.totals(values.reshape(cells * columns, -1))
            p_values = [sign_change_p(row, seed=0, alternative="two-sided") for row in totals]
            found = benjamini_hochberg(np.array(p_values)) <= ALPHA
            is_true = effects.ravel() > 0
            wrong, right = int((found & ~is_true).sum()), int((found & is_true).sum())
            false.append(wrong / max(wrong + right, 1))
            power.append(right / max(int(is_true.sum()), 1))
        share = f"{np.mean(power):.2f}" if true_share else "-"
        yield kind, f"{true_share:.0%}", f"{np.mean(false):.3f}", share


def _print_table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    print(f"### {title}\n")
    print("| " + " | ".join(headings) + " |")
    print("|" + " --- |" * len(headings))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


def main() -> None:
    """Print every check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--trials", type=int, default=2000, help="simulated runs of each line")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    trials, rng = options.trials, np.random.Generator(np.random.Philox(options.seed))
    _print_table(
        f"True nulls rejected at {ALPHA:.0%}",
        ["differences", "objects", "ICC", "attainable", "two-sided", "less", "greater"],
        type_one_errors(trials, rng),
    )
    _print_table(
        "Coverage of the 95 % interval (2 scenes of each object, ICC 0.6)",
        ["differences", "objects", "ours", "BCa"],
        coverages(trials, rng),
    )
    _print_table(
        f"Power at the minimum detectable difference (aim {POWER:.0%})",
        ["differences", "objects", "ICC", "difference / sd", "upwards", "downwards"],
        powers(trials, rng),
    )
    _print_table(
        f"False discoveries at q <= {ALPHA:.0%} (48 differences, 12 objects)",
        ["differences", "true ones", "false discoveries", "found of the true ones"],
        false_discoveries(trials, rng),
    )


if __name__ == "__main__":
    main()
