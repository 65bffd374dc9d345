"""Linear motion models and their discretisation.  MAT 3.1, KF thesis 4.1."""

from dataclasses import dataclass, field

import numpy as np

from core import checks
from core.linalg import cholesky_psd
from core.noise import Sampler, linear_sampler
from core.stacks import apply, frozen, is_finite
from core.types import Array


@dataclass(frozen=True, slots=True, eq=False)
class LinearMotion:
    """x_k = Phi x_{k-1} + w,  w ~ N(0, Q).  MAT (3.4).

    Phi (n, n); Q (n, n) positive semidefinite, in the squares of the state's units per step.  Q may be singular
    (KF thesis, sigma_z = 0).  `root` is a lower triangular L with L L' = Q.  ValueError for any other shape or Q.

    >>> LinearMotion([[1, 1], [0, 1]], [[0.01, 0], [0, 0]]).f(np.array([3.0, 2.0]))
    array([5., 2.])
    """

    Phi: Array
    Q: Array
    root: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        Phi = checks.finite("Phi", self.Phi, None, None)
        if Phi.ndim != 2 or Phi.shape[0] != Phi.shape[1]:
            raise ValueError(f"Phi: expected a square matrix, got shape {Phi.shape}")
        Q = checks.covariance("Q", self.Q, len(Phi))
        if Q.ndim != 2:
            raise ValueError(f"Q: expected one matrix {Phi.shape}, got shape {Q.shape}")
        object.__setattr__(self, "Phi", frozen(Phi))
        object.__setattr__(self, "Q", frozen((Q + Q.T) / 2))
        object.__setattr__(self, "root", frozen(cholesky_psd(Q)))

    def f(self, x: Array) -> Array:
        """Phi x, shape (..., n)."""
        return apply(self.Phi, self._state(x))

    def jacobian(self, x: Array) -> Array:
        """Phi for every x: (..., n, n), one matrix repeated without copying."""
        x = self._state(x)
        return self.Phi if x.ndim == 1 else np.broadcast_to(self.Phi, x.shape[:-1] + self.Phi.shape)

    def sample(self, x: Array, rng: "np.random.Generator") -> Array:
        """Phi x + L u,  u ~ N(0, I): one draw for each x (..., n).

        The result has contiguous components, out[..., i], whatever the layout of x.
        """
        x = self._state(x)
        u = rng.standard_normal((x.shape[-1], *x.shape[:-1]))
        if x.ndim == 1:
            return self.Phi @ x + self.root @ u
        out = np.empty_like(u)
        # Row by row with the zeros left out: both matrices are sparse, and each component is a plain vector.
        for i, row in enumerate(out):
            terms = [(self.Phi[i, j], x[..., j]) for j in np.flatnonzero(self.Phi[i])]
            terms += [(self.root[i, j], u[j]) for j in np.flatnonzero(self.root[i])]
            row[...] = 0.0
            for factor, vector in terms:
                row += vector if factor == 1.0 else factor * vector
        return np.moveaxis(out, 0, -1)

    def sampler(self) -> Sampler:
        """(x, z, out): out = Phi x + L z, how the particle filter draws from this model block by block.

        x, out (B, n), z (n, B) float32 standard normals.
        """
        return linear_sampler(self.Phi, self.root)

    def _state(self, x: Array) -> Array:
        x = np.asarray(x, dtype=np.float64)
        if x.ndim == 0 or x.shape[-1] != len(self.Q):
            raise ValueError(f"x: expected shape (..., {len(self.Q)}), got {x.shape}")
        if not is_finite(x):
            checks.finite("x", x)
        return x


def constant_velocity(dt_s: float, sigma: float | Array, dim: int) -> LinearMotion:
    """Phi = [[I, dt I], [0, I]],  Q = [[dt^3/3 Qc, dt^2/2 Qc], [dt^2/2 Qc, dt Qc]],  Qc = diag(sigma^2).

    State: `dim` positions (m), then `dim` velocities (m/s).  sigma (m/s per square root of a second, the square root
    of the diffusion: the velocity's variance grows by sigma^2 each second) is a number or one per axis; 0 is allowed.
    ValueError for dt_s <= 0, sigma < 0 or dim < 1.  MAT (3.3) and what follows it; KF thesis (4.1)-(4.5).

    >>> constant_velocity(1.0, 1.0, 1).Q.round(4)
    array([[0.3333, 0.5   ],
           [0.5   , 1.    ]])
    """
    dt, variance = _step(dt_s), _diffusion("sigma", sigma, dim)
    Phi = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(dim))
    Q = np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.diag(variance))
    return LinearMotion(Phi, Q)


