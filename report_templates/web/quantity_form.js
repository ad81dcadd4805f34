// The form of the quantity calculator; its words are those of the sheet Quantity of the workbook.

{
  const data = dataOf("calculator");
  const spelt = spoken.quantity;
  const covariance = covarianceOfTable(data.deliveries, unpacked(data.height_m, Float64Array));
  const tank = {
    ...data.quantity,
    reference_height_m: data.reference_height_m,
    heights: unpacked(data.height_m, Float64Array),
    volumes: unpacked(data.volume, Float64Array).map((volume) => volume / data.quantity.unit_factor),
  };
  const UNITS = {
    alpha: "1/K", density: "kg/m³", sample: "°C", sw: "%", dip: "m", ullage: "m", water: "m",
    liquid: "°C", ambient: "°C", ...tank.units_of_u,
  };
  const CHOICES = {
    correction: [["D1250-04", "D1250-04"], ["D1250-80", "D1250-80"],
      ["CNP-6-70", spelt.choices.cnp], ["CNP-6-70-unrounded", spelt.choices.cnp_unrounded],
      ["coefficient", spelt.choices.constant]],
    group: ["crude", "products", "lubricants", "coefficient"].map((key) => [key, spelt.choices[key]]),
    base: ["15C", "20C", "60F"].map((key) => [key, key]),
    density_is: ["base", "observed"].map((key) => [key, spelt.choices[key]]),
    hydrometer: ["15C", "20C", "60F"].map((key) => [key, key]),
  };
  const PRODUCT = ["correction", "group", "base", "alpha", "density", "density_is", "sample",
    "hydrometer", "sw"];
  const GAUGING = ["dip", "ullage", "water", "liquid", "ambient"];
  const STEPS = [ // label, decimals, unit
    ["tov", 3, "m³"], ["fw", 3, "m³"], ["shell", 2, "°C"], ["ctsh", 6, ""], ["vcf", 6, ""],
    ["rho_t", 2, "kg/m³"], ["fra", 3, "m³"], ["gov", 3, "m³"], ["gsv", 3, "m³"], ["csw", 6, ""],
    ["nsv", 3, "m³"], ["mass", 0, "kg"], ["air", 6, ""], ["weight", 0, "kg"],
  ];
  const make = (tag, text = "", more = {}) => Object.assign(document.createElement(tag),
    { textContent: text }, more);
  const fields = {};

  /** A labelled field: a list of choices, a check box or a number. */
  const field = (key, name = key, label = spelt.labels[key]) => {
    const id = `quantity-${name}`;
    const line = make("p");
    let control = make("input", "", { id, inputMode: "decimal", autocomplete: "off", size: 9 });
    if (key === "insulated") control = make("input", "", { id, type: "checkbox" });
    if (CHOICES[key]) {
      control = make("select", "", { id });
      control.append(make("option", "", { value: "" }));
      for (const [value, text] of CHOICES[key]) control.append(make("option", text, { value }));
    }
    line.append(make("label", label, { htmlFor: id }), control, make("span", UNITS[key] ?? ""));
    control.addEventListener("input", () => show());
    fields[name] = control;
    return line;
  };
  const group = (title, lines) => {
    const part = make("fieldset");
    part.append(make("legend", title), ...lines);
    return part;
  };

  /** The number in a field, with its power of ten; null: blank; NaN: no number. */
  const numberIn = (name) => {
    const text = fields[name].value.trim();
    if (!text) return null;
    const [mantissa, power] = text.toLowerCase().split("e");
    const value = typedNumber(mantissa);
    return power === undefined ? value : /^[+-]?\d{1,3}$/.test(power) ? Number(`${value}e${power}`) : NaN;
  };
  const gaugingIn = (place) => Object.fromEntries(
    GAUGING.map((key) => [key, numberIn(`${key}-${place}`)]));
  const given = () => ({
    ...Object.fromEntries(["correction", "group", "base", "density_is", "hydrometer"].map(
      (key) => [key, fields[key].value])),
    ...Object.fromEntries(["alpha", "density", "sample", "sw"].map((key) => [key, numberIn(key)])),
    insulated: fields.insulated.checked,
    u: Object.fromEntries(tank.u.map(([key]) => [key, numberIn(key)])),
    opening: gaugingIn("opening"),
    closing: gaugingIn("closing"),
  });

  const table = make("table", "", { className: "lines" });
  const remark = make("p", "", { className: "answer" });
  remark.setAttribute("role", "status");
  const cell = (text) => make("td", text, { className: "decimal" });

  const headRow = (title, keys) => {
    const head = make("tr");
    head.append(make("th", title), ...keys.map((key) => make("th", spelt.columns[key], { scope: "col" })));
    return head;
  };
  const decimalsOfU = (U) => Math.max(decimalsOf(U), 0);
  /** Rows of the volumes between the closing gauging and the operating levels. */
  const roomRows = (rooms) => rooms.map(({ name, level_m, value, U, k }) => {
    const row = make("tr");
    row.append(make("th", `${spoken.rooms[name]} (m³)`, { scope: "row" }), cell(""),
      cell(fixed(level_m, 4)), cell(fixed(value, 3)), cell(fixed(U, decimalsOfU(U))), cell(fixed(k, 2)));
    return row;
  });

  const showResult = (result) => {
    const head = headRow("", ["opening", "closing", "difference", "expanded", "k"]);
    const rows = STEPS.map(([key, decimals, unit]) => {
      const row = make("tr");
      const values = ["opening", "closing"].map((place) =>
        cell(result.steps[place] ? fixed(result.steps[place][key].value, decimals) : NOTHING));
      const moved = result.moved[key];
      const U = moved ? [
        fixed(moved.value, decimals),
        fixed(moved.U, decimalsOfU(moved.U)),
        fixed(moved.k, 2),
      ] : ["", "", ""];
      row.append(make("th", spelt.labels[key] + (unit ? ` (${unit})` : ""), { scope: "row" }),
        ...values, ...U.map(cell));
      return row;
    });
    const body = make("tbody");
    body.append(head, ...rows);
    const rooms = roomRows(result.rooms);
    if (rooms.length) {
      const room = headRow(spoken.rooms.rooms, ["level", "volume", "expanded", "k"]);
      room.firstChild.after(make("th"));
      body.append(room, ...rooms);
    }
    table.replaceChildren(body);
  };

  /** Sentence of a refusal, with the numbers of the table. */
  const sentenceOf = (key) => spelt.sentences[key].replace(/\{(\w+)\}/g, (whole, name) => ({
    first: fixed(tank.heights[0], 4),
    last: fixed(tank.heights.at(-1), 4),
    critical_low: fixed(tank.roof?.critical_bottom_m ?? 0, 4),
    critical_high: fixed(tank.roof?.critical_top_m ?? 0, 4),
  })[name] ?? whole);

  /** Text of an allowed range, rounded so that it is never wider. */
  const rangeText = ({ label, low, high, unit }) => {
    const [least, most] = [Math.ceil(low * 100 - 1e-6) / 100, Math.floor(high * 100 + 1e-6) / 100];
    return ` ${spelt.labels[label]}: ${fixed(least, 2)}, ${fixed(most, 2)} ${unit}.`;
  };

  const show = () => {
    try {
      const result = quantityOf(tank, covariance, given());
      showResult(result);
      remark.textContent = result.steps.opening ? spelt.sentences.fine : spelt.sentences.opening_blank;
      remark.className = "answer";
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      table.replaceChildren();
      remark.textContent = `${spelt.columns[refusal.place]}: ${spoken.refused} ${sentenceOf(refusal.key)}`
        + (refusal.range ? rangeText(refusal.range) : "");
      remark.className = "answer refused";
    }
  };

  const form = document.getElementById("quantity");
  const heading = (place) => spelt.columns[place];
  form.append(
    make("summary", spelt.headings.title),
    group(spelt.columns.product, [...PRODUCT, "insulated"].map((key) => field(key))),
    ...["opening", "closing"].map((place) => group(`${spelt.headings.gauging}: ${heading(place)}`,
      GAUGING.map((key) => field(key, `${key}-${place}`)))),
    group(spelt.headings.uncertainty, tank.u.map(([key]) => field(key))),
    remark,
    table,
    make("p", spelt.notes.steps, { className: "note" }),
    make("p", spelt.notes.uncertainty, { className: "note" }),
  );
  for (const [key, value] of tank.u) {
    if (value !== null) fields[key].value = String(value).replace(".", marks.decimal);
  }
  form.hidden = false;
  show();
}
