// Numbers and sentences in the language of the page; the rules are those of tankcal/text/digits.py.

const spoken = JSON.parse(document.getElementById("words").textContent);
const words = spoken.words;
const marks = spoken.marks;
const NOTHING = "–";

/** The sentence `words[name]` with its {places} filled. */
function sentence(name, values = {}) {
  return words[name].replace(/\{(\w+)\}/g, (place, key) => values[key] ?? place);
}

/** {digits, exponent} of the 15 decimal digits that a double holds for certain. */
function exact(value) {
  const [mantissa, exponent] = Math.abs(value).toExponential(14).split("e");
  return { digits: mantissa.replace(".", ""), exponent: Number(exponent) };
}

/** The whole number nearest to |value| * 10^decimals, a half away from zero (BigInt). */
function scaled(value, decimals) {
  const { digits, exponent } = exact(value);
  const keep = exponent + 1 + decimals; // digits before the place where it ends
  if (keep < 0) return 0n;
  if (keep >= digits.length) return BigInt(digits + "0".repeat(keep - digits.length));
  const whole = BigInt(digits.slice(0, keep) || "0");
  return digits[keep] >= "5" ? whole + 1n : whole;
}

function grouped(text, fromRight) {
  const pattern = fromRight ? /(\d)(?=(\d{3})+$)/g : /(\d{3})(?=\d)/g;
  return text.replace(pattern, "$1" + marks.group);
}

/** A number with so many decimals, 0 or more, in the marks of the page. */
function fixed(value, decimals) {
  if (!Number.isFinite(value)) return NOTHING;
  const rounded = scaled(value, decimals);
  const text = rounded.toString().padStart(decimals + 1, "0");
  let whole = text.slice(0, text.length - decimals);
  let behind = text.slice(text.length - decimals);
  const least = marks.least ?? 5;
  if (marks.group && whole.length >= least) whole = grouped(whole, true);
  if (marks.group && marks.of_decimals && behind.length >= least) behind = grouped(behind, false);
  const sign = value < 0 && rounded > 0n ? (marks.minus ?? "−") : "";
  return sign + whole + (behind ? marks.decimal + behind : "");
}

/** Decimals, 0 or more, that show an uncertainty above 0 with two significant digits. */
function decimalsOf(u) {
  const { exponent } = exact(u);
  const carried = scaled(u, 1 - exponent) >= 100n; // 0.0996 is 0.10
  return Math.max(1 - exponent - (carried ? 1 : 0), 0);
}

/** Decimals of a height in metres: millimetres, and up to two more where it is no whole one. */
function decimalsOfHeight(height) {
  return [3, 4].find((one) => Math.abs(height - Number(height.toFixed(one))) < 1e-9) ?? 5;
}

/** The number that was typed, with a decimal point or comma; NaN for anything else. */
function typedNumber(text) {
  const plain = text.trim().replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)$/.test(plain) ? Number(plain) : NaN;
}

/** The little-endian numbers in a base64 text, as an array of the given kind. */
function unpacked(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0)).buffer);
}

/** The data that a part of the page was made with. */
function dataOf(name) {
  return JSON.parse(document.getElementById(`${name}-data`).textContent);
}
