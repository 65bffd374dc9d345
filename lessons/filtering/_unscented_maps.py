"""The maps that the unscented transform is tried on, and the moments that they really have.

Every map takes points (..., 2) to points (..., 2); all images are in metres.
"""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.gaussian import affine
from core.linalg import cholesky_psd
from core.sensors import Range
from core.types import Array, Gaussian

if TYPE_CHECKING:
    from lessons.filtering.unscented import Params

SCALE_M = 100.0          # the polynomial is a pure number of a pure number: x and y are counted in this length
NODES = 48               # per axis: exact for polynomials of degree 95


class Map(NamedTuple):
    """f and its Jacobian, both with leading batch axes."""

    f: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]


def map_of(p: "Params") -> Map:
    """The chosen map at the chosen stations and degree."""
    if p.map == "polar":
        return polar(np.array(p.station_1))
    if p.map == "two_ranges":
        sensor = Range(np.array([p.station_1, p.station_2]), 1.0)
        return Map(sensor.h, sensor.jacobian)
    return polynomial(p.degree)


def prior_of(p: "Params") -> Gaussian:
    """The prior in the map's own input units.

    The handle of `mean` stands in the plane of positions.  For the polar map the prior is a law of range (m) and
    bearing (degrees, anticlockwise from the x axis) as seen from station 1, centred at what that station measures to
    the handle.
    """
    sigma = np.array([p.sigma_1, p.sigma_2])
    cov = sigma[:, None] * np.array([[1.0, p.correlation], [p.correlation, 1.0]]) * sigma
    mean = np.array(p.mean)
    if p.map == "polar":
        d = mean - p.station_1
        mean = np.array([np.linalg.norm(d), np.degrees(np.arctan2(d[1], d[0]))])
    return Gaussian(mean, cov)


def polar(station: Array) -> Map:
    """(r, theta) -> s + r [cos theta, sin theta]: r in m, theta in degrees from the x axis towards the y axis."""
    def f(x: Array) -> Array:
        r, theta = x[..., 0], np.radians(x[..., 1])
        return station + np.stack([r * np.cos(theta), r * np.sin(theta)], axis=-1)

    def jacobian(x: Array) -> Array:
        r, theta = x[..., 0], np.radians(x[..., 1])
        c, s = np.cos(theta), np.sin(theta)
        per_degree = np.pi / 180.0
        return np.stack([np.stack([c, -r * s * per_degree], axis=-1), np.stack([s, r * c * per_degree], axis=-1)],
                        axis=-2)

    return Map(f, jacobian)


def polynomial(degree: int) -> Map:
    """y_i = L (x_i / L)^d, component by component."""
    def f(x: Array) -> Array:
        return SCALE_M * (x / SCALE_M)**degree

    def jacobian(x: Array) -> Array:
        return degree * ((x / SCALE_M)**(degree - 1))[..., None] * np.eye(2)

    return Map(f, jacobian)


def linearised(m: Map, prior: Gaussian) -> Gaussian:
    """N(f(x), J P J'), J the Jacobian at the mean: what the EKF believes."""
    J = m.jacobian(prior.mean)
    return affine(prior, J, m.f(prior.mean) - J @ prior.mean)


def reference(f: Callable[[Array], Array], prior: Gaussian) -> Gaussian:
    """E f and V f by Gauss-Hermite quadrature: exact for the polynomials, to many digits where f is smooth."""
    z, w = _nodes(prior.mean.shape[-1])
    y = f(prior.mean + z @ cholesky_psd(prior.cov).T)
    mean = w @ y
    return Gaussian(mean, ((y - mean).T * w) @ (y - mean))


def weighted_cov(images: Array, weights: Array, mean: Array) -> Array:
    """sum w_i (f_i - mean)(f_i - mean)' as (3.16) has it, indefinite or not."""
    d = images - mean
    return (d.T * weights) @ d


@cache
def _nodes(n: int) -> tuple[Array, Array]:
    """Nodes (k, n) and weights (k,) of the product rule for N(0, I)."""
    z, w = np.polynomial.hermite_e.hermegauss(NODES)
    w = w / w.sum()
    if n == 1:
        return z[:, None], w
    return np.stack(np.meshgrid(z, z), axis=-1).reshape(-1, 2), np.outer(w, w).ravel()
