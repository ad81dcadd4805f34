// The browser part of the app: it sends entries, and shows the answers of the server. It holds no
// state of a job but the text that is being typed. All texts come from the server.
import grid from "./grid.js";

const base = document.documentElement.dataset.base;
const texts = document.body.dataset;
const bar = document.getElementById("bar");
const job = document.getElementById("job");
const $ = (id) => document.getElementById(id);

function tell(text) {
  bar.textContent = text ?? "";
  bar.hidden = !text;
}

// ---- requests; an entry waits for the server if it does not answer

const pending = [];
const client = Math.random().toString(36).slice(2);  // edits of this page do not contradict each other
let sending = false;

async function request(address, options = {}) {
  const answer = await fetch(address, { credentials: "same-origin", ...options });
  const kind = answer.headers.get("content-type") ?? "";
  const content = kind.includes("json") ? await answer.json() : await answer.text();
  if (!answer.ok) throw Object.assign(new Error(content.error ?? texts.failed), { status: answer.status, isStranger: answer.status === 403 && !kind.includes("json") });
  return content;
}

function send(content, take) {
  pending.push({ content, take });
  if (!sending) flush();
}

async function flush() {
  sending = true;
  while (pending.length) {
    const { content, take } = pending[0];
    try {
      if (shown.desk === null) await renewEntries();
      const body = JSON.stringify({ ...content, client, since: shown.revision, desk: shown.desk });
      const headers = { "content-type": "application/json" };
      const answer = await request(`${job.dataset.job}/act`, { method: "POST", headers, body });
      pending.shift();
      tell("");
      takeState(answer);
      take?.(answer);
    } catch (error) {
      if (error.status === 412) shown.desk = null;
      else if (error.status && !error.isStranger) {
        pending.shift();
        tell(error.message);
        shown.revision = -1;
        await refresh();
      } else {
        tell(error.isStranger ? texts.restarted : texts.offline);
        await new Promise((done) => setTimeout(done, 2000));
      }
    }
  }
  sending = false;
}

// After a restart of the server, entries apply if the rest of their table has not changed.
async function renewEntries() {
  const state = await request(`${job.dataset.job}/changes?since=-1&name=${encodeURIComponent(shown.name ?? "")}`);
  const entered = new Set(pending.flatMap(({ content: { action } }) => action.changes ?? []).map(([row, column]) => `${row},${column}`));
  const columns = model?.content.columns.map((item) => item.name);
  const compared = (rows) => JSON.stringify(rows.map((cells, row) => cells.filter((_, place) => !entered.has(`${row},${columns[place]}`))));
  const isSame = !model || (state.rows && compared(state.rows) === compared(model.content.rows));
  for (const { content } of pending) content.revision = isSame ? state.revision : -1;
  shown.desk = state.desk;
}

// Entries that are on their way arrive before the page is left.
function whenSent(act) { if (pending.length) setTimeout(whenSent, 50, act); else act(); }
for (const kind of ["click", "submit"]) {
  document.addEventListener(kind, (event) => {
    const target = kind === "click" ? event.target.closest?.("a[href]") : event.target;
    if (!pending.length || !target) return;
    event.preventDefault();
    whenSent(() => kind === "click" ? target.click() : target.requestSubmit(event.submitter));
  }, true);
}
window.addEventListener("beforeunload", (event) => { if (pending.length) event.preventDefault(); });

// ---- state of the job: saved, Undo, Redo, problems

const shown = { revision: job ? Number(job.dataset.revision) : 0, desk: job?.dataset.desk, name: null, take: null };

function takeState(state) {
  shown.revision = state.revision;
  const words = job.dataset;
  for (const [id, name] of [["undo", state.undo], ["redo", state.redo]]) {
    $(id).disabled = !name;
    $(id).title = name;
    $(id).setAttribute("aria-label", name ? `${words[id]}: ${name}` : words[id]);
  }
  $("saved").textContent = state.refusal || (state.is_changed ? words.unsaved : words.saved);
  $("autosave").checked = state.is_autosaved;
  $("count").textContent = !state.is_checked ? words.checking
    : state.problems || state.warnings
      ? words.count.replace("{problems}", state.problems).replace("{warnings}", state.warnings)
      : words.nothing;
  $("count").className = state.problems ? "state draft" : state.warnings ? "state stale" : "state computed";
  takeRun(state.run);
}

