"""The step of the graph-based particle filter as one would first write it: a Python loop over the particles."""

import math
import random

from core.indoor import FloorGraph, choice_probabilities


class Walker:
    """One particle: on a link (offset, direction) or in an area (x, y, heading)."""

    __slots__ = ("direction", "goal", "heading", "held", "object", "offset", "speed", "stopped", "wait", "x", "y", "z")

    def copy(self):
        new = Walker()
        for name in Walker.__slots__:
            setattr(new, name, getattr(self, name))
        return new


class Loop:
    """All that can be looked up is prepared; each particle is then moved and weighed by itself with `math`."""

    def __init__(self, graph: FloorGraph, points, walk, seed: int):
        self.graph, self.points, self.walk, self.random = graph, points, walk, random.Random(seed)
        self.links = {o: (*l.nodes, l.length_m, l.kind) for o, l in graph.links.items()}
        self.choices = {}
        for o in graph.object_ids:
            for n in graph.nodes_of(o):
                p = choice_probabilities(graph, n, o, walk.l_max_m, rule=walk.rule)
                self.choices[n, o] = list(p.items())
        self.edges = {}
        for o, a in graph.areas.items():
            P = a.polygon.tolist()
            self.edges[o] = []
            for (x1, y1), (x2, y2) in zip(P, P[1:] + P[:1], strict=True):
                length = math.hypot(x2 - x1, y2 - y1)
                tx, ty = (x2 - x1) / length, (y2 - y1) / length
                self.edges[o].append((x1, y1, tx, ty, length, ty, -tx))
        self.inward = {(o, n): self._inward(o, n) for o, a in graph.areas.items() for n in a.accessor_nodes}
        self.stations = list(zip(points.xy_m.tolist(), points.floor.tolist(), points.power_dbm.tolist(),
                                 points.exponent.tolist(), points.sigma_db.tolist(), strict=True))

    def _inward(self, o, n):
        """Direction of the bisector of the border at a door."""
        x, y, _ = self.graph.nodes[n]
        u, v = 0.0, 0.0
        for x1, y1, tx, ty, length, nx, ny in self.edges[o]:
            s = min(max((x - x1) * tx + (y - y1) * ty, 0.0), length)
            if math.hypot(x1 + s * tx - x, y1 + s * ty - y) < 1e-6:
                u, v = u - nx, v - ny
        return math.atan2(v, u)

    def step(self, walkers, y, dt):
        """Moves, weighs and resamples (systematic) all particles."""
        logs = []
        moved = []
        for w in walkers:
            w = w.copy()
            self.move(w, dt)
            logs.append(self.log_likelihood(w, y))
            moved.append(w)
        top = max(logs)
        weights = [math.exp(v - top) for v in logs]
        total = sum(weights)
        N = len(moved)
        new, cumulative, j = [], weights[0] / total, 0
        u = self.random.random()
        for i in range(N):
            while cumulative < (i + u) / N and j < N - 1:
                j += 1
                cumulative += weights[j] / total
            new.append(moved[j].copy())
        n_eff = total * total / sum(w * w for w in weights)
        mean = [sum(w * getattr(p, c) for w, p in zip(weights, moved, strict=True)) / total for c in ("x", "y")]
        return new, n_eff, mean

    def log_likelihood(self, w, y):
        h = self.points.floor_height_m
        total, floor = 0.0, self.floor(w)
        for ((x, v), f, A, n, sigma), value in zip(self.stations, y, strict=True):
            if value != value:
                continue
            squares = (w.x - x) ** 2 + (w.y - v) ** 2 + (w.z - h * f) ** 2
            mu = A - 5.0 * n * math.log10(max(squares, 1.0)) - self.points.floor_loss_db * abs(floor - f)
            z = (value - mu) / sigma
            total -= 0.5 * z * z + math.log(sigma) + 0.9189385332046727
        return total

    def floor(self, w):
        link = self.links.get(w.object)
        if link is None:
            return self.graph.areas[w.object].floor
        return self.graph.nodes[link[0] if w.offset <= 0.5 * link[2] else link[1]].floor

    def move(self, w, dt):
        k, r = self.walk, self.random
        w.speed = min(max(w.speed + k.sigma_v_mps * math.sqrt(dt) * r.gauss(0, 1), k.v_min_mps), k.v_max_mps)
        if w.stopped:
            if r.random() < -math.expm1(-k.go_rate_hz * dt):
                w.stopped, w.speed = False, r.uniform(*k.start_speeds_mps)
        elif r.random() < -math.expm1(-k.stop_rate_hz * dt):
            w.stopped = True
        if w.stopped:
            w.speed = 0.0
        if w.object in self.links and self.links[w.object][3] != "lift":
            if r.random() < -math.expm1(-k.turn_rate_hz * dt):
                w.direction = -w.direction
        elif w.object not in self.links:
            w.heading += k.sigma_heading_rad * math.sqrt(dt) * r.gauss(0, 1)
        left, bounces = dt, 0
        if w.wait > 0.0:
            passed = min(w.wait, left)
            w.wait, left = w.wait - passed, left - passed
        while left > 0.0:
            if w.object in self.links:
                left = self.along(w, left)
            else:
                left, bounces = self.across(w, left, bounces)
        if w.object in self.links:
            a, b, length, _ = self.links[w.object]
            p, q, t = self.graph.nodes[a], self.graph.nodes[b], w.offset / length
            h = self.graph.floor_height_m
            w.x, w.y = p.x_m + t * (q.x_m - p.x_m), p.y_m + t * (q.y_m - p.y_m)
            w.z = h * (p.floor + t * (q.floor - p.floor))

    def along(self, w, left):
        a, b, length, kind = self.links[w.object]
        rate = {"corridor": w.speed, "stairs": w.speed * self.walk.stairs_factor}.get(kind, self.walk.lift_speed_mps)
        to_end = length - w.offset if w.direction > 0 else w.offset
        if rate * left <= to_end:
            w.offset += w.direction * rate * left
            return 0.0
        left -= to_end / rate
        n = b if w.direction > 0 else a
        return self.enter(w, n, self.draw(n, w.object), left)

    def draw(self, n, o):
        u, total = self.random.random(), 0.0
        for q, p in self.choices[n, o]:
            total += p
            if u < total:
                return q
        return q

    def enter(self, w, n, o, left):
        w.object, w.goal, w.held = o, None, ()
        if o in self.links:
            a, _, length, kind = self.links[o]
            w.offset, w.direction = (0.0, 1) if n == a else (length, -1)
            if kind == "lift":
                w.wait = self.random.expovariate(1.0 / self.walk.lift_wait_s)
                passed = min(w.wait, left)
                w.wait, left = w.wait - passed, left - passed
        else:
            w.x, w.y, _ = self.graph.nodes[n]
            w.z = self.graph.floor_height_m * self.graph.areas[o].floor
            w.heading = self.inward[o, n] + self.random.gauss(0, self.walk.entry_sigma_rad)
            w.held = (n,)
        return left

    def across(self, w, left, bounces):
        if w.speed == 0.0:
            return 0.0, bounces
        r, nodes = self.walk.capture_radius_m, self.graph.nodes
        if w.goal is not None:
            n, o = w.goal
            dx, dy = nodes[n].x_m - w.x, nodes[n].y_m - w.y
            distance = math.hypot(dx, dy)
            if w.speed * left >= distance:
                return self.enter(w, n, o, left - distance / w.speed), bounces
            share = w.speed * left / distance
            w.x, w.y = w.x + share * dx, w.y + share * dy
            return 0.0, bounces
        w.held = tuple(n for n in w.held if math.hypot(nodes[n].x_m - w.x, nodes[n].y_m - w.y) <= 2 * r)
        ux, uy = math.cos(w.heading), math.sin(w.heading)
        reach = w.speed * left
        wall, normal = self.hit(w.object, w.x, w.y, reach * ux, reach * uy)
        best, event = min(wall, 1.0) * reach, None
        for n in self.graph.areas[w.object].accessor_nodes:
            if n in w.held:
                continue
            x, y = nodes[n].x_m - w.x, nodes[n].y_m - w.y
            squares, along = x * x + y * y, x * ux + y * uy
            room = r * r - squares + along * along
            if squares <= r * r:
                t = 0.0
            elif room >= 0.0 and along > 0.0:
                t = along - math.sqrt(room)
            else:
                continue
            if t <= best and (event is None or t < best):
                px, py = w.x + t * ux, w.y + t * uy
                dx, dy = nodes[n].x_m - px, nodes[n].y_m - py
                if self.hit(w.object, px, py, 0.999999 * dx, 0.999999 * dy)[0] > 1.0:
                    best, event = t, n
        w.x, w.y = w.x + best * ux, w.y + best * uy
        if event is not None:
            o = self.draw(event, w.object)
            w.held = (*w.held, event)
            w.goal = None if o == w.object else (event, o)
            return left - best / w.speed, bounces
        if wall <= 1.0:
            dot = ux * normal[0] + uy * normal[1]
            w.heading = math.atan2(uy - 2 * dot * normal[1], ux - 2 * dot * normal[0])
            bounces += 1
            if bounces >= 10:
                w.heading = self.random.uniform(-math.pi, math.pi)
                return 0.0, bounces
            return left - best / w.speed, bounces
        return 0.0, bounces

    def hit(self, o, x, y, dx, dy):
        first, normal = math.inf, None
        for x1, y1, tx, ty, length, nx, ny in self.edges[o]:
            s0 = nx * (x - x1) + ny * (y - y1)
            speed = nx * dx + ny * dy
            if s0 <= 1e-9 and s0 + speed > 0.0 and speed > 0.0:
                t = max(-s0, 0.0) / speed
                along = (x + t * dx - x1) * tx + (y + t * dy - y1) * ty
                if -1e-9 <= along <= length + 1e-9 and t < first:
                    first, normal = t, (nx, ny)
        return first, normal
