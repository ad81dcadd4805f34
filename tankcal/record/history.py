"""History of the certificates of a tank: history.json.

Volumes and radii of all tables are on the basis of the newest table, by the steps of `tankcal
compare`. The verdicts between two tables are verdicts of this command.
"""

import tankcal
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, key
from tankcal.record.texts import WarningRecord

HISTORY = SavedFormat("tankcal-history", 1, "history.json")


class CertificateInHistory(Saved):
    """A capacity table with the data of its certificate."""

    certificate: int = key("from the oldest, 1 first")
    file: str = key("path of the file")
    sha256: str = key("of the file")
    origin: str = key('"record" or "table"')
    tank: str | None = key("id of the tank in it; null: not known")
    date: str = key("of the calibration, ISO")
    superseded: str | None = key("date of the next certificate; null: it is the newest")
    number: str | None = key("of the certificate; null: not given")
    laboratory: str | None = key("null: not given")
    method: str | None = key("by the certificate, or kind of survey; null: not known")
    tankcal: str | None = key("version that computed it; null: a table of others")
    nominal_diameter_m: float | None = key("null: not known")
    nominal_height_m: float | None = key("null: not known")
    reference_temperature_c: float | None = key("of the shell; null: not known")
    liquid_density_kg_m3: float | None = key("of the head; 0: without head; null: not known")
    reference_height_m: float | None = key("dip plate to reference point; null: not known")
    zero: str | None = key("code of the zero in the record; null: not known")
    top_dip_m: float = key("of its last row")
    top_volume_m3: float = key("of its last row, as printed")
    U_top_m3: float | None = key("expanded, of its last row, as stated; null: not known")
    k: float | None = key("coverage factor of U_top_m3; null: not known")
    rule: str | None = key("decision rule; null: none")
    rule_verdict: str | None = key("code of the verdict, as `rule.code` of a record; null: none")
    sigma0: float | None = key("of its adjusted survey; null: none, or no redundancy")
    global_test_passed: bool | None = key("of the adjustment; null: not tested")
    state: str | None = key(
        'in the register: "issued", "replaced", "withdrawn" or "not_registered"; left out without '
        "a register",
        default=None,
        optional=True,
    )
    state_since: str | None = key(
        "date of the state, ISO; left out if not registered", default=None, optional=True
    )


class RadiusInHistory(Saved):
    """The radius of a course by a table, empty, on the basis of the newest table."""

    certificate: int = key("see certificates")
    course: int = key("from the bottom, 1 first")
    bottom_m: float = key("above the zero of the newest table")
    top_m: float = key("above the zero of the newest table")
    radius_m: float = key("inside")
    U_m: float | None = key("expanded, by U of the volume of the course; null: not known")


class VolumeInHistory(Saved):
    """The volume of a table at a dip of the newest table, on the basis of the latter."""

    certificate: int = key("see certificates")
    height_m: float = key("dip in the newest table")
    volume_m3: float = key("on the basis of the newest table")
    U_m3: float | None = key("expanded; null: not known")
    d_m3: float = key("less that of the newest table")
    E_n: float | None = key("of d, with the correlation of the comparison; null: a U is not known")


class RadiusChange(Saved):
    """Change of the radius of a course between successive tables."""

    course: int = key("from the bottom, 1 first")
    d_m: float = key("newer less older")
    U_m: float | None = key("expanded, of d, rounding included; null: not known")
    E_n: float | None = key("d over U_m; null: not known")


class TableChange(Saved):
    """Comparison of a table with the preceding table."""

    former: int = key("number of the older certificate")
    new: int = key("number of the newer certificate")
    years: float = key("between their dates")
    low_m: float = key("lowest compared dip")
    high_m: float = key("highest compared dip")
    top_d_m3: float = key("newer less older at the highest dip, on the basis of the newer table")
    U_top_m3: float | None = key("expanded, of top_d_m3; null: not known")
    worst_E_n: float | None = key("largest |E_n| of rows and deliveries judged, with its sign")
    c: float | None = key("correlation declared of both tables; null: none, 0 is taken")
    zero_m: float = key("height of the newer above the older zero, which was corrected")
    zero_source: str = key('"reference_heights", "fitted" or "none"')
    not_made: list[str] = key("missing steps to a common basis: not declared, not possible")
    verdict: str | None = key('"keep", "recompute" or "recalibrate"; null: no criterion')
    rule: str = key("of the verdict")
    radii: list[RadiusChange] = key("from the bottom up; empty: courses are not known")


class CheckInHistory(Saved):
    """The worst value of a check of an inspection."""

    code: str = key("such as plumbness_generatrix")
    unit: str = key('"mm", "mm/m", "1/m" or ""')
    value: float | None = key("with its sign; null: not determined")
    U: float | None = key("expanded; null: not known")
    limit: float | None = key("in `unit`; null: none")
    verdict: str = key('"passed", "guard_band", "guard_band_beyond", "failed" or "not_determined"')


class InspectionInHistory(Saved):
    """An inspection of the tank."""

    file: str = key("path of the file")
    sha256: str = key("of the file")
    tank: str = key("id of the tank in it")
    date: str | None = key("of its survey, ISO; null: not known")
    rule: str | None = key("name; null: values without limits")
    checks: list[CheckInHistory] = key("in their order, the worst of each")


class MonthInHistory(Saved):
    """A month of an upkeep by everyday data."""

    file: str = key("path of upkeep.json")
    month: str = key("year-month")
    table_sha256: str = key("of the record of the table in force")
    leak_l_h: Finite = key("loss by time")
    leak_U_l_h: Finite = key("expanded")
    throughput_percent: Finite = key("causes proportional to throughput, less their mean")
    throughput_U_percent: Finite = key("expanded")
    verdict: str = key('"pass", "fail" or "inconclusive"')
    alarm: str | None = key("day of the first alarm, if it is in this month")


class HistoryFile(Saved, kw_only=True):
    """History of the certificates of a tank."""

    format: str = key("see Versions", default=HISTORY.format)
    tankcal: str = key("version of tankcal", default=tankcal.__version__)
    notice: str = key("on every page of the reports of the newest record, such as EXAMPLE")
    tank: str | None = key("its id, of the newest record; null: not known")
    kind: str | None = key('"vertical", "horizontal", "sphere" or "mesh"; null: not known')
    coverage_k: float = key("factor of a normal distribution to which all U were converted")
    certificates: list[CertificateInHistory] = key("from the oldest to the newest")
    dips_m: list[Finite] = key("of the shown volumes")
    volumes: list[VolumeInHistory] = key("of each certificate, at each dip")
    radii: list[RadiusInHistory] = key("of each certificate and course; none: not known")
    changes: list[TableChange] = key("between successive certificates")
    inspections: list[InspectionInHistory] = key("by their dates; without date last")
    months: list[MonthInHistory] | None = key(
        "of upkeeps, in their order; left out if there are none", default=None, optional=True
    )
    left_out: list[WarningRecord] = key("excluded files, with the reason")
    warnings: list[WarningRecord] = key("on the history")
