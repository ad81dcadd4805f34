"""Simulated everyday data: a fuel station, and an upright tank of a terminal.

    python simulate.py station RECORD FOLDER [DAYS]
    python simulate.py upright RECORD FOLDER [DAYS]

The true tank has the table of the record, with a scale and a zero that differ by about U. Gauge,
meters, tickets and temperatures have errors that are not the model of tankcal. From three quarters
of the time on, the tank of the station loses 0.6 L/h. truth.json has the true values.
"""

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path

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


# ---- the examples


class TableTank:
    """True tank: the table of a record, with another scale and zero."""

    def __init__(self, record, scale, zero_m):
        capacity = json.loads(Path(record).read_text(encoding="utf-8"))["capacity"]
        self.grid = np.array(capacity["height_m"]) + zero_m
        self.volume = np.array(capacity["volume_m3"]) * (1 + scale)

    below, level = TrueTank.below, TrueTank.level


def write_months(folder, name, heading, rows):
    """Write a log in a file for each month; rows are texts that begin with an ISO time."""
    files = {}
    for row in rows:
        files.setdefault(row[:7], []).append(row)
    for month, lines in files.items():
        text = "\n".join([heading, *lines, ""])
        (folder / f"{name}-{month}.csv").write_text(text, encoding="utf-8")


def write_settings(folder, record, service, expansion, quantum_mm, meters, more=""):
    """Write upkeep.toml, and meters.csv with the certificates {meter: u in ppm}."""
    (folder / "upkeep.toml").write_text(
        f'[upkeep]\nrecord = "{Path(record).as_posix()}"\ntimezone = "UTC"\n'
        f'service = "{service}"\nnotice = "EXAMPLE"\n\n[liquid]\nexpansion_per_k = {expansion}\n'
        f"base_c = 15\n\n[gauge]\nresolution_mm = {quantum_mm}\n{more}\n"
        '[levels]\nfiles = ["levels-*.csv"]\n\n[meters]\nfiles = ["sales-*.csv"]\n\n'
        '[deliveries]\nfiles = ["tickets-*.csv"]\n', encoding="utf-8",
    )  # fmt: skip
    rows = [f"{name},1,{u},C-{name}" for name, u in meters.items()]
    text = "\n".join(["meter,factor,u_factor_ppm,certificate", *rows, ""])
    (folder / "meters.csv").write_text(text, encoding="utf-8")


