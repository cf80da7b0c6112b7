// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A camera that circles a point of the map, turned with the mouse. Matrices are column-major.
"use strict";

const kFieldOfView_rad = 0.7;
const kSteepest_rad = Math.PI / 2 - 1e-3; // straight down, with north still up

function multiply(a, b) {
  const c = new Float32Array(16);
  for (let column = 0; column < 4; ++column) {
    for (let row = 0; row < 4; ++row) {
      for (let k = 0; k < 4; ++k) {
        c[4 * column + row] += a[4 * k + row] * b[4 * column + k];
      }
    }
  }
  return c;
}

class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.distance_m = 90;
    this.yaw_rad = -0.35;
    this.pitch_rad = 0.8; // above the horizon
  }

  viewProjection(aspect) {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw_rad), Math.sin(this.yaw_rad), Math.cos(this.pitch_rad), Math.sin(this.pitch_rad)];
    const right = [cy, sy, 0];
    const up = [-sy * sp, cy * sp, cp];
    const back = [sy * cp, -cy * cp, sp]; // from the target to the eye
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const t = this.target;
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, t), -dot(up, t), -dot(back, t) - this.distance_m, 1];
    const f = 1 / Math.tan(kFieldOfView_rad / 2);
    const [near, far] = [this.distance_m / 100, this.distance_m * 30];
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return multiply(projection, view);
  }

  // How far a pixel at the target is, in metres.
  metresPerPixel(height_px) {
    return (2 * this.distance_m * Math.tan(kFieldOfView_rad / 2)) / height_px;
  }

  turn(dx_px, dy_px) {
    this.yaw_rad -= dx_px * 0.006;
    this.pitch_rad = Math.min(kSteepest_rad, Math.max(0.03, this.pitch_rad + dy_px * 0.006));
  }

  pan(dx_px, dy_px, height_px) {
    const scale = this.metresPerPixel(height_px);
    const [c, s] = [Math.cos(this.yaw_rad), Math.sin(this.yaw_rad)];
    const [dx, dy] = [-dx_px * scale, (dy_px * scale) / Math.max(0.2, Math.sin(this.pitch_rad))];
    this.target = [this.target[0] + c * dx - s * dy, this.target[1] + s * dx + c * dy, this.target[2]];
  }

  zoom(steps) {
    this.distance_m = Math.min(20000, Math.max(3, this.distance_m * Math.exp(steps)));
  }

  lookDown() {
    this.yaw_rad = 0;
    this.pitch_rad = kSteepest_rad;
  }

  lookAslant() {
    this.yaw_rad = -0.35;
    this.pitch_rad = 0.8;
  }

  // All of a box; `aspect` is width by height of the picture.
  fit(low, high, aspect) {
    this.target = low.map((value, axis) => (value + high[axis]) / 2);
    const size = Math.max((high[0] - low[0]) / aspect, high[1] - low[1], 20);
    this.distance_m = (0.72 * size) / Math.tan(kFieldOfView_rad / 2);
  }
}
