// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Wires what the bus says to the cloud, the paths, the charts and the table.
"use strict";

const kPathStyles = {
  lio: { colour: "#e8772e", width: 6 },
  fusion: { colour: "#17853c", width: 3.5 },
  gps: { colour: "#1f6fbf", width: 1.5 },
}; // drawn in this order, so that each is seen where they lie over each other
const kAxisNames = ["east", "north", "up"];
const kLioHealth = ["starting", "ok", "degraded", "lost", "stale"];
const kGpsHealth = ["starting", "ok", "degraded", "dead reckoning", "stale", "fault"];
const kGnssClasses = ["none", "unknown", "code", "SBAS", "float", "fixed"];
const kNewDrive_s = 5; // data time that goes back by more: another drive began
const kFrame_ms = 50; // between two pictures: the computer may be the robot's own
const kGap_m = 4; // further apart than this, and some were lost between: not joined
const kMostWaitingClouds = 100; // before the first alignment

const byId = (id) => document.getElementById(id);
const history_ = new History();
const store = new CloudStore();
const camera = new Camera();
let painter = null;
let follow = true;
let now_s = 0;
let waitingClouds = []; // of before the alignment, in odom
let dirty = true;
let drawn_ms = 0;

function clearAll() {
  history_.clear();
  store.clear();
  waitingClouds = [];
  dirty = true;
}

function onTime(t) {
  if (t < now_s - kNewDrive_s) {
    clearAll();
  }
  now_s = t;
  dirty = true;
}

// A cloud stays where the alignment of its time puts it, as fusion/odometry does.
function onCloud(cloud) {
  const points = pointsOf(cloud);
  if (cloud.header.frame_id === "map") {
    store.add(points, kIdentity);
  } else if (history_.mapFromOdom) {
    waitingClouds.splice(0).forEach((earlier) => store.add(earlier, history_.mapFromOdom));
    store.add(points, history_.mapFromOdom);
  } else {
    waitingClouds.push(points);
    waitingClouds.splice(0, Math.max(0, waitingClouds.length - kMostWaitingClouds));
  }
}

const counted = (handle) => (message) => {
  dirty = true;
  handle(message);
};
const handlers = {
  "/cloud_registered": counted(onCloud),
  "/gps/odometry": counted((m) => history_.paths.gps.add(positionOf(m))),
  "/lio/odometry": counted((m) => history_.paths.lio.add(positionOf(m))),
  "/fusion/odometry": counted((m) => history_.paths.fusion.add(positionOf(m))),
  "/fusion/status": counted((m) => history_.addGate(m)),
  "/gps/status": counted((m) => history_.addGps(m)),
  "/lio/status": counted((m) => (history_.lio = m)),
};

// Each path in `map`; before the alignment there is only the one in `odom`.
function pathsInMap() {
  const t = history_.mapFromOdom ?? kIdentity;
  return {
    gps: history_.paths.gps.all(),
    lio: history_.paths.lio.all().map((point) => apply(t, point)),
    fusion: history_.paths.fusion.all(),
  };
}

function robotPosition(paths) {
  const best = [paths.fusion, paths.lio, paths.gps].find((path) => path.length);
  return best ? best[best.length - 1] : null;
}

// Screen position of a point of the map, or null when it is behind the camera.
function projector(matrix, width, height) {
  return ([x, y, z]) => {
    const clip = [0, 1, 3].map((row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row]);
    return clip[2] > 0.01 ? [((clip[0] / clip[2] + 1) / 2) * width, ((1 - clip[1] / clip[2]) / 2) * height] : null;
  };
}

function drawPath(c, project, points, spacing_m, style) {
  c.strokeStyle = style.colour;
  c.lineWidth = style.width;
  c.lineJoin = "round";
  c.beginPath();
  const longest_m = kGap_m + 2 * spacing_m;
  let before = null;
  for (const point of points) {
    const at = project(point);
    if (at) {
      const joined = before && Math.hypot(point[0] - before[0], point[1] - before[1], point[2] - before[2]) < longest_m;
      joined ? c.lineTo(...at) : c.moveTo(...at);
    }
    before = at ? point : null;
  }
  c.stroke();
}

function drawFixes(c, project) {
  for (const { point, accepted } of history_.fixes) {
    const at = project(point);
    if (at) {
      c.strokeStyle = accepted ? "#3b8fd9" : "#c0392b";
      c.lineWidth = 1.2;
      c.beginPath();
      c.moveTo(at[0] - 3, at[1] - 3);
      c.lineTo(at[0] + 3, at[1] + 3);
      c.moveTo(at[0] - 3, at[1] + 3);
      c.lineTo(at[0] + 3, at[1] - 3);
      c.stroke();
    }
  }
}

function drawRobot(c, project, robot) {
  const at = robot && project(robot);
  if (at) {
    c.fillStyle = "#17853c";
    c.strokeStyle = "#ffffff";
    c.lineWidth = 2.5;
    c.beginPath();
    c.arc(at[0], at[1], 7, 0, 2 * Math.PI);
    c.fill();
    c.stroke();
  }
}

function drawScale(c, width, height) {
  const perPixel = camera.metresPerPixel(height);
  const length_m = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].find((m) => m / perPixel > 60) ?? 10000;
  const length_px = length_m / perPixel;
  c.strokeStyle = "#222";
  c.fillStyle = "#222";
  c.lineWidth = 2;
  c.beginPath();
  c.moveTo(16, height - 16);
  c.lineTo(16 + length_px, height - 16);
  c.stroke();
  c.font = "12px sans-serif";
  c.fillText(`${length_m} m`, 16, height - 22);
}