def make_station(record, folder, days=730):
    """Write the folders first and second: two years of a station, with a late leak.

    The second year begins with the record ../table, which the upkeep of the first year writes.
    """
    rng = np.random.default_rng(51)
    tank = TableTank(record, 6e-4, 0.0006)
    factors = {name: 3e-4 * rng.normal() for name in "1234"}
    station = Station(
        days=days, tank=tank, meters=factors, ticket=8e-4, leak_l_h=0.05, gauge_zero=0.0008,
        quantum=1e-4, period_s=300.0, sales_a_day=90, low_m3=6.0, load_m3=24.0, fault="leak",
        fault_day=0.75 * days, fault_size=0.6,
    )  # fmt: skip
    data = station.run(rng)
    time, level = data["levels"]
    half = str(local_text(days // 2 * DAY_S))

    def write_log(name, heading, rows):
        rows = list(rows)
        for part, chosen in (("first", [row for row in rows if row < half]),
                             ("second", [row for row in rows if row >= half])):  # fmt: skip
            (folder / part).mkdir(parents=True, exist_ok=True)
            write_months(folder / part, name, heading, chosen)

    write_log("levels", "time,level_mm,temperature_c", (
        f"{at},{1000 * h:.1f},{c:.1f}" for at, h, c in
        zip(local_text(time), level, 15 + 0 * time, strict=True)
    ))  # fmt: skip
    begin, end = (local_text([sale[i] for sale in data["sales"]]) for i in (0, 1))
    write_log("sales", "time,begin,meter,volume_l", (
        f"{e},{b},{sale[2]},{sale[3]:.2f}"
        for b, e, sale in zip(begin, end, data["sales"], strict=True)
    ))  # fmt: skip
    texts = local_text([ticket[0] for ticket in data["tickets"]])
    write_log("tickets", "time,volume_l", (
        f"{at},{ticket[1]:.0f}" for at, ticket in zip(texts, data["tickets"], strict=True)
    ))  # fmt: skip
    for part, table in (("first", Path(record).resolve()), ("second", "../table")):
        write_settings(folder / part, table, "station", 0, 0.1, dict.fromkeys(factors, 300))
    return {"scale": 6e-4, "zero_m": 0.0006, "meters": factors, "leak_l_h": 0.6,
            "leak_day": 0.75 * days}  # fmt: skip


def make_upright(record, folder, days=365):
    """Write a year of an upright tank: a loading rack, a receipt when the stock is low."""
    rng = np.random.default_rng(52)
    tank = TableTank(record, -2e-4, 0.001)
    top = tank.grid[-1]
    low, high = tank.below(0.2 * top), tank.below(0.9 * top)
    expansion, rack, receipt = 0.00083, 6e-4, 1e-4
    stock, flows, tickets, sales = high, [], [], []
    for day in range(days):
        if day % 7 < 5:  # loaded from 7 to 16 h
            volume = (high - low) / 6 * rng.gamma(20, 1 / 20)
            start = day * DAY_S + 7 * HOUR_S
            flows.append((start, start + 9 * HOUR_S, -volume * (1 + rack)))
            sales.append((start, start + 9 * HOUR_S, volume))
            stock -= volume * (1 + rack)
        if stock < low + (high - low) / 5:
            volume, start = high - stock, day * DAY_S + 17 * HOUR_S
            flows.append((start, start + 5 * HOUR_S, volume))
            tickets.append((start + 5 * HOUR_S, volume * (1 - receipt)))
            stock += volume
    time = np.arange(0, days * DAY_S, 600.0)
    begin, end, volume = np.array(flows).T
    season = 18 + 8 * np.sin(2 * np.pi * (time / DAY_S - 110) / 365)
    inside = high + Station._sum_flows(time, begin, end, volume)  # at 15 degC
    warm = season + 0.15 * np.sin(2 * np.pi * time / DAY_S / 9)
    level = tank.level(inside * (1 + expansion * (warm - 15)))
    slow = 0.0003 * np.sin(2 * np.pi * time / DAY_S / 17 + 1) + 0.0012 + 6e-5 * level
    read = np.round(1000 * (level + slow + 0.0004 * rng.normal(size=len(time))))
    folder.mkdir(parents=True, exist_ok=True)
    write_months(folder, "levels", "time,level_mm,temperature_c", (
        f"{at},{h:.0f},{c:.2f}" for at, h, c in zip(local_text(time), read, season, strict=True)
    ))  # fmt: skip

    def season_at(seconds):
        return np.interp(seconds, time, season)

    def warmed(litres, seconds):
        return 1000 * litres * (1 + expansion * (season_at(seconds) - 15))

    write_months(folder, "sales", "time,begin,meter,volume_l,temperature_c", (
        f"{local_text(e)},{local_text(b)},rack,{warmed(v, e):.0f},{season_at(e):.2f}"
        for b, e, v in sales
    ))  # fmt: skip
    write_months(folder, "tickets", "time,volume_l,temperature_c", (
        f"{local_text(at)},{warmed(v, at):.0f},{season_at(at):.2f}" for at, v in tickets
    ))  # fmt: skip
    write_settings(folder, Path(record).resolve(), "terminal", expansion, 1, {"rack": 1000})
    return {"scale": -2e-4, "zero_m": 0.001, "meters": {"rack": rack}}


def main():
    """Write the logs of an example and truth.json beside them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("kind", choices=("station", "upright"))
    parser.add_argument("record", help="record.json with the table of the tank")
    parser.add_argument("folder", type=Path, help="written here")
    parser.add_argument("days", type=int, nargs="?")
    options = parser.parse_args()
    make = {"station": make_station, "upright": make_upright}[options.kind]
    days = () if options.days is None else (options.days,)
    text = json.dumps(make(options.record, options.folder, *days), indent=1) + "\n"
    (options.folder / "truth.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
