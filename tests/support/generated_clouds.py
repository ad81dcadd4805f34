"""Scans of tanks that are no model of the package: rays against a wall and what stands before it.

    scene = make_scene(np.random.default_rng(1), pipes=4, stairs=True)
    scans = [take_scan(rng, scene, (1.0, -0.5, 1.6), 300_000) for ...]
    scene.radius(azimuth, height)

A ray ends where it first meets something: pipes, treads of a stair, posts of a railing, a nozzle
with its neck, bottom, roof, or the wall, whose radius is any function of azimuth and height about a
leaning axis. Ranges are noisy by distance and incidence, beams have a width, so that edges give
points between the near and the far surface, and a share of the points comes from a second surface.
"""

from dataclasses import dataclass, field

import numpy as np

FULL_TURN = 2 * np.pi
WALL, CLUTTER, MIXED, SECOND, FLOOR, MIRROR = range(6)
NEWTON = 12


@dataclass
class Scene:
    """An upright tank; z is 0 at its bottom. Lengths in m."""

    radius_m: float = 7.5
    courses: int = 4
    course_m: float = 2.0
    lean: tuple = (0.0015, -0.001)
    centre: tuple = (0.0, 0.0)
    step_m: tuple = ()  # of the radius of each course
    bulge_m: float = 0.005
    oval_m: tuple = ((2, 0.008, 0.4), (3, 0.004, 1.0), (7, 0.002, 2.0))
    seams: tuple = ((1.0, -0.03, 0.4), (4.2, 0.02, 0.5))  # azimuth, height of the ridge, width
    buckle: tuple | None = (3.0, 5.0, 0.06, 2.0)  # azimuth, z, depth, size
    pipes: list = field(default_factory=list)  # azimuth, stand-off of its face, radius, low, high
    stairs: tuple | None = None  # first azimuth, turn, stand-off, width of the band in z
    railing: float | None = None  # height above the bottom at which posts stand
    nozzles: list = field(default_factory=list)  # azimuth, z, radius, stand-off
    second: tuple | None = None  # share of the points, distance before the wall
    gap: tuple | None = None  # azimuths between which nothing is seen
    floor: object = None  # z of the bottom at x, y; None: level at 0
    pits: list = field(default_factory=list)  # x, y, radius, depth
    rods: list = field(default_factory=list)  # two ends (3,) and a radius: columns, coils
    boxes: list = field(default_factory=list)  # low corner (3,), high corner (3,)
    film: tuple | None = None  # x, y, radius, z of liquid, share of no return, of the mirror's
    line_noise: tuple | None = None  # sd in m, and degrees over which it hangs together, of a line
    alike: int = 1  # lines beside each other with the same noise
    is_sphere: bool = False  # about the middle of the heights, with waves of the form

    @property
    def height_m(self):
        return self.courses * self.course_m

    @property
    def joints_m(self):
        return np.arange(self.courses + 1) * self.course_m

    def radius(self, azimuth, z):
        """Distance of the wall from the axis."""
        course = np.clip((z / self.course_m).astype(int), 0, self.courses - 1)
        zeta = 2 * (z / self.course_m - course) - 1
        r = self.radius_m + self.bulge_m * (1 - zeta**2) * (1 - 0.1 * course)
        if self.step_m:
            r = r + np.asarray(self.step_m)[course]
        for mode, size, phase in self.oval_m:
            r = r + size * np.cos(mode * azimuth + phase + 0.05 * z)
        for at, depth, width in self.seams:
            r = r + depth * np.exp(-np.abs(_turn(azimuth - at)) * self.radius_m / (width / 4))
        if self.buckle:
            at, up, depth, size = self.buckle
            away = np.hypot(_turn(azimuth - at) * self.radius_m, z - up) / (size / 2)
            r = r - depth * np.where(away < 1, (1 + np.cos(np.pi * np.minimum(away, 1))) / 2, 0)
        return r

    def axis(self, z):
        return self.centre[0] + self.lean[0] * z, self.centre[1] + self.lean[1] * z


def _turn(angle):
    return (angle + np.pi) % FULL_TURN - np.pi


def make_scene(rng, *, pipes=0, stairs=False, second=None, **changes):
    """A scene with clutter at places of chance."""
    scene = Scene(**changes)
    for _ in range(pipes):
        low = rng.uniform(0, 0.3) * scene.height_m
        scene.pipes.append(
            (
                rng.uniform(0, FULL_TURN),
                rng.uniform(0.03, 0.4),
                rng.uniform(0.04, 0.2),
                low,
                scene.height_m * rng.uniform(0.7, 1.05),
            )
        )
    if stairs:
        scene.stairs = (rng.uniform(0, FULL_TURN), 2.0, rng.uniform(0.3, 0.8), 0.25)
        scene.railing = scene.height_m - 1.0
    scene.second = second
    return scene


