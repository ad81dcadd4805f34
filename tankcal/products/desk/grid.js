// A table to be filled in by keyboard, mouse or paste from a spreadsheet. Only the rows that are
// in sight are in the page. Python holds the truth: what is typed goes there, and comes back as
// it was understood, with the marks of the check.
const ROW_PX = 26;
const AHEAD = 12;

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== false) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// The cells of a text as a spreadsheet copies it: tabs and lines, quotation marks round a cell
// that holds one of them.
function parseBlock(text) {
  const rows = [[]];
  let cell = "";
  let quoted = false;
  const plain = text.replace(/\r\n?/g, "\n").replace(/\n$/, "");
  for (let i = 0; i < plain.length; i++) {
    const char = plain[i];
    if (quoted) {
      if (char === '"' && plain[i + 1] === '"') { cell += '"'; i++; }
      else if (char === '"') quoted = false;
      else cell += char === "\n" ? " " : char;
    } else if (char === '"' && cell === "") quoted = true;
    else if (char === "\t") { rows[rows.length - 1].push(cell); cell = ""; }
    else if (char === "\n") { rows[rows.length - 1].push(cell); cell = ""; rows.push([]); }
    else cell += char;
  }
  rows[rows.length - 1].push(cell);
  return rows;
}

class Grid {
  constructor(model, el) {
    this.model = model;
    this.words = model.get("words");
    this.id = `tankcal-${Math.random().toString(36).slice(2)}`;
    this.active = [0, 0];
    this.anchor = [0, 0];
    this.input = null;
    this.build(el);
    this.take();
    const first = this.columns.findIndex((one) => one.is_edited);
    if (first > 0) this.moveTo(0, first);
    const quiet = new AbortController();
    this.stop = () => quiet.abort();
    this.listen(quiet.signal);
  }

  build(el) {
    const words = this.words;
    this.tools = element("div", { class: "tankcal-tools", role: "toolbar" });
    this.body = element("tbody");
    this.head = element("tr", { role: "row", "aria-rowindex": 1 });
    this.table = element("table", { role: "presentation" },
      element("thead", { role: "rowgroup" }, this.head), this.body);
    this.pane = element("div", { class: "tankcal-pane", tabindex: 0, role: "grid",
      "aria-label": this.model.get("label"), "aria-multiselectable": "true",
      "aria-describedby": `${this.id}-keys` }, this.table);
    this.status = element("div", { class: "tankcal-status", role: "status", "aria-live": "polite" });
    this.keys = element("div", { class: "tankcal-keys", id: `${this.id}-keys` }, words.keys);
    this.root = element("div", { class: "tankcal-grid", "data-lm-suppress-shortcuts": "true",
      "data-table": this.model.get("name") }, this.tools, this.pane, this.status, this.keys);
    el.append(this.root);
  }

  button(code, act) {
    const made = element("button", { type: "button", "data-act": code }, this.words[code]);
    made.addEventListener("click", () => { act(); this.pane.focus(); });
    return made;
  }

  buildTools() {
    this.tools.replaceChildren();
    if (this.locked) return;
    if (this.model.get("takes_rows")) {
      this.tools.append(
        this.button("add_row", () => this.send("insert", { row: this.rows.length, count: 1 })),
        this.button("insert_row", () => this.send("insert", { row: this.active[0], count: 1 })),
        this.button("remove_rows", () => this.removeRows()),
      );
    } else {
      const box = element("input", { type: "checkbox", "data-act": "every_key" });
      box.checked = this.model.get("every_key");
      box.addEventListener("change", () => this.send("every", { value: box.checked }));
      this.tools.append(element("label", {}, box, ` ${this.words.every_key}`));
    }
    const addable = this.model.get("addable");
    if (addable.length) {
      const choice = element("select", { "aria-label": this.words.add_column },
        element("option", { value: "" }, this.words.add_column),
        ...addable.map((name) => element("option", { value: name }, name)));
      choice.addEventListener("change", () => {
        if (choice.value) this.send("column", { name: choice.value });
      });
      this.tools.append(choice);
    }
    if (this.words.undo) this.tools.append(this.button("undo", () => this.send("undo", {})));
  }

