"use strict";
// Plots beside a player: numbers of legends, the player's time as a line with the values there, a click that sets the time.
const beside = (() => {
  let now = null;

  const figures = (value) => (value == null ? "" : Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3)
    ? value.toExponential(3) : value.toPrecision(5)).replace(/-/g, "\u2212");

  function line(plot) {
    if (now === null) return;
    const x = plot.valToPos(now, "x", true), { ctx, bbox } = plot;
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.save();
    ctx.strokeStyle = "#9aa3af";
    ctx.setLineDash([4, 4]);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }

  // The legend of a plot at the player's time, unless the mouse points at another.
  function tell(plot) {
    if (now !== null && !(plot.cursor.left >= 0)) plot.setLegend({ idx: plot.valToIdx(now) });
  }

  function follow(host, plots) {
    document.addEventListener("frame", (event) => {
      if (event.detail === now) return;
      now = event.detail;
      for (const plot of plots()) {
        plot.redraw(false);
        tell(plot);
      }
    });
    host.addEventListener("click", (event) => {
      const over = event.target.closest(".u-over"), plot = plots().find((each) => each.over === over);
      if (plot && plot.select.width === 0) document.dispatchEvent(new CustomEvent("seek", { detail: plot.posToVal(event.offsetX, "x") }));
    });
  }

  const time = { label: "t", value: (_, v) => (v == null ? "" : figures(v) + " s") };
  return { figures, line, time, tell, follow };
})();