def take_scan(rng, scene, position, rays, *, noise_m=0.002, beam_rad=3e-4, even=True):
    """xyz (n, 3) of a scan, and what each point is (n,), in the order of the rays."""
    origin = np.array([*np.add(scene.axis(position[2]), position[:2]), position[2]])
    count = int(np.sqrt(rays / 2))
    if even:  # even angles, as an instrument has them: dense at its poles
        around, up = np.meshgrid(
            np.arange(2 * count) / count * np.pi, (np.arange(count) + 0.5) / count
        )
        turn = (around + rng.normal(0, 1e-5, around.shape)).ravel()
        rise = (np.pi * (up - 0.5)).ravel()
    else:
        turn, rise = rng.uniform(0, FULL_TURN, rays), np.arcsin(rng.uniform(-1, 1, rays))
    rise = np.clip(rise, -1.4, 1.5)
    t, kind, cosine = _trace(scene, origin, _direction(turn, rise))
    jitter = rng.normal(0, beam_rad, (2, len(turn)))
    other, _, _ = _trace(scene, origin, _direction(turn + jitter[0], rise + jitter[1]))
    if scene.film is not None:
        t, kind = _mirrored(rng, scene, origin, _direction(turn, rise), t, kind)
        other = np.where(np.isin(kind, (FLOOR, MIRROR)), t, other)
    hit = np.isfinite(t)
    t, other, turn, rise, kind, cosine = (one[hit] for one in (t, other, turn, rise, kind, cosine))
    share = rng.uniform(0, 1, len(turn))
    edge = (np.abs(other - t) > 0.02) & (np.abs(other - t) < 2)
    t = np.where(edge, t + share * (np.where(edge, other, t) - t), t)
    kind = np.where(edge, MIXED, kind)
    if scene.second is not None:
        part, before = scene.second
        ghost = (kind == WALL) & (rng.uniform(0, 1, len(t)) < part)
        t = np.where(ghost, t - before / np.maximum(cosine, 0.1), t)
        kind = np.where(ghost, SECOND, kind)
    t = t + rng.normal(0, 1, len(t)) * noise_m * (0.7 + t / 30) / np.sqrt(np.maximum(cosine, 0.05))
    if scene.line_noise is not None:
        t = t + _line_noise(rng, scene, turn, rise, count)
    seen = t < 60
    xyz = origin + t[:, None] * _direction(turn, rise)
    if scene.gap is not None:
        azimuth = np.arctan2(xyz[:, 0], xyz[:, 1]) % FULL_TURN
        seen &= ~((azimuth > scene.gap[0]) & (azimuth < scene.gap[1]))
    return xyz[seen], kind[seen]


def _direction(turn, rise):
    level = np.cos(rise)
    return np.column_stack([level * np.sin(turn), level * np.cos(turn), np.sin(rise)])


def _trace(scene, origin, d, floor=True):
    """Range (inf: none), what is met, and cosine of the incidence of each ray."""
    inside = np.hypot(*(origin[:2] - scene.axis(origin[2]))) < scene.radius_m
    t, cosine = _ball(scene, origin, d) if scene.is_sphere else _wall(scene, origin, d, inside)
    kind = np.full(len(d), WALL)

    def meet(other, what):
        nonlocal t, kind, cosine
        nearer = other < t
        t, kind = np.where(nearer, other, t), np.where(nearer, what, kind)
        cosine = np.where(nearer, 0.7, cosine)

    with np.errstate(divide="ignore", invalid="ignore"):
        if scene.floor is not None and floor:
            meet(_floor(scene, origin, d), FLOOR)
            for pit in scene.pits:
                t, kind = _through_pit(scene, origin, d, pit, t, kind)
        levels = [0.0] * (floor and scene.floor is None) + [scene.height_m] * bool(inside)
        levels *= not scene.is_sphere
        for level in levels:
            fall = (level - origin[2]) / d[:, 2]
            meet(np.where(fall > 0, fall, np.inf), FLOOR)
    sign = -1.0 if inside else 1.0
    for azimuth, off, radius, low, high in scene.pipes:
        r = scene.radius_m + sign * (off + radius)
        middle = np.add(scene.axis(0.0), (r * np.sin(azimuth), r * np.cos(azimuth)))
        meet(_upright(origin, d, middle, radius, low, high), CLUTTER)
    for low, high, radius in scene.rods:
        meet(_rod(origin, d, np.array(low), np.array(high), radius), CLUTTER)
    for low, high in scene.boxes:
        meet(_box(origin, d, np.array(low), np.array(high)), CLUTTER)
    if scene.stairs is not None:
        first, turn, off, wide = scene.stairs
        other, azimuth, z = _shell(scene, origin, d, scene.radius_m + sign * off, inside)
        along = (azimuth - first) % FULL_TURN / turn
        rest = z - along * scene.height_m
        tread = (np.abs(rest) < wide / 2) & ((along * turn * scene.radius_m % 0.3) < 0.22)
        meet(np.where((along < 1) & tread, other, np.inf), CLUTTER)
    if scene.railing is not None:
        other, azimuth, z = _shell(scene, origin, d, scene.radius_m + sign * 0.9, inside)
        post = (azimuth * scene.radius_m % 1.5 < 0.05) | (np.abs(z - scene.railing - 0.9) < 0.03)
        meet(np.where((z > scene.railing) & (z < scene.railing + 1) & post, other, np.inf), CLUTTER)
    for azimuth, up, radius, off in scene.nozzles:
        for part in np.linspace(1.0, 0.1, 10):  # the face, and rings of the neck behind it
            other, at, z = _shell(scene, origin, d, scene.radius_m + sign * off * part, inside)
            away = np.hypot(_turn(at - azimuth) * scene.radius_m, z - up)
            hit = away < radius if part == 1.0 else np.abs(away - radius) < 0.02
            meet(np.where(hit, other, np.inf), CLUTTER)
    return t, kind, cosine


