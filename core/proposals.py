"""Where new particles are drawn: x_k ~ g(x_k | x_{k-1}, y_k), and what that does to their weights.  MAT Algorithm 5.

A proposal returns, with the particles, the logarithm of the factor of their weights,

    p(y_k | x_k) p(x_k | x_{k-1}) / g(x_k | x_{k-1}, y_k).

The Gaussian proposals work in the coordinates e of the process noise, x_k = f(x_{k-1}) + L e with L L' = Q and
e ~ N(0, I), so a singular Q needs no special case.  Each particle has its own linear model of the measurement,
y = y_hat + G e + v with V(v) = Omega, and draws e from the posterior N(J^-1 G' Omega^-1 nu, J^-1) with the
information matrix J = I + G' Omega^-1 G, which is never singular.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from core.linalg import cholesky_psd
from core.noise import box_muller
from core.types import Array, Motion, Sensor

Proposal = Callable[[Array, Array, Motion, Sensor, "np.random.Generator"], tuple[Array, Array]]
BlockProposal = Callable[[Array, "np.random.Generator", Array], Array]
_ROWS = 8192


class LocalModel(NamedTuple):
    """y = y_hat + G e + v, V(v) = Omega, for each particle.

    nu = y - y_hat (B, m), G (B, m, r), Omega (B, m, m) or (m, m).
    """

    nu: Array
    G: Array
    Omega: Array


def block_proposal(proposal: str | Proposal, y: Array, motion: Motion, sensor: Sensor) -> BlockProposal:
    """(x, rng, out) -> log factor of the weights (B,); fills out (B, n) with x_k ~ g(. | x, y), for x (B, n).

    proposal: "prior", "ekf", "ukf", "optimal" (only for a measurement that is linear in the state), or a function
    (x, y, motion, sensor, rng) -> (x_k (B, n), log factor (B,)).  "ekf", "ukf" and "optimal" take the process noise to
    be N(0, Q); "optimal" takes the measurement noise to be N(0, R).  ValueError for another name.
    """
    if callable(proposal):
        return _custom(proposal, y, motion, sensor)
    if proposal == "prior":
        return _prior(y, motion, sensor)
    if proposal not in _MODELS:
        raise ValueError(f"proposal: expected prior, {', '.join(_MODELS)} or a function, got {proposal!r}")
    return _gaussian(proposal, y, motion, sensor)


def _custom(proposal: Proposal, y: Array, motion: Motion, sensor: Sensor) -> BlockProposal:
    def draw(x: Array, rng: "np.random.Generator", out: Array) -> Array:
        out[...], log_factor = proposal(x, y, motion, sensor, rng)
        return log_factor

    return draw


def _prior(y: Array, motion: Motion, sensor: Sensor) -> BlockProposal:
    """g = p(x_k | x_{k-1}): the factor is p(y | x_k)."""
    sampler = motion.sampler() if hasattr(motion, "sampler") else None

    def draw(x: Array, rng: "np.random.Generator", out: Array) -> Array:
        if sampler is None:
            out[...] = motion.sample(x, rng)
        else:
            sampler(x, box_muller(rng, x.shape[1], len(x)), out)
        return sensor.log_likelihood(y, out)

    return draw


def _gaussian(name: str, y: Array, motion: Motion, sensor: Sensor) -> BlockProposal:
    """e = J^-1 G' Omega^-1 nu + U^-T xi with J = U U', xi ~ N(0, I)."""
    model, exact = _MODELS[name], name == "optimal"
    L = cholesky_psd(motion.Q)
    L = L[:, L.any(axis=0)]

    def draw_rows(x: Array, rng: "np.random.Generator", out: Array) -> Array:
        fx = motion.f(x)
        nu, G, Omega = model(y, fx, L, sensor)
        V = np.linalg.cholesky(Omega)
        W = np.linalg.solve(V, G)
        z = np.linalg.solve(V, nu[..., None])
        U = np.linalg.cholesky(np.eye(L.shape[1]) + W.mT @ W)
        xi = rng.standard_normal((len(x), L.shape[1]))
        e = np.linalg.solve(U.mT, np.linalg.solve(U, W.mT @ z) + xi[..., None])[..., 0]
        out[...] = fx + e @ L.T
        if exact:
            return _log_normal(nu, G @ G.mT + Omega)       # p(y | x_{k-1}): the same wherever x_k falls
        log_g = -0.5 * np.square(xi).sum(axis=-1) + np.log(np.diagonal(U, axis1=-2, axis2=-1)).sum(axis=-1)
        return sensor.log_likelihood(y, out) - 0.5 * np.square(e).sum(axis=-1) - log_g

    def draw(x: Array, rng: "np.random.Generator", out: Array) -> Array:
        log_factor = np.empty(len(x))
        for start in range(0, len(x), _ROWS):              # several small matrices for each particle: stay in the cache
            rows = slice(start, start + _ROWS)
            log_factor[rows] = draw_rows(x[rows], rng, out[rows])
        return log_factor

    return draw


def _extended(y: Array, fx: Array, L: Array, sensor: Sensor) -> LocalModel:
    """y = h(f) + h'(f) L e + v."""
    return LocalModel(sensor.innovation(y, sensor.h(fx)), sensor.jacobian(fx) @ L, sensor.R)


