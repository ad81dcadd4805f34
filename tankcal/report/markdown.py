"""Conversion of markdown cells into nodes {"t": kind, ...} for the PDF and the web page.

Conversion of a subset of LaTeX mathematics to typst and MathML.

An unknown macro or character is an error, so that no formula is printed incorrectly.
"""

import re
from dataclasses import dataclass
from html import escape

import mistune

from tankcal.errors import TankcalError

_SCHEMES = ("https:", "http:", "mailto:")  # schemes of links that remain links
_WRAPPERS = {
    "paragraph": "paragraph",
    "block_text": "plain",
    "block_quote": "quote",
    "emphasis": "emph",
    "strong": "strong",
    "list_item": "item",
}
_GREEK = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "epsilon": "ε",
    "zeta": "ζ",
    "eta": "η",
    "theta": "θ",
    "iota": "ι",
    "kappa": "κ",
    "lambda": "λ",
    "mu": "μ",
    "nu": "ν",
    "xi": "ξ",
    "pi": "π",
    "rho": "ρ",
    "sigma": "σ",
    "tau": "τ",
    "upsilon": "υ",
    "phi": "φ",
    "chi": "χ",
    "psi": "ψ",
    "omega": "ω",
    "Gamma": "Γ",
    "Delta": "Δ",
    "Theta": "Θ",
    "Lambda": "Λ",
    "Xi": "Ξ",
    "Pi": "Π",
    "Sigma": "Σ",
    "Phi": "Φ",
    "Psi": "Ψ",
    "Omega": "Ω",
}
_SYMBOLS = {  # LaTeX: (typst, character)
    "cdot": ("dot.op", "⋅"),
    "times": ("times", "×"),
    "pm": ("plus.minus", "±"),
    "le": ("<=", "≤"),
    "leq": ("<=", "≤"),
    "ge": (">=", "≥"),
    "geq": (">=", "≥"),
    "ne": ("!=", "≠"),
    "approx": ("approx", "≈"),
    "infty": ("infinity", "∞"),
    "partial": ("partial", "∂"),
    "sum": ("sum", "∑"),
    "int": ("integral", "∫"),
    "to": ("->", "→"),
    "circ": ("compose", "∘"),
    "ldots": ("dots", "…"),
}
_FUNCTIONS = ("sin", "cos", "tan", "arctan", "ln", "log", "exp", "min", "max")
_SPACES = {",": "thin", ";": "med", "quad": "quad", " ": "space"}
_ACCENTS = {"bar": ("overline", "¯"), "hat": ("hat", "^")}
_OPERATORS = "+-=()[]|/<>,.!':"
# Groups of a token: macro, number, other character, white space.
_TOKEN = re.compile(r"\\([A-Za-z]+|.)|([0-9]+(?:(?:\.|\{,\})[0-9]+)?)|(\S)|(\s+)", re.DOTALL)


def nodes(source):
    """Return the nodes of a markdown text (list of dict).

    HTML is printed as text. A link with an unusual scheme is reduced to its text. Images and
    unknown mathematics raise TankcalError.
    """
    parse = mistune.create_markdown(renderer=None, plugins=["math", "table"])
    return _children(parse(source))


def _children(tokens):
    converted = (_node(token) for token in tokens if token["type"] != "blank_line")
    return [node for node in converted if node is not None]


def _node(token):
    """Convert a token of mistune into a node."""
    kind, raw = token["type"], token.get("raw", "")
    if kind in _WRAPPERS:
        return {"t": _WRAPPERS[kind], "c": _children(token["children"])}
    if kind in ("text", "inline_html", "block_html"):
        text = {"t": "text", "s": raw}
        return {"t": "paragraph", "c": [text]} if kind == "block_html" else text
    if kind in ("softbreak", "linebreak"):
        return {"t": "text", "s": " "} if kind == "softbreak" else {"t": "break"}
    if kind == "codespan":
        return {"t": "code", "s": raw}
    if kind == "block_code":
        return {"t": "code_block", "s": raw.rstrip("\n")}
    if kind == "thematic_break":
        return {"t": "rule"}
    if kind == "heading":
        level = min(token["attrs"]["level"], 3)
        return {"t": "heading", "level": level, "c": _children(token["children"])}
    if kind == "list":
        ordered = bool(token["attrs"]["ordered"])
        return {"t": "list", "ordered": ordered, "c": _children(token["children"])}
    if kind in ("inline_math", "block_math"):
        return _math(raw, kind == "block_math")
    if kind == "link":
        return _link(token)
    if kind == "table":
        return _table(token)
    raise TankcalError(f"a markdown cell has a part that the report cannot show: {kind}")


def _math(latex, block):
    read = formula(latex)
    return {
        "t": "math",
        "latex": read.latex,
        "typst": read.typst,
        "mathml": read.mathml,
        "block": block,
    }


def _link(token):
    url, children = token["attrs"]["url"], _children(token["children"])
    if url.lower().startswith(_SCHEMES):
        return {"t": "link", "url": url, "c": children}
    return {"t": "plain", "c": children}


def _table(token):
    head, body = token["children"][0], token["children"][1:]
    lines = [head["children"]] + [row["children"] for part in body for row in part["children"]]
    return {
        "t": "table",
        "align": [cell["attrs"]["align"] or "left" for cell in head["children"]],
        "rows": [[_children(cell["children"]) for cell in line] for line in lines],
    }


