"""Levels of a gauge: means of quiet windows, and the gauge's own volumes and water level.

Pieces of the quiet windows are accumulated while the logs are read.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.upkeep.logs import NOT_A_TIME, Findings, find_offset_s
from tankcal.products.upkeep.saved import NO_STATE

PIECE_NS = 3600 * 10**9  # longest piece of a quiet window
STUCK_STEPS = 8  # movement of the level, in quanta, that a stuck float has missed
LINE_ROWS, LINE_M = 6, 1e-9  # a straight line through so many rows is an interpolation
REST_NS = 2 * 3600 * 10**9  # shortest rest that is tested for a sloping line
REST_ROWS, REST_RISE = (12, 24), 10  # rows of this test; rise of a line, in steps of the file
SAME_SLOPE = 0.2  # relative scatter of slopes, below which the lines are a leak
CLOCK_ROWS, CLOCK_STEP_NS = 1500, 240 * 10**9  # rows that compare the clocks, and their distance
CLOCK_NS = 7 * 86400 * 10**9  # between two comparisons
MOST_OFFSET_S = 60.0  # between two clocks; a larger offset causes a warning
MOST_SHARED = 2  # pieces with levels of two files, as where a month ends
OVERLAP = 400_000  # rows in which a late row is compared with earlier rows


@dataclass(frozen=True)
class Pieces:
    """Means of readings in pieces of the quiet windows, in order of time; (n,) each.

    Attributes
    ----------
    window : ndarray of int
        Number of the quiet window.
    time_ns : ndarray of int64
        Mean time of the readings.
    level_m : ndarray
    sd_m : ndarray
        Standard deviation of a reading about the mean.
    count : ndarray of int
    temperature_c : ndarray
        nan: not measured.
    water_m : ndarray
        nan: not measured.
    """

    window: np.ndarray
    time_ns: np.ndarray
    level_m: np.ndarray
    sd_m: np.ndarray
    count: np.ndarray
    temperature_c: np.ndarray
    water_m: np.ndarray

    def __len__(self):
        """Number of pieces."""
        return len(self.time_ns)

    def select(self, rows):
        """Pieces of an index or a mask."""
        return Pieces(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def divide_windows(windows):
    """Divide windows (w, 2) into pieces of at most an hour: (pieces (p, 2), window (p,))."""
    lengths = windows[:, 1] - windows[:, 0]
    counts = np.maximum(np.ceil(lengths / PIECE_NS).astype(int), 1)
    window = np.repeat(np.arange(len(windows)), counts)
    number = np.arange(len(window)) - np.repeat(np.cumsum(counts) - counts, counts)
    size = lengths[window] // counts[window]
    starts = windows[window, 0] + number * size
    return np.stack([starts, starts + size], axis=1), window


SUMS = ("n", "h", "hh", "t", "T", "nT", "w", "nw")  # see `LevelSums._add`


@dataclass(frozen=True)
class FileSpan:
    """First and last time of a level log, nanoseconds UTC."""

    first_ns: int
    last_ns: int


@dataclass(frozen=True)
class FileSums:
    """Sums of the readings of a file.

    Attributes
    ----------
    first : int
        Number of the first piece.
    reference_m : ndarray, shape (p,)
        Level from which the sums of each piece are taken; nan: no reading.
    sums : ndarray, shape (8, p)
        In the order of `SUMS`.
    stuck_ns : ndarray of int64, shape (s, 2)
    offsets : ndarray, shape (o, 2)
        Times, and offsets of the clock in seconds.
    slopes : ndarray, shape (r,)
        Slope of the levels in each long rest, m/s; nan: no straight line.
    names : tuple of str
        Kinds of findings.
    counts : ndarray of int64, shape (f, 3)
        Number, first and last time of each kind.
    """

    first: int
    reference_m: np.ndarray
    sums: np.ndarray
    stuck_ns: np.ndarray
    offsets: np.ndarray
    slopes: np.ndarray
    names: tuple
    counts: np.ndarray


class LevelSums:
    """Sums of the readings of each piece of the quiet windows.

    Parameters
    ----------
    windows : ndarray of int64, shape (w, 2)
        Quiet windows in nanoseconds UTC.
    quantum_m : float
        Smallest step of the indication.
    flows : sequence of flows.MeterFlow
    volume_m3 : callable
        Volume of the table at levels.

    Attributes
    ----------
    offsets : list of (int, float)
        Time and offset in seconds of the clock of the levels from the clock of the meters.
    slopes : list of float
        Slopes of the levels in long rests, m/s; nan: no straight line.
    """

    def __init__(self, windows, quantum_m, flows, volume_m3):
        self.pieces, self.window = divide_windows(windows)
        self.quantum_m, self.flows, self.volume_m3 = quantum_m, flows, volume_m3
        count = len(self.pieces)
        self._total = np.full(count, np.nan), np.zeros((len(SUMS), count))
        self.offsets, self.slopes, self._all_stuck = [], [], []
        self._file_of = np.zeros(count, dtype=object)  # the first file with a level in each piece
        self._rests = windows[np.diff(windows, axis=1)[:, 0] >= REST_NS]

    def read(self, files, state=NO_STATE):
        """Add the rows of level logs, in order of their first time.

        Sums of files that earlier runs have read are taken from `state`, if the windows and the
        flows during the file are equal.
        """
        for file in files:
            key = state.key(file.digest, repr(file.profile), file.zone)
            span, sums = state.load(key, FileSpan), None
            if span is not None:
                within = self._key(state, key, span)
                sums = state.load(within, FileSums)
            if sums is None:
                span, sums = self._read_file(file)
                if span is not None and not file.log.problems:
                    state.save(key, span)
                    state.save(self._key(state, key, span), sums)
            self._refuse_repeated(sums, file)
            self._add_file(sums, file.findings)
            if "row" in sums.names:  # as if the file had been read
                file.span[:] = sums.counts[sums.names.index("row")].tolist()

    def _key(self, state, key, span):
        """Key of the sums of a file: windows, flows and table during the file."""
        if state.folder is None:
            return ""
        low, high = span.first_ns, span.last_ns
        first, last = self._find_pieces(low, high)
        flows = []
        for flow in self.flows:
            begin = max(np.searchsorted(flow.time_ns, low) - 1, 0)
            part = slice(begin, np.searchsorted(flow.time_ns, high) + 2)
            # Differences to rounding, so that earlier sums do not matter.
            volumes = np.round(np.diff(flow.total_m3)[part], 9)
            flows += [flow.name, flow.time_ns[part], flow.begin_ns[part], volumes]
        grid = self.volume_m3(np.linspace(0.0, 30.0, 31))
        return state.key(key, self.quantum_m, self.pieces[first:last], first, grid, *flows)

    def _find_pieces(self, low, high):
        """First and last piece of an interval, with a margin."""
        first, last = np.searchsorted(self.pieces[:, 0], (low, high))
        return max(int(first) - 1, 0), min(int(last) + 1, len(self.pieces))

    def _refuse_repeated(self, sums, file):
        """Report a file with levels at the times of another, such as a copy in another encoding."""
        has_level = np.flatnonzero(sums.sums[SUMS.index("n")] > 0) + sums.first
        others = self._file_of[has_level]
        if np.sum(others != 0) > MOST_SHARED:
            file.log.problem(file.path.name, message(
                "upkeep_levels_twice", "levels at the times of those of {twin}; expected each "
                "reading once: it would count twice", twin=others[others != 0][0]))  # fmt: skip
        self._file_of[has_level[others == 0]] = file.path.name

    def _add_file(self, sums, findings):
        """Add the sums of a file, about the reference of the first file with a reading."""
        place = slice(sums.first, sums.first + len(sums.reference_m))
        reference, total = self._total[0][place], self._total[1][:, place]
        reference[...] = np.where(np.isnan(reference), sums.reference_m, reference)
        shift = np.nan_to_num(sums.reference_m - reference)
        part = dict(zip(SUMS, sums.sums, strict=True))
        part["hh"] = part["hh"] + 2 * shift * part["h"] + part["n"] * shift**2
        part["h"] = part["h"] + part["n"] * shift
        total += np.stack(list(part.values()))
        self._all_stuck += [tuple(map(int, pair)) for pair in sums.stuck_ns]
        self.offsets += [(int(time), offset) for time, offset in sums.offsets]
        self.slopes += sums.slopes.tolist()
        for name, (count, low, high) in zip(sums.names, sums.counts.tolist(), strict=True):
            findings.add("levels", name, (low, high), count)

    def _read_file(self, file):
        """(`FileSpan` or None, `FileSums`) of a level log."""
        count, file = len(self.pieces), replace(file, findings=Findings())
        self._reference = np.full(count, np.nan)
        self._sums = {name: np.zeros(count) for name in SUMS}
        self._stuck, self._clocks, self._lines = [], [], []
        recent = [np.zeros(0, dtype=np.int64), np.zeros(0)]
        run, first, last = None, None, NOT_A_TIME
        for chunk in file.chunks():
            chunk = _separate_tags(chunk, file.profile)
            if not len(chunk["time"]):
                continue
            time, level = chunk["time"], chunk["level"]
            late = time < np.maximum.accumulate(np.append(last, time))[:-1]
            file.findings.add("levels", "late", time[late])
            first = int(time.min()) if first is None else min(first, int(time.min()))
            last = max(last, int(time.max(initial=NOT_A_TIME)))
            file.findings.add("levels", "row", time)
            order = np.argsort(time, kind="stable")
            chunk = {key: values[order] for key, values in chunk.items()}
            time, level = chunk["time"], chunk["level"]
            is_level = np.isfinite(level)
            is_new = self._find_new_rows(time, level, is_level, recent, file)
            recent = [np.append(old, new)[-OVERLAP:] for old, new in
                      zip(recent, (time[is_level & is_new], level[is_level & is_new]),
                          strict=True)]  # fmt: skip
            run = self._follow_runs(time[is_level], level[is_level], run)
            self._compare_clocks(time[is_level], level[is_level], file)
            self._test_rests(time[is_level], level[is_level], file.profile.to_si("level", 1.0))
            is_line = np.zeros(len(time), dtype=bool)
            is_line[is_level] = find_lines(time[is_level], level[is_level])
            file.findings.add("levels", "interpolated", time[is_line])
            self._add(chunk, is_new & ~is_line)
        self._follow_runs(None, None, run)
        low, high = (0, 0) if first is None else self._find_pieces(first, last)
        counts = {name: entry for (_, name), entry in file.findings.counts.items()}
        sums = FileSums(
            low, self._reference[low:high],
            np.stack([self._sums[name][low:high] for name in SUMS]),
            np.array(self._stuck, dtype=np.int64).reshape(-1, 2),
            np.array(self._clocks, dtype=float).reshape(-1, 2), np.array(self._lines),
            tuple(counts),
            np.array([[number, NOT_A_TIME if begin is None else begin,
                       NOT_A_TIME if end is None else end]
                      for number, begin, end in counts.values()], dtype=np.int64).reshape(-1, 3),
        )  # fmt: skip
        return None if first is None else FileSpan(first, last), sums

    def _find_new_rows(self, time, level, is_level, recent, file):
        """Mask (n,) of rows that do not repeat an earlier row; other values are problems."""
        both = np.append(recent[0], time), np.append(recent[1], level)
        order = np.argsort(both[0], kind="stable")
        times, levels = both[0][order], both[1][order]
        repeats = np.append(False, (np.diff(times) == 0) & np.isfinite(levels[1:]))
        repeats &= np.append(False, np.isfinite(levels[:-1]))
        is_other = repeats & np.append(False, levels[1:] != levels[:-1])
        is_repeated = np.zeros(len(times), dtype=bool)
        is_repeated[order] = repeats
        file.findings.add("levels", "duplicate", times[repeats & ~is_other])
        file.findings.add("levels", "other_value", times[is_other])
        mask = ~is_repeated[len(recent[0]) :]
        # Two values at a time: neither is used.
        clash = np.isin(time, times[is_other])
        return mask & ~(clash & is_level)

    def _follow_runs(self, time, level, run):
        """Record stuck floats: equal values while liquid was metered; the open run at the end.

        A run is (start, end, value); time None closes the open run.
        """
        runs = [] if run is None else [run]
        if time is not None and len(time):
            edges = np.flatnonzero(np.diff(level) != 0) + 1
            starts, ends = np.append(0, edges), np.append(edges, len(level)) - 1
            new = [time[starts], time[ends], level[starts]]
            if run is not None and run[2] == level[0]:
                new[0] = new[0].copy()
                new[0][0], runs = min(run[0], int(new[0][0])), []
        else:
            new = [np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)]
        start, end, value = (
            np.append([entry[i] for entry in runs], new[i]) for i in range(3)
        )  # fmt: skip
        start, end = start.astype(np.int64), end.astype(np.int64)
        closed = len(start) - (0 if time is None else 1)
        flow = np.zeros(len(start))
        for meter in self.flows:
            flow += meter.volume_m3(end) - meter.volume_m3(start)
        missed = (
            STUCK_STEPS
            * max(self.quantum_m, 1e-4)
            * ((self.volume_m3(value + 1e-3) - self.volume_m3(value - 1e-3)) / 2e-3)
        )
        for place in np.flatnonzero(flow[:closed] > missed[:closed]):
            self._stuck.append((int(start[place]), int(end[place])))
        return None if time is None or not len(start) else (start[-1], end[-1], value[-1])

    def _compare_clocks(self, time, level, file):
        """Compare the clocks of levels and meters by the first rows of each week of a chunk."""
        if len(time) < 2:
            return
        # A sale takes minutes: closer rows share it, and do not show the offset.
        spacing = max(np.median(np.diff(time)), 1)
        stride, most = int(CLOCK_STEP_NS // spacing) + 1, MOST_OFFSET_S + 0.5e-9 * spacing
        for start in np.flatnonzero(np.diff(time // CLOCK_NS, prepend=-1)):
            part = slice(start, start + CLOCK_ROWS * stride, stride)
            now, last = time[part], self._clocks[-1][1] if self._clocks else None
            if len(now) < 2:
                continue
            offset = find_offset_s(now, self.volume_m3(level[part]), self.flows, last)
            if offset is not None:
                self._clocks.append((float(now[0]), offset))
                if abs(offset) > most:
                    file.findings.add("levels", "clock_offset", now[[0, -1]], len(now))

    def _test_rests(self, time, level, unit_m):
        """Add the slopes of the levels in long rests, where a historian interpolates and rounds."""
        if not len(time):
            return
        values = level[:1000] / unit_m
        step = next((step for step in 10.0 ** -np.arange(5)
                     if np.allclose(values / step, np.round(values / step), rtol=0, atol=1e-3)),
                    1e-6) * unit_m  # fmt: skip
        ends = np.searchsorted(time, self._rests)
        for first, last in ends[np.diff(ends, axis=1)[:, 0] >= REST_ROWS[0]]:
            rows = np.linspace(first, last - 1, min(last - first, REST_ROWS[1])).astype(int)
            seconds, rise = (time[rows] - time[first]) * 1e-9, level[rows] - level[first]
            slope = rise[-1] / seconds[-1]
            # Rounding moves a reading and the ends of the line by half a step each.
            is_line = np.max(np.abs(rise - slope * seconds)) < 1.01 * step
            is_line &= abs(rise[-1]) > REST_RISE * step
            self._lines.append(slope if is_line else np.nan)

    def interpolated_share(self):
        """Share of the long rests with levels on sloping lines, which are no leak."""
        slopes = np.array(self.slopes)[np.isfinite(self.slopes)]
        if not len(slopes) or np.std(slopes) < SAME_SLOPE * abs(np.mean(slopes)):
            return 0.0
        return len(slopes) / len(self.slopes)

    def _add(self, chunk, is_used):
        """Add readings to the sums of their pieces."""
        time = chunk["time"]
        place = np.searchsorted(self.pieces[:, 0], time, side="right") - 1
        is_used = is_used & (place >= 0)
        is_used &= time <= self.pieces[np.maximum(place, 0), 1] if len(self.pieces) else False
        count = len(self.pieces)

        def add(name, rows, values):
            self._sums[name] += np.bincount(place[rows], values, minlength=count)

        rows = is_used & np.isfinite(chunk["level"])
        level, at = chunk["level"][rows], place[rows]
        is_first = np.isnan(self._reference[at])
        first, index = np.unique(at[is_first], return_index=True)
        self._reference[first] = level[is_first][index]
        offset = level - self._reference[at]
        add("n", rows, np.ones(len(level)))
        add("h", rows, offset)
        add("hh", rows, offset**2)
        add("t", rows, (time[rows] - self.pieces[at, 0]) * 1e-9)
        for name, column in (("T", "temperature"), ("w", "water")):
            if column in chunk:
                known = is_used & np.isfinite(chunk[column])
                add(name, known, chunk[column][known])
                add(f"n{name}", known, np.ones(known.sum()))

    def means(self, findings):
        """`Pieces` with at least two readings, without those of a stuck float."""
        reference, sums = self._total[0], dict(zip(SUMS, self._total[1], strict=True))
        n = np.maximum(sums["n"], 1)
        mean = sums["h"] / n
        variance = np.maximum(sums["hh"] / n - mean**2, 0.0) * n / np.maximum(n - 1, 1)
        is_stuck = np.zeros(len(n), dtype=bool)
        for start, end in self._all_stuck:
            touched = (self.pieces[:, 1] > start) & (self.pieces[:, 0] < end)
            is_stuck |= touched
            findings.add("levels", "stuck", (start, end), int(sums["n"][touched].sum()))
        with np.errstate(invalid="ignore", divide="ignore"):
            temperature, water = sums["T"] / sums["nT"], sums["w"] / sums["nw"]
        pieces = Pieces(
            self.window, self.pieces[:, 0] + (sums["t"] / n * 1e9).astype(np.int64),
            reference + mean, np.sqrt(variance), sums["n"].astype(int), temperature, water,
        )  # fmt: skip
        return pieces.select((sums["n"] >= 2) & ~is_stuck)


def _separate_tags(chunk, profile):
    """Chunk with a column for each tag, nan in the rows of other tags."""
    if "tag" not in chunk:
        return {"level": np.full(len(chunk["time"]), np.nan)} | chunk
    values = chunk["value"].astype(float)
    columns = {name: profile.to_si(name, np.where(chunk["tag"] == tag, values, np.nan))
               for name, tag in profile.tags.items()}  # fmt: skip
    return {"time": chunk["time"], "level": np.full(len(values), np.nan)} | columns


def find_lines(time_ns, level_m):
    """Whether each row (n,) lies inside a straight line of constant slope, an interpolation.

    Parameters
    ----------
    time_ns : ndarray of int64, shape (n,)
        Ascending.
    level_m : ndarray, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    result = np.zeros(len(level_m), dtype=bool)
    if len(level_m) < LINE_ROWS:
        return result
    seconds, rise = np.diff(time_ns) * 1e-9, np.diff(level_m)
    slope = rise / np.maximum(seconds, 1e-9)
    # Row i + 1 is on the line through its neighbours, which is not level.
    is_inside = (np.abs((slope[1:] - slope[:-1]) * seconds[1:]) < LINE_M) & (rise[1:] != 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_inside, [0]])))
    pairs = edges.reshape(-1, 2)
    for start, end in pairs[pairs[:, 1] - pairs[:, 0] >= LINE_ROWS - 2]:
        result[start + 1 : end + 1] = True
    return result


