"""Stations whose tank is known from a drawing only: other ends and rings, and a model of its sizes.

The model of the table is linear in its causes. Here the sizes themselves are the causes, so that
the geometry is evaluated at the estimates.
"""

import numpy as np
from example_logs import TrueTank
from scipy.interpolate import CubicSpline
from station_years import BASE_C, EXPANSION, NOMINAL, make_table

from tankcal.products.quantity.table import TankTable
from tankcal.products.upkeep.causes import PRIORS, Operation, TableStock
from tankcal.products.upkeep.steps import Marks, Steps

DRAWING = {"radius": 0.0125, "length": 0.12, "end": 0.06, "tilt": 0.015, "zero": 0.01}
FORM = {"flat": (0.0025, 0.0015), "power": (2.0, 0.5)}  # mean and sd; both are positive


def section_volume(sizes, level):
    """Volume below levels of a lying tank, m3, with ends of a power and a flattened section."""
    x = np.linspace(-sizes["end"], sizes["length"] + sizes["end"], 241)
    out = np.maximum(np.maximum(-x, x - sizes["length"]), 0.0) / sizes["end"]
    local = np.sqrt(np.clip(1 - out ** sizes["power"], 0, 1))
    rings = sizes.get("ring", 0.0) * np.where((x // 1.4) % 2 < 1, 1.0, -1.0)
    radius, squeeze = (sizes["radius"] + rings) * local, 1 - sizes["flat"] / sizes["radius"]
    depth = level[:, None] + sizes["zero"] + sizes["tilt"] * (sizes["length"] / 2 - x)
    share = np.clip((depth - sizes["radius"]) / squeeze / np.maximum(radius, 1e-9), -1, 1)
    area = radius**2 * squeeze * (np.arccos(-share) + share * np.sqrt(1 - share**2))
    return np.trapezoid(area, x, axis=1)


def nominal_sizes():
    return {name: getattr(NOMINAL, name) for name in DRAWING} | {
        name: mean for name, (mean, _) in FORM.items()
    }


class OtherTank(TrueTank):
    """Tank with drawn sizes, rings, flattening and ends."""

    def __init__(self, **sizes):
        self.sizes = sizes
        self.grid = np.linspace(0.0, 2 * sizes["radius"], 1001)
        self.volume = section_volume(sizes, self.grid)


def draw_tank(rng):
    """`OtherTank`: sizes as the drawing, rings of 3 mm, section to 5 mm flatter, other ends."""
    sizes = {name: getattr(NOMINAL, name) + u * rng.normal() for name, u in DRAWING.items()}
    return OtherTank(**sizes, ring=0.003 * rng.uniform(-1, 1), flat=0.005 * rng.random(),
                     power=rng.uniform(1.4, 3.0))  # fmt: skip


class SizedStock(TableStock):
    """Stock of a lying tank whose causes are its sizes, evaluated at their estimates.

    Parameters
    ----------
    volume : callable
        Volume at levels for {name: size}.
    nominal, sd : dict
        Sizes of the drawing, and the standard uncertainties of those that are estimated.
    table : TankTable
    """

    def __init__(self, volume, nominal, sd, table):
        super().__init__(table, EXPANSION, BASE_C)
        self.volume, self.nominal, self.sd = volume, nominal, sd
        self.names, self.known = tuple(sd), {}
        self.grid = np.linspace(0.0, table.height_m[-1] + 0.1, 131)

    def _spline(self, x):
        key = np.asarray(x).tobytes()
        if key not in self.known:
            sizes = dict(self.nominal)
            for (name, sd), value in zip(self.sd.items(), x, strict=True):
                sizes[name] += sd * value
            self.known[key] = CubicSpline(self.grid, self.volume(sizes, self.grid))
        return self.known[key]

    def volume_m3(self, level_m, x):
        return self._spline(np.asarray(x, float))(level_m)

    def columns(self, level_m, x):
        x, columns = np.asarray(x, float), []
        for step in 0.2 * np.eye(len(x)):
            high, low = (self._spline(x + sign * step)(level_m) for sign in (1, -1))
            columns.append((high - low) / 0.4)
        return np.stack(columns, axis=1)


def drawn_stock(form=True):
    """`SizedStock` of a drawing; `form`: also the flattening and the ends that it does not show."""
    sd = DRAWING | ({name: sd for name, (_, sd) in FORM.items()} if form else {})
    return SizedStock(section_volume, nominal_sizes(), sd, make_table(DRAWING))


# ---- twin of the tank of a contest (CUMCM 2010 A): a cylinder with spherical caps, pitch and roll

CONTEST = {"pitch": 0.0, "lowering": 0.0}  # rad; 1 - cos(roll), whose sign no level shows
POSE = {"pitch": np.radians(3.0), "lowering": 0.005}


def posed_volume(sizes, level, *, radius=1.5, length=8.0, cap=1.0, probe=2.0):
    """Volume below levels of the probe, m3; caps of a ball, probe at `probe` from an end."""
    x = np.linspace(-cap, length + cap, 401)
    out = np.maximum(np.maximum(-x, x - length), 0.0)
    ball = (radius**2 + cap**2) / (2 * cap)
    local = np.sqrt(np.maximum(ball**2 - (out + ball - cap) ** 2, 0.0))
    above = (level[:, None] - radius) * (1 - sizes["lowering"])
    share = (above + (probe - x) * np.tan(sizes["pitch"])) / np.maximum(local, 1e-9)
    share = np.clip(share, -1, 1)
    area = local**2 * (np.arccos(-share) + share * np.sqrt(1 - share**2))
    return np.trapezoid(area, x, axis=1)


def posed_station(rng, pitch, roll, rows=302):
    """(`Operation`, `Steps` of the sales, true volume function, meter factor) of the twin."""
    true = {"pitch": pitch, "lowering": 1 - np.cos(roll)}
    heights = np.linspace(0.0, 3.0, 301)
    volume = posed_volume(CONTEST, heights)
    table = TankTable("contest", "horizontal", heights, volume, np.zeros((301, 1)),
                      np.full(301, np.inf), 0.0, BASE_C, 0.0)  # fmt: skip
    sold, factor = rng.uniform(0.04, 0.28, rows), 1 + 0.001 * rng.normal()
    tank = CubicSpline(heights, posed_volume(true, heights))
    inside = float(tank(2.63)) - np.append(0.0, np.cumsum(sold * factor))
    fine = np.linspace(0.0, 3.0, 6001)
    level = np.interp(inside, tank(fine), fine) + 1e-4 * rng.normal(size=rows + 1)
    time = np.arange(rows + 1) * 900 * 10**9
    blank, none = np.full(rows, np.nan), np.zeros(rows, dtype=int)
    steps = Steps(Marks(time, np.round(level, 5), np.zeros(rows + 1), np.full(rows + 1, BASE_C)),
                  ("1",), sold[:, None], blank[:, None], np.zeros(rows), blank, none,
                  none)  # fmt: skip
    prior = dict.fromkeys(PRIORS["station"], 0.0) | {
        "gauge_wander_days": 5.0, "layer_h": 12.0, "meter_percent": 0.1, "level_mm": 0.1,
    }  # fmt: skip
    return Operation(SizedStock(posed_volume, CONTEST, POSE, table), {}, prior), steps, tank, factor
