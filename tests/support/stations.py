"""Simulated fuel stations: a tank, sales, deliveries and a gauge, none of which is the model.

The volume below a level is integrated along a cylinder with rings of alternating radius, ends and a
tilt. Sales are transactions, readings of the gauge are rows of a log.
"""

from dataclasses import dataclass, field

import numpy as np

DAY_S, HOUR_S = 86400.0, 3600.0
START = np.datetime64("2025-01-06T00:00:00", "ns").astype(np.int64)


@dataclass
class TrueTank:
    """Lying cylinder: volume below levels at the probe, m3."""

    radius: float = 1.25
    length: float = 5.7
    end: float = 0.35
    tilt: float = 0.010
    zero: float = 0.0
    ring: float = 0.0
    flat: float = 0.0
    grid: np.ndarray = field(init=False)
    volume: np.ndarray = field(init=False)

    def __post_init__(self):
        x = np.linspace(-self.end, self.length + self.end, 601)
        out = np.maximum(np.maximum(-x, x - self.length), 0.0) / max(self.end, 1e-9)
        local = np.sqrt(np.clip(1 - out**2, 0, 1))  # ellipsoidal ends
        rings = self.ring * np.where((x // 1.4) % 2 < 1, 1.0, -1.0)
        radius = (self.radius + rings) * local
        self.grid = np.linspace(0.0, 2 * self.radius, 1001)
        depth = self.grid[:, None] + self.zero + self.tilt * (self.length / 2 - x) - self.radius
        depth = depth / (1 - self.flat / self.radius)
        share = np.clip(depth / np.maximum(radius, 1e-9), -1, 1)
        area = radius**2 * (np.arccos(-share) + share * np.sqrt(1 - share**2))
        self.volume = np.trapezoid(area * (1 - self.flat / self.radius), x, axis=1)

    def below(self, level):
        return np.interp(level, self.grid, self.volume)

    def level(self, volume):
        return np.interp(volume, self.volume, self.grid)


@dataclass
class Station:
    """What a station does in some days, with all true errors."""

    days: int = 30
    tank: TrueTank = field(default_factory=TrueTank)
    meters: dict = field(default_factory=lambda: {"1": 0.0, "2": 0.0, "3": 0.0, "4": 0.0})
    ticket: float = 0.0  # relative bias of tickets
    ticket_own: float = 0.0025
    leak_l_h: float = 0.0
    gauge_zero: float = 0.0
    noise: float = 0.0001
    quantum: float = 1e-5
    wander: float = 0.00025
    period_s: float = 60.0
    sales_a_day: int = 60
    fault_day: float = 1e9
    fault: str = ""
    fault_size: float = 0.0
    constant_c: float = 15.0
    expansion: float = 0.0
    low_m3: float = 7.0  # stock at which a delivery is ordered
    load_m3: float = 12.0

    def run(self, rng):
        """Tables: levels (s, m, degC), sales (begin s, end s, meter, L), tickets (s, L)."""
        sales = []
        for day in range(self.days):
            hours = np.sort(6 + 16 * rng.beta(1.6, 1.6, self.sales_a_day))
            for hour in hours:
                litres = np.clip(rng.gamma(3.0, 12.0), 4, 120)
                sales.append((day * DAY_S + hour * HOUR_S, rng.choice(list(self.meters)), litres))
        first = stock = self.low_m3 + 7.0
        free_at = {}
        flows, tickets, sold = [], [], []
        for begin, meter, litres in sales:
            begin = max(begin, free_at.get(meter, 0.0))
            end = begin + litres / 35 * 60
            free_at[meter] = end + 20
            after_fault = begin / DAY_S > self.fault_day
            factor = 1 + self.meters[meter]
            if after_fault and self.fault == "meter" and meter == "1":
                factor += self.fault_size
            flows.append((begin, end, -litres * factor / 1000))
            sold.append((begin, end, meter, litres))
            stock -= litres * factor / 1000
            if stock < self.low_m3 and (not tickets or begin - tickets[-1][0] > 6 * HOUR_S):
                volume = self.load_m3 + rng.choice([-1.0, 0.0, 1.0])
                start = begin + 1800
                bias = self.ticket
                if after_fault and self.fault == "ticket":
                    bias += self.fault_size
                flows.append((start, start + 900, volume))
                tickets.append((start + 900, 1000 * volume * (1 - bias) *
                                (1 + self.ticket_own * rng.normal())))  # fmt: skip
                stock += volume
        time = np.arange(0, self.days * DAY_S, self.period_s)
        begin, end, volume = np.array(flows).T
        inside = first + self._sum_flows(time, begin, end, volume)
        leak = np.full(len(time), self.leak_l_h)
        if self.fault == "leak":
            leak = leak + np.where(time / DAY_S > self.fault_day, self.fault_size, 0.0)
        inside = inside - np.cumsum(leak) * self.period_s / 3.6e6
        level = self.tank.level(inside)
        stay = np.exp(-self.period_s / (5 * DAY_S))
        shocks = self.wander * np.sqrt(1 - stay**2) * rng.normal(size=len(time))
        w = np.empty(len(time))
        state = self.wander * rng.normal()
        for i, shock in enumerate(shocks):
            state = stay * state + shock
            w[i] = state
        zero = np.full(len(time), self.gauge_zero)
        if self.fault == "zero":
            zero = zero + np.where(time / DAY_S > self.fault_day, self.fault_size, 0.0)
        read = level + w + zero + self.noise * rng.normal(size=len(time))
        read = np.round(read / self.quantum) * self.quantum
        return {"levels": (time, read), "sales": sold, "tickets": tickets, "inside": inside}

    @staticmethod
    def _sum_flows(time, begin, end, volume):
        """Volume that has come in until each time, at a constant flow during each interval."""
        knots = np.concatenate([begin, end])
        rate = volume / (end - begin)
        change = np.concatenate([rate, -rate])
        at = np.argsort(knots)
        knots, slopes = knots[at], np.cumsum(change[at])
        steps = np.append(0.0, np.cumsum(slopes[:-1] * np.diff(knots)))
        return np.interp(time, knots, steps, left=0.0)


def local_text(seconds):
    """ISO texts of seconds after START."""
    times = (START + (np.asarray(seconds) * 1e9).astype(np.int64)).view("datetime64[ns]")
    return np.datetime_as_string(times.astype("datetime64[s]"))


def write_station(folder, data, *, settings=""):
    """Write the logs of `Station.run` as plain CSV files, with upkeep.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    time, level = data["levels"]
    with open(folder / "levels.csv", "w") as file:
        file.write("time,level_mm\n")
        file.writelines(
            f"{text},{1000 * value:.2f}\n"
            for text, value in zip(local_text(time), level, strict=True)
        )
    sales = data["sales"]
    begin, end = (local_text([sale[i] for sale in sales]) for i in (0, 1))
    with open(folder / "meters.csv.log", "w") as file:
        file.write("time,begin,meter,volume_l\n")
        file.writelines(f"{e},{b},{sale[2]},{sale[3]:.3f}\n"
                        for b, e, sale in zip(begin, end, sales, strict=True))  # fmt: skip
    with open(folder / "deliveries.csv", "w") as file:
        file.write("time,volume_l\n")
        texts = local_text([ticket[0] for ticket in data["tickets"]])
        file.writelines(
            f"{text},{ticket[1]:.1f}\n" for text, ticket in zip(texts, data["tickets"], strict=True)
        )
    (folder / "upkeep.toml").write_text(
        '[upkeep]\nrecord = "record.json"\ntimezone = "UTC"\nservice = "station"\n\n'
        "[liquid]\nexpansion_per_k = 0\nbase_c = 15\n\n[gauge]\nresolution_mm = 0.01\n\n"
        '[levels]\nfiles = ["levels.csv"]\n\n[meters]\nfiles = ["meters.csv.log"]\n\n'
        '[deliveries]\nfiles = ["deliveries.csv"]\n' + settings
    )
