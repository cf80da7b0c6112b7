// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The registered clouds, thinned to one point a voxel, and WebGL that draws them.
"use strict";

const kMostPoints = 1500000; // then the oldest give way
const kVoxel_m = 0.25;
const kHashBits = 22;

const kVertexShader = `
attribute vec3 position;
uniform mat4 view_projection;
uniform vec2 height_range;
uniform float point_px;
varying float level;
void main() {
  gl_Position = view_projection * vec4(position, 1.0);
  gl_PointSize = clamp(point_px / gl_Position.w, 1.2, 5.0);
  level = clamp((position.z - height_range.x) / (height_range.y - height_range.x), 0.0, 1.0);
}`;
// Ground pale, walls blue, tops dark: the lines over it stay readable.
const kFragmentShader = `
precision mediump float;
varying float level;
void main() {
  vec3 ground = vec3(0.78, 0.76, 0.71), wall = vec3(0.38, 0.52, 0.68), top = vec3(0.20, 0.18, 0.42);
  gl_FragColor = vec4(level < 0.35 ? mix(ground, wall, level / 0.35) : mix(wall, top, (level - 0.35) / 0.65), 1.0);
}`;

// x, y, z of a PointCloud2 as three numbers each; only float32 fields, as the mapper writes them.
function pointsOf(cloud) {
  const offset = (name) => cloud.fields.find((field) => field.name === name && field.datatype === 7)?.offset;
  const [x, y, z] = ["x", "y", "z"].map(offset);
  const count = x === undefined || y === undefined || z === undefined ? 0 : Math.floor(cloud.data.length / cloud.point_step);
  const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
  const little = !cloud.is_bigendian;
  const points = new Float32Array(3 * count);
  for (let i = 0, at = 0; i < count; ++i, at += cloud.point_step) {
    points[3 * i] = view.getFloat32(at + x, little);
    points[3 * i + 1] = view.getFloat32(at + y, little);
    points[3 * i + 2] = view.getFloat32(at + z, little);
  }
  return points;
}

class CloudStore {
  constructor() {
    this.points = new Float32Array(3 * kMostPoints);
    this.taken = new Int32Array(1 << kHashBits);
    this.clear();
  }

  clear() {
    this.taken.fill(0);
    this.count = 0; // points that may be drawn
    this.next = 0; // where the next one goes
    this.changed = [0, 0];
  }

  // Keeps the points whose voxel had none. `transform` is row-major 3x4.
  add(points, transform) {
    const begin = this.next;
    const t = transform;
    for (let i = 0; i < points.length; i += 3) {
      const [px, py, pz] = [points[i], points[i + 1], points[i + 2]];
      const x = t[0] * px + t[1] * py + t[2] * pz + t[3];
      const y = t[4] * px + t[5] * py + t[6] * pz + t[7];
      const z = t[8] * px + t[9] * py + t[10] * pz + t[11];
      if (Number.isFinite(x + y + z) && this.claim(x, y, z)) {
        this.points[3 * this.next] = x;
        this.points[3 * this.next + 1] = y;
        this.points[3 * this.next + 2] = z;
        if (++this.next === kMostPoints) {
          this.taken.fill(0);
          this.next = 0;
        }
        this.count = Math.max(this.count, this.next || kMostPoints);
      }
    }
    this.changed = this.next >= begin ? [this.changed[0], Math.max(this.changed[1], this.next)] : [0, kMostPoints];
  }

  // False when the voxel has a point. Of two voxels with one hash the second stays empty: rare, and harmless.
  claim(x, y, z) {
    const key =
      (Math.imul(Math.floor(x / kVoxel_m), 73856093) ^ Math.imul(Math.floor(y / kVoxel_m), 19349663) ^ Math.imul(Math.floor(z / kVoxel_m), 83492791)) | 1;
    let slot = Math.imul(key, 0x9e3779b1) >>> (32 - kHashBits);
    for (let tries = 0; tries < 16; ++tries, slot = (slot + 1) & ((1 << kHashBits) - 1)) {
      if (this.taken[slot] === key) {
        return false;
      }
      if (this.taken[slot] === 0) {
        this.taken[slot] = key;
        return true;
      }
    }
    return false;
  }
}

class CloudPainter {
  // Throws where there is no WebGL.
  constructor(canvas, store) {
    this.store = store;
    this.gl = canvas.getContext("webgl", { antialias: true });
    if (!this.gl) {
      throw new Error("this browser has no WebGL: the cloud is not shown");
    }
    const gl = this.gl;
    this.program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, kVertexShader], [gl.FRAGMENT_SHADER, kFragmentShader]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    gl.useProgram(this.program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, 12 * kMostPoints, gl.DYNAMIC_DRAW);
    const position = gl.getAttribLocation(this.program, "position");
    gl.enableVertexAttribArray(position);
    gl.vertexAttribPointer(position, 3, gl.FLOAT, false, 0, 0);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0.965, 0.97, 0.976, 1);
  }

  // viewProjection column-major; heights in metres of what is pale and what is dark.
  draw(viewProjection, heights, pointScale_px) {
    const { gl, store } = this;
    const [begin, end] = store.changed;
    if (end > begin) {
      gl.bufferSubData(gl.ARRAY_BUFFER, 12 * begin, store.points.subarray(3 * begin, 3 * end));
    }
    store.changed = [store.next, store.next];
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const uniform = (name) => gl.getUniformLocation(this.program, name);
    gl.uniformMatrix4fv(uniform("view_projection"), false, viewProjection);
    gl.uniform2f(uniform("height_range"), heights[0], heights[1]);
    gl.uniform1f(uniform("point_px"), pointScale_px);
    gl.drawArrays(gl.POINTS, 0, store.count);
  }
}