async function refresh() {
  const name = shown.name ? `&name=${encodeURIComponent(shown.name)}` : "";
  try {
    const state = await request(`${job.dataset.job}/changes?since=${shown.revision}${name}`);
    if (pending.length && (!sending || state.desk !== shown.desk)) return;
    if (state.desk !== shown.desk) { Object.assign(shown, { desk: state.desk, revision: -1 }); await refresh(); return; }
    takeState(state);
    shown.take?.(state);
  } catch { /* the next event asks again */ }
}

function listenToEvents() {
  const events = new EventSource(`${job.dataset.job}/events`);
  events.onmessage = () => { if (!pending.length) refresh(); };
  events.onerror = () => {
    const isRefused = events.readyState === EventSource.CLOSED;
    tell(isRefused ? texts.restarted : texts.offline);
    if (isRefused) setTimeout(listenToEvents, 2000);
  };
  events.onopen = () => { tell(""); refresh(); };
  window.addEventListener("pagehide", () => events.close());
}

function listenToJob() {
  listenToEvents();
  for (const kind of ["undo", "redo", "save"]) {
    $(kind).addEventListener("click", () => act({ kind }));
  }
  $("autosave").addEventListener("change", (event) => act({ kind: "autosave", value: event.target.checked }));
}

function act(action) {
  send({ name: shown.name, action, revision: shown.revision }, shown.take);
}

// ---- form of the settings

function listenToForm() {
  const fields = [...document.querySelectorAll("[data-section]")];
  if (!fields.length) return;
  shown.name = "job";
  const typed = new Set();
  for (const field of fields) {
    field.addEventListener("input", () => typed.add(field));
    field.addEventListener("change", () => {
      const { section, key } = field.dataset;
      typed.delete(field);
      act({ kind: "setting", section, key, text: field.value });
      // Another kind of tank has other settings.
      if (section === "tank" && key === "kind") send({ action: { kind: "save" } }, () => location.reload());
    });
  }
  shown.take = (state) => {
    for (const [name, [text, level, problem]] of Object.entries(state.fields ?? {})) {
      const field = $(`f-${name}`);
      if (!field) continue;
      const { section, key } = field.dataset;
      const isSent = pending.every(({ content: { action } }) => action.section !== section || action.key !== key);
      if (isSent && !typed.has(field) && field.value !== text) field.value = text;
      field.closest(".field").className = `field ${level}`;
      field.toggleAttribute("aria-invalid", level === "bad");
      if (level === "bad") field.setAttribute("aria-invalid", "true");
      $(`p-${name}`).textContent = problem;
    }
  };
}

function openTarget() {
  const target = location.hash.length > 1 ? $(decodeURIComponent(location.hash.slice(1))) : null;
  if (!target?.classList.contains("field")) return;
  const fold = target.closest("details");
  if (fold) fold.open = true;
  target.scrollIntoView({ block: "center" });
  target.querySelector("input, select").focus();
}

// ---- grid of a table

class Model {
  constructor(content) {
    this.content = content;
    this.listeners = new Map();
  }
  get(name) { return this.content[name]; }
  on(event, act) { this.listeners.set(event, [...(this.listeners.get(event) ?? []), act]); }
  tell(event, message) { for (const act of this.listeners.get(event) ?? []) act(message); }
  send(action) { act(action); }
  take(state) {
    const marks = state.marks ?? this.mend(state.entered);
    if (state.rows) {
      Object.assign(this.content, state);
      const columns = state.columns.map((item) => item.name);
      // Entries that are on their way remain visible.
      for (const { content: { action } } of pending) {
        for (const [row, column, text] of action.changes ?? []) {
          if (state.rows[row]) state.rows[row][columns.indexOf(column)] = text;
        }
      }
      this.tell("change:rows");
    } else if (state.cells) {
      for (const [row, column, text] of state.cells) {
        if (this.content.rows[row]) this.content.rows[row][column] = text;
      }
      this.tell("msg:custom", { kind: "cells", cells: state.cells });
    }
    if (marks) {
      this.content.marks = marks;
      this.tell("change:marks");
    }
  }
  // Marks of entered cells by their fields, until the full check.
  mend(entered) {
    if (!entered?.length) return null;
    const places = new Set(entered.map(([row, column]) => `${row},${column}`));
    const others = this.content.marks.filter(([row, column]) => !places.has(`${row},${column}`));
    return [...others, ...entered.filter((mark) => mark[2])];
  }
}

