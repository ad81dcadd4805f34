"""Trimble JobXML: controller records as XML, with angles in decimal degrees and lengths in metres.

The readings are raw. Prism constant and ppm are applied here, once. The parser refuses document
types, so a file can neither declare entities nor refer to other files.
"""

import datetime
import re
from xml.parsers import expat

from tankcal.messages import message
from tankcal.products.fieldbooks.book import FieldBook, KnownPoint, parse_number, refuse_number

DEEPEST, LONGEST = 30, 20_000  # nested elements; characters of one value
READ = ("", "DirectReading", "AngleOnly", "AnglesOnly", "DistanceOnly", "Direct")
MEANS = ("MeanTurnedAngle", "MeanAngle", "MTA")
QUIET = ("UnitsRecord", "BackBearingRecord", "JobPropertiesRecord", "CorrectionsRecord",
         "CoordinateSystemRecord", "ToleranceRecord", "SurveyRecord")  # fmt: skip
MOST_PPM, MOST_PRISM_M = 1e3, 0.5
_TIME = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(\.\d+)?(Z|[+-]\d\d:?\d\d)?")


class _UnreadableFile(Exception):
    """The file cannot be read further; the problem is in the log."""


def read(data, file, log, encoding=None):
    """Return the FieldBook of the bytes of a JobXML file.

    encoding  encoding of the bytes; None: as declared in the file
    """
    book = FieldBook(file, "jxl")
    reader = _RecordReader(book, log)
    parser = expat.ParserCreate(encoding)
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.refuse_doctype
    reader.parser = parser
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        text = message("no_xml", "not valid XML ({reason}); is the file complete?", reason=reason)
        log.problem(file, text, error.lineno)
    except _UnreadableFile:
        return book
    except (ValueError, LookupError):  # an unknown declared encoding
        text = message("xml_encoding", "unknown XML encoding; expected UTF-8")
        log.problem(file, text, 1)
    reader.report_strays()
    if not reader.has_field_book and not log.problems:
        text = message("no_field_book", "no FieldBook element; expected a JobXML file")
        log.problem(file, text)
    if book.shots:
        book.add_units(length="m", angle="deg")
    return book


