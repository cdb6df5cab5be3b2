"use strict";
// The page of `birefit view`: asks the program that serves it for pictures and shows them. All text of others goes in by
// textContent.

const at = (id) => document.getElementById(id);
const client = (self.crypto && crypto.randomUUID) ? crypto.randomUUID() : String(Math.random()).slice(2);

// ---- the program behind the page ---------------------------------------------------------------------------------------

class Refused extends Error {}

const ask = async (path, body) => {
  const options = { headers: { "X-Client": client } };
  if (body !== undefined) {
    options.method = "POST";
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const reply = await fetch(path, options);
  if (reply.ok) return reply;
  let words = reply.statusText;
  try {
    words = (await reply.json()).error;
  } catch { /* not ours */ }
  const error = new Refused(words);
  error.status = reply.status;
  throw error;
};
const banner = (words) => {
  at("banner").textContent = words || "";
  at("banner").hidden = !words;
};
const say = (words) => { at("spoken").textContent = words; };

// ---- what is shown -------------------------------------------------------------------------------------------------------

const kSlow = 0.1;   // s a picture: beyond, it is made when the hand rests
const kRest = 160;   // ms without a change
let now = null;      // the description
let values = [];     // of the sliders
let item = 0;        // which picture or table
let seen = [];       // what is kept of each item: measured, sigma, range
let drawn = null;    // the last picture's header and numbers
let startChi = null;
let sight = null;
let line = null;
let bitmaps = null;
const counters = { pictures: 0, latency: [], painted: 0 };
self.birefitView = { counters, get values() { return values; }, get drawn() { return drawn; } };

const unitOf = (unit) => unit.replace(/\bum\b/, "µm").replace(/\bdeg\b/, "°");
const number = (v, digits = 5) => Number.isFinite(v) ? Draw.label(Number(v.toPrecision(digits))).replace("-", "−") : "–";
/** Chi-square is a number of pixels: its digits in groups, as far as they tell something. */
const grouped = (v) => Math.abs(v) < 1e4 || Math.abs(v) >= 1e12 ? number(v) : String(Math.round(v)).replace(/\B(?=(\d{3})+$)/g, "\u202f").replace("-", "−");
const short = (v) => Number(v.toPrecision(8));

const describe = async () => {
  const json = await (await ask("description")).json();
  const first = !now || !now.ready, before = now;
  now = json;
  banner("");
  at("work").hidden = !now.ready;
  if (self.begin) await self.begin.show(!now.ready);
  if (!now.ready) return;
  document.title = `${now.file} – birefit view`;
  at("file").textContent = now.file;
  if (!at("save-as").value || (before && before.file !== now.file)) at("save-as").value = now.save_as;
  const shape = (of) => JSON.stringify(of.parameters.map((p) => [p.name, p.lower, p.upper, p.prior]));
  if (first || shape(before) !== shape(now)) makeSliders();
  values = now.parameters.map((p) => p.value);
  if (first || before.items.map((i) => i.name + i.width).join() !== now.items.map((i) => i.name + i.width).join()) {
    item = 0;
    makeItems();
  }
  seen = [];
  startChi = null;
  showNotes();
  showResult();
  showRows();
  showSliders();
  stale();
  await choose(item);
};

const makeItems = () => {
  at("item").replaceChildren(...now.items.map((one, i) => new Option(one.name, i)));
  at("item-label").hidden = now.items.length < 2;
};

const choose = async (index) => {
  item = index;
  at("item").value = index;
  const one = now.items[item], n = one.width * one.height, kept = seen;
  if (!kept[index]) {
    const all = new Float32Array(await (await ask("measured", { item: index })).arrayBuffer());
    const measured = all.subarray(0, n), sigma = all.subarray(n);
    kept[index] = { measured, sigma, range: rangeOf(measured, sigma) };
  }
  if (kept !== seen || index !== item) return;  // described anew, or another was chosen, while this one was on its way
  const picture = one.kind === "picture";
  at("pictures").classList.toggle("table", !picture);
  at("hand").hidden = !picture;
  document.querySelector(".tools .group").hidden = !picture;
  at("chart-title").textContent = picture ? "profile along the line" : one.name;
  at("centre-tool").hidden = !picture || one.centre_x.parameter < 0 || one.centre_y.parameter < 0;
  if (picture && (!sight || sight.width !== one.width || sight.height !== one.height)) {
    sight = new Draw.Sight(one.width, one.height);
    bitmaps = [0, 1, 2].map(() => new Draw.Bitmap(one.width, one.height));
    line = diagonal(one);
  }
  if (picture) {
    const { measured, range } = seen[item];
    bitmaps[0].fill(measured, range[0], range[1], Draw.grey);
    for (const id of ["measured", "model", "residual"])
      at(id).setAttribute("aria-label", `${id === "measured" ? "measured picture" : id === "model" ? "picture of the model" : "measured less model"}, ${one.width} by ${one.height} pixels`);
  }
  drawn = null;
  recent = [];
  slow = false;
  draw(true);
};

/** Between crossed polarizers rows and columns through a sample's centre are dark: the profile begins as a diagonal. */
const diagonal = (one) => {
  const [x, y] = centreOf() || [(one.width - 1) / 2, (one.height - 1) / 2];
  const reach = Math.max(8, Math.min(x, y, one.width - 1 - x, one.height - 1 - y));
  const [x0, y0] = inside([x - reach, y + reach]), [x1, y1] = inside([x + reach, y - reach]);
  return { x0, y0, x1, y1 };
};

/** From the darkest to the brightest but for one in a thousand either way. */
const rangeOf = (all, sigma) => {
  const list = [], step = Math.max(1, Math.floor(all.length / 20000));
  for (let i = 0; i < all.length; i += step) if (all[i] === all[i] && sigma[i] === sigma[i]) list.push(all[i]);
  if (!list.length) return [0, 1];
  list.sort((a, b) => a - b);
  const place = (q) => list[Math.min(list.length - 1, Math.max(0, Math.round(q * (list.length - 1))))];
  const low = place(0.001), high = place(0.999);
  return high > low ? [low, high] : [low, low + 1];
};

// ---- asking for pictures -------------------------------------------------------------------------------------------------

let wanted = null, busy = false, rest = 0, slow = false, recent = [];

/** After a change: at once where pictures are quick, and once more, planned anew, when the hand rests. */
const draw = (settle) => {
  clearTimeout(rest);
  if (!seen[item]) return;  // what is measured is on its way, and the picture is asked for when it has come
  if (settle || !slow) {
    wanted = { item, values: values.slice(), settle, beside: seen[item] };
    pump();
  }
  if (!settle) rest = setTimeout(() => draw(true), kRest);
  if (!settle && slow && drawn) at("speed").textContent = `${seconds(drawn.header.seconds)} a picture: made when the hand rests`;
};

/** The latest question, on its way; null where nothing was asked since the last. */
const send = () => {
  if (!wanted) return null;
  const asked = wanted;
  wanted = null;
  if (asked.settle && slow) at("speed").textContent = "computing …";
  const { beside, ...question } = asked;
  const reply = ask("draw", question).then(async (answer) => (answer.status === 204 ? null : answer.arrayBuffer()));
  return { asked, reply: reply.catch((error) => error), begin: performance.now() };
};

const headerOf = (bytes) => JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, new DataView(bytes).getUint32(0, true))));