  // ---- what is shown

  take() {
    this.rows = this.model.get("rows").map((row) => [...row]);
    this.columns = this.model.get("columns");
    // An added row is kept until Python has it, but not if Python refuses it.
    if (this.added && this.rows.length === this.added.row && this.added.times-- > 0) this.rows.push(this.blank());
    else this.added = null;
    this.locked = this.model.get("locked");
    this.buildTools();
    const heads = this.columns.map((one, place) => element("th", { role: "columnheader",
      scope: "col", title: one.note, "aria-colindex": place + 2, "data-column": one.name },
      element("span", { class: "tankcal-label" }, one.heading),
      element("span", { class: "tankcal-code" },
        one.heading === one.name || !this.model.get("takes_rows") || this.model.get("shows_units")
          ? one.unit : one.name)));
    this.head.replaceChildren(element("th", { role: "columnheader", class: "tankcal-number",
      "aria-colindex": 1 }, "#"), ...heads);
    this.pane.setAttribute("aria-rowcount", this.rows.length + 1);
    this.pane.setAttribute("aria-colcount", this.columns.length + 1);
    this.keep();
    this.takeMarks();
  }

  takeMarks() {
    this.marks = new Map();
    for (const [row, column, level, text] of this.model.get("marks")) {
      this.marks.set(`${row},${column}`, { level, text });
    }
    for (const [place, head] of [...this.head.children].slice(1).entries()) {
      const mark = this.marks.get(`null,${place}`);
      head.className = mark ? `tankcal-${mark.level}` : "";
      head.title = mark ? `${mark.text}\n${this.columns[place].note}` : this.columns[place].note;
    }
    const whole = this.marks.get("null,null");
    this.root.classList.toggle("tankcal-whole", Boolean(whole));
    this.draw();
    this.tell();
  }

  keep() {
    const inside = ([row, column]) => [
      Math.max(0, Math.min(row, this.rows.length - 1)),
      Math.max(0, Math.min(column, this.columns.length - 1)),
    ];
    this.active = inside(this.active);
    this.anchor = inside(this.anchor);
  }

  draw() {
    const first = Math.max(0, Math.floor(this.pane.scrollTop / ROW_PX) - AHEAD);
    const seen = Math.ceil((this.pane.clientHeight || 420) / ROW_PX) + 2 * AHEAD;
    const last = Math.min(this.rows.length, first + seen);
    const drawn = [];
    if (first > 0) drawn.push(this.spacer(first));
    for (let row = first; row < last; row++) drawn.push(this.line(row));
    if (last < this.rows.length) drawn.push(this.spacer(this.rows.length - last));
    const typed = this.input;
    const selection = typed?.matches(":focus") ? [typed.selectionStart, typed.selectionEnd] : null;
    this.input = null;  // its removal does not end the typing
    this.body.replaceChildren(...drawn);
    this.input = typed;
    if (typed) this.placeInput(typed);
    if (selection) {  // the next keys belong to the cell
      typed.focus({ preventScroll: true });
      typed.setSelectionRange(...selection);
    }
    this.pane.setAttribute("aria-activedescendant", this.cellId(...this.active));
  }

  spacer(count) {
    const made = element("tr", { "aria-hidden": "true" },
      element("td", { colspan: this.columns.length + 1, class: "tankcal-spacer" }));
    made.style.height = `${count * ROW_PX}px`;
    return made;
  }

  cellId(row, column) { return `${this.id}-${row}-${column}`; }

