// The cross: a pointer that arrow keys move, so that every tool works from the keyboard.

const STEP_PX = 12;
const EDGE_PX = 60; // nearer to the edge, the map moves along

export class Cross {
  constructor(view, studio) {
    Object.assign(this, { view, studio, at: null });
  }

  hide() {
    if (!this.at) return;
    this.at = null;
    this.studio.redraw();
  }

  /** Move by steps; the first time it appears in the middle. */
  move(right, down) {
    const { view } = this;
    this.at ??= { x: view.width / 2, y: view.height / 2 };
    const far = this.studio.tools.name === "brush" ? Math.max(2, Math.min(STEP_PX, this.studio.tools.radius * view.scale)) : STEP_PX;
    this.at = { x: this.at.x + right * far, y: this.at.y + down * far };
    const [x, y] = [keep(this.at.x, view.width), keep(this.at.y, view.height)];
    if (x !== this.at.x || y !== this.at.y) view.move(x - this.at.x, y - this.at.y);
    this.at = { x, y };
    this.#follow();
  }

  /** What a press of the pointer does: begin or end a stroke, set a corner, fill. */
  press() {
    const { tools } = this.studio;
    if (!this.at) return false;
    if (tools.name === "brush" || tools.name === "rectangle") {
      if (tools.drawing) tools.release(this.point);
      else tools.press(this.point, this.at);
    } else this.studio.clicked(this.at);
    this.studio.changed();
    return true;
  }

  get point() {
    return this.view.toMap(this.at.x, this.at.y);
  }

  #follow() {
    const { tools } = this.studio;
    this.studio.hovered(this.at);
    if (tools.drawing) tools.move(this.point, this.at);
    this.studio.redraw();
  }

  /** Draw it; the context is in pixels of the screen. */
  draw(context, colours) {
    if (!this.at) return;
    const { x, y } = this.at;
    for (const [colour, width] of [
      [colours.halo, 5],
      [colours.ink, 2],
    ]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(x + 4 * dx, y + 4 * dy);
        context.lineTo(x + 14 * dx, y + 14 * dy);
      }
      context.stroke();
    }
  }
}

const keep = (value, length) => Math.max(Math.min(EDGE_PX, length / 2), Math.min(length - Math.min(EDGE_PX, length / 2), value));
