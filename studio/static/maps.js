// The list of maps: how far each is, and one training configuration for all of them.

import { h, byId, icon } from "./dom.js";
import { Server } from "./server.js";
import { Theme } from "./theme.js";

const ASK_EVERY_MS = 1500;

class Overview {
  constructor() {
    this.server = new Server();
    this.theme = new Theme(() => {});
    const sun = h("button", { className: "plain", type: "button", title: "Light or dark", "aria-label": "Light or dark" }, icon("sun"));
    sun.addEventListener("click", () => this.theme.toggle());
    byId("actions").append(sun);
    this.#build();
    this.#follow();
  }

  #build() {
    const write = h("button", { className: "button primary", type: "button" }, "Write the training configuration");
    write.addEventListener("click", () => this.#write());
    this.written = h("p", { className: "paths" });
    byId("training").append(
      h("h2", {}, "One model for all"),
      h("p", { className: "small" }, "Correct uncertain places on each map. Then this writes one configuration that teaches a model the paint of all of them: ", h("code", {}, "pgm-places train train.toml --out model")),
      write, this.written);
  }

  async #write() {
    try {
      const { files } = await this.server.post("training", {});
      this.written.textContent = `Written: ${files.join(", ")}`;
    } catch (error) {
      this.#say(error.message);
    }
  }

  async #follow() {
    for (;;) {
      try {
        this.#show((await this.server.get("maps")).maps);
      } catch {
        byId("status").className = "status failed";
        byId("status").textContent = "The studio has stopped; all edits are saved";
      }
      await new Promise((resume) => setTimeout(resume, ASK_EVERY_MS));
    }
  }

  #show(maps) {
    const key = JSON.stringify(maps);
    if (key === this.key) return;
    this.key = key;
    const painted = maps.filter((map) => map.painted_m2 > 0 || map.painted_before).length;
    byId("status").className = "status";
    byId("status").textContent = `${painted} of ${maps.length} painted`;
    const focused = document.activeElement?.getAttribute?.("href");
    byId("maps").replaceChildren(...maps.map((map) => this.#row(map)));
    if (focused) document.querySelector(`[href="${focused}"]`)?.focus();
  }

  #row(map) {
    const parts = [h("b", {}, map.title), h("span", { className: "small" }, words(map))];
    if (typeof map.doubtful_m2 === "number") parts.push(h("span", { className: "amount" }, `${map.doubtful_m2.toFixed(1)} m² uncertain`));
    return h("li", {}, h("a", { className: "book", href: map.address }, parts, icon("next")));
  }

  #say(words) {
    const toast = byId("toast");
    toast.textContent = words;
    toast.className = "toast bad";
    toast.hidden = false;
    clearTimeout(this.toasted);
    this.toasted = setTimeout(() => (toast.hidden = true), 6000);
  }
}

/** How far a map is. */
function words({ problem, working, painted_m2: painted, painted_before: before }) {
  if (problem) return problem;
  if (working) return "is being labelled";
  if (painted > 0) return `${painted.toFixed(1)} m² painted`;
  if (painted === undefined) return before ? "worked on before" : "not looked at yet";
  return "labelled, nothing painted";
}

window.overview = new Overview();