const pump = async () => {
  if (busy) return;
  busy = true;
  for (let sent = send(); sent;) {
    const { asked, reply, begin } = sent, bytes = await reply;
    if (bytes instanceof Error) {
      if (!(bytes instanceof Refused)) ended();
      else if (bytes.status === 409) taken(bytes.message);
      else banner(bytes.message);
      if (!(bytes instanceof Refused) || bytes.status === 409) break;
      sent = send();
      continue;
    }
    sent = send();  // the program makes the next while this one is painted
    if (!bytes || asked.beside !== seen[item]) continue;  // made for another picture, or for one that was described anew since
    const header = headerOf(bytes), model = new Float32Array(bytes, 4 + new DataView(bytes).getUint32(0, true));
    drawn = { header, values: asked.values, settle: asked.settle, model };
    recent = [...recent.slice(-2), header.render_seconds];
    slow = recent.every((s) => s > kSlow);  // one that other work has held up is none
    banner("");
    showPicture();
    counters.latency.push(performance.now() - begin);
    ++counters.pictures;
    if (!sent) {
      await new Promise(requestAnimationFrame);
      if (startChi === null) await weighStart();
      sent = send();
    }
  }
  busy = false;
};

/** Chi-square where the user began, under the weights of now: a fit has changed them. */
const weighStart = async () => {
  const start = now.parameters.map((p) => p.start), kept = seen;
  let weighed = NaN;
  try {
    const bytes = await (await ask("draw", { item, values: start, settle: false })).arrayBuffer();
    if (bytes.byteLength) weighed = headerOf(bytes).chi_square;
  } catch { /* the next picture tells of it */ }
  if (kept !== seen) return;  // described anew: asked for once more
  startChi = weighed;
  if (drawn) showFigures();
};

