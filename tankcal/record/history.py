"""The certificates of one tank over the years, as it is saved: history.json.

Volumes and radii of all tables are on the basis of the newest one, by the steps that `tankcal
compare` makes; what is judged between two tables is what that command says of them.
"""

import tankcal
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, key
from tankcal.record.texts import WarningRecord

HISTORY = SavedFormat("tankcal-history", 1, "history.json")  # so far one version


class CertificateInHistory(Saved):
    """One capacity table with what it was handed out as."""

    certificate: int = key("from the oldest, 1 first")
    file: str = key("where it was found")
    sha256: str = key("of that file")
    origin: str = key('"record" or "table"')
    tank: str | None = key("id of the tank in it; null: not known")
    date: str = key("of the calibration, ISO")
    superseded: str | None = key("date of the next one; null: it is the newest")
    number: str | None = key("of the certificate; null: not given")
    laboratory: str | None = key("null: not given")
    method: str | None = key("as the certificate says it, or what the survey was; null: not known")
    tankcal: str | None = key("version that computed it; null: a table of others")
    nominal_diameter_m: float | None = key("null: not known")
    nominal_height_m: float | None = key("null: not known")
    reference_temperature_c: float | None = key("of the shell; null: not known")
    liquid_density_kg_m3: float | None = key("of the head; 0: without head; null: not known")
    reference_height_m: float | None = key("dip plate to reference point; null: not known")
    zero: str | None = key("what dips count from, as the record calls it; null: not known")
    top_dip_m: float = key("of its last row")
    top_volume_m3: float = key("of its last row, as printed")
    U_top_m3: float | None = key("expanded, of that row, as stated; null: not known")
    k: float | None = key("coverage factor of that U; null: not known")
    rule: str | None = key("decision rule that it was judged by; null: none")
    rule_verdict: str | None = key("code of that verdict, as `rule.code` of a record; null: none")
    sigma0: float | None = key("of its adjusted survey; null: none, or nothing redundant")
    global_test_passed: bool | None = key("of that adjustment; null: not tested")


class RadiusInHistory(Saved):
    """The radius of a course by one table, empty, on the basis of the newest one."""

    certificate: int = key("see certificates")
    course: int = key("from the bottom, 1 first")
    bottom_m: float = key("above the zero of the newest table")
    top_m: float = key("above the zero of the newest table")
    radius_m: float = key("inside")
    U_m: float | None = key("expanded, by U of the volume of the course; null: not known")


class VolumeInHistory(Saved):
    """What one table says at a dip of the newest one, on its basis."""

    certificate: int = key("see certificates")
    height_m: float = key("dip in the newest table")
    volume_m3: float = key("on the basis of the newest table")
    U_m3: float | None = key("expanded; null: not known")
    d_m3: float = key("less that of the newest table")
    E_n: float | None = key("of d, with the correlation of the comparison; null: a U is not known")


class RadiusChange(Saved):
    """How the radius of a course changed from one table to the next."""

    course: int = key("from the bottom, 1 first")
    d_m: float = key("newer less older")
    U_m: float | None = key("expanded, of d, rounding included; null: not known")
    E_n: float | None = key("d over U_m; null: not known")


class TableChange(Saved):
    """One table compared with the one before it."""

    former: int = key("number of the older certificate")
    new: int = key("number of the newer certificate")
    years: float = key("between their dates")
    low_m: float = key("lowest dip that was compared")
    high_m: float = key("highest dip that was compared")
    top_d_m3: float = key("newer less older at the highest dip, on the basis of the newer one")
    U_top_m3: float | None = key("expanded, of that difference; null: not known")
    worst_E_n: float | None = key("largest |E_n| of rows and deliveries judged, with its sign")
    c: float | None = key("correlation declared of both tables; null: none, 0 is taken")
    zero_m: float = key("height of the newer zero above the older one that was taken off")
    zero_source: str = key('"reference_heights", "fitted" or "none"')
    not_made: list[str] = key("steps to one basis that were not made: not declared, not possible")
    verdict: str | None = key('"keep", "recompute" or "recalibrate"; null: nothing to judge by')
    rule: str = key("that the verdict is by")
    radii: list[RadiusChange] = key("from the bottom up; none where courses are not known")


class CheckInHistory(Saved):
    """The worst figure of one check of an inspection."""

    code: str = key("such as plumbness_generatrix")
    unit: str = key('"mm", "mm/m", "1/m" or ""')
    value: float | None = key("with its sign; null: not determined")
    U: float | None = key("expanded; null: not known")
    limit: float | None = key("in that unit; null: none")
    verdict: str = key('"passed", "guard_band", "guard_band_beyond", "failed" or "not_determined"')


class InspectionInHistory(Saved):
    """One inspection of the tank."""

    file: str = key("where it was found")
    sha256: str = key("of that file")
    tank: str = key("id of the tank in it")
    date: str | None = key("of its survey, ISO; null: not known")
    rule: str | None = key("name; null: figures without limits")
    checks: list[CheckInHistory] = key("in their order, the worst of each")


class HistoryFile(Saved, kw_only=True):
    """The certificates of one tank over the years."""

    format: str = key("see Versions", default=HISTORY.format)
    tankcal: str = key("version of tankcal", default=tankcal.__version__)
    notice: str = key("that stands on every page of the newest record's papers, such as EXAMPLE")
    tank: str | None = key("its id, of the newest record; null: not known")
    kind: str | None = key('"vertical", "horizontal", "sphere" or "mesh"; null: not known')
    coverage_k: float = key("factor of a normal distribution that every U was brought to")
    certificates: list[CertificateInHistory] = key("from the oldest to the newest")
    dips_m: list[Finite] = key("that volumes are shown at")
    volumes: list[VolumeInHistory] = key("of each certificate, at each dip")
    radii: list[RadiusInHistory] = key("of each certificate and course; none: not known")
    changes: list[TableChange] = key("between one certificate and the next")
    inspections: list[InspectionInHistory] = key("by their dates, those without one last")
    left_out: list[WarningRecord] = key("files that are not in the history, and why")
    warnings: list[WarningRecord] = key("what should be read")
