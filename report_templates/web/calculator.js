// The dip calculator: as that of the workbook, straight lines between rows, U of the worse row.

let dipNow = null; // the dip of the calculator, m; null while it is refused
const tellDip = [];

/** Calls tell(dip) now and whenever the dip changes: the view shows the level of the liquid. */
function whenDipChanges(tell) {
  tellDip.push(tell);
  tell(dipNow);
}

{
  const SAME_M = 1e-9; // so that 0.35 typed finds the row 0.35, whatever its last bit is
  const data = dataOf("calculator");
  const heights = unpacked(data.height_m, Float64Array);
  const volumes = unpacked(data.volume, Float64Array);
  const expanded = unpacked(data.U, Float64Array);
  const standard = unpacked(data.u, Float32Array);
  const factors = unpacked(data.k, Float32Array);
  const decimals = unpacked(data.decimals, Uint8Array);
  const simulated = unpacked(data.simulated, Uint8Array);
  const last = heights.length - 1;
  const top = Math.max(heights[last], Number(heights[last].toFixed(3))); // as a tape shows it
  const covariance = covarianceOfTable(data.deliveries, heights);
  const uncertaintyBetween = deliveryUncertainty(covariance);
  const field = (id) => document.getElementById(id);
  const height = (value) => fixed(value, decimalsOfHeight(value));
  const metres = (value) => `${height(value)}\u00a0m`;

  /** {refusal} in words, or {dip, row, part}: how far it is from a row to the next one. */
  const read = (text) => {
    const dip = typedNumber(text);
    if (!text.trim()) return { refusal: sentence("type_dip") };
    if (Number.isNaN(dip)) return { refusal: sentence("no_number", { text: text.trim() }) };
    if (dip < heights[0] - SAME_M) return { refusal: sentence("below", { from: metres(heights[0]) }) };
    if (dip > top + SAME_M) return { refusal: sentence("above", { to: metres(heights[last]) }) };
    const [low, high] = data.critical_m ?? [Infinity, -Infinity];
    if (dip > low + SAME_M && dip < high - SAME_M) return { refusal: sentence("critical") };
    let row = 0;
    let end = last;
    while (row < end) {
      const middle = (row + end + 1) >> 1;
      if (heights[middle] <= dip + SAME_M) row = middle;
      else end = middle - 1;
    }
    const rest = dip - heights[row];
    const part = row === last || rest < SAME_M ? 0 : rest / (heights[row + 1] - heights[row]);
    return { dip, row, part };
  };

  const volumeAt = ({ row, part }) =>
    part ? volumes[row] + part * (volumes[row + 1] - volumes[row]) : volumes[row];
  const heightAt = ({ row, part }) =>
    part ? heights[row] + part * (heights[row + 1] - heights[row]) : heights[row];
  const quantity = (value, places) => `${fixed(value, places)}\u00a0${data.unit}`;
  const standardU = (u) => ["standard_u", quantity(u, u > 0 ? decimalsOf(u) : data.least)];

  /** The sentence of a result; k is null where U is Monte Carlo's. */
  const result = (volume, U, k, places) => sentence(k === null ? "result_simulated" : "result", {
    volume: quantity(volume, Math.max(places, data.least)),
    U: quantity(U, places),
    k: k === null ? "" : fixed(k, 2),
    coverage: data.coverage,
  }).replaceAll(" = ", "\u00a0=\u00a0");

  const facts = (list, pairs) => {
    list.replaceChildren(...pairs.flatMap(([name, value]) => {
      const [term, description] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = words[name];
      description.textContent = value;
      return [term, description];
    }));
  };

  /** Show a result; kind is "", "refused" or "asked". */
  const answer = (id, text, kind, pairs = []) => {
    field(id).textContent = text;
    field(id).className = `answer ${kind}`;
    facts(field(`${id}-more`), pairs);
  };

  /** U, u and k of the volume at a dip: of the row with the larger U; k is null by Monte Carlo. */
  const uncertaintyAt = ({ row, part }) => {
    const worse = part && expanded[row + 1] >= expanded[row] ? row + 1 : row;
    return { worse, U: expanded[worse], u: standard[worse], k: simulated[worse] ? null : factors[worse] };
  };

  const showVolume = (found) => {
    if (found.refusal) return answer("volume", found.refusal, "refused");
    const { row, part } = found;
    const volume = volumeAt(found);
    const { worse, k } = uncertaintyAt(found);
    const pairs = [standardU(standard[worse])];
    if (volume > 0) pairs.push(["relative_U", `${fixed((100 * expanded[worse]) / volume, 3)} %`]);
    if (data.reference_height_m !== null) {
      pairs.push(["ullage", metres(data.reference_height_m - found.dip)]);
    }
    pairs.push(["rows", part ? `${metres(heights[row])}, ${metres(heights[row + 1])}`
      : metres(heights[row])]);
    return answer("volume", result(volume, expanded[worse], k, decimals[worse]), "", pairs);
  };

  const statedBetween = (low, high) => data.deliveries.stated.find((one) =>
    Math.abs(one.low_m - low) < SAME_M && Math.abs(one.high_m - high) < SAME_M);

  const showDelivery = (one, other) => {
    const refusal = one.refusal ?? other.refusal;
    if (refusal) return answer("delivery", refusal, "refused");
    if (Math.abs(one.dip - other.dip) < SAME_M) return answer("delivery", words.same_dip, "refused");
    const [below, above] = one.dip < other.dip ? [one, other] : [other, one];
    const [low, high] = [heightAt(below), heightAt(above)];
    const volume = volumeAt(above) - volumeAt(below);
    const stated = statedBetween(low, high);
    // Down to the empty tank, errors of the two dips cancel in part only: the larger U is stated.
    const between = uncertaintyBetween(low, high);
    const whole = uncertaintyAt(above);
    const isWhole = volumeAt(below) === 0 && whole.U >= between.k * between.u;
    const { u, k } = isWhole ? whole : between;
    const U = stated ? stated.U : isWhole ? whole.U : k * u;
    const places = U > 0 ? decimalsOf(U) : data.least;
    const pairs = stated ? [] : [standardU(u)];
    if (volume > 0) pairs.push(["relative_U", `${fixed((100 * U) / volume, 3)} %`]);
    if (stated) pairs.push(["as_stated", words.as_stated_text]);
    return answer("delivery", result(volume, U, stated ? stated.k : k, places), "", pairs);
  };

  const show = () => {
    const [dip, other] = [read(field("dip").value), read(field("other_dip").value)];
    showVolume(dip);
    if (field("other_dip").value.trim()) showDelivery(dip, other);
    else answer("delivery", words.type_other_dip, "asked");
    for (const [id, found] of [["dip", dip], ["other_dip", other]]) {
      const isWrong = Boolean(found.refusal) && field(id).value.trim() !== "";
      field(id).setAttribute("aria-invalid", String(isWrong));
    }
    dipNow = dip.refusal ? null : dip.dip;
    for (const tell of tellDip) tell(dipNow);
  };

  field("dip").value = height(heights[last >> 1]);
  field("dip").addEventListener("input", show);
  field("other_dip").addEventListener("input", show);
  document.getElementById("calculator").hidden = false;
  show();
}
