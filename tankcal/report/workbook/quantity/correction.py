"""Formulas of each gauging: volumes of the table and volume corrections.

Formulas of the volume corrections: checks of the product, density at the base, VCF.

D1250 of 1980 and 2004 share their equations, with d = 0 in 1980:

    a(r) = K0 / r^2 + K1 / r + K2,   A = d a(r) / 2,   B = -(da/dln r) / a
    r* = r (1 + (exp(A (1 + 0.8 A)) - 1) / (1 + A (1 + 1.6 A) B)),   a* = a(r*)
    L(t) = ln CTL = -a* D (1 + 0.8 a* (D + d)),   D = temperature less that of the form

r is the density at the temperature of the form: 15 degC or 60 degF. Every other density follows
from it: rho(t) = r exp(L(t)), so r is the root of ln r + L(t) = ln rho for the density of a sample
at t, or for the density at the base. VCF = exp(L(t) - L(base)), and

    dln rho_base / dln rho = (1 + L'(base)) / (1 + L'(sample)),   L' = dL / dln r
    dVCF / dln rho = VCF (L'(t) - L'(base)) / (1 + L'(sample))

Rows of the hidden sheet of workings, and the notation of their formulas.

In the texts of formulas, `[tov_c]` denotes the cell of a key, `[tov@]` the cell of the opening
(`[tov_o]`) or of the closing (`[tov_c]`), and `#fine` the number of a sentence.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.report.uncertainty.stated import is_roof_in_table, roof_of
from tankcal.report.workbook.calculator.table import is_no_number
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3
from tankcal.tank.gauging import LIMITS
from tankcal.tank.volume_correction import petroleum
from tankcal.tank.volume_correction.corrections import LEAST_C, MOST_C
from tankcal.text.digits import NOTHING

# Codes of the volume corrections, in the order of their list; groups and bases likewise from 1.
D1250_04, D1250_80, CNP, CNP_UNROUNDED, COEFFICIENT, TYPED = range(1, 7)
GROUPS = (*petroleum.GROUPS, "coefficient")
BASES = tuple(petroleum.BASES_C)
_ROUNDS = 7  # of Newton's iteration; five give 1e-14 within the ranges
_CLASS_ROUNDS = 6  # of the iteration for the class of CNP 6/70
_CONVERGED = "1E-12"
_60F_C = repr(petroleum.BASES_C["60F"])
FACTORS = (0.5, 1.5)  # limits of a typed factor


def constants():
    """Rows (least, highest density, K0, K1, K2) of the forms 15 degC, 60 degF and 2004.

    Each form has six rows: crude oil, four groups of products, lubricating oils.
    """
    return [
        (least, *part)
        for groups in (petroleum.GROUPS_15C, petroleum.GROUPS_60F, petroleum.GROUPS_2004)
        for least, *parts in (groups[name] for name in petroleum.GROUPS)
        for part in parts
    ]


def classes():
    """Rows (highest density g/cm3, p1, p2, p3, p4) of the classes of CNP 6/70."""
    bounds = [float(bound) for bound in petroleum.CLASSES[:, 0]]
    bounds[-1] = petroleum.MOST
    # The highest density of a class belongs to it.
    return [(bound, *map(float, petroleum.coefficients_of_class(bound))) for bound in bounds]


def codes():
    """Rows with the number of each choice."""
    lists = {
        "correction": "corrections", "group": "groups", "base": "bases",
        "density_is": "density_kinds", "hydrometer": "bases", "insulated": "yes_no",
    }  # fmt: skip
    return [
        cell_row(f"{key}_code", "", choice_code(f"[{key}]", f"quantity_{names}"), 0)
        for key, names in lists.items()
    ]


def checks(number):
    """Rows of the state of the product before the calculation, and of its insulation."""
    kind, group, base = "[correction_code]", "[group_code]", "[base_code]"
    uses_alpha = f"OR(AND({kind}<=2,{group}=4),{kind}={COEFFICIENT})"
    low = [1.8 * petroleum.ALPHA_2004_PER_F[0], 1.8 * petroleum.ALPHA_1980_PER_F[0]]
    high = 1.8 * petroleum.ALPHA_2004_PER_F[1]
    alpha_low = f"IF({kind}=5,1E-9,CHOOSE({kind},{low[0]!r},{low[1]!r}))"
    alpha_high = f"IF({kind}=5,0.01,{high!r})"
    is_observed = "[density_is_code]=2"
    cases = [
        (f"{kind}=0", "correction_blank"),
        (f"OR({kind}<0,{group}<0,{base}<0,[density_is_code]<0,[hydrometer_code]<0,"
         "[insulated_code]<0)", "no_choice"),
        (f"AND({kind}<=2,{group}=0)", "group_blank"),
        (f"AND({kind}>2,{group}>0)", "group_unused"),
        (f"AND(OR({kind}<=2,{kind}={COEFFICIENT}),{base}=0)", "base_blank"),
        (f"AND(OR({kind}={CNP},{kind}={CNP_UNROUNDED}),{base}>0,{base}<>2)", "base_other"),
        (f"AND({kind}={TYPED},{base}>0)", "base_other"),
        (f"AND(NOT({uses_alpha}),NOT(ISBLANK([alpha])))", "alpha_unused"),
        (f"IF({uses_alpha},{fault('[alpha]', alpha_low, alpha_high)},FALSE)", "alpha_range"),
        (fault("[density]", *LIMITS["density_kg_m3"]), "density_range"),
        ("[density_is_code]=0", "density_is_blank"),
        (f"AND({kind}={TYPED},{is_observed})", "typed_base"),
        (f"AND({is_observed},{fault('[sample]', *LIMITS['density_temperature_c'])})",
         "sample_blank"),
        ("AND([density_is_code]=1,OR(NOT(ISBLANK([sample])),[hydrometer_code]>0))",
         "sample_unused"),
        (f"AND(NOT(ISBLANK([sw])),{fault('[sw]', *LIMITS['sw_percent'])})", "sw_range"),
        (f"AND({kind}={TYPED},ISBLANK([name]))", "name_blank"),
        (f"AND({kind}<>{TYPED},NOT(ISBLANK([name])))", "name_unused"),
        ("OR(COUNT([u_dip]:[u_expansion])<9,MIN([u_dip]:[u_vcf])<0,"
         f"AND(NOT(ISBLANK([u_vcf])),{is_no_number('[u_vcf]')}))", "u_wrong"),
    ]  # fmt: skip
    return [cell_row("valid", "", first_true(cases, "#fine"), number("correction_blank"))]


def density_rows(number):
    """Rows from the density of the ticket to the density at the base and its state."""
    return [
        *_form_rows(),
        *_newton(),
        *_derivatives(),
        *_brazil_density(),
        *_base_density(number),
    ]


def _guard(expression, condition="[valid]=#fine"):
    return f"IF({condition},{expression},{NONE})"


_IS_D1250 = "[is_d1250]=1"
_IS_CNP = "[is_cnp]=1"


def _form_rows():
    """Rows of the form of D1250, its temperatures and the density of the sample."""
    kind, base = "[correction_code]", "[base_code]"
    bases = ",".join(repr(value) for value in petroleum.BASES_C.values())
    scales = ",".join(_glass("[t_s]", scale) for scale in petroleum.BASES_C)
    glass = f"IF([hydrometer_code]=0,1,CHOOSE([hydrometer_code],{scales}))"
    form = f"IF({kind}={D1250_04},3,IF({base}=3,2,1))"
    first = "([form]-1)*6+CHOOSE([group_code],1,2,6,1)"
    is_cnp = f"OR({kind}={CNP},{kind}={CNP_UNROUNDED})"
    has_base = f"OR({kind}<={D1250_80},{kind}={COEFFICIENT})"
    base_c = f"IF({has_base},CHOOSE({base},{bases}),{petroleum.BRAZIL_BASE_C!r})"
    glass_cnp = f"IF([hydrometer_code]=0,1,[glass]/{_glass('[t_s]', '20C')})"
    return [
        cell_row("is_d1250", "", f"IF(AND([valid]=#fine,{kind}<=2),1,0)", 0),
        cell_row("is_cnp", "", f"IF(AND([valid]=#fine,{is_cnp}),1,0)", 0),
        cell_row("t_b", "t0", _guard(base_c)),
        cell_row("t_s", "t", _guard("IF([density_is_code]=2,[sample],[t_b])")),
        cell_row("glass", "HYC", _guard(glass)),
        # The tables of CNP 6/70 contain the glass of a hydrometer of 20 degC.
        cell_row("glass_used", "HYC", _guard(
            f"IF([is_cnp]=1,IF([density_is_code]=2,IF([hydrometer_code]=0,"
            f"1/{_glass('[t_s]', '20C')},{glass_cnp}),1),[glass])")),
        cell_row("seen", "ρ", _guard("[density]*[glass_used]")),
        cell_row("form", "", _guard(form, _IS_D1250)),
        cell_row("first", "", _guard(first, _IS_D1250)),
        cell_row("degree", "", _guard("IF([form]=1,1,1.8)", _IS_D1250)),
        cell_row("shift", "δ", _guard(f"IF([form]=3,{petroleum.DELTA_60!r},0)", _IS_D1250)),
        cell_row("a_fixed", "α", _guard("IF([group_code]=4,[alpha]/[degree],0)", _IS_D1250)),
        cell_row("d_s", "D", _guard(_degrees("[t_s]"), _IS_D1250)),
        cell_row("d_b", "D0", _guard(_degrees("[t_b]"), _IS_D1250)),
    ]  # fmt: skip


def _glass(celsius, scale):
    """Formula of the correction of a hydrometer of a scale, as `petroleum.glass_correction`."""
    linear, quadratic = (
        np.format_float_positional(value, trim="-") for value in petroleum.GLASS_EXPANSION[scale]
    )
    step = f"({celsius}-{petroleum.BASES_C[scale]!r})"
    step = f"(1.8*{step})" if scale == "60F" else step
    return f"(1-{linear}*{step}-{quadratic}*{step}^2)"


def _degrees(celsius):
    """Formula of D, the temperature less that of the form, in degrees of the form."""
    shift = "0"
    for coefficient in reversed(petroleum.SCALES):
        shift = f"{celsius}/630*({coefficient!r}+{shift})"
    iptm = f"1.8*({celsius}-({shift}))+32-{petroleum.ZERO_68_F!r}"
    return f"IF([form]=3,{iptm},IF([form]=2,1.8*({celsius}-{_60F_C}),{celsius}-15))"


def _slope_of_scale(celsius):
    """Formula of dD/dt."""
    slope = "0"
    for power, coefficient in reversed(list(enumerate(petroleum.SCALES, start=1))):
        slope = f"({power * coefficient!r}+{celsius}/630*{slope})"
    return f"IF([form]=3,1.8*(1-{slope}/630),[degree])"


def _group_rows(end, density):
    """Rows of the row of constants, a, -da/dln r, r*/r and a* at a density; keys end in `end`."""
    place = (
        f"[first]+IF([group_code]=2,({density}>INDEX(quantity_high,[first]))"
        f"+({density}>INDEX(quantity_high,[first]+1))+({density}>INDEX(quantity_high,[first]+2)),0)"
    )
    k0, k1, k2 = (f"INDEX(quantity_{name},[n{end}])" for name in ("k0", "k1", "k2"))
    expansion = f"({k0}/{density}+{k1})/{density}+{k2}"
    a, q = f"[a{end}]", f"[q{end}]"
    half = f"([shift]/2*{a})"
    stretch = f"1+(EXP({half}*(1+0.8*{half}))-1)/(1+{half}*(1+1.6*{half})*{q}/{a})"
    star = f"({density}*[w{end}])"
    return [
        cell_row(f"n{end}", "", _guard(place, _IS_D1250)),
        cell_row(f"a{end}", "α", _guard(f"IF([group_code]=4,[a_fixed],{expansion})", _IS_D1250)),
        cell_row(f"q{end}", "-∂α/∂lnρ", _guard(
            f"IF([group_code]=4,0,(2*{k0}/{density}+{k1})/{density})", _IS_D1250)),
        cell_row(f"w{end}", "ρ*/ρ", _guard(stretch, _IS_D1250)),
        cell_row(f"s{end}", "α*", _guard(
            f"IF([group_code]=4,[a_fixed],({k0}/{star}+{k1})/{star}+{k2})", _IS_D1250)),
    ]  # fmt: skip


def _log_factor(a, step):
    """Formula of L = ln CTL."""
    return f"-{a}*{step}*(1+0.8*{a}*({step}+[shift]))"


def _newton():
    """Rows of Newton's iteration for r, with a derivative that is exact to about 1e-4."""
    rows, density = [], "[seen]"
    for place in range(1, _ROUNDS + 1):
        rows += _group_rows(place, density)
        log = _log_factor(f"[s{place}]", "[d_s]")
        slope = f"[d_s]*(1+1.6*[s{place}]*([d_s]+[shift]))*[q{place}]"
        step = f"(LN({density}/[seen])+({log}))/(1+{slope})"
        rows.append(cell_row(f"r{place}", "ρ", _guard(f"{density}*EXP(-({step}))", _IS_D1250)))
        density = f"[r{place}]"
    return rows


