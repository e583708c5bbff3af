"use strict";
// The kernel of a saved page: light of a stop for other water, walls, gain and background. It follows
// lightfield/render/diffuse/portable.py, shift.py and formula/closed_form.py, and is held to them within 1e-3.
LF.kernel = {};

LF.kernel.half = (h) => {
  const exponent = (h >> 10) & 31, fraction = h & 1023, sign = h & 0x8000 ? -1 : 1;
  return sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : (fraction / 1024) * 2 ** -14);
};

LF.kernel.array = (buffer, [kind, at, shape, scales]) => {
  const count = shape.reduce((a, b) => a * b, 1);
  if (kind === "f4") return new Float32Array(buffer, at, count);
  if (kind === "u4") return new Uint32Array(buffer, at, count);
  const raw = new Uint16Array(buffer, at, count), out = new Float32Array(count), row = shape[shape.length - 1];
  const scale = LF.kernel.array(buffer, scales);
  for (let k = 0; k < count; k++) out[k] = LF.kernel.half(raw[k]) * scale[Math.floor(k / row)];
  return out;
};

// Part of a Poisson number of mean x at n or above.
LF.kernel.atLeast = (n, x) => {
  if (x <= 0) return n === 0 ? 1 : 0;
  let term = Math.exp(-x), below = 0;
  for (let k = 0; k < n; k++) { below += term; term *= x / (k + 1); }
  if (below < 0.9) return 1 - below;
  let sum = 0;
  for (let k = n; k < n + 200 && term > 1e-18 * (sum + 1e-300); k++) { sum += term; term *= x / (k + 1); }
  return sum;
};

// Factor of a row in any cell, without the attenuation on the straight line.
LF.kernel.factor = (d, c, row, a, b, rho) => {
  const [, m, k] = c.counts[row], change = a + b - d.a0 - d.b0;
  let factor = Math.exp(-change * c.excess[row]);
  if (m) factor *= d.rho0 ? (rho / d.rho0) ** m : 0;
  if (k) factor *= d.surface ** k;
  return factor;
};

LF.kernel.sum = (d, c, rows, a, b, rho, cells) => {
  const out = new Float64Array(cells), { nodes, below, part } = d.lengths;
  const more = Float64Array.from(d.straight, (r) => Math.exp((b - d.b0) * r));
  c.counts.forEach(([n], row) => {
    const w = LF.kernel.factor(d, c, row, a, b, rho), start = row * cells;
    if (w === 0) return;
    if (!c.open[row] || b === d.b0) {
      const same = w * (b / d.b0) ** n;
      for (let k = 0; k < cells; k++) out[k] += same * rows[start + k];
      return;
    }
    // Of open-ended rows another in every cell, by the length of the path.
    const grown = w * Math.exp((b - d.b0) * c.excess[row]);
    const chances = Array.from(nodes, (r) => {
      const length = r + c.excess[row];
      return Math.log(Math.max(LF.kernel.atLeast(n, b * length), 1e-200) / LF.kernel.atLeast(n, d.b0 * length));
    });
    for (let k = 0; k < cells; k++) {
      const i = below[k], chance = Math.exp(chances[i] + part[k] * (chances[i + 1] - chances[i]));
      out[k] += grown * more[k] * chance * rows[start + k];
    }
  });
  return out;
};

LF.kernel.inCells = (d, a, b, rho) => {
  const cells = d.straight.length, total = new Float64Array(cells), change = a + b - d.a0 - d.b0;
  for (const c of d.classes) {
    const mean = LF.kernel.sum(d, c, c.mean, a, b, rho, cells);
    if (!c.wanted) { for (let k = 0; k < cells; k++) total[k] += mean[k]; continue; }
    const wanted = LF.kernel.sum(d, c, c.wanted, a, b, rho, cells), { starts, cells: near, weights } = d.smoother;
    for (let k = 0; k < cells; k++) wanted[k] = mean[k] > 0 ? wanted[k] / mean[k] : 1;
    for (let k = 0; k < cells; k++) {
      let ratio = 0;
      for (let i = starts[k]; i < starts[k + 1]; i++) ratio += weights[i] * wanted[near[i]];
      total[k] += mean[k] * ratio;
    }
  }
  for (let k = 0; k < cells; k++) total[k] *= Math.exp(-change * d.straight[k]) * d.through[k];
  return total;
};

