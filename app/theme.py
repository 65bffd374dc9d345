"""Roles become colours here, in light and dark; safe for colour-blind viewers (after Okabe and Ito).

Roles that meet in one picture differ in lightness as well as in hue.
"""

from dataclasses import dataclass

from lessons.kit.roles import ROLES

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of one appearance."""

    name: str
    background: Rgb
    text: Rgb
    grid: Rgb
    roles: dict[str, Rgb]

    def color(self, role: str, fade: float = 0.0) -> Rgb:
        """The role's colour, mixed with the background by `fade` (0: full, 1: invisible)."""
        base = self.roles[role]
        return tuple(round(c + (b - c) * fade) for c, b in zip(base, self.background, strict=True))  # type: ignore


LIGHT = Theme(
    "light", background=(255, 255, 255), text=(28, 28, 30), grid=(226, 228, 232),
    roles={
        "truth": (20, 20, 22), "measurement": (213, 94, 0), "prior": (86, 170, 225), "likelihood": (0, 140, 104),
        "posterior": (0, 84, 166), "innovation": (190, 30, 120), "linearised": (222, 143, 5),
        "monte_carlo": (132, 136, 142), "sigma": (140, 60, 170), "kf": (0, 84, 166), "ekf": (222, 143, 5),
        "ukf": (0, 140, 104), "pf": (120, 82, 190), "grid": (0, 130, 145), "mixture": (150, 85, 40),
        "station": (28, 28, 30), "satellite": (90, 96, 104), "handle": (214, 40, 57), "axis_x": (200, 40, 40),
        "axis_y": (24, 140, 60), "axis_z": (30, 90, 210), "frame_a1": (96, 100, 108), "frame_a2": (0, 114, 178),
        "rotation": (213, 94, 0), "vector": (140, 60, 170), "reference": (110, 116, 124), "muted": (165, 170, 178),
        "warning": (196, 0, 26), "link": (52, 104, 150), "area": (118, 168, 84), "accessor": (20, 120, 60),
    },
)

DARK = Theme(
    "dark", background=(20, 20, 20), text=(233, 233, 236), grid=(52, 54, 58),
    roles={
        "truth": (240, 240, 242), "measurement": (255, 140, 66), "prior": (120, 196, 245), "likelihood": (50, 200, 150),
        "posterior": (82, 152, 255), "innovation": (255, 112, 190), "linearised": (255, 186, 66),
        "monte_carlo": (150, 154, 160), "sigma": (210, 140, 236), "kf": (82, 152, 255), "ekf": (255, 186, 66),
        "ukf": (50, 200, 150), "pf": (172, 146, 255), "grid": (64, 200, 214), "mixture": (214, 148, 100),
        "station": (233, 233, 236), "satellite": (180, 186, 194), "handle": (255, 92, 105), "axis_x": (255, 104, 104),
        "axis_y": (84, 206, 120), "axis_z": (110, 160, 255), "frame_a1": (170, 175, 184), "frame_a2": (86, 180, 233),
        "rotation": (255, 140, 66), "vector": (210, 140, 236), "reference": (150, 156, 164), "muted": (105, 110, 118),
        "warning": (255, 90, 100), "link": (116, 168, 214), "area": (132, 186, 100), "accessor": (104, 220, 140),
    },
)

THEMES = {"light": LIGHT, "dark": DARK}

for _theme in THEMES.values():
    if set(_theme.roles) != set(ROLES):
        raise ValueError(f"theme {_theme.name}: colours and roles differ: {set(_theme.roles) ^ set(ROLES)}")


def css(rgb: Rgb, alpha: float = 1.0) -> str:
    """A colour for HTML and plotly."""
    return "#{:02x}{:02x}{:02x}".format(*rgb) if alpha >= 1 else f"rgba({rgb[0]},{rgb[1]},{rgb[2]},{alpha:g})"
