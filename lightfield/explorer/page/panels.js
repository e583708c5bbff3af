"use strict";
// Everything on the page: what the server (or the saved page's kernel) tells, as controls, lists and drawings.
LF.experiment = null;
LF.state = null;
LF.shown = null; // the last evaluation: head and arrays
LF.errors = null; // standard error of the shown map
LF.controls = {}; // by path: slider, number and how they map
LF.ask = () => {}; // set by live.js or saved.js
LF.can = () => true; // what a saved page cannot do is not offered

LF.showExperiment = (experiment) => {
  const other = !LF.experiment || LF.experiment.value.length !== experiment.value.length;
  LF.experiment = experiment;
  LF.errors = null;
  LF.$("title").textContent = experiment.title;
  document.title = `${experiment.title} – lightfield explorer`;
  LF.$("floor").textContent = LF.percent(experiment.floor_percent);
  const source = experiment.has_data ? `${experiment.value.length} readings${experiment.source ? `, ${experiment.source.split("/").pop()}` : ""}` : "no readings: the render of the scene takes their place";
  const assumed = experiment.assumed.length ? [`assumed: ${experiment.assumed.join(", ")}`] : [];
  LF.$("source").textContent = [source, ...assumed].join(" · ");
  LF.$("source").title = experiment.warnings.join("\n");
  LF.$("error-words").textContent = experiment.has_data ? "error against the readings" : "error against the render";
  LF.$("diagnose").hidden = !experiment.has_data || !LF.can("diagnose");
  const planes = experiment.planes_m.map((z, k) => LF.make("button", { type: "button", onclick: () => LF.ask({ do: "view", plane: k, channel: Number(LF.$("channel").value) }) }, `${LF.number(z, 3)}`));
  LF.$("planes").replaceChildren("z = ", ...planes, " m");
  LF.options("channel", experiment.wavelengths_nm.map((w, k) => [String(k), `${LF.number(w, 4)} nm`]));
  LF.$("channel").hidden = experiment.wavelengths_nm.length < 2;
  const names = experiment.untestable;
  LF.$("untestable").replaceChildren(...Object.keys(names).flatMap((name) => [LF.make("dt", {}, name.replaceAll("_", " ")), LF.make("dd", {}, names[name])]));
  LF.$("untestable-details").hidden = Object.keys(names).length === 0;
  LF.options("residual-axis", LF.axesOf(experiment).map(([key, label]) => [key, label]));
  LF.options("profile-axis", [["x_m", "x"], ["y_m", "y"]]);
  const spread = (key) => { const [a, b] = LF.extent([experiment[key]]); return b - a; };
  if (other) LF.$("profile-axis").value = spread("y_m") > spread("x_m") * 1.01 ? "y_m" : "x_m";
};

LF.options = (id, pairs) => {
  const select = LF.$(id), before = select.value;
  select.replaceChildren(...pairs.map(([key, label]) => LF.make("option", { value: key }, label)));
  if (pairs.some(([key]) => key === before)) select.value = before;
};

LF.axesOf = (experiment) => {
  const varies = (array) => { const [a, b] = LF.extent([array]); return b - a > 1e-6; };
  const all = [["x_m", "x in m"], ["y_m", "y in m"], ["z_m", "z in m"], ["angle_deg", "angle in degrees"], ["time_s", "time in s"], ["wavelength_nm", "wavelength in nm"]];
  return all.filter(([key]) => varies(experiment[key].filter((v) => v !== null)));
};

// -- state ---------------------------------------------------------------------------------------

LF.showState = (state) => {
  const before = LF.state;
  LF.state = state;
  const focused = document.activeElement, held = focused && focused.dataset ? focused.dataset.hold : null;
  const structure = JSON.stringify([state.base, state.effects.map((e) => [e.key, e.on]), Object.keys(state.parameters)]);
  if (LF.structure !== structure || !before) {
    LF.structure = structure;
    LF.controls = {};
    LF.$("base").replaceChildren(...state.base.map((path) => LF.parameter(path, state.parameters[path])));
    LF.$("on").replaceChildren(...state.effects.filter((e) => e.on).map((e) => LF.effectOn(e, state)));
    LF.$("off").replaceChildren(...LF.effectsOff(state));
  }
  for (const [path, control] of Object.entries(LF.controls)) control.update(state.parameters[path]);
  LF.showBecomes(state);
  LF.showLadder(state);
  LF.showHistory(state);
  LF.showVerdict(state.verdict);
  for (const [k, button] of [...LF.$("planes").querySelectorAll("button")].entries()) button.setAttribute("aria-pressed", String(k === state.plane));
  LF.$("channel").value = String(state.channel);
  LF.$("undo").disabled = !state.can_undo;
  LF.$("redo").disabled = !state.can_redo;
  LF.$("save-report").hidden = !state.verdict;
  LF.$("save-comparison").hidden = !state.compared;
  if (held) {
    const again = document.querySelector(`[data-hold="${CSS.escape(held)}"]`);
    if (again && document.activeElement !== again) again.focus({ preventScroll: true });
  }
};

