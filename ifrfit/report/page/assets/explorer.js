"use strict";
// The interactive panel: sliders move the curve over the data. All numbers come from the page itself.
(() => {
  const $ = (name) => document.getElementById(`explorer-${name}`);
  const root = document.getElementById("explorer");
  if (!root) return;
  const data = JSON.parse($("data").textContent);
  const SLIDERS = ["e_n", "c", "mu", "spin_y", "spin_x"];
  const ANGLES = Array.from({ length: 179 }, (_, i) => 0.5 + i / 2);
  const angled = data.observables.map((o, i) => ({ ...o, index: i })).filter((o) => o.angled);
  const count = data.rows.value.length;

  // ---- state: what the controls say

  const state = { observable: angled[0].index, series: 0, closure: data.fitted, values: {} };
  const group = () => data.groups.find((g) => g.series.includes(state.series));
  const closure = () => data.closures[state.closure];

  function best() {
    const own = group().best;
    const constant = data.closures[data.fitted].constant;
    const series = data.series[state.series];
    return {
      e_n: own.e_n, c: constant ? own[constant] : 0, mu: own.mu,
      spin_y: series.spin_y, spin_x: series.spin_x,
    };
  }

  // the constant of another closure that has the same restitution in sticking, as far as its domain goes
  function translated(from, to, c) {
    const slope = to.a[1] + to.b[1];
    if (slope === 0) return 0;
    const sum = from.a[0] + from.b[0] + (from.a[1] + from.b[1]) * c;
    const found = (sum - to.a[0] - to.b[0]) / slope;
    return Math.min(Math.max(found, to.domain[0]), to.domain[1]);
  }

  function ranges() {
    const b = best();
    const rows = data.rows;
    const spins = ["spin_y", "spin_x"].map((key) => Math.max(1, ...rows[key].map((s) => 1.5 * Math.abs(s))));
    const own = closure().domain;
    const c = state.values.c ?? b.c;
    return {
      e_n: [0, Math.max(1, b.e_n)], c: [Math.min(own[0], c), Math.max(own[1], c)],
      mu: [0, Math.max(0.5, Math.min(2, 3 * b.mu), b.mu)], spin_y: [-spins[0], spins[0]], spin_x: [-spins[1], spins[1]],
    };
  }

  // ---- numbers

  const fitted = (row, observable, v, c) =>
    ifrfit.value(observable, data.rows.gamma[row], data.rows.spin_x[row], data.rows.spin_y[row], c, v.e_n, v.c, v.mu, data.inertia);

  function chi2(v, c) {
    const own = group().series;
    let sum = 0;
    for (let row = 0; row < count; row += 1) {
      if (!own.includes(data.rows.series[row]) || data.rows.sigma[row] === null) continue;
      const name = data.observables[data.rows.observable[row]].name;
      const z = (data.rows.value[row] - fitted(row, name, v, c)) / data.rows.sigma[row];
      if (isFinite(z)) sum += z * z;
    }
    return sum;
  }

  // Mahalanobis distance from the stated values by the posterior covariance, and fixed constants that were moved
  function distance(v) {
    const own = group();
    const constant = data.closures[data.fitted].constant;
    const now = { e_n: v.e_n, mu: v.mu, kappa: v.mu * (1 + v.e_n), [constant]: v.c };
    const off = own.coordinates.map((name, i) => now[name] - own.at[i]);
    const fixed = own.coordinates.filter((name, i) => !own.free[i] && Math.abs(off[i]) > 1e-9);
    let sum = 0;
    own.precision.forEach((line, i) => line.forEach((p, j) => { sum += off[i] * p * off[j]; }));
    return { sd: Math.sqrt(Math.max(sum, 0)), fixed };
  }

  // ---- drawing

  const NS = "http://www.w3.org/2000/svg";
  const plot = $("plot");
  const MARKS = {
    o: "M-3.6 0a3.6 3.6 0 1 0 7.2 0a3.6 3.6 0 1 0 -7.2 0z", s: "M-3.3-3.3h6.6v6.6h-6.6z", "^": "M0-4.2L3.9 3H-3.9z",
    D: "M0-4.4L4.4 0L0 4.4L-4.4 0z", v: "M0 4.2L3.9-3H-3.9z", P: "M-1.3-4h2.6v2.7h2.7v2.6h-2.7v2.7h-2.6v-2.7h-2.7v-2.6h2.7z",
    X: "M-4-2.2L-2.2-4L0-1.8L2.2-4L4-2.2L1.8 0L4 2.2L2.2 4L0 1.8L-2.2 4L-4 2.2L-1.8 0z", h: "M0-4L3.5-2V2L0 4L-3.5 2V-2z",
  };

  function add(name, attributes, parent = plot, text = null) {
    const element = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== null) element.textContent = text;
    parent.appendChild(element);
    return element;
  }

  function ticks(low, high, wanted) {
    const raw = (high - low) / wanted;
    const unit = 10 ** Math.floor(Math.log10(raw));
    const step = unit * [1, 2, 5, 10].find((m) => m * unit >= raw);
    const first = Math.ceil(low / step - 1e-9);
    const found = [];
    for (let i = first; i * step <= high + 1e-9 * step; i += 1) found.push(i * step);
    return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }

  const rowsOf = (observable) => [...Array(count).keys()].filter((i) => data.rows.observable[i] === observable);

  function limits(observable) {
    const seen = [];
    for (const i of rowsOf(observable)) {
      const s = data.rows.sigma[i] ?? 0;
      seen.push(data.rows.value[i] - s, data.rows.value[i] + s);
    }
    const low = Math.min(...seen);
    const high = Math.max(...seen);
    const room = 0.35 * (high - low) || 0.1 * Math.max(Math.abs(high), 0.1);
    const fitted = data.observables[observable].limits;
    return [Math.min(low - room, fitted[0]), Math.max(high + room, fitted[1])];
  }

  const width = () => Math.max(280, plot.parentElement.clientWidth);
  const HEIGHT = 360;
  const MARGIN = { left: 52, right: 8, top: 10, bottom: 40 };

  function path(observable, v, c, spinX, spinY, x, y, bounds) {
    let line = "";
    let pen = "M";
    const kinks = ifrfit.transitions(c, v.e_n, v.c, v.mu, spinX, spinY);
    const room = bounds[1] - bounds[0];
    for (const angle of [...ANGLES, ...kinks].sort((p, q) => p - q)) {
      const at = ifrfit.value(observable, angle, spinX, spinY, c, v.e_n, v.c, v.mu, data.inertia);
      if (!isFinite(at)) { pen = "M"; continue; }
      const shown = Math.min(Math.max(at, bounds[0] - 3 * room), bounds[1] + 3 * room);
      line += `${pen}${x(angle).toFixed(2)} ${y(shown).toFixed(2)}`;
      pen = "L";
    }
    return line;
  }

  function draw() {
    const v = state.values;
    const c = closure();
    const observable = data.observables[state.observable];
    const w = width();
    const bounds = limits(state.observable);
    const x = (angle) => MARGIN.left + (angle / 90) * (w - MARGIN.left - MARGIN.right);
    const y = (at) => HEIGHT - MARGIN.bottom - ((at - bounds[0]) / (bounds[1] - bounds[0])) * (HEIGHT - MARGIN.top - MARGIN.bottom);
    plot.setAttribute("viewBox", `0 0 ${w} ${HEIGHT}`);
    plot.setAttribute("width", w);
    plot.replaceChildren(plot.querySelector("title"));
    const clip = add("clipPath", { id: "explorer-clip" }, add("defs", {}));
    const frame = { x: MARGIN.left, y: MARGIN.top, width: w - MARGIN.left - MARGIN.right, height: HEIGHT - MARGIN.top - MARGIN.bottom };
    add("rect", frame, clip);
    shade(v, c, x);
    axes(w, bounds, x, y, observable);
    const inside = add("g", { "clip-path": "url(#explorer-clip)" });
    points(inside, x, y);
    curves(inside, v, c, observable.name, x, y, bounds);
    add("rect", { ...frame, fill: "none", stroke: "#222", "stroke-width": 1 });
    if (data.stand_in) add("text", { x: w / 2, y: HEIGHT / 2, "text-anchor": "middle", class: "stand-in-mark", transform: `rotate(-18 ${w / 2} ${HEIGHT / 2})` }, plot, "STAND-IN");
  }

  function shade(v, c, x) {
    const angles = ifrfit.transitions(c, v.e_n, v.c, v.mu, v.spin_x, v.spin_y);
    const edges = [0, ...angles, 90];
    for (let i = 0; i + 1 < edges.length; i += 1) {
      const i0 = ifrfit.incidence((edges[i] + edges[i + 1]) / 2, v.spin_x, v.spin_y);
      if (!ifrfit.rebound(i0, c, v.e_n, v.c, v.mu, data.inertia).sticking) continue;
      const place = { x: x(edges[i]), y: MARGIN.top, width: x(edges[i + 1]) - x(edges[i]), height: HEIGHT - MARGIN.top - MARGIN.bottom };
      add("rect", { ...place, fill: "#000", "fill-opacity": 0.06, class: "sticking" });
      if (place.width > 52) add("text", { x: place.x + place.width / 2, y: MARGIN.top + 13, "text-anchor": "middle", class: "regime" }, plot, "sticking");
    }
  }

  function axes(w, bounds, x, y, observable) {
    for (let angle = 0; angle <= 90; angle += w < 420 ? 30 : 15) {
      add("line", { x1: x(angle), x2: x(angle), y1: HEIGHT - MARGIN.bottom, y2: HEIGHT - MARGIN.bottom - 5, stroke: "#222" });
      add("text", { x: x(angle), y: HEIGHT - MARGIN.bottom + 15, "text-anchor": "middle" }, plot, String(angle));
    }
    const { found, digits } = ticks(bounds[0], bounds[1], 6);
    for (const at of found) {
      add("line", { x1: MARGIN.left, x2: MARGIN.left + 5, y1: y(at), y2: y(at), stroke: "#222" });
      add("text", { x: MARGIN.left - 5, y: y(at) + 4, "text-anchor": "end" }, plot, at.toFixed(digits).replace("-", "−"));
    }
    add("text", { x: (MARGIN.left + w - MARGIN.right) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, plot, data.across);
    add("text", { transform: `translate(11 ${(HEIGHT - MARGIN.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, plot, `${observable.label} (${observable.unit})`);
  }

  function points(inside, x, y) {
    for (const i of rowsOf(state.observable)) {
      if (data.rows.gamma[i] === null) continue;
      const series = data.series[data.rows.series[i]];
      const faint = group().series.includes(data.rows.series[i]) ? 1 : 0.3;
      const px = x(data.rows.gamma[i]);
      const s = data.rows.sigma[i];
      if (s !== null) add("line", { x1: px, x2: px, y1: y(data.rows.value[i] - s), y2: y(data.rows.value[i] + s), stroke: series.colour, "stroke-width": 0.9, "stroke-opacity": 0.7 * faint }, inside);
      add("path", { d: MARKS[series.marker] ?? MARKS.o, transform: `translate(${px.toFixed(2)} ${y(data.rows.value[i]).toFixed(2)})`, fill: series.colour, "fill-opacity": 0.75 * faint, class: "datum" }, inside);
    }
  }

  // every series of the group at its own spin; the one of the spin sliders on top, dashed where it is at another spin
  function curves(inside, v, c, name, x, y, bounds) {
    const b = best();
    const fittedClosure = data.closures[data.fitted];
    for (const index of group().series) {
      const series = data.series[index];
      if (index !== state.series) add("path", { d: path(name, v, c, series.spin_x, series.spin_y, x, y, bounds), fill: "none", stroke: series.colour, "stroke-width": 1.5, class: "curve-other" }, inside);
    }
    const own = data.series[state.series];
    add("path", { d: path(name, b, fittedClosure, own.spin_x, own.spin_y, x, y, bounds), fill: "none", stroke: "#555", "stroke-width": 1.3, "stroke-dasharray": "2 3", id: "explorer-best" }, inside);
    const moved = v.spin_x !== own.spin_x || v.spin_y !== own.spin_y;
    const look = { fill: "none", stroke: own.colour, "stroke-width": 2.4, id: "explorer-curve" };
    add("path", { d: path(name, v, c, v.spin_x, v.spin_y, x, y, bounds), ...look, ...(moved ? { "stroke-dasharray": "8 4" } : {}) }, inside);
  }

  // ---- words

  // names of constants as symbols, everything else as it is
  const NAMES = new RegExp(`\\b(${Object.keys(data.symbols).sort((p, q) => q.length - p.length).join("|")})\\b`);

  function say(element, text) {
    element.replaceChildren(...text.split(NAMES).flatMap((part, i) => (i % 2 ? data.symbols[part].map(typeset) : [part])));
  }

  function typeset([text, slanted, level]) {
    let node = document.createTextNode(text);
    for (const tag of [slanted ? "i" : "", level < 0 ? "sub" : level > 0 ? "sup" : ""].filter(Boolean)) {
      const element = document.createElement(tag);
      element.append(node);
      node = element;
    }
    return node;
  }

  const short = (number, digits) => number.toFixed(digits).replace("-", "−");

  function words() {
    const v = state.values;
    const now = chi2(v, closure());
    const least = chi2(best(), data.closures[data.fitted]);
    const of = data.thinned ? ` (of the ${count} rows shown, of ${data.n})` : "";
    $("chi2").textContent = `${now.toPrecision(4)}; at the stated values ${least.toPrecision(4)}${of}`;
    if (state.closure !== data.fitted) {
      $("distance").textContent = `not defined: the fit is of closure ${data.closures[data.fitted].title}`;
    } else {
      const { sd, fixed } = distance(v);
      const moved = fixed.length ? `; ${fixed.join(" and ")} had no spread in the fit` : "";
      say($("distance"), `${sd < 100 ? sd.toFixed(2) : sd.toPrecision(3)} sd from the stated values${moved}`);
    }
    const angles = ifrfit.transitions(closure(), v.e_n, v.c, v.mu, v.spin_x, v.spin_y);
    const sticks = ifrfit.rebound(ifrfit.incidence(45, v.spin_x, v.spin_y), closure(), v.e_n, v.c, v.mu, data.inertia).sticking;
    $("transition").textContent = angles.length ? `${angles.map((a) => short(a, 2)).join("° and ")}°` : `none: all ${sticks ? "stick" : "slide"}`;
    note(v);
  }

  function note(v) {
    const own = data.series[state.series];
    const said = [`chi2 takes each row at its own spin, with ${data.yardstick}.`];
    if (data.open.length) said.push(`Not determined by the data: ${data.open.join(", ")}; the panel starts from a value that is compatible with them, one of many.`);
    if (data.left_out.length) said.push(`The panel has no formula for ${data.left_out.join(", ")} and leaves these values out.`);
    if (data.groups.length > 1) said.push(`It counts the rows of ${own.name} alone, whose constants these are.`);
    if (v.spin_x !== own.spin_x || v.spin_y !== own.spin_y) said.push(`The dashed curve is at the spin chosen, the data of ${own.name} are not.`);
    say($("note"), said.join(" "));
    $("legend").textContent = `Solid: the constants chosen${group().series.length > 1 ? ", each series at its own spin" : ""}. Dotted: the stated values${group().series.length > 1 ? ` at the spin of ${own.name}` : ""}.`;
  }

  // ---- controls

  function show() {
    const constant = closure().constant;
    $("c-row").hidden = constant === null;
    const limit = ranges();
    for (const name of SLIDERS) {
      const slider = $(name);
      const [low, high] = limit[name];
      slider.min = low;
      slider.max = high;
      slider.step = "any";
      slider.value = state.values[name];
      say($(`${name}-label`), name === "c" ? (constant ?? "") : name);
      const text = short(state.values[name], 4);
      $(`${name}-value`).textContent = text;
      slider.setAttribute("aria-valuetext", text);
    }
    $("closure").value = state.closure;
    $("series").value = String(state.series);
    draw();
    words();
  }

  // arrows move by a two-hundredth of the range, with shift by a twentieth of that
  function key(event) {
    const slider = event.target;
    const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!steps) return;
    event.preventDefault();
    const step = ((slider.max - slider.min) / 200) * (event.shiftKey ? 0.05 : 1);
    slider.value = Math.min(Math.max(Number(slider.value) + steps * step, slider.min), slider.max);
    slider.dispatchEvent(new Event("input"));
  }

  function back() {
    state.closure = data.fitted;
    state.values = best();
    show();
  }

  function options(select, entries) {
    for (const [value, text] of entries) {
      const option = document.createElement("option");
      option.value = value;
      option.textContent = text;
      select.appendChild(option);
    }
  }

  options($("observable"), angled.map((o) => [o.index, `${o.label} (${o.name})`]));
  options($("series"), data.series.map((s, i) => [i, s.short]));
  options($("closure"), Object.entries(data.closures).map(([name, own]) => [name, own.title]));
  $("observable-row").hidden = angled.length < 2;
  $("series-row").hidden = data.series.length < 2;
  $("observable").addEventListener("change", (event) => { state.observable = Number(event.target.value); show(); });
  $("series").addEventListener("change", (event) => {
    state.series = Number(event.target.value);
    if (data.groups.length > 1) { back(); return; }
    state.values = { ...state.values, spin_x: best().spin_x, spin_y: best().spin_y };
    show();
  });
  $("closure").addEventListener("change", (event) => {
    const from = closure();
    state.closure = event.target.value;
    state.values.c = translated(from, closure(), state.values.c);
    show();
  });
  for (const name of SLIDERS) {
    $(name).addEventListener("input", (event) => { state.values[name] = Number(event.target.value); show(); });
    $(name).addEventListener("keydown", key);
  }
  $("back").addEventListener("click", back);
  root.hidden = false;
  window.addEventListener("resize", draw);
  back();
})();