class _RecordReader:
    """Handler of XML events that reads each record below FieldBook as {path: text}."""

    def __init__(self, book, log):
        self.book, self.log, self.parser = book, log, None
        self.path, self.record, self.row, self.attributes = [], {}, 0, {}
        self.texts, self.has_field_book = [], False
        self.targets, self.ppm, self.stations = {}, {}, {}
        self.last_ppm = 0.0
        self.strays = {}  # {ID of a station that is missing: [readings, row of the first]}

    def refuse_doctype(self, *_):
        text = message(
            "xml_doctype",
            "a document type (DOCTYPE); expected XML without one, as instruments write it",
        )
        self.log.problem(self.book.file, text, self.parser.CurrentLineNumber)
        raise _UnreadableFile

    def start(self, name, attributes):
        name = name.rpartition(":")[2]
        self.path.append(name)
        self.texts = []
        if len(self.path) > DEEPEST:
            text = message(
                "xml_deep",
                "elements nested more than {most} deep; expected fewer levels",
                most=DEEPEST,
            )
            self.log.problem(self.book.file, text, self.parser.CurrentLineNumber)
            raise _UnreadableFile
        self.has_field_book |= name == "FieldBook"
        if len(self.path) == 3 and self.path[1] == "FieldBook":
            self.record, self.attributes = {}, attributes
            self.row = self.parser.CurrentLineNumber

    def text(self, text):
        if len(self.path) > 3 and sum(map(len, self.texts)) < LONGEST:
            self.texts.append(text)

    def end(self, _name):
        if len(self.path) > 3 and self.path[1] == "FieldBook":
            text = "".join(self.texts).strip()
            if text:
                self.record.setdefault("/".join(self.path[3:]), text)
        elif len(self.path) == 3 and self.path[1] == "FieldBook":
            self.take(self.path[2])
        self.path.pop()
        self.texts = []

    def take(self, kind):
        take_record = {
            "PointRecord": self.take_point,
            "StationRecord": self.take_station,
            "TargetRecord": self.take_target,
            "AtmosphereRecord": self.take_atmosphere,
            "InstrumentRecord": self.take_instrument,
        }.get(kind)
        if take_record is not None:
            take_record()
        elif kind not in QUIET:
            self.book.leave_out(message("jxl_records", "records {kind}", kind=kind[:40]), self.row)

    def number(self, key):
        """Return a number of the record; None if it is blank or invalid (reported)."""
        text = self.record.get(key, "")
        value = parse_number(text) if text else None
        if text and value is None:
            refuse_number(self.log, self.book.file, self.row, text)
        return value

    def take_instrument(self):
        named = (self.record.get(key, "")[:40] for key in ("Model", "Serial"))
        self.book.instrument = " ".join(text for text in named if text)

    def take_atmosphere(self):
        is_raw = self.record.get("ApplyPPMToRawDistances", "false").lower() == "true"
        ppm = self.number("PPM") or 0.0
        self.last_ppm = self.ppm[self.attributes.get("ID")] = ppm if is_raw else 0.0
        if abs(ppm) > MOST_PPM:
            text = message("jxl_ppm", "found {ppm:g} ppm; expected at most {most:g}", ppm=ppm,
                           most=MOST_PPM)  # fmt: skip
            self.log.problem(self.book.file, text, self.row)
        elif ppm and is_raw:
            self.book.note(
                message(
                    "jxl_ppm_applied", "ppm {ppm:g}: the distances are raw, applied here", ppm=ppm
                )
            )
        elif ppm:
            text = message(
                "jxl_ppm_not_applied",
                "ppm {ppm:g}: not applied, as stated in the file (ApplyPPMToRawDistances)",
                ppm=ppm,
            )
            self.book.note(text)

    def take_target(self):
        height, prism = self.number("TargetHeight"), self.number("PrismConstant") or 0.0
        self.targets[self.attributes.get("ID")] = height, prism
        if abs(prism) > MOST_PRISM_M:
            text = message(
                "jxl_prism", "found a prism constant of {prism:g} m; expected metres", prism=prism
            )
            self.log.problem(self.book.file, text, self.row)
        elif prism:
            text = message(
                "jxl_prism_applied",
                "prism constant {prism_mm:+.1f} mm: the distances are raw, applied here",
                prism_mm=1000 * prism,
            )
            self.book.note(text)

    def take_station(self):
        if self.is_deleted():
            return
        book, identity = self.book, self.attributes.get("ID")
        ppm = self.ppm.get(self.record.get("AtmosphereID"), self.last_ppm)
        book.begin_setup(self.record.get("StationName", ""), self.number("TheodoliteHeight"), None,
                   self.row)  # fmt: skip
        self.stations[identity] = len(book.setups) - 1, ppm
        scale = self.number("ScaleFactor")
        if scale not in (None, 1.0):
            text = message("jxl_scale", "scale factor {scale:g} of a station: not applied",
                           scale=scale)  # fmt: skip
            book.note(text)

    def is_deleted(self):
        """Return whether the surveyor deleted the record; deleted records are counted."""
        if self.record.get("Deleted", "false").lower() != "true":
            return False
        self.book.reject(message("deleted", "deleted records"), self.row)
        return True

    def take_point(self):
        if self.is_deleted():
            return
        book, method = self.book, self.record.get("Method", "")
        name = self.record.get("Name", "")
        is_shot = any(key.startswith("Circle/") for key in self.record)
        if is_shot and method in MEANS:
            book.leave_out(
                message("jxl_means", "means computed by the controller from other readings"),
                self.row,
            )
        elif is_shot and method in READ:
            self.take_shot(name)
        elif is_shot:
            book.leave_out(message("jxl_method", "points by {method}", method=method[:40]),
                           self.row)  # fmt: skip
        elif "Grid/North" in self.record:
            xyz = tuple(self.number(f"Grid/{axis}") for axis in ("East", "North", "Elevation"))
            if None not in xyz[:2]:
                book.known.append(KnownPoint(name, xyz, self.row))
        else:
            book.leave_out(message("jxl_points", "points without circle readings"), self.row)

    def take_shot(self, name):
        book, station_id = self.book, self.record.get("StationID")
        place, ppm = self.stations.get(station_id, (None, self.last_ppm))
        if place is None and (station_id or not book.setups):
            self.strays.setdefault(station_id or "", [0, self.row])[0] += 1
            return
        height, prism = self.targets.get(self.record.get("TargetID"), (None, 0.0))
        distance = self.number("Circle/EDMDistance")
        if distance:
            distance = (distance + prism) * (1 + ppm * 1e-6)
        book.add_shot(
            self.log, self.row, point=name, height=height, distance=distance,
            direction=self.number("Circle/HorizontalCircle"),
            zenith=self.number("Circle/VerticalCircle"),
            face={"Face1": 1, "Face2": 2}.get(self.record.get("Circle/Face")),
            code=self.record.get("Code", ""), prism=1000 * prism, setup=place,
            time=parse_time(self.attributes.get("TimeStamp", "")),
        )  # fmt: skip

    def report_strays(self):
        """Report each missing station once."""
        for station, (count, row) in self.strays.items():
            text = message(
                "jxl_station",
                "{count} readings of station {station!r}, the first in this row; expected a "
                "StationRecord of this ID before them",
                count=count,
                station=station[:40],
            )
            self.log.problem(self.book.file, text, row)


def parse_time(text):
    """Return date and time without zone, or None."""
    match = _TIME.fullmatch(text.strip()[:40])
    if match is None:
        return None
    try:
        return datetime.datetime.fromisoformat(match[1])
    except ValueError:
        return None
