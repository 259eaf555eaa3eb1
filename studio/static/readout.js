// The readout: what is known of the cell under the pointer, and never of another one.

import { h, byId, swatch } from "./dom.js";
import { percent } from "./why.js";

const ASK_EVERY_MS = 70;

export class Readout {
  constructor(studio) {
    this.studio = studio;
    this.screen = null; // where the pointer is on the screen
    this.reading = null; // the point of the map that is read
  }

  /** The pointer is at a point of the screen. */
  at(screen) {
    this.screen = screen;
    this.soon();
  }

  leave() {
    this.screen = this.reading = null;
    this.clear();
  }

  clear() {
    byId("readout").replaceChildren();
  }

  /** Say what the server knows of the cell under the pointer, not more often than it can answer. */
  soon() {
    if (this.asking) return;
    this.asking = setTimeout(() => {
      this.asking = null;
      const { screen, studio } = this;
      const point = screen ? studio.view.toMap(screen.x, screen.y) : this.reading;
      if (studio.state && point) this.read(point);
    }, ASK_EVERY_MS);
  }

  /** Show the values of the cell at a point, unless a newer request supersedes this one. */
  async read(point) {
    this.reading = point;
    const [x, y] = this.studio.frame.toCells(point);
    const cell = await this.studio.server.get("cell", { x, y }).catch(() => null);
    if (this.reading === point) this.#show(cell);
  }

  #show(cell) {
    if (!cell) { // no answer: clear the values of the previous cell
      this.clear();
      return;
    }
    const { colours, places } = this.studio;
    const parts = [h("span", { className: "muted" }, `${cell.x_m.toFixed(2)}, ${cell.y_m.toFixed(2)} m`)];
    if (cell.ground !== "free") parts.push(h("span", {}, cell.ground));
    else if (cell.label) {
      const probability = cell.probabilities?.[cell.label];
      parts.push(h("span", { className: "row" }, swatch(colours.of(cell.label)), h("b", {}, cell.label)));
      if (probability !== undefined) parts.push(h("span", {}, percent(probability)));
      if (cell.hall > probability / 2 && cell.label === "corridor") parts.push(h("span", {}, `rather a hall (${percent(cell.hall)})`));
      const region = places.byId.get(cell.region);
      if (region && region.name !== cell.label) parts.push(h("span", {}, region.name));
    }
    if (cell.paint) parts.push(h("span", { className: "muted" }, "painted"));
    byId("readout").replaceChildren(...parts);
  }
}
