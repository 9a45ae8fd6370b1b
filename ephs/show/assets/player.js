"use strict";
// Player of a mechanism's motion on a canvas: polygons are sorted by depth and shaded, no WebGL is needed.
for (const host of document.querySelectorAll(".player:not([data-ready])")) {
  host.dataset.ready = "yes";
  const data = JSON.parse(host.querySelector("script").textContent);
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const times = floats(data.times), poses = floats(data.poses), middle = floats(data.middle);
  const count = times.length, bodies = data.names.length;
  for (const solid of data.solids) solid.vertices = floats(solid.vertices);
  const drawn = data.solids.filter((solid) => solid.own);
  for (const arrow of data.arrows) { arrow.from = floats(arrow.from); arrow.to = floats(arrow.to); }
  for (const values of [data.shades.shares, data.shades.faces]) for (const name in values) values[name] = floats(values[name]);

  // ---- controls
  const make = (tag, attributes = {}, text = "") => Object.assign(document.createElement(tag), attributes, { textContent: text });
  const canvas = make("canvas", { tabIndex: 0 }), bar = make("div", { className: "bar" });
  const play = make("button", { title: "play or pause (space)" }, "▶"), clock = make("output");
  const slider = make("input", { type: "range", min: 0, max: count - 1, value: 0 });
  slider.setAttribute("aria-label", "time");
  const speed = make("select", { title: "playing speed" });
  for (const factor of [0.1, 0.25, 0.5, 1, 2, 4]) speed.append(make("option", { value: factor, selected: factor === 1 }, `${factor}×`));
  const switches = {};
  const travelled = spread();
  for (const [name, on] of [["follow", travelled > 1.5 * data.size], ["names", false], ["traces", false], ["forces", data.arrows.length > 0]]) {
    if (name === "forces" && !data.arrows.length) continue;
    const label = make("label"), box = make("input", { type: "checkbox", checked: on });
    box.addEventListener("change", draw);
    label.append(box, name);
    switches[name] = { box, label };
  }
  const home = make("button", { title: "reset the view (0)" }, "⌂");
  bar.append(play, slider, clock, speed, ...Object.values(switches).map((s) => s.label), home);
  const key = make("div", { className: "key" });
  key.innerHTML = data.arrows.map((a) => `<b style="color:rgb(${a.colour})">→</b> ${a.label}`)
    .concat(data.shades.bars.map(({ said, ends }) => `${said} ${ends[0]} <span style="display:inline-block;width:7em;height:.7em;background:linear-gradient(90deg,${data.shades.scale.map((c) => `rgb(${c})`)})"></span> ${ends[1]}`)).join("<br>");
  host.append(canvas, key, bar);
  const context = canvas.getContext("2d");
  const is = (name) => switches[name]?.box.checked;

  // ---- camera
  let frame = 0, playing = false, began = 0, from = 0, azimuth, elevation, zoom, shift;
  function reset() {
    const [x, y, z] = data.way;
    azimuth = Math.atan2(y, x); elevation = Math.asin(z); zoom = 1; shift = [0, 0];
    draw();
  }
  function spread() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < middle.length; i++) { low[i % 3] = Math.min(low[i % 3], middle[i]); high[i % 3] = Math.max(high[i % 3], middle[i]); }
    return Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  }
  function centre() {
    if (is("follow")) return [...middle.subarray(3 * frame, 3 * frame + 3)];
    const sum = [0, 0, 0];
    for (let i = 0; i < 3; i++) {
      let low = Infinity, high = -Infinity;
      for (let k = i; k < middle.length; k += 3) { low = Math.min(low, middle[k]); high = Math.max(high, middle[k]); }
      sum[i] = (low + high) / 2;
    }
    return sum;
  }
  function camera() {
    const ce = Math.cos(elevation), way = [ce * Math.cos(azimuth), ce * Math.sin(azimuth), Math.sin(elevation)];
    const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
    const up = [way[1] * right[2] - way[2] * right[1], way[2] * right[0] - way[0] * right[2], way[0] * right[1] - way[1] * right[0]];
    const radius = data.radius + (is("follow") ? 0 : travelled / 2);
    const distance = 4 * radius, target = centre();
    const width = canvas.width, height = canvas.height;
    const scale = 0.52 * Math.min(width, height) / radius * zoom;
    return (x, y, z) => {
      const a = x - target[0], b = y - target[1], c = z - target[2];
      const depth = a * way[0] + b * way[1] + c * way[2], f = distance / Math.max(distance - depth, 0.05 * distance);
      return [width / 2 + shift[0] + scale * f * (a * right[0] + b * right[1]), 0.47 * height + shift[1] - scale * f * (a * up[0] + b * up[1] + c * up[2]), depth];
    };
  }
  function mover(body) {
    if (body < 0) return (x, y, z) => [x, y, z];
    const at = 7 * (frame * bodies + body), [w, i, j, k, px, py, pz] = poses.subarray(at, at + 7);
    return (x, y, z) => {
      const a = 2 * (j * z - k * y), b = 2 * (k * x - i * z), c = 2 * (i * y - j * x);
      return [x + w * a + j * c - k * b + px, y + w * b + k * a - i * c + py, z + w * c + i * b - j * a + pz];
    };
  }

  // ---- drawing
  const shade = (colour, factor) => `rgb(${colour.map((c) => Math.round(Math.min(255, c * factor)))})`;
  const scaled = (share) => data.shades.scale[Math.round((data.shades.scale.length - 1) * Math.max(0, Math.min(1, share)))];
  function tinted(colour, node) {
    const shares = data.shades.shares[node];
    if (!shares) return colour;
    const share = shares[frame], warm = scaled(share), fade = Math.min(1, 10 * share);
    return colour.map((c, n) => (1 - fade) * c + fade * warm[n]);
  }
  function path(points, close) {
    context.beginPath();
    points.forEach((p, n) => (n ? context.lineTo(p[0], p[1]) : context.moveTo(p[0], p[1])));
    if (close) context.closePath();
  }
  function polygons(solid, project, out) {
    const move = mover(solid.body), v = solid.vertices, at = [], world = [];
    for (let n = 0; n < v.length; n += 3) { const p = move(v[n], v[n + 1], v[n + 2]); world.push(p); at.push(project(...p)); }
    const colour = tinted(solid.colour, solid.heat);
    for (const face of solid.faces) {
      const corners = face.map((n) => at[n]), [a, b, c] = corners;
      if ((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) >= 0) continue; // turned away (the picture's y points down)
      const [p, q, r] = face.map((n) => world[n]);
      const u = [q[0] - p[0], q[1] - p[1], q[2] - p[2]], w = [r[0] - q[0], r[1] - q[1], r[2] - q[2]];
      const normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
      const light = (0.3 * normal[0] - 0.5 * normal[1] + 0.8 * normal[2]) / (Math.hypot(...normal) || 1);
      out.push({ depth: corners.reduce((sum, corner) => sum + corner[2], 0) / corners.length, corners, fill: shade(colour, 0.78 + 0.26 * Math.max(-0.4, light)) });
    }
    for (const stick of solid.sticks || []) line(stick, move, project, shade(solid.colour, 0.75), 0.016 * data.size, out);
    if (solid.axis) line(solid.axis, move, project, "rgb(198,58,40)", 0, out);
  }
  function bent(sheet, project, out) {
    const world = sheet.ends.map(([body, at]) => mover(body)(...at)), at = world.map((p) => project(...p));
    const values = data.shades.faces[sheet.shell], count = sheet.faces.length;
    sheet.faces.forEach((face, k) => {
      const [p, q, r, s] = face.map((n) => world[n]), corners = face.map((n) => at[n]);
      const u = [r[0] - p[0], r[1] - p[1], r[2] - p[2]], w = [s[0] - q[0], s[1] - q[1], s[2] - q[2]];
      const normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
      const light = Math.abs(0.3 * normal[0] - 0.5 * normal[1] + 0.8 * normal[2]) / (Math.hypot(...normal) || 1);
      const colour = values ? shade(scaled(values[frame * count + k]), 0.9 + 0.1 * light) : shade(sheet.colour, 0.72 + 0.3 * light);
      out.push({ depth: corners.reduce((sum, corner) => sum + corner[2], 0) / 4, corners, fill: colour, edge: "rgba(20,24,30,.35)" });
    });
  }
  function line(ends, move, project, stroke, width, out) {
    const a = project(...move(...ends.slice(0, 3))), b = project(...move(...ends.slice(3)));
    out.push({ depth: (a[2] + b[2]) / 2, corners: [a, b], stroke, width });
  }
  function zigzag(a, b) {
    const along = [b[0] - a[0], b[1] - a[1]], length = Math.hypot(...along) || 1, side = 0.018 * canvas.height, points = [a];
    for (let n = 0; n <= 14; n++) {
      const share = 0.15 + 0.05 * n, off = n === 0 || n === 14 ? 0 : n % 2 ? side : -side;
      points.push([a[0] + share * along[0] - off * along[1] / length, a[1] + share * along[1] + off * along[0] / length]);
    }
    return [...points, b];
  }
  function ground(project) {
    const decade = 10 ** Math.floor(Math.log10(data.size / 2)), cell = decade * Math.max(...[1, 2, 5].filter((n) => n * decade <= data.size / 2));
    const [x, y] = centre().map((c) => Math.round(c / cell) * cell), reach = 6;
    context.lineWidth = devicePixelRatio;
    for (let n = -reach; n <= reach; n++) {
      context.strokeStyle = `rgba(150,160,172,${0.45 * (1 - Math.abs(n) / (reach + 1))})`;
      path([project(x + n * cell, y - reach * cell, data.low), project(x + n * cell, y + reach * cell, data.low)]); context.stroke();
      path([project(x - reach * cell, y + n * cell, data.low), project(x + reach * cell, y + n * cell, data.low)]); context.stroke();
    }
  }
  function draw() {
    const project = camera(), dots = devicePixelRatio;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.lineJoin = context.lineCap = "round";
    ground(project);
    if (is("traces")) for (const { body, colour } of drawn) {
      const points = [];
      for (let n = 0; n < count; n++) { const at = 7 * (n * bodies + body) + 4; points.push(project(poses[at], poses[at + 1], poses[at + 2])); }
      path(points); context.strokeStyle = `rgba(${colour},.7)`; context.lineWidth = 1.3 * dots; context.stroke();
    }
    const parts = [];
    for (const solid of data.solids) polygons(solid, project, parts);
    for (const sheet of data.sheets) bent(sheet, project, parts);
    for (const spring of data.springs) {
      const [a, b] = spring.ends.map(([body, at]) => project(...mover(body)(...at)));
      parts.push({ depth: (a[2] + b[2]) / 2, corners: spring.coiled ? zigzag(a, b) : [a, b], stroke: shade(tinted([70, 76, 84], spring.heat), 1), width: 0 });
    }
    parts.sort((a, b) => a.depth - b.depth);
    for (const part of parts) {
      path(part.corners, part.fill);
      if (part.fill) {
        context.fillStyle = part.fill; context.strokeStyle = part.edge || part.fill; context.lineWidth = 0.7 * dots; context.fill(); context.stroke();
      } else {
        const one = project(0, 0, 0), metre = Math.hypot(project(0, 0, 1)[1] - one[1], project(1, 0, 0)[0] - one[0]);
        context.strokeStyle = part.stroke; context.lineWidth = Math.max(1.8 * dots, part.width * metre); context.stroke();
      }
    }
    if (is("forces")) for (const arrow of data.arrows) drawArrows(arrow, project);
    if (is("names")) names(project);
    clock.textContent = `${times[frame].toFixed(3)} s`;
    slider.value = frame;
    document.dispatchEvent(new CustomEvent("frame", { detail: times[frame] }));
  }
  function drawArrows(arrow, project) {
    const n = arrow.from.length / count;
    for (let at = frame * n; at < (frame + 1) * n; at += 3) {
      const a = project(...arrow.from.subarray(at, at + 3)), b = project(...arrow.to.subarray(at, at + 3));
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]), head = Math.min(length, 9 * devicePixelRatio);
      if (length < 2) continue;
      const x = (b[0] - a[0]) / length, y = (b[1] - a[1]) / length, back = [b[0] - head * x, b[1] - head * y];
      context.strokeStyle = context.fillStyle = `rgb(${arrow.colour})`; context.lineWidth = 2.5 * devicePixelRatio;
      path([a, back]); context.stroke();
      path([b, [back[0] - 0.5 * head * y, back[1] + 0.5 * head * x], [back[0] + 0.5 * head * y, back[1] - 0.5 * head * x]], true); context.fill();
    }
  }
  function names(project) {
    context.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    context.textAlign = "center"; context.lineWidth = 3 * devicePixelRatio; context.strokeStyle = "#fff";
    const say = (text, p, ink) => { context.strokeText(text, p[0], p[1]); context.fillStyle = ink; context.fillText(text, p[0], p[1]); };
    for (const { body } of drawn) say(data.names[body], project(...mover(body)(0, 0, 0)), "#1a1a1a");
    for (const solid of data.solids) if (solid.label) { const p = project(...mover(solid.body)(...solid.place)); say(solid.label, [p[0], p[1] - 12 * devicePixelRatio], "#6b7280"); }
  }

  // ---- time and input
  function seek(number) { frame = Math.max(0, Math.min(count - 1, Math.round(number))); began = performance.now(); from = frame; draw(); }
  function toggle(on = !playing) {
    playing = on; play.textContent = playing ? "❚❚" : "▶";
    if (playing) { seek(frame >= count - 1 ? 0 : frame); requestAnimationFrame(step); }
  }
  function step(now) {
    if (!playing || !host.isConnected) return;
    const wanted = Math.floor(from + (now - began) / 1000 / data.pause * Number(speed.value));
    if (wanted > count - 1) seek(0); else if (wanted > frame) { frame = wanted; draw(); }
    requestAnimationFrame(step);
  }
  play.addEventListener("click", () => toggle());
  host.addEventListener("motion", ({ detail }) => {
    const half = bodies * 7;
    poses.set(detail);
    for (let n = 0; n < count; n++) for (let k = 0; k < 3; k++) {
      let low = Infinity, high = -Infinity;
      for (let at = n * half + 4 + k; at < (n + 1) * half; at += 7) { low = Math.min(low, poses[at]); high = Math.max(high, poses[at]); }
      if (bodies) middle[3 * n + k] = (low + high) / 2;
    }
    draw();
  });
  slider.addEventListener("input", () => seek(Number(slider.value)));
  speed.addEventListener("change", () => seek(frame));
  home.addEventListener("click", reset);
  document.addEventListener("seek", (event) => seek(times.reduce((best, t, n) => (Math.abs(t - event.detail) < Math.abs(times[best] - event.detail) ? n : best), 0)));
  canvas.addEventListener("keydown", (event) => {
    const done = { " ": () => toggle(), ArrowLeft: () => seek(frame - 1), ArrowRight: () => seek(frame + 1), Home: () => seek(0), End: () => seek(count - 1), 0: reset }[event.key];
    if (done) { event.preventDefault(); done(); }
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    if (event.shiftKey || event.buttons > 1) shift = [shift[0] + event.movementX * devicePixelRatio, shift[1] + event.movementY * devicePixelRatio];
    else { azimuth -= 0.008 * event.movementX; elevation = Math.max(-1.5, Math.min(1.5, elevation + 0.008 * event.movementY)); }
    draw();
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom *= Math.exp(-0.001 * event.deltaY); draw(); }, { passive: false });
  new ResizeObserver(() => { canvas.width = canvas.clientWidth * devicePixelRatio; canvas.height = canvas.clientHeight * devicePixelRatio; draw(); }).observe(canvas);
  reset();
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) toggle(true);
}