def _derivatives():
    """Rows of L and L' at the sample and at the base, at the root r."""
    root = f"[r{_ROUNDS}]"
    half, b = "([shift]/2*[a])", "([q]/[a])"
    k0, k1 = "INDEX(quantity_k0,[n])", "INDEX(quantity_k1,[n])"
    growth = f"EXP({half}*(1+0.8*{half}))"
    below = f"(1+{half}*(1+1.6*{half})*{b})"
    half_slope = "(-[shift]/2*[q])"
    growth_slope = f"({growth}*(1+1.6*{half})*{half_slope})"
    b_slope = f"((-((4*{k0}/{root}+{k1})/{root})*[a]+[q]^2)/[a]^2)"
    below_slope = f"((1+3.2*{half})*{half_slope}*{b}+{half}*(1+1.6*{half})*{b_slope})"
    stretch_slope = f"(({growth_slope}*{below}-({growth}-1)*{below_slope})/{below}^2)"
    star = f"({root}*[w])"
    by_star = f"(2*{k0}/{star}+{k1})/{star}"
    slope = f"IF([group_code]=4,0,-{by_star}*(1+{stretch_slope}/[w]))"
    return [
        *_group_rows("", root),
        cell_row("slope", "∂α*/∂lnρ", _guard(slope, _IS_D1250)),
        *(
            cell_row(f"l_{at}", f"ln CTL{name}", _guard(_log_factor("[s]", f"[d_{at}]"), _IS_D1250))
            for at, name in (("s", ""), ("b", "0"))
        ),
        *(
            cell_row(f"lr_{at}", f"L{name}'", _guard(_slope(f"[d_{at}]"), _IS_D1250))
            for at, name in (("s", ""), ("b", "0"))
        ),
    ]


