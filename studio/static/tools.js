// Tools: what the pointer does on the map, and what is drawn until the server has painted it.

export const TOOLS = [
  { name: "look", key: "v", words: "Look: drag to move, click to ask why", icon: "pan" },
  { name: "brush", key: "b", words: "Brush", icon: "brush" },
  { name: "rectangle", key: "r", words: "Rectangle", icon: "rectangle" },
  { name: "polygon", key: "p", words: "Polygon", icon: "polygon", hint: "Click the corners; double-click or press Enter to close." },
  { name: "fill", key: "f", words: "Fill a region", icon: "fill", hint: "Click a region to give all of it this class." },
  { name: "doorway", key: "d", words: "Doorway: click wall, click wall", icon: "doorway", hint: "Click on either side of the opening; the ends reach to the walls." },
  { name: "cut", key: "k", words: "Cut a place: click wall, click wall", icon: "cut", hint: "Click on either side of a place: its two parts touch, without a doorway between them." },
  { name: "merge", key: "m", words: "Merge two regions", icon: "merge", hint: "Click the two regions that are one." },
];

const LINES = ["doorway", "cut"]; // from wall to wall
const LEAST_STEP = 3;

export class Tools {
  constructor(studio) {
    this.studio = studio;
    this.name = "look";
    this.radius = 6;
    this.points = [];
    this.drawing = false;
    this.pointer = null;
    this.pending = [];
    this.first = null;
    this.line = null; // the doorway or cut that a second click would draw
  }

  get tool() {
    return TOOLS.find((tool) => tool.name === this.name);
  }

  choose(name) {
    this.cancel();
    this.name = name;
    this.studio.changed();
  }

  cancel() {
    this.points = [];
    this.drawing = false;
    this.first = this.line = null;
    this.studio.redraw();
  }

  /** Whether the tool takes a press at this point; else the map is moved. */
  press(point, screen) {
    if (this.name === "look") return false;
    this.pointer = point;
    if (this.name === "brush" || this.name === "rectangle") {
      this.drawing = true;
      this.points = [point];
      this.last = screen;
    }
    this.studio.redraw();
    return true;
  }

  move(point, screen) {
    this.pointer = point;
    if (this.drawing && this.name === "brush") {
      if (Math.hypot(screen.x - this.last.x, screen.y - this.last.y) >= LEAST_STEP) {
        this.points.push(point);
        this.last = screen;
      }
    } else if (this.drawing) {
      this.points[1] = point;
    }
    this.studio.redraw();
  }

  release(point) {
    if (!this.drawing) return;
    this.drawing = false;
    if (this.name === "brush") this.points.push(point);
    else this.points[1] = point;
    const points = this.points;
    this.points = [];
    if (this.name === "rectangle" && (points[0].x === point.x || points[0].y === point.y)) return;
    this.#stroke(this.name, points);
  }

  click(point, region) {
    if (this.name === "polygon") {
      this.points.push(point);
    } else if (LINES.includes(this.name)) {
      this.points.push(point);
      if (this.points.length === 2) {
        const points = this.points;
        this.points = [];
        this.line = null;
        if (this.name === "cut") this.#cut(points);
        else this.#stroke("doorway", points);
      }
    } else if (this.name === "fill") {
      this.fill(point);
    } else if (this.name === "merge" && region) {
      this.#merge(region);
    }
    this.studio.changed(); // what is drawn can be taken back
  }

  /** Take back the last corner of what is being drawn; whether there was one. */
  takeBack() {
    if (this.drawing || !this.points.length) return false;
    this.points.pop();
    this.line = null;
    this.studio.changed();
    return true;
  }

  /** Whether something is being drawn that Esc gives up. */
  get busy() {
    return this.drawing || this.points.length > 0 || this.first !== null;
  }

  /** Show where the line would end, not more often than the server can say. */
  async snap() {
    if (!LINES.includes(this.name) || this.points.length !== 1 || this.snapping || !this.pointer) return;
    const [start, end] = [this.points[0], this.pointer];
    this.snapping = true;
    const { frame, server } = this.studio;
    const [[x1, y1], [x2, y2]] = [start, end].map((point) => frame.toCells(point));
    const found = await server.get("door-line", { x1, y1, x2, y2 }).catch(() => null);
    this.snapping = false;
    if (this.points[0] !== start) return;
    this.line = found && found.ends.map((point) => frame.fromCells(point));
    this.studio.redraw();
    if (this.pointer && this.pointer !== end) this.snap();
  }

