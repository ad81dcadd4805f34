"""Words of each language, sentences from the codes of a record, and words of forms.

The words are the files report_templates/words/, one per language.
"""

import marshal
import os
import sys
import tomllib
import unicodedata
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.util import cache_from_source
from numbers import Integral, Number
from pathlib import Path

from tankcal.errors import SHEET, TankcalError
from tankcal.messages import as_plain, fill_template
from tankcal.text.digits import NOTHING, Marks, fixed, shortest
from tankcal.text.shipped import DEFAULT, shipped_folder

NOTES = {}  # {English note of a key or column: (group, name)}; the contract of the job fills it
YES, NO = "true", "false"
FORM_WORDS = {
    "pt-BR": {
        YES: ("sim", "verdadeiro"),
        NO: ("não", "falso"),
        "outside": ("fora", "por fora", "externo", "exterior"),
        "inside": ("dentro", "por dentro", "interno", "interior"),
        "sphere": ("esfera", "esférico"),
        "equator": ("equador",),
        "meridian": ("meridiano",),
        "mesh": ("malha",),
        "flat": ("plano",),
        "leaning": ("inclinado",),
        "cone": ("cone", "cônico"),
        "dish": ("calota",),
        "points": ("pontos",),
        "liquid": ("líquido",),
        "conical": ("cônico",),
        "ellipsoidal": ("elipsoidal", "elíptico", "semielíptico"),
        "torispherical": ("torisférico",),
        "spherical": ("esférico",),
        "plumb": ("prumo", "a prumo", "vertical"),
        "square": ("esquadro", "perpendicular"),
        "air": ("ar", "no ar"),
        "vacuum": ("vácuo", "no vácuo"),
        "standard": ("padrão", "incerteza-padrão"),
        "expanded": ("expandida",),
        "half_width": ("semiamplitude", "semilargura"),
        "rectangular": ("retangular",),
        "adjust": ("ajustar",),
        "check": ("verificar",),
        "rest": ("repouso",),
        "spatial": ("espacial", "inclinada"),
        "control": ("apoio",),
        "fixed_photo": ("foto fixa",),
        "minimal": ("mínimo", "mínimas"),
        "inner": ("interno", "internas", "livre", "interna"),
        "outer": ("externo", "externa"),
        "carbon_steel": ("aço-carbono", "aço carbono"),
        "stainless_steel": ("inoxidável", "aço inoxidável"),
        "aluminium": ("alumínio",),
        "other": ("outro",),
        "ambient": ("ambiente",),
        "heated": ("aquecido",),
        "refrigerated": ("refrigerado",),
        "up": ("sobe",),
        "middle": ("meio", "linha média"),
        "raised": ("saliente", "em suporte"),
        "down": ("desce",),
        "keep": ("manter",),
        "leave_out": ("retirar",),
        "left": ("esquerda", "esquerdo"),
        "right": ("direita", "direito"),
        "tape": ("trena",),
        "edm": ("distanciômetro",),
        "total_station": ("estação total",),
        "theodolite": ("teodolito",),
        "level": ("nível",),
        "plummet": ("prumo",),
        "stadia": ("estádia",),
        "before": ("antes",),
        "after": ("depois",),
        "rust": ("ferrugem",),
        "paint": ("pintura",),
    },
    "es": {
        YES: ("sí", "verdadero"),
        NO: ("no", "falso"),
        "outside": ("fuera", "por fuera", "externo", "exterior"),
        "inside": ("dentro", "por dentro", "interno", "interior"),
        "sphere": ("esfera", "esférico"),
        "equator": ("ecuador",),
        "meridian": ("meridiano",),
        "mesh": ("malla",),
        "flat": ("plano",),
        "leaning": ("inclinado",),
        "cone": ("cono", "cónico"),
        "dish": ("casquete",),
        "points": ("puntos",),
        "liquid": ("líquido",),
        "conical": ("cónico",),
        "ellipsoidal": ("elipsoidal", "elíptico", "semielíptico"),
        "torispherical": ("toriesférico", "torisférico"),
        "spherical": ("esférico",),
        "plumb": ("plomada", "a plomo", "vertical"),
        "square": ("escuadra", "perpendicular"),
        "air": ("aire", "en aire"),
        "vacuum": ("vacío", "en vacío"),
        "standard": ("estándar", "típica"),
        "expanded": ("expandida",),
        "half_width": ("semiamplitud",),
        "rectangular": ("rectangular",),
        "adjust": ("ajustar",),
        "check": ("comprobar",),
        "rest": ("reposo",),
        "spatial": ("espacial", "inclinada"),
        "control": ("control", "apoyo"),
        "fixed_photo": ("foto fija",),
        "minimal": ("mínimo", "mínimas"),
        "inner": ("interno", "internas", "libre"),
        "outer": ("externo", "exterior"),
        "carbon_steel": ("acero al carbono",),
        "stainless_steel": ("inoxidable", "acero inoxidable"),
        "aluminium": ("aluminio",),
        "other": ("otro",),
        "ambient": ("ambiente",),
        "heated": ("calentado",),
        "refrigerated": ("refrigerado",),
        "up": ("sube",),
        "middle": ("mitad", "línea media"),
        "raised": ("saliente", "en soporte"),
        "down": ("baja",),
        "keep": ("mantener",),
        "leave_out": ("retirar",),
        "left": ("izquierda", "izquierdo"),
        "right": ("derecha", "derecho"),
        "tape": ("cinta",),
        "edm": ("distanciómetro",),
        "total_station": ("estación total",),
        "theodolite": ("teodolito",),
        "level": ("nivel",),
        "plummet": ("plomada",),
        "stadia": ("estadia",),
        "before": ("antes",),
        "after": ("después",),
        "rust": ("óxido",),
        "paint": ("pintura",),
    },
}