const seconds = (s) => s < 0.0995 ? `${(1000 * s).toPrecision(2)} ms` : `${s.toPrecision(2)} s`;

const showFigures = () => {
  const { header } = drawn;
  if (!Number.isFinite(startChi) && now.parameters.every((p, j) => p.start === drawn.values[j])) startChi = header.chi_square;
  at("reduced").textContent = number(header.reduced_chi_square, 4);
  at("chi").textContent = grouped(header.chi_square);
  const change = startChi === null ? NaN : header.chi_square - startChi;
  at("change").textContent = Number.isNaN(change) ? "–" : Math.abs(change) <= 1e-9 * startChi ? "0" : (change > 0 ? "+" : "") + grouped(change);
  at("change").className = change < 0 ? "good" : change > 0 ? "bad" : "";
  at("linear").textContent = header.linear.length ? "solved: " + header.linear.map((p) => `${p.label} ${number(p.value)}`).join(", ") : "";
  at("speed").textContent = slow ? `${seconds(header.seconds)} a picture: made when the hand rests` : `${seconds(header.seconds)} a picture`;
  if (drawn.settle) say(`reduced chi-square ${number(header.reduced_chi_square, 4)}`);
};

let residual = null, residualRange = 1, residualInSigma = true;

const showPicture = () => {
  const one = now.items[item], { measured, sigma } = seen[item], { model } = drawn, n = model.length;
  if (!residual || residual.length !== n) residual = new Float32Array(n);
  residualInSigma = at("unit").value === "sigma";
  if (residualInSigma) for (let i = 0; i < n; ++i) residual[i] = (measured[i] - model[i]) / sigma[i];
  else for (let i = 0; i < n; ++i) residual[i] = sigma[i] === sigma[i] ? measured[i] - model[i] : NaN;
  showFigures();
  if (one.kind === "picture") {
    const step = Math.max(1, Math.floor(n / 4000)), list = [];
    for (let i = 0; i < n; i += step) if (residual[i] === residual[i]) list.push(Math.abs(residual[i]));
    list.sort((a, b) => a - b);
    const most = Math.max(list.length ? list[Math.floor(0.99 * (list.length - 1))] : 1, residualInSigma ? 3 : 1e-12);
    residualRange = Draw.nice(most, 1);
    const { range } = seen[item];
    bitmaps[1].fill(model, range[0], range[1], Draw.grey);
    bitmaps[2].fill(residual, -residualRange, residualRange, Draw.diverging);
  }
  paint();
};

// ---- painting ------------------------------------------------------------------------------------------------------------

const centreOf = () => {
  const one = now.items[item];
  if (one.kind !== "picture" || one.centre_x.parameter < 0 || one.centre_y.parameter < 0) return null;
  const place = (of) => of.times * values[of.parameter] + of.plus;
  return [place(one.centre_x), place(one.centre_y)];
};

