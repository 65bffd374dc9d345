"""Maps for the tests: those of the oracle, and random ones with cycles, parallel links and areas."""

import numpy as np

from core.indoor import FloorGraph
from tests.oracle import entry

M0 = FloorGraph.from_dict(entry("G-01")["inputs"])
_m1 = entry("G-02")["inputs"]
M1 = FloorGraph.from_dict({"nodes": _m1["nodes"], "links": _m1["links"], "areas": {_m1["area"]["id"]: _m1["area"]}})


def random_map(seed: int, nodes: int = 12, extra: int = 4, areas: int = 2) -> FloorGraph:
    """A random tree of links, `extra` more links that make cycles, and areas spanned by three or four of the nodes."""
    rng = np.random.default_rng(seed)
    place = rng.permutation(100)[:nodes]
    xy = {f"n{k}": (float(7 * (p % 10)) + rng.uniform(0, 3), float(7 * (p // 10)) + rng.uniform(0, 3), 0)
          for k, p in enumerate(place)}
    links = {f"l{k}": (f"n{rng.integers(k)}", f"n{k}") for k in range(1, nodes)}
    for k in range(extra):
        a, b = rng.choice(nodes, 2, replace=False)
        links[f"x{k}"] = (f"n{a}", f"n{b}")
    spans = {}
    for k in range(areas):
        some = [f"n{j}" for j in rng.choice(nodes, int(rng.integers(3, 5)), replace=False)]
        centre = np.mean([xy[n][:2] for n in some], axis=0)
        some.sort(key=lambda n: np.arctan2(xy[n][1] - centre[1], xy[n][0] - centre[0]))
        spans[f"a{k}"] = ([xy[n][:2] for n in some], some)
    return FloorGraph.from_dict({"nodes": xy, "links": links, "areas": spans})