# ---- conversion of a subset of LaTeX mathematics to typst and MathML


@dataclass(frozen=True)
class Formula:
    """A formula as LaTeX source, in the math mode of typst, and as MathML."""

    latex: str
    typst: str
    mathml: str


def formula(latex):
    """Convert LaTeX source into a Formula; raise TankcalError for syntax outside the subset."""
    reader = _Reader(latex)
    typst, mathml = reader.sequence(until=None)
    return Formula(latex.strip(), typst, f"<mrow>{mathml}</mrow>")


class _Reader:
    """Recursive parser; the methods return (typst, MathML) of the parsed part."""

    def __init__(self, latex):
        self.latex = latex
        self.tokens = [match for match in _TOKEN.finditer(latex) if not match[4]]
        self.at = 0

    def refuse(self, what):
        """Raise TankcalError that names the formula."""
        raise TankcalError(f"formula {self.latex.strip()!r}: {what}")

    def peek(self):
        """Return the next token without consuming it, or None at the end."""
        return self.tokens[self.at][0] if self.at < len(self.tokens) else None

    def sequence(self, until):
        """Convert symbols up to the token `until`; None: up to the end."""
        parts = []
        while self.peek() != until:
            if self.peek() is None:
                self.refuse(f"{until!r} is missing")
            parts.append(self.scripted())
        return " ".join(typst for typst, _ in parts), "".join(mathml for _, mathml in parts)

    def scripted(self):
        """Convert a symbol with its subscript and superscript."""
        base = self.atom()
        scripts = {}
        while self.peek() in ("^", "_"):
            mark = self.peek()
            self.at += 1
            if mark in scripts:
                self.refuse(f"two {mark!r} on one symbol")
            scripts[mark] = self.atom()
        if not scripts:
            return base
        typst = base[0] + "".join(f"{mark}({typst})" for mark, (typst, _) in scripts.items())
        tag = {"_": "msub", "^": "msup"}.get("".join(scripts), "msubsup")
        inner = "".join(f"<mrow>{scripts[mark][1]}</mrow>" for mark in "_^" if mark in scripts)
        return typst, f"<{tag}><mrow>{base[1]}</mrow>{inner}</{tag}>"

    def atom(self):
        """Convert a number, letter, operator, group or macro."""
        if self.peek() is None:
            self.refuse("something is missing at the end")
        macro, number, character, _ = self.tokens[self.at].groups()
        self.at += 1
        if macro:
            return self.macro(macro)
        if number:
            typst = number.replace("{,}", ' class("normal", \\,) ')  # no space after the comma
            return typst, f"<mn>{number.replace('{,}', ',')}</mn>"
        if character == "{":
            inner = self.sequence(until="}")
            self.at += 1
            return inner[0], f"<mrow>{inner[1]}</mrow>"
        if character.isascii() and character.isalpha():
            return character, f"<mi>{character}</mi>"
        if character in _OPERATORS:
            typst = {"-": "minus", "+": "plus"}.get(character, f"\\{character}")
            return typst, f"<mo>{escape(character)}</mo>"
        return self.refuse(f"the character {character!r} is not supported")

    def macro(self, name):
        """Convert a macro with its arguments."""
        if name in _GREEK:
            return name, f"<mi>{_GREEK[name]}</mi>"
        if name in _SYMBOLS:
            typst, character = _SYMBOLS[name]
            return typst, f"<mo>{escape(character)}</mo>"
        if name in _FUNCTIONS:
            return name, f"<mi>{name}</mi><mo>&#x2061;</mo>"
        if name in _SPACES:
            return _SPACES[name], '<mspace width="0.3em"/>'
        if name in ("text", "mathrm"):
            return self.words()
        if name == "frac":
            (top, top_ml), (bottom, bottom_ml) = self.braced(), self.braced()
            return (
                f"frac({top}, {bottom})",
                f"<mfrac><mrow>{top_ml}</mrow><mrow>{bottom_ml}</mrow></mfrac>",
            )
        if name == "sqrt":
            typst, mathml = self.braced()
            return f"sqrt({typst})", f"<msqrt>{mathml}</msqrt>"
        if name in _ACCENTS:
            typst, mathml = self.braced()
            function, mark = _ACCENTS[name]
            return f"{function}({typst})", f"<mover><mrow>{mathml}</mrow><mo>{mark}</mo></mover>"
        return self.refuse(f"the macro \\{name} is not supported")

    def braced(self):
        """Convert a group in braces."""
        if self.peek() != "{":
            self.refuse("'{' expected")
        return self.atom()

    def words(self):
        """Convert the text of \\text{...}, which is taken unchanged from the source."""
        if self.peek() != "{":
            self.refuse("'{' expected")
        start = self.tokens[self.at].end()
        stop = self.latex.find("}", start)
        if stop < 0:
            self.refuse("'}' is missing")
        while self.at < len(self.tokens) and self.tokens[self.at].start() <= stop:
            self.at += 1
        text = self.latex[start:stop]
        if re.search(r'[\\"{$#]', text):
            self.refuse(f"the text {text!r} holds a sign that is not supported")
        return f'upright("{text}")', f"<mtext>{escape(text)}</mtext>"