  line(row) {
    const ofRow = this.marks.get(`${row},null`);
    const number = element("th", { scope: "row", role: "rowheader", "aria-colindex": 1,
      class: `tankcal-number${ofRow ? ` tankcal-${ofRow.level}` : ""}`,
      title: ofRow ? ofRow.text : undefined }, String(row + 1));
    number.addEventListener("mousedown", () => this.selectRow(row));
    const made = element("tr", { role: "row", "aria-rowindex": row + 2 }, number);
    this.columns.forEach((one, column) => {
      const mark = this.marks.get(`${row},${column}`);
      const kinds = [];
      if (one.is_number) kinds.push("tankcal-right");
      if (!one.is_edited) kinds.push("tankcal-fixed");
      if (mark) kinds.push(`tankcal-${mark.level}`);
      if (this.isChosen(row, column)) kinds.push("tankcal-chosen");
      if (row === this.active[0] && column === this.active[1]) kinds.push("tankcal-active");
      made.append(element("td", { id: this.cellId(row, column), role: "gridcell",
        class: kinds.join(" "), "aria-colindex": column + 2, "data-row": row,
        "data-column": one.name, title: mark ? mark.text : undefined,
        "aria-invalid": mark && mark.level === "bad" ? "true" : undefined,
        "aria-selected": this.isChosen(row, column) ? "true" : "false",
        "aria-readonly": this.isFixed(column) ? "true" : undefined }, this.rows[row][column] ?? ""));
    });
    return made;
  }

  isFixed(column) { return this.locked || !this.columns[column]?.is_edited; }

  block() {
    const [rows, columns] = [0, 1].map((i) =>
      [Math.min(this.anchor[i], this.active[i]), Math.max(this.anchor[i], this.active[i])]);
    return { rows, columns };
  }

  isChosen(row, column) {
    const { rows, columns } = this.block();
    return row >= rows[0] && row <= rows[1] && column >= columns[0] && column <= columns[1];
  }

  // What ails the chosen cell, its row, its column or the table, in words below the grid.
  tell() {
    const [row, column] = this.active;
    const places = [`${row},${column}`, `${row},null`, `null,${column}`, "null,null"];
    const found = places.map((one) => this.marks.get(one)).filter(Boolean);
    const note = this.columns[column] ? this.columns[column].note : "";
    this.status.textContent = found.length ? found.map((one) => one.text).join("\n") : note;
    this.status.className = `tankcal-status${found.length ? ` tankcal-${found[0].level}` : ""}`;
  }

  // ---- what is done

  send(kind, content) { this.model.send({ kind, ...content }); }

  enter(changes) {
    const allowed = changes.filter(([row, column, text]) =>
      !this.isFixed(column) && this.rows[row] && this.rows[row][column] !== text);
    if (!allowed.length) return;
    for (const [row, column, text] of allowed) this.rows[row][column] = text;
    this.send("enter", { changes: allowed.map(([row, column, text]) =>
      [row, this.columns[column].name, text]) });
    this.draw();
  }

  removeRows() {
    const { rows } = this.block();
    const gone = [];
    for (let row = rows[0]; row <= rows[1]; row++) gone.push(row);
    if (this.rows.length) this.send("remove", { rows: gone });
  }

  clear() {
    const { rows, columns } = this.block();
    const changes = [];
    for (let row = rows[0]; row <= rows[1]; row++) {
      for (let column = columns[0]; column <= columns[1]; column++) changes.push([row, column, ""]);
    }
    this.enter(changes);
  }

  paste(text) {
    if (this.locked) return;
    const cells = parseBlock(text);
    const { rows, columns } = this.block();
    if (cells.length === 1 && cells[0].length === 1) {
      const changes = [];
      for (let row = rows[0]; row <= rows[1]; row++) {
        for (let column = columns[0]; column <= columns[1]; column++) {
          changes.push([row, column, cells[0][0]]);
        }
      }
      this.enter(changes);
      return;
    }
    this.send("paste", { row: rows[0], column: columns[0], cells });
  }

