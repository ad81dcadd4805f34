"""Checks of the entries of a certificate and of its statements, by its words in six languages.

Words of certificates in six languages: labels, claims, intervals, placeholders.

Patterns of regular expressions for texts in English, Portuguese, Spanish, French, German and
Italian. They find a label or a claim in the certificate of any laboratory; a certificate that uses
other words gets a finding that a reader must check.

Checks of statements of conformity: ISO/IEC 17025:2017, 7.8.6, ILAC-G8 and the rule itself.

The verdicts are judged again from the table of the record.
"""

import math
import re
from datetime import date

import numpy as np

from tankcal.gum.conformity import decide
from tankcal.messages import message
from tankcal.products.assess.evidence import CERTIFICATE, compact
from tankcal.products.assess.requirements import (
    ILAC_G8,
    ISO_17025,
    MEMORY,
    MINOR,
    OBSERVATION,
    READ,
    Finding,
)
from tankcal.report.certificate import instruments_of, missing_keys
from tankcal.report.outputs import RECORD
from tankcal.report.uncertainty.rule import deviation_limit_text, limit_text
from tankcal.report.uncertainty.stated import stated_U_m3

PLACEHOLDER = re.compile(
    r"tbd|tba|todo|x{2,}|\?+|[-–—._/ ]+|n[./]?a\.?|<.*>|\[.*\]|lorem ipsum.*|fixme"
    r"|to be (filled|completed|determined|confirmed|defined).*|a (preencher|definir|confirmar).*"
    r"|por (completar|definir|confirmar).*|pendente|pendiente|pending|à compléter.*",
    re.IGNORECASE,
)
CLAIMS = re.compile(
    r"\b(compl(y|ies) with|conforms? (to|with)|in conformity with|in compliance with"
    r"|meets? the (requirements?|limits?)|within (the )?toleran\w+"
    r"|(tank|table) (passed|is approved)"
    r"|atende (a|ao|aos|à|às) \w+|em conformidade com|está conforme|dentro da tolerância"
    r"|(tanque|tabela) aprovad[oa]"
    r"|cumple (con )?(el|la|los|las)|conforme (a|con) (el|la|los|las)|dentro de la tolerancia"
    r"|(tanque|tabla) aprobad[oa]|est conforme|satisfait aux?|entspricht den|ist konform"
    r"|è conforme)\b",
    re.IGNORECASE,
)
INTERVALS = re.compile(
    r"\b(valid (until|for|to)|period of validity|expir(es|y)|(next|re-?)[ -]?calibrat\w+"
    r"|next (verification|due)|due date|recommended interval"
    r"|válid[oa] (até|por|hasta)|validade|vencimento|vencimiento|vigencia"
    r"|próxim[oa] (calibração|verificação|arqueação|calibración|verificación)|recalibra\w+"
    r"|valable jusqu\w*|prochain(e)? (étalonnage|vérification)|gültig bis|nächste kalibrierung"
    r"|valid[oa] fino|prossima taratura)\b",
    re.IGNORECASE,
)
# A rule or the customer's request, which permits an interval.
_REASONS = re.compile(
    r"customer|request|regulation|\b(order|law|lei|ley|norma|loi)\b|decree|directive|cliente|pedido"
    r"|solicit|portaria|decreto|resolu[cç]|arrêté|demande|kunde|verordnung|gesetz|richiesta"
    r"|(article|artigo) \d",
    re.IGNORECASE,
)
# What may be valid until a day without being the tank: standards, instruments, an accreditation.
_OTHER_VALIDITY = re.compile(
    r"padr(ão|ões)|patr(ón|ones)|standards?\b|instrument|equip|trena|cinta|tape|scanner|estaç"
    r"|estación|station|accredit|acredit|akkredit|certificad[oa]s? (rbc|n[.º°o])|étalon",
    re.IGNORECASE,
)
_NEAR, _REASON_NEAR = 60, 120  # letters around an interval in which its subject or reason is
# Names of the requirements of a certificate whose words are searched, with their patterns.
LABELS = {
    "title": r"certificate|certificado|certificat|kalibrierschein|certificato|barème|zertifikat",
    "number": r"(certificate|report|certificado|certificat|kalibrierschein|certificato|serial)?"
    r"\s*(no\b|n[.º°o]|number|número|numéro|nummer|numero)\s*[.:º°]?",
    "laboratory": r"laborator|issued by|emitid|émetteur|expedid|aussteller|company|empresa|ltd|gmbh"
    r"|s\.?a\.?\b",
    "customer": r"customer|client|owner|propriet|propietari|kunde|auftraggeber|cliente|titular"
    r"|détenteur|solicitante|contratante|requerente|interessado|applicant|requested by",
    "place": r"place|location|site\b|local|lugar|ubicaci|lieu|\bort\b|standort|luogo|terminal",
    "method": r"method|método|méthode|verfahren|metodo|procedure|procedimento|procedimiento"
    r"|ISO 7507|API MPMS",
    "item": r"tank|tanque|réservoir|récipient|cuve|serbatoio|behälter|depósito",
    "date": r"\bdate|\bdata\b|fecha|datum|\d{1,2}[./-]\d{1,2}[./-]\d{2,4}|\d{4}-\d{2}-\d{2}",
    "conditions": r"condition|condiç|condicion|temperatur|bedingung|condizion|weather|environment",
    "traceability": r"traceab|rastreab|trazab|traçab|raccord|rückgeführt|rückführ|riferibil|tracea"
    r"|standards? used|padr(ão|ões)|patr(ón|ones)|étalons?",
    "uncertainty": r"uncertaint|incerteza|incertidumbre|incertitude|unsicherheit|incertezza"
    r"|\bU\s*=",
    "coverage": r"\bk\s*=|coverage|abrang|cobertura|élargissement|erweiterungsfaktor|copertura",
    "reference": r"reference temperature|temperatura de refer|température de référence"
    r"|bezugstemperatur|temperatura di riferimento|(at|to|a|à|bei|zu) (15|20|60)([.,]0+)?\s*°",
    "only_items": r"(only|solely|exclusively|apenas|somente|únicamente|solamente|sólo|solo"
    r"|exclusiva\w*|uniquement|ausschließlich|esclusivamente)",
    "copy": r"reprodu|copied|copia|cópia|copiad|vervielfältig|riprodu",
    "authorisation": r"authori[sz]|approv|sign|autoriz|aprov|aprob|assinat|firma|signat"
    r"|unterschrift|verantwortlich|responsible|responsável|responsable",
    "pages": r"(page|página|pág\.?|seite|pagina|sheet|folha|hoja)\s*:?\s*\d+\s*(of|de|/|von|di|sur)"
    r"\s*\d+|\b\d+\s*/\s*\d+\b",
}