def _slope(step):
    """Formula of L' = dL / dln r."""
    return f"-{step}*(1+1.6*[s]*({step}+[shift]))*[slope]"


def _brazil_density():
    """Rows of the iteration for the class of CNP 6/70, and the density at 20 degC, g/cm3."""
    rows, density = [], "[seen]/1000"
    x = "([t_s]-20)"
    glass = _glass("[t_s]", "20C")
    for place in range(1, _CLASS_ROUNDS + 1):
        p1, p2, p3, p4 = (f"INDEX(quantity_p{i},[m{place}])" for i in range(1, 5))
        value = f"{glass}*([seen]/1000-{p1}*{x}-{p3}*{x}^2)/(1+{p2}*{x}+{p4}*{x}^2)"
        rows += [
            cell_row(f"m{place}", "", _guard(class_formula(density), _IS_CNP)),
            cell_row(f"e{place}", "D20", _guard(value, _IS_CNP)),
        ]
        density = f"[e{place}]"
    return rows


def class_formula(density):
    """Formula of the class of a density: the number of lower bounds, and 1."""
    return f"MIN({len(petroleum.CLASSES)},1+SUMPRODUCT((quantity_classes<{density})*1))"


def _base_density(number):
    """Rows of the density at the base, its ranges and derivative, and the state of the product."""
    kind, root, last = "[correction_code]", f"[r{_ROUNDS}]", f"[e{_CLASS_ROUNDS}]"
    by_alpha = "[seen]*(1+[alpha]*([t_s]-[t_b]))"
    calculated = (
        f"IF({kind}<=2,{root}*EXP([l_b]),IF({kind}<={CNP_UNROUNDED},1000*{last},"
        f"IF({kind}={COEFFICIENT},{by_alpha},[density])))"
    )
    is_converged = (
        f"IF({kind}<=2,ABS({root}/[r{_ROUNDS - 1}]-1)<{_CONVERGED},IF({kind}<={CNP_UNROUNDED},"
        f"ABS({last}/[e{_CLASS_ROUNDS - 1}]-1)<{_CONVERGED},TRUE))"
    )
    x, p2, p4 = (
        "([t_s]-20)",
        f"INDEX(quantity_p2,[m{_CLASS_ROUNDS}])",
        (f"INDEX(quantity_p4,[m{_CLASS_ROUNDS}])"),
    )
    brazil_ratio = f"{_glass('[t_s]', '20C')}*[seen]/1000/(1+{p2}*{x}+{p4}*{x}^2)/{last}"
    ratio = (
        f"IF([density_is_code]=1,1,IF({kind}<=2,(1+[lr_b])/(1+[lr_s]),"
        f"IF({kind}<={CNP_UNROUNDED},{brazil_ratio},1)))"
    )
    light, middle = petroleum.LIGHT_KG_M3, petroleum.MIDDLE_KG_M3
    low_c, high_c = petroleum.LIMITS_2004_C
    high_f = "+".join(
        [f"{petroleum.HIGHEST_F[2]!r}",
         f"IF([rho_b]<{middle!r},{petroleum.HIGHEST_F[1] - petroleum.HIGHEST_F[2]!r},0)",
         f"IF([rho_b]<{light!r},{petroleum.HIGHEST_F[0] - petroleum.HIGHEST_F[1]!r},0)"]
    )  # fmt: skip
    lowest = (low_c, (petroleum.LOWEST_F - 32) / 1.8, *2 * (petroleum.LOWEST_C,), *2 * (LEAST_C,))
    cold = ",".join(map(repr, lowest))
    highest = (petroleum.HIGHEST_C, petroleum.HIGHEST_C, MOST_C, MOST_C)
    hot = f"{high_c!r},({high_f}-32)/1.8,{','.join(map(repr, highest))}"
    cnp_low, cnp_high = 1000 * petroleum.LEAST, 1000 * petroleum.MOST
    is_group = f"AND({kind}<=2,[group_code]<4)"
    least = f"IF({is_group},INDEX(quantity_low,[first]),IF([is_cnp]=1,{cnp_low!r},0))"
    heaviest = "[first]+IF([group_code]=2,3,0)"
    most = f"IF({is_group},INDEX(quantity_high,{heaviest}),IF([is_cnp]=1,{cnp_high!r},1E+9))"
    light_cnp, heavy_cnp = petroleum.THREE_DECIMALS_TO, petroleum.FOUR_DECIMALS_FROM
    good = "[valid]=#fine"
    cases = [
        ("ISERROR([rho_b])", "no_base_density"),
        ("OR([rho_b]<[rho_low],[rho_b]>[rho_high])", "base_density_range"),
        (f"NOT({is_converged})", "no_base_density"),
        ("OR([t_s]<[t_low],[t_s]>[t_high])", "sample_range"),
        (f"IF({kind}={CNP},AND([rho_b]/1000>{light_cnp!r},[rho_b]/1000<{heavy_cnp!r}),FALSE)",
         "cnp_decimals"),
    ]  # fmt: skip
    return [
        cell_row("rho_b", "ρ0", _guard(f"IF([density_is_code]=1,[density],{calculated})", good)),
        cell_row("rho_ratio", "∂lnρ0/∂lnρ", _guard(ratio, good)),
        cell_row("rho_low", "ρ ≥", _guard(least, good)),
        cell_row("rho_high", "ρ ≤", _guard(most, good)),
        cell_row("t_low", "t ≥", _guard(f"CHOOSE({kind},{cold})", good)),
        cell_row("t_high", "t ≤", _guard(f"CHOOSE({kind},{hot})", good)),
        cell_row("product", "", f"IF({good},{first_true(cases, '#fine')},[valid])",
               number("correction_blank")),
    ]  # fmt: skip


