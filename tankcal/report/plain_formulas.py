"""Typesetting of formulas that the record contains in plain text.

Only the patterns below become mathematics. They take words and numbers from the text; the rest of a
sentence remains text.
"""

import re
from functools import cache

from tankcal.report.latex_math import formula

_NUMBER = r"(\d+[.,]\d+)"
_SET_AS = (  # pattern of the plain text and LaTeX; a longer pattern precedes its own beginning
    (r"\br_([^\W\d_]+) = r − t − ([^\W\d_]+)", r"r_\text{%s} = r - t - \text{%s}"),
    (r"\br_([^\W\d_]+) = r − t", r"r_\text{%s} = r - t"),
    (
        rf"1 \+ α \(T_([^\W\d_]+) − T_([^\W\d_]+)\) = {_NUMBER}",
        r"1 + \alpha \, (T_\text{%s} - T_\text{%s}) = %s",
    ),
    (r"Δr = ρ g \(h − z\) r²/\(E t\)", r"\Delta r = \rho \, g \, (h - z) \, r^2 / (E \, t)"),
    (r"Δr = p r² \(1 − ν\)/\(2 E t\)", r"\Delta r = p \, r^2 \, (1 - \nu) / (2 \, E \, t)"),
    (r"\bp = p₀ \+ ρ g h²/\(4 r\)", r"p = p_0 + \rho \, g \, h^2 / (4 \, r)"),
    (r"\bg(?= = \d)", "g"),
    (r"√\(1 \+ m²\)", r"\sqrt{1 + m^2}"),
    (r"2 π r² H/3", r"2 \, \pi \, r^2 H / 3"),
    (r"π r² H/3", r"\pi \, r^2 H / 3"),
    (r"π H \(3 r² \+ H²\)/6", r"\pi H \, (3 r^2 + H^2) / 6"),
    (
        rf"−m \(1 − {_NUMBER}/8000\)/\(ρ_ref − {_NUMBER}\)",
        r"-m \, (1 - %s / 8000) / (\rho_\text{ref} - %s)",
    ),
    (r"-m/rho_ref", r"-m / \rho_\text{ref}"),
)


@cache
def _patterns():
    return re.compile("|".join(f"(?P<f{i}>{pattern})" for i, (pattern, _) in enumerate(_SET_AS)))


def formula_nodes(text):
    """Split a sentence into nodes {"t": "text"} and {"t": "math"} (with alternative text)."""
    nodes, end_of_last = [], 0
    for match in _patterns().finditer(text):
        if match.start() > end_of_last:
            nodes.append({"t": "text", "s": text[end_of_last : match.start()]})
        nodes.append(_math(match))
        end_of_last = match.end()
    if end_of_last < len(text) or not nodes:
        nodes.append({"t": "text", "s": text[end_of_last:]})
    return nodes


def _math(match):
    kind = match.lastgroup
    first = match.re.groupindex[kind]
    latex = _SET_AS[int(kind[1:])][1]
    words = match.groups()[first : first + latex.count("%s")]
    read = formula(latex % tuple(word.replace(",", "{,}") for word in words))
    return {"t": "math", "typst": read.typst, "mathml": read.mathml, "alt": match[0]}
