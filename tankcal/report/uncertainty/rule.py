"""The verdict of the job's decision rule: sentences for a certificate, tables for the papers."""

from tankcal.report import blocks, numbers
from tankcal.report.tables import Column, Table
from tankcal.text.digits import decimals_of

CERTAIN = 1e-4  # a probability nearer to 0 or 1 is not printed in full
_LITRES = numbers.unit("m3").least
_LITRES_OF_U, _LITRES_OF_WORST = ({"u": u, "least": _LITRES} for u in ("U_m3", "worst_U_m3"))
_ENDS = ("TL_m3", "TU_m3", "AL_m3", "AU_m3")  # of tolerance and of acceptance


def facts(paper):
    """Labels and texts: the rule, where it comes from, what it says of the tank."""
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
    """What became of every limit, a sentence each."""
    verdict = paper.record["rule"]
    found = [_of_limit(paper, one) for one in verdict["uncertainty"]]
    found += [_of_deviation(paper, one) for one in verdict["deviation"]]
    return [*found, *_by_law(paper)]


def _by_law(paper):
    """How deliveries are judged where Monte Carlo was on, and there is a limit of them."""
    limits = paper.record["rule"]["uncertainty"]
    is_bound = any(one["of"] == "deliveries" for one in limits)
    return [paper.word("texts.by_law_only")] if is_bound and paper.record["monte_carlo"] else []


def is_read(paper):
    """Whether every value of the rule was read in the legal text; else it certifies nothing."""
    return paper.record["rule"]["verified"]


def blocks_of_verdict(paper):
    """The chapter of the certificate; nothing of a rule that nobody has read in the legal text."""
    return [paper.heading("rule"), *_verdict(paper)] if is_read(paper) else []


def blocks_of_unread(paper):
    """What the working papers say of such a rule, the verdict that the certificate leaves out."""
    if is_read(paper):
        return [paper.facts(facts(paper))]
    return [paper.paragraph("rule_unread"), *_verdict(paper)]


def _verdict(paper):
    found = [paper.facts(facts(paper))]
    texts = sentences(paper)
    return [*found, blocks.listing(texts)] if texts else found


# ---- limits of the expanded uncertainty


def limit_text(paper, one):
    """What a limit of U says: of what, how much, of what."""
    height = paper.plain(one["minimum_height_m"], "m") if one["minimum_height_m"] else ""
    of = paper.word(f"limited.{one['of']}", height=height)
    if one["limit"] is None:
        return paper.word("texts.rule_no_limit", of=of)
    relative_to = paper.word(f"relative_to.{one['relative_to']}")
    return paper.word(
        "texts.rule_limit", of=of, limit=paper.percent(one["limit"]), relative_to=relative_to
    )


def _of_limit(paper, one):
    return paper.word(
        f"texts.rule_{one['code']}",
        limit=limit_text(paper, one),
        place=place_text(paper, one),
        worst=worst_text(paper, one),
    )


def place_text(paper, one):
    """From which level and volume, or height of delivery, on a limit is kept; None: nowhere."""
    if one["from_m"] is None:
        return None
    level = paper.height(one["from_m"])
    if one["from_m3"] is None:
        return paper.word("texts.from_height", height=level)
    volume = _volume(paper, one["from_m3"], _LITRES)
    return paper.word("texts.from_level", level=level, volume=volume)


def worst_text(paper, one):
    """Where U is nearest to the limit or farthest beyond it; None: nothing was judged."""
    if one["worst_m"] is None:
        return None
    ratio = ""
    if one["worst_ratio"] is not None:
        relative_to = paper.word(f"relative_to.{one['relative_to']}")
        ratio = paper.number(one["worst_ratio"], "share", digits=2)
        ratio = paper.word("texts.worst_ratio", ratio=ratio, relative_to=relative_to)
    name = "row" if one["worst_low_m"] is None else "delivery"
    return paper.word(
        f"texts.worst_{name}",
        low=paper.height(one["worst_low_m"]),
        high=paper.height(one["worst_m"]),
        volume=_volume(paper, one["worst_m3"], _LITRES),
        U=paper.number(one["worst_U_m3"], "m3", u=one["worst_U_m3"]),
        ratio=ratio,
    )


