// The dialog of exports: what is written where, and what there is older than the paint.

import { h, byId } from "./dom.js";

export class Export {
  constructor(studio) {
    this.studio = studio;
    this.dialog = byId("export");
  }

  async open() {
    const { folder, items } = await this.studio.server.get("exports");
    this.boxes = new Map();
    const rows = items.map((item) => {
      const box = h("input", { type: "checkbox", id: `export-${item.name}`, checked: item.older || item.name === "labels" || item.name === "places" });
      this.boxes.set(item.name, box);
      return h("li", {}, box, h("label", { for: box.id }, h("b", {}, item.words), h("span", { className: "small" }, item.files.join(", "))), h("span", { className: "small state" }, age(item)));
    });
    this.write = h("button", { className: "button primary", type: "button" }, "Write");
    this.write.addEventListener("click", () => this.#write());
    const close = h("button", { className: "button", type: "button" }, "Close");
    close.addEventListener("click", () => this.dialog.close());
    this.told = h("p", { className: "paths", role: "status" });
    this.dialog.replaceChildren(
      h("h2", { id: "export-title" }, "Export"),
      h("p", { className: "paths" }, `Into ${folder}`),
      h("ul", { className: "exports" }, rows),
      this.told,
      h("div", { className: "row end" }, close, this.write),
    );
    if (!this.dialog.open) this.dialog.showModal();
  }

  async #write() {
    this.write.disabled = true;
    const [written, problems] = [[], []];
    for (const [name, box] of this.boxes) {
      if (!box.checked) continue;
      try {
        written.push(...(await this.studio.server.post("export", { what: name })).files);
      } catch (error) {
        problems.push(error.message);
      }
    }
    await this.open(); // the ages are others now
    const names = [...new Set(written)].map((path) => path.split(/[\\/]/).pop());
    this.told.textContent = [names.length ? `Written: ${names.join(", ")}.` : "", ...problems].filter(Boolean).join(" ");
    this.told.classList.toggle("bad", problems.length > 0);
  }
}

function age({ written, older }) {
  if (!written) return "not written yet";
  return older ? "older than the paint" : "up to date";
}
