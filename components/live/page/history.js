// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the page remembers of a drive, bounded: paths, fixes and what the gate said.
"use strict";

const kMostPathPoints = 8000; // then every second one is forgotten and the spacing doubles
const kMostFixes = 3000;
const kMostStatuses = 6000;

class Path {
  constructor(spacing_m) {
    this.first_spacing_m = spacing_m;
    this.clear();
  }

  clear() {
    this.points = [];
    this.newest = null;
    this.spacing_m = this.first_spacing_m;
  }

  add(point) {
    if (!point.every(Number.isFinite)) {
      return;
    }
    const last = this.points[this.points.length - 1];
    if (!last || Math.hypot(...point.map((value, axis) => value - last[axis])) >= this.spacing_m) {
      this.points.push(point);
    }
    this.newest = point;
    if (this.points.length > kMostPathPoints) {
      this.points = this.points.filter((_, index) => index % 2 === 0);
      this.spacing_m *= 2;
    }
  }

  all() {
    return this.newest ? [...this.points, this.newest] : this.points;
  }
}

const seconds = (stamp) => stamp.sec + stamp.nanosec * 1e-9;
const positionOf = (odometry) => {
  const { x, y, z } = odometry.pose.pose.position;
  return [x, y, z];
};

// Row-major 3x4 of a YawPose: R = Rz(yaw) exp((tilt x, tilt y, 0)), Rodrigues' formula.
function transformOf(pose) {
  const [tx, ty] = pose.tilt_rad;
  const angle = Math.hypot(tx, ty);
  const [ax, ay] = angle > 1e-12 ? [tx / angle, ty / angle] : [1, 0];
  const [c, s, k] = [Math.cos(angle), Math.sin(angle), 1 - Math.cos(angle)];
  const tilt = [[c + ax * ax * k, ax * ay * k, ay * s], [ax * ay * k, c + ay * ay * k, -ax * s], [-ay * s, ax * s, c]];
  const [cy, sy] = [Math.cos(pose.yaw_rad), Math.sin(pose.yaw_rad)];
  const rows = [0, 1, 2].map((j) => [cy * tilt[0][j] - sy * tilt[1][j], sy * tilt[0][j] + cy * tilt[1][j], tilt[2][j]]);
  const p = pose.position_m;
  return [0, 1, 2].flatMap((row) => [rows[0][row], rows[1][row], rows[2][row], [p.x, p.y, p.z][row]]);
}

const kIdentity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
const apply = (t, p) => [0, 4, 8].map((row) => t[row] * p[0] + t[row + 1] * p[1] + t[row + 2] * p[2] + t[row + 3]);

class History {
  constructor() {
    this.paths = { gps: new Path(0.3), lio: new Path(0.3), fusion: new Path(0.3) };
    this.clear();
  }

  clear() {
    Object.values(this.paths).forEach((path) => path.clear());
    this.fixes = []; // {point, accepted}
    this.lastFix_s = -Infinity;
    this.statuses = []; // {t, axes: [{source, sigma, threshold, alignment}]}
    this.gate = this.lio = this.gps = null; // newest status of each
    this.mapFromOdom = null; // the newest alignment
  }

  addGate(status) {
    this.gate = status;
    if (status.aligned) {
      this.mapFromOdom = transformOf(status.t_map_odom);
    }
    const t = seconds(status.stamp);
    const axes = status.axes.map((axis, i) => ({ source: axis.source, sigma: axis.sigma_m, threshold: axis.threshold_m, alignment: status.position_sigma_m[i] }));
    if (t > 0 && t > (this.statuses[this.statuses.length - 1]?.t ?? 0)) {
      this.statuses.push({ t, axes });
    }
    if (this.statuses.length > kMostStatuses) {
      this.statuses.splice(0, kMostStatuses / 4);
    }
  }

  addGps(status) {
    this.gps = status;
    for (const fix of status.recent_fixes) {
      const t = seconds(fix.stamp);
      const point = Array.from(fix.antenna_map_m);
      if (t > this.lastFix_s && point.every(Number.isFinite)) {
        this.lastFix_s = t;
        this.fixes.push({ point, accepted: fix.accepted });
      }
    }
    if (this.fixes.length > kMostFixes) {
      this.fixes.splice(0, kMostFixes / 4);
    }
  }
}
