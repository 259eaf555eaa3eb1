// The divider between two labellings, moved by pointer or arrow keys.

import { byId } from "./dom.js";
import { SOURCES } from "./layers.js";

export class Swipe {
  constructor(element, studio) {
    Object.assign(this, { element, studio, on: false, share: 0.5 });
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

  set(on) {
    this.on = on;
    this.element.hidden = !on;
    this.move(this.share);
    this.studio.changed();
  }

  move(share) {
    this.share = Math.min(0.97, Math.max(0.03, share));
    const { left, right } = this.studio.layers.sources;
    byId("left-side").textContent = SOURCES[left];
    byId("right-side").textContent = SOURCES[right];
    this.element.style.left = `${100 * this.share}%`;
    this.element.setAttribute("aria-valuenow", Math.round(100 * this.share));
    this.studio.redraw();
  }
}
