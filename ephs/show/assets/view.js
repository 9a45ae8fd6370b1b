"use strict";
// A page that poses a mechanism: each slider asks the server for a configuration with its joint there.
(() => {
  const data = JSON.parse(document.getElementById("view").textContent);
  const host = document.querySelector(".player"), said = document.getElementById("said");
  const board = document.getElementById("sliders"), sliders = [];

  function show(found) {
    for (const { each, slider, tell } of sliders) {
      slider.value = found.coordinates[each.joint][each.entry];
      tell();
    }
    host.dispatchEvent(new CustomEvent("motion", { detail: Float32Array.from(found.poses) }));
    document.body.dataset.posed = JSON.stringify(found.coordinates);
  }

  // One request at a time; what was moved meanwhile is asked for after it.
  let busy = false, next = null;
  async function pose(wanted) {
    next = wanted;
    if (busy) return;
    busy = true;
    while (next) {
      const body = JSON.stringify(next);
      next = null;
      const answer = await fetch("/pose", { method: "POST", body });
      if (answer.ok) { said.textContent = ""; const found = await answer.json(); if (!next) show(found); } else said.textContent = await answer.text();
    }
    busy = false;
  }

  for (const each of data.joints) {
    const label = document.createElement("label"), name = document.createElement("span"), value = document.createElement("output");
    const slider = Object.assign(document.createElement("input"), { type: "range", min: each.low, max: each.high, step: "any" });
    slider.value = each.start;
    slider.name = each.label;
    name.textContent = each.label;
    const tell = () => { value.textContent = `${Number(slider.value).toFixed(3)} ${each.unit}`; };
    const ask = () => {
      const own = sliders.filter((other) => other.each.joint === each.joint);
      pose({ [each.joint]: own.map((other) => Number(other.slider.value)) });
    };
    slider.addEventListener("input", () => { tell(); ask(); });
    slider.addEventListener("dblclick", () => { slider.value = each.start; tell(); ask(); });
    tell();
    label.append(name, slider, value);
    board.append(label);
    sliders.push({ each, slider, tell });
  }

  document.addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("drop"); });
  document.addEventListener("dragleave", () => document.body.classList.remove("drop"));
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    document.body.classList.remove("drop");
    const file = event.dataTransfer.files[0];
    if (!file) return;
    const answer = await fetch(`/model?name=${encodeURIComponent(file.name)}`, { method: "POST", body: await file.arrayBuffer() });
    if (answer.ok) location.reload(); else said.textContent = await answer.text();
  });
  document.body.dataset.ready = "yes";
})();