  /** Close a polygon. */
  close() {
    if (this.name !== "polygon" || this.points.length < 3) return;
    const points = this.points;
    this.points = [];
    this.#stroke("polygon", points);
  }

  fill(point, label = this.studio.label) {
    const cells = this.studio.frame.toCells(point);
    return this.studio.edit({ kind: "fill", label, point: cells });
  }

  #merge(region) {
    if (this.first === null) {
      this.first = region.id;
      this.studio.say(`Now click what is one with ${region.name}.`);
      return;
    }
    const [first, second] = [this.first, region.id];
    this.first = null;
    this.studio.edit({ kind: "merge", first, second });
  }

  #cut(points) {
    const [start, end] = points.map((point) => this.studio.frame.toCells(point));
    this.studio.edit({ kind: "cut", start, end });
  }

  async #stroke(tool, points) {
    const { studio } = this;
    const label = studio.labelOf(tool);
    const shown = { tool, points, radius: this.radius, label, revision: null };
    this.pending.push(shown);
    studio.redraw();
    const stroke = {
      tool,
      points: points.map((point) => studio.frame.toCells(point)),
      radius: tool === "doorway" ? studio.doorwayRadius : this.radius,
    };
    const over = tool === "doorway" || studio.over < 0 ? {} : { over: studio.over };
    const done = await studio.edit({ kind: "stroke", label, stroke, ...over });
    if (done?.remark) studio.say(done.remark, true);
    if (done) shown.revision = done.revision;
    else this.pending = this.pending.filter((other) => other !== shown);
    studio.redraw();
  }

  /** Forget strokes that the server has painted and the tiles show. */
  settle(revision, settled) {
    if (!settled) return;
    this.pending = this.pending.filter((item) => item.revision === null || item.revision > revision);
  }

  /** Draw strokes and the tool's own marks; the context is in cells. */
  draw(context, pixel, colours) {
    for (const item of this.pending) this.#drawShape(context, item, pixel, colours, 0.75);
    const label = this.studio.labelOf(this.name);
    if (this.drawing || this.points.length) {
      let points = [...this.points];
      const open = this.name === "polygon" || LINES.includes(this.name);
      if (open && this.pointer) points.push(this.pointer);
      if (this.line) points = this.line;
      const shape = { tool: this.name, points, radius: this.radius, label };
      this.#drawShape(context, shape, pixel, colours, 0.55);
    }
    if (this.line) this.#drawEnds(context, pixel, colours);
    if (this.name === "brush" && this.pointer) {
      for (const [colour, width] of [
        [colours.halo, 3],
        [colours.ink, 1.4],
      ]) {
        context.beginPath();
        context.arc(this.pointer.x, this.pointer.y, Math.max(this.radius, 0.5), 0, 7);
        context.strokeStyle = colour;
        context.lineWidth = width * pixel;
        context.stroke();
      }
    }
  }

  /** Where a doorway or a cut reaches to. */
  #drawEnds(context, pixel, colours) {
    for (const { x, y } of this.line) {
      context.beginPath();
      context.arc(x, y, 4 * pixel, 0, 7);
      context.fillStyle = colours.ink;
      context.strokeStyle = colours.halo;
      context.lineWidth = 2 * pixel;
      context.fill();
      context.stroke();
    }
  }

  #drawShape(context, { tool, points, radius, label }, pixel, colours, opacity) {
    if (!points.length) return;
    const colour = tool === "cut" ? colours.ink : label < 0 ? colours.halo : colours.ofLabel(label);
    context.save();
    context.globalAlpha = opacity;
    context.fillStyle = colour;
    context.strokeStyle = colour;
    context.lineCap = context.lineJoin = "round";
    context.beginPath();
    if (tool === "rectangle") {
      const [a, b] = [points[0], points[1] ?? points[0]];
      context.rect(a.x, a.y, b.x - a.x, b.y - a.y);
      context.fill();
    } else {
      points.forEach((point, k) => (k ? context.lineTo(point.x, point.y) : context.moveTo(point.x, point.y)));
      if (tool === "polygon") {
        context.fill();
        context.globalAlpha = 1;
        context.lineWidth = 2 * pixel;
      } else {
        if (points.length === 1) context.lineTo(points[0].x + 0.01, points[0].y); // a dot
        if (tool === "cut") context.globalAlpha = 1;
        context.lineWidth = tool === "cut" ? 2 * pixel : 2 * (tool === "doorway" ? this.studio.doorwayRadius : Math.max(radius, 0.5));
      }
      context.stroke();
    }
    context.restore();
  }
}