def find_claim(text):
    """Words of a text that claim conformity; "" if there are none."""
    match = CLAIMS.search(text)
    return match[0] if match else ""


def find_interval(text):
    """Words of a text that state an interval of calibration without its reason; ""."""
    for match in INTERVALS.finditer(text):
        subject, reason = (
            text[max(0, match.start() - near) : match.end() + near]
            for near in (_NEAR, _REASON_NEAR)
        )
        if not (_OTHER_VALIDITY.search(subject) or _REASONS.search(reason)):
            return match[0]
    return ""


def claim_text(words):
    """Return the message about words that claim conformity."""
    return message(
        "assess_claim", "claims conformity ({words}) without a decision rule", words=words
    )


def interval_text(words):
    """Return the message about words that state an interval of calibration."""
    return message(
        "assess_interval",
        "states a validity or a next calibration ({words}), without the rule or the customer's "
        "request behind it",
        words=words,
    )


def statement_text(sentence):
    """Return the message about a sentence that a certificate lacks."""
    return message("assess_statement", "does not state: {sentence}", sentence=sentence)


_SAME = 1e-9  # relative tolerance of limits
_OF_DECISION = {"passed": "conforms", "guard_band": "guard_band"}  # others: "fails"


def check_rule(evidence):
    """Yield a rule that the certificate does not name, or names without its text read."""
    rule, name = evidence.rule["rule"], evidence.certificate.name
    is_named = compact(rule["name"]) in evidence.certificate.body
    if evidence.rule["verified"] and not is_named:
        text = message("assess_rule_unnamed", "does not name the rule {rule}", rule=rule["name"])
        yield Finding(text, file=name)
    if not evidence.rule["verified"] and is_named:
        text = message(
            "assess_rule_unread",
            "states {rule}, whose values were not checked against its text",
            rule=rule["name"],
        )
        yield Finding(text, file=name)