def factor_rows():
    """Rows of VCF and its derivatives by the temperature and by ln rho, for each state."""
    kind, t = "[correction_code]", "[liquid@]"
    good, d1250 = "[inputs@]=#fine", "AND([inputs@]=#fine,[is_d1250]=1)"
    cnp = "AND([inputs@]=#fine,[is_cnp]=1)"
    x, relative = f"({t}-20)", "([rho_b]/1000)"
    half = f"ROUND({relative}/0.002,9)"
    even = (
        f"0.002*IF(ABS({half}-INT({half})-0.5)<1E-9,INT({half})+MOD(INT({half}),2),ROUND({half},0))"
    )
    exact, rounded = (
        [f"INDEX(quantity_p{i},[{name}@])" for i in range(1, 5)] for name in ("class", "even_class")
    )
    p1, p2, p3, p4 = exact
    r1, r2, r3, r4 = rounded
    fit = f"1+{p2}*{x}+{p4}*{x}^2+({p1}*{x}+{p3}*{x}^2)/{relative}"
    even_fit = f"1+{r2}*{x}+{r4}*{x}^2+({r1}*{x}+{r3}*{x}^2)/[even@]"
    decimals = f"IF({relative}<={petroleum.THREE_DECIMALS_TO!r},3,4)"
    by_density = "[vcf@]*([lr@]-[lr_b])/(1+[lr_s])"
    by_density_cnp = f"-({p1}*{x}+{p3}*{x}^2)/{relative}*[rho_ratio]"
    by_temperature = f"{p2}+2*{p4}*{x}+({p1}+2*{p3}*{x})/{relative}"
    constant = f"1/(1+[alpha]*({t}-[t_b]))"
    return [
        state_row("d", "D", _guard(_degrees(t), d1250)),
        state_row("l", "ln CTL", _guard(_log_factor("[s]", "[d@]"), d1250)),
        state_row("lr", "L'", _guard(_slope("[d@]"), d1250)),
        state_row("lt", "∂L/∂t", _guard(
            f"-[s]*(1+0.8*[s]*(2*[d@]+[shift]))*{_slope_of_scale(t)}", d1250)),
        state_row("class", "", _guard(class_formula(relative), cnp)),
        state_row("even", "D20", _guard(even, cnp)),
        state_row("even_class", "", _guard(class_formula("[even@]"), cnp)),
        state_row("vcf", "VCF", _guard(
            f"IF({kind}<=2,EXP([l@]-[l_b]),IF({kind}={CNP},ROUND({even_fit},{decimals}),"
            f"IF({kind}={CNP_UNROUNDED},{fit},IF({kind}={COEFFICIENT},{constant},[factor@]))))",
            good)),
        state_row("vcf_t", "∂VCF/∂t", _guard(
            f"IF({kind}<=2,[vcf@]*[lt@],IF({kind}<={CNP_UNROUNDED},{by_temperature},"
            f"IF({kind}={COEFFICIENT},-[alpha]*[vcf@]^2,0)))", good)),
        state_row("vcf_r", "∂VCF/∂lnρ", _guard(
            f"IF({kind}<=2,{by_density},IF({kind}<={CNP_UNROUNDED},{by_density_cnp},0))", good)),
    ]  # fmt: skip


