"""Papers of a camera analysis: values of a result in the words of a language."""

import hashlib
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.record.versions import CAMERA
from tankcal.report import blocks
from tankcal.report.plain import Column, PlainPaper
from tankcal.text.delimited import read_json
from tankcal.text.digits import NOTHING
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

LONGEST_NAME = 24  # characters of a name in a table
LONGEST_HEADING = 5  # characters of a name that can be the heading of a column
MOST_HEADINGS = 8  # names that can be headings of columns
_NAMES_OF_PARAMETERS = ("names", "with", "of")  # keys of a reason
_MORE_DIGITS = ("F", "critical", "correlation")  # keys of a reason shown with three digits


def load(path):
    """Read a camera.json of this or an older version; raise InputError for other files."""
    name = Path(path).name
    try:
        result = read_json(path)
    except (OSError, ValueError, RecursionError) as error:
        expected = message(
            "camera_result_unreadable",
            "cannot be read as a result: {error}",
            error=reason_of(error),
        )
        raise InputError(Problem(name, expected)) from error
    return CAMERA.migrated(result, name)


class CameraPaper(PlainPaper):
    """Result of an analysis with the words of a language.

    Parameters
    ----------
    result : dict
        Result of this or an older version (record.camera_versions.CAMERA).
    language : str, optional
        One of languages.LANGUAGES; by default English.

    Notes
    -----
    Words of a group under `camera` take precedence over the common words of the group.
    """

    def __init__(self, result, language=None):
        self.result = CAMERA.migrated(result, CAMERA.file)
        words = load_words(language or DEFAULT)
        groups = words.pop("camera")
        super().__init__(
            words | {name: words.get(name, {}) | group for name, group in groups.items()}
        )

    @classmethod
    def of_file(cls, path, language=None):
        """CameraPaper of the result in a file."""
        return cls(load(path), language)

    def title(self):
        """Title of the papers."""
        return self.word(f"titles.{self.result['kind']}")

    def head(self):
        """Start of the document, and heading of its first page."""
        return [
            blocks.document(
                title=self.title(),
                language=self.words["language"]["code"],
                notice=self.result.get("made_from", {}).get("notice", ""),
                running=[self.word("page.running"), self.title()],
                footer=self.words["page"]["footer"],
            ),
            blocks.masthead(self.title(), self.word(f"subtitles.{self.result['kind']}")),
        ]

    def origin(self):
        """Table of the input files, and the version of tankcal; empty if they are not known."""
        origin = self.result.get("made_from")
        if not origin:
            return []
        rows = [{"input_file": file["file"], "sha256": file["sha256"]} for file in origin["files"]]
        return [
            self.heading("made_from"),
            self.paragraph("made_with", version=origin["version"]),
            self.table("input_files", rows, [Column("input_file"), Column("sha256")]),
        ]

    def text(self, name, /, **values):
        """Sentence `texts.<name>`."""
        return self.word(f"texts.{name}", **values)

    def reason(self, reason):
        """Format a reason {"code": ..., values} of the result as a sentence `reasons.<code>`.

        Numbers have two or three digits. {edge} is replaced by edge_um and edge_px together, and
        {volume_u} by volume_u_m3. For a code without words, the code and its values are returned.
        """
        code = reason["code"]
        values = {
            key.removesuffix("_m3"): self._format_value(key, value)
            for key, value in reason.items()
            if key != "code"
        }
        for key in [key for key in reason if key.endswith("_um")]:
            name = key.removesuffix("_um")
            values[name] = self.in_image(reason[key], reason.get(f"{name}_px"))
        template = self.words["reasons"].get(code + _variant(reason))
        if template is None:
            listed = ", ".join(f"{key} {value}" for key, value in values.items())
            return f"{code}: {listed}" if listed else code
        return template.format(**values)

    def in_image(self, um, px):
        """Length in the image, in micrometres and in pixels, if they are known."""
        parts = [(um, "um"), (px, "px")]
        known = [self.number(value, unit, digits=2) for value, unit in parts if value is not None]
        if not known:
            return NOTHING
        return known[0] if len(known) == 1 else f"{known[0]} ({known[1]})"

    def _format_value(self, key, value):
        if key in _NAMES_OF_PARAMETERS:
            return self.parameters([value] if isinstance(value, str) else value)
        if value is None:
            return NOTHING
        digits = 3 if key in _MORE_DIGITS else 2
        return self.number(value, digits=digits) if isinstance(value, float) else str(value)

    def parameters(self, names):
        """Printed names of parameters, joined by commas."""
        return ", ".join(self.words["parameters"].get(name, name) for name in names)


def _variant(reason):
    """Suffix of the word of a reason without a volume, or of several parameters together."""
    if reason.get("volume_change_m3", 0) is None:
        return "_points"
    return "_together" if reason["code"] == "not_determined_without" and "names" in reason else ""


def describe_origin(paths=(), job=None):
    """Origin of a result: {"version", "notice", "files": [{file, sha256}]} of files and a job."""
    files = [] if job is None else [{"file": f.file, "sha256": f.sha256} for f in job.files]
    for path in map(Path, paths):
        path = path / "cameras.toml" if path.is_dir() else path
        files.append({"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
    notice = "" if job is None else str(job.certificate.get("notice", ""))
    return {"version": tankcal.__version__, "notice": notice, "files": files}


def shorten(name, longest=LONGEST_NAME):
    """Name, or its beginning and end if it is longer; the CSV files contain the whole name."""
    if len(name) <= longest:
        return name
    half = (longest - 1) // 2
    return f"{name[:half]}…{name[-half:]}"


def number_names(names):
    """Labels of rows and headings of columns for a matrix of names.

    Returns
    -------
    labels, heads : list of str
        Names, if they are few and short. Otherwise the headings are numbers, and the labels are
        numbers with shortened names.
    """
    if len(names) <= MOST_HEADINGS and all(len(name) <= LONGEST_HEADING for name in names):
        return list(names), list(names)
    heads = [str(number) for number in range(1, len(names) + 1)]
    return [f"{head}  {shorten(name)}" for head, name in zip(heads, names, strict=True)], heads