BIN_M = 0.02  # levels that are compared
DAY_NS = 86400 * 10**9
CHANGED, CHANGED_M3 = 0.002, 0.005  # of the volume, and the least, of a changed table
WATER_M = 0.003  # rise of the level of water that is more than the scatter of a float
MOST_BINS = 0.5  # share of the known levels of a day that must have changed


def compare_own_volumes(file, table, findings, events, log):
    """Warn if the volumes of a gauge change at equal levels, without an event table_changed.

    Parameters
    ----------
    file : logs.LogFile
        Level log; without volumes there is no comparison.
    table : quantity.table.TankTable
        Interpolates between levels of a bin.
    findings : logs.Findings
    events : list of dict
    log : Log
    """
    if file.profile.format == "csv" and not file.has_column("volume"):
        return
    known, changed = pd.Series(dtype=float), []
    # Its rows are counted already.
    for chunk in replace(file, findings=Findings(), log=Log(), span=[0, None, None]).chunks():
        if "volume" not in chunk or "level" not in chunk:
            return
        level, volume = chunk["level"], chunk["volume"]
        is_used = np.isfinite(level) & np.isfinite(volume) & ~table.is_outside(level)
        level, volume, time = level[is_used], volume[is_used], chunk["time"][is_used]
        rows = pd.DataFrame({
            "day": time // DAY_NS, "bin": np.round(level / BIN_M), "volume": volume,
            "difference": volume - table.volume(level),
        })  # fmt: skip
        for day, values in rows.groupby("day"):
            means = values.groupby("bin")[["difference", "volume"]].mean()
            both = means.index.intersection(known.index)
            limit = np.maximum(CHANGED * means.volume[both], CHANGED_M3)
            moved = np.abs(means.difference[both] - known[both]) > limit
            if len(both) and moved.mean() > MOST_BINS:
                changed.append(int(day) * DAY_NS)
            known = means.difference.combine_first(known) if not changed else known
    declared = any(event["kind"] == "table_changed" for event in events)
    if changed and not declared:
        findings.add("levels", "table_changed", changed)
        text = message("upkeep_table_changed", "the gauge states other volumes at equal levels "
                       "from {day} on: its table was changed; expected an event table_changed",
                       day=str(np.datetime64(changed[0], "ns"))[:10])  # fmt: skip
        log.warning(file.path.name, text, column="volume")