def ball_radius(scene, unit):
    """Distance of the wall of a sphere from its centre, in directions (n, 3)."""
    x, y, z = unit.T
    return (
        scene.radius_m + 0.006 * (3 * z * z - 1) / 2 + 0.004 * x * y + 0.003 * z * (x * x - y * y)
    )


def _ball(scene, origin, d):
    """Range from inside to a wall about the middle of the heights, and cosine of the incidence."""
    start = origin - [*scene.centre, scene.height_m / 2]
    along = d @ start
    t = -along + np.sqrt(along**2 - start @ start + scene.radius_m**2)
    for _ in range(NEWTON):
        p = start + t[:, None] * d
        r = np.linalg.norm(p, axis=1)
        t = t - (r - ball_radius(scene, p / r[:, None]))
    return t, np.abs(np.sum(p * d, axis=1) / r)


def _floor(scene, origin, d):
    """Range to a bottom that is any smooth function of x and y."""
    down = np.where(d[:, 2] < -1e-3, d[:, 2], np.nan)
    t = (np.float64(scene.floor(*scene.axis(0.0))) - origin[2]) / down
    for _ in range(4 * NEWTON):
        x, y = origin[0] + t * d[:, 0], origin[1] + t * d[:, 1]
        miss = origin[2] + t * down - scene.floor(x, y)
        t = t - np.clip(miss / down, -1.0, 1.0) * 0.8
    within = np.hypot(x - scene.centre[0], y - scene.centre[1]) < scene.radius_m + 0.5
    return np.where((t > 0) & (np.abs(miss) < 1e-5) & within, t, np.inf)


def _through_pit(scene, origin, d, pit, t, kind):
    """Rays that meet the bottom within a round pit go on to its floor or its side."""
    px, py, radius, depth = pit
    x, y = origin[0] + t * d[:, 0], origin[1] + t * d[:, 1]
    into = (kind == FLOOR) & (np.hypot(x - px, y - py) < radius)
    x, y, way = x[into] - px, y[into] - py, d[into]
    fall = -(depth / way[:, 2])
    a, b = way[:, 0] ** 2 + way[:, 1] ** 2, x * way[:, 0] + y * way[:, 1]
    side = (-b + np.sqrt(np.maximum(b**2 - a * (x**2 + y**2 - radius**2), 0))) / np.maximum(
        a, 1e-12
    )
    t, kind = t.copy(), kind.copy()
    t[into] += np.minimum(fall, side)
    kind[into] = CLUTTER
    return t, kind


def _rod(origin, d, low, high, radius):
    """Range to the side of a round rod between two points."""
    length = np.linalg.norm(high - low)
    along = (high - low) / length
    across, start = d - np.outer(d @ along, along), origin - low
    off = start - (start @ along) * along
    a, b = np.sum(across**2, axis=1), across @ off
    root = b**2 - a * (off @ off - radius**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
        place = start @ along + t * (d @ along)
    return np.where((t > 0) & (place > 0) & (place < length), t, np.inf)


def _box(origin, d, low, high):
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - origin) / d, (high - origin) / d
    near = np.max(np.minimum(first, second), axis=1)
    far = np.min(np.maximum(first, second), axis=1)
    return np.where((near > 0) & (near < far), near, np.inf)