let painting = 0;
const paint = () => {
  if (!painting) painting = requestAnimationFrame(() => {
    painting = 0;
    paintNow();
  });
};
const paintNow = () => {
  if (!now || !now.ready || !seen[item]) return;
  const one = now.items[item];
  if (one.kind === "picture") {
    const unit = residualInSigma ? " σ" : "";
    ["measured", "model", "residual"].forEach((id, i) => {
      const canvas = at(id), ratio = Draw.fit(canvas, canvas.clientWidth * Math.min(1.25, one.height / one.width));
      canvas.style.height = `${canvas.height / ratio}px`;
      if (i === 0 || drawn) Draw.show(canvas, bitmaps[i], sight);
      else canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
      Draw.marks(canvas, sight, line, i === 2 ? null : centreOf(), ratio);
      if (i === 0) Draw.scaleBar(canvas, sight, one.pixel_um, ratio);
      const [low, high] = canvas.parentNode.querySelectorAll(".bar span"), { range } = seen[item];
      low.textContent = i < 2 ? number(range[0], 4) : `−${number(residualRange)}${unit}`;
      high.textContent = i < 2 ? number(range[1], 4) : `+${number(residualRange)}${unit}`;
    });
  }
  if (drawn) Draw.chart(at("chart"), one.kind === "picture" ? profile(one) : wholeTable(one));
  ++counters.painted;
};

const wholeTable = (one) => {
  const { measured, sigma } = seen[item], x = one.x || Array.from(measured, (_, i) => i + 1);
  at("chart").setAttribute("aria-label", `${one.y_label} against ${one.x_label}, ${x.length} rows, measured and by the model`);
  return { x, measured, model: drawn.model, residual, sigma, points: true, inValues: !residualInSigma, xLabel: one.x_label, yLabel: one.y_label };
};

/** Means of the four pixels around each place of the line, a place a pixel. */
const profile = (one) => {
  const { measured, sigma } = seen[item], w = one.width, h = one.height;
  const length = Math.hypot(line.x1 - line.x0, line.y1 - line.y0), n = Math.max(2, Math.round(length) + 1);
  const um = one.pixel_um > 0 ? one.pixel_um : 0;
  const data = { x: [], measured: [], model: [], residual: [], xLabel: um ? "along the line (µm)" : "along the line (px)", inValues: !residualInSigma };
  const take = (list, x, y) => {
    const i = Math.min(w - 1, Math.max(0, Math.floor(x))), j = Math.min(h - 1, Math.max(0, Math.floor(y)));
    const i1 = Math.min(w - 1, i + 1), j1 = Math.min(h - 1, j + 1), f = Math.min(1, Math.max(0, x - i)), g = Math.min(1, Math.max(0, y - j));
    const value = (p, q) => list[q * w + p];
    const along = (q) => f === 0 ? value(i, q) : (1 - f) * value(i, q) + f * value(i1, q);
    return g === 0 ? along(j) : (1 - g) * along(j) + g * along(j1);
  };
  for (let k = 0; k < n; ++k) {
    const t = k / (n - 1), x = line.x0 + t * (line.x1 - line.x0), y = line.y0 + t * (line.y1 - line.y0);
    data.x.push(t * length * (um || 1));
    data.measured.push(take(measured, x, y));
    data.model.push(take(drawn.model, x, y));
    data.residual.push(take(residual, x, y));
  }
  at("chart").setAttribute("aria-label", `profile from column ${number(line.x0)}, row ${number(line.y0)} to column ${number(line.x1)}, row ${number(line.y1)}: measured, model and residual`);
  return data;
};

// ---- parameters ----------------------------------------------------------------------------------------------------------

const makeSliders = () => {
  const rows = now.parameters.map((p, j) => {
    const row = document.createElement("div");
    row.className = "slider";
    const make = (tag, name, text) => {
      const made = document.createElement(tag);
      if (name) made.className = name;
      if (text !== undefined) made.textContent = text;
      return made;
    };
    const label = make("label", "", p.label.replace(/_(um|deg|px|v|k|nm|mm|s|rad|pn)(?=$|[.[ ])/, "").replaceAll("_", " ").replace(/\.([xyz])$/, ", $1"));
    label.title = p.name;
    label.htmlFor = `p${j}`;
    const box = make("input"), range = make("input"), unit = make("span", "unit", unitOf(p.unit));
    Object.assign(box, { type: "number", step: "any", min: p.lower, max: p.upper });
    box.setAttribute("aria-label", `${label.textContent}, ${p.unit || "pure number"}, as a number`);
    Object.assign(range, { type: "range", id: `p${j}`, step: "any", min: p.lower, max: p.upper });
    const span = p.upper - p.lower, step = Number.isFinite(span) ? Draw.nice(span, 1000) : 1e-3;
    range.step = "any";
    // Browsers move a slider of any step by a tenth of its length a key: too much for a fringe.
    range.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 20, PageDown: -20 }[event.key];
      if (!by) return;
      event.preventDefault();
      set(j, values[j] + by * step * (event.shiftKey ? 10 : 1));
    });
    range.addEventListener("input", () => set(j, short(Math.round(Number(range.value) / (step / 10)) * (step / 10))));
    box.addEventListener("change", () => box.value === "" ? showSliders() : set(j, Number(box.value)));
    const name = make("div", "name"), value = make("span", "value"), ends = make("div", "ends");
    value.append(box, unit);
    name.append(label, value);
    ends.append(make("span", "", number(p.lower)), make("span", "", p.prior ? "has a prior: fits and configs keep its centre" : ""), make("span", "", number(p.upper)));
    row.append(name, range, ends, make("p", "fitted"));
    return row;
  });
  at("sliders").replaceChildren(...rows);
};

