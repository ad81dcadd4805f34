// From two dips to the quantity of product, as tankcal/products/quantity; no part of the page.

const { quantityOf, Refusal } = (() => {
// A number with its derivatives by named inputs. They go through every step of the calculation.
const lift = (x) => (typeof x === "number" ? { value: x, slopes: {} } : x);
const input = (value, ...names) => ({ value, slopes: Object.fromEntries(names.map((name) => [name, 1])) });

/** A number whose derivatives are those of its parts [number, factor], summed. */
function derived(value, parts) {
  const slopes = {};
  for (const [part, factor] of parts) {
    for (const name of Object.keys(part.slopes)) {
      slopes[name] = (slopes[name] ?? 0) + factor * part.slopes[name];
    }
  }
  return { value, slopes };
}

const plus = (a, b) => ([a, b] = [lift(a), lift(b)], derived(a.value + b.value, [[a, 1], [b, 1]]));
const minus = (a, b) => ([a, b] = [lift(a), lift(b)], derived(a.value - b.value, [[a, 1], [b, -1]]));
const times = (a, b) => ([a, b] = [lift(a), lift(b)],
  derived(a.value * b.value, [[a, b.value], [b, a.value]]));
const over = (a, b) => ([a, b] = [lift(a), lift(b)],
  derived(a.value / b.value, [[a, 1 / b.value], [b, -a.value / b.value ** 2]]));
const exponential = (a) => derived(Math.exp(a.value), [[a, Math.exp(a.value)]]);
const less1 = (a) => derived(Math.expm1(a.value), [[a, Math.exp(a.value)]]);
const product = (...factors) => factors.reduce(times);
const sum = (...terms) => terms.reduce(plus);

/** A refusal: key of its sentence, place ("product", "opening" or "closing"), and the range. */
class Refusal extends Error {
  constructor(key, place = "product", range = null) {
    super(key);
    Object.assign(this, { key, place, range });
  }
}

const MOST_ROUNDS = 200; // of iterations for the density at the base
const ROUNDS_OF_GROUPS = 30; // later rounds keep the group, so that it cannot alternate
const CONVERGED = 1e-13; // relative
const ROUNDS_OF_SLOPES = 12; // derivatives converge as values do, some rounds later

/** Polynomial with coefficients from the highest power. */
const horner = (coefficients, x) => coefficients.reduce((total, c) => plus(times(total, x), c), 0);

function glassCorrection({ glass, bases_c: bases }, celsius, scale) {
  const [linear, quadratic] = glass[scale];
  const step = (scale === "60F" ? 1.8 : 1) * (celsius - bases[scale]);
  return 1 - linear * step - quadratic * step ** 2;
}

/** The root of density = next(density, group), with its derivatives. */
function iterate(start, next) {
  let [density, bound, after] = [start, null, 0];
  for (let round = 0; round < MOST_ROUNDS; round++) {
    const before = density.value;
    density = next(density, bound);
    if (round === ROUNDS_OF_GROUPS) bound = density.value;
    if (!Number.isFinite(density.value)) break;
    if (Math.abs(density.value - before) <= CONVERGED * Math.abs(density.value)) {
      after += 1;
      if (after > ROUNDS_OF_SLOPES) return density;
    } else after = 0;
  }
  throw new Refusal("no_base_density");
}

/** D1250 of 1980 or 2004 at one base: through the density at 15 degC or 60 degF. */
function petroleum(constants, { edition, group, base, alpha }) {
  const { bases_c: bases } = constants;
  const is2004 = edition === "D1250-04";
  const form = is2004 ? "2004" : base === "60F" ? "60F" : "15C";
  const [delta, degree] = [is2004 ? constants.delta_60 : 0, form === "15C" ? 1 : 1.8];
  const parts = group === "coefficient" ? null : constants.groups[form][group];

  const steps = (t) => {
    if (form === "15C") return minus(t, bases["15C"]);
    if (form === "60F") return times(1.8, minus(t, bases["60F"]));
    const tau = over(t, 630);
    const shift = horner([...constants.scales.slice().reverse(), 0], tau);
    return minus(plus(times(1.8, minus(t, shift)), 32), constants.zero_68_f);
  };
  const expansion = (density, bound) => {
    const at = bound ?? density.value;
    const [, k0, k1, k2] = parts.find(([high], place) => at <= high || place === parts.length - 1);
    const a = plus(over(plus(over(k0, density), k1), density), k2);
    return { a, k0, k1, k2 };
  };
  const logFactor = (density, t, bound) => {
    let a = lift((alpha ?? 0) / degree);
    if (parts) {
      const { a: raw, k0, k1, k2 } = expansion(density, bound);
      const half = times(delta / 2, raw);
      const b = over(plus(2 * k0, times(k1, density)),
        plus(k0, times(plus(k1, times(k2, density)), density)));
      const rise = less1(times(half, plus(1, times(0.8, half))));
      const below = plus(1, product(half, plus(1, times(1.6, half)), b));
      const star = times(density, plus(1, over(rise, below)));
      a = plus(over(plus(over(k0, star), k1), star), k2);
    }
    const step = steps(lift(t));
    return times(-1, product(a, step, plus(1, product(0.8, a, plus(step, delta)))));
  };
  const root = (density, t) => iterate(density, (rho, bound) =>
    times(density, exponential(times(-1, logFactor(rho, t, bound)))));

  const least = parts ? constants.least[form][group] : 0;
  const most = parts ? parts.at(-1)[0] : Infinity;
  const limits = (density) => {
    if (is2004) return constants.limits_2004_c;
    const [light, middle, heavy] = constants.highest_f;
    const high = density < constants.light ? light : density < constants.middle ? middle : heavy;
    return [(constants.lowest_f - 32) / 1.8, (high - 32) / 1.8];
  };
  return {
    base_c: bases[base],
    densities: [least, most],
    limits,
    baseDensity: (density, t) => {
      const rho = root(density, t);
      return times(rho, exponential(logFactor(rho, bases[base])));
    },
    factor: (density, t) => {
      const rho = root(density, bases[base]);
      return exponential(minus(logFactor(rho, t), logFactor(rho, bases[base])));
    },
  };
}

/** The tables of Brazil, CNP 6/70, through their fit. */
function brazil(constants, isRounded) {
  const { classes, least, most, limits_c: limits, three_to: threeTo, four_from: fourFrom } =
    constants.brazil;
  const base = constants.bases_c["20C"];
  const classOf = (relative) => classes.find(([high], place) =>
    relative <= high || place === classes.length - 1).slice(1);
  const fit = (relative, t) => {
    const [p1, p2, p3, p4] = classOf(lift(relative).value);
    const x = minus(t, base);
    return sum(1, times(p2, x), product(p4, x, x), over(plus(times(p1, x), product(p3, x, x)), relative));
  };
  /** To the nearest whole number, a half to the even one. */
  const even = (value) => {
    const whole = Math.round(value);
    return Math.abs(value % 1) === 0.5 && whole % 2 !== 0 ? whole - 1 : whole;
  };
  return {
    base_c: base,
    glass_scale: "20C",
    densities: [1000 * least, 1000 * most],
    limits: () => limits,
    baseDensity: (density, t) => {
      const seen = over(density, 1000);
      const x = t - base;
      return times(1000, iterate(seen, (rho, bound) => {
        const [p1, p2, p3, p4] = classOf(bound ?? rho.value);
        return times(glassCorrection(constants, t, "20C") / (1 + p2 * x + p4 * x ** 2),
          minus(seen, p1 * x + p3 * x ** 2));
      }));
    },
    factor: (density, t) => {
      const relative = over(density, 1000);
      const unrounded = fit(relative, lift(t));
      if (!isRounded) return unrounded;
      const isLight = relative.value <= threeTo;
      if (!isLight && relative.value < fourFrom) throw new Refusal("cnp_decimals");
      const ninth = Math.round((relative.value / 0.002) * 1e9) / 1e9;
      const decimals = isLight ? 3 : 4;
      const value = fit(0.002 * even(ninth), lift(t)).value;
      return { value: Number(value.toFixed(decimals)), slopes: unrounded.slopes };
    },
  };
}

function constant({ bases_c: bases, constant_c: limits }, alpha, base) {
  const factor = (density, t) => over(1, plus(1, times(alpha, minus(t, bases[base]))));
  return {
    base_c: bases[base],
    densities: [0, Infinity],
    limits: () => limits,
    baseDensity: (density, t) => over(density, factor(null, lift(t))),
    factor,
  };
}

/** The volume correction of the chosen product; a Refusal for an incomplete choice. */
function correctionOf(constants, given) {
  const { correction, group, base, alpha } = given;
  const hasGroup = correction.startsWith("D1250");
  const needsAlpha = correction === "coefficient" || (hasGroup && group === "coefficient");
  if (!correction) throw new Refusal("correction_blank");
  if (hasGroup && !group) throw new Refusal("group_blank");
  if (!hasGroup && group) throw new Refusal("group_unused");
  if ((hasGroup || correction === "coefficient") && !base) throw new Refusal("base_blank");
  if (correction.startsWith("CNP") && base && base !== "20C") throw new Refusal("base_other");
  if (!needsAlpha && alpha !== null) throw new Refusal("alpha_unused");
  if (needsAlpha) {
    const [low, high] = correction === "coefficient" ? [1e-9, 0.01] : constants.alpha[correction];
    if (!(alpha >= low && alpha <= high)) throw new Refusal("alpha_range");
  }
  if (hasGroup) return petroleum(constants, { edition: correction, group, base, alpha });
  if (correction === "coefficient") return constant(constants, alpha, base);
  return brazil(constants, correction === "CNP-6-70");
}

/** Volume of the table at a dip, linear between rows; the level has derivatives. */
function tableVolume({ heights, volumes }, level) {
  let row = 0;
  let end = heights.length - 2;
  while (row < end) {
    const middle = (row + end + 1) >> 1;
    if (heights[middle] <= level.value) row = middle;
    else end = middle - 1;
  }
  const slope = (volumes[row + 1] - volumes[row]) / (heights[row + 1] - heights[row]);
  const part = (level.value - heights[row]) / (heights[row + 1] - heights[row]);
  const volume = volumes[row] + part * (volumes[row + 1] - volumes[row]);
  return { row, volume: derived(volume, [[level, slope]]) };
}

function shellFactor(tank, level, shell, expansion) {
  const step = times(expansion, minus(shell, tank.temperature_c));
  if (tank.kind === "vertical") return sum(1, times(2, step), times(step, step));
  const stretch = plus(1, step);
  const cold = minus(over(plus(level, tank.zero_m), stretch), tank.zero_m);
  const { volume } = tableVolume(tank, level);
  if (!(volume.value > 0)) return lift(1);
  return over(product(stretch, stretch, stretch, tableVolume(tank, cold).volume), volume);
}

/** Volume displaced by the floating roof at a density. */
const displacement = (roof, density) => over(
  roof.mass_kg * (1 - roof.air / roof.weights), minus(density, roof.air));

/** Relative standard uncertainty of VCF by the distance from the base, with its sign. */
function vcfScale(rule, celsius, base) {
  const distance = Math.abs(celsius - base);
  const last = rule.at_k.length - 2;
  let piece = 0;
  while (piece < last && distance >= rule.at_k[piece + 1]) piece += 1;
  const [low, high] = [rule.at_k[piece], rule.at_k[piece + 1]];
  const [below, above] = [rule.percent[piece], rule.percent[piece + 1]];
  const percent = below + ((distance - low) * (above - below)) / (high - low);
  return (Math.sign(celsius - base) * percent) / 100 / rule.k;
}

/** Whether a value is a number within its limits; a blank is not. */
const isWithin = (value, [low, high]) => value !== null && value >= low && value <= high;

/** Dips and temperatures of one gauging, checked. */
function gaugingOf(tank, given, place, isInsulated) {
  const refuse = (key) => { throw new Refusal(key, place); };
  const { dip, ullage, water, liquid, ambient } = given;
  const readings = { dip_m: dip, ullage_m: ullage, water_dip_m: water, temperature_c: liquid,
    ambient_c: ambient };
  for (const [key, value] of Object.entries(readings)) {
    if (value !== null && !isWithin(value, tank.input_limits[key])) refuse("no_number");
  }
  if (dip !== null && ullage !== null) refuse("dip_and_ullage");
  if (dip === null && ullage === null) refuse("no_dip");
  if (ullage !== null && tank.reference_height_m === null) refuse("no_reference");
  const level = ullage === null ? dip : tank.reference_height_m - ullage;
  const first = tank.heights[0];
  if (!(level >= first && level <= tank.heights.at(-1))) refuse("outside_table");
  if (tank.roof && level < tank.roof.critical_top_m) refuse("critical");
  if (water !== null && water >= level) refuse("water_above");
  if (tank.roof?.is_in_table && water > tank.roof.critical_bottom_m) refuse("water_at_roof");
  if (liquid === null) refuse("liquid_blank");
  if (!isInsulated && ambient === null) refuse("ambient_blank");
  const hasWater = water !== null && water > 0 && water >= first;
  return { level, taped: ullage === null ? level : -ullage, water: hasWater ? water : null, liquid, ambient };
}

/** Steps of one gauging; the names of its own inputs end in its place. */
function followChain(tank, gauging, liquid, place) {
  const { correction, base, waterShare, isInsulated, expansion, u } = liquid;
  const level = {
    value: gauging.level,
    slopes: { [`dip ${place}`]: 1, tape: gauging.taped },
  };
  const found = tableVolume(tank, level);
  const tov = plus(found.volume, { value: 0, slopes: { [`table ${place}`]: 1 } });
  const fw = gauging.water === null ? lift(0)
    : tableVolume(tank, input(gauging.water, `water ${place}`)).volume;
  const celsius = input(gauging.liquid, `temperature ${place}`, "thermometer");
  const shell = isInsulated ? celsius
    : over(plus(times(7, celsius), input(gauging.ambient, "ambient")), 8);
  const ctsh = shellFactor(tank, level, shell, expansion);
  const [low, high] = correction.limits(base.value);
  if (!(gauging.liquid >= low && gauging.liquid <= high)) {
    throw new Refusal("liquid_range", place, { label: "t_range", low, high, unit: "°C" });
  }
  const scale = u.u_vcf === null ? vcfScale(tank.vcf_rule, gauging.liquid, correction.base_c)
    : u.u_vcf / 100;
  const vcf = times(correction.factor(base, celsius), { value: 1, slopes: { vcf: scale } });
  const observed = times(base, vcf);
  let fra = lift(0);
  if (tank.roof) {
    const reference = tank.roof.is_in_table
      ? displacement(tank.roof, tank.roof.reference_density) : lift(0);
    fra = minus(reference, displacement(tank.roof, observed));
  }
  const gov = plus(times(minus(tov, fw), ctsh), fra);
  if (!(gov.value > 0)) throw new Refusal("negative", place);
  const gsv = times(gov, vcf);
  const csw = minus(1, waterShare);
  const nsv = times(gsv, csw);
  const mass = times(nsv, base);
  const air = over(minus(1, over(tank.air, base)), 1 - tank.air / tank.weights);
  return { tov, fw, shell, ctsh, vcf, rho_t: observed, fra, gov, gsv, csw, nsv, mass, air,
    weight: times(mass, air), row: found.row };
}

const QUANTITIES = ["tov", "gov", "gsv", "nsv", "mass", "weight"];

/** {base density, steps of each place, moved: {quantity: {value, U, k}}}; throws a Refusal.

 * `table` has columnsAt(height), inverseDof(columns) and coverage(inverse dof) of deliveries.js.
 */
function quantityOf(tank, table, given) {
  const correction = correctionOf(tank.constants, given);
  const limits = tank.input_limits;
  if (!isWithin(given.density, limits.density_kg_m3)) throw new Refusal("density_range");
  if (!given.density_is) throw new Refusal("density_is_blank");
  const isObserved = given.density_is === "observed";
  if (isObserved && !isWithin(given.sample, limits.density_temperature_c)) {
    throw new Refusal("sample_blank");
  }
  if (!isObserved && (given.sample !== null || given.hydrometer)) throw new Refusal("sample_unused");
  if (given.sw !== null && !isWithin(given.sw, limits.sw_percent)) throw new Refusal("sw_range");
  for (const [name, u] of Object.entries(given.u)) {
    if (!(u >= 0) || (u === null && name !== "u_vcf")) throw new Refusal("u_wrong");
  }
  let base = input(given.density, "density");
  if (isObserved) {
    let glass = given.hydrometer ? glassCorrection(tank.constants, given.sample, given.hydrometer) : 1;
    if (correction.glass_scale) {
      glass /= glassCorrection(tank.constants, given.sample, correction.glass_scale);
    }
    base = correction.baseDensity(times(base, glass), given.sample);
  }
  const [least, most] = correction.densities;
  if (!(base.value >= least && base.value <= most)) {
    const range = { label: "rho_range", low: least, high: most, unit: "kg/m³" };
    throw new Refusal("base_density_range", "product", range);
  }
  const [low, high] = correction.limits(base.value);
  if (isObserved && !(given.sample >= low && given.sample <= high)) {
    throw new Refusal("sample_range", "product", { label: "t_range", low, high, unit: "°C" });
  }
  const liquid = {
    correction, base, u: given.u, isInsulated: given.insulated,
    waterShare: input((given.sw ?? 0) / 100, "sw"), expansion: input(tank.expansion_per_k, "expansion"),
  };
  const isBlank = (gauging) => Object.values(gauging).every((value) => value === null);
  if (isBlank(given.closing)) throw new Refusal("closing_blank", "closing");
  const places = isBlank(given.opening) ? ["closing"] : ["opening", "closing"];
  const [steps, gaugings] = [{}, {}];
  for (const place of places) {
    gaugings[place] = gaugingOf(tank, given[place], place, given.insulated);
    steps[place] = followChain(tank, gaugings[place], liquid, place);
  }
  const standard = standardUncertainties(tank, given, places);
  return {
    base_density: base.value,
    steps,
    moved: differences(tank, table, standard, gaugings, steps),
    rooms: roomsOf(tank, table, standard, gaugings.closing, steps.closing, liquid.expansion),
  };
}

/** {input: standard uncertainty}. */
function standardUncertainties(tank, given, places) {
  const { u } = given;
  const standard = {
    tape: u.u_tape / 1e6, thermometer: u.u_thermometer, density: u.u_density, vcf: 1,
    ambient: u.u_ambient, sw: given.sw === null ? 0 : u.u_sw / 100, expansion: u.u_expansion,
  };
  for (const place of places) {
    standard[`dip ${place}`] = u.u_dip / 1000;
    standard[`water ${place}`] = u.u_water / 1000;
    standard[`temperature ${place}`] = u.u_temperature;
    standard[`table ${place}`] = tank.interpolation_m3 / Math.sqrt(3);
  }
  return standard;
}

/** Factor of the table at a dip, in m3 for each column. */
const factorAt = (tank, table, height) =>
  table.columnsAt(height).map((value) => value / tank.unit_factor);

/** 1/dof of the table at a dip: the larger of the rows about it. */
const inverseDofAt = (tank, table, row) => Math.max(...[row, row + 1].map((at) =>
  table.inverseDof(table.columnsAt(tank.heights[at]))));

/** {value, U, k} of a number with derivatives, and the variance by the table. */
function stated(table, total, standard, byTable, inverse) {
  const variance = Object.entries(total.slopes).reduce((all, [name, slope]) =>
    all + (slope * (standard[name] ?? 0)) ** 2, byTable);
  const k = table.coverage(variance > 0 ? (byTable / variance) ** 2 * inverse : 0);
  return { value: total.value, U: k * Math.sqrt(variance), k };
}

/** {quantity: {value, U, k}} of closing - opening, or of the closing alone. */
function differences(tank, table, standard, gaugings, steps) {
  const [gross, net] = [{}, {}]; // factors of TOV, and of TOV - FW
  let inverse = 0;
  for (const [place, gauging] of Object.entries(gaugings)) {
    const water = gauging.water === null ? null : factorAt(tank, table, gauging.water);
    gross[place] = factorAt(tank, table, gauging.level);
    net[place] = gross[place].map((value, column) => value - (water ? water[column] : 0));
    inverse = Math.max(inverse, inverseDofAt(tank, table, steps[place].row));
  }
  const moved = {};
  for (const name of QUANTITIES) {
    const closing = steps.closing[name];
    const factors = name === "tov" ? gross : net;
    const total = steps.opening ? minus(closing, steps.opening[name]) : closing;
    const byTable = factors.closing.reduce((variance, _, column) => variance
      + Object.keys(factors).reduce((part, place) =>
        part + (total.slopes[`table ${place}`] ?? 0) * factors[place][column], 0) ** 2, 0);
    moved[name] = stated(table, total, standard, byTable, inverse);
  }
  return moved;
}

/** [{name, level_m, value, U, k}] of the observed volumes between the closing and each level. */
function roomsOf(tank, table, standard, gauging, closing, expansion) {
  const present = plus(times(closing.tov, closing.ctsh), closing.fra);
  const here = factorAt(tank, table, gauging.level);
  return tank.rooms.map(({ name, level_m: level, sign }) => {
    const { volume, row } = tableVolume(tank, lift(level));
    const ctsh = shellFactor(tank, lift(level), closing.shell, expansion);
    // Below its critical zone the roof rests on its legs, and displaces no liquid.
    const isResting = tank.roof && level < tank.roof.critical_top_m;
    const full = plus(times(volume, ctsh), isResting ? 0 : closing.fra);
    const total = times(sign, minus(full, present));
    // An error of the table at the level acts like the error at the dip, with other sign.
    const slope = total.slopes["table closing"];
    const there = factorAt(tank, table, level);
    const byTable = here.reduce((variance, value, column) =>
      variance + (slope * (value - there[column])) ** 2, 0);
    total.slopes["table level"] = -slope;
    const inverse = Math.max(...[closing.row, row].map((at) => inverseDofAt(tank, table, at)));
    const own = { ...standard, "table level": standard["table closing"] };
    return { name, level_m: level, ...stated(table, total, own, byTable, inverse) };
  });
}
return { quantityOf, Refusal };
})();
