"""The statement of conformity by the decision rule of the job: sentences and tables."""

from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, Table
from tankcal.text.digits import decimals_of

CERTAIN = 1e-4  # probabilities closer to 0 or 1 are printed as a limit
_LITRES = numbers.unit("m3").least
_LITRES_OF_U, _LITRES_OF_WORST = ({"u": u, "least": _LITRES} for u in ("U_m3", "worst_U_m3"))
_ENDS = ("TL_m3", "TU_m3", "AL_m3", "AU_m3")  # tolerance limits and acceptance limits


def facts(paper):
    """Return labels and texts: the rule, its source, and the verdict on the tank."""
    verdict = paper.record["rule"]
    rule = verdict["rule"]
    return [
        ("rule_name", rule["name"]),
        ("rule_verdict", paper.word(f"rule_codes.{verdict['code']}")),
        ("rule_unjudged", ", ".join(verdict["unjudged"])),
        ("rule_source", rule["source"]),
        ("rule_verified", paper.word(f"verified.{verdict['verified']}")),
        ("rule_remark", rule["remark"]),
        ("rule_largest", _volume(paper, rule["largest_capacity_m3"], 0)),
        ("rule_tank", paper.word(f"rule_tanks.{verdict['tank']}")),
        ("rule_capacity", _volume(paper, verdict["capacity_m3"], _LITRES)),
    ]


def sentences(paper):
    """Return a sentence on the result for each limit (list of str)."""
    verdict = paper.record["rule"]
    texts = [_limit_sentence(paper, result) for result in verdict["uncertainty"]]
    texts += [
        paper.word("texts.rule_deviation", **deviation_texts(paper, result))
        for result in verdict["deviation"]
    ]
    return [*texts, *_propagation_note(paper)]


def _propagation_note(paper):
    """Return a sentence on the evaluation of limits for deliveries if Monte Carlo is used."""
    limits = paper.record["rule"]["uncertainty"]
    is_bound = any(limit["of"] == "deliveries" for limit in limits)
    return [paper.word("texts.by_law_only")] if is_bound and paper.record["monte_carlo"] else []


def is_read(paper):
    """Return whether all values of the rule were checked against the legal text.

    The certificate does not state the verdict of an unchecked rule.
    """
    return paper.record["rule"]["verified"]


def blocks_of_verdict(paper):
    """Blocks of the chapter of the certificate; [] for an unchecked rule."""
    return [paper.heading("rule"), *_verdict(paper)] if is_read(paper) else []


def blocks_of_unread(paper):
    """Blocks of the working papers, with the verdict of an unchecked rule."""
    if is_read(paper):
        return [paper.facts(facts(paper))]
    return [paper.paragraph("rule_unread"), *_verdict(paper)]


def _verdict(paper):
    shown = [paper.facts(facts(paper))]
    texts = sentences(paper)
    return [*shown, blocks.listing(texts)] if texts else shown


# ---- limits of the expanded uncertainty


def limit_text(paper, result):
    """Return a limit of U in words: quantity, value and reference."""
    height = paper.plain(result["minimum_height_m"], "m") if result["minimum_height_m"] else ""
    quantity = paper.word(f"limited.{result['of']}", height=height)
    if result["limit"] is None:
        return paper.word("texts.rule_no_limit", of=quantity)
    relative_to = paper.word(f"relative_to.{result['relative_to']}")
    return paper.word(
        "texts.rule_limit",
        of=quantity,
        limit=paper.percent(result["limit"]),
        relative_to=relative_to,
    )


def _limit_sentence(paper, result):
    return paper.word(
        f"texts.rule_{result['code']}",
        limit=limit_text(paper, result),
        place=place_text(paper, result),
        worst=worst_text(paper, result),
    )


def place_text(paper, result):
    """Return the level, or height of delivery, above which a limit is met; None: nowhere."""
    if result["from_m"] is None:
        return None
    level = paper.height(result["from_m"])
    if result["from_m3"] is None:
        return paper.word("texts.from_height", height=level)
    volume = _volume(paper, result["from_m3"], _LITRES)
    return paper.word("texts.from_level", level=level, volume=volume)


