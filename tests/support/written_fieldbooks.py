"""One simulated survey written in each format of instruments, by the public descriptions of these.

Nothing of `tankcal.products.fieldbooks` is used: what is written here is read there.

    written(survey, "gsi16")    the text of a file

A survey is a list of Stand; a reading is on face 1 or, with the errors of an instrument, on face 2.
"""

import datetime
from dataclasses import dataclass, replace

START = datetime.datetime(2026, 7, 14, 9, 0, 0)


@dataclass(frozen=True)
class Aim:
    """One reading on one face: degrees as the circles show them, metres."""

    point: str
    direction: float
    zenith: float
    distance: float
    face: int = 1
    height: float = 0.0
    code: str = ""
    time: datetime.datetime = START


@dataclass(frozen=True)
class Stand:
    """A set-up: name of its station, height of the instrument, (east, north, height), readings."""

    station: str
    height: float
    xyz: tuple
    aims: tuple


def both_faces(aims, collimation=0.0, index=0.0):
    """Each reading on face 1 and on face 2, by an instrument with these errors (degrees)."""
    import math

    found = []
    for one in aims:
        across = collimation / math.sin(math.radians(one.zenith))
        found.append(replace(one, direction=(one.direction + across) % 360,
                             zenith=one.zenith + index))  # fmt: skip
        found.append(replace(one, direction=(one.direction + 180 - across) % 360,
                             zenith=360 - one.zenith + index, face=2))  # fmt: skip
    return tuple(found)


def _dms(angle, decimals):
    """(degrees, minutes, units of a second's 10^-decimals) of an angle, rounded once."""
    per = 3600 * 10**decimals
    total = round(angle * per) % (360 * per)
    degrees, rest = divmod(total, per)
    return degrees, *divmod(rest, 60 * 10**decimals)


def _packed(angle, decimals=1):
    degrees, minutes, seconds = _dms(angle, decimals)
    return f"{degrees}.{minutes:02d}{seconds:0{2 + decimals}d}"


ANGLE_UNITS = {"2": 400 / 360 * 1e5, "3": 1e5, "5": 6400 / 360 * 1e4}
LENGTH_UNITS = {"0": 1e3, "1": 1e3 / 0.3048, "6": 1e4, "7": 1e4 / 0.3048, "8": 1e5}


def gsi(survey, *, width=16, angle="2", length="8", newline="\r\n"):
    """GSI-8 or GSI-16 in any of its units."""

    def word(start, value, text=False):
        sign = "-" if not text and value < 0 else "+"
        body = str(value) if text else str(abs(value))
        assert len(body) <= width, body
        return f"{start}{sign}{body.zfill(width)}"

    def of_length(index, metres):
        return word(f"{index}..0{length}", round(metres * LENGTH_UNITS[length]))

    def of_angle(index, degrees):
        if angle == "4":
            whole, minutes, tenths = _dms(degrees, 1)
            return word(f"{index}.324", int(f"{whole}{minutes:02d}{tenths:03d}"))
        return word(f"{index}.32{angle}", round(degrees * ANGLE_UNITS[angle]))

    lines, mark = [], "*" if width == 16 else ""

    def block(name, words):
        start = word(f"11{len(lines) + 1:04d}", name, text=True)
        lines.append(mark + " ".join([start, *words]) + " ")

    for stand in survey:
        x, y, z = stand.xyz
        block(stand.station, [of_length(i, v) for i, v in
                              (("84", x), ("85", y), ("86", z), ("88", stand.height))])  # fmt: skip
        for one in stand.aims:
            more = [word("71....", one.code, text=True)] if one.code else []
            clock = [word("17....", f"{one.time:%d%m%Y}", text=True),
                     word("19....", f"{one.time:%m%d%H%M}", text=True)]  # fmt: skip
            constants = "51....+" + "0".zfill(width - 4) + "+000"
            block(one.point, [of_angle("21", one.direction), of_angle("22", one.zenith),
                              of_length("31", one.distance), constants,
                              of_length("87", one.height), *more, *clock])  # fmt: skip
    return newline.join(lines) + newline


def rw5(survey, *, unit="1", decimals=2):
    """RW5 with angles to the right of a backsight at zero."""
    per = {"0": 0.3048, "1": 1.0, "2": 1200 / 3937}[unit]
    lines = ["JB,NMTANK,DT07-14-2026,TM08:55:00",
             f"MO,AD0,UN{unit},SF1.00000000,EC0,EO0.0,AU0"]  # fmt: skip
    for stand in survey:
        x, y, z = (one / per for one in stand.xyz)
        lines += [f"OC,OP{stand.station},N {y:.5f},E {x:.5f},EL{z:.5f},--",
                  f"BK,OP{stand.station},BP99,BS0.0000,BC0.0000"]  # fmt: skip
        rod = None
        for one in stand.aims:
            if one.height != rod:
                rod = one.height
                lines.append(f"LS,HI{stand.height / per:.6f},HR{rod / per:.6f}")
            kind = {1: "SS", 2: "FR"}[one.face]
            lines.append(
                f"{kind},OP{stand.station},FP{one.point},AR{_packed(one.direction, decimals)},"
                f"ZE{_packed(one.zenith, decimals)},SD{one.distance / per:.6f},--{one.code}"
            )
            lines += [f"--DT{one.time:%m-%d-%Y}", f"--TM{one.time:%H:%M:%S}"]
    return "\n".join(lines) + "\n"