LF.title = (name) => name.replaceAll("_", " ");

LF.head = (effect) => {
  const box = LF.make("input", { type: "checkbox", checked: effect.on, "data-hold": `effect-${effect.name}`, "aria-label": LF.title(effect.name) });
  box.addEventListener("change", () => LF.ask({ do: "switch", effect: effect.key, on: box.checked }));
  return LF.make("label", { class: "head", title: `${effect.physics}\nLooks like: ${effect.signature}\nCheck: ${effect.laboratory}` },
    box, LF.make("span", { class: "name" }, LF.title(effect.name)), LF.make("span", { class: "becomes", "data-key": effect.key }));
};

LF.effectOn = (effect, state) => {
  const block = LF.make("div", { class: "effect on", role: "group", "aria-label": LF.title(effect.name) }, LF.head(effect));
  if (effect.forms.length > 1) {
    const select = LF.make("select", { "aria-label": `form of ${LF.title(effect.name)}`, "data-hold": `form-${effect.name}` });
    select.append(...effect.forms.map((form) => LF.make("option", { value: form.key }, form.name)));
    select.value = effect.key;
    select.addEventListener("change", () => LF.ask({ do: "switch", effect: select.value, on: true }));
    block.append(select);
  }
  block.append(...effect.parameters.map((path) => LF.parameter(path, state.parameters[path])));
  return block;
};

LF.effectsOff = (state) => {
  const families = new Map();
  for (const effect of state.effects.filter((e) => !e.on)) {
    if (!families.has(effect.family)) families.set(effect.family, []);
    families.get(effect.family).push(effect);
  }
  return [...families].flatMap(([family, effects]) => [
    LF.make("p", { class: "family" }, family),
    ...effects.map((effect) => LF.make("div", { class: "effect" }, LF.head(effect))),
  ]);
};

LF.showBecomes = (state) => {
  const off = state.effects.filter((e) => !e.on && e.error_percent !== null).map((e) => e.error_percent);
  const least = Math.min(...off);
  for (const effect of state.effects) {
    const place = document.querySelector(`.becomes[data-key="${CSS.escape(effect.key)}"]`);
    if (!place) continue;
    const known = effect.error_percent !== null && effect.error_percent !== undefined;
    const helps = known && !effect.on && LF.shown && effect.error_percent === least && least < 0.8 * LF.shown.error_percent;
    place.textContent = effect.not_with ? `not with ${LF.title(effect.not_with)}` : !known ? "" : effect.on ? `${LF.percent(effect.error_percent)} without` : `${helps ? "↓ " : ""}${LF.percent(effect.error_percent)}`;
    place.classList.toggle("best", Boolean(helps));
  }
};

