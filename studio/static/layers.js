// The panel of layers: what is shown, how strongly, and which labels are on either side.

import { h } from "./dom.js";
import { WAYS } from "./swipe.js";

export const TRUTH = "file:0";

export class Layers {
  constructor(studio) {
    this.studio = studio;
    this.shown = {
      map: 1, labels: 0.62, errors: 0, values: 0, paint: 0.9,
      regions: 1, names: 1, gates: 0, graph: 0, drive: 0,
    };
    this.last = { ...this.shown, errors: 0.9, values: 0.85, gates: 1, graph: 1, drive: 1 };
    this.value = "entropy";
    this.sources = { left: "taught", right: "before" };
    this.element = h("div", { className: "panel" });
  }

  set(name, opacity) {
    this.shown[name] = opacity;
    if (opacity) this.last[name] = opacity;
    this.studio.redraw();
  }

  /** Show a layer, or hide it. */
  flip(name) {
    this.set(name, this.shown[name] ? 0 : this.last[name]);
    this.key = null;
    this.studio.changed();
  }

  render(state) {
    const key = JSON.stringify([state.classes, state.sources, state.drive, this.studio.swipe.way, this.studio.theme.name, this.sources, this.value, !!state.relabelling]);
    if (key === this.key) return;
    this.key = key;
    const truth = TRUTH in state.sources;
    this.element.replaceChildren(
      h("section", {}, h("h2", {}, "Pictures"),
        h("div", { className: "layers" },
          this.#row("map", "Map", true),
          this.#row("labels", "Labels", true),
          this.#row("paint", "Paint", true),
          truth ? this.#row("errors", "Errors", true) : [],
          state.relabelling ? this.#row("values", "Probability", true) : []),
        state.relabelling ? this.#values(state) : null),
      h("section", {}, h("h2", {}, "Over the map"),
        h("div", { className: "layers" },
          this.#row("regions", "Outlines of regions"),
          this.#row("names", "Names"),
          this.#row("gates", "Gates"),
          this.#row("graph", "Graph of places"),
          state.drive ? this.#row("drive", "Path of the drive") : [])),
      h("section", {}, h("h2", {}, "Compare"), this.#compare(state)),
    );
  }

  #row(name, words, graded = false) {
    const box = h("input", { type: "checkbox", checked: this.shown[name] > 0, id: `layer-${name}` });
    const range = h("input", {
      type: "range", min: 0.05, max: 1, step: 0.05, value: this.last[name], "aria-label": `Opacity: ${words}`,
    });
    box.addEventListener("change", () => this.set(name, box.checked ? Number(range.value) : 0));
    range.addEventListener("input", () => {
      box.checked = true;
      this.set(name, Number(range.value));
    });
    return [box, h("label", { for: box.id }, words), graded ? range : h("span")];
  }

  #values(state) {
    const known = state.relabelling.known.map((k) => [`probability-${k}`, `of ${state.classes[k].name}`]);
    const gradient = state.gradients[this.studio.theme.name][this.value.split("-")[0]];
    const bar = h("i");
    bar.style.background = `linear-gradient(90deg, ${gradient.join(", ")})`;
    const ends = this.value === "entropy" ? ["sure", "unsure"] : ["0 %", "100 %"];
    const legend = h("div", { className: "legend" }, ends[0], bar, ends[1]);
    const choice = this.#choice("Which probability", [["entropy", "uncertainty (entropy)"], ...known], this.value, (value) => {
      this.value = value;
      if (!this.shown.values) this.set("values", this.last.values);
      this.key = null;
      this.studio.changed();
    });
    return [choice, legend];
  }

  #compare(state) {
    const listed = Object.entries(state.sources);
    const { swipe } = this.studio;
    const pick = (side, words) =>
      this.#choice(words, listed, this.sources[side], (value) => {
        this.sources[side] = value;
        this.studio.changed();
      });
    return [
      this.#choice("Compare", Object.entries(WAYS), swipe.way, (way) => swipe.set(way)),
      pick("left", swipe.on ? "First labelling" : "Labelling shown"),
      swipe.on ? pick("right", "Second labelling") : null,
    ];
  }

  #choice(words, listed, value, take) {
    const select = h("select", { className: "field", "aria-label": words });
    for (const [key, name] of listed) select.append(h("option", { value: key, selected: key === value }, name));
    select.addEventListener("change", () => take(select.value));
    return select;
  }
}
