"""Checks of a certificate: the words of its entries and statements, and the numbers of its record.

Patterns of regular expressions find labels, claims, intervals and placeholders in English,
Portuguese, Spanish, French, German and Italian, in the certificate of any laboratory. A certificate
that uses other words gets a finding that a reader must check.

Verdicts on conformity (ISO/IEC 17025:2017, 7.8.6, ILAC-G8 and the rule itself) are judged again
from the table of the record. U is computed again by other ways than it was stated: u of a row from
the covariance factor, k from the degrees of freedom, and the verdict of Monte Carlo from its saved
results.
"""

import math
import re
from datetime import date

import numpy as np

from tankcal.gum.conformity import decide
from tankcal.gum.coverage import coverage_factor
from tankcal.job.plausibility import CODES
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
from tankcal.products.linter.linting import lint
from tankcal.record.covariance_factor import factor_of
from tankcal.report.certificate import instruments_of, missing_keys
from tankcal.report.laboratory import find_capability, is_outside_scope
from tankcal.report.outputs import RECORD
from tankcal.report.uncertainty.rule import deviation_limit_text, limit_text
from tankcal.report.uncertainty.stated import MONTE_CARLO, stated_U_m3

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


_RESULT_SAME = 1e-6  # largest relative difference of equal numbers of a record
_SAME_M = 1e-9  # largest difference of equal dips
LEAST_PROBABILITY, MOST_PROBABILITY = 0.94, 0.96  # "approximately 95 %" of ILAC-P14
LARGE_SHARE = 0.5  # share of the variance above which a default u is reported
MOST_REJECTED = 0.05  # share of rejected readings above which an assessor asks
# Typical U of a table by the annexes of ISO 7507, from memory; half of it makes an assessor ask.
USUAL_PERCENT, SMALL_PERCENT = 0.1, 0.05
MOST_ROWS_NAMED = 5  # rows named for a fault, at most


def check_table(evidence):
    """Yield faults of the table of the record: falling volumes, odd rows, wrong digits."""
    path = evidence.paper._path
    yield from check_lint(lint(path).findings, RECORD)


def check_lint(findings, file):
    """Yield each error that the linter found in a capacity table; its warnings are not errors."""
    for finding in findings:
        if finding.severity == "error":
            problem = finding.problem
            place = ", ".join(str(part) for part in (problem.column, problem.row) if part)
            text = message("assess_table", "capacity table: {finding}", finding=problem.expected)
            yield Finding(text, file=file, section=place)


