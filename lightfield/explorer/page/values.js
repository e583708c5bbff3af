"use strict";
// Numbers as people read them, elements, and how a slider's position becomes a value.
const LF = { dragging: false };

LF.$ = (id) => document.getElementById(id);

LF.make = (name, attributes = {}, ...children) => {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key in element && key !== "list" && typeof value !== "string") element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
};

LF.number = (value, digits = 3) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(Math.max(0, digits - 1)).replace("-", "−").replace("e−", "e-");
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 8)).replace("-", "−");
};

// As people type it: a comma is a point.
LF.read = (text) => { const plain = text.trim().replace(",", ".").replace("−", "-"); return plain === "" ? NaN : Number(plain); };

LF.over = (value, count) => (value === null || value === undefined ? null : value / count);

LF.percent = (value) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value >= 1e5) return `${LF.number(value, 2)} %`;
  return (value >= 99.5 ? value.toFixed(0) : value >= 0.05 ? value.toFixed(1) : value >= 0.0005 ? value.toFixed(3) : "0.0") + " %";
};

// Is an error as small as the noise leaves it? The floor in per cent is that of the dim readings: bright ones may be
// missed below it, which chi-square tells. A model that is dark has no error in per cent.
LF.met = (error, floor, chi2PerDof) => Number.isFinite(error) && Number.isFinite(floor) && error <= 1.2 * floor
  && Number.isFinite(chi2PerDof) && Math.sqrt(chi2PerDof) <= 1.2;

// What the fit moves, u, and the value of the scene: the coordinates of lightfield/fitting/parameter.py.
LF.valueAt = (coordinate, u) => {
  if (coordinate === "log") return Math.exp(u);
  if (coordinate === "square") return u > 0 ? Math.sqrt(u) : 0;
  if (coordinate === "inverse-square") return u > 0 ? 10 / Math.sqrt(u) : 0;
  return u;
};
LF.coordinateOf = (coordinate, value) => {
  if (coordinate === "log") return Math.log(value);
  if (coordinate === "square") return value * value;
  if (coordinate === "inverse-square") return value > 0 ? (10 / value) ** 2 : 0;
  return value;
};

// A slider goes from 0 to 1. Around a neutral value it is fine, as a cube is; without one it is even.
LF.slide = (p) => {
  const at = p.neutral === null ? null : LF.coordinateOf(p.coordinate, p.neutral);
  const span = p.high - p.low;
  const inside = at !== null && at >= p.low && at <= p.high;
  const low = inside ? -Math.cbrt((at - p.low) / span) : 0;
  const high = inside ? Math.cbrt((p.high - at) / span) : 1;
  return {
    value: (t) => {
      const s = low + t * (high - low);
      const u = inside ? at + span * s * s * s : p.low + span * s;
      return LF.valueAt(p.coordinate, Math.min(p.high, Math.max(p.low, u)));
    },
    position: (value) => {
      const u = LF.coordinateOf(p.coordinate, value);
      const s = inside ? Math.cbrt((u - at) / span) : (u - p.low) / span;
      return Math.min(1, Math.max(0, (s - low) / (high - low)));
    },
  };
};
