// The dialog of exports: what is written where, and which files are out of date.

import { h, byId } from "./dom.js";

export class Export {
  constructor(studio) {
    this.studio = studio;
    this.dialog = byId("export");
    this.folder = ""; // the map's own
  }

  async open() {
    this.field = h("input", { className: "field", id: "export-folder", type: "text", autocomplete: "off", spellcheck: false, "aria-describedby": "export-place" });
    this.field.setAttribute("list", "export-folders");
    this.field.addEventListener("change", () => this.#show(this.field.value.trim()));
    this.place = h("p", { className: "paths", id: "export-place" });
    this.offered = h("datalist", { id: "export-folders" });
    this.list = h("ul", { className: "exports" });
    this.status = h("p", { className: "paths", role: "status" });
    this.write = h("button", { className: "button primary", type: "button" }, "Write");
    this.write.addEventListener("click", () => this.#write());
    const close = h("button", { className: "button", type: "button" }, "Close");
    close.addEventListener("click", () => this.dialog.close());
    this.dialog.replaceChildren(
      h("h2", { id: "export-title" }, "Export"),
      h("label", { className: "folder", for: "export-folder" }, "Folder", this.field),
      this.offered,
      this.place,
      this.list,
      this.status,
      h("div", { className: "row end" }, close, this.write),
    );
    await this.#show(this.folder);
    if (!this.dialog.open) this.dialog.showModal();
  }

  /** Show what there is in a folder; the boxes that are checked stay so. */
  async #show(folder) {
    this.write.disabled = true; // until the folder has been checked
    this.#tell("", false);
    let found;
    try {
      found = await this.studio.server.get(`exports?folder=${encodeURIComponent(folder)}`);
    } catch (error) {
      this.#tell(error.message, true);
      return;
    }
    this.folder = folder;
    this.field.value = found.name;
    this.offered.replaceChildren(...found.offered.map((name) => h("option", { value: name })));
    this.place.textContent = found.folder;
    this.place.hidden = found.folder === found.name;
    const before = this.boxes;
    this.boxes = new Map();
    this.there = new Set(found.items.flatMap((item) => item.there));
    const rows = found.items.map((item) => {
      const checked = before?.get(item.name)?.checked ?? (item.older || item.name === "labels" || item.name === "places");
      const box = h("input", { type: "checkbox", id: `export-${item.name}`, checked });
      this.boxes.set(item.name, box);
      return h("li", {}, box, h("label", { for: box.id }, h("b", {}, item.words), h("span", { className: "small" }, item.files.join(", "))), h("span", { className: "small state" }, found.own ? age(item) : replaced(item)));
    });
    this.list.replaceChildren(...rows);
    this.write.disabled = false;
  }

  async #write() {
    this.write.disabled = true;
    const [written, notes, problems] = [[], [], []];
    for (const [name, box] of this.boxes) {
      if (!box.checked) continue;
      try {
        const replaced = [...this.there, ...written];
        const { files, remarks } = await this.studio.server.post("export", { what: name, folder: this.folder, replaced });
        written.push(...files.map((path) => path.split(/[\\/]/).pop()));
        notes.push(...remarks);
      } catch (error) {
        problems.push(error.message);
      }
    }
    await this.#show(this.folder); // what was written is up to date now
    const names = [...new Set(written)];
    this.#tell([names.length ? `Written: ${names.join(", ")}.` : "", ...new Set(notes), ...problems].filter(Boolean).join(" "), problems.length > 0);
  }

  #tell(words, bad) {
    this.status.textContent = words;
    this.status.classList.toggle("bad", bad);
  }
}

function age({ written, older }) {
  if (!written) return "not written yet";
  return older ? "out of date" : "up to date";
}

function replaced({ there }) {
  return there.length ? `replaces ${there.join(", ")}` : "not written yet";
}