def worst_text(paper, result):
    """Return the place with the largest ratio of U to the limit; None: not evaluated."""
    if result["worst_m"] is None:
        return None
    ratio = ""
    if result["worst_ratio"] is not None:
        relative_to = paper.word(f"relative_to.{result['relative_to']}")
        ratio = paper.number(result["worst_ratio"], "share", digits=2)
        ratio = paper.word("texts.worst_ratio", ratio=ratio, relative_to=relative_to)
    name = "row" if result["worst_low_m"] is None else "delivery"
    return paper.word(
        f"texts.worst_{name}",
        low=paper.height(result["worst_low_m"]),
        high=paper.height(result["worst_m"]),
        volume=_volume(paper, result["worst_m3"], _LITRES),
        U=paper.number(result["worst_U_m3"], "m3", u=result["worst_U_m3"]),
        ratio=ratio,
    )


LIMITS = Table(
    "limits",
    (
        Column("limit_of", text=limit_text, sheet="limit", width=40),
        Column("limit", "share", digits=2, on="", sheet="at_most"),
        Column("verdict", text=lambda paper, result: paper.word(f"limit_codes.{result['code']}"),
               sheet="verdict", width=16),
        Column("kept_from", text=place_text, heading="from_m"),
        Column("worst", text=worst_text),
        Column("from_m", "m", height=True, on="", sheet="kept_from_m"),
        Column("from_m3", "m3", on="", sheet="kept_from_m3", **_LITRES_OF_WORST),
        Column("worst_m", "m", height=True, on="", sheet="worst_dip_m"),
        Column("worst_low_m", "m", height=True, on="", sheet="worst_down_to_m"),
        Column("worst_m3", "m3", on="", sheet="worst_m3", **_LITRES_OF_WORST),
        Column("worst_U_m3", "m3", u="worst_U_m3", on="", sheet="worst_U_m3"),
        Column("worst_ratio", "share", digits=2, on="", sheet="worst_ratio"),
        Column("clause", on="", sheet="clause", width=40),
        Column("verified", on="", sheet="verified"),
    ),
    rows=lambda record: record["rule"]["uncertainty"],
)  # fmt: skip


def limit_blocks(paper):
    """Table of the limits of U; [] if there are none."""
    return [paper.show(LIMITS)] if LIMITS.rows(paper.record) else []


# ---- deviations from stated volumes


def deviation_texts(paper, result):
    """Return the texts of a deviation, {name: text}."""
    u = result["U_m3"]
    low = paper.height(result["low_m"])
    name = "row" if result["low_m"] is None else "delivery"
    return {
        "place": paper.word(f"texts.place_{name}", high=paper.height(result["high_m"]), low=low),
        **{
            key: paper.number(result[f"{key}_m3"], "m3", u=u)
            for key in ("volume", "stated", "deviation", "U")
        },
        "dips": _dips(paper, result),
        "limit": paper.word(
            f"limit_sides.{result['side']}", limit=_permissible_deviation(paper, result)
        ),
        "guard": paper.word(f"guards.{result['guard']}"),
        "verdict": paper.word(f"deviation_codes.{result['code']}"),
        "probability": probability(paper, result["probability"]),
    }


def _dips(paper, result):
    high = paper.height(result["high_m"])
    return high if result["low_m"] is None else f"{paper.height(result['low_m'], '')} – {high}"


def _permissible_deviation(paper, result):
    """Return the largest permissible deviation of a volume from the stated volume."""
    if result["limit"] is None:
        return paper.plain(result["limit_m3"] * paper.volume_factor, paper.volume_symbol)
    return paper.word("texts.limit_of_stated", limit=paper.percent(result["limit"]))


def probability(paper, share):
    """Format a probability in percent; values close to 0 or 1 are printed as a limit."""
    if share > 1 - CERTAIN:
        return paper.word("texts.more_probable", probability=paper.percent(1 - CERTAIN))
    if share < CERTAIN:
        return paper.word("texts.less_probable", probability=paper.percent(CERTAIN))
    return paper.number(share, "share", decimals=2)


