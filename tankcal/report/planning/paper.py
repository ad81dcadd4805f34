"""PlanPaper: a prediction with its plan and the words of a language."""

import numpy as np

import tankcal
from tankcal.messages import as_plain
from tankcal.planning.changes import IMAGES, OF_COURSE, ROW
from tankcal.record.schema import to_plain
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.report.planning.rows import find_by_name
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, message_sentence

DESIGN = "design"  # folder of the documents of the smallest design


class PlanPaper(PlainPaper):
    """A Prediction with the words of a language.

    Words are looked up in the part of a group under `planning` first, then in the group itself.

    Parameters
    ----------
    prediction : Prediction
    language : str, optional
        One of languages.LANGUAGES; None: that of the plan.
    effects : sequence of Effect, optional
        Effects of all evaluated changes.
    design : Path, optional
        Search for the smallest design.
    simulated : Simulated, optional
        Simulated surveys.
    """

    is_wall = False

    def __init__(self, prediction, language=None, effects=(), design=None, simulated=None):
        self.prediction, self.plan = prediction, prediction.plan
        self.effects, self.design, self.simulated = effects, design, simulated
        words = load_words(language or self.plan.job.table.language or DEFAULT)
        super().__init__(words_with_part(words, "planning"))

    def subject(self):
        """Subject of the documents: the tank."""
        return f"{self.word('page.tank')} {self.plan.job.tank.id}"

    def day(self, iso=None):
        """Format a date in the language; None: the planned date of the survey."""
        return super().day(iso or self.plan.job.survey.date)

    def head(self, part):
        """Return the blocks at the start of the document `part`."""
        title = self.word(f"titles.{part}")
        return [
            blocks.document(
                title=f"{title}, {self.subject()}",
                date=str(self.plan.job.survey.date or ""),
                language=self.words["language"]["code"],
                running=[title, self.subject()],
                footer=f"{self.words['page']['footer']} · tankcal {tankcal.__version__}",
            ),
            blocks.masthead(title, self.subject()),
        ]

    @property
    def fewest_rays(self):
        """Fewest rays of a target that is not weak; 0 with set-ups, as one set-up is enough."""
        return 0 if self.plan.setups else self.plan.limits.rays

    def three_digits(self, share):
        """Format a share in percent with three digits."""
        return self.number(float(share), "share", digits=3)

    def count(self, number):
        """Format a number of items; 0 returns None."""
        return self.number(number, decimals=0) if number else None

    def translate(self, text):
        """Return a Message of the program in the language."""
        plain = to_plain(as_plain(text))
        return message_sentence(self.words, str(text), plain["code"], plain["values"])

    def describe_change(self, change):
        """Return a `planning.changes.Change` in words."""
        prefix = OF_COURSE if change.name.startswith(OF_COURSE) else ROW
        name = change.name.removeprefix(prefix)
        if change.item == "reading":
            return self.word("changes.repeat_images" if name == IMAGES else "changes.repeat_sets")
        if change.item != "tape":
            return self.word(f"changes.{change.action}_{change.item}", name=name)
        tie = find_by_name((*change.plan.ties, *self.plan.ties), name)
        if change.action != "add":
            # A tape that a search adds and later drops is in neither plan.
            table = "distances" if tie is None else tie.table
            return self.word(f"changes.{change.action}_{table}", name=name)
        rise = change.plan.points[tie.end] - change.plan.points[tie.start]
        length = self.number(float(np.linalg.norm(rise)), "m", decimals=1)
        kind = "upright" if abs(rise[2]) > np.hypot(rise[0], rise[1]) else "level"
        return self.word(f"changes.add_tape_{kind}", name=name, length=length)

    def warnings(self, problems):
        """Return the blocks of warnings (errors.Problem), each with its place in the plan."""
        if not problems:
            return []
        texts = [f"{_place(problem)}{self.translate(problem.expected)}" for problem in problems]
        return [self.heading("warnings"), blocks.listing(texts)]


def _place(problem):
    """Return file and column of a problem in a file, as a prefix of its text."""
    if "." not in problem.file:
        return ""
    return f"{problem.file}{f', {problem.column}' if problem.column else ''}: "
