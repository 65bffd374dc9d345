"""How a density on a grid moves: exact shears and scalings, additive normal noise, grids that follow the density.

A linear motion x' = Phi x + w is taken apart: Phi = permutation x (unit lower) x diagonal x (unit upper).  A diagonal
factor only stretches the axes, a triangular one shifts each line of cells by its own distance, and w is a convolution;
shifts and convolutions are multiplications of Fourier transforms.  For densities that are resolved by the grid (a
standard deviation of about 1.5 cells or more) this is exact to many digits; negative ripples beside an edge that is
sharper than the grid are cut off.  Axes grow so that nothing is lost or wrapped round; `regrid` cuts them.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.grid_density import GridDensity, cells, checked_axes
from core.grid_estimates import moments
from core.types import Array, Motion

_REACH = 7.0                                              # noise beyond this many standard deviations is left out


class Prediction(NamedTuple):
    """posterior at k - 1; moved: the law of f(x); blurred: of f(x) + w; prior: the same on the axes wanted.

    lost: the probability outside those axes.
    """

    posterior: GridDensity
    moved: GridDensity
    blurred: GridDensity
    prior: GridDensity
    lost: float


def predict(
    posterior: GridDensity, motion: Motion, *, axes: tuple[ArrayLike, ...] | None = None, moving: bool = False,
    width: float = 5.0,
) -> GridDensity:
    """p(x_k) = int p_w(x_k - f(x_{k-1})) p(x_{k-1}) dx_{k-1}  (Chapman-Kolmogorov).

    motion: linear (`core.motion`), or any with f and additive normal noise Q.  The result lies on `axes`; if not
    given on the posterior's own, or with `moving` on as many cells around its own mean, `width` standard deviations
    to each side.  ValueError for sizes that do not match or a singular Phi.  MAT 3.4; KF thesis (2.10).

    >>> from core.motion import constant_position
    >>> p = GridDensity(cells(-10.0, 10.0, 40), np.eye(40)[20])
    >>> moments(predict(p, constant_position(1.0, 2.0, 1))).cov.round(3).tolist()
    [[4.0]]
    """
    return prediction(posterior, motion, axes=axes, moving=moving, width=width).prior


def prediction(
    posterior: GridDensity, motion: Motion, *, axes: tuple[ArrayLike, ...] | None = None, moving: bool = False,
    width: float = 5.0,
) -> Prediction:
    """`predict` with everything on the way."""
    if len(motion.Q) != posterior.dim:
        raise ValueError(f"motion: expected {posterior.dim} components as the grid has, got {len(motion.Q)}")
    Phi = getattr(motion, "Phi", None)
    moved = deposit(posterior, motion) if Phi is None else transport(posterior, Phi)
    blurred = blur(moved, motion.Q)
    if axes is None:
        axes = follow(blurred, posterior.weights.shape, width) if moving else posterior.axes
    prior, lost = regrid(blurred, axes)
    return Prediction(posterior, moved, blurred, prior, lost)


def transport(p: GridDensity, Phi: ArrayLike) -> GridDensity:
    """The law of Phi x.  Phi (d, d) invertible -> a density on axes that hold all of it.  MAT 3.1, 3.4.

    >>> transport(GridDensity([1.0, 2.0], [1.0, 3.0]), [[-2.0]]).axes[0].tolist()
    [-4.0, -2.0]
    """
    Phi = finite("Phi", Phi, p.dim, p.dim)
    P, L, D, U = _factors(Phi)
    axes, w = list(p.axes), p.weights
    for i in range(p.dim):                                # x_i += sum_{j > i} U_ij x_j
        axes, w = _shear(axes, w, i, U[i])
    for i, d in enumerate(D):
        axes[i] = axes[i] * d if d > 0.0 else axes[i][::-1] * d
        w = w if d > 0.0 else np.flip(w, axis=i)
    for i in reversed(range(p.dim)):
        axes, w = _shear(axes, w, i, L[i])
    order = P.argmax(axis=1)
    return GridDensity(tuple(axes[i] for i in order), np.transpose(w, order))


def blur(p: GridDensity, Q: ArrayLike) -> GridDensity:
    """The law of x + w,  w ~ N(0, Q): p * N(0, Q).

    Q (d, d) positive semidefinite -> a density on longer axes with the same cells.  Components whose noise is
    independent are convolved one group after the other.  ValueError for an indefinite Q.  MAT 3.4.
    """
    Q = covariance("Q", Q, p.dim)
    h, w = p.spacing, p.weights
    margin = np.ceil(_REACH * np.sqrt(np.maximum(np.diagonal(Q), 0.0)) / h).astype(int)
    for group in _groups(Q):
        shape = [w.shape[i] + 2 * margin[i] for i in group]
        w = _convolve(w, group, shape, margin, Q[np.ix_(group, group)] / (h[group, None] * h[group]))
    axes = [_longer(a, k, k) for a, k in zip(p.axes, margin, strict=True)]
    return GridDensity(axes, np.maximum(w, 0.0))


def deposit(p: GridDensity, motion: Motion) -> GridDensity:
    """The law of f(x) for any f: each cell's weight is shared among the 2^d cells around f(x_i).

    The shares keep the mean exact and add at most a quarter of a squared cell to the variances.  -> a density on axes
    with the same cells that hold all of it.  MAT 3.4.
    """
    x = motion.f(p.points)
    if x.shape != (*p.weights.shape, p.dim) or not np.isfinite(x).all():
        raise ValueError(f"motion: expected finite states of shape {(*p.weights.shape, p.dim)}, got shape {x.shape}")
    used = p.weights > 0.0
    w, flat, shape, axes = p.weights[used], np.zeros((1, used.sum()), dtype=np.intp), [], []
    shares = np.ones((1, len(w)))
    for a, h, z in zip(p.axes, p.spacing, np.moveaxis(x[used], -1, 0), strict=True):
        u = (z - a[0]) / h
        low = np.floor(u)
        first, n = int(low.min()), int(low.max() - low.min()) + 2
        k, t = (low - first).astype(np.intp), u - low
        flat = np.concatenate([flat * n + k, flat * n + k + 1])
        shares = np.concatenate([shares * (1.0 - t), shares * t])
        shape.append(n)
        axes.append(a[0] + h * (first + np.arange(n)))
    total = np.bincount(flat.ravel(), (shares * w).ravel(), minlength=int(np.prod(shape)))
    return GridDensity(axes, total.reshape(shape))


def follow(p: GridDensity, counts: tuple[int, ...] | None = None, width: float = 5.0) -> tuple[Array, ...]:
    """Axes that follow a density: mu_i +- width sd_i, `counts` cells each (as many as p has, if not given).

    Never narrower than 2 cells of p.  ValueError for width <= 0.
    """
    if not 0.0 < width < np.inf:
        raise ValueError(f"width: expected a positive number of standard deviations, got {width}")
    mean, P = moments(p)
    half = np.maximum(width * np.sqrt(np.diagonal(P)), p.spacing)
    counts = p.weights.shape if counts is None else counts
    return tuple(cells(m - s, m + s, n) for m, s, n in zip(mean, half, counts, strict=True))


def regrid(p: GridDensity, axes: tuple[ArrayLike, ...]) -> tuple[GridDensity, float]:
    """The same density at other cells: p(x) = sum_i p(x_i) prod_j sinc((x_j - x_ij) / h_j), renormalised; lost mass.

    axes: new axes, one per component.  Cells on the same lattice are copied as they are.  ValueError if nothing of
    the density lies on the new axes.
    """
    axes = checked_axes(axes)
    if len(axes) != p.dim:
        raise ValueError(f"axes: expected {p.dim}, got {len(axes)}")
    w, factor = p.weights, 1.0
    for i, (old, new, h) in enumerate(zip(p.axes, axes, p.spacing, strict=True)):
        offset = (new - old[0]) / h
        nearest = np.rint(offset).astype(int)
        if np.abs(offset - nearest).max() < 1e-6:
            inside = (nearest >= 0) & (nearest < len(old))
            rows = np.take(w, np.where(inside, nearest, 0), axis=i)
            w = rows * inside.reshape(-1, *(1,) * (p.dim - 1 - i))
        else:
            S = np.sinc(offset[:, None] - np.arange(len(old)))
            w = np.moveaxis(np.tensordot(S, w, axes=(1, i)), 0, i)
        factor *= (new[-1] - new[0]) / (len(new) - 1) / h
    w = np.maximum(w, 0.0)
    kept = float(w.sum()) * factor
    if not kept > 0.0:
        raise ValueError("axes: expected cells where the density is positive, got none")
    return GridDensity(axes, w), max(0.0, 1.0 - kept)


def _shear(axes: list[Array], w: Array, i: int, row: Array) -> tuple[list[Array], Array]:
    """x_i += sum_j row_j x_j over the other components: every line of cells along axis i moves by its own shift."""
    others = [j for j in np.flatnonzero(row) if j != i]
    if not others:
        return axes, w
    from scipy.fft import irfft, next_fast_len, rfft

    d, n = w.ndim, w.shape[i]
    h = (axes[i][-1] - axes[i][0]) / (n - 1)
    shift = sum(row[j] * axes[j].reshape(-1, *(1,) * (d - 1 - j)) for j in others) / h
    shift = np.broadcast_to(shift, (1,) * (d - shift.ndim) + shift.shape)
    first, last = int(np.floor(shift.min())), int(np.ceil(shift.max()))
    length = next_fast_len(n + last - first, real=True)
    k = (np.arange(length // 2 + 1) / length).reshape(-1, *(1,) * (d - 1 - i))
    turned = rfft(w, length, axis=i) * np.exp(-2j * np.pi * k * (shift - first))
    moved = irfft(turned, length, axis=i)
    moved = moved[(slice(None),) * i + (slice(n + last - first),)]
    return [_longer(a, -first, last) if j == i else a for j, a in enumerate(axes)], np.maximum(moved, 0.0)


def _convolve(w: Array, group: list[int], shape: list[int], margin: Array, Q: Array) -> Array:
    """w * N(0, Q) along the axes of the group, Q in cells; the result is longer by the margins."""
    from scipy.fft import irfftn, next_fast_len, rfftn

    lengths = tuple(next_fast_len(n, real=True) for n in shape)
    kernel = _kernel(lengths, Q.tobytes())
    spread = [1] * w.ndim
    for i, n in zip(group, kernel.shape, strict=True):
        spread[i] = n
    spectrum = rfftn(w, lengths, axes=group)
    spectrum *= kernel.reshape(spread)
    out = irfftn(spectrum, lengths, axes=group)
    for i, n in zip(group, shape, strict=True):           # what spreads to the left comes out at the far end
        out = np.take(out, np.arange(-margin[i], n - margin[i]) % out.shape[i], axis=i)
    return out


@lru_cache(maxsize=16)
def _kernel(lengths: tuple[int, ...], Q: bytes) -> Array:
    """exp(-1/2 k'Q k), the Fourier transform of N(0, Q) at the frequencies of `rfftn`; Q in cells."""
    d = len(lengths)
    C = np.frombuffer(Q).reshape(d, d)
    k = [2.0 * np.pi * (np.fft.rfftfreq(n) if i == d - 1 else np.fft.fftfreq(n)) for i, n in enumerate(lengths)]
    k = [f.reshape(-1, *(1,) * (d - 1 - i)) for i, f in enumerate(k)]
    out = np.exp(-0.5 * sum(C[i, j] * k[i] * k[j] for i in range(d) for j in range(d)))
    out.setflags(write=False)
    return out


def _groups(Q: Array) -> list[list[int]]:
    """The components with noise, in groups that are correlated with each other."""
    left, out = [i for i in range(len(Q)) if Q[i, i] > 0.0], []
    while left:
        group = {left[0]}
        while (more := {j for j in left if Q[list(group), j].any()} - group):
            group |= more
        out.append(sorted(group))
        left = [i for i in left if i not in group]
    return out


def _factors(Phi: Array) -> tuple[Array, Array, Array, Array]:
    """Phi = P (I + L) diag(D) (I + U): P a permutation, L and U strictly triangular."""
    from scipy.linalg import lu

    P, L, V = lu(Phi)
    D = np.diagonal(V)
    if np.abs(D).min() <= 1e-12 * np.abs(Phi).max():
        raise ValueError(f"Phi: expected an invertible matrix, got {Phi.tolist()}")
    return P, L - np.eye(len(D)), D, V / D[:, None] - np.eye(len(D))


def _longer(axis: Array, before: int, after: int) -> Array:
    """The axis with more cells (or fewer) at both ends."""
    h = (axis[-1] - axis[0]) / (len(axis) - 1)
    return axis[0] + h * np.arange(-before, len(axis) + after)
