"""Provenance of an exported table, and statements about its errors in the report."""

from tankcal.messages import message

_SURVEYS = ("strapping", "lines", "clouds", "hits", "tangents", "liquid", "adjustment")


def provenance_lines(record, sha256):
    """Return lines of provenance: the table, its references, its uncertainty; a tuple of Message.

    record: record.making.Record; sha256: SHA-256 of its file.
    """
    table, capacity = record.job.table, record.capacity
    provenance = message("export_record", "record SHA-256 {sha256}, tankcal {version}",
                         sha256=sha256, version=record.tankcal)  # fmt: skip
    theoretical = message("export_theoretical", "theoretical table: no survey of the tank stands "
                          "behind it")  # fmt: skip
    temperature = message("export_temperature", "reference temperature of the shell {celsius:.4g} "
                          "C", celsius=table.reference_temperature_c)  # fmt: skip
    U_top = message(
        "export_U_top", "U of the highest row: {U:.4g} L (k = {k:.3g}) of {volume:.1f} L",
        U=1000 * capacity.stated_U_m3[-1], k=capacity.k[-1], volume=1000 * capacity.volume_m3[-1],
    )  # fmt: skip
    return [
        _tank(record),
        provenance,
        *([] if is_surveyed(record) else [theoretical]),
        temperature,
        _density(record),
        _zero(record),
        *_roof(record),
        _expansion(record),
        U_top,
        *_least_delivery(record),
    ]


def report_lines(export):
    """Return the lines of the report of an `Export`: its errors and further facts, as Messages."""
    profile, litres = export.profile, 1000 * export.error_m3
    rows = message(
        "export_rows", "{points} of the {rows} rows of the table, dips {low:.6g} to {high:.6g} m, "
        "for {name}", points=len(export.dip_m), rows=export.rows, low=export.dip_m[0],
        high=export.dip_m[-1], name=profile.name,
    )  # fmt: skip
    error = message(
        "export_error", "largest error of what is read there: {error:.4g} L, worst at the dip "
        "{at:.6g} m; rounding included, and {own:.4g} L that straight lines between the rows of "
        "the table err themselves", error=litres, at=export.at_m,
        own=1000 * export.interpolation_m3,
    )  # fmt: skip
    lines = [rows, error, message("export_error_delivery", "of a delivery up to twice that: "
                                  "{twice:.4g} L", twice=2 * litres)]  # fmt: skip
    if profile.interpolation == "spline":
        lines.append(
            message(
                "export_spline",
                "for natural cubic splines between the rows: a "
                "program that reads straight lines must not use this file",
            )
        )
    if export.left_out_m is not None:
        lines.append(
            message(
                "export_top_left_out",
                "the highest row, {dip:.6g} m, is on no level of this profile and is left out: "
                "above {high:.6g} m the file says nothing",
                dip=export.left_out_m,
                high=export.dip_m[-1],
            )
        )
    if export.rounded_levels:
        lines.append(
            message(
                "export_rounded",
                "levels that had to be rounded: {count}; the error above counts it",
                count=export.rounded_levels,
            )
        )
    if not profile.verified:
        lines.append(
            message(
                "export_not_verified",
                "the profile was not verified with the system's own text: {source}",
                source=profile.source,
            )
        )
    if profile.remark:
        lines.append(message("export_remark", "{remark}", remark=profile.remark))
    return lines if export.gauge is None else [*lines, _hytd(export.gauge)]


def _hytd(gauge):
    return message(
        "export_hytd", "HyTD of a gauge that hangs on the shell: starting level {start:.2f} m, "
        "deformation factor {factor:.4f} mm/m; off by at most {off:.3f} mm. It corrects the level "
        "of the gauge; the head that this table has is another thing",
        start=gauge.start_m, factor=1000 * gauge.factor, off=1000 * gauge.off_m,
    )  # fmt: skip


def is_surveyed(record):
    """Whether any quantity of the tank was measured, not only declared."""
    if record.job.tank.kind == "mesh":
        return True
    return record.points != [] or any(getattr(record, survey) is not None for survey in _SURVEYS)


def _tank(record):
    tank = record.job.tank.id
    number = record.job.certificate.get("number")
    if not number:
        return message("export_tank", "tank {tank}, without the number of a certificate", tank=tank)
    return message("export_tank_certificate", "tank {tank}, certificate {number}",
                   tank=tank, number=str(number))  # fmt: skip


def _density(record):
    head = next((choice.value for choice in record.choices if choice.code == "head"), "none")
    if not isinstance(head, int | float):
        return message("export_no_head", "head of the liquid: none in this table")
    return message("export_head", "with the head of a liquid of {density:.5g} kg/m3: not to be "
                   "applied again", density=float(head))  # fmt: skip


def _zero(record):
    reference = record.job.datum.reference_height_m
    plate = record.capacity.zero == "dip_plate"
    zero = message("export_from_bottom", "dips count from the bottom")
    if plate:
        zero = message("export_from_plate", "dips count from the dip plate")
    if reference is None:
        return message("export_zero", "{zero}; reference height not given", zero=zero)
    return message("export_zero_reference", "{zero}; reference height {reference:.6g} m",
                   zero=zero, reference=reference)  # fmt: skip


def _roof(record):
    roof = {roof.code: roof.value for roof in record.roof or ()}
    mass = roof.get("roof_mass")
    if mass is None:
        return []
    weighing = message("export_in_vacuum", "weighed in vacuum")
    if roof.get("roof_weighing") == "air":
        weighing = message("export_in_air", "weighed in air")
    text = message(
        "export_roof", "floating roof of {mass:.6g} kg ({weighing}) at {density:.5g} kg/m3 is "
        "taken off; critical zone {low:.6g} to {high:.6g} m",
        mass=mass, weighing=weighing, density=roof.get("roof_reference_density", 0.0),
        low=roof.get("roof_critical_bottom", 0.0), high=roof.get("roof_critical_top", 0.0),
    )  # fmt: skip
    return [text]


def _expansion(record):
    material, heights = record.job.material, record.job.table.height_expansion
    ppm = 1e6 * material.expansion_per_k
    if heights:
        return message("export_expansion_3a", "expansion of the shell {ppm:.4g} ppm/K, of heights,"
                       " too", ppm=ppm)  # fmt: skip
    return message("export_expansion_2a", "expansion of the shell {ppm:.4g} ppm/K, not of heights",
                   ppm=ppm)  # fmt: skip


def _least_delivery(record):
    if not record.deliveries:
        return []
    least = min(record.deliveries, key=lambda delivery: delivery.minimum_m)
    worst = least.at_minimum or least.relative
    text = message(
        "export_U_delivery", "U of the least delivery ({height:.4g} m): at most {U:.4g} L of "
        "{volume:.1f} L", height=least.minimum_m, U=1000 * worst.U_m3,
        volume=1000 * worst.volume_m3,
    )  # fmt: skip
    return [text]