let model = null;

async function showGrid(place) {
  shown.name = place.dataset.grid;
  try {
    const content = await request(`${job.dataset.job}/grid/${encodeURIComponent(shown.name)}`);
    shown.revision = content.revision;
    model = new Model(content);
    place.replaceChildren();
    grid.render({ model, el: place });
    shown.take = (state) => model.take(state);
    const [row, column] = location.hash.slice(1).split(",");
    const columns = content.columns.map((item) => item.name);
    if (row) model.tell("msg:custom", { kind: "go", row: Number(row), column: Math.max(0, columns.indexOf(decodeURIComponent(column ?? ""))) });
  } catch (error) { tell(error.message); }
}

// ---- run

let lastRun = null;

function takeRun(run) {
  const place = $("run");
  if (!place) return;
  const isActive = run && ["waiting", "running"].includes(run.state);
  if (lastRun === null) lastRun = place.dataset.state;
  if (run && run.state !== lastRun && !(isActive && lastRun)) { location.reload(); return; }
  lastRun = run?.state ?? "";
  if (!isActive) return;
  $("progress").hidden = false;
  $("step").textContent = run.text;
  if (run.share === null) $("share").removeAttribute("value");
  else $("share").value = run.share;
}

// ---- files

const MOST_FILES = 2000;  // as in folders.py

// Files of a folder with their paths, without hidden files.
async function readFolder(entry, path, files) {
  if (entry.name.startsWith(".") || files.length > MOST_FILES) return files;
  if (entry.isFile) files.push([path, await new Promise((done, fail) => entry.file(done, fail))]);
  else for (const reader = entry.createReader(); ;) {
    const items = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!items.length) break;
    for (const item of items) await readFolder(item, `${path}/${item.name}`, files);
  }
  return files;
}

function listenToDrop(place) {
  const [input, folder] = place.querySelectorAll("input");
  const status = place.querySelector("[role=status]");
  const take = async (file, isFolder = false) => {
    if (!file) return;
    if (file.size > 200e6) { status.textContent = texts.tooLarge; return; }
    status.textContent = texts.sending.replace("{file}", file.name);
    const address = new URL(place.dataset.drop, location.href);
    address.searchParams.set("name", file.name);
    if (isFolder) address.searchParams.set("folder", "yes");
    try {
      const answer = await request(address, { method: "POST", body: file });
      location.assign(answer.address);
    } catch (error) { status.textContent = error.message; }
  };
  // A list of the paths and sizes, and the contents of the files behind it.
  const takeFolder = (files) => {
    if (files.length > MOST_FILES) { status.textContent = texts.tooLarge; return; }
    const list = JSON.stringify(files.map(([path, file]) => [path, file.size]));
    take(new File([list, "\n", ...files.map(([, file]) => file)], files[0]?.[0].split("/")[0] ?? "-"), true);
  };
  const takeAll = (files) => (files.length > 1 ? takeFolder([...files].map((file) => [file.name, file])) : take(files[0]));
  input.addEventListener("change", () => takeAll(input.files));
  if (!("webkitdirectory" in folder)) status.textContent = texts.noFolder;
  folder.addEventListener("change", () => takeFolder([...folder.files].map((file) => [file.webkitRelativePath, file])));
  place.addEventListener("dragover", (event) => { event.preventDefault(); place.classList.add("over"); });
  place.addEventListener("dragleave", () => place.classList.remove("over"));
  place.addEventListener("drop", (event) => {
    event.preventDefault();
    place.classList.remove("over");
    const entry = event.dataTransfer.items[0]?.webkitGetAsEntry?.();
    if (entry?.isDirectory) readFolder(entry, entry.name, []).then(takeFolder, (error) => tell(error.message));
    else takeAll(event.dataTransfer.files);
  });
}