def constant_position(dt_s: float, sigma: float | Array, dim: int) -> LinearMotion:
    """Phi = I,  Q = dt diag(sigma^2).

    State: `dim` positions (m).  sigma (m per square root of a second) is a number or one per axis.  With a further
    axis for the clock bias it is the random-walk model of a static receiver.  MAT 3.1 without velocities.

    >>> constant_position(4.0, 0.5, 2).Q
    array([[1., 0.],
           [0., 1.]])
    """
    dt, variance = _step(dt_s), _diffusion("sigma", sigma, dim)
    return LinearMotion(np.eye(dim), dt * np.diag(variance))


def constant_velocity_with_clock(
    dt_s: float, sigma: float | Array, dim: int, bias_sigma: float, drift_sigma: float
) -> LinearMotion:
    """d(p, b) = (v, r) dt + (0, dbeta_b),  d(v, r) = dbeta.

    State: `dim` positions (m), clock bias b (m), `dim` velocities (m/s), clock drift r (m/s): the constant-velocity
    model with the clock as one more axis, so a `Pseudorange` finds its bias right after the position.  bias_sigma
    (m per square root of a second) is the clock's phase noise, drift_sigma (m/s per square root of a second) its
    frequency noise; both may be 0.  MAT (3.3), with the two-state clock of Brown & Hwang.
    """
    model = constant_velocity(dt_s, np.append(_spread("sigma", sigma, dim), drift_sigma), dim + 1)
    Q = model.Q.copy()
    Q[dim, dim] += dt_s * _diffusion("bias_sigma", bias_sigma, 1)[0]
    return LinearMotion(model.Phi, Q)


def discretise(F: Array, G: Array, Qc: Array, dt_s: float) -> LinearMotion:
    """Phi = exp(F dt),  Q = int_0^dt exp(F s) G Qc G' exp(F s)' ds, for dx = F x dt + G dbeta.

    F (n, n) per second; G (n, k); Qc (k, k) the diffusion of the Brownian motion beta.  Both matrices come from one
    exponential of [[-F, G Qc G'], [0, F']] dt (Van Loan 1978).  ValueError for shapes that do not fit.  MAT (3.3).

    >>> discretise([[0, 1], [0, 0]], [[0], [1]], [[1]], 1.0).Q.round(4)
    array([[0.3333, 0.5   ],
           [0.5   , 1.    ]])
    """
    from scipy.linalg import expm

    dt = _step(dt_s)
    F = checks.finite("F", F, None, None)
    n = len(F)
    if F.shape != (n, n):
        raise ValueError(f"F: expected a square matrix, got shape {F.shape}")
    G = checks.finite("G", G, n, None)
    Qc = checks.covariance("Qc", Qc, G.shape[1])
    M = expm(dt * np.block([[-F, G @ Qc @ G.T], [np.zeros((n, n)), F.T]]))
    Phi = M[n:, n:].T
    Q = Phi @ M[:n, n:]
    return LinearMotion(Phi, (Q + Q.T) / 2)


def _step(dt_s: float) -> float:
    dt = float(checks.finite("dt_s", dt_s))
    if dt <= 0:
        raise ValueError(f"dt_s: expected a positive number of seconds, got {dt}")
    return dt


def _spread(name: str, sigma: float | Array, dim: int) -> Array:
    if dim != int(dim) or dim < 1:
        raise ValueError(f"dim: expected a positive integer, got {dim}")
    sigma = checks.finite(name, sigma)
    if sigma.shape not in ((), (dim,)):
        raise ValueError(f"{name}: expected a number or {dim} of them, got shape {sigma.shape}")
    if (sigma < 0).any():
        raise ValueError(f"{name}: expected non-negative numbers, got {sigma.min()}")
    return np.broadcast_to(sigma, (dim,))


def _diffusion(name: str, sigma: float | Array, dim: int) -> Array:
    return np.square(_spread(name, sigma, dim))
