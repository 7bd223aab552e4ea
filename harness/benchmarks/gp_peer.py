"""Time the exact Dirichlet GP beside GPyTorch's exact Cholesky path, in one run.

    python -m harness.benchmarks.gp_peer [--training-points 3600] [--test-points 1000] [--threads 2]

Needs `torch` and `gpytorch` (``pip install -e '.[peers]'``); says so where they are missing. Both
sides get the same points, labels, hyperparameters and thread count, in float64, and their results
are compared before their times are.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

LENGTHSCALE_M = 0.05
OUTPUTSCALE = 4.0
MEANS = (-3.0, -4.0)


def training_problem(
    training_points: int, test_points: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on and off a sphere of 4 cm radius, as an observed object in its free space.

    Returns
    -------
    points : (training_points, 3) float64, metres
    labels : (training_points,) uint8, 1 on the sphere
    test : (test_points, 3) float64, metres
    """
    rng = np.random.default_rng(np.random.SeedSequence(7))
    directions = rng.normal(size=(training_points, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    labels = (np.arange(training_points) % 2).astype(np.uint8)
    radii = np.where(labels == 1, 0.04, rng.uniform(0.055, 0.09, size=training_points))
    test = rng.uniform(-0.06, 0.06, size=(test_points, 3))
    return directions * radii[:, None], labels, test


def median_seconds(call: Callable[[], object], repeats: int) -> float:
    """Median wall time of a call after one warm-up."""
    call()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def peer_calls(
    points: np.ndarray, labels: np.ndarray, test: np.ndarray
) -> tuple[Callable[[], tuple[np.ndarray, np.ndarray]], Callable[[], np.ndarray]]:
    """GPyTorch's posterior with variance, and its likelihood with gradients, as calls."""
    import gpytorch
    import torch

    x, y, x_test = (torch.as_tensor(a) for a in (points, labels.astype(np.int64), test))
    likelihood = gpytorch.likelihoods.DirichletClassificationLikelihood(
        y, alpha_epsilon=0.01, learn_additional_noise=False, dtype=torch.float64
    )
    classes = likelihood.num_classes
    batch = torch.Size((classes,))

    class Model(gpytorch.models.ExactGP):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(x, likelihood.transformed_targets, likelihood)
            self.mean_module = gpytorch.means.ConstantMean(batch_shape=batch)
            self.covar_module = gpytorch.kernels.ScaleKernel(
                gpytorch.kernels.MaternKernel(nu=2.5, batch_shape=batch), batch_shape=batch
            )

        def forward(self, inputs: Any) -> Any:
            return gpytorch.distributions.MultivariateNormal(
                self.mean_module(inputs), self.covar_module(inputs)
            )

    model = Model().double()
    model.covar_module.base_kernel.lengthscale = LENGTHSCALE_M
    model.covar_module.outputscale = OUTPUTSCALE
    model.mean_module.constant.data = torch.tensor(MEANS, dtype=torch.float64)
    marginal = gpytorch.mlls.ExactMarginalLogLikelihood(likelihood, model)

    def exact() -> Any:
        """Cholesky all the way: no conjugate gradients, no low-rank shortcuts."""
        from contextlib import ExitStack

        stack = ExitStack()
        stack.enter_context(gpytorch.settings.max_cholesky_size(10**6))
        stack.enter_context(gpytorch.settings.fast_computations(False, False, False))
        stack.enter_context(gpytorch.settings.fast_pred_var(state=False))
        return stack

    def posterior() -> tuple[np.ndarray, np.ndarray]:
        model.train()
        model.eval()
        likelihood.eval()
        with exact(), torch.no_grad(), gpytorch.settings.skip_posterior_variances(state=False):
            latent = model(x_test)
            return latent.mean.numpy(), latent.variance.numpy()

    def likelihood_and_gradient() -> np.ndarray:
        model.train()
        likelihood.train()
        model.zero_grad()
        with exact():
            value = marginal(model(x), likelihood.transformed_targets)
            value.sum().backward()
        values: np.ndarray = value.detach().numpy()
        return values

    return posterior, likelihood_and_gradient


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--training-points", type=int, default=3600)
    parser.add_argument("--test-points", type=int, default=1000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args(arguments)
    os.environ["RAYON_NUM_THREADS"] = str(options.threads)
    try:
        import gpytorch
        import torch
    except ImportError as error:
        sys.stderr.write(f"gp_peer: {error}; install the peers: pip install -e '.[peers]'\n")
        return 2
    from harness.native import gp_log_likelihood, gp_posterior

    torch.set_num_threads(options.threads)
    points, labels, test = training_problem(options.training_points, options.test_points)
    hyperparameters: dict[str, Any] = {
        "lengthscales": np.full(2, LENGTHSCALE_M),
        "outputscales": np.full(2, OUTPUTSCALE),
        "means": np.array(MEANS),
    }

    def our_posterior() -> tuple[np.ndarray, np.ndarray]:
        return gp_posterior(points=points, labels=labels, test_points=test, **hyperparameters)

    def our_likelihood() -> tuple[np.ndarray, np.ndarray]:
        return gp_log_likelihood(points=points, labels=labels, **hyperparameters)

    peer_posterior, peer_likelihood = peer_calls(points, labels, test)
    for value, reference in zip(our_posterior(), peer_posterior(), strict=True):
        np.testing.assert_allclose(value, reference, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(our_likelihood()[0], peer_likelihood(), rtol=1e-8)

    print(
        f"exact Dirichlet GP, {options.training_points} training and {options.test_points} test "
        f"points, 2 classes, float64, {options.threads} threads; "
        f"gpytorch {gpytorch.__version__}, torch {torch.__version__}"
    )
    for name, ours, theirs in (
        ("posterior with variance", our_posterior, peer_posterior),
        ("likelihood and gradient", our_likelihood, peer_likelihood),
    ):
        our_s = median_seconds(ours, options.repeats)
        peer_s = median_seconds(theirs, options.repeats)
        print(f"{name}: ours {our_s:.3f} s, gpytorch {peer_s:.3f} s, ratio {peer_s / our_s:.1f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
