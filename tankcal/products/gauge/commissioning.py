"""Commissioning of a gauge from the checked comparison, also for `tankcal verify`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.errors import InputError, Problem
from tankcal.gum.components import Source
from tankcal.gum.conformity import probability_of, verdict_of
from tankcal.messages import message
from tankcal.products.exports.exporting import gauge_correction, shortening_m
from tankcal.products.gauge import saved
from tankcal.products.gauge.deviation import (
    expand,
    fit_line,
    slope_of_tilt,
    sources_of_dips,
    tilt_of_slope,
)
from tankcal.products.gauge.reading import (
    LEAST_RANGE,
    READINGS,
    SETTINGS,
    TAPE,
    read_files,
    read_saved_comparison,
    read_tank,
    shell_of,
)
from tankcal.products.gauge.saved import GAUGE, GaugeRecord
from tankcal.products.recomputing import compare_values, find_record
from tankcal.products.settings import drop_blanks, fill_blanks
from tankcal.record.manifest import digest_of
from tankcal.record.schema import from_plain, to_plain, warnings_of

STEPS_M = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # between two rows of the corrections
MOST_ROWS = 25  # of the corrections
MM = 1000.0


def commission(comparison):
    """Compute the deviation, corrections, zeros and decision of a comparison.

    Returns
    -------
    saved.GaugeFile
    """
    share = comparison.u["u_movement_percent"] / 100
    line = fit_line(comparison.dips, comparison.known_slope, share)
    levels = _levels(comparison, line)
    zeros, zero_columns = _zeros(comparison, line)
    declared = comparison.sections
    reference, table_reference = _reference_heights(comparison)
    return saved.GaugeFile(
        notice=declared["certificate"]["notice"] or (comparison.tank.notice if comparison.tank
                                                     else ""),
        tank=declared["gauge"]["tank"] or comparison.tank.tank,
        coverage_probability=comparison.probability,
        certificate=saved.GaugeCertificate(
            **{name: declared["certificate"][name] for name in
               ("number", "date", "by", "place", "customer", "note", "language")},
        ),
        gauge=saved.GaugeInstrument(
            **{name: declared["gauge"][name] for name in
               ("maker", "model", "serial", "principle", "certificate", "resolution_mm",
                "supported_by", "lowest_m", "highest_m", "scale_ppm", "u_scale_ppm")},
            corrects_head=bool(declared["gauge"]["corrects_head"]),
        ),
        tape=saved.GaugeTape(
            serial=declared["tape"]["serial"],
            certificate=declared["tape"]["certificate"],
            **fill_blanks(declared["tape"], TAPE),
        ),
        liquid=declared["liquid"]["name"],
        reference_height_m=reference,
        U_reference_mm=None if reference is None else zeros[-1].U_mm,
        table_reference_height_m=table_reference,
        levels=levels,
        line=_line(comparison, line),
        zeros=zeros,
        head=_head(comparison),
        corrections=_corrections(comparison, line, zeros[1].z_mm, zero_columns),
        budget=_budget(comparison, line),
        uncertainties=[
            saved.GaugeInput(name, value, declared["uncertainty"][name] is None)
            for name, value in comparison.u.items()
        ],
        decision=_decision(declared["limit"], levels),
        record=comparison.tank,
        inputs=drop_blanks(declared),
        readings=readings_of(comparison.table),
        files=[saved.GaugeSource(*file) for file in comparison.files],
        warnings=warnings_of([*comparison.warnings, *_warnings(comparison, line, zeros)]),
    )  # fmt: skip


def readings_of(table):
    """`saved.GaugeReading` of each row of readings.csv."""
    return [
        saved.GaugeReading(row, **record)
        for row, record in zip(table.rows, table.records(), strict=True)
    ]


def _movement(comparison, level_m):
    """Movement h of the gauge at levels; 0 where none is modelled."""
    level_m = np.asarray(level_m, dtype=float)
    if comparison.movement is None:
        return np.zeros_like(level_m)
    return comparison.movement(level_m)


def _levels(comparison, line):
    """`GaugeLevel` of each level, judged by the limit."""
    dips, limit = comparison.dips, comparison.sections["limit"]
    u, U, dof, k = expand(sources_of_dips(dips, line), comparison.probability)
    has_limit = limit["source"] is not None
    levels = []
    for row, name in enumerate(comparison.names):
        deviation = MM * float(dips.deviation_m[row])
        bound = probability = verdict = None
        if has_limit:
            # The larger of both limits applies, as is usual for gauges.
            relative = 10 * (limit["relative_percent"] or 0.0) * float(dips.level_m[row])
            bound = max(limit["absolute_mm"] or 0.0, relative)
            probability = probability_of(deviation, MM * u[row], bound, dof[row])
            guard = MM * float(U[row]) if limit["rule"] == "guarded" else 0.0
            verdict = verdict_of(deviation, guard, bound)
        levels.append(
            saved.GaugeLevel(
                name=name,
                count=int(comparison.counts[row]),
                dip_m=float(dips.level_m[row]),
                gauge_m=float(dips.gauge_m[row]),
                movement_mm=MM * float(dips.movement_m[row]),
                deviation_mm=deviation,
                U_mm=MM * float(U[row]),
                k=float(k[row]),
                residual_mm=MM * float(line.residuals_m[row]),
                w=float(line.w[row]),
                limit_mm=bound,
                probability=probability,
                verdict=verdict,
            )
        )
    return levels


def _decision(limit, levels):
    """`GaugeDecision` with the gravest verdict; None without a limit."""
    if limit["source"] is None:
        return None
    verdict = min((level.verdict for level in levels), key=saved.VERDICTS.index)
    return saved.GaugeDecision(limit["source"], limit["rule"], limit["absolute_mm"],
                               limit["relative_percent"], verdict)  # fmt: skip


def _line(comparison, line):
    """`GaugeLine`: offset, slope, and the parts of the slope by pipe and scale."""
    probability, gauge = comparison.probability, comparison.sections["gauge"]
    _, U, _, k = expand(line.sources, probability)
    slope = float(line.unknowns[1])
    k_normal = comparison.k_normal
    pipe = U_pipe = scale = U_scale = tilt = kind = low = high = None
    of_slope = [replace(s, columns_m3=s.columns_m3[1:]) for s in line.sources]
    if comparison.sections["pipe"]["tilt_deg"] is not None:
        angles = np.radians(
            [comparison.sections["pipe"][name] for name in ("tilt_deg", "u_tilt_deg")]
        )
        pipe, u_pipe = slope_of_tilt(*angles)
        U_pipe, scale = k_normal * u_pipe, slope - pipe
        U_scale = _expand_slope([*of_slope, Source("pipe", np.array([[u_pipe]]))], probability)
        if not line.is_slope_estimated:  # the declared scale
            scale, U_scale = gauge["scale_ppm"] * 1e-6, k_normal * gauge["u_scale_ppm"] * 1e-6
    if line.is_slope_estimated:
        is_known = gauge["scale_ppm"] is not None
        kind = "estimated" if is_known else "equivalent"
        part = slope - (gauge["scale_ppm"] or 0.0) * 1e-6
        u_scale = (gauge["u_scale_ppm"] or 0.0) * 1e-6
        U_part = _expand_slope([*of_slope, Source("scale", np.array([[u_scale]]))], probability)
        tilt, low, high = (
            float(np.degrees(tilt_of_slope(value)))
            for value in (part, part - U_part, part + U_part)
        )
    return saved.GaugeLine(
        is_slope_estimated=line.is_slope_estimated,
        mean_level_m=line.mean_level_m,
        offset_mm=MM * float(line.unknowns[0]),
        U_offset_mm=MM * float(U[0]),
        k_offset=float(k[0]),
        slope_mm_per_m=MM * slope,
        U_slope_mm_per_m=MM * float(U[1]),
        k_slope=float(k[1]),
        dof=line.dof,
        sigma0=line.sigma0,
        probability=line.probability,
        is_scatter_estimated=line.is_scatter_estimated,
        pipe_mm_per_m=None if pipe is None else MM * pipe,
        U_pipe_mm_per_m=None if pipe is None else MM * U_pipe,
        scale_mm_per_m=None if scale is None else MM * scale,
        U_scale_mm_per_m=None if scale is None else MM * U_scale,
        tilt_deg=tilt,
        tilt_is=kind,
        U_tilt_low_deg=low,
        U_tilt_high_deg=high,
    )


def _expand_slope(sources, probability):
    return float(expand(sources, probability)[1][0])


def _reference_heights(comparison):
    """Reference heights of today and of the capacity table, m; None: not known."""
    declared = comparison.sections["reference"]
    table = declared["table_height_m"]
    if table is None and comparison.tank is not None:
        table = comparison.tank.reference_height_m
    return declared["height_m"], table


def _zeros(comparison, line):
    """(`GaugeZero`s above the dip plate, {source: effect of u on -z of the table, m})."""
    u, declared = comparison.u, comparison.sections["zeros"]
    k = comparison.k_normal
    reference, table_reference = _reference_heights(comparison)
    columns, z_table, source = {}, None, "unknown"
    if declared["table_zero_m"] is not None:
        z_table, source = declared["table_zero_m"] - declared["dip_plate_m"], "levelled"
        columns = {"zeros": np.hypot(u["u_dip_plate_mm"], u["u_table_zero_mm"]) / MM}
    elif None not in (reference, table_reference):
        # Both heights end at the reference point: z of the table = H - H of the table.
        z_table, source = reference - table_reference, "reference_heights"
        columns = {
            "reference height": -u["u_reference_mm"] / MM,
            "table reference height": u["u_table_reference_mm"] / MM,
        }
    U_table = k * MM * float(np.linalg.norm([*columns.values()])) if columns else None
    # The gauge indicates 0 where L + D(L) = 0.
    level, _, sources = _solve_levels(comparison, line, np.zeros(1))
    U_gauge = MM * float(expand(sources, comparison.probability)[1][0])
    zeros = [
        saved.GaugeZero("dip_plate", 0.0, 0.0, "definition"),
        saved.GaugeZero("table", None if z_table is None else MM * z_table, U_table, source),
        saved.GaugeZero("gauge", MM * float(level[0]), U_gauge, "line"),
    ]
    if reference is not None:
        U_reference = k * u["u_reference_mm"]
        zeros.append(saved.GaugeZero("reference", MM * reference, U_reference, "tape"))
    return zeros, columns


def _solve_levels(comparison, line, indication):
    """(levels, deviations, sources) at indications; the deviation is a function of the level."""
    level = indication
    for _ in range(3):
        deviation, sources = line.at(level, _movement(comparison, level))
        level = indication - deviation
    return level, deviation, sources


def _corrections(comparison, line, z_table_mm, zero_columns):
    """`GaugeCorrection`s over the levels in use."""
    gauge, dips = comparison.sections["gauge"], comparison.dips
    indication = _indications(gauge["lowest_m"], gauge["highest_m"])
    level, deviation, sources = _solve_levels(comparison, line, indication)
    _, U, _, k = expand(sources, comparison.probability)
    to_table = [None] * len(level)
    U_table = [None] * len(level)
    if z_table_mm is not None:
        to_table = [MM * float(-value) - z_table_mm for value in deviation]
        U_table = MM * expand(_join(sources, zero_columns), comparison.probability)[1]
    outside = (level < dips.level_m[0] - 0.5 * STEPS_M[0]) | (
        level > dips.level_m[-1] + 0.5 * STEPS_M[0]
    )
    return [
        saved.GaugeCorrection(
            gauge_m=float(indication[row]),
            correction_mm=-MM * float(deviation[row]),
            U_mm=MM * float(U[row]),
            k=float(k[row]),
            table_correction_mm=to_table[row],
            U_table_mm=None if U_table[row] is None else float(U_table[row]),
            is_outside=bool(outside[row]),
        )
        for row in range(len(level))
    ]


def _join(sources, zero_columns):
    """Sources of -D - z of the table; the reference height may be in both."""
    joined, rest = [], dict(zero_columns)
    for source in sources:
        columns = -source.columns_m3 + rest.pop(source.kind, 0.0)
        joined.append(replace(source, columns_m3=columns))
    count = len(sources[0].columns_m3)
    added = (Source(kind, np.full((count, 1), value)) for kind, value in rest.items())
    return [*joined, *added]


def _indications(low, high):
    """Indications of the table of corrections: both ends, and round values between them."""
    step = next((s for s in STEPS_M if (high - low) / s <= MOST_ROWS - 2), (high - low) / MOST_ROWS)
    inner = step * np.arange(np.floor(low / step) + 1, np.ceil(high / step))
    return np.unique(np.round([low, *inner, high], 6))


def _budget(comparison, line):
    """`GaugeContribution`s at the lowest, mean and highest compared level, the largest first."""
    dips = comparison.dips
    levels = np.array([dips.level_m[0], line.mean_level_m, dips.level_m[-1]])
    _, sources = line.at(levels, _movement(comparison, levels))
    rows = []
    for source in sources:
        u = MM * np.linalg.norm(source.columns_m3, axis=1)
        rows.append(saved.GaugeContribution(source.kind, *map(float, u), source.dof))
    return sorted(rows, key=lambda row: -max(row.low_mm, row.middle_mm, row.high_mm))


def _head(comparison):
    """`GaugeHead` of a gauge that the shell carries; None without courses or density."""
    gauge, tank = comparison.sections["gauge"], comparison.tank
    density = comparison.sections["liquid"]["density_kg_m3"]
    if gauge["supported_by"] != "shell" or tank is None or not tank.courses or density is None:
        return None
    shell = shell_of(tank, density)
    best = gauge_correction(gauge["highest_m"], *shell)
    top = MM * float(shortening_m([gauge["highest_m"]], *shell)[0])
    share = comparison.u["u_movement_percent"] / 100
    return saved.GaugeHead(
        is_modelled=comparison.movement is not None,
        density_kg_m3=density,
        top_mm=top,
        U_top_mm=comparison.k_normal * share * top,
        start_m=best.start_m,
        factor_mm_per_m=MM * best.factor,
        off_mm=MM * best.off_m,
    )


def _warnings(comparison, line, zeros):
    """Yield `Problem`s of the result: scatter, levels, range, reference heights, zeros."""
    gauge, dips = comparison.sections["gauge"], comparison.dips
    if line.is_scatter_estimated:
        text = message("gauge_scatter", "the residuals scatter {factor:.1f} times as much as "
                       "declared (probability {p:.3f}): U is taken from the residuals",
                       factor=line.sigma0, p=line.probability)  # fmt: skip
        yield Problem(READINGS, text)
    for name, w in zip(comparison.names, line.w, strict=True):
        if np.isfinite(w) and abs(w) > CRITICAL:
            text = message(
                "gauge_level_off",
                "the level {name} does not agree with the line: w = {w:.1f} (limit {limit:.2f})",
                name=name,
                w=w,
                limit=CRITICAL,
            )
            yield Problem(READINGS, text)
    if not line.is_slope_estimated:
        text = message("gauge_slope_declared", "{count} levels do not determine the scale: the "
                       "declared scale is used", count=len(comparison.names))  # fmt: skip
        yield Problem(READINGS, text)
    compared, used = np.ptp(dips.level_m), gauge["highest_m"] - gauge["lowest_m"]
    if compared < LEAST_RANGE * used:
        text = message("gauge_short_range", "the levels cover {compared:.2f} m of {used:.2f} m in "
                       "use: corrections outside are extrapolated, with their U",
                       compared=compared, used=used)  # fmt: skip
        yield Problem(READINGS, text)
    heights = _reference_heights(comparison)
    if None not in heights:
        moved = MM * (heights[0] - heights[1])
        u = np.hypot(comparison.u["u_reference_mm"], comparison.u["u_table_reference_mm"])
        U = comparison.k_normal * u
        if abs(moved) > U:
            text = message("gauge_reference_moved", "the reference height differs from that of the "
                           "table by {moved:+.1f} mm, U = {U:.1f} mm: dip plate or reference "
                           "point have moved, or a height is wrong", moved=moved, U=U)  # fmt: skip
            yield Problem(SETTINGS, text, None, "reference.height_m")
    if zeros[1].z_mm is None:
        text = message(
            "gauge_zero_unknown",
            "the zero of the table is not linked to the dip plate: declare both reference heights, "
            "or [zeros]",
        )
        yield Problem(SETTINGS, text, None, "zeros.table_zero_m")


def compute_again(saved, folder):
    """Compute a saved comparison again from its readings.

    The saved readings and settings are also compared with the input files, and the saved facts of
    the tank with its record, if these files are found.

    Parameters
    ----------
    saved : dict
        Content of gauge.json.
    folder : Path
        Folder of the input files.

    Returns
    -------
    count : int
        Number of the compared values.
    problems : list of Problem
        Differences.
    notes : list of Message
        Checks that were not possible.

    Raises
    ------
    InputError
        If the inputs are not those of a comparison.
    """
    folder, facts = Path(folder), saved["record"]
    again, notes = {}, []
    files = _find_inputs(saved, folder)
    if files is None:
        notes.append(
            message(
                "verify_gauge_inputs",
                "{folder} does not contain the input files with the SHA-256 stated in {file}; "
                "readings and settings were taken from {file}",
                folder=str(folder),
                file=GAUGE.file,
            )
        )
    else:
        sections, table = read_files(*files)
        again |= {"inputs": drop_blanks(sections), "readings": to_plain(readings_of(table))}
    if facts is not None:
        record = _find_record(saved, folder)
        if record is None:
            notes.append(
                message(
                    "verify_gauge_record",
                    "the record of the tank is not in {folder}: its values were taken from {file}",
                    folder=str(folder),
                    file=GAUGE.file,
                )
            )
        else:
            again["record"] = to_plain(read_tank(record))
    comparison = read_saved_comparison(
        saved["inputs"],
        saved["readings"],
        None if facts is None else from_plain(GaugeRecord, facts, GAUGE.file),
        tuple((file["file"], file["sha256"]) for file in saved["files"]),
    )
    result = to_plain(commission(comparison))
    for name in ("format", "tankcal", "files", "inputs", "readings", "record"):
        del result[name]
    return *compare_values(GAUGE.file, _comparable(saved), _comparable(again | result)), notes


def _comparable(gauge):
    """Content of gauge.json, without the rows and the English texts of its warnings."""
    keys = ("file", "column", "code", "values")
    warnings = [{key: warning[key] for key in keys} for warning in gauge["warnings"]]
    return {**gauge, "warnings": warnings}


def _find_inputs(saved, folder):
    """Paths of gauge.toml and readings.csv with the saved SHA-256; None if one is missing."""
    paths = [folder / file["file"] for file in saved["files"]]
    is_found = len(paths) == 2 and paths[1].name == READINGS
    for path, file in zip(paths, saved["files"], strict=True):
        is_found = is_found and path.is_file() and digest_of(path) == file["sha256"]
    return paths if is_found else None


def _find_record(saved, folder):
    """The record.json of the tank: as named in gauge.toml, or below the folder of the inputs."""
    places = [folder]
    named = saved["inputs"].get("gauge", {}).get("record")
    if isinstance(named, str):
        places.insert(0, folder / named)
    for place in places:
        try:
            path = find_record(place, saved["record"]["sha256"])
        except InputError:
            continue
        if path is not None:
            return path
    return None