def check_sentences(evidence):
    """Yield sentences that the rule requires and the certificate does not state."""
    for sentence in evidence.rule["rule"].get("statements", ()):
        if compact(sentence) not in evidence.certificate.body:
            yield Finding(
                statement_text(sentence),
                file=evidence.certificate.name,
                clause=_clause(evidence),
            )


def check_scope(evidence):
    """Yield a tank that is larger than the rule allows."""
    rule, top_m3 = evidence.rule["rule"], evidence.record["capacity"]["volume_m3"][-1]
    largest = rule["largest_capacity_m3"]
    if largest is not None and top_m3 > largest:
        text = message(
            "assess_too_large", "the capacity of {capacity:.6g} m3 exceeds {largest:.6g} m3",
            capacity=top_m3, largest=largest,
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="rule", clause=_clause(evidence))


def check_verdicts(evidence):
    """Yield verdicts of the record that its table does not support."""
    capacity = evidence.record["capacity"]
    for result in evidence.rule["uncertainty"]:
        is_judged = result["code"] != "nothing_to_judge" and result["limit"] is not None
        if not is_judged or result["of"] == "deliveries":
            continue
        recorded, (computed, passed) = result["from_m"], _judge_again(capacity, result)
        if result["code"] == "holds_accurate":  # the limit is valid from this level only
            passed = computed is not None
        heights = ["-" if height is None else f"{height:.4f}" for height in (recorded, computed)]
        if heights[0] != heights[1] or result["passed"] is not passed:
            text = message(
                "assess_verdict",
                "{limit}: met from {recorded} m by the record, from {computed} m by its table",
                limit=limit_text(evidence.paper, result),
                recorded=heights[0], computed=heights[1],
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=f"rule.{result['name']}")
    for result in evidence.rule["deviation"]:
        guard = result["U_m3"] if result["guard"] == "U" else 0.0
        lower, upper = (
            sign * math.inf if limit is None else limit
            for sign, limit in zip((-1, 1), result["tolerance_m3"], strict=True)
        )
        code = _OF_DECISION.get(decide(result["volume_m3"], lower, upper, guard), "fails")
        if result["code"] not in (code, "not_for_use"):
            text = message(
                "assess_decision",
                "{limit}: the record has the verdict {recorded}, its numbers give {computed}",
                limit=deviation_limit_text(evidence.paper, result),
                recorded=result["code"], computed=code,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=f"rule.{result['name']}")


def check_results(evidence):
    """Yield limits of the rule that no row meets, or that a value meets without its U."""
    limits = [(limit_text, result) for result in evidence.rule["uncertainty"]]
    limits += [(deviation_limit_text, result) for result in evidence.rule["deviation"]]
    for describe, result in limits:
        limit, section = describe(evidence.paper, result), f"rule.{result['name']}"
        # A limit of U that is met from some level on is a result, not a failure.
        if result["passed"] is False and result.get("from_m") is None:
            text = message("assess_limit_not_met", "not met: {limit}", limit=limit)
            clause = _clause(evidence, result)
            yield Finding(text, OBSERVATION, RECORD, section=section, clause=clause)
        elif result["passed"] and "tolerance_m3" in result and _is_risky(result):
            text = message(
                "assess_simple_acceptance",
                "{limit}: accepted although U reaches beyond the limit; the rule has no guard band",
                limit=limit,
            )
            clause = (ILAC_G8, "4.2.1", READ)
            yield Finding(text, OBSERVATION, RECORD, section=section, clause=clause)


def _clause(evidence, result=None):
    """Return document, clause and basis of a limit; without a limit, of the whole rule."""
    rule = evidence.rule["rule"]
    is_read = (result or rule)["verified"]
    return rule["name"], (result or {}).get("clause", ""), READ if is_read else MEMORY


def _is_risky(result):
    """Whether a value is within its tolerance, but not by U."""
    lower, upper = result["tolerance_m3"]
    low = math.inf if lower is None else result["volume_m3"] - lower
    high = math.inf if upper is None else upper - result["volume_m3"]
    return min(low, high) < result["U_m3"] * (1 - _SAME)


