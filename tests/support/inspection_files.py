"""An inspection as it is saved, its numbers from known truths: a lean, peaks at welds, levels.

plain()            everything: a leaning shell, welds from a cloud, two epochs and their difference
few()              a sparse survey: an epoch without sd, welds not determined, limits that were read
unjudged()         no rule, no wall: levels of the bottom alone
hostile()          texts that a spreadsheet, a browser or a typesetter could take for commands
"""

from copy import deepcopy
from functools import cache
from statistics import NormalDist

import numpy as np

from tankcal.record.inspection import (
    EdgeProfile,
    Generatrices,
    InspectedLevel,
    InspectedTank,
    InspectionCheck,
    InspectionFile,
    InspectionLimit,
    InspectionRule,
    Settlement,
    SettlementPoint,
    WeldGap,
)
from tankcal.record.schema import WarningRecord, to_plain

HOSTILE = '=HYPERLINK("http://x.example","y") <script>alert(1)</script>'
TYPESET = "#strong[x] $E$ \\n @ref _a_ ^b {c}"
K = 1.96
LEAN = np.array([2.10e-3, -1.30e-3])  # of the axis; 2.470 mm/m, 1/405, towards 121.76 deg
COURSE_M = 11.9 / 6
DIAMETER_M, HEIGHT_M = 21.3, 11.9
YIELD_PA, E_PA = 160e6, 206e9
Z_MM = (113.8, 109.5, 100.9, 97.1, 96.2, 87.1, 81.1, 82.4, 86.8, 89.5, 92.0, 103.6, 111.9, 117.1,
        118.1, 116.3)  # fmt: skip
EARLIER_MM = (103.1, 100.4, 92.2, 89.6, 89.1, 82.4, 77.6, 79.5, 82.9, 84.8, 86.6, 96.0, 102.9,
              107.3, 107.6, 105.8)  # fmt: skip


def limit(name, value, clause, verified=False):
    """A limit of the rule."""
    return InspectionLimit(name, value, clause, verified)


def check(code, unit, value, U, bound=None, *, remark=None, values=None, used=24, reading=None,
          **place):  # fmt: skip
    """A figure judged with guard bands on both sides of its limit, by the normal distribution."""
    where = {key: place.get(key) for key in ("course", "height_m", "azimuth_deg", "epoch")}
    verdict, probability = "not_determined", None
    if bound is not None and value is not None and U is not None and remark != "gap_too_uncertain":
        verdict, probability = _judged(code, value, U, bound.value)
    return InspectionCheck(
        code=code, unit=unit, value=value, U=U, k=None if U is None else K, used=used, limit=bound,
        probability=probability, verdict=verdict, remark=remark, remark_values=values or {},
        reading=reading, U_reading=None if reading is None else U, **where,
    )  # fmt: skip


def _judged(code, value, U, most):
    if code == "settlement_cosine":  # at least
        return ("passed" if value >= most else "failed"), None
    normal = NormalDist(value, U / K)
    probability = normal.cdf(most) - normal.cdf(-most)
    if abs(value) > most:
        return ("failed" if abs(value) - U > most else "guard_band_beyond"), probability
    return ("passed" if abs(value) + U <= most else "guard_band"), probability


# ---- the wall


