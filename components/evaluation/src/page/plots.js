// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Zoom, hover and legends of the plots. Values are read back from the SVG paths. Plots over time
// share their x axis; the moment under the pointer is announced to the others, to the top view and
// to the map in 3-D by an event "moment".
'use strict';
(() => {
  const figures = [...document.querySelectorAll('figure.plot')];
  const make = (tag, style, parent) => {
    const element = document.createElement(tag);
    element.className = style;
    parent.append(element);
    return element;
  };
  const tip = make('div', 'tip', document.body);
  tip.hidden = true;

  // Points of a path as SvgPlot writes it: "Mx y l dx dy dx dy ..." and "Mx yh0".
  const read_path = (path) => {
    const points = [];
    for (const piece of path.getAttribute('d').split('M').slice(1)) {
      const n = piece.match(/-?\d+/g).map(Number);
      let [x, y] = n;
      points.push([x, y, true]);
      for (let i = 4; i + 1 < n.length; i += 2) {
        x += n[i];
        y += n[i + 1];
        points.push([x, y, false]);
      }
    }
    return points;
  };

  const round_marks = (from, to, most) => {
    const rough = (to - from) / most;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((r) => r * power).find((s) => s >= rough * (1 - 1e-9));
    const marks = [];
    for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; ++k) {
      marks.push(Number((k * step).toPrecision(9)));
    }
    return marks;
  };

  const plots = figures.map((figure) => {
    const svg = figure.querySelector('.drawing');
    const [, , width, height] = svg.getAttribute('viewBox').split(' ').map(Number);
    const number = (name) => Number(figure.dataset[name]);
    const plot = {
      figure, svg, width, height, is_map: figure.classList.contains('map'), log: figure.dataset.log === '1',
      x0: number('x0'), x1: number('x1'), y0: number('y0'), y1: number('y1'),
      view: [0, 0, width, height], area: figure.querySelector('.area'), numbers: figure.querySelector('.numbers'),
    };
    plot.to_x = (u) => plot.x0 + (u / width) * (plot.x1 - plot.x0);
    plot.to_y = (v) => {
      const part = 1 - v / height;
      return plot.log ? plot.y0 * (plot.y1 / plot.y0) ** part : plot.y0 + part * (plot.y1 - plot.y0);
    };
    plot.from_x = (x) => ((x - plot.x0) / (plot.x1 - plot.x0)) * width;
    plot.from_y = (y) => (1 - (y - plot.y0) / (plot.y1 - plot.y0)) * height;
    plot.curves = null;
    return plot;
  });

  // Only what is looked at is parsed.
  const curves_of = (plot) => {
    plot.curves ??= [...plot.svg.querySelectorAll('path[data-title]')].map((path) => {
      const points = read_path(path);
      return {path, points, title: path.dataset.title, dots: path.classList.contains('dots')};
    });
    return plot.curves;
  };

  const show_view = (plot) => {
    const [x, y, w, h] = plot.view;
    plot.svg.setAttribute('viewBox', plot.view.join(' '));
    for (const old of plot.numbers.querySelectorAll(plot.is_map ? 'span' : '.x')) old.remove();
    let grid = '';
    for (const value of round_marks(plot.to_x(x), plot.to_x(x + w), plot.area.clientWidth > 500 ? 8 : 4)) {
      const mark = make('span', 'x', plot.numbers);
      mark.textContent = value;
      mark.style.left = `${(100 * (plot.from_x(value) - x)) / w}%`;
      grid += `M${plot.from_x(value)} 0v${plot.height}`;
    }
    plot.svg.querySelector('.gridx').setAttribute('d', grid);
    if (!plot.is_map) return;
    grid = '';
    for (const value of round_marks(plot.to_y(y + h), plot.to_y(y), 6)) {
      const mark = make('span', 'y', plot.numbers);
      mark.textContent = value;
      mark.style.top = `${(100 * (plot.from_y(value) - y)) / h}%`;
      grid += `M0 ${plot.from_y(value)}h${plot.width}`;
    }
    plot.svg.querySelector('.gridy').setAttribute('d', grid);
    for (const label of plot.figure.querySelectorAll('.label')) {
      const u = (plot.from_x(Number(label.dataset.x)) - x) / w;
      const v = (plot.from_y(Number(label.dataset.y)) - y) / h;
      label.style.left = `${100 * u}%`;
      label.style.top = `${100 * v}%`;
      label.hidden = u < 0 || u > 1 || v < 0 || v > 1;
    }
    place_spot(plot);
  };

  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  // ---- legends ----
  for (const plot of plots) {
    if (plot.figure.classList.contains('rows')) {
      plot.area.style.setProperty('--rows', plot.numbers.querySelectorAll('.y').length);
    }
    for (const button of plot.figure.querySelectorAll('.legend button')) {
      button.addEventListener('click', () => {
        const off = button.classList.toggle('off');
        const wanted = button.dataset.style.split(' ');
        for (const element of plot.svg.querySelectorAll('[data-title]')) {
          if (wanted.every((name) => element.classList.contains(name))) element.classList.toggle('off-curve', off);
        }
      });
    }
  }

  // ---- the moment under the pointer ----
  const scene_element = document.getElementById('scene');
  window.trigpoint_scene = scene_element ? JSON.parse(scene_element.textContent) : null;
  const floats = (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  };
  for (const track of window.trigpoint_scene?.tracks ?? []) track.values = floats(track.values);
  const best = () => {
    const tracks = window.trigpoint_scene?.tracks ?? [];
    return ['fused', 'gps', 'lio'].map((s) => tracks.find((t) => t.style === s)).find((t) => t);
  };
  window.trigpoint_place_at = (time_s) => {
    const values = best()?.values;
    if (!values || time_s === null) return null;
    let low = 0;
    let high = values.length / 4 - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (values[4 * middle] < time_s) low = middle + 1;
      else high = middle;
    }
    return Math.abs(values[4 * low] - time_s) < 2 ? values.subarray(4 * low + 1, 4 * low + 4) : null;
  };

  let place = null;
  const place_spot = (plot) => {
    plot.spot ??= make('div', 'spot', plot.area);
    const [x, y, w, h] = plot.view;
    plot.spot.hidden = !place;
    if (!place) return;
    const u = (plot.from_x(place[0]) - x) / w;
    const v = (plot.from_y(place[1]) - y) / h;
    plot.spot.hidden = u < 0 || u > 1 || v < 0 || v > 1;
    plot.spot.style.left = `${100 * u}%`;
    plot.spot.style.top = `${100 * v}%`;
  };
  document.addEventListener('moment', (event) => {
    place = window.trigpoint_place_at(event.detail);
    for (const plot of plots) {
      if (plot.is_map) {
        place_spot(plot);
        continue;
      }
      plot.cursor ??= make('div', 'cursor', plot.area);
      const u = event.detail === null ? -1 : (plot.from_x(event.detail) - plot.view[0]) / plot.view[2];
      plot.cursor.hidden = u < 0 || u > 1;
      plot.cursor.style.left = `${100 * u}%`;
    }
  });
  const announce = (time_s) => document.dispatchEvent(new CustomEvent('moment', {detail: time_s}));

  const text_of = (value) => String(Number(value.toPrecision(4)));
  const row = (parent, text) => { make('div', '', parent).textContent = text; };
  const describe_time = (plot, u) => {
    tip.replaceChildren();
    row(tip, `t = ${text_of(plot.to_x(u))} s`);
    for (const rect of plot.svg.querySelectorAll('rect.band:not(.off-curve)')) {
      const from = Number(rect.getAttribute('x'));
      if (u >= from && u <= from + Number(rect.getAttribute('width'))) row(tip, rect.dataset.title);
    }
    if (plot.figure.classList.contains('rows')) return;
    for (const {path, points, title} of curves_of(plot)) {
      if (path.classList.contains('off-curve') || points.length === 0) continue;
      let low = 0;
      let high = points.length - 1;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (points[middle][0] < u) low = middle + 1;
        else high = middle;
      }
      if (low > 0 && u - points[low - 1][0] < points[low][0] - u) --low;
      // Between the ends of a line a long straight piece is as good as a point.
      const inside = low > 0 && !points[low][2] && u >= points[0][0] && u <= points[points.length - 1][0];
      if (Math.abs(points[low][0] - u) < 0.02 * plot.view[2] || inside) {
        row(tip, `${title}: ${text_of(plot.to_y(points[low][1]))}`);
      }
    }
  };
  const show_tip = (event) => {
    tip.hidden = false;
    const box = tip.getBoundingClientRect();
    const left = event.clientX + 16 + box.width > innerWidth ? event.clientX - 16 - box.width : event.clientX + 16;
    tip.style.left = `${Math.max(4, left)}px`;
    tip.style.top = `${clamp(event.clientY + 14, 4, innerHeight - box.height - 4)}px`;
  };
  const hide_tip = () => { tip.hidden = true; announce(null); };

  // ---- pointer: select a stretch of time, move and zoom the top view ----
  const at = (plot, event) => {
    const box = plot.svg.getBoundingClientRect();
    const [x, y, w, h] = plot.view;
    return [x + ((event.clientX - box.left) / box.width) * w, y + ((event.clientY - box.top) / box.height) * h];
  };
  const zoom_time = (from, to) => {
    for (const plot of plots.filter((p) => !p.is_map)) {
      const u0 = plot.from_x(from);
      plot.view = [u0, 0, Math.max(plot.from_x(to) - u0, 20), plot.height];
      show_view(plot);
    }
  };
  const whole_time = () => {
    for (const plot of plots.filter((p) => !p.is_map)) {
      plot.view = [0, 0, plot.width, plot.height];
      show_view(plot);
    }
  };
  const zoom_map = (plot, factor, u, v) => {
    const [x, y, w, h] = plot.view;
    const f = clamp(factor * w, plot.width / 200, plot.width) / w;
    plot.view = [clamp(u - (u - x) * f, 0, plot.width - w * f), clamp(v - (v - y) * f, 0, plot.height - h * f), w * f, h * f];
    show_view(plot);
  };

  for (const plot of plots) {
    let begin = null;
    let mark = null;
    plot.svg.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      begin = at(plot, event);
      if (event.pointerType === 'mouse') plot.svg.setPointerCapture(event.pointerId);
    });
    plot.svg.addEventListener('pointermove', (event) => {
      const [u, v] = at(plot, event);
      if (plot.is_map) {
        if (begin && event.buttons) {
          const [x, y, w, h] = plot.view;
          plot.view = [clamp(x + begin[0] - u, 0, plot.width - w), clamp(y + begin[1] - v, 0, plot.height - h), w, h];
          show_view(plot);
        }
        tip.replaceChildren();
        row(tip, `east ${plot.to_x(u).toFixed(1)} m, north ${plot.to_y(v).toFixed(1)} m`);
        show_tip(event);
        return;
      }
      if (begin && event.buttons && event.pointerType === 'mouse') {
        mark ??= make('div', 'cursor select', plot.area);
        const left = (Math.min(begin[0], u) - plot.view[0]) / plot.view[2];
        mark.style.left = `${100 * left}%`;
        mark.style.width = `${(100 * Math.abs(u - begin[0])) / plot.view[2]}%`;
      }
      describe_time(plot, u);
      show_tip(event);
      announce(plot.to_x(u));
    });
    plot.svg.addEventListener('pointerup', (event) => {
      const [u] = at(plot, event);
      if (!plot.is_map && begin && mark && Math.abs(u - begin[0]) > 0.01 * plot.view[2]) {
        zoom_time(plot.to_x(Math.min(begin[0], u)), plot.to_x(Math.max(begin[0], u)));
      }
      mark?.remove();
      mark = begin = null;
    });
    plot.svg.addEventListener('pointercancel', () => { mark?.remove(); mark = begin = null; });
    plot.svg.addEventListener('pointerleave', hide_tip);
    plot.svg.addEventListener('dblclick', (event) => {
      if (plot.is_map) zoom_map(plot, 0.5, ...at(plot, event));
      else whole_time();
    });
    if (!plot.is_map) continue;
    // The wheel alone scrolls the page.
    plot.svg.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom_map(plot, 2 ** (event.deltaY / 200), ...at(plot, event));
    }, {passive: false});
    const buttons = make('div', 'buttons', plot.area);
    for (const [text, factor, name] of [['+', 0.5, 'nearer'], ['\u2212', 2, 'further'], ['whole', 1e9, 'the whole picture']]) {
      const button = make('button', '', buttons);
      button.type = 'button';
      button.textContent = text;
      button.title = name;
      button.addEventListener('click', () => {
        const [x, y, w, h] = plot.view;
        zoom_map(plot, factor, x + w / 2, y + h / 2);
      });
    }
  }
  let resizing = 0;
  addEventListener('resize', () => {
    cancelAnimationFrame(resizing);
    resizing = requestAnimationFrame(() => plots.forEach(show_view));
  });
  plots.forEach(show_view);
})();
