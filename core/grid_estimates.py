"""What to report from a density on a grid: moments, modes, quantiles, and the estimates that minimise a loss.

MAT 3.4, (3.18)-(3.20), 2.5.1, exercise 3.9.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.grid_density import GridDensity
from core.types import Array, Gaussian


class HitOrMiss(NamedTuple):
    """x (d,) with the most probability within delta; that probability; hits (n_1, ..., n_d): the same for each cell."""

    x: Array
    probability: float
    hits: Array


def marginal(p: GridDensity, components: Sequence[int]) -> GridDensity:
    """p(x_c) = int p(x) dx_others: the sum over the other axes.

    components: different indices from 0, rising -> a density on those axes.  ValueError for other indices.

    >>> marginal(GridDensity([[0, 1], [0, 1]], [[1, 2], [3, 4]]), [0]).weights.round(9).tolist()
    [0.3, 0.7]
    """
    c = [int(i) for i in components]
    if not c or c != sorted(set(c)) or c[0] < 0 or c[-1] >= p.dim:
        raise ValueError(f"components: expected rising indices from 0 to {p.dim - 1}, got {list(components)}")
    return GridDensity([p.axes[i] for i in c], _sum_to(p, c))


def moments(p: GridDensity) -> Gaussian:
    """mu = sum w_i x_i,  P = sum w_i (x_i - mu)(x_i - mu)': the MMSE estimate and its mean square error.

    -> mean (d,), cov (d, d).  For a smooth density that is small at the edges the sums equal the integrals almost to
    rounding.  MAT (3.20), 2.5.1.

    >>> moments(GridDensity([-1.0, 1.0], [1.0, 3.0])).mean.tolist()
    [0.5]
    """
    d = p.dim
    middle = np.array([0.5 * (a[0] + a[-1]) for a in p.axes])
    z = [a - m for a, m in zip(p.axes, middle, strict=True)]
    lines = [_sum_to(p, [i]) for i in range(d)]
    mean = np.array([w @ x for w, x in zip(lines, z, strict=True)])
    z = [x - m for x, m in zip(z, mean, strict=True)]
    P = np.diag([float(w @ np.square(x)) for w, x in zip(lines, z, strict=True)])
    for i in range(d):
        for j in range(i + 1, d):
            P[i, j] = P[j, i] = z[i] @ _sum_to(p, [i, j]) @ z[j]
    return Gaussian(middle + mean, P)


def mode(p: GridDensity) -> Array:
    """argmax p(x), the maximum a posteriori estimate, (d,).

    The best cell's centre, moved to the top of the quadric through the logarithms of its neighbours (exact for a
    normal law), or along each axis by a parabola where that quadric has no top nearby.  With several equal tops the
    first.  MAT 3.4 (MAP).

    >>> mode(GridDensity([0.0, 1.0, 2.0], np.exp(-0.5 * np.square([-1.25, -0.25, 0.75])))).round(9).tolist()
    [1.25]
    """
    logs = p.log_weights
    index = np.array(np.unravel_index(logs.argmax(), logs.shape))
    x, steps = np.array([a[i] for a, i in zip(p.axes, index, strict=True)]), np.eye(p.dim, dtype=int)
    inner = [i for i in range(p.dim) if 0 < index[i] < logs.shape[i] - 1]

    def at(*moves: Array) -> float:
        return logs[tuple(index + sum(moves))] - logs[tuple(index)]

    if not np.isfinite([at(s * steps[i]) for i in inner for s in (-1, 1)]).all():
        return x
    slope = np.array([0.5 * (at(steps[i]) - at(-steps[i])) for i in inner])
    bend = np.array([-at(steps[i]) - at(-steps[i]) for i in inner])
    moved = np.where(bend > 0.0, slope / np.where(bend > 0.0, bend, 1.0), 0.0)
    if len(inner) > 1:
        H = np.diag(bend)
        with np.errstate(invalid="ignore"):
            for a, i in enumerate(inner):
                for b, j in enumerate(inner[:a]):
                    corners = [s * at(steps[i], s * steps[j]) + s * at(-steps[i], -s * steps[j]) for s in (1, -1)]
                    H[a, b] = H[b, a] = -0.25 * sum(corners)
        if np.isfinite(H).all() and np.linalg.eigvalsh(H).min() > 1e-9 * np.abs(H).max():
            full = np.linalg.solve(H, slope)
            moved = full if np.abs(full).max() <= 2.0 else moved
    x[inner] += p.spacing[inner] * moved
    return x


def quantile(p: GridDensity, probability: ArrayLike, component: int = 0) -> Array:
    """x with P(x_c <= x) = probability, the distribution function rising linearly within each cell.

    probability (...) from 0 to 1 -> (...).  Where the distribution function is flat, the first such x; for 0
    the lower end of the support.  ValueError
    outside this range or for another component.

    >>> float(quantile(GridDensity([0.5, 1.5], [1.0, 1.0]), 0.25))
    0.5
    """
    q = finite("probability", probability)
    if np.any((q < 0.0) | (q > 1.0)) or not 0 <= component < p.dim:
        raise ValueError(f"expected probabilities from 0 to 1 and a component below {p.dim}, got {q} and {component}")
    a, h = p.axes[component], p.spacing[component]
    F = np.concatenate([[0.0], np.cumsum(_sum_to(p, [component]))])
    F /= F[-1]
    i = np.searchsorted(F, np.maximum(q, np.finfo(float).tiny), side="left")          # F[i - 1] < q <= F[i]
    return a[0] + h * (i - 1.5 + (q - F[i - 1]) / (F[i] - F[i - 1]))


def median(p: GridDensity) -> Array:
    """argmin E|x_c - x| for each component c: the point with half of the probability on either side, (d,).

    MAT (3.18) with L = |x|.

    >>> median(GridDensity([0.5, 1.5], [3.0, 1.0])).round(9).tolist()
    [0.666666667]
    """
    return np.array([float(quantile(p, 0.5, c)) for c in range(p.dim)])


def hit_or_miss(p: GridDensity, delta: float) -> HitOrMiss:
    """argmax P(|x - z| <= delta) over the cell centres z: the minimiser of the loss 1(|x - z| > delta).

    delta > 0 in the state's units (Euclidean norm).  As delta falls to the cell size this becomes the mode, as it
    grows beyond the support any point will do.  ValueError for delta <= 0.  MAT 3.4 (hit or miss), exercise 3.9.

    >>> hit_or_miss(GridDensity([0.0, 1.0, 2.0, 3.0, 4.0], [4.0, 0.0, 3.0, 2.5, 2.0]), 1.0).x.tolist()
    [3.0]
    """
    if not 0.0 < delta < np.inf:
        raise ValueError(f"delta: expected a positive number, got {delta}")
    from scipy.fft import irfftn, next_fast_len, rfftn

    reach = [min(int(delta / h * (1 + 1e-12)), n - 1) for h, n in zip(p.spacing, p.weights.shape, strict=True)]
    squares = sum(
        np.square(h * np.arange(-r, r + 1)).reshape(-1, *(1,) * (p.dim - 1 - i))
        for i, (h, r) in enumerate(zip(p.spacing, reach, strict=True))
    )
    ball = (squares <= delta * delta * (1 + 1e-12)).astype(np.float64)
    size = [next_fast_len(n + 2 * r, real=True) for n, r in zip(p.weights.shape, reach, strict=True)]
    both = irfftn(rfftn(p.weights, size) * rfftn(ball, size), size)
    hits = both[tuple(slice(r, r + n) for r, n in zip(reach, p.weights.shape, strict=True))]
    hits = np.clip(hits, 0.0, 1.0)
    index = np.unravel_index(np.argmax(hits > hits.max() - 1e-13), hits.shape)        # first of those equal but for
    return HitOrMiss(np.array([a[i] for a, i in zip(p.axes, index, strict=True)]), float(hits[index]), hits)  # rounding


def expected_loss(p: GridDensity, estimates: ArrayLike, loss: Callable[[Array], Array]) -> Array:
    """E(L(x - z)) = sum w_i L(x_i - z) for each estimate z.

    estimates (..., d); loss takes errors (..., d) and returns (...) -> (...).  MAT (3.18)-(3.19).

    >>> float(expected_loss(GridDensity([0.0, 1.0], [1.0, 1.0]), [0.25], lambda e: np.abs(e[..., 0])))
    0.5
    """
    z = finite("estimates", estimates, p.dim)
    points, w = p.points.reshape(-1, p.dim), p.weights.ravel()
    flat = [w @ loss(points - one) for one in z.reshape(-1, p.dim)]
    return np.array(flat).reshape(z.shape[:-1])


def mean_square_error(law: GridDensity | Gaussian, estimate: ArrayLike) -> Array:
    """E (x - z)(x - z)' = P + (mu - z)(mu - z)'  for any estimate z; least (P) for z = mu.

    law: a density on a grid or its moments; estimate (..., d) -> (..., d, d).  MAT 2.5.1, exercise 3.9.

    >>> mean_square_error(GridDensity([-1.0, 1.0], [1.0, 1.0]), [2.0]).tolist()
    [[5.0]]
    """
    mean, P = moments(law) if isinstance(law, GridDensity) else law
    e = mean - finite("estimate", estimate, len(mean))
    return P + e[..., :, None] * e[..., None, :]


def _sum_to(p: GridDensity, components: Sequence[int]) -> Array:
    """The weights summed over all other axes."""
    return p.weights.sum(axis=tuple(i for i in range(p.dim) if i not in components))
