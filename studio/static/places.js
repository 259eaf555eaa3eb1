// Places: outlines, names, gates and connections of the newest labels, drawn over the map.

import { Frame } from "./geometry.js";

const NAME_SIZE = 12.5;

export class Places {
  constructor() {
    this.regions = [];
    this.gates = [];
    this.connections = [];
    this.checks = [];
    this.path = [];
    this.byId = new Map();
  }

  take(record, map) {
    this.frame = new Frame(map);
    this.regions = record.regions ?? [];
    this.gates = record.gates ?? [];
    this.connections = record.connections ?? [];
    this.checks = record.checks ?? [];
    this.byId = new Map(this.regions.map((region) => [region.id, region]));
    for (const region of this.regions) {
      region.outline = new Path2D();
      for (const ring of region.polygons.flat()) this.#trace(region.outline, ring);
      region.shell = new Path2D();
      for (const [ring] of region.polygons) this.#trace(region.shell, ring);
      region.anchor = this.frame.fromMetres(region.anchor_m);
      region.reach = region.clearance_m / map.resolution_m;
    }
    for (const gate of this.gates) {
      gate.outline = new Path2D();
      this.#trace(gate.outline, gate.corners_m);
    }
  }

  /** The regions next to one: behind its doors, where it is not itself a doorway. */
  beside(region) {
    const found = new Set();
    for (const id of region.neighbours) {
      const other = this.byId.get(id);
      if (!other) continue;
      const behind = other.class === "doorway" && region.class !== "doorway" ? other.neighbours : [id];
      for (const number of behind) if (number !== region.id) found.add(this.byId.get(number));
    }
    return [...found].filter(Boolean);
  }

  takeDrive(record, map) {
    const frame = new Frame(map);
    this.path = new Path2D();
    record.path_m.forEach((point, k) => {
      const { x, y } = frame.fromMetres(point);
      if (k) this.path.lineTo(x, y);
      else this.path.moveTo(x, y);
    });
  }

  #trace(path, ring) {
    ring.forEach((point, k) => {
      const { x, y } = this.frame.fromMetres(point);
      if (k) path.lineTo(x, y);
      else path.moveTo(x, y);
    });
    path.closePath();
  }

  /** Draw what is shown; the context is in cells, and `pixel` is a pixel of the screen in cells. */
  draw(context, pixel, shown, colours) {
    if (shown.regions) {
      context.strokeStyle = colours.outline;
      context.lineWidth = 1.2 * pixel;
      for (const region of this.regions) context.stroke(region.outline);
    }
    if (shown.gates) {
      context.strokeStyle = colours.gate;
      context.lineWidth = 2 * pixel;
      for (const gate of this.gates) context.stroke(gate.outline);
    }
    if (shown.drive && this.path instanceof Path2D) {
      context.strokeStyle = colours.accent;
      context.lineJoin = "round";
      context.lineWidth = 2 * pixel;
      context.stroke(this.path);
    }
    if (shown.graph) this.#drawGraph(context, pixel, colours);
  }

  #drawGraph(context, pixel, colours) {
    // Half a metre of floor at most, so that dots do not cover a building on a phone.
    const radius = Math.min(5, Math.max(2.2, 0.35 / this.frame.map.resolution_m / pixel));
    const thick = Math.max(0.6, radius / 5) * pixel;
    const edges = new Path2D();
    for (const item of this.connections) {
      const first = this.byId.get(item.first)?.anchor;
      const second = this.byId.get(item.second)?.anchor;
      if (!first || !second) continue;
      const middle = this.frame.fromMetres(item.point_m);
      edges.moveTo(first.x, first.y);
      edges.lineTo(middle.x, middle.y);
      edges.lineTo(second.x, second.y);
    }
    context.lineJoin = "round";
    for (const [colour, width] of [
      [colours.halo, 4.5],
      [colours.ink, 1.8],
    ]) {
      context.strokeStyle = colour;
      context.lineWidth = width * thick;
      context.stroke(edges);
    }
    for (const region of this.regions) {
      context.beginPath();
      context.arc(region.anchor.x, region.anchor.y, radius * pixel, 0, 7);
      context.fillStyle = colours.of(region.class);
      context.fill();
      context.strokeStyle = colours.ink;
      context.lineWidth = 1.6 * thick;
      context.stroke();
    }
  }

  /** Names of the places that have room for theirs; the context is in pixels of the screen. */
  drawNames(context, view, colours) {
    context.font = `600 ${NAME_SIZE}px ${getComputedStyle(document.body).fontFamily}`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineJoin = "round";
    const taken = [];
    const byArea = [...this.regions].sort((a, b) => b.area_m2 - a.area_m2);
    for (const region of byArea) {
      const { x, y } = view.toScreen(region.anchor.x, region.anchor.y);
      if (x < -80 || y < -20 || x > view.width + 80 || y > view.height + 20) continue;
      const half = context.measureText(region.name).width / 2;
      if (region.reach * view.scale < Math.min(half * 0.8, 18)) continue;
      const box = [x - half - 3, y - 9, x + half + 3, y + 9];
      if (taken.some((other) => overlap(box, other))) continue;
      taken.push(box);
      context.strokeStyle = colours.halo;
      context.lineWidth = 3.5;
      context.strokeText(region.name, x, y);
      context.fillStyle = colours.ink;
      context.fillText(region.name, x, y);
    }
  }

  drawChosen(context, pixel, id, colours) {
    const region = this.byId.get(id);
    if (!region) return;
    for (const [colour, width] of [
      [colours.halo, 6],
      [colours.accent, 3],
    ]) {
      context.strokeStyle = colour;
      context.lineWidth = width * pixel;
      context.stroke(region.shell);
    }
  }
}

const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