def _judge_again(capacity, result):
    """Judge a limit of U at the rows for use.

    Returns
    -------
    from_m : float or None
        Lowest dip from which on all rows meet the limit; None: no such dip.
    passed : bool
        Whether all rows meet the limit.
    """
    volume, U = np.array(capacity["volume_m3"]), np.array(stated_U_m3(capacity))
    judged = np.flatnonzero(capacity["for_use"])
    relative_to = volume[judged[-1]] if result["relative_to"] == "capacity" else volume
    is_met = result["limit"] * relative_to * (1 + _SAME) >= U
    if result["of"] == "capacity":
        judged = judged[-1:]
    failing = judged[~is_met[judged]]
    later = judged[judged > failing[-1]] if len(failing) else judged
    return (capacity["height_m"][later[0]] if len(later) else None), not len(failing)


_DATES = ("date_of_issue", "survey_end")


def check_presence(evidence):
    """Yield a finding if the results lack the printed certificate."""
    if evidence.certificate is None:
        text = message("assess_no_certificate", "the results contain no printed certificate")
        yield Finding(text, file=CERTIFICATE)


def check_entries(evidence):
    """Yield each required entry that the record lacks."""
    text = message("assess_missing", "blank, but required in a certificate")
    for key in missing_keys(evidence.paper):
        yield entry_finding(key, text)


def check_placeholders(evidence):
    """Yield each entry that contains a placeholder."""
    values = {
        f"certificate.{key}": value for key, value in evidence.entries.items() if key not in _DATES
    }
    values["tank.id"] = evidence.record["job"]["tank"]["id"]
    values |= {
        f"instruments.{name}.certificate": certificate
        for name, certificate in instruments_of(evidence.record).items()
        if certificate
    }
    for section, value in values.items():
        if PLACEHOLDER.fullmatch(str(value).strip()):
            text = message("assess_placeholder", "found {value!r}, a placeholder", value=str(value))
            yield Finding(text, file=RECORD, section=section)


def check_dates(evidence):
    """Yield dates of survey and issue that are missing, or in an impossible order."""
    survey = evidence.record["job"]["survey"] or {}
    start, end = survey.get("date"), evidence.entries.get("survey_end")
    issue = evidence.entries.get("date_of_issue")
    if not start:
        text = message("assess_no_survey_date", "no date of the survey")
        yield Finding(text, file=RECORD, section="survey.date")
        return
    last = str(end or start)
    if last < str(start):
        text = message(
            "assess_survey_order",
            "the survey ends on {last}, before its first day, {start}",
            last=last,
            start=str(start),
        )
        yield entry_finding("survey_end", text)
    if issue and str(issue) < last:
        text = message(
            "assess_issued_early",
            "issued on {issue}, before the end of the survey on {last}",
            issue=str(issue),
            last=last,
        )
        yield entry_finding("date_of_issue", text)
    if issue and date.fromisoformat(str(issue)[:10]) > evidence.day:
        text = message(
            "assess_issued_late",
            "issued on {issue}, after the day of this assessment, {day}",
            issue=str(issue),
            day=evidence.day.isoformat(),
        )
        yield entry_finding("date_of_issue", text)


def check_title(evidence):
    """Yield a title that is not that of a certificate."""
    if compact(evidence.paper.word("titles.certificate")) not in evidence.certificate.body:
        text = message("assess_title", "the first page has no title of a calibration certificate")
        yield Finding(text, file=evidence.certificate.name, page=1)


def check_identity(evidence):
    """Yield pages without the number of the certificate, page numbers, or the end mark."""
    certificate, pages = evidence.certificate, len(evidence.certificate.pages)
    number, footer = evidence.entries.get("number"), evidence.paper.words["page"]["footer"]
    for page, lines in enumerate(certificate.lines, 1):
        text = compact("".join(lines))
        if number and compact(str(number)) not in text:
            lacking = message(
                "assess_no_number", "the page lacks the number of the certificate, {number}",
                number=str(number),
            )  # fmt: skip
            yield Finding(lacking, file=certificate.name, page=page)
        if compact(footer.format(page=page, pages=pages)) not in text:
            lacking = message(
                "assess_page_number", "the page is not numbered as page {page} of {pages}",
                page=page, pages=pages,
            )  # fmt: skip
            yield Finding(lacking, file=certificate.name, page=page)
    if compact(evidence.paper.word("page.end")) not in certificate.body:
        lacking = message("assess_no_end", "no mark at the end of the certificate")
        yield Finding(lacking, file=certificate.name, page=pages)