LF.parameter = (path, p) => {
  const slider = LF.make("input", { type: "range", min: "0", max: "1", step: "any", "aria-label": `${p.label}${p.unit ? ` in ${p.unit}` : ""}`, "data-path": path, "data-hold": `slider-${path}` });
  const number = LF.make("input", { type: "text", inputmode: "decimal", "aria-label": `${p.label}, value`, "data-hold": `number-${path}` });
  const neutral = LF.make("span", { class: "mark", hidden: true, title: "neutral: off" });
  const best = LF.make("span", { class: "mark fit", hidden: true, title: "fitted" });
  const words = LF.make("span", { class: "fitted" }), range = LF.make("span", { class: "range" });
  const control = { p, map: LF.slide(p), slider, number };
  const show = (value) => {
    number.value = String(Number(value.toPrecision(4)));
    slider.setAttribute("aria-valuetext", `${LF.number(value, 4)} ${p.unit}`);
  };
  const place = (mark, value) => {
    mark.hidden = value === null || value === undefined;
    if (!mark.hidden) mark.style.left = `calc(${control.map.position(value)} * (100% - 16px) + 7px)`;
  };
  control.update = (p) => {
    if (!p) return;
    control.p = p;
    if (document.activeElement !== slider || !LF.dragging) {
      control.map = LF.slide(p);
      slider.value = String(control.map.position(p.value));
      if (document.activeElement !== number) show(p.value);
    }
    slider.disabled = number.disabled = Boolean(p.fixed);
    place(neutral, p.fixed ? null : p.neutral);
    place(best, p.fixed ? null : p.fitted);
    const ends = [control.map.value(0), control.map.value(1)].map((v) => LF.number(v, 2));
    range.textContent = p.fixed ? "" : `${ends[0]} to ${ends[1]}`;
    slider.title = p.fixed ? "fixed here" : `${ends[0]} to ${ends[1]} ${p.unit}${p.neutral === null ? "" : `; neutral ${LF.number(p.neutral, 3)}: double click`}`;
    words.textContent = p.fitted === null ? "" : `fit ${LF.number(p.fitted, 4)}${p.stderr === null ? "" : ` ± ${LF.number(p.stderr, 2)}`}`;
  };
  slider.addEventListener("input", () => { LF.dragging = true; const v = control.map.value(Number(slider.value)); show(v); LF.drag(path, v); });
  slider.addEventListener("change", () => { LF.dragging = false; LF.drag(path, control.map.value(Number(slider.value)), true); });
  slider.addEventListener("dblclick", () => { if (control.p.neutral !== null) LF.drag(path, control.p.neutral, true); });
  slider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
    if (!step) return;
    event.preventDefault();
    slider.value = String(Math.min(1, Math.max(0, Number(slider.value) + step * 0.005)));
    slider.dispatchEvent(new Event("input"));
    slider.dispatchEvent(new Event("change"));
  });
  number.addEventListener("change", () => {
    const v = LF.read(number.value);
    if (Number.isFinite(v)) LF.drag(path, v, true);
    else LF.say(`${p.label}: “${number.value}” is no number; nothing was changed`);
  });
  // What counts, also where what was typed did not.
  number.addEventListener("blur", () => show(control.p.value));
  LF.controls[path] = control;
  return LF.make("div", { class: "parameter" },
    LF.make("span", { class: "label", title: `${path}: ${p.meaning}` }, p.label),
    LF.make("span", { class: "slider" }, slider, neutral, best), number, LF.make("span", { class: "unit" }, p.unit), range, words);
};

LF.drag = (path, value, done = false) => LF.ask({ do: "set", values: { [path]: value }, done });

LF.showLadder = (state) => {
  const rungs = [...state.ladder];
  const top = Math.max(...rungs.map((r) => r.error_percent || 0), LF.shown ? LF.shown.error_percent : 0, LF.experiment.floor_percent || 0, 1e-6);
  const floor = LF.experiment.floor_percent;
  const hand = LF.handMoved(state);
  const here = hand ? -1 : state.here ?? state.effects.filter((e) => e.on).length;
  const items = rungs.map((rung) => LF.rung(rung.label, rung.error_percent, rung.chi2_per_dof, top, floor, rung.at === here, () => LF.ask({ do: "rung", at: rung.at })));
  if (hand && LF.shown) items.push(LF.rung("now, by hand", LF.shown.error_percent, LF.over(LF.shown.chi2, LF.shown.dof), top, floor, true, null));
  LF.$("ladder").replaceChildren(...items);
};

LF.handMoved = (state) => LF.dragging || Object.values(state.parameters).some((p) => p.fitted !== null && Math.abs(p.value - p.fitted) > 1e-6 * (Math.abs(p.fitted) + 1e-9));

LF.rung = (label, error, chi2, top, floor, here, go) => {
  const bar = LF.make("div", { class: LF.met(error, floor, chi2) ? "bar low" : "bar" });
  bar.style.width = `${(100 * error) / top}%`;
  const noise = LF.make("div", { class: "noise", title: `noise floor ${LF.percent(floor)}` });
  noise.style.left = `${(100 * floor) / top}%`;
  const button = LF.make("button", { type: "button", disabled: go === null, title: `chi²/dof ${LF.number(chi2, 3)}` },
    LF.make("span", { class: "label" }, here ? `▸ ${label}` : label), LF.make("span", { class: "percent" }, LF.percent(error)),
    LF.make("span", { class: "track" }, bar, noise));
  if (go) button.addEventListener("click", go);
  return LF.make("li", here ? { "aria-current": "true" } : {}, button);
};

