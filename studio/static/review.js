// The panel of places to check: by doubt times area, most of it first; what to say of the one that is looked at.

import { h, icon, swatch } from "./dom.js";

export class Review {
  constructor(studio) {
    this.studio = studio;
    this.element = h("div", { className: "panel" });
    this.at = -1; // where in the list the last place was when it was chosen
    this.parts = new Map(); // how many places a place looks like, by version and id
  }

  render(state) {
    const { checks } = this.studio.places;
    if (this.studio.chosen !== this.last) {
      this.last = this.studio.chosen;
      this.at = checks.findIndex((check) => check.id === this.last);
    }
    const key = JSON.stringify([this.studio.placesVersion, this.studio.chosen, state.classes, !!state.relabelling, this.parts.size]);
    if (key === this.key) return;
    this.key = key;
    const total = checks.reduce((sum, check) => sum + check.doubtful_m2, 0);
    const next = h("button", { className: "button primary wide", type: "button", disabled: !checks.length }, "Next place", h("kbd", {}, "N"), icon("next"));
    next.addEventListener("click", () => this.next(1));
    const region = this.studio.places.byId.get(this.studio.chosen);
    const listed = checks.some((check) => check.id === this.studio.chosen);
    this.element.replaceChildren(
      h("section", {}, h("h2", {}, "Where to look"),
        h("p", { className: "small" }, checks.length
          ? `${total.toFixed(1)} m² are expected to be wrong, most of it in the first places.`
          : state.relabelling ? "No probabilities are known for these labels." : "The list appears once the map has been labelled.")),
      h("div", { className: "stay" }, next),
      region && !listed ? h("section", {}, h("h2", {}, region.name), this.#answers(region, null, state)) : "",
      h("ul", { className: "checks" }, checks.map((check, k) => this.#row(check, k, state))),
    );
  }

  #row(check, k, state) {
    const chosen = this.studio.chosen === check.id;
    const hall = check.is_likely_hall ? ", rather a hall" : "";
    const uncertain = `${Math.round(100 * check.doubt)} % uncertain`;
    const row = h("button", { className: "check", type: "button", "aria-expanded": String(chosen) },
      swatch(this.studio.colours.of(check.label)),
      h("b", {}, check.name),
      h("small", {}, `${uncertain}${check.second_label ? `, may be ${check.second_label}` : ""}${hall}`),
      h("span", { className: "amount" }, `${check.doubtful_m2.toFixed(1)} m²`));
    row.addEventListener("click", () => this.go(k));
    const region = this.studio.places.byId.get(check.id);
    const answers = chosen && region ? this.#answers(region, check.second_label, state) : null;
    return h("li", { className: chosen ? "chosen" : "" }, row, answers);
  }

  /** The one-key answers for a place. */
  #answers(region, second, state) {
    const { studio } = this;
    const confirm = h("button", { className: "button primary", type: "button" }, icon("check"), `Yes, ${region.class}`, h("kbd", {}, "C"));
    confirm.addEventListener("click", () => studio.confirm());
    const first = [confirm];
    const other = state.classes.findIndex((item) => item.name === second);
    if (other >= 0) {
      const button = h("button", { className: "button", type: "button" }, swatch(state.classes[other].colour), `No, ${second}`);
      button.addEventListener("click", () => studio.fillChosen(other));
      first.push(button);
    }
    const parts = this.#partsOf(region);
    if (parts > 1) {
      const title = `${region.name} could be ${parts} places`;
      const split = h("button", { className: "button", type: "button", title }, `Split into ${parts}`, h("kbd", {}, "A"));
      split.addEventListener("click", () => this.split());
      first.push(split);
    }
    const chips = state.classes.map((item, k) => {
      const chip = h("button", { className: "chip", type: "button", title: `It is a ${item.name}` }, swatch(item.colour), item.name, k < 9 ? h("kbd", {}, `⇧${k + 1}`) : null);
      chip.addEventListener("click", () => studio.fillChosen(k));
      return chip;
    });
    return h("div", { className: "answers" }, h("div", { className: "chips" }, first), h("div", { className: "chips" }, chips));
  }

  #partsOf(region) {
    const key = `${this.studio.placesVersion}.${region.id}`;
    if (!this.parts.has(key)) {
      this.parts.set(key, 1);
      this.#ask(key, region.id);
    }
    return this.parts.get(key);
  }

  async #ask(key, id) {
    const found = await this.studio.server.get("parts", { id }).catch(() => null);
    if (!found || found.parts < 2) return;
    this.parts.set(key, found.parts);
    this.key = null;
    this.studio.changed();
  }

  /** Split the chosen place into the places that it could be. */
  split() {
    const region = this.studio.places.byId.get(this.studio.chosen);
    if (region && this.#partsOf(region) > 1) this.studio.edit({ kind: "split", region: region.id });
  }

  next(step) {
    const { checks } = this.studio.places;
    if (!checks.length) return;
    // A place that was corrected has left for the end of the list, and another one has moved up.
    const stays = this.at < 0 || checks[this.at]?.id === this.studio.chosen;
    const k = stays || step < 0 ? this.at + step : this.at;
    this.go((k + 2 * checks.length) % checks.length);
  }

  go(k) {
    const check = this.studio.places.checks[k];
    this.studio.goTo(check.id);
    this.element.querySelector(".checks .chosen")?.scrollIntoView({ block: "nearest" });
  }
}