# ---- rows of workings and their notation

STATES = ("o", "c")  # opening and closing
NONE = f'"{NOTHING}"'


@dataclass(frozen=True)
class Cell:
    """Cell with a formula and its result for a blank form."""

    key: str
    formula: str
    result: float | str = NOTHING


@dataclass(frozen=True)
class Row:
    """Row of the workings: symbol, cells from column B, and the key of a label after the symbol."""

    symbol: str
    cells: tuple[Cell, ...]
    label: str = ""


def cell_row(key, symbol, formula, result=NOTHING):
    """Row with a common cell of both states."""
    return Row(symbol, (Cell(key, formula, result),))


def state_row(key, symbol, formula, result=NOTHING):
    """Row with a cell for each state; the results may differ, as a pair."""
    results = result if isinstance(result, tuple) else (result, result)
    return Row(
        symbol,
        tuple(
            Cell(f"{key}_{state}", formula.replace("@", f"_{state}"), value)
            for state, value in zip(STATES, results, strict=True)
        ),
    )


def first_true(cases, otherwise):
    """Formula of the sentence of the first condition that is true; `cases` are pairs."""
    formula = otherwise
    for condition, sentence in reversed(cases):
        formula = f"IF({condition},#{sentence},{formula})"
    return formula


def choice_code(cell, names):
    """Formula of the place of a choice in a named list; 0: blank, -1: not in the list."""
    return f"IF(ISBLANK({cell}),0,IF(ISNUMBER(MATCH({cell},{names},0)),MATCH({cell},{names},0),-1))"


