// The panel of classes: what is painted, in which colour, and whether it is learned.

import { h, icon, swatch } from "./dom.js";

export class Classes {
  constructor(studio) {
    this.studio = studio;
    this.element = h("div", { className: "panel" });
  }

  render(state) {
    const { label } = this.studio;
    const key = JSON.stringify([state.classes, label, state.learns, state.painted, state.model, state.versions]);
    if (key === this.key || this.element.querySelector("input:not([type=checkbox]):focus")) return;
    this.key = key;
    const { resolution_m: side } = state.map;
    this.element.replaceChildren(
      h("section", {}, h("h2", {}, "Paint with"),
        h("ul", { className: "classes" },
          state.classes.map((item, k) => this.#row(item, k)),
          this.#eraser()),
        this.#adder(state)),
      h("section", {}, h("h2", {}, "What the paint does"),
        h("p", { className: "small" }, `${(state.painted * side * side).toFixed(1)} m² are painted. They keep their label, and pull what lies around them.`),
        this.#teaching(state)),
      h("hr", { className: "rule" }),
      h("section", {}, h("h2", {}, "Versions"), this.#versions(state)),
      h("section", {}, h("h2", {}, "Export"), this.#exports()),
    );
  }

  /** Painted cells are fixed; a separate button trains the model on them. */
  #teaching(state) {
    if (!state.model) return h("p", { className: "small" }, "All is learned from the paint: begin with a stroke of two classes.");
    const words = state.learns
      ? `The model “${state.model}” also learns from it, for errors that repeat and for other maps of this kind.`
      : "Where errors repeat, teach the model.";
    const button = h("button", { className: "button", type: "button" }, state.learns ? "Stop teaching" : "Teach from this");
    button.addEventListener("click", () => this.studio.edit({ kind: "learn", on: !state.learns }));
    return [h("p", { className: "small" }, words), button];
  }

  #row(item, k) {
    const colour = h("input", {
      type: "color", className: "swatch", value: item.colour, "aria-label": `Colour of ${item.name}`, title: "Change the colour",
    });
    colour.addEventListener("change", () => {
      colour.blur(); // else keys would go on choosing a colour, and the panel would wait for it
      this.studio.edit({ kind: "class", index: k, name: item.name, colour: colour.value });
    });
    const pick = h("button", { className: "pick", type: "button", "aria-pressed": String(this.studio.label === k) },
      h("span", {}, item.name));
    pick.addEventListener("click", () => this.studio.chooseLabel(k));
    const chosen = this.studio.label === k ? " chosen" : "";
    const digit = k < 9 ? h("kbd", {}, String(k + 1)) : null;
    if (item.own) return h("li", { className: `class${chosen}` }, colour, pick, digit);
    const change = h("button", { className: "plain small-target", type: "button", title: `Rename ${item.name}`, "aria-label": `Rename ${item.name}` }, icon("pen"));
    const drop = h("button", { className: "plain small-target", type: "button", title: `Delete ${item.name}`, "aria-label": `Delete ${item.name}` }, icon("cross"));
    drop.addEventListener("click", async () => {
      if (await this.studio.edit({ kind: "drop", index: k })) this.studio.say(`${item.name} and its paint are deleted; Ctrl Z brings them back.`);
    });
    const deletable = !item.fixed && this.studio.state.classes.length > 2;
    const row = h("li", { className: `class${chosen}` }, colour, pick, change, deletable ? drop : null, digit);
    change.addEventListener("click", () => this.#rename(row, pick, item, k));
    return row;
  }

  /** Write another name in place of the old one. */
  #rename(row, pick, item, index) {
    const field = h("input", { className: "field", value: item.name, "aria-label": `New name of ${item.name}`, maxLength: 60 });
    let finished = false; // removing the field takes the focus from it, which ends it once more
    const done = (keep) => {
      if (finished) return;
      finished = true;
      const name = field.value.trim();
      field.remove();
      pick.hidden = false;
      this.key = null;
      if (keep && name && name !== item.name) this.studio.edit({ kind: "class", index, name, colour: item.colour });
      this.studio.changed();
    };
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === "Escape") done(event.key === "Enter");
    });
    field.addEventListener("blur", () => done(true));
    pick.hidden = true;
    row.insertBefore(field, pick);
    field.select();
  }

  #eraser() {
    const on = this.studio.label < 0;
    const pick = h("button", { className: "pick", type: "button", "aria-pressed": String(on) }, h("span", {}, "Eraser"));
    pick.addEventListener("click", () => this.studio.chooseLabel(-1));
    return h("li", { className: `class${on ? " chosen" : ""}` }, icon("erase"), pick, h("kbd", {}, "0"));
  }

  #adder(state) {
    const field = h("input", { className: "field", placeholder: "Another class", "aria-label": "Name of another class", maxLength: 60 });
    const form = h("form", { className: "row" }, swatch(state.next_colour), field, h("button", { className: "button" }, "Add"));
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const name = field.value.trim();
      if (!name) return;
      const index = state.classes.length;
      field.blur();
      if (await this.studio.edit({ kind: "class", index, name, colour: state.next_colour })) this.studio.chooseLabel(index);
    });
    return form;
  }

  #versions(state) {
    const save = h("button", { className: "button", type: "button" }, "Save this version");
    save.addEventListener("click", () => {
      const name = window.prompt("Name of the version", `version ${state.versions.length + 1}`)?.trim();
      if (name) this.studio.edit({ kind: "version", name });
    });
    const rows = [...state.versions].reverse().map((item) => {
      const back = h("button", { className: "button", type: "button" }, "Go back");
      back.addEventListener("click", () => this.studio.edit({ kind: "restore", revision: item.revision }));
      const when = new Date(item.saved_at * 1000).toLocaleString([], { dateStyle: "short", timeStyle: "short" });
      return h("li", { className: "row between" }, h("span", {}, item.name, " ", h("span", { className: "small" }, when)), back);
    });
    return [
      h("p", { className: "small" }, "Every stroke is on the disk at once. A version gives a state a name to go back to."),
      h("ul", { className: "versions" }, rows),
      save,
    ];
  }

  #exports() {
    const button = h("button", { className: "button", type: "button" }, "Export …");
    button.addEventListener("click", () => this.studio.exports.open());
    return [h("p", { className: "small" }, "Labels, places, routes, the paint, a model: as files for other programs."), button];
  }
}