def _mirrored(rng, scene, origin, d, t, kind):
    """A film of liquid: its face is seen, or nothing, or what stands over it, upside down."""
    px, py, radius, level, dark, mirror = scene.film
    fall = (level - origin[2]) / np.where(d[:, 2] < -1e-3, d[:, 2], np.nan)
    x, y = origin[0] + fall * d[:, 0], origin[1] + fall * d[:, 1]
    wet = (np.hypot(x - px, y - py) < radius) & (fall > 0) & (fall <= t + 1e-9)
    below = np.array([origin[0], origin[1], 2 * level - origin[2]])
    image, _, _ = _trace(scene, below, d * [1, 1, -1], floor=False)
    lot = rng.uniform(0, 1, len(t))
    t = np.where(wet, fall, t)
    kind = np.where(wet, FLOOR, kind)
    t = np.where(wet & (lot < dark), np.inf, t)
    shown = wet & (lot >= dark) & (lot < dark + mirror)
    return np.where(shown, image, t), np.where(shown, MIRROR, kind)


def _line_noise(rng, scene, turn, rise, count):
    """Noise that hangs together along each upright line of a scan over some degrees."""
    sd, reach = scene.line_noise
    line = np.round(turn * count / np.pi).astype(int) // scene.alike
    step = np.radians(reach) / 3
    knots = rng.normal(0, 1, (line.max() + 1, int(np.pi / step) + 8))
    at = (rise + np.pi / 2) / step + 3
    whole = np.floor(at).astype(int)
    total, weight = 0.0, 0.0
    for k in range(-3, 4):  # a bell over the knots
        share = np.exp(-(((at - whole - k) / 1.5) ** 2))
        total, weight = total + share * knots[line, whole + k], weight + share**2
    return sd * total / np.sqrt(weight)


def _upright(origin, d, middle, radius, low, high):
    x, y = (origin[:2] - middle)[:, None] + np.zeros(len(d))
    a = d[:, 0] ** 2 + d[:, 1] ** 2
    b = x * d[:, 0] + y * d[:, 1]
    root = b**2 - a * (x**2 + y**2 - radius**2)
    t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    with np.errstate(invalid="ignore"):
        z = origin[2] + t * d[:, 2]
    return np.where((t > 0) & (z > low) & (z < high), t, np.inf)


def _shell(scene, origin, d, radius, inside):
    """Range, azimuth and z where rays meet a round shell; the first of two from outside."""
    x, y = (origin[:2] - scene.axis(origin[2]))[:, None] + np.zeros(len(d))
    dx, dy = d[:, 0] - scene.lean[0] * d[:, 2], d[:, 1] - scene.lean[1] * d[:, 2]
    a, b = dx**2 + dy**2, x * dx + y * dy
    root = b**2 - a * (x**2 + y**2 - radius**2)
    sign = 1.0 if inside else -1.0
    t = np.where(root > 0, (-b + sign * np.sqrt(np.maximum(root, 0))) / a, np.inf)
    with np.errstate(invalid="ignore"):
        z = origin[2] + t * d[:, 2]
        azimuth = np.arctan2(x + t * dx, y + t * dy) % FULL_TURN
    good = (t > 0) & np.isfinite(t)
    return np.where(good, t, np.inf), np.where(good, azimuth, 0), np.where(good, z, -9)


def _wall(scene, origin, d, inside):
    t = _shell(scene, origin, d, scene.radius_m, inside)[0]
    x, y = origin[:2] - scene.axis(origin[2])
    dx, dy = d[:, 0] - scene.lean[0] * d[:, 2], d[:, 1] - scene.lean[1] * d[:, 2]
    met = np.isfinite(t)
    t, dx, dy, dz = t[met], dx[met], dy[met], d[met, 2]
    for _ in range(NEWTON):
        px, py = x + t * dx, y + t * dy
        r = np.hypot(px, py)
        slope = (px * dx + py * dy) / r
        z = origin[2] + t * dz
        miss = r - scene.radius(
            np.arctan2(px, py) % FULL_TURN, np.clip(z, 0, scene.height_m - 1e-9)
        )
        t = t - np.clip(
            miss / np.where(np.abs(slope) < 0.05, 0.05 * np.sign(slope), slope), -0.3, 0.3
        )
    sound = (np.abs(miss) < 1e-4) & (z > 0) & (z < scene.height_m)
    far, cosine = np.full(len(d), np.inf), np.ones(len(d))
    far[met] = np.where(sound, t, np.inf)
    cosine[met] = np.abs(slope)
    return far, cosine


def passes_of(scans, chunk=1 << 18):
    """What `find_cloud_wall` calls: the scans in pieces."""

    def passes():
        for number, xyz in enumerate(scans):
            for start in range(0, len(xyz), chunk):
                yield number, xyz[start : start + chunk]

    return passes