function drawView() {
  const canvas = byId("cloud");
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const paths = pathsInMap();
  const robot = robotPosition(paths);
  if (follow && robot) {
    camera.target = [...robot];
  }
  const ground_m = (robot ?? [0, 0, 0])[2] - 1.5; // a robot's IMU is about so high
  const matrix = camera.viewProjection(width / height);
  painter?.draw(matrix, [ground_m, ground_m + 12], (0.28 * canvas.height) / (2 * Math.tan(kFieldOfView_rad / 2)));
  const { context } = sharpContext(byId("overlay"));
  const project = projector(matrix, width, height);
  drawFixes(context, project);
  for (const [key, style] of Object.entries(kPathStyles)) {
    if (byId(`show-${key}`).checked) {
      drawPath(context, project, paths[key], history_.paths[key].spacing_m, style);
    }
  }
  drawRobot(context, project, robot);
  drawScale(context, width, height);
}

const metres = (value) => (Number.isFinite(value) ? `${value < 10 ? value.toFixed(2) : value.toFixed(0)} m` : "-");

function row(cells) {
  const line = document.createElement("tr");
  for (const { text, colour } of cells) {
    const cell = line.insertCell();
    cell.textContent = text; // never HTML: the words come from the network
    cell.style.background = colour ?? "";
  }
  return line;
}

function fillTables() {
  const { gate, lio, gps } = history_;
  byId("axes").replaceChildren(
    ...(gate?.axes ?? []).map((axis, i) =>
      row([{ text: kAxisNames[i] }, { text: kSources[axis.source]?.name ?? "?", colour: kSources[axis.source]?.colour }, { text: metres(axis.sigma_m) }, { text: metres(axis.threshold_m) }, { text: axis.reason }]),
    ),
  );
  const lines = [
    ["gate", gate ? `mode ${gate.mode}, ${gate.aligned ? "aligned" : "not aligned yet"}, ${gate.fixes_used} of ${gate.fixes_seen} fixes used` : "not heard"],
    ["last fix", gate?.verdict.reason || (gate?.fixes_seen ? "used" : "-")],
    ["GPS filter", gps ? `${kGpsHealth[gps.health]}, ${kGnssClasses[gps.gnss_class]}, ${gps.source}` : "not heard"],
    ["LIO", lio ? `${kLioHealth[lio.health]}, ${lio.scan_ms.toFixed(0)} ms a scan, ${lio.distance_m.toFixed(0)} m driven` : "not heard"],
    ["map", `${store.count.toLocaleString("en")} points shown`],
  ];
  byId("facts").replaceChildren(...lines.map(([name, text]) => row([{ text: name }, { text }])));
  byId("time").textContent = now_s > 0 ? new Date(now_s * 1000).toISOString().replace("T", " ").slice(0, 19) + " UTC (data)" : "";
}

function draw(t_ms) {
  if (dirty && t_ms - drawn_ms >= kFrame_ms) {
    dirty = false;
    drawn_ms = t_ms;
    drawView();
  }
  requestAnimationFrame(draw);
}

function drawSlowly() {
  fillTables();
  kAxisNames.forEach((name, axis) => drawAxisChart(byId(`chart-${name}`), history_.statuses, axis));
}

function showWhole() {
  const points = Object.values(pathsInMap()).flat();
  if (points.length) {
    const low = [0, 1, 2].map((axis) => points.reduce((least, point) => Math.min(least, point[axis]), Infinity));
    const high = [0, 1, 2].map((axis) => points.reduce((most, point) => Math.max(most, point[axis]), -Infinity));
    follow = byId("follow").checked = false;
    camera.fit(low.map((v) => v - 15), high.map((v) => v + 15), byId("cloud").clientWidth / byId("cloud").clientHeight);
  }
}

function listenToMouse() {
  const view = byId("overlay");
  const changed = () => (dirty = true);
  view.addEventListener("pointermove", (event) => {
    if (event.buttons === 0) {
      return;
    }
    if (event.buttons === 1 && !event.shiftKey) {
      camera.turn(event.movementX, event.movementY);
    } else {
      follow = byId("follow").checked = false;
      camera.pan(event.movementX, event.movementY, view.clientHeight);
    }
    changed();
  });
  view.addEventListener("contextmenu", (event) => event.preventDefault());
  view.addEventListener("wheel", (event) => (event.preventDefault(), camera.zoom(event.deltaY * 0.001), changed()), { passive: false });
  byId("top").onclick = () => (camera.lookDown(), changed());
  byId("aslant").onclick = () => (camera.lookAslant(), changed());
  byId("whole").onclick = () => (showWhole(), changed());
  byId("clear").onclick = clearAll;
  byId("follow").onchange = (event) => ((follow = event.target.checked), changed());
  Object.keys(kPathStyles).forEach((key) => (byId(`show-${key}`).onchange = changed));
  window.addEventListener("resize", changed);
}

function start() {
  try {
    painter = new CloudPainter(byId("cloud"), store);
  } catch (error) {
    byId("trouble").textContent = error.message;
  }
  listenToMouse();
  const view = new URLSearchParams(location.search).get("view"); // ?view=top, whole: for pictures
  if (view) {
    camera.lookDown();
    setInterval(() => view === "whole" && showWhole(), 1000);
  }
  connect(`ws://${location.host}/`, handlers, (text, connected) => {
    byId("state").textContent = text;
    byId("state").className = connected ? "good" : "bad";
  }, onTime);
  setInterval(drawSlowly, 500);
  requestAnimationFrame(draw);
}

start();
