// Two labellings at once: on either side of a divider, moved by pointer or arrow keys, or side by side.

import { byId } from "./dom.js";

export const WAYS = { one: "One labelling", divider: "Divider between two", side: "Side by side" };

export class Swipe {
  constructor(element, studio) {
    Object.assign(this, { element, studio, way: "one", share: 0.5 });
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    element.addEventListener("pointermove", (event) => {
      if (!element.hasPointerCapture(event.pointerId)) return;
      const box = element.parentElement.getBoundingClientRect();
      this.move((event.clientX - box.left) / box.width);
    });
    element.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(this.share + step);
    });
  }

  /** Whether two labellings are shown. */
  get on() {
    return this.way !== "one";
  }

  /** Compare in this way, or show one labelling again. */
  toggle(way) {
    this.set(this.way === way ? "one" : way);
  }

  set(way) {
    this.way = way;
    this.element.hidden = way !== "divider";
    this.studio.view.setPanes(way === "side" ? 2 : 1);
    this.move(this.share);
    this.studio.changed();
  }

  move(share) {
    this.share = Math.min(0.97, Math.max(0.03, share));
    this.element.style.left = `${100 * this.share}%`;
    this.element.setAttribute("aria-valuenow", Math.round(100 * this.share));
    this.studio.redraw();
  }

  /** Name what is compared, on both sides of the divider or in both panes. */
  name() {
    const { layers, state, view } = this.studio;
    for (const side of ["left", "right"]) {
      const words = state.sources[layers.sources[side]] ?? "";
      byId(`${side}-side`).textContent = words;
      const title = byId(`${side}-title`);
      title.textContent = words;
      title.hidden = this.way !== "side";
    }
    byId("stage").dataset.panes = this.way === "side" ? (view.stacked ? "stacked" : "beside") : "one";
  }
}