def word_of(language, choice):
    """Return the word for a choice in a language; the choice itself if there is no word."""
    return FORM_WORDS.get(language, {}).get(choice, (choice,))[0]


def meant(word, choices):
    """Return the choice that a word of any form means; None if it matches no choice or several.

    A choice also matches regardless of case, blanks and punctuation: "DIN 28011" matches din_28011.
    This does not apply to units and codes of one or two letters.
    """
    plain = _plain(word)
    matches = {
        choice
        for words in FORM_WORDS.values()
        for choice in choices
        if plain in map(_plain, words.get(choice, ()))
    }
    if not matches:
        bare = _bare(word)
        matches = {choice for choice in choices if len(bare) > 2 and _bare(choice) == bare}
    return matches.pop() if len(matches) == 1 else None


def _bare(word):
    """Return the letters and digits of a word in lower case, without accents."""
    return "".join(char for char in _plain(word) if char.isalnum())


def _plain(word):
    """Return a word in lower case without accents and underscores."""
    letters = unicodedata.normalize("NFKD", word.strip().lower().replace("_", " "))
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def load_words(language=DEFAULT):
    """Load the words of one language: {group: {code: template, or {value: template}}}.

    Raises TankcalError if no words are shipped in this language.
    """
    folder = shipped_folder("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return marshal.loads(_parse_once(known[language]))


@cache
def _parse_once(path):
    """Return the parsed words of a file as bytes, of which marshal makes new copies.

    Parsing takes 50 times longer. The bytes are stored where Python stores byte code. Their digest
    covers the file and themselves, so that neither changed words nor a damaged store are used.
    """
    text, stored = path.read_bytes(), Path(cache_from_source(path))
    with suppress(OSError):
        content = stored.read_bytes()
        if content[32:] and content[:32] == sha256(text + content[32:]).digest():
            return content[32:]
    words = marshal.dumps(tomllib.loads(text.decode("utf-8")))
    if not sys.dont_write_bytecode:
        with suppress(OSError):  # an installation without the right to write
            stored.parent.mkdir(parents=True, exist_ok=True)
            temporary = stored.with_suffix(f".{os.getpid()}")
            temporary.write_bytes(sha256(text + words).digest() + words)
            temporary.replace(stored)
    return words


def language_of(record):
    """Return the language of the job of a record."""
    table = record["job"]["table"] or {}  # None for a survey without tank
    return table.get("language") or DEFAULT


def marks_of(words):
    """Return the decimal mark and other number marks of a language (digits.Marks)."""
    return Marks(**words["language"]["marks"])


def sentence(words, group, code, value=None):
    """Return the sentence of `words[group]` for `code` (and `value`) of the record.

    A template may contain {value}: a list is shown as its items joined by ", ", a number with up to
    six digits. In a table of templates, the key is the value as text, then "none" for null or an
    empty list, then "other". A code or value without words is shown as "code: value", so that no
    assumption is hidden.
    """
    if isinstance(value, list | tuple):
        value = ", ".join(str(item) for item in value) or None
    shown = shortest(value, marks_of(words)) if isinstance(value, float) else value
    template = words.get(group, {}).get(code)
    if isinstance(template, dict):
        key = "none" if value is None else str(value)
        template = template.get(key, template.get("other"))
    if template is None:
        return code if value is None else f"{code}: {value}"
    return template.format(value=shown)


def choice_sentence(words, choice):
    """Return the sentence of a choice {code, value} of the record."""
    code, value = choice["code"], choice["value"]
    if code == "coverage":
        value = percent(words, value)
    elif isinstance(value, int | float):
        digits = 6 if code in _DECLARED else 3
        value = shortest(value, marks_of(words), digits=digits)
    elif isinstance(value, list):
        value = [words["inputs"].get(name, name) for name in value]
    return sentence(words, "choices", code, value)


# ---- English texts of the record, with a code and values

MESSAGES = ("warnings", "formulas", "datum", "problems")  # groups of templates


def message_sentence(words, text, code, values):
    """Translate a text of the record; it is unchanged if its code has no words."""
    template = next(
        (words[group][code] for group in MESSAGES if code in words.get(group, {})), None
    )
    if template is None:
        return text
    named = {key: _name_value(words, key, value) for key, value in values.items()}
    return fill_template(
        template,
        named,
        number=lambda value, form: _number(value, form, marks_of(words)),
        said=lambda nested: message_sentence(
            words, nested["text"], nested["code"], nested["values"]
        ),
    )


def say(words, text):
    """Return a Message in the language of the reader; any other text is returned unchanged."""
    known = as_plain(text)
    return message_sentence(words, str(text), known["code"], known["values"])


def translate_record(words, record):
    """Return a record with texts in the language of the reader, where the texts have codes."""
    adjustment, corrections = record["adjustment"], record["corrections"]
    return {
        **record,
        "warnings": [
            _translate_file(words, _name_keys(words, _translate_row(words, row, "text")))
            for row in record["warnings"]
        ],
        "corrections": [_translate_row(words, row, "formula", "formula_") for row in corrections],
        "adjustment": adjustment and _adjustment_in_language(words, adjustment),
        "rule": record.get("rule") and _rule_in_language(words, record),
    }


def _adjustment_in_language(words, adjustment):
    """Return the adjustment of a record with translated texts."""
    left_out = [_translate_row(words, row, "text") for row in adjustment.get("left_out", [])]
    places = {}
    if residuals := adjustment.get("residuals"):  # by columns
        files = residuals["file"]
        translated = {file: _translate_place(words, file) for file in set(files)}
        places["residuals"] = residuals | {"file": [translated[file] for file in files]}
    if held := adjustment.get("held"):
        places["held"] = [_translate_file(words, row) for row in held]
    return {
        **adjustment,
        **places,
        "datum": _translate_row(words, adjustment["datum"], "words", "words_"),
        "aside": [row["text"] for row in left_out] or adjustment["aside"],
    }


def _rule_in_language(words, record):
    """Return the verdict with translated texts of a shipped rule; user rules stay unchanged."""
    rule, texts = record["rule"], words.get("rule_texts", {})
    return {**rule, "rule": {**rule["rule"], **texts.get(record["job"]["table"]["rule"], {})}}


def _translate_row(words, row, key, of=""):
    """Return a row with a translated text in `key`; rows of older records have no code."""
    code, values = row.get(f"{of}code"), row.get(f"{of}values", {})
    return {**row, key: message_sentence(words, row[key], code, values)}


def _name_keys(words, row):
    """Return a warning that names inputs and entries of the certificate, in place of their keys."""
    text, values = row["text"], row.get("values", {})
    labels = words.get("labels", {}) | {"number": words.get("page", {}).get("number", "number")}
    for key, names in (("inputs", words.get("inputs", {})), ("entries", labels)):
        if isinstance(keys := values.get(key), list):
            named = "; ".join(names.get(name, name) for name in keys)
            text = text.replace(", ".join(keys), named)
    return {**row, "text": text}


def _translate_file(words, row):
    """Return a row of the record with a translated name of its sheet."""
    return {**row, "file": _translate_place(words, row["file"])}


def _translate_place(words, file):
    """Return a file name unchanged, or the translated name of a sheet."""
    if not file.startswith(SHEET):
        return file
    return message_sentence(words, file, "in_sheet", {"sheet": file.removeprefix(SHEET)})


def _number(value, form, marks):
    """Format a number with a Python format (".1f", ".3g", "+g"; "" for a count) and marks."""
    if value is not None and not isinstance(value, Number):
        return str(value)
    if not form and not isinstance(value, Integral):
        return shortest(value, marks, digits=12)
    sign = "+" if form.startswith("+") and value > 0 else ""
    digits = form.strip("+.fg")
    if form.endswith("g"):
        return sign + shortest(value, marks, digits=int(digits or 6))
    return sign + fixed(value, int(digits or 0), marks)


def _name_value(words, key, value):
    """Replace codes among the values of a message by names."""
    if key == "row" or key.endswith("_row"):
        return str(value)  # a row number has no group marks
    if key == "note":
        return _notes(words).get(value, value) if isinstance(value, str) else value
    if key == "choice":
        return word_of(words["language"].get("code"), value)
    if key == "kind":
        known = words["observations"]  # some kinds are named after their table
        return known.get(value, known.get(f"{value.replace(' ', '_')}s", value))
    if key in ("group", "of_group"):
        name = words["observed"].get(value, value)
        return name[:1].lower() + name[1:]
    if key == "inputs":
        return "; ".join(name_of_input(words, code) for code in value)
    if key == "entries":  # of [certificate]
        labels = words["page"] | words["labels"]
        return "; ".join(labels.get(entry, entry) for entry in value)
    return value


def _notes(words):
    """Return {English note of a key or column of a job: translated note}."""
    translated = words.get("input", {}).get("notes", {})
    return {
        note: translated[group][key]
        for note, (group, key) in NOTES.items()
        if key in translated.get(group, ())
    }


_DECLARED = ("head",)  # choices with a number of the job, which is not rounded


NAMED_INPUTS = (
    *("deadwood", "instrument_scale", "instrument_offset", "plate_readings"),
    "registration",
    *("tape_comparison", "tape_temperature", "tape_tension", "tape_friction"),
    *("tape_weight", "tape_sag"),
)


def input_name(words, row):
    """Return the name of an input of the budget; a default value is marked.

    Some inputs include the name of their item or instrument.
    """
    is_share = row["input"] == "deadwood" and row["unit"] == "%"
    name = name_of_input(words, "deadwood_share" if is_share else row["input"])
    if row["input"] in NAMED_INPUTS and row["note"] and not is_share:
        note = row["note"]
        if row["input"] == "plate_readings":  # its note is the name of a course
            note = words["texts"]["named_course"].format(course=note)
        name = f"{name}: {note}"
    return words["texts"]["default_input"].format(input=name) if row.get("is_default") else name


def name_of_input(words, code):
    """Return the name of an input; correlated inputs have one name, "a & b"."""
    return " & ".join(words["inputs"].get(part, part) for part in code.split(" & "))


# ---- sentences about an adjustment, for reports and workbook

MOST_NAMES = 12  # largest number of names in a sentence


def group_name(words, group):
    """Return the name of a group of observations: "Distances (tape 1)", "Zenith angles"."""
    known, name = words["observed"], group["name"]
    if name in known:
        return known[name]
    kind = known.get(group["kind"], group["kind"])
    return f"{kind} ({name})" if name else kind


def observation_name(words, reading):
    """Return the kind of a reading; some, such as zenith angles, are identified by their files."""
    known, kind = words["observations"], reading["kind"]
    return known.get(reading["file"].removesuffix(".csv"), known.get(kind, kind))


def global_test_sentence(words, adjustment):
    """Return the result of the global test with its bounds."""
    bounds = adjustment["chi2_bounds"]
    if bounds is None:
        return words["texts"]["test_none"]
    verdict = "above" if adjustment["chi2"] > bounds[1] else "below"
    low, high, chi2 = (_format_fixed(words, value, 1) for value in (*bounds, adjustment["chi2"]))
    return words["texts"][f"test_{'passed' if adjustment['passed'] else verdict}"].format(
        low=low,
        high=high,
        statistic=chi2,
        dof=_format_fixed(words, adjustment["redundancy"]),
        confidence=percent(words, adjustment["confidence"]),
    )


def scale_sentence(words, adjustment):
    """Return the variance factor used for the covariances."""
    factor = _format_fixed(words, adjustment["cov_scale"], 3)
    return words["texts"][f"scale_{adjustment['scale']}"].format(factor=factor)


def snooping_sentence(words, adjustment):
    """Return the method of blunder detection and the number of rejected observations."""
    if not adjustment["snooping"]:
        return words["texts"]["snooping_off"]
    removed = {(row["kind"], tuple(row["ids"]), row["row"]) for row in adjustment["removed"]}
    return words["texts"]["snooping_on"].format(
        critical=_format_fixed(words, adjustment["critical_w"], 2),
        rounds=_format_fixed(words, adjustment["rounds"]),
        removed=_format_fixed(words, len(removed)),
    )


def datum_sentences(words, adjustment):
    """Return sentences about the datum and about quantities that depend on it."""
    datum, texts = adjustment["datum"], words["texts"]
    held = [name for name in datum["held"] if datum["choice"] != "inner" or ":" not in name]
    sentences = [texts[f"datum_{datum['choice']}"].format(held=list_names(words, held))]
    if len(held) < len(datum["held"]):
        fixed = [name for name in datum["held"] if ":" in name]
        sentences = [
            texts["datum_fixed"].format(held=list_names(words, fixed)),
            *(sentences if held else []),
        ]
    if datum["defect"]:
        words_of_defect = datum["words"].split(";")[0].rstrip(".")
        sentences.append(texts["datum_defect"].format(words=words_of_defect))
        by_control = "_control" if datum["choice"] == "control" else ""
        sentences.append(texts[f"datum_dependent{by_control}"])
    for what in ("vertical", "scale"):
        sentences.append(texts[f"{what}_{'observed' if datum[what] else 'not_observed'}"])
    return sentences


def verdict_sentences(words, adjustment):
    """Return a sentence for each group of observations that differs from its declared accuracy."""
    return [
        words["texts"][f"group_{row['verdict']}"].format(
            group=group_name(words, row),
            **{key: factor_text(words, row[name]) for key, name in _FACTORS.items()},
        )
        for row in adjustment["groups"]
        if row["verdict"] in ("worse", "better")
    ]


_FACTORS = {"factor": "factor", "low": "factor_low", "high": "factor_high"}


def method_line(words, adjustment):
    """Return the observations, the number of points and sigma0 in one line for a certificate."""
    parts = []
    if adjustment["photos"]:
        cameras = list_names(words, dict.fromkeys(row["camera"] for row in adjustment["photos"]))
        photographs = words["observed"]["photographs"]
        parts.append(
            f"{photographs} ({cameras}): {_format_fixed(words, len(adjustment['photos']))}"
        )
    groups = [row for row in adjustment["groups"] if row["kind"] != "weighted unknown"]
    for row in sorted(groups, key=lambda row: row["kind"] != "image coordinate"):
        name = group_name(words, row)
        parts.append(f"{name[:1].lower()}{name[1:]}: {_format_fixed(words, row['count'])}")
    sigma0 = adjustment["sigma0"]
    return words["texts"]["method_of_survey"].format(
        observed=", ".join(parts),
        points=_format_fixed(words, len(adjustment["points"])),
        sigma=NOTHING if sigma0 is None else _format_fixed(words, sigma0, 2),
    )


def list_names(words, names):
    """Return the first names and the number of further names; "P7:xyz" is shown as P7."""
    names = [str(name).removesuffix(":xyz") for name in names]
    if names == ["all"]:
        return words["texts"]["all_points"]
    if len(names) <= MOST_NAMES:
        return ", ".join(names)
    more, first = len(names) - MOST_NAMES, ", ".join(names[:MOST_NAMES])
    return words["texts"]["and_more"].format(names=first, more=more)


def make_sentence(text):
    """Return a text of the record with a capital letter and a full stop."""
    return text[:1].upper() + text[1:].rstrip(".") + "."


def percent(words, share):
    """Format a share in percent with the marks of the language."""
    return f"{shortest(100 * share, marks_of(words))}\N{NO-BREAK SPACE}%"


def factor_text(words, value):
    """Format a ratio of standard deviations."""
    return _format_fixed(words, value, 2 if value < 10 else 1)


def _format_fixed(words, value, decimals=0):
    return fixed(value, decimals, marks_of(words))