LF.showHistory = (state) => {
  LF.$("history").replaceChildren(...state.history.map((did, k) => LF.make("li", k === state.at ? { "aria-current": "true" } : {},
    LF.make("button", { type: "button", onclick: () => LF.ask({ do: "state", at: k }) }, did))));
  LF.$("snapshots").replaceChildren(...state.snapshots.map((name) => LF.make("li", {}, LF.make("button", { type: "button", onclick: () => LF.ask({ do: "restore", name }) }, `back to ${name}`))));
};

LF.showVerdict = (v) => {
  LF.$("verdict").hidden = !v;
  if (!v) return;
  const text = (words, kind = "") => LF.make("p", kind ? { class: kind } : {}, words);
  const body = [text(v.headline, "headline"), ...v.support.map((words) => text(words, "muted"))];
  if (v.doubt) body.push(text(v.doubt));
  v.explanations.forEach((one, k) => body.push(LF.make("p", {},
    LF.can("accept") ? LF.make("button", { type: "button", "data-hold": `accept-${k}`, onclick: () => LF.ask({ do: "accept", at: k }) }, `Accept: ${one.label}`) : `${one.label}:`,
    ` ${LF.percent(one.error_percent)}, chi²/dof ${LF.number(one.chi2_per_dof, 2)}`)));
  if (v.rendered_percent !== null) body.push(text(`rendered afresh: ${LF.percent(v.rendered_percent)}; noise floor ${LF.percent(v.floor_percent)}`, "muted"));
  if (v.found.length) body.push(LF.make("h3", {}, "How sure each effect is"), LF.make("dl", { class: "found" }, ...v.found.flatMap(LF.foundEffect)));
  if (v.rival) body.push(text(`Nearest rival: ${v.rival.label || "nothing more"}, ${LF.number(v.rival.sigma, 2)} sigma away.`));
  if (v.next) body.push(LF.make("h3", {}, "Next measurement"), text(v.next));
  LF.$("verdict-body").replaceChildren(...body);
};

LF.foundEffect = (one) => {
  const without = one.sigma === null ? [] : [`without it ${LF.number(one.sigma, 3)} sigma worse`];
  const rival = one.rival ? [`best set without it: ${one.rival}`] : [];
  return [
    LF.make("dt", {}, `${one.name} `, LF.make("span", { class: `level ${one.level.replace(" ", "-")}` }, one.words)),
    LF.make("dd", {}, [one.size, ...without, ...rival].join("; ")),
  ];
};

// -- evaluation ----------------------------------------------------------------------------------

LF.showEvaluation = (head, arrays) => {
  LF.errors = null;
  LF.shown = { ...head, ...arrays };
  const error = LF.$("error");
  error.textContent = LF.percent(head.error_percent);
  const chi2 = LF.over(head.chi2, head.dof);
  error.classList.toggle("good", LF.met(head.error_percent, LF.experiment.floor_percent, chi2));
  LF.$("chi2").textContent = LF.number(chi2, 3);
  LF.paintMaps(arrays.map_render || null, arrays.map_formula || null, LF.experiment.map_x_m.length, LF.$("log").checked);
  LF.showCursor();
  LF.drawPlots();
  document.documentElement.dataset.maps = arrays.map_render ? "ready" : "waiting";
};

LF.drawPlots = () => {
  if (!LF.shown || !LF.experiment) return;
  LF.drawProfile();
  LF.drawAxis();
  LF.drawResiduals();
};

LF.onPlane = () => {
  const e = LF.experiment, z = e.planes_m[LF.shown.plane];
  return e.z_m.map((v, k) => k).filter((k) => Math.abs(e.z_m[k] - z) < 0.011 && !e.air[k] && e.channel[k] === Number(LF.$("channel").value || 0));
};

