// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Uncertainty of each axis over time, on a logarithmic scale, over the gate's choices as bands.
"use strict";

const kSources = [
  { name: "none", colour: "#d9d9d9" },
  { name: "LIO", colour: "#f7c59f" },
  { name: "fused", colour: "#b9e3c0" },
  { name: "GPS", colour: "#b7d4f0" },
];
const kLines = [
  { key: "alignment", colour: "#555555", width: 1.2, dash: [] },
  { key: "threshold", colour: "#c00000", width: 1.3, dash: [5, 4] },
  { key: "sigma", colour: "#1f6fbf", width: 1.8, dash: [] },
];
const kLowest_m = 0.01;
const kHighest_m = 100;
const kWindow_s = 240;

// A canvas in device pixels whose context takes CSS pixels.
function sharpContext(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function drawAxisChart(canvas, statuses, axis) {
  const { context: c, width, height } = sharpContext(canvas);
  const [left, right, top, bottom] = [42, width - 6, 7, height - 16];
  const end = statuses.length ? statuses[statuses.length - 1].t : 0;
  const begin = Math.max(statuses.length ? statuses[0].t : 0, end - kWindow_s);
  const span = Math.max(end - begin, 10);
  const x = (t) => left + ((t - begin) / span) * (right - left);
  const y = (metres) => {
    const share = Math.log(Math.min(Math.max(metres, kLowest_m), kHighest_m) / kLowest_m) / Math.log(kHighest_m / kLowest_m);
    return bottom - share * (bottom - top);
  };
  const shown = statuses.filter((status) => status.t >= begin);
  shown.forEach((status, i) => {
    c.fillStyle = kSources[status.axes[axis].source]?.colour ?? "#ffffff";
    const until = i + 1 < shown.length ? shown[i + 1].t : end;
    c.fillRect(x(status.t), top, Math.max(x(until) - x(status.t), 0) + 0.5, bottom - top);
  });
  c.font = "10px sans-serif";
  c.textBaseline = "middle";
  c.textAlign = "right";
  c.lineWidth = 1;
  for (const metres of [0.01, 0.1, 1, 10, 100]) {
    c.strokeStyle = "rgba(0,0,0,0.12)";
    c.beginPath();
    c.moveTo(left, y(metres));
    c.lineTo(right, y(metres));
    c.stroke();
    c.fillStyle = "#555";
    c.fillText(`${metres} m`, left - 4, y(metres));
  }
  for (const line of kLines) {
    c.strokeStyle = line.colour;
    c.lineWidth = line.width;
    c.setLineDash(line.dash);
    c.beginPath();
    let drawing = false;
    for (const status of shown) {
      const value = status.axes[axis][line.key];
      if (!Number.isFinite(value)) {
        drawing = false;
        continue;
      }
      drawing ? c.lineTo(x(status.t), y(value)) : c.moveTo(x(status.t), y(value));
      drawing = true;
    }
    c.stroke();
    c.setLineDash([]);
  }
  c.textBaseline = "alphabetic";
  c.fillStyle = "#555";
  c.textAlign = "left";
  c.fillText(`-${Math.round(span)} s`, left, height - 4);
  c.textAlign = "right";
  c.fillText("now", right, height - 4);
}