LIMITS = Table(
    "limits",
    (
        Column("limit_of", text=limit_text, sheet="limit", width=40),
        Column("limit", "share", digits=2, on="", sheet="at_most"),
        Column("verdict", text=lambda paper, one: paper.word(f"limit_codes.{one['code']}"),
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
    """The limits of U as a table; nothing when there are none."""
    return [paper.show(LIMITS)] if LIMITS.rows(paper.record) else []


# ---- deviations from stated volumes


def _of_deviation(paper, one):
    return paper.word("texts.rule_deviation", **deviation_texts(paper, one))


def deviation_texts(paper, one):
    """The texts of a deviation by name."""
    u = one["U_m3"]
    low = paper.height(one["low_m"])
    name = "row" if one["low_m"] is None else "delivery"
    return {
        "place": paper.word(f"texts.place_{name}", high=paper.height(one["high_m"]), low=low),
        **{
            key: paper.number(one[f"{key}_m3"], "m3", u=u)
            for key in ("volume", "stated", "deviation", "U")
        },
        "dips": _dips(paper, one),
        "limit": paper.word(f"limit_sides.{one['side']}", limit=_room(paper, one)),
        "guard": paper.word(f"guards.{one['guard']}"),
        "verdict": paper.word(f"deviation_codes.{one['code']}"),
        "probability": probability(paper, one["probability"]),
    }


def _dips(paper, one):
    high = paper.height(one["high_m"])
    return high if one["low_m"] is None else f"{paper.height(one['low_m'], '')} – {high}"


def _room(paper, one):
    """How far a volume may be from the stated one."""
    if one["limit"] is None:
        return paper.plain(one["limit_m3"] * paper.volume_factor, paper.volume_symbol)
    return paper.word("texts.limit_of_stated", limit=paper.percent(one["limit"]))


def probability(paper, share):
    """A probability in percent; one very near to 0 or 1 as below or above what is printed."""
    if share > 1 - CERTAIN:
        return paper.word("texts.more_probable", probability=paper.percent(1 - CERTAIN))
    if share < CERTAIN:
        return paper.word("texts.less_probable", probability=paper.percent(CERTAIN))
    return paper.number(share, "share", decimals=2)


def deviation_limit_text(paper, one):
    """What a limit of a deviation says."""
    of = paper.word(f"limited_deviation.{one['of']}")
    limit = deviation_texts(paper, one)["limit"]
    return paper.word("texts.rule_deviation_limit", of=of, limit=limit)


def _in_words(name, **more):
    """A column of the paper with a text of a deviation."""
    return Column(name, text=lambda paper, one: deviation_texts(paper, one)[name],
                  heading=f"deviation_{name}", **more)  # fmt: skip


def _decimals_of_probability(one):
    """Near to 0 and 1 with as many decimals as tell them from these."""
    rest = 100 * min(one["probability"], 1 - one["probability"])
    return min(decimals_of(rest, significant=1, least=2), 6)


DEVIATIONS = Table(
    "stated_deviations",
    (
        Column("dips", text=_dips, heading="deviation_place"),
        Column("limit_of", text=deviation_limit_text, on="", sheet="limit", width=40),
        Column("high_m", "m", height=True, on="", sheet="from_dip_m"),
        Column(
            "verdict_there",
            text=lambda paper, one: paper.word(f"deviation_codes.{one['code']}"),
            on="",
            sheet="verdict",
            width=16,
        ),
        Column("low_m", "m", height=True, on="", sheet="down_to_m"),
        _in_words("volume", align="right"),
        _in_words("stated", align="right"),
        _in_words("deviation", align="right"),
        Column("stated_m3", "m3", on="", sheet="stated_m3", **_LITRES_OF_U),
        Column("volume_m3", "m3", on="", sheet="table_m3", **_LITRES_OF_U),
        Column("deviation_m3", "m3", on="", sheet="deviation_m3", **_LITRES_OF_U),
        _in_words("U", align="right"),
        Column("U_m3", "m3", u="U_m3", on="", sheet="U_m3"),
        _in_words("limit"),
        _in_words("guard", sheet="guard"),
        _in_words("verdict"),
        _in_words("probability", align="right"),
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
        one | dict(zip(_ENDS, (*one["tolerance_m3"], *one["accepted_m3"]), strict=True))
        for one in record["rule"]["deviation"]
    ],
)  # fmt: skip


def deviation_blocks(paper):
    """The deviations as a table; nothing when there are none."""
    return [paper.show(DEVIATIONS)] if DEVIATIONS.rows(paper.record) else []


def clauses(paper):
    """Where each limit stands, and whether it was read there, a sentence each."""
    verdict = paper.record["rule"]
    texts = [(limit_text(paper, one), one) for one in verdict["uncertainty"]]
    texts += [(deviation_limit_text(paper, one), one) for one in verdict["deviation"]]
    found = [
        paper.word(
            "texts.rule_clause" if one["clause"] else "texts.rule_without_clause",
            limit=text,
            clause=one["clause"],
            verified=paper.word(f"verified.{one['verified']}"),
        )
        for text, one in texts
    ]
    found = [*dict.fromkeys(found), *_by_law(paper)]
    return [blocks.listing(found)] if found else []


def _volume(paper, value_m3, decimals):
    return paper.number(value_m3, "m3", decimals=decimals)
