"""Checks of the sequence of rows in liquid.csv: starts, signs, dips, temperatures, units."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.job.checking import UNIT_FACTOR
from tankcal.job.checks.extent import volume_by_sizes
from tankcal.job.checks.survey.readings import tell_rows
from tankcal.messages import message
from tankcal.methods.liquid.columns import TEMPERATURES

ABOVE_TOP_M, ABOVE_TOP = 0.05, 0.03  # a dip above the nominal top: length, share of the height
BELOW_BOTTOM_M = 0.3  # a dip below the nominal bottom
CHECK, REST = "check", "rest"
TELLING = 20.0  # smallest change of level, in sds of a dip, for a comparison with sizes
UNLIKE = (0.7, 1.4)  # plausible volume of a batch over that from nominal sizes
GUESSES = (  # (smallest and largest ratio of volumes, hint at the unit)
    (700.0, 1400.0, message("in_litres", ": is it in litres?")),
    (190.0, 360.0, message("in_gallons", ": is it in US gallons?")),
    (5.0, 8.0, message("in_barrels", ": is it in barrels?")),
    (25.0, 46.0, message("in_cubic_feet", ": is it in cubic feet?")),
)


@dataclass(frozen=True)
class Step:
    """Liquid filled between two dips that are used.

    Attributes
    ----------
    place : int
        Index of the row of the second dip.
    volume_m3 : float
        Metered volume.
    before_m, after_m : float
        Dips.
    """

    place: int
    volume_m3: float
    before_m: float
    after_m: float


def place_runs(table):
    """{run: indices of its rows} of liquid.csv, in the order of the rows."""
    places = {}
    for place, run in enumerate(table.of("run")):
        if run is not None:
            places.setdefault(run, []).append(place)
    return places


def steps_of(table):
    """Steps of all runs, without steps that lack a dip.

    The volume of a row whose dip is not used is added to the next step.
    """
    volumes, dips, uses = (table.of(name) for name in ("volume_m3", "dip_m", "use"))
    steps = []
    for places in place_runs(table).values():
        previous, volume = None, 0.0
        for k, place in enumerate(places):
            if k and volume is not None:
                volume = None if volumes[place] is None else volume + volumes[place]
            if uses[place] == CHECK:
                continue
            if None not in (previous, dips[place], volume):
                steps.append(Step(place, volume, previous, dips[place]))
            previous, volume = dips[place], 0.0
    return steps


def check_runs(table, values, extent, raw, log):
    """Check single rows, runs, and dips against the size of the tank.

    Parameters
    ----------
    table : ColumnValues
        liquid.
    values, extent : dict, Extent
        Settings and size of the tank; None: the settings are unreadable.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
    """
    runs = place_runs(table)
    if not table.skipped:
        broken = _check_order(table, log)
        for run, places in runs.items():
            _check_start(table, run, places, log)
            _check_batches(table, run, places, log)
            _check_times(table, places, log)
        _check_dips(table, runs, log)
        _check_signs(table, broken, log)
    _check_temperatures(table, runs, log)
    if extent is not None and _check_levels(table, extent, log):
        _check_units(table, volume_by_sizes(values, raw), extent, values, log)


def _check_order(table, log):
    """Report runs whose rows are not consecutive; returns the names of these runs."""
    last, last_rows, broken = None, {}, []
    for row, run in zip(table.rows, table.of("run"), strict=True):
        if run is not None and run != last and run in last_rows:
            expected = message(
                "run_apart",
                "run {run!r} ended in row {last}; expected its rows one after the other, or another"
                " name",
                run=run,
                last=last_rows[run],
            )
            log.problem(table.file, expected, row, "run")
            broken.append(run)
        last, last_rows[run] = run, row
    return broken


def _check_start(table, run, places, log):
    first, row = places[0], table.rows[places[0]]
    volume = table.of("volume_m3")[first]
    if volume:
        expected = message(
            "run_without_start",
            "found {volume:g} in the first row of run {run!r}; expected 0 there: it has the dip"
            " that the run starts from, the batches follow",
            volume=volume,
            run=run,
        )
        log.problem(table.file, expected, row, "volume_m3")
    elif len(places) == 1:
        expected = message(
            "run_of_one_row",
            "run {run!r} has one row; expected its start and a batch at least",
            run=run,
        )
        log.problem(table.file, expected, row, "run")
    if table.of("use")[first] in (CHECK, REST):
        expected = message(
            "start_not_used",
            "found {use}; expected adjust: the run counts from its first dip",
            use=table.of("use")[first],
        )
        log.problem(table.file, expected, row, "use")


def _check_batches(table, run, places, log):
    """Report batches of 0, and dips at rest with a batch or without times."""
    volumes, uses, times = (table.of(name) for name in ("volume_m3", "use", "time"))
    for before, place in pairwise(places):
        if uses[place] == REST:
            _check_rest(table, (run, place, volumes[place]), (times[before], times[place]), log)
        elif volumes[place] == 0:
            expected = message(
                "batch_of_nothing",
                "found 0 within run {run!r}; expected what the meter showed since the row above; of"
                " a dip that was read again give the mean, or write use = rest and the times where"
                " hours passed; for a new run another name",
                run=run,
            )
            log.problem(table.file, expected, table.rows[place], "volume_m3")


def _check_rest(table, step, times, log):
    run, place, volume = step
    if volume:
        expected = message(
            "batch_at_rest",
            "found {volume:g} with use = rest in run {run!r}; expected 0: nothing passes the meter"
            " while the liquid is at rest",
            volume=volume,
            run=run,
        )
        log.problem(table.file, expected, table.rows[place], "volume_m3")
    if None in times:
        expected = message(
            "rest_without_time",
            "a dip at rest in run {run!r} without its time or that of the row above; expected both:"
            " they give the duration that a leak is divided by",
            run=run,
        )
        log.problem(table.file, expected, table.rows[place], "time")


def _check_dips(table, runs, log):
    """Report rows without a dip, except for the first row of each run."""
    dips = table.of("dip_m")
    needed = {place for places in runs.values() for place in places[1:]}
    is_blank = [
        dips[place] is None and place in needed and not log.has(table.file, row, "dip_m")
        for place, row in enumerate(table.rows)
    ]
    expected = message(
        "dip_missing_in_run",
        "blank; expected the dip: only the first row of a run may have none, where the tank was"
        " empty and dry",
    )
    tell_rows(log.problem, table, is_blank, "dip_m", expected)


def _check_times(table, places, log):
    times, last = table.of("time"), None
    for place in places:
        if times[place] is None:
            continue
        if last is not None and times[place] < last:
            expected = message(
                "dip_before_its_batch",
                "earlier than the row above of the same run; expected rows in the order of the"
                " work",
            )
            log.warning(table.file, expected, table.rows[place], "time")
        last = times[place]


def _check_signs(table, broken, log):
    """Report dips that contradict the sign of the batch, except in interrupted runs."""
    runs = table.of("run")
    for step in steps_of(table):
        if runs[step.place] in broken:
            continue
        rise = step.after_m - step.before_m
        figures = {"after": step.after_m, "before": step.before_m, "volume": step.volume_m3}
        if step.volume_m3 > 0 and rise <= 0:
            expected = message(
                "dip_does_not_rise",
                "found {after:g} after {before:g} and {volume:g} m3 more; expected a higher dip: is"
                " one misread, or was the tank drawn off?",
                **figures,
            )
        elif step.volume_m3 < 0 and rise >= 0:
            expected = message(
                "dip_does_not_fall",
                "found {after:g} after {before:g} and {volume:g} m3; expected a lower dip: is one"
                " misread, or the sign of the volume?",
                **figures,
            )
        else:
            continue
        log.problem(table.file, expected, table.rows[step.place], "dip_m")


def _check_temperatures(table, runs, log):
    """Require each temperature in all rows that need it or in none; meter and tank together."""
    dips = table.of("dip_m")
    starts = {places[0] for places in runs.values()}
    uses = table.of("use")
    of_batches = [
        place for place in range(len(table.rows)) if place not in starts and uses[place] != REST
    ]
    of_dips = [place for place in range(len(table.rows)) if dips[place] is not None]
    absent = []
    for column in TEMPERATURES:
        given = table.of(column)
        if table.columns[column] is None:
            absent.append(column)
            continue
        needed = of_batches if column.startswith("meter") else of_dips
        blank = [
            table.rows[place]
            for place in needed
            if given[place] is None and not log.has(table.file, table.rows[place], column)
        ]
        if blank:
            expected = message(
                "temperature_in_some_rows",
                "blank in {count} of {all} rows that need it; expected it in all of them, or in"
                " none (no correction)",
                count=len(blank),
                all=len(needed),
            )
            log.problem(table.file, expected, blank[0], column)
    of_liquid = [column for column in TEMPERATURES[:2] if column in absent]
    if len(of_liquid) == 1:
        (missing,) = of_liquid
        (other,) = set(TEMPERATURES[:2]) - {missing}
        expected = message(
            "one_temperature_of_liquid",
            "blank, but {other} is given; expected both or none: a batch is brought from the one to"
            " the other",
            other=other,
        )
        log.problem(table.file, expected, None, missing)
    elif absent:
        expected = message(
            "volumes_not_reduced",
            "no readings of {columns}: nothing is corrected for them",
            columns=absent,
        )
        log.warning(table.file, expected)


def _check_levels(table, extent, log):
    """Report dips outside the tank; returns False if a problem was found."""
    dips, lowest, top = table.numbers("dip_m"), extent.lowest_m, extent.top_m
    if top is None and extent.height_m is not None:
        top = 1.2 * extent.height_m  # the zero of the table is not known
    is_valid = True
    for row, dip in zip(table.rows, dips, strict=True):
        if top is not None and dip > top + max(ABOVE_TOP_M, ABOVE_TOP * top):
            expected = message(
                "dip_above_tank",
                "found {dip:g}; expected at most {top:.4g} m, the top of the tank{hint}",
                dip=dip,
                top=top,
                hint=_unit_of_dip(dip, top),
            )
        elif lowest is not None and dip < lowest - BELOW_BOTTOM_M:
            expected = message(
                "dip_below_tank",
                "found {dip:g}; expected at least {lowest:.4g} m, the bottom of the tank",
                dip=dip,
                lowest=lowest,
            )
        else:
            continue
        log.problem(table.file, expected, row, "dip_m")
        is_valid = False
    return is_valid


def _unit_of_dip(dip, top):
    for scale, hint in (
        (3.3, message("dip_in_feet", ": is it in feet?")),
        (100.0, message("dip_in_centimetres", ": is it in centimetres?")),
    ):
        if dip <= scale * top:
            return hint
    return ""


def _check_units(table, volume, extent, values, log):
    """Compare the batches with the nominal volume between their dips.

    volume is a function of the dip, m3; None: the nominal dimensions are not known.
    """
    steps = [] if volume is None else steps_of(table)
    default_sd = values["liquid"]["s_dip_mm"]
    sds = [(sd or default_sd or 0.0) / 1000 for sd in table.of("s_dip_mm")]
    comparable = []
    for step in steps:
        nominal = volume(step.after_m) - volume(step.before_m)
        is_clear = abs(step.after_m - step.before_m) > TELLING * sds[step.place]
        if is_clear and nominal * step.volume_m3 > 0:
            comparable.append((step, nominal, step.volume_m3 / nominal))
    if not comparable:
        return
    ratio = float(np.median([ratio for *_, ratio in comparable]))
    if not 1 / UNIT_FACTOR < ratio < UNIT_FACTOR:
        expected = message(
            "batches_in_other_unit",
            "most batches are {ratio:.3g} times what a tank of these sizes holds between their"
            " dips; expected cubic metres{hint}",
            ratio=ratio,
            hint=_unit_of_volume(ratio),
        )
        log.problem(table.file, expected, None, "volume_m3")
        return
    for step, nominal, ratio in comparable:
        is_inside = _is_clear_of_ends(step, extent, values)
        if is_inside and not UNLIKE[0] < ratio < UNLIKE[1]:
            expected = message(
                "batch_unlike_sizes",
                "{found_m3:g} m3 from a dip of {before_m:g} m to {after_m:g} m, where a tank of"
                " these sizes holds {held_m3:.4g} m3: a batch missing, a dip misread, a valve that"
                " passed?",
                found_m3=step.volume_m3,
                before_m=step.before_m,
                after_m=step.after_m,
                held_m3=nominal,
            )
            log.warning(table.file, expected, table.rows[step.place], "volume_m3")


def _is_clear_of_ends(step, extent, values):
    """Return True if small errors of nominal dimensions do not affect the volume of the step."""
    low, high = sorted((step.before_m, step.after_m))
    if values["tank"]["kind"] == "vertical":
        shell = values["datum"]["bottom_z_m"]
        highest = [z for z in (shell, values["bottom"]["centre_z_m"]) if z is not None]
        zero = values["datum"]["dip_plate_z_m"]
        zero = shell if zero is None else zero
        return zero is not None and low >= max(highest, default=zero) - zero
    height = extent.height_m
    return height is not None and 0.15 * height < low and high < 0.85 * height


def _unit_of_volume(ratio):
    for low, high, hint in GUESSES:
        if low < ratio < high:
            return hint
    return ""