def check_rows(evidence):
    """Yield rows without U, or whose U is not k u or the end of the Monte Carlo interval."""
    capacity = evidence.record["capacity"]
    volume, u, U, k = (np.array(capacity[key]) for key in ("volume_m3", "u_m3", "U_m3", "k"))
    stated = np.array(stated_U_m3(capacity))
    lacking = (volume > 0) & ~(stated > 0)
    if lacking.any():
        text = message(
            "assess_no_u", "{count} rows have no U, the first at {dip}",
            count=int(lacking.sum()), dip=_dip(capacity, np.argmax(lacking)),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")
    wrong = ~_agree(U, k * u)
    if "interval" in capacity:
        by_law = np.array([source != MONTE_CARLO for source in capacity["interval"]])
        ends = np.maximum(
            volume - np.array(capacity["low_m3"], float),
            np.array(capacity["high_m3"], float) - volume,
        )
        wrong |= ~np.where(by_law, _agree(stated, U), _agree(stated, ends))
    for row in np.flatnonzero(wrong)[:MOST_ROWS_NAMED]:
        text = message(
            "assess_k_u", "U at {dip} is {U:.6g} m3, but k u is {product:.6g} m3",
            dip=_dip(capacity, row), U=float(stated[row]), product=float(k[row] * u[row]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")


def check_coverage(evidence):
    """Yield a coverage probability far from 95 %, and k that do not belong to it."""
    capacity = evidence.record["capacity"]
    probability = evidence.record["job"]["table"]["coverage_probability"]
    if not LEAST_PROBABILITY <= probability <= MOST_PROBABILITY:
        text = message(
            "assess_probability", "the coverage probability is {probability:.4g} %",
            probability=100 * probability,
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="table.coverage_probability")
    factors = {}
    for row, (k, dof) in enumerate(zip(capacity["k"], capacity["dof"], strict=True)):
        if dof not in factors:
            factors[dof] = float(coverage_factor(probability, math.inf if dof is None else dof))
        if not math.isclose(k, factors[dof], rel_tol=_RESULT_SAME):
            text = message(
                "assess_k_dof",
                "k at {dip} is {k:.4g}; {probability:.4g} % and {dof} degrees of freedom give "
                "{expected:.4g}",
                dip=_dip(capacity, row), k=k, probability=100 * probability,
                dof="∞" if dof is None else f"{dof:.3g}", expected=factors[dof],
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="capacity.k")
            return


def check_propagation(evidence):
    """Yield the row whose u disagrees most with the covariance factor of the table."""
    capacity = evidence.record["capacity"]
    u, again = np.array(capacity["u_m3"]), np.linalg.norm(factor_of(capacity), axis=1)
    apart = np.abs(u - again)
    row = int(np.argmax(apart))
    if apart[row] > _RESULT_SAME * max(u.max(), again.max()):
        text = message(
            "assess_factor",
            "u at {dip} is {u:.6g} m3, but the covariance of the table gives {again:.6g} m3",
            dip=_dip(capacity, row), u=float(u[row]), again=float(again[row]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.u_m3")


def check_budgets(evidence):
    """Yield budgets whose shares do not add up to the variance."""
    for section, lines, _ in _budgets(evidence.record):
        total = sum(line["share"] for line in lines)
        if lines and not math.isclose(total, 1, rel_tol=_RESULT_SAME):
            text = message(
                "assess_shares", "the shares of the variance add up to {total:.4g} %, not 100 %",
                total=100 * total,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=section)


def check_types(evidence):
    """Yield inputs evaluated as type A without degrees of freedom, or as both types."""
    types = {}
    for section, lines, _ in _budgets(evidence.record):
        for line in lines:
            types.setdefault(line["input"], {}).setdefault(line["type"], (section, line))
    for name, of_input in types.items():
        if len(of_input) > 1:
            text = message(
                "assess_types", "{name} is of type {types} in different budgets",
                name=name, types=" / ".join(sorted(of_input)),
            )  # fmt: skip
            yield Finding(text, MINOR, RECORD, section=of_input["A"][0])
        elif "A" in of_input and of_input["A"][1]["dof"] is None:
            text = message(
                "assess_type_a", "{name} is of type A, but has no degrees of freedom", name=name
            )
            yield Finding(text, MINOR, RECORD, section=of_input["A"][0])


def check_defaults(evidence):
    """Yield default uncertainties with more than half of the variance of the capacity."""
    for line in evidence.record["budget"]:
        if line["is_default"] and line["share"] > LARGE_SHARE:
            text = message(
                "assess_default",
                "u of {name} was not declared; its default has {share:.0f} % of the variance",
                name=evidence.paper.input_name(line), share=100 * line["share"],
            )  # fmt: skip
            yield Finding(text, OBSERVATION, RECORD, section="budget")


def check_undeclared(evidence):
    """Yield the inputs that affect the table and are not in U."""
    names = [
        name
        for choice in evidence.record["choices"]
        if choice["code"] == "not_in_budget"
        for name in choice["value"]
    ]
    if names:
        words = evidence.paper.words["inputs"]
        text = message(
            "assess_undeclared", "not in U, because not declared: {names}",
            names=[words.get(name, name) for name in names],
        )  # fmt: skip
        yield Finding(text, OBSERVATION, "uncertainty.csv")


def check_bias(evidence):
    """Yield known effects whose correction is switched off."""
    for row in evidence.record["corrections"]:
        if not row["applied"] and row["size_m3"]:
            text = message(
                "assess_bias",
                "{name}: not corrected, although its effect is known ({size:+.3g} m3)",
                name=evidence.paper.word(f"corrections.{row['code']}"), size=row["size_m3"],
            )  # fmt: skip
            yield Finding(text, OBSERVATION, RECORD, section="corrections")


def check_monte_carlo(evidence):
    """Yield rows whose stated interval contradicts the verdict of Monte Carlo."""
    simulated, capacity = evidence.record["monte_carlo"], evidence.record["capacity"]
    if not simulated or "interval" not in capacity:
        return
    rows = zip(simulated["rows"]["validated"], capacity["interval"], strict=True)
    wrong = [row for row, (ok, source) in enumerate(rows) if not ok and source != MONTE_CARLO]
    if wrong:
        text = message(
            "assess_not_validated",
            "{count} rows state U = k u, although Monte Carlo does not validate it, such as {dip}",
            count=len(wrong), dip=_dip(capacity, wrong[0]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="monte_carlo")


def check_stated(evidence):
    """Yield stated volumes that differ from the row of the table at their dip."""
    capacity = evidence.record["capacity"]
    height, stated = np.array(capacity["height_m"]), stated_U_m3(capacity)
    for budget in evidence.record.get("budgets", ()):
        row = int(np.argmin(np.abs(height - budget["high_m"])))
        if budget["low_m"] is not None or abs(height[row] - budget["high_m"]) > _SAME_M:
            continue
        volume, U = capacity["volume_m3"][row], stated[row]
        of_budget = budget.get("stated_U_m3", budget["U_m3"])
        # U of a volume may include the reading of the table, so that it is not smaller.
        is_smaller = of_budget < U * (1 - _RESULT_SAME)
        if not math.isclose(volume, budget["volume_m3"], rel_tol=_RESULT_SAME) or is_smaller:
            text = message(
                "assess_two_values",
                "stated at {dip}: {volume:.7g} m3, U = {U:.2g} m3; in the table: {row_volume:.7g} "
                "m3, U = {row_U:.2g} m3",
                dip=_dip(capacity, row), volume=budget["volume_m3"], U=of_budget,
                row_volume=volume, row_U=U,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="budgets")


def check_capability(evidence):
    """Yield U below the CMC, and an accreditation that does not cover the tank."""
    letterhead, record = evidence.letterhead, evidence.record
    accreditation = evidence.entries.get("accreditation_number")
    if is_outside_scope(letterhead, record) and (accreditation or letterhead.get("mark")):
        text = message("assess_outside_scope", "refers to an accreditation that lacks this tank")
        yield Finding(text, file=RECORD, section="certificate.accreditation_number")
    capability = find_capability(letterhead, record)
    if capability is None:
        return
    capacity = record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if percent < capability["percent"] * (1 - _RESULT_SAME):
        text = message(
            "assess_below_cmc", "U of the capacity is {percent:.2g} %, below the CMC of {cmc:g} %",
            percent=percent, cmc=capability["percent"],
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")


def check_size(evidence):
    """Yield a relative U of the capacity that is smaller than surveys usually attain."""
    capacity = evidence.record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if 0 < percent < SMALL_PERCENT:
        text = message(
            "assess_small_u",
            "U of the capacity is {percent:.2g} %, less than the usual {usual:g} % or more",
            percent=percent, usual=USUAL_PERCENT,
        )  # fmt: skip
        yield Finding(text, OBSERVATION, RECORD, section="capacity.U_m3")


def check_input(evidence):
    """Yield implausible input, a failed global test, and a large number of rejected readings."""
    for warning in evidence.record["warnings"]:
        if warning.get("code") in CODES:
            text = message("assess_doubt", "implausible input: {warning}", warning=warning["text"])
            place = (warning["file"] or RECORD, None, warning["column"] or "")
            yield Finding(text, OBSERVATION, *place)
    adjustment = evidence.record["adjustment"]
    if not adjustment:
        return
    if adjustment["passed"] is False:
        text = message(
            "assess_global_test",
            "the global test of the adjustment failed (sigma0 = {sigma0:.3g})",
            sigma0=adjustment["sigma0"],
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="adjustment")
    count, rejected = adjustment["observations"], len(adjustment["removed"])
    if rejected > MOST_REJECTED * count:
        text = message(
            "assess_rejected", "{rejected} of {count} observations were rejected",
            rejected=rejected, count=count,
        )  # fmt: skip
        yield Finding(text, OBSERVATION, RECORD, section="adjustment.removed")


def _budgets(record):
    """Yield (section of the record, lines, budget or None) of all budgets."""
    yield "budget", record["budget"], None
    for number, budget in enumerate(record.get("budgets", ())):
        yield f"budgets[{number}]", budget["lines"], budget


def _agree(first, second):
    """Flag equal numbers; a number that is missing on both sides is equal."""
    scale = np.maximum(np.abs(first), np.abs(second))
    return (np.abs(first - second) <= _RESULT_SAME * scale) | (np.isnan(first) & np.isnan(second))


def _dip(capacity, row):
    """Dip of a row as printed, with the unit m if it is a length in metres."""
    dip = capacity["dip"][row]
    return dip if "'" in dip or " " in dip else f"{dip} m"