// ---- keyboard

function goToProblem(step) {
  if (model) { model.tell("msg:custom", { kind: "next", step }); return; }
  const marked = [...document.querySelectorAll(".field.bad, .field.doubtful")];
  if (!marked.length) { if (job) whenSent(() => location.assign(`${job.dataset.job}/problems`)); return; }
  const now = marked.indexOf(document.activeElement.closest?.(".field"));
  const next = marked[(now + step + marked.length) % marked.length];
  const fold = next.closest("details");
  if (fold) fold.open = true;
  next.querySelector("input, select").focus();
}

document.addEventListener("keydown", (event) => {
  const isTyping = event.target.matches?.("input, select, textarea, [role=grid]");
  const isFar = event.ctrlKey || event.metaKey;
  const key = event.key.toLowerCase();
  if (event.key === "?" && !isTyping) location.assign(`${base}/keys`);
  if (!job) return;
  if (event.key === "F8") goToProblem(event.shiftKey ? -1 : 1);
  else if (isFar && key === "s") { document.activeElement.blur?.(); act({ kind: "save" }); }
  else if (isFar && event.key === "Enter") {
    document.activeElement.blur?.();
    const start = $("start");
    if (start) start.requestSubmit(); else whenSent(() => location.assign(`${job.dataset.job}/results`));
  } else if (isFar && !event.shiftKey && key === "z" && !event.target.matches("input")) act({ kind: "undo" });
  else if (isFar && (key === "y" || (event.shiftKey && key === "z")) && !event.target.matches("input")) act({ kind: "redo" });
  else if (event.altKey && /^[1-9]$/.test(event.key)) document.querySelectorAll("nav li a")[event.key - 1]?.click();
  else return;
  event.preventDefault();
});

// ---- parts of all pages

for (const place of document.querySelectorAll("[data-submit]")) {
  place.addEventListener("change", () => place.form.requestSubmit());
}
for (const place of document.querySelectorAll("[data-drop]")) listenToDrop(place);
for (const form of document.querySelectorAll("[data-new]")) {
  const choose = () => {
    const kind = form.elements.kind.value;
    for (const line of form.querySelectorAll("[data-kinds]")) {
      line.hidden = !line.dataset.kinds.split(" ").includes(kind);
      if (line.hidden && line.querySelector("input").checked) form.elements.survey[0].checked = true;
    }
  };
  form.addEventListener("change", choose);
  choose();
}
function listenToSearch(page) {
  const search = page.querySelector("[data-filter]");
  search?.addEventListener("input", () => {
    for (const row of $(search.dataset.filter).tBodies[0].rows) {
      row.hidden = !row.textContent.toLowerCase().includes(search.value.toLowerCase());
    }
  });
}
function replaceContent(place, html, id) {
  place.replaceChildren(...new DOMParser().parseFromString(html, "text/html").getElementById(id).childNodes);
}
listenToSearch(document);
for (const form of document.querySelectorAll("[data-live]")) {
  let asked = 0;
  form.addEventListener("input", ({ target }) => {
    const output = form.querySelector(`output[for="${target.id}"]`);
    if (output) output.textContent = Number(target.value).toFixed(2).replace(".", output.dataset.mark);
  });
  form.addEventListener("change", async ({ target }) => {
    if (target.type !== "range") return;
    const number = ++asked;
    try {
      const html = await request(`?${new URLSearchParams(new FormData(form))}`);
      if (number === asked) replaceContent($(form.dataset.live), html, form.dataset.live);
    } catch (error) { tell(error.message); }
  });
}
for (const place of document.querySelectorAll("[data-fragment]")) {
  request(place.dataset.fragment).then((html) => {
    replaceContent(place, html, "main");
    listenToSearch(place);
  }).catch((error) => { place.textContent = error.message; });
}
if (job) {
  listenToForm();
  listenToJob();
  openTarget();
  if ($("grid")) showGrid($("grid"));
}