def jobxml(survey, *, prism=-0.034, ppm=12.0, declared="true"):
    """JobXML whose distances are raw: without prism constant and ppm."""
    rows = ['<?xml version="1.0" encoding="UTF-8"?>', '<JOBFile jobName="TANK" version="5.72">',
            "<Environment/>", "<FieldBook>",
            f'<AtmosphereRecord ID="a"><PPM>{ppm}</PPM>'
            f"<ApplyPPMToRawDistances>{declared}</ApplyPPMToRawDistances>"
            "</AtmosphereRecord>"]  # fmt: skip
    if declared != "true":
        ppm = 0.0
    number = 0
    for stand in survey:
        x, y, z = stand.xyz
        number += 1
        here = f"s{number}"
        rows.append(
            f'<PointRecord ID="k{number}"><Name>{stand.station}</Name><Method>KeyedIn</Method>'
            f"<Deleted>false</Deleted><Grid><North>{y!r}</North><East>{x!r}</East>"
            f"<Elevation>{z!r}</Elevation></Grid></PointRecord>"
        )
        rows.append(
            f'<StationRecord ID="{here}" TimeStamp="2026-07-14T08:55:00"><StationName>'
            f"{stand.station}</StationName><TheodoliteHeight>{stand.height}</TheodoliteHeight>"
            "<AtmosphereID>a</AtmosphereID></StationRecord>"
        )
        for one in stand.aims:
            number += 1
            constant = 0.0 if one.code else prism  # what has a code is read without a reflector
            raw = one.distance / (1 + ppm * 1e-6) - constant
            rows.append(
                f'<TargetRecord ID="t{number}"><PrismConstant>{constant}</PrismConstant>'
                f"<TargetHeight>{one.height}</TargetHeight></TargetRecord>"
            )
            rows.append(
                f'<PointRecord ID="p{number}" TimeStamp="{one.time:%Y-%m-%dT%H:%M:%S}">'
                f"<Name>{one.point}</Name><Code>{one.code}</Code><Method>DirectReading</Method>"
                "<Classification>Normal</Classification><Deleted>false</Deleted><Circle>"
                f"<HorizontalCircle>{one.direction:.10f}</HorizontalCircle>"
                f"<VerticalCircle>{one.zenith:.10f}</VerticalCircle>"
                f"<EDMDistance>{raw:.6f}</EDMDistance><Face>Face{one.face}</Face></Circle>"
                f"<StationID>{here}</StationID><TargetID>t{number}</TargetID></PointRecord>"
            )
    return "\n".join([*rows, "</FieldBook>", "</JOBFile>"]) + "\n"


def sdr(survey, *, wide=True, angle="1", length="1", order="1", zero="1"):
    """SDR33 (wide) or SDR20."""
    name, number = (16, 16) if wide else (4, 10)
    turn = {"1": 1.0, "2": 400 / 360, "4": 6400 / 360}[angle]
    per = {"1": 1.0, "2": 0.3048}[length]
    digits = 8 if wide else 5

    def put(value):
        text = f"{value:.{digits}f}"[:number]
        return text.ljust(number)

    version = "SDR33V04-01" if wide else "SDR20V03-05"
    lines = [f"00NM{version:16s}0000{'14-Jul-26 08:55':16s}{angle}{length}11{order}1",
             f"10NM{'TANK':16s}121111", f"01KI1{'SET2':16s}{'001234':6s}{'':16s}{'':6s}1{zero}",
             "13PCP.C. mm Applied:0.000"]  # fmt: skip
    for stand in survey:
        x, y, z = (one / per for one in stand.xyz)
        first, second = (y, x) if order == "1" else (x, y)
        lines.append(f"02TP{stand.station:>{name}}{put(first)}{put(second)}{put(z)}"
                     f"{put(stand.height / per)}")  # fmt: skip
        rod = None
        for one in stand.aims:
            if one.height != rod:
                rod = one.height
                lines.append(f"03NM{rod / per:<{number}.5f}")
            vertical = one.zenith if zero == "1" else (90 - one.zenith) % 360
            lines.append(
                f"09F{one.face}{stand.station:>{name}}{one.point:>{name}}"
                f"{put(one.distance / per)}{put(vertical * turn)}{put(one.direction * turn)}"
                f"{one.code}"
            )
            lines.append(f"13TS{one.time:%d-%b-%y %H:%M:%S}")
    return "\r\n".join(lines) + "\r\n"


PROFILE = """\
separator = ";"
decimal = ","
length = "m"
angle = "dms"
time_format = "%d/%m/%Y %H:%M:%S"

[columns]
setup = "Estação"
instrument_height = "hi"
point = "Ponto"
direction = "Hz"
zenith = "Z"
distance = "Di"
target_height = "hs"
code = "Código"
time = "Hora"
face = "Posição"
"""


def plain(survey):
    """A plain table as Brazilian Excel writes it; PROFILE says what it is."""
    lines = ["Estação;hi;Ponto;Hz;Z;Di;hs;Código;Hora;Posição"]

    def angle(value):
        degrees, minutes, seconds = _dms(value, 3)
        return f"{degrees}° {minutes:02d}' {seconds / 1000:06.3f}\"".replace(".", ",")

    for stand in survey:
        for one in stand.aims:
            cells = [stand.station, f"{stand.height:.4f}", one.point, angle(one.direction),
                     angle(one.zenith), f"{one.distance:.5f}", f"{one.height:.4f}", one.code,
                     f"{one.time:%d/%m/%Y %H:%M:%S}", str(one.face)]  # fmt: skip
            lines.append(";".join(
                one.replace(".", ",") if column in (1, 5, 6) else one
                for column, one in enumerate(cells)
            ))  # fmt: skip
    return "\n".join(lines) + "\n"


WRITERS = {"gsi": gsi, "rw5": rw5, "jxl": jobxml, "sdr": sdr, "csv": plain}