def fault(cell, low, high):
    """Condition that a cell contains no number from `low` to `high`."""
    return f"OR({is_no_number(cell)},{cell}<{low},{cell}>{high})"


BLANK = ("opening_blank", "closing_blank")  # sentences of a blank opening and closing
_FIRST, _LAST = "INDEX(capacity_height,1)", "INDEX(capacity_height,ROWS(capacity_height))"


def rows(record, number):
    """Rows of both gaugings, from the checks of the input to the weight in air."""
    return [
        *_levels(record, number),
        *_volumes(),
        *_shell(record),
        *_inputs(number),
        *factor_rows(),
        *_roof(record),
        *_steps(number),
    ]


def _guard_level(expression, state="level_state"):
    return f"IF([{state}@]=#fine,{expression},{NONE})"


def _fault(key, name):
    """Condition that a cell of a gauging contains no number within the limits of a ticket."""
    return fault(f"[{key}@]", *LIMITS[name])


def _levels(record, number):
    """Rows of the dip, and of the state of dips and temperatures."""
    reference = record["job"]["datum"]["reference_height_m"]
    roof = roof_of(record) if record["roof"] else None
    ullage = f"{reference!r}-[ullage@]" if reference is not None else "-1"
    level = f"IF(ISBLANK([ullage@]),[dip@],{ullage})"
    dip = f"IF(ISBLANK([ullage@]),{_fault('dip', 'dip_m')},{_fault('ullage', 'ullage_m')})"
    ambient = _fault("ambient", "ambient_c")
    cases = [
        ("AND(NOT(ISBLANK([dip@])),NOT(ISBLANK([ullage@])))", "dip_and_ullage"),
        ("AND(ISBLANK([dip@]),ISBLANK([ullage@]))", "no_dip"),
        (dip, "no_number"),
        *([] if reference is not None else [("NOT(ISBLANK([ullage@]))", "no_reference")]),
        (f"OR([level@]<{_FIRST},[level@]>{_LAST})", "outside_table"),
        *([(f"[level@]<{roof['roof_critical_top']!r}", "critical")] if roof else []),
        (f"AND(NOT(ISBLANK([water@])),{_fault('water', 'water_dip_m')})", "no_number"),
        ("[water@]>=[level@]", "water_above"),
        *(
            [(f"[water@]>{roof['roof_critical_bottom']!r}", "water_at_roof")]
            if roof and is_roof_in_table(record)
            else []
        ),
        (_fault("liquid", "temperature_c"), "liquid_blank"),
        (f"IF([insulated_code]=1,FALSE,{ambient})", "ambient_blank"),
        (f"AND(NOT(ISBLANK([ambient@])),{ambient})", "no_number"),
    ]
    blank = "AND(" + ",".join(
        f"ISBLANK([{key}@])" for key in ("dip", "ullage", "water", "liquid", "ambient", "factor")
    ) + ")"  # fmt: skip
    checked = first_true(cases, "#fine")
    states = state_row("level_state", "", f"IF({blank},#{BLANK[0]},{checked})",
                       tuple(map(number, BLANK)))  # fmt: skip
    opening, closing = states.cells
    closing = replace(closing, formula=closing.formula.replace(f"#{BLANK[0]}", f"#{BLANK[1]}"))
    return [state_row("level", "h", level, 0), replace(states, cells=(opening, closing))]