def _unscented(y: Array, fx: Array, L: Array, sensor: Sensor) -> LocalModel:
    """y = y_bar + P_ye e + v, V(v) = R + what is left: the line through the sigma points of e ~ N(0, I).

    MAT (3.15) and (3.17) with kappa = max(3 - r, 0), so that no weight is negative.
    """
    r = L.shape[1]
    kappa = max(3 - r, 0)
    E = np.sqrt(r + kappa) * np.vstack([np.zeros(r), np.eye(r), -np.eye(r)])
    weights = np.array([kappa] + [0.5] * (2 * r)) / (r + kappa)
    Y = sensor.h(fx[:, None, :] + E @ L.T)
    centre = Y[:, :1]
    dY = sensor.innovation(Y, centre)                      # differences from the centre: angles stay together
    shift = np.einsum("p,bpm->bm", weights, dY)
    dY = dY - shift[:, None, :]
    G = np.einsum("p,bpm,pr->bmr", weights, dY, E)
    rest = dY - E @ G.mT
    Omega = sensor.R + np.einsum("p,bpm,bpk->bmk", weights, rest, rest)
    return LocalModel(sensor.innovation(y, centre[:, 0] + shift), G, Omega)


def _linear(y: Array, fx: Array, L: Array, sensor: Sensor) -> LocalModel:
    """y = H f + H L e + v, after checking at the particles and one standard deviation away that h is linear."""
    moved = fx + L.sum(axis=1)
    H = sensor.jacobian(fx)
    bend = sensor.innovation(sensor.h(moved), sensor.h(fx)) - np.matvec(H, moved - fx)
    size = np.abs(H).max(initial=0.0)
    if np.abs(H - H[:1]).max() > 1e-9 * size or np.abs(bend).max() > 1e-9 * size * np.abs(moved).max():
        raise ValueError("proposal: 'optimal' expects a measurement that is linear in the state; use 'ekf' or 'ukf'")
    return _extended(y, fx, L, sensor)


def _log_normal(nu: Array, S: Array) -> Array:
    """log N(nu; 0, S): nu (B, m), S (B, m, m)."""
    B = np.linalg.cholesky(S)
    z = np.linalg.solve(B, nu[..., None])[..., 0]
    log_det = 2.0 * np.log(np.diagonal(B, axis1=-2, axis2=-1)).sum(axis=-1)
    return -0.5 * (np.square(z).sum(axis=-1) + log_det + nu.shape[-1] * np.log(2.0 * np.pi))


_MODELS = {"ekf": _extended, "ukf": _unscented, "optimal": _linear}
