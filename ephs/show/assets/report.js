"use strict";
// Plots of a report: signals picked from a list, one zoom and one cursor for all, the animation's time as a line.
(() => {
  const data = JSON.parse(document.getElementById("signals").textContent);
  const floats = (text, kind) => new kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const host = document.getElementById("plots"), list = document.getElementById("picker");
  const plots = new Map();
  const { figures } = beside;
  let window_ = null, busy = false;

  function everywhere(change) {
    if (busy) return;
    busy = true;
    for (const plot of plots.values()) change(plot);
    busy = false;
  }

  function range(panel) {
    return (_, low, high) => {
      if (low == null) return [-1, 1];
      const least = Math.max(panel.noise, 1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-300);
      const pad = high - low < least ? 50 * least : 0.06 * (high - low);
      return [low - pad, high + pad];
    };
  }

  function draw(panel) {
    plots.get(panel)?.destroy();
    plots.delete(panel);
    panel.host?.remove();
    const curves = panel.curves.filter((curve) => curve.shown);
    if (!curves.length) return;
    panel.host = document.createElement("figure");
    const after = panels.slice(panels.indexOf(panel) + 1).find((other) => plots.has(other));
    host.insertBefore(panel.host, after ? after.host : null);
    panel.t ??= floats(panel.times, Float64Array);
    const columns = curves.map((curve) => (curve.y ??= Array.from(floats(curve.values, Float32Array),
      (v) => (Number.isFinite(v) && !(panel.residual && v === 0) ? Math.abs(v) * (panel.residual || v >= 0 ? 1 : -1) : null))));
    const plot = new uPlot({
      width: host.clientWidth,
      height: panel.residual ? 150 : 220,
      scales: { x: { time: false }, y: panel.residual ? { distr: 3 } : { range: range(panel) } },
      axes: [
        { label: "time [s]", labelSize: 18, size: 34 },
        { label: panel.title, labelSize: 18, size: 66, values: (_, ticks) => ticks.map((v) => (v == null ? "" : Number(v.toPrecision(6)).toString().replace(/-/g, "\u2212"))) },
      ],
      series: [beside.time,
        ...curves.map((curve) => ({ label: curve.name, stroke: curve.colour, width: 1.5,
          value: (_, v) => (v != null && !panel.residual && Math.abs(v) < panel.noise ? "0" : figures(v)) }))],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      hooks: {
        draw: [beside.line],
        setScale: [(self, key) => {
          if (key !== "x" || busy || !plots.has(panel)) return;
          const { min, max } = self.scales.x;
          window_ = { min, max };
          everywhere((other) => other !== self && other.setScale("x", window_));
        }],
      },
    }, [panel.t, ...columns], panel.host);
    if (window_) { busy = true; plot.setScale("x", window_); busy = false; }
    plots.set(panel, plot);
  }

  const panels = [];
  for (const group of data) {
    const box = document.createElement("details");
    box.open = group.open;
    const head = document.createElement("summary");
    head.textContent = group.name;
    box.append(head);
    for (const panel of group.panels) {
      panels.push(panel);
      const title = document.createElement("b");
      title.textContent = panel.title;
      box.append(title);
      for (const curve of panel.curves) {
        const label = document.createElement("label"), tick = document.createElement("input");
        tick.type = "checkbox";
        tick.checked = curve.shown;
        tick.addEventListener("change", () => { curve.shown = tick.checked; draw(panel); });
        const key = document.createElement("i");
        key.style.background = curve.colour;
        label.append(tick, key, curve.name);
        label.dataset.name = `${group.name} ${panel.title} ${curve.name}`.toLowerCase();
        box.append(label);
      }
    }
    list.append(box);
  }
  document.getElementById("find").addEventListener("input", (event) => {
    const words = event.target.value.toLowerCase().split(/\s+/);
    for (const label of list.querySelectorAll("label"))
      label.hidden = !words.every((word) => label.dataset.name.includes(word));
    if (event.target.value) for (const box of list.querySelectorAll("details")) box.open = true;
  });
  panels.forEach(draw);
  addEventListener("resize", () => everywhere((plot) => plot.setSize({ width: host.clientWidth, height: plot.height })));

  beside.follow(host, () => [...plots.values()]);
})();