def find_water(pieces, table, events, name, log):
    """Warn if the level of water rises between two drainings: liquid that no ticket contains.

    Parameters
    ----------
    pieces : levels.Pieces
    table : quantity.table.TankTable
    events : list of dict
    name : str
        File of the levels.
    log : Log
    """
    known = np.isfinite(pieces.water_m)
    time, water = pieces.time_ns[known], pieces.water_m[known]
    drawn = [event["time"] for event in events if event["kind"] == "water_drawn"]
    for part in np.split(np.arange(len(time)), np.searchsorted(time, drawn)):
        if not len(part):
            continue
        days = (time[part] - time[part[0]]) // DAY_NS
        ends = [float(np.median(water[part[days == day]])) for day in (days[0], days[-1])]
        if ends[1] - ends[0] > WATER_M:
            litres = 1000 * float(np.diff(table.volume(np.array(ends)))[0])
            first, last = np.datetime_as_string(time[part[[0, -1]]].view("datetime64[ns]"), "D")
            log.warning(name, message(
                "upkeep_water", "the water rose by {rise:.0f} mm ({litres:.0f} L by the table) "
                "from {first} to {last}: water came in, and is a gain in the balance; expected a "
                "constant level, or an event water_drawn", rise=1000 * (ends[1] - ends[0]),
                litres=litres, first=str(first), last=str(last)), column="water_mm")  # fmt: skip