def check_statements(evidence):
    """Yield standing sentences that the certificate does not state."""
    words = ["certificate.only_items", "texts.copy", "certificate.not_in_u"]
    if evidence.entries.get("customer_data"):
        words.append("certificate.data_of_customer")
    for word in words:
        sentence = evidence.paper.word(word)
        if compact(sentence) not in evidence.certificate.body:
            yield Finding(statement_text(sentence), file=evidence.certificate.name)


def check_interval(evidence):
    """Yield entries that recommend an interval of calibration."""
    for key, value in evidence.entries.items():
        if words := find_interval(str(value)):
            yield entry_finding(key, interval_text(words))


def check_claims(evidence):
    """Yield entries that claim conformity although the record has no decision rule."""
    for key, value in evidence.entries.items():
        if (words := find_claim(str(value))) and not evidence.rule:
            yield entry_finding(key, claim_text(words))


def check_traceability(evidence):
    """Yield instruments and equipment without a calibration certificate."""
    equipment = evidence.record["job"].get("equipment") or ()
    certificates = {name: ("instruments", certificate) for name, certificate
                    in instruments_of(evidence.record).items()}  # fmt: skip
    certificates |= {item["name"]: ("equipment", item["certificate"]) for item in equipment}
    for name, (section, certificate) in certificates.items():
        if not str(certificate or "").strip():
            text = message("assess_no_trace", "{name}: no calibration certificate", name=name)
            yield Finding(text, file=RECORD, section=section)


def check_references(evidence):
    """Yield dips without a reference height, and calibrations known by their number only."""
    job = evidence.record["job"]
    if job["datum"]["reference_height_m"] is None:
        text = message(
            "assess_no_reference_height",
            "no reference height: nobody can check by a dip whether the tank has moved",
        )
        yield Finding(text, OBSERVATION, RECORD, section="datum.reference_height_m")
    if not job.get("equipment"):
        text = message(
            "assess_no_register",
            "the calibrations of the instruments have no laboratory and no date",
        )
        clause = (ISO_17025, "7.8.4", MEMORY)
        yield Finding(text, OBSERVATION, RECORD, section="equipment", clause=clause)


def check_calibration_dates(evidence):
    """Yield equipment whose calibration was due before, or made after, the survey."""
    survey = evidence.record["job"]["survey"] or {}
    first = str(survey.get("date") or "")
    last = str(evidence.entries.get("survey_end") or first)
    for item in evidence.record["job"].get("equipment") or () if first else ():
        if item.get("due") and item["due"] < last:
            text = message(
                "assess_due",
                "{name}: its calibration was due on {due}, before the survey of {day}",
                name=item["name"], due=item["due"], day=last,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="equipment")
        if item.get("date") and item["date"] > first:
            text = message(
                "assess_calibrated_late",
                "{name}: calibrated on {date}, after the survey of {day}",
                name=item["name"], date=item["date"], day=first,
            )  # fmt: skip
            yield Finding(text, MINOR, RECORD, section="equipment")


def check_conditions(evidence):
    """Yield an unknown temperature of the shell, on which the volumes depend."""
    survey = evidence.record["job"]["survey"] or {}
    # A survey by liquid measures the temperature of the liquid instead.
    if survey.get("shell_temperature_c") is None and not evidence.record.get("liquid"):
        text = message("assess_no_temperature", "no temperature of the shell during the survey")
        yield Finding(text, MINOR, RECORD, section="survey.shell_temperature_c")


def check_notice(evidence):
    """Yield a notice, which a certificate for use does not carry."""
    if notice := evidence.entries.get("notice"):
        text = message(
            "assess_notice", "every page has the notice {notice}: not for use", notice=notice
        )
        yield Finding(text, OBSERVATION, RECORD, section="certificate.notice")


def check_overrulings(evidence):
    """Yield decisions on single readings without the person who decided."""
    overrulings = evidence.record.get("overrulings") or {"each": ()}
    unsigned = [row for row in overrulings["each"] if not row["by"]]
    if unsigned:
        text = message(
            "assess_overruled", "{count} decisions on readings do not name a person",
            count=len(unsigned),
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="overrulings")


def entry_finding(key, text):
    """Return the finding of a key of [certificate]."""
    return Finding(text, file=RECORD, section=f"certificate.{key}")
