"""Plots, readouts and formulas of the lesson on geodetic coordinates."""

from typing import TYPE_CHECKING

import numpy as np

from core.frames import dcm_enu_from_ecef
from core.geodesy import prime_vertical_radius
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.geodetic import Result

LEAST_DEG = 1e-12                            # smaller errors are rounding


def figures(r: "Result", step: int) -> dict[str, "go.Figure"]:
    """Geodetic minus geocentric latitude, drawn and real, and the error of the iterates."""
    lat_deg, here = np.linspace(-90.0, 90.0, len(r.difference_deg)), float(np.degrees(r.place.lat_rad))
    shown = {"cursor": here, "x_range": (-90.0, 90.0)}
    k = np.arange(len(r.error_deg))
    iteration = plot.chart(
        plot.line("drawn", k, np.maximum(r.error_deg, LEAST_DEG), "posterior", markers=True),
        plot.line("wgs84", k, np.maximum(r.error_wgs84_deg, LEAST_DEG), "reference", dash=True, markers=True),
        cursor=float(step), log_y=True, y_range=(LEAST_DEG / 3.0, 100.0))
    iteration.layout.yaxis.exponentformat = "power"          # 10^-9, not 1n: these are no prefixes of degrees
    return {
        "difference": plot.chart(plot.line("difference", lat_deg, r.difference_deg, "posterior"), **shown),
        "wgs84": plot.chart(plot.line("wgs84", lat_deg, r.difference_wgs84_arcmin, "posterior"), **shown),
        "iteration": iteration,
    }


def readouts(r: "Result", step: int) -> list[Readout]:
    lat, lon, h = (float(v) for v in r.place)
    off = float(np.degrees(lat) - np.degrees(r.geocentric_rad))
    return [
        Readout("lat", float(np.degrees(lat)), "°", digits=8),
        Readout("lon", float(np.degrees(lon)), "°", digits=8),
        Readout("h", round(h, 6) / 1e3 + 0.0, "km", digits=6),
        Readout("geocentric", float(np.degrees(r.geocentric_rad)), "°", digits=8),
        Readout("difference", off if abs(off) > 1e-10 else 0.0, "°"),
        Readout("wgs84", r.here_wgs84_arcmin, "′"),
        Readout("axis", r.ellipsoid.e2 * float(prime_vertical_radius(lat, r.ellipsoid)) * abs(np.sin(lat)) / 1e3, "km"),
        Readout("error", float(r.error_deg[step]) if r.error_deg[step] > LEAST_DEG else 0.0, "°", digits=2),
    ]


def equations(r: "Result", step: int) -> list[Equation]:
    """From Cartesian to geodetic coordinates by iterate `step`, and the axes East, North, Up."""
    a, e2 = r.ellipsoid.a_m, r.ellipsoid.e2
    rho, z = float(np.hypot(*r.r_m[:2])), float(r.r_m[2])
    lat, lon = float(r.place.lat_rad), float(r.place.lon_rad)
    before = float(r.steps.lat_rad[max(step - 1, 0)])
    N = float(prime_vertical_radius(before, r.ellipsoid))
    return [
        Equation("constants", ("a =", a, r"\mathrm{m},\quad e^2 = f(2-f) =", e2), digits=10),
        Equation("r", (r"\mathbf{r}^E =", np.round(r.r_m, 4) + 0.0, r"\mathrm{m},\quad \rho = \sqrt{x^2+y^2} =", rho,
                       r"\mathrm{m}"), digits=10),
        Equation("longitude", (r"\lambda = \mathrm{atan2}(y, x) =", float(np.degrees(lon)), r"^\circ"), digits=9),
        Equation("radius", (r"N(\varphi_{k-1}) = a/\sqrt{1-e^2\sin^2\varphi_{k-1}} =", N, r"\mathrm{m}") if step else
                 (r"N(\varphi) = a/\sqrt{1-e^2\sin^2\varphi}",), current=step > 0, digits=8),
        Equation("aim", (r"z_k = -e^2 N \sin\varphi_{k-1} =", float(r.steps.axis_z_m[step]), r"\mathrm{m}") if step else
                 (r"z_0 = 0\ \mathrm{m}",), current=True, digits=8),
        Equation("latitude", (r"\varphi_k = \mathrm{atan2}(z - z_k, \rho) =",
                              float(np.degrees(r.steps.lat_rad[step])), r"^\circ"), current=True, digits=9),
        Equation("height", (r"h_k = \rho\cos\varphi_k + z\sin\varphi_k - a\sqrt{1-e^2\sin^2\varphi_k} =",
                            float(np.round(r.steps.h_m[step], 4)) + 0.0, r"\mathrm{m}"), current=True, digits=8),
        Equation("back", (r"\mathbf{r}^E = [\,(N+h)\cos\varphi\cos\lambda,\ (N+h)\cos\varphi\sin\lambda,\ "
                          r"(N(1-e^2)+h)\sin\varphi\,]^T",)),
        Equation("geocentric", (r"\psi = \mathrm{atan2}(z, \rho) =", float(np.degrees(np.arctan2(z, rho))),
                                r"^\circ"), digits=9),
        Equation("enu", (r"C_E^L =", np.round(dcm_enu_from_ecef(lat, lon), 12) + 0.0), digits=4),
    ]
