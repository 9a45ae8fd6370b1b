"""The page whose sliders change a four-bar: an ensemble of motions, and the script that plays the nearest one.

    python docs/four_bar_page.py four-bar.html

writes it as one file that needs no network.
"""

import json
import sys
from pathlib import Path

import numpy as np

import ephs
from ephs.mechanics.scene.parameters import varied

ROOT = Path(__file__).parents[1]
UNTIL, INSTANTS = 4.0, 240
FRICTION = 0.35  # N m s/rad, in the bearing of the crank
HALF = 0.45  # m, from the pin to the coupler's centre of mass
VARIED = {
    "joints.knee.frame1.position[0]": ("length of coupler", "m", np.linspace(0.39, 0.51, 5), HALF),
    "joints.pivot.frame1.position[0]": ("distance of supports", "m", np.linspace(0.85, 1.05, 5), 0.0),
    "joints.main.drive": ("torque on crank", "N m", np.linspace(4.0, 7.0, 4), 0.0),
}  # path: words, unit, values, what is added for the reader
OUTPUTS = ("bodies.crank.position", "bodies.coupler.position", "joints.main.rate", "heat")


def page() -> str:
    """The page's contents, without its frame."""
    scene = ephs.load(ROOT / "ephs" / "templates" / "four-bar.toml")
    scene = varied(scene, {"joints.main.friction": FRICTION})
    times = np.linspace(0.0, UNTIL, INSTANTS + 1)
    vary = {path: values for path, (_, _, values, _) in VARIED.items()}
    table = ephs.sweep(scene, vary, UNTIL, save_at=times, outputs=OUTPUTS, method="rk87")
    if int(table.attrs["failed"]):
        raise RuntimeError("a member of the ensemble failed: " + "; ".join(np.unique(table["status"].values)))
    crank, coupler = (table[f"bodies.{name}.position"].values[..., [0, 2]] for name in ("crank", "coupler"))
    pin = 2.0 * crank
    length = HALF + next(iter(vary.values())).reshape(-1, 1, 1, 1, 1)
    knee = pin + (coupler - pin) / HALF * length
    millimetres = np.rint(1000.0 * np.concatenate([pin, knee], axis=-1)).astype(int)
    data = {
        "sliders": [
            {"words": words, "unit": unit, "values": (values + more).round(6).tolist()}
            for words, unit, values, more in VARIED.values()
        ],
        "start": [2, 3, 1],
        "times": times.round(4).tolist(),
        "points": millimetres.reshape(-1, INSTANTS + 1, 4).tolist(),
        "rate": table["joints.main.rate"].values.reshape(-1, INSTANTS + 1).round(2).tolist(),
        "heat": table["heat"].values.reshape(-1, INSTANTS + 1).round(2).tolist(),
        "ground": 1,
    }
    return _BODY.replace("DATA", json.dumps(data, separators=(",", ":")))


def whole() -> str:
    """One self-contained page."""
    head = '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Interactive four-bar</title></head>'
    return f"{head}<body style='background:#fff;max-width:52rem;margin:2rem auto'>{page()}</body></html>\n"