LF.drawProfile = () => {
  const e = LF.experiment, s = LF.shown, along = LF.$("profile-axis").value, across = along === "x_m" ? "y_m" : "x_m";
  const name = along[0], z = e.planes_m[s.plane], log = LF.$("log").checked;
  let rows = LF.onPlane();
  if (rows.length) {
    const counts = new Map();
    for (const k of rows) { const key = e[across][k].toFixed(3); counts.set(key, (counts.get(key) || 0) + 1); }
    const most = [...counts].sort((a, b) => b[1] - a[1] || Math.abs(a[0]) - Math.abs(b[0]))[0][0];
    rows = rows.filter((k) => e[across][k].toFixed(3) === most);
  }
  rows.sort((a, b) => e[along][a] - e[along][b]);
  const pick = (array) => rows.map((k) => array[k]), x = pick(e[along]);
  const lines = [];
  const side = e.map_x_m.length, middle = (side - 1) / 2;
  // Without data the curve is the row of the map through the axis; else the model at the readings' own places.
  if (s.map_render && !e.has_data) {
    const row = (map) => Array.from({ length: side }, (_, k) => (along === "x_m" ? map[middle * side + k] : map[k * side + middle]));
    const at = along === "x_m" ? e.map_x_m : e.map_y_m;
    lines.push({ class: "line-formula", x: at, y: row(s.map_formula) }, { class: "line-model", x: at, y: row(s.map_render) });
  } else lines.push({ class: "line-formula", x, y: pick(s.formula) }, { class: "line-model", x, y: pick(s.model) });
  const value = pick(e.value), [, high] = LF.extent([value, ...lines.map((l) => l.y)]);
  const [low] = LF.extent([value, pick(s.model)], (v) => v > 0);
  LF.$("profile-title").textContent = `Profile along ${name} at z = ${LF.number(z, 3)} m`;
  LF.plot(LF.$("profile"), {
    x: LF.extent([x, ...(lines[0].x ? [lines[0].x] : [])]), y: log ? [low / 1.5, high * 1.3] : [Math.min(0, low), high * 1.05], log, xLabel: `${name} in m`, lines,
    points: [{ x, y: value, error: pick(e.sigma) }],
    key: [["data", e.has_data ? "● readings" : "● render of the scene"], ["model", "— model"], ["formula", "- - formula in it"]],
    label: `Readings, model and formula along ${name} at z = ${LF.number(z, 3)} m`,
  });
};

LF.drawAxis = () => {
  const e = LF.experiment, s = LF.shown, near = new Map();
  e.z_m.forEach((z, k) => {
    if (e.air[k] || !e.kept[k] || e.channel[k] !== Number(LF.$("channel").value || 0)) return;
    const key = `${z.toFixed(2)}`, off = Math.hypot(e.x_m[k], e.y_m[k]);
    if (!near.has(key) || off < near.get(key).off - 1e-9) near.set(key, { off, rows: [k] });
    else if (Math.abs(off - near.get(key).off) < 1e-9) near.get(key).rows.push(k);
  });
  const rows = [...near.values()].flatMap((n) => (n.off < 0.11 ? n.rows : [])).sort((a, b) => e.z_m[a] - e.z_m[b]);
  if (rows.length < 2) { LF.$("axis").replaceChildren("no readings near the axis at several distances"); LF.$("decay").textContent = ""; return; }
  const z2 = (array) => rows.map((k) => array[k] * (e.z_m[k] ** 2 + e.x_m[k] ** 2 + e.y_m[k] ** 2)), z = rows.map((k) => e.z_m[k]);
  const value = z2(e.value), model = z2(s.model), log = LF.$("log").checked;
  const ends = LF.extent([value, model, z2(s.formula)], (v) => v > 0);
  LF.plot(LF.$("axis"), {
    x: LF.extent([z]), y: log ? [ends[0] / 1.1, ends[1] * 1.1] : [0, ends[1] * 1.05], log, xLabel: "z in m", height: 150,
    lines: [{ class: "line-formula", x: z, y: z2(s.formula) }, { class: "line-model", x: z, y: model }],
    points: [{ x: z, y: value, error: z2(e.sigma) }], label: "Readings, model and formula on the axis times distance squared",
  });
  const slope = (y) => { // least squares of ln y over z
    const good = y.map((v, k) => [z[k], Math.log(v)]).filter((p) => Number.isFinite(p[1]));
    const mz = good.reduce((a, p) => a + p[0], 0) / good.length, my = good.reduce((a, p) => a + p[1], 0) / good.length;
    return -good.reduce((a, p) => a + (p[0] - mz) * (p[1] - my), 0) / good.reduce((a, p) => a + (p[0] - mz) ** 2, 0);
  };
  LF.$("decay").textContent = `decay: ${e.has_data ? "readings" : "render"} ${LF.number(slope(value), 3)}, model ${LF.number(slope(model), 3)} per m`;
};