  copied() {
    const { rows, columns } = this.block();
    const quoted = (one) => (/[\t\n"]/.test(one) ? `"${one.replace(/"/g, '""')}"` : one);
    return this.rows.slice(rows[0], rows[1] + 1)
      .map((row) => row.slice(columns[0], columns[1] + 1).map(quoted).join("\t")).join("\n");
  }

  selectRow(row) {
    this.anchor = [row, 0];
    this.active = [row, this.columns.length - 1];
    this.draw();
    this.tell();
  }

  moveTo(row, column, isWider = false) {
    this.active = [row, column];
    if (!isWider) this.anchor = [row, column];
    this.keep();
    if (!isWider) this.anchor = [...this.active];
    const top = this.active[0] * ROW_PX;
    const high = this.pane.clientHeight - this.head.offsetHeight - ROW_PX;
    if (top < this.pane.scrollTop) this.pane.scrollTop = top;
    if (top > this.pane.scrollTop + high) this.pane.scrollTop = top - high;
    this.draw();
    const cell = document.getElementById(this.cellId(...this.active));
    if (cell) cell.scrollIntoView({ block: "nearest", inline: "nearest" });
    this.tell();
  }

  goTo(row, column) {
    this.moveTo(row, column);
    this.pane.focus();
  }

  // The next or the previous marked cell, from the chosen one on, cyclically.
  goToMark(step) {
    const width = this.columns.length;
    const places = [...this.marks.keys()].map((place) => place.split(",").map(Number))
      .filter(([row]) => !Number.isNaN(row))
      .map(([row, column]) => row * width + (Number.isNaN(column) ? 0 : column));
    places.sort((a, b) => a - b);
    if (!places.length) return;
    const now = this.active[0] * width + this.active[1];
    const next = step > 0 ? places.find((place) => place > now) ?? places[0]
      : places.findLast((place) => place < now) ?? places[places.length - 1];
    this.goTo(Math.floor(next / width), next % width);
  }

  blank() { return this.columns.map(() => ""); }

  // A blank row after the last, unless that is blank.
  addRow(column) {
    const count = this.rows.length;
    const isBlank = count && this.rows[count - 1].every((cell) => !cell);
    if (this.locked || isBlank || !this.model.get("takes_rows")) return false;
    this.added = { row: count, times: 2 };
    this.rows.push(this.blank());
    this.send("insert", { row: count, count: 1 });
    this.draw();
    this.moveTo(count, column);
    return true;
  }

  // ---- typing in a cell

  beginTyping(text) {
    const [row, column] = this.active;
    if (!this.rows.length) this.addRow(0);
    if (!this.rows.length || this.isFixed(column)) return;
    const input = element("input", { type: "text", class: "tankcal-input",
      "aria-label": this.columns[column].heading });
    input.value = text ?? this.rows[row][column];
    input.place = [row, column];
    this.input = input;
    input.addEventListener("keydown", (event) => this.keyInCell(event));
    input.addEventListener("blur", () => this.endTyping(true));
    this.placeInput(input);
    input.focus();
    if (text !== undefined) input.setSelectionRange(text.length, text.length);
  }

  placeInput(input) {
    const cell = document.getElementById(this.cellId(...input.place));
    if (cell && !cell.contains(input)) cell.replaceChildren(input);
  }

  endTyping(isKept) {
    const input = this.input;
    if (!input) return;
    this.input = null;
    const [row, column] = input.place;
    if (isKept) this.enter([[row, column, input.value.trim()]]);
    this.draw();
  }

  keyInCell(event) {
    event.stopPropagation();
    const [row, column] = this.active;
    const goals = { Enter: [row + (event.shiftKey ? -1 : 1), column],
      Tab: [row, column + (event.shiftKey ? -1 : 1)] };
    if (event.key === "Escape") {
      this.endTyping(false);
      this.pane.focus();
    } else if (goals[event.key]) {
      this.endTyping(true);
      this.pane.focus();
      const isBelow = event.key === "Enter" && goals.Enter[0] === this.rows.length;
      if (!isBelow || !this.addRow(column)) this.moveTo(...goals[event.key]);
    } else return;
    event.preventDefault();
  }

  key(event) {
    if (event.target !== this.pane) return;
    const [row, column] = this.active;
    const isFar = event.ctrlKey || event.metaKey;
    // Keys of the page around the grid, such as Ctrl+S; in a notebook they stay in the grid.
    const isOfPage = event.altKey || (isFar && ["s", "enter"].includes(event.key.toLowerCase()));
    if (isOfPage && this.model.get("passes_keys")) return;
    const page = Math.max(1, Math.floor(this.pane.clientHeight / ROW_PX) - 2);
    const goals = {
      ArrowUp: [isFar ? 0 : row - 1, column],
      ArrowDown: [isFar ? this.rows.length - 1 : row + 1, column],
      ArrowLeft: [row, isFar ? 0 : column - 1],
      ArrowRight: [row, isFar ? this.columns.length - 1 : column + 1],
      Home: [isFar ? 0 : row, 0],
      End: [isFar ? this.rows.length - 1 : row, this.columns.length - 1],
      PageUp: [row - page, column],
      PageDown: [row + page, column],
    };
    const isBelow = event.key === "ArrowDown" && !isFar && !event.shiftKey && row === this.rows.length - 1;
    if (isBelow && this.addRow(column)) this.tell();
    else if (goals[event.key]) this.moveTo(...goals[event.key], event.shiftKey);
    else if (event.key === "Enter" || event.key === "F2") this.beginTyping();
    else if (event.key === "F8") this.goToMark(event.shiftKey ? -1 : 1);
    else if (event.key === "Delete" || event.key === "Backspace") this.clear();
    else if (isFar && event.key.toLowerCase() === "z") this.send(event.shiftKey ? "redo" : "undo", {});
    else if (isFar && event.key.toLowerCase() === "y") this.send("redo", {});
    else if (isFar && event.key.toLowerCase() === "a") {
      this.anchor = [0, 0];
      this.moveTo(this.rows.length - 1, this.columns.length - 1, true);
    } else if (event.key.length === 1 && !isFar && !event.altKey) this.beginTyping(event.key);
    else {
      if (event.key !== "Tab") event.stopPropagation();
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }

  listen(signal) {
    const cellOf = (event) => event.target.closest?.("td[data-row]");
    const place = (cell) => [Number(cell.dataset.row), Number(cell.getAttribute("aria-colindex")) - 2];
    let dragging = false;
    this.pane.addEventListener("mousedown", (event) => {
      const cell = cellOf(event);
      if (!cell || event.target.tagName === "INPUT") return;
      this.endTyping(true);
      dragging = true;
      this.moveTo(...place(cell), event.shiftKey);
      this.pane.focus({ preventScroll: true });
      event.preventDefault();
    }, { signal });
    this.pane.addEventListener("mouseover", (event) => {
      const cell = cellOf(event);
      if (dragging && cell && event.buttons === 1) this.moveTo(...place(cell), true);
    }, { signal });
    document.addEventListener("mouseup", () => { dragging = false; }, { signal });
    this.pane.addEventListener("dblclick", (event) => { if (cellOf(event)) this.beginTyping(); });
    this.pane.addEventListener("keydown", (event) => this.key(event));
    this.pane.addEventListener("scroll", () => this.draw());
    this.pane.addEventListener("paste", (event) => {
      if (event.target.tagName === "INPUT") return;
      this.paste(event.clipboardData.getData("text/plain"));
      event.preventDefault();
      event.stopPropagation();
    });
    this.pane.addEventListener("copy", (event) => {
      if (event.target.tagName === "INPUT") return;
      event.clipboardData.setData("text/plain", this.copied());
      event.preventDefault();
      event.stopPropagation();
    });
    this.model.on("change:rows", () => this.take());
    this.model.on("change:marks", () => this.takeMarks());
    this.model.on("msg:custom", (message) => {
      if (message.kind === "go") this.goTo(message.row, message.column);
      if (message.kind === "next") this.goToMark(message.step);
      if (message.kind !== "cells") return;
      for (const [row, column, text] of message.cells) {
        if (this.rows[row]) this.rows[row][column] = text;
      }
      this.draw();
    });
  }
}

export default {
  render({ model, el }) {
    const grid = new Grid(model, el);
    return () => grid.stop();
  },
};