const set = (j, value) => {
  const p = now.parameters[j];
  if (!Number.isFinite(value)) return showSliders();
  values[j] = short(Math.min(p.upper, Math.max(p.lower, value)));
  showSliders();
  paint();
  draw(false);
  stale();
};

const showSliders = () => {
  [...at("sliders").children].forEach((row, j) => {
    const p = now.parameters[j], [box, range] = [row.querySelector("[type=number]"), row.querySelector("[type=range]")];
    if (document.activeElement !== box || Number(box.value) !== values[j]) box.value = String(Number(values[j].toPrecision(7)));
    range.value = values[j];
    range.setAttribute("aria-valuetext", `${number(values[j], 6)} ${p.unit}`);
    const found = now.result && now.result.parameters.find((q) => q.name === p.name);
    row.querySelector(".fitted").textContent = !found ? "" : found.limit ? `fitted: ${found.limit} limit ${found.limit_text}`
      : `fitted: ${found.text} ± ${found.error_text}  [95 %: ${found.low_text} .. ${found.high_text}]`;
  });
};

/** What was computed for other values is asked for anew when it is looked at. */
const stale = () => {
  if (at("config-box").open) later("config", showConfig);
  if (at("words-box").open) {
    ++asked.words;
    at("words").textContent = "for other values: close and open this to ask anew";
  }
};
/** Which question of each was the last: an earlier one's answer may come later. */
const asked = { words: 0, config: 0 };
const waiting = {};
const later = (name, what) => {
  clearTimeout(waiting[name]);
  waiting[name] = setTimeout(what, 300);
};
const fill = async (id, path) => {
  const mine = ++asked[id];
  let text;
  try {
    text = await (await ask(path, { values })).text();
  } catch (error) {
    text = error.message;
  }
  if (mine === asked[id]) at(id).textContent = text;
};
const showConfig = () => fill("config", "config");
const showWords = () => {
  at("words").textContent = "computing …";
  return fill("words", "words");
};

const showNotes = () => {
  at("notes-box").hidden = !now.notes.length;
  at("notes").replaceChildren(...now.notes.map((words) => Object.assign(document.createElement("li"), { textContent: words })));
};

const showResult = () => {
  at("result").hidden = !now.result;
  if (!now.result) return;
  const { grade, answer, misfit, verdict, departures } = now.result;
  at("grade").textContent = grade;
  at("grade").className = `badge ${!answer ? "bad" : misfit.length ? "fair" : "good"}`;
  at("verdict").textContent = verdict + (departures ? ` The fit also found ${departures} departures of the picture from the model, which the pictures here are without.` : "");
  say(`fit ended: ${grade}`);
};

const showRows = () => {
  at("rows").hidden = !now.columns.length;
  if (!now.columns.length) return;
  const row = (tag, cells) => {
    const tr = document.createElement("tr");
    tr.append(...cells.map((text) => Object.assign(document.createElement(tag), { textContent: text })));
    return tr;
  };
  at("rows").querySelector("thead").replaceChildren(row("th", now.columns));
  at("rows").querySelector("tbody").replaceChildren(...now.rows.map((cells) => row("td", cells)).reverse());
};

// ---- the hand in the pictures ----------------------------------------------------------------------------------------------

