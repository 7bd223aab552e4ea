"""Thresholds and what is guaranteed of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from harness.calibration import (
    THRESHOLDS,
    Goal,
    Losses,
    ScenePoints,
    choose_threshold,
    judge_threshold,
    object_losses,
    validate,
)
from harness.errors import InputError


def scene(
    confidence: list[float], truth: list[bool], *, of: str = "a", category: str = "mug"
) -> ScenePoints:
    values = np.array(confidence)
    return ScenePoints(
        scene_id=f"{category}-0000",
        category=category,
        object_name=of,
        completion="none",
        model="metric",
        truth=np.array(truth),
        predicted=values >= 0.5,
        on_object={"confidence": values},
        of_decision={},
    )


def losses_of(*false_shares: dict[float, float]) -> Losses:
    """Objects whose loss at and above each confidence is as given, up to the next one."""
    rows = np.zeros((len(false_shares), len(THRESHOLDS)))
    for row, shares in zip(rows, false_shares, strict=True):
        for start, share in sorted(shares.items()):
            row[at(start) :] = share
    names = np.array([f"mug/{index}" for index in range(len(rows))])
    return Losses(objects=names, false_share=rows)


def at(confidence: float) -> int:
    return int(np.searchsorted(THRESHOLDS, confidence))


def test_shares_of_false_points_by_hand() -> None:
    truth = [True, False, True, False]
    found = object_losses(
        [
            scene([0.9, 0.8, 0.7, 0.1], truth),
            scene([0.3, 0.2, 0.2, 0.2], truth),
            scene([0.5, 0.9, 0.5, 0.5], truth, category="bowl"),
        ]
    )
    assert found.objects.tolist() == ["bowl/a", "mug/a"]
    bowl, mug = found.false_share
    # A point of just the threshold's confidence is kept.
    assert bowl[at(0.5)] == 0.5
    assert bowl[at(0.501)] == bowl[at(0.9)] == 1.0
    assert bowl[at(0.901)] == 0.0
    # The mean of two scenes: 2/4 and 2/4; 1/3 and nothing kept; 1/2; 0.
    assert_allclose(mug[[at(0.1), at(0.7), at(0.75), at(0.9)]], [0.5, 1 / 6, 1 / 4, 0.0])


def test_a_threshold_and_what_it_keeps() -> None:
    scenes = [
        scene([0.9, 0.8, 0.7, 0.1], [True, False, True, True], of="a"),
        scene([0.3, 0.2, 0.2, 0.2], [True, False, False, False], of="b"),
        scene([0.9, 0.9], [False, False], of="c"),
    ]
    kept = judge_threshold(scenes, 0.7, seed=0)
    assert kept.precision.mean == pytest.approx((2 / 3 + 1 + 0) / 3)
    assert kept.precision_where_kept.mean == pytest.approx((2 / 3 + 0) / 2)
    assert kept.kept.mean == pytest.approx((3 / 4 + 0 + 1) / 3)
    # The third has no point on the mesh to recall.
    assert kept.recall.mean == pytest.approx((2 / 3 + 0) / 2)
    assert (kept.scenes, kept.objects, kept.empty) == (3, 3, 1)


def test_the_lowest_threshold_in_expectation() -> None:
    # Four objects, of which one loses .4 from .2 up and .2 from .6 up: (4 R + 1) / 5.
    losses = losses_of({0.2: 0.4, 0.6: 0.2, 0.8: 0.0}, {}, {}, {})
    for precision, threshold, bound in ((0.8, 0.8, 0.2), (0.76, 0.6, 0.24), (0.72, 0.0, 0.28)):
        choice = choose_threshold(losses, Goal(keep_precision=precision))
        assert choice.threshold == threshold, precision
        assert choice.bound == pytest.approx(bound)
    none = choose_threshold(losses, Goal(keep_precision=0.81))
    assert none.threshold is None
    assert (none.objects, none.least_objects) == (4, 5)
    assert none.bound == pytest.approx(0.2)


def test_a_dip_below_a_worse_threshold_is_not_taken() -> None:
    """Below .5 the mean loss is 0, but more at .5: the guarantee needs what never rises."""
    losses = losses_of(*[{0.5: 0.3, 0.9: 0.0}] * 9)
    choice = choose_threshold(losses, Goal(keep_precision=0.85))
    assert choice.threshold == 0.9
    # Tested from above, too, a threshold is not reached beyond one that fails.
    assert choose_threshold(losses, Goal(keep_precision=0.7, delta=0.1)).threshold == 0.9


@pytest.mark.parametrize(
    ("precision", "delta", "least"),
    [
        (0.95, None, 19),
        (0.9, None, 9),
        (0.8, None, 4),
        (0.97, None, 33),
        (0.95, 0.1, 45),
        (0.9, 0.05, 29),
        (0.9, 0.1, 22),
        (0.5, 0.25, 2),
    ],
)
def test_the_fewest_objects_of_a_guarantee(
    precision: float, delta: float | None, least: int
) -> None:
    goal = Goal(keep_precision=precision, delta=delta)
    assert goal.least_objects == least
    # Without a false point so many are enough, and one fewer is not.
    assert choose_threshold(losses_of(*[{}] * least), goal).threshold == 0.0
    few = choose_threshold(losses_of(*[{}] * (least - 1)), goal)
    assert few.threshold is None
    assert few.least_objects == least


def test_the_p_value_by_hand() -> None:
    # (.8 / .9) (.8 / 1) (.8 / .95) at 0; an object whose points are all false ends every bet.
    losses = losses_of({0.0: 0.1, 0.5: 0.0}, {}, {0.0: 0.05, 0.5: 0.0})
    choice = choose_threshold(losses, Goal(keep_precision=0.8, delta=0.6))
    assert choice.threshold == 0.0
    assert choice.bound == pytest.approx(0.8**3 / (0.9 * 0.95))
    strict = choose_threshold(losses, Goal(keep_precision=0.8, delta=0.55))
    assert strict.threshold == 0.5
    assert strict.bound == pytest.approx(0.8**3)
    lost = choose_threshold(losses_of({0.0: 1.0}, {}, {}), Goal(keep_precision=0.8, delta=0.6))
    assert (lost.threshold, lost.bound) == (None, 1.0)


@pytest.mark.parametrize("worst", [0.25, 0.5, 1.0])
def test_the_p_value_is_valid_by_enumeration(worst: float) -> None:
    """Losses of 0 or the worst, with a mean of alpha: P(p <= delta) <= delta over all draws."""
    alpha, count = 0.2, 12
    chance = alpha / worst
    for delta in (0.05, 0.1, 0.3, 0.5):
        goal = Goal(keep_precision=1 - alpha, delta=delta)
        # Only the number of bad objects counts.
        wrongly = 0.0
        for bad in range(count + 1):
            drawn = losses_of(*[{0.0: worst}] * bad, *[{}] * (count - bad))
            if choose_threshold(drawn, goal).threshold is not None:
                wrongly += binom.pmf(bad, count, chance)
        assert wrongly <= delta
        # Nor is it idle: without a bad object p is .8^12 = .069.
        assert (wrongly > 0.0) == (delta > 0.069)


def test_the_bet_needs_fewer_objects_than_hoeffding_and_bentkus() -> None:
    def hoeffding_bentkus(losses: np.ndarray, alpha: float) -> float:
        """Angelopoulos et al. 2021, proposition 3."""
        count, mean = len(losses), float(losses.mean())
        if mean >= alpha:
            return 1.0
        gap = mean * np.log(mean / alpha) + (1 - mean) * np.log((1 - mean) / (1 - alpha))
        bentkus = np.e * binom.cdf(np.ceil(count * mean), count, alpha)
        return float(min(np.exp(-count * gap), bentkus))

    rng = np.random.default_rng(3)
    for alpha, mean, count in ((0.05, 0.02, 100), (0.1, 0.03, 48)):
        goal = Goal(keep_precision=1 - alpha, delta=0.1)
        theirs = []
        for _ in range(50):
            drawn = rng.beta(2, 2 * (1 - mean) / mean, size=count)
            losses = losses_of(*({0.0: loss} for loss in drawn))
            assert choose_threshold(losses, goal).threshold == 0.0
            theirs.append(hoeffding_bentkus(drawn, alpha) <= 0.1)
        assert np.mean(theirs) < 0.1


def planted(rng: np.random.Generator, count: int) -> Losses:
    """Objects of 200 points of which one of confidence c is false with 1 - c, or 1 - .8 c."""
    grid = np.linspace(0.005, 1.0, 200)
    scenes = []
    for index in range(count):
        share = 1.0 if rng.uniform() < 0.9 else 0.8
        truth = rng.uniform(size=len(grid)) < grid * share
        scenes.append(scene(grid.tolist(), truth.tolist(), of=f"{index:04d}"))
    return object_losses(scenes)


def test_what_is_promised_in_expectation_holds() -> None:
    """New objects lose at most alpha in the mean over draws, though the loss is not monotone."""
    rng = np.random.default_rng(0)
    population = planted(rng, 2000).false_share
    goal = Goal(keep_precision=0.7)
    risks = []
    for _ in range(300):
        drawn = rng.choice(len(population), size=12, replace=False)
        losses = Losses(objects=drawn.astype(str), false_share=population[drawn])
        choice = choose_threshold(losses, goal)
        risk = 0.0
        if choice.threshold is not None:
            risk = float(population[:, at(choice.threshold)].mean())
        risks.append(risk)
    assert 0.1 < np.mean(risks) <= goal.alpha


def test_what_is_promised_with_probability_holds() -> None:
    """The expected loss passes alpha in at most delta of the draws."""
    rng = np.random.default_rng(1)
    population = planted(rng, 2000).false_share
    means = population.mean(axis=0)
    goal = Goal(keep_precision=0.7, delta=0.2)
    found = []
    for _ in range(300):
        drawn = rng.choice(len(population), size=60)
        losses = Losses(objects=drawn.astype(str), false_share=population[drawn])
        choice = choose_threshold(losses, goal)
        found.append(0.0 if choice.threshold is None else float(means[at(choice.threshold)]))
    assert np.mean(np.array(found) > goal.alpha) <= 0.2
    assert np.mean(found) > 0.1


def test_validation_counts_halves() -> None:
    # Of eight alike objects every half chooses the same, and finds what it was told.
    losses = losses_of(*[{0.0: 0.2, 0.3: 0.0}] * 8)
    found = validate(losses, Goal(keep_precision=0.75), splits=10, seed=0)
    assert (found.splits, found.objects_chosen_on, found.objects_held_out) == (10, 4, 4)
    assert found.chosen == 10
    assert found.thresholds == (0.3, 0.3, 0.3)
    assert (found.mean_precision, found.mean_precision_of_all, found.held) == (1.0, 1.0, 1.0)
    loose = validate(losses, Goal(keep_precision=0.6), splits=10, seed=0)
    assert loose.thresholds == (0.0, 0.0, 0.0)
    assert loose.mean_precision == pytest.approx(0.8)


def test_validation_without_a_threshold_keeps_nothing() -> None:
    losses = losses_of(*[{0.0: 0.9}] * 8)
    found = validate(losses, Goal(keep_precision=0.75), splits=5, seed=0)
    assert (found.chosen, found.mean_precision, found.held, found.thresholds) == (0, *[None] * 3)
    assert found.mean_precision_of_all == 1.0


def test_the_same_seed_splits_alike() -> None:
    losses = planted(np.random.default_rng(2), 30)
    goal = Goal(keep_precision=0.7)
    first, again, other = (validate(losses, goal, splits=20, seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_what_cannot_be_asked_is_refused() -> None:
    for value in (0.0, 1.0, 95.0, float("nan")):
        with pytest.raises(InputError, match=r"--keep-precision .* is not between 0 and 1; pass"):
            Goal(keep_precision=value)
        with pytest.raises(InputError, match=r"--delta .* is not between 0 and 1; pass"):
            Goal(keep_precision=0.95, delta=value)
    losses = losses_of(*[{}] * 20)
    with pytest.raises(InputError, match=r"20 objects .*half of them are 10, and 0\.95 needs 19"):
        validate(losses, Goal(keep_precision=0.95), splits=5, seed=0)
    with pytest.raises(InputError, match="--splits 0 is none; pass a number such as 200"):
        validate(losses, Goal(keep_precision=0.8), splits=0, seed=0)
