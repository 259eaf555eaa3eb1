// The pointer: gestures of mouse, pen and fingers on the map: tool, move, zoom and click.

const CLICK_PX = 5;

export class Pointer {
  constructor(canvas, view, studio) {
    this.canvas = canvas;
    this.view = view;
    this.studio = studio;
    this.down = new Map();
    this.moving = false;
    this.space = false;
    canvas.addEventListener("pointerdown", (event) => this.#press(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#release(event));
    canvas.addEventListener("pointercancel", (event) => this.#drop(event));
    canvas.addEventListener("pointerleave", () => studio.left());
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    canvas.addEventListener("dblclick", (event) => studio.doubled(this.#at(event)));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** Where an event is in its pane; a pointer that is down stays in the one where it was pressed. */
  #at(event) {
    const box = this.canvas.getBoundingClientRect();
    const screen = { x: event.clientX - box.left, y: event.clientY - box.top };
    const held = this.down.get(event.pointerId);
    const shift = held?.shift ?? this.#shift(screen);
    return { x: screen.x - shift.x, y: screen.y - shift.y, shift };
  }

  #shift(screen) {
    const inside = this.view.inPane(screen);
    return { x: screen.x - inside.x, y: screen.y - inside.y };
  }

  #press(event) {
    this.studio.cross.hide();
    const screen = this.#at(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.down.set(event.pointerId, { ...screen, from: screen });
    if (this.down.size === 2) {
      this.studio.tools.cancel(); // a second finger: it is a pinch
      this.moving = true;
      return;
    }
    const moves = this.space || event.button !== 0;
    const point = this.view.toMap(screen.x, screen.y);
    this.moving = moves || !this.studio.tools.press(point, screen);
    if (this.moving) this.canvas.classList.add("moving");
  }

  #move(event) {
    const screen = this.#at(event);
    const held = this.down.get(event.pointerId);
    if (!held) {
      if (event.movementX || event.movementY) this.studio.cross.hide();
      this.studio.hovered(screen);
      return;
    }
    if (this.down.size === 2) this.#pinch(event.pointerId, screen);
    else if (this.moving) this.view.move(screen.x - held.x, screen.y - held.y);
    else this.studio.tools.move(this.view.toMap(screen.x, screen.y), screen);
    held.x = screen.x;
    held.y = screen.y;
  }

  #pinch(id, screen) {
    const held = this.down.get(id);
    const [other] = [...this.down].filter(([key]) => key !== id).map(([, value]) => value);
    const before = Math.hypot(held.x - other.x, held.y - other.y);
    const now = Math.hypot(screen.x - other.x, screen.y - other.y);
    this.view.move((screen.x - held.x) / 2, (screen.y - held.y) / 2);
    if (before > 1) this.view.zoom(now / before, (screen.x + other.x) / 2, (screen.y + other.y) / 2);
  }

  #release(event) {
    const screen = this.#at(event);
    const held = this.down.get(event.pointerId);
    if (!held) return;
    this.down.delete(event.pointerId);
    const clicked = Math.hypot(screen.x - held.from.x, screen.y - held.from.y) < CLICK_PX;
    if (!this.moving) this.studio.tools.release(this.view.toMap(screen.x, screen.y));
    if (clicked && event.button === 0 && !this.space && !this.down.size) this.studio.clicked(screen);
    if (!this.down.size) {
      this.moving = false;
      this.canvas.classList.remove("moving");
    }
  }

  #drop(event) {
    this.down.delete(event.pointerId);
    this.studio.tools.cancel();
    this.moving = false;
  }

  #wheel(event) {
    event.preventDefault();
    const screen = this.#at(event);
    const lines = event.deltaMode === 1 ? 16 : 1;
    const step = Math.max(-300, Math.min(300, event.deltaY * lines));
    this.view.zoom(Math.exp(-step * (event.ctrlKey ? 0.01 : 0.0016)), screen.x, screen.y);
  }
}
