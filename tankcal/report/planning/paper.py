"""A prediction on paper: its plan, what was tried, and the words of a language."""

import numpy as np

import tankcal
from tankcal.messages import as_plain
from tankcal.planning.changes import IMAGES
from tankcal.record.schema import to_plain
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.report.planning import rows
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words, message_sentence


class PlanPaper(PlainPaper):
    """A `planning.predicting.Prediction` with the words of a language.

    language  one of languages.LANGUAGES; None: that of the plan
    effects   `planning.helping.Effect` of every change that was tried      design  `Path` or None
    simulated  `planning.simulations.Simulated` or None

    Words are looked up in the group's part under `planning` first, then in the group itself.
    """

    is_wall = False

    def __init__(self, prediction, language=None, effects=(), design=None, simulated=None):
        self.prediction, self.plan = prediction, prediction.plan
        self.effects, self.design, self.simulated = effects, design, simulated
        words = load_words(language or self.plan.job.table.language or DEFAULT)
        super().__init__(words_with_part(words, "planning"))

    def subject(self):
        """What the papers are about."""
        return f"{self.word('page.tank')} {self.plan.job.tank.id}"

    def day(self, iso=None):
        """The day that the survey is planned for, in words."""
        return super().day(iso or self.plan.job.survey.date)

    def head(self, part):
        """The start of the document `part`, and the head of its first page."""
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
        """Rays of a target that is not weak; 0 where set-ups measure, one of which is enough."""
        return 0 if self.plan.setups else self.plan.limits.rays

    def three_digits(self, share):
        """A share in percent, to three digits."""
        return self.number(float(share), "share", digits=3)

    def said(self, text):
        """A Message of the program in the language."""
        found = to_plain(as_plain(text))
        return message_sentence(self.words, str(text), found["code"], found["values"])

    def change(self, change):
        """A `planning.changes.Change` in words."""
        name = change.name.removeprefix("row ").removeprefix("in course ")
        if change.item == "reading":
            return self.word("changes.repeat_images" if name == IMAGES else "changes.repeat_sets")
        if change.item != "tape":
            return self.word(f"changes.{change.action}_{change.item}", name=name)
        ties = (*change.plan.ties, *self.plan.ties)
        tie = rows.named(ties, name)
        if change.action != "add":  # a tape that a search adds and drops again is in neither plan
            table = "distances" if tie is None else tie.table
            return self.word(f"changes.{change.action}_{table}", name=name)
        rise = change.plan.points[tie.end] - change.plan.points[tie.start]
        length = self.number(float(np.linalg.norm(rise)), "m", decimals=1)
        kind = "upright" if abs(rise[2]) > np.hypot(rise[0], rise[1]) else "level"
        return self.word(f"changes.add_tape_{kind}", name=name, length=length)

    def warnings(self, problems):
        """The blocks of some warnings (errors.Problem), each with its place in the plan."""
        if not problems:
            return []
        said = [f"{_place(one)}{self.said(one.expected)}" for one in problems]
        return [self.heading("warnings"), blocks.listing(said)]


def _place(problem):
    """Where to look, for what stands in a file."""
    if "." not in problem.file:
        return ""
    return f"{problem.file}{f', {problem.column}' if problem.column else ''}: "
