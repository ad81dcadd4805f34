"""Chart of a station tank from the sizes of its drawing; no calibration.

U contains the declared accuracy of the sizes only: for each size, the larger change of the volume
at both ends of its interval is the half-width of a rectangular distribution (JCGM 100, 4.3.7 and
5.1.3, note 2). It contains neither dents nor fittings, of which a drawing knows nothing.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from tankcal.errors import HeightError, TankcalError
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper
from tankcal.report.station_chart import MOST_ROWS, layout
from tankcal.tank.heads import End
from tankcal.tank.lying import RingedTank
from tankcal.text.digits import fixed, format_significant, shortest
from tankcal.text.words import load_words

K = 2.0  # coverage factor
KINDS = ("horizontal", "vertical")
ENDS = ("flat", "ellipsoidal", "conical")
STEPS_CM = (1, 2, 5, 10)
LIMITS = {  # smallest and largest value of each entry
    "diameter_m": (0.3, 60.0), "length_m": (0.3, 60.0), "depth_m": (0.0, 5.0),
    "tilt_mm_m": (-50.0, 50.0), "dip_m": (0.0, 60.0), "accuracy_percent": (0.1, 20.0),
    "tilt_accuracy_mm_m": (0.0, 30.0),
}  # fmt: skip


@dataclass(frozen=True)
class Drawing:
    """Inside sizes of a tank, and their accuracy.

    Attributes
    ----------
    kind : {"horizontal", "vertical"}
    diameter_m, length_m : float
        Diameter, and length without the ends or height.
    end : {"flat", "ellipsoidal", "conical"}
        Form of both ends of a lying tank, with its depth_m.
    tilt_mm_m : float
        Rise of the axis from end A to end B.
    dip_m : float or None
        Distance of the dip from end A; None: at mid-length.
    accuracy_percent, tilt_accuracy_mm_m : float
        Half-widths of the intervals of the sizes, and of the tilt.
    step_cm : int
        Step of the rows.
    """

    kind: str = "horizontal"
    diameter_m: float = 0.0
    length_m: float = 0.0
    end: str = "flat"
    depth_m: float = 0.0
    tilt_mm_m: float = 0.0
    dip_m: float | None = None
    accuracy_percent: float = 1.0
    tilt_accuracy_mm_m: float = 5.0
    step_cm: int = 1

    @property
    def top_m(self):
        """Highest dip of the chart."""
        return self.diameter_m if self.kind == "horizontal" else self.length_m

    def volumes_m3(self, dips_m):
        """Volumes (n,) below dips (n,); below the bottom 0, above the top the capacity."""
        dips = np.asarray(dips_m, dtype=float)
        if self.kind == "vertical":
            return math.pi / 4 * self.diameter_m**2 * np.clip(dips, 0, self.length_m)
        end = End(self.end, self.depth_m if self.end != "flat" else 0.0)
        position = self.length_m / 2 if self.dip_m is None else min(self.dip_m, self.length_m)
        tank = RingedTank(
            (self.diameter_m / 2,), (self.length_m,), end, end, self.tilt_mm_m / 1000, position
        )
        volumes = tank.volume_m3(np.clip(dips, 0, tank.top_m))
        return np.where(dips > tank.top_m, tank.capacity_m3, volumes)


def read_drawing(texts):
    """Read a drawing from the texts of a form.

    Parameters
    ----------
    texts : dict
        {entry: text}; a blank text is the default.

    Returns
    -------
    Drawing or None
        None with a problem.
    problems : list of str
        Entries that are missing or out of range.
    """
    values, problems = {}, []
    for field in fields(Drawing):
        text = (texts.get(field.name) or "").strip()
        if field.name in LIMITS:
            values[field.name] = _read_number(field, text, problems)
        elif text:
            values[field.name] = text
    for name, known in {"kind": KINDS, "end": ENDS, "step_cm": tuple(map(str, STEPS_CM))}.items():
        if name in values and values[name] not in known:
            problems.append(name)
    if not problems:
        drawing = Drawing(**(values | {"step_cm": int(values.get("step_cm", 1))}))
        try:
            _refuse_sizes(drawing, problems)
        except (TankcalError, HeightError, ValueError):  # impossible ends or tilt
            problems.append("depth_m")
    return (None, problems) if problems else (drawing, [])


def _refuse_sizes(drawing, problems):
    """Report sizes that have no volume, or too many rows for a page."""
    if drawing.dip_m is not None and drawing.dip_m > drawing.length_m:
        problems.append("dip_m")
    elif drawing.top_m * 100 / drawing.step_cm > MOST_ROWS:
        problems.append("step_cm")
    else:
        chart_rows(drawing)


def _read_number(field, text, problems):
    """Number of an entry; the entry is added to the problems if it is none, or out of range."""
    if not text:
        if field.default == 0.0 and field.name in ("diameter_m", "length_m"):
            problems.append(field.name)
        return field.default
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = math.nan
    low, high = LIMITS[field.name]
    if not low <= value <= high:
        problems.append(field.name)
    return value


def chart_rows(drawing):
    """Rows (cm, volume in m3, U in m3) of a chart."""
    count = math.floor(drawing.top_m * 100 / drawing.step_cm + 1e-7)
    cm = np.arange(count + 1) * drawing.step_cm
    dips = cm / 100
    volumes, variance = drawing.volumes_m3(dips), np.zeros(len(cm))
    for size, half_width in _list_intervals(drawing):
        ends = [
            replace(drawing, **{size: getattr(drawing, size) + sign * half_width})
            for sign in (-1, 1)
        ]
        changes = [np.abs(end.volumes_m3(dips) - volumes) for end in ends]
        variance += np.max(changes, axis=0) ** 2 / 3
    return list(zip(cm.tolist(), volumes.tolist(), (K * np.sqrt(variance)).tolist(), strict=True))


def _list_intervals(drawing):
    """Sizes and half-widths of their intervals."""
    part = drawing.accuracy_percent / 100
    yield "diameter_m", part * drawing.diameter_m
    yield "length_m", part * drawing.length_m
    if drawing.kind == "horizontal":
        if drawing.end != "flat":
            yield "depth_m", part * drawing.depth_m
        yield "tilt_mm_m", drawing.tilt_accuracy_mm_m


def list_settings(drawing):
    """Settings (section, key, text) of a job for the tank of a drawing."""
    if drawing.kind == "vertical":
        sizes = {"nominal_diameter_m": drawing.diameter_m, "nominal_height_m": drawing.length_m}
        return [("tank", key, f"{value:.10g}") for key, value in sizes.items()]
    sizes = {"diameter_m": drawing.diameter_m, "tilt_mm_per_m": drawing.tilt_mm_m}
    if drawing.end != "flat":
        sizes |= {"end_a_depth_m": drawing.depth_m, "end_b_depth_m": drawing.depth_m}
    known = [("horizontal", key, f"{value:.10g}") for key, value in sizes.items()]
    known += [("horizontal", f"end_{end}", drawing.end) for end in "ab"]
    return [*known, ("horizontal", "length_m", f"{drawing.length_m:.10g}")]


def describe_chart(drawing, language):
    """Texts of a chart: capacity, largest U, accuracy of the sizes, and its rows.

    Returns
    -------
    facts : list of (str, str)
    rows : list of (str, str, str)
        Dip in cm, litres, U in litres.
    """
    words = load_words(language)
    paper, rows = PlainPaper(words), chart_rows(drawing)
    marks, labels = paper.marks, words["app"]["drawing"]
    largest = max(U for _, _, U in rows)
    capacity = drawing.volumes_m3([10 * drawing.top_m])[0]
    facts = [
        (labels["capacity"], f"{fixed(1000 * capacity, 0, marks)} L"),
        (labels["largest_U"], f"{format_significant(1000 * largest, 2, marks)} L (k = 2)"),
        (labels["accuracy_percent"], f"± {shortest(drawing.accuracy_percent, marks)} %"),
    ]
    if drawing.kind == "horizontal":
        tilt = shortest(drawing.tilt_accuracy_mm_m, marks)
        facts.append((labels["tilt_accuracy_mm_m"], f"± {tilt} mm/m"))
    shown = [
        (str(cm), fixed(1000 * volume, 0, marks),
         format_significant(1000 * U, 2, marks) if U else "0")
        for cm, volume, U in rows
    ]  # fmt: skip
    return facts, shown


def write_drawing_chart(drawing, tank, language, day):
    """PDF (bytes) of a chart on a page for the wall, marked as no calibration.

    Parameters
    ----------
    drawing : Drawing
    tank : str
        Name of the tank.
    language : str
    day : date
    """
    from tankcal.report.pdf import pdf

    words = load_words(language)["app"]["drawing"]
    facts, rows = describe_chart(drawing, language)
    cells = [[cm, litres] for cm, litres, _ in rows]
    across, size_pt = layout(len(cells), max(len(text) for row in cells for text in row))
    shown = [
        blocks.document(
            title=f"{words['title']} {tank}", language=language, date=day.isoformat(),
            notice=words["no_calibration"], running=[words["title"], ""],
            footer=words["no_calibration"], record_sha256="", dense=True,
        ),
        blocks.chart(tank or words["title"], facts, [("cm", "L")], cells, across=across,
                     size_pt=size_pt, note=words["note"]),
    ]  # fmt: skip
    return pdf([block.data for block in shown])
