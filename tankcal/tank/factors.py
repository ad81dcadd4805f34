"""Uncertainty after a survey by cause, and causes shared by several parts of a tank."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.uncertainty import Source, factor_of, type_of

LEAST_SHARE = 1e-6  # tolerance for rounding of the share of a named cause in the covariance


@dataclass(frozen=True)
class Factor:
    """Cause of uncertainty after a survey, in terms of the results of the survey.

    Attributes
    ----------
    kind : str
        "points", "bulge", "ovality", "seams", or the kind of a named cause ("instrument_scale").
    columns : ndarray, shape (f, c)
        Factor of the covariance of the features of a shell or of the inputs of a solid.
    dof, u, unit, type, note, is_default
        As in `uncertainty.Source`.
    """

    kind: str
    columns: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "B"
    note: str = ""
    is_default: bool = False

    def mapped(self, function):
        """Return the cause in terms of other quantities: function(columns) -> columns."""
        return replace(self, columns=function(self.columns))

    def source(self, columns_m3):
        """Return the `Source` with the columns (rows, c) of the cause in a table."""
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
    """Return the `Factor`s of a survey: the points, then every named cause.

    With F F' the covariance and e = F a, the remainder is F (I - A A') F', which is positive
    semidefinite.

    Parameters
    ----------
    covariance : ndarray, shape (f, f)
        Covariance due to all causes: the remainder L L' + sum of e e' over the effects.
    dof : float, optional
        Degrees of freedom of the covariance.
    causes : sequence, optional
        Objects with name, what, u, unit, is_assumed (`surveys.Cause`). Causes of equal name and
        kind form a single `Factor`.
    effects : sequence of ndarray, shape (f,), optional
        Effect of one standard uncertainty of each cause.

    Returns
    -------
    tuple of Factor

    Raises
    ------
    ValueError
        For effects larger than the covariance.
    """
    factor = factor_of(covariance)
    if len(causes) == 0:
        return (Factor("points", factor, dof, type=type_of(dof)),)
    shares = factor.T @ np.column_stack(effects) / np.sum(factor**2, axis=0)[:, None]
    # Coordinates of the effects in the factor; singular values above 1 would leave a negative
    # remainder.
    basis, size, _ = np.linalg.svd(shares)
    if size.max(initial=0.0) > 1 + LEAST_SHARE:
        raise ValueError("a named cause is larger than the covariance that contains it")
    # I - A A' has the eigenvalues 1 - size^2 in the basis of the left singular vectors.
    remaining = np.ones(len(basis))
    remaining[: len(size)] = np.sqrt(np.maximum(1 - size**2, 0.0))
    remainder = factor @ (basis * remaining)
    return (
        Factor("points", remainder[:, remaining > 0], dof, type=type_of(dof)),
        *cause_factors(causes, effects),
    )


def cause_factors(causes, effects):
    """Return a tuple with the `Factor` of each named cause; arguments as for `survey_factors`."""
    return tuple(
        Factor(
            cause.what,
            np.column_stack(columns),
            u=cause.u,
            unit=cause.unit,
            note=cause.name,
            is_default=cause.is_assumed,
        )
        for cause, columns in _group_by_name(causes, effects)
    )


def _group_by_name(causes, effects):
    """Return the first cause of each name and kind, with the effects of all such causes."""
    groups = {}
    for cause, effect in zip(causes, effects, strict=True):
        groups.setdefault((cause.what, cause.name), (cause, []))[1].append(effect)
    return tuple(groups.values())


def join_shared(of_parts):
    """Return sources of parts, with a named cause of several parts joined to a single source.

    The columns of a named cause refer to the same unit variables in all parts, so they add.

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
    >>> [source.columns_m3.tolist() for source in join_shared([[lifted], [widened]])]
    [[[7.0]]]
    """
    joined, place = [], {}
    for sources in of_parts:
        earlier_place = dict(place)
        for source in sources:
            cause = source.kind, source.note, source.columns_m3.shape[1]
            # Only sources of earlier parts are joined: equal causes within a part remain separate.
            if source.note and cause in earlier_place:
                earlier = joined[earlier_place[cause]]
                columns = earlier.columns_m3 + source.columns_m3
                joined[earlier_place[cause]] = replace(earlier, columns_m3=columns)
                continue
            place[cause] = len(joined)
            joined.append(source)
    return joined
