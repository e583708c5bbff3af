"use strict";
// Maps on canvases: render and formula in one scale of blues, their ratio in orange (too little) and blue (too much)
// over a factor of ten either way. Where there is no water, or nothing to compare with, they are grey.
LF.dark = [[8, 20, 40], [10, 60, 120], [11, 107, 184], [80, 170, 225], [190, 225, 245], [255, 252, 225]];
LF.parting = [[150, 60, 10], [214, 120, 60], [240, 200, 170], [245, 245, 245], [170, 205, 235], [70, 140, 200], [10, 70, 140]];
LF.none = [140, 140, 140, 255];

LF.shade = (ramp, t, out, k) => {
  const at = Math.min(0.9999, Math.max(0, t)) * (ramp.length - 1), i = Math.floor(at), f = at - i;
  for (let c = 0; c < 3; c++) out[k + c] = ramp[i][c] + f * (ramp[i + 1][c] - ramp[i][c]);
  out[k + 3] = 255;
};

// Rows of the arrays run with +y; the first row of a picture is its top.
LF.paintMap = (canvas, values, side, tone) => {
  if (canvas.width !== side) { canvas.width = side; canvas.height = side; }
  const context = canvas.getContext("2d"), image = context.createImageData(side, side), out = image.data;
  for (let row = 0; row < side; row++) for (let column = 0; column < side; column++) {
    const value = values[(side - 1 - row) * side + column], k = 4 * (row * side + column);
    if (Number.isFinite(value)) tone(value, out, k);
    else out.set(LF.none, k);
  }
  context.putImageData(image, 0, 0);
};

// What colours and edges of the maps mean, and between what the ratio lies where there is light to compare.
LF.mapsSaid = (ratio, x, y, log) => {
  // Of the outer cells the edges: places are the middles of cells.
  const edges = (at) => [-1, 1].map((end) => LF.number(at.at(end < 0 ? 0 : -1) + 0.5 * end * (at[1] - at[0]), 3));
  const reach = (name, at) => `${name} from ${edges(at).join(" to ")} m`;
  const known = ratio.filter(Number.isFinite), low = LF.number(Math.min(...known)), high = LF.number(Math.max(...known));
  const between = known.length ? ` Formula over render: ${low === high ? low + " everywhere" : low + " to " + high}.` : "";
  const darkest = log ? "a thousandth of the brightest, or less," : "nothing";
  LF.$("map-said").textContent = `Colours go from ${darkest} to the brightest; ${reach("x", x)}, ${reach("y", y)}.${between}`;
};

LF.blank = (canvas) => { canvas.width = canvas.width; };

LF.paintMaps = (render, formula, side, log) => {
  // A plane in a shallow tank is no square: a round beam must look round in it.
  const { map_x_m: x, map_y_m: y } = LF.experiment, wide = (x[side - 1] - x[0]) / (y[side - 1] - y[0]);
  for (const id of ["map-render", "map-formula", "map-ratio"]) LF.$(id).style.aspectRatio = Number.isFinite(wide) && wide > 0 ? wide : 1;
  LF.$("map-said").textContent = "";
  if (!formula) { for (const id of ["map-render", "map-formula", "map-ratio"]) LF.blank(LF.$(id)); return; }
  const top = LF.extent([render || formula])[1], floor = 1e-3;
  const tone = log
    ? (v, out, k) => LF.shade(LF.dark, 1 + Math.log10(Math.max(v / top, floor)) / 3, out, k)
    : (v, out, k) => LF.shade(LF.dark, v / top, out, k);
  LF.paintMap(LF.$("map-formula"), formula, side, tone);
  LF.mapsSaid([], x, y, log);
  if (!render) { LF.blank(LF.$("map-render")); LF.blank(LF.$("map-ratio")); return; }
  LF.paintMap(LF.$("map-render"), render, side, tone);
  const ratio = Array.from(render, (v, k) => (v > 0 ? formula[k] / v : NaN));
  LF.paintMap(LF.$("map-ratio"), ratio, side, (v, out, k) => LF.shade(LF.parting, 0.5 + Math.log10(Math.max(v, 1e-3)) / 2, out, k));
  LF.mapsSaid(ratio.filter((v, k) => render[k] > floor * top), x, y, log);
};
