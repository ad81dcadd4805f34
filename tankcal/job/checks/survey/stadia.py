"""Checks of stadia readings: bars, set-ups, angles."""

from tankcal.job.checking import has_rows, tell_missing
from tankcal.job.checks.survey.files import refuse_undefined
from tankcal.job.checks.survey.readings import check_angle
from tankcal.job.contract.registers import KIND
from tankcal.messages import message


def bars_of(registers):
    """{name: {key: value}} of the stadia bars of instruments.toml."""
    instruments = registers["instruments"]
    return {name: keys for name, keys in instruments.items() if is_bar(keys["kind"])}


def is_bar(kind):
    """Return True for the kind of a stadia bar, in any spelling."""
    return (kind or "").strip().lower() == KIND


def bars_used(table, bars):
    """Bar of each reading, shape (n,); blank: the only bar; None: several bars."""
    only = next(iter(bars)) if len(bars) == 1 else None
    return [only if name is None else name for name in table.of("bar")]


def check_bars(files, table):
    """Check the stadia bars of instruments.toml, and the references of readings to them."""
    bars = bars_of(files.registers)
    for name, given in bars.items():
        for key in ("length_m", "u_mm"):
            if given[key] is None:
                expected = message(
                    "bar_not_described",
                    "missing; expected it of a stadia: distances are read against its length",
                )
                files.tell_key(files.log.problem, "instruments", name, key, expected)
    if files.raw.registers.get("instruments", 0) is None:  # unreadable, reported already
        return
    if not files.registers["instruments"]:
        tell_missing(files.log, files.raw.file_of("instruments"), table.file, "bar")
        return
    reported = set()
    for row, bar in zip(table.rows, bars_used(table, bars), strict=True):
        if bar not in bars and bar not in reported:
            reported.add(bar)
            expected = message(
                "no_such_bar",
                "found {name!r}; expected a stadia of {file}: kind = stadia, length_m, u_mm",
                name=bar or "",
                file=files.raw.file_of("instruments"),
            )
            files.log.problem(table.file, expected, row, "bar")


def check_stadia(files):
    """Check all stadia readings and their bars."""
    table = files.tables["stadia"]
    if not has_rows(table):
        return
    setups = files.tables["setups"]
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    refuse_undefined(files, table, "setup", defined, "setups")
    check_angle(files, table, "angle")
    check_bars(files, table)
    stations = {}
    if setups is not None:
        stations = dict(zip(setups.of("setup"), setups.of("station"), strict=True))
    for row, setup, to in zip(table.rows, table.of("setup"), table.of("to"), strict=True):
        if to is not None and stations.get(setup) == to:
            refuse_itself(files.log, table, row, to)


def refuse_itself(log, table, row, to):
    """Report a bar on the station of its own set-up."""
    expected = message(
        "stadia_at_itself",
        "found station {to!r} of the set-up itself; expected another one",
        to=to,
    )
    log.problem(table.file, expected, row, "to")
