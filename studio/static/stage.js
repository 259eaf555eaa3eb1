// The stage: the canvas with its layers from the ground up, drawn at most once a frame.

import { TileLayer } from "./tiles.js";
import { roundLength } from "./geometry.js";
import { byId } from "./dom.js";
import { TRUTH } from "./layers.js";

const FLASH_MS = 2200;

export class Stage {
  constructor(canvas, view, studio) {
    Object.assign(this, { canvas, view, studio });
    this.context = canvas.getContext("2d", { alpha: false });
    this.tiles = new Map();
    this.frames = 0;
    this.asked = false;
    this.split = null;
    new ResizeObserver(() => this.#resize()).observe(canvas);
    view.changed = () => studio.moved();
  }

  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.#draw();
    });
  }

  /** The layer of a name, made when it is first drawn. */
  layer(name) {
    if (!this.tiles.has(name)) this.tiles.set(name, new TileLayer(name, () => this.redraw()));
    return this.tiles.get(name);
  }

  #resize() {
    const { canvas, view } = this;
    view.ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * view.ratio);
    canvas.height = Math.round(canvas.clientHeight * view.ratio);
    view.follow();
    this.studio.changed();
  }

  #draw() {
    const { canvas, context, view, studio } = this;
    const { state, colours } = studio;
    const style = getComputedStyle(document.documentElement);
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    context.fillStyle = style.getPropertyValue("--stage");
    context.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    if (!state) return;
    this.frames += 1;
    const { left, right } = studio.layers.sources;
    for (const [k, corner] of view.corners.entries()) {
      context.save();
      context.translate(corner.x, corner.y);
      context.beginPath();
      context.rect(0, 0, view.width, view.height);
      context.clip();
      this.#pane(k ? right : left, colours);
      context.restore();
    }
    this.#scale(state.map);
    const paint = this.layer("paint");
    studio.tools.settle(Number(paint.version.split(".")[0]), paint.settled);
  }

  /** A pane with the labels of a source. */
  #pane(source, colours) {
    const { context, view, studio } = this;
    const { state } = studio;
    const { shown } = studio.layers;
    context.save();
    context.translate(view.x, view.y);
    context.scale(view.scale, view.scale);
    context.beginPath();
    context.rect(0, 0, state.map.columns, state.map.rows);
    context.clip();
    if (shown.map) this.#tiled("map", shown.map);
    for (const name of ["labels", "errors"]) if (shown[name]) this.#labelled(name, shown[name], source);
    if (shown.values) this.#tiled(studio.layers.value, shown.values);
    if (shown.paint) this.#tiled("paint", shown.paint);
    this.#flash();
    context.restore();
    context.save();
    context.translate(view.x, view.y);
    context.scale(view.scale, view.scale);
    const pixel = 1 / view.scale;
    studio.places.draw(context, pixel, shown, colours);
    studio.places.drawChosen(context, pixel, studio.chosen, colours);
    if (studio.asked && studio.why.reasons && studio.why.showsScan) this.#scan(studio.why.reasons, pixel, colours);
    studio.tools.draw(context, pixel, colours);
    context.restore();
    if (shown.names) studio.places.drawNames(context, view, colours);
    if (studio.asked) this.#cross(studio.asked, colours);
    studio.cross.draw(context, colours);
  }

  #tiled(name, opacity, clip = null) {
    const { context, studio } = this;
    const layer = this.layer(name);
    layer.version = studio.versionOf(name);
    layer.theme = studio.theme.name;
    context.save();
    context.globalAlpha = opacity;
    if (clip) {
      context.beginPath();
      context.rect(...clip);
      context.clip();
    }
    layer.draw(context, this.view, studio.state.map);
    context.restore();
  }

  /** Let what the newest labels changed light up, and fade. */
  #flash() {
    const { studio } = this;
    if (studio.flash === undefined) return;
    const age = performance.now() - studio.flash;
    if (age > FLASH_MS) {
      studio.flash = undefined;
      return;
    }
    const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.#tiled("changes", calm ? 0.55 : 0.75 * Math.abs(Math.cos((2.5 * Math.PI * age) / FLASH_MS)));
    this.redraw();
  }

  /** Labels, or their errors: of one source, or of two on either side of the divider. */
  #labelled(kind, opacity, source) {
    const { left, right } = this.studio.layers.sources;
    const { sources, map } = this.studio.state;
    const named = (name) => (name in sources ? `${kind}-${name}` : null);
    if (kind === "errors" && !(TRUTH in sources)) return;
    if (this.studio.swipe.way !== "divider") {
      if (named(source)) this.#tiled(named(source), opacity);
      return;
    }
    const at = this.view.toMap(this.studio.swipe.share * this.view.width, 0).x;
    const far = 2 * Math.max(map.columns, map.rows);
    if (named(left)) this.#tiled(named(left), opacity, [at - far, -far, far, 3 * far]);
    if (named(right)) this.#tiled(named(right), opacity, [at, -far, far, 3 * far]);
  }

  /** The scan of the explained cell. */
  #scan({ scan_m: ends }, pixel, colours) {
    const { context, studio } = this;
    context.beginPath();
    for (const end of ends) {
      const { x, y } = studio.frame.fromMetres(end);
      context.lineTo(x, y);
    }
    context.closePath();
    context.save();
    context.fillStyle = colours.accent;
    context.globalAlpha = 0.16;
    context.fill();
    context.globalAlpha = 0.9;
    context.strokeStyle = colours.accent;
    context.lineWidth = 1.2 * pixel;
    context.stroke();
    context.restore();
  }

  /** The position of the explained cell. */
  #cross(point, colours) {
    const { x, y } = this.view.toScreen(point.x, point.y);
    for (const [colour, width] of [
      [colours.halo, 5],
      [colours.accent, 2],
    ]) {
      this.context.strokeStyle = colour;
      this.context.lineWidth = width;
      this.context.beginPath();
      this.context.arc(x, y, 7, 0, 7);
      this.context.stroke();
    }
  }

  #scale(map) {
    const metres = roundLength((110 / this.view.scale) * map.resolution_m);
    const shown = metres >= 1000 ? `${metres / 1000} km` : metres < 1 ? `${+(metres * 100).toFixed(1)} cm` : `${metres} m`;
    byId("scale-text").textContent = shown;
    byId("scale-bar").style.width = `${(metres / map.resolution_m) * this.view.scale}px`;
  }
}
