"use strict";
// A saved page: no server; stops of the ladder, and what moves at each.
(() => {
  const saved = JSON.parse(LF.$("saved").textContent);
  const raw = atob(saved.arrays), bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  const stops = saved.stops.map((stop) => ({ ...stop, sets: LF.kernel.unpack(bytes.buffer, stop.sets) }));
  const whiten = saved.whiten ? LF.kernel.array(bytes.buffer, saved.whiten) : null;
  const e = saved.experiment;
  for (const key of ["x_m", "y_m", "z_m", "value", "sigma", "time_s", "wavelength_nm", "angle_deg"]) e[key] = e[key].map((v) => (v === null ? NaN : v));
  let here = saved.here, plane = saved.plane, channel = saved.channel, values = { ...stops[here].values }, past = [], ahead = [];

  LF.can = () => false;

  const moved = (stop) => {
    const paths = Object.keys(stop.moves), from = (path) => stop.values[path];
    return {
      by: Object.fromEntries(paths.map((path) => [path, values[path] - from(path)])),
      ratio: Object.fromEntries(paths.filter((path) => path.startsWith("gain")).map((path) => [path, values[path] / from(path)])),
      background: "detector.background" in stop.moves ? values["detector.background"] - from("detector.background") : 0,
      albedo: "tank.wall_albedo" in stop.moves ? values["tank.wall_albedo"] : undefined,
    };
  };

  // Light is known at the places of a map that are in the water.
  const mapOf = (values) => {
    const out = new Float32Array(e.map_x_m.length * e.map_y_m.length).fill(NaN), first = plane * saved.wet.length;
    saved.wet.forEach((k, i) => { out[k] = values[first + i]; });
    return out;
  };

  LF.evaluateSaved = () => {
    const stop = stops[here], by = moved(stop), { model, formula } = LF.kernel.evaluate(stop.sets.readings, by), n = model.length;
    const residual = model.map((m, k) => (e.kept[k] ? (e.value[k] - m) / e.sigma[k] : NaN));
    let sum = 0, count = 0;
    for (let k = 0; k < n; k++) if (saved.bright[k]) { sum += ((e.value[k] - model[k]) / model[k]) ** 2; count++; }
    let chi2 = null;
    if (whiten) {
      chi2 = 0;
      for (let i = 0; i < n; i++) {
        let r = 0;
        for (let k = 0; k < n; k++) if (e.kept[k]) r += whiten[i * n + k] * (e.value[k] - model[k]);
        chi2 += r * r * saved.phi;
      }
    }
    const arrays = { model, formula, residual }, head = { plane, error_percent: 100 * Math.sqrt(sum / count), chi2, dof: stop.score.dof };
    if (stop.sets.maps[channel]) {
      const maps = LF.kernel.evaluate(stop.sets.maps[channel], by);
      arrays.map_render = mapOf(maps.model);
      arrays.map_formula = mapOf(maps.formula);
      LF.allMaps = maps.model;
    }
    return [head, arrays];
  };

  const state = () => {
    const stop = stops[here], parameters = {};
    for (const [path, p] of Object.entries(stop.parameters)) {
      const ends = stop.moves[path], u = (v) => LF.coordinateOf(p.coordinate, v);
      parameters[path] = { ...p, value: values[path], fixed: !ends, low: ends ? u(ends[0]) : u(values[path]) - 1, high: ends ? u(ends[1]) : u(values[path]) + 1 };
    }
    return {
      effects: stop.described.map((one) => ({ ...one, on: true, error_percent: null, forms: [] })), base: stop.base, parameters,
      ladder: stops.map((one, k) => ({ at: k, label: one.label, error_percent: one.score.error_percent, chi2_per_dof: LF.over(one.score.chi2, one.score.dof) })),
      here, history: [], at: 0, can_undo: past.length > 0, can_redo: ahead.length > 0, snapshots: [], plane, channel, verdict: saved.verdict,
    };
  };

  const show = (all = true) => {
    LF.showEvaluation(...LF.evaluateSaved());
    LF.$("why-fixed").hidden = !stops[here].why_fixed;
    LF.$("why-fixed").textContent = `Nothing moves at this rung: ${stops[here].why_fixed}. Its numbers are what Python found.`;
    if (all) LF.showState(state());
    else LF.showLadder(LF.state);
    document.documentElement.dataset.painted = String(Number(document.documentElement.dataset.painted || 0) + 1);
  };

  const remember = () => { past.push([here, { ...values }]); ahead = []; };
  const back = (from, to) => { if (from.length) { to.push([here, { ...values }]); [here, values] = from.pop(); show(); } };

  let before = null;
  LF.ask = (request) => {
    if (request.do === "view") { [plane, channel] = [request.plane, request.channel]; show(); }
    else if (request.do === "rung") { remember(); here = request.at; values = { ...stops[here].values }; show(); }
    else if (request.do === "undo") back(past, ahead);
    else if (request.do === "redo") back(ahead, past);
    else if (request.do === "set") {
      const [path, value] = Object.entries(request.values)[0], ends = stops[here].moves[path];
      if (!ends) { show(); return; }
      before = before || [here, { ...values }];
      values[path] = Math.min(ends[1], Math.max(ends[0], value));
      LF.say(values[path] === value ? "" : `this page knows ${LF.number(ends[0])} to ${LF.number(ends[1])} here: taken for its end`);
      if (request.done) { past.push(before); before = null; ahead = []; }
      show(request.done);
    } else LF.say("a saved page cannot do that: open the scene in the explorer");
  };

  document.body.classList.add("saved");
  LF.showExperiment(e);
  LF.$("source").textContent += ` · saved by lightfield ${saved.version}`;
  show();
})();
