"""Typesetting of formulas that the record contains in plain text.

Only the formulas below become mathematics. Their patterns take words and numbers from the text; the
rest of a sentence remains text.
"""

import re
from functools import cache

from tankcal.report.markdown import formula

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
    (r"ρ_([Labsw])\b", r"\rho_\text{%s}"),
)
# Formulas of the steps of tickets; their symbols do not depend on the language.
STEP_FORMULAS = {
    "tov_m3": "TOV = V(h)",
    "fw_m3": "FW = V(h_w)",
    "shell_c": "t_S = (7 t_L + t_A)/8",
    "shell_c_insulated": "t_S = t_L",
    "ctsh": "CTSh = 1 + 2 α ΔT + (α ΔT)²",
    "ctsh_solid": "CTSh = s³ V(h/s)/V(h)",
    "base_density": "ρ_b",
    "base_density_observed": "ρ_b = ρ_s/VCF(ρ_b, t_s)",
    "vcf": "VCF(ρ_b, t_L)",
    "observed_density": "ρ_L = ρ_b VCF",
    "fra_m3": "FRA = 0",
    "fra_m3_in_table": "FRA = −m_r (1/ρ_L − 1/ρ_ref)",
    "fra_m3_not_in_table": "FRA = −m_r/ρ_L",
    "gov_m3": "GOV = (TOV − FW) CTSh + FRA",
    "gsv_m3": "GSV = GOV VCF",
    "csw": "CSW = 1 − S&W",
    "nsv_m3": "NSV = GSV CSW",
    "mass_kg": "m = NSV ρ_b",
    "air_factor": "f = (1 − ρ_a/ρ_b)/(1 − ρ_a/ρ_w)",
    "weight_kg": "W = m f",
}
# Notation of these formulas, and its LaTeX in the order of the replacements.
_NOTATION = (
    (r"S&W|[A-Z]{2,}[a-z]*", lambda match: rf"\text{{{match[0].replace('&', '')}}}"),
    (r"_(\w+)", r"_\\text{\1}"),
    (r"(?<![=+−,]) (?![=+−])", r" \\, "),  # a product, unless the blank is beside an operator
    *(("α", r"\\alpha "), ("ρ", r"\\rho "), ("Δ", r"\\Delta ")),
    *(("−", "-"), ("²", "^2"), ("³", "^3")),
)


def _step_latex(text):
    """Return the LaTeX of the formula of a step of a ticket."""
    for notation, latex in _NOTATION:
        text = re.sub(notation, latex, text)
    return text


@cache
def _patterns():
    """Return the pattern of any formula, and the LaTeX of each of its groups."""
    steps = sorted(STEP_FORMULAS.values(), key=len, reverse=True)
    set_as = *((rf"(?<!\w){re.escape(text)}(?!\w)", _step_latex(text)) for text in steps), *_SET_AS
    patterns = (f"(?P<f{i}>{pattern})" for i, (pattern, _) in enumerate(set_as))
    return re.compile("|".join(patterns)), [latex for _, latex in set_as]


def formula_nodes(text):
    """Split a sentence into nodes {"t": "text"} and {"t": "math"} (with alternative text)."""
    nodes, end_of_last = [], 0
    for match in _patterns()[0].finditer(text):
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
    latex = _patterns()[1][int(kind[1:])]
    words = match.groups()[first : first + latex.count("%s")]
    read = formula(latex % tuple(word.replace(",", "{,}") for word in words))
    return {"t": "math", "typst": read.typst, "mathml": read.mathml, "alt": match[0]}
