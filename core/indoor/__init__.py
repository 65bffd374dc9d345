"""Positioning on the graph of a building: the map, the walk on it, signal strengths, and the filters.  GBPF.

The modules in the order of reading: `graph` (the map), `link_length` and `choice` (where people go), `walk`, `cloud`,
`motion` and `area_motion` (how they move), `signal` and `learning` (what they hear), `filter` and `tracking` (the
graph-based particle filter), `point_estimates`, `kalman_filters` (the comparison), `routes` and `simulate` (ground
truth), `chain` and `density` (the theory behind), `examples` (maps).
"""

from core.indoor.chain import constrained_transition, link_chain, time_shares
from core.indoor.choice import categorical, choice_probabilities, trained
from core.indoor.cloud import Cloud, directions, place, scatter
from core.indoor.density import disc_probability, mixed_measure, sample_measure, straighten
from core.indoor.discs import inscribed_disc, is_open_area
from core.indoor.examples import hall_map, office_building, room_corridor, tree_map
from core.indoor.filter import Belief, Recovery, Step, start, step
from core.indoor.graph import Area, FloorGraph, Link, Node
from core.indoor.kalman_filters import Grid, Track, cpkf, cvkf, position_fixes
from core.indoor.learning import coverage_area, fit_path_loss, locate_access_point
from core.indoor.link_length import objects_behind, total_link_length, total_link_lengths
from core.indoor.motion import Choices, advance
from core.indoor.point_estimates import Estimates, Projection, estimates, floor_rate, object_weights, project
from core.indoor.replicas import Replicas, replicate
from core.indoor.routes import Truth, random_stops, shortest_route, walk_route
from core.indoor.signal import AccessPoints, RadioMap, radio_map
from core.indoor.simulate import simulate_scans
from core.indoor.tracking import Run, run
from core.indoor.walk import Walk

__all__ = [
    "AccessPoints", "Area", "Belief", "Choices", "Cloud", "Estimates", "FloorGraph", "Grid", "Link", "Node",
    "Projection", "RadioMap", "Recovery", "Replicas", "Run", "Step", "Track", "Truth", "Walk", "advance", "categorical",
    "choice_probabilities", "constrained_transition", "coverage_area", "cpkf", "cvkf", "directions", "disc_probability",
    "estimates", "fit_path_loss", "floor_rate", "hall_map", "inscribed_disc", "is_open_area", "link_chain",
    "locate_access_point", "mixed_measure", "object_weights", "objects_behind",
    "office_building", "place", "position_fixes", "project",
    "radio_map", "random_stops", "replicate", "room_corridor", "run", "sample_measure", "scatter", "shortest_route",
    "simulate_scans", "start", "step", "straighten", "time_shares", "total_link_length", "total_link_lengths",
    "trained", "tree_map", "walk_route",
]  # fmt: skip