const hand = () => document.querySelector("[name=hand]:checked").value;
const place = (canvas, event) => {
  const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
  return sight.from(canvas, (event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio);
};
const inside = ([x, y]) => [Math.min(sight.width - 1, Math.max(0, x)), Math.min(sight.height - 1, Math.max(0, y))];
const inFile = (one, x, y) => [x * one.bin + one.x0 + (one.bin - 1) / 2, y * one.bin + one.y0 + (one.bin - 1) / 2];

const setCentre = ([x, y]) => {
  const one = now.items[item];
  for (const [of, v] of [[one.centre_x, x], [one.centre_y, y]]) {
    const p = now.parameters[of.parameter];
    values[of.parameter] = short(Math.min(p.upper, Math.max(p.lower, (v - of.plus) / of.times)));
  }
  showSliders();
  paint();
  draw(false);
  stale();
};

const watchPictures = () => {
  for (const canvas of document.querySelectorAll(".pictures canvas")) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      from = place(canvas, event);
      if (hand() === "centre") setCentre(from);
      if (hand() === "line") {
        const [x, y] = inside(from);
        line = { x0: x, y0: y, x1: x, y1: y };
      }
    });
    canvas.addEventListener("pointermove", (event) => {
      const here = place(canvas, event);
      tell(here);
      if (!from) return;
      if (hand() === "move") sight.move(from[0] - here[0], from[1] - here[1]);
      else if (hand() === "line") [line.x1, line.y1] = inside(here);
      else setCentre(here);
      paint();
    });
    const end = () => {
      if (from && Math.hypot(line.x1 - line.x0, line.y1 - line.y0) < 2) line = { x0: 0, y0: line.y0, x1: sight.width - 1, y1: line.y0 };
      from = null;
      paint();
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("pointerleave", () => { at("pointer").textContent = "\u00a0"; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      sight.zoom(Math.exp(-event.deltaY * (event.deltaMode === 1 ? 0.05 : 0.0016)), ...place(canvas, event));
      paint();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      if (hand() !== "move") return;
      sight.reset();
      paint();
    });
    canvas.addEventListener("keydown", (event) => {
      if (keyed(event)) event.preventDefault();
    });
  }
};

const keyed = (event) => {
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  const by = event.shiftKey ? 10 : 1;
  if (arrow && hand() === "move") sight.move(arrow[0] * by * sight.width / sight.times / 20, arrow[1] * by * sight.height / sight.times / 20);
  else if (arrow && hand() === "line") {
    [line.x0, line.y0] = inside([line.x0 + arrow[0] * by, line.y0 + arrow[1] * by]);
    [line.x1, line.y1] = inside([line.x1 + arrow[0] * by, line.y1 + arrow[1] * by]);
  } else if (arrow) {
    const [x, y] = centreOf();
    setCentre([x + 0.1 * arrow[0] * by, y + 0.1 * arrow[1] * by]);
  } else if (event.key === "+" || event.key === "=") sight.zoom(1.4);
  else if (event.key === "-") sight.zoom(1 / 1.4);
  else if (event.key === "0") sight.reset();
  else if (event.key === "[" || event.key === "]") {
    const turn = (event.key === "[" ? 5 : -5) * Math.PI / 180, x = (line.x0 + line.x1) / 2, y = (line.y0 + line.y1) / 2;
    const dx = (line.x1 - line.x0) / 2, dy = (line.y1 - line.y0) / 2, c = Math.cos(turn), s = Math.sin(turn);
    [line.x0, line.y0] = inside([x - c * dx - s * dy, y - c * dy + s * dx]);
    [line.x1, line.y1] = inside([x + c * dx + s * dy, y + c * dy - s * dx]);
  } else return false;
  paint();
  return true;
};

const tell = ([x, y]) => {
  const one = now.items[item], i = Math.round(x), j = Math.round(y);
  if (i < 0 || j < 0 || i >= one.width || j >= one.height || !drawn || !seen[item]) {
    at("pointer").textContent = "\u00a0";
    return;
  }
  const k = j * one.width + i, [column, row] = inFile(one, i, j);
  at("pointer").textContent = `column ${number(column, 6)}, row ${number(row, 6)}:  measured ${number(seen[item].measured[k])}, model ${number(drawn.model[k])}, residual ${number(residual[k], 3)}${residualInSigma ? " σ" : ""}`;
};