_BODY = """
<div id="fourbar">
<style>
#fourbar{font:15px/1.5 system-ui,sans-serif;color:#1f2933;background:#fff;padding:.8rem;border-radius:8px}
#fourbar .set{display:flex;flex-wrap:wrap;gap:.4rem 2rem;margin:.2rem 0 .8rem}
#fourbar label{flex:1 1 15rem;display:block}
#fourbar input{width:100%;accent-color:#4c78a8}
#fourbar svg{width:100%;height:auto;display:block}
#fourbar button{font:inherit;padding:.1rem .8rem;border:1px solid #9aa5b1;border-radius:6px;background:#f5f7fa}
#fourbar output{font-variant-numeric:tabular-nums;font-weight:600;white-space:nowrap}
#fourbar .read{display:flex;flex-wrap:wrap;gap:.3rem 1.6rem;align-items:center;font-variant-numeric:tabular-nums}
</style>
<div class="set"></div>
<svg viewBox="-480 -840 1760 1220" role="img" aria-label="a four-bar linkage in motion"></svg>
<svg viewBox="0 -26 1000 216" role="img" aria-label="crank speed over time"></svg>
<div class="read"><button type="button">pause</button><span></span></div>
<script>
(function () {
  "use strict";
  const data = DATA;
  const root = document.getElementById("fourbar");
  const NS = "http://www.w3.org/2000/svg";
  const [stage, plot] = root.querySelectorAll("svg");
  const make = (parent, tag, given) => {
    const node = document.createElementNS(NS, tag);
    for (const key in given) node.setAttribute(key, given[key]);
    return parent.appendChild(node);
  };
  const chosen = data.start.slice();
  data.sliders.forEach((slider, k) => {
    const label = document.createElement("label");
    const out = document.createElement("output");
    const input = document.createElement("input");
    Object.assign(input, {type: "range", min: 0, max: slider.values.length - 1, step: 1, value: chosen[k]});
    input.setAttribute("aria-label", slider.words);
    const tell = () => { out.textContent = slider.values[chosen[k]].toFixed(2) + " " + slider.unit; };
    input.addEventListener("input", () => { chosen[k] = +input.value; tell(); choose(); });
    label.append(slider.words + ": ", out, input);
    root.querySelector(".set").append(label);
    tell();
  });
  const line = {fill: "none", "stroke-linecap": "round", "stroke-linejoin": "round"};
  make(stage, "line", {x1: -470, y1: 0, x2: 1270, y2: 0, stroke: "#e1e5ea", "stroke-width": 4});
  const ghost = make(stage, "polyline", {...line, stroke: "#e0912f", "stroke-width": 5, opacity: 0.45});
  const arc = make(stage, "polyline", {...line, stroke: "#5f9e6e", "stroke-width": 5, opacity: 0.45});
  const inks = ["#4c78a8", "#e0912f", "#5f9e6e"], bars = [];
  for (const i of [1, 2, 0])  // the crank in front
    bars[i] = make(stage, "line", {...line, stroke: inks[i], "stroke-width": 34, opacity: 0.92});
  const pins = [0, 1, 2, 3].map(k =>
    make(stage, "circle", {r: 13, fill: k % 3 ? "#fff" : "#1f2933", stroke: "#1f2933", "stroke-width": 6}));
  make(plot, "line", {x1: 60, y1: 160, x2: 980, y2: 160, stroke: "#9aa5b1"});
  const curve = make(plot, "polyline", {...line, stroke: "#4c78a8", "stroke-width": 2.5});
  const now = make(plot, "line", {y1: 12, y2: 160, stroke: "#9aa5b1", "stroke-dasharray": "4 4"});
  const words = (x, y, text, anchor) => {
    const node = make(plot, "text", {x: x, y: y, "font-size": 19, fill: "#52606d", "text-anchor": anchor});
    node.textContent = text;
    return node;
  };
  words(60, 184, "0 s", "middle");
  words(980, 184, data.times[data.times.length - 1] + " s", "middle");
  words(60, -6, "speed of the crank [rad/s]", "start");
  const top = words(52, 30, "", "end");
  words(52, 165, "0", "end");
  const tracks = data.points[0].length;
  const most = Math.max(...data.rate.map(r => Math.max(...r.map(Math.abs))));
  top.textContent = most.toFixed(0);
  let member = 0, time = 0, last = null, playing = true;
  function choose() {
    member = chosen.reduce((at, value, k) => at * data.sliders[k].values.length + value, 0);
    const points = data.points[member];
    const middle = points.map(p => ((p[0] + p[2]) / 2) + "," + (-(p[1] + p[3]) / 2));
    ghost.setAttribute("points", middle.join(" "));
    arc.setAttribute("points", points.map(p => p[2] + "," + (-p[3])).join(" "));
    curve.setAttribute("points", data.rate[member].map((r, k) =>
      (60 + 920 * k / (tracks - 1)) + "," + (160 - 145 * Math.abs(r) / most)).join(" "));
    draw();
  }
  function draw() {
    const end = data.times[tracks - 1];
    const at = Math.min(time / end * (tracks - 1), tracks - 1.0001), k = Math.floor(at), w = at - k;
    const points = data.points[member];
    const p = points[k].map((value, i) => value * (1 - w) + points[k + 1][i] * w);
    const ground = 1000 * data.sliders[data.ground].values[chosen[data.ground]];
    const places = [[0, 0], [p[0], -p[1]], [p[2], -p[3]], [ground, 0]];
    bars.forEach((bar, i) => {
      bar.setAttribute("x1", places[i][0]); bar.setAttribute("y1", places[i][1]);
      bar.setAttribute("x2", places[i + 1][0]); bar.setAttribute("y2", places[i + 1][1]);
    });
    pins.forEach((pin, i) => { pin.setAttribute("cx", places[i][0]); pin.setAttribute("cy", places[i][1]); });
    const x = 60 + 920 * at / (tracks - 1);
    now.setAttribute("x1", x); now.setAttribute("x2", x);
    root.querySelector(".read span").textContent = "t = " + time.toFixed(2) + " s, crank at " +
      Math.abs(data.rate[member][k]).toFixed(1) + " rad/s, heat so far " + data.heat[member][k].toFixed(1) + " J";
  }
  function frame(stamp) {
    if (last !== null && playing) {
      time = (time + Math.min(stamp - last, 100) / 1000) % data.times[tracks - 1];
      draw();
    }
    last = stamp;
    requestAnimationFrame(frame);
  }
  root.querySelector("button").addEventListener("click", event => {
    playing = !playing;
    event.target.textContent = playing ? "pause" : "play";
  });
  choose();
  requestAnimationFrame(frame);
})();
</script>
</div>
"""

if __name__ == "__main__":
    Path(sys.argv[1]).write_text(whole(), encoding="utf-8")
