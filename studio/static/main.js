// The studio: what the person sees and does, and what the server knows, brought together.

import { h, byId, icon } from "./dom.js";
import { Server } from "./server.js";
import { View } from "./view.js";
import { Stage } from "./stage.js";
import { Places } from "./places.js";
import { Tools, TOOLS } from "./tools.js";
import { Pointer } from "./pointer.js";
import { Swipe } from "./swipe.js";
import { Theme } from "./theme.js";
import { Layers } from "./layers.js";
import { Classes } from "./classes.js";
import { Review } from "./review.js";
import { Why } from "./why.js";
import { Keys, help } from "./keys.js";
import { Status } from "./status.js";
import { Readout } from "./readout.js";
import { Options } from "./options.js";
import { Export } from "./export.js";
import { Cross } from "./cross.js";
import { Memory } from "./memory.js";
import { Frame } from "./geometry.js";

const SLOW_MS = 300; // an edit that takes longer is shown in the status

class Studio {
  constructor() {
    const canvas = byId("canvas");
    this.server = new Server();
    this.view = new View(canvas);
    this.places = new Places();
    this.theme = new Theme(() => this.changed());
    this.tools = new Tools(this);
    this.swipe = new Swipe(byId("swipe"), this);
    this.layers = new Layers(this);
    this.classes = new Classes(this);
    this.review = new Review(this);
    this.why = new Why(this);
    this.cross = new Cross(this.view, this);
    this.memory = new Memory(this);
    this.exports = new Export(this);
    this.status = new Status(this);
    this.readout = new Readout(this);
    this.options = new Options(this);
    this.over = -1; // the only class that is painted over; -1 for all
    this.stage = new Stage(canvas, this.view, this);
    this.pointer = new Pointer(canvas, this.view, this);
    this.keys = new Keys(this, this.view, this.pointer);
    this.label = 0;
    this.chosen = null;
    this.asked = null;
    this.placesVersion = "";
    this.slow = new Set();
    this.offline = null; // why there is no news
    this.refused = 0; // edits that were not saved
    this.tab = "paint";
    this.#build();
    this.server.follow((state) => this.#take(state), (why) => this.#lost(why));
  }

  // ------------------------------------------------------------------ what the server says

  #take(state) {
    const first = !this.state;
    this.state = state;
    this.offline = null;
    this.refused = 0;
    this.frame = new Frame(state.map);
    this.colours = this.theme.colours(state.classes);
    this.label = Math.min(this.label, state.classes.length - 1);
    if (first) {
      this.view.size = state.map;
      this.view.box = state.map.box;
      this.view.showAll();
      document.title = `${state.map.name} · Studio`;
      byId("map-name").textContent = state.map.name;
      byId("all-maps").hidden = state.pool.of < 2;
      byId("all-maps").prepend(icon("next"));
      this.memory.recall(state.map.name);
      if (state.drive) this.#loadDrive();
    }
    this.#labelled(state.relabelling);
    this.#loadPlaces();
    this.readout.soon();
    this.changed();
  }