def interpolation_formulas(key, level):
    """Formulas of the row of a dip, position above it, slope and volume, {end of the key: text}."""
    low, high = (f"INDEX(capacity_height,[{key}_row@]{end})" for end in ("", "+1"))
    below, above = (f"INDEX(capacity_volume,[{key}_row@]{end})" for end in ("", "+1"))
    place = f"IF({level}<{_FIRST},1,MIN(MATCH({level},capacity_height,1),ROWS(capacity_height)-1))"
    return {
        "row": place,
        "part": f"({level}-{low})/({high}-{low})",
        "slope": f"({above}-{below})/({high}-{low})",
        "volume": f"{below}+[{key}_part@]*({above}-{below})",
    }


def _interpolate(key, level, symbol):
    """Rows of the row of a dip, position above it, slope and volume."""
    symbols = {"slope": f"∂{symbol}/∂h", "volume": symbol}
    return [
        state_row(f"{key}_{part}", symbols.get(part, ""), _guard_level(formula))
        for part, formula in interpolation_formulas(key, level).items()
    ]


def _volumes():
    """Rows of TOV and FW; water below the first row of the table is not subtracted."""
    has_water = f"IF(AND(ISNUMBER([water@]),[water@]>0,[water@]>={_FIRST}),1,0)"
    return [
        *_interpolate("tov", "[level@]", "TOV"),
        state_row("has_water", "", _guard_level(has_water)),
        state_row("water_level", "", _guard_level(f"IF([has_water@]=1,[water@],{_FIRST})")),
        *_interpolate("water", "[water_level@]", "FW"),
        state_row("fw", "FW", _guard_level("[has_water@]*[water_volume@]")),
        state_row("net", "TOV - FW", _guard_level("[tov_volume@]-[fw@]")),
    ]


