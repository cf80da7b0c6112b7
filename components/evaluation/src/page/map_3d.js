// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The map in 3-D: points, trajectories, and a camera that goes round a point. x east, y north, z up.
'use strict';
(() => {
  const scene = window.trigpoint_scene;
  const canvas = document.getElementById('view');
  if (!scene || !canvas) return;
  const told = document.getElementById('view-text');

  const decode = (id) => {
    const element = document.getElementById(id);
    const text = atob(element.textContent);
    element.remove();
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return bytes;
  };
  const places = new Uint16Array(decode('scene-points').buffer);
  const intensities = decode('scene-intensities');

  const BACKGROUND = [0.071, 0.082, 0.102];
  const PAPER = [1, 1, 1];
  const COLOURS = {fused: [0.2, 0.95, 0.45], lio: [1.0, 0.6, 0.25], gps: [0.4, 0.7, 1.0], truth: [1.0, 0.83, 0.2]};
  const WIDTHS = {truth: 6, fused: 3.5, gps: 2, lio: 2};  // pixels
  const DROPOUT = [1.0, 0.35, 0.35];
  const FIELD_OF_VIEW = 0.9;  // rad, upright
  const POINT_m = 0.1;

  // ---- numbers: vectors and column-major matrices ----
  const add = (a, b) => a.map((v, i) => v + b[i]);
  const scale = (a, s) => a.map((v) => v * s);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const multiply = (a, b) => {
    const m = new Float32Array(16);
    for (let c = 0; c < 4; ++c) {
      for (let r = 0; r < 4; ++r) {
        for (let k = 0; k < 4; ++k) m[4 * c + r] += a[4 * k + r] * b[4 * c + k];
      }
    }
    return m;
  };

  // ---- what is looked at: the box of the trajectories, or of the points without any ----
  const low = [1e12, 1e12, 1e12];
  const high = [-1e12, -1e12, -1e12];
  const include = (p) => p.forEach((v, i) => { low[i] = Math.min(low[i], v); high[i] = Math.max(high[i], v); });
  for (const {values} of scene.tracks) {
    for (let i = 0; i < values.length; i += 4) include([...values.subarray(i + 1, i + 4)]);
  }
  if (scene.tracks.length === 0) {
    include(scene.low);
    include(add(scene.low, scale(scene.step, 65535)));
  }
  const centre = add(scale(low, 0.5), scale(high, 0.5));
  const extent_m = Math.max(Math.hypot(high[0] - low[0], high[1] - low[1]), 30);
  const axes_of = ({yaw, pitch}) => {
    const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const right = [-Math.sin(yaw), Math.cos(yaw), 0];
    const up = [-Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch)];
    return {back, right, up};
  };
  // So far away that the box's corners lie within the picture, with room for what is seen beside the trajectories.
  const distance_of = (direction) => {
    const {back, right, up} = axes_of(direction);
    const tangent = 0.88 * Math.tan(FIELD_OF_VIEW / 2);
    const aspect = Math.max(canvas.clientWidth, 1) / Math.max(canvas.clientHeight, 1);
    let distance_m = 30;
    for (let corner = 0; corner < 8; ++corner) {
      const p = add([0, 1, 2].map((i) => ((corner >> i) & 1 ? high[i] : low[i])), scale(centre, -1));
      const beside_m = Math.max(Math.abs(dot(p, up)), Math.abs(dot(p, right)) / aspect);
      distance_m = Math.max(distance_m, dot(p, back) + beside_m / tangent);
    }
    return distance_m;
  };
  const seen_from = (direction) => ({target: centre, ...direction, distance: distance_of(direction)});
  // Along the shorter side, so that the longer one lies across the picture.
  const whole = seen_from({yaw: high[0] - low[0] >= high[1] - low[1] ? -1.9 : -0.35, pitch: 0.72});
  let camera = {...whole};

  const axes = () => axes_of(camera);
  const matrix = () => {
    const {back, right, up} = axes();
    const eye = add(camera.target, scale(back, camera.distance));
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
                  -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const near = Math.max(0.05, camera.distance / 200);
    const far = camera.distance + 20 * extent_m;
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const projection = [(f * canvas.height) / canvas.width, 0, 0, 0, 0, f, 0, 0,
                        0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return multiply(projection, view);
  };

  // ---- programs ----
  const POINTS_VERTEX = `
    attribute vec3 place;
    attribute float intensity;
    uniform mat4 clip_map;
    uniform vec3 low, step_m;
    uniform vec2 heights;
    uniform float cut_m, px_per_m, size, by_intensity;
    varying vec3 colour;
    vec3 ramp(float t) {
      vec3 c = mix(vec3(0.36, 0.45, 0.72), vec3(0.16, 0.58, 0.72), clamp(t * 4.0, 0.0, 1.0));
      c = mix(c, vec3(0.42, 0.76, 0.62), clamp(t * 4.0 - 1.0, 0.0, 1.0));
      c = mix(c, vec3(0.93, 0.86, 0.55), clamp(t * 4.0 - 2.0, 0.0, 1.0));
      return mix(c, vec3(0.93, 0.55, 0.42), clamp(t * 4.0 - 3.0, 0.0, 1.0));
    }
    void main() {
      vec3 p = low + place * step_m;
      gl_Position = p.z > cut_m ? vec4(2.0, 2.0, 2.0, 1.0) : clip_map * vec4(p, 1.0);
      gl_PointSize = clamp(size * px_per_m / max(gl_Position.w, 0.01), 1.0, 24.0);
      float t = (p.z - heights.x) / (heights.y - heights.x);
      colour = by_intensity > 0.5 ? vec3(0.12 + 0.88 * intensity)
                                  : ramp(t) * (0.72 + 0.38 * intensity);
    }`;
  const POINTS_FRAGMENT = `
    precision mediump float;
    varying vec3 colour;
    void main() { gl_FragColor = vec4(colour, 1.0); }`;
  // A piece of a line is two triangles, as wide in pixels everywhere.
  const LINES_VERTEX = `
    attribute vec3 from, to;
    attribute vec2 corner;
    uniform mat4 clip_map;
    uniform vec2 viewport_px;
    uniform float width_px;
    void main() {
      vec4 a = clip_map * vec4(from, 1.0);
      vec4 b = clip_map * vec4(to, 1.0);
      const float nearest = 0.05;
      if (a.w < nearest && b.w > nearest) a = mix(a, b, (nearest - a.w) / (b.w - a.w));
      if (b.w < nearest && a.w > nearest) b = mix(b, a, (nearest - b.w) / (a.w - b.w));
      vec2 way = (b.xy / b.w - a.xy / a.w) * viewport_px;
      float length_px = length(way);
      way = length_px > 1e-4 ? way / length_px : vec2(1.0, 0.0);
      vec4 p = corner.x < 0.5 ? a : b;
      // Half a width longer at both ends: no notches in curves.
      vec2 offset = (vec2(-way.y, way.x) * corner.y + way * (corner.x - 0.5)) * width_px / viewport_px;
      gl_Position = vec4(p.xy + offset * p.w, p.z, p.w);
    }`;
  const LINES_FRAGMENT = `
    precision mediump float;
    uniform vec4 colour;
    void main() { gl_FragColor = colour; }`;
  const SPOT_VERTEX = `
    uniform mat4 clip_map;
    uniform vec3 place;
    uniform float size_px;
    void main() { gl_Position = clip_map * vec4(place, 1.0); gl_PointSize = size_px; }`;
  const SPOT_FRAGMENT = `
    precision mediump float;
    void main() {
      float r = length(gl_PointCoord - 0.5);
      if (r > 0.5) discard;
      gl_FragColor = r > 0.32 ? vec4(1.0) : vec4(0.1, 0.12, 0.15, 1.0);
    }`;

  let gl = null;
  let programs = null;
  let drawn_tracks = [];
  let spot = null;
  let on_paper = false;

  const program_of = (vertex, fragment) => {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const found = {program, uniforms: {}, attributes: {}};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const {name} = gl.getActiveUniform(program, i);
      found.uniforms[name] = gl.getUniformLocation(program, name);
    }
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); ++i) {
      const {name} = gl.getActiveAttrib(program, i);
      found.attributes[name] = gl.getAttribLocation(program, name);
    }
    return found;
  };
  const buffer_of = (values) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    return buffer;
  };
  const CORNERS = [[0, -1], [0, 1], [1, 1], [0, -1], [1, 1], [1, -1]];
  const ribbon_of = (values, is_drawn) => {
    const vertices = [];
    for (let i = 0; i + 4 < values.length; i += 4) {
      if (!is_drawn(values[i], values[i + 4])) continue;
      for (const corner of CORNERS) vertices.push(...values.subarray(i + 1, i + 4), ...values.subarray(i + 5, i + 8), ...corner);
    }
    return {buffer: buffer_of(new Float32Array(vertices)), count: vertices.length / 8};
  };
  const is_dropout = (from_s, to_s) => scene.dropouts.some(([begin_s, end_s]) => from_s >= begin_s && to_s <= end_s);

  const start = () => {
    gl = canvas.getContext('webgl', {antialias: true, preserveDrawingBuffer: true});
    if (!gl) {
      told.textContent = 'This browser shows no WebGL: the map in 3-D needs it.';
      return false;
    }
    programs = {
      points: program_of(POINTS_VERTEX, POINTS_FRAGMENT),
      lines: program_of(LINES_VERTEX, LINES_FRAGMENT),
      spot: program_of(SPOT_VERTEX, SPOT_FRAGMENT),
      places: buffer_of(places),
      intensities: buffer_of(intensities),
    };
    const hidden = new Set(drawn_tracks.filter((t) => t.hidden).map((t) => t.title));
    drawn_tracks = scene.tracks.map(({style, title, values}) => ({
      title, colour: COLOURS[style], width: WIDTHS[style], style, ...ribbon_of(values, () => true),
    }));
    const way = ['fused', 'gps', 'lio'].map((s) => scene.tracks.find((t) => t.style === s)).find((t) => t);
    if (way && scene.dropouts.length > 0) {
      drawn_tracks.unshift({title: 'GPS dropout', style: 'dropout-way', colour: DROPOUT, width: 16, ...ribbon_of(way.values, is_dropout)});
    }
    for (const track of drawn_tracks) track.hidden = hidden.has(track.title);
    return true;
  };

  // ---- drawing ----
  const control = (name) => document.getElementById(`view-${name}`);
  const cut_m = () => {
    const part = Number(control('cut').value);
    const top = scene.low[2] + 65535 * scene.step[2];
    return part >= 1 ? 1e9 : scene.low[2] + part * (top - scene.low[2]);
  };
  const attribute = (location, buffer, size, type, stride = 0, offset = 0) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, type, type === gl.UNSIGNED_BYTE, stride, offset);
  };
  const draw_points = (clip_map) => {
    const {program, uniforms, attributes} = programs.points;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.clip_map, false, clip_map);
    gl.uniform3fv(uniforms.low, scene.low);
    gl.uniform3fv(uniforms.step_m, scene.step);
    gl.uniform2fv(uniforms.heights, scene.heights);
    gl.uniform1f(uniforms.cut_m, cut_m());
    gl.uniform1f(uniforms.size, Number(control('size').value));
    gl.uniform1f(uniforms.by_intensity, Number(control('colour').value));
    gl.uniform1f(uniforms.px_per_m, (POINT_m * canvas.height) / (2 * Math.tan(FIELD_OF_VIEW / 2)));
    attribute(attributes.place, programs.places, 3, gl.UNSIGNED_SHORT);
    attribute(attributes.intensity, programs.intensities, 1, gl.UNSIGNED_BYTE);
    gl.drawArrays(gl.POINTS, 0, scene.count);
    Object.values(attributes).forEach((a) => gl.disableVertexAttribArray(a));
  };
  const draw_tracks = (clip_map, opacity) => {
    const {program, uniforms, attributes} = programs.lines;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.clip_map, false, clip_map);
    gl.uniform2f(uniforms.viewport_px, canvas.width, canvas.height);
    for (const track of drawn_tracks.filter((t) => !t.hidden && t.count > 0)) {
      gl.uniform4f(uniforms.colour, ...track.colour, opacity);
      gl.uniform1f(uniforms.width_px, track.width * devicePixelRatio);
      attribute(attributes.from, track.buffer, 3, gl.FLOAT, 32, 0);
      attribute(attributes.to, track.buffer, 3, gl.FLOAT, 32, 12);
      attribute(attributes.corner, track.buffer, 2, gl.FLOAT, 32, 24);
      gl.drawArrays(gl.TRIANGLES, 0, track.count);
    }
    Object.values(attributes).forEach((a) => gl.disableVertexAttribArray(a));
  };
  const draw_spot = (clip_map) => {
    const {program, uniforms} = programs.spot;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.clip_map, false, clip_map);
    gl.uniform3fv(uniforms.place, spot);
    gl.uniform1f(uniforms.size_px, 16 * devicePixelRatio);
    gl.drawArrays(gl.POINTS, 0, 1);
  };
  const draw = () => {
    if (!gl || gl.isContextLost()) return;
    const ratio = Math.min(devicePixelRatio, 2);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...(on_paper ? PAPER : BACKGROUND), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const clip_map = matrix();
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    draw_points(clip_map);
    // Once more through roofs and trees, faintly.
    gl.depthMask(false);  // the later ones lie over the earlier ones where they agree
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST);
    draw_tracks(clip_map, 0.3);
    gl.enable(gl.DEPTH_TEST);
    draw_tracks(clip_map, 1);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    gl.disable(gl.DEPTH_TEST);
    if (spot) draw_spot(clip_map);
    canvas.dataset.drawn = String(scene.count);
  };
  let wanted = 0;
  const redraw = () => {
    wanted ||= requestAnimationFrame(() => { wanted = 0; draw(); });
  };

  // ---- camera ----
  const turn = (dx, dy) => {
    camera.yaw -= dx;
    camera.pitch = clamp(camera.pitch + dy, -0.2, Math.PI / 2);
    redraw();
  };
  /// By parts of the picture's height; over the ground, not into it.
  const move = (dx, dy) => {
    const {right} = axes();
    const ahead = [-Math.cos(camera.yaw), -Math.sin(camera.yaw), 0];
    const reach_m = 2 * Math.tan(FIELD_OF_VIEW / 2) * camera.distance;
    camera.target = add(camera.target, add(scale(right, -dx * reach_m), scale(ahead, dy * reach_m)));
    redraw();
  };
  const come = (factor) => {
    camera.distance = clamp(camera.distance * factor, 1.5, 8 * extent_m);
    redraw();
  };
  /// The point of the map nearest to the eye within a few pixels; null when there is none.
  const point_at = (x_px, y_px) => {
    const m = matrix();
    const within = 10 / canvas.clientHeight;
    const aspect = canvas.clientWidth / canvas.clientHeight;
    const u = (2 * x_px) / canvas.clientWidth - 1;
    const v = 1 - (2 * y_px) / canvas.clientHeight;
    const limit_m = cut_m();
    let nearest = Infinity;
    let found = null;
    for (let i = 0; i < places.length; i += 3) {
      const p = [0, 1, 2].map((k) => scene.low[k] + places[i + k] * scene.step[k]);
      const w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
      if (w <= 0.05 || w >= nearest || p[2] > limit_m) continue;
      const x = (m[0] * p[0] + m[4] * p[1] + m[8] * p[2] + m[12]) / w - u;
      const y = (m[1] * p[0] + m[5] * p[1] + m[9] * p[2] + m[13]) / w - v;
      if (Math.hypot(x * aspect, y) < 2 * within) {
        nearest = w;
        found = p;
      }
    }
    return found;
  };

  const fingers = new Map();
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const size = canvas.clientHeight;
    const d = [(now[0] - before[0]) / size, (now[1] - before[1]) / size];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const reach = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      come(reach(before) / Math.max(reach(now), 1));
      move(d[0] / 2, d[1] / 2);
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) {
      move(...d);
    } else {
      turn(3 * d[0], 3 * d[1]);
    }
    fingers.set(event.pointerId, now);
  });
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    come(2 ** (event.deltaY / 400));
  }, {passive: false});
  canvas.addEventListener('dblclick', (event) => {
    const box = canvas.getBoundingClientRect();
    const point = point_at(event.clientX - box.left, event.clientY - box.top);
    if (!point) return;
    camera.target = point;
    camera.distance = Math.min(camera.distance, Math.max(8, 0.4 * camera.distance));
    told.textContent = `east ${point[0].toFixed(1)} m, north ${point[1].toFixed(1)} m, up ${point[2].toFixed(1)} m`;
    redraw();
  });
  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.07),
    ArrowDown: () => turn(0, -0.07), '+': () => come(0.8), '-': () => come(1.25),
  };
  canvas.addEventListener('keydown', (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });

  // ---- controls ----
  for (const name of ['colour', 'size', 'cut']) control(name).addEventListener('input', redraw);
  control('top').addEventListener('click', () => {
    camera = seen_from({yaw: -Math.PI / 2, pitch: Math.PI / 2});
    redraw();
  });
  control('reset').addEventListener('click', () => { camera = {...whole}; redraw(); });

  let moment_s = null;  // of the drive that is shown; null: it stands still
  const announce = (time_s) => document.dispatchEvent(new CustomEvent('moment', {detail: time_s}));
  const SPEED = 6;
  const play = (before_ms) => (now_ms) => {
    if (moment_s === null) return;
    moment_s += (SPEED * Math.min(now_ms - before_ms, 100)) / 1000;
    const values = scene.tracks[scene.tracks.length - 1].values;
    if (moment_s > values[values.length - 4]) { stop(); return; }
    const place = window.trigpoint_place_at(moment_s);
    if (place) camera.target = [...place];
    announce(moment_s);
    requestAnimationFrame(play(now_ms));
  };
  const stop = () => {
    moment_s = null;
    control('play').textContent = 'drive along';
    announce(null);
  };
  control('play').addEventListener('click', () => {
    if (moment_s !== null) { stop(); return; }
    moment_s = scene.tracks[scene.tracks.length - 1].values[0];
    camera = {...camera, pitch: 0.5, distance: Math.min(camera.distance, 45)};
    control('play').textContent = 'stop';
    requestAnimationFrame((now_ms) => play(now_ms)(now_ms));
  });
  control('play').hidden = scene.tracks.length === 0;
  document.addEventListener('moment', (event) => {
    const place = window.trigpoint_place_at(event.detail);
    spot = place ? [...place] : null;
    redraw();
  });

  if (!start()) return;
  const legend = control('legend');
  for (const {title, style} of drawn_tracks) {
    const button = document.createElement('button');
    button.type = 'button';
    button.innerHTML = `<svg class="key" viewBox="0 0 24 12"><path class="line ${style}" d="M1 6h22"/></svg>`;
    button.append(title);
    button.addEventListener('click', () => {
      const off = button.classList.toggle('off');
      drawn_tracks.find((t) => t.title === title).hidden = off;
      redraw();
    });
    legend.append(button);
  }
  told.textContent = scene.of > scene.count ? `${scene.count} of the map's ${scene.of} points` : `${scene.count} points`;
  canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
  canvas.addEventListener('webglcontextrestored', () => { start(); redraw(); });
  new ResizeObserver(redraw).observe(canvas);
  addEventListener('beforeprint', () => { on_paper = true; draw(); });
  addEventListener('afterprint', () => { on_paper = false; draw(); });
  draw();
})();
