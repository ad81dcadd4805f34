"""What a survey leaves uncertain, cause by cause, and causes that several parts of a tank share."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.uncertainty import Source, factor_of

LEAST_SHARE = 1e-6  # rounding of the share that a named cause has in the covariance


@dataclass(frozen=True)
class Factor:
    """One cause of what a survey leaves uncertain, over what the survey gave.

    Attributes
    ----------
    kind : str
        "points", "bulge", "ovality", "seams", or what a named cause is ("instrument_scale").
    columns : ndarray, shape (f, c)
        Factor of the covariance of a shell's features or of a solid's inputs.
    dof, u, unit, type, note, is_default
        As in `uncertainty.Source`.
    """

    kind: str
    columns: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "A"
    note: str = ""
    is_default: bool = False

    def mapped(self, function):
        """The same cause over something else: function(columns) -> columns."""
        return replace(self, columns=function(self.columns))

    def source(self, columns_m3):
        """The `Source` of (rows, c) columns that its own columns make in a table."""
        return Source(
            self.kind,
            columns_m3,
            self.dof,
            self.u,
            self.unit,
            type=self.type,
            note=self.note,
            is_default=self.is_default,
        )


def survey_factors(covariance, dof=np.inf, causes=(), effects=()):
    """`Factor`s of what a survey leaves uncertain: the points, then every named cause.

    With F F' the covariance and e = F a the rest is F (I - A A') F', which is never negative.

    Parameters
    ----------
    covariance : ndarray, shape (f, f)
        Of all causes together: the rest L L' + sum of e e' over the effects.
    dof : optional
        Degrees of freedom of the covariance.
    causes : optional
        With name, what, u, unit, is_assumed (`surveys.Cause`); effects: (f,) of one u of each.
        Those of one name and kind make one `Factor`.

    Raises
    ------
    ValueError
        For effects that are larger than the covariance.
    """
    whole = factor_of(covariance)
    if len(causes) == 0:
        return (Factor("points", whole, dof),)
    shares = whole.T @ np.column_stack(effects) / np.sum(whole**2, axis=0)[:, None]
    turn, size, _ = np.linalg.svd(shares)
    if size.max(initial=0.0) > 1 + LEAST_SHARE:
        raise ValueError("a named cause is larger than the covariance that contains it")
    left = np.ones(len(turn))
    left[: len(size)] = np.sqrt(np.maximum(1 - size**2, 0.0))
    rest = whole @ (turn * left)
    return (
        Factor("points", rest[:, left > 0], dof),
        *cause_factors(causes, effects),
    )


def cause_factors(causes, effects):
    """`Factor` tuple of named causes; arguments as of `survey_factors`."""
    return tuple(
        Factor(
            one.what,
            np.column_stack(columns),
            u=one.u,
            unit=one.unit,
            type="B",
            note=one.name,
            is_default=one.is_assumed,
        )
        for one, columns in _by_name(causes, effects)
    )


def _by_name(causes, effects):
    """The first cause of each name and kind, with the effects of all of that name and kind."""
    found = {}
    for cause, effect in zip(causes, effects, strict=True):
        found.setdefault((cause.what, cause.name), (cause, []))[1].append(effect)
    return tuple(found.values())


def join_shared(of_parts):
    """Sources of parts, those of one named cause that several parts feel as one.

    Its columns stand for the same unit variables in all of them, so they add.

    Parameters
    ----------
    of_parts : sequence of sequences of Source

    Returns
    -------
    list of Source

    Examples
    --------
    >>> lifted = Source("registration", np.array([[3.0]]), note="A")
    >>> widened = Source("registration", np.array([[4.0]]), note="A")
    >>> [one.columns_m3.tolist() for one in join_shared([[lifted], [widened]])]
    [[[7.0]]]
    """
    found, place = [], {}
    for sources in of_parts:
        before = dict(place)
        for one in sources:
            cause = one.kind, one.note, one.columns_m3.shape[1]
            if one.note and cause in before:
                known = found[before[cause]]
                columns = known.columns_m3 + one.columns_m3
                found[before[cause]] = replace(known, columns_m3=columns)
                continue
            place[cause] = len(found)
            found.append(one)
    return found