LF.kernel.atPlaces = (d, field) => {
  const n = d.cell.length, many = d.near.length / n, top = Math.max(field.reduce((a, b) => Math.max(a, b), 0), 1e-300);
  const log = field.map((v) => Math.log(Math.max(v, 1e-6 * top))), out = new Float64Array(n), t = new Float64Array(6);
  for (let p = 0; p < n; p++) {
    t.fill(0);
    for (let j = 0; j < many; j++) {
      const value = log[d.near[p * many + j]];
      for (let q = 0; q < 6; q++) t[q] += d.terms[(q * n + p) * many + j] * value;
    }
    const [value, gx, gy, gxx, gxy, gyy] = t;
    const ux = Math.max(1 + d.vx * gxx, 0.5), uy = Math.max(1 + d.vy * gyy, 0.5);
    const middle = -0.5 * (Math.log(ux * uy) + (d.vx * gx * gx) / ux + (d.vy * gy * gy) / uy);
    const dx = d.dx[p] - d.offset_x, dy = d.dy[p] - d.offset_y;
    const moved = (gx * dx + 0.5 * gxx * dx * dx) / ux + (gy * dy + 0.5 * gyy * dy * dy) / uy + (gxy * dx * dy) / (ux * uy);
    const here = field[d.cell[p]], lit = here > 1e-6 * top ? Math.exp(value) : here;
    out[p] = lit * Math.exp(Math.min(0.5, Math.max(-0.5, middle)) + Math.min(3, Math.max(-3, moved)));
  }
  return out;
};

// From values at places that of a reading; of a track two places tell of it, one before and one behind it.
LF.kernel.between = (d, values, n) => (p) => {
  if (!d.weight) return values(d.which[p]);
  let log = 0;
  for (let i = p; i < d.which.length; i += n) log += d.weight[i] * Math.log(Math.max(values(d.which[i]), 1e-300));
  return Math.exp(log);
};

LF.kernel.lagrange = (nodes, at) => nodes.map((x) => nodes.reduce((product, y) => (y === x ? product : (product * (at - y)) / (x - y)), 1));

LF.kernel.reflected = (r, through, c, rho, n) => {
  const out = new Float64Array(n), nodes = r.albedos.length, first = Math.max(Math.floor(c / r.step) - 1, 0);
  const inC = LF.kernel.lagrange([0, 1, 2, 3].map((i) => r.step * (first + i)), c);
  const inRho = LF.kernel.lagrange(r.albedos, rho);
  for (let p = 0; p < n; p++) {
    let light = r.image[p] * Math.exp(-c * r.way[p]);
    if (rho > 0 && r.walls.length) {
      let log = 0;
      for (let i = 0; i < 4; i++) for (let j = 0; j < nodes; j++) log += inC[i] * inRho[j] * r.walls[((first + i) * nodes + j) * n + p];
      light += rho * Math.exp(log);
    }
    out[p] = light * through(p);
  }
  return out;
};

// Readings and formula of one set of places: {model, formula}. `moved` has differences of water's paths and of the
// background, ratios of gains, and perhaps an albedo. Wavelengths have coefficients of their own, and one response.
LF.kernel.evaluate = (set, moved) => {
  if (set.fixed) return { model: Float32Array.from(set.fixed), formula: Float32Array.from(set.formula) };
  const n = set.direct.length, model = new Float32Array(n), formula = new Float32Array(n), d = set.diffuse;
  const rho = moved.albedo ?? set.albedo, sum = (parts) => Object.entries(parts).reduce((total, [path, part]) => total + part * (moved.by[path] || 0), 0);
  set.channels.forEach((one, k) => {
    const more = sum(one.of_absorption), denser = sum(one.of_scattering), a = one.absorption + more, b = one.scattering + denser;
    const gain = moved.ratio[one.gain] ?? 1;
    let diffuse = null, reflected = null;
    if (d && (b > 0 || rho > 0 || d.surface > 0)) {
      const places = LF.kernel.atPlaces(d, LF.kernel.inCells(d, a, b, rho)), seen = LF.kernel.between(d, (i) => places[i], n);
      diffuse = (p) => seen(p) * (d.scale ? d.scale[p] : 1);
      const through = LF.kernel.between(d, (i) => d.through[d.cell[i]], n);
      if (d.reflected) reflected = LF.kernel.reflected(d.reflected, through, a + b, rho, n);
    }
    for (let p = 0; p < n; p++) {
      if (set.channel[p] !== k) continue;
      const direct = set.direct[p] * Math.exp(-(more + denser) * set.way[p]);
      const light = direct + (diffuse ? diffuse(p) : 0) + (reflected ? reflected[p] : 0);
      formula[p] = set.slope[p] * gain * direct + set.offset[p] + moved.background;
      model[p] = set.slope[p] * gain * light + set.offset[p] + moved.background;
    }
  });
  return { model, formula };
};

// Arrays of a stop in place of where they lie.
LF.kernel.unpack = (buffer, given) => {
  if (Array.isArray(given) && given.length === 4 && typeof given[0] === "string" && /^[fu][24]$/.test(given[0])) return LF.kernel.array(buffer, given);
  if (Array.isArray(given)) return given.map((inner) => LF.kernel.unpack(buffer, inner));
  if (given && typeof given === "object") return Object.fromEntries(Object.entries(given).map(([key, inner]) => [key, LF.kernel.unpack(buffer, inner)]));
  return given;
};