  /** Labels have come: the first lead to uncertain places, others show what they changed. */
  #labelled(relabelling) {
    if (!relabelling || relabelling.number === this.labelled) return;
    const first = this.labelled === undefined;
    this.labelled = relabelling.number;
    if (first && this.state.model && !this.tabChosen) this.show("review");
    if (first || !relabelling.changed) return;
    this.flash = performance.now();
    this.redraw();
    if (this.wentBack) {
      this.say(`${relabelling.changed}.`);
      return;
    }
    const undo = h("button", { className: "plain", type: "button" }, "Undo");
    undo.addEventListener("click", () => {
      byId("toast").hidden = true;
      this.edit({ kind: "undo" });
    });
    this.say([h("span", {}, `${relabelling.changed}.`), undo]);
  }

  async #loadPlaces() {
    const { relabelling, revision } = this.state;
    const version = relabelling ? `${relabelling.number}.${revision}` : "";
    if (!relabelling || version === this.wantedPlaces) return;
    this.wantedPlaces = version;
    const record = await this.server.get("places").catch(() => null);
    if (!record || version !== this.wantedPlaces) return;
    const chosen = this.places.byId.get(this.chosen);
    this.places.take(record, this.state.map);
    this.placesVersion = version;
    if (chosen && !this.places.byId.has(this.chosen)) this.chosen = null;
    if (this.asked) this.#ask(this.asked);
    this.readout.soon();
    this.changed();
  }

  async #loadDrive() {
    this.places.takeDrive(await this.server.get("drive"), this.state.map);
    this.layers.set("drive", 1);
  }

  #lost(why) {
    this.offline = why;
    this.readout.clear();
    this.status.render();
  }

  /** What the pictures of a layer depend on: another version means other pictures. */
  versionOf(name) {
    const { classes, revision, relabelling } = this.state;
    const colours = classes.map((item) => item.colour.slice(1)).join("");
    if (name === "map") return "0";
    if (name === "paint") return `${revision}.${colours}`;
    if (name.startsWith("labels-file:")) return `0.${colours}`;
    const learned = relabelling?.number ?? 0;
    return name.startsWith("labels") ? `${learned}.${colours}` : `${learned}`;
  }

  // ------------------------------------------------------------------ what the person does

  async edit(request) {
    this.wentBack = ["undo", "redo", "restore"].includes(request.kind);
    const late = setTimeout(() => {
      this.slow.add(request);
      this.status.render();
    }, SLOW_MS);
    try {
      return await this.server.post("edit", request);
    } catch (error) {
      if (!error.status || error.status === 403) this.refused += 1; // the studio has stopped, so the edit is lost
      this.say(error.status === 403 ? "Not saved: the studio of this tab has stopped." : error.message, true);
      this.status.render();
      return null;
    } finally {
      clearTimeout(late);
      if (this.slow.delete(request)) this.status.render();
    }
  }

  /** Take back the last corner of what is being drawn, or the last edit. */
  undo() {
    if (!this.tools.takeBack()) this.edit({ kind: "undo" });
  }

  redo() {
    this.edit({ kind: "redo" });
  }

  /** Give up what is being drawn, or close the answer to "why". */
  escape() {
    if (this.tools.busy) this.tools.cancel();
    else this.forget();
  }

  /** Close the explanation of a cell or place. */
  forget() {
    this.asked = this.chosen = this.why.cell = this.why.reasons = null;
    if (!this.readout.screen) this.readout.leave();
    this.changed();
  }

  chooseLabel(label) {
    this.label = label;
    if (this.tools.name === "look" || this.tools.name === "merge") this.tools.choose("brush");
    this.changed();
  }

  fillChosen(label) {
    const region = this.places.byId.get(this.chosen);
    if (region) this.tools.fill(region.anchor, label);
    else this.say("Choose a place first: click it with the hand, or press N.");
  }

  confirm() {
    const region = this.places.byId.get(this.chosen);
    if (region) this.fillChosen(this.state.classes.findIndex((item) => item.name === region.class));
  }

  goTo(id) {
    const region = this.places.byId.get(id);
    if (!region) return;
    this.chosen = id;
    this.why.cell = null;
    this.why.reasons = null;
    this.asked = null;
    const polygons = region.polygons.flat(2).map((point) => this.frame.fromMetres(point));
    const xs = polygons.map((point) => point.x);
    const ys = polygons.map((point) => point.y);
    const room = 2.5 / this.state.map.resolution_m;
    this.view.show(Math.min(...xs) - room, Math.min(...ys) - room, Math.max(...xs) + room, Math.max(...ys) + room);
    this.readout.read(region.anchor);
    this.changed();
  }

  hovered(screen) {
    this.tools.pointer = this.view.toMap(screen.x, screen.y);
    if (this.tools.name !== "look") this.redraw();
    this.tools.snap();
    this.readout.at(screen);
  }

  /** The map was moved: redraw it, and update the cell under the pointer. */
  moved() {
    if (this.readout.screen) this.hovered(this.readout.screen);
    this.redraw();
  }

  left() {
    this.readout.leave();
    this.tools.pointer = null;
    this.redraw();
  }

  resize(factor) {
    this.tools.radius = Math.min(200, Math.max(0.5, this.tools.radius * factor));
    this.changed();
  }

  /** The class that a tool paints. */
  labelOf(tool) {
    return tool === "doorway" && this.label >= 0 ? this.doorwayLabel : this.label;
  }

  get doorwayLabel() {
    const named = this.state.classes.findIndex((item) => /^door/i.test(item.name));
    return named < 0 ? this.label : named;
  }

  get doorwayRadius() {
    return Math.max(1, 0.12 / this.state.map.resolution_m);
  }

  clicked(screen) {
    const point = this.view.toMap(screen.x, screen.y);
    const region = this.#regionAt(point);
    if (this.tools.name === "look") this.#ask(point);
    else this.tools.click(point, region);
  }

  doubled() {
    if (this.tools.name === "polygon") {
      this.tools.points.pop(); // the second click of the two
      this.tools.close();
    }
  }

  async #ask(point) {
    const [x, y] = this.frame.toCells(point);
    const cell = await this.server.get("cell", { x, y }).catch(() => null);
    if (!cell) return;
    const moved = this.asked !== point;
    this.asked = point;
    this.why.cell = cell;
    this.chosen = cell.region ?? null;
    if (moved) this.show("why");
    this.why.reasons = null;
    this.changed();
    if (cell.ground !== "free" || !cell.label) return;
    const reasons = await this.server.get("reasons", { x_m: cell.x_m, y_m: cell.y_m }).catch(() => null);
    if (this.asked !== point) return; // superseded by a newer request
    this.why.reasons = reasons;
    this.changed();
  }

  #regionAt(point) {
    const { context } = this.stage;
    context.save();
    context.resetTransform();
    const found = this.places.regions.find((region) => context.isPointInPath(region.outline, point.x, point.y, "evenodd"));
    context.restore();
    return found;
  }

  // ------------------------------------------------------------------ the page

  redraw() {
    this.stage?.redraw();
  }

  changed() {
    if (!this.state) return;
    this.colours = this.theme.colours(this.state.classes);
    for (const panel of [this.classes, this.layers, this.review, this.why]) panel.render(this.state);
    this.status.render();
    this.#bar();
    this.memory.keep();
    this.redraw();
  }

  show(tab) {
    if (this.tab !== tab) byId("panels").scrollTop = 0;
    this.tab = tab;
    document.querySelector(".side").classList.remove("folded");
    this.#tabs();
  }

  say(words, bad = false) {
    const toast = byId("toast");
    toast.replaceChildren(...[words].flat());
    toast.className = bad ? "toast bad" : "toast";
    toast.hidden = false;
    clearTimeout(this.toasted);
    this.toasted = setTimeout(() => (toast.hidden = true), bad || typeof words !== "string" ? 6000 : 3000);
  }

  #build() {
    const tools = byId("tools");
    for (const tool of TOOLS) {
      const title = `${tool.words} (${tool.key.toUpperCase()})`;
      const button = h("button", { type: "button", title, "aria-label": title, "data-tool": tool.name }, icon(tool.icon), h("span", { className: "words" }, tool.words.split(":")[0]));
      button.addEventListener("click", () => this.tools.choose(tool.name));
      tools.append(button);
      if (tool.name === "look") tools.append(h("hr"));
    }
    const action = (name, words, act, wide = false, short = "") => {
      const button = h("button", { className: `plain${wide ? " wide-only" : ""}`, type: "button", title: words, "aria-label": words, id: `act-${name}` }, icon(name), short ? h("span", { className: "words" }, short) : "");
      button.addEventListener("click", act);
      return button;
    };
    byId("actions").append(
      action("undo", "Undo (Ctrl Z)", () => this.undo(), false, "Undo"),
      action("redo", "Redo (Ctrl Shift Z)", () => this.redo(), false, "Redo"),
      action("swipe", "Divider between two labellings (S)", () => this.swipe.toggle("divider"), true, "Divider"),
      action("side", "Two labellings side by side (Shift S)", () => this.swipe.toggle("side"), true, "Side by side"),
      action("sun", "Light or dark", () => this.theme.toggle()),
      action("help", "Keys (?)", help, true, "Keys"),
    );
    byId("zoom").append(
      action("plus", "Zoom in (+)", () => this.view.zoom(1.5)),
      action("minus", "Zoom out (−)", () => this.view.zoom(1 / 1.5)),
      action("fit", "Show all (Home)", () => this.view.showAll()),
    );
    const panels = { review: ["Review", this.review], paint: ["Paint", this.classes], layers: ["Layers", this.layers], why: ["Why", this.why] };
    for (const [name, [words, panel]] of Object.entries(panels)) {
      const tab = h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}` }, words);
      tab.addEventListener("click", () => {
        this.tabChosen = true;
        if (this.tab === name) this.#fold();
        else this.show(name);
      });
      byId("tabs").append(tab);
      panel.element.id = `panel-${name}`;
      panel.element.setAttribute("role", "tabpanel");
      panel.element.setAttribute("aria-labelledby", `tab-${name}`);
      panel.element.tabIndex = 0;
      byId("panels").append(panel.element);
    }
    byId("tabs").addEventListener("keydown", (event) => this.#stepTab(event));
    this.#tabs();
  }

  #fold() {
    if (window.innerWidth <= 760) document.querySelector(".side").classList.toggle("folded");
  }

  #stepTab(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const tabs = [...byId("tabs").children];
    const next = tabs[(tabs.findIndex((tab) => tab.id === `tab-${this.tab}`) + step + tabs.length) % tabs.length];
    this.show(next.id.slice(4));
    next.focus();
  }

  #tabs() {
    for (const tab of byId("tabs").children) {
      const name = tab.id.slice(4);
      tab.setAttribute("aria-selected", String(name === this.tab));
      tab.tabIndex = name === this.tab ? 0 : -1;
      byId(`panel-${name}`).hidden = name !== this.tab;
    }
  }

  #bar() {
    byId("act-undo").disabled = !this.state.can_undo && !this.tools.points.length;
    byId("act-redo").disabled = !this.state.can_redo;
    byId("act-swipe").setAttribute("aria-pressed", String(this.swipe.way === "divider"));
    byId("act-side").setAttribute("aria-pressed", String(this.swipe.way === "side"));
    this.swipe.name();
    for (const button of byId("tools").querySelectorAll("button")) {
      button.setAttribute("aria-pressed", String(button.dataset.tool === this.tools.name));
    }
    byId("canvas").dataset.tool = this.tools.name;
    const { tool } = this.tools;
    byId("hint").textContent = tool.hint ?? "";
    byId("hint").hidden = !tool.hint;
    this.options.render();
  }
}

window.studio = new Studio();
