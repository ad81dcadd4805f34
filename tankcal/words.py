"""Codes of the record as sentences, in the reader's language (report_templates/words/)."""

import tomllib

from tankcal.errors import TankcalError
from tankcal.shipped import shipped


def load_words(language="en"):
    """The words of one language: {group: {code: template, or {value: template}}}.

    Raises TankcalError when no words are shipped in that language.
    """
    folder = shipped("report_templates") / "words"
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if language not in known:
        raise TankcalError(
            f"there are no words in language {language!r}; shipped: {', '.join(known) or 'none'}"
        )
    return tomllib.loads(known[language].read_text(encoding="utf-8"))


class _Number(float):
    """A number that a plain {value} shows with six significant digits at most."""

    def __format__(self, spec):
        return super().__format__(spec or ".6g")


def sentence(words, group, code, value=None):
    """What `code` (with `value`) of the record says, as a sentence of `words[group]`.

    A template may use {value}: a list comes as its items joined by ", ", a number that has no
    format of its own with up to six digits. A table of templates is
    looked up by the value as text, then "none" for null or an empty list, then "other". A code or
    value without words comes back as "code: value", for an assumption is never hidden.
    """
    if isinstance(value, list | tuple):
        value = ", ".join(str(item) for item in value) or None
    shown = _Number(value) if isinstance(value, float) else value
    template = words.get(group, {}).get(code)
    if isinstance(template, dict):
        key = "none" if value is None else str(value)
        template = template.get(key, template.get("other"))
    if template is None:
        return code if value is None else f"{code}: {value}"
    return template.format(value=shown)


def choice_sentence(words, choice):
    """One choice {code, value} of the record as a sentence, its numbers in the reader's style."""
    value = choice["value"]
    if choice["code"] == "coverage":
        value = f"{100 * value:.6g}\N{NO-BREAK SPACE}%"
    elif isinstance(value, int | float):
        value = f"{value:.3g}"
    elif isinstance(value, list):
        return sentence(
            words, "choices", choice["code"], [words["inputs"].get(name, name) for name in value]
        )
    mark = words["language"]["decimal"]
    is_number = any(sign.isdigit() for sign in value)
    return sentence(
        words, "choices", choice["code"], value.replace(".", mark) if is_number else value
    )


NAMED_INPUTS = ("deadwood", "instrument_scale", "instrument_offset")


def input_name(words, row):
    """The name of an input of the budget; some have that of an item or instrument beside it."""
    name = sentence(words, "inputs", row["input"])
    return f"{name}: {row['note']}" if row["input"] in NAMED_INPUTS and row["note"] else name


# ---- what the record says of an adjustment: the same sentences on paper and in the workbook

MOST_NAMES = 12  # that a sentence lists


def group_name(words, group):
    """A group of observations in words: "Distances (tape 1)", "Zenith angles"."""
    known, name = words["observed"], group["name"]
    if name in known:
        return known[name]
    kind = known.get(group["kind"], group["kind"])
    return f"{kind} ({name})" if name else kind


def observation_name(words, reading):
    """What a reading is: some kinds are told apart by their files, such as zenith angles."""
    known, kind = words["observations"], reading["kind"]
    return known.get(reading["file"].removesuffix(".csv"), known.get(kind, kind))


def global_test_sentence(words, adjustment):
    """What the global test says, with its bounds."""
    bounds = adjustment["chi2_bounds"]
    if bounds is None:
        return words["texts"]["test_none"]
    verdict = "above" if adjustment["chi2"] > bounds[1] else "below"
    low, high, chi2 = (_fixed(words, value, 1) for value in (*bounds, adjustment["chi2"]))
    return words["texts"][f"test_{'passed' if adjustment['passed'] else verdict}"].format(
        low=low,
        high=high,
        statistic=chi2,
        dof=adjustment["redundancy"],
        confidence=percent(words, adjustment["confidence"]),
    )


def scale_sentence(words, adjustment):
    """Which variance factor the covariances bear."""
    factor = _fixed(words, adjustment["cov_scale"], 3)
    return words["texts"][f"scale_{adjustment['scale']}"].format(factor=factor)


def snooping_sentence(words, adjustment):
    """How blunders were searched, and how many observations were set aside."""
    if not adjustment["snooping"]:
        return words["texts"]["snooping_off"]
    removed = {(row["kind"], tuple(row["ids"]), row["row"]) for row in adjustment["removed"]}
    return words["texts"]["snooping_on"].format(
        critical=_fixed(words, adjustment["critical_w"], 2),
        rounds=adjustment["rounds"],
        removed=len(removed),
    )


def datum_sentences(words, adjustment):
    """What holds the frame, and what depends on that choice."""
    datum, texts = adjustment["datum"], words["texts"]
    found = [texts[f"datum_{datum['choice']}"].format(held=listed(words, datum["held"]))]
    if datum["defect"]:
        words_of_defect = datum["words"].split(";")[0].rstrip(".")
        found.append(texts["datum_defect"].format(words=words_of_defect))
        by_control = "_control" if datum["choice"] == "control" else ""
        found.append(texts[f"datum_dependent{by_control}"])
    for what in ("vertical", "scale"):
        found.append(texts[f"{what}_{'observed' if datum[what] else 'not_observed'}"])
    return found


def verdict_sentences(words, adjustment):
    """A sentence for each group of observations that is not what was declared."""
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
    """What was measured, how many points, sigma0: one line for a certificate."""
    parts = []
    if adjustment["photos"]:
        cameras = listed(words, dict.fromkeys(row["camera"] for row in adjustment["photos"]))
        photographs = words["observed"]["photographs"]
        parts.append(f"{len(adjustment['photos'])} {photographs} ({cameras})")
    groups = [row for row in adjustment["groups"] if row["kind"] != "weighted unknown"]
    for row in sorted(groups, key=lambda row: row["kind"] != "image coordinate"):
        name = group_name(words, row)
        parts.append(f"{row['count']} {name[:1].lower()}{name[1:]}")
    sigma0 = adjustment["sigma0"]
    return words["texts"]["method_of_survey"].format(
        observed=", ".join(parts),
        points=len(adjustment["points"]),
        sigma="–" if sigma0 is None else _fixed(words, sigma0, 2),
    )


def listed(words, names):
    """The first names, and how many more there are; "P7:xyz" is P7."""
    names = [str(name).removesuffix(":xyz") for name in names]
    if names == ["all"]:
        return words["texts"]["all_points"]
    if len(names) <= MOST_NAMES:
        return ", ".join(names)
    more, first = len(names) - MOST_NAMES, ", ".join(names[:MOST_NAMES])
    return words["texts"]["and_more"].format(names=first, more=more)


def as_sentence(text):
    """A text of the record with a capital letter and a full stop."""
    return text[:1].upper() + text[1:].rstrip(".") + "."


def percent(words, share):
    """A share in percent, in the reader's style."""
    text = f"{100 * share:.6g}".replace(".", words["language"]["decimal"])
    return f"{text}\N{NO-BREAK SPACE}%"


def factor_text(words, value):
    """A factor of standard deviations."""
    return _fixed(words, value, 2 if value < 10 else 1)


def _fixed(words, value, decimals):
    return f"{value:.{decimals}f}".replace(".", words["language"]["decimal"])
