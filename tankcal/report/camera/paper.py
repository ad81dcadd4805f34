"""A result of the camera's analyses on paper: its values in the words of its language."""

import hashlib
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.record.camera_versions import CAMERA
from tankcal.report import blocks
from tankcal.report.plain import Column, PlainPaper
from tankcal.text.decoding import read_json
from tankcal.text.digits import NOTHING
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

_NAMES_OF_PARAMETERS = ("names", "with", "of")
_MORE_DIGITS = ("F", "critical", "correlation")


def load(path):
    """Read a camera.json of this version or an older one; raises InputError when it is none."""
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
    """A result, a dict as CAMERA says, with the words of a language.

    language  one of languages.LANGUAGES; None: English

    Words are looked up in the group's part under `camera` first, then in the group itself.
    """

    def __init__(self, result, language=None):
        self.result = CAMERA.migrated(result, CAMERA.file)
        words = load_words(language or DEFAULT)
        of_camera = words.pop("camera")
        super().__init__(
            words | {name: words.get(name, {}) | group for name, group in of_camera.items()}
        )

    @classmethod
    def of_file(cls, path, language=None):
        """The paper of the result at `path`, in a language."""
        return cls(load(path), language)

    def title(self):
        """What the papers are about."""
        return self.word(f"titles.{self.result['kind']}")

    def head(self):
        """The start of the document, and the head of its first page."""
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

    def made_from(self):
        """The files that the result was made from, and the version; nothing when not known."""
        found = self.result.get("made_from")
        if not found:
            return []
        rows = [{"input_file": one["file"], "sha256": one["sha256"]} for one in found["files"]]
        return [
            self.heading("made_from"),
            self.paragraph("made_with", version=found["version"]),
            self.table("input_files", rows, [Column("input_file"), Column("sha256")]),
        ]

    def text(self, name, /, **values):
        """The sentence `texts.<name>`."""
        return self.word(f"texts.{name}", **values)

    def reason(self, reason):
        """A reason {"code": ..., values} of the result as a sentence `reasons.<code>`.

        Numbers are shown with two or three digits; {edge} stands for edge_um and edge_px together,
        {volume_u} for volume_u_m3. A code without words comes back with its values.
        """
        code = reason["code"]
        values = {
            key.removesuffix("_m3"): self._shown(key, value)
            for key, value in reason.items()
            if key != "code"
        }
        for key in [key for key in reason if key.endswith("_um")]:
            name = key.removesuffix("_um")
            values[name] = self.in_image(reason[key], reason.get(f"{name}_px"))
        template = self.words["reasons"].get(code + _variant(reason))
        if template is None:
            told = ", ".join(f"{key} {value}" for key, value in values.items())
            return f"{code}: {told}" if told else code
        return template.format(**values)

    def in_image(self, um, px):
        """A length in the image in micrometres, and in pixels where these are known."""
        parts = [(um, "um"), (px, "px")]
        known = [self.number(value, unit, digits=2) for value, unit in parts if value is not None]
        if not known:
            return NOTHING
        return known[0] if len(known) == 1 else f"{known[0]} ({known[1]})"

    def _shown(self, key, value):
        if key in _NAMES_OF_PARAMETERS:
            return self.parameters([value] if isinstance(value, str) else value)
        if value is None:
            return NOTHING
        digits = 3 if key in _MORE_DIGITS else 2
        return self.number(value, digits=digits) if isinstance(value, float) else str(value)

    def parameters(self, names):
        """Names of parameters as they are printed, joined by commas."""
        return ", ".join(self.words["parameters"].get(name, name) for name in names)


def _variant(reason):
    """The end of the word for a reason: without a volume, or of several parameters together."""
    if reason.get("volume_change_m3", 0) is None:
        return "_points"
    return "_together" if reason["code"] == "not_determined_without" and "names" in reason else ""


def made_from(paths=(), job=None):
    """{"version", "notice", "files": [{file, sha256}]} of files that were read, and of a job."""
    files = [] if job is None else [{"file": f.file, "sha256": f.sha256} for f in job.files]
    for path in map(Path, paths):
        path = path / "cameras.toml" if path.is_dir() else path
        files.append({"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
    notice = "" if job is None else str(job.certificate.get("notice", ""))
    return {"version": tankcal.__version__, "notice": notice, "files": files}
