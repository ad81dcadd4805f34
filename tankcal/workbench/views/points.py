"""Rejected points one by one, and what a person decides about them."""

from html import escape

import ipywidgets as widgets
import traitlets

from tankcal.errors import InputError, TankcalError
from tankcal.job.contract.overrulings import DECISIONS
from tankcal.report.web.wall_map import looked_at, why
from tankcal.text.words import say


class PointsPanel(traitlets.HasTraits):
    """The list, the point that is looked at, and buttons that decide.

    Parameters
    ----------
    paper : Paper
    on_overrule : callable or None
        on_overrule(point, decision, reason); None: nobody can decide here.
    """

    chosen = traitlets.Unicode()

    def __init__(self, paper, on_overrule):
        super().__init__()
        self.paper, self.on_overrule = paper, on_overrule
        self.points = {one.name: one for one in looked_at(paper.record)}
        self.used = _used(paper.record)
        word = paper.word
        self.list = widgets.Select(
            options=[(self._line(one), one.name) for one in self.points.values()],
            value=None,
            rows=min(max(len(self.points), 3), 10),
            layout={"width": "60rem", "max_width": "100%"},
        )
        self.told, self.state = widgets.HTML(), widgets.HTML()
        self.reason = widgets.Text(
            placeholder=word("views.reason"),
            layout={"width": "60rem", "max_width": "100%"},
            continuous_update=True,
        )
        self.previous = _button("◀ " + word("views.previous"), lambda: self.step(-1))
        self.next = _button(word("views.next") + " ▶", lambda: self.step(1))
        self.decide = {
            one: _button(word(f"views.{one}"), lambda one=one: self.overrule(one))
            for one in DECISIONS
        }
        self.list.observe(lambda change: self._choose(change["new"]), "value")
        self.observe(lambda change: self._show(), "chosen")
        self.box = widgets.VBox(self._rows())
        self._show()

    def _rows(self):
        word, count = self.paper.word, len(self.points)
        heading = word("views.looked_at", count=count) if count else word("views.none_rejected")
        rows = [widgets.HTML(f"<b>{escape(heading)}</b>")]
        if count:
            rows += [self.list, widgets.HBox([self.previous, self.next])]
        rows.append(self.told)
        if self.on_overrule is None:
            return rows
        return [*rows, self.reason, widgets.HBox(list(self.decide.values())), self.state]

    # ---- looking

    def step(self, by):
        """Look at the next point of the list, or at the one before it."""
        names = list(self.points)
        if not names:
            return
        start = -1 if by > 0 else 0
        at = names.index(self.chosen) if self.chosen in self.points else start
        self.chosen = names[(at + by) % len(names)]

    def _choose(self, name):
        if name is not None:
            self.chosen = name

    def _show(self):
        name = self.chosen
        self.list.value = name if name in self.points else None
        point, word = self.points.get(name), self.paper.word
        is_known = point is not None or name in self.used
        for button in self.decide.values():
            button.disabled = not is_known
        self.state.value = ""
        if point is not None:
            self.told.value = f"<div>{escape(self._sentence(point))}</div>"
        elif name in self.used:
            off = self.paper.number(self.used[name], "mm", decimals=1)
            self.told.value = f"<div>{escape(word('views.point_used', point=name, off=off))}</div>"
        else:
            self.told.value = f"<div>{escape(word('views.choose_point'))}</div>"

    def _line(self, one):
        parts = [one.name, self._off(one), why(self.paper, one)]
        return " · ".join(part for part in parts if part)

    def _sentence(self, one):
        parts = [self._line(one)]
        if one.w is not None:
            parts.append(f"w = {self.paper.number(one.w, decimals=1)}")
        if one.azimuth_deg is not None:
            parts.append(f"{self.paper.number(one.azimuth_deg, decimals=1)}°")
            parts.append(self.paper.number(one.height_m, "m", decimals=3))
        return " · ".join(parts)

    def _off(self, one):
        if one.off_m is None:
            return ""
        return self.paper.number(one.off_m, "mm", decimals=1)

    # ---- deciding

    def overrule(self, decision):
        """Hand over a decision about the point that is looked at; refused without a reason."""
        word, name = self.paper.word, self.chosen
        reason = " ".join(self.reason.value.split())
        if not reason:
            self._state(word("views.no_reason"), "#a01818")
            return
        try:
            self.on_overrule(name, decision, reason)
        except InputError as error:
            lines = [say(self.paper.words, one) for one in error.texts]
            self._state("\n".join(lines), "#a01818")
        except TankcalError as error:
            self._state(str(error), "#a01818")
        else:
            self.reason.value = ""
            self._state(word(f"views.decided_{decision}", point=name), "#14603c")

    def _state(self, text, colour):
        lines = "<br>".join(map(escape, text.splitlines()))
        self.state.value = f'<div role="status" style="color:{colour}">{lines}</div>'


def _used(record):
    """{name: distance from the circle of its section, m} of the points of the wall."""
    return {
        one["point"]: one["residual_m"]
        for one in record["points"]
        if one["used"] and one["residual_m"] is not None
    }


def _button(text, act):
    made = widgets.Button(description=text, layout={"width": "auto"})
    made.on_click(lambda _: act())
    return made