def _shell(record):
    """Rows of the temperature of the shell, CTSh and its derivatives (by h, t and a)."""
    job = record["job"]
    a, base = job["material"]["expansion_per_k"], job["table"]["reference_temperature_c"]
    shell = state_row(
        "shell", "TSh", _guard_level("IF([insulated_code]=1,[liquid@],(7*[liquid@]+[ambient@])/8)")
    )
    warming = f"([shell@]-{base!r})"
    if job["tank"]["kind"] == "vertical":
        step = f"({a!r}*{warming})"
        return [
            shell,
            state_row("ctsh", "CTSh", _guard_level(f"1+2*{step}+{step}^2")),
            state_row("ctsh_h", "∂CTSh/∂h", _guard_level("0")),
            state_row("ctsh_t", "∂CTSh/∂TSh", _guard_level(f"2*{a!r}*(1+{step})")),
            state_row("ctsh_a", "∂CTSh/∂a", _guard_level(f"2*{warming}*(1+{step})")),
        ]
    # A solid expands in all directions: CTSh = s^3 V(h / s) / V(h), heights above the bottom.
    zero = record["capacity"]["zero_m"]
    height = f"([level@]+{zero!r})"
    is_empty = "[tov_volume@]<=0"
    by_s = (
        "IF(" + is_empty + ",0,(3*[s@]^2*[cold_volume@]-[s@]*[cold_slope@]*" + height
        + ")/[tov_volume@])"
    )  # fmt: skip
    by_h = f"IF({is_empty},0,([s@]^2*[cold_slope@]-[ctsh@]*[tov_slope@])/[tov_volume@])"
    return [
        shell,
        state_row("s", "s", _guard_level(f"1+{a!r}*{warming}")),
        state_row("cold", "h/s", _guard_level(f"{height}/[s@]-{zero!r}")),
        *_interpolate("cold", "[cold@]", "V(h/s)"),
        state_row("ctsh", "CTSh", _guard_level(
            f"IF({is_empty},1,[s@]^3*[cold_volume@]/[tov_volume@])")),
        state_row("ctsh_h", "∂CTSh/∂h", _guard_level(by_h)),
        state_row("ctsh_s", "∂CTSh/∂s", _guard_level(by_s)),
        state_row("ctsh_t", "∂CTSh/∂TSh", _guard_level(f"{a!r}*[ctsh_s@]")),
        state_row("ctsh_a", "∂CTSh/∂a", _guard_level(f"{warming}*[ctsh_s@]")),
    ]  # fmt: skip


def _inputs(number):
    """Row of the state of all inputs of a gauging, with those of the product."""
    low, high = FACTORS
    cases = [
        ("[product]<>#fine", "product_first"),
        ("OR([liquid@]<[t_low],[liquid@]>[t_high])", "liquid_range"),
        (
            f"IF([correction_code]={TYPED},{fault('[factor@]', low, high)},FALSE)",
            "factor_blank",
        ),
        (f"AND([correction_code]<>{TYPED},NOT(ISBLANK([factor@])))", "factor_unused"),
    ]
    state = f"IF([level_state@]=#fine,{first_true(cases, '#fine')},[level_state@])"
    return [state_row("inputs", "", state, tuple(map(number, BLANK)))]


def _roof(record):
    """Rows of the density in the tank, FRA, and its derivative by this density."""
    observed = state_row("rho_t", "ρ", _guard_level("[rho_b]*[vcf@]", "inputs"))
    if not record["roof"]:
        return [
            observed,
            state_row("fra", "FRA", _guard_level("0", "inputs")),
            state_row("fra_rho", "∂FRA/∂ρ", _guard_level("0", "inputs")),
        ]
    roof = roof_of(record)
    air = AIR_KG_M3 if roof["roof_weighing"] == "air" else 0.0
    mass = f"({roof['roof_mass']!r}*(1-{air!r}/{WEIGHTS_KG_M3!r}))"
    reference = f"{mass}/({roof['roof_reference_density']!r}-{air!r})"
    fra = f"{reference if is_roof_in_table(record) else '0'}-{mass}/([rho_t@]-{air!r})"
    return [
        observed,
        state_row("fra", "FRA", _guard_level(fra, "inputs")),
        state_row("fra_rho", "∂FRA/∂ρ", _guard_level(f"{mass}/([rho_t@]-{air!r})^2", "inputs")),
    ]


def _steps(number):
    """Rows from GOV to the weight in air, and of the state of the gauging."""
    buoyancy = f"(1-{AIR_KG_M3!r}/[rho_b])/(1-{AIR_KG_M3!r}/{WEIGHTS_KG_M3!r})"
    state = "IF([inputs@]=#fine,IF([gov@]>0,#fine,#negative),[inputs@])"
    return [
        state_row("gov", "GOV", _guard_level("[net@]*[ctsh@]+[fra@]", "inputs")),
        state_row("state", "", state, tuple(map(number, BLANK))),
        state_row("gsv", "GSV", _guard_level("[gov@]*[vcf@]", "state")),
        state_row("csw", "CSW", _guard_level("1-[sw]/100", "state")),
        state_row("nsv", "NSV", _guard_level("[gsv@]*[csw@]", "state")),
        state_row("mass", "m", _guard_level("[nsv@]*[rho_b]", "state")),
        state_row("air", "W/m", _guard_level(buoyancy, "state")),
        state_row("weight", "W", _guard_level("[mass@]*[air@]", "state")),
    ]