LF.drawResiduals = () => {
  const e = LF.experiment, s = LF.shown, key = LF.$("residual-axis").value || "z_m";
  const x = e[key], worst = LF.extent([s.residual]), reach = Math.max(4, 1.05 * Math.max(-worst[0], worst[1]));
  const [a, b] = LF.extent([x]), room = 0.03 * (b - a);
  const label = LF.$("residual-axis").selectedOptions[0]?.textContent || "z in m";
  LF.plot(LF.$("residuals"), {
    x: [a - room, b + room], y: [-reach, reach], xLabel: label, zero: 0, bands: [[-2, 2]], height: 210,
    points: [{ x, y: s.residual }], key: [["data", e.has_data ? "(reading − model) / sigma" : "(render − model) / sigma"]],
    label: `Residuals in sigma over ${label}`,
  });
  let within = 0, n = 0;
  for (const r of s.residual) if (Number.isFinite(r)) { n++; if (Math.abs(r) <= 2) within++; }
  LF.$("residual-words").textContent = `${Math.round((100 * within) / Math.max(n, 1))} % within ±2 sigma (noise alone: 95 %); worst ${LF.number(Math.max(-worst[0], worst[1]), 2)} sigma`;
};

// -- cursor --------------------------------------------------------------------------------------

LF.cursor = null;
LF.showCursor = () => {
  const place = LF.$("cursor"), e = LF.experiment, s = LF.shown;
  if (!LF.cursor || !s || !s.map_formula) return;
  const side = e.map_x_m.length, [column, row] = LF.cursor, k = row * side + column;
  const words = [`x ${LF.number(e.map_x_m[column], 2)} m, y ${LF.number(e.map_y_m[row], 2)} m:`];
  if (Number.isNaN(s.map_formula[k])) { place.textContent = `${words[0]} outside the water`; return; }
  if (s.map_render) words.push(`render ${LF.number(s.map_render[k], 3)}${LF.errors ? ` ± ${LF.number(LF.errors[k], 1)}` : ""},`);
  words.push(`formula ${LF.number(s.map_formula[k], 3)}`);
  if (s.map_render) words.push(`(${LF.number((100 * s.map_formula[k]) / s.map_render[k], 3)} %)`);
  place.textContent = words.join(" ");
};

for (const id of ["map-render", "map-formula", "map-ratio"]) {
  const canvas = document.getElementById(id);
  canvas.setAttribute("aria-label", { "map-render": "Map of the rendered light", "map-formula": "Map of the formula", "map-ratio": "Map of formula over render, 0.1 to 10: orange too little, blue too much" }[id]);
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect(), side = LF.experiment ? LF.experiment.map_x_m.length : 1;
    const at = (f) => Math.min(side - 1, Math.max(0, Math.floor(f * side)));
    LF.cursor = [at((event.clientX - box.left) / box.width), side - 1 - at((event.clientY - box.top) / box.height)];
    LF.showCursor();
  });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step || !LF.experiment) return;
    event.preventDefault();
    const side = LF.experiment.map_x_m.length, middle = (side - 1) / 2, [c, r] = LF.cursor || [middle, middle];
    LF.cursor = [Math.min(side - 1, Math.max(0, c + step[0])), Math.min(side - 1, Math.max(0, r + step[1]))];
    LF.showCursor();
  });
}

LF.say = (text) => {
  const place = LF.$("message");
  place.hidden = !text;
  place.textContent = text || "";
};

LF.$("log").addEventListener("change", () => { if (LF.shown) { LF.paintMaps(LF.shown.map_render || null, LF.shown.map_formula || null, LF.experiment.map_x_m.length, LF.$("log").checked); LF.drawPlots(); } });
LF.$("channel").addEventListener("change", () => LF.ask({ do: "view", plane: LF.shown.plane, channel: Number(LF.$("channel").value) }));
LF.$("profile-axis").addEventListener("change", LF.drawPlots);
LF.$("residual-axis").addEventListener("change", LF.drawPlots);
window.addEventListener("resize", () => requestAnimationFrame(LF.drawPlots));
for (const [id, what] of [["undo", "undo"], ["redo", "redo"], ["fit", "fit"], ["diagnose", "diagnose"], ["cancel", "cancel"]]) LF.$(id).addEventListener("click", () => LF.ask({ do: what }));
document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || /^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName) && event.target.type !== "range" && event.target.type !== "checkbox") return;
  const key = event.key.toLowerCase(), what = key === "y" || (key === "z" && event.shiftKey) ? "redo" : key === "z" ? "undo" : null;
  if (what) { event.preventDefault(); LF.ask({ do: what }); }
});
for (const menu of document.querySelectorAll(".menu")) {
  menu.addEventListener("keydown", (event) => { if (event.key === "Escape") { menu.open = false; menu.querySelector("summary").focus(); } });
  document.addEventListener("pointerdown", (event) => { if (!menu.contains(event.target)) menu.open = false; });
}