// ---- fits and configs --------------------------------------------------------------------------------------------------------

const act = async (what) => {
  try {
    await what();
  } catch (error) {
    if (error instanceof Refused) banner(error.message);
    else ended();
  }
};

const running = (is) => {
  at("fit").hidden = is;
  at("stop").hidden = !is;
};

const watchButtons = () => {
  at("item").addEventListener("change", () => act(() => choose(Number(at("item").value))));
  at("unit").addEventListener("change", () => drawn && seen[item] && showPicture());
  at("zoom-in").addEventListener("click", () => { sight.zoom(1.4); paint(); });
  at("zoom-out").addEventListener("click", () => { sight.zoom(1 / 1.4); paint(); });
  at("whole").addEventListener("click", () => { sight.reset(); paint(); });
  for (const radio of document.querySelectorAll("[name=hand]"))
    radio.addEventListener("change", () => {
      for (const canvas of document.querySelectorAll(".pictures canvas")) canvas.classList.toggle("cross", hand() !== "move");
    });
  at("sliders").addEventListener("submit", (event) => event.preventDefault());
  at("reset").addEventListener("click", () => {
    values = now.parameters.map((p) => p.start);
    showSliders();
    draw(true);
    stale();
  });
  at("fit").addEventListener("click", () => act(async () => {
    await ask("fit", { values });
    running(true);
    at("log-box").open = true;
    at("stop").focus();
  }));
  at("stop").addEventListener("click", () => act(() => ask("stop", {})));
  at("words-box").addEventListener("toggle", () => at("words-box").open && showWords());
  at("config-box").addEventListener("toggle", () => at("config-box").open && showConfig());
  let overwrite = "";
  at("save-as").addEventListener("input", () => { overwrite = ""; at("save-button").textContent = "Save"; });
  at("save").addEventListener("submit", async (event) => {
    event.preventDefault();
    const name = at("save-as").value;
    try {
      const { path } = await (await ask("save", { name, values, overwrite: overwrite === name })).json();
      at("saved").textContent = `saved: birefit fit ${path}`;
      overwrite = "";
      at("save-button").textContent = "Save";
    } catch (error) {
      at("saved").textContent = error.message;
      if (/is there already/.test(error.message)) {
        overwrite = name;
        at("save-button").textContent = "Overwrite";
      }
    }
  });
  addEventListener("resize", paint);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  addEventListener("pagehide", () => navigator.sendBeacon("leave", client));
  // A page that comes back from the browser's memory has been said goodbye for.
  addEventListener("pageshow", (event) => event.persisted && location.reload());
};

const listen = async () => {
  let state = -1, heard = 0;
  for (;;) {
    let news;
    try {
      news = await (await ask("news", { state, line: heard })).json();
    } catch (error) {
      if (error instanceof Refused && error.status === 409) return taken(error.message);
      return ended();
    }
    const rows = now.ready && news.rows_set !== now.rows_set;
    state = news.state;
    heard = news.line;
    if (news.lines.length) {
      at("log").append(news.lines.join("\n") + "\n");
      at("log").scrollTop = at("log").scrollHeight;
    }
    if (news.version !== now.version || rows) await act(describe);
    running(news.running);
  }
};

const ended = () => {
  if (at("work").inert) return;
  banner("birefit has ended: start it again in the terminal and open the address that it prints.");
  at("work").inert = true;
  // A line that was cut, a machine that slept: where it is there again, the page begins anew.
  setInterval(() => fetch("description", { headers: { "X-Client": client } })
    .then((reply) => (reply.ok || reply.status === 409) && location.reload(), () => {}), 3000);
};
const taken = (words) => {
  banner(`${words}.`);
  at("work").hidden = true;
  setTimeout(() => location.reload(), 4000);
};

const start = async () => {
  watchButtons();
  watchPictures();
  try {
    await describe();
  } catch (error) {
    return error instanceof Refused ? (error.status === 409 ? taken(error.message) : banner(error.message)) : ended();
  }
  running(now.running);
  listen();
};
start();
