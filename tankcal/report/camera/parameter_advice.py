"""What dropping parameters of a camera does, the authors' rules, and the recommendation."""

from tankcal.report import blocks
from tankcal.report.camera.parameter_tests import reach
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING


def dropping(paper):
    """What the survey and the volume do without parameters."""
    sets, whole = paper.result["without"], paper.result["with_all"]
    done = [one for one in sets if one["points"]]
    found = []
    if done:
        found.append(_dropped_table(paper, done))
        if not all(one["comparable"] for one in done):
            found.append(paper.paragraph("not_comparable"))
    elif sets:
        found.append(paper.paragraph("no_product"))
    for one in sets:
        if one["failed"]:
            code = "no_volume_without" if one["points"] else "failed_without"
            names = paper.parameters(one["names"])
            found.append(paper.paragraph(code, names=names, text=one["failed"]))
    if whole and whole["no_volume"]:
        found.append(paper.paragraph("no_volume", text=whole["no_volume"]))
    return found


def _dropped_table(paper, done):
    rows = [
        {
            "without": paper.parameters(one["names"]) + ("" if one["comparable"] else " *"),
            "because": ", ".join(paper.words["whys"].get(why, why) for why in one["because"]),
            "sigma0": one["sigma0"],
            "rms_moved": one["points"]["rms_mm"],
            "largest_moved": one["points"]["largest_mm"],
            "largest_sds": one["points"]["largest_sds"],
            "volume_change_m3": one["volume_change_m3"],
            "volume_u_m3": one["volume_u_m3"],
        }
        for one in done
    ]
    columns = [
        Column("without"),
        Column("because"),
        Column("sigma0", decimals=3),
        Column("rms_moved", "image mm", decimals=3),
        Column("largest_moved", "image mm", decimals=3),
        Column("largest_sds", decimals=2),
    ]
    if any(row["volume_change_m3"] is not None for row in rows):
        columns += [
            Column("volume_change_m3", "m3", decimals=4),
            Column("volume_u_m3", "m3", digits=2),
        ]
    return paper.table("without", rows, columns)


def rules(paper):
    """What the rules of the two authors say."""
    found, sentences = paper.result["rules"] or {}, []
    silva, pessoa = found.get("silva"), found.get("pessoa")
    nothing = paper.text("none")
    if silva:
        sentences.append(
            paper.text(
                "silva",
                may_go=silva["may_go"],
                negligible=paper.plain(silva["negligible_percent"]),
                loading=paper.plain(silva["loading"]),
                drop=paper.parameters(silva["drop"]) or nothing,
            )
        )
    if pessoa:
        kept = [
            paper.text(
                "pessoa_kept",
                name=paper.parameters([one["name"]]),
                because=paper.words["pessoa"].get(one["because"], one["because"]),
            )
            for one in pessoa["keep"]
        ]
        px, um = pessoa["limit_px"], pessoa["limit_um"]
        limit = paper.number(px, "px", digits=2) if px is not None else None
        sentences.append(
            paper.text(
                "pessoa",
                limit=limit or (paper.number(um, "um", digits=2) if um is not None else NOTHING),
                drop=paper.parameters(pessoa["drop"]) or nothing,
                keep=", ".join(kept) or nothing,
            )
        )
    return [blocks.listing(sentences)] if sentences else []


def recommendation(paper):
    """The advice in a sentence, where test and effect disagree, and the reasons of each."""
    advice = paper.result["recommendation"]
    may_go = [one["name"] for one in advice if not one["keep"]]
    code = "advice_some" if may_go else "advice_none"
    found = [paper.paragraph(code, names=paper.parameters(may_go))]
    if not paper.result["with_all"]:
        found.append(paper.paragraph("no_product"))
    disagree = [
        one["name"]
        for one in advice
        if {"significant_but_tiny", "insignificant_but_large"} & {r["code"] for r in one["reasons"]}
    ]
    if disagree:
        found.append(paper.paragraph("disagree", names=paper.parameters(disagree)))
    codes = [reason["code"] for one in advice for reason in one["reasons"]]
    if "corner_not_seen" in codes:
        found.append(paper.paragraph("beyond_points", **reach(paper)))
    together = [reason for one in advice for reason in one["reasons"] if _is_of_all(reason)]
    sentences = dict.fromkeys(_as_sentence(paper.reason(reason)) for reason in together)
    found += [blocks.paragraph(sentence) for sentence in sentences]
    return [*found, blocks.listing(_advice(paper, one) for one in advice)]


def _is_of_all(reason):
    """Whether a reason is of all parameters that may go together: it is told once."""
    code = reason["code"]
    return code.startswith("together_") or (code == "not_determined_without" and "names" in reason)


def _advice(paper, one):
    own = [reason for reason in one["reasons"] if not _is_of_all(reason)]
    return paper.text(
        "reasons_of",
        name=paper.parameters([one["name"]]),
        advice=paper.words["advice"][str(one["keep"])],
        reasons=" ".join(_as_sentence(paper.reason(reason)) for reason in own),
    )


def _as_sentence(text):
    """With a capital letter and a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
