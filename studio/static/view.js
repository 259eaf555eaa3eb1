// The view: the visible part of the map. Cells count from the upper left corner, y downwards.

const LARGEST = 64;
const TOOLS_PX = 58;

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.scale = 1;
    this.x = 0;
    this.y = 0;
    this.size = { columns: 1, rows: 1 };
    this.ratio = 1;
    this.panes = 1;
    this.shrunk = 1;
    this.pane = null;
    this.changed = () => {};
  }

  /** Whether two panes are above each other, on a tall screen, rather than side by side. */
  get stacked() {
    return this.canvas.clientHeight > this.canvas.clientWidth;
  }

  /** The width of a pane; all panes show the same part of the map. */
  get width() {
    return this.canvas.clientWidth / (this.stacked ? 1 : this.panes);
  }

  get height() {
    return this.canvas.clientHeight / (this.stacked ? this.panes : 1);
  }

  /** Where each pane begins on the screen. */
  get corners() {
    return Array.from({ length: this.panes }, (_, k) => (this.stacked ? { x: 0, y: k * this.height } : { x: k * this.width, y: 0 }));
  }

  /** A point of the screen as one of the first pane, which shows the same there. */
  inPane({ x, y }) {
    return this.stacked ? { x, y: y < this.height ? y : y - this.height } : { x: x < this.width ? x : x - this.width, y };
  }

  /** Keep the centre of the map when the panes change their size. */
  follow() {
    const { width, height, pane: before } = this;
    this.pane = { width, height };
    if (before) this.move((width - before.width) / 2, (height - before.height) / 2);
  }

  /** Show one pane or two; the visible part of the map stays in view, and is restored. */
  setPanes(panes) {
    if (panes === this.panes) return;
    this.follow();
    const middle = this.toMap((this.width + TOOLS_PX) / 2, this.height / 2);
    let factor = 1 / this.shrunk;
    const { columns, rows } = this.size;
    const from = this.toMap(0, 0);
    const to = this.toMap(this.width, this.height);
    this.panes = panes;
    this.pane = { width: this.width, height: this.height };
    if (panes > 1) {
      const [left, right] = [Math.max(0, from.x), Math.min(columns, to.x)];
      const [top, bottom] = [Math.max(0, from.y), Math.min(rows, to.y)];
      [middle.x, middle.y] = [(left + right) / 2, (top + bottom) / 2];
      const fit = Math.min((this.width - TOOLS_PX) / (right - left), this.height / (bottom - top));
      factor = Math.min(1, (0.92 * fit) / this.scale);
    }
    this.shrunk = factor;
    this.scale *= factor;
    this.x = (this.width + TOOLS_PX) / 2 - middle.x * this.scale;
    this.y = this.height / 2 - middle.y * this.scale;
    this.#keep();
  }

  get smallest() {
    return 0.5 * Math.min(this.width / this.size.columns, this.height / this.size.rows, 1);
  }

  /** The point of the map, in cells, at a point of the screen. */
  toMap(x, y) {
    return { x: (x - this.x) / this.scale, y: (y - this.y) / this.scale };
  }

  /** The point of the screen at a point of the map. */
  toScreen(x, y) {
    return { x: x * this.scale + this.x, y: y * this.scale + this.y };
  }

  move(right, down) {
    this.x += right;
    this.y += down;
    this.#keep();
  }

  /** Zoom by a factor; the point of the screen stays where it is. */
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const scale = Math.min(LARGEST, Math.max(this.smallest, this.scale * factor));
    this.x = x - ((x - this.x) * scale) / this.scale;
    this.y = y - ((y - this.y) * scale) / this.scale;
    this.scale = scale;
    this.#keep();
  }

  /** Show a part of the map, by its corners in cells, next to the tools. */
  show(left, top, right, bottom, margin = 0.04) {
    this.follow();
    const wide = Math.max(1, right - left);
    const high = Math.max(1, bottom - top);
    const tools = this.beside();
    const room = this.width - tools;
    const scale = Math.min(room / wide, this.height / high) * (1 - 2 * margin);
    this.scale = Math.min(LARGEST, Math.max(this.smallest, scale));
    this.x = tools + room / 2 - ((left + right) / 2) * this.scale;
    this.y = this.height / 2 - ((top + bottom) / 2) * this.scale;
    this.#keep();
  }

  /** Show the building; what a few rays saw outside is left at the edge. */
  showAll() {
    this.show(...(this.box ?? [0, 0, this.size.columns, this.size.rows]));
  }

  /** How much of the left is taken by the tools. */
  beside() {
    const tools = document.getElementById("tools");
    return tools ? tools.offsetLeft + tools.offsetWidth : TOOLS_PX;
  }

  /** Never lose the map: some of it stays in the middle half of the screen. */
  #keep() {
    const wide = this.size.columns * this.scale;
    const high = this.size.rows * this.scale;
    this.x = Math.min(this.width * 0.75, Math.max(this.width * 0.25 - wide, this.x));
    this.y = Math.min(this.height * 0.75, Math.max(this.height * 0.25 - high, this.y));
    this.changed();
  }
}
