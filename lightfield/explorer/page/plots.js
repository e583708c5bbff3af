"use strict";
// Drawings: axes, lines and points as SVG; every one has a text that says what it shows.
LF.svg = (name, attributes = {}, text = null) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== null) element.textContent = text;
  return element;
};

LF.ticks = (low, high, count) => {
  const rough = (high - low) / Math.max(1, count);
  if (!(rough > 0) || !Number.isFinite(rough)) return [low];
  const unit = 10 ** Math.floor(Math.log10(rough));
  const at = [1, 2, 5, 10].findIndex((m) => m * unit >= rough);
  for (const m of [[1, 2, 5, 10][at], [0.5, 1, 2, 5][at]]) {
    const step = m * unit, out = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-9) + 1e-12 && out.length < 50; k++) out.push(k * step);
    if (out.length > 1) return out;
  }
  return [low];
};

LF.logTicks = (low, high) => {
  const out = [];
  const decades = Math.log10(high / low);
  for (let k = Math.floor(Math.log10(low)); k <= Math.ceil(Math.log10(high)); k++) {
    for (const m of decades > 3 ? [1] : decades > 1.2 ? [1, 3] : [1, 2, 5]) {
      const at = m * 10 ** k;
      if (at >= low * 0.999 && at <= high * 1.001) out.push(at);
    }
  }
  return out.length > 1 ? out : LF.ticks(low, high, 4);
};

LF.extent = (arrays, keep = () => true) => {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) for (const value of array) {
    if (Number.isFinite(value) && keep(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  }
  return low <= high ? [low, high] : [0, 1];
};

// plot(host, {x: [low, high], y: [low, high], log, label, xLabel, yLabel, bands, lines, points, zero, height})
LF.plot = (host, given) => {
  const width = Math.max(240, host.clientWidth || 420), height = given.height || 190;
  const left = 46, right = 8, top = given.key ? 18 : 6, bottom = 30;
  let [x0, x1] = given.x, [y0, y1] = given.y;
  if (x0 === x1) { x0 -= 0.5; x1 += 0.5; }
  if (given.log) { y0 = Math.max(y0, y1 * 1e-6); if (y0 === y1) { y0 /= 2; y1 *= 2; } } else if (y0 === y1) { y0 -= 1; y1 += 1; }
  const sx = (v) => left + ((v - x0) / (x1 - x0)) * (width - left - right);
  const part = given.log ? (v) => Math.log(Math.max(v, y0 * 1e-3) / y0) / Math.log(y1 / y0) : (v) => (v - y0) / (y1 - y0);
  const sy = (v) => Math.min(height + 400, Math.max(-400, top + (1 - part(v)) * (height - top - bottom)));
  const svg = LF.svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": given.label });
  const clip = `${host.id}-clip`;
  const frame = LF.svg("clipPath", { id: clip });
  frame.append(LF.svg("rect", { x: left - 4, y: top - 4, width: width - left - right + 8, height: height - top - bottom + 8 }));
  svg.append(frame);
  for (const v of LF.ticks(x0, x1, Math.floor(width / 90))) {
    svg.append(LF.svg("line", { class: "grid", x1: sx(v), x2: sx(v), y1: top, y2: height - bottom }));
    svg.append(LF.svg("text", { x: sx(v), y: height - bottom + 13, "text-anchor": "middle" }, LF.tick(v)));
  }
  for (const v of given.log ? LF.logTicks(y0, y1) : LF.ticks(y0, y1, Math.floor(height / 45))) {
    svg.append(LF.svg("line", { class: "grid", x1: left, x2: width - right, y1: sy(v), y2: sy(v) }));
    svg.append(LF.svg("text", { x: left - 5, y: sy(v) + 4, "text-anchor": "end" }, LF.tick(v)));
  }
  svg.append(LF.svg("text", { x: width - right, y: height - 4, "text-anchor": "end" }, given.xLabel));
  const inner = LF.svg("g", { "clip-path": `url(#${clip})` });
  for (const [low, high] of given.bands || []) {
    inner.append(LF.svg("rect", { class: "band", x: left, width: width - left - right, y: sy(high), height: Math.max(0, sy(low) - sy(high)) }));
  }
  if (given.zero !== undefined) inner.append(LF.svg("line", { class: "zero", x1: left, x2: width - right, y1: sy(given.zero), y2: sy(given.zero) }));
  for (const line of given.lines || []) {
    let d = "", pen = "M";
    for (let k = 0; k < line.x.length; k++) {
      if (!Number.isFinite(line.y[k]) || (given.log && line.y[k] <= 0)) { pen = "M"; continue; }
      d += `${pen}${sx(line.x[k]).toFixed(1)} ${sy(line.y[k]).toFixed(1)}`;
      pen = "L";
    }
    inner.append(LF.svg("path", { class: line.class, d }));
  }
  for (const points of given.points || []) {
    let dots = "", bars = "";
    for (let k = 0; k < points.x.length; k++) {
      const y = points.y[k];
      if (!Number.isFinite(y) || (given.log && y <= 0)) continue;
      const px = sx(points.x[k]).toFixed(1), py = sy(y), r = points.r || 2.4;
      dots += `M${px} ${(py - r).toFixed(1)}a${r} ${r} 0 1 0 .01 0Z`;
      if (points.error) {
        const e = points.error[k];
        bars += `M${px} ${sy(y + e).toFixed(1)}V${sy(given.log ? Math.max(y - e, y0 * 1e-2) : y - e).toFixed(1)}`;
      }
    }
    if (bars) inner.append(LF.svg("path", { class: "bars", d: bars }));
    inner.append(LF.svg("path", { class: points.class || "dots", d: dots }));
  }
  svg.append(inner);
  let at = left;
  for (const [kind, text] of given.key || []) {
    svg.append(LF.svg("text", { class: `key t-${kind}`, x: at, y: 11 }, text));
    at += 8 * text.length + 12;
  }
  host.replaceChildren(svg);
};

LF.tick = (value) => {
  const size = Math.abs(value);
  if (size < 1e-12) return "0";
  if (size >= 1e4 || size < 1e-3) return value.toExponential(0).replace("-", "−").replace("e−", "e-");
  return String(Number(value.toPrecision(4))).replace("-", "−");
};
