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
    # Steps of tickets.
    (r"TOV = V\(h\)", r"\text{TOV} = V(h)"),
    (r"FW = V\(h_w\)", r"\text{FW} = V(h_\text{w})"),
    (r"t_S = \(7 t_L \+ t_A\)/8", r"t_\text{S} = (7 \, t_\text{L} + t_\text{A}) / 8"),
    (r"t_S = t_L", r"t_\text{S} = t_\text{L}"),
    (
        r"CTSh = 1 \+ 2 α ΔT \+ \(α ΔT\)²",
        r"\text{CTSh} = 1 + 2 \, \alpha \, \Delta T + (\alpha \, \Delta T)^2",
    ),
    (r"CTSh = s³ V\(h/s\)/V\(h\)", r"\text{CTSh} = s^3 \, V(h/s) / V(h)"),
    (
        r"ρ_b = ρ_s/VCF\(ρ_b, t_s\)",
        r"\rho_\text{b} = \rho_\text{s} / \text{VCF}(\rho_\text{b}, t_\text{s})",
    ),
    (r"VCF\(ρ_b, t_L\)", r"\text{VCF}(\rho_\text{b}, t_\text{L})"),
    (r"ρ_L = ρ_b VCF", r"\rho_\text{L} = \rho_\text{b} \, \text{VCF}"),
    (
        r"FRA = −m_r \(1/ρ_L − 1/ρ_ref\)",
        r"\text{FRA} = -m_\text{r} \, (1/\rho_\text{L} - 1/\rho_\text{ref})",
    ),
    (r"FRA = −m_r/ρ_L", r"\text{FRA} = -m_\text{r} / \rho_\text{L}"),
    (r"FRA = 0", r"\text{FRA} = 0"),
    (
        r"GOV = \(TOV − FW\) CTSh \+ FRA",
        r"\text{GOV} = (\text{TOV} - \text{FW}) \, \text{CTSh} + \text{FRA}",
    ),
    (r"GSV = GOV VCF", r"\text{GSV} = \text{GOV} \, \text{VCF}"),
    (r"CSW = 1 − S&W", r"\text{CSW} = 1 - \text{SW}"),
    (r"NSV = GSV CSW", r"\text{NSV} = \text{GSV} \, \text{CSW}"),
    (r"m = NSV ρ_b", r"m = \text{NSV} \, \rho_\text{b}"),
    (
        r"f = \(1 − ρ_a/ρ_b\)/\(1 − ρ_a/ρ_w\)",
        r"f = (1 - \rho_\text{a}/\rho_\text{b}) / (1 - \rho_\text{a}/\rho_\text{w})",
    ),
    (r"W = m f", r"W = m \, f"),
    (r"ρ_([Labsw])\b", r"\rho_\text{%s}"),
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
