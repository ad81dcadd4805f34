"""Tapes, obstructions, comparisons and gauge readings of a job, in SI."""

import numpy as np

from tankcal.survey.strapping import Comparison, Obstruction, Tape

LEAST_GAUGE_SD_M = 5e-5  # smallest standard deviation of the mean of gauge readings


def strapping_equipment(tables, tapes):
    """Tapes {name: {key: value}}, obstructions and comparisons as arguments of `Strapping`."""
    return {
        "tapes": tuple(_tape(name, given) for name, given in tapes.items()),
        "obstructions": _obstructions(tables["obstructions"]),
        "comparisons": _comparisons(tables["tape_checks"]),
    }


def mean_plates(table):
    """{course: (mean plate, sd of the mean, mean paint or None)} of the gauge readings, m."""
    if table is None:
        return {}
    courses, means = table.of("course"), {}
    plates, sds, paints = (
        table.numbers(f"{name}_mm") / 1000 for name in ("thickness", "s", "paint")
    )
    for name in dict.fromkeys(courses):
        rows = np.array([course == name for course in courses])
        given = plates[rows]
        # sd of the mean, from the given sds; else from the scatter of the readings.
        if np.all(np.isfinite(sds[rows])):
            sd = np.sqrt(np.mean(sds[rows] ** 2) / len(given))
        else:
            sd = np.std(given, ddof=1) / np.sqrt(len(given)) if len(given) > 1 else 0.0
        painted = paints[rows & np.isfinite(paints)]
        paint = float(np.mean(painted)) if len(painted) else None
        means[name] = (float(np.mean(given)), float(max(sd, LEAST_GAUGE_SD_M)), paint)
    return means


def metres(millimetres):
    """Length in m from mm; None if not given."""
    return None if millimetres is None else millimetres / 1000


def _tape(name, given):
    stretches = given["section_mm2"] and given["e_gpa"]
    return Tape(
        name,
        correction=given["correction"] or 0.0,
        correction_m=(given["correction_mm"] or 0.0) / 1000,
        temperature_c=given["certified_temperature_c"],
        tension_n=given["tension_n"],
        expansion_per_k=given["expansion_per_k"] or 0.0,
        thickness_m=(given["thickness_mm"] or 0.0) / 1000,
        friction=given["friction"] or 0.0,
        stiffness_n=1e3 * given["section_mm2"] * given["e_gpa"] if stretches else np.inf,
        u_scale=_sd(given["u_scale_ppm"]) / 1e6,
        u_offset_m=_sd(given["u_offset_mm"]) / 1000,
        laying_m=(given["laying_mm"] or 0.0) / 1000,
        master=given["master"] or "",
        certificate=given["certificate"] or "",
        weight_n_per_m=given["weight_n_per_m"] or 0.0,
    )


def _sd(given):
    """Standard uncertainty; 0 if not given or to be estimated."""
    return 0.0 if given is None or isinstance(given, str) else given


def _obstructions(table):
    if table is None:
        return {}
    obstructions = {}
    lengths = [f"{name}_mm" for name in ("thickness", "width", "over", "arc", "excess")]
    columns = map(table.of, ("circumference", "kind", "count", *lengths, "span_m", "s_mm"))
    for name, kind, count, *sizes, span, s_mm in zip(*columns, strict=True):
        sizes = map(metres, sizes)
        item = Obstruction(kind, count or 1.0, *sizes, span_m=span, sd_m=(s_mm or 0.0) / 1000)
        obstructions.setdefault(name, []).append(item)
    return {name: tuple(items) for name, items in obstructions.items()}


def _comparisons(table):
    if table is None:
        return ()
    columns = map(table.of, ("level", "master_m", "working_m", "s_mm", "when"))
    return tuple(
        Comparison(level, master, working, (s_mm or 0.0) / 1000, when or "")
        for level, master, working, s_mm, when in zip(*columns, strict=True)
    )
