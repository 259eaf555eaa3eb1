// The options of the tool at hand: its class, the size of the brush, and what is painted over.

import { h, byId, icon, swatch } from "./dom.js";

export class Options {
  constructor(studio) {
    this.studio = studio;
  }

  render() {
    const { studio } = this;
    const options = byId("options");
    options.hidden = !["brush", "rectangle", "polygon"].includes(studio.tools.name);
    if (options.hidden) return;
    if (!this.size) {
      this.size = h("input", { type: "range", min: 0, max: 100, "aria-label": "Size of the brush" });
      this.size.addEventListener("input", () => {
        studio.tools.radius = 0.5 * 200 ** (this.size.value / 100);
        studio.changed();
      });
      this.sizeWords = h("span");
      this.sizeColour = h("span", { className: "row" });
      this.overChoice = h("select", { className: "field", "aria-label": "What is painted over" });
      this.overChoice.addEventListener("change", () => {
        studio.over = Number(this.overChoice.value);
        studio.changed();
      });
      options.append(this.sizeColour, this.size, this.sizeWords, this.overChoice);
    }
    this.size.hidden = this.sizeWords.hidden = studio.tools.name !== "brush";
    studio.over = Math.min(studio.over, studio.state.classes.length - 1);
    const listed = ["over everything", ...studio.state.classes.map((item) => `only over ${item.name}`)];
    if (this.overWords !== listed.join()) {
      this.overWords = listed.join();
      this.overChoice.replaceChildren(...listed.map((words, k) => h("option", { value: k - 1 }, words)));
    }
    this.overChoice.value = String(studio.over);
    const { radius } = studio.tools;
    if (document.activeElement !== this.size) this.size.value = (100 * Math.log(radius / 0.5)) / Math.log(200);
    this.sizeWords.textContent = `${(2 * radius * studio.state.map.resolution_m).toFixed(2)} m`;
    const item = studio.state.classes[studio.label];
    this.sizeColour.replaceChildren(item ? swatch(item.colour) : icon("erase"));
  }
}
