"use strict";
// A page that simulates: sliders for parameters and forces, the motion computed anew by WebAssembly at each change.
(async () => {
  const data = JSON.parse(document.getElementById("live").textContent);
  const code = Uint8Array.from(atob(data.wasm), (c) => c.charCodeAt(0));
  const { instance: { exports: wasm } } = await WebAssembly.instantiate(code, {});
  const call = (name, ...given) => wasm[`${data.name}_${name}`](...given);
  const memory = (wasm.__heap_base.value + 7) & ~7;
  const given = memory + data.bytes, out = given + 8 * Math.max(data.parameters.length, data.inputs.length, 1);
  const missing = out + 8 * data.outputs - wasm.memory.buffer.byteLength;
  if (missing > 0) wasm.memory.grow(Math.ceil(missing / 65536));
  const host = document.querySelector(".player"), said = document.getElementById("said");
  const count = data.times.length, bodies = data.poses.length;

  function put(name, values) {
    new Float64Array(wasm.memory.buffer, given, values.length).set(values);
    call(name, memory, given);
  }

  // The motion over all frames: poses of the bodies, and the curves.
  function simulate(values) {
    const poses = new Float32Array(count * bodies * 7), curves = data.curves.map(() => new Array(count).fill(null));
    call("start", memory);
    if (data.parameters.length) put("parameters", values.parameters);
    if (data.inputs.length) put("inputs", values.inputs);
    let frame = 0, status = 0n;
    for (; frame < count && !status; frame++) {
      status = call("advance", memory, data.times[frame]) || call("outputs", memory, out);
      if (status) break;
      const read = new Float64Array(wasm.memory.buffer, out, data.outputs);
      data.poses.forEach((at, body) => {
        const to = 7 * (frame * bodies + body);
        for (let k = 0; k < 7; k++) poses[to + k] = read[at + k];
      });
      data.curves.forEach((curve, k) => { curves[k][frame] = read[curve.at]; });
    }
    const whole = frame === count, end = frame;
    for (; frame > 0 && frame < count; frame++) poses.copyWithin(7 * bodies * frame, 7 * bodies * (frame - 1), 7 * bodies * frame);
    return { poses, curves, whole, end };
  }

  const plots = data.panels.map((panel) => {
    const figure = document.createElement("figure");
    document.getElementById("live-plots").append(figure);
    const picked = data.curves.map((curve, k) => [curve, k]).filter(([curve]) => curve.panel === panel);
    const options = {
      width: figure.clientWidth, height: 200, scales: { x: { time: false } }, cursor: { sync: { key: "time" } },
      axes: [{ label: "time [s]", labelSize: 18, size: 34 }, { label: panel, labelSize: 18, size: 66 }],
      series: [beside.time, ...picked.map(([curve]) => ({ label: curve.name, stroke: curve.colour, width: 1.5, points: { show: false },
        value: (_, v) => beside.figures(v) }))],
      hooks: { draw: [beside.line] },
    };
    return { plot: new uPlot(options, [data.times, ...picked.map(() => [])], figure), picked };
  });

  beside.follow(document.getElementById("live-plots"), () => plots.map(({ plot }) => plot));
  const sliders = { parameters: [], inputs: [] };
  function refresh() {
    const values = { parameters: sliders.parameters.map((s) => Number(s.value)), inputs: sliders.inputs.map((s) => Number(s.value)) };
    const began = performance.now(), found = simulate(values), took = performance.now() - began;
    host.dispatchEvent(new CustomEvent("motion", { detail: found.poses }));
    for (const { plot, picked } of plots) {
      plot.setData([data.times, ...picked.map(([, k]) => found.curves[k])]);
      beside.tell(plot);
    }
    said.textContent = found.whole
      ? `${data.times[count - 1]} s of motion computed here in ${took.toFixed(0)} ms`
      : `The simulation fails after ${data.times[Math.max(found.end - 1, 0)].toFixed(3)} s with these numbers; the plots end there.`;
    document.body.dataset.ready = "yes";
    document.body.dataset.end = JSON.stringify(data.curves.map((curve, k) => found.curves[k][count - 1]));
  }

  let waiting = false;
  function later() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; refresh(); });
  }
  const board = document.getElementById("sliders");
  for (const kind of ["parameters", "inputs"]) for (const each of data[kind]) {
    const label = document.createElement("label"), name = document.createElement("span"), value = document.createElement("output");
    const slider = Object.assign(document.createElement("input"), { type: "range", min: each.low, max: each.high, step: "any" });
    slider.value = each.start;
    slider.name = each.name;
    name.textContent = each.name;
    const tell = () => { value.textContent = Number(slider.value).toPrecision(4) + (each.unit ? ` ${each.unit}` : ""); };
    slider.addEventListener("input", () => { tell(); later(); });
    slider.addEventListener("dblclick", () => { slider.value = each.start; tell(); later(); });
    tell();
    label.append(name, slider, value);
    board.append(label);
    sliders[kind].push(slider);
  }
  refresh();
})();
