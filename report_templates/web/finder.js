// A long table: rows that contain what is typed, or those about a dip between two rows.

for (const box of document.querySelectorAll(".searchable")) {
  const field = box.querySelector("input");
  const told = box.querySelector("output");
  const frame = box.querySelector(".pieces");
  const pieces = [...box.querySelectorAll(".piece")];
  const rows = [...box.querySelectorAll("tbody tr")];
  let cells = null; // texts of each row, read when they are first needed

  const textsOf = (row) => [...row.cells].map((cell) => cell.textContent.trim());

  /** Numbers of the rows whose dip begins with the text, else of those that contain it. */
  const matching = (text) => {
    const all = [...cells.keys()];
    const byDip = all.filter((at) => cells[at][0].startsWith(text));
    if (byDip.length) return byDip;
    const between = neighbours(typedNumber(text));
    return between.length ? between : all.filter((at) => cells[at].some((one) => one.includes(text)));
  };

  /** The rows below and above a dip that is no row; none outside the table. */
  const neighbours = (dip) => {
    const above = cells.findIndex((row) => typedNumber(row[0]) > dip);
    return above > 0 ? [above - 1, above] : [];
  };

  const show = (found) => {
    const wanted = found && new Set(found);
    rows.forEach((row, at) => {
      const hide = wanted !== null && !wanted.has(at);
      if (row.hidden !== hide) row.hidden = hide;
    });
    for (const piece of pieces) {
      piece.hidden = wanted !== null && !piece.querySelector("tbody tr:not([hidden])");
    }
    frame.scrollTop = 0;
  };

  const search = () => {
    cells ??= rows.map(textsOf);
    const text = field.value.trim().replace(/[.,]/, marks.decimal);
    for (const row of box.querySelectorAll(".found")) row.classList.remove("found");
    const found = text ? matching(text) : null;
    show(found);
    told.textContent = !text ? "" : found.length
      ? sentence("found", { count: fixed(found.length, 0), all: fixed(rows.length, 0) })
      : sentence("not_found", { text: field.value.trim() });
    return found;
  };

  /** All rows again, with the first one found in the middle. */
  const jump = () => {
    const found = search();
    if (!found?.length) return;
    show(null);
    const row = rows[found[0]];
    row.classList.add("found");
    row.scrollIntoView({ block: "center" });
    requestAnimationFrame(() => row.scrollIntoView({ block: "center" }));
  };

  field.addEventListener("input", search);
  field.addEventListener("keydown", (event) => {
    if (event.key === "Enter") jump();
  });
  box.querySelector(".finder").hidden = false;
}