@cache
def wall():
    """Generatrices, levels and heights of a leaning shell with a flat side."""
    azimuth = np.arange(0, 360, 15.0)
    heights = np.concatenate([COURSE_M * course + np.array([0.3, 1.0, 1.7]) for course in range(6)])
    turn = np.radians(azimuth)
    outwards = np.array([np.sin(turn), np.cos(turn)])
    form_mm = 6 * np.cos(2 * turn - 0.4) - 9 * np.exp(-(((azimuth - 200) / 25) ** 2))
    departure, levels = [], []
    for number, height in enumerate(heights):
        rise = height - heights[0]
        grown = form_mm * (0.4 + 0.9 * rise / HEIGHT_M) + 1.2 * np.sin(5 * turn + number)
        start = form_mm * 0.4 + 1.2 * np.sin(5 * turn)
        departure.append(1e3 * rise * (LEAN @ outwards) + grown - start)
        if number % 3 == 0:
            centre = LEAN * rise
            levels.append(_level(height, number // 3 + 1, centre, azimuth, grown))
    of_course = [number // 3 + 1 for number in range(len(heights))]
    return Generatrices(
        azimuth_deg=azimuth.tolist(), height_m=heights.tolist(), course=of_course,
        departure_mm=np.array(departure).tolist(),
        U_mm=np.full((len(heights), len(azimuth)), 2.4).tolist(),
    ), levels  # fmt: skip


def _level(height, course, centre, azimuth, departure):
    return InspectedLevel(
        height_m=float(height), course=course,
        mean_radius_m=DIAMETER_M / 2 + 1e-3 * float(departure.mean()),
        centre_x_m=float(centre[0]), centre_y_m=float(centre[1]), azimuth_deg=azimuth.tolist(),
        departure_mm=departure.tolist(), U_mm=np.full(len(azimuth), 1.8).tolist(),
    )  # fmt: skip


def gap_of(peak_mm, width_m, along_m):
    """What a board of 914 mm shows of peak exp(-|s| / w), its ends on the shell."""
    end = peak_mm * np.exp(-0.457 / width_m)
    return peak_mm * np.exp(-np.abs(along_m) / width_m) - end


def welds():
    """Gaps of the vertical welds of six courses, and of the horizontal ones between them."""
    along = np.linspace(-0.457, 0.457, 37)
    found = []
    for course in range(1, 7):
        for plate in range(8):
            peak = [8.0, -3.0, 5.5, 1.5, -6.4, 2.2, 0.8, 4.1][plate] * (1.0 - 0.12 * (course - 1))
            azimuth = (45.0 * plate + 15.0 * course) % 360
            place = COURSE_M * (course - 0.5)
            found.append(_gap("peaking", course, place, azimuth, peak, along, 1.1))
            if course < 6:
                joint = COURSE_M * course
                found.append(_gap("banding", course, joint, azimuth, -0.9 * peak, along, 1.6))
    return found


def _gap(kind, course, height, azimuth, peak, along, U):
    profile = gap_of(peak, 0.15, along)
    reached = profile[np.abs(along) <= 0.15]
    return WeldGap(
        kind=kind, course=course, height_m=float(height), azimuth_deg=azimuth,
        gap_mm=float(reached[np.argmax(np.abs(reached))]), U_mm=U,
        along_mm=(1e3 * along).tolist(), profile_mm=profile.tolist(),
    )  # fmt: skip


# ---- the bottom


def settlement(z_mm, sd_mm, epoch, since=None):
    """Settlement of points every 22.5 degrees, by the formulas that are published."""
    z = np.array(z_mm)
    azimuth = 360.0 / len(z) * np.arange(len(z))
    turn = np.radians(azimuth)
    design = np.column_stack([np.ones(len(z)), np.cos(turn), np.sin(turn)])
    (a, p, q), *_ = np.linalg.lstsq(design, z, rcond=None)
    u = z - design @ [a, p, q]
    s = u - (np.roll(u, 1) + np.roll(u, -1)) / 2
    b = float(np.hypot(p, q))
    arc = np.pi * DIAMETER_M / len(z)
    bound = 11e3 * arc**2 * YIELD_PA / (2 * E_PA * HEIGHT_M)
    U_S = None if sd_mm is None else 1.2244 * K * sd_mm
    points = [
        SettlementPoint(
            point=f"P{number + 1}", azimuth_deg=float(azimuth[number]), z_mm=float(z[number]),
            s_mm=sd_mm, fitted_mm=float(z[number] - u[number]), U_i_mm=float(u[number]),
            S_i_mm=float(s[number]), U_S_mm=U_S, in_subset=number % 2 == 0,
        )
        for number in range(len(z))
    ]  # fmt: skip
    return Settlement(
        epoch=epoch, since=since, a_mm=float(a), p_mm=float(p), q_mm=float(q), b_mm=b,
        U_b_mm=None if sd_mm is None else K * sd_mm * float(np.sqrt(2 / len(z))),
        highest_azimuth_deg=float(np.degrees(np.arctan2(q, p)) % 360),
        tilt_mm_per_m=b / (DIAMETER_M / 2),
        R2=float(1 - np.sum(u**2) / np.sum((z - z.mean()) ** 2)), sd_known=sd_mm is not None,
        arc_m=float(arc), limit_mm=float(bound), limit_half_mm=float(4 * bound),
        subset_arc_m=float(2 * arc), subset_limit_mm=float(4 * bound), harmonics=4,
        curvature_per_m=3.8e-4, U_curvature_per_m=None if sd_mm is None else 0.9e-4,
        curvature_limit_per_m=11 * YIELD_PA / (E_PA * HEIGHT_M), points=points,
    )  # fmt: skip


def checks_of(found):
    """The checks of a settlement, its epoch in each."""
    worst = max(found.points, key=lambda one: abs(one.S_i_mm))
    annex = "Annex B, B.3.2.1, by a secondary source"
    epoch = found.epoch if found.since is None else f"{found.epoch} - {found.since}"
    place = {"azimuth_deg": worst.azimuth_deg, "epoch": epoch}
    bounds = {
        "cosine": limit("settlement_r2", 0.90, annex),
        "all": limit("settlement_s", found.limit_mm, annex),
        "half": limit("settlement_s", found.subset_limit_mm, annex),
        "curvature": limit("settlement_curvature", found.curvature_limit_per_m, annex),
        "de_beer": limit("settlement_de_beer", 1e3 * found.arc_m / 450, "De Beer, by a forum"),
    }
    U, sub = worst.U_S_mm, None if worst.U_S_mm is None else worst.U_S_mm
    return [
        check("settlement_cosine", "", found.R2, 0.02, bounds["cosine"], epoch=epoch,
              used=16),
        check("settlement_all", "mm", worst.S_i_mm, U, bounds["all"], used=16,
              reading=None if U is None else worst.S_i_mm + 0.5, **place),
        check("settlement_subset", "mm", 7.93, sub, bounds["half"], used=8, **place),
        check("settlement_curvature", "1/m", found.curvature_per_m, found.U_curvature_per_m,
              bounds["curvature"], used=16, epoch=epoch),
        check("settlement_de_beer", "mm", worst.S_i_mm, U, bounds["de_beer"], used=16, **place),
    ]  # fmt: skip


def edges():
    """Three radial lines of the bottom's edge: flat up to a break, then down."""
    found = []
    for number, azimuth in enumerate((20.0, 140.0, 260.0)):
        radius = np.linspace(8.6, 10.6, 11)
        start = 9.4 + 0.2 * number
        fall = np.clip((radius - start) / (10.65 - start), 0, None)
        drop = 38.0 + 12 * number
        found.append(
            EdgeProfile(
                azimuth_deg=azimuth, radius_m=radius.tolist(),
                z_mm=(4 * np.sin(3 * radius) - drop * fall**1.6).tolist(), break_radius_m=start,
                width_m=10.65 - start, drop_mm=drop, U_mm=4.2, limit_mm=60.0,
            )
        )  # fmt: skip
    return found


# ---- whole files


def _tank(**changed):
    known = {
        "id": "T-12", "name": "inspected-tank", "source": "record", "file": "record.json",
        "sha256": "5d" * 32, "survey_date": "2026-03-18", "survey_side": "outside",
        "methods": ["scan"], "nominal_diameter_m": DIAMETER_M, "nominal_source": "drawing",
        "height_m": HEIGHT_M, "state": "as_found",
    }  # fmt: skip
    return InspectedTank(**known | changed)


def _rule(**changed):
    known = {
        "name": "API 653 (as quoted elsewhere)", "file": "api_653.toml", "verified": False,
        "source": "secondary sources: ballots, articles and forums; see each limit",
        "remark": "No value was read in the text of the standard",
    }  # fmt: skip
    return InspectionRule(**known | changed)


def _of_wall(generatrices, levels):
    departure = np.array(generatrices.departure_mm)
    row, column = np.unravel_index(np.argmax(np.abs(departure)), departure.shape)
    lowest, highest = levels[0], max(levels, key=lambda one: max(map(abs, one.departure_mm)))
    plumb = limit("plumbness_rebuilt", 119.0, "10.5.2, quoted in a ballot: H/100, at most 127 mm")
    found = [
        check("plumbness_axis", "mm", 2.470 * 10.9, 1.6, plumb, azimuth_deg=121.76),
        check("plumbness_generatrix", "mm", float(departure[row, column]), 2.4, plumb,
              height_m=generatrices.height_m[row], azimuth_deg=generatrices.azimuth_deg[column]),
        check("plumbness_course", "mm", -7.1, 2.4,
              limit("plumbness_course", 1e3 * COURSE_M / 250, "10.5.2"), course=5,
              azimuth_deg=195.0),
    ]  # fmt: skip
    for code, level, most, clause in (
        ("roundness_low", lowest, 19.0, "10.5.3, table"),
        ("roundness_high", highest, 57.0, "10.5.3"),
    ):
        place = int(np.argmax(np.abs(level.departure_mm)))
        found.append(
            check(code, "mm", level.departure_mm[place], 1.8, limit(code, most, clause),
                  course=level.course, height_m=level.height_m,
                  azimuth_deg=level.azimuth_deg[place])
        )  # fmt: skip
    return found


def _of_welds(gaps):
    found = []
    for kind, most in (("peaking", 12.7), ("banding", 25.4)):
        worst = max((one for one in gaps if one.kind == kind), key=lambda one: abs(one.gap_mm))
        found.append(
            check(kind, "mm", worst.gap_mm, worst.U_mm, limit(kind, most, "10.5.4"),
                  course=worst.course, height_m=worst.height_m, azimuth_deg=worst.azimuth_deg,
                  used=sum(one.kind == kind for one in gaps))
        )  # fmt: skip
    return found


@cache
def inspection():
    """The `InspectionFile` of `plain`."""
    generatrices, levels = wall()
    gaps, lines = welds(), edges()
    change = tuple(np.subtract(Z_MM, EARLIER_MM))
    epochs = [
        settlement(EARLIER_MM, 1.0, "2019"),
        settlement(Z_MM, 1.0, "2026"),
        settlement(change, 2**0.5, "2026", since="2019"),
    ]
    edge = limit("edge_settlement", 60.0, "Annex B, figure, from memory")
    checks = [
        *_of_wall(generatrices, levels),
        *_of_welds(gaps),
        *(one for epoch in epochs for one in checks_of(epoch)),
        check("edge_settlement", "mm", 66.0, 4.2, edge, azimuth_deg=260.0, used=3),
        check("bottom_bulge", "mm", 47.0, 5.0, limit("bottom_bulge", 45.0, "Annex B"), used=1),
    ]
    return InspectionFile(
        notice="EXAMPLE", tank=_tank(), rule=_rule(), as_built=True, checks=checks,
        generatrices=generatrices, levels=levels, gaps=gaps, settlements=epochs, edges=lines,
        warnings=[],
    )  # fmt: skip


@cache
def _plain():
    return to_plain(inspection())


def plain():
    """Everything that an inspection may hold."""
    return deepcopy(_plain())


def few():
    """A sparse survey and one epoch without standard deviations; the limits were read."""
    found = plain()
    found["rule"] |= {"verified": True, "name": "House rule", "file": "house.toml"}
    found["as_built"] = False
    found["notice"] = ""
    found["tank"] |= {
        "source": "job", "sha256": None, "survey_date": None, "survey_side": "inside",
        "methods": ["straps", "lines"], "nominal_source": "mean", "state": "unloaded",
    }  # fmt: skip
    one = settlement(Z_MM, None, "survey")
    found["settlements"] = [to_plain(one)]
    found["gaps"] = [
        one | {"gap_mm": None, "U_mm": None, "along_mm": [], "profile_mm": []}
        for one in found["gaps"][:6]
    ]
    found["edges"] = []
    wanted = ("plumbness_axis", "plumbness_generatrix", "roundness_low")
    kept = [one for one in found["checks"] if one["code"] in wanted]
    more = [
        *(check(kind, "mm", None, None, limit(kind, 12.7, "10.5.4"), used=0,
                remark="gap_too_uncertain", values={"u_mm": 4.1, "most_mm": 3.175})
          for kind in ("peaking", "banding")),
        *checks_of(one),
    ]  # fmt: skip
    found["checks"] = kept + [to_plain(one) for one in more]
    for one in found["checks"]:
        one["limit"]["verified"] = True
    return found


def unjudged():
    """Levels of the bottom alone, without a rule."""
    found = plain()
    found["checks"] = [
        one | {"limit": None, "probability": None, "verdict": "not_determined"}
        for one in found["checks"]
        if one["code"].startswith("settlement") and one["epoch"] == "2019"
    ]
    nothing = ("limit_mm", "limit_half_mm", "subset_limit_mm", "curvature_limit_per_m")
    first = found["settlements"][0] | dict.fromkeys(nothing)
    empty = {"generatrices": None, "levels": [], "gaps": [], "edges": [], "rule": None}
    tank = {"survey_side": None, "methods": [], "nominal_diameter_m": None,
            "nominal_source": "none", "height_m": None}  # fmt: skip
    return found | empty | {
        "settlements": [first], "as_built": False, "tank": found["tank"] | tank,
    }  # fmt: skip


def hostile():
    """Texts that a spreadsheet, a browser or a typesetter could take for commands."""
    found = plain()
    long = f"{HOSTILE} {'very_long_name_of_a_file_' * 4}.csv"
    found["tank"] |= {"id": "=T-1", "name": f"{TYPESET} {HOSTILE}", "file": long}
    found["rule"] |= {"name": f"@SUM(A1) {TYPESET}", "file": "mine.toml", "remark": HOSTILE}
    found["notice"] = "EXAMPLE #1 & <b>"
    for one in found["checks"]:
        one["limit"] |= {"clause": f"=1+1 {TYPESET}"}
        if one["epoch"]:
            one["epoch"] = f"=1+1 $x$ {one['epoch']}"
    for one in found["settlements"]:
        one["epoch"] = f"=1+1 $x$ {one['epoch']}"
        one["since"] = one["since"] and f"=1+1 $x$ {one['since']}"
        for number, point in enumerate(one["points"]):
            point["point"] = f"-2+3 #{number} $y$ {'long' * 12}"
    found["checks"][2] |= {"remark": "unheard_of", "remark_values": {"x": HOSTILE, "y": 2.5}}
    text = f"{TYPESET} {HOSTILE}"
    warning = WarningRecord(file=long, row=None, column=None, text=text, code=None, values={})
    return found | {"warnings": [to_plain(warning)]}


KINDS = {"plain": plain, "few": few, "unjudged": unjudged, "hostile": hostile}