def deviation_limit_text(paper, result):
    """Return a limit of a deviation in words."""
    quantity = paper.word(f"limited_deviation.{result['of']}")
    limit = deviation_texts(paper, result)["limit"]
    return paper.word("texts.rule_deviation_limit", of=quantity, limit=limit)


def _text_column(name, **more):
    """Return a column with a text of `deviation_texts`."""
    return Column(name, text=lambda paper, result: deviation_texts(paper, result)[name],
                  heading=f"deviation_{name}", **more)  # fmt: skip


def _decimals_of_probability(result):
    """Return the decimals that distinguish a probability from 0 and 1."""
    rest = 100 * min(result["probability"], 1 - result["probability"])
    return min(decimals_of(rest, significant=1, least=2), 6)


DEVIATIONS = Table(
    "stated_deviations",
    (
        Column("dips", text=_dips, heading="deviation_place"),
        Column("limit_of", text=deviation_limit_text, on="", sheet="limit", width=40),
        Column("high_m", "m", height=True, on="", sheet="from_dip_m"),
        Column(
            "verdict_there",
            text=lambda paper, result: paper.word(f"deviation_codes.{result['code']}"),
            on="",
            sheet="verdict",
            width=16,
        ),
        Column("low_m", "m", height=True, on="", sheet="down_to_m"),
        _text_column("volume", align="right"),
        _text_column("stated", align="right"),
        _text_column("deviation", align="right"),
        Column("stated_m3", "m3", on="", sheet="stated_m3", **_LITRES_OF_U),
        Column("volume_m3", "m3", on="", sheet="table_m3", **_LITRES_OF_U),
        Column("deviation_m3", "m3", on="", sheet="deviation_m3", **_LITRES_OF_U),
        _text_column("U", align="right"),
        Column("U_m3", "m3", u="U_m3", on="", sheet="U_m3"),
        _text_column("limit"),
        _text_column("guard", sheet="guard"),
        _text_column("verdict"),
        _text_column("probability", align="right"),
        Column(
            "conformity",
            "share",
            on="",
            sheet="conformity",
            in_sheet={"key": "probability", "decimals": _decimals_of_probability},
        ),
        Column("clause", on="", sheet="clause", width=40),
        Column("verified", on="", sheet="verified"),
    ),
    rows=lambda record: record["rule"]["deviation"],
)
ACCEPTANCE = Table(
    "acceptance",
    (
        Column("limit_of", text=deviation_limit_text, sheet="limit", width=40),
        Column("high_m", "m", height=True, sheet="from_dip_m"),
        Column("guard_m3", "m3", sheet="guard_band_m3", width=16, **_LITRES_OF_U),
        *(Column(code, "m3", sheet=code, **_LITRES_OF_U) for code in _ENDS),
    ),
    rows=lambda record: [
        result | dict(zip(_ENDS, (*result["tolerance_m3"], *result["accepted_m3"]), strict=True))
        for result in record["rule"]["deviation"]
    ],
)  # fmt: skip


def deviation_blocks(paper):
    """Table of the deviations; [] if there are none."""
    return [paper.show(DEVIATIONS)] if DEVIATIONS.rows(paper.record) else []


def clauses(paper):
    """Block of sentences on the source of each limit and whether it was checked; [] if none."""
    verdict = paper.record["rule"]
    texts = [(limit_text(paper, result), result) for result in verdict["uncertainty"]]
    texts += [(deviation_limit_text(paper, result), result) for result in verdict["deviation"]]
    sentences = [
        paper.word(
            "texts.rule_clause" if result["clause"] else "texts.rule_without_clause",
            limit=text,
            clause=result["clause"],
            verified=paper.word(f"verified.{result['verified']}"),
        )
        for text, result in texts
    ]
    sentences = [*dict.fromkeys(sentences), *_propagation_note(paper)]
    return [blocks.listing(sentences)] if sentences else []


def _volume(paper, value_m3, decimals):
    return paper.number(value_m3, "m3", decimals=decimals)
